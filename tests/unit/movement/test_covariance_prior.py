"""A prior on the covariances of a task-parameterised mixture: closed forms, the ordinary
mixture's, and few demonstrations.
"""

import numpy as np
import pytest

from dart_skill.mixture import GaussianMixture
from dart_skill.movement import DSGMR, TaskFrame, TaskParameterisedMixture


def frame(rng, n_dims):
    """A frame of time and further columns, turned in a plane and shifted."""
    matrix, angle = np.eye(n_dims), rng.uniform(-1.0, 1.0)
    matrix[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, np.concatenate([[0.0], rng.normal(size=n_dims - 1)]))


def demonstrations(rng, n, n_samples=12, n_dims=8):
    """Rows of time and movement variables that go from the first frame to the second, with noise;
    and the frames.
    """
    time, found, frames = np.linspace(0.0, 1.0, n_samples), [], []
    for _ in range(n):
        pair = [frame(rng, n_dims), frame(rng, n_dims)]
        ends = [one.from_frame(np.zeros((1, n_dims)))[:, 1:] for one in pair]
        path = (
            ends[0]
            + time[:, None] * (ends[1] - ends[0])
            + rng.normal(0.0, 0.05, (n_samples, n_dims - 1))
        )
        found.append(np.column_stack([time, path]))
        frames.append(pair)
    return found, frames


@pytest.mark.parametrize("n_components", [1, 3])
def test_in_one_frame_it_is_that_of_the_ordinary_mixture(n_components):
    rng = np.random.default_rng(1)
    samples = [
        np.column_stack([np.linspace(0.0, 1.0, 30), rng.normal(size=(30, 2)).cumsum(0)])
        for _ in range(3)
    ]
    options = dict(covariance_prior=4.0, tolerance=1e-13, max_iterations=3000)
    found = TaskParameterisedMixture(n_components, **options).fit(
        samples, [[TaskFrame(np.eye(3), np.zeros(3))]] * 3
    )
    start = GaussianMixture.from_parameters(found.priors_, found.means_[0], found.covariances_[0])
    ordinary = GaussianMixture(n_components, **options).fit(np.concatenate(samples), start=start)
    np.testing.assert_allclose(ordinary.covariances_, found.covariances_[0], rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(ordinary.means_, found.means_[0], rtol=1e-5, atol=1e-8)


def test_ds_gmr_takes_it_keeps_it_and_saves_it(tmp_path):
    samples, frames = demonstrations(np.random.default_rng(3), 3, 40, 3)
    for partition in ("em", "time"):
        model = DSGMR(4, partition=partition, covariance_prior=3.0).fit(samples, frames)
        plain = DSGMR(4, partition=partition).fit(samples, frames)
        assert np.abs(model.mixture_.covariances_ - plain.mixture_.covariances_).max() > 1e-4
        assert model.get_params()["covariance_prior"] == 3.0 and "covariance_prior=3.0" in repr(
            model
        )
        model.save(tmp_path / f"{partition}.npz")
        assert DSGMR.load(tmp_path / f"{partition}.npz").get_params()["covariance_prior"] == 3.0
    with pytest.raises(ValueError, match="covariance_prior must be at least 0"):
        TaskParameterisedMixture(2, covariance_prior=-1.0)
