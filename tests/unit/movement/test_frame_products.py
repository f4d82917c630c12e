"""What task frames see beside NumPy's matrices; products of Gaussians beside sums of precisions,
and conditional distributions.
"""

import numpy as np
import pytest

from dart_skill.movement import _frame_products
from tests.interpreted import interpreted

PLAIN = interpreted("dart_skill.movement._frame_products")


def gaussians(rng, n_frames, n_components, m):
    """Means (P, K, m) and covariances (P, K, m, m)."""
    roots = rng.normal(size=(n_frames, n_components, m, m))
    return rng.normal(size=(n_frames, n_components, m)), roots @ roots.swapaxes(
        -1, -2
    ) + 0.1 * np.eye(m)


def frames(rng, n, n_frames, m, n_shared=0):
    """A, inverses, b and seen of random frames, which pass the first features through; at some
    moments one is missing.
    """
    A, b = np.tile(np.eye(m), (n, n_frames, 1, 1)), np.zeros((n, n_frames, m))
    A[..., n_shared:, n_shared:] = rng.normal(
        size=(n, n_frames, m - n_shared, m - n_shared)
    ) + 2.0 * np.eye(m - n_shared)
    b[..., n_shared:] = rng.normal(size=(n, n_frames, m - n_shared))
    seen = np.ones((n, n_frames), dtype=np.uint8)
    seen[1::2, 0] = n_frames == 1
    return A, np.linalg.inv(A), b, seen


def products_by(module, means, covariances, situation, n_shared=0):
    n, (_, k, m) = len(situation[0]), means.shape
    mean, covariance = np.empty((n, k, m)), np.empty((n, k, m, m))
    products = module.FrameProducts(
        means, np.linalg.inv(np.linalg.cholesky(covariances)), n_shared
    )
    return products.write(*situation, mean, covariance), mean, covariance


def in_the_world(means, covariances, situation, n, k):
    """Means (f, m) and covariances (f, m, m) of component k, mapped by the frames that are there
    at moment n.
    """
    A, _, b, seen = situation
    there = np.flatnonzero(seen[n])
    mapped = [
        (A[n, p] @ means[p, k] + b[n, p], A[n, p] @ covariances[p, k] @ A[n, p].T) for p in there
    ]
    return [np.stack(values) for values in zip(*mapped, strict=True)]


@pytest.mark.parametrize("d", [1, 3, 4])
def test_a_sample_is_seen_from_its_place_and_stays_as_it_is_where_there_is_none(d):
    rng = np.random.default_rng(d)
    world, inverses, b, place = (
        rng.normal(size=(9, 4)),
        rng.normal(size=(3, d, 4)),
        rng.normal(size=(3, 4)),
        np.arange(9) % 4 - 1,
    )
    columns, plain = np.full((d, 9), 7.0), np.full((d, 9), 7.0)
    _frame_products.write_seen(world, inverses, b, place, columns)
    PLAIN.write_seen(world, inverses, b, place, plain)
    for n, s in enumerate(place):
        expected = np.full(d, 7.0) if s < 0 else inverses[s] @ (world[n] - b[s])
        np.testing.assert_allclose(columns[:, n], expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(columns, plain)


@pytest.mark.parametrize(("n_frames", "m"), [(1, 1), (1, 4), (2, 3), (3, 6)])
def test_precisions_add_up(n_frames, m):
    rng = np.random.default_rng(m)
    (means, covariances), situation = gaussians(rng, n_frames, 2, m), frames(rng, 4, n_frames, m)
    feature, mean, covariance = products_by(_frame_products, means, covariances, situation)
    assert feature == m
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
    feature, mean, covariance = products_by(
        _frame_products, means, covariances, situation, n_shared
    )
    shared, others = slice(None, n_shared), slice(n_shared, None)
    assert feature == m
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


@pytest.mark.parametrize("module", [_frame_products, PLAIN])
@pytest.mark.parametrize("n_shared", [0, 1])
def test_the_first_feature_that_no_frame_tells_from_others_is_named(module, n_shared):
    rng = np.random.default_rng(0)
    (means, covariances), (A, inverses, b, seen) = (
        gaussians(rng, 2, 2, 4),
        frames(rng, 3, 2, 4, n_shared),
    )
    inverses[2, :, :, 2] = 0.0
    assert products_by(module, means, covariances, (A, inverses, b, seen), n_shared)[0] == 2


def test_a_frame_without_error_in_a_direction_loses_no_digits():
    """Squares of such condition numbers, as in a sum of precisions, would."""
    means, covariances = (
        np.zeros((2, 1, 2)),
        np.array([[np.diag([1e-16, 1.0])], [np.diag([1.0, 1e-16])]]),
    )
    A = np.array([[np.array([[0.6, -0.8], [0.8, 0.6]]), np.array([[0.6, -0.8], [0.8, 0.6]])]])
    situation = (
        A,
        np.linalg.inv(A),
        np.array([[[1.0, 2.0], [1.0, 2.0]]]),
        np.ones((1, 2), dtype=np.uint8),
    )
    _, mean, covariance = products_by(_frame_products, means, covariances, situation)
    np.testing.assert_allclose(mean[0, 0], [1.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(covariance[0, 0], 1e-16 * np.eye(2), atol=1e-23)


def test_compiled_and_interpreted_have_the_same_bits():
    rng = np.random.default_rng(1)
    for n_shared in (0, 2):
        arguments = *gaussians(rng, 3, 2, 5), frames(rng, 4, 3, 5, n_shared), n_shared
        for one, other in zip(
            products_by(_frame_products, *arguments), products_by(PLAIN, *arguments), strict=True
        ):
            np.testing.assert_array_equal(one, other)
