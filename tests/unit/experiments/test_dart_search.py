"""Experiments on learning where to aim: regrets against the exact best aim, runs that can be
continued, processes that change nothing.
"""

import json
import sys

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.darts import best_aim
from dart_skill.experiments.parallel import all_of, read_runs, run_all, run_tasks
from dart_skill.experiments.studies import dart_search
from dart_skill.experiments.studies.dart_search import (
    SCHEDULES,
    best_scores,
    run,
    search_task,
    summarise,
    table_of,
)


@pytest.fixture
def short(monkeypatch):
    """A schedule of 200 throws under the name of the thesis's."""
    monkeypatch.setitem(SCHEDULES, "thesis", np.linspace(75.0, 60.0, 200))
    best_scores.cache_clear()
    yield
    best_scores.cache_clear()


OPEN = []


def what_is_open(_):
    return tuple(OPEN)


def square(number):
    if number == 13:
        raise ValueError("thirteen")
    return number**2


def test_the_best_score_of_every_throw_is_that_of_the_best_aim():
    best, sigmas = best_scores("extended"), SCHEDULES["extended"]
    chosen = np.linspace(0, len(sigmas) - 1, 9).astype(int)
    np.testing.assert_allclose(
        best[chosen], [best_aim(sigmas[n]).expected_score for n in chosen], atol=1e-4
    )
    assert (np.diff(best) > 0.0).all(), "a better thrower scores more"


OF_EACH_KIND = (
    "mixture",
    "mixture_daspec",
    "mixture_automatic",
    "mixture_tenth",
    "mixture_automatic_tenfold",
    "power",
    "power_proportional",
)
OF_OTHERS = ("cem", "enac", "reinforce", "restarts", "monte_carlo", "sharpening")


@pytest.mark.parametrize("method", [*OF_EACH_KIND, *OF_OTHERS])
def test_every_method_runs_and_regret_is_never_negative(short, method):
    one = run(search_task(method, "thesis", 1))
    assert len(one["throw_regrets"]) == len(one["best_regrets"]) == len(one["components"]) == 20
    assert min(one["throw_regrets"]) > -1e-3 and min(one["best_regrets"]) > -1e-3
    assert one["throw_regret"] == pytest.approx(np.mean(one["throw_regrets"]), abs=1e-3)


def test_after_the_stop_only_the_best_known_aim_is_thrown_at(short):
    one = run(search_task("power", "thesis", 0, "expected", 100))
    assert (
        one["throw_regrets"][10:] == one["best_regrets"][10:]
        and one["throw_regrets"][:10] != one["best_regrets"][:10]
    )


def test_the_model_based_agent_needs_the_scores_of_darts(short):
    with pytest.raises(ValueError, match="reward 'thrown'"):
        search_task("model_based", "thesis", 0)
    assert run(search_task("model_based", "thesis", 0, "thrown"))["throw_regret"] < 1.0


def test_a_file_of_results_is_continued_and_a_line_that_was_cut_off_is_run_again(
    short, tmp_path, monkeypatch
):
    results, tasks = (
        tmp_path / "results.jsonl",
        [search_task("power", "thesis", seed) for seed in range(3)],
    )
    first = run_tasks(run, tasks[:2], results, jobs=1)
    text = results.read_text()
    results.write_text(text[:-200])
    done = []
    monkeypatch.setattr(dart_search, "run", lambda task: done.append(task["seed"]) or run(task))
    assert run_tasks(dart_search.run, tasks, results, jobs=1)[:2] == first
    assert sorted(done) == [1, 2]
    assert [one["task"]["seed"] for one in read_runs(results)] == [0, 1, 2]


def test_a_damaged_line_within_a_file_of_results_is_an_error_that_names_it(tmp_path):
    results = tmp_path / "results.jsonl"
    results.write_text('{"task": 3}\n{"task": 4}\n')
    with pytest.raises(ValueError, match=r"line 1 of .*results.jsonl is not a run"):
        read_runs(results)


def test_processes_give_the_same_runs_as_one_process(short):
    tasks = [search_task("power", "thesis", seed) for seed in range(2)]
    assert dict(run_all(square, [1, 2, 3, 4], jobs=2)) == {0: 1, 1: 4, 2: 9, 3: 16}
    assert run_tasks(run, tasks, jobs=1) == run_tasks(run, tasks, jobs=1)


def test_a_scheduler_without_dask_here_is_answered_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        ValueError,
        match=(
            r"tcp://127.0.0.1:8786 needs Dask here too: pip install -r requirements/optional.txt"
        ),
    ):
        dict(run_all(square, [1], scheduler="tcp://127.0.0.1:8786"))


def test_a_process_is_no_copy_of_the_one_that_asks():
    """A copy ends nodes of ROS and threads that are not its own, when it collects garbage: that
    once was a segmentation fault.
    """
    OPEN.append("a node")
    try:
        assert dict(run_all(what_is_open, [0, 0], jobs=2)) == {0: (), 1: ()}
    finally:
        OPEN.clear()


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_in_a_process_comes_out_and_names_its_task(jobs):
    """Forty arms ended with an error of one, and nobody could tell which."""
    with pytest.raises(ValueError, match="^task 13: .*thirteen"):
        dict(run_all(square, [1, 13, 2], jobs=jobs))
    with pytest.raises(ValueError, match="^seed 13: .*thirteen"):
        all_of(square, [13, 2], jobs=jobs)


def test_the_table_has_quartiles_over_seeds(short):
    runs = run_tasks(run, [search_task("power", "thesis", seed) for seed in range(4)], jobs=1)
    row = summarise(runs)[0]
    quartiles = np.percentile([one["throw_regret"] for one in runs], [25, 50, 75])
    assert row["runs"] == 4 and row["throw_regret"] == quartiles.round(4).tolist()
    assert row["offline_error"] is None and "offline" not in table_of([row])
    assert "power" in table_of([row]) and f"{row['throw_regret'][1]:.3f}" in table_of([row])


def test_search_on_the_command_line(short, tmp_path, capsys):
    arguments = "darts search --methods power --seeds 2 --jobs 1 --json --results".split()
    assert main([*arguments, str(tmp_path / "r.jsonl")]) == 0
    assert json.loads(capsys.readouterr().out)[0]["runs"] == 2
    assert main(["darts", "search", "--methods", "psychic"]) == 1
    assert (
        "there is no method 'psychic': choose one of mixture, mixture_daspec, mixture_automatic"
        in capsys.readouterr().err
    )
    assert main(["darts", "search", "--seeds", "0"]) == 1
