"""The options of the commands that run nodes: `dart-skill up`, `demo`, `practice`, `teach`, `learn` and `throw`.

No ROS is imported here, so that help, usage errors and completion with TAB need none and come at once. What an option must not be is
checked where it is used.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

from dart_skill.names import CHANGES, PRACTICE_METHODS
from dart_skill_nodes.graph import LAYOUTS, SIMULATED


def up(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill up`."""
    parser.description = "The node graph, started, watched and ended in order; it stays until Ctrl-C."
    parser.add_argument("--layout", choices=list(LAYOUTS), help="what is started (default composed; replay with --play)")
    parser.add_argument("--seed", type=int, default=0, help="everything random in the simulation comes from it (default 0)")
    parser.add_argument("--play", type=Path, metavar="BAG", help="bag of a replay")
    parser.add_argument("--rate", type=float, default=1.0, help="of a replay; 0: as fast as can be (default 1)")
    parser.add_argument("--viewer", action="store_true", help="the live view, too")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="every topic into a bag, too")
    parser.add_argument("--output", type=Path, help="folder for logs and the bag of demonstrations (default output/up_<date>)")
    parser.add_argument("--json", action="store_true", help="each event as a line of JSON")


def demo(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill demo`."""
    parser.description = "The main job over the real graph: a teacher shows throws, the skill is learned, the arm throws at new baskets."
    _add_run(parser, demonstrations=13, throws=10, thrown="new baskets to throw at", output="demo")
    parser.add_argument("--json", action="store_true", help="summary.json on stdout instead of the table")
    parser.add_argument("--configuration", default="", help="of the skill (default: that of config/skill_learner.yaml)")


def practice(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill practice`."""
    parser.description = "Practice over the real graph: a few demonstrations, then throw after throw, each of which the arm learns from."
    _add_run(parser, demonstrations=3, throws=20, thrown="own throws", output="practice")
    methods = [name for name in PRACTICE_METHODS if name != "power"]
    parser.add_argument("--method", choices=methods, help="default: of config/skill_learner.yaml")
    parser.add_argument("--change", choices=sorted(CHANGES), default="none", help="what happens to the arm, unannounced (default none)")
    parser.add_argument("--change-after", type=int, default=5, metavar="N", help="own throws before the change (default 5)")
    parser.add_argument("--json", action="store_true", help="every throw as JSON on stdout instead of the table")


def teach(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill teach`."""
    parser.description = "Throws that a person guides, on a graph that runs (`dart-skill up`); at new baskets for those that miss."
    _add_baskets(parser, 13)


def learn(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill learn` without a bag."""
    parser.description = "A skill from the demonstrations that were published since the learner was started."
    parser.add_argument("--configuration", default="", help="of the skill (default: that of config/skill_learner.yaml)")
    parser.add_argument("--at-least", type=int, default=0, metavar="N", help="wait for so many demonstrations")
    _add_json(parser)


def throw(parser: argparse.ArgumentParser) -> None:
    """Options of `dart-skill throw`."""
    parser.description = "Throws of the arm at baskets that are put there, on a graph that runs (`dart-skill up`)."
    _add_baskets(parser, 1)


OPTIONS: dict[str, Callable[[argparse.ArgumentParser], None]] = {one.__name__: one for one in (up, demo, practice, teach, throw)}
"""What gives the parser of each command its options; `dart-skill learn` has the library's, which learns from bags, too."""


def parser_of(command: str) -> argparse.ArgumentParser:
    """The parser of one of the commands by itself."""
    parser = argparse.ArgumentParser(prog=f"dart-skill {command}")
    OPTIONS[command](parser)
    return parser


def _add_run(parser: argparse.ArgumentParser, demonstrations: int, throws: int, thrown: str, output: str) -> None:
    """The options of a run that starts a graph, teaches it and throws."""
    parser.add_argument("--seed", type=int, default=0, help="everything random comes from it (default 0)")
    parser.add_argument("--demonstrations", type=int, default=demonstrations, help=f"throws to be shown (default {demonstrations})")
    parser.add_argument("--throws", type=int, default=throws, help=f"{thrown} (default {throws})")
    what = "bag, summary, report, pictures and logs"
    parser.add_argument("--output", type=Path, help=f"folder for {what} (default output/{output}_<date>)")
    parser.add_argument("--layout", choices=SIMULATED, default="composed", help="processes of the graph (default composed)")


def _add_baskets(parser: argparse.ArgumentParser, count: int) -> None:
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--at", type=float, nargs=3, metavar=("X", "Y", "Z"), help="centre of the rim, from the base of the arm [m]")
    where.add_argument("--count", type=int, default=count, metavar="N", help=f"so many baskets over the region (default {count})")
    parser.add_argument("--seed", type=int, default=0, help="of where they are (default 0)")
    _add_json(parser)


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="the result as JSON")
