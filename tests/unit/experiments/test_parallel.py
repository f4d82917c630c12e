"""Runs on a Dask cluster: asked for through its own interface, in any order, and the same as here."""

import sys
from types import SimpleNamespace

import pytest

from dart_skill.cli import main
from dart_skill.experiments.parallel import all_of, run_all
from dart_skill.experiments.studies import throws

ADDRESS = "tcp://127.0.0.1:8786"


class Cluster:
    """As much of `distributed` as is used: a client that runs what it is given, and gives it back
    from the last to the first.
    """

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
        self.tasks += tasks
        return [
            SimpleNamespace(key=f"{function}-{k}", result=function(task))
            for k, task in enumerate(tasks)
        ]

    def nthreads(self):
        return {ADDRESS: 1}

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


def half(number):
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number // 2


@pytest.fixture(scope="module", params=[1, 2])
def real_cluster(request):
    distributed = pytest.importorskip(
        "distributed", reason="pip install -r requirements/test.txt, or make setup"
    )
    options = {
        "n_workers": 1,
        "threads_per_worker": request.param,
        "host": "127.0.0.1",
        "dashboard_address": None,
    }
    with distributed.LocalCluster(**options) as made:
        yield made.scheduler_address, request.param


def test_runs_are_carried_out_by_workers_of_one_thread(real_cluster):
    address, threads = real_cluster
    if threads > 1:
        with pytest.raises(
            ValueError, match="the worker tcp://.* has several threads.*: give it --nthreads 1"
        ):
            list(run_all(half, [2], scheduler=address))
        return
    assert sorted(run_all(half, [2, 8], scheduler=address)) == [(0, 1), (1, 4)]
    assert dict(run_all(lambda number: number + 1, [1], scheduler=address)) == {0: 2}, (
        "a function that no module has"
    )
    with pytest.raises(ValueError, match="3 is odd"):
        list(run_all(half, [3], scheduler=address))


def test_results_of_a_cluster_come_as_they_finish_and_are_put_in_order(cluster):
    assert list(run_all(twice, [3, 5], scheduler=ADDRESS)) == [(1, [5, 5]), (0, [3, 3])]
    assert all_of(twice, [3, 5], scheduler=ADDRESS) == [3, 3, 5, 5] and cluster.addresses == [
        ADDRESS,
        ADDRESS,
    ]


def test_throws_are_run_on_the_cluster_of_a_scheduler(cluster, monkeypatch, capsys):
    made = throws.ThrowResult(0, "ideal", "default", (1.9, 0.0, 0.4), 0.01, 0.02, True, "")
    monkeypatch.setattr(throws, "run_seed", lambda seed, **_: [made])
    assert (
        main(["experiment", "throws", "--seeds", "3", "--throws", "1", "--scheduler", ADDRESS])
        == 0
    )
    assert cluster.tasks == [0, 1, 2] and cluster.addresses == [ADDRESS]
    assert "3/3" in capsys.readouterr().out


def test_throws_with_a_scheduler_but_without_dask_end_with_the_remedy(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["experiment", "throws", "--seeds", "1", "--scheduler", ADDRESS]) == 1
    assert "pip install -r requirements/optional.txt" in capsys.readouterr().err
