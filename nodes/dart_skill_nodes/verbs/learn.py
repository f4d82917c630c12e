"""`dart-skill learn` without a bag: a skill from the demonstrations that were published since the
learner was started.

Its options stand in `dart_skill.cli.learn`, which learns from bags without ROS.
"""

import argparse
from typing import TYPE_CHECKING

from dart_skill_nodes.verbs.on_graph import PATIENCE, on_running_graph

if TYPE_CHECKING:
    from dart_skill_nodes.client.graph_client import GraphClient


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Learn; returns the exit status."""

    def learn(client: "GraphClient") -> dict:
        learned = client.learn(
            configuration=options.configuration,
            at_least=options.at_least or 0,
            without=options.without,
        )
        return {
            "text": f"{learned.message}; model {learned.model_id}",
            "demonstrations": int(learned.demonstrations),
            "model_id": learned.model_id,
            "ok": True,
            "next": "dart-skill execute",
        }

    return on_running_graph(options, lambda client: client.wait_for_learner(PATIENCE), learn)
