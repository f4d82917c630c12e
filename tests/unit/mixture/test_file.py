"""Mixtures on disk: what comes back, and what is refused."""

import pickle

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


def test_a_file_that_exists_is_not_overwritten(mixture, saved):
    before = saved.read_bytes()
    with pytest.raises(FileExistsError):
        mixture.save(saved)
    assert saved.read_bytes() == before


def test_an_unfitted_mixture_is_not_saved(tmp_path):
    with pytest.raises(ValueError, match="call fit"):
        GaussianMixture(2).save(tmp_path / "none.npz")
    assert not (tmp_path / "none.npz").exists()


def test_a_missing_file_is_missing(tmp_path):
    with pytest.raises(FileNotFoundError):
        GaussianMixture.load(tmp_path / "none.npz")


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.7, 0.99])
def test_a_truncated_file_is_refused_by_name(saved, share):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(ValueError, match="mixture.npz holds no GaussianMixture that can be read"):
        GaussianMixture.load(saved)


def test_flipped_bytes_are_noticed(saved):
    content = bytearray(saved.read_bytes())
    middle = content.find(b"means.npy") + 200
    content[middle] ^= 0xFF
    saved.write_bytes(content)
    with pytest.raises(ValueError, match="can be read"):
        GaussianMixture.load(saved)


@pytest.mark.parametrize(
    "content",
    [
        b"priors: [0.5, 0.5]\n",
        pickle.dumps({"priors": [1.0]}),
        b"\x93NUMPY\x01\x00",
        b"PK\x03\x04 and more",
    ],
)
def test_a_foreign_file_is_refused(tmp_path, content):
    path = tmp_path / "foreign.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="foreign.npz holds no GaussianMixture"):
        GaussianMixture.load(path)


def test_a_plain_array_and_a_directory_are_refused(tmp_path):
    np.save(tmp_path / "array.npy", np.eye(3))
    with pytest.raises(ValueError, match="holds no GaussianMixture"):
        GaussianMixture.load(tmp_path / "array.npy")
    with pytest.raises(OSError, match="is a folder"):
        GaussianMixture.load(tmp_path)


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
