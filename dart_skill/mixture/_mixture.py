"""Gaussian mixture with weighted samples (thesis 3.2, 3.2.1).

EM stops when the mean log-likelihood per sample stops changing. The thesis stops on the ratio of
successive values of the log-likelihood (3.1), which fails when that is near zero or changes its
sign.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    as_count,
    as_covariances,
    as_dims,
    as_finite,
    as_learnable,
    as_number,
    as_samples,
    as_vector,
    as_weights,
)
from dart_skill.common.hyper_parameters import HyperParameters
from dart_skill.mixture._expectation_maximisation import (
    EmSettings,
    Parameters,
    Start,
    best_fit,
    expectation_at,
    normalise_log,
)
from dart_skill.mixture._gaussian import (
    Gaussian,
    cholesky,
    log_determinants,
    moments,
    product_of_two,
    split_dims,
    square_root,
)
from dart_skill.mixture._start import kmeans_start

FORMAT = "dart_skill mixture 1"


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


def _require_parameters(priors: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> None:
    """ValueError unless these are the parameters of a mixture; covariances may be singular."""
    checked_priors(priors)
    for mean, covariance, _ in zip(as_samples(means, "means"), covariances, priors, strict=True):
        Gaussian(mean, covariance)


def n_free_parameters(n_components: int, n_dims: int) -> int:
    """Free parameters of one block: means and symmetric covariances.

    Parameters
    ----------
    n_components, n_dims
        K and d.
    """
    return n_components * (n_dims + n_dims * (n_dims + 1) // 2)


def require_enough(n_samples: int, n_components: int) -> None:
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


class GaussianMixture(EMEstimator):
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

    def collapse(self) -> Gaussian:
        """The Gaussian with the mean and covariance of the whole mixture."""
        self._require_fitted()
        return Gaussian(*moments(self.priors_, self.means_, self.covariances_))

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

    def condition(self, dims: ArrayLike, values: ArrayLike) -> GaussianMixture:
        """(3.5): mixture of the other dimensions, in ascending order, given x[dims] = values.

        A component is left out if it is so far from the values that its prior is zero.
        """
        dims, rest = split_dims(dims, self.n_dims)
        values = as_vector(np.atleast_1d(values), "values", len(dims))
        shares = self.marginal(dims).responsibilities(values[None])[0]
        kept = [
            Gaussian(self.means_[k], self.covariances_[k]).condition(dims, values)
            for k in np.flatnonzero(shares)
        ]
        return self._of(shares[shares > 0], kept)

    def linear_map(self, matrix: ArrayLike, offset: ArrayLike | None = None) -> GaussianMixture:
        """Mixture of A x + b for any A (e, d) and b (e,), zero by default. More rows than columns
        make the covariances singular: such a mixture has moments, marginals and samples, but no
        density.

        Parameters
        ----------
        matrix, offset
            A and b.
        """
        return self._of(
            self.priors_, [component.linear_map(matrix, offset) for component in self.components]
        )

    def product(self, other: GaussianMixture | Gaussian) -> tuple[GaussianMixture, float]:
        """Mixture M and log C with C M(x) = this(x) other(x) for every x.

        M has a component for each pair of components, those of `other` in the inner loop. A pair
        is left out if its components are so far apart that its prior is zero.

        Raises
        ------
        ValueError
            For another dimension, or factors so far apart that C overflows.
        """
        other = GaussianMixture._of(np.ones(1), [other]) if isinstance(other, Gaussian) else other
        if other.n_dims != self.n_dims:
            raise ValueError(
                f"factors must agree in dimension, got {self.n_dims} and {other.n_dims}"
            )
        mine, yours = np.divmod(
            np.arange(len(self.priors_) * len(other.priors_)), len(other.priors_)
        )
        mean, covariance, log_constants = product_of_two(
            self.means_[mine],
            self.covariances_[mine],
            other.means_[yours],
            other.covariances_[yours],
        )
        log_constants = log_constants + np.log(self.priors_[mine]) + np.log(other.priors_[yours])
        if not np.isfinite(log_constants).any():
            raise ValueError(
                "the factors of the product are so far apart that its constant overflows"
            )
        shares, log_total = normalise_log(log_constants[None])
        kept = shares[0] > 0
        return self._made(shares[0, kept], mean[kept], covariance[kept]), float(log_total[0])

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

    def reduce(self, n_components: int) -> GaussianMixture:
        """Mixture of n_components, by merging the pair whose merger costs least until so many are
        left (Runnalls 2007: an upper bound of the divergence from the mixture before).

        Raises
        ------
        ValueError
            If that is more than there are.
        """
        mixture, n_components = self, as_count(n_components, "n_components")
        self._require_fitted()
        if n_components > len(self.priors_):
            raise ValueError(
                f"n_components must be at most the {len(self.priors_)} that there are, got"
                f" {n_components}"
            )
        while len(mixture.priors_) > n_components:
            mixture = mixture.merge(mixture._cheapest_pair())
        return mixture

    def _cheapest_pair(self) -> tuple[int, int]:
        pairs = np.stack(np.triu_indices(len(self.priors_), 1), axis=1)
        priors = self.priors_[pairs]
        total = priors.sum(1)
        shares = priors / total[:, None]
        step = self.means_[pairs[:, 0]] - self.means_[pairs[:, 1]]
        covariances = np.einsum("pi,pijk->pjk", shares, self.covariances_[pairs])
        covariances += shares.prod(1)[:, None, None] * step[:, :, None] * step[:, None, :]
        volumes = log_determinants(self.covariances_)
        cost = total * log_determinants(covariances) - (priors * volumes[pairs]).sum(1)
        return tuple(pairs[cost.argmin()].tolist())

    @staticmethod
    def together(
        mixtures: Sequence[GaussianMixture], weights: ArrayLike | None = None
    ) -> GaussianMixture:
        """All components of several mixtures, each mixture with its weight (positive, any sum;
        equal by default).

        Raises
        ------
        ValueError
            For none, or for different dimensions.
        """
        if len(mixtures) == 0 or len({mixture.n_dims for mixture in mixtures}) > 1:
            raise ValueError(
                "mixtures must be one or more of one dimension, got"
                f" {[mixture.n_dims for mixture in mixtures]}"
            )
        weights = as_weights(weights, len(mixtures))
        parts = [
            (weight / weights.sum(), mixture)
            for weight, mixture in zip(weights, mixtures, strict=True)
            if weight > 0
        ]
        return GaussianMixture._made(
            np.concatenate([share * mixture.priors_ for share, mixture in parts]),
            np.concatenate([mixture.means_ for _, mixture in parts]),
            np.concatenate([mixture.covariances_ for _, mixture in parts]),
        )

    def save(self, path: str | Path) -> None:
        """Write priors, means and covariances to a NumPy archive at `path`, which must not exist."""
        self._require_fitted()
        with open(path, "xb") as file:
            np.savez(
                file,
                format=np.array(FORMAT),
                priors=self.priors_,
                means=self.means_,
                covariances=self.covariances_,
            )

    @classmethod
    def load(cls, path: str | Path) -> GaussianMixture:
        """The mixture that `save` wrote, to the last bit.

        Raises
        ------
        ValueError
            If the file has another format or is damaged.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                content = {
                    name: archive[name] for name in ("format", "priors", "means", "covariances")
                }
            if str(content.pop("format")) != FORMAT:
                raise ValueError(f"its format is not '{FORMAT}'")
            parameters = [as_finite(value, name) for name, value in content.items()]
            _require_parameters(*parameters)
        except FileNotFoundError:
            raise
        except (
            KeyError,
            ValueError,
            EOFError,
            TypeError,
            AttributeError,
            OSError,
            zipfile.BadZipFile,
            zlib.error,
        ) as error:
            raise ValueError(
                f"{path} is not a mixture saved by dart_skill, or damaged: {error}"
            ) from error
        return cls._made(*parameters)

    @classmethod
    def _made(
        cls, priors: np.ndarray, means: np.ndarray, covariances: np.ndarray
    ) -> GaussianMixture:
        """Mixture with parameters that have been checked."""
        mixture = cls(len(priors))
        mixture._set(priors, means, covariances)
        return mixture

    @classmethod
    def _of(cls, priors: np.ndarray, components: Sequence[Gaussian]) -> GaussianMixture:
        means, covariances = (
            [one.mean for one in components],
            [one.covariance for one in components],
        )
        return cls._made(priors, np.stack(means), np.stack(covariances))
