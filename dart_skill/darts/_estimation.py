"""The thrower's spread from scores alone, from impact points, or from both with misses, by expectation maximisation.

Tibshirani, Price and Taylor, "A statistician plays darts" (2011): the impacts are what is missing. E-step: moments of the Gaussian in
each bed (exact, `_exact`), once per bed and not per throw. M-step: bias and covariance from the expected moments; isotropic: half
the trace; with sigma held at a value, as the likelihood profile needs it: the covariance scaled to that determinant. Steps are
extrapolated in pairs (SQUAREM: Varadhan and Roland 2008), which changes how soon EM ends and not where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dart_skill.checks import as_number, as_vector
from dart_skill.darts._spread import LARGEST, LARGEST_BIAS, Spread
from dart_skill.darts._throws import Expectation, Throws, throws_from_points, throws_from_scores

MODELS = ("isotropic", "general")
FLOOR, CEILING = 1.0, 1000.0
"""Sigmas that can be told from scores [mm]; an estimate is held between them."""
NARROWEST = 2.0
"""Least standard deviation along the narrow axis of a general covariance [mm]."""
STARTS = (12.0, 50.0)
"""Sigmas from which EM starts [mm]; the better end counts."""
STEPS_OUT = 0.2 * 1.6 ** np.arange(12)
"""Logarithmic distances from the estimate at which the ends of its interval are looked for."""
MAX_STEPS = 300
TOLERANCE, ROUGHLY = 1e-12, 1e-7
"""Gain of log-likelihood per throw at which EM has converged, and at which the ends of several starts are compared."""
LARGEST_RATIO = 10.0
"""Largest ratio of the axes of a general covariance: few throws would otherwise flatten it to a line."""


class LikelihoodRatio(NamedTuple):
    """Twice the difference of log-likelihoods, its degrees of freedom, and how probable one this large is if the simpler model holds."""

    statistic: float
    degrees_of_freedom: int
    p_value: float


@dataclass(frozen=True, eq=False)
class SpreadEstimate:
    """The most likely spread of a thrower.

    model: isotropic or general; with_bias: whether the mean was estimated or taken to be the aim; n_throws: those that tell
    something; bounced_out: those that do not.
    """

    spread: Spread
    log_likelihood: float
    model: str
    with_bias: bool
    throws: Throws

    @property
    def sigma(self) -> float:
        return self.spread.sigma

    @property
    def n_throws(self) -> int:
        return self.throws.n_throws

    def profile(self, sigmas: ArrayLike) -> np.ndarray:
        """Log-likelihood (n,) at sigmas (n,) [mm], highest over bias and shape; -inf where throws are all but impossible."""
        return np.array([self._profile_at(sigma, self.spread)[1] for sigma in as_vector(sigmas, "sigmas")])

    def confidence_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Sigmas [mm] that the likelihood ratio does not reject at 1 - level; an end that the throws leave open is 0 or inf."""
        if not 0.0 < as_number(level, "level") < 1.0:
            raise ValueError(f"level must lie between 0 and 1, got {level:g}")
        drop = float(scipy.special.chdtri(1, 1.0 - level)) / 2.0
        return self._end(drop, FLOOR, 0.0), self._end(drop, CEILING, float("inf"))

    def isotropy_test(self) -> LikelihoodRatio:
        """Whether one sigma is good enough: the isotropic model against a general covariance, on the same throws."""
        simple, general = (_fit(self.throws, model, self.with_bias) for model in MODELS)
        return _likelihood_ratio(simple, general)

    def bias_test(self) -> LikelihoodRatio:
        """Whether the thrower hits where the aim is, on average."""
        return _likelihood_ratio(*(_fit(self.throws, self.model, with_bias) for with_bias in (False, True)))

    def _profile_at(self, sigma: float, start: Spread, tolerance: float = 1e-8) -> tuple[Spread, float]:
        """The most likely spread with this sigma, looked for from another, and its log-likelihood."""
        variances, axes = np.linalg.eigh(start.covariance)
        scaled = Spread((axes * _bounded(variances, sigma)) @ axes.T, start.bias)
        return _em(self.throws, scaled, self.model, self.with_bias, sigma, tolerance)

    def _end(self, drop: float, limit: float, if_open: float) -> float:
        """Where the profile has fallen by `drop` on the way from the estimate to a limit; if_open when it has not there."""
        latest, known = self.spread, {}

        def above(log_sigma: float) -> float:
            nonlocal latest
            if log_sigma not in known:
                spread, log_likelihood = self._profile_at(float(np.exp(log_sigma)), latest)
                latest = spread if np.isfinite(log_likelihood) else latest
                known[log_sigma] = max(log_likelihood, self.log_likelihood - 1e3) - self.log_likelihood + drop
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
    """The spread of a thrower from the scores (n,) of single darts.

    scores: numbers (0 is a miss), beds where they are known (T20, D10, S5) and x for a dart that bounced out, which is left out.
    aim: what all of them were aimed at, a name or a point (2,) [mm], or a point for each (n, 2). model: isotropic (one sigma) or
    general (a covariance); bias: whether the mean may differ from the aim. misses: "unrecorded" if only darts that hit were listed.
    """
    throws = throws_from_scores(scores, aim, misses)
    if all(group.patterns.shape[0] == 1 and group.patterns[0, -1] for group in throws.groups):
        raise ValueError(f"all {throws.n_throws} darts missed the board, which leaves the spread open; aim where some hit, from nearer by")
    return _estimate(throws, model, bias)


