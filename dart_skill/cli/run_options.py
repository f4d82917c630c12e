"""Options that several verbs share, those of the nodes too, and how they are checked. No ROS is
imported here.
"""

import argparse
import re
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from dart_skill.cli.names import CONFIGURATIONS

if TYPE_CHECKING:
    from dart_skill.skills.protocol import Skill

_T = TypeVar("_T")
GRAPHS = ("composed", "processes")
"""Layouts of the simulated graph."""
PARAMETER_FILES = ("skill_learner.yaml", "demonstration_recorder.yaml", "coach.yaml")
"""What a report shows besides the parameters that the bag holds."""
UNTOLD = ("help", "output", "json")
"""Options that change nothing about a run."""
FILES = (".png", ".svg", ".webp", ".html", ".json", ".csv", ".npz", ".mcap", ".db3", ".yaml")
"""Endings of files: no folder is meant to be called so."""
FROM_NOW_ON = "a file of 'dart-skill learn BAG': the learner plans with it from now on"
"""What becomes of a model, in words."""


def add_run(
    parser: argparse.ArgumentParser,
    demonstrations: int,
    throws: int,
    thrown: str,
    layouts: Sequence[str] = GRAPHS,
    also: str = "",
) -> None:
    """The options of a run that teaches and throws.

    Parameters
    ----------
    layouts
        Those that it has.
    also
        What there is to say of them.
    """
    parser.add_argument(
        "--seed", type=int, default=0, help="everything random comes from it (default 0)"
    )
    parser.add_argument(
        "--demonstrations",
        type=int,
        default=demonstrations,
        help=f"throws to be shown (default {demonstrations})",
    )
    parser.add_argument(
        "--throws", "--trials", type=int, default=throws, help=f"{thrown} (default {throws})"
    )
    what, verb = "bag, summary, report, pictures and logs", parser.prog.split()[-1]
    parser.add_argument(
        "--output", type=folder, help=f"folder for {what} (default output/{verb}_<date>)"
    )
    parser.add_argument(
        "--layout",
        choices=layouts,
        default="composed",
        help=f"processes of the graph{also} (default composed)",
    )
    add_arm(parser)


def positive(text: str) -> int:
    """A type of options that count: with none of them a table would be empty."""
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"{number}: give at least 1")
    return number


def add_configuration(parser: argparse.ArgumentParser, default: str) -> None:
    """Which of the skill's configurations is learned.

    Parameters
    ----------
    default
        In words.
    """
    text = f"of the skill: {', '.join(CONFIGURATIONS)} (default: {default})"
    parser.add_argument(
        "--configuration", default="", choices=CONFIGURATIONS, metavar="NAME", help=text
    )


def add_model(parser: argparse.ArgumentParser, text: str = FROM_NOW_ON) -> None:
    """A model that was learned before."""
    parser.add_argument("--model", type=Path, metavar="FILE", help=text)


def check_model(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """A usage error for a model that is no file, before anything is started."""
    if options.model is not None and not options.model.is_file():
        parser.error(
            f"--model {options.model}: there is no such file; 'dart-skill learn BAG' writes one"
        )


def _made(parser: argparse.ArgumentParser, make: Callable[[], _T]) -> _T:
    """What is made of values that a user gave; a usage error for a value that cannot be, but not
    where a file of config/ is broken.
    """
    from dart_skill.common.entries import ConfigurationError

    try:
        return make()
    except ConfigurationError:
        raise
    except ValueError as error:
        parser.error(str(error))


def chosen_skill(
    parser: argparse.ArgumentParser, name: str, settings: Sequence[str] = ()
) -> "Skill":
    """The skill of that name; a usage error lists those that there are.

    Parameters
    ----------
    settings
        Values of --set, of which those of the node "skill" are settings of the skill.
    """
    from dart_skill.common.fleet import skill_settings
    from dart_skill.skills.protocol import load_skill

    return _made(parser, lambda: load_skill(name, changes=skill_settings(settings)))


def add_namespace(
    parser: argparse._ActionsContainer,
    text: str = "of the graph, where several arms share a ROS domain, as /arm1 (default: none)",
) -> None:
    """Which of several graphs of a ROS domain is meant."""
    parser.add_argument("--namespace", type=_namespace, default="", metavar="NAME", help=text)


def _namespace(text: str) -> str:
    """With the slash before it, and none after it."""
    name = f"/{text.strip('/')}".rstrip("/")
    if not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)*", name) or "__" in name:
        raise argparse.ArgumentTypeError(
            f"'{text}' is no ROS namespace: letters, digits and single underscores, as /arm1"
        )
    return name


