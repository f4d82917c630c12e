"""`dart-skill throw`: throws of the arm, on a graph that runs: in a simulated world, or with a
person who puts the ball into the hand.
"""

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_model, add_namespace, check_model
from dart_skill.common.world import THROW
from dart_skill_nodes.verbs._run import (
    PATIENCE,
    baskets,
    on_running_graph,
    print_result,
    throw_all,
    throw_with_person,
)

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.session import ThrowResult
    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Throws of the arm, on a graph that runs (`dart-skill up`). A simulated basket is put"
        " there; without a simulator a person puts the ball into the hand, and without --at or"
        " --count the arm throws where the cameras see the basket."
    )
    add_baskets(parser, None)
    add_model(parser)
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Throw; returns the exit status."""
    check_model(parser, options)

    def wait(client: "GraphClient") -> None:
        options.simulated = client.is_simulated(PATIENCE)
        if options.simulated:
            client.wait_until_ready(PATIENCE, teacher=False)

    def run() -> dict:
        places = options.at is not None or options.count is not None
        options.count = 1 if options.count is None else options.count
        targets = baskets(options, stream=2)

        def task(client: "GraphClient") -> dict:
            if (skill := client.skill(PATIENCE)) != THROW:
                raise ValueError(
                    f"the graph has learned '{skill}', not to throw: dart-skill execute"
                )
            if options.model:
                client.load(options.model)
            return _throw(client, targets, options.simulated, places)

        return on_running_graph(wait, task, options.namespace)

    return print_result(run, options.json, options.namespace)


def _throw(client: "GraphClient", targets: "np.ndarray", simulated: bool, places: bool) -> dict:
    """places: somebody said where the baskets are; else a real arm throws where the cameras see
    one.
    """
    results = (
        throw_all(client, targets)
        if simulated
        else throw_with_person(client, targets if places else None)
    )
    hits = sum(result.in_basket for result in results)
    throws = [asdict(result) for result in results]
    thrown = all(not result.message for result in results)
    text = f"{hits} of {len(results)} in the basket"
    return {
        "text": text,
        "throws": throws,
        "ok": thrown,
        "next": "dart-skill throw --count 10" if thrown else _remedy(results),
    }


def _remedy(results: "list[ThrowResult]") -> str:
    """What to type next, where not every throw was made."""
    unlearned = any("nothing is learned yet" in result.message for result in results)
    return "dart-skill learn" if unlearned else "dart-skill status"
