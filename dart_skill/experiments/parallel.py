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
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tqdm import tqdm

DEAF = "dart_skill.experiments._deaf_to_ctrl_c"
"""A process that imports this module ignores Ctrl-C, and so do the processes that it makes."""
ORPHANED = 1.0
"""Time between two looks of a worker whether its parent still runs [s]."""


def all_of(
    function: Callable, seeds: Sequence[int], jobs: int = 1, scheduler: str = ""
) -> list[Any]:
    """What function(seed) lists for every seed, in their order, `jobs` processes at a time; a
    progress bar where stderr is a terminal.

    Parameters
    ----------
    scheduler
        As in `run_all`.
    """
    parts = dict(
        tqdm(
            run_all(function, seeds, jobs, scheduler), total=len(seeds), unit="seed", disable=None
        )
    )
    return [one for index in range(len(seeds)) for one in parts[index]]


def run_all(
    function: Callable, tasks: Sequence, jobs: int = 0, scheduler: str = ""
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
    """
    if scheduler:
        yield from _on_dask(function, tasks, scheduler)
        return
    jobs = min(jobs or os.cpu_count() or 1, len(tasks))
    if jobs <= 1:
        yield from ((index, function(task)) for index, task in enumerate(tasks))
        return
    with ProcessPoolExecutor(
        jobs, mp_context=_workers(function), initializer=_end_with_parent
    ) as pool:
        try:  # from the first task on: workers are being started then
            # or a worker that was just asked for is not known, and not ended
            with _signals_held_back():
                futures = {pool.submit(function, task): index for index, task in enumerate(tasks)}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except (KeyboardInterrupt, SystemExit, GeneratorExit):
            # it has no public way to end a task that runs (from Python 3.14 on)
            for worker in list(pool._processes.values()):
                worker.terminate()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _end_with_parent() -> None:
    """From now on this process ends when its parent does."""

    def watch(parent: int = os.getppid()) -> None:
        while os.getppid() == parent:
            time.sleep(ORPHANED)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _workers(function: Callable) -> multiprocessing.context.BaseContext:
    """How processes are made: never as copies of this one. Who asks may have threads, or nodes of
    ROS, which a copy would end again.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([getattr(function, "func", function).__module__, DEAF])
    return context


@contextmanager
def _signals_held_back() -> Iterator[None]:
    """Ctrl-C and SIGTERM that come meanwhile come afterwards. In other threads than the main one,
    which hears them, nothing is held.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: came.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
    for late in came:
        signal.raise_signal(late)


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
    run: Callable,
    tasks: Sequence,
    run_type: type,
    results: Path | None = None,
    jobs: int = 0,
    scheduler: str = "",
) -> list:
    """run(task) of every task once; those that stand in the file of results already are not run
    again, and each new one is added to it at once.

    A task and its run are frozen dataclasses of numbers, words, and tuples of them; run.task is
    the task.

    Parameters
    ----------
    run
        A function of a task, which returns its run.
    tasks
        In the order of the result.
    results
        The file, a JSON object a line.
    """
    known: dict[Any, Any] = {}
    if tasks and results and results.exists():
        _drop_unfinished_line(results)
        known = {one.task: one for one in read_runs(results, run_type, type(tasks[0]))}
    missing = [task for task in dict.fromkeys(tasks) if task not in known]
    for _, one in tqdm(
        run_all(run, missing, jobs, scheduler), total=len(missing), unit="run", disable=None
    ):
        known[one.task] = one
        if results:
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(_plain(asdict(one)), allow_nan=False) + "\n")
    return [known[task] for task in tasks]


def read_runs(results: Path, run_type: type, task_type: type) -> list:
    """Runs of a file of `run_tasks`.

    Raises
    ------
    ValueError
        Names a line that is not one.
    """
    lines = results.read_text(encoding="utf-8").splitlines()
    return [
        _parsed(line, run_type, task_type, f"line {number} of {results}")
        for number, line in enumerate(lines, start=1)
    ]


def _parsed(line: str, run_type: type, task_type: type, where: str) -> Any:
    try:
        row = json.loads(line)
        task = task_type(**{name: _tuples(value) for name, value in row["task"].items()})
        return run_type(**{**{name: _tuples(value) for name, value in row.items()}, "task": task})
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ValueError(
            f"{where} is not a run ({error}): move the file away, or remove the line"
        ) from error


def _drop_unfinished_line(results: Path) -> None:
    """What a run that was killed while it wrote has left behind would spoil the next line."""
    text = results.read_bytes()
    if not text.endswith(b"\n"):
        results.write_bytes(text[: text.rfind(b"\n") + 1])


def _plain(value: Any) -> Any:
    """JSON knows no NaN: null inside of a list."""
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _tuples(value: Any) -> Any:
    return (
        tuple(math.nan if part is None else _tuples(part) for part in value)
        if isinstance(value, list)
        else value
    )
