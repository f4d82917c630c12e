"""One hill of a changing landscape: a quadratic model of the returns about its top, fitted to the
hill's latest trials.

    y = a + s t + b'x + x'Hx / 2,    x = (place - centre) / radius,    t the age of the trial

is fitted by least squares. The weight of a trial halves after as many newer trials as the model
has coefficients. A Newton step of limited length goes to the top. The radius of the trials grows
while the steps are long and shrinks while they are short. So it is as small as drift and noise
allow. With more than `FULL_MODEL` parameters H is diagonal. G. Box and K. Wilson, On the
experimental attainment of optimum conditions, JRSS B 1951.

The value of a hill is forecast by a line through the values at its visits, against the clock of
the landscape:

    value(t) = v + s (t - last),    s ~ N(0, drift^2) before any visit,    a visit's variance = error^2 + (drift (last - t) / 2)^2

This is Bayesian linear regression. Old visits have a larger variance and count less, because the
real curve is not a line. The standard deviation of the slope ahead is at least drift / 2.

`NicheSearch` is the common base of searches that follow hills by niches.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_vector
from dart_skill.policy_search._search import SearchSettings, VectorSearch

FULL_MODEL = 10
"""Largest number of parameters for which H is a full matrix; the model then has 66 coefficients."""
RIDGE = 0.03
"""Weight of the prior (slope zero, the last curvature) [trials]; it keeps the fit of few trials
well-posed.
"""
LONGEST_STEP = 1.0
"""Length of the longest step [radii per root of the dimension]."""
STILL = 0.1
"""Length of a step that leaves the radius unchanged [radii per root of the dimension]."""
SETTLED = 0.5
"""Length of a step below which the top counts as found [radii per root of the dimension]."""
REMEMBERED = 8
"""Number of latest visits through which the line is fitted."""


@dataclass
class Niche:
    """State of one hill. Places (d,) are relative to the start of the search, in units of the
    spread.

    Parameters
    ----------
    identity
        Number of the niche.
    centre : (d,)
        Of its trials.
    radius
        Of its trials.
    hessian : (d, d)
        H in units of the spread.
    value, error
        Return of the model at the centre, and its standard error.
    drop
        How much less than `value` the trials earn on average.
    relative
        Value minus the common level of the landscape.
    last
        Number of the trial at which its last visit began.
    clock
        Of its last trial.
    burst
        Trials of the present visit that are still to come.
    surprises
        Number of trials in a row with a much lower return than expected.
    settled
        Whether the top is found.
    trials
        (number, place, return, clock) of each, sorted by number.
    visits
        (clock, relative value, error) at the end of each visit.
    """

    identity: int
    centre: np.ndarray
    radius: float
    hessian: np.ndarray
    value: float = 0.0
    error: float = 0.0
    drop: float = 0.0
    relative: float = 0.0
    last: int = 0
    clock: float = 0.0
    burst: int = 0
    surprises: int = 0
    settled: bool = False
    trials: list[tuple[int, np.ndarray, float, float]] = field(default_factory=list)
    visits: list[tuple[float, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.centre = np.array(self.centre, dtype=float)
        self.hessian = np.array(self.hessian, dtype=float)
        self.trials = [(k, np.array(place), seen, now) for k, place, seen, now in self.trials]
        self.visits = [(clock, value, error) for clock, value, error in self.visits]

    @property
    def known(self) -> bool:
        """Whether there are enough trials to fit a slope."""
        return len(self.trials) >= self.centre.size + 2

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        """A place (d,), uniform in the ball about the centre whose variance per axis is radius^2."""
        d = self.centre.size
        direction = rng.standard_normal(d)
        return self.centre + self.radius * np.sqrt(d + 2) * rng.random() ** (
            1 / d
        ) * direction / np.linalg.norm(direction)

    def tell(
        self,
        trial: tuple[int, np.ndarray, float, float],
        fading: float,
        repeats: int,
        alarm: float,
        limits: tuple[float, float],
        fits: bool = True,
    ) -> None:
        """Add a trial, and fit the model if `fits`.

        After two trials in a row (times `repeats`) with returns lower than expected by more than
        `alarm`, all older trials are forgotten.

        Parameters
        ----------
        fading
            Change of the clock after which a trial counts 1/e.
        limits
            Of the radius.
        """
        surprised = self.known and trial[2] < self.value - 3 * self.drop - alarm
        self.surprises = self.surprises + 1 if surprised else 0
        self.trials.append(trial)
        self.trials.sort(key=lambda trial: trial[0])
        forgets = self.surprises == 2 * repeats
        self.trials = self.trials[
            -(self.surprises if forgets else 4 * n_coefficients(self.centre.size) * repeats) :
        ]
        # A single surprise may be an outlier: it is fitted only after a second one confirms it.
        if not self.known:
            earned_here = [trial[2] for trial in self.trials]
            self.value = float(np.mean(earned_here) if repeats > 1 else np.max(earned_here))
        elif (
            fits and trial[0] % max(repeats // 10, 1) == 0 and (repeats > 1 or not self.surprises)
        ):
            self._fit(fading, repeats, limits)

    def _fit(self, fading: float, repeats: int, limits: tuple[float, float]) -> None:
        d, recent = self.centre.size, n_coefficients(self.centre.size) * repeats
        numbers, places, earned, clocks = (
            np.array(part, dtype=float) for part in zip(*self.trials, strict=True)
        )
        ages, points = (
            (numbers - numbers[-1]) / max(numbers[-1] - numbers[0], 1.0),
            (places - self.centre) / self.radius,
        )
        weights = 0.5 ** (np.arange(len(earned))[::-1] / recent) * np.exp(
            -np.square(points).sum(axis=1) / (32 * d) - (clocks.max() - clocks) / fading
        )
        prior = np.concatenate([np.zeros(2 + d), (self.hessian * self.radius**2)[_products(d)]])
        coefficients, self.error = _solve(_design(points, ages), earned, weights, prior)
        slope, hessian = _read(coefficients, d)
        curvatures, axes = np.linalg.eigh(hessian)
        step = _newton(slope, curvatures, axes)
        # The value of a top cannot exceed the best recent return.
        self.value = min(
            float(coefficients[0] + slope @ step + 0.5 * step @ hessian @ step),
            float(earned[-recent:].max()),
        )
        self.drop = 0.5 * float(np.maximum(-curvatures, 0).sum())
        self.hessian, self.centre = hessian / self.radius**2, self.centre + self.radius * step
        length = float(np.linalg.norm(step)) / np.sqrt(d)
        self.settled = bool(
            curvatures.max() < 0 and length < SETTLED and len(earned) > n_coefficients(d)
        )
        self.radius = float(
            np.clip(self.radius * np.clip((length / STILL) ** 0.2, 0.9, 1.15), *limits)
        )


def n_coefficients(d: int) -> int:
    """Number of coefficients of the model, without the trend s."""
    return 1 + d + (d * (d + 1) // 2 if d <= FULL_MODEL else d)


def _products(d: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(d) if d <= FULL_MODEL else (np.arange(d), np.arange(d))


def _design(points: np.ndarray, ages: np.ndarray) -> np.ndarray:
    rows, columns = _products(points.shape[1])
    products = points[:, rows] * points[:, columns] * np.where(rows == columns, 0.5, 1.0)
    return np.column_stack([np.ones(len(points)), ages, points, products])


def _solve(
    design: np.ndarray, earned: np.ndarray, weights: np.ndarray, prior: np.ndarray
) -> tuple[np.ndarray, float]:
    """Coefficients, and the standard error of the first."""
    middle = float(earned.mean())
    residual = earned - middle - design @ prior
    normal = design.T @ (weights[:, None] * design)
    ridge = np.full(len(prior), RIDGE)
    ridge[: 2 if len(earned) > len(prior) else 1] = 1e-9
    inverse = np.linalg.inv(normal + np.diag(ridge))
    change = inverse @ (design.T @ (weights * residual))
    freedom = max(float(weights.sum() - np.sum(inverse * normal)), 0.5)
    variance = float(weights @ np.square(residual - design @ change)) / freedom
    coefficients = prior + change
    coefficients[0] += middle
    return coefficients, float(np.sqrt(variance * inverse[0, 0]))


def _read(coefficients: np.ndarray, d: int) -> tuple[np.ndarray, np.ndarray]:
    """Slope (d,) and second derivatives (d, d)."""
    rows, columns = _products(d)
    hessian = np.zeros((d, d))
    hessian[rows, columns] = hessian[columns, rows] = coefficients[2 + d :]
    return coefficients[2 : 2 + d], hessian


def _newton(slope: np.ndarray, curvatures: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Step (d,) to the top, of limited length; along axes without a maximum it goes uphill as far
    as allowed.
    """
    along, longest = axes.T @ slope, LONGEST_STEP * np.sqrt(len(slope))
    step = axes @ (along / np.maximum(np.maximum(-curvatures, np.abs(along) / longest), 1e-300))
    return step * min(1.0, longest / max(float(np.linalg.norm(step)), 1e-300))


