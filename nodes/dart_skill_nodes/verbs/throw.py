"""`dart-skill throw`: throws of the arm, on a graph that runs: in a simulated world, or with a
person who puts the ball into the hand.
"""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_model, add_namespace, check_model
from dart_skill.common.world import THROW
from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.comms.names import full_name
from dart_skill_nodes.verbs._run import PATIENCE, baskets, on_running_graph, print_result
from dart_skill_nodes.verbs._trials import practise, throw_at

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.session import TrialResult
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
    """places: whether the options say where the baskets are; else a real arm throws where the
    cameras see one.
    """
    if simulated:
        results = throw_at(client, targets)
    else:
        results = _throw_with_person(client, targets if places else None)
    hits = sum(result.success for result in results)
    thrown = all(not result.message for result in results)
    return {
        "text": f"{hits} of {len(results)} in the basket",
        "throws": [_row(result) for result in results],
        "ok": thrown,
        "next": "dart-skill throw --count 10" if thrown else _remedy(results),
    }


def _row(result: "TrialResult") -> dict:
    row = result.to_json_of_throw()
    return {**row, "in_basket": row.pop("in")}


def _throw_with_person(client: "GraphClient", targets: "np.ndarray | None") -> "list[TrialResult]":
    """One throw at each basket, or without any at the one that the cameras see; a person is told
    when to put the ball into the hand.
    """
    from dart_skill.skills.protocol import load_skill

    where = {"follow_basket": True} if targets is None else {"targets": targets}
    trials = 1 if targets is None else 0
    result, made = practise(client, load_skill(THROW), trials, **where, only_throw=True)
    if len(made) < (1 if targets is None else len(targets)):
        raise GraphFailure(f"{full_name(client.node, 'practice')}: {result.message}")
    return made


def _remedy(results: "list[TrialResult]") -> str:
    """What to type next, where not every throw was made."""
    unlearned = any("nothing is learned yet" in result.message for result in results)
    return "dart-skill learn" if unlearned else "dart-skill status"
