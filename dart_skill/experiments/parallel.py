"""Independent runs on all cores of this machine, or on a Dask cluster that already exists, and
runs as one file that can be continued.
"""

from __future__ import annotations

import importlib
import json
import math
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from tqdm import tqdm


def all_of(
    function: Callable, seeds: Sequence, jobs: int = 1, scheduler: str = "", **options: Any
) -> list[Any]:
    """What function(seed, **options) lists for every seed, in their order, `jobs` processes at a
    time; a progress bar where stderr is a terminal.

    Parameters
    ----------
    jobs, scheduler
        As in `run_all`.
    """
    done = run_all(partial(function, **options), seeds, jobs, scheduler, "seed")
    parts = dict(tqdm(done, total=len(seeds), unit="seed", disable=None))
    return [one for index in range(len(seeds)) for one in parts[index]]


def run_all(
    function: Callable, tasks: Sequence, jobs: int = 0, scheduler: str = "", what: str = "task"
) -> Iterator[tuple[int, Any]]:
    """(index, function(task)) of every task as it finishes, in any order.

    Parameters
    ----------
    jobs
        Processes on this machine, 0 for one per core.
    scheduler
        Address of a Dask scheduler, whose workers have this package installed. An exception of a
        task is raised here, and the tasks not begun are not run. Ctrl-C, or no interest in more
        results, ends the workers at once; they end by themselves when this process does, however
        that goes.
    what
        Is a task, in a word: a ValueError names it.
    """
    if scheduler:
        yield from _on_dask(function, tasks, scheduler)
        return
    jobs = min(jobs or os.cpu_count() or 1, len(tasks))
    if jobs <= 1:
        yield from (
            (index, _named(what, task, partial(function, task)))
            for index, task in enumerate(tasks)
        )
        return
    # Workers are never copies of this process, which may have threads, or nodes of ROS, that a
    # copy would end again.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([getattr(function, "func", function).__module__])
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_parent) as pool:
        # Workers inherit that Ctrl-C is blocked: this process ends them.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            futures = {pool.submit(function, task): index for index, task in enumerate(tasks)}
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            for future in as_completed(futures):
                index = futures[future]
                yield index, _named(what, tasks[index], future.result)
        except (KeyboardInterrupt, SystemExit, GeneratorExit):
            # it has no public way to end a task that runs (from Python 3.14 on)
            for worker in list(pool._processes.values()):
                worker.terminate()
            raise
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            pool.shutdown(wait=True, cancel_futures=True)


def _named(what: str, task: Any, result: Callable[[], Any]) -> Any:
    """The result of a task, whose errors name it."""
    try:
        return result()
    except ValueError as error:
        raise ValueError(f"{what} {task}: {error}") from error


def _end_with_parent() -> None:
    """From now on this process ends when its parent does."""

    def wait() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None  # as of every worker
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _on_dask(function: Callable, tasks: Sequence, scheduler: str) -> Iterator[tuple[int, Any]]:
    try:
        dask = importlib.import_module("distributed")
    except ImportError:
        raise ValueError(
            f"a scheduler at {scheduler} needs Dask here too: pip install -r"
            " requirements/optional.txt"
        ) from None
    with dask.Client(scheduler) as client:
        if crowded := [address for address, threads in client.nthreads().items() if threads > 1]:
            raise ValueError(
                f"the worker {crowded[0]} has several threads, whose runs would share one"
                " PyBullet: give it --nthreads 1"
            )
        futures = client.map(function, tasks, pure=False)
        index_of = {future.key: index for index, future in enumerate(futures)}
        for future, result in dask.as_completed(futures, with_results=True):
            yield index_of[future.key], result


def run_tasks(
    run: Callable[[dict], dict],
    tasks: Sequence[dict],
    results: Path | None = None,
    jobs: int = 0,
    scheduler: str = "",
) -> list[dict]:
    """run(task) of every task once; those that stand in the file of results already are not run
    again, and each new one is added to it at once.

    Parameters
    ----------
    run
        A function of a task, which returns its run with the task as `task`. Both are dicts of
        numbers, words, and lists of them.
    tasks
        In the order of the result.
    results
        The file, a JSON object a line.
    """
    known: dict[str, dict] = {}
    if results and results.exists():
        # What a run that was killed while it wrote has left behind would spoil the next line.
        text = results.read_bytes()
        if not text.endswith(b"\n"):
            results.write_bytes(text[: text.rfind(b"\n") + 1])
        known = {_key(one["task"]): one for one in read_runs(results)}
    missing = {_key(task): task for task in tasks if _key(task) not in known}
    done = run_all(run, list(missing.values()), jobs, scheduler)
    for _, one in tqdm(done, total=len(missing), unit="run", disable=None):
        known[_key(one["task"])] = one
        if results:
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(_nan_as_null(one), allow_nan=False) + "\n")
    return [known[_key(task)] for task in tasks]


def read_runs(results: Path) -> list[dict]:
    """Runs of a file of `run_tasks`.

    Raises
    ------
    ValueError
        Names a line that is not one.
    """
    runs = []
    for number, line in enumerate(results.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            row = json.loads(line)
            runs.append({**_null_as_nan(row), "task": {**row["task"]}})
        except (ValueError, TypeError, KeyError) as error:
            raise ValueError(
                f"line {number} of {results} is not a run ({error}): move the file away, or"
                " remove the line"
            ) from error
    return runs


def _key(task: dict) -> str:
    return json.dumps(task, sort_keys=True)


def _nan_as_null(value: Any) -> Any:
    """JSON knows no NaN: it is null inside of a list."""
    if isinstance(value, dict):
        return {name: _nan_as_null(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_nan_as_null(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _null_as_nan(value: Any, within: bool = False) -> Any:
    """The inverse of `_nan_as_null`."""
    if isinstance(value, dict):
        return {name: _null_as_nan(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_null_as_nan(part, True) for part in value]
    return math.nan if value is None and within else value
