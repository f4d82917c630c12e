"""Gaussian mixtures of poses: against the Euclidean ones where the spread is tiny, and the laws of
the manifold where it is not.
"""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from dart_skill.mixture import GaussianMixture, product_of_gaussians, regress
from dart_skill.movement.pose import (
    PoseFrame,
    PoseMixture,
    TaskParameterisedPoseMixture,
    exponential,
    logarithm,
    mean_point,
    product_of_poses,
)
from tests.unit.movement.pose.random_poses import (
    apart,
    near,
    orientations,
)

TINY = 1e-6
"""Spread [rad] at which the curvature of the manifold, of its order, is below the tolerance."""
CENTRE = np.array([0.1, -0.5, 0.7, 0.2, 0.4, 0.3, np.sqrt(1.0 - 0.29)])


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def demonstrations(rng, n=400, turn=4.0):
    """Rows t, x, y, z, quaternion (n, 8) that turn by `turn` [rad] about an axis that leans."""
    time = np.sort(rng.uniform(0.0, 1.0, n))
    axis = np.column_stack([0.3 * np.sin(3.0 * time), 0.2 * time, np.ones(n)])
    path = Rotation.from_rotvec(turn * time[:, None] * axis) * Rotation.from_quat(
        [0.5, 0.5, 0.5, 0.5]
    )
    noisy = Rotation.from_rotvec(rng.normal(0.0, 0.05, (n, 3))) * path
    position = np.column_stack([time, np.sin(3.0 * time), np.zeros(n)]) + rng.normal(
        0.0, 0.01, (n, 3)
    )
    return np.column_stack([time, position, noisy.as_quat()])


WORLD = PoseFrame(np.zeros(3))


def fitted(n_components, rows, weights=None, *, rng=None, **options):
    """Mixture of poses (n, q + 7) that are seen from the world alone."""
    mixture = TaskParameterisedPoseMixture(n_components, correlated=True, **options)
    weights = None if weights is None else [weights]
    return mixture.fit([rows], [[WORLD]], weights, rng=rng).product([WORLD])


def tangent_cloud(rng, n=300):
    """Numbers (n, 7) in two clusters, of size one, and the rows (n, 8) of poses of which they are
    TINY tangent vectors.
    """
    flat = (
        rng.normal(size=(n, 7)) @ (np.eye(7) + 0.3 * rng.normal(size=(7, 7)))
        + np.where(rng.random(n) < 0.4, 3.0, 0.0)[:, None]
    )
    return flat, exponential(CENTRE_ROW, TINY * flat)


CENTRE_ROW = np.concatenate([[0.0], CENTRE])


@pytest.mark.parametrize("into", [[0], [1, 3]])
def test_with_tiny_spread_regression_is_the_euclidean_one(rng, into):
    flat, rows = tangent_cloud(rng)
    euclidean = GaussianMixture(2).fit(flat, rng=rng)
    means = exponential(CENTRE_ROW, TINY * euclidean.means_)
    curved = PoseMixture(euclidean.priors_, means, TINY**2 * euclidean.covariances_)
    rest = np.setdiff1d(np.arange(7), into)
    wanted, wanted_covariance = regress(euclidean, flat[:40, into], into, rest)
    mean, covariance = curved.regress(rows[:40, into], into)
    base = np.delete(CENTRE_ROW, into)
    np.testing.assert_allclose(logarithm(base, mean) / TINY, wanted, atol=1e-5)
    np.testing.assert_allclose(covariance / TINY**2, wanted_covariance, atol=1e-5)


def test_with_tiny_spread_the_product_is_the_euclidean_one(rng):
    means, roots = rng.normal(size=(3, 6)), rng.normal(size=(3, 6, 6))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(6)
    mode, covariance = product_of_poses(exponential(CENTRE, TINY * means), TINY**2 * covariances)
    wanted = product_of_gaussians(means, covariances)
    np.testing.assert_allclose(logarithm(CENTRE, mode) / TINY, wanted[0], atol=1e-5)
    np.testing.assert_allclose(covariance / TINY**2, wanted[1], atol=1e-5)


def random_factors(rng, n, apart_by):
    means = np.column_stack(
        [rng.normal(size=(n, 3)), near(orientations(1, rng)[0], apart_by, n, rng)]
    )
    roots = rng.normal(size=(n, 6, 6))
    return means, 0.3 * roots @ np.swapaxes(roots, 1, 2) + 0.05 * np.eye(6)


@pytest.mark.parametrize("seed", range(6))
def test_the_mode_of_a_product_is_where_the_density_is_largest(seed):
    rng = np.random.default_rng(seed)
    means, covariances = random_factors(rng, 3, 0.8)
    mode, covariance = product_of_poses(means, covariances)

    def cost(move):
        ways = logarithm(means, exponential(mode, move))
        return 0.5 * sum(
            way @ np.linalg.solve(one, way) for way, one in zip(ways, covariances, strict=True)
        )

    assert (
        np.abs(minimize(cost, np.zeros(6), method="BFGS", options={"gtol": 1e-9}).x).max() < 1e-6
    )
    begins = [logarithm(mode, other) for other in means]
    best = min(minimize(cost, begin, method="BFGS").fun for begin in begins)
    assert cost(np.zeros(6)) <= best + 1e-9
    assert np.linalg.eigvalsh(covariance).min() > 0


