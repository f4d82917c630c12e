"""Via points: what a movement that was learned shall pass through in one situation, exactly or with
a covariance.

A learned path is a mean mu(t) and a covariance S(t). What deviates from it is taken as a Gaussian
process: x(t) = mu(t) + R(t) z(t), where R is the symmetric root of S + e^2 I, and z has unit
variance and the kernel exp(-(t - t')^2 / (2 l^2)) in each dimension. This is the process that
`DSGMR.variations` draws from, but for e. A via point is an observation of x, so the rest follows by
conditioning a Gaussian (C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine
Learning, 2006, (2.22) to (2.24)). As in ProMP and KMP it may have a covariance.

e bounds how far the rest of a path goes along with a via point that the demonstrations did not allow
for: where they all agreed S is nothing, and what is a millimetre there would be as unlikely as a
decimetre elsewhere.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_covariances, as_finite, as_number, as_vector
from dart_skill.mixture import symmetric

Movement = TypeVar("Movement", bound="ViaPoints")
TimedMovement = TypeVar("TimedMovement", bound="TimedViaPoints")


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """What a path passes through.

    Parameters
    ----------
    time
        [s] on the clock of the movement.
    position
        (d,) in the world.
    covariance
        (d, d); zeros: exactly.
    """

    time: float
    position: np.ndarray
    covariance: np.ndarray


class ViaPoints:
    """Base of movements that may be asked to pass through points. Those are of one situation: a
    file of a model has none.
    """

    _vias: tuple[ViaPoint, ...] = ()

    @property
    def _n_outputs(self) -> int:
        """Number d of movement variables."""
        raise NotImplementedError

    def condition(
        self: Movement, time: float, position: ArrayLike, covariance: ArrayLike | None = None
    ) -> Movement:
        """The same movement that passes through a point, too.

        Parameters
        ----------
        time
            When [s], on the clock of the movement.
        position
            Where (d,), in the world.
        covariance
            How exactly (d, d); default None: it meets the point.

        Raises
        ------
        ValueError
            For an instant outside of the movement, or a point of another dimension.
        """
        d, instant = self._n_outputs, float(as_finite(time, "time", 0))
        self._require_within(instant)
        spread = (
            np.zeros((d, d))
            if covariance is None
            else as_covariances(covariance, "covariance", (d, d))
        )
        other = copy.copy(self)
        other._vias = (*self._vias, ViaPoint(instant, self._as_place(position), spread))
        return other

    def _as_place(self, position: ArrayLike) -> np.ndarray:
        """Where a via point is (d,), checked."""
        return as_vector(position, "position", self._n_outputs)

    def _require_within(self, time: float) -> None:
        """ValueError for an instant [s] outside of the movement."""

    def _require_no_vias(self) -> None:
        if self._vias:
            raise ValueError(
                "via points are of one situation and are not saved: save the model without them"
            )


class TimedViaPoints(ViaPoints):
    """Base of those that know when they begin and end: their `time_`, once `means_` are fitted."""

    time_: np.ndarray

    def _require_fitted(self) -> None:
        if not hasattr(self, "means_"):
            raise ValueError(f"this {type(self).__name__} holds no model yet; call fit first")

    @property
    def _first_and_last(self) -> tuple[float, float]:
        """First and last instant of the movement [s]."""
        self._require_fitted()
        return float(self.time_[0]), float(self.time_[-1])

    def between(self: TimedMovement, start: ArrayLike, end: ArrayLike) -> TimedMovement:
        """The same movement with exactly this start and end (d,), in the world."""
        first, last = self._first_and_last
        return self.condition(first, start).condition(last, end)

    def _require_within(self, time: float) -> None:
        first, last = self._first_and_last
        if not first <= time <= last:
            raise ValueError(
                f"a via point at {time:g} s is outside of the movement, which is from {first:g} to"
                f" {last:g} s"
            )


def conditioned(
    time: np.ndarray,
    mean: np.ndarray,
    covariance: np.ndarray,
    weights: np.ndarray,
    misses: np.ndarray,
    noise: np.ndarray,
    smoothness: float,
    least: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (n, d) and covariance (n, d, d) of a path once m of its weighted sums are known.

    Parameters
    ----------
    time
        (n,) [s].
    mean, covariance
        (n, d) and (n, d, d), as learned.
    weights : (m, n, d)
        What is known is sum_t weights[., t, i] x_i(t) for each dimension i.
    misses : (m, d)
        By how much these sums differ from those of the mean.
    noise : (m, d, d)
        Covariances with which they are known.
    smoothness
        l [s].
    least
        e, default None: the root of the mean variance of the path.

    Raises
    ------
    ValueError
        Where two of them cannot both hold.
    """
    (n, d), m = mean.shape, len(weights)
    variance = float(np.trace(covariance, axis1=1, axis2=2).mean()) / d
    slack = (variance if least is None else least**2) * np.eye(d)
    kernel = np.exp(-0.5 * np.square((time[:, None] - time) / smoothness))
    observed = np.einsum("mti,tij->mitj", weights, roots(covariance + slack))
    along = np.einsum("mitj,ts->misj", observed, kernel)
    known = np.einsum("misj,nksj->mink", along, observed).reshape(m * d, m * d)
    for k, one in enumerate(noise):
        known[k * d : (k + 1) * d, k * d : (k + 1) * d] += one
    along = along.reshape(m * d, n * d)
    gain = _solved(symmetric(known), along)
    deviation = (misses.reshape(-1) @ gain).reshape(n, d)
    told = np.einsum("ktj,kti->tji", along.reshape(-1, n, d), gain.reshape(-1, n, d))
    root = roots(covariance)
    left = root @ (np.eye(d) - symmetric(told)) @ root
    moved = mean + np.einsum("tij,tj->ti", roots(covariance + slack), deviation)
    return moved, symmetric(left)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """matrix^-1 right; ValueError where via points are so near in time that they say the same."""
    values = np.linalg.eigvalsh(matrix)
    if values[0] <= 1e-13 * values[-1]:
        raise ValueError(
            "two via points are at the same instant, or so near that no smooth path meets both:"
            " leave one out, or give them covariances"
        )
    return np.linalg.solve(matrix, right)


def roots(covariance: np.ndarray) -> np.ndarray:
    """Symmetric roots (n, d, d) of covariances (n, d, d), which change as smoothly as these do."""
    variance, axes = np.linalg.eigh(covariance)
    return np.einsum("tij,tj,tkj->tik", axes, np.sqrt(np.maximum(variance, 0.0)), axes)


def arrays_of(vias: Sequence[ViaPoint]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants (m,) [s], positions (m, d) and covariances (m, d, d) of via points."""
    return (
        np.array([one.time for one in vias]),
        np.array([one.position for one in vias]),
        np.array([one.covariance for one in vias]),
    )


def interpolating(time: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Weights (m, n) with which values at stamps (n,) are interpolated linearly at instants (m,);
    the first and the last value hold beyond the ends.
    """
    n = len(stamps)
    if n == 1:
        return np.ones((len(time), 1))
    place = np.interp(time, stamps, np.arange(n))
    low = np.minimum(place.astype(int), n - 2)
    rows, share = np.arange(len(time)), place - low
    weights = np.zeros((len(time), n))
    weights[rows, low] = 1.0 - share
    weights[rows, low + 1] += share
    return weights


def as_smoothness(value: float | None) -> float | None:
    """l [s], checked; None stays None."""
    return None if value is None else as_number(value, "smoothness")
