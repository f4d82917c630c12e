"""A skill that has practised, in a model file: after loading it goes on where it was saved, to the
last bit.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dart_skill.skills.learning import SavedModel, save_model
from dart_skill.skills.practice._correction import CorrectionSettings
from dart_skill.skills.practice._memory import PracticeSettings
from dart_skill.skills.practice._practising import CORRECTIONS, PractisingSkill
from dart_skill.skills.protocol import Skill, ThrowSettings


def save_practised(path: str | Path, skill: PractisingSkill) -> None:
    """Write a model with what practice has found to `path`, which must not exist; the folder must.

    Parameters
    ----------
    skill
        The PractisingSkill. A plan that explores is given up if its throw was not reported.

    Raises
    ------
    FileNotFoundError
        If there is no such folder.
    """
    practised = np.empty((0, 6)) if skill.correction is None else skill.correction.throws
    found = (
        skill.state()
        if skill.practised or skill.practice.n_shown < len(skill.practice.demonstrations)
        else None
    )
    save_model(path, skill.practice.demonstrations, skill.skill.configuration, practised, found)


def practised_skill(
    saved: SavedModel,
    method: str = "residual",
    memory: PracticeSettings | None = None,
    settings: CorrectionSettings | None = None,
    steady_every: int = 0,
    of: Skill | None = None,
) -> PractisingSkill:
    """The skill of a model file, which goes on where practice ended.

    Parameters
    ----------
    saved
        What `load_model` gave.
    method
        How to practise; default "residual". One that has no use for what was found gives way to
        the method that found it; only "none" leaves it out.
    memory, settings, steady_every, of
        As in `PractisingSkill`.

    Raises
    ------
    ValueError
        If what practice found is damaged.
    """
    found = saved.found
    method = _of_use(method, saved)
    n_shown = count_shown(found, len(saved.demonstrations))
    shown, tried = saved.demonstrations[:n_shown], saved.demonstrations[n_shown:]
    assert isinstance(saved.configuration, ThrowSettings)
    skill = PractisingSkill(
        shown,
        saved.configuration,
        method,
        memory,
        settings,
        steady_every=steady_every,
        tried=tried,
        of=of,
    )
    if skill.correction is not None:
        skill.correction.remember(saved.practised)
    if found is not None and (method != "none" or found.get("method") == "none"):
        skill.restore(found)
    return skill


def _of_use(method: str, saved: SavedModel) -> str:
    """The method, or the one that found something which this one could not go on from."""
    found = saved.found
    if found is None or method == "none":
        return method
    kept = found.get("method")
    searched, corrected = found.get("search") is not None, len(saved.practised) > 0
    if (searched and method != "power") or (corrected and method not in CORRECTIONS):
        return str(kept)
    return method


def count_shown(found: dict | None, most: int) -> int:
    """How many of so many demonstrations were shown, and not tried.

    Raises
    ------
    ValueError
        If what practice found is damaged.
    """
    if found is None:
        return most
    n_shown = found.get("n_shown")
    if not isinstance(n_shown, int) or not 0 <= n_shown <= most:
        raise ValueError(
            f"what practice found is damaged (n_shown is {n_shown!r} of {most} demonstrations):"
            " learn from the bag again"
        )
    return n_shown