def remapping(text: str) -> str:
    """A topic under another name, as the nodes take it: old=new, from /old:=/new."""
    old, _, new = text.partition(":=")
    if not (old and new):
        raise argparse.ArgumentTypeError(f"'{text}': write it as /old:=/new")
    return f"{old}={new}"


def add_arm(parser: argparse.ArgumentParser) -> None:
    """What stands in for hardware."""
    parser.add_argument(
        "--arm",
        default="ideal",
        help="an arm of config/fleet.yaml, or fleet:SEED for one drawn from it (default ideal)",
    )
    add_settings(parser)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Parameters of nodes, and settings of the skill, that differ."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help=(
            "a parameter of a node, or skill.NAME=VALUE, a setting of the skill; may be given several"
            " times"
        ),
    )


def differences(parser: argparse.ArgumentParser, options: argparse.Namespace) -> dict[str, dict]:
    """Parameters by node in which --arm and --set differ from config/; a usage error names what
    does not exist.
    """
    from dart_skill.common.fleet import arm_with, of_nodes
    from dart_skill.common.world import the_world

    differs = _made(parser, lambda: arm_with(options.arm, options.set))
    if len(of_nodes(options.set)) < len(options.set):
        chosen_skill(parser, getattr(options, "skill", "") or the_world().skill, options.set)
    return differs


def add_baskets(parser: argparse.ArgumentParser, count: int | None) -> None:
    """Where baskets are put, one by one or over the region.

    Parameters
    ----------
    count
        None where a real arm throws at the basket that is seen.
    """
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--at",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="centre of the rim, from the base of the arm [m]",
    )
    default = (
        f"default {count}"
        if count
        else "default: one, with a real arm the one that the cameras see"
    )
    where.add_argument(
        "--count",
        type=int,
        default=count,
        metavar="N",
        help=f"so many baskets over the region ({default})",
    )
    parser.add_argument("--seed", type=int, default=0, help="of where they are (default 0)")


def check_run(
    parser: argparse.ArgumentParser, options: argparse.Namespace, demonstrations: int = 2
) -> None:
    """Usage errors of the options of a run; sets its output folder.

    Parameters
    ----------
    demonstrations
        Least number of them.
    """
    for name, value, least in (
        ("seed", options.seed, 0),
        ("demonstrations", options.demonstrations, demonstrations),
        ("throws", options.throws, 1),
    ):
        if value < least:
            parser.error(f"--{name} is {value}; it must be at least {least}")
    options.differs = differences(parser, options)
    options.output = output_folder(parser, options.output)
    if (options.output / "bag").exists():
        parser.error(f"--output {options.output} holds a bag already: choose another folder")


def folder(name: str) -> Path:
    """Type of an argument: a folder that is filled, there already or not; a usage error for what
    is, or is called like, a file.
    """
    chosen = Path(name)
    if chosen.is_file() or chosen.suffix.lower() in FILES:
        raise argparse.ArgumentTypeError(
            f"{name}: what is written fills a folder; this is the name of a file"
        )
    return chosen


def output_folder(parser: argparse.ArgumentParser, chosen: Path | None) -> Path:
    """The chosen folder, or output/VERB_<date>."""
    return (
        chosen or Path("output") / f"{parser.prog.split()[-1]}_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    ).resolve()


def asked(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[tuple]:
    """Name, value and default of every option that a run depends on."""
    names = [action.dest for action in parser._actions if action.dest not in UNTOLD]
    return [
        (name.replace("_", "-"), getattr(options, name), parser.get_default(name))
        for name in names
    ]


def parameter_texts() -> dict[str, str]:
    """The parameter files in force that no bag holds."""
    from dart_skill.common.configuration import config_path

    return {name: config_path(name).read_text(encoding="utf-8") for name in PARAMETER_FILES}
