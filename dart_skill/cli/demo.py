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
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from dart_skill.cli import graph_verbs
from dart_skill.cli.run_options import (
    GRAPHS,
    add_configuration,
    add_model,
    add_run,
    asked,
    check_model,
    check_run,
    parameter_texts,
)
from dart_skill.common.extras import explained, need
from dart_skill.common.world import THROW

if TYPE_CHECKING:
    from dart_skill.report import About
    from dart_skill.session import DartsSummary, DemoSummary, SkillSummary
    from dart_skill.skills.protocol import Skill

DARTS, IN_PROCESS = "darts", "in-process"
DEMONSTRATIONS, OWN_DARTS = 8, 75
"""Default numbers of demonstrations of another skill than throwing, and of own darts."""
LEFT_OUT = "in process: no nodes run, so there are no logs of them"
DIFFERS = (
    "a person and the cameras look at the bodies for another moment than on the graph: trials"
    " differ from those there"
)


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `demo` to the commands of `dart-skill`."""
    parser = commands.add_parser("demo", help=graph_verbs.HELP["demo"])
    parser.description = (
        "The main job over the real graph: a teacher shows throws, the skill is learned, the arm"
        " throws at new baskets. The same with any other skill. Without ROS: --layout in-process."
    )
    skills = "throw, darts, place, reach, or one of an installed package (default throw)"
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
    add_model(
        parser, "nobody shows anything, the arm does what a file of 'dart-skill learn BAG' holds"
    )
    parser.set_defaults(run=partial(_demo, parser=parser))


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def _demo(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the demo; returns the exit status."""
    _check_model(options, parser)
    job = _InProcess() if options.layout == IN_PROCESS else _on_graph(parser)
    if options.skill != THROW:
        return _demo_of_skill(options, parser, job)
    _check_run(options, parser)
    summary = job.carried_out(job.run, options, "the demo")
    if summary is None:
        return 1
    from dart_skill.session import table  # not before the nodes start, who are waited for

    print(json.dumps(summary.to_json(), indent=1) if options.json else table(summary))
    return _leave_behind(summary, options, partial(_throwing_report, summary, options, parser))


