"""What a thrower gets wrong in the same way again and again, learned from where the balls came
down, and taken out of the next plan.

A miss has three parts. One repeats and belongs to the place: friction, the load, a base that was
turned. A Gaussian process over the places describes it: a common offset and a smooth difference
from place to place (C. Rasmussen and C. Williams, Gaussian Processes for Machine Learning, 2006,
chapter 2). One is known once it has happened: the hand opened early or late, and by its plan the
ball left the path elsewhere. One is scatter, of which nothing can be learned.

How large each part is, the throws themselves tell. Nothing is decided: predictions are averaged
over all that noise, difference, scale and the share of a late release may be, each weighed by its
evidence (J. Hoeting et al., Bayesian model averaging, Statistical Science 14, 1999). A choice of
the most probable values takes scatter for a difference between places while throws are few.

After something has changed, what was learned before is of no use: two surprises in a row in the
same direction, at different places, forget it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.surface import BASKETS, RIMS, Game, Surface
from dart_skill.common.vectors import at_most
from dart_skill.skills.learning import landing_if_late

USUAL_SCATTER = 0.01
"""Standard deviation [m] about which those of scatter and of the difference from place to place
are expected.
"""
NOISES = 0.0005 * 2.0 ** np.arange(9)
"""Standard deviations of scatter over which predictions are averaged [m]: from a steady machine to a
hand that scatters by 13 cm.
"""
DIFFERENCES = USUAL_SCATTER * 2.0 ** np.arange(-2, 4)
"""Standard deviations of the difference between places over which predictions are averaged [m]."""
UNUSUAL_NOISE = 0.1
"""Log probability that a factor of two from the usual scatter costs, squared for more: arms scatter
by millimetres or by decimetres.
"""
UNUSUAL_DIFFERENCE = 1.0
"""Log probability that a factor of two from the usual difference between places costs, squared for
more.
"""
SHARES = np.array([0.0, 0.5, 1.0])
"""Shares of what a late release is computed to do: 0 where its instant was seen so badly that it
explains nothing.
"""


@dataclass(frozen=True)
class CorrectionSettings:
    """How misses are learned from.

    Parameters
    ----------
    offsets
        Standard deviations that what all places have in common may have, before the first throw
        [m]; the evidence weighs them.
    lengths
        Distances over which misses resemble each other; the evidence weighs them [m].
    turns
        Azimuths over which they do [rad]. An arm that turns about its base may make the same throw
        all around.
    surprise
        A miss is a surprise from so many standard deviations on.
    apart
        Two surprises nearer to each other than this, in distance [m] and azimuth [rad], may be the
        fault of the place.
    farthest
        A plan is moved no farther than this from its target [m].
    memory
        Throws at most, the latest.
    """

    offsets: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3)
    lengths: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4, 0.8)
    turns: tuple[float, ...] = (0.7, 3.0)
    surprise: float = 4.0
    apart: tuple[float, float] = (0.25, 0.35)
    farthest: float = 0.5
    memory: int = 200

    def __post_init__(self) -> None:
        choices, others = (
            (self.offsets, self.lengths, self.turns),
            (self.surprise, *self.apart, self.farthest, self.memory),
        )
        values = np.array(
            [value for choice in (*choices, others) for value in choice], dtype=float
        )
        if not (all(choices) and np.isfinite(values).all() and (values > 0).all()):
            raise ValueError(
                f"correction: {self} must hold finite positive numbers only, and at least one"
                " offset, one length and one turn"
            )


NOTHING = np.zeros(2)


class _Modes(NamedTuple):
    """The misses as modes of the kernel between the throws, on every scale (s): but for the offset
    they are independent there.

    * axes: (s, n, n) eigenvectors of the kernel.
    * common: (s, n), what each mode has of an offset that all places share.
    * precision: (s, k, n), inverse variance under each hypothesis [1/m^2].
    * doubt: (s, k), variance of the offset after the throws [m^2].
    """

    axes: np.ndarray
    common: np.ndarray
    precision: np.ndarray
    doubt: np.ndarray


class _Grid(NamedTuple):
    """Hypotheses (k,): standard deviations [m] of noise, difference and offset, and the log of
    their prior.
    """

    noise: np.ndarray
    difference: np.ndarray
    offset: np.ndarray
    prior: np.ndarray

    @classmethod
    def over(cls, offsets: tuple[float, ...]) -> _Grid:
        noise, difference, offset = np.array(list(product(NOISES, DIFFERENCES, offsets))).T
        prior = (
            -UNUSUAL_NOISE * np.log2(noise / USUAL_SCATTER) ** 2
            - UNUSUAL_DIFFERENCE * np.log2(difference / USUAL_SCATTER) ** 2
        )
        return cls(noise, difference, offset, prior)


class _Posterior(NamedTuple):
    """What the throws say, by share (b), axis (2), scale (s), and hypothesis (k) of noise,
    difference and offset.

    * modes: those of the throws.
    * probability: (b, 2, s, k), sums to one on each axis.
    * offset: (b, 2, s, k) mean of what all places have in common [m].
    * seen: (b, 2, s, n) misses in the modes [m].
    * towards: (2, s, n) weights of the kernel in the averaged mean.
    * noise: (2,) root mean square of what does not repeat [m].
    """

    modes: _Modes
    probability: np.ndarray
    offset: np.ndarray
    seen: np.ndarray
    towards: np.ndarray
    noise: np.ndarray

    @property
    def common(self) -> np.ndarray:
        """Averaged offset (2,) [m]."""
        return np.einsum("bask,bask->a", self.probability, self.offset)

    @property
    def share(self) -> float:
        """Expected share of what a late release is computed to do."""
        return float(np.einsum("bsk,b->", self.probability[:, 0], SHARES))


class _Suspect(NamedTuple):
    """A miss that surprised: place (2,), miss (2,), what of it a late release explains (2,), and
    by how many standard deviations (2,).
    """

    place: np.ndarray
    miss: np.ndarray
    explained: np.ndarray
    surprise: np.ndarray


class Correction:
    """Misses (along, across) [m] as a function of the place (distance [m], azimuth [rad]) that a
    plan is meant for; on a board: misses (up, left), and the height for the distance.
    """

    _posterior: _Posterior

    def __init__(self, settings: CorrectionSettings | None = None, surface: Surface = RIMS):
        self.settings, self._surface = settings or CorrectionSettings(), surface
        self._grid = _Grid.over(self.settings.offsets)
        self._scales = np.array(list(product(self.settings.lengths, self.settings.turns)))
        self._places: np.ndarray = np.empty((0, 2))
        self._misses: np.ndarray = np.empty((0, 2))
        self._explained: np.ndarray = np.empty((0, 2))
        self._suspects: list[_Suspect] = []
        self.n_forgotten = 0

    def __len__(self) -> int:
        """Throws that count."""
        return len(self._places)

    @property
    def throws(self) -> np.ndarray:
        """What is remembered (n, 6): distance [m], azimuth [rad], miss along and across [m], and
        what of it a late release explains [m].
        """
        return np.hstack([self._places, self._misses, self._explained])

    @property
    def share(self) -> float:
        """How much of what a late release is computed to do the throws confirm, from 0 to 1; 1
        before the first throw.
        """
        return self._posterior.share if len(self) else 1.0

    @property
    def noise(self) -> np.ndarray:
        """Standard deviation (2,) [m] of what does not repeat, along and across; nan before the
        first throw.
        """
        return self._posterior.noise if len(self) else np.full(2, np.nan)

    def remember(self, throws: np.ndarray) -> None:
        """Take up what another correction remembered: (n, 6), as `throws` gave it.

        Raises
        ------
        ValueError
            For another shape, or what is not finite.
        """
        throws = as_throws(throws)
        if len(throws):
            self._remember(list(throws[:, :2]), list(throws[:, 2:4]), list(throws[:, 4:]))

    def suspicions(self) -> list:
        """Misses that surprised and wait for another like them, for JSON."""
        return [[part.tolist() for part in one] for one in self._suspects]

    def suspect(self, suspicions: list) -> None:
        """Wait as another correction did.

        Parameters
        ----------
        suspicions
            As it gave them.
        """
        self._suspects = [
            _Suspect(*(np.array(part, dtype=float).reshape(2) for part in one))
            for one in suspicions
        ]

    def add(self, place: np.ndarray, miss: np.ndarray, explained: np.ndarray = NOTHING) -> None:
        """Remember a miss (2,) [m] at a place (2,).

        A surprise waits: for one like it at another place, then the arm has changed, or for a
        throw that is none, then it was an accident, or the fault of its place.

        Parameters
        ----------
        explained
            (2,) [m], default nothing. What of the miss is due to this throw's release by its plan,
            against the usual release.

        Raises
        ------
        ValueError
            For what is not two finite numbers each.
        """
        place, miss, explained = (
            np.asarray(part, dtype=float) for part in (place, miss, explained)
        )
        if not all(
            part.shape == (2,) and np.isfinite(part).all() for part in (place, miss, explained)
        ):
            raise ValueError(
                f"place {place}, miss {miss}, explained {explained} must be two finite numbers"
                " each: was the landing seen?"
            )
        surprise = self._surprise(place, miss, explained)
        if surprise is None:
            self._suspects = []
            self._remember([place], [miss], [explained])
            return
        alike = [one for one in self._suspects if np.dot(one.surprise, surprise) > 0]
        self._suspects.append(_Suspect(place, miss, explained, surprise))
        if any(np.linalg.norm((one.place - place) / self.settings.apart) > 1.0 for one in alike):
            self.n_forgotten += 1
            self._places = self._misses = self._explained = np.empty((0, 2))
            changed = [*alike, self._suspects[-1]]
            self._remember(
                [one.place for one in changed],
                [one.miss for one in changed],
                [one.explained for one in changed],
            )
            self._suspects = []

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (n, 2) of the repeatable miss at places (n, 2)."""
        places = np.asarray(places, dtype=float).reshape(-1, 2)
        if not len(self._places):
            return np.zeros_like(places), np.full_like(
                places, np.sqrt(np.mean(np.square(self.settings.offsets)))
            )
        kernel = self._kernel(places, self._places)
        mean = self._mean(kernel)
        return mean, self._deviation(kernel, mean)

    def shifted(self, target: np.ndarray) -> np.ndarray:
        """The point (3,) to plan for so that the ball comes down on the target (3,)."""
        target = np.asarray(target, dtype=float)
        point = target.copy()
        for _ in range(3 if len(self) else 0):
            mean = self._mean(self._kernel(self._surface.coordinates(point)[None], self._places))[
                0
            ]
            move = at_most(self._surface.offset(mean, point), self.settings.farthest)
            point = target - move
        return point

    def _remember(self, places: list, misses: list, explained: list) -> None:
        last = self.settings.memory
        self._places, self._misses = (
            np.vstack([self._places, *places])[-last:],
            np.vstack([self._misses, *misses])[-last:],
        )
        self._explained = np.vstack([self._explained, *explained])[-last:]
        self._posterior = self._infer()

    def _surprise(
        self, place: np.ndarray, miss: np.ndarray, explained: np.ndarray
    ) -> np.ndarray | None:
        """The innovation (2,) in standard deviations if it is too large to be chance."""
        if len(self._places) < 2:
            return None
        mean, deviation = (part[0] for part in self.predict(place))
        innovation = (miss - self.share * explained - mean) / np.hypot(
            deviation, self._posterior.noise
        )
        return innovation if np.abs(innovation).max() > self.settings.surprise else None

    def _kernel(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """How much places (m, 2) resemble places (n, 2), on every scale (s, m, n)."""
        squares = np.square(first[:, None] - second)
        return np.exp(-0.5 * np.einsum("mnj,sj->smn", squares, self._scales**-2.0))

    def _mean(self, kernel: np.ndarray) -> np.ndarray:
        """Averaged mean (m, 2) [m] at places that resemble those of the throws as a kernel (s, m,
        n) says.
        """
        return self._posterior.common + np.einsum("smn,asn->ma", kernel, self._posterior.towards)

    def _modes(self) -> _Modes:
        """The offset adds a matrix of rank one to the diagonal covariance of the modes (Sherman
        and Morrison).
        """
        grid = self._grid
        power, axes = np.linalg.eigh(self._kernel(self._places, self._places))
        common = axes.sum(axis=1)
        precision = 1.0 / (
            grid.difference[:, None] ** 2 * np.maximum(power, 0.0)[:, None]
            + grid.noise[:, None] ** 2
        )
        return _Modes(
            axes,
            common,
            precision,
            1.0 / (grid.offset**-2 + np.einsum("sn,skn->sk", common**2, precision)),
        )

    def _infer(self) -> _Posterior:
        """What the throws say of noise, difference, offset, scale and share."""
        grid, modes = self._grid, self._modes()
        axes, common, precision, doubt = modes
        seen = np.einsum(
            "bna,snj->basj", self._misses - SHARES[:, None, None] * self._explained, axes
        )
        offset = doubt * np.einsum("sn,skn,basn->bask", common, precision, seen, optimize=True)
        determinant = -np.log(precision).sum(axis=-1) - np.log(doubt / grid.offset**2)
        evidence = grid.prior - 0.5 * (
            np.einsum("basn,skn->bask", seen**2, precision, optimize=True)
            - offset**2 / doubt
            + determinant
        )
        probability = _normalised(evidence)
        pull = np.einsum(
            "bask,skn,k->basn", probability, precision, grid.difference**2, optimize=True
        )
        drawn = np.einsum(
            "bask,skn,k->asn", probability * offset, precision, grid.difference**2, optimize=True
        )
        towards = np.einsum("snj,asj->asn", axes, (pull * seen).sum(axis=0) - drawn * common)
        noise = np.sqrt(np.einsum("bask,k->a", probability, grid.noise**2))
        return _Posterior(modes, probability, offset, seen, towards, noise)

    def _deviation(self, kernel: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """Standard deviation (m, 2) about the averaged mean (m, 2): of each process, and between
        their means (law of total variance).
        """
        axes, common, precision, doubt = self._posterior.modes
        probability, offset, seen = (
            self._posterior.probability,
            self._posterior.offset,
            self._posterior.seen,
        )
        usual, difference = self._grid.offset**2, self._grid.difference**2
        alike = np.einsum("smn,snj->smj", kernel, axes)
        # (s, k, m, n)
        towards = (
            difference[:, None, None] * alike[:, None]
            + usual[:, None, None] * common[:, None, None]
        )
        told = np.einsum("skmn,skn->skm", towards**2, precision)
        told -= (
            doubt[..., None]
            * np.einsum("skmn,skn,sn->skm", towards, precision, common, optimize=True) ** 2
        )
        left = np.maximum((usual + difference)[:, None] - told, 0.0)
        smooth = np.einsum("smn,skn,basn->baskm", alike, precision, seen, optimize=True)
        smooth -= (
            np.einsum("smn,skn,sn->skm", alike, precision, common, optimize=True)
            * offset[..., None]
        )
        means = offset[..., None] + difference[:, None] * smooth
        square = np.einsum("bask,baskm->ma", probability, left + means**2, optimize=True)
        return np.sqrt(np.maximum(square - mean**2, 0.0))


def as_throws(throws: np.ndarray) -> np.ndarray:
    """What a correction remembered, as an array (n, 6); ValueError for another shape, or for what
    is not finite.
    """
    throws = np.asarray(throws, dtype=float)
    if throws.ndim != 2 or throws.shape[1] != 6 or not np.isfinite(throws).all():
        raise ValueError(
            f"throws of a correction must be a finite (n, 6) array, got shape {throws.shape}"
        )
    return throws


def _normalised(evidence: np.ndarray) -> np.ndarray:
    """Probability (b, 2, s, k) from log evidence: the share is the same on both axes, all else is
    of each axis by itself.
    """
    highest = evidence.max(axis=(2, 3), keepdims=True)
    weights = np.exp(evidence - highest)
    total = weights.sum(axis=(2, 3), keepdims=True)
    of_share = (highest + np.log(total)).sum(axis=1, keepdims=True)
    share = np.exp(of_share - of_share.max())
    return weights / total * (share / share.sum())


def polar(point: np.ndarray) -> np.ndarray:
    """Distance from the base axis [m] and azimuth [rad] of a point (3,)."""
    return np.array([np.hypot(point[0], point[1]), np.arctan2(point[1], point[0])])


def corrected(plan: MotionPlan, target: np.ndarray) -> MotionPlan:
    """A plan that was made for a shifted point, as a plan for the target (3,)."""
    target, meant = np.asarray(target, dtype=float), plan.thrown
    landing = meant.landing + (target - meant.target)
    return replace(plan, throw=replace(meant, target=target, landing=landing))


def repeatable_miss(
    plan: MotionPlan, seen: np.ndarray, late: float, game: Game = BASKETS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place (2,) that the plan's own path would send a ball to, how far from it the ball came down
    that was seen (3,), and how far from it the path would have sent a ball that is released `late`
    [s]: along, across [m] or, on a board, up, left. A release that was not seen, nan, counts as one on
    time.
    """
    meant = landing_if_late(plan, 0.0, game)
    expected = landing_if_late(plan, late, game) if np.isfinite(late) else meant
    return (
        game.surface.coordinates(meant),
        game.surface.miss(seen - meant, meant),
        game.surface.miss(expected - meant, meant),
    )
