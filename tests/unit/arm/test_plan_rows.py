"""Numbers of a plan between its instants, beside NumPy's interpolation and SciPy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.arm import _plan_rows
from dart_skill.arm._guide import References
from tests.interpreted import interpreted

MODULES = [_plan_rows, interpreted("dart_skill.arm._plan_rows")]
TIME = np.array([0.0, 0.1, 0.15, 0.4, 1.0])


def numbers(seed=0):
    rng, n = np.random.default_rng(seed), len(TIME)
    return (
        rng.normal(size=(n, 18)),
        rng.normal(size=(n, 2, 3, 3)),
        rng.normal(size=(n - 1, 2, 3, 3)),
        rng.normal(size=(n - 1, 2, 3, 3)),
    )


@pytest.mark.parametrize("module", MODULES)
def test_rows_are_linear_between_instants_and_go_on_beyond_the_ends(module):
    linear, rotation, first, second = numbers()
    rows = module.PlanRows(TIME, linear, rotation, first, second)
    for time in (-0.1, 0.0, 0.05, 0.1, 0.3, 0.7, 1.0, 1.2):
        k = int(np.clip(np.searchsorted(TIME, time, side="right") - 1, 0, len(TIME) - 2))
        share = (time - TIME[k]) / (TIME[k + 1] - TIME[k])
        assert rows.place(time) == (k, share)
        row = linear[k] + share * (linear[k + 1] - linear[k])
        turned = rotation[k] + share * first[k] + share**2 * second[k]
        expected = row[:3], turned[0], row[3:6], turned[1], row[6:12], row[12:]
        for found, one in zip(rows.at(time), expected, strict=True):
            np.testing.assert_allclose(found, one, rtol=1e-12, atol=1e-12)


def test_a_plan_turns_its_hand_by_a_share_of_the_way_to_the_next_instant(plan):
    references, motion = References(plan.motion), plan.motion
    slerps = [
        Slerp(motion.path.time, Rotation.from_quat(q))
        for q in (motion.path.quaternion, motion.attractor_quaternion)
    ]
    for time in np.linspace(0.0, motion.path.duration, 50):
        now = references.at(time)
        for found, slerp in zip((now.rotation, now.attractor_rotation), slerps, strict=True):
            np.testing.assert_allclose(found, slerp(time).as_matrix(), atol=1e-5)
        position = [np.interp(time, motion.path.time, axis) for axis in motion.path.position.T]
        np.testing.assert_allclose(now.position, position, atol=1e-12)


def test_compiled_and_interpreted_have_the_same_bits():
    ours, theirs = (module.PlanRows(TIME, *numbers(1)) for module in MODULES)
    for time in np.linspace(-0.2, 1.2, 30):
        assert ours.place(time) == theirs.place(time)
        for one, other in zip(ours.at(time), theirs.at(time), strict=True):
            np.testing.assert_array_equal(one, other)
