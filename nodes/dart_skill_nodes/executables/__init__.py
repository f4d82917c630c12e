"""The nodes: one module each, which `ros2 run dart_skill` starts by its name."""

import gc
import os
import signal
import sys
from pathlib import Path
from types import TracebackType


def _is_program() -> bool:
    """Whether this process is one of them, started from lib/dart_skill as `ros2 run` and `ros2
    launch` do.
    """
    program = Path(sys.argv[0])
    return (
        program.parent.name == "dart_skill"
        and Path(__file__).with_name(f"{program.name}.py").is_file()
    )


def _say(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """A line for a broken file of config/, which the library reads while it is imported, before
    `run` could say so.
    """
    if kind.__name__ == "ConfigurationError":  # nothing of ours is imported here
        print(f"{Path(sys.argv[0]).stem}: {error}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


# what Python calls a program of `python3 -m` while it looks for it
if _is_program() or sys.argv[:1] == ["-m"]:
    # nearly all that is imported stays, and to look through it takes a tenth of the time; `run`
    # takes up the search again
    gc.disable()
if _is_program() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    # a node that is told to end while it still loads ends, instead of a traceback from the middle
    # of an import; `run` takes over
    signal.signal(signal.SIGINT, lambda *_: os._exit(0))
if _is_program() or sys.argv[:1] == ["-m"]:
    sys.excepthook = _say
