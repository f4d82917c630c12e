"""The thrower's spread from scores alone, from impact points, or from impact points and misses, by
expectation maximisation.

R. Tibshirani, A. Price and J. Taylor, "A statistician plays darts", JRSS A 174, 2011: the impacts
are the missing data.

* E-step: moments of the Gaussian in each bed, exact (`_exact`), computed once for each bed and not
  for each throw.
* M-step: bias and covariance from the expected moments. The isotropic model takes half the trace.
  For the likelihood profile sigma is fixed; then the covariance is scaled to the determinant of
  that sigma.
* Two steps at a time are extrapolated (SQUAREM: R. Varadhan and C. Roland 2008). EM then ends
  sooner, at the same result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_number, as_vector
from dart_skill.darts._spread import LARGEST, LARGEST_BIAS, Spread
from dart_skill.darts._throws import (
    Expectation,
    ObservedThrows,
    throws_from_points,
    throws_from_scores,
)

MODELS = ("isotropic", "general")
FLOOR = 1.0
"""Smallest sigma that can be estimated from scores [mm]."""
CEILING = 1000.0
"""Largest sigma that can be estimated from scores [mm]."""
NARROWEST = 2.0
"""Least standard deviation along the narrow axis of a general covariance [mm]."""
STARTS = (12.0, 50.0)
"""Sigmas from which EM starts [mm]; the more likely result is kept."""
STEPS_OUT = 0.2 * 1.6 ** np.arange(12)
"""Distances in log(sigma) from the estimate at which the ends of its interval are searched for."""
MAX_STEPS = 300
TOLERANCE = 1e-12
"""Gain of the log-likelihood per throw below which EM has converged."""
ROUGHLY = 1e-7
"""Gain of the log-likelihood per throw below which the results of several starts are compared."""
LARGEST_RATIO = 10.0
"""Largest ratio of the axes of a general covariance: with few throws it would otherwise become a
line.
"""


class LikelihoodRatio(NamedTuple):
    """Test of a model against a simpler one.

    Parameters
    ----------
    statistic
        Twice the difference of the log-likelihoods.
    degrees_of_freedom
        By how many parameters the models differ.
    p_value
        Probability of a statistic at least as large if the simpler model is right.
    """

    statistic: float
    degrees_of_freedom: int
    p_value: float


@dataclass(frozen=True, eq=False)
class SpreadEstimate:
    """The most likely spread of a thrower, made by `estimate_from_scores` or
    `estimate_from_points`.

    Parameters
    ----------
    spread
        Spread, the estimate.
    log_likelihood
        Of the throws under it.
    model
        "isotropic" (one sigma) or "general" (a covariance).
    with_bias
        Whether the mean was estimated; otherwise it is the aim.
    throws
        The observations.

    Attributes
    ----------
    sigma : [mm]
        Of it.
    n_throws
        Number of those that were used.
    """

    spread: Spread
    log_likelihood: float
    model: str
    with_bias: bool
    throws: ObservedThrows

    @property
    def sigma(self) -> float:
        return self.spread.sigma

    @property
    def n_throws(self) -> int:
        return self.throws.n_throws

    def profile(self, sigmas: ArrayLike) -> np.ndarray:
        """Log-likelihood (n,) at sigmas (n,) [mm], maximised over bias and shape; -inf where a
        throw is practically impossible.
        """
        return np.array(
            [self._profile_at(sigma, self.spread)[1] for sigma in as_vector(sigmas, "sigmas")]
        )

    def confidence_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Lowest and highest sigma [mm] that the likelihood ratio does not reject at 1 - level.

        An end that the throws do not determine is 0 or inf.

        Raises
        ------
        ValueError
            For a level that is not between 0 and 1.
        """
        if not 0.0 < as_number(level, "level") < 1.0:
            raise ValueError(f"level must lie between 0 and 1, got {level:g}")
        drop = float(scipy.special.chdtri(1, 1.0 - level)) / 2.0
        return self._end(drop, FLOOR, 0.0), self._end(drop, CEILING, float("inf"))

    def isotropy_test(self) -> LikelihoodRatio:
        """Test of whether one sigma is enough: the isotropic model against a general covariance,
        on the same throws.
        """
        simple, general = (_fit(self.throws, model, self.with_bias) for model in MODELS)
        return _likelihood_ratio(simple, general)

    def bias_test(self) -> LikelihoodRatio:
        """Test of whether the mean of the darts is the aim."""
        return _likelihood_ratio(
            *(_fit(self.throws, self.model, with_bias) for with_bias in (False, True))
        )

    def _profile_at(
        self, sigma: float, start: Spread, tolerance: float = 1e-8
    ) -> tuple[Spread, float]:
        """The most likely spread with this sigma, and its log-likelihood; start: spread at which
        EM starts.
        """
        variances, axes = np.linalg.eigh(start.covariance)
        scaled = Spread((axes * _bounded(variances, sigma)) @ axes.T, start.bias)
        return _em(self.throws, scaled, self.model, self.with_bias, sigma, tolerance)

    def _end(self, drop: float, limit: float, if_open: float) -> float:
        """Sigma [mm] between the estimate and a limit at which the profile has fallen by `drop`;
        if_open if it does not.
        """
        latest, known = self.spread, {}

        def above(log_sigma: float) -> float:
            nonlocal latest
            if log_sigma not in known:
                spread, log_likelihood = self._profile_at(float(np.exp(log_sigma)), latest)
                latest = spread if np.isfinite(log_likelihood) else latest
                known[log_sigma] = (
                    max(log_likelihood, self.log_likelihood - 1e3) - self.log_likelihood + drop
                )
            return known[log_sigma]

        inside, whole = float(np.log(self.sigma)), float(np.log(limit / self.sigma))
        for step in np.sign(whole) * STEPS_OUT:
            outside = float(np.log(self.sigma) + (whole if abs(step) > abs(whole) else step))
            if above(outside) < 0.0:
                return float(np.exp(scipy.optimize.brentq(above, inside, outside, xtol=1e-5)))
            if abs(step) > abs(whole):
                return if_open
            inside = outside
        return if_open


