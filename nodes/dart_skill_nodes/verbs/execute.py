"""`dart-skill execute`: trials of whatever skill a graph that runs has learned, in simulated
situations that it draws.
"""

import argparse
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_model, add_namespace, check_model
from dart_skill_nodes.verbs.on_graph import PATIENCE, on_running_graph
from dart_skill_nodes.verbs.trials import try_all

if TYPE_CHECKING:
    from dart_skill_nodes.client.graph_client import GraphClient


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Trials of the skill that a graph that runs (`dart-skill up --skill NAME`) has learned: in"
        " a simulated world that is reset, with bodies put where the skill may be tried, and plans"
        " for what the cameras see. With a real arm send /execute a goal without a situation: it"
        " is carried out where the cameras see the bodies."
    )
    parser.add_argument(
        "--count", type=int, default=1, metavar="N", help="so many trials (default 1)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of where they are (default 0)")
    add_model(parser)
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Execute; returns the exit status."""
    if options.count < 1 or options.seed < 0:
        parser.error(
            f"--count is {options.count}, --seed {options.seed}: give at least 1, and at least 0"
        )
    check_model(parser, options)

    def wait(client: "GraphClient") -> None:
        if not client.is_simulated(PATIENCE):
            raise ValueError("there is no simulator: send /execute a goal without a situation")
        client.wait_until_ready(PATIENCE, teacher=False)

    def execute(client: "GraphClient") -> dict:
        from dart_skill.skills.protocol import load_skill

        skill = load_skill(client.skill(PATIENCE))
        if options.model:
            client.load(options.model)
        _, situations = skill.situations(options.seed, 0, options.count)
        trials = try_all(client, skill, situations, options.count)
        done = sum(one.success for one in trials)
        return {
            "text": f"{skill.name}: {done} of {len(trials)} succeeded",
            "trials": [one.to_json() for one in trials],
            "ok": all(not one.message for one in trials),
            "next": "dart-skill execute --count 10",
        }

    return on_running_graph(options, wait, execute)
