"""`dart-skill teach`: throws that a person guides, on a graph that runs."""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_namespace
from dart_skill.common.world import THROW
from dart_skill_nodes.verbs._run import (
    PATIENCE,
    baskets,
    on_running_graph,
    place,
    print_result,
    say,
    teach_by_hand,
)
from dart_skill_nodes.verbs._skill_run import drawn, show_all

if TYPE_CHECKING:
    import numpy as np

    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Throws that a person guides, on a graph that runs (`dart-skill up`): a simulated one, at"
        " new baskets for those that miss; with a real arm you, and the Enter key says when a"
        " throw begins and has ended."
    )
    add_baskets(parser, 13)
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Teach; returns the exit status."""

    def wait(client: "GraphClient") -> None:
        options.simulated = client.is_simulated(PATIENCE)
        if options.simulated:
            client.wait_until_ready(PATIENCE)

    def run() -> dict:
        targets = baskets(options, stream=1)

        def task(client: "GraphClient") -> dict:
            skill = client.skill(PATIENCE)
            if not options.simulated:
                return _teach_by_hand(client, options, skill)
            return _teach(client, targets) if skill == THROW else _show(client, options, skill)

        return on_running_graph(wait, task, options.namespace)

    return print_result(run, options.json, options.namespace)


def _show(client: "GraphClient", options: argparse.Namespace, name: str) -> dict:
    """Lessons in another skill than throwing."""
    from dart_skill.skills.protocol import load_skill

    if options.at is not None:
        raise ValueError(
            f"--at is for throws: the graph teaches '{name}', whose situations are drawn (--seed)"
        )
    attempts = show_all(client, load_skill(name), options.count, drawn(options.seed))
    text = f"{options.count} of {options.count} movements shown, in {attempts} attempts"
    return {
        "text": text,
        "shown": options.count,
        "attempts": attempts,
        "ok": True,
        "next": "dart-skill learn",
    }


def _teach_by_hand(client: "GraphClient", options: argparse.Namespace, skill: str) -> dict:
    from dart_skill.skills.protocol import load_skill

    if options.at is not None:
        raise ValueError(
            "--at puts a simulated basket there: put the real one where you like, and leave"
            " this out"
        )
    words = load_skill(skill).words
    shown = teach_by_hand(client, options.count, words)
    text = f"{shown} of {options.count} {words.trials} shown"
    return {
        "text": text,
        "shown": shown,
        "ok": shown == options.count,
        "next": "dart-skill demonstrations",
    }


def _teach(client: "GraphClient", targets: "np.ndarray") -> dict:
    lessons = []
    for target in targets:
        result = client.teach(target)
        how = f"in after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"{place(target)}: {how}")
        lessons.append(
            {
                "target": target.tolist(),
                "success": bool(result.success),
                "attempts": int(result.attempts),
            }
        )
    shown = sum(lesson["success"] for lesson in lessons)
    text, then = (
        f"{shown} of {len(lessons)} throws shown",
        "dart-skill learn" if shown else "dart-skill status",
    )
    return {"text": text, "lessons": lessons, "ok": shown == len(lessons), "next": then}