def estimate_from_points(
    points: ArrayLike, aim: str | ArrayLike = "DB", *, model: str = "isotropic", bias: bool = False, misses: int | str = 0
) -> SpreadEstimate:
    """The spread of a thrower from measured impacts (n, 2) [mm].

    aim: as in estimate_from_scores, one point for each measured dart and then for each miss. misses: how many more darts were thrown
    that left no measurable impact because they missed the board, or "unrecorded" if nobody counted.
    """
    return _estimate(throws_from_points(points, aim, misses), model, bias)


def _estimate(throws: Throws, model: str, with_bias: bool) -> SpreadEstimate:
    if model not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
    n_parameters = _n_parameters(model, with_bias)
    if throws.n_throws <= n_parameters:
        raise ValueError(f"{throws.n_throws} darts are too few for the {n_parameters} numbers of this model; throw more or simplify it")
    return _fit(throws, model, bool(with_bias))


def _n_parameters(model: str, with_bias: bool) -> int:
    return (1 if model == "isotropic" else 3) + 2 * bool(with_bias)


def _fit(throws: Throws, model: str, with_bias: bool) -> SpreadEstimate:
    """The best end of EM from several spreads; a general covariance starts from the isotropic one, lengthened along each axis."""
    if model == "isotropic":
        starts = [Spread.isotropic(sigma) for sigma in STARTS]
    else:
        simple = _fit(throws, "isotropic", with_bias).spread
        shapes = [[1, 0, 0, 1], [4, 0, 0, 1], [1, 0, 0, 4], [2.5, 1.5, 1.5, 2.5], [2.5, -1.5, -1.5, 2.5]]
        starts = [Spread(np.reshape(shape, (2, 2)), simple.bias).scaled_to(simple.sigma) for shape in shapes]
    ends = [_em(throws, start, model, with_bias, tolerance=ROUGHLY) for start in _possible(starts, throws)]
    spread, log_likelihood = _em(throws, max(ends, key=lambda end: end[1])[0], model, with_bias)
    return SpreadEstimate(spread, log_likelihood, model, with_bias, throws)


def _possible(starts: list[Spread], throws: Throws) -> list[Spread]:
    """Spreads under which every throw is possible; a wide one if there is none."""
    possible = [start for start in starts if np.isfinite(throws.expect(start).log_likelihood)]
    return possible or [Spread.isotropic(2.0 * STARTS[-1])]


def _em(
    throws: Throws, spread: Spread, model: str, with_bias: bool, sigma: float | None = None, tolerance: float = TOLERANCE
) -> tuple[Spread, float]:
    """EM from a spread to the nearest maximum of the likelihood, sigma held if given; every two steps are extrapolated if that climbs."""
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
    """Where steps that shrink like the last two would end, at most `reach` such steps on: in bias and Cholesky factor (SQUAREM)."""
    from_start, from_first, from_second = (_coordinates(spread, start.sigma) for spread in (start, first, second))
    step = from_first - from_start
    change = from_second - from_first - step
    length = np.clip(np.linalg.norm(step) / max(np.linalg.norm(change), 1e-300), 1.0, reach)
    return _spread_at(from_start + 2.0 * length * step + length**2 * change, start.sigma) or second


def _coordinates(spread: Spread, unit: float) -> np.ndarray:
    """Bias in units, logarithms of the diagonal of the Cholesky factor, and its slope (5,): every such vector is a spread."""
    (first, _), (below, second) = np.linalg.cholesky(spread.covariance)
    return np.array([*(spread.bias / unit), np.log(first), np.log(second), below / second])


def _spread_at(coordinates: np.ndarray, unit: float) -> Spread | None:
    """The spread at coordinates, unless it is one that no thrower has."""
    *bias, first, second, slope = coordinates
    if max(abs(first), abs(second)) > np.log(LARGEST) or max(np.abs(bias)) * unit > LARGEST_BIAS:
        return None
    factor = np.array([[np.exp(first), 0.0], [slope * np.exp(second), np.exp(second)]])
    widest, narrowest = np.linalg.svd(factor, compute_uv=False)
    sensible = FLOOR <= narrowest <= widest <= min(LARGEST, LARGEST_RATIO * narrowest) and narrowest * widest <= CEILING**2
    return Spread(factor @ factor.T, unit * np.array(bias)) if sensible else None


def _maximise(expected: Expectation, spread: Spread, model: str, with_bias: bool, sigma: float | None) -> Spread:
    """M-step."""
    shift = expected.first / expected.count if with_bias else np.zeros(2)
    covariance = expected.second / expected.count - np.outer(shift, shift)
    variances, axes = np.linalg.eigh(0.5 * (covariance + covariance.T))
    variances = np.maximum(variances, 1e-12)
    if model == "isotropic":
        variances, axes = np.full(2, variances.mean()), np.eye(2)
    variances = _bounded(variances, sigma)
    bias = np.clip(spread.bias + shift, -LARGEST_BIAS, LARGEST_BIAS)
    return Spread((axes * variances) @ axes.T, bias)


def _bounded(variances: np.ndarray, sigma: float | None) -> np.ndarray:
    """The most likely variances (2,) along the axes for the expected ones, within the bounds and with sigma held if given."""
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
    freedom = _n_parameters(general.model, general.with_bias) - _n_parameters(simple.model, simple.with_bias)
    return LikelihoodRatio(statistic, freedom, float(scipy.special.chdtrc(freedom, statistic)))
