"""`dart-skill throw`: throws of the arm at baskets that are put there, on a graph that runs."""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from dart_skill_nodes.verbs._options import add_baskets
from dart_skill_nodes.verbs._run import PATIENCE, baskets, on_running_graph, print_result, throw_all

if TYPE_CHECKING:
    import numpy as np

    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = "Throws of the arm at baskets that are put there, on a graph that runs (`dart-skill up`)."
    add_baskets(parser, 1)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Throw; returns the exit status."""

    def run() -> dict:
        targets = baskets(options, stream=2)
        return on_running_graph(lambda client: client.wait_until_ready(PATIENCE, teacher=False), lambda client: _throw(client, targets))

    return print_result(run, options.json)


def _throw(client: "GraphClient", targets: "np.ndarray") -> dict:
    results = throw_all(client, targets)
    hits = sum(result.in_basket for result in results)
    throws = [asdict(result) for result in results]
    thrown = all(not result.message for result in results)
    return {"text": f"{hits} of {len(results)} in the basket", "throws": throws, "ok": thrown, "next": "dart-skill throw --count 10"}
