"""A search that follows several optima of a changing landscape, and makes each earn its trials.

Every hill is a niche with a quadratic model of its own (`_niche`). The best one is tried with tiny steps. Time is counted by a clock, how
far the best value went up or down: what was found out ages by change and not by waiting. Another niche is due when `following` times the
change since its last trial reaches what a trial would cost: its gap to the best, less what is uncertain about it. So the rate falls with
the gap, and near a tie both are followed. Scouts are paid in the same way; one goes where a Gaussian process over everything seen
(`_surrogate`) hopes for most, clear of all niches. A place worth it founds a niche. A niche keeps clear of better ones (A. Petrowski, A
clearing procedure as a niching method for genetic algorithms, 1996) and is given up when it falls too far behind.

    search = Niches(aim, spread, rng=rng)
    for trial in search.trials(3000):
        search.tell(trial, score(trial.parameters))
    search.parameters, search.optima
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..mixture._checks import as_count, as_number, as_vector
from ._niche import Niche, n_coefficients
from ._search import Settings, Told
from ._surrogate import FIRST, LENGTHS, Surrogate
from .baselines import VectorSearch

SCOUT = -1  # in the place of a niche's identity
LANDMARKS = 150  # trials of scouts and lesser niches that are remembered
THINNING = 0.1  # a trial takes the place of landmarks this near [spreads per root of the dimension]
PLACES = 200  # among which a scout chooses
FIRST_RADIUS = 0.3  # of trials about a new niche, in lengths of the surrogate; of the first one, in spreads
LARGEST_RADIUS = 0.4  # in lengths of the surrogate
STEADY = 0.1  # largest change of the common level by one trial [reliefs]; more is a hill that falls by itself
FRESH = 0.3  # change that takes the weight of a trial in the model of its niche to 1/e [reliefs]
PAUSE = 10  # fewest trials between scouts


class Niches(VectorSearch):
    """Search for the best of several optima (d,) that rise and fall, from a first guess and the `spread` of sensible first trials.

    following, scouting: what each niche but the best, and what scouts, may cost in all, over the change of the best value meanwhile.
    waiting: what each of these may cost per trial, in reliefs, also while the best value stays; raise it where others change by themselves.
    most: niches at a time. hopeless: a niche so far behind is given up, in reliefs (standard deviations of the landscape within reach).
    clearing: two niches are at least so far apart, and reach: scouts stay so near to the beginning, in spreads per root of the dimension.
    optimism: standard deviations of the surrogate that count as hope. fading: change that takes what was seen to 1/e, in reliefs.
    repeats: trials that one comparison needs, 1 for exact returns, hundreds when noise exceeds the relief.
    limits: smallest and largest radius of trials about an optimum, as multiples of `spread`.

    Darts from 75 to 6 mm: the defaults take the hill that overtakes late in 15 of 20 runs, and pay 0.12 points a throw
    (from 75 to 16 mm); following = scouting = hopeless = 2 with waiting = 0.002 pays 0.02 and takes it in 2 of 20. They are
    "niches" and "niches_thrifty" in experiments/dart_search.py.
    """

    def __init__(
        self,
        parameters: ArrayLike,
        spread: ArrayLike,
        *,
        rng: np.random.Generator,
        following: float = 8.0,
        scouting: float = 3.0,
        waiting: float = 0.005,
        most: int = 4,
        hopeless: float = 10.0,
        clearing: float = 1.0,
        reach: float = 1.25,
        optimism: float = 1.0,
        fading: float = 3.0,
        repeats: int = 1,
        limits: tuple[float, float] = (0.01, 2.0),
    ):
        settings = Settings("constant", "rank", 1, 1, 2, 0.0, tuple(as_vector(limits, "limits", 2).tolist()))
        super().__init__(parameters, spread, settings, rng)
        self._following = as_number(following, "following", strict=False)
        self._scouting = as_number(scouting, "scouting", strict=False)
        self._waiting = as_number(waiting, "waiting", strict=False)
        self._optimism = as_number(optimism, "optimism", strict=False)
        self._hopeless, self._clearing = as_number(hopeless, "hopeless"), as_number(clearing, "clearing")
        self._reach, self._fading = as_number(reach, "reach"), as_number(fading, "fading")
        self._most, self._repeats = as_count(most, "most"), as_count(repeats, "repeats")
        d = self._start.size
        self._root, self._burst = float(np.sqrt(d)), n_coefficients(d)
        self._niches, self._main, self._founded = [Niche(0, np.zeros(d), FIRST_RADIUS, np.zeros((d, d)))], 0, 1
        self._level, self._clock, self._mark = 0.0, 0.0, None
        self._relief, self._purse, self._next_scout, self._turns = 0.0, 0.0, 0, 0
        self._indices, self._length = FIRST, float(LENGTHS[FIRST[0]]) * self._root
        self._landmarks: list[tuple[int, np.ndarray, float, int, float]] = []

    @property
    def parameters(self) -> np.ndarray:
        """Top (d,) of the best niche."""
        return self._start + self._scale * self._best().centre

    @property
    def optima(self) -> tuple[np.ndarray, np.ndarray]:
        """Tops (n, d) of the niches, the best first, and how much less than it they are thought to earn (n,)."""
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

    # Whose turn it is

    def _draw(self) -> tuple[np.ndarray, np.ndarray]:
        number, identity = self.n_asked - 1, SCOUT
        place = self._scout(number) if self._scout_is_due(number) else None
        if place is None:
            niche = self._due(number)
            identity, place = niche.identity, niche.draw(self._rng)
        return np.append(place, identity), self._start + self._scale * place

    def _due(self, number: int) -> Niche:
        """The niche whose burst is not over, else the most overdue, else the best, which has at least as many turns as all others."""
        best = self._best()
        others = [one for one in self._niches if one is not best]
        niche = next((one for one in others if one.burst), None)
        if niche is None and self._turns >= self._burst:
            late = max(others, key=lambda one: self._credit(one, number), default=None)
            if late is not None and self._credit(late, number) > 0:
                niche, self._turns = late, 0
                niche.burst, niche.last, niche.clock = self._burst, number, self._clock
        if niche is None:
            self._turns += 1
            return best
        niche.burst -= 1
        return niche

    def _credit(self, niche: Niche, number: int) -> float:
        """What a burst of the niche may cost after so long, less what it costs if all that is uncertain is in its favour."""
        allowed = self._following * (self._clock - niche.clock) + self._waiting * self._relief * (number - niche.last - 1)
        gap = self._gap(niche)
        return allowed - self._burst * max(gap - niche.error - self._best().error, gap / 2)

    def _gap(self, niche: Niche) -> float:
        return max(self._best().relative - niche.relative, 0.0)

    def _best(self) -> Niche:
        return self._niche(self._main)

    def _niche(self, identity: int) -> Niche | None:
        return next((one for one in self._niches if one.identity == identity), None)

    def _ranked(self) -> list[Niche]:
        return sorted(self._niches, key=lambda one: (one.identity != self._main, -one.relative, one.identity))

    # Scouts

    def _beginning(self) -> bool:
        return len(self._landmarks) <= self._start.size + 2

    def _scout_is_due(self, number: int) -> bool:
        self._purse += self._waiting * self._relief
        due = number >= self._next_scout and number % 2 == 1 and (self._purse > 0 or self._beginning())
        if due:
            self._next_scout = number + PAUSE
        return due

    def _scout(self, number: int) -> np.ndarray | None:
        """The place (d,) of most hope that is clear of all niches, if there is one."""
        places = self._cloud()
        if self._beginning():
            self._remember(number, places[0], 0.0)
            return places[0]
        mean, deviation = self._surrogate().predict(places)
        hope = np.where(self._distances(places).min(axis=0) > self._clear, mean + self._optimism * deviation, -np.inf)
        best = int(hope.argmax())
        if not np.isfinite(hope[best]):
            return None
        self._remember(number, places[best], float(mean[best]))  # as believed until it is told, or for good if it fails
        return places[best]

    def _cloud(self) -> np.ndarray:
        """Places (n, d), uniform in the ball within reach."""
        d = self._start.size
        directions = self._rng.standard_normal((PLACES, d))
        sizes = self._reach * self._root * self._rng.random((PLACES, 1)) ** (1 / d)
        return sizes * directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def _distances(self, places: np.ndarray) -> np.ndarray:
        """From niches to places, (niches, n)."""
        return np.linalg.norm(np.array([one.centre for one in self._niches])[:, None] - places, axis=2)

    @property
    def _clear(self) -> float:
        return self._clearing * self._root

    def _surrogate(self) -> Surrogate:
        tops = [(0, one.centre, one.relative, self._repeats, self._clock) for one in self._niches if one.known]
        _, points, values, counts, clocks = (np.array(part, dtype=float) for part in zip(*self._landmarks, *tops, strict=True))
        ages = (self._clock - clocks) / max(self._fading * self._relief, 1e-300)
        surrogate = Surrogate(points, values, ages, counts, self._indices)
        self._indices, self._length = surrogate.indices, surrogate.length
        self._relief = surrogate.relief if self._repeats > 1 else float(np.std(values))
        return surrogate

    def _remember(self, number: int, place: np.ndarray, relative: float) -> None:
        """A landmark instead of those near it; of noisy returns, with their mean."""
        points = np.reshape([mark[1] for mark in self._landmarks], (-1, place.size))
        near = np.linalg.norm(points - place, axis=1) < THINNING * self._root
        old = [mark for mark, close in zip(self._landmarks, near, strict=True) if close and mark[0] != number]
        count = min(sum(mark[3] for mark in old), self._repeats - 1)
        if count:
            relative = (count * float(np.average([mark[2] for mark in old], weights=[mark[3] for mark in old])) + relative) / (count + 1)
        kept = [mark for mark, close in zip(self._landmarks, near, strict=True) if not close]
        self._landmarks = [*kept, (number, place, relative, count + 1, self._clock)][-LANDMARKS:]

    # Learning

    def _learn(self) -> bool:
        self._fresh, changed = 0, self._update([self._told[-1]])
        self.n_updates += changed
        return changed

    def _update(self, told: list[Told]) -> bool:
        place, identity, earned = told[0].noise[:-1], int(told[0].noise[-1]), float(told[0].outcome)
        if self.n_told == 1:
            self._level = earned
        niche = self._niche(identity)
        if niche is not None:
            self._tell_niche(niche, told[0].number, place, earned)
        if identity != self._main:
            self._remember(told[0].number, place, earned - self._level)
        if identity == SCOUT and not self._beginning():
            self._found(told[0].number, place)
        return True

    def _tell_niche(self, niche: Niche, number: int, place: np.ndarray, earned: float) -> None:
        before, knew = niche.value, niche.known
        niche.tell(
            (number, place, earned, self._clock), FRESH * self._relief or np.inf, self._repeats, self._relief or np.inf, self._radii()
        )
        if niche.identity == self._main and knew:
            self._notice(niche)
            self._level += float(np.clip(niche.value - before, -STEADY * self._relief, STEADY * self._relief))
        niche.relative = niche.value - self._level
        self._elect()
        self._keep_clear()

    def _radii(self) -> tuple[float, float]:
        low, high = self.settings.limits
        return low, max(low, min(high, LARGEST_RADIUS * self._length / self._root))

    def _notice(self, best: Niche) -> None:
        """Let the clock go on when the best value went further than its error."""
        if self._mark is None:
            self._mark = best.value
        change = abs(best.value - self._mark)
        if best.settled and change > max(0.05 * self._relief, 2 * best.error):
            self._clock, self._mark, self._purse = self._clock + change, best.value, self._purse + self._scouting * change

    def _elect(self) -> None:
        """Another niche becomes the best when it is better by more than the errors of both."""
        best = self._best()
        for one in self._niches:
            if one.known and one.relative > best.relative + np.hypot(one.error, best.error):
                best = one
        if best.identity != self._main:
            self._main, self._mark = best.identity, None

    def _keep_clear(self) -> None:
        """Niches stay clear of better ones; those that cannot, or have no hope, or left what is within reach, are given up."""
        ranked = self._ranked()
        for rank, niche in enumerate(ranked):
            for better in ranked[:rank]:
                away = niche.centre - better.centre
                distance = float(np.linalg.norm(away))
                if distance < self._clear:
                    niche.centre = better.centre + away * self._clear / max(distance, 1e-300)
        self._niches = [ranked[0], *(one for rank, one in enumerate(ranked[1:], 1) if self._stays(one, ranked[:rank]))]

    def _stays(self, niche: Niche, better: list[Niche]) -> bool:
        alone = all(np.linalg.norm(niche.centre - one.centre) > 0.8 * self._clear for one in better)
        within = np.linalg.norm(niche.centre) < 1.2 * self._reach * self._root
        return bool(alone and within and not (niche.trials and self._gap(niche) > self._hopeless * self._relief))

    def _found(self, number: int, place: np.ndarray) -> None:
        """Pay the scout; the best known place that is clear of the niches, and has hope, becomes one, if need be for the worst."""
        surrogate, best, d = self._surrogate(), self._best(), place.size
        self._purse -= max(best.relative - float(surrogate.predict(place[None])[0][0]), 0.0)
        places = np.array([mark[1] for mark in self._landmarks])
        mean, deviation = surrogate.predict(places)
        new = (self._distances(places).min(axis=0) > 0.99 * self._clear) & (deviation < 0.5 * surrogate.relief)
        new &= mean > best.relative - self._hopeless * self._relief
        if not new.any():
            return
        chosen = int(np.where(new, mean, -np.inf).argmax())
        if len(self._niches) >= self._most:
            worst = self._ranked()[-1]
            if worst is best or worst.relative >= mean[chosen]:
                return
            self._niches.remove(worst)
        radius = float(np.clip(FIRST_RADIUS * self._length / self._root, *self.settings.limits))
        new_one = Niche(
            self._founded, places[chosen], radius, np.zeros((d, d)), relative=float(mean[chosen]), last=number, clock=self._clock
        )
        self._niches, self._founded = [*self._niches, new_one], self._founded + 1

    # Saving

    def _policy_state(self) -> dict:
        return {
            **super()._policy_state(),
            "options": {name: getattr(self, f"_{name}") for name in OPTIONS},
            "memory": {name: getattr(self, f"_{name}") for name in MEMORY},
            "indices": list(self._indices),
            "niches": [one.state() for one in self._niches],
            "landmarks": [[number, place.tolist(), *rest] for number, place, *rest in self._landmarks],
        }

    @classmethod
    def _from_policy_state(cls, state: dict, settings: Settings, rng: np.random.Generator) -> Niches:
        search = cls(state["start"], state["scale"], rng=rng, limits=settings.limits, **state["options"])
        for name in MEMORY:
            setattr(search, f"_{name}", state["memory"][name])
        search._indices = tuple(state["indices"])
        search._niches = [Niche.from_state(one) for one in state["niches"]]
        search._landmarks = [(number, np.array(place), *rest) for number, place, *rest in state["landmarks"]]
        return search


OPTIONS = ("following", "scouting", "waiting", "most", "hopeless", "clearing", "reach", "optimism", "fading", "repeats")
MEMORY = ("main", "founded", "level", "clock", "mark", "relief", "purse", "next_scout", "turns", "length")
