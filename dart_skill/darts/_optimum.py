"""Where to aim one dart: the best aim and all local optima of the expected score.

Candidates are the local maxima of the heat map. For narrow spreads the maxima are plateaus, so the
middles of trebles, doubles and bull are candidates, too. From each candidate a climb on the exact
expected score makes Newton steps within a trust region, with the signs of the eigenvalues turned
such that the steps go uphill. The result is exact to much better than 0.1 mm, unless the optimum
is so flat that round-off decides.

`optimum_path` is the best aim as a function of sigma (thesis figure 6.6): pieces on which it moves
continuously, and jumps between them. At a jump two local optima are equally good. The best aims of
two neighbouring sigmas may be two different optima. Then both are followed towards each other, and
root finding gives the sigma at which they are equal, to 1e-6 mm. If a third optimum is better
there, there are two jumps, and each is found in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dart_skill.darts._board import RADII, bed_centres, place_of
from dart_skill.darts._exact import Derivatives, expected_score, score_derivatives
from dart_skill.darts._heat_map import HeatMap, heat_map
from dart_skill.darts._spread import Spread, as_spread

PLATEAU = 4.5
"""Up to this standard deviation [mm] the expected score has plateaus, and each optimum is in a
treble, a double or the bull.
"""
BED_SEEDS = 6.0
"""Up to this standard deviation [mm] along the narrower axis the middles of the beds are
candidates, too.
"""
SPACING = 2.0
OFF_BOARD = 1e-3
N_STEPS = 200
STEP_TOLERANCE = 1e-7
"""Length of a step below which a climb ends [mm]."""
GAIN_TOLERANCE = 1e-13
"""Expected gain of a step below which a climb ends [points]."""
SAME = 0.02
"""If two climbs end nearer to each other than this [mm], they found the same optimum."""
DIP = 1e-7
"""Points by which the expected score must fall between two optima for both to count."""


@dataclass(frozen=True, eq=False)
class Aim:
    """A point to aim at, (2,) [mm], and the expected score of one dart there."""

    point: np.ndarray
    expected_score: float

    @property
    def bed(self) -> str:
        """Name of the bed at the point, such as T20, or "outside D1" off the board."""
        return place_of(self.point)


def best_aim(spread: Spread | float | ArrayLike) -> Aim:
    """The aim with the highest expected score of one dart.

    Parameters
    ----------
    spread
        A Spread, a sigma [mm] or a covariance (2, 2) [mm^2].
    """
    spread = as_spread(spread)
    seeds = _seeds(spread)
    return _climb_all(seeds[_promising(seeds, spread)], spread)[0]


def local_optima(spread: Spread | float | ArrayLike) -> list[Aim]:
    """All local maxima of the expected score of one dart, the best first, which is `best_aim`.

    Parameters
    ----------
    spread
        As there.
    """
    spread = as_spread(spread)
    return _separate(_climb_all(_seeds(spread), spread), spread)


def climb(point: ArrayLike, spread: Spread) -> Aim:
    """The local optimum that a climb from a point (2,) [mm] reaches."""
    return _climb_all(np.asarray(point, dtype=float)[None], spread)[0]


def _seeds(spread: Spread) -> np.ndarray:
    """Starting points (n, 2) [mm] of climbs, at least one for each local optimum."""
    narrowest, widest = spread.deviations
    high_beds = np.r_[0, 22:42, 62:82]
    seeds = [bed_centres()[high_beds] - spread.bias] if narrowest < BED_SEEDS else []
    if widest > PLATEAU:
        reach = RADII[-1] + np.abs(spread.bias).max() + SPACING
        seeds.append(_maxima(heat_map(spread, min(SPACING, 0.25 * narrowest), reach)))
    return np.concatenate(seeds)


def _maxima(heat: HeatMap) -> np.ndarray:
    """Nodes (n, 2) that are at least as high as all of their eight neighbours."""
    values = np.pad(heat.expected_score, 1, constant_values=-np.inf)
    n_rows, n_columns = heat.expected_score.shape
    # Far off the board the values are only round-off.
    highest = heat.expected_score > OFF_BOARD * heat.expected_score.max()
    for down, right in ((0, 0), (0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1), (2, 2)):
        highest &= heat.expected_score >= values[down : down + n_rows, right : right + n_columns]
    rows, columns = np.nonzero(highest)
    return np.column_stack([heat.x[columns], heat.y[rows]])


def _promising(seeds: np.ndarray, spread: Spread) -> np.ndarray:
    """Mask (n,) of the seeds that can lead to the global optimum: a climb over the distance of two
    seeds can gain only so much.
    """
    values = expected_score(seeds, spread)
    gain = 60.0 * (SPACING / spread.deviations[0]) ** 2
    return values >= values.max() - min(gain, 0.5 * values.max())


def _climb_all(seeds: np.ndarray, spread: Spread) -> list[Aim]:
    """Ends of the climbs from seeds (n, 2), the best first, each only once."""
    points, values = _newton(seeds, spread)
    order = np.argsort(-values, kind="stable")
    ends: list[Aim] = []
    for point, value in zip(points[order], values[order], strict=True):
        if all(np.hypot(*(point - end.point)) > SAME for end in ends):
            ends.append(Aim(point, float(value)))
    return ends


def _newton(points: np.ndarray, spread: Spread) -> tuple[np.ndarray, np.ndarray]:
    """Ends (n, 2) and expected scores (n,) of climbs from points (n, 2), all at once.

    After a step that does not climb, the trust radius becomes a quarter of that step.
    """
    points = points.copy()
    trust = np.full(len(points), 0.5 * spread.deviations[0])
    state = score_derivatives(points, spread)
    active = np.arange(len(points))
    for _ in range(N_STEPS):
        local = Derivatives(*(part[active] for part in state))
        step = _uphill(local, trust[active])
        length = np.hypot(*step.T)
        moving = (length > STEP_TOLERANCE) & (
            np.einsum("nd,nd->n", local.gradient, step) > GAIN_TOLERANCE
        )
        active, step, length = active[moving], step[moving], length[moving]
        if len(active) == 0:
            break
        trial = score_derivatives(points[active] + step, spread)
        climbs = trial.value >= state.value[active] - 1e-13
        accepted = active[climbs]
        points[accepted] += step[climbs]
        for part, new in zip(state, trial, strict=True):
            part[accepted] = new[climbs]
        trust[active] = np.where(
            climbs,
            np.maximum(trust[active], np.minimum(2.0 * length, spread.deviations[0])),
            0.25 * length,
        )
    return points, state.value


def _uphill(local: Derivatives, trust: np.ndarray) -> np.ndarray:
    """Newton steps (n, 2) towards a maximum, at most as long as the trust radius (n,)."""
    curvature, axes = np.linalg.eigh(local.hessian)
    slope = np.einsum("nij,ni->nj", axes, local.gradient)
    step = np.einsum("nij,nj->ni", axes, slope / np.maximum(np.abs(curvature), 1e-14))
    length = np.maximum(np.hypot(*step.T), 1e-300)
    return step * np.minimum(1.0, trust / length)[:, None]


def _separate(ends: list[Aim], spread: Spread) -> list[Aim]:
    """The ends that are optima: one on a plateau or slope is left out if a path leads to a better
    one without descending.
    """
    curvatures = np.linalg.eigvalsh(
        score_derivatives(np.array([end.point for end in ends]), spread).hessian
    )
    kept: list[Aim] = []
    for end, curvature in zip(ends, curvatures, strict=True):
        sharp = curvature[1] < -1e-7
        if sharp or not any(_connected(end, better, spread) for better in _nearest(end, kept)):
            kept.append(end)
    return kept


def _nearest(end: Aim, others: list[Aim], n: int = 4) -> list[Aim]:
    return sorted(others, key=lambda other: float(np.hypot(*(other.point - end.point))))[:n]


def _connected(lower: Aim, higher: Aim, spread: Spread) -> bool:
    """Whether a straight path, or one around the bull, leads from the lower to the higher end
    without descending.
    """
    share = np.linspace(0.0, 1.0, 65)[:, None]
    straight = lower.point + share * (higher.point - lower.point)
    ends = np.array([lower.point, higher.point]) + spread.bias
    radius, angle = np.hypot(*ends.T), np.unwrap(np.arctan2(ends[:, 1], ends[:, 0]))
    turned = angle[0] + share * (angle[1] - angle[0])
    round_bull = (radius[0] + share * (radius[1] - radius[0])) * np.hstack(
        [np.cos(turned), np.sin(turned)]
    ) - spread.bias
    lows = expected_score(np.stack([straight, round_bull]), spread).min(axis=1)
    return bool(lows.max() >= lower.expected_score - DIP)


RATIO = 1.03
"""Largest ratio of two neighbouring sigmas for which the best aim is computed from the beginning.
"""
SIGMA_TOLERANCE = 1e-6
TIE = 1e-7


@dataclass(frozen=True, eq=False)
class Jump:
    """A jump of the best aim: below this sigma and above it, two distant aims score the same.

    Parameters
    ----------
    sigma
        Where the best aim jumps [mm].
    below
        The best aim for a slightly smaller sigma.
    above
        The best aim for a slightly larger one.
    """

    sigma: float
    below: Aim
    above: Aim


@dataclass(frozen=True, eq=False)
class OptimumPath:
    """The best aim over sigma, made by `optimum_path`.

    Parameters
    ----------
    sigmas : (n,) [mm]
        Ascending; at a jump sigma occurs twice, with the aims before and after it.
    aims : (n, 2) [mm]
    expected_scores : (n,)
    jumps
        In ascending order of sigma.
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

    Parameters
    ----------
    shape
        A spread or covariance that gives the shape and the bias; isotropic without bias by
        default.

    Raises
    ------
    ValueError
        Unless lowest is below highest.
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
        # neither ends between the two sigmas
        assert from_below is not None and from_above is not None
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
