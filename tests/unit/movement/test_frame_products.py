"""Products of Gaussians that task frames see beside sums of precisions, and conditional
distributions.
"""

import numpy as np
import pytest

from dart_skill.movement import PartialFrame, TaskFrame, TaskParameterisedMixture


def gaussians(rng, n_frames, n_components, m):
    """Means (P, K, m) and covariances (P, K, m, m)."""
    roots = rng.normal(size=(n_frames, n_components, m, m))
    return rng.normal(size=(n_frames, n_components, m)), roots @ roots.swapaxes(
        -1, -2
    ) + 0.1 * np.eye(m)


def frames(rng, n, n_frames, m, n_shared=0):
    """A, b and seen of random frames, which pass the first features through; at some
    moments one is missing.
    """
    A, b = np.tile(np.eye(m), (n, n_frames, 1, 1)), np.zeros((n, n_frames, m))
    A[..., n_shared:, n_shared:] = rng.normal(
        size=(n, n_frames, m - n_shared, m - n_shared)
    ) + 2.0 * np.eye(m - n_shared)
    b[..., n_shared:] = rng.normal(size=(n, n_frames, m - n_shared))
    seen = np.ones((n, n_frames), dtype=bool)
    seen[1::2, 0] = n_frames == 1
    return A, b, seen


def products_of(means, covariances, situation, n_shared=0):
    """Means (n, K, m) and covariances (n, K, m, m) in the world."""
    k = means.shape[1]
    mixture = TaskParameterisedMixture.from_parameters(
        np.full(k, 1.0 / k), means, covariances, n_shared
    )
    found = [
        mixture.product(
            [TaskFrame(*frame) if there else None for *frame, there in zip(*moment, strict=True)]
        )
        for moment in zip(*situation, strict=True)
    ]
    return np.array([one.means_ for one in found]), np.array([one.covariances_ for one in found])


def in_the_world(means, covariances, situation, n, k):
    """Means (f, m) and covariances (f, m, m) of component k, mapped by the frames that are there
    at moment n.
    """
    A, b, seen = situation
    there = np.flatnonzero(seen[n])
    mapped = [
        (A[n, p] @ means[p, k] + b[n, p], A[n, p] @ covariances[p, k] @ A[n, p].T) for p in there
    ]
    return [np.stack(values) for values in zip(*mapped, strict=True)]


@pytest.mark.parametrize(("n_frames", "m"), [(1, 1), (1, 4), (2, 3), (3, 6)])
def test_precisions_add_up(n_frames, m):
    rng = np.random.default_rng(m)
    (means, covariances), situation = gaussians(rng, n_frames, 2, m), frames(rng, 4, n_frames, m)
    mean, covariance = products_of(means, covariances, situation)
    for n in range(4):
        for k in range(2):
            centres, spreads = in_the_world(means, covariances, situation, n, k)
            precisions = np.linalg.inv(spreads)
            expected = np.linalg.inv(precisions.sum(0))
            np.testing.assert_allclose(covariance[n, k], expected, rtol=1e-7, atol=1e-9)
            np.testing.assert_allclose(
                mean[n, k],
                expected @ np.einsum("pij,pj->i", precisions, centres),
                rtol=1e-7,
                atol=1e-9,
            )


@pytest.mark.parametrize(("n_frames", "m", "n_shared"), [(1, 2, 1), (2, 4, 1), (3, 5, 2)])
def test_shared_features_are_those_of_the_first_frame_and_the_others_are_products_given_them(
    n_frames, m, n_shared
):
    rng = np.random.default_rng(m)
    (means, covariances), situation = (
        gaussians(rng, n_frames, 2, m),
        frames(rng, 3, n_frames, m, n_shared),
    )
    mean, covariance = products_of(means, covariances, situation, n_shared)
    shared, others = slice(None, n_shared), slice(n_shared, None)
    for n in range(3):
        for k in range(2):
            centres, spreads = in_the_world(means, covariances, situation, n, k)
            slopes = [
                spread[others, shared] @ np.linalg.inv(spread[shared, shared])
                for spread in spreads
            ]
            precisions = [
                np.linalg.inv(one[others, others] - slope @ one[shared, others])
                for slope, one in zip(slopes, spreads, strict=True)
            ]
            within = np.linalg.inv(sum(precisions))
            slope = within @ sum(
                precision @ one for precision, one in zip(precisions, slopes, strict=True)
            )
            offsets = [
                centre[others] - one @ centre[shared]
                for centre, one in zip(centres, slopes, strict=True)
            ]
            offset = within @ sum(
                precision @ one for precision, one in zip(precisions, offsets, strict=True)
            )
            of_shared = spreads[0][shared, shared]
            np.testing.assert_allclose(
                mean[n, k, shared], centres[0][shared], rtol=1e-8, atol=1e-9
            )
            np.testing.assert_allclose(
                mean[n, k, others], offset + slope @ centres[0][shared], rtol=1e-6, atol=1e-8
            )
            np.testing.assert_allclose(
                covariance[n, k, shared, shared], of_shared, rtol=1e-7, atol=1e-9
            )
            np.testing.assert_allclose(
                covariance[n, k, others, shared], slope @ of_shared, rtol=1e-6, atol=1e-8
            )
            np.testing.assert_allclose(
                covariance[n, k, others, others],
                within + slope @ of_shared @ slope.T,
                rtol=1e-6,
                atol=1e-8,
            )


@pytest.mark.parametrize("n_shared", [0, 1])
def test_a_feature_that_no_frame_tells_from_others_is_named(n_shared):
    means, covariances = gaussians(np.random.default_rng(0), 2, 2, 4)
    mixture = TaskParameterisedMixture.from_parameters(
        [0.5, 0.5],
        [means[0], means[1, :, :3]],
        [covariances[0], covariances[1, :, :3, :3]],
        n_shared,
    )
    partial = PartialFrame(np.eye(4)[:, [0, 1, 3]], np.zeros(4))
    assert mixture.product([TaskFrame(np.eye(4), np.zeros(4)), partial]).n_dims == 4
    with pytest.raises(ValueError, match="do not tell feature 2 of the world"):
        mixture.product([None, partial])


def test_a_frame_without_error_in_a_direction_loses_no_digits():
    """Squares of such condition numbers, as in a sum of precisions, would."""
    means, covariances = (
        np.zeros((2, 1, 2)),
        np.array([[np.diag([1e-16, 1.0])], [np.diag([1.0, 1e-16])]]),
    )
    A = np.array([[np.array([[0.6, -0.8], [0.8, 0.6]]), np.array([[0.6, -0.8], [0.8, 0.6]])]])
    situation = A, np.array([[[1.0, 2.0], [1.0, 2.0]]]), np.ones((1, 2), dtype=bool)
    mean, covariance = products_of(means, covariances, situation)
    np.testing.assert_allclose(mean[0, 0], [1.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(covariance[0, 0], 1e-16 * np.eye(2), atol=1e-23)
