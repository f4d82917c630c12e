"""Gaussian mixture over poses and numbers beside them, such as time: EM, regression, product
(Zeestraten 2017; Calinon 2020).
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    as_count,
    as_covariances,
    as_dims,
    as_finite,
    as_samples,
    as_weights,
    require_near,
)
from dart_skill.mixture import (
    EMEstimator,
    Parameters,
    checked_priors,
    cholesky,
    kmeans_start,
    n_free_parameters,
    sliced_start,
)
from dart_skill.movement.pose._em import (
    Blocks,
    expectation,
    iterate,
    maximisation,
    scales_of,
    tangents_at,
)
from dart_skill.movement.pose._frames import as_rows
from dart_skill.movement.pose._gaussians import product_at, regress_at
from dart_skill.movement.pose._manifold import as_points, exp_at, log_at, means_of

FORMAT = "dart_skill pose mixture 1"


def product_of_poses(means: ArrayLike, covariances: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Product of P Gaussians on R^n x S3: its mode (n + 4,) and its covariance (n + 3, n + 3) in
    the tangent space there.

    The mode is where the product of the densities is largest; the covariance is that of its
    quadratic approximation. With little spread and near means both are those of (3.8).

    Parameters
    ----------
    means
        (P, n + 4), the last four columns unit quaternions.
    covariances
        (P, n + 3, n + 3), positive definite, each in the tangent space at its own mean, in world
        axes.

    Raises
    ------
    ValueError
        For what is not finite, of another shape, not positive definite, or for a quaternion whose
        length is not 1.
    """
    means = as_points(means, "means", ndim=2)
    size = means.shape[1] - 1
    spreads = as_covariances(covariances, "covariances", (len(means), size, size))
    return product_at(means, spreads, np.ones(len(means), dtype=bool))


def responsibilities_by_kmeans(
    blocks: Blocks, weights: np.ndarray, n_components: int, rng: np.random.Generator
) -> np.ndarray:
    """(n, K) by k-means++ of the tangent vectors at the mean of all samples, in units of their
    spread, over all blocks.
    """
    share = weights[:, None] / weights.sum()
    flat = [
        log_at(means_of(rows, share), rows) / scale
        for rows, scale in zip(blocks.rows, blocks.scales, strict=True)
    ]
    return kmeans_start(np.hstack(flat), weights, n_components, rng)


class PoseEstimator(EMEstimator):
    """What the mixture of poses and that in task frames share: runs of EM over blocks."""

    def _best_run(
        self, blocks: Blocks, weights: np.ndarray, start: Callable[[], np.ndarray] | Parameters
    ) -> Parameters:
        """The most likely of n_starts runs, each from responsibilities (n, K) of `start`, or the
        one run from parameters.
        """
        settings = (self.covariance_floor, self.tolerance, self.max_iterations)
        if isinstance(start, Parameters):
            fits = [iterate(blocks, weights, start, *settings)]
        else:
            begins = [start() * weights[:, None] for _ in range(self.n_starts)]
            firsts = [
                maximisation(blocks, counts[:, counts.any(0)], self.covariance_floor)[0]
                for counts in begins
            ]
            fits = [iterate(blocks, weights, first, *settings) for first in firsts]
        best = max(fits, key=lambda fit: fit.log_likelihood)
        self.log_likelihood_ = best.log_likelihood * float(weights.sum())
        self.n_iterations_, self.converged_ = best.n_iterations, best.converged
        return best.parameters

    def _require_enough(self, weights: np.ndarray) -> None:
        if int((weights > 0).sum()) < self.n_components:
            raise ValueError(
                f"{self.n_components} components need at least as many samples with weight, got"
                f" {int((weights > 0).sum())}; lower n_components or give more samples"
            )


