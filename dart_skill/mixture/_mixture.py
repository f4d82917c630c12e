"""Gaussian mixture with weighted samples: thesis 3.2, 3.2.1; the likelihood is (3.1), the stop its change per
sample (errata).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._checks import as_count, as_covariances, as_number, as_samples, as_vector, as_weights
from ._expectation_maximisation import Parameters, Settings, best_fit, expectation
from ._gaussian import Gaussian, cholesky
from ._start import kmeans_start


def checked_priors(priors: ArrayLike) -> np.ndarray:
    """Priors (K,), positive and summing to one; rounding in the sum is removed."""
    priors = as_vector(priors, "priors")
    if priors.size == 0 or priors.min() <= 0 or abs(priors.sum() - 1.0) > 1e-6:
        raise ValueError(f"priors must be positive and sum to one, got {priors.tolist()}")
    return priors / priors.sum()


def n_free_parameters(n_components: int, n_dims: int) -> int:
    """Free parameters of one block: means and symmetric covariances."""
    return n_components * (n_dims + n_dims * (n_dims + 1) // 2)


def require_enough(n_samples: int, n_components: int) -> None:
    if n_samples < n_components:
        raise ValueError(
            f"{n_components} components need at least as many samples with weight, got {n_samples}; lower n_components or give more samples"
        )


class EMEstimator:
    """Hyper-parameters of EM and the outcome of a fit; the base of every mixture that EM fits.

    n_components: components at the start; one that dies twice over is dropped, so fewer may be left.
    covariance_floor: least variance in any direction relative to the variance of the data, per column.
    tolerance: stop when the mean log-likelihood per sample changes by no more than this.
    n_starts: runs with different random starts, of which the most likely is kept.
    """

    def __init__(
        self,
        n_components: int,
        *,
        covariance_floor: float = 1e-6,
        tolerance: float = 1e-6,
        max_iterations: int = 300,
        n_starts: int = 1,
    ):
        self.n_components = as_count(n_components, "n_components")
        self.covariance_floor = as_number(covariance_floor, "covariance_floor")
        self.tolerance = as_number(tolerance, "tolerance", strict=False)
        self.max_iterations = as_count(max_iterations, "max_iterations")
        self.n_starts = as_count(n_starts, "n_starts")

    def _run(self, blocks: list[np.ndarray], weights: np.ndarray, start, least_scales=0.0) -> Parameters:
        require_enough(int((weights > 0).sum()), self.n_components)
        settings = Settings(self.covariance_floor, self.tolerance, self.max_iterations)
        fit = best_fit(blocks, weights, start, settings, self.n_starts, least_scales)
        self.log_likelihood_ = fit.log_likelihood * float(weights.sum())
        self.n_iterations_, self.converged_ = fit.n_iterations, fit.converged
        return fit.parameters

    def _require_fitted(self) -> None:
        if not hasattr(self, "priors_"):
            raise ValueError(f"this {type(self).__name__} holds no parameters yet; call fit or from_parameters first")


class GaussianMixture(EMEstimator):
    """Mixture of K Gaussians with full covariances.

    Fitted: priors_ (K,), means_ (K, d), covariances_ (K, d, d), log_likelihood_ (sum over samples times
    weight, (3.1)), n_iterations_, converged_. A mixture made by `from_parameters` has the first three only.
    """

    @classmethod
    def from_parameters(cls, priors: ArrayLike, means: ArrayLike, covariances: ArrayLike) -> GaussianMixture:
        """Mixture with given priors (K,), means (K, d) and positive definite covariances (K, d, d)."""
        priors, means = checked_priors(priors), as_samples(means, "means")
        if len(means) != len(priors):
            raise ValueError(f"one mean per prior is needed, got {len(means)} for {len(priors)}")
        covariances = as_covariances(covariances, "covariances", (*means.shape, means.shape[1]))
        cholesky(covariances, "covariance of component")
        mixture = cls(len(priors))
        mixture._set(priors, means, covariances)
        return mixture

    def _set(self, priors: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> None:
        self.priors_, self.means_, self.covariances_ = priors, means, covariances

    @property
    def n_dims(self) -> int:
        self._require_fitted()
        return self.means_.shape[1]

    def fit(self, samples: ArrayLike, weights: ArrayLike | None = None, *, rng: np.random.Generator) -> GaussianMixture:
        """EM on samples (n, d) with weights (n,), from a k-means++ start drawn with rng. An integer weight
        equals repeated samples.
        """
        samples = as_samples(samples, "samples")
        weights = as_weights(weights, len(samples))
        fitted = self._run([samples], weights, lambda blocks, mass: kmeans_start(blocks[0], mass, self.n_components, rng))
        self._set(fitted.priors, fitted.means[0], fitted.covariances[0])
        return self

    @property
    def components(self) -> list[Gaussian]:
        """The components as Gaussians, in the order of priors_."""
        self._require_fitted()
        return [Gaussian(mean, covariance) for mean, covariance in zip(self.means_, self.covariances_, strict=True)]

    def responsibilities(self, samples: ArrayLike) -> np.ndarray:
        """(n, K) posterior probability of each component for samples (n, d)."""
        return self._expectation(samples)[0]

    def log_density(self, samples: ArrayLike) -> np.ndarray:
        """(n,) log P of samples (n, d), (3.2)."""
        return self._expectation(samples)[1]

    def _expectation(self, samples: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        samples = as_samples(samples, "samples", self.n_dims)
        return expectation([samples], Parameters(self.priors_, [self.means_], [self.covariances_]))

    def sample(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, d) independent draws."""
        n = as_count(n, "n", 0)
        self._require_fitted()
        labels = rng.choice(len(self.priors_), size=n, p=self.priors_)
        noise = rng.standard_normal((n, self.n_dims))
        return self.means_[labels] + np.einsum("nij,nj->ni", cholesky(self.covariances_)[labels], noise)

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        return len(self.priors_) - 1 + n_free_parameters(len(self.priors_), self.n_dims)

    def bic(self, samples: ArrayLike, weights: ArrayLike | None = None) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as sample number."""
        log_density = self.log_density(samples)
        weights = as_weights(weights, len(log_density))
        return float(-2.0 * weights @ log_density + self.n_parameters * np.log(weights.sum()))
