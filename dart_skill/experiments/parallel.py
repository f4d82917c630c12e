"""Independent runs on all cores of this machine, or on a Dask cluster that already exists."""

from __future__ import annotations

import importlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any


def run_all(function: Callable, tasks: Sequence, jobs: int = 0, scheduler: str = "") -> Iterator[tuple[int, Any]]:
    """(index, function(task)) of every task as it finishes, in any order.

    jobs: processes on this machine, 0 for one per core; scheduler: address of a Dask scheduler, whose workers have this package installed.
    An exception of a task is raised here, and the tasks not begun are not run.
    """
    if scheduler:
        yield from _on_dask(function, tasks, scheduler)
        return
    jobs = min(jobs or os.cpu_count() or 1, len(tasks))
    if jobs <= 1:
        yield from ((index, function(task)) for index, task in enumerate(tasks))
        return
    with ProcessPoolExecutor(jobs, mp_context=_workers(function)) as pool:
        futures = {pool.submit(function, task): index for index, task in enumerate(tasks)}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _workers(function: Callable) -> multiprocessing.context.BaseContext:
    """How processes are made: never as copies of this one. Who asks may have threads, or nodes of ROS, which a copy would end again."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([getattr(function, "func", function).__module__])
    return context


def _on_dask(function: Callable, tasks: Sequence, scheduler: str) -> Iterator[tuple[int, Any]]:
    try:
        dask = importlib.import_module("distributed")
    except ImportError:
        raise ValueError(f"a scheduler at {scheduler} needs Dask here too: pip install -r requirements/optional.txt") from None
    with dask.Client(scheduler) as client:
        futures = client.map(function, tasks, pure=False)
        index_of = {future.key: index for index, future in enumerate(futures)}
        for future, result in dask.as_completed(futures, with_results=True):
            yield index_of[future.key], result
