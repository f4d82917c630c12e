"""Orientations that leap between two solutions are found, and brought back to the one that was
seen more often.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.recording.imports import PoseStream, find_leaps, repair

N = 600
TIME = 0.01 * np.arange(N)
TURN = Rotation.from_euler(
    "zyx", np.column_stack([np.sin(TIME), 0.5 * np.cos(2.0 * TIME), TIME])
) * Rotation.from_rotvec(0.002 * np.random.default_rng(0).standard_normal((N, 3)))
POSITION = np.column_stack([np.sin(TIME), np.cos(TIME), TIME]) + 1e-4 * np.random.default_rng(
    1
).standard_normal((N, 3))


def stream(turn):
    return PoseStream(
        "hand", (1e9 * TIME).astype(np.int64) + 1_000_000_000, POSITION, turn.as_quat()
    )


def leaping(where, turn):
    return stream(TURN * Rotation.from_rotvec(np.where(where[:, None], turn, 0.0)))


@pytest.mark.parametrize("turn", [[0.0, 0.0, np.pi], [2.0, 0.5, 0.0], [0.0, np.pi / 2, 0.0]])
@pytest.mark.parametrize(
    "where", [TIME % 2.0 < 0.5, (TIME > 1.0) & (TIME < 1.2), np.arange(N) % 9 == 0, TIME > 4.0]
)
def test_stretches_that_leapt_are_brought_back(where, turn):
    mended, leapt, angle = find_leaps(leaping(where, turn))
    np.testing.assert_array_equal(leapt, where)
    assert angle == pytest.approx(np.linalg.norm(turn), abs=0.05)
    apart = TURN.inv() * Rotation.from_quat(mended.quaternion)
    assert apart.magnitude().max() < 0.05


def test_smooth_orientations_and_lone_outliers_are_left_alone():
    assert find_leaps(stream(TURN)) is None
    outlier = np.arange(N) == 300
    assert find_leaps(leaping(outlier, [1.0, 0.0, 0.0])) is None
    wild = TURN * Rotation.from_rotvec(
        np.where(
            (np.arange(N) % 50 == 0)[:, None], Rotation.random(N, random_state=3).as_rotvec(), 0.0
        )
    )
    assert find_leaps(stream(wild)) is None


def test_of_two_solutions_that_were_seen_alike_nothing_tells_which_is_right():
    _, (fault,) = repair({"hand": leaping(TIME % 1.0 < 0.5, [0.0, 0.0, np.pi])})
    assert fault.kind == "leap" and not fault.repaired and "nothing tells" in fault.message


def test_a_recording_is_mended_and_says_so():
    where = TIME % 2.0 < 0.5
    bodies, faults = repair({"hand": leaping(where, [0.0, 0.0, np.pi])})
    assert [fault.kind for fault in faults] == ["leap"] and faults[0].repaired
    assert (
        "between two solutions, 180 degrees apart" in faults[0].message
        and faults[0].count == where.sum()
    )
    assert (TURN.inv() * Rotation.from_quat(bodies["hand"].quaternion)).magnitude().max() < 0.05
