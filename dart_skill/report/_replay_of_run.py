"""The replay of a run, begun: what it shows of the run is gathered here, and made into a page by whoever has time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from dart_skill.report._replay import Ellipsoid, Replay, in_replay, make_replay
from dart_skill.report._run import Run
from dart_skill.second_process import Begin
from dart_skill.skill.learn import component_ellipsoids


def begin_replay(run: Run, begin: Begin = partial) -> Callable[[], Replay | None]:
    """What gives the replay of a run, None if it has no throw that can be shown. begin: of a second process, which makes it meanwhile."""
    throws = run.own or run.guided
    shown = in_replay(throws)
    if not shown:
        return lambda: None
    guided = {k: throw.demonstration.id for k, throw in enumerate(run.guided) if throw.demonstration is not None}
    purposes = run.purposes
    names = {k: ": ".join(filter(None, (purposes[n - 1], f"throw {n}"))) for k, n in run.numbers.items()} if run.own else guided
    gaussians = {k: _gaussians(run, one.target) for k in shown if (one := throws[k].demonstration) is not None}
    return begin(make_replay, run.recording, throws, run.shown, gaussians, names)


def _gaussians(run: Run, target: np.ndarray) -> Sequence[Ellipsoid]:
    """Of the skill, for a basket; none without one, or where it knows nothing of it."""
    try:
        return component_ellipsoids(run.skill.mixture(target)) if run.skill else ()
    except ValueError:
        return ()
