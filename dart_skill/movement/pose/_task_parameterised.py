"""Task-parameterised mixture of poses: thesis 7.5.2 and (7.21) on R^n x S3.

Each demonstration is seen from P frames at once, and EM shares the responsibilities between them.
For new frames each component is carried into the world by every frame, and the product of these
Gaussians is taken on the manifold (Zeestraten 2017). Since frames carry means and covariances
exactly, turning all frames of the new situation by any rotation turns the result by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.mixture import (
    DEAD_SHARE,
    EMEstimator,
    Parameters,
    checked_priors,
    cholesky,
    n_free_parameters,
    require_enough,
    sliced_start,
)
from dart_skill.movement._placement import Weights
from dart_skill.movement._task_parameterised import (
    LEAST_SHARE,
    STARTS,
    as_sample_weights,
    windows_in_time,
)
from dart_skill.movement.pose._em import (
    Blocks,
    PoseCourse,
    Stage,
    expectation,
    iterate,
    maximisation,
    responsibilities_by_kmeans,
    scales_of,
    see,
    tangents_at,
)
from dart_skill.movement.pose._gaussians import PoseMixture, as_rows, product_at, regress_rows

PoseFrames = Sequence[Sequence[PoseCourse]]
"""P frames for each demonstration."""


class TaskParameterisedPoseMixture(EMEstimator, SavableModel):
    """Mixture of K components in P task frames over rows of q numbers, of which column 0 is time,
    and a pose.

    Frames are given as P entries per demonstration: a PoseFrame, a list of them with one for each
    sample, or None, in the list too, where the frame is missing.

    A component should turn by less than half a turn about its mean; a movement that turns farther
    needs time among the numbers, and components enough.

    Parameters
    ----------
    n_components, tolerance, max_iterations, n_starts
        As of `EMEstimator`.
    covariance_floor
        Float, default 1e-6. Least variance of a component in any direction, relative to the
        variance of the data: of each number, of the position and of the rotation.
    start
        "time" (default) cuts the samples into K slices of equal weight along column 0, and needs
        no generator; "kmeans" clusters them as seen from all frames.
    correlated
        Bool, default False. Position and rotation of a component are independent, given time and
        the other numbers. True: they may be correlated. Seven or more directions in each frame
        then need far more than seven demonstrations, or the frames contradict each other with
        false certainty.

    Attributes
    ----------
    priors_ : (K,)
    means_ : (P, K, q + 7)
    covariances_ : (P, K, q + 6, q + 6)
        As each frame sees them.
    log_likelihood_
        Float, summed over samples and frames.
    n_iterations_
        Int.
    converged_
        Bool.
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
        correlated: bool = False,
    ):
        if start not in STARTS:
            raise ValueError(f"start must be one of {STARTS}, got {start!r}")
        if start == "time" and n_starts != 1:
            raise ValueError(
                f"start 'time' is always the same; n_starts {n_starts} needs start='kmeans'"
            )
        super().__init__(
            n_components,
            covariance_floor=covariance_floor,
            tolerance=tolerance,
            max_iterations=max_iterations,
            n_starts=n_starts,
        )
        self.start, self.correlated = start, bool(correlated)

    def fit(
        self,
        samples: Sequence[ArrayLike],
        frames: PoseFrames,
        weights: Weights = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> TaskParameterisedPoseMixture:
        """Fit by EM to the samples (n_i, q + 7) of each demonstration and its P frames.

        Parameters
        ----------
        weights
            For each demonstration one number or one per sample (n_i,); default: all count alike.
        rng
            Random generator, only for start="kmeans".

        Returns
        -------
        TaskParameterisedPoseMixture
            Self.

        Raises
        ------
        ValueError
            For a start that these demonstrations do not allow, or if rng is missing.
        """
        blocks, mass = self._seen(samples, frames, weights)
        require_enough(int((mass > 0).sum()), self.n_components)
        if self.start == "kmeans":
            if rng is None:
                raise ValueError("start='kmeans' needs rng=numpy.random.default_rng(seed)")
            if not blocks.seen.all():
                raise ValueError(
                    "start='kmeans' needs every frame in every sample; use start='time'"
                )
            starts = [
                responsibilities_by_kmeans(blocks, mass, self.n_components, rng)
                for _ in range(self.n_starts)
            ]
        else:
            starts = [sliced_start(self._time(blocks), mass, self.n_components)]
        fits = []
        for start in starts:
            counts = start[:, start.any(0)] * mass[:, None]
            first = maximisation(blocks, counts, self.covariance_floor)[0]
            fits.append(
                iterate(
                    blocks,
                    mass,
                    first,
                    self.covariance_floor,
                    self.tolerance,
                    self.max_iterations,
                )
            )
        best, likelihood, self.n_iterations_, self.converged_ = max(fits, key=lambda fit: fit[1])
        self.log_likelihood_ = likelihood * float(mass.sum())
        self._set(best)
        return self

    def fit_in_time(
        self,
        samples: Sequence[ArrayLike],
        frames: PoseFrames,
        weights: Weights = None,
        overlap: float = 0.7,
    ) -> TaskParameterisedPoseMixture:
        """One component in each of K equal intervals of time, by a single M step.

        Parameters
        ----------
        overlap
            Float, default 0.7. Standard deviation of the window of a component in intervals.
        samples, frames, weights
            As of `fit`.

        Returns
        -------
        TaskParameterisedPoseMixture
            Self.
        """
        blocks, mass = self._seen(samples, frames, weights)
        counts = windows_in_time(self._time(blocks), self.n_components, overlap) * mass[:, None]
        kept = counts.sum(0) > DEAD_SHARE * mass.mean()
        self._set(maximisation(blocks, counts[:, kept], self.covariance_floor)[0])
        return self

    def _seen(
        self, samples: Sequence[ArrayLike], frames: PoseFrames, weights: Weights
    ) -> tuple[Blocks, np.ndarray]:
        blocks, mass, _ = _taught(samples, frames, weights)
        return replace(blocks, correlated=self.correlated), mass

    @staticmethod
    def _time(blocks: Blocks) -> np.ndarray:
        if blocks.rows[0].shape[1] < 8:
            raise ValueError(
                "samples have no number before the pose; give time in column 0, or use"
                " start='kmeans'"
            )
        return blocks.rows[0][:, 0]

    def _set(self, parameters: Parameters) -> None:
        self.priors_ = parameters.priors
        self.means_, self.covariances_ = (
            np.stack(parameters.means),
            np.stack(parameters.covariances),
        )

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        return {"priors": self.priors_, "means": self.means_, "covariances": self.covariances_}

    def _from_arrays(self, arrays: Arrays) -> None:
        priors = array_of(arrays, "priors", (None,))
        means = array_of(arrays, "means", (None, len(priors), None))
        width = means.shape[2] - 1
        covariances = array_of(arrays, "covariances", (*means.shape[:2], width, width))
        checked_priors(priors)
        cholesky(covariances, "covariance")
        self._set(Parameters(priors, list(means), list(covariances)))

    def _fitted_to(self) -> str:
        return (
            f"{len(self.priors_)} components in {len(self.means_)} task frames"
            if hasattr(self, "priors_")
            else ""
        )

    @property
    def n_numbers(self) -> int:
        """q, the numbers before the pose."""
        self._require_fitted()
        return self.means_.shape[-1] - 7

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        self._require_fitted()
        p, k, w = self.means_.shape
        return k - 1 + p * (n_free_parameters(k, w - 1) - (0 if self.correlated else 9 * k))

    def log_density(self, samples: Sequence[ArrayLike], frames: PoseFrames) -> list[np.ndarray]:
        """Per demonstration, (n_i,) log of the mixture density, a product over the frames that see
        the sample.
        """
        return self._per_demonstration(samples, frames, 1)

    def responsibilities(
        self, samples: Sequence[ArrayLike], frames: PoseFrames
    ) -> list[np.ndarray]:
        """Per demonstration, (n_i, K) posterior probability of each component.

        Parameters
        ----------
        samples
            (n_i, q + 7) of each demonstration.
        """
        return self._per_demonstration(samples, frames, 0)

    def bic(
        self, samples: Sequence[ArrayLike], frames: PoseFrames, weights: Weights = None
    ) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as sample
        number.
        """
        log_density = self.log_density(samples, frames)
        mass = as_sample_weights(weights, [len(one) for one in log_density])
        return float(
            -2.0 * mass @ np.concatenate(log_density) + self.n_parameters * np.log(mass.sum())
        )

    def _per_demonstration(
        self, samples: Sequence[ArrayLike], frames: PoseFrames, which: int
    ) -> list[np.ndarray]:
        self._require_fitted()
        blocks, _, lengths = _taught(
            samples, frames, None, self.means_.shape[0], self.means_.shape[-1]
        )
        parameters = Parameters(self.priors_, list(self.means_), list(self.covariances_))
        values = expectation(blocks, parameters, tangents_at(blocks, parameters.means))[which]
        return np.split(values, np.cumsum(lengths)[:-1])

    def product(self, frames: Sequence[PoseCourse]) -> PoseMixture:
        """(7.21): the mixture in the world for P new frames; None leaves a frame out of the
        product.
        """
        self._require_fitted()
        means, covariances = self._products(
            Stage.of(frames, 1, "the new situation", len(self.means_))
        )
        return PoseMixture(self.priors_, means[0], covariances[0])

    def regress(
        self, frames: Sequence[PoseCourse], inputs: ArrayLike, input_dims: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """`PoseMixture.regress` in new frames; a frame that moves is given by a list with one for
        each of the inputs.

        Parameters
        ----------
        input_dims
            As of `PoseMixture.regress`: columns (i,) of numbers or position, default the q numbers
            before the pose.
        """
        self._require_fitted()
        n = len(np.atleast_1d(inputs))
        means, covariances = self._products(
            Stage.of(frames, n, "the new situation", len(self.means_))
        )
        return regress_rows(self.priors_, means, covariances, inputs, input_dims)

    def _products(self, stage: Stage) -> tuple[np.ndarray, np.ndarray]:
        """Means (m, K, w) and covariances (m, K, d, d) in the world at m moments."""
        means, covariances = stage.place(self.means_, self.covariances_)
        seen = np.broadcast_to(stage.seen[:, None], means.shape[:-1])
        return product_at(means, covariances, seen)


def _taught(
    samples: Sequence[ArrayLike],
    frames: PoseFrames,
    weights: Weights,
    n_frames: int | None = None,
    width: int | None = None,
) -> tuple[Blocks, np.ndarray, list[int]]:
    """The samples with weight as all frames see them, their weights, and the number of samples of
    each demonstration.
    """
    if len(samples) == 0 or len(samples) != len(frames):
        raise ValueError(
            f"one list of frames per demonstration is needed, got {len(frames)} for {len(samples)}"
        )
    worlds = [as_rows(one, f"samples of demonstration {i}") for i, one in enumerate(samples)]
    for i, world in enumerate(worlds):
        if world.shape[1] != (width or worlds[0].shape[1]):
            raise ValueError(
                f"demonstration {i} has {world.shape[1]} columns, expected"
                f" {width or worlds[0].shape[1]}"
            )
    lengths = [len(world) for world in worlds]
    mass = as_sample_weights(weights, lengths)
    n_frames = n_frames or len(frames[0])
    stages = [
        Stage.of(ours, n, f"demonstration {i}", n_frames)
        for i, (ours, n) in enumerate(zip(frames, lengths, strict=True))
    ]
    world, kept = np.concatenate(worlds), mass > 0
    position, orientation, seen = (
        np.concatenate(
            [
                np.broadcast_to(part, (n, *part.shape[1:]))
                for part, n in zip(parts, lengths, strict=True)
            ]
        )[kept]
        for parts in (
            [one.position for one in stages],
            [one.orientation for one in stages],
            [one.seen for one in stages],
        )
    )
    return _blocks(world[kept], position, orientation, seen.T, mass[kept]), mass[kept], lengths


def _blocks(
    world: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
    seen: np.ndarray,
    mass: np.ndarray,
) -> Blocks:
    least, rows, scales = LEAST_SHARE * scales_of(world, mass), [], []
    for j, there in enumerate(seen):
        if not there.any():
            raise ValueError(
                f"task frame {j} is missing from every sample with weight; leave it out of all"
                " demonstrations"
            )
        rows.append(see(world, position[:, j], orientation[:, j]))
        scales.append(scales_of(rows[j][there], mass[there], least))
    return Blocks(rows, seen, scales)
