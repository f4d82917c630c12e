"""Mixtures of poses in task frames: what frames do to poses, and what new frames do to a mixture."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.movement import TaskFrame, TaskParameterisedMixture
from dart_skill.movement.pose import (
    PoseFrame,
    TaskParameterisedPoseMixture,
    exponential,
    logarithm,
    product_of_poses,
)
from tests.unit.movement.pose.random_poses import apart, blocks, flipped, orientations, turned

TINY = 1e-6
POSE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def frames_of(rng, n_frames=2, angle=0.7):
    return [
        PoseFrame(rng.normal(size=3), Rotation.from_rotvec(rng.normal(0.0, angle, 3)).as_quat())
        for _ in range(n_frames)
    ]


def moved(frame, rotation, shift):
    position, orientation = np.split(
        turned(np.concatenate([frame.position, frame.orientation]), rotation, 0, shift), [3]
    )
    return PoseFrame(position, orientation)


def demonstration(frames, rng, n=60, turn=3.5):
    """From the first frame to the second one: a turn of the wrist by `turn` [rad] on the way, seen
    from both.
    """
    time, (first, second) = np.linspace(0.0, 1.0, n), frames
    s = time**3 * (10.0 - 15.0 * time + 6.0 * time**2)
    # In the first frame the hand begins at its origin; in the second it ends there, turned about
    # its own axis on the way.
    way = logarithm(
        np.concatenate([first.position, first.orientation]),
        np.concatenate([second.position, second.orientation]),
    )
    between = exponential(np.concatenate([first.position, first.orientation]), s[:, None] * way)
    own = Rotation.from_rotvec((s - 1.0)[:, None] * [0.0, 0.0, turn])
    between[:, 3:] = (
        Rotation.from_quat(between[:, 3:])
        * own
        * Rotation.from_rotvec(rng.normal(0.0, 0.01, (n, 3)))
    ).as_quat()
    between[:, :3] += rng.normal(0.0, 0.002, (n, 3))
    return np.column_stack([time, between])


@pytest.fixture
def taught(rng):
    frames = [frames_of(rng) for _ in range(5)]
    return [demonstration(one, rng) for one in frames], frames


def test_a_frame_sees_what_scipy_says(rng):
    frame, rows = (
        PoseFrame([0.1, 0.2, 0.3], orientations(1, rng)[0]),
        np.column_stack([rng.normal(size=(9, 4)), orientations(9, rng)]),
    )
    seen, axes = frame.to_frame(rows), Rotation.from_quat(frame.orientation)
    np.testing.assert_allclose(seen[:, 0], rows[:, 0])
    np.testing.assert_allclose(
        seen[:, 1:4], axes.inv().apply(rows[:, 1:4] - frame.position), atol=1e-14
    )
    assert apart(seen, (axes.inv() * Rotation.from_quat(rows[:, 4:])).as_quat()) < 1e-14
    back = frame.from_frame(seen)
    assert apart(back, rows) < 1e-14
    np.testing.assert_allclose(back[:, :4], rows[:, :4], atol=1e-14)


def test_without_an_orientation_the_axes_are_those_of_the_world():
    np.testing.assert_array_equal(PoseFrame(np.zeros(3)).orientation, [0.0, 0.0, 0.0, 1.0])


def test_with_tiny_spread_all_is_as_in_the_euclidean_mixture(rng):
    """Rotation vectors as three more coordinates, in frames that move them and do not turn them."""
    offsets = TINY * rng.normal(size=(4, 2, 6))
    flat = [
        np.column_stack(
            [np.linspace(0.0, TINY, 50), TINY * rng.normal(size=(50, 6)) + offsets[i].sum(0)]
        )
        for i in range(4)
    ]
    euclidean_frames = [
        [TaskFrame(np.eye(7), [0.0, *offset]) for offset in pair] for pair in offsets
    ]
    curved_frames = [
        [PoseFrame(offset[:3], exponential(POSE, offset)[3:]) for offset in pair]
        for pair in offsets
    ]
    rows = [exponential(np.concatenate([[0.0], POSE]), one) for one in flat]
    options = {"tolerance": 0.0, "max_iterations": 15}
    euclidean = TaskParameterisedMixture(3, **options).fit(flat, euclidean_frames)
    curved = TaskParameterisedPoseMixture(3, correlated=True, **options).fit(rows, curved_frames)
    np.testing.assert_allclose(curved.priors_, euclidean.priors_, atol=1e-5)
    np.testing.assert_allclose(
        curved.covariances_ / TINY**2, euclidean.covariances_ / TINY**2, atol=1e-4
    )
    wanted = euclidean.product(euclidean_frames[1])
    product = curved.product(curved_frames[1])
    found = logarithm(np.concatenate([[0.0], POSE]), product.means_)
    np.testing.assert_allclose(found / TINY, wanted.means_ / TINY, atol=1e-4)
    np.testing.assert_allclose(
        product.covariances_ / TINY**2, wanted.covariances_ / TINY**2, atol=1e-4
    )
    np.testing.assert_allclose(
        curved.log_density(rows, curved_frames)[2],
        euclidean.log_density(flat, euclidean_frames)[2],
        rtol=1e-5,
        atol=1e-3,
    )


@pytest.mark.parametrize("partition", ["fit", "fit_in_time"])
def test_turning_a_demonstration_with_its_frames_changes_nothing(rng, taught, partition):
    samples, frames = taught
    rotations, shifts = Rotation.random(5, random_state=8), rng.normal(size=(5, 3))
    elsewhere = [
        turned(one, *place)
        for one, *place in zip(samples, rotations, [1] * 5, shifts, strict=True)
    ]
    with_them = [
        [moved(frame, *place) for frame in pair]
        for pair, *place in zip(frames, rotations, shifts, strict=True)
    ]
    here = getattr(TaskParameterisedPoseMixture(6), partition)(samples, frames)
    # The scale of the covariance floor is partly that of the world; here no eigenvalue is near it.
    there = getattr(TaskParameterisedPoseMixture(6), partition)(
        [flipped(one, rng) for one in elsewhere], with_them
    )
    assert apart(there.means_, here.means_) < 1e-10
    np.testing.assert_allclose(there.covariances_, here.covariances_, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_turning_the_new_frames_turns_product_and_regression(rng, taught, seed):
    mixture = TaskParameterisedPoseMixture(6).fit(*taught)
    rotation, shift, new = Rotation.random(random_state=seed), rng.normal(size=3), frames_of(rng)
    time = np.linspace(0.0, 1.0, 40)
    mean, covariance = mixture.regress(new, time)
    moved_mean, moved_covariance = mixture.regress(
        [moved(frame, rotation, shift) for frame in new], time
    )
    assert apart(moved_mean, turned(mean, rotation, 0, shift)) < 1e-10
    np.testing.assert_allclose(
        moved_mean[:, :3], turned(mean, rotation, 0, shift)[:, :3], atol=1e-10
    )
    np.testing.assert_allclose(
        moved_covariance, blocks(rotation) @ covariance @ blocks(rotation).T, atol=1e-10
    )


def test_a_product_is_that_of_the_frames_gaussians_in_the_world(rng, taught):
    mixture, new = TaskParameterisedPoseMixture(4).fit(*taught), frames_of(rng, 2, 0.3)
    product = mixture.product(new)
    for k in range(4):
        matrices = [blocks(Rotation.from_quat(frame.orientation), 1) for frame in new]
        means = np.concatenate(
            [frame.from_frame(mixture.means_[j, k][None]) for j, frame in enumerate(new)]
        )
        covariances = [
            matrix @ mixture.covariances_[j, k] @ matrix.T for j, matrix in enumerate(matrices)
        ]
        mean, covariance = product_of_poses(means, np.array(covariances))
        assert apart(product.means_[k], mean) < 1e-12
        np.testing.assert_allclose(product.covariances_[k], covariance, atol=1e-12)


def test_a_frame_that_is_missing_is_no_factor(rng, taught):
    samples, frames = taught
    mixture, new = TaskParameterisedPoseMixture(4).fit(samples, frames), frames_of(rng)
    product = mixture.product([new[0], None])
    assert apart(product.means_, new[0].from_frame(mixture.means_[0])) < 1e-12
    halves = [[frames[0][0], None], *frames[1:]]
    assert np.isfinite(TaskParameterisedPoseMixture(4).fit(samples, halves).means_).all()


def test_a_frame_that_moves_is_asked_where_it_is(rng, taught):
    mixture, new, later = (
        TaskParameterisedPoseMixture(5).fit(*taught),
        frames_of(rng, 2, 0.3),
        frames_of(rng, 2, 0.3),
    )
    time = np.array([0.2, 0.6, 0.9])
    mean, covariance = mixture.regress([new[0], [new[1], later[1], new[1]]], time)
    for i, pair in enumerate([new, [new[0], later[1]], new]):
        wanted, wanted_covariance = mixture.regress(pair, time[i : i + 1])
        assert apart(mean[i], wanted[0]) < 1e-11
        np.testing.assert_allclose(covariance[i], wanted_covariance[0], atol=1e-12)
    samples, frames = taught
    lists = [[[frame] * 60 for frame in pair] for pair in frames]
    assert (
        apart(TaskParameterisedPoseMixture(5).fit(samples, lists).means_, mixture.means_) < 1e-12
    )


def test_position_and_rotation_are_independent_given_time_unless_they_may_be_correlated(taught):
    apart_by = {}
    for correlated in (False, True):
        mixture = TaskParameterisedPoseMixture(4, correlated=correlated).fit(*taught)
        within = np.linalg.inv(mixture.covariances_)
        apart_by[correlated] = np.abs(
            within[..., 1:4, 4:] / np.sqrt(within[..., 1:4, 1:4].max() * within[..., 4:, 4:].max())
        ).max()
    assert apart_by[False] < 1e-9 < 1e-3 < apart_by[True]


def test_k_means_needs_no_time(rng, taught):
    samples, frames = taught
    without = [one[:, 1:] for one in samples]
    mixture = TaskParameterisedPoseMixture(4, start="kmeans", n_starts=2).fit(
        without, frames, rng=rng
    )
    assert mixture.means_.shape[::2] == (2, 7)
    assert sum(len(one) for one in mixture.responsibilities(without, frames)) == 300


def test_the_likelihood_rises_and_the_bic_counts_weights(rng, taught):
    samples, frames = taught
    runs = [
        TaskParameterisedPoseMixture(3, tolerance=0.0, max_iterations=n).fit(samples, frames)
        for n in (1, 2, 4, 8, 16)
    ]
    assert np.diff([run.log_likelihood_ for run in runs]).min() > 0
    weighted = runs[2].bic(samples, frames, [2.0, 1.0, 1.0, 1.0, 1.0])
    assert weighted == pytest.approx(runs[2].bic([*samples, samples[0]], [*frames, frames[0]]))


ROWS = np.column_stack([np.linspace(0.0, 1.0, 20), np.tile(POSE, (20, 1))])
WORLD = PoseFrame(np.zeros(3))


def spoilt(row, column, value=np.nan):
    rows = ROWS.copy()
    rows[row, column] = value
    return rows


def fit(samples=(ROWS, ROWS), frames=((WORLD,), (WORLD,)), weights=None, **options):
    return TaskParameterisedPoseMixture(2, **options).fit(samples, frames, weights)


WRONG = {
    r"samples of demonstration 1 holds nan at index \(3, 2\)": lambda: fit((ROWS, spoilt(3, 2))),
    r"samples of demonstration 1: the quaternion at index \(3,\)": lambda: fit(
        (ROWS, spoilt(3, -1, 5.0))
    ),
    "41 components need at least as many samples": lambda: TaskParameterisedPoseMixture(41).fit(
        [ROWS, ROWS], [[WORLD], [WORLD]]
    ),
    "position holds nan": lambda: PoseFrame([0.0, np.nan, 0.0]),
    "orientation: the quaternion has length 0": lambda: PoseFrame(np.zeros(3), np.zeros(4)),
    "one list of frames per demonstration": lambda: fit(frames=((WORLD,),)),
    "demonstration 1 has 2 task frames, expected 1": lambda: fit(
        frames=((WORLD,), (WORLD, WORLD))
    ),
    "task frame 0 of demonstration 0 must be a PoseFrame": lambda: fit(frames=((3,), (WORLD,))),
    "task frame 0 of demonstration 0 is given for 1 samples": lambda: fit(
        frames=(([WORLD],), (WORLD,))
    ),
    "all task frames are missing": lambda: fit(frames=((None,), (WORLD,))),
    "demonstration 1 has 7 columns": lambda: fit(samples=(ROWS, ROWS[:, 1:])),
    "weights are all zero": lambda: fit(weights=[0.0, 0.0]),
    "missing from every sample with weight": lambda: fit(
        frames=((WORLD, None), (WORLD, WORLD)), weights=[1.0, 0.0]
    ),
    "give time in column 0": lambda: fit(samples=(ROWS[:, 1:], ROWS[:, 1:])),
    "needs rng": lambda: fit(start="kmeans"),
    "start must be one of": lambda: fit(start="middle"),
    "there are no intervals": (
        lambda: TaskParameterisedPoseMixture(2).fit_in_time([0.0 * ROWS + ROWS[0]], [[WORLD]])
    ),
    "the new situation has 2 task frames, expected 1": lambda: fit().product([WORLD, WORLD]),
    "holds no parameters yet": lambda: TaskParameterisedPoseMixture(2).product([WORLD]),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    with pytest.raises(ValueError, match=message):
        WRONG[message]()
