"""The task-parameterised mixture with frames that move, are missing, or see only some directions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.mixture import Gaussian, regress
from dart_skill.movement import DSGMR, PartialFrame, TaskFrame, TaskParameterisedMixture

STEPS = np.linspace(0.0, 1.0, 60)
IDENTITY = TaskFrame(np.eye(3), np.zeros(3))


def planar_frame(angle, x, y):
    matrix = np.eye(3)
    matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, [0.0, x, y])


def height_frame(height):
    """Sees time and the second coordinate."""
    return PartialFrame([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]], [0.0, 0.0, height])


def taught(n=8, seed=0):
    """Reaches [t, x, y] from the first frame to the second, which is another one every time."""
    rng = np.random.default_rng(seed)
    samples, frames = [], []
    for _ in range(n):
        goal = planar_frame(rng.uniform(-1, 1), *rng.uniform(0.8, 1.5, 2))
        middle = goal.from_frame([[0.0, -0.4, 0.0]])[0, 1:]
        u = STEPS[:, None]
        path = 2 * u * (1 - u) * middle + u**2 * goal.b[1:]
        samples.append(np.column_stack([STEPS, path + rng.normal(0, 0.01, path.shape)]))
        frames.append([IDENTITY, goal])
    return samples, frames


def assert_same(one, other, rtol=1e-9):
    for name in ("priors_", "means_", "covariances_"):
        for left, right in zip(getattr(one, name), getattr(other, name), strict=True):
            np.testing.assert_allclose(
                left, right, rtol=rtol, atol=rtol * np.abs(right).max(), err_msg=name
            )


def factors(model, frame_index, local):
    """(n, K) log densities in one frame, by the Gaussians themselves."""
    parts = zip(model.means_[frame_index], model.covariances_[frame_index], strict=True)
    return np.stack([Gaussian(*one).log_density(local) for one in parts], axis=1)


# frames that move


def test_a_frame_given_for_every_sample_is_the_frame_of_the_demonstration_when_it_rests():
    samples, frames = taught()
    resting = [[first, [goal] * len(STEPS)] for first, goal in frames]
    assert_same(
        TaskParameterisedMixture(3).fit(samples, resting),
        TaskParameterisedMixture(3).fit(samples, frames),
    )


def moving_goal(rng):
    """Frames (60) that drift and turn, and samples that draw the same half circle in all of them."""
    start, drift, turn = rng.normal(size=2), rng.normal(size=2), rng.uniform(-2, 2)
    course = [planar_frame(turn * u, *(start + drift * u)) for u in STEPS]
    local = np.column_stack([STEPS, np.cos(np.pi * STEPS), np.sin(np.pi * STEPS)])
    return (
        np.concatenate(
            [frame.from_frame(row[None]) for frame, row in zip(course, local, strict=True)]
        ),
        course,
        local,
    )


def test_what_is_the_same_in_a_moving_frame_is_learned_there_and_reproduced_in_another_course():
    rng = np.random.default_rng(1)
    shown = [moving_goal(rng) for _ in range(5)]
    model = DSGMR(8).fit(
        [samples for samples, _, _ in shown], [[course] for _, course, _ in shown]
    )
    expected, course, local = moving_goal(rng)
    attractor, covariance = model.retrieve([course], STEPS)
    at_rest, _ = model.retrieve([IDENTITY], STEPS)
    assert np.abs(at_rest - local[:, 1:]).max() < 0.05
    assert np.abs(attractor - expected[:, 1:]).max() < 0.05
    assert np.linalg.eigvalsh(covariance).min() > 0


def test_regression_in_moving_frames_is_the_product_of_each_moment():
    samples, frames = taught()
    model = TaskParameterisedMixture(3).fit(samples, frames)
    course = [planar_frame(u, 1.0 + u, 1.0) for u in STEPS]
    mean, covariance = model.regress([IDENTITY, course], STEPS[:, None], [0], [2, 1])
    for i in (0, 17, 59):
        alone = regress(model.product([IDENTITY, course[i]]), STEPS[i : i + 1], [0], [2, 1])
        np.testing.assert_allclose(mean[i], alone[0][0], atol=1e-11)
        np.testing.assert_allclose(covariance[i], alone[1][0], atol=1e-11)


# frames that are missing


def with_gaps(samples, frames):
    """The goal is unknown in two demonstrations and for a while in a third; the start frame is
    unknown in a fourth.
    """
    frames = [list(one) for one in frames]
    frames[1][1] = frames[2][1] = None
    frames[3][1] = [None if 20 <= i < 35 else frames[3][1] for i in range(len(STEPS))]
    frames[4][0] = None
    seen = [[np.full(len(STEPS), True) for _ in range(2)] for _ in samples]
    seen[1][1][:] = seen[2][1][:] = seen[4][0][:] = False
    seen[3][1][20:35] = False
    return frames, np.concatenate([np.stack(one) for one in seen], axis=1)


@pytest.mark.parametrize("options", [{}, {"start": "kmeans"}])
def test_density_has_the_factors_of_the_frames_that_are_there(options):
    samples, frames = taught()
    gappy, seen = with_gaps(samples, frames)
    model = TaskParameterisedMixture(3, **options).fit(
        samples, gappy, rng=np.random.default_rng(0)
    )
    terms = np.log(model.priors_)[None]
    for j in range(2):
        local = np.concatenate(
            [its_frames[j].to_frame(one) for one, its_frames in zip(samples, frames, strict=True)]
        )
        terms = terms + np.where(seen[j][:, None], factors(model, j, local), 0.0)
    expected = np.logaddexp.reduce(terms, axis=1)
    np.testing.assert_allclose(
        np.concatenate(model.log_density(samples, gappy)), expected, rtol=1e-9, atol=1e-9
    )
    assert model.log_likelihood_ == pytest.approx(expected.sum(), rel=1e-9)
    shares = np.concatenate(model.responsibilities(samples, gappy))
    np.testing.assert_allclose(shares, np.exp(terms - expected[:, None]), atol=1e-9)


def test_a_gaussian_comes_from_the_samples_that_its_frame_saw():
    """At the fixed point of EM every mean is the mean of what was seen, weighted by the
    responsibilities.
    """
    samples, frames = taught()
    gappy, seen = with_gaps(samples, frames)
    weights = [1.0, 2.0, 1.0, 1.0, 0.5, 0.0, 1.0, 1.0]
    model = TaskParameterisedMixture(3, tolerance=1e-14, max_iterations=3000).fit(
        samples, gappy, weights
    )
    shares = (
        np.concatenate(model.responsibilities(samples, gappy))
        * np.repeat(weights, len(STEPS))[:, None]
    )
    np.testing.assert_allclose(model.priors_, shares.sum(0) / shares.sum(), atol=1e-6)
    for j in range(2):
        local = np.concatenate(
            [its_frames[j].to_frame(one) for one, its_frames in zip(samples, frames, strict=True)]
        )
        for k in range(3):
            share = shares[:, k] * seen[j]
            mean = np.average(local, axis=0, weights=share)
            np.testing.assert_allclose(model.means_[j, k], mean, atol=1e-6)
            np.testing.assert_allclose(
                model.covariances_[j, k], np.cov(local.T, aweights=share, bias=True), atol=1e-6
            )


def test_a_component_that_a_frame_never_sees_is_as_wide_there_as_all_that_it_saw():
    samples, frames = taught()
    late = [[None if u < 0.6 else goal for u in STEPS] for _, goal in frames]
    model = TaskParameterisedMixture(4).fit(
        samples, [[first, course] for (first, _), course in zip(frames, late, strict=True)]
    )
    seen = np.concatenate(
        [goal.to_frame(one)[STEPS >= 0.6] for one, (_, goal) in zip(samples, frames, strict=True)]
    )
    earliest = int(model.means_[0, :, 0].argmin())
    np.testing.assert_allclose(model.means_[1, earliest], seen.mean(0), atol=1e-9)
    np.testing.assert_allclose(
        model.covariances_[1, earliest], np.cov(seen.T, bias=True), atol=1e-9
    )


def test_a_frame_left_out_of_a_new_situation_is_no_factor_of_the_product():
    samples, frames = taught()
    model = TaskParameterisedMixture(3).fit(samples, frames)
    goal = planar_frame(0.3, 1.0, 1.2)
    alone = TaskParameterisedMixture.from_parameters(
        model.priors_, model.means_[1:], model.covariances_[1:]
    )
    np.testing.assert_allclose(
        model.product([None, goal]).means_, alone.product([goal]).means_, atol=1e-12
    )
    np.testing.assert_allclose(
        model.product([None, goal]).covariances_, alone.product([goal]).covariances_, atol=1e-14
    )
    # Known from the middle of the movement on: at first only the other frame counts.
    course = [None] * 30 + [goal] * 30
    mean, covariance = model.regress([IDENTITY, course], STEPS[:, None], [0], [1, 2])
    for part, situation in ((slice(30), [IDENTITY, None]), (slice(30, 60), [IDENTITY, goal])):
        expected = model.regress(situation, STEPS[part], [0], [1, 2])
        np.testing.assert_allclose(mean[part], expected[0], atol=1e-11)
        np.testing.assert_allclose(covariance[part], expected[1], atol=1e-11)


# frames of other dimensions


def random_parameters(rng, dims, n_components=2):
    roots = [rng.normal(size=(n_components, d, d)) for d in dims]
    covariances = [root @ np.swapaxes(root, 1, 2) + 0.2 * np.eye(root.shape[-1]) for root in roots]
    return (
        rng.dirichlet(np.full(n_components, 5.0)),
        [rng.normal(size=(n_components, d)) for d in dims],
        covariances,
    )


@given(seed=st.integers(0, 10_000), dims=st.lists(st.integers(1, 4), max_size=4))
@settings(max_examples=40, deadline=None)
def test_precisions_add_up_over_any_number_of_frames_of_any_dimension(seed, dims):
    """(7.21) with C = A^-1: S^-1 = sum C' S_p^-1 C, S^-1 mu = sum C' S_p^-1 (mu_p + C b)."""
    rng, dims = np.random.default_rng(seed), [4, *dims]
    priors, means, covariances = random_parameters(rng, dims)
    frames = [
        PartialFrame(
            np.linalg.qr(rng.normal(size=(4, d)))[0] * rng.uniform(0.5, 2.0, d), rng.normal(size=4)
        )
        for d in dims
    ]
    found = TaskParameterisedMixture.from_parameters(priors, means, covariances).product(frames)
    for k in range(2):
        precision, information = np.zeros((4, 4)), np.zeros(4)
        for frame, mean, covariance in zip(frames, means, covariances, strict=True):
            inverse = np.linalg.pinv(frame.A)
            gain = inverse.T @ np.linalg.inv(covariance[k])
            precision += gain @ inverse
            information += gain @ (mean[k] + inverse @ frame.b)
        np.testing.assert_allclose(
            found.covariances_[k], np.linalg.inv(precision), rtol=1e-8, atol=1e-10
        )
        np.testing.assert_allclose(
            found.means_[k], np.linalg.solve(precision, information), rtol=1e-8, atol=1e-10
        )


def test_a_partial_frame_that_sees_all_is_an_ordinary_one():
    samples, frames = taught()
    partial = [[first, PartialFrame(goal.A, goal.b)] for first, goal in frames]
    model, plain = (
        TaskParameterisedMixture(3).fit(samples, partial),
        TaskParameterisedMixture(3).fit(samples, frames),
    )
    assert_same(model, plain)
    np.testing.assert_allclose(
        model.product(partial[0]).means_, plain.product(frames[0]).means_, atol=1e-9
    )


# weights, time, refusals


def test_components_in_time_take_frames_with_gaps_and_leave_out_what_no_stamp_belongs_to():
    samples, frames = taught()
    gappy, _ = with_gaps(samples, frames)
    broken = [np.concatenate([one[:10], one[50:]]) for one in samples]
    whole = TaskParameterisedMixture(4).fit_in_time(samples, gappy)
    assert whole.means_.shape == (2, 4, 3) and np.isfinite(whole.covariances_).all()
    torn = TaskParameterisedMixture(20).fit_in_time(broken, frames)
    assert 4 <= len(torn.priors_) < 20, torn.priors_
    assert np.isfinite(torn.means_).all() and np.linalg.eigvalsh(torn.covariances_).min() > 0


@pytest.mark.parametrize("method", ["fit", "fit_in_time"])
@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: [[None, None], *f[1:]], "sample 0 of demonstration 0 is seen by no task frame"),
        (
            lambda f: [*f[:3], [[None] * 60, [f[0][1]] * 59 + [None]], *f[4:]],
            "sample 59 of demonstration 3 is seen by no",
        ),
        (
            lambda f: [[first, None] for first, _ in f],
            "task frame 1 is missing from every sample with weight",
        ),
        (
            lambda f: [[f[0][0], [f[0][1]] * 59], *f[1:]],
            "task frame 1 of demonstration 0 is given for 59 samples, there are 60",
        ),
        (
            lambda f: [[f[0][0], height_frame(0.0)], *f[1:]],
            r"task frame 1 must see as many directions everywhere, got \[2, 3\]",
        ),
        (
            lambda f: [[f[0][0], np.eye(3)], *f[1:]],
            "must be a TaskFrame, a PartialFrame or None, got ndarray",
        ),
        (
            lambda f: [[f[0][0], [TaskFrame(np.eye(2), [0, 0])] * 60], *f[1:]],
            "has 2 dimensions, the samples have 3",
        ),
    ],
)
def test_frames_that_do_not_fit_the_samples_are_refused(method, spoil, message):
    samples, frames = taught()
    with pytest.raises(ValueError, match=message):
        getattr(TaskParameterisedMixture(3), method)(samples, spoil(frames))


def test_situations_that_do_not_fit_the_mixture_are_refused():
    samples, frames = taught()
    model = TaskParameterisedMixture(3).fit(samples, frames)
    for situation, message in (
        ([IDENTITY], "has 1 task frames, expected 2"),
        ([None, None], "all task frames are missing at moment 0"),
        (
            [IDENTITY, height_frame(0.0)],
            r"task frame 1 must see as many directions everywhere, got \[2, 3\]",
        ),
        ([IDENTITY, [IDENTITY] * 3], "is given for 3 samples, there are 1"),
    ):
        with pytest.raises(ValueError, match=message):
            model.product(situation)
    with pytest.raises(ValueError, match="missing at moment 4"):
        model.regress([None, [IDENTITY] * 4 + [None]], np.zeros((5, 1)), [0], [1])
    with pytest.raises(ValueError, match="all samples have the time 0.5"):
        TaskParameterisedMixture(3).fit_in_time([np.full((60, 3), 0.5)], [[IDENTITY]])
    with pytest.raises(ValueError, match="overlap"):
        TaskParameterisedMixture(3).fit_in_time(samples, frames, overlap=0.0)


@pytest.mark.parametrize(
    "matrix", [np.ones((3, 2)), np.zeros((3, 1)), np.ones((2, 3)), [[np.nan], [0.0]]]
)
def test_a_partial_frame_without_independent_columns_is_refused(matrix):
    with pytest.raises(ValueError, match="independent columns|nan"):
        PartialFrame(matrix, np.zeros(len(matrix)))
