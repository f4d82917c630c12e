"""The registration of cameras and arm, told from demonstrations: both say where the hand was."""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmModel, Sightings
from dart_skill.common.arm_choice import joint_count
from dart_skill.recording import Demonstration
from dart_skill.skills.observation._grip import rows_at

INSTANTS = 24
"""Instants of a demonstration at which the two are compared."""


def sightings(demonstration: Demonstration, model: ArmModel) -> Sightings:
    """The hand of a demonstration at some instants; none (k = 0) if the arm's joints were not
    recorded meanwhile.

    Parameters
    ----------
    model
        Of the arm.
    """
    d = demonstration
    if not len(d.joint_time):
        return Sightings(*(np.empty((0, n)) for n in (3, 4, 3, 4, 6)))
    both = np.flatnonzero((d.hand_time >= d.joint_time[0]) & (d.hand_time <= d.joint_time[-1]))
    chosen = both[np.linspace(0, len(both) - 1, min(INSTANTS, len(both))).round().astype(int)]
    states = np.hstack([d.joint_position, d.joint_velocity])
    states = (
        rows_at(d.hand_time[chosen], d.joint_time, states)
        if len(states) > 1
        else np.repeat(states, len(chosen), axis=0)
    )
    q, qd = np.ascontiguousarray(states[:, : joint_count()]), states[:, joint_count() :]
    return Sightings.of_joints(model, q, qd, d.hand_position[chosen], d.hand_quaternion[chosen])
