"""A mixture of random Gaussians, none of them nearly flat."""

import numpy as np

from dart_skill.mixture import GaussianMixture


def random_mixture(rng, n_components=3, n_dims=3):
    """Priors, means and covariances are all drawn."""
    roots = rng.normal(size=(n_components, n_dims, n_dims))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.2 * np.eye(n_dims)
    priors = rng.dirichlet(np.full(n_components, 5.0))
    return GaussianMixture.from_parameters(
        priors, 2.0 * rng.normal(size=(n_components, n_dims)), covariances
    )


def whole(mixture):
    """The Gaussian with the mean and covariance of the whole mixture."""
    return mixture.merge(np.arange(len(mixture.priors_))).components[0]


def given_values(mixture, dims, values):
    """The mixture of the other dimensions, in ascending order, given x[dims] = values: each
    component by itself, and Bayes' rule.
    """
    shares = mixture.marginal(dims).responsibilities(np.atleast_2d(values))[0]
    parts = [one.condition(dims, values) for one in mixture.components]
    kept = np.flatnonzero(shares)
    return GaussianMixture.from_parameters(
        shares[kept], [parts[k].mean for k in kept], [parts[k].covariance for k in kept]
    )