def forecast(
    visits: list[tuple[float, float, float]], now: float, drift: float
) -> tuple[float, float]:
    """Value and its standard deviation at the time `now`.

    Parameters
    ----------
    visits
        (clock, value, error) of each, the latest last.
    """
    clocks, values, errors = np.array(visits, dtype=float).T
    before, bend = clocks - clocks[-1], 0.5 * drift
    weights = 1 / (np.square(errors) + np.square(bend * before) + 1e-12 * drift**2 + 1e-300)
    design = np.column_stack([np.ones(len(clocks)), before])
    covariance = np.linalg.inv(
        design.T @ (weights[:, None] * design) + np.diag([0.0, 1 / drift**2])
    )
    middle = values[-1]
    value, slope = covariance @ design.T @ (weights * (values - middle))
    ahead = np.array([1.0, now - clocks[-1]])
    variance = ahead @ covariance @ ahead + np.square(bend * ahead[1])
    return float(middle + value + slope * ahead[1]), float(np.sqrt(variance))


AnyNicheSearch = TypeVar("AnyNicheSearch", bound="NicheSearch")


class NicheSearch(VectorSearch):
    """A search that learns from every return at once.

    OPTIONS and MEMORY name attributes, without their underscore, that are saved as they are.
    OPTIONS are arguments of the constructor, MEMORY are not.

    Parameters
    ----------
    parameters
        (d,) or (n, d), where the search begins.
    spread
        (d,) or (d, d), covariance of the first trials.
    limits
        Smallest and largest radius of trials, relative to `spread`.
    rng
        Draws the trials.
    """

    OPTIONS: tuple[str, ...] = ()
    MEMORY: tuple[str, ...] = ()

    def __init__(
        self, parameters: ArrayLike, spread: ArrayLike, limits: ArrayLike, rng: np.random.Generator
    ):
        settings = SearchSettings(
            "constant", "rank", 1, 1, 2, 0.0, tuple(as_vector(limits, "limits", 2).tolist())
        )
        super().__init__(parameters, spread, settings, rng)
        self._root = float(np.sqrt(self._start.size))

    def _cloud(self, n: int, reach: float) -> np.ndarray:
        """Places (n, d), uniform in a ball about the start [spreads per root of d]."""
        d = self._start.size
        directions = self._rng.standard_normal((n, d))
        sizes = reach * self._root * self._rng.random((n, 1)) ** (1 / d)
        return sizes * directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def _learn(self) -> bool:
        changed = self._update([self._told[-1]])
        self._fresh = 0
        self.n_updates += changed
        return changed

    def _policy_state(self) -> dict:
        return {
            "start": self._start,
            "scale": self._scale,
            "options": {name: getattr(self, f"_{name}") for name in self.OPTIONS},
            "memory": {name: getattr(self, f"_{name}") for name in self.MEMORY},
        }

    @classmethod
    def _from_policy_state(
        cls: type[AnyNicheSearch], state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> AnyNicheSearch:
        search = cls(
            state["start"], state["scale"], rng=rng, limits=settings.limits, **state["options"]
        )
        for name in cls.MEMORY:
            setattr(search, f"_{name}", state["memory"][name])
        return search
