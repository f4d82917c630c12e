"""Gaussians at each step on the manifold: against means, products and the flat members."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.movement import PerStepGaussians, TaskFrame
from dart_skill.movement.pose import (
    PerStepPoses,
    PoseFrame,
    angles_between,
    logarithm,
    mean_point,
    product_of_poses,
)

TIME = np.linspace(0.0, 1.5, 31)


def frame(rng, angle=0.5):
    return PoseFrame(
        rng.normal(0.0, 0.3, 3), Rotation.from_rotvec(rng.normal(0.0, angle, 3)).as_quat()
    )


def demonstration(frames, rng):
    """From the first frame to the second, with a bend and a turn of the wrist on the way."""
    s = TIME / TIME[-1]
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    first, second = frames
    position = first.position + s[:, None] * (second.position - first.position)
    position += np.outer(np.sin(np.pi * s), rng.normal([0.0, 0.0, 0.1], 0.02))
    way = (
        Rotation.from_quat(second.orientation) * Rotation.from_quat(first.orientation).inv()
    ).as_rotvec()
    turn = Rotation.from_rotvec(s[:, None] * way) * Rotation.from_quat(first.orientation)
    wrist = Rotation.from_rotvec(np.outer(np.sin(np.pi * s), rng.normal([0.0, 0.6, 0.0], 0.1)))
    return np.column_stack([TIME, position, (turn * wrist).as_quat()])


@pytest.fixture(scope="module")
def frames():
    rng = np.random.default_rng(2)
    return [[frame(rng, 0.3), frame(rng, 0.3)] for _ in range(6)]


@pytest.fixture(scope="module")
def shown(frames):
    rng = np.random.default_rng(5)
    return [demonstration(ours, rng) for ours in frames]


@pytest.fixture(scope="module")
def model(shown, frames):
    return PerStepPoses(31).fit(shown, frames)


NEW = [frame(np.random.default_rng(9), 0.3), frame(np.random.default_rng(10), 0.3)]


def test_a_step_is_the_mean_and_the_product_on_the_manifold(model, shown, frames):
    k = 13
    local = np.array(
        [
            [f.to_frame(one[k : k + 1])[0, 1:] for f in ours]
            for one, ours in zip(shown, frames, strict=True)
        ]
    )
    for j in range(2):
        mean = mean_point(local[:, j])
        assert np.abs(logarithm(mean, model.means_[j, k])).max() < 1e-9
        off = logarithm(mean, local[:, j])
        for part in (slice(0, 3), slice(3, 6)):
            own = off[:, part].T @ off[:, part] / 6.0
            expected = (6.0 * own + 2.0 * np.trace(own) / 3.0 * np.eye(3)) / 8.0
            np.testing.assert_allclose(
                model.covariances_[j, k][part, part], expected, rtol=1e-3, atol=1e-6
            )
    rotations = [Rotation.from_quat(one.orientation).as_matrix() for one in NEW]
    means = [f.from_frame(model.means_[j, k][None])[0] for j, f in enumerate(NEW)]
    wide = [np.kron(np.eye(2), R) for R in rotations]
    spreads = [W @ model.covariances_[j, k] @ W.T for j, W in enumerate(wide)]
    mean, covariance = product_of_poses(means, spreads)
    found, spread = model.retrieve(NEW)
    assert np.abs(found[k, :3] - mean[:3]).max() < 1e-9
    assert angles_between(found[k], mean) < 1e-7
    np.testing.assert_allclose(spread[k], covariance, atol=1e-9)


def test_without_turns_positions_are_those_of_the_flat_member(shown, frames):
    flat = [[TaskFrame(np.eye(4), [0.0, *one.position]) for one in ours] for ours in frames]
    level = [[PoseFrame(one.position) for one in ours] for ours in frames]
    one = PerStepGaussians(31).fit([rows[:, :4] for rows in shown], flat)
    other = PerStepPoses(31).fit(shown, level)
    for expected, found in zip(one.retrieve(flat[2]), other.retrieve(level[2]), strict=True):
        kept = found[:, :3] if found.ndim == 2 else found[:, :3, :3]
        np.testing.assert_allclose(kept, expected, atol=1e-9)


def test_a_world_that_is_turned_has_the_same_movement_turned(model):
    turn, shift = Rotation.from_rotvec([0.4, -0.9, 1.3]), np.array([0.3, -0.2, 0.5])
    moved = [
        PoseFrame(
            turn.apply(one.position) + shift,
            (turn * Rotation.from_quat(one.orientation)).as_quat(),
        )
        for one in NEW
    ]
    poses, other = model.retrieve(NEW)[0], model.retrieve(moved)[0]
    np.testing.assert_allclose(other[:, :3], turn.apply(poses[:, :3]) + shift, atol=1e-9)
    turned = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
    assert angles_between(other, np.hstack([other[:, :3], turned])).max() < 1e-7


def test_the_sign_of_a_quaternion_makes_no_difference(model, shown, frames):
    signs = np.random.default_rng(0).choice([-1.0, 1.0], 31)
    flipped = [np.hstack([one[:, :4], signs[:, None] * one[:, 4:]]) for one in shown]
    other = PerStepPoses(31).fit(flipped, frames)
    poses, found = model.retrieve(NEW)[0], other.retrieve(NEW)[0]
    assert np.abs(found[:, :3] - poses[:, :3]).max() < 1e-9
    assert angles_between(found, poses).max() < 1e-6


def test_start_end_and_a_pose_between_are_met(model):
    usual = model.retrieve(NEW)[0]
    tilt = Rotation.from_rotvec([0.0, 0.1, -0.05])
    poses = [
        np.hstack([one[:3] + [0.0, 0.02, 0.01], (tilt * Rotation.from_quat(one[3:])).as_quat()])
        for one in usual[[0, 12, 30]]
    ]
    led = model.between(poses[0], poses[2]).condition(float(model.time_[12]), poses[1])
    found, spread = led.retrieve(NEW, model.time_[[0, 12, 30]])
    assert np.abs(found[:, :3] - np.array(poses)[:, :3]).max() < 1e-9
    assert angles_between(found, np.array(poses)).max() < 1e-7
    assert np.abs(spread).max() < 1e-9
    loose = model.condition(0.6, poses[1], 1e3 * np.eye(6)).retrieve(NEW)[0]
    np.testing.assert_allclose(loose, usual, atol=1e-3)


def test_between_steps_the_hand_moves_along_a_geodesic(model):
    poses = model.retrieve(NEW)[0]
    half = 0.5 * (model.time_[7] + model.time_[8])
    between = model.retrieve(NEW, [half, half + 0.01, 99.0])[0]
    way = logarithm(poses[7], poses[8])
    np.testing.assert_allclose(logarithm(poses[7], between[0]), 0.5 * way, atol=1e-9)
    np.testing.assert_allclose(logarithm(poses[7], between[1]), 0.7 * way, atol=1e-9)
    assert angles_between(between[2], poses[30]) < 1e-9


def test_a_saved_model_comes_back_and_says_what_it_is(model, tmp_path):
    model.save(tmp_path / "model.npz")
    again = PerStepPoses.load(tmp_path / "model.npz")
    np.testing.assert_array_equal(again.retrieve(NEW)[0], model.retrieve(NEW)[0])
    assert repr(again) == (
        "PerStepPoses(n_steps=31): 6 demonstrations, positions and orientations at 31 steps in 2"
        " task frames"
    )


def test_what_cannot_be_learned_from_is_said(shown, frames, model):
    for samples, given, why in (
        (shown, frames[:2], "one list of frames per demonstration"),
        (shown[:2], [frames[0], [frames[1][0], None]], "a task frame is missing"),
        ([shown[0][:, 1:]], frames[:1], "must have the columns time and pose"),
        ([shown[0] * 2.0], frames[:1], "the quaternion at index"),
    ):
        with pytest.raises(ValueError, match=why):
            PerStepPoses().fit(samples, given)
    with pytest.raises(ValueError, match="position must have length 7"):
        model.condition(0.5, np.zeros(6))
    assert np.isfinite(model.log_likelihood(shown, frames)) and model.n_parameters == 2 * 31 * 18
