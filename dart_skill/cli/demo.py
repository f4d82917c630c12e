"""`dart-skill demo`: the main job. A teacher shows a skill, it is learned, the arm carries it out
elsewhere.

Over the real graph, or in one process without ROS; the options, what is printed and what is left
behind are the same.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING

from dart_skill.cli import graph_verbs
from dart_skill.cli.run_options import (
    GRAPHS,
    add_configuration,
    add_model,
    add_run,
    asked,
    check_model,
    check_run,
    chosen_skill,
    parameter_texts,
)
from dart_skill.common.extras import explained, need
from dart_skill.common.words import counted
from dart_skill.common.world import THROW

if TYPE_CHECKING:
    from dart_skill.report import About
    from dart_skill.session import RunSummary
    from dart_skill.skills.protocol import Skill, SkillWords

IN_PROCESS = "in-process"
LEFT_OUT = "in process: no nodes run, so there are no logs of them"


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `demo` to the commands of `dart-skill`."""
    parser = commands.add_parser("demo", help=graph_verbs.HELP["demo"])
    parser.description = (
        "The main job over the real graph: a teacher shows throws, the skill is learned, the arm"
        " throws at new baskets. The same with any other skill. Without ROS: --layout in-process."
    )
    skills = "throw, darts, place, reach, stir, or one of an installed package (default throw)"
    parser.add_argument("--skill", default=THROW, metavar="NAME", help=skills)
    thrown, also = (
        "new baskets to throw at, or trials of another skill",
        ", or in-process: all in one process, without ROS",
    )
    add_run(
        parser,
        demonstrations=13,
        throws=10,
        thrown=thrown,
        layouts=(*GRAPHS, IN_PROCESS),
        also=also,
    )
    parser.add_argument(
        "--json", action="store_true", help="summary.json on stdout instead of the table"
    )
    add_configuration(parser, "that of config/skill_learner.yaml")
    add_model(parser, "nothing is shown, the arm does what a file of 'dart-skill learn BAG' holds")
    # each skill has its own numbers
    parser.set_defaults(run=partial(_demo, parser=parser), demonstrations=None, throws=None)


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def _demo(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the demo; returns the exit status."""
    _check_model(options, parser)
    in_process = options.layout == IN_PROCESS
    carried_out = _in_process if in_process else _on_graph(parser).demo
    skill = chosen_skill(parser, options.skill, options.set)
    _check_options_of_skill(options, parser, skill)
    check_run(parser, options, _fewest(skill))
    if options.model is not None:
        options.demonstrations = 0
    say(expected(skill.words, options.demonstrations, options.throws))
    summary = carried_out(options, skill)
    if summary is None:
        return 1
    print(json.dumps(summary.to_json(), indent=1) if options.json else summary.table())
    return _leave_behind(summary, options, parser)


def expected(words: SkillWords, demonstrations: int, trials: int) -> str:
    """What a demo does, and with the usual numbers, for which it was measured, how long that takes."""
    is_timed = words.demo_seconds and (demonstrations, trials) == (words.lessons, words.tries)
    about = f"; about {words.demo_seconds:.0f} s on two idle cores" if is_timed else ""
    shown = counted(demonstrations, "demonstration")
    return f"{shown}, then {counted(trials, words.trial, words.trials)}{about}"


def _fewest(skill: Skill) -> int:
    """Fewest demonstrations that are asked for: one, where the representation learns from it."""
    from dart_skill.skills.protocol import part_of

    return min(2, part_of(skill, "representation").least(skill.settings))


def _check_options_of_skill(
    options: argparse.Namespace, parser: argparse.ArgumentParser, skill: Skill
) -> None:
    """A usage error for an option that is not for this skill; its own numbers where none is given."""
    if options.configuration and not skill.configurations:
        parser.error(
            "--configuration is for throws: other skills have their settings in a file of"
            " their own"
        )
    for name, number in (("demonstrations", skill.words.lessons), ("throws", skill.words.tries)):
        if getattr(options, name) is None:
            setattr(options, name, number)


def _check_model(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    """Usage errors of --model beside options of what it takes the place of."""
    check_model(parser, options)
    if options.model is None:
        return
    if options.layout == IN_PROCESS:
        parser.error("--model is for the learner of a graph: leave out --layout in-process")
    for name in ("demonstrations", "configuration"):
        if getattr(options, name) != parser.get_default(name):
            parser.error(f"--{name} is for a skill that is shown: with --model nothing is shown")


def _in_process(options: argparse.Namespace, skill: Skill) -> RunSummary | None:
    """The demo in this process; None, and a line why, if it failed."""
    need("pinocchio", "pybullet")
    from dart_skill.common.fleet import of_nodes
    from dart_skill.session import Job, demo

    options.output.mkdir(parents=True, exist_ok=True)
    say(f"seed {options.seed}; {LEFT_OUT}")
    job = Job(
        options.seed,
        options.demonstrations,
        options.throws,
        options.output / "bag",
        options.arm,
        of_nodes(options.set),
        options.configuration,
    )
    try:
        return demo(job, skill, say)
    except (ValueError, OSError) as error:
        say(f"the demo failed: {error}")
    return None


def _on_graph(parser: argparse.ArgumentParser) -> ModuleType:
    """The nodes' part; ImportError, with what to do, where there are none."""
    try:
        return graph_verbs.module_of("demo", parser)
    except ImportError as error:
        raise ImportError(
            f"{error}; without ROS: dart-skill demo --layout {IN_PROCESS}"
        ) from error


def _leave_behind(
    summary: RunSummary, options: argparse.Namespace, parser: argparse.ArgumentParser
) -> int:
    """The report of a run, and what to do next; returns the exit status."""
    bag, page = options.output / "bag", options.output / "report.html"
    try:
        from dart_skill.report import write_report

        written = write_report(summary, options.output, _about(summary, options, parser))
    except ImportError as error:  # the figures can be drawn from the bag later
        from dart_skill.session import write_summary

        written = [write_summary(summary.to_json(), options.output)]
        say(
            f"no report and no pictures: {explained(error)}, then dart-skill report"
            f" {shlex.quote(str(options.output))}"
        )
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        print(f"\nbag, {', '.join(path.name for path in written)}: {options.output}")
        seen = f"open {shlex.quote(str(page))} in a browser, or " if page.is_file() else ""
        print(f"next: {seen}dart-skill view {shlex.quote(str(bag))}")
    return 0


def _about(
    summary: RunSummary, options: argparse.Namespace, parser: argparse.ArgumentParser
) -> About:
    """What the report says of the run beyond its bag."""
    from dart_skill.report import About, RunPhase

    skill, trials = summary.skill, len(summary.trials)
    words, factor = skill.words, summary.trial_real_time_factor
    pace = "" if factor is None else f"; {words.trials} at {factor:.1f} times real time"
    shown = counted(summary.demonstrations, "demonstration")
    facts = {
        "Seed": str(options.seed),
        "Guided movements": f"{summary.attempts} for {shown}",
        "Arm": options.arm,
        "Layout": options.layout,
        "Time": f"{summary.wall_seconds:.0f} s{pace}",
    }
    return About(
        f"{skill.name.capitalize()}: {shown}, {counted(trials, words.trial, words.trials)}",
        facts,
        asked(parser, options),
        parameter_texts(),
        options.configuration,
        phases=(RunPhase(f"own {words.trials}", trials),),
    )
