"""Components from sums over the samples, and coefficients of their log densities, beside NumPy's
matrices.
"""

import numpy as np
import pytest

from dart_skill.mixture import _second_moments
from tests.interpreted import interpreted

PLAIN = interpreted("dart_skill.mixture._second_moments")


def sums_of(rng, n_blocks, n_components, d):
    """Sums (P, K, q) of random counts times products of (1, z) of random samples, the upper
    triangles by rows.
    """
    samples, counts = (
        rng.normal(size=(n_blocks, 60, d)) + rng.normal(size=(n_blocks, 1, d)),
        rng.random((n_components, 60)),
    )
    extended = np.concatenate([np.ones((n_blocks, 60, 1)), samples], axis=2)
    squares = np.einsum("kn,pni,pnj->pkij", counts, extended, extended)
    return squares, squares[(..., *np.triu_indices(1 + d))]


def components_by(module, sums, d):
    stack = sums.shape[:2]
    found = np.empty((*stack, d)), np.empty((*stack, d, 1 + d)), np.empty(stack), np.empty(stack)
    return module.write_components(sums, *found), found


def coefficients_by(module, affine, log_volumes, of_blocks, least_peaks):
    p, k, d, _ = affine.shape
    columns = np.arange(p * (1 + d) * (2 + d) // 2).reshape(p, -1)
    coefficients, highest = np.zeros((k, columns.size)), np.ones(k)
    module.write_coefficients(
        affine, log_volumes, of_blocks, least_peaks, highest, columns, coefficients
    )
    return coefficients, highest


@pytest.mark.parametrize(
    ("n_blocks", "n_components", "d"), [(1, 1, 1), (2, 3, 2), (1, 3, 6), (2, 2, 9)]
)
def test_components_are_those_of_the_means_and_covariances(n_blocks, n_components, d):
    squares, sums = sums_of(np.random.default_rng(d), n_blocks, n_components, d)
    moments = squares / squares[..., :1, :1]
    expected_means = moments[..., 0, 1:]
    covariances = (
        moments[..., 1:, 1:] - expected_means[..., :, None] * expected_means[..., None, :]
    )
    whiteners = np.linalg.inv(np.linalg.cholesky(covariances))
    made, (means, affine, log_volumes, precisions) = components_by(_second_moments, sums, d)
    assert made
    np.testing.assert_allclose(means, expected_means, rtol=1e-12)
    np.testing.assert_allclose(affine[..., 1:], whiteners, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        affine[..., 0],
        -np.einsum("pkij,pkj->pki", whiteners, expected_means),
        rtol=1e-9,
        atol=1e-12,
    )
    np.testing.assert_allclose(
        log_volumes, 0.5 * np.linalg.slogdet(2.0 * np.pi * covariances)[1], rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        precisions, np.trace(np.linalg.inv(covariances), axis1=2, axis2=3), rtol=1e-9
    )


def test_coefficients_make_the_log_density_of_products():
    rng, d = np.random.default_rng(1), 4
    _, (_, affine, log_volumes, _) = components_by(_second_moments, sums_of(rng, 2, 3, d)[1], d)
    of_blocks, points = (
        rng.normal(size=2),
        np.concatenate([np.ones((2, 7, 1)), rng.normal(size=(2, 7, d))], axis=2),
    )
    products = (points[..., :, None] * points[..., None, :])[(..., *np.triu_indices(1 + d))]
    white = np.einsum("pkij,pnj->pkni", affine, points)
    log_peaks = -of_blocks[:, None] - log_volumes
    expected = (log_peaks[..., None] - 0.5 * np.square(white).sum(-1)).sum(0)
    coefficients, highest = coefficients_by(
        _second_moments, affine, log_volumes, of_blocks, np.array([-np.inf, 0.0])
    )
    np.testing.assert_allclose(
        coefficients @ np.concatenate(list(products), axis=1).T, expected, rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(
        highest, 1.0 + log_peaks[0] + np.maximum(log_peaks[1], 0.0), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("module", [_second_moments, PLAIN])
@pytest.mark.parametrize("variance", [0.0, -1.0, np.nan])
def test_a_covariance_that_is_not_positive_definite_makes_no_component(module, variance):
    sums = np.array([[[2.0, 2.0, 0.0, 6.0, 0.0, 2.0 * variance]]])
    assert not components_by(module, sums, 2)[0]


def test_compiled_and_interpreted_have_the_same_bits():
    for d in (1, 3, 6):
        _, sums = sums_of(np.random.default_rng(d), 2, 3, d)
        (_, found), (_, plain) = (
            components_by(_second_moments, sums, d),
            components_by(PLAIN, sums, d),
        )
        for one, other in zip(found, plain, strict=True):
            np.testing.assert_array_equal(one, other)
        arguments = found[1], found[2], np.array([0.3, -2.0]), np.array([0.0, -np.inf])
        for one, other in zip(
            coefficients_by(_second_moments, *arguments),
            coefficients_by(PLAIN, *arguments),
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)
