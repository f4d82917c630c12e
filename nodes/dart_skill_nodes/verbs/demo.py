"""The work of `dart-skill demo` over the real graph; options, table and report are those of
`dart_skill.cli.demo`.
"""

import argparse
import time
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.process.graph_processes import Graph
from dart_skill_nodes.verbs.on_graph import carried_out, say, started
from dart_skill_nodes.verbs.trials import practise_darts, show_all, try_all

if TYPE_CHECKING:
    from dart_skill.session import RunSummary
    from dart_skill.skills.protocol import Skill

COUNTED = 3.0
"""The simulator is waited for so long until it has counted the steps of a short job [s]."""


def demo(options: argparse.Namespace, skill: "Skill") -> "RunSummary | None":
    """The whole job with ROS running; None, and a line why, if it failed."""
    return carried_out(partial(_run, skill=skill), options, "the demo")


def _run(options: argparse.Namespace, skill: "Skill") -> "RunSummary":
    """The job on a graph of its own: lessons and what is learned from them, or a model that was
    learned before, and trials.
    """
    begun, shown, tried = time.monotonic(), options.demonstrations, options.throws
    with Graph(options.output / "logs") as graph:
        client = started(graph, options, skill.name)
        from dart_skill.session import RunSummary
        from dart_skill.simulation import PlantSettings

        ready = client.counted_at if client.simulated_steps else time.monotonic()
        steps, attempts, darts = client.simulated_steps, 0, None
        lessons, situations = skill.situations(options.seed, shown, tried)
        if options.model is None:
            attempts = show_all(client, skill, lessons, shown)
            say(client.learn(configuration=options.configuration).message)
        else:
            say(f"model {client.load(options.model)}: nothing is shown")
        if skill.agent() is None:
            trials = try_all(client, skill, situations, tried)
        else:
            trials, darts = practise_darts(client, skill, options.seed, tried)
        until = time.monotonic() + COUNTED
        while client.counted_at <= ready and time.monotonic() < until:
            client.spin()  # of a job that took less than a second
        simulated = (client.simulated_steps - steps) * PlantSettings().step
        worked = client.counted_at - ready
        client.close()
    of_trials, took = client.throw_seconds
    return RunSummary(
        skill=skill,
        seed=options.seed,
        bag=str(options.output / "bag"),
        demonstrations=shown,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=options.layout,
        real_time_factor=simulated / worked if worked else None,
        trial_real_time_factor=float(of_trials / took) if took else None,
        darts=darts,
    )