class PoseMixture(PoseEstimator):
    """Mixture of K Gaussians over rows of q numbers, a position [m] and a unit quaternion x, y, z,
    w.

    A component should turn by less than half a turn about its mean; a movement that turns farther
    needs time among the numbers, and components enough.

    After `fit`; a mixture made by `from_parameters` has the first three only:

    Parameters
    ----------
    n_components
        Int, number K of components at the start. One that loses its samples is dropped, so a fit
        may end with fewer, len(priors_).
    covariance_floor
        Float, default 1e-6. Least variance of a component in any direction, relative to the
        variance of the data: of each number, of the position and of the rotation.
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
    priors_ : (K,)
        Positive, with sum one.
    means_ : (K, q + 7)
        Numbers, position and unit quaternion.
    covariances_ : (K, q + 6, q + 6)
        In the tangent space at the mean: numbers, position [m], rotation vector [rad] in world
        axes.
    log_likelihood_
        Float, the sum over the samples times their weights.
    n_iterations_
        Int.
    converged_
        Bool.
    """

    @classmethod
    def from_parameters(
        cls, priors: ArrayLike, means: ArrayLike, covariances: ArrayLike
    ) -> PoseMixture:
        """Mixture with given priors (K,), means (K, q + 7) and positive definite covariances (K, q
        + 6, q + 6).

        Raises
        ------
        ValueError
            For other shapes or values.
        """
        priors, means = checked_priors(priors), as_rows(means, "means")
        if len(means) != len(priors):
            raise ValueError(f"one mean per prior is needed, got {len(means)} for {len(priors)}")
        size = means.shape[1] - 1
        covariances = as_covariances(covariances, "covariances", (len(means), size, size))
        cholesky(covariances, "covariance of component")
        return cls._made(priors, means, covariances)

    @classmethod
    def _made(cls, priors: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> PoseMixture:
        mixture = cls(len(priors))
        mixture.priors_, mixture.means_, mixture.covariances_ = priors, means, covariances
        return mixture

    @property
    def n_numbers(self) -> int:
        """q, the numbers before the pose."""
        self._require_fitted()
        return self.means_.shape[1] - 7

    def fit(
        self,
        samples: ArrayLike,
        weights: ArrayLike | None = None,
        *,
        rng: np.random.Generator | None = None,
        start: PoseMixture | None = None,
    ) -> PoseMixture:
        """Fit by EM to samples (n, q + 7) with weights (n,), equal by default.

        Give rng for a random start by k-means++, or start, a mixture to start from. With neither,
        the samples are cut into slices of equal weight along column 0, which is then time.

        Returns
        -------
        PoseMixture
            Self.

        Raises
        ------
        ValueError
            For what is not finite, for a quaternion whose length is not 1, or if there are fewer
            samples with weight than components.
        """
        rows = as_rows(samples, "samples")
        weights = as_weights(weights, len(rows))
        self._require_enough(weights)
        rows, weights = rows[weights > 0], weights[weights > 0]
        blocks = Blocks([rows], np.ones((1, len(rows)), dtype=bool), [scales_of(rows, weights)])
        fitted = self._best_run(blocks, weights, self._starter(blocks, weights, rng, start))
        self.priors_, self.means_, self.covariances_ = (
            fitted.priors,
            fitted.means[0],
            fitted.covariances[0],
        )
        return self

    def _starter(
        self,
        blocks: Blocks,
        weights: np.ndarray,
        rng: np.random.Generator | None,
        start: PoseMixture | None,
    ) -> Callable[[], np.ndarray] | Parameters:
        rows = blocks.rows[0]
        if rng is not None and start is not None:
            raise ValueError("fit takes rng for a random start, or start=mixture, and not both")
        if rng is not None:
            return lambda: responsibilities_by_kmeans(blocks, weights, self.n_components, rng)
        if start is not None:
            start._require_fitted()
            if start.means_.shape != (self.n_components, rows.shape[1]):
                raise ValueError(
                    f"start has means {start.means_.shape}, needed are"
                    f" {(self.n_components, rows.shape[1])}"
                )
            return Parameters(start.priors_, [start.means_], [start.covariances_])
        if rows.shape[1] == 7:
            raise ValueError(
                "samples have no number such as time before the pose; fit then needs"
                " rng=numpy.random.default_rng(seed)"
            )
        return lambda: sliced_start(rows[:, 0], weights, self.n_components)

    def responsibilities(self, samples: ArrayLike) -> np.ndarray:
        """(n, K) posterior probability of each component for samples (n, q + 7)."""
        return self._expectation(samples)[0]

    def log_density(self, samples: ArrayLike) -> np.ndarray:
        """(n,) log density of samples (n, q + 7), per unit of the numbers, per m^3 and per rad^3."""
        return self._expectation(samples)[1]

    def _expectation(self, samples: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        self._require_fitted()
        rows = as_points(samples, "samples", self.means_.shape[1], 2)
        blocks = Blocks([rows], np.ones((1, len(rows)), dtype=bool), [])
        parameters = Parameters(self.priors_, [self.means_], [self.covariances_])
        with np.errstate(over="ignore", invalid="ignore"):
            shares, log_density = expectation(
                blocks, parameters, tangents_at(blocks, parameters.means)
            )
        require_near(log_density, rows, "samples")
        return shares, log_density

    def sample(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, q + 7) independent draws."""
        n = as_count(n, "n", 0)
        self._require_fitted()
        labels = rng.choice(len(self.priors_), size=n, p=self.priors_)
        noise = rng.standard_normal((n, self.means_.shape[1] - 1))
        return exp_at(
            self.means_[labels],
            np.einsum("nij,nj->ni", np.linalg.cholesky(self.covariances_)[labels], noise),
        )

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        self._require_fitted()
        return (
            len(self.priors_) - 1 + n_free_parameters(len(self.priors_), self.means_.shape[1] - 1)
        )

    def bic(self, samples: ArrayLike, weights: ArrayLike | None = None) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as the
        number of samples.
        """
        log_density = self.log_density(samples)
        weights = as_weights(weights, len(log_density))
        return float(-2.0 * weights @ log_density + self.n_parameters * np.log(weights.sum()))

    def regress(
        self, inputs: ArrayLike, input_dims: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, o + 4) and covariance (n, o + 3, o + 3) of all other columns, given inputs (n,
        i): regression on the manifold.

        The mean is a row of the columns that are left, in order, and a unit quaternion. The
        covariance is in the tangent space there: within the components, and between them.

        Parameters
        ----------
        inputs
            (n, i), or (n,) for one input column.
        input_dims
            i columns of numbers or position, no quaternion; default: the q numbers, so that poses
            (n, 7) are returned.

        Raises
        ------
        ValueError
            For columns that there are not, or inputs that are not finite or so far away that their
            density overflows.
        """
        self._require_fitted()
        return regress_rows(
            self.priors_, self.means_[None], self.covariances_[None], inputs, input_dims
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
    def load(cls, path: str | Path) -> PoseMixture:
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
            cls.from_parameters(*parameters)
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
                f"{path} is not a mixture of poses saved by dart_skill, or damaged: {error}"
            ) from error
        return cls._made(*parameters)


def regress_rows(
    priors: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    inputs: ArrayLike,
    input_dims: ArrayLike | Sequence[int] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """`PoseMixture.regress` with checks, for one mixture or one for each query: means (m, K, w),
    covariances (m, K, d, d).
    """
    n_numbers = means.shape[-1] - 7
    if input_dims is None and n_numbers == 0:
        raise ValueError(
            "the mixture has no number such as time before the pose; give input_dims, columns of"
            " the position"
        )
    into = as_dims(
        np.arange(n_numbers) if input_dims is None else input_dims,
        means.shape[-1] - 4,
        "input_dims",
    )
    given = as_finite(inputs, "inputs")
    rows = as_samples(
        given[:, None] if given.ndim == 1 and len(into) == 1 else given, "inputs", len(into)
    )
    return regress_at(priors, means, covariances, rows, into)
