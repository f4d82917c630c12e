"""A Gaussian at each step of time, in task frames: the core of MiDiGaP with one mode (J. O. von
Hartz, A. Schlageter, A. Valada and J. Boedecker, MiDiGaP: Mixtures of Discrete-time Gaussian
Processes, arXiv 2505.03296, 2025), in the task frames of the thesis (7.5.2).

In frame p, of demonstrations i with shares w_i that are seen there as x_pi(t),

    mu_p(t) = sum_i w_i x_pi(t),    S_p(t) = sum_i w_i (x_pi(t) - mu_p(t)) (x_pi(t) - mu_p(t))'.

For new frames (A_p, b_p) the path is the product of Gaussians (3.8), step by step, as (7.21) has it
for components:

    N(mu(t), S(t))  ~  prod_p N(A_p mu_p(t) + b_p, A_p S_p(t) A_p').

Nothing is iterated and there is no number of components to choose: a fit is means and covariances
over the demonstrations. In exchange nothing is averaged over time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_vector
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.mixture import cholesky
from dart_skill.movement._frames import TaskFrame
from dart_skill.movement._on_steps import on_steps
from dart_skill.movement._placement import FrameSituation, moments_of
from dart_skill.movement._task_parameterised import frame_products
from dart_skill.movement._via_points import (
    TimedViaPoints,
    arrays_of,
    as_smoothness,
    conditioned,
    interpolating,
)

SMOOTHNESS = 0.1
"""l of a via point in parts of the movement."""


class StepwiseGaussians(TimedViaPoints, SavableModel):
    """Base of models with a Gaussian at each step, whose parameters `PerStepGaussians` describes."""

    means_: np.ndarray
    covariances_: np.ndarray

    def __init__(
        self,
        n_steps: int = 100,
        *,
        covariance_prior: float = 2.0,
        covariance_floor: float = 1e-6,
        smoothness: float | None = None,
    ) -> None:
        self.n_steps = as_count(n_steps, "n_steps", 2)
        self.covariance_prior = as_number(covariance_prior, "covariance_prior", strict=False)
        self.covariance_floor = as_number(covariance_floor, "covariance_floor")
        self.smoothness = as_smoothness(smoothness)

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        self._require_no_vias()
        return {"time": self.time_, "means": self.means_, "covariances": self.covariances_}


class PerStepGaussians(StepwiseGaussians):
    """Movement of d variables in P task frames, with a Gaussian at each of n steps.

    Frames are TaskFrames over [t, y] that pass time through, and stay where they are.

    Fitted attributes: time_ (n,) [s], means_ (P, n, d), covariances_ (P, n, d, d).

    Parameters
    ----------
    n_steps
        Int, default 100. n.
    covariance_prior
        Float, default 2. Few demonstrations have much in common by chance: each covariance is
        averaged with one that says that all d variables vary alike and are not correlated, and that
        counts as so many demonstrations (inverse Wishart; Fraley and Raftery 2007). They have one
        unit, therefore. 0: no prior; the larger, the nearer is the product to a mean of the frames
        with one weight each.
    covariance_floor
        Float, default 1e-6. Least variance in any direction, relative to the mean variance of the
        samples in the world.
    smoothness
        Float [s], default None: a tenth of the movement. Over what time a via point (`condition`)
        draws the path.
    """

    def fit(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[TaskFrame]],
        weights: ArrayLike | None = None,
    ) -> PerStepGaussians:
        """Learn from demonstrations.

        Parameters
        ----------
        samples
            [t, y] (n_i, 1 + d) of each, in the world. Its stamps are stretched to the mean first
            and last ones.
        frames
            P task frames of each.
        weights
            For each demonstration one number: how much it counts. Default None: all alike.

        Returns
        -------
        PerStepGaussians
            Self.

        Raises
        ------
        ValueError
            For what cannot be learned from, or frames that are missing, move, or change time.
        """
        time, rows, shares = on_steps(samples, weights, self.n_steps)
        if len(frames) != len(rows):
            raise ValueError(
                f"one list of frames per demonstration is needed, got {len(frames)} for"
                f" {len(rows)}"
            )
        d, n_frames = rows.shape[2], len(frames[0])
        seen = [
            _situation(ours, d, f"demonstration {i}", n_frames) for i, ours in enumerate(frames)
        ]
        if not all(one.seen.all() for one in seen):
            raise ValueError("a task frame is missing; give each demonstration all of them")
        inverses = np.concatenate([one.inverses for one in seen])
        origins = np.concatenate([one.b for one in seen])
        local = np.einsum(
            "ipab,iptb->ipta", inverses, rows[:, None] - origins[:, :, None], optimize=True
        )
        mean = np.einsum("i,ipta->pta", shares, local)
        off = (local - mean) * np.sqrt(shares)[:, None, None, None]
        covariance = np.einsum("ipta,iptb->ptab", off, off, optimize=True)
        least = self.covariance_floor * float(np.var(rows.reshape(-1, d), axis=0).mean())
        self._set(time, mean, self._believed(covariance, len(rows), least))
        self.n_demonstrations_ = len(rows)
        return self

    def _believed(self, covariance: np.ndarray, n: int, least: float) -> np.ndarray:
        """Covariances (P, n, d, d) with what the prior says, and none below the floor."""
        d, strength = covariance.shape[-1], self.covariance_prior
        alike = np.trace(covariance, axis1=-2, axis2=-1)[..., None, None] / d * np.eye(d)
        floor = max(least, np.finfo(float).tiny ** 0.5) * np.eye(d)
        return (n * covariance + strength * alike) / (n + strength) + floor

    def _set(self, time: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> None:
        self.time_, self.means_, self.covariances_ = time, means, covariances
        self._whiteners = np.linalg.inv(cholesky(covariances, "covariance of step"))
        self._vias = ()

    def _from_arrays(self, arrays: Arrays) -> None:
        time = array_of(arrays, "time", (None,))
        means = array_of(arrays, "means", (None, len(time), None))
        shape = (*means.shape, means.shape[2])
        self._set(time, means, array_of(arrays, "covariances", shape))

    def _fitted_to(self) -> str:
        if not hasattr(self, "means_"):
            return ""
        p, n, d = self.means_.shape
        return f"{self._shown()}{d} movement variables at {n} steps in {p} task frames"

    @property
    def _n_outputs(self) -> int:
        self._require_fitted()
        return self.means_.shape[2]

    def product(self, frames: Sequence[TaskFrame | None]) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, d) and covariance (n, d, d) of all steps in the world for P new frames; None
        for a missing one. Via points count.

        Raises
        ------
        ValueError
            For other frames, or via points that cannot all be met.
        """
        self._require_fitted()
        situation = _situation(frames, self._n_outputs, "the new situation", len(self.means_))
        if not situation.seen.any():
            raise ValueError("all task frames are missing; give one at least")
        (mean,), (covariance,) = frame_products(self.means_, self._whiteners, 0, situation)
        return self._through(mean, covariance) if self._vias else (mean, covariance)

    def _through(self, mean: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left of a path once it passes through the via points."""
        at, wanted, noise = arrays_of(self._vias)
        weights = interpolating(at, self.time_)
        length = self.smoothness or SMOOTHNESS * (self.time_[-1] - self.time_[0])
        each = np.repeat(weights[:, :, None], mean.shape[1], axis=2)
        return conditioned(
            self.time_, mean, covariance, each, wanted - weights @ mean, noise, length
        )

    def retrieve(
        self, frames: Sequence[TaskFrame | None], time: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean (k, d) and covariance (k, d, d) in new frames.

        Parameters
        ----------
        frames
            P task frames; None for a missing one.
        time
            Instants (k,) [s], default None: the n steps. Between these both are linear; before the
            first and after the last they stay.
        """
        mean, covariance = self.product(frames)
        if time is None:
            return mean, covariance
        weights = interpolating(as_vector(time, "time"), self.time_)
        return weights @ mean, np.tensordot(weights, covariance, axes=1)

    def log_likelihood(
        self, samples: Sequence[ArrayLike], frames: Sequence[Sequence[TaskFrame]]
    ) -> float:
        """Log density of demonstrations, given as to `fit`, summed over steps and frames."""
        self._require_fitted()
        total, d = 0.0, self._n_outputs
        rows = on_steps(samples, None, len(self.time_)).rows
        log_roots = np.log(np.abs(np.linalg.det(self._whiteners))).sum()
        for one, ours in zip(rows, frames, strict=True):
            seen = _situation(ours, d, "a demonstration", len(self.means_))
            local = np.einsum("pab,ptb->pta", seen.inverses[0], one - seen.b[0][:, None])
            white = np.einsum("ptab,ptb->pta", self._whiteners, local - self.means_)
            total += float(log_roots - 0.5 * (white**2 + np.log(2.0 * np.pi)).sum())
        return total

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        self._require_fitted()
        p, n, d = self.means_.shape
        return p * n * (d + d * (d + 1) // 2)


def _situation(
    frames: Sequence[TaskFrame | None], d: int, name: str, n_frames: int
) -> FrameSituation:
    """P frames of [t, y] without time, at one moment."""
    (row,) = moments_of(frames, 1, name, n_frames, (TaskFrame,))
    whole = FrameSituation.of([row], 1 + d)
    A, b = whole.A[whole.seen], whole.b[whole.seen]
    if (A[:, 0] != np.eye(1 + d)[0]).any() or A[:, 1:, 0].any() or b[:, 0].any():
        raise ValueError(f"a task frame of {name} changes time, which all shall pass through")
    return FrameSituation(whole.A[..., 1:, 1:], whole.b[..., 1:], whole.seen, [d] * n_frames)
