"""Rewards that change while a search goes on, other than those of darts: moving peaks, a peak
under an obstacle, and a broken actuator.

A landscape is a row of stages; a search is not told when one follows another. Every stage has
its reward in closed form and knows the highest there is, so that regret can be measured: it has
`best`, its highest reward, and `rewards` (m,) of parameters (m, d).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

N_TRIALS = 3000
"""Number of trials on a landscape."""


class StagedLandscape:
    """One stage after the other: stages[i + 1] begins with trial changes[i].

    Parameters
    ----------
    start
        First guess (d,).
    spread
        Standard deviation of the first trials, in the same units.

    Attributes
    ----------
    best : (N_TRIALS,)
        The highest reward at every trial.
    """

    def __init__(
        self, start: np.ndarray, spread: float, stages: list, changes: tuple[int, ...]
    ) -> None:
        self.start, self.spread, self.stages, self.changes = start, spread, stages, changes
        lengths = np.diff([0, *changes, N_TRIALS])
        self.best = np.repeat([stage.best for stage in stages], lengths)

    def rewards(self, parameters: np.ndarray, trial: int) -> np.ndarray:
        """Rewards (m,) of parameters (m, d), each tried as this trial."""
        stage = self.stages[int(np.searchsorted(self.changes, trial, side="right"))]
        return stage.rewards(parameters)


BOX = (0.0, 100.0)
"""Limits of the places of moving peaks, along each parameter."""
HEIGHTS = (30.0, 70.0)
"""Limits of their heights."""
RADII = (5.0, 30.0)
"""Limits of the distances at which half of their height is left."""
SHIFT = 5.0
"""Length of the step of a peak at each change; heights change by 7, radii by 1 (deviations)."""


class Peaks(NamedTuple):
    """max_i h_i / (1 + |x - p_i|^2 / w_i^2): the peaks of J. Branke, Memory enhanced evolutionary
    algorithms for changing optimization problems, CEC 1999, with heights (k,), centres (k, d), and
    as `radii` (k,) the distance at which half of the height is left.
    """

    heights: np.ndarray
    radii: np.ndarray
    centres: np.ndarray

    @property
    def best(self) -> float:
        """The highest peak is higher at its centre than all others are there."""
        return float(self.heights.max())

    def rewards(self, parameters: np.ndarray) -> np.ndarray:
        squares = np.square(parameters[:, None] - self.centres).sum(axis=2)
        return np.max(self.heights / (1.0 + squares / self.radii**2), axis=1)

    def moved(self, rng: np.random.Generator) -> Peaks:
        """Each peak a step of length SHIFT further in a random direction, its height and radius
        changed by a random amount; all are reflected at their bounds.
        """
        steps = rng.standard_normal(self.centres.shape)
        steps *= SHIFT / np.linalg.norm(steps, axis=1, keepdims=True)
        heights = self.heights + 7.0 * rng.standard_normal(len(self.heights))
        radii = self.radii + 1.0 * rng.standard_normal(len(self.radii))
        centres = reflected(self.centres + steps, *BOX)
        return Peaks(reflected(heights, *HEIGHTS), reflected(radii, *RADII), centres)


def reflected(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Values thrown back at the bounds as often as need be.

    Parameters
    ----------
    low, high
        The bounds.
    """
    length = high - low
    return low + length - np.abs((values - low) % (2 * length) - length)


def moving_peaks(
    rng: np.random.Generator, n_dims: int, every: int, n_peaks: int = 5
) -> StagedLandscape:
    """Peaks at random places of the box that change after `every` trials.

    Parameters
    ----------
    n_dims
        Of the box.
    """
    heights, radii = rng.uniform(*HEIGHTS, n_peaks), rng.uniform(*RADII, n_peaks)
    peaks = [Peaks(heights, radii, rng.uniform(*BOX, (n_peaks, n_dims)))]
    changes = tuple(range(every, N_TRIALS, every))
    for _ in changes:
        peaks.append(peaks[-1].moved(rng))
    return StagedLandscape(np.full(n_dims, np.mean(BOX)), 30.0, peaks, changes)


HILL = 0.6
"""Standard deviation of both hills of `vanishing_peak` [spreads]."""


class Hills(NamedTuple):
    """Gaussian hills with tops (k, 2) and heights (k,), the highest of those at each place; none
    of it within the disc of that radius about the first top.

    Parameters
    ----------
    obstacle
        The radius, default 0.
    """

    tops: np.ndarray
    heights: np.ndarray
    obstacle: float = 0.0

    @property
    def best(self) -> float:
        """The highest top left, or what sticks out of the first hill beside the obstacle."""
        edge = self.heights[0] * np.exp(-0.5 * (self.obstacle / HILL) ** 2)
        free = np.linalg.norm(self.tops - self.tops[0], axis=1) >= self.obstacle
        return float(np.max(self.heights, where=free, initial=edge))

    def rewards(self, parameters: np.ndarray) -> np.ndarray:
        squares = np.square(parameters[:, None] - self.tops).sum(axis=2)
        highest = np.max(self.heights * np.exp(-0.5 * squares / HILL**2), axis=1)
        return np.where(squares[:, 0] < self.obstacle**2, 0.0, highest)


