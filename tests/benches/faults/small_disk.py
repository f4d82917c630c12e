"""A disk that is full when it shall be: a file system of a few megabytes in memory, or where that
needs rights that one has not, a limit on how long the files of a process may become.
"""

import resource
import subprocess
from pathlib import Path

SIZE = "24m"
"""What a recorder writes until the disk is filled: some seconds of all topics."""
FILLER = "filler"


class SmallDisk:
    """A folder on a disk of its own. is_real: whether that could be had."""

    def __init__(self, folder: Path):
        self.folder = folder
        folder.mkdir(parents=True)
        mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
        try:
            self.is_real = subprocess.run(mount, capture_output=True, timeout=10).returncode == 0
        except OSError:
            self.is_real = False

    def fill(self, process: int) -> None:
        """From now on nothing fits on it any more; process: who writes to it."""
        if not self.is_real:
            resource.prlimit(process, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
            return
        with (self.folder / FILLER).open("wb", buffering=0) as filler:
            for size in (1 << 20, 1 << 12, 1):
                _fill(filler, size)

    def free(self) -> None:
        """There is room again."""
        (self.folder / FILLER).unlink(missing_ok=True)

    def close(self) -> None:
        """Take the disk away with what is on it."""
        if self.is_real:
            subprocess.run(["umount", "--lazy", str(self.folder)], capture_output=True, timeout=10)
            self.is_real = False


def _fill(filler, size: int) -> None:
    try:
        while filler.write(bytes(size)) == size:
            pass
    except OSError:
        return
