"""The work of `dart-skill demo` over the real graph; options, table and report are those of
`dart_skill.cli.demo`.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.process.discovery import has_own_domain
from dart_skill_nodes.process.graph_processes import LAYOUTS, NODES, Graph, of_executables
from dart_skill_nodes.verbs._darts_run import play_leg, practise_darts
from dart_skill_nodes.verbs._run import carried_out, say, teach, throw_all
from dart_skill_nodes.verbs._skill_run import drawn, execute_all, show_all

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.session import DartsSummary, DemoSummary, SkillSummary
    from dart_skill.skills.darts import Darts
    from dart_skill.skills.protocol import Skill
    from dart_skill_nodes.client.graph_client import GraphClient

__all__ = ["carried_out", "run", "run_darts", "run_skill"]


def _started(graph: Graph, options: argparse.Namespace, skill: str = "") -> "GraphClient":
    """A client of the graph, which has been started and is ready. Where others may use the ROS
    domain, nodes of before must be gone first; where nobody does, nodes start while this process
    imports what a client needs.
    """
    extra = of_executables(options.layout, options.differs)
    start = partial(
        graph.start_all, options.layout, options.seed, options.output / "bag", extra, skill
    )
    if alone := has_own_domain():
        start()
    import dart_skill.session  # noqa: F401  the job needs it next
    from dart_skill_nodes.client.graph_client import GraphClient

    client = GraphClient(graph.dead)
    if not alone:
        client.wait_until_gone(NODES)
        start()
    client.wait_until_ready()
    return client


@contextmanager
def _learned_graph(
    options: argparse.Namespace, skill: "Skill", rng: "np.random.Generator"
) -> "Iterator[tuple[GraphClient, int]]":
    """A graph of its own that was shown a skill and has learned it: a client, and how many
    attempts the lessons took.
    """
    with Graph(options.output / "logs") as graph:
        say(
            f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])} with the skill"
            f" {skill.name}"
        )
        client = _started(graph, options, skill.name)
        attempts = _learned(
            client, options, lambda: show_all(client, skill, options.demonstrations, rng)
        )
        if options.model is not None:
            rng.random(1000)  # other situations than those in which it may have been shown
        yield client, attempts
        client.close()


def _learned(
    client: "GraphClient", options: argparse.Namespace, lessons: Callable[[], int]
) -> int:
    """Lessons, and what is learned from them, or a model that was learned before; how many
    attempts the lessons took.
    """
    if options.model is not None:
        say(f"model {client.load(options.model)}: nobody shows anything")
        return 0
    attempts = lessons()
    say(client.learn(configuration=options.configuration).message)
    return attempts


def run_darts(options: argparse.Namespace, skill: "Darts") -> "DartsSummary":
    """Darts on a graph of its own: shown, learned, practised, and a leg of 501."""
    from dart_skill.session import DartsRun, DartsSummary, SkillResult, SkillSummary
    from dart_skill_nodes.comms import conversions

    begun = time.monotonic()
    with _learned_graph(options, skill, drawn(options.seed)) as (client, attempts):
        done = practise_darts(client, skill, options.throws)
        say(done.result.message)
        leg = play_leg(client, skill, done.agent)
    trials = [
        SkillResult(conversions.situation(one.situation), conversions.task_outcome(one), dart.note)
        for one, dart in zip(done.result.outcomes, done.darts, strict=True)
    ]
    of = SkillSummary(
        skill=skill.name,
        seed=options.seed,
        bag=str(options.output / "bag"),
        demonstrations=options.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=options.layout,
    )
    return DartsSummary(
        of, DartsRun(options.seed, "of the graph", skill.bull, (), done.darts), leg
    )


def run_skill(options: argparse.Namespace, skill: "Skill") -> "SkillSummary":
    """The whole job of any skill on a graph of its own."""
    from dart_skill.session import SkillSummary

    bag, begun, rng = options.output / "bag", time.monotonic(), drawn(options.seed)
    with _learned_graph(options, skill, rng) as (client, attempts):
        trials = execute_all(client, skill, options.throws, rng)
    simulated, took = client.throw_seconds
    return SkillSummary(
        skill=skill.name,
        seed=options.seed,
        bag=str(bag),
        demonstrations=options.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=options.layout,
        real_time_factor=float(simulated / took),
    )


def run(options: argparse.Namespace) -> "DemoSummary":
    """The whole job on a graph of its own.

    options: of the command.
    """
    begun = time.monotonic()
    with Graph(options.output / "logs") as graph:
        say(f"seed {options.seed}; starting {', '.join(LAYOUTS[options.layout])}")
        client = _started(graph, options)
        from dart_skill.common.regions import targets_for
        from dart_skill.session import DemoSummary
        from dart_skill.simulation import PlantSettings

        ready, steps = (
            client.counted_at if client.simulated_steps else time.monotonic(),
            client.simulated_steps,
        )
        attempts = _learned(
            client, options, lambda: teach(client, options.seed, options.demonstrations)
        )
        results = throw_all(
            client, targets_for(options.seed, options.demonstrations, options.throws)[1]
        )
        until = time.monotonic() + 3.0
        while client.counted_at <= ready and time.monotonic() < until:
            client.spin()  # of a job that took less than a second
        simulated, worked = (
            (client.simulated_steps - steps) * PlantSettings().step,
            client.counted_at - ready,
        )
        client.close()
    return DemoSummary(
        seed=options.seed,
        bag=str(options.output / "bag"),
        demonstrations=options.demonstrations,
        attempts=attempts,
        throws=tuple(results),
        wall_seconds=time.monotonic() - begun,
        real_time_factor=simulated / worked,
        throw_real_time_factor=float(client.throw_seconds[0] / client.throw_seconds[1]),
        layout=options.layout,
    )
