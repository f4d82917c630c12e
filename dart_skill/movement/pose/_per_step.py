"""A Gaussian at each step of time on R^3 x S3, in task frames: `dart_skill.movement.PerStepGaussians`
with poses (J. O. von Hartz, A. Schlageter, A. Valada and J. Boedecker, MiDiGaP: Mixtures of
Discrete-time Gaussian Processes, arXiv 2505.03296, 2025; one mode).

In each frame a step has the intrinsic mean of the demonstrations' poses and their covariance in the
tangent space there. In new frames it is the product of these Gaussians on the manifold (Zeestraten
2017). A via point conditions the deviations in the tangent spaces, as `PerStepGaussians` does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_vector
from dart_skill.common.hyper_parameters import Arrays, array_of
from dart_skill.movement._on_steps import on_steps
from dart_skill.movement._orientation import make_continuous
from dart_skill.movement._per_step import SMOOTHNESS, StepwiseGaussians
from dart_skill.movement._via_points import (
    arrays_of,
    conditioned,
    interpolating,
)
from dart_skill.movement.pose._em import PoseFrame, Stage, see
from dart_skill.movement.pose._gaussians import as_rows, log_normals, moments_at, product_at
from dart_skill.movement.pose._manifold import as_points, exp_at, log_at

PARTS = (slice(0, 3), slice(3, 6))
"""Columns of position [m] and of rotation [rad] in the tangent space."""


class PerStepPoses(StepwiseGaussians):
    """Movement of position and orientation in P task frames, with a Gaussian at each of n steps.

    Position and rotation of a step are independent. Frames stay where they are.

    Fitted attributes: time_ (n,) [s], means_ (P, n, 7), covariances_ (P, n, 6, 6) in the tangent
    spaces at the means, in the axes of the frame.

    Parameters
    ----------
    n_steps
        Int, default 100. n.
    covariance_prior
        Float, default 2. As of `PerStepGaussians`: so many demonstrations say that all directions
        vary alike, those of the position and those of the rotation.
    covariance_floor
        Float, default 1e-6. Least variance in any direction, relative to the mean variance of
        position and rotation in the world.
    smoothness
        Float [s], default None: a tenth of the movement. As of `PerStepGaussians`.
    """

    def fit(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[PoseFrame]],
        weights: ArrayLike | None = None,
    ) -> PerStepPoses:
        """Learn from demonstrations.

        Parameters
        ----------
        samples
            [t, x, y, z, quaternion] (n_i, 8) of each, in the world. Its stamps are stretched to the
            mean first and last ones.
        frames
            P task frames of each.
        weights
            For each demonstration one number: how much it counts. Default None: all alike.

        Returns
        -------
        PerStepPoses
            Self.

        Raises
        ------
        ValueError
            For what cannot be learned from, or frames that are missing or move.
        """
        rows = [_continuous(one, f"samples of demonstration {i}") for i, one in enumerate(samples)]
        time, poses, shares = on_steps(rows, weights, self.n_steps)
        poses = as_points(poses / _lengths(poses), "poses")
        local = self._seen(poses, frames)
        n_frames, n, count, _ = local.shape
        nothing = np.zeros((n_frames * n, count, 6, 6))
        mean, covariance = moments_at(
            local.reshape(-1, count, 7), nothing, np.broadcast_to(shares, (n_frames * n, count))
        )
        world = poses.reshape(1, -1, 7)
        uniform = np.full((1, world.shape[1]), 1.0 / world.shape[1])
        spread = moments_at(world, np.zeros((1, world.shape[1], 6, 6)), uniform)[1][0]
        believed = self._believed(covariance.reshape(n_frames, n, 6, 6), count, spread)
        self._set(time, mean.reshape(n_frames, n, 7), believed)
        self.n_demonstrations_ = count
        return self

    @staticmethod
    def _seen(poses: np.ndarray, frames: Sequence[Sequence[PoseFrame]]) -> np.ndarray:
        """Poses (N, n, 7) as all frames see them (P, n, N, 7)."""
        if len(frames) != len(poses):
            raise ValueError(
                f"one list of frames per demonstration is needed, got {len(frames)} for"
                f" {len(poses)}"
            )
        stages = [
            Stage.of(ours, 1, f"demonstration {i}", len(frames[0]))
            for i, ours in enumerate(frames)
        ]
        if not all(one.seen.all() for one in stages):
            raise ValueError("a task frame is missing; give each demonstration all of them")
        position = np.concatenate([one.position for one in stages])[:, :, None]
        orientation = np.concatenate([one.orientation for one in stages])[:, :, None]
        n_frames, n = position.shape[1], poses.shape[1]
        turned = np.broadcast_to(orientation, (len(poses), n_frames, n, 4))
        return np.moveaxis(see(poses[:, None], position, turned), 0, 2)

    def _believed(self, covariance: np.ndarray, n: int, spread: np.ndarray) -> np.ndarray:
        """Covariances (P, n, 6, 6) with what the prior says, and none below the floor."""
        made, strength = np.zeros_like(covariance), self.covariance_prior
        for part in PARTS:
            own = covariance[..., part, part]
            alike = np.trace(own, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)
            least = self.covariance_floor * float(np.trace(spread[part, part])) / 3.0
            floor = max(least, np.finfo(float).tiny ** 0.5) * np.eye(3)
            made[..., part, part] = (n * own + strength * alike) / (n + strength) + floor
        return made

    def _set(self, time: np.ndarray, means: np.ndarray, covariances: np.ndarray) -> None:
        self.time_, self.means_, self.covariances_, self._vias = time, means, covariances, ()

    def _from_arrays(self, arrays: Arrays) -> None:
        time = array_of(arrays, "time", (None,))
        means = array_of(arrays, "means", (None, len(time), 7))
        covariances = array_of(arrays, "covariances", (*means.shape[:2], 6, 6))
        self._set(time, means, covariances)

    def _fitted_to(self) -> str:
        if not hasattr(self, "means_"):
            return ""
        p, n, _ = self.means_.shape
        return f"{self._shown()}positions and orientations at {n} steps in {p} task frames"

    @property
    def _n_outputs(self) -> int:
        self._require_fitted()
        return 6

    def _as_place(self, position: ArrayLike) -> np.ndarray:
        """A pose (7,), which is where a via point is."""
        return as_points(as_vector(position, "position", 7), "position")

    def product(self, frames: Sequence[PoseFrame | None]) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n, 7) of all steps in the world for P new frames, and their covariances (n, 6,
        6); None for a missing one. Via points count.

        Raises
        ------
        ValueError
            For other frames, or via points that cannot all be met.
        """
        self._require_fitted()
        stage = Stage.of(frames, 1, "the new situation", len(self.means_))
        means, covariances = stage.place(self.means_, self.covariances_)
        seen = np.broadcast_to(stage.seen[:, None], means.shape[:-1])
        (mean,), (covariance,) = product_at(means, covariances, seen)
        return self._through(mean, covariance) if self._vias else (mean, covariance)

    def _through(self, mean: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left of a path once it passes through the via points. Position and rotation
        have units of their own, so each is conditioned alone.
        """
        at, wanted, noise = arrays_of(self._vias)
        weights = interpolating(at, self.time_)
        misses = log_at(_between(weights, mean), wanted)
        length = self.smoothness or SMOOTHNESS * (self.time_[-1] - self.time_[0])
        moved, left = np.zeros((len(mean), 6)), np.zeros_like(covariance)
        for part in PARTS:
            moved[:, part], left[:, part, part] = conditioned(
                self.time_,
                moved[:, part],
                covariance[:, part, part],
                np.repeat(weights[:, :, None], 3, axis=2),
                misses[:, part],
                noise[:, part, part],
                length,
            )
        return exp_at(mean, moved), left

    def retrieve(
        self, frames: Sequence[PoseFrame | None], time: ArrayLike | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Poses (k, 7) and covariances (k, 6, 6), [m] and [rad] in world axes, in new frames.

        Parameters
        ----------
        frames
            P task frames; None for a missing one.
        time
            Instants (k,) [s], default None: the n steps. Between these the hand moves along a
            geodesic; before the first and after the last it stays.
        """
        mean, covariance = self.product(frames)
        if time is None:
            return mean, covariance
        weights = interpolating(as_vector(time, "time"), self.time_)
        return _between(weights, mean), np.tensordot(weights, covariance, axes=1)

    def log_likelihood(
        self, samples: Sequence[ArrayLike], frames: Sequence[Sequence[PoseFrame]]
    ) -> float:
        """Log density of demonstrations, given as to `fit`, summed over steps and frames."""
        self._require_fitted()
        rows = [_continuous(one, f"samples of demonstration {i}") for i, one in enumerate(samples)]
        poses = on_steps(rows, None, len(self.time_)).rows
        local = self._seen(as_points(poses / _lengths(poses), "poses"), frames)
        ways = log_at(self.means_[:, :, None], local)
        return float(log_normals(ways, self.covariances_).sum())

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        self._require_fitted()
        return self.means_.shape[0] * self.means_.shape[1] * (6 + 2 * 6)


def _continuous(samples: ArrayLike, name: str) -> np.ndarray:
    """[t, pose] (n, 8) whose quaternions do not change sign."""
    rows = as_rows(samples, name)
    if rows.shape[1] != 8:
        raise ValueError(f"{name} must have the columns time and pose, got shape {rows.shape}")
    return np.hstack([rows[:, :4], make_continuous(rows[:, 4:])])


def _lengths(poses: np.ndarray) -> np.ndarray:
    """What makes the quaternions of poses (..., 7) unit ones once they were interpolated."""
    lengths = np.ones_like(poses)
    lengths[..., 3:] = np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    return lengths


def _between(weights: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Poses (k, 7) between neighbours of n poses, of which each has the weights (k, n)."""
    low = np.minimum(weights.argmax(axis=1), len(poses) - 2)
    low -= (low > 0) & (weights[np.arange(len(low)), low - 1] > 0.0)
    share = weights[np.arange(len(low)), low + 1]
    way = log_at(poses[low], poses[low + 1])
    return exp_at(poses[low], share[:, None] * way)
