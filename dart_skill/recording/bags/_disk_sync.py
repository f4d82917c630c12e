"""Getting files to the disk, beyond the operating system's cache, without waiting for it:
fdatasync in a thread.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from io import FileIO
from pathlib import Path
from threading import Event

PAUSE_SECONDS = 0.2  # between two syncs of files that are asked for without pause


class DiskSync:
    """A thread that syncs files when asked to; what is asked for twice before it begins is done
    once.

    on_error: called in the thread with the OSError of a sync, once; nothing is synced after it.
    """

    def __init__(self, on_error: Callable[[OSError], object]):
        from concurrent.futures import (
            ThreadPoolExecutor,
        )  # takes longer to import than all of bags, and who reads needs none

        self._on_error, self._failed = on_error, False
        self._thread = ThreadPoolExecutor(1, "bag sync")
        self._waiting: set[FileIO] = set()
        self._known: set[str] = set()  # files whose name is on the disk
        self._hurry = Event()

    def request(self, file: FileIO, close: bool = False) -> None:
        """Sync what `file` holds now, soon; close: and close it then."""
        if close or file not in self._waiting:
            self._waiting.add(file)
            self._thread.submit(self._sync, file, close)

    def wait(self) -> None:
        """Return when all that was asked for is on the disk, or has failed (`on_error` was called
        then).
        """
        self._hurry.set()
        self._thread.submit(lambda: None).result()
        self._hurry.clear()

    def stop(self) -> None:
        """Do what was asked for and end the thread."""
        self._hurry.set()
        self._thread.shutdown()

    def _sync(self, file: FileIO, close: bool) -> None:
        self._waiting.discard(
            file
        )  # before it is synced: what is written from now on needs another request
        try:
            if not self._failed:
                os.fdatasync(file.fileno())
                if file.name not in self._known:
                    sync_folder(Path(file.name).parent)
                    self._known.add(file.name)
        except OSError as error:
            self._failed = True
            self._on_error(error)
        if close:
            with suppress(OSError):
                file.close()
        self._hurry.wait(PAUSE_SECONDS)


def sync_folder(path: Path) -> None:
    """Get the names of the files in a folder to the disk; without them no power cut leaves the
    files.
    """
    with suppress(OSError):  # some file systems sync no folders, and need none to
        folder = os.open(path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