def vanishing_peak(rng: np.random.Generator) -> StagedLandscape:
    """Two hills on opposite sides of the start; at a random moment in the middle third an obstacle
    covers the better one.
    """
    angle = rng.uniform(0.0, 2.0 * np.pi)
    top = 1.25 * np.array([np.cos(angle), np.sin(angle)])
    hills = Hills(np.array([top, -top]), np.array([1.0, 0.8]))
    stages = [hills, hills._replace(obstacle=0.9)]
    return StagedLandscape(np.zeros(2), 1.0, stages, broken_at(rng))


def broken_at(rng: np.random.Generator) -> tuple[int]:
    """A random moment in the middle third."""
    return (int(rng.integers(N_TRIALS // 3, 2 * N_TRIALS // 3)),)


LENGTHS = np.array([0.35, 0.30, 0.20, 0.15])
"""Links of the arm [m]."""
REST = np.array([0.0, 0.5, 0.0, 0.0])
"""Angles at rest [rad]."""
EASE = np.array([4.0, 4.0, 1.2, 1.2])
"""Deviations from the angles at rest that make a cost of 1 [rad]."""
TOLERANCE = 0.1
"""Distance to the target that makes a cost of 1 [m]."""
RANGE = 2.4
"""Range of every joint to either side [rad]."""
ELBOW = 1
"""The joint that breaks."""


@dataclass(frozen=True, eq=False)
class PlanarArm:
    """Four joints in a plane put the tip at a target (2,) [m]. Angles (4,) [rad] outside of `low`
    and `high` stop there; a joint is stuck where both are the same.

        reward = 1 / (1 + |tip - target|^2 / TOLERANCE^2 + sum_j (angle_j - REST_j)^2 / EASE_j^2)

    With two joints more than it needs, the arm can get there with the elbow to the left, as at
    rest, or to the right.
    """

    target: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @cached_property
    def best(self) -> float:
        """By least squares on the joints that move, from the best of a grid of angles."""
        free = self.high > self.low
        low, high = self.low[free], self.high[free]

        def whole(angles: np.ndarray) -> np.ndarray:
            every = np.tile(self.low, (*angles.shape[:-1], 1))
            every[..., free] = angles
            return every

        def residuals(angles: np.ndarray) -> np.ndarray:
            return self._residuals(whole(angles[None]))[0]

        shares = np.array(list(itertools.product(np.linspace(0.05, 0.95, 7), repeat=len(low))))
        starts = low + shares * (high - low)
        chosen = starts[np.argsort(-self.rewards(whole(starts)), kind="stable")[:24]]
        how = {"bounds": (low, high), "xtol": 1e-12, "ftol": 1e-14}
        least = min(scipy.optimize.least_squares(residuals, one, **how).cost for one in chosen)
        return float(1.0 / (1.0 + 2.0 * least))

    def rewards(self, parameters: np.ndarray) -> np.ndarray:
        costs = np.square(self._residuals(np.clip(parameters, self.low, self.high)))
        return 1.0 / (1.0 + costs.sum(axis=1))

    def tip(self, angles: np.ndarray) -> np.ndarray:
        """Places (m, 2) [m] for angles (m, 4), each from the link before."""
        directions = np.cumsum(angles, axis=1)
        return np.stack([np.cos(directions) @ LENGTHS, np.sin(directions) @ LENGTHS], axis=1)

    def _residuals(self, angles: np.ndarray) -> np.ndarray:
        away = (self.tip(angles) - self.target) / TOLERANCE
        return np.column_stack([away, (angles - REST) / EASE])


def broken_actuator(rng: np.random.Generator, stuck: bool) -> StagedLandscape:
    """At a random moment in the middle third the elbow loses the half of its range in which it
    was, or gets stuck at a random angle (thesis 5.3.1).
    """
    distance, azimuth = rng.uniform(0.5, 0.75), rng.uniform(-0.5, 0.5)
    target = distance * np.array([np.cos(azimuth), np.sin(azimuth)])
    low, high = np.full(4, -RANGE), np.full(4, RANGE)
    arm = PlanarArm(target, low.copy(), high.copy())
    angle = rng.uniform(-0.5 * RANGE, 0.5 * RANGE)
    low[ELBOW], high[ELBOW] = (angle, angle) if stuck else (-RANGE, 0.0)
    stages = [arm, replace(arm, low=low, high=high)]
    return StagedLandscape(np.zeros(4), 0.6, stages, broken_at(rng))


LANDSCAPES: dict[str, Callable[[np.random.Generator], StagedLandscape]] = {
    "moving_peaks_2": lambda rng: moving_peaks(rng, n_dims=2, every=250),
    "moving_peaks_5": lambda rng: moving_peaks(rng, n_dims=5, every=500),
    "vanishing_peak": vanishing_peak,
    "half_range": lambda rng: broken_actuator(rng, stuck=False),
    "stuck_joint": lambda rng: broken_actuator(rng, stuck=True),
}
"""Each is drawn anew from a generator, so that every seed has a landscape of its own."""
