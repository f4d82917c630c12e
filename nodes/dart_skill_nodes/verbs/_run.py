"""What the verbs that run a job on a graph have in common: telling how it goes, lessons, throws,
and how a job fails.

rclpy is imported when something runs: parsers must come at once.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.comms.names import full_name, in_namespace
from dart_skill_nodes.process.discovery import choose_domain, stay_on_this_machine

if TYPE_CHECKING:
    import numpy as np

    from dart_skill.session import ThrowResult
    from dart_skill.skills.protocol import SkillWords
    from dart_skill_nodes.client.graph_client import GraphClient

PATIENCE = 10.0
"""For a graph that is said to run to answer at all [s, wall clock]."""


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def place(target: "np.ndarray") -> str:
    """A basket in words."""
    from dart_skill.session import basket_in_words

    return basket_in_words(target)


def baskets(options: argparse.Namespace, stream: int) -> "np.ndarray":
    """Centres of rims (n, 3) that the options name, or over the region; stream: of random numbers.
    ValueError for a wrong number.
    """
    import numpy as np

    from dart_skill.common.regions import REGION

    if options.at is not None:
        return np.array([options.at])
    if options.count < 1 or options.seed < 0:
        raise ValueError(
            f"--count is {options.count}, --seed {options.seed}: give at least 1, and at least 0"
        )
    return REGION.spread(options.count, np.random.default_rng([options.seed, stream]))


def teach(client: "GraphClient", seed: int, wanted: int) -> int:
    """Lessons until `wanted` throws were demonstrated, at new baskets for those that failed; how
    many throws it took.
    """
    import numpy as np

    from dart_skill.common.regions import REGION, targets_for

    shown = attempts = 0
    targets = targets_for(seed, wanted, 0)[0]
    spare = iter(REGION.spread(wanted, np.random.default_rng([seed, 3])))
    for lesson in range(2 * wanted):
        target = targets[lesson] if lesson < wanted else next(spare)
        result = client.teach(target)
        attempts += result.attempts
        shown += bool(result.success)
        how = f"in after {result.attempts}" if result.success else f"given up: {result.message}"
        say(f"demonstration {shown}/{wanted}: {place(target)}: {how}")
        if shown == wanted and lesson >= wanted - 1:
            return attempts
    raise GraphFailure(f"only {shown} of {wanted} demonstrations succeeded")


def teach_by_hand(client: "GraphClient", wanted: int, words: "SkillWords") -> int:
    """Movements that a person guides on a real arm, told by the Enter key, until so many can be
    learned from; how many that are.

    words: of the skill.
    """
    say("the arm is free now: guide it by hand. Ctrl-D ends the lesson")
    client.release_arm(True)
    shown = 0
    try:
        while shown < wanted:
            ask(words.begin)
            client.start_demonstration()
            ask(words.show)
            stopped = client.stop_demonstration()
            shown += bool(stopped.success and stopped.readable)
            what = f"{stopped.demonstration.id} is kept" if stopped.success else "not kept"
            say(f"demonstration {shown}/{wanted}: {stopped.message or what}")
    except EOFError:
        say("the lesson ends")
    say("the arm is held where it is from now on")
    client.release_arm(False)
    return shown


def ask(text: str) -> None:
    """Wait for the Enter key; EOFError if there is no more input."""
    say(text)
    input()


def throw_with_person(
    client: "GraphClient", targets: Sequence["np.ndarray"] | None
) -> list["ThrowResult"]:
    """One throw at each basket, or without any at the one that the cameras see; a person is told
    when to put the ball into the hand.
    """
    messages: dict[int, str] = {}
    tell = partial(tell_practice, before=0, messages=messages)
    wanted = {"throws": 1, "follow_basket": True} if targets is None else {"targets": targets}
    result = client.practise(**wanted, only_throw=True, on_feedback=tell)
    if len(result.outcomes) < (1 if targets is None else len(targets)):
        raise GraphFailure(f"{full_name(client.node, 'practice')}: {result.message}")
    return [
        throw_result(outcome, messages.get(k, ""))
        for k, outcome in enumerate(result.outcomes, start=1)
    ]


def throw_result(outcome, message: str) -> "ThrowResult":
    """What the cameras saw of a throw, and what the commander said of it."""
    from dart_skill.session import ThrowResult
    from dart_skill_nodes.comms import conversions

    seen = bool(outcome.seen)
    return ThrowResult(
        target=tuple(conversions.target_of(outcome.situation).tolist()),
        landing=(
            tuple(conversions.seen_at(outcome, conversions.LANDING).tolist()) if seen else None
        ),
        error_m=float(outcome.error) if seen else None,
        in_basket=bool(outcome.success),
        message="" if message == "executed" else message,
    )


def tell_practice(feedback, before: int, messages: dict[int, str], what: str = "throw") -> None:
    """What the person should do, and one line per throw, whose message is kept under its number;
    `before`: throws of earlier goals; what: a throw is called.
    """
    from dart_skill.session import throw_in_words
    from dart_skill_nodes.comms import conversions

    if feedback.phase == "waiting":
        say(f"{what} {before + feedback.number}: {feedback.message}")
    if feedback.phase != "done":
        return
    messages[before + feedback.number] = feedback.message
    outcome = feedback.outcome
    became = throw_in_words(
        outcome.success,
        outcome.error if outcome.seen else None,
        feedback.message.removeprefix("executed"),
    )
    say(
        f"{what} {before + feedback.number}: {place(conversions.target_of(outcome.situation))}:"
        f" {became}"
    )


def throw_all(client: "GraphClient", targets: Sequence["np.ndarray"]) -> list["ThrowResult"]:
    """One throw at each basket."""
    from dart_skill_msgs.action import Execute

    from dart_skill.session import throw_in_words

    results = []
    for k, target in enumerate(targets, start=1):
        thrown = client.throw(target)
        result = throw_result(thrown.outcome, thrown.message)
        refused = thrown.code == Execute.Goal.OUTCOME_REFUSED
        became = (
            f"no throw: {result.message}"
            if refused
            else throw_in_words(result.in_basket, result.error_m, result.message)
        )
        say(f"throw {k}/{len(targets)}: {place(target)}: {became}")
        results.append(result)
    return results


def carried_out(job: Callable, options: argparse.Namespace, what: str):
    """job(options) with ROS running, on a domain of its own; None, and a line why, if it failed.
    KeyboardInterrupt if it was stopped.
    """
    choose_domain()
    import rclpy

    options.output.mkdir(parents=True, exist_ok=True)
    rclpy.init(args=[])
    try:
        return job(options)
    except Exception as error:
        if not rclpy.ok():  # a signal that rclpy heard first: it ends the context under the job
            raise KeyboardInterrupt from None
        if not isinstance(error, (GraphFailure, ValueError, OSError)):
            raise
        say(f"{what} failed: {error}")
        say(f"logs: {options.output / 'logs'}")
    finally:
        with suppress(
            RuntimeError
        ):  # a signal that rclpy hears at this very moment has shut it down already
            rclpy.try_shutdown()
    return None


def on_running_graph(
    wait: Callable[["GraphClient"], None],
    task: Callable[["GraphClient"], dict],
    namespace: str = "",
) -> dict:
    """Result of a task on the graph that runs in a namespace, after waiting for what it needs;
    GraphFailure if there is none.
    """
    stay_on_this_machine()
    import rclpy

    from dart_skill_nodes.client.graph_client import GraphClient

    rclpy.init(args=in_namespace(namespace))
    client = GraphClient(name="verb", appears=PATIENCE)
    try:
        try:
            wait(client)
        except GraphFailure as failure:
            raise GraphFailure(
                f"{failure}: does the graph run? 'dart-skill up' starts it, in another terminal"
            ) from failure
        return task(client)
    finally:
        client.close()
        rclpy.try_shutdown()


def of_graph(command: str, namespace: str) -> str:
    """A command of `dart-skill` for the graph of a namespace."""
    return f"{command} --namespace {namespace}" if namespace else command


def print_result(run: Callable[[], dict], as_json: bool, namespace: str = "") -> int:
    """Carry out one thing on a graph, print what came of it as text or as JSON, and give the exit
    status.
    """
    import json

    try:
        result = run()
    except (GraphFailure, ValueError) as failure:
        print(f"dart-skill: {failure}", file=sys.stderr)
        return 1
    text = f"{result.pop('text')}\nnext: {of_graph(result.pop('next'), namespace)}"
    print(json.dumps(result) if as_json else text)
    return 0 if result["ok"] else 1
