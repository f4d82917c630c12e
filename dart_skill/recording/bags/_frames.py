"""Messages of a topic as a table of pandas."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from dart_skill.common.extras import optional

MOST_ELEMENTS = 64
"""A longer array stays one in its cell."""


def frame_of(messages: Iterable[Any]) -> Any:
    """A pandas.DataFrame: a row for each decoded message, by its log time; a column for each
    number and text in it, by its path.
    """
    pandas = optional("pandas")
    stamps, rows = [], []
    for one in messages:
        stamps.append(one.stamp_ns)
        rows.append(dict(_cells("", one.data)))
    return pandas.DataFrame(
        rows, index=pandas.Index(np.array(stamps, dtype=np.int64), name="log_time_ns")
    )


def _cells(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Paths and values of the leaves of a message."""
    if _is_time(value):
        yield path, int(value.sec) * 1_000_000_000 + int(value.nanosec)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            if name != "__msgtype__":
                yield from _cells(f"{path}.{name}" if path else name, getattr(value, name))
    elif isinstance(value, (np.ndarray, list, tuple)) and len(value) <= MOST_ELEMENTS:
        for k, item in enumerate(value):
            yield from _cells(f"{path}[{k}]", item)
    else:
        yield path, value.item() if isinstance(value, np.generic) else value


def _is_time(value: Any) -> bool:
    """A stamp or a duration, which is one number of nanoseconds."""
    fields: Mapping[str, Any] = getattr(value, "__dataclass_fields__", {})
    return {name for name in fields if name != "__msgtype__"} == {"sec", "nanosec"}
