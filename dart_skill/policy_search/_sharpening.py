"""A search for trials that scatter about their aim, less and less.

The rewards are those of an unknown landscape, blurred by the scatter. As the scatter shrinks,
hills become sharper, split, and overtake each other.

* A quadratic model (`_niche`) follows the best hill.
* A blur obeys the heat equation: a top rises by db tr(H) / 2 when the variance b of the blur
  changes by db. So the rise of the top tells by how much the blur shrank. tr(H) is measured by a
  star of trials about the top, whenever b has lost a tenth.
* One Gaussian process (`_blurred_noise`) describes all values, seen through any blur. It predicts
  what places that were seen through a wide blur are worth now.
* A place is promising if its prediction plus `optimism` standard deviations exceeds the best top.
  A scout, a trial of another place, goes to the promising place with the smallest expected loss.
  (Optimism of this kind: N. Srinivas et al., Gaussian process optimization in the bandit setting,
  ICML 2010.) If the scout earned more than the best top, the search climbs from there.
* A real landscape has higher peaks than blurred white noise, so the process is too certain where
  it has seen little. Therefore there is a budget for additional scouts (`insurance`): it grows
  with each rise of the best top, because other hills may rise faster then. If no place is
  promising and the budget covers the expected loss of a scout, a scout goes where an improvement
  is most probable (H. Kushner, J. Basic Eng. 86, 1964). All scouts are paid from this budget.

    search = Sharpening(aim, scatter, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, expected_score(trial.parameters))
    search.parameters
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number
from dart_skill.policy_search._gaussian_process import BlurredNoise
from dart_skill.policy_search._niche import Niche, NicheSearch
from dart_skill.policy_search._search import SearchSettings, ToldTrial

TOP = 0
"""Kind of a trial about the best top."""
SCOUT = 1
"""Kind of a trial of another place."""
PROBE = 2
"""Kind of a trial of a star."""
RECORDS = 300
"""Number of latest trials that the process uses."""
PLACES = 300
"""Number of places among which a scout chooses."""
STEP = 0.1
"""Share of its variance that the blur loses between two stars."""
STAR = 0.15
"""Radius of a star [lengths of the blur]."""
NEAR = 6
"""Number of latest trials at the top, per dimension, that are evaluated together with a star."""
FIRST_RADIUS = 0.3
"""Radius of trials about a new top [lengths of the blur], and about the first one [spreads]."""
LARGEST_RADIUS = 0.4
"""Largest radius of trials about a top [lengths of the blur]."""
ERRORS = 10.0 ** np.arange(-7.0, -2.9, 0.5)
"""Possible variances of the error of a value, relative to that of the landscape."""
FIRST_ERROR = 4
"""First index into ERRORS."""

Number = TypeVar("Number", float, np.ndarray)


class Sharpening(NicheSearch):
    """Search for the best parameters (d,) while the scatter of the trials shrinks. Returns are
    expected values, without noise.

    The defaults were chosen on darts (experiments/studies/dart_search.py, seeds from 100 on). With
    less optimism or a coarser grain the process is too certain, and hills that overtake late are
    missed. With more optimism or a finer grain scouts cost more than they find.

    Parameters
    ----------
    parameters : (d,)
        First guess.
    spread
        One number or (d,). The scatter at the beginning, as a standard deviation.
    rng
        Numpy Generator.
    optimism
        Float, default 1.85. Standard deviations of the process that are added to its mean to judge
        a place.
    insurance
        Float, default 6. Budget for scouts to places that are not promising, relative to the rise
        of the best top; 0 for none.
    grain
        Float, default 0.14 [spreads]. Details finer than this do not matter: the process sees
        every landscape through an additional blur of this length.
    every
        Int, default 5. After so many trials the search looks for a place for a scout.
    clearing
        Float, default 1 [lengths of the blur]. Least distance of a scout from the best top.
    reach
        Float, default 1.25 [spreads per root of d]. Largest distance of a scout from the start.
    limits : (2,)
        Smallest and largest radius of trials about the top, relative to `spread`; default (0.01,
        2).
    """

    OPTIONS = ("optimism", "insurance", "grain", "every", "clearing", "reach")
    MEMORY = (
        "founded",
        "blur",
        "rate",
        "marked",
        "top",
        "seen",
        "error",
        "new",
        "highest",
        "purse",
    )

    _highest: float | None
    _top: tuple[float, float] | None
    _process: BlurredNoise | None

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        optimism: float = 1.85,
        insurance: float = 6.0,
        grain: float = 0.14,
        every: int = 5,
        clearing: float = 1.0,
        reach: float = 1.25,
        limits: tuple[float, float] = (0.01, 2.0),
    ):
        super().__init__(parameters, spread, limits, rng)
        self._optimism = as_number(optimism, "optimism", strict=False)
        self._insurance = as_number(insurance, "insurance", strict=False)
        self._grain, self._every = as_number(grain, "grain"), as_count(every, "every")
        self._clearing, self._reach = as_number(clearing, "clearing"), as_number(reach, "reach")
        d = self._start.size
        self._niche = Niche(0, np.zeros(d), FIRST_RADIUS, np.zeros((d, d)))
        self._founded, self._highest, self._purse = 1, None, 0.0
        self._blur, self._seen, self._rate = 1.0, 1.0, 0.0
        self._marked, self._top = 0, None
        self._star: list[np.ndarray] = []
        self._probed: list[tuple[int, np.ndarray, float]] = []
        self._records: list[tuple[int, np.ndarray, float, float]] = []
        self._error, self._new, self._process = FIRST_ERROR, False, None

    @property
    def parameters(self) -> np.ndarray:
        """Best top (d,)."""
        return self._start + self._scale * self._niche.centre

    @property
    def exploration_size(self) -> float:
        """Radius of the trials at the best top, in units of the spread."""
        return self._niche.radius

    @property
    def blur(self) -> float:
        """Estimated scatter of the trials now, a standard deviation in units of the spread."""
        return float(np.sqrt(max(self._variance(self.n_asked), 0.0)))

    def _variance(self, number: int) -> float:
        """Variance of the blur at a trial, from the rise of the top since the last star.

        While no top is found, it continues at its last rate.
        """
        if self._top is None or not self._niche.settled:
            return self._blur + self._rate * (number - self._marked)
        value, trace = self._top
        return self._blur + 2 * (self._niche.value - value) / trace

    def _seen_through(self, variance: Number) -> Number:
        """Variance of the blur for the process: not below zero, plus that of the grain."""
        return np.maximum(variance, 0.0) + self._grain**2

    # What to try

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        number, kind = self.n_asked - 1, SCOUT
        looks = number % self._every == self._every - 1 and not self._star
        place = self._scout(number) if looks and self._niche.settled else None
        if place is None:
            kind = PROBE if self._star else TOP
            place = (
                self._niche.centre + self._star.pop()
                if self._star
                else self._niche.draw(self._rng)
            )
        return np.append(place, [kind, self._niche.identity]), self._start + self._scale * place

    def _scout(self, number: int) -> np.ndarray | None:
        """Place (d,) of the next scout, far enough from the best top; None if no scout shall go.

        It is the promising place with the smallest expected loss. If no place is promising, it is
        the one that is most probably better, provided that the budget covers its expected loss.
        """
        blur = float(self._seen_through(self._variance(number)))
        places = self._cloud(PLACES, self._reach)
        places = places[
            np.linalg.norm(places - self._niche.centre, axis=1) > self._clearing * np.sqrt(blur)
        ]
        if not len(places) or len(self._records) < self._start.size + 2:
            return None
        mean, deviation = self._posterior().predict(places, blur)
        missing = self._niche.value - mean
        hopeful = missing < self._optimism * deviation
        best = int(
            np.where(hopeful, mean, -np.inf).argmax()
            if hopeful.any()
            else (missing / deviation).argmin()
        )
        if not hopeful.any() and missing[best] > self._purse:
            return None
        # the prediction stands until the return is told, or if it fails
        self._remember(number, places[best], float(mean[best]))
        return places[best]

    def _posterior(self) -> BlurredNoise:
        """The process for all records; after a new record its error moves at most one step of
        ERRORS up the likelihood.
        """
        if self._process is None:
            _, points, variances, values = (
                np.array(part, dtype=float) for part in zip(*self._records, strict=True)
            )
            blurs = self._seen_through(variances)
            near = [
                index
                for index in (self._error, self._error - 1, self._error + 1)
                if self._new and 0 <= index < len(ERRORS)
            ]
            fits = {
                index: BlurredNoise(points, blurs, values, float(ERRORS[index]))
                for index in near or [self._error]
            }
            self._error = max(fits, key=lambda index: fits[index].log_likelihood)
            self._process, self._new = fits[self._error], False
        return self._process

    def _remember(self, number: int, place: np.ndarray, value: float) -> None:
        others = [record for record in self._records if record[0] != number]
        self._records, self._process = (
            [*others, (number, place, self._variance(number), value)][-RECORDS:],
            None,
        )
        self._new = True

    # Learning

    def _update(self, told: list[ToldTrial]) -> bool:
        place, (kind, identity) = told[0].noise[:-2], told[0].noise[-2:].astype(int)
        number, earned = told[0].number, float(told[0].outcome)
        if kind != TOP:
            self._remember(number, place, earned)
        if kind == SCOUT:
            self._purse = max(self._purse - max(self._niche.value - earned, 0.0), 0.0)
        if kind == SCOUT and earned > self._niche.value:
            self._go_over(number, place, earned)
        elif kind == PROBE and identity == self._niche.identity:
            self._probed.append((number, place, earned))
        elif kind == TOP and identity == self._niche.identity:
            self._follow(number, place, earned)
        if self._niche.settled:
            self._put_by()
        if (
            self._probed
            and not self._star
            and not any(noise[-2] == PROBE for noise, _ in self._open.values())
        ):
            self._read_star(number)
        return True

    def _put_by(self) -> None:
        """Add to the budget of scouts: `insurance` times the rise of the best top."""
        highest = self._niche.value if self._highest is None else self._highest
        self._purse += self._insurance * max(self._niche.value - highest, 0.0)
        self._highest = max(self._niche.value, highest)

    def _go_over(self, number: int, place: np.ndarray, value: float) -> None:
        """Follow the hill of a successful scout from now on."""
        d, variance = place.size, self._variance(number)
        radius = float(
            np.clip(FIRST_RADIUS * np.sqrt(self._seen_through(variance)), *self.settings.limits)
        )
        self._blur, self._marked, self._top = variance, number, None
        self._star, self._probed = [], []
        self._niche = Niche(self._founded, place, radius, np.zeros((d, d)), value)
        self._founded += 1

    def _follow(self, number: int, place: np.ndarray, earned: float) -> None:
        low, high = self.settings.limits
        largest = LARGEST_RADIUS * float(np.sqrt(self._seen_through(self._variance(number))))
        self._niche.tell(
            (number, place, earned, 0.0), np.inf, 1, np.inf, (low, max(low, min(high, largest)))
        )
        if not self._niche.settled:
            if self._founded == 1:
                self._remember(number, place, earned)
            return
        seen = float(self._seen_through(self._variance(number)))
        if (
            not self._star
            and not self._probed
            and (self._top is None or seen < (1 - STEP) * self._seen)
        ):
            self._seen = seen
            self._remember(number, place, earned)
            axes = (
                np.linalg.qr(self._rng.standard_normal((place.size, place.size)))[0]
                * STAR
                * np.sqrt(seen)
            )
            self._star = [*axes, *-axes]

    def _read_star(self, number: int) -> None:
        """Height and tr(H) of the top, by least squares with a trend, from the star and the latest
        trials in its middle.
        """
        d, told = (
            self._niche.centre.size,
            [
                *self._probed,
                *(trial[:3] for trial in self._niche.trials[-NEAR * self._niche.centre.size :]),
            ],
        )
        numbers, places, earned = (np.array(part, dtype=float) for part in zip(*told, strict=True))
        self._probed = []
        away = places - self._niche.centre
        design = np.column_stack(
            [np.ones(len(told)), numbers - number, away, np.square(away).sum(axis=1)]
        )
        answer = np.linalg.lstsq(design, earned, rcond=None)[0]
        value, steepness, trace = (
            float(answer[0]),
            float(np.linalg.norm(answer[2:-1])),
            2 * d * float(answer[-1]),
        )
        # A star that is not about a top is not used.
        if trace < 0 and steepness * d < -trace * STAR * np.sqrt(self._seen):
            self._mark(number, value - 0.5 * steepness**2 * d / trace, trace)

    def _mark(self, number: int, value: float, trace: float) -> None:
        """Update the blur by the rise of the top since the last star, with the geometric mean of
        both tr(H).
        """
        if self._top is None:
            self._blur = self._variance(number)
        else:
            change = -2 * (value - self._top[0]) / np.sqrt(trace * self._top[1])
            self._blur, self._rate = (
                float(self._blur + change),
                float(change / max(number - self._marked, 1)),
            )
        self._marked, self._top = number, (value, trace)

    # Saving

    def _policy_state(self) -> dict:
        return {
            **super()._policy_state(),
            "niche": vars(self._niche),
            "star": self._star,
            "probed": self._probed,
            "records": self._records,
        }

    @classmethod
    def _from_policy_state(
        cls, state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> Sharpening:
        search = super()._from_policy_state(state, settings, rng)
        search._niche = Niche(**state["niche"])
        search._star = [np.array(place) for place in state["star"]]
        search._probed, search._records = (
            [(number, np.array(place), *rest) for number, place, *rest in state[name]]
            for name in ("probed", "records")
        )
        return search
