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
