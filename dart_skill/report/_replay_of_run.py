"""The replay of a run: what it shows of the run is gathered here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dart_skill.report._replay import Ellipsoid, Replay, in_replay, make_replay
from dart_skill.report._run import Run
from dart_skill.skills.learning import component_ellipsoids


def replay_of(run: Run) -> Replay | None:
    """The replay of a run, None if it has no throw that can be shown."""
    throws = run.own or run.guided
    shown = in_replay(throws)
    if not shown:
        return None
    guided = {
        k: throw.demonstration.id
        for k, throw in enumerate(run.guided)
        if throw.demonstration is not None
    }
    purposes = run.purposes
    names = (
        {
            k: ": ".join(filter(None, (purposes[n - 1], f"throw {n}")))
            for k, n in run.numbers.items()
        }
        if run.own
        else guided
    )
    gaussians = {
        k: _gaussians(run, one.target)
        for k in shown
        if (one := throws[k].demonstration) is not None
    }
    return make_replay(run.recording, throws, run.shown, gaussians, names)


def _gaussians(run: Run, target: np.ndarray) -> Sequence[Ellipsoid]:
    """Gaussians of the skill for a basket; none without a skill, or where it knows nothing of the
    basket.
    """
    try:
        return component_ellipsoids(run.skill.mixture(target)) if run.skill else ()
    except ValueError:
        return ()