def estimate_from_scores(
    scores: Sequence[str | int],
    aim: str | ArrayLike = "DB",
    *,
    model: str = "isotropic",
    bias: bool = False,
    misses: str = "counted",
) -> SpreadEstimate:
    """The spread of a thrower from the scores of n single darts.

    Parameters
    ----------
    scores : (n,)
        Numbers (0 is a miss), names of beds where they are known (T20, D10, S5), and x for a dart
        that bounced out, which is not used.
    aim
        Target of all darts, a name or a point (2,) [mm], or a point for each (n, 2); default DB,
        the double bull.
    model
        "isotropic" (one sigma, default) or "general" (a covariance).
    bias
        Bool, default False. Whether the mean may differ from the aim.
    misses
        "counted" (default), or "unrecorded" if only darts that hit the board are listed.

    Raises
    ------
    ValueError
        If all darts missed the board.
    """
    throws = throws_from_scores(scores, aim, misses)
    if all(group.patterns.shape[0] == 1 and group.patterns[0, -1] for group in throws.groups):
        raise ValueError(
            f"all {throws.n_throws} darts missed the board, which leaves the spread open; aim"
            " where some hit, from nearer by"
        )
    return _estimate(throws, model, bias)


def estimate_from_points(
    points: ArrayLike,
    aim: str | ArrayLike = "DB",
    *,
    model: str = "isotropic",
    bias: bool = False,
    misses: int | str = 0,
) -> SpreadEstimate:
    """The spread of a thrower from measured impacts.

    Parameters
    ----------
    points : (n, 2) [mm]
        The impacts.
    aim
        As in `estimate_from_scores`; if there is one for each dart, first those of the impacts,
        then those of the misses.
    model, bias
        As in `estimate_from_scores`.
    misses
        Int, default 0. Number of darts that missed the board and have no impact; "unrecorded" if
        they were not counted.
    """
    return _estimate(throws_from_points(points, aim, misses), model, bias)


def _estimate(throws: ObservedThrows, model: str, with_bias: bool) -> SpreadEstimate:
    if model not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
    n_parameters = _n_parameters(model, with_bias)
    if throws.n_throws <= n_parameters:
        raise ValueError(
            f"{throws.n_throws} darts are too few for the {n_parameters} numbers of this model;"
            " throw more or simplify it"
        )
    return _fit(throws, model, bool(with_bias))


def _n_parameters(model: str, with_bias: bool) -> int:
    return (1 if model == "isotropic" else 3) + 2 * bool(with_bias)


def _fit(throws: ObservedThrows, model: str, with_bias: bool) -> SpreadEstimate:
    """The most likely result of EM from several starts.

    A general covariance starts from the isotropic result and from versions of it that are longer
    in one direction.
    """
    if model == "isotropic":
        starts = [Spread.isotropic(sigma) for sigma in STARTS]
    else:
        simple = _fit(throws, "isotropic", with_bias).spread
        shapes = [
            [1.0, 0.0, 0.0, 1.0],
            [4.0, 0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0, 4.0],
            [2.5, 1.5, 1.5, 2.5],
            [2.5, -1.5, -1.5, 2.5],
        ]
        starts = [
            Spread(np.array(shape).reshape(2, 2), simple.bias).scaled_to(simple.sigma)
            for shape in shapes
        ]
    ends = [
        _em(throws, start, model, with_bias, tolerance=ROUGHLY)
        for start in _possible(starts, throws)
    ]
    spread, log_likelihood = _em(throws, max(ends, key=lambda end: end[1])[0], model, with_bias)
    return SpreadEstimate(spread, log_likelihood, model, with_bias, throws)


def _possible(starts: list[Spread], throws: ObservedThrows) -> list[Spread]:
    """The starts under which every throw is possible; a wide spread if there is none."""
    possible = [start for start in starts if np.isfinite(throws.expect(start).log_likelihood)]
    return possible or [Spread.isotropic(2.0 * STARTS[-1])]


