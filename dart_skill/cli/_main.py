"""`dart-skill`: nouns and verbs; results on stdout, progress on stderr; exit status 0, 1 (failed),
2 (usage), 130 or 143 (ended by Ctrl-C or SIGTERM).
"""

import argparse
import atexit
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from importlib import import_module
from types import FrameType
from typing import NoReturn

from dart_skill import __version__
from dart_skill.cli import _completion, graph_verbs
from dart_skill.cli.printable import in_a_line
from dart_skill.common.configuration import ARM_VARIABLE, arm_names
from dart_skill.common.extras import explained

TAB = (
    "With TAB, bash and zsh complete commands, options and values: source tools/env.sh, or"
    " tools/completion.bash (.zsh) alone."
)

OF_THE_NODES = ("up", "status", "practice", "teach", "demonstrations", "throw", "execute")
COMMANDS = (
    "up", "status", "demo", "practice", "teach", "demonstrations", "check", "arm", "learn", "throw", "execute", "bag", "view", "report",
    "experiment", "darts", "security",
)  # fmt: skip
"""In the order of the help: those of the nodes (`graph_verbs`), and modules of this package."""


def main(arguments: list[str] | None = None) -> int:
    """Entry point.

    Returns
    -------
    int
        The exit status.
    """
    try:
        if _completion.is_asked():
            return _completion.answer(_parser())
        if arguments is None:
            atexit.register(_keep_status)  # before packages register what must be done earlier
        words = _with_arm_chosen(sys.argv[1:] if arguments is None else arguments)
        parser = _parser(words)
        options, unknown = parser.parse_known_args(words)
        if unknown and not options.takes_anything:
            command = _completion.command_of(parser, words)
            command.error(
                f"unrecognized arguments: {' '.join(unknown)}{_option(command, unknown)}"
            )
        with _ends_in_order():
            status = options.run(options)
            sys.stdout.flush()
            return status
    except KeyboardInterrupt:
        print("dart-skill: stopped", file=sys.stderr)
        _stopped.set()
        return 128 + signal.SIGINT
    except BrokenPipeError:  # `dart-skill ... | head`: the reader has gone, and the interpreter would complain about it at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except ImportError as error:
        print(f"dart-skill: {in_a_line(explained(error))}", file=sys.stderr)
        return 1
    except (ValueError, OSError) as error:
        print(f"dart-skill: {in_a_line(str(error) or type(error).__name__)}", file=sys.stderr)
        return 1


def _with_arm_chosen(words: list[str]) -> list[str]:
    """The words without an arm of config/arms/ that --arm names, which counts for this process and
    all that it starts. What follows its name after a colon is an arm of config/fleet.yaml.
    """
    for k, word in enumerate(words):
        option, equals, value = word.partition("=")
        if option not in ("--arm", "--arms") or not (equals or k + 1 < len(words)):
            continue
        name, _, variant = (value if equals else words[k + 1]).partition(":")
        if name in arm_names() or name.endswith(".yaml"):
            os.environ[ARM_VARIABLE] = name
            rest = words[k + 1 if equals else k + 2 :]
            return [*words[:k], *([option, variant] if variant else []), *rest]
    return words


_stopped = threading.Event()
"""By Ctrl-C."""


def _keep_status() -> None:
    """Python would send itself a Ctrl-C at its end, in place of its status, if the one that came
    met it in a text that it carried out, as dataclasses do while packages load.
    """
    if _stopped.is_set():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(128 + signal.SIGINT)


@contextmanager
def _ends_in_order() -> Iterator[None]:
    """SIGTERM ends what runs as Ctrl-C does, so that nothing of it is left, and a Ctrl-C is one
    whatever becomes of it while packages load; verbs of the nodes have handlers of their own.
    """
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL
    ):
        yield
        return
    usual, interrupted = signal.getsignal(signal.SIGINT), threading.Event()

    def interrupt(number: int, frame: FrameType | None) -> None:
        interrupted.set()
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGTERM, _end)
    if usual is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except ImportError as error:
        if interrupted.is_set():  # some packages make a broken installation of it
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        if usual is signal.default_int_handler:
            signal.signal(signal.SIGINT, usual)


def _end(number: int, _: object) -> None:
    raise SystemExit(128 + number)


def _parser(words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Parser of all commands; if words begin with one, of this one alone, as each takes some
    milliseconds.
    """
    parser = _Parser(
        prog="dart-skill",
        description="A robot arm that learns to throw from demonstrations.",
        epilog=TAB,
    )
    parser.add_argument("--version", action="version", version=f"dart-skill {__version__}")
    parser.set_defaults(takes_anything=False)
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for name in words[:1] if words and words[0] in COMMANDS else COMMANDS:
        if name in OF_THE_NODES:
            graph_verbs.add_to(commands, name)
        else:
            import_module(f"dart_skill.cli.{name}").add_to(commands)
    return parser


class _Parser(argparse.ArgumentParser):
    """Parser of all commands. Where a command is missing, it says which there are; where one is
    misspelt, which one may be meant.
    """

    def error(self, message: str) -> NoReturn:
        if message.startswith("the following arguments are required") and _completion.verbs_of(
            self
        ):
            self.print_help(sys.stderr)
            self.exit(2)
        super().error(message + _meant(message))


def _meant(message: str) -> str:
    """What may be meant in place of a choice that argparse refuses in a message."""
    refused = re.search(r"invalid choice: '?([^' ]*)'? \(choose from (.*)\)", message)
    return _nearest(refused[1], refused[2].replace("'", "").split(", ")) if refused else ""


def _option(command: argparse.ArgumentParser, unknown: Sequence[str]) -> str:
    """What may be meant in place of the first option that a command does not have."""
    typed = next((word.partition("=")[0] for word in unknown if word.startswith("--")), "")
    return _nearest(typed, list(command._option_string_actions)) if typed else ""


def _nearest(typed: str, known: Sequence[str]) -> str:
    near = get_close_matches(typed, known, n=1)
    return f"; did you mean '{near[0]}'?" if near else ""
