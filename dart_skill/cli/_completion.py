"""Completion with TAB: commands, options and their values, through argcomplete, with which `ros2`
and `colcon` complete, too.

The shell's part is tools/completion.bash and tools/completion.zsh: they run `dart-skill` with the
line in COMP_LINE, and it prints what may follow. Nothing of a command is imported for that but its
parser.
"""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from dart_skill.cli import names
from dart_skill.cli.run_options import folder

BAG_SUFFIXES = (".mcap", ".db3", ".bag")
LISTS: dict[str, dict[str, Sequence[str]]] = {
    "experiment throws": {"configurations": names.CONFIGURATIONS},
    "experiment basket": {"models": names.CONFIGURATIONS},
    "experiment attempts": {"methods": names.PRACTICE_METHODS},
    "experiment practice": {"methods": names.PRACTICE_METHODS, "changes": names.CHANGES},
    "experiment landscapes": {"methods": names.SEARCHES, "schedules": names.LANDSCAPES},
    "experiment search": {"methods": names.SEARCHES, "schedules": names.SCHEDULES},
    "darts search": {"methods": names.SEARCHES, "schedules": names.SCHEDULES},
}
"""Options that take names separated by commas, by command."""
WORDS: dict[str, Sequence[str]] = {
    "configuration": names.CONFIGURATIONS,
    "number": ("list", "all", *names.FIGURES),
}
"""Options and arguments that take one name, and have no choices in their parser because they say
more than that about a wrong one.
"""


def is_asked() -> bool:
    """Whether the shell wants to know how a line may go on, instead of running a command."""
    return "_ARGCOMPLETE" in os.environ


def _words() -> list[str]:
    """What was typed after `dart-skill`, roughly: enough to know the command."""
    return os.environ.get("COMP_LINE", "").split()[1:]


def answer(parser: argparse.ArgumentParser) -> int:
    """Print what may follow, and end; status 1 where argcomplete is not installed or does not know
    how to go on.
    """
    try:
        argcomplete = importlib.import_module("argcomplete")
    except ImportError:
        return 1
    for command in commands_of(parser):
        for action in command._actions:
            complete_with(action, command.prog.removeprefix(parser.prog).strip())
    bare = not _takes_words(command_of(parser, _words()))
    argcomplete.autocomplete(
        parser, always_complete_options=bare, exclude=["-h"], default_completer=_nothing
    )
    return 1


def commands_of(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parser, and those of all its commands and verbs."""
    yield parser
    for verb in verbs_of(parser).values():
        yield from commands_of(verb)


def complete_with(action: argparse.Action, command: str) -> None:
    """Give an option or argument what completes its value: names, or paths of the kind that its
    metavar tells; choices do by themselves.
    """
    completer: Callable[..., Sequence[str]] | None = None
    if action.choices is not None or action.nargs == 0:
        return
    if action.dest in LISTS.get(command, {}):
        completer = _separated_by_commas(LISTS[command][action.dest])
    elif action.dest in WORDS:
        completer = _one_of(WORDS[action.dest])
    elif action.metavar in ("BAG", "SOURCE"):
        completer = _paths(BAG_SUFFIXES)
    elif (
        action.metavar == "FOLDER"
        or action.type is folder
        or (action.type is Path and action.metavar is None)
    ):
        completer = _paths(())
    elif action.type is Path or action.metavar == "FILE":
        completer = _paths(None)
    if completer is not None:
        action.completer = completer  # type: ignore[attr-defined]  # where argcomplete looks for it


def verbs_of(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The commands of a command, by name; empty for one that has none."""
    groups = [
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    ]
    return dict(groups[0].choices) if groups else {}


def command_of(parser: argparse.ArgumentParser, typed: Sequence[str]) -> argparse.ArgumentParser:
    """That which words name, as far as they do."""
    verbs = verbs_of(parser)
    return command_of(verbs[typed[0]], typed[1:]) if typed and typed[0] in verbs else parser


def _takes_words(parser: argparse.ArgumentParser) -> bool:
    """Whether there is more than options to complete: those then come after a dash only."""
    return any(not action.option_strings for action in parser._actions)


def _nothing(**_: Any) -> tuple[str, ...]:
    """A number, say: not the files of the folder, which are the shell's guess."""
    return ()


def _one_of(known: Sequence[str]) -> Callable[..., Sequence[str]]:
    return lambda **_: known


def _separated_by_commas(known: Sequence[str]) -> Callable[..., list[str]]:
    def complete(prefix: str, **_: Any) -> list[str]:
        given = prefix.split(",")[:-1]
        return [",".join([*given, name]) for name in known if name not in given]

    return complete


def _paths(suffixes: tuple[str, ...] | None) -> Callable[..., list[str]]:
    """Folders, and files with one of the suffixes; all files for None. A hidden one only after its
    dot.
    """

    def complete(prefix: str, **_: Any) -> list[str]:
        folder, begun = os.path.split(prefix)
        found = []
        try:
            for entry in os.scandir(os.path.expanduser(folder) or "."):
                if not entry.name.startswith(begun) or entry.name.startswith(
                    "."
                ) > begun.startswith("."):
                    continue
                if entry.is_dir():
                    found.append(os.path.join(folder, entry.name, ""))
                elif suffixes is None or entry.name.endswith(suffixes or ("/",)):
                    found.append(os.path.join(folder, entry.name))
        except OSError:
            return []
        return sorted(found)

    return complete
