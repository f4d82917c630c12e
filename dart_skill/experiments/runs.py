"""Runs of an experiment as one file that can be continued: a JSON object per line, the task that
asked for it inside.

A task and its run are frozen dataclasses of numbers, words, and tuples of them; run.task is the
task.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tqdm import tqdm

from dart_skill.experiments.parallel import run_all


def run_tasks(
    function: Callable,
    tasks: Sequence,
    run_type: type,
    task_type: type,
    results: Path | None = None,
    jobs: int = 0,
    scheduler: str = "",
) -> list:
    """function(task) of every task once; those that stand in the file of results already are not
    run again, and each new one is added to it at once.
    """
    known: dict[Any, Any] = {}
    if results and results.exists():
        _drop_unfinished_line(results)
        known = {one.task: one for one in read(results, run_type, task_type)}
    missing = [task for task in dict.fromkeys(tasks) if task not in known]
    for _, one in tqdm(
        run_all(function, missing, jobs, scheduler), total=len(missing), unit="run", disable=None
    ):
        known[one.task] = one
        if results:
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(_plain(asdict(one)), allow_nan=False) + "\n")
    return [known[task] for task in tasks]


def read(results: Path, run_type: type, task_type: type) -> list:
    """Runs of a file, one JSON object a line; ValueError names a line that is not one."""
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
