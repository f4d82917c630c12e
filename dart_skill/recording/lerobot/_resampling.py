"""Streams of any rate at the frames of a dataset, which are 1 / fps apart.

What is a state is taken at the instant of its frame, between the two samples around it: positions
linearly, turns on the shortest way (slerp). What holds until the next value comes, as a command
does, is averaged over the frame, from its instant to the next one: the sum over all frames is that
of the stream, whatever the rates are. A signal that switches between 0 and 1 so keeps the instant
at which it did.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

CERTAIN = 1e-3
"""Largest distance of a share of a frame from 0 or 1 that counts as that: values are stored with 24
bits.
"""


def frame_times(duration: float, fps: float) -> np.ndarray:
    """Instants (n,) k / fps of all frames from 0 to a duration [s], at least one."""
    return np.arange(max(0, int(np.floor(duration * fps + 1e-6))) + 1) / fps


def at_frames(stamps: np.ndarray, values: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Values (m, k) at stamps (m,) as they are at frames (n,): (n, k). Before the first and after
    the last sample as it was there.
    """
    return np.column_stack([np.interp(frames, stamps, column) for column in values.T])


def turned_at_frames(
    stamps: np.ndarray, quaternions: np.ndarray, frames: np.ndarray
) -> np.ndarray:
    """Orientations (m, 4), x, y, z, w, at frames (n,): (n, 4) of norm 1 and continuous sign, the
    first one with w >= 0.

    Parameters
    ----------
    stamps
        (m,) [s].
    quaternions
        The orientations.
    """
    if len(stamps) == 1:
        turned = np.tile(Rotation.from_quat(quaternions[0]).as_quat(), (len(frames), 1))
    else:
        turned = Slerp(stamps, Rotation.from_quat(quaternions))(
            np.clip(frames, stamps[0], stamps[-1])
        ).as_quat()
    flips = np.sum(turned[1:] * turned[:-1], axis=1) < 0.0
    signs = np.where(np.cumsum(np.concatenate([[turned[0, 3] < 0.0], flips])) % 2, -1.0, 1.0)
    return turned * signs[:, None]


def held_mean(
    stamps: np.ndarray, values: np.ndarray, frames: np.ndarray, fps: float, hold: float = np.inf
) -> np.ndarray:
    """Mean over each frame (n,), until 1 / fps later, of what holds from each of the stamps (m,)
    until the next one: (n, k) of (m, k).

    Parameters
    ----------
    hold
        So long at most [s]; then, and before the first stamp, it is 0.
    values
        (m, k).
    """
    ends = np.minimum(np.append(stamps[1:], np.inf), stamps + hold)
    ends = np.minimum(ends, max(frames[-1] + 1.0 / fps, stamps[-1]) + 1.0)
    edges = np.column_stack([stamps, ends]).ravel()
    gained = np.zeros((len(edges), values.shape[1]))
    gained[1::2] = values * (ends - stamps)[:, None]
    integral = np.cumsum(gained, axis=0)
    both = [at_frames(edges, integral, instants) for instants in (frames, frames + 1.0 / fps)]
    return (both[1] - both[0]) * fps


def seen_at(stamps: np.ndarray, frames: np.ndarray, fps: float) -> np.ndarray:
    """1 for each frame (n,) that stands for a sample (m,), or between two that follow each other;
    0 for one in a gap, or beyond the ends.

    A gap is longer than one and a half periods of the slower of the two: what is on a straight
    line across it was not seen, however near a sample is to it.

    Parameters
    ----------
    fps
        Frames per second.
    stamps
        (m,) [s].
    """
    period = max(1.0 / fps, float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0)
    after = np.searchsorted(stamps, frames)
    before, behind = (stamps[np.clip(k, 0, len(stamps) - 1)] for k in (after - 1, after))
    nearest = np.minimum(np.abs(frames - before), np.abs(behind - frames))
    between = (before <= frames) & (frames <= behind) & (behind - before < 1.5 * period)
    return (between | (nearest < 0.75 / fps)).astype(float)


def changes_at(share: np.ndarray, fps: float) -> list[tuple[float, bool]]:
    """When a signal (n,) that `held_mean` brought to frames switched [s], and whether on; also one
    that only ever is 0 or 1.

    Parameters
    ----------
    fps
        Frames per second.
    share
        The signal, from 0 to 1.
    """
    found: list[tuple[float, bool]] = []
    on = bool(share[0] >= 1.0 - CERTAIN)
    for k, value in enumerate(share):
        if value > CERTAIN and not on:
            found.append(((k + 1.0 - min(value, 1.0)) / fps, True))
        elif value < 1.0 - CERTAIN and on:
            found.append(((k + max(value, 0.0)) / fps, False))
        else:
            continue
        on = not on
    return found
