"""Runs on a Dask cluster: asked for through its own interface, in any order, and the same as here."""

import os
import sys
from types import SimpleNamespace

import pytest

from dart_skill.cli import main
from dart_skill.experiments import throws
from dart_skill.experiments._apart import run_apart
from dart_skill.experiments.parallel import all_of, run_all

ADDRESS = "tcp://127.0.0.1:8786"


class Cluster:
    """As much of `distributed` as is used: a client that runs what it is given, and gives it back from the last to the first."""

    def __init__(self):
        self.addresses, self.tasks = [], []
        self.Client = self._client

    def _client(self, address):
        self.addresses.append(address)
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def map(self, function, tasks, pure):
        assert not pure  # or two runs of one task would be one
        assert function.func is run_apart
        self.tasks += tasks
        return [SimpleNamespace(key=f"{function}-{k}", result=function.args[0](task)) for k, task in enumerate(tasks)]

    def as_completed(self, futures, with_results):
        assert with_results
        return [(future, future.result) for future in futures[::-1]]


@pytest.fixture
def cluster(monkeypatch):
    made = Cluster()
    monkeypatch.setitem(sys.modules, "distributed", made)
    return made


def twice(number):
    return [number, number]


def process_of(task):
    """The process that carries a task out; one of the tasks raises, one ends its process."""
    if task == "raises":
        raise ValueError("no such seed")
    if task == "ends":
        os._exit(3)
    return os.getpid()


def variable(name):
    """Of the environment in which a run is carried out."""
    return os.environ.get(name)


@pytest.fixture(scope="module")
def real_cluster():
    distributed = pytest.importorskip("distributed", reason="pip install -r requirements/test.txt, or make setup")
    options = {"n_workers": 1, "threads_per_worker": 2, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(**options) as made, distributed.Client(made) as client:
        yield made.scheduler_address, next(iter(client.run(os.getpid).values()))


def test_runs_of_a_worker_are_carried_out_in_processes_of_its_threads_that_stay(real_cluster):
    address, worker = real_cluster
    first = set(dict(run_all(process_of, ["a", "b", "c", "d"], scheduler=address)).values())
    again = set(dict(run_all(process_of, ["e", "f", "g", "h"], scheduler=address)).values())
    assert len(first | again) <= 2 and not {worker, os.getpid()} & (first | again)
    assert dict(run_all(lambda number: number + 1, [1], scheduler=address)) == {0: 2}, "a function that no module has"
    assert dict(run_all(variable, ["MALLOC_TRIM_THRESHOLD_"], scheduler=address)) == {0: None}, "else a run takes a tenth longer"


def test_what_a_run_on_a_worker_raises_is_raised_here_and_one_that_ends_its_process_is_named(real_cluster):
    address, _ = real_cluster
    with pytest.raises(ValueError, match="no such seed"):
        dict(run_all(process_of, ["raises"], scheduler=address))
    with pytest.raises(OSError, match="ended with status 3: is there too little memory"):
        dict(run_all(process_of, ["ends"], scheduler=address))
    assert len(dict(run_all(process_of, ["a", "b", "c"], scheduler=address))) == 3, "the worker goes on with a new process"


def test_results_of_a_cluster_come_as_they_finish_and_are_put_in_order(cluster):
    assert list(run_all(twice, [3, 5], scheduler=ADDRESS)) == [(1, [5, 5]), (0, [3, 3])]
    assert all_of(twice, [3, 5], scheduler=ADDRESS) == [3, 3, 5, 5] and cluster.addresses == [ADDRESS, ADDRESS]


def test_throws_are_run_on_the_cluster_of_a_scheduler(cluster, monkeypatch, capsys):
    made = throws.Throw(0, "ideal", "default", (1.9, 0.0, 0.4), 0.01, 0.02, True, "")
    monkeypatch.setattr(throws, "run_seed", lambda seed, **_: [made])
    assert main(["experiment", "throws", "--seeds", "3", "--throws", "1", "--scheduler", ADDRESS]) == 0
    assert cluster.tasks == [0, 1, 2] and cluster.addresses == [ADDRESS]
    assert "3/3" in capsys.readouterr().out


def test_throws_with_a_scheduler_but_without_dask_end_with_the_remedy(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["experiment", "throws", "--seeds", "1", "--scheduler", ADDRESS]) == 1
    assert "pip install -r requirements/optional.txt" in capsys.readouterr().err
