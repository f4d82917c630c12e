"""`dart-skill demo`, the main job over the real graph: a teacher shows throws, the skill is learned, the arm throws at new baskets."""

import argparse
import json
import time
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill_nodes.process.graph_processes import LAYOUTS, NODES, Graph, of_executables
from dart_skill_nodes.verbs._options import add_run, asked, check_run
from dart_skill_nodes.verbs._run import carried_out, parameter_texts, say, teach, throw_all

if TYPE_CHECKING:
    from dart_skill.report import About
    from dart_skill.session import DemoSummary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = "The main job over the real graph: a teacher shows throws, the skill is learned, the arm throws at new baskets."
    add_run(parser, demonstrations=13, throws=10, thrown="new baskets to throw at")
    parser.add_argument("--json", action="store_true", help="summary.json on stdout instead of the table")
    parser.add_argument("--configuration", default="", help="of the skill (default: that of config/skill_learner.yaml)")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the demo; returns the exit status."""
    from dart_skill.report import PAGE, write_report
    from dart_skill.session import table

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
