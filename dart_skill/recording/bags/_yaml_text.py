"""YAML of a stranger: read only if it is small, flat, and does not unfold to more than it says.

A parser that builds what it reads crashes on 100,000 brackets, and fills the memory with a few
aliases of aliases. So the events of a text are counted first, which takes neither depth nor
memory.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import yaml

LARGEST_TEXT = 2_000_000
"""Size of the metadata of a bag of ten thousand files [characters]."""
DEEPEST, MOST_NODES = 30, 200_000
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load(text: str, what: str) -> Any:
    """What a YAML text says; ValueError, with `what` it is, for one that is no YAML, or that asks
    for too much.
    """
    check(text, what)
    try:
        return yaml.load(text, Loader=_LOADER)
    except (
        yaml.YAMLError,
        ValueError,
        RecursionError,
    ) as error:  # the second: numbers and dates that are none
        raise ValueError(f"{what} is no YAML: {error}") from error


def check(text: str, what: str) -> None:
    """ValueError for a text that `load` refuses without building anything of it."""
    if len(text) > LARGEST_TEXT:
        raise ValueError(
            f"{what} has {len(text)} characters, more than the {LARGEST_TEXT} of any bag"
        )
    count, too_deep = _Count(), f"{what} is nested deeper than {DEEPEST} levels"
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            count.take(event)
            if len(count.open) > DEEPEST:
                raise ValueError(too_deep)
            if count.total > MOST_NODES:
                raise ValueError(
                    f"{what} has more than {MOST_NODES} entries once its aliases are followed"
                )
    except yaml.YAMLError as error:
        # PyYAML 6.0.4 looks far enough ahead of its events to meet a limit of its own before ours
        raise ValueError(
            too_deep if "nesting depth" in str(error) else f"{what} is no YAML: {error}"
        ) from error


@dataclass
class _Count:
    """Nodes so far, each as often as aliases repeat it. open: anchor and number of nodes before
    each collection that has not ended.
    """

    total: int = 0
    open: list[tuple[str | None, int]] = field(default_factory=list)
    sizes: dict[str, int] = field(default_factory=dict)

    def take(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.AliasEvent):
            self.total += self.sizes.get(
                event.anchor, MOST_NODES
            )  # one that is within itself never ends
        elif isinstance(event, yaml.CollectionStartEvent):
            self.open.append((event.anchor, self.total))
            self.total += 1
        elif isinstance(event, yaml.ScalarEvent):
            self.total += 1
            self._name(event.anchor, 1)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = self.open.pop()
            self._name(anchor, self.total - before)

    def _name(self, anchor: str | None, size: int) -> None:
        if anchor is not None:
            self.sizes[anchor] = size
