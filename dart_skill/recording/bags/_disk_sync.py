"""Getting files to the disk, beyond the operating system's cache, without waiting for it: fdatasync in a thread."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from io import FileIO
from pathlib import Path

PAUSE_SECONDS = 0.2  # between two syncs of files that are asked for without pause


class DiskSync:
    """A thread that syncs files when asked to; the newest request covers those before it.

    on_error: called in the thread with the OSError of a sync, once; nothing is synced after it.
    """

    def __init__(self, on_error: Callable[[OSError], None]):
        self._on_error, self._error = on_error, None
        self._changed = threading.Condition()
        self._waiting: list[tuple[FileIO, bool]] = []  # file, and whether to close it
        self._known: set[str] = set()  # files whose name is on the disk
        self._busy, self._hurry, self._stopped = False, False, False
        self._thread = threading.Thread(target=self._run, name="bag sync", daemon=True)
        self._thread.start()

    def request(self, file: FileIO, close: bool = False) -> None:
        """Sync what `file` holds now, soon; close: and close it then."""
        with self._changed:
            if close or all(file is not other for other, _ in self._waiting):
                self._waiting = [(other, its_close) for other, its_close in self._waiting if other is not file]
                self._waiting.append((file, close))
            self._changed.notify_all()

    def wait(self) -> None:
        """Return when all that was asked for is on the disk, or has failed (`on_error` was called then)."""
        with self._changed:
            self._hurry = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._busy and (not self._waiting or self._error is not None or self._stopped))
            self._hurry = False

    def stop(self) -> None:
        """Do what was asked for and end the thread."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._stopped)
                if not self._waiting:
                    return
                work, self._waiting, self._busy = self._waiting, [], True
            self._sync(work)
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._hurry or self._stopped, timeout=PAUSE_SECONDS)

    def _sync(self, work: list[tuple[FileIO, bool]]) -> None:
        for file, close in work:
            try:
                if self._error is None:
                    os.fdatasync(file.fileno())
                    if file.name not in self._known:
                        sync_folder(Path(file.name).parent)
                        self._known.add(file.name)
            except OSError as error:
                self._error = error
                self._on_error(error)
            if close:
                with suppress(OSError):
                    file.close()


def sync_folder(path: Path) -> None:
    """Get the names of the files in a folder to the disk; without them no power cut leaves the files."""
    with suppress(OSError):  # some file systems sync no folders, and need none to
        folder = os.open(path, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
