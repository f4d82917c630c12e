"""Gaussian mixture with weighted samples (thesis 3.2, 3.2.1).

EM stops when the mean log-likelihood per sample stops changing. The thesis stops on the ratio of
successive values of the log-likelihood (3.1), which fails when that is near zero or changes its
sign.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    as_count,
    as_covariances,
    as_dims,
    as_learnable,
    as_number,
    as_samples,
    as_vector,
    as_weights,
)
from dart_skill.common.hyper_parameters import Arrays, HyperParameters, SavableModel
from dart_skill.mixture._expectation_maximisation import (
    EmSettings,
    Parameters,
    Start,
    best_fit,
    expectation_at,
)
from dart_skill.mixture._gaussian import (
    Gaussian,
    cholesky,
    moments,
    square_root,
)
from dart_skill.mixture._start import kmeans_start


def checked_priors(priors: ArrayLike) -> np.ndarray:
    """Priors (K,), positive and with sum one; a rounding error of the sum is removed.

    Raises
    ------
    ValueError
        For what is none.
    """
    priors = as_vector(priors, "priors")
    if priors.size == 0 or priors.min() <= 0 or abs(priors.sum() - 1.0) > 1e-6:
        raise ValueError(f"priors must be positive and sum to one, got {priors.tolist()}")
    return priors / priors.sum()


def n_free_parameters(n_components: int, n_dims: int) -> int:
    """Free parameters of one block: means and symmetric covariances.

    Parameters
    ----------
    n_components, n_dims
        K and d.
    """
    return n_components * (n_dims + n_dims * (n_dims + 1) // 2)


def require_enough(n_samples: int, n_components: int) -> None:
    """ValueError unless there are as many samples with weight as components."""
    if n_samples < n_components:
        raise ValueError(
            f"{n_components} components need at least as many samples with weight, got"
            f" {n_samples}; lower n_components or give more samples"
        )


class EMEstimator(HyperParameters):
    """Hyper-parameters of EM and results of a fit; the base class of every mixture that EM fits.

    After a fit:

    Parameters
    ----------
    n_components
        Int, number K of components at the start. A component that loses all its samples is moved
        to badly explained ones, at most n_components times in a run. After that it is dropped, so
        a fit may end with fewer.
    covariance_floor
        Float, default 1e-6. Least variance of a component in any direction, relative to the
        variance of the data in each column.
    tolerance
        Float, default 1e-6. EM stops when the mean log-likelihood per sample changes by no more
        than this.
    max_iterations
        Int, default 300. EM stops after so many iterations in any case.
    n_starts
        Int, default 1. Number of runs with different random starts; the most likely result is
        kept.

    Attributes
    ----------
    log_likelihood_
        Float, (3.1), the sum over the samples times their weights.
    n_iterations_
        Int.
    converged_
        Bool, False if max_iterations was reached first.
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

    covariance_prior = 0.0

    def _run(
        self,
        blocks: list[np.ndarray],
        weights: np.ndarray,
        start: Start,
        least_scales: Sequence[ArrayLike] | None = None,
    ) -> Parameters:
        require_enough(int((weights > 0).sum()), self.n_components)
        settings = EmSettings(
            self.covariance_floor, self.tolerance, self.max_iterations, self.covariance_prior
        )
        fit = best_fit(blocks, weights, start, settings, self.n_starts, least_scales)
        self.log_likelihood_ = fit.log_likelihood * float(weights.sum())
        self.n_iterations_, self.converged_ = fit.n_iterations, fit.converged
        return fit.parameters

    def _require_fitted(self) -> None:
        if not hasattr(self, "priors_"):
            raise ValueError(
                f"this {type(self).__name__} holds no parameters yet; call fit or from_parameters"
                " first"
            )


