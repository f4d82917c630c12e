"""How processes are placed, and how coroutines wait."""

import os
import time

import numpy as np
import pytest
import rclpy
from std_msgs.msg import Empty

from dart_skill_nodes.comms.coroutines import Promise, pause, start, within
from dart_skill_nodes.comms.qos import WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import OK, Diagnostics, make_executor
from tests.integration.conftest import until


class Executor:
    """Keeps what it is told to run, and runs it when told."""

    def __init__(self):
        self.tasks = []

    def create_task(self, task):
        self.tasks.append(task)

    def run(self):
        tasks, self.tasks = self.tasks, []
        for task in tasks:
            task()


class Owner:
    def __init__(self):
        self.executor = Executor()


def test_a_routine_sleeps_until_its_promise_is_kept_and_is_resumed_once():
    owner, promises, said, ended = Owner(), [Promise(), Promise()], [], []

    async def inner(promise):
        return await promise

    async def routine():
        said.append(await promises[0])
        said.append(await inner(promises[1]))
        return "done"

    start(owner, routine(), lambda result, error: ended.append((result, error)))
    owner.executor.run()
    assert said == [] and owner.executor.tasks == [], "nothing to do while it waits"
    promises[0].keep("first")
    promises[0].keep("too late")
    assert said == [] and len(owner.executor.tasks) == 1, (
        "resumed by the executor, not inside of whoever kept the promise"
    )
    owner.executor.run()
    promises[1].keep("second")
    owner.executor.run()
    assert said == ["first", "second"] and ended == [("done", None)]


def test_a_promise_that_is_kept_already_does_not_wait():
    owner, promise, ended = Owner(), Promise(), []
    promise.keep(3)

    async def routine():
        return await promise

    start(owner, routine(), lambda result, error: ended.append(result))
    assert ended == [3]


def test_the_error_of_a_routine_goes_to_whoever_started_it():
    ended = []

    async def routine():
        raise ValueError("no")

    start(Owner(), routine(), lambda result, error: ended.append(str(error)))
    assert ended == ["no"]


def test_many_waits_at_once_end_in_time_and_rclpy_has_nothing_to_say_of_their_timers(ros, capfd):
    """It printed a warning for each wait, from the eighth on, on the terminal of whoever had
    started a viewer.
    """
    node, executor, ended, promise = rclpy.create_node("patient"), make_executor(), [], Promise()
    executor.add_node(node)
    limits = [0.05 * number for number in range(20, 0, -1)]
    begun = time.monotonic()
    for limit in limits:
        start(
            node,
            pause(node, limit),
            lambda result, error, limit=limit: ended.append((limit, time.monotonic() - begun)),
        )
    start(node, within(node, promise, 60.0), lambda result, error: ended.append((result, 0.0)))
    promise.keep("early")
    until(lambda: len(ended) == 21, lambda: executor.spin_once(timeout_sec=0.1))
    node.destroy_node()
    assert ended[0] == ("early", 0.0) and [limit for limit, _ in ended[1:]] == limits[::-1]
    assert all(after >= limit for limit, after in ended[1:])
    said = capfd.readouterr()
    assert "Warning" not in said.out + said.err


def test_a_watchdog_is_called_when_it_is_due_while_routines_wait_beside_it(ros):
    """rclpy's EventsExecutor calls a timer too often, and then not for seconds, when others of its
    clock come and go.
    """
    node, executor, calls, period = rclpy.create_node("busy"), make_executor(), [], 0.05
    executor.add_node(node)
    begun = time.monotonic()
    node.create_timer(period, lambda: calls.append(time.monotonic()), clock=WALL)
    again = node.create_publisher(Empty, "~/again", 10)

    def routine(_):
        time.sleep(0.002)
        again.publish(Empty())
        start(node, pause(node, 0.01), lambda result, error: None)

    node.create_subscription(Empty, "~/again", routine, 10)
    while again.get_subscription_count() == 0:
        executor.spin_once(timeout_sec=0.1)
    for _ in range(3):
        again.publish(Empty())
    while len(calls) < 40:
        executor.spin_once(timeout_sec=0.1)
    node.destroy_node()
    for number, called in enumerate(calls, start=1):
        assert called - begun >= number * period - 0.01, f"call {number} came too early"


def test_a_node_that_is_configured_slowly_does_not_lose_its_status(ros):
    """Timers that are made while the status is due silence it for a second each, where they are of
    the same clock.
    """
    node, executor, told = GuardedNode("slow"), make_executor(), []
    executor.add_node(node)
    Diagnostics(node, lambda: (told.append(time.monotonic()) or OK, "well", {}))

    def configure(_):
        time.sleep(1.2)
        for _ in range(6):
            node.create_timer(60.0, lambda: None, clock=WALL)

    node.create_subscription(Empty, "~/configure", configure, 10)
    begin = node.create_publisher(Empty, "~/configure", 10)
    while begin.get_subscription_count() == 0:
        executor.spin_once(timeout_sec=0.1)
    begin.publish(Empty())
    while not told or told[-1] - told[0] < 4.0:
        executor.spin_once(timeout_sec=0.1)
    node.destroy_node()
    assert max(np.diff(told)) < 3.0


@pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core"
)
def test_nodes_that_take_turns_share_a_core_and_nobody_else_has_it(make_graph, tmp_path):
    graph, _ = make_graph(None)
    for executable in ("commander", "wam_simulator", "skill_learner"):
        graph.start(executable)
    cores = {name: os.sched_getaffinity(process.pid) for name, process in graph.processes.items()}
    assert cores["commander"] == cores["wam_simulator"] and len(cores["commander"]) == 1
    assert not cores["skill_learner"] & cores["commander"]


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity")
def test_where_no_nodes_take_turns_every_process_has_all_cores(make_graph):
    """On two cores `composed` and the learner shared one, and nobody had the other."""
    graph, _ = make_graph(None)
    for executable in ("composed", "skill_learner"):
        graph.start(executable)
    assert [os.sched_getaffinity(process.pid) for process in graph.processes.values()] == [
        os.sched_getaffinity(0)
    ] * 2
