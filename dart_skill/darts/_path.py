"""The best aim as a function of sigma (thesis figure 6.6): pieces on which it moves continuously,
and jumps between them.

At a jump two local optima are equally good. The best aims of two neighbouring sigmas may be two
different optima. Then both are followed towards each other, and root finding gives the sigma at
which they are equal, to 1e-6 mm. If a third optimum is better there, there are two jumps, and each
is found in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dart_skill.darts._optimum import Aim, best_aim, climb
from dart_skill.darts._spread import Spread, as_spread

RATIO = 1.03
"""Largest ratio of two neighbouring sigmas for which the best aim is computed from the beginning.
"""
SIGMA_TOLERANCE = 1e-6
TIE = 1e-7


@dataclass(frozen=True, eq=False)
class Jump:
    """A jump of the best aim: below this sigma and above it, two distant aims score the same.

    * sigma: where the best aim jumps [mm].
    * below: the best aim for a slightly smaller sigma.
    * above: the best aim for a slightly larger one.
    """

    sigma: float
    below: Aim
    above: Aim


@dataclass(frozen=True, eq=False)
class OptimumPath:
    """The best aim over sigma, made by `optimum_path`.

    * sigmas (n,) [mm]: ascending; at a jump sigma occurs twice, with the aims before and after it.
    * aims (n, 2) [mm], expected_scores (n,).
    * jumps: in ascending order of sigma.
    """

    sigmas: np.ndarray
    aims: np.ndarray
    expected_scores: np.ndarray
    jumps: tuple[Jump, ...]

    @property
    def pieces(self) -> list[slice]:
        """Slices of the arrays, one for each piece between two jumps."""
        ends = np.flatnonzero(np.diff(self.sigmas) == 0.0) + 1
        return [
            slice(int(a), int(b))
            for a, b in zip([0, *ends], [*ends, len(self.sigmas)], strict=True)
        ]


def optimum_path(
    lowest: float, highest: float, shape: Spread | ArrayLike | None = None
) -> OptimumPath:
    """The best aim for sigmas from lowest to highest [mm].

    shape: a spread or covariance that gives the shape and the bias; isotropic without bias by
    default. ValueError unless lowest is below highest.
    """
    shape = Spread(np.eye(2)) if shape is None else as_spread(shape)
    low, high = shape.scaled_to(lowest), shape.scaled_to(highest)
    if not low.sigma < high.sigma:
        raise ValueError(
            f"the lowest sigma must be below the highest, got {lowest:g} and {highest:g} mm"
        )
    sigmas = np.geomspace(
        low.sigma, high.sigma, 2 + int(np.log(high.sigma / low.sigma) / np.log(RATIO))
    )
    rows = [(sigmas[0], best_aim(low))]
    jumps: list[Jump] = []
    for sigma in sigmas[1:]:
        aim = best_aim(shape.scaled_to(sigma))
        found = _jumps_between(*rows[-1], sigma, aim, shape)
        for jump in found:
            rows += [(jump.sigma, jump.below), (jump.sigma, jump.above)]
        jumps += found
        rows.append((sigma, aim))
    points = np.array([aim.point for _, aim in rows])
    return OptimumPath(
        np.array([s for s, _ in rows]),
        points,
        np.array([aim.expected_score for _, aim in rows]),
        tuple(jumps),
    )


def _jumps_between(low: float, below: Aim, high: float, above: Aim, shape: Spread) -> list[Jump]:
    """Jumps of the best aim between two sigmas with their best aims, in ascending order."""
    followed = _follow(below.point, low, high, shape)
    if followed is not None and above.expected_score - followed.expected_score < TIE:
        return []
    sigma = _tie(low, below, high, above, shape)
    if sigma is None:
        return _halves(low, below, high, above, shape)
    left, right = _follow(below.point, low, sigma, shape), _follow(above.point, high, sigma, shape)
    assert left is not None and right is not None  # or there would be no tie
    best = best_aim(shape.scaled_to(sigma))
    if best.expected_score - max(left.expected_score, right.expected_score) > TIE:
        return _jumps_between(low, below, sigma, best, shape) + _jumps_between(
            sigma, best, high, above, shape
        )
    return [Jump(sigma, left, right)]


def _halves(low: float, below: Aim, high: float, above: Aim, shape: Spread) -> list[Jump]:
    """Jumps if an optimum ends between the two sigmas: the interval is halved."""
    if high - low < SIGMA_TOLERANCE:
        return [Jump(0.5 * (low + high), below, above)]
    middle = 0.5 * (low + high)
    best = best_aim(shape.scaled_to(middle))
    return _jumps_between(low, below, middle, best, shape) + _jumps_between(
        middle, best, high, above, shape
    )


def _tie(low: float, below: Aim, high: float, above: Aim, shape: Spread) -> float | None:
    """Sigma at which the optimum from `below` and the optimum from `above`, both followed along
    sigma, score the same.

    None if one of them ends before.
    """
    if (
        _follow(below.point, low, high, shape) is None
        or _follow(above.point, high, low, shape) is None
    ):
        return None

    def advantage(sigma: float) -> float:
        from_below, from_above = (
            _follow(below.point, low, sigma, shape),
            _follow(above.point, high, sigma, shape),
        )
        assert (
            from_below is not None and from_above is not None
        )  # neither ends between the two sigmas
        return from_below.expected_score - from_above.expected_score

    if advantage(low) < 0.0 or advantage(high) > 0.0:
        return None
    return float(scipy.optimize.brentq(advantage, low, high, xtol=0.1 * SIGMA_TOLERANCE))


def _follow(
    point: np.ndarray, start: float, end: float, shape: Spread, n_steps: int = 4
) -> Aim | None:
    """The local optimum at sigma = `start`, followed along sigma to `end`; None if it ends on the
    way.
    """
    aim = Aim(point, float("nan"))
    for sigma in np.linspace(start, end, n_steps + 1)[1:]:
        spread = shape.scaled_to(sigma)
        nearest = climb(aim.point, spread)
        step = float(np.hypot(*(nearest.point - aim.point)))
        # An optimum moves little from step to step; a long step means that it has ended and the
        # climb went to another one.
        if step > 0.5 * spread.deviations[0]:
            return None
        aim = nearest
    return aim
