"""Movement primitives whose regression fits the positions of the movement: the nearest there is,
and right where the start is noisy.
"""

import numpy as np
import pytest

from dart_skill.movement import DiscretePrimitive, RhythmicPrimitive
from dart_skill.movement.pose import DiscretePosePrimitive, angles_between, exponential

TIME = np.linspace(0.0, 15.0, 400)
SHARE = (TIME / 15.0) ** 3 * (10.0 - 15.0 * (TIME / 15.0) + 6.0 * (TIME / 15.0) ** 2)


def shaken(seed, amplitude=0.02):
    """A slow reach that begins with a shake of the hand, as where a person takes hold of it."""
    rng = np.random.default_rng(seed)
    shake = (
        amplitude
        * np.exp(-TIME / 0.3)[:, None]
        * np.sin(2.0 * np.pi * TIME[:, None] / rng.uniform(0.1, 0.3, 2) + rng.uniform(0, 6, 2))
    )
    return np.outer(SHARE, [0.4, -0.2]) + shake + rng.normal(0.0, 1e-4, (len(TIME), 2))


def far(primitive, path):
    return np.linalg.norm(primitive.open_loop(TIME).position - path, axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_start_does_not_lead_the_movement_away(seed):
    path = shaken(seed)
    joint, own = (
        far(DiscretePrimitive(50, regression=one).fit(TIME, path), path)
        for one in ("joint", "path")
    )
    assert np.sqrt(np.mean(own**2)) < np.sqrt(np.mean(joint**2)), (own.max(), joint.max())
    assert own[100:].max() < 2e-3, "after the shake, of 20 mm, it is where the hand was"


def test_no_other_weights_and_no_other_speed_come_nearer():
    """The sum of squares is at its least: it rises in any direction, by the same amount in the
    opposite one.
    """
    path, rng = shaken(7), np.random.default_rng(0)
    primitive = DiscretePrimitive(20, regression="path").fit(TIME, path)
    least = np.sum(far(primitive, path) ** 2)
    for _ in range(10):
        step, faster = rng.normal(0.0, 1.0, primitive.parameters.shape), rng.normal(0.0, 0.01, 2)
        sums = []
        for sign in (1.0, -1.0):
            other = primitive.with_parameters(primitive.parameters + sign * step)
            other.start_velocity_ = primitive.start_velocity_ + sign * faster
            sums.append(np.sum(far(other, path) ** 2))
        assert min(sums) > least and sums[0] - least == pytest.approx(sums[1] - least, rel=1e-3)


def test_a_movement_of_a_primitive_is_found_again():
    rng = np.random.default_rng(1)
    shown = DiscretePrimitive(12).fit(TIME, np.outer(SHARE, [0.3, 0.1]))
    shown = shown.with_parameters(shown.parameters + 3.0 * rng.normal(size=24))
    shown.start_velocity_ = np.array([0.05, -0.03])
    path = shown.open_loop(TIME).position
    found = DiscretePrimitive(12, regression="path").fit(
        [TIME, 2.0 * TIME], [path, path], noise=0.0
    )
    assert found.duration_ == pytest.approx(22.5) and found.n_demonstrations_ == 2
    again = found.open_loop(TIME, found.begin(path[0], goal=path[-1], duration=15.0)).position
    assert np.abs(again - path).max() < 1e-5 * np.ptp(path)


def test_poses_take_it_and_save_it(tmp_path):
    rng = np.random.default_rng(2)
    turned = np.column_stack(
        [0.0 * TIME, 0.0 * TIME, 0.0 * TIME, np.zeros((len(TIME), 3)), np.ones(len(TIME))]
    )
    vectors = np.zeros((len(TIME), 6))
    vectors[:, 3:5] = 3.0 * shaken(3) + rng.normal(0.0, 2e-4, (len(TIME), 2))
    poses = exponential(turned, vectors)
    worst = {}
    for regression in ("joint", "path"):
        primitive = DiscretePosePrimitive(50, regression=regression).fit(TIME, poses)
        worst[regression] = np.degrees(
            angles_between(primitive.open_loop(TIME).pose[100:, 3:], poses[100:, 3:]).max()
        )
    assert worst["path"] < 0.3 and worst["path"] < worst["joint"], worst
    primitive.save(tmp_path / "pose.npz")
    again = DiscretePosePrimitive.load(tmp_path / "pose.npz")
    assert again.get_params()["regression"] == "path"
    np.testing.assert_array_equal(again.open_loop(TIME).pose, primitive.open_loop(TIME).pose)


def test_what_is_no_regression_is_named():
    with pytest.raises(
        ValueError, match=r"regression must be one of \['joint', 'local', 'path'\], got 'ridge'"
    ):
        DiscretePrimitive(10, regression="ridge")
    with pytest.raises(
        ValueError, match=r"regression must be one of \['joint', 'local'\], got 'path'"
    ):
        RhythmicPrimitive(10, regression="path")
