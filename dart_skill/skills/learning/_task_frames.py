"""Which task frames a configuration uses for one task, in the features that it learns."""

import numpy as np

from dart_skill.movement import (
    TaskFrame,
    azimuth_frame,
    azimuth_of,
    base_frame,
    pointing_at,
    start_frame,
    target_frame,
)
from dart_skill.skills.protocol import ThrowSettings


def frames_for(
    task: np.ndarray, start: np.ndarray, configuration: ThrowSettings
) -> list[TaskFrame]:
    """Task frames of the features t, [distance,] x, y, z, alpha, beta for one task: thesis (8.2),
    (8.3), or turned ones.

    Parameters
    ----------
    task
        Task parameter (3,) [m].
    start
        Position of the hand before it moves, x, y, z [m]; further entries are ignored.
    configuration
        Which frames, and whether the distance of the target is an input.
    """
    start = start[:3]
    if configuration.frames_turn:
        return _turned_frames(task, configuration)
    first = base_frame() if configuration.frames[0] == "base" else start_frame(start)
    frames = [first, target_frame(task, pointing_at(task, start))]
    return [frame.with_input(1) for frame in frames] if configuration.distance_input else frames


def _turned_frames(task: np.ndarray, configuration: ThrowSettings) -> list[TaskFrame]:
    """`azimuth_frame` and, if the configuration has it, `azimuth_target_frame` of a task (3,),
    which have the same axes.
    """
    base = azimuth_frame(azimuth_of(task))
    if configuration.distance_input:
        base = base.with_input(1)  # after time
    if len(configuration.frames) == 1:
        return [base]
    origin, first = np.zeros(base.n_dims), 1 + configuration.distance_input
    origin[first : first + 3] = task
    return [base, base.at(origin)]
