"""`dart-skill learn`: a model from a recording alone, ours or another laboratory's."""

from __future__ import annotations

import argparse
import importlib.util
import json
import shlex
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli import graph_verbs
from dart_skill.cli.mapping_option import add_mapping, settle_mapping
from dart_skill.cli.printable import printable, tell_bag_faults
from dart_skill.cli.run_options import add_configuration, add_namespace
from dart_skill.common.constants import REMEMBERED
from dart_skill.common.words import counted
from dart_skill.common.world import THROW

if TYPE_CHECKING:
    from dart_skill.recording.lerobot import LeRobotDataset
    from dart_skill.session import LearnReport
    from dart_skill.skills.observation import FoundThrow
    from dart_skill.skills.practice import PractisingSkill
    from dart_skill.skills.protocol import Skill

NEXT = ("next: dart-skill up{} --model {}", "next: dart-skill demo{} --model {}")
"""What uses a model: a graph, with the arm that there is, and throws in simulation."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `learn` to the commands of `dart-skill`."""
    parser = commands.add_parser(
        "learn",
        help="a model from a recording alone, or on a graph that runs, from what it was shown",
    )
    text = (
        "rosbag2 folder, .mcap or .db3 file, folder with CSV files, or LeRobot dataset; none: the"
        " learner of the graph that runs learns"
    )
    parser.add_argument("bag", metavar="BAG", type=Path, nargs="?", help=text)
    add_mapping(parser)
    parser.add_argument(
        "--output",
        metavar="MODEL",
        type=Path,
        help=(
            "model file to write (default <name of the bag>_model.npz; of a demo's the name of its"
            " run)"
        ),
    )
    way = parser.add_mutually_exclusive_group()
    way.add_argument(
        "--raw", action="store_true", help="find the throws in the recorded poses (default)"
    )
    way.add_argument(
        "--demonstrations-topic",
        action="store_true",
        help="take what the recorder published on /demonstrations instead",
    )
    parser.add_argument(
        "--with-throws",
        action="store_true",
        help="learn from misses and from the arm's own throws, too",
    )
    text = (
        "leave this demonstration out, named by its id or its number in the list; may be given"
        " several times (those that were dropped are left out anyway)"
    )
    parser.add_argument("--without", metavar="ID", action="append", default=[], help=text)
    parser.add_argument(
        "--remember",
        type=int,
        metavar="N",
        help=(
            "learn from at most so many throws of a bag, those that cover the region best"
            f" (default {REMEMBERED}; 0: all)"
        ),
    )
    add_configuration(parser, "default; on a graph that of its learner")
    parser.add_argument(
        "--at-least", type=int, metavar="N", help="without BAG: wait for so many demonstrations"
    )
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="what was found and learned as JSON")
    parser.set_defaults(run=_learn, run_on_graph=graph_verbs.runner("learn", parser))


def _learn(options: argparse.Namespace) -> int:
    if options.bag is None:
        _refuse_what_needs_a_bag(options)
        return options.run_on_graph(options)
    from dart_skill.recording import skill_of
    from dart_skill.recording.imports import fault_lines, load_mapping
    from dart_skill.recording.lerobot import is_dataset
    from dart_skill.session import NothingLearned, learn_from_bag
    from dart_skill.skills.learning import save_model
    from dart_skill.skills.protocol import load_skill

    if options.at_least is not None:
        raise ValueError(
            "--at-least waits for demonstrations on a graph that runs: leave out BAG, or this"
        )
    if options.demonstrations_topic and (options.mapping or options.with_throws):
        raise ValueError(
            "--demonstrations-topic takes the demonstrations as they are: leave out --mapping and"
            " --with-throws"
        )
    output = options.output or file_for(options.bag)
    if output.exists():
        raise ValueError(f"{output} exists already: name another file with --output")
    if is_dataset(options.bag):
        return _learn_dataset(options, output)
    settle_mapping(options, options.bag, file_for(options.bag).stem.removesuffix("_model"))
    if not options.mapping:
        kind = load_skill(skill_of(options.bag))
        if options.demonstrations_topic or not kind.cuts_itself:
            return _learn_skill(options, kind, output)
    mapping = load_mapping(options.mapping) if options.mapping else None
    wanted = {"with_throws": options.with_throws, "without": options.without}
    wanted["remember"] = REMEMBERED if options.remember is None else options.remember
    try:
        skill, report = learn_from_bag(
            options.bag, mapping, options.configuration or "default", **wanted
        )
    except NothingLearned as error:
        print(*map(printable, fault_lines(error.report.faults)), sep="\n", file=sys.stderr)
        raise
    origin = {"clocks": report.clocks} if report.clocks else None
    save_model(output, list(report.learned_from), skill.skill.configuration, origin=origin)
    print(
        json.dumps(_as_json(skill, report, output), indent=1)
        if options.json
        else printable(_as_text(skill, report, output))
    )
    return 0


def file_for(bag: Path) -> Path:
    """Where a model goes that was learned from a bag: by its name, or by that of its folder, as
    the bag of each demo is called `bag`.
    """
    bag = bag.resolve()
    return Path(f"{(bag.parent if bag.name == 'bag' and bag.parent.name else bag).stem}_model.npz")


def _learn_dataset(options: argparse.Namespace, output: Path) -> int:
    """Any skill, from the episodes of a dataset of LeRobot."""
    from dart_skill.session import open_dataset, skill_of_dataset

    of_bags = {
        "--mapping": options.mapping,
        "--demonstrations-topic": options.demonstrations_topic,
        "--with-throws": options.with_throws,
    }
    of_bags["--remember"] = options.remember is not None
    if given := [name for name, value in of_bags.items() if value]:
        raise ValueError(
            f"{given[0]} is for bags: {options.bag} is a dataset of LeRobot, whose episodes are"
            " the demonstrations"
        )
    dataset = open_dataset(options.bag)
    return _learn_skill(options, skill_of_dataset(dataset), output, dataset)


