"""Mixtures on disk: what comes back, and what is refused."""

import numpy as np
import pytest

from dart_skill.mixture import GaussianMixture


@pytest.fixture
def mixture():
    rng = np.random.default_rng(0)
    return GaussianMixture(3).fit(rng.normal(size=(200, 3)), rng=rng)


@pytest.fixture
def saved(mixture, tmp_path):
    mixture.save(tmp_path / "mixture.npz")
    return tmp_path / "mixture.npz"


def rewrite(path, **changes):
    with np.load(path) as archive:
        content = dict(archive)
    content.update(changes)
    np.savez(path, **{name: value for name, value in content.items() if value is not None})


def test_a_mixture_comes_back_to_the_last_bit(mixture, saved):
    loaded = GaussianMixture.load(saved)
    for name in ("priors_", "means_", "covariances_"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(mixture, name))
    assert loaded.n_components == 3
    np.testing.assert_array_equal(
        loaded.log_density(mixture.means_), mixture.log_density(mixture.means_)
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": np.array("dart_skill GaussianMixture 99")}, "version 99"),
        ({"format": None}, "format"),
        ({"means": None}, "means"),
        ({"priors": np.array([0.5, 0.5, 0.5])}, "sum to one"),
        ({"priors": np.array([0.5, 0.5])}, "shorter|longer|argument"),
        ({"priors": np.array([np.nan, 0.5, 0.5])}, "nan"),
        ({"means": np.zeros((3, 2))}, "shape"),
        ({"covariances": np.zeros((3, 3))}, "dimension|shape"),
        ({"covariances": -np.stack([np.eye(3)] * 3)}, "variance -1"),
        ({"priors": np.array([{"a": 1}], dtype=object)}, "priors.npy says that it has the shape"),
    ],
)
def test_parameters_that_are_no_mixture_are_refused(saved, changes, message):
    rewrite(saved, **changes)
    with pytest.raises(ValueError, match=f"(?s)holds no GaussianMixture.*({message})"):
        GaussianMixture.load(saved)