def _check_model(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    """Usage errors of --model beside options of what it takes the place of."""
    check_model(parser, options)
    if options.model is None:
        return
    if options.layout == IN_PROCESS:
        parser.error("--model is for the learner of a graph: leave out --layout in-process")
    for name in ("demonstrations", "configuration"):
        if getattr(options, name) != parser.get_default(name):
            parser.error(
                f"--{name} is for a skill that is shown: with --model nobody shows anything"
            )


def _check_run(options: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    """As `check_run`; with a model nothing is shown."""
    check_run(parser, options)
    if options.model is not None:
        options.demonstrations = 0


class _InProcess:
    """The demo in this process, with the calls of the nodes' module `demo`."""

    def run(self, options: argparse.Namespace) -> DemoSummary:
        from dart_skill.session import throwing_demo

        return throwing_demo(_job(options), say)

    def run_skill(self, options: argparse.Namespace, skill: Skill) -> SkillSummary:
        from dart_skill.session import skill_demo

        say(DIFFERS)
        return skill_demo(_job(options), skill, say)

    def run_darts(self, options: argparse.Namespace, skill: Any) -> DartsSummary:
        from dart_skill.session import darts_demo

        return darts_demo(_job(options), skill, say)

    @staticmethod
    def carried_out(job: Callable, options: argparse.Namespace, what: str) -> Any:
        """job(options); None, and a line why, if it failed."""
        need("pinocchio", "pybullet")
        options.output.mkdir(parents=True, exist_ok=True)
        say(f"seed {options.seed}; {LEFT_OUT}")
        try:
            return job(options)
        except (ValueError, OSError) as error:
            say(f"{what} failed: {error}")
        return None


def _on_graph(parser: argparse.ArgumentParser) -> ModuleType:
    """The nodes' part; ImportError, with what to do, where there are none."""
    try:
        return graph_verbs.module_of("demo", parser)
    except ImportError as error:
        raise ImportError(
            f"{error}; without ROS: dart-skill demo --layout {IN_PROCESS}"
        ) from error


def _job(options: argparse.Namespace) -> Any:
    from dart_skill.session import Job

    return Job(
        options.seed,
        options.demonstrations,
        options.throws,
        options.output / "bag",
        options.arm,
        tuple(options.set),
        options.configuration,
    )


def _demo_of_skill(options: argparse.Namespace, parser: argparse.ArgumentParser, job: Any) -> int:
    """The demo of another skill than throwing; returns the exit status."""
    from dart_skill.session import darts_table, skill_table
    from dart_skill.skills.protocol import load_skill

    if options.configuration and options.skill != DARTS:
        parser.error(
            "--configuration is for throws: other skills have their settings in a file of"
            " their own"
        )
    if options.demonstrations == parser.get_default("demonstrations") and options.model is None:
        options.demonstrations = DEMONSTRATIONS
    if options.skill == DARTS and options.throws == parser.get_default("throws"):
        options.throws = OWN_DARTS
    try:
        skill = load_skill(options.skill)
    except ValueError as error:
        parser.error(str(error))
    _check_run(options, parser)
    run = job.run_darts if options.skill == DARTS else job.run_skill
    summary = job.carried_out(partial(run, skill=skill), options, "the demo")
    if summary is None:
        return 1
    if options.json:
        print(json.dumps(summary.to_json(), indent=1))
    elif options.skill == DARTS:
        print(
            "\n".join(
                [
                    darts_table(summary.run),
                    *([] if summary.leg is None else [summary.leg.in_words]),
                ]
            )
        )
    else:
        print(skill_table(summary))
    return _leave_behind(summary, options, partial(_skill_report, summary, skill, options, parser))


def _leave_behind(
    summary: DemoSummary | SkillSummary | DartsSummary,
    options: argparse.Namespace,
    report: Callable[[], list[Path]],
) -> int:
    """The report of a run, and what to do next; returns the exit status."""
    bag, page = options.output / "bag", options.output / "report.html"
    try:
        written = report()
    except (
        ImportError
    ) as error:  # the run was made, and its figures can be drawn from the bag later
        from dart_skill.session import write_summary

        written = [write_summary(summary, options.output)]
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
        print(
            f"next: {seen}dart-skill {'view' if options.skill == THROW else 'bag info'}"
            f" {shlex.quote(str(bag))}"
        )
    return 0


def _throwing_report(
    summary: DemoSummary, options: argparse.Namespace, parser: argparse.ArgumentParser
) -> list[Path]:
    from dart_skill.report import write_report

    return write_report(
        summary, Path(summary.bag), options.output, _about_throws(options, parser, summary)
    )


def _skill_report(
    summary: SkillSummary | DartsSummary,
    skill: Skill,
    options: argparse.Namespace,
    parser: argparse.ArgumentParser,
) -> list[Path]:
    from dart_skill.report import About, write_skill_report
    from dart_skill.session import DartsSummary

    of = summary.of if isinstance(summary, DartsSummary) else summary
    facts = {
        "Seed": str(options.seed),
        "Guided movements": f"{of.attempts} for {of.demonstrations} demonstrations",
        "Arm": options.arm,
        "Layout": options.layout,
        "Time": f"{of.wall_seconds:.0f} s",
    }
    title = (
        f"{skill.name.capitalize()}: {of.demonstrations} demonstrations, {len(of.trials)} trials"
    )
    return write_skill_report(
        summary,
        skill,
        options.output,
        About(title, facts, asked(parser, options), parameter_texts()),
    )


def _about_throws(
    options: argparse.Namespace, parser: argparse.ArgumentParser, summary: DemoSummary
) -> About:
    from dart_skill.report import About, Phase

    facts = {
        "Seed": str(options.seed),
        "Guided throws": f"{summary.attempts} for {summary.demonstrations} demonstrations",
        "Arm": options.arm,
        "Layout": options.layout,
        "Time": (
            f"{summary.wall_seconds:.0f} s; a throw at {summary.throw_real_time_factor:.1f} times"
            " real time"
        ),
    }
    title = f"Demo: {summary.demonstrations} demonstrations, {summary.thrown} throws"
    phases = (Phase("own throws", summary.thrown),)
    return About(
        title,
        facts,
        asked(parser, options),
        parameter_texts(),
        options.configuration,
        phases=phases,
    )
