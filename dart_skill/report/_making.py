"""A page from its bag, by one process or two. The other one begins before this one has imported all that it needs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from dart_skill.report._seen import Seen, seen_throws
from dart_skill.second_process import Begin

if TYPE_CHECKING:
    from dart_skill.report._pictures import Picture
    from dart_skill.report._run import About, Run
    from dart_skill.session import ThrowResult


def make_page(
    bag: str | os.PathLike,
    about: About | None = None,
    results: Sequence[ThrowResult] | None = None,
    begin: Begin = partial,
    seen: Callable[[], Seen] | None = None,
    when_drawn: Callable[[Picture], Any] = lambda picture: None,
) -> tuple[Run, str]:
    """A run and its page. BagError if the bag cannot be read.

    bag, about, results: as in `write_page`. begin: of a second process, which reads the streams and makes the replay while this one learns
    and draws. seen: what begin(seen_throws, bag) gave, where the bag is being read already. when_drawn: called with each picture.
    """
    seen = seen or begin(seen_throws, bag)
    from dart_skill.report._replay_of_run import begin_replay
    from dart_skill.report._run import read_run

    def seen_then() -> Seen:
        """What was seen, when it is wanted: matplotlib is imported while the streams are read."""
        import_module("dart_skill.report._pictures")
        return seen()

    run = read_run(bag, about, results, seen_then)
    replay = begin_replay(run, begin)
    from dart_skill.report._page import page_of
    from dart_skill.report._pictures import drawn_pictures

    drawn = []
    for picture in drawn_pictures(run):
        drawn.append(picture)
        when_drawn(picture)
    return run, page_of(run, drawn, replay)