def _learn_skill(
    options: argparse.Namespace, skill: Skill, output: Path, dataset: LeRobotDataset | None = None
) -> int:
    """Any skill, from the demonstrations that a recorder cut, or from a dataset."""
    from dart_skill.session import learn_skill

    given = {
        "--with-throws": options.with_throws,
        "--remember": options.remember is not None,
        "--configuration": options.configuration and not skill.configurations,
    }
    for option in (name for name, value in given.items() if value):
        raise ValueError(
            f"{option} is for throws that are found in a recording: {options.bag} has demonstrations"
            f" of the skill '{skill.name}'"
        )
    if dataset is None:
        tell_bag_faults(options.bag)
    source = options.bag if dataset is None else dataset
    learner, lesson = learn_skill(source, skill, options.configuration or "", options.without)
    learner.save(output)
    told = {
        "skill": skill.name,
        "learned_from": lesson.learned_from,
        "left_out": dict(lesson.left_out),
        "facts": lesson.facts,
        "model_id": lesson.model_id,
        "model": str(output),
    }
    lines = [f"{one}: left out: {why}" for one, why in lesson.left_out.items()]
    learned = f"learned '{skill.name}' from {counted(len(lesson.learned_from), 'demonstration')}"
    lines.append("; ".join([learned, *lesson.facts]))
    lines += [f"model {lesson.model_id}: {output}", *_next(skill.name, output)]
    print(json.dumps(told, indent=1) if options.json else "\n".join(lines))
    return 0


def _refuse_what_needs_a_bag(options: argparse.Namespace) -> None:
    of_bags = {
        "--mapping": options.mapping,
        "--output": options.output,
        "--raw": options.raw,
        "--demonstrations-topic": options.demonstrations_topic,
        "--with-throws": options.with_throws,
        "--remember": options.remember is not None,
    }
    for name, given in of_bags.items():
        if given:
            raise ValueError(f"{name} is for learning from a BAG: name one, or leave it out")


def _as_text(skill: PractisingSkill, report: LearnReport, output: Path) -> str:
    from dart_skill.recording.imports import fault_lines
    from dart_skill.skills.learning import strained_in_words

    lines = [
        *fault_lines(report.faults),
        *(_throw_line(number, throw) for number, throw in enumerate(report.throws, start=1)),
    ]
    learned, model = report.learned_from, skill.skill
    delay = (
        f"; the hand opens {1e3 * model.hand_delay:.0f} ms after it is told to"
        if any(d.opened == d.opened for d in learned)
        else ""
    )
    lines.append(
        f"learned from {len(learned)} of {len(report.throws)} throws with"
        f" '{model.configuration.name}'{delay}"
    )
    of_the_arm = strained_in_words(_strained(report))
    ball = model.ball_in_words([one.slowing for one in model.throws])
    lines += filter(None, [report.weakness, skill.practice.patterns(), of_the_arm, ball])
    lines.append(f"model {model.model_id}: {output}")
    return "\n".join(lines + _next(THROW, output))


def _strained(report: LearnReport) -> dict[str, str]:
    """Throws that were shown at a limit of the arm, and at which, by their ids."""
    from dart_skill.skills.learning import strained
    from dart_skill.skills.protocol import load_skill

    return strained(load_skill(THROW), report.learned_from)


def _next(skill: str, model: Path) -> list[str]:
    """What to type for an arm that does what was learned; nothing where there is no ROS for it."""
    if importlib.util.find_spec("rclpy") is None:
        return []
    of = "" if skill == THROW else f" --skill {skill}"
    return [line.format(of, shlex.quote(str(model.resolve()))) for line in NEXT]


def _throw_line(number: int, throw: FoundThrow) -> str:
    who = "guided" if throw.taught else "own"
    place, name = "", "throw"
    if throw.shown is not None:
        name, (x, y, z) = throw.shown
        place = f", basket at ({x:.2f}, {y:.2f}, {z:.2f})"
    landed = ""
    if throw.outcome is not None and throw.outcome.landing_seen:
        landed = f", landed {100 * throw.outcome.landing_error:.1f} cm from its centre"
    return (
        f"{number:3d}  {name}  {throw.stamp_ns * 1e-9:.3f} s:"
        f" {who}{place}{landed}{'; left out: ' + throw.reason if throw.reason else ''}"
    )


def _as_json(skill: PractisingSkill, report: LearnReport, output: Path) -> dict:
    return {
        "source": report.source,
        "faults": [asdict(fault) for fault in report.faults],
        "clocks": report.clocks,
        "throws": [_throw_json(*each) for each in enumerate(report.throws, start=1)],
        "learned_from": [one.id for one in report.learned_from],
        "weakness": report.weakness,
        "patterns": skill.practice.patterns(),
        "strained": _strained(report),
        "configuration": skill.skill.configuration.name,
        "model_id": skill.skill.model_id,
        "model": str(output),
    }


def _throw_json(number: int, throw: FoundThrow) -> dict:
    outcome, (name, target) = throw.outcome, throw.shown or (None, None)
    return {
        "number": number,
        "stamp_ns": throw.stamp_ns,
        "id": name,
        "taught": throw.taught,
        "target": None if target is None else target.tolist(),
        "in_basket": None if outcome is None else bool(outcome.in_basket),
        "landing_error": (
            float(outcome.landing_error) if outcome is not None and outcome.landing_seen else None
        ),
        "left_out": throw.reason or None,
    }
