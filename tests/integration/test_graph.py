"""How processes are placed, and how coroutines wait."""

import os

import pytest

from dart_skill_nodes.comms.coroutines import Promise, start


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
    assert said == [] and len(owner.executor.tasks) == 1, "resumed by the executor, not inside of whoever kept the promise"
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


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core")
def test_nodes_that_take_turns_share_a_core_and_nobody_else_has_it(make_graph, tmp_path):
    graph, _ = make_graph(None)
    for executable in ("commander", "wam_simulator", "skill_learner"):
        graph.start(executable)
    cores = {name: os.sched_getaffinity(process.pid) for name, process in graph.processes.items()}
    assert cores["commander"] == cores["wam_simulator"] and len(cores["commander"]) == 1
    assert not cores["skill_learner"] & cores["commander"]
