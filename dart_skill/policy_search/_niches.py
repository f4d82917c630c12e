"""A search that follows several optima of a changing landscape, and tries each only as often as it
pays.

* Every hill is a niche with a quadratic model of its own (`_niche`). Most trials are small steps
  about the best niche.
* A clock counts the change of the landscape: by how much the best value went up or down. So
  knowledge ages by change and not by waiting.
* Another niche is visited when it may have overtaken the best one. This is judged by the line
  through the values of its visits (`_trend`) and its error. So visits are frequent near a tie, and
  rare for a niche that falls behind.
* A scout is a trial of an unknown place. It goes where a Gaussian process over everything seen
  (`_surrogate`) predicts the largest possible value, among places that are not known and far
  enough from all niches. It goes only if such a place could become the best before the clock has
  doubled.
* A known place founds a new niche if it could become the best, and if a valley divides it from
  every niche. The new niche is climbed at once.
* Of two niches that are too near to each other the worse is given up (A. Petrowski, A clearing
  procedure as a niching method for genetic algorithms, 1996).

    search = Niches(aim, spread, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, score(trial.parameters))
    search.parameters, search.optima
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number
from dart_skill.policy_search._gaussian_process import FIRST, LENGTHS, Surrogate
from dart_skill.policy_search._niche import (
    REMEMBERED,
    Niche,
    NicheSearch,
    forecast,
    n_coefficients,
)
from dart_skill.policy_search._search import SearchSettings, ToldTrial

SCOUT = -1
"""Identity of a trial that belongs to no niche."""
LANDMARKS = 150
"""Number of trials, of scouts and of all niches but the best, that are remembered."""
THINNING = 0.1
"""Distance within which a trial replaces landmarks [spreads per root of the dimension]."""
PLACES = 200
"""Number of places among which a scout chooses."""
KNOWN = 0.3
"""Standard deviation of the surrogate below which a place is known [standard deviations of the
landscape].
"""
VALLEY = 0.15
"""Least depth of a valley that divides two hills [standard deviations of the landscape]."""
FIRST_RADIUS = 0.3
"""Radius of trials about a new niche [lengths of the surrogate], and about the first one
[spreads].
"""
LARGEST_RADIUS = 0.4
"""Largest radius of trials [lengths of the surrogate]."""
VISIT = 0.5
"""Radius of the trials of a visit to a top that is found, relative to that of its climb."""
STEADY = 0.1
"""Largest change of the common level by one trial [reliefs]; what is above it is a change of that
hill alone.
"""
FRESH = 0.3
"""Change after which a trial counts 1/e in the model of its niche [reliefs]."""
PAUSE = 10
"""Least number of trials between two scouts."""


class Landmark(NamedTuple):
    """A trial that the surrogate is made from, or the top of a niche.

    Parameters
    ----------
    number
        Of the trial.
    place
        (d,).
    value
        Its return; with noisy returns the mean of those near it.
    n_returns
        Of how many returns.
    clock
        When it was told.
    length
        Of hills at that time.
    """

    number: int
    place: np.ndarray
    value: float
    n_returns: int
    clock: float
    length: float


class Niches(NicheSearch):
    """Search for the best of several optima (d,) that rise and fall.

    In darts from 75 to 16 mm (experiments/studies/dart_search.py, 20 runs) it loses 0.044 points a
    throw, and 0.001 with its best aim. From 75 to 6 mm it finds the hill that overtakes late in 10
    of 20 runs. The scores of single darts are too noisy for it: with 12000 of them from 75 to 16
    mm and repeats of 100 or 400, its best aim lost 0.7 to 1.0 points in four runs.

    A relief is the standard deviation of the landscape within reach.

    Parameters
    ----------
    parameters : (d,)
        First guess.
    spread
        One number or (d,). Standard deviations of sensible first trials.
    rng
        Numpy Generator.
    drift
        Float, default 0.2. Expected change of the gap between two hills, relative to a change of
        the best value.
    scouting
        Float, default 6. What all scouts together may cost, relative to the change of the best
        value meanwhile.
    waiting
        Float, default 0.001 [reliefs]. Change that each trial counts for while the best value
        stays. Raise it if other hills change while the best one does not.
    most
        Int, default 4. Largest number of niches at a time.
    clearing
        Float, default 1 [spreads per root of d]. Least distance of two niches, approximately.
    reach
        Float, default 1.25 [spreads per root of d]. Largest distance of scouts from the start.
    optimism
        Float, default 2. Standard deviations of the surrogate that are added to its mean to judge
        a place.
    fading
        Float, default 20 [reliefs]. Change after which what was seen counts 1/e.
    repeats
        Int, default 1. Trials that one comparison needs: 1 for exact returns, hundreds if the
        noise exceeds the relief.
    limits : (2,)
        Smallest and largest radius of trials about an optimum, relative to `spread`; default
        (0.01, 2).
    """

    OPTIONS = (
        "drift",
        "scouting",
        "waiting",
        "most",
        "clearing",
        "reach",
        "optimism",
        "fading",
        "repeats",
    )
    MEMORY = (
        "main",
        "founded",
        "level",
        "clock",
        "change",
        "mark",
        "relief",
        "purse",
        "next_scout",
        "turns",
        "length",
    )

    _mark: float | None

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        drift: float = 0.2,
        scouting: float = 6.0,
        waiting: float = 0.001,
        most: int = 4,
        clearing: float = 1.0,
        reach: float = 1.25,
        optimism: float = 2.0,
        fading: float = 20.0,
        repeats: int = 1,
        limits: tuple[float, float] = (0.01, 2.0),
    ):
        super().__init__(parameters, spread, limits, rng)
        self._drift = as_number(drift, "drift")
        self._scouting = as_number(scouting, "scouting", strict=False)
        self._waiting = as_number(waiting, "waiting", strict=False)
        self._optimism = as_number(optimism, "optimism", strict=False)
        self._clearing, self._reach = as_number(clearing, "clearing"), as_number(reach, "reach")
        self._fading = as_number(fading, "fading")
        self._most, self._repeats = as_count(most, "most"), as_count(repeats, "repeats")
        d = self._start.size
        self._burst, self._check, self._main, self._founded = n_coefficients(d), d + 1, 0, 1
        self._niches = [Niche(0, np.zeros(d), FIRST_RADIUS, np.zeros((d, d)))]
        self._level, self._clock, self._change, self._mark = 0.0, 0.0, 0.0, None
        self._relief, self._purse, self._next_scout, self._turns = 0.0, 0.0, 0, 0
        self._indices, self._length = FIRST, float(LENGTHS[FIRST[0]]) * self._root
        self._landmarks: list[Landmark] = []

    @property
    def parameters(self) -> np.ndarray:
        """Top (d,) of the best niche."""
        return self._start + self._scale * self._best().centre

    @property
    def optima(self) -> tuple[np.ndarray, np.ndarray]:
        """Tops (n, d) of the niches, the best first, and how much less than the best each is
        estimated to earn (n,).
        """
        ranked = self._ranked()
        places = np.array([one.centre for one in ranked])
        return self._start + self._scale * places, np.array([self._gap(one) for one in ranked])

    @property
    def n_components(self) -> int:
        return len(self._niches)

    @property
    def exploration_size(self) -> float:
        """Radius of the trials of the best niche, in units of the spread."""
        return self._best().radius

    # Which niche is tried next

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        number, identity = self.n_asked - 1, SCOUT
        place = self._scout(number) if self._scout_is_due(number) else None
        if place is None:
            niche = self._due(number)
            identity, place = niche.identity, self._trial(niche)
        return np.append(place, identity), self._start + self._scale * place

    def _trial(self, niche: Niche) -> np.ndarray:
        """Place (d,) of the next trial of a niche; a visit to a top that is found begins at the
        top and stays near it.
        """
        place = niche.draw(self._rng)
        if niche.identity == self._main or not niche.settled:
            return place
        return niche.centre + (
            VISIT * (place - niche.centre) if niche.burst < self._check - 1 else 0.0
        )

    def _due(self, number: int) -> Niche:
        """The niche of the next trial: one whose visit is not over, else the one that is most
        overdue, else the best.

        Between two visits to other niches the best one has at least as many trials as the model
        has coefficients.
        """
        best = self._best()
        others = [one for one in self._niches if one is not best]
        niche = next((one for one in others if one.burst), None)
        if niche is None and others and self._turns >= self._burst:
            late = max(others, key=self._lead)
            if self._lead(late) > 0:
                niche = late
                self._turns = 0
                niche.burst, niche.last = self._check if niche.settled else self._burst, number
                niche.visits = [*niche.visits, (self._clock, niche.relative, niche.error)][
                    -REMEMBERED:
                ]
        if niche is None:
            self._turns += 1
            return best
        niche.burst -= 1
        return niche

    def _lead(self, niche: Niche) -> float:
        """How far above the best niche this one may be by now."""
        if not niche.visits:
            return np.inf
        value, deviation = forecast(niche.visits, self._clock, self._drift)
        return value + deviation - self._best().relative

    def _gap(self, niche: Niche) -> float:
        return max(self._best().relative - niche.relative, 0.0)

    def _best(self) -> Niche:
        return next(one for one in self._niches if one.identity == self._main)

    def _niche(self, identity: int) -> Niche | None:
        return next((one for one in self._niches if one.identity == identity), None)

    def _ranked(self) -> list[Niche]:
        return sorted(
            self._niches, key=lambda one: (one.identity != self._main, -one.relative, one.identity)
        )

    # Scouts

    def _beginning(self) -> bool:
        return len(self._landmarks) <= self._start.size + 2

    def _scout_is_due(self, number: int) -> bool:
        self._pass(self._waiting * self._relief)
        due = (
            number >= self._next_scout
            and number % 2 == 1
            and (self._purse > 0 or self._beginning())
        )
        if due:
            self._next_scout = number + PAUSE
        return due

    def _scout(self, number: int) -> np.ndarray | None:
        """The place (d,) with the largest possible value, far enough from all niches; None if it
        could not become the best.
        """
        places = self._cloud(PLACES, self._reach)
        if self._beginning():
            self._remember(number, places[0], 0.0)
            return places[0]
        surrogate = self._surrogate()
        mean, deviation = surrogate.predict(places)
        new = (self._distances(places).min(axis=0) > self._clear) & (
            deviation > KNOWN * surrogate.relief
        )
        hope = np.where(new, mean + self._optimism * deviation, -np.inf)
        best = int(hope.argmax())
        if hope[best] + self._repair < self._best().value:
            return None
        # the prediction stands until the return is told, or if it fails
        self._remember(number, places[best], float(mean[best]))
        return places[best]

    def _distances(self, places: np.ndarray) -> np.ndarray:
        """Distances (niches, n) from the niches to places (n, d)."""
        return np.linalg.norm(
            np.array([one.centre for one in self._niches])[:, None] - places, axis=2
        )

    @property
    def _repair(self) -> float:
        """By how much a gap may shrink until the clock has doubled."""
        return self._drift * self._clock

    @property
    def _clear(self) -> float:
        return self._clearing * self._root

    def _surrogate(self) -> Surrogate:
        usual = self._usual()
        tops = [
            Landmark(0, one.centre, one.value, self._repeats, one.clock, usual)
            for one in self._niches
            if one.known
        ]
        marks = [*self._landmarks, *tops]
        points, values = (
            np.array([mark.place for mark in marks], dtype=float),
            np.array([mark.value for mark in marks], dtype=float),
        )
        counts, lengths = (
            np.array([mark.n_returns for mark in marks], dtype=float),
            np.array([mark.length for mark in marks], dtype=float),
        )
        ages = (self._clock - np.array([mark.clock for mark in marks], dtype=float)) / max(
            self._fading * self._relief, 1e-300
        )
        surrogate = Surrogate(
            points, values, ages, counts, self._indices, lengths, usual, self._repeats == 1
        )
        self._indices, self._length = surrogate.indices, surrogate.length
        self._relief = surrogate.relief if self._repeats > 1 else float(np.std(values))
        return surrogate

    def _usual(self) -> float:
        """Length of hills from height and curvature of the best one: about a top the value falls
        as exp(-r^2 / 2 length^2).
        """
        best, first = self._best(), float(LENGTHS[FIRST[0]])
        if not best.settled or not self._landmarks:
            return first
        curvature = -float(np.trace(best.hessian)) / best.centre.size
        height = best.value - float(np.median([mark.value for mark in self._landmarks]))
        return float(
            np.clip(np.sqrt(max(height, 0.0) / curvature) / self._root, LENGTHS[0], LENGTHS[-1])
        )

    def _remember(self, number: int, place: np.ndarray, value: float) -> None:
        """Add a landmark and remove those near it; with noisy returns the new one gets the mean of
        all of them.
        """
        points = np.reshape([mark.place for mark in self._landmarks], (-1, place.size))
        near = np.linalg.norm(points - place, axis=1) < THINNING * self._root
        old = [
            mark
            for mark, close in zip(self._landmarks, near, strict=True)
            if close and mark.number != number
        ]
        count = min(sum(mark.n_returns for mark in old), self._repeats - 1)
        if count:
            before = float(
                np.average([mark.value for mark in old], weights=[mark.n_returns for mark in old])
            )
            value = (count * before + value) / (count + 1)
        kept = [mark for mark, close in zip(self._landmarks, near, strict=True) if not close]
        self._landmarks = [
            *kept,
            Landmark(number, place, value, count + 1, self._clock, self._usual()),
        ][-LANDMARKS:]

    # Learning

    def _update(self, told: list[ToldTrial]) -> bool:
        place, identity, earned = (
            told[0].noise[:-1],
            int(told[0].noise[-1]),
            float(told[0].outcome),
        )
        if self.n_told == 1:
            self._level = earned
        niche = self._niche(identity)
        if niche is not None:
            self._tell_niche(niche, told[0].number, place, earned)
        if identity != self._main:
            self._remember(told[0].number, place, earned)
        if identity == SCOUT and not self._beginning():
            self._found(told[0].number, place)
        return True

    def _tell_niche(self, niche: Niche, number: int, place: np.ndarray, earned: float) -> None:
        before, knew, fading, alarm = (
            niche.value,
            niche.known,
            FRESH * self._relief or np.inf,
            self._relief or np.inf,
        )
        visited = niche.settled and niche.burst > 0 and niche.identity != self._main
        niche.tell(
            (number, place, earned, self._change),
            fading,
            self._repeats,
            alarm,
            self._radii(),
            fits=not visited,
        )
        if niche.identity == self._main and knew:
            self._notice(niche)
            self._level += float(
                np.clip(niche.value - before, -STEADY * self._relief, STEADY * self._relief)
            )
        niche.relative, niche.clock = niche.value - self._level, self._clock
        if niche.visits and niche.known:
            niche.visits[-1] = (self._clock, niche.relative, niche.error)
            self._climb_on(niche)
        self._elect()
        self._keep_clear()

    def _climb_on(self, niche: Niche) -> None:
        """Continue the first climb of a niche while its top is not found and could become the
        best.
        """
        early = len(niche.visits) == 1 and len(niche.trials) < 3 * self._burst
        if early and not niche.settled and not niche.burst and self._gap(niche) < 2 * self._repair:
            niche.burst = self._burst // 2

    def _radii(self) -> tuple[float, float]:
        low, high = self.settings.limits
        return low, max(low, min(high, LARGEST_RADIUS * self._length / self._root))

    def _notice(self, best: Niche) -> None:
        """Advance the clock when the best value has changed by more than its error."""
        if self._mark is None:
            self._mark = best.value
        change = abs(best.value - self._mark)
        if best.settled and change > max(0.05 * self._relief, 2 * best.error):
            self._change, self._mark = self._change + change, best.value
            self._pass(change)

    def _pass(self, change: float) -> None:
        self._clock, self._purse = self._clock + change, self._purse + self._scouting * change

    def _elect(self) -> None:
        """Another niche becomes the best if it is better by more than the combined error of both."""
        best = self._best()
        for one in self._niches:
            if one.known and one.relative > best.relative + np.hypot(one.error, best.error):
                best = one
        if best.identity != self._main:
            self._main, self._mark = best.identity, None
            for one in self._niches:
                one.visits = one.visits[-1:]

    def _keep_clear(self) -> None:
        """Give up niches that are too near to a better one or out of reach."""
        ranked = self._ranked()
        self._niches = [
            ranked[0],
            *(one for rank, one in enumerate(ranked[1:], 1) if self._stays(one, ranked[:rank])),
        ]

    def _stays(self, niche: Niche, better: list[Niche]) -> bool:
        alone = all(
            np.linalg.norm(niche.centre - one.centre) > 0.8 * self._clear for one in better
        )
        return bool(alone and np.linalg.norm(niche.centre) < 1.2 * self._reach * self._root)

    def _found(self, number: int, place: np.ndarray) -> None:
        """Pay for the scout. The best known place that may be a hill of its own becomes a niche,
        if necessary in place of the worst.
        """
        surrogate, best, d = self._surrogate(), self._best(), place.size
        self._purse -= max(best.value - float(surrogate.predict(place[None])[0][0]), 0.0)
        places = np.array([mark.place for mark in self._landmarks])
        mean, deviation = surrogate.predict(places)
        new = (self._distances(places).min(axis=0) > 0.99 * self._clear) & (
            deviation < KNOWN * surrogate.relief
        )
        new &= mean + self._optimism * deviation + self._repair > best.value
        new &= self._valleys(surrogate, places) < mean - VALLEY * surrogate.relief
        if not new.any():
            return
        chosen = int(np.where(new, mean, -np.inf).argmax())
        value = float(mean[chosen])
        if len(self._niches) >= self._most:
            worst = self._ranked()[-1]
            if worst is best or worst.value >= value:
                return
            self._niches.remove(worst)
        radius = float(np.clip(FIRST_RADIUS * self._length / self._root, *self.settings.limits))
        found = Niche(
            self._founded,
            places[chosen],
            radius,
            np.zeros((d, d)),
            value,
            last=number,
            clock=self._clock,
        )
        found.relative = value - self._level
        self._niches, self._founded = [*self._niches, found], self._founded + 1

    def _valleys(self, surrogate: Surrogate, places: np.ndarray) -> np.ndarray:
        """Height (n,) of the surrogate in the shallowest of the valleys between each place and the
        niches.

        R. Ursem, Multinational evolutionary algorithms, 1999.
        """
        parts, centres = (
            np.linspace(0, 1, 12)[1:-1, None, None, None],
            np.array([one.centre for one in self._niches]),
        )
        between = places + parts * (centres[:, None] - places)
        heights = surrogate.predict(between.reshape(-1, places.shape[1]))[0]
        return heights.reshape(between.shape[:3]).min(axis=0).max(axis=0)

    # Saving

    def _policy_state(self) -> dict:
        return {
            **super()._policy_state(),
            "indices": self._indices,
            "niches": [vars(one) for one in self._niches],
            "landmarks": self._landmarks,
        }

    @classmethod
    def _from_policy_state(
        cls, state: dict, settings: SearchSettings, rng: np.random.Generator
    ) -> Niches:
        search = super()._from_policy_state(state, settings, rng)
        search._indices = tuple(state["indices"])
        search._niches = [Niche(**one) for one in state["niches"]]
        search._landmarks = [
            Landmark(number, np.array(place), *rest) for number, place, *rest in state["landmarks"]
        ]
        return search
