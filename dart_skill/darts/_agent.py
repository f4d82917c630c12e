"""An agent that knows the board. It estimates its own spread from its own darts while that spread
changes.

Where it sees the hits, the spread is the most likely covariance of the last ones about their aims.
Where it sees only the scores, a hidden Markov model on a grid predicts log sigma and its change
per throw. Each score corrects it: the probability of a score is known for every aim and sigma.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Set
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_vector
from dart_skill.darts._board import BED_SCORES, POSSIBLE_SCORES, RADII, bed_centres, place_of
from dart_skill.darts._estimation import estimate_from_points
from dart_skill.darts._exact import bed_probabilities, expected_score
from dart_skill.darts._optimum import Aim, best_aim, local_optima, optimum_path
from dart_skill.darts._spread import Spread

BULL = np.zeros(2)
FEWEST = 4
"""Least number of hits from which a covariance can be estimated."""


class RecentHits:
    """The last hits with their aims, and the aim with the highest expected score for the spread
    estimated from them.

    A bias counts as spread and is not corrected in the aim: practice removes it.

    Parameters
    ----------
    window
        Int, number of the last hits that are used.
    least
        Int, number of hits before the first estimate.
    every
        Int, number of hits between two estimates.
    """

    def __init__(self, window: int, least: int, every: int):
        least, every = as_count(least, "least", FEWEST), as_count(every, "every")
        self._least, self._every = least, every
        self._aims: deque[np.ndarray] = deque(maxlen=as_count(window, "window", least))
        self._hits: deque[np.ndarray] = deque(maxlen=self._aims.maxlen)
        self._n_told, self._aimed = 0, BULL
        self.spread: Spread | None = None

    @property
    def sigma(self) -> float:
        """Sigma of the spread [mm]; nan before the first estimate."""
        return float("nan") if self.spread is None else self.spread.sigma

    def tell(self, hit: ArrayLike) -> bool:
        """Learn from the hit (2,) [mm] of the dart that was thrown at the aim chosen last.

        Returns
        -------
        bool
            Whether there is a new estimate.
        """
        self._hits.append(as_vector(hit, "hit", 2))
        self._aims.append(self._aimed)
        self._n_told += 1
        if self._n_told < self._least or self._n_told % self._every:
            return False
        self.spread = estimate_from_points(
            np.array(self._hits), np.array(self._aims), model="general"
        ).spread
        return True

    def choose(self, beyond: Set[str]) -> Aim:
        """The best aim that is not in one of the beds `beyond`; before the first estimate the bull,
        or a single bed around it. The bull if no other bed is left.
        """
        aim = _first(beyond) if self.spread is None else self._best(self.spread, beyond)
        self._aimed = aim.point
        return aim

    def _best(self, spread: Spread, beyond: Set[str]) -> Aim:
        best = best_aim(spread)
        if best.bed not in beyond:
            return best
        others = (aim for aim in local_optima(spread) if aim.bed not in beyond)
        return next(others, Aim(BULL, float(expected_score(BULL, spread))))


def _first(beyond: Set[str]) -> Aim:
    """The bull, or the single bed at it that is not in `beyond`."""
    points = (BULL, *(point for point in bed_centres() if np.hypot(*point) < RADII[2]))
    aims = (Aim(point, float("nan")) for point in points)
    return next((aim for aim in aims if aim.bed not in beyond), Aim(BULL, float("nan")))


LOWEST = 3.0
"""Lowest possible sigma [mm]."""
HIGHEST = 150.0
"""Highest possible sigma [mm]."""
N_SIGMAS = 200
"""Number of possible sigmas."""
RATES = np.array([-4.0, -3.0, -2.0, -1.4, -1.0, -0.7, -0.45, -0.25, -0.1, 0.0, 0.1, 0.25]) * 1e-3
"""Possible changes of log sigma per throw; most of them are improvements."""
RATE_CHANGES = 0.005
"""Probability per throw that the rate becomes a neighbouring one."""


@dataclass(frozen=True, eq=False)
class PathTable:
    """What scores each aim can bring, by sigma.

    Parameters
    ----------
    sigmas
        (s,) [mm].
    aims
        (a, 2) [mm].
    likelihood
        (a, s, 62), probability of each possible score.
    expected
        (a, s), expected score.
    """

    sigmas: np.ndarray
    aims: np.ndarray
    likelihood: np.ndarray
    expected: np.ndarray


@lru_cache(maxsize=1)
def table() -> PathTable:
    """The table of all aims and sigmas; it is computed once."""
    sigmas = np.geomspace(LOWEST, HIGHEST, N_SIGMAS)
    path = optimum_path(LOWEST, HIGHEST)
    # Only the best aim of some sigma is ever aimed at.
    aims = np.unique(path.aims.round(2), axis=0)
    beds = np.stack([bed_probabilities(aims, sigma) for sigma in sigmas], axis=1)
    of_score = (np.asarray(BED_SCORES)[:, None] == np.asarray(POSSIBLE_SCORES)).astype(float)
    return PathTable(sigmas, aims, beds @ of_score, beds @ np.asarray(BED_SCORES, dtype=float))


class SigmaBelief:
    """Probability distribution of sigma and its rate of change, and the aim with the highest
    expected score under it.
    """

    def __init__(self) -> None:
        self._known = table()
        self.sigmas = self._known.sigmas
        self._belief = np.full((len(RATES), N_SIGMAS), 1.0 / (len(RATES) * N_SIGMAS))
        self._shift = RATES / np.log(self.sigmas[1] / self.sigmas[0])
        self._aimed = 0

    @property
    def belief(self) -> np.ndarray:
        """Probability (s,) of each of `sigmas` (s,) [mm]."""
        return self._belief.sum(axis=0)

    @property
    def sigma(self) -> float:
        """Mean of log sigma, as sigma [mm]."""
        return float(np.exp(self.belief @ np.log(self.sigmas)))

    @property
    def spread(self) -> Spread:
        """The isotropic spread with this sigma."""
        return Spread.isotropic(self.sigma)

    def tell(self, score: int | ArrayLike) -> bool:
        """Learn from the score of the dart that was thrown at the aim chosen last.

        Returns
        -------
        bool
            Whether the aim must be chosen again.
        """
        place = np.flatnonzero(np.asarray(POSSIBLE_SCORES) == score)
        if place.size == 0:
            raise ValueError(f"one dart cannot score {score!r}; a miss is 0, the most is 60")
        self._belief *= self._known.likelihood[self._aimed, :, place[0]]
        total = self._belief.sum()
        # A score that nothing believed can explain (a rounded probability of zero) says nothing
        # about what is left.
        self._belief = (
            self._belief / total
            if total > 0.0
            else np.full_like(self._belief, 1.0 / self._belief.size)
        )
        self._predict()
        return True

    def choose(self, beyond: Set[str]) -> Aim:
        """The best aim that is not in one of the beds `beyond`; the one nearest to the bull if
        none is left.
        """
        expected = self._known.expected @ self.belief
        self._aimed = int(np.argmax(expected))
        if beyond:
            allowed = np.array([place_of(aim) not in beyond for aim in self._known.aims])
            nearest = np.argmin(np.hypot(*self._known.aims.T))
            self._aimed = int(
                np.argmax(np.where(allowed, expected, -np.inf)) if allowed.any() else nearest
            )
        return Aim(self._known.aims[self._aimed], float(expected[self._aimed]))

    def _predict(self) -> None:
        """One throw later: sigma moves by its rate, and the rate may become a neighbouring one."""
        after = (1.0 - RATE_CHANGES) * self._belief
        after[1:] += 0.5 * RATE_CHANGES * self._belief[:-1]
        after[:-1] += 0.5 * RATE_CHANGES * self._belief[1:]
        after[[0, -1]] += 0.5 * RATE_CHANGES * self._belief[[0, -1]]
        up, down = np.maximum(self._shift, 0.0)[:, None], np.maximum(-self._shift, 0.0)[:, None]
        moved = (1.0 - up - down) * after
        moved[:, 1:] += up * after[:, :-1]
        moved[:, :-1] += down * after[:, 1:]
        moved[:, -1:] += up * after[:, -1:]
        moved[:, :1] += down * after[:, :1]
        self._belief = moved


EVIDENCE = ("scores", "hits")


class ModelBasedAgent:
    """Aims where the expected score is highest for the spread that is estimated from the darts so
    far.

    The expected score of every aim is known for every spread, so that the agent needs no
    exploration.

        agent = ModelBasedAgent()
        agent.tell(score_thrown_at(agent.aim))

    Parameters
    ----------
    learns_from
        "scores" or "hits", default "scores". What the agent learns of a dart, and what it
        estimates: "scores": one sigma that changes from throw to throw, as a probability
        distribution (a hidden Markov model). The aim has the highest expected score under that
        distribution. "hits": the most likely covariance of the last hits about their aims. A bias
        counts as spread. The aim has the highest expected score for that covariance.
    window
        Int, default 50, for "hits". Number of the last hits that are used.
    least
        Int, default 10, for "hits". Number of hits before the first estimate; until then the aim
        is the bull.
    every
        Int, default 5, for "hits". Number of hits between two estimates.
    """

    def __init__(
        self, learns_from: str = "scores", *, window: int = 50, least: int = 10, every: int = 5
    ):
        if learns_from not in EVIDENCE:
            raise ValueError(
                f"an agent cannot learn from '{learns_from}': choose one of {', '.join(EVIDENCE)}"
            )
        self.learns_from = learns_from
        self._estimate = (
            SigmaBelief() if learns_from == "scores" else RecentHits(window, least, every)
        )
        self._beyond: set[str] = set()
        self._best = self._estimate.choose(self._beyond)

    @property
    def aim(self) -> np.ndarray:
        """Best aim (2,) [mm]."""
        return self._best.point.copy()

    @property
    def bed(self) -> str:
        """Name of the bed that is aimed at, such as T20."""
        return self._best.bed

    @property
    def expected_score(self) -> float:
        """Expected score of a dart at the aim [points]; nan before the first estimate."""
        return self._best.expected_score

    @property
    def spread(self) -> Spread | None:
        """The estimated spread; None before the first estimate."""
        return self._estimate.spread

    @property
    def sigma(self) -> float:
        """Estimated sigma [mm]; nan before the first estimate.

        From scores it is exp of the mean of log sigma, from hits (det covariance)^(1/4).
        """
        return self._estimate.sigma

    @property
    def sigmas(self) -> np.ndarray:
        """Possible sigmas (s,) [mm] of an agent that learns from scores."""
        return self._of_scores.sigmas

    @property
    def belief(self) -> np.ndarray:
        """Probability (s,) of each of `sigmas`, for an agent that learns from scores."""
        return self._of_scores.belief

    def tell(self, seen: int | ArrayLike) -> None:
        """Learn from the dart that was thrown at `aim`.

        Parameters
        ----------
        seen
            Its score, or its hit (2,) [mm], as `learns_from` says.

        Raises
        ------
        ValueError
            For what is impossible.
        """
        if self._estimate.tell(seen):
            self._best = self._estimate.choose(self._beyond)

    def cannot(self) -> None:
        """Report that a throw at `aim` is impossible: its bed is not chosen any more, except the
        bull if no other bed remains.
        """
        self._beyond.add(self.bed)
        self._best = self._estimate.choose(self._beyond)

    @property
    def _of_scores(self) -> SigmaBelief:
        if not isinstance(self._estimate, SigmaBelief):
            raise ValueError(
                "an agent that learns from hits has no belief over sigmas, but one estimate: ask"
                " for its spread or sigma"
            )
        return self._estimate
