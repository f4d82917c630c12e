"""Work at the end of a command without a search for garbage."""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Without a search for garbage: nearly all that a page makes lives until its end, and to look through it takes a tenth of the time."""
    collects = gc.isenabled()
    atexit.register(gc.freeze)  # nor once more at the very end of the process
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
