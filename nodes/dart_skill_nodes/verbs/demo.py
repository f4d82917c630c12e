"""The main job over the real graph: a teacher shows throws, the skill is learned, the arm throws at baskets nobody demonstrated."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np
import rclpy

from dart_skill.configuration import config_path
from dart_skill.experiments.report import DemoSummary, ThrowResult, table, write_report
from dart_skill.experiments.targets import REGION, targets_for
from dart_skill.report import PAGE
from dart_skill.report.run import About
from dart_skill.simulation.plant import PlantSettings
from dart_skill_nodes import conversions
from dart_skill_nodes.coaching import Coach, GraphFailure
from dart_skill_nodes.command_lines import parser_of
from dart_skill_nodes.graph import LAYOUTS, NODES, Graph, choose_domain

PARAMETER_FILES = ("skill_learner.yaml", "demonstration_recorder.yaml", "coach.yaml")
"""What a report shows besides the parameters that the bag holds."""
UNTOLD = ("help", "output", "json")
"""Options that change nothing about a run."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Command line of the demo."""
    parser = parser_of("demo")
    options = parser.parse_args(arguments)
    options.asked = asked(parser, options)
    for name, least in (("seed", 0), ("demonstrations", 2), ("throws", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name} is {getattr(options, name)}; it must be at least {least}")
    options.output = (options.output or Path("output") / f"demo_{datetime.now():%Y_%m_%d-%H_%M_%S}").resolve()
    if (options.output / "bag").exists():
        parser.error(f"--output {options.output} holds a bag already: choose another folder")
    return options


def asked(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[tuple]:
    """Name, value and default of every option that a run depends on."""
    names = [action.dest for action in parser._actions if action.dest not in UNTOLD]
    return [(name.replace("_", "-"), getattr(options, name), parser.get_default(name)) for name in names]


def parameter_texts() -> dict[str, str]:
    """The parameter files in force that no bag holds."""
    return {name: config_path(name).read_text(encoding="utf-8") for name in PARAMETER_FILES}


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def place(target: np.ndarray) -> str:
    """A basket in words."""
    azimuth = np.rad2deg(np.arctan2(target[1], target[0]))
    return f"basket at {np.hypot(target[0], target[1]):.2f} m, {azimuth:+.0f} degrees"


def teach(coach: Coach, seed: int, wanted: int) -> int:
    """Lessons until `wanted` throws were demonstrated, at new baskets for those that failed; how many throws it took."""
    shown = attempts = 0
    targets = targets_for(seed, wanted, 0)[0]
    spare = iter(REGION.spread(wanted, np.random.default_rng([seed, 3])))
    for lesson in range(2 * wanted):
        target = targets[lesson] if lesson < wanted else next(spare)
        result = coach.teach(target)
        attempts += result.attempts
        shown += bool(result.success)
        how = f"in after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"demonstration {shown}/{wanted}: {place(target)}: {how}")
        if shown == wanted and lesson >= wanted - 1:
            return attempts
    raise GraphFailure(f"only {shown} of {wanted} demonstrations succeeded")


def throw_all(coach: Coach, targets: np.ndarray) -> list[ThrowResult]:
    """One throw at each basket."""
    results = []
    for k, target in enumerate(targets, start=1):
        result = coach.throw(target)
        outcome = result.outcome
        seen = bool(outcome.landing_seen)
        results.append(
            ThrowResult(
                target=tuple(float(x) for x in target),
                landing=tuple(conversions.vector(outcome.landing).tolist()) if seen else None,
                error_m=float(outcome.landing_error) if seen else None,
                in_basket=bool(outcome.in_basket),
                message="" if result.code == 1 else result.message,
            )
        )
        error = f"{100 * outcome.landing_error:.1f} cm" if seen else "landing not seen"
        say(f"throw {k}/{len(targets)}: {place(target)}: {'in' if outcome.in_basket else 'out'}, {error} {results[-1].message}")
    return results


def run(options: argparse.Namespace) -> tuple[DemoSummary, list]:
    """The whole job on a graph of its own; the summary, and the plans that were thrown."""
    bag = options.output / "bag"
    begun = time.monotonic()
    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}")
        coach = Coach(graph.dead)
        coach.wait_until_gone(NODES)
        graph.start_all(options.layout, options.seed, bag)
        coach.wait_until_ready()
        ready, steps = time.monotonic(), coach.simulated_steps
        attempts = teach(coach, options.seed, options.demonstrations)
        learned = coach.learn(configuration=options.configuration)
        say(learned.message)
        results = throw_all(coach, targets_for(options.seed, options.demonstrations, options.throws)[1])
        worked = time.monotonic() - ready
        before = coach.simulated_steps
        until = time.monotonic() + 3.0
        while coach.simulated_steps == before and time.monotonic() < until:
            coach.spin()  # the last count comes with the next diagnostics
        simulated = (coach.simulated_steps - steps) * PlantSettings().step
        coach.close()
    summary = DemoSummary(
        seed=options.seed,
        bag=str(bag),
        demonstrations=options.demonstrations,
        attempts=attempts,
        throws=tuple(results),
        wall_seconds=time.monotonic() - begun,
        real_time_factor=simulated / worked,
        throw_real_time_factor=float(coach.throw_seconds[0] / coach.throw_seconds[1]),
        layout=options.layout,
    )
    return summary, bag


def carried_out(job: Callable, options: argparse.Namespace, what: str):
    """job(options) with ROS running, on a domain of its own; None, and a line why, if it failed or was stopped."""
    choose_domain()  # not when this is imported: `teach` and its like must find the graph that runs
    options.output.mkdir(parents=True, exist_ok=True)
    rclpy.init(args=[])
    try:
        return job(options)
    except (GraphFailure, ValueError, OSError) as error:
        say(f"{what} failed: {error}")
        say(f"logs: {options.output / 'logs'}")
    except KeyboardInterrupt:
        say("stopped")
    finally:
        rclpy.try_shutdown()
    return None


def _about(options: argparse.Namespace, summary: DemoSummary) -> About:
    facts = {
        "Seed": str(options.seed),
        "Guided throws": f"{summary.attempts} for {summary.demonstrations} demonstrations",
        "Layout": options.layout,
        "Time": f"{summary.wall_seconds:.0f} s; a throw at {summary.throw_real_time_factor:.1f} times real time",
    }
    title = f"Demo: {summary.demonstrations} demonstrations, {summary.thrown} throws"
    return About(title, facts, options.asked, parameter_texts(), options.configuration)


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = parse(arguments)
    done = carried_out(run, options, "the demo")
    if done is None:
        return 1
    summary, bag = done
    print(json.dumps(summary.to_json(), indent=1) if options.json else table(summary))
    try:
        written = write_report(summary, bag, options.output, _about(options, summary))
    except (ValueError, OSError) as error:
        say(f"no report: {error}")
        return 1
    if not options.json:
        pictures = ", ".join(path.name for path in written if path.suffix == ".png")
        print(f"\nbag, summary.json, {PAGE} and pictures ({pictures}): {options.output}")
        print(f"next: open {options.output / PAGE} in a browser, or dart-skill view {bag}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
