"""Orientations of a plan, with the formulas of SciPy's `Rotation`, whose import takes longer than all plans of a run.

Quaternions x, y, z, w; the results have the same bits as SciPy's.
"""

from __future__ import annotations

import numpy as np

from dart_skill.quaternions import CONJUGATE

SMALL = 1e-3
"""Below this angle x / sin(x / 2) is its series [rad]."""


def unit(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) of length 1.

    * quaternions: (n, 4), none of them zero.
    """
    x, y, z, w = quaternions.T
    return quaternions / np.sqrt(x * x + y * y + z * z + w * w)[:, None]


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3).

    * quaternions: (n, 4), of length 1.
    """
    x, y, z, w = quaternions.T
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    rows = [
        [xx - yy - zz + ww, 2.0 * (xy - zw), 2.0 * (xz + yw)],
        [2.0 * (xy + zw), -xx + yy - zz + ww, 2.0 * (yz - xw)],
        [2.0 * (xz - yw), 2.0 * (yz + xw), -xx - yy + zz + ww],
    ]
    return np.array(rows).transpose(2, 0, 1)


def turns_between(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors (n - 1, 3) from each orientation to the next [rad].

    * quaternions: (n, 4), of length 1.
    """
    (a, b, c, d), (x, y, z, w) = quaternions[1:].T, (CONJUGATE * quaternions[:-1]).T
    vector = [d * x + w * a + (b * z - c * y), d * y + w * b + (c * x - a * z), d * z + w * c + (a * y - b * x)]
    turn = unit(np.stack([*vector, d * w - a * x - b * y - c * z], axis=1))
    turn = np.where(turn[:, 3:] < 0.0, -turn, turn)
    x, y, z, w = turn.T
    angle = 2.0 * np.arctan2(np.sqrt(x * x + y * y + z * z), w)
    square = angle * angle
    share = 2.0 + square / 12.0 + 7.0 * square * square / 2880.0
    wide = angle > SMALL
    share[wide] = angle[wide] / np.sin(angle[wide] / 2.0)
    return share[:, None] * turn[:, :3]
