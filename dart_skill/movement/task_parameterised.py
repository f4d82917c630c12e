"""Task-parameterised Gaussian mixture: thesis 7.5.2 and (7.21).

Every demonstration is seen from P frames at once. EM shares the responsibilities between the frames (the
density of a component is the product over frames, as in the tensor mixture of Calinon), so component k means
the same part of the motion in each of them. For new frames each component is the product of its Gaussians
mapped into the world.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..mixture import GaussianMixture, product_of_gaussians
from ..mixture._checks import as_covariances, as_finite, as_samples, as_weights
from ..mixture._expectation_maximisation import (
    Parameters,
    column_scales,
    expectation,
    maximisation,
    normalise_log,
)
from ..mixture._gaussian import cholesky, symmetric
from ..mixture._mixture import EMEstimator, checked_priors, n_free_parameters
from ..mixture._start import kmeans_start, sliced_start
from .frames import TaskFrame

STARTS = ("time", "kmeans")
# A column of a frame counts as no narrower than this share of what world deviations could put there.
LEAST_SHARE = 1e-2


def as_demonstrations(samples: Sequence[ArrayLike], frames: Sequence[Sequence[TaskFrame]]) -> list[np.ndarray]:
    """Samples (n_i, m) per demonstration, checked against its frames; P and m must agree between
    demonstrations.
    """
    if len(samples) == 0 or len(samples) != len(frames):
        raise ValueError(f"one list of frames per demonstration is needed, got {len(frames)} for {len(samples)}")
    samples = [as_samples(one, f"samples of demonstration {i}") for i, one in enumerate(samples)]
    n_frames, n_dims = len(frames[0]), samples[0].shape[1]
    for i, (one, its_frames) in enumerate(zip(samples, frames, strict=True)):
        if one.shape[1] != n_dims:
            raise ValueError(f"demonstration {i} has {one.shape[1]} columns, the first has {n_dims}")
        check_frames(its_frames, n_frames, n_dims, f"demonstration {i}")
    return samples


def check_frames(frames: Sequence[TaskFrame], n_frames: int, n_dims: int, what: str) -> None:
    if len(frames) != n_frames or n_frames == 0:
        raise ValueError(f"{what} has {len(frames)} task frames, expected {n_frames or 'at least 1'}")
    for j, frame in enumerate(frames):
        if frame.n_dims != n_dims:
            raise ValueError(f"task frame {j} of {what} has {frame.n_dims} dimensions, the samples have {n_dims}")


def as_sample_weights(weights: Sequence | None, samples: list[np.ndarray]) -> np.ndarray:
    """Weights of all samples in a row, from None, one number per demonstration, or one array (n_i,) per
    demonstration.
    """
    lengths = [len(one) for one in samples]
    if weights is None:
        return np.ones(sum(lengths))
    if len(weights) != len(samples):
        raise ValueError(f"weights has {len(weights)} entries for {len(samples)} demonstrations")
    full = [
        np.full(n, w) if np.ndim(w) == 0 else as_finite(w, f"weights of demonstration {i}", 1)
        for i, (w, n) in enumerate(zip(weights, lengths, strict=True))
    ]
    for i, (one, n) in enumerate(zip(full, lengths, strict=True)):
        if len(one) != n:
            raise ValueError(f"weights of demonstration {i} has length {len(one)}, its samples {n}")
    return as_weights(np.concatenate(full), sum(lengths))


def world_scales(samples: list[np.ndarray], frames: Sequence[Sequence[TaskFrame]], weights: np.ndarray) -> np.ndarray:
    """(P, m) deviations of the samples in the world, carried into each frame without regard to their
    direction.

    A floor that comes from these keeps a component usable that is flat in one frame (static attractors at the
    target): turned into the world, the floor must stand out from the rounding errors of the other columns.
    """
    world = np.concatenate(samples)
    share = weights / weights.sum()
    variance = share @ np.square(world - share @ world)
    per_demonstration = [part.sum() for part in np.split(share, np.cumsum([len(one) for one in samples])[:-1])]
    return np.sqrt(
        [
            np.average([np.square(np.linalg.inv(frame.A)) @ variance for frame in column], 0, per_demonstration)
            for column in zip(*frames, strict=True)
        ]
    )


class TaskParameterisedMixture(EMEstimator):
    """Mixture of K components in P task frames over m features, of which column 0 is time.

    start: "time" cuts the samples into K slices of equal weight along column 0 of the first frame, and needs
    no generator; "kmeans" clusters the samples as seen from all frames. Other hyper-parameters as in
    `EMEstimator`. Fitted: priors_ (K,), means_ (P, K, m), covariances_ (P, K, m, m), log_likelihood_ (summed
    over samples and frames), n_iterations_, converged_.
    """

    def __init__(
        self,
        n_components: int,
        *,
        start: str = "time",
        covariance_floor: float = 1e-6,
        tolerance: float = 1e-6,
        max_iterations: int = 300,
        n_starts: int = 1,
    ):
        if start not in STARTS:
            raise ValueError(f"start must be one of {STARTS}, got {start!r}")
        if start == "time" and n_starts != 1:
            raise ValueError(f"start 'time' is always the same; n_starts {n_starts} needs start='kmeans'")
        super().__init__(
            n_components,
            covariance_floor=covariance_floor,
            tolerance=tolerance,
            max_iterations=max_iterations,
            n_starts=n_starts,
        )
        self.start = start

    @classmethod
    def from_parameters(cls, priors: ArrayLike, means: ArrayLike, covariances: ArrayLike) -> TaskParameterisedMixture:
        """Mixture with priors (K,), means (P, K, m), positive definite covariances (P, K, m, m)."""
        priors, means = checked_priors(priors), as_finite(means, "means", 3)
        if means.size == 0 or means.shape[1] != len(priors):
            raise ValueError(f"means must have shape (P, {len(priors)}, m), got {means.shape}")
        covariances = as_covariances(covariances, "covariances", (*means.shape, means.shape[2]))
        cholesky(covariances, "covariance (frame-major)")
        mixture = cls(len(priors))
        mixture.priors_, mixture.means_, mixture.covariances_ = priors, means, covariances
        return mixture

    @property
    def n_frames(self) -> int:
        self._require_fitted()
        return self.means_.shape[0]

    @property
    def n_dims(self) -> int:
        self._require_fitted()
        return self.means_.shape[2]

    def fit(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[TaskFrame]],
        weights: Sequence | None = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> TaskParameterisedMixture:
        """EM on demonstrations (n_i, m) in the world with P frames each; weights per demonstration, per
        sample (a list of arrays), or None.
        """
        if self.start == "kmeans" and rng is None:
            raise ValueError("start='kmeans' draws random centres: pass rng=numpy.random.default_rng(seed)")
        samples = as_demonstrations(samples, frames)
        weights = as_sample_weights(weights, samples)
        least_scales = LEAST_SHARE * world_scales(samples, frames, weights)
        fitted = self._run(self._blocks(samples, frames), weights, self._starter(rng), least_scales)
        self.priors_, self.means_, self.covariances_ = (
            fitted.priors,
            np.stack(fitted.means),
            np.stack(fitted.covariances),
        )
        return self

    def fit_in_time(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[TaskFrame]],
        weights: Sequence | None = None,
        overlap: float = 0.7,
    ) -> TaskParameterisedMixture:
        """Components at equal intervals of time whose responsibilities depend on time alone: one weighted M step.

        No component can settle on a few demonstrations, as EM lets it when other inputs than time vary from one to
        the next, and there is no local optimum. overlap: standard deviation of a component in units of the interval.
        """
        samples = as_demonstrations(samples, frames)
        blocks, weights = self._blocks(samples, frames), as_sample_weights(weights, samples)
        time = blocks[0][:, 0]
        interval = (time.max() - time.min()) / self.n_components
        centres = time.min() + interval * (0.5 + np.arange(self.n_components))
        shares, _ = normalise_log(-0.5 * np.square((time[:, None] - centres) / (overlap * interval)))
        scales = [column_scales(block, weights, np.zeros(block.shape[1])) for block in blocks]
        scaled = [(block - centre) / scale for block, (centre, scale) in zip(blocks, scales, strict=True)]
        fitted = maximisation(scaled, shares * weights[:, None], self.covariance_floor)
        self.priors_ = fitted.priors
        self.means_ = np.stack([m * s + c for m, (c, s) in zip(fitted.means, scales, strict=True)])
        self.covariances_ = np.stack([v * np.outer(s, s) for v, (_, s) in zip(fitted.covariances, scales, strict=True)])
        return self

    @staticmethod
    def _blocks(samples: list[np.ndarray], frames: Sequence[Sequence[TaskFrame]]) -> list[np.ndarray]:
        """Per frame, all samples as it sees them (n, m)."""
        return [
            np.concatenate([its_frames[j].to_frame(one) for one, its_frames in zip(samples, frames, strict=True)])
            for j in range(len(frames[0]))
        ]

    def _starter(self, rng: np.random.Generator | None):
        if self.start == "kmeans":
            return lambda blocks, weights: kmeans_start(np.hstack(blocks), weights, self.n_components, rng)
        return lambda blocks, weights: sliced_start(blocks[0][:, 0], weights, self.n_components)

    def responsibilities(self, samples: Sequence[ArrayLike], frames: Sequence[Sequence[TaskFrame]]) -> list[np.ndarray]:
        """Per demonstration, (n_i, K) posterior probability of each component."""
        return self._per_demonstration(samples, frames, 0)

    def log_density(self, samples: Sequence[ArrayLike], frames: Sequence[Sequence[TaskFrame]]) -> list[np.ndarray]:
        """Per demonstration, (n_i,) log of the mixture density, a product over frames."""
        return self._per_demonstration(samples, frames, 1)

    def _per_demonstration(self, samples, frames, which: int) -> list[np.ndarray]:
        samples = as_demonstrations(samples, frames)
        check_frames(frames[0], self.n_frames, self.n_dims, "demonstration 0")
        parameters = Parameters(self.priors_, list(self.means_), list(self.covariances_))
        values = expectation(self._blocks(samples, frames), parameters)[which]
        return np.split(values, np.cumsum([len(one) for one in samples])[:-1])

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        return len(self.priors_) - 1 + self.n_frames * n_free_parameters(len(self.priors_), self.n_dims)

    def bic(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[TaskFrame]],
        weights: Sequence | None = None,
    ) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as sample number."""
        log_density = np.concatenate(self.log_density(samples, frames))
        weights = as_sample_weights(weights, [np.asarray(one) for one in samples])
        return float(-2.0 * weights @ log_density + self.n_parameters * np.log(weights.sum()))

    def product(self, frames: Sequence[TaskFrame]) -> GaussianMixture:
        """(7.21): the mixture in the world for new frames, P of them."""
        check_frames(frames, self.n_frames, self.n_dims, "the new situation")
        matrices = np.stack([frame.A for frame in frames])[:, None]
        offsets = np.stack([frame.b for frame in frames])[:, None]
        means = (matrices @ self.means_[..., None])[..., 0] + offsets
        covariances = symmetric(matrices @ self.covariances_ @ np.swapaxes(matrices, -1, -2))
        mean, covariance, _ = product_of_gaussians(means, covariances)
        return GaussianMixture.from_parameters(self.priors_, mean, covariance)
