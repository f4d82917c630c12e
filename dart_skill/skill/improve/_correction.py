"""What a thrower gets wrong in the same way again and again, learned from where the balls came down, and taken out of the next plan.

A miss has a part that is known once it has happened, the hand opened early or late and the ball left the path elsewhere, and a part that
belongs to the place: friction, the load, a base that was turned. The first is computed and taken away, so that one throw already tells much
about the second, which a Gaussian process over the places describes: a common offset and a smooth difference from place to place
(C. Rasmussen and C. Williams, Gaussian Processes for Machine Learning, 2006, chapter 2). After something has changed, what was learned
before is of no use: two surprises in a row in the same direction, at different places, forget it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from dart_skill.robot import ThrowPlan
from dart_skill.skill.learn import landing_if_late
from dart_skill.surface import BASKETS, RIMS, Game, Surface

USUAL_NOISE, USUAL_DIFFERENCE = 0.004, 0.01
"""Standard deviations [m] that are expected: of what does not repeat, and of what differs from place to place."""
NOISES, DIFFERENCES = USUAL_NOISE * 2.0 ** np.arange(-3, 5), USUAL_DIFFERENCE * 2.0 ** np.arange(-2, 4)
"""Among which evidence decides."""
UNUSUAL = 1.0
"""Log probability that a factor of two costs, squared for more: two throws that happen to agree are no evidence of a steady hand."""
WARY, WARY_WEIGHT = 0.012, 4.0
"""Noise [m] that a few throws count for where surprises are judged: the first ones may agree better than the next."""


@dataclass(frozen=True)
class CorrectionSettings:
    """How misses are learned from.

    * offset: standard deviation of what all places have in common, before the first throw [m].
    * lengths: distances over which misses resemble each other; the evidence decides among them [m].
    * turns: azimuths over which they do [rad]. An arm that turns about its base may make the same throw all around.
    * surprise: a miss is a surprise from so many standard deviations on.
    * apart: two surprises nearer to each other than this, in distance [m] and azimuth [rad], may be the fault of the place.
    * farthest: a plan is moved no farther than this from its target [m].
    * memory: throws at most, the latest.
    """

    offset: float = 0.1
    lengths: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4, 0.8)
    turns: tuple[float, ...] = (0.7, 3.0)
    surprise: float = 4.0
    apart: tuple[float, float] = (0.25, 0.35)
    farthest: float = 0.5
    memory: int = 200

    def __post_init__(self) -> None:
        values = np.array([self.offset, *self.lengths, *self.turns, self.surprise, *self.apart, self.farthest, self.memory], dtype=float)
        if not (self.lengths and self.turns and np.isfinite(values).all() and (values > 0).all()):
            raise ValueError(f"correction: {self} must hold finite positive numbers only, and at least one length and one turn")


class _Fit(NamedTuple):
    """Noise and difference [m], scale (length [m], turn [rad]), log evidence, inverse covariance (n, n) of the misses, and its product with
    them (n,).
    """

    noise: float
    difference: float
    scale: tuple[float, float]
    evidence: float
    inverse: np.ndarray
    weights: np.ndarray


class _Suspect(NamedTuple):
    """A miss that surprised: place (2,), miss (2,), and by how many standard deviations (2,)."""

    place: np.ndarray
    miss: np.ndarray
    surprise: np.ndarray


class Correction:
    """Misses (along, across) [m] as a function of the place (distance [m], azimuth [rad]) that a plan is meant for; on a board: misses
    (up, left), and the height for the distance.
    """

    def __init__(self, settings: CorrectionSettings | None = None, surface: Surface = RIMS):
        self.settings, self._surface = settings or CorrectionSettings(), surface
        self._places: np.ndarray = np.empty((0, 2))
        self._misses: np.ndarray = np.empty((0, 2))
        self._suspects: list[_Suspect] = []
        self.n_forgotten = 0

    def __len__(self) -> int:
        """Throws that count."""
        return len(self._places)

    @property
    def throws(self) -> np.ndarray:
        """What is remembered (n, 4): distance [m], azimuth [rad], miss along and across [m]."""
        return np.hstack([self._places, self._misses])

    def remember(self, throws: np.ndarray) -> None:
        """Take up (n, 4) what another correction remembered, as `throws` gave it."""
        throws = np.asarray(throws, dtype=float)
        if throws.ndim != 2 or throws.shape[1] != 4 or not np.isfinite(throws).all():
            raise ValueError(f"throws of a correction must be a finite (n, 4) array, got shape {throws.shape}")
        if len(throws):
            self._remember(list(throws[:, :2]), list(throws[:, 2:]))

    def add(self, place: np.ndarray, miss: np.ndarray) -> None:
        """Remember a miss (2,) at a place (2,). A surprise waits: for one like it at another place, then the arm has changed, or for a
        throw that is none, then it was an accident, or the fault of its place.
        """
        place, miss = (np.asarray(part, dtype=float) for part in (place, miss))
        if place.shape != (2,) or miss.shape != (2,) or not np.isfinite([place, miss]).all():
            raise ValueError(f"place {place} and miss {miss} must be two finite numbers each: was the landing seen?")
        surprise = self._surprise(place, miss)
        if surprise is None:
            self._suspects = []
            self._remember([place], [miss])
            return
        alike = [one for one in self._suspects if np.dot(one.surprise, surprise) > 0]
        self._suspects.append(_Suspect(place, miss, surprise))
        if any(np.linalg.norm((one.place - place) / self.settings.apart) > 1.0 for one in alike):
            self.n_forgotten, self._places, self._misses = self.n_forgotten + 1, np.empty((0, 2)), np.empty((0, 2))
            self._remember([*(one.place for one in alike), place], [*(one.miss for one in alike), miss])
            self._suspects = []

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (n, 2) of the repeatable miss at places (n, 2)."""
        places = np.asarray(places, dtype=float).reshape(-1, 2)
        if not len(self._places):
            return np.zeros_like(places), np.full_like(places, self.settings.offset)
        columns = [self._predict(places, axis) for axis in range(2)]
        mean, deviation = (np.stack(part, axis=1) for part in zip(*columns, strict=True))
        return mean, deviation

    def shifted(self, target: np.ndarray) -> np.ndarray:
        """The point (3,) to plan for so that the ball comes down on the target (3,)."""
        target = np.asarray(target, dtype=float)
        point = target.copy()
        for _ in range(3):
            mean = self.predict(self._surface.coordinates(point))[0][0]
            move = self._surface.offset(mean, point)
            move *= min(1.0, self.settings.farthest / max(float(np.linalg.norm(move)), 1e-12))
            point = target - move
        return point

    def _remember(self, places: list, misses: list) -> None:
        last = self.settings.memory
        self._places, self._misses = np.vstack([self._places, *places])[-last:], np.vstack([self._misses, *misses])[-last:]
        self._fits = self._fit_all()

    def _surprise(self, place: np.ndarray, miss: np.ndarray) -> np.ndarray | None:
        """The innovation (2,) in standard deviations if it is too large to be chance."""
        if len(self._places) < 2:
            return None
        mean, deviation = (part[0] for part in self.predict(place))
        seen = np.square([fit.noise for fit in self._fits]) * len(self._places)
        noise = np.sqrt((WARY_WEIGHT * WARY**2 + seen) / (WARY_WEIGHT + len(self._places)))
        innovation = (miss - mean) / np.hypot(deviation, noise)
        return innovation if np.abs(innovation).max() > self.settings.surprise else None

    def _kernel(self, first: np.ndarray, second: np.ndarray, scale: tuple[float, float]) -> np.ndarray:
        apart = (first[:, None] - second) / scale
        return np.exp(-0.5 * np.einsum("ijk,ijk->ij", apart, apart))

    def _fit_all(self) -> list[_Fit]:
        """For either axis the process with the most probable scale, noise and difference (evidence times prior)."""
        scales = product(self.settings.lengths, self.settings.turns)
        kernels = [(scale, *np.linalg.eigh(self._kernel(self._places, self._places, scale))) for scale in scales]
        fits = [[self._fit(values, *kernel) for kernel in kernels] for values in self._misses.T]
        return [max(candidates, key=lambda fit: fit.evidence) for candidates in fits]

    def _fit(self, values: np.ndarray, scale: tuple[float, float], power: np.ndarray, modes: np.ndarray) -> _Fit:
        """The same for one axis and scale, from the eigenvalues (n,) and eigenvectors (n, n) of its kernel.

        In them the covariance is diagonal but for the common offset, which is of rank one (Sherman and Morrison).
        """
        noise, difference = (part.ravel() for part in np.meshgrid(NOISES, DIFFERENCES, indexing="ij"))
        variances = difference[:, None] ** 2 * np.maximum(power, 0.0) + noise[:, None] ** 2
        common, seen = modes.sum(axis=0), values @ modes
        share = 1.0 / (self.settings.offset**-2 + (common**2 / variances).sum(axis=1))
        offset = share * (common * seen / variances).sum(axis=1)
        log_determinant = np.log(variances).sum(axis=1) - np.log(share)
        evidence = -0.5 * ((seen**2 / variances).sum(axis=1) - offset**2 / share + log_determinant)
        evidence -= UNUSUAL * (np.log2(noise / USUAL_NOISE) ** 2 + np.log2(difference / USUAL_DIFFERENCE) ** 2)
        k = int(evidence.argmax())
        towards = modes @ (common / variances[k])
        inverse = (modes / variances[k]) @ modes.T - share[k] * np.outer(towards, towards)
        weights = modes @ ((seen - common * offset[k]) / variances[k])
        return _Fit(float(noise[k]), float(difference[k]), scale, float(evidence[k]), inverse, weights)

    def _predict(self, places: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
        _, difference, scale, _, inverse, weights = self._fits[axis]
        common = self.settings.offset**2
        kernel = common + difference**2 * self._kernel(places, self._places, scale)
        left = common + difference**2 - np.einsum("ij,jk,ik->i", kernel, inverse, kernel)
        return kernel @ weights, np.sqrt(np.maximum(left, 0.0))


def polar(point: np.ndarray) -> np.ndarray:
    """Distance from the base axis [m] and azimuth [rad] of a point (3,)."""
    return np.array([np.hypot(point[0], point[1]), np.arctan2(point[1], point[0])])


def corrected(plan: ThrowPlan, target: np.ndarray) -> ThrowPlan:
    """A plan that was made for a shifted point, as a plan for the target (3,)."""
    return replace(plan, target=np.asarray(target, dtype=float), predicted_landing=plan.predicted_landing + (target - plan.target))


def repeatable_miss(plan: ThrowPlan, seen: np.ndarray, late: float, game: Game = BASKETS) -> tuple[np.ndarray, np.ndarray]:
    """Place (2,) that the plan's own path would send a ball to, and how far the ball that was released `late` [s] came down (3,) from where
    the path would have sent it then: along, across [m] or, on a board, up, left. A release nobody saw, nan, counts as one on time.
    """
    meant = landing_if_late(plan, 0.0, game)
    expected = landing_if_late(plan, late, game) if np.isfinite(late) else meant
    return game.surface.coordinates(meant), game.surface.miss(seen - expected, meant)
