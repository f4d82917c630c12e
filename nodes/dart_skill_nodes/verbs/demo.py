"""`dart-skill demo`, the main job over the real graph: a teacher shows a skill, it is learned, the arm carries it out elsewhere."""

import argparse
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill_nodes.process.graph_processes import LAYOUTS, NODES, Graph, of_executables
from dart_skill_nodes.verbs._darts_run import play_leg, practise_darts
from dart_skill_nodes.verbs._options import add_configuration, add_run, asked, check_run
from dart_skill_nodes.verbs._run import carried_out, parameter_texts, say, teach, throw_all
from dart_skill_nodes.verbs._skill_run import THROW, drawn, execute_all, show_all

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.report import About
    from dart_skill.session import DartsSummary, DemoSummary, SkillSummary
    from dart_skill.skill.protocol import Skill
    from dart_skill.skills.darts import Darts
    from dart_skill_nodes.client.graph_client import GraphClient

DARTS = "darts"
DEMONSTRATIONS, OWN_DARTS = 8, 75
"""Of another skill, and own darts, where nobody says how many."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "The main job over the real graph: a teacher shows throws, the skill is learned, the arm throws at new baskets. The same with any "
        "other skill."
    )
    skills = "throw, darts, place, reach, or one of an installed package (default throw)"
    parser.add_argument("--skill", default=THROW, metavar="NAME", help=skills)
    add_run(parser, demonstrations=13, throws=10, thrown="new baskets to throw at, or trials of another skill")
    parser.add_argument("--json", action="store_true", help="summary.json on stdout instead of the table")
    add_configuration(parser, "that of config/skill_learner.yaml")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the demo; returns the exit status."""
    from dart_skill.report import PAGE, write_report
    from dart_skill.session import table

    if options.skill != THROW:
        return _main_of_skill(options, parser)
    check_run(parser, options)
    summary = carried_out(run, options, "the demo")
    if summary is None:
        return 1
    print(json.dumps(summary.to_json(), indent=1) if options.json else table(summary))
    try:
        written = write_report(summary, Path(summary.bag), options.output, _about(options, parser, summary))
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        pictures = ", ".join(path.name for path in written if path.suffix == ".png")
        print(f"\nbag, summary.json, {PAGE} and pictures ({pictures}): {options.output}")
        print(f"next: open {options.output / PAGE} in a browser, or dart-skill view {summary.bag}")
    return 0


def _main_of_skill(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """The demo of another skill than throwing; returns the exit status."""
    from dart_skill.session import skill_table
    from dart_skill.skill.protocol import load_skill

    if options.configuration and options.skill != DARTS:
        parser.error("--configuration is for throws: other skills have their settings in a file of their own")
    if options.demonstrations == parser.get_default("demonstrations"):
        options.demonstrations = DEMONSTRATIONS
    if options.skill == DARTS and options.throws == parser.get_default("throws"):
        options.throws = OWN_DARTS
    try:
        skill = load_skill(options.skill)
    except ValueError as error:
        parser.error(str(error))
    check_run(parser, options)
    if options.skill == DARTS:
        return _main_of_darts(options, parser, skill)
    summary = carried_out(partial(run_skill, skill=skill), options, "the demo")
    if summary is None:
        return 1
    print(json.dumps(summary.to_json(), indent=1) if options.json else skill_table(summary))
    return _leave_behind(summary, summary, skill, options, parser)


def _main_of_darts(options: argparse.Namespace, parser: argparse.ArgumentParser, skill: "Skill") -> int:
    """The demo of darts; returns the exit status."""
    from dart_skill.session import darts_table

    summary = carried_out(partial(run_darts, skill=skill), options, "the demo")
    if summary is None:
        return 1
    leg = [] if summary.leg is None else [summary.leg.in_words]
    print(json.dumps(summary.to_json(), indent=1) if options.json else "\n".join([darts_table(summary.run), *leg]))
    return _leave_behind(summary, summary.of, skill, options, parser)


def _leave_behind(
    summary: "SkillSummary | DartsSummary", of: "SkillSummary", skill: "Skill", options: argparse.Namespace, parser: argparse.ArgumentParser
) -> int:
    """The report of a run, and what to do next; returns the exit status."""
    from dart_skill.report import PAGE, About, write_skill_report

    facts = {
        "Seed": str(options.seed),
        "Guided movements": f"{of.attempts} for {of.demonstrations} demonstrations",
        "Arm": options.arm,
        "Layout": options.layout,
        "Time": f"{of.wall_seconds:.0f} s",
    }
    title = f"{skill.name.capitalize()}: {of.demonstrations} demonstrations, {len(of.trials)} trials"
    try:
        written = write_skill_report(summary, skill, options.output, About(title, facts, asked(parser, options), parameter_texts()))
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        print(f"\nbag, {', '.join(path.name for path in written)}: {options.output}")
        print(f"next: open {options.output / PAGE} in a browser, or dart-skill bag info {of.bag}")
    return 0


@contextmanager
def _learned_graph(options: argparse.Namespace, skill: "Skill", rng: "np.random.Generator") -> "Iterator[tuple[GraphClient, int]]":
    """A graph of its own that was shown a skill and has learned it: a client, and how many attempts the lessons took."""
    from dart_skill_nodes.client.graph_client import GraphClient

    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])} with the skill {skill.name}")
        client = GraphClient(graph.dead)
        client.wait_until_gone(NODES)
        extra = of_executables(options.layout, options.differs)
        graph.start_all(options.layout, options.seed, options.output / "bag", extra, skill.name)
        client.wait_until_ready()
        attempts = show_all(client, skill, options.demonstrations, rng)
        say(client.learn(configuration=options.configuration).message)
        yield client, attempts
        client.close()


