"""`dart-skill teach`: throws that a person guides, on a graph that runs."""

import argparse
from typing import TYPE_CHECKING

from dart_skill_nodes.verbs._options import add_baskets
from dart_skill_nodes.verbs._run import PATIENCE, baskets, on_running_graph, place, print_result, say

if TYPE_CHECKING:
    import numpy as np

    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = "Throws that a person guides, on a graph that runs (`dart-skill up`); at new baskets for those that miss."
    add_baskets(parser, 13)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Teach; returns the exit status."""

    def run() -> dict:
        targets = baskets(options, stream=1)
        return on_running_graph(lambda client: client.wait_until_ready(PATIENCE), lambda client: _teach(client, targets))

    return print_result(run, options.json)


def _teach(client: "GraphClient", targets: "np.ndarray") -> dict:
    lessons = []
    for target in targets:
        result = client.teach(target)
        how = f"in after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"{place(target)}: {how}")
        lessons.append({"target": target.tolist(), "success": bool(result.success), "attempts": int(result.attempts)})
    shown = sum(lesson["success"] for lesson in lessons)
    return {"text": f"{shown} of {len(lessons)} throws shown", "lessons": lessons, "ok": shown == len(lessons), "next": "dart-skill learn"}