def test_a_product_of_factors_that_differ_by_nearly_half_a_turn_stays_at_the_sharp_one():
    turn = exponential(CENTRE, [0.0, 0.0, 0.0, 0.0, 0.0, np.radians(179.0)])
    mode, covariance = product_of_poses(
        [CENTRE, turn], [1e-4 * np.eye(6), np.diag([1.0] * 3 + [4.0] * 3)]
    )
    assert apart(mode, CENTRE) < 2e-4
    np.testing.assert_allclose(covariance[3:, 3:], 1e-4 * np.eye(3), atol=1e-7)


@pytest.mark.parametrize("degrees", [90, 180, 360, 720])
def test_regression_follows_a_turn_through_half_a_turn_and_beyond(degrees):
    time = np.linspace(0.0, 1.0, 400)
    path = Rotation.from_rotvec(np.radians(degrees) * time[:, None] * np.array([0.6, 0.0, 0.8]))
    rows = np.column_stack([time, np.zeros((400, 3)), path.as_quat()])
    mixture = fitted(2 + degrees // 45, rows)
    mean, covariance = mixture.regress(time)
    # A constant rate is linear in each tangent space, so all components agree.
    assert np.degrees(apart(mean, path.as_quat())) < 0.2
    assert np.linalg.eigvalsh(covariance).min() > -1e-15


def test_regression_of_one_component_is_the_iteration_of_calinon(rng):
    """Calinon 2020: the estimate moves until the tangent conditional mean, with a transported
    covariance, is zero.
    """
    root = 0.3 * rng.normal(size=(7, 7))
    mixture = PoseMixture(np.ones(1), CENTRE_ROW[None], (root @ root.T + 0.02 * np.eye(7))[None])
    (wanted,), _ = mixture.regress([0.8])
    estimate = CENTRE
    slope = mixture.covariances_[0, 1:, 0] / mixture.covariances_[0, 0, 0]
    for _ in range(100):
        half = Rotation.from_rotvec(0.5 * logarithm(CENTRE, estimate)[3:])
        carried = np.concatenate([slope[:3], half.apply(slope[3:])])
        estimate = exponential(estimate, logarithm(estimate, CENTRE) + carried * 0.8)
    assert apart(estimate, wanted) < 1e-12
    np.testing.assert_allclose(estimate[:3], wanted[:3], atol=1e-12)


def test_regression_averages_components_that_disagree(rng):
    """Two components at the same time: mean and covariance are those of the two orientations."""
    means = np.array([[0.0, *CENTRE], [0.0, *exponential(CENTRE, [0.2, 0.0, 0.0, 0.0, 0.9, 0.0])]])
    mixture = PoseMixture(np.full(2, 0.5), means, np.tile(1e-6 * np.eye(7), (2, 1, 1)))
    mean, covariance = mixture.regress([0.0])
    assert apart(mean[0], mean_point(means[:, 1:])) < 1e-12
    np.testing.assert_allclose(
        np.diag(covariance[0]), [0.01, 0.0, 0.0, 0.0, 0.45**2, 0.0], atol=2e-6
    )


def test_a_sample_with_weight_two_counts_as_two(rng):
    rows = demonstrations(rng, 120)
    weights = rng.integers(0, 3, 120)
    weighted, repeated = (
        fitted(3, rows, weights),
        fitted(3, np.repeat(rows, weights, axis=0)),
    )
    assert apart(weighted.means_, repeated.means_) < 1e-8
    np.testing.assert_allclose(weighted.covariances_, repeated.covariances_, atol=1e-8)


def test_a_still_hand_gives_a_mixture(rng):
    rows = np.column_stack([np.linspace(0.0, 1.0, 50), np.tile(CENTRE, (50, 1))])
    mean, covariance = fitted(3, rows).regress([0.5])
    assert apart(mean, CENTRE) < 1e-12 and np.isfinite(covariance).all()


FITTED = PoseMixture(np.ones(1), CENTRE_ROW[None], np.eye(7)[None])
WRONG = {
    "within 0..3": lambda: FITTED.regress([0.0], [4]),
    "inputs must have 1 columns": lambda: FITTED.regress([[0.0, 1.0]]),
    "so far away that its log density overflows": lambda: FITTED.regress([1e200]),
    "must have columns x, y, z and a quaternion": lambda: PoseMixture(
        np.ones(1), CENTRE_ROW[None, 2:], np.eye(7)[None]
    ),
    "means must have 2 dimension": lambda: product_of_poses(CENTRE, np.eye(6)),
    "covariances must have shape": lambda: product_of_poses([CENTRE], np.eye(6)),
    "covariance of factor is not positive definite": lambda: product_of_poses(
        [CENTRE], np.zeros((1, 6, 6))
    ),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    with pytest.raises(ValueError, match=message):
        WRONG[message]()