def run_darts(options: argparse.Namespace, skill: "Darts") -> "DartsSummary":
    """Darts on a graph of its own: shown, learned, practised, and a leg of 501."""
    from dart_skill.session import DartsRun, DartsSummary, SkillResult, SkillSummary
    from dart_skill_nodes.comms import conversions

    begun = time.monotonic()
    with _learned_graph(options, skill, drawn(options.seed)) as (client, attempts):
        done = practise_darts(client, skill, options.throws)
        say(done.result.message)
        leg = play_leg(client, skill, done.agent)
    trials = [
        SkillResult(conversions.situation(one.situation), conversions.task_outcome(one), dart.note)
        for one, dart in zip(done.result.outcomes, done.darts, strict=True)
    ]
    of = SkillSummary(
        skill=skill.name,
        seed=options.seed,
        bag=str(options.output / "bag"),
        demonstrations=options.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=options.layout,
    )
    return DartsSummary(of, DartsRun(options.seed, "of the graph", skill.bull, (), done.darts), leg)


def run_skill(options: argparse.Namespace, skill: "Skill") -> "SkillSummary":
    """The whole job of any skill on a graph of its own."""
    from dart_skill.session import SkillSummary

    bag, begun, rng = options.output / "bag", time.monotonic(), drawn(options.seed)
    with _learned_graph(options, skill, rng) as (client, attempts):
        trials = execute_all(client, skill, options.throws, rng)
    simulated, took = client.throw_seconds
    return SkillSummary(
        skill=skill.name,
        seed=options.seed,
        bag=str(bag),
        demonstrations=options.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=options.layout,
        real_time_factor=float(simulated / took),
    )


def run(options: argparse.Namespace) -> "DemoSummary":
    """The whole job on a graph of its own."""
    from dart_skill.regions import targets_for
    from dart_skill.session import DemoSummary
    from dart_skill.simulation import PlantSettings
    from dart_skill_nodes.client.graph_client import GraphClient

    bag = options.output / "bag"
    begun = time.monotonic()
    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}")
        client = GraphClient(graph.dead)
        client.wait_until_gone(NODES)
        graph.start_all(options.layout, options.seed, bag, of_executables(options.layout, options.differs))
        client.wait_until_ready()
        ready, steps = time.monotonic(), client.simulated_steps
        attempts = teach(client, options.seed, options.demonstrations)
        learned = client.learn(configuration=options.configuration)
        say(learned.message)
        results = throw_all(client, targets_for(options.seed, options.demonstrations, options.throws)[1])
        worked = time.monotonic() - ready
        before = client.simulated_steps
        until = time.monotonic() + 3.0
        while client.simulated_steps == before and time.monotonic() < until:
            client.spin()  # the last count comes with the next diagnostics
        simulated = (client.simulated_steps - steps) * PlantSettings().step
        client.close()
    return DemoSummary(
        seed=options.seed,
        bag=str(bag),
        demonstrations=options.demonstrations,
        attempts=attempts,
        throws=tuple(results),
        wall_seconds=time.monotonic() - begun,
        real_time_factor=simulated / worked,
        throw_real_time_factor=float(client.throw_seconds[0] / client.throw_seconds[1]),
        layout=options.layout,
    )


def _about(options: argparse.Namespace, parser: argparse.ArgumentParser, summary: "DemoSummary") -> "About":
    from dart_skill.report import About

    facts = {
        "Seed": str(options.seed),
        "Guided throws": f"{summary.attempts} for {summary.demonstrations} demonstrations",
        "Arm": options.arm,
        "Layout": options.layout,
        "Time": f"{summary.wall_seconds:.0f} s; a throw at {summary.throw_real_time_factor:.1f} times real time",
    }
    title = f"Demo: {summary.demonstrations} demonstrations, {summary.thrown} throws"
    return About(title, facts, asked(parser, options), parameter_texts(), options.configuration)
