"""The command line `dart-skill`. Each verb is one file with its options, its work and its output.

A verb's `add_to(commands)` adds its parser, and sets what runs it. Whatever takes long to import
is imported when the verb runs, so that help, usage errors and completion with TAB come at once.
"""

import atexit
import gc
import signal
import threading


def main(arguments: list[str] | None = None) -> int:
    """Entry point.

    Returns
    -------
    int
        The exit status.
    """
    if arguments is None:  # this process is the command's own
        _seldom_look_for_garbage()
    loads = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    # Ctrl-C ends it, as it ends any program, instead of a traceback from the middle of an import
    if loads:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from dart_skill.cli._main import main as run
    finally:
        if loads:
            signal.signal(signal.SIGINT, signal.default_int_handler)
    return run(arguments)


def _seldom_look_for_garbage() -> None:
    """A command makes many objects that stay, and is over soon: to look through them again and
    again took a fifth of its time.
    """
    gc.set_threshold(50_000, 20, 20)
    # or the interpreter looks through all of them once more before it ends
    atexit.register(gc.freeze)


__all__ = ["main"]