class GaussianMixture(EMEstimator, SavableModel):
    """Mixture of K Gaussians with full covariances (thesis 3.2), fitted by EM to weighted samples.

    After `fit`; a mixture made by `from_parameters` has the first three only:

    Parameters
    ----------
    n_components
        Int, number K of components at the start; a fit may end with fewer, len(priors_).
    covariance_floor
        Float, default 1e-6. Least variance of a component in any direction, relative to the
        variance of the data in each column.
    tolerance
        Float, default 1e-6. EM stops when the mean log-likelihood per sample changes by no more
        than this.
    max_iterations
        Int, default 300. EM stops after so many iterations in any case.
    n_starts
        Int, default 1. Number of runs with different random starts; the most likely result is
        kept.
    covariance_prior
        Float, default 0, no prior. For few samples: each covariance is averaged with one that says
        that all columns vary alike and by chance only together, and this one counts as so many
        samples (inverse Wishart, Fraley and Raftery 2007). The number of columns is a good weight
        for up to three samples per component and column, less for more.

    Attributes
    ----------
    priors_ : (K,)
        Positive, with sum one.
    means_ : (K, d)
        In the units of the samples.
    covariances_ : (K, d, d)
    log_likelihood_
        Float, (3.1), the sum over the samples times their weights.
    n_iterations_
        Int.
    converged_
        Bool, False if max_iterations was reached first.
    """

    def __init__(
        self,
        n_components: int,
        *,
        covariance_floor: float = 1e-6,
        tolerance: float = 1e-6,
        max_iterations: int = 300,
        n_starts: int = 1,
        covariance_prior: float = 0.0,
    ):
        super().__init__(
            n_components,
            covariance_floor=covariance_floor,
            tolerance=tolerance,
            max_iterations=max_iterations,
            n_starts=n_starts,
        )
        self.covariance_prior = as_number(covariance_prior, "covariance_prior", strict=False)

    def _fitted_to(self) -> str:
        return (
            f"{len(self.priors_)} components in {self.n_dims} dimensions"
            if hasattr(self, "priors_")
            else ""
        )

    @classmethod
    def from_parameters(
        cls, priors: ArrayLike, means: ArrayLike, covariances: ArrayLike
    ) -> GaussianMixture:
        """Mixture with given priors (K,), means (K, d) and positive definite covariances (K, d,
        d).

        Raises
        ------
        ValueError
            For other shapes or values.
        """
        priors, means = checked_priors(priors), as_samples(means, "means")
        if len(means) != len(priors):
            raise ValueError(f"one mean per prior is needed, got {len(means)} for {len(priors)}")
        covariances = as_covariances(covariances, "covariances", (*means.shape, means.shape[1]))
        cholesky(covariances, "covariance of component")
        return cls._made(priors, means, covariances)

    def _set(self, priors: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> None:
        self.priors_, self.means_, self.covariances_ = priors, means, covariances

    @property
    def n_dims(self) -> int:
        self._require_fitted()
        return self.means_.shape[1]

    def fit(
        self,
        samples: ArrayLike,
        weights: ArrayLike | None = None,
        *,
        rng: np.random.Generator | None = None,
        start: GaussianMixture | None = None,
    ) -> GaussianMixture:
        """Fit the mixture by EM to samples (n, d) with weights (n,), equal by default.

        Give either rng, for a random start by k-means++, or start, a mixture with as many
        components to start from. A sample with an integer weight counts as so many equal samples.

        Returns
        -------
        GaussianMixture
            Self.

        Raises
        ------
        ValueError
            If there are fewer samples with weight than components.
        """
        samples = as_learnable(samples, "samples")
        weights = as_weights(weights, len(samples))
        fitted = self._run([samples], weights, self._starter(samples.shape[1], rng, start))
        self._set(fitted.priors, fitted.means[0], fitted.covariances[0])
        return self

    def _starter(
        self, n_dims: int, rng: np.random.Generator | None, start: GaussianMixture | None
    ) -> Start:
        if (rng is None) == (start is None):
            raise ValueError(
                "fit needs rng=numpy.random.default_rng(seed) for a random start, or"
                " start=mixture, and not both"
            )
        if rng is not None:
            return lambda blocks, mass: kmeans_start(blocks[0], mass, self.n_components, rng)
        assert start is not None
        if (start.n_dims, len(start.priors_)) != (n_dims, self.n_components):
            raise ValueError(
                f"start has {len(start.priors_)} components in {start.n_dims} dimensions, needed"
                f" are {self.n_components} in {n_dims}"
            )
        cholesky(start.covariances_, "start: covariance of component")
        return Parameters(start.priors_, [start.means_], [start.covariances_])

    @property
    def components(self) -> list[Gaussian]:
        """The components as Gaussians, in the order of priors_."""
        self._require_fitted()
        return [
            Gaussian(mean, covariance)
            for mean, covariance in zip(self.means_, self.covariances_, strict=True)
        ]

    def responsibilities(self, samples: ArrayLike) -> np.ndarray:
        """(n, K) posterior probability of each component for samples (n, d)."""
        return self._expectation(samples)[0]

    def log_density(self, samples: ArrayLike) -> np.ndarray:
        """(n,) log P of samples (n, d), (3.2)."""
        return self._expectation(samples)[1]

    def _expectation(self, samples: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        samples = as_samples(samples, "samples", self.n_dims)
        return expectation_at(
            samples, [samples], Parameters(self.priors_, [self.means_], [self.covariances_])
        )

    def sample(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, d) independent draws."""
        n = as_count(n, "n", 0)
        self._require_fitted()
        labels = rng.choice(len(self.priors_), size=n, p=self.priors_)
        noise = rng.standard_normal((n, self.n_dims))
        return self.means_[labels] + np.einsum(
            "nij,nj->ni", square_root(self.covariances_)[labels], noise
        )

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        return len(self.priors_) - 1 + n_free_parameters(len(self.priors_), self.n_dims)

    def bic(self, samples: ArrayLike, weights: ArrayLike | None = None) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as the
        number of samples.
        """
        log_density = self.log_density(samples)
        weights = as_weights(weights, len(log_density))
        return float(-2.0 * weights @ log_density + self.n_parameters * np.log(weights.sum()))

    def aic(self, samples: ArrayLike, weights: ArrayLike | None = None) -> float:
        """Akaike's information criterion for samples (n, d) with weights (n,), lower is better."""
        log_density = self.log_density(samples)
        return float(
            -2.0 * as_weights(weights, len(log_density)) @ log_density + 2.0 * self.n_parameters
        )

    def marginal(self, dims: ArrayLike) -> GaussianMixture:
        """Mixture over some dimensions, in the order in which they are named.

        Parameters
        ----------
        dims
            Their indices (k,), from 0.
        """
        dims = as_dims(dims, self.n_dims, "dims")
        return self._made(
            self.priors_, self.means_[:, dims], self.covariances_[:, dims[:, None], dims]
        )

    def merge(self, indices: ArrayLike) -> GaussianMixture:
        """Mixture in which the components with these indices are merged into one; it is the last
        component.

        The merged component has their total prior, and the mean and covariance of all of them
        together.
        """
        self._require_fitted()
        indices = as_dims(indices, len(self.priors_), "indices")
        prior = self.priors_[indices].sum()
        mean, covariance = moments(
            self.priors_[indices] / prior, self.means_[indices], self.covariances_[indices]
        )
        rest = np.setdiff1d(np.arange(len(self.priors_)), indices)
        return self._made(
            np.append(self.priors_[rest], prior),
            np.concatenate([self.means_[rest], mean[None]]),
            np.concatenate([self.covariances_[rest], covariance[None]]),
        )

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        return {"priors": self.priors_, "means": self.means_, "covariances": self.covariances_}

    def _from_arrays(self, arrays: Arrays) -> None:
        checked_priors(arrays["priors"])
        for mean, covariance, _ in zip(
            as_samples(arrays["means"], "means"),
            arrays["covariances"],
            arrays["priors"],
            strict=True,
        ):
            Gaussian(mean, covariance)  # which may be singular
        self._set(arrays["priors"], arrays["means"], arrays["covariances"])

    @classmethod
    def _made(
        cls, priors: np.ndarray, means: np.ndarray, covariances: np.ndarray
    ) -> GaussianMixture:
        """Mixture with parameters that have been checked."""
        mixture = cls(len(priors))
        mixture._set(priors, means, covariances)
        return mixture
