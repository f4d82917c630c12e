"""`dart-skill teach`, `learn` and `throw`: one thing at a time on a graph that runs (`dart-skill up`)."""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import asdict

import numpy as np

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")  # before rclpy starts

import rclpy  # noqa: E402

from dart_skill.experiments.targets import REGION  # noqa: E402
from dart_skill_nodes import command_lines  # noqa: E402
from dart_skill_nodes.coaching import Coach, GraphFailure  # noqa: E402
from dart_skill_nodes.demo import place, say, throw_all  # noqa: E402

PATIENCE = 10.0
"""For the graph to answer at all [s, wall clock]."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Command line of the three."""
    parser = argparse.ArgumentParser(prog="dart-skill", description=__doc__)
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    for add_options, run in ((command_lines.teach, _teach), (command_lines.learn, _learn), (command_lines.throw, _throw)):
        verb = verbs.add_parser(add_options.__name__)
        add_options(verb)
        verb.set_defaults(run=run)
    return parser.parse_args(arguments)


def _baskets(options: argparse.Namespace, stream: int) -> np.ndarray:
    """Centres of rims (n, 3)."""
    if options.at is not None:
        return np.array([options.at])
    if options.count < 1 or options.seed < 0:
        raise ValueError(f"--count is {options.count}, --seed {options.seed}: give at least 1, and at least 0")
    return REGION.spread(options.count, np.random.default_rng([options.seed, stream]))


def _teach(coach: Coach, options: argparse.Namespace) -> dict:
    lessons = []
    for target in _baskets(options, 1):
        result = coach.teach(target)
        how = f"in after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"{place(target)}: {how}")
        lessons.append({"target": target.tolist(), "success": bool(result.success), "attempts": int(result.attempts)})
    shown = sum(lesson["success"] for lesson in lessons)
    return {"text": f"{shown} of {len(lessons)} throws shown", "lessons": lessons, "ok": shown == len(lessons), "next": "dart-skill learn"}


def _learn(coach: Coach, options: argparse.Namespace) -> dict:
    learned = coach.learn(configuration=options.configuration, at_least=options.at_least)
    told = {"demonstrations": int(learned.demonstrations), "model_id": learned.model_id}
    return {"text": f"{learned.message}; model {learned.model_id}", **told, "ok": True, "next": "dart-skill throw"}


def _throw(coach: Coach, options: argparse.Namespace) -> dict:
    results = throw_all(coach, _baskets(options, 2))
    hits = sum(result.in_basket for result in results)
    throws = [asdict(result) for result in results]
    thrown = all(not result.message for result in results)
    return {"text": f"{hits} of {len(results)} in the basket", "throws": throws, "ok": thrown, "next": "dart-skill throw --count 10"}


def on_the_graph(task: Callable[[Coach, argparse.Namespace], dict], options: argparse.Namespace) -> dict:
    """Result of a task on the graph that runs; GraphFailure if none does."""
    coach = Coach(name="verb")
    try:
        try:
            if task is _learn:
                coach.wait_for_learner(PATIENCE)
            else:
                coach.wait_until_ready(PATIENCE, teacher=task is _teach)
        except GraphFailure as failure:
            raise GraphFailure(f"{failure}: does the graph run? 'dart-skill up' starts it, in another terminal") from failure
        return task(coach, options)
    finally:
        coach.close()


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = parse(arguments)
    rclpy.init()
    try:
        result = on_the_graph(options.run, options)
    except (GraphFailure, ValueError) as failure:
        print(f"dart-skill: {failure}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    text = f"{result.pop('text')}\nnext: {result.pop('next')}"
    print(json.dumps(result) if options.json else text)
    return 0 if result["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