def _em(
    throws: ObservedThrows,
    spread: Spread,
    model: str,
    with_bias: bool,
    sigma: float | None = None,
    tolerance: float = TOLERANCE,
) -> tuple[Spread, float]:
    """EM from a spread to the nearest maximum of the likelihood; with a fixed sigma if it is
    given.

    After every two steps the spread is extrapolated, and the result is kept if it is more likely.
    """
    before, reach = throws.expect(spread), 4.0
    for _ in range(MAX_STEPS):
        if not np.isfinite(before.log_likelihood):
            break
        first = _maximise(before, spread, model, with_bias, sigma)
        after_first = throws.expect(first)
        if not after_first.log_likelihood - before.log_likelihood >= tolerance * throws.n_throws:
            break
        second = _maximise(after_first, first, model, with_bias, sigma)
        spread = _extrapolated(spread, first, second, reach)
        before, reach = throws.expect(spread), 2.0 * reach
        if not before.log_likelihood >= after_first.log_likelihood:
            spread, before, reach = second, throws.expect(second), max(1.0, 0.1 * reach)
    return spread, before.log_likelihood


def _extrapolated(start: Spread, first: Spread, second: Spread, reach: float) -> Spread:
    """Extrapolation of two steps, `reach` steps ahead at most, in the coordinates of
    `_coordinates` (SQUAREM).
    """
    from_start, from_first, from_second = (
        _coordinates(spread, start.sigma) for spread in (start, first, second)
    )
    step = from_first - from_start
    change = from_second - from_first - step
    length = np.clip(np.linalg.norm(step) / max(float(np.linalg.norm(change)), 1e-300), 1.0, reach)
    return _spread_at(from_start + 2.0 * length * step + length**2 * change, start.sigma) or second


def _coordinates(spread: Spread, unit: float) -> np.ndarray:
    """Coordinates (5,) in which every vector is a spread.

    They are the bias in units of `unit`, the logarithms of the diagonal of the Cholesky factor,
    and its slope.
    """
    (first, _), (below, second) = np.linalg.cholesky(spread.covariance)
    return np.array([*(spread.bias / unit), np.log(first), np.log(second), below / second])


def _spread_at(coordinates: np.ndarray, unit: float) -> Spread | None:
    """The spread at these coordinates; None if it is outside the bounds of an estimate."""
    *bias, first, second, slope = coordinates
    if max(abs(first), abs(second)) > np.log(LARGEST) or max(np.abs(bias)) * unit > LARGEST_BIAS:
        return None
    factor = np.array([[np.exp(first), 0.0], [slope * np.exp(second), np.exp(second)]])
    widest, narrowest = np.linalg.svd(factor, compute_uv=False)
    sensible = (
        FLOOR <= narrowest <= widest <= min(LARGEST, LARGEST_RATIO * narrowest)
        and narrowest * widest <= CEILING**2
    )
    return Spread(factor @ factor.T, unit * np.array(bias)) if sensible else None


def _maximise(
    expected: Expectation, spread: Spread, model: str, with_bias: bool, sigma: float | None
) -> Spread:
    """M-step."""
    shift = expected.first / expected.n_throws if with_bias else np.zeros(2)
    covariance = expected.second / expected.n_throws - np.outer(shift, shift)
    variances, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    variances = np.maximum(variances, 1e-12)
    if model == "isotropic":
        variances, axes = np.full(2, variances.mean()), np.eye(2)
    variances = _bounded(variances, sigma)
    bias = np.clip(spread.bias + shift, -LARGEST_BIAS, LARGEST_BIAS)
    return Spread((axes * variances) @ axes.T, bias)


def _bounded(variances: np.ndarray, sigma: float | None) -> np.ndarray:
    """The most likely variances (2,) along the axes within the bounds, from the expected ones;
    with a fixed sigma if it is given.
    """
    ratio = np.sqrt(variances[1] / variances[0])
    free = float(variances.prod() ** 0.25)
    if ratio > LARGEST_RATIO:
        ratio = LARGEST_RATIO
        free = float(np.sqrt(0.5 * (variances[0] * ratio + variances[1] / ratio)))
    sigma = float(np.clip(free, FLOOR, CEILING)) if sigma is None else sigma
    ratio = min(ratio, (0.999 * LARGEST / sigma) ** 2, max(1.0, (sigma / NARROWEST) ** 2))
    return sigma**2 * np.array([1.0 / ratio, ratio])


def _likelihood_ratio(simple: SpreadEstimate, general: SpreadEstimate) -> LikelihoodRatio:
    statistic = max(0.0, 2.0 * (general.log_likelihood - simple.log_likelihood))
    freedom = _n_parameters(general.model, general.with_bias) - _n_parameters(
        simple.model, simple.with_bias
    )
    return LikelihoodRatio(statistic, freedom, float(scipy.special.chdtrc(freedom, statistic)))
