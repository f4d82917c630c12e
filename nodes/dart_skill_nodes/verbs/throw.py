"""`dart-skill throw`: throws of the arm, on a graph that runs: in a simulated world, or with a
person who puts the ball into the hand.
"""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_baskets, add_model, add_namespace, check_model
from dart_skill.common.world import THROW
from dart_skill_nodes.comms.names import full_name
from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.verbs.on_graph import PATIENCE, baskets, on_running_graph
from dart_skill_nodes.verbs.trials import practise, throw_at

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

    places = options.at is not None or options.count is not None
    options.count = 1 if options.count is None else options.count

    def wait(client: "GraphClient") -> None:
        options.targets = baskets(options, stream=2)
        options.simulated = client.is_simulated(PATIENCE)
        if options.simulated:
            client.wait_until_ready(PATIENCE, teacher=False)

    def throw(client: "GraphClient") -> dict:
        if (skill := client.skill(PATIENCE)) != THROW:
            raise ValueError(f"the graph has learned '{skill}', not to throw: dart-skill execute")
        if options.model:
            client.load(options.model)
        if options.simulated:
            results = throw_at(client, options.targets)
        else:
            results = _throw_with_person(client, options.targets if places else None)
        hits, thrown = sum(one.success for one in results), all(not one.message for one in results)
        rows = [one.to_json_of_throw() for one in results]
        unlearned = any("nothing is learned yet" in one.message for one in results)
        remedy = "dart-skill learn" if unlearned else "dart-skill status"
        return {
            "text": f"{hits} of {len(results)} in the basket",
            "throws": [{**row, "in_basket": row.pop("in")} for row in rows],
            "ok": thrown,
            "next": "dart-skill throw --count 10" if thrown else remedy,
        }

    return on_running_graph(options, wait, throw)


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
