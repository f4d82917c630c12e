"""Gaussians at each step, in task frames: against means, covariances and products written out, and
what turning the world must not change.
"""

import numpy as np
import pytest

from dart_skill.mixture import Gaussian, product
from dart_skill.movement import PartialFrame, PerStepGaussians, TaskFrame

TIME = np.linspace(0.0, 2.0, 41)
RNG = np.random.default_rng(4)
ENDS = RNG.normal([[[0.0, 0.0]], [[0.5, 0.3]]], 0.1, (2, 6, 2)).swapaxes(0, 1)


def demonstration(ends, bend=0.1):
    s = (TIME / TIME[-1])[:, None]
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    return np.hstack([TIME[:, None], ends[0] + s * (ends[1] - ends[0]) + bend * np.sin(np.pi * s)])


SHOWN = [
    demonstration(ends, bend)
    for ends, bend in zip(ENDS, np.random.default_rng(1).normal(0.1, 0.02, (6, 2)), strict=True)
]


def turned(place, angle=0.0):
    A = np.eye(3)
    A[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(A, [0.0, *place])


FRAMES = [[turned(ends[0], 0.3 * i), turned(ends[1], -0.2 * i)] for i, ends in enumerate(ENDS)]
NEW = [turned([0.1, -0.1], 0.5), turned([0.6, 0.4], 0.1)]


@pytest.fixture(scope="module")
def plain():
    return PerStepGaussians(41, covariance_prior=0.0, covariance_floor=1e-12).fit(SHOWN, FRAMES)


def test_a_step_is_the_product_of_what_the_frames_saw(plain):
    """One step at a time, with NumPy's own mean and covariance, and `mixture.product`."""
    mean, covariance = plain.retrieve(NEW)
    for k in (5, 17, 30):
        seen = []
        for j, frame in enumerate(NEW):
            local = np.array(
                [
                    ours[j].to_frame(one[k : k + 1])[0, 1:]
                    for one, ours in zip(SHOWN, FRAMES, strict=True)
                ]
            )
            gaussian = Gaussian(local.mean(axis=0), np.cov(local.T, bias=True))
            seen.append(gaussian.linear_map(frame.A[1:, 1:], frame.b[1:]))
        expected = product(seen)[0]
        np.testing.assert_allclose(mean[k], expected.mean, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(covariance[k], expected.covariance, rtol=1e-5, atol=1e-11)


def test_the_prior_is_a_mean_with_what_varies_alike(plain):
    """(N S + n tr(S) / d I) / (N + n)."""
    with_prior = PerStepGaussians(41, covariance_prior=3.0, covariance_floor=1e-12)
    found, sample = with_prior.fit(SHOWN, FRAMES).covariances_, plain.covariances_
    alike = np.trace(sample, axis1=-2, axis2=-1)[..., None, None] / 2.0 * np.eye(2)
    np.testing.assert_allclose(found, (6.0 * sample + 3.0 * alike) / 9.0, atol=1e-10)


def test_a_world_that_is_turned_has_the_same_path_turned():
    model = PerStepGaussians(41).fit(SHOWN, FRAMES)
    world = turned([0.3, -0.2], 1.1)
    moved = [TaskFrame(world.A @ one.A, world.A @ one.b + world.b) for one in NEW]
    (mean, covariance), (other, spread) = model.retrieve(NEW), model.retrieve(moved)
    np.testing.assert_allclose(other, mean @ world.A[1:, 1:].T + world.b[1:], atol=1e-9)
    np.testing.assert_allclose(
        spread, world.A[1:, 1:] @ covariance @ world.A[1:, 1:].T, atol=1e-12
    )


def test_a_path_begins_and_ends_where_its_frames_stand():
    """All demonstrations begin at the first frame and end at the second."""
    mean, covariance = PerStepGaussians(41).fit(SHOWN, FRAMES).retrieve(NEW)
    np.testing.assert_allclose(mean[[0, -1]], [one.b[1:] for one in NEW], atol=1e-5)
    middle = np.trace(covariance[20])
    assert np.trace(covariance[0]) < 1e-2 * middle > np.trace(covariance[-1])


def test_a_weight_is_a_number_of_demonstrations():
    twice = PerStepGaussians(41).fit([*SHOWN, SHOWN[0]], [*FRAMES, FRAMES[0]])
    weighted = PerStepGaussians(41, covariance_prior=2.0 * 6.0 / 7.0)
    weighted.fit(SHOWN, FRAMES, [2.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(twice.retrieve(NEW)[0], weighted.retrieve(NEW)[0], atol=1e-6)


def test_slower_demonstrations_are_the_same_movement():
    slower = [one * [1.5, 1.0, 1.0] for one in SHOWN]
    model, same = PerStepGaussians(41).fit(slower, FRAMES), PerStepGaussians(41).fit(SHOWN, FRAMES)
    assert model.time_[-1] == pytest.approx(3.0)
    np.testing.assert_allclose(model.retrieve(NEW)[0], same.retrieve(NEW)[0], atol=1e-9)


def test_a_frame_that_is_missing_is_no_factor(plain):
    alone = PerStepGaussians(41, covariance_prior=0.0, covariance_floor=1e-12)
    alone.fit(SHOWN, [ours[:1] for ours in FRAMES])
    np.testing.assert_allclose(
        plain.retrieve([NEW[0], None])[0], alone.retrieve(NEW[:1])[0], atol=1e-9
    )
    with pytest.raises(ValueError, match="all task frames are missing"):
        plain.retrieve([None, None])


def test_between_steps_both_are_linear_and_beyond_the_ends_they_stay(plain):
    mean, covariance = plain.retrieve(NEW)
    half = 0.5 * (TIME[3] + TIME[4])
    between, spread = plain.retrieve(NEW, [-1.0, half, 9.0])
    np.testing.assert_allclose(between, [mean[0], 0.5 * (mean[3] + mean[4]), mean[-1]])
    np.testing.assert_allclose(spread[1], 0.5 * (covariance[3] + covariance[4]))


def test_the_likelihood_is_that_of_the_gaussians(plain):
    model = PerStepGaussians(41).fit(SHOWN, FRAMES)
    expected = 0.0
    for one, ours in zip(SHOWN[:2], FRAMES, strict=False):
        for j, frame in enumerate(ours):
            local = frame.to_frame(one)[:, 1:]
            expected += sum(
                float(Gaussian(mean, covariance).log_density(row))
                for mean, covariance, row in zip(
                    model.means_[j], model.covariances_[j], local, strict=True
                )
            )
    assert model.log_likelihood(SHOWN[:2], FRAMES[:2]) == pytest.approx(expected)
    assert model.n_parameters == 2 * 41 * 5


@pytest.mark.parametrize(
    ("samples", "frames", "why"),
    [
        ([], [], "there is no demonstration"),
        (SHOWN, FRAMES[:3], "one list of frames per demonstration"),
        ([SHOWN[0], SHOWN[1][:, :2]], FRAMES[:2], "demonstration 1 has 2 columns, the first 3"),
        ([SHOWN[0][::-1]], FRAMES[:1], "time must increase"),
        ([SHOWN[0][:1]], FRAMES[:1], "at least 2 are needed"),
        (SHOWN[:2], [FRAMES[0], [FRAMES[1][0], None]], "a task frame is missing"),
        (SHOWN[:2], [FRAMES[0], FRAMES[1][:1]], "has 1 task frames, expected 2"),
        (SHOWN[:1], [[TaskFrame(np.eye(3), [0.1, 0.0, 0.0])]], "changes time"),
        (SHOWN[:1], [[PartialFrame(np.eye(3)[:, :2], np.zeros(3))]], "must be a TaskFrame"),
        (SHOWN[:1], [[[FRAMES[0][0]] * 41]], "is given for 41 samples, there are 1"),
        ([np.full((5, 3), np.nan)], FRAMES[:1], "holds nan"),
    ],
)
def test_what_cannot_be_learned_from_is_said(samples, frames, why):
    with pytest.raises(ValueError, match=why):
        PerStepGaussians().fit(samples, frames)


def test_one_demonstration_is_drawn_again():
    """Its covariances are the floor, in both frames alike."""
    model = PerStepGaussians(41).fit(SHOWN[:1], FRAMES[:1])
    np.testing.assert_allclose(model.retrieve(FRAMES[0])[0], SHOWN[0][:, 1:], atol=1e-9)


def test_a_model_that_was_not_fitted_says_so():
    for ask in (lambda m: m.retrieve(NEW), lambda m: m.condition(0.0, [0.0, 0.0])):
        with pytest.raises(ValueError, match="no model yet; call fit first"):
            ask(PerStepGaussians())
