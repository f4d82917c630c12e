"""An agent that knows the board and learns its own precision from its own scores, throw by throw, while that precision changes.

The state is (log sigma, its change per throw) on a grid; a hidden Markov model predicts it and each score, which is a known probability for
every aim and sigma, corrects it. The aim is the one with the highest expected score under what is believed of sigma.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.darts._board import BED_SCORES, POSSIBLE_SCORES
from dart_skill.darts._exact import bed_probabilities
from dart_skill.darts._path import optimum_path

LOWEST, HIGHEST, N_SIGMAS = 3.0, 150.0, 200
"""Sigmas that are held for possible [mm]."""
RATES = np.array([-4.0, -3.0, -2.0, -1.4, -1.0, -0.7, -0.45, -0.25, -0.1, 0.0, 0.1, 0.25]) * 1e-3
"""Changes of log sigma per throw that are held for possible: practice rather than decline."""
RATE_CHANGES = 0.005
"""Probability per throw that the rate becomes a neighbouring one."""


@dataclass(frozen=True, eq=False)
class _Table:
    """For aims (a, 2) [mm] and sigmas (s,) [mm]: probability of each possible score (a, s, 62) and expected score (a, s)."""

    sigmas: np.ndarray
    aims: np.ndarray
    likelihood: np.ndarray
    expected: np.ndarray


@lru_cache(maxsize=1)
def _table() -> _Table:
    sigmas = np.geomspace(LOWEST, HIGHEST, N_SIGMAS)
    path = optimum_path(LOWEST, HIGHEST)
    # Only the best aim of some sigma is ever aimed at.
    aims = np.unique(path.aims.round(2), axis=0)
    beds = np.stack([bed_probabilities(aims, sigma) for sigma in sigmas], axis=1)
    of_score = (np.asarray(BED_SCORES)[:, None] == np.asarray(POSSIBLE_SCORES)).astype(float)
    return _Table(sigmas, aims, beds @ of_score, beds @ np.asarray(BED_SCORES, dtype=float))


class ModelBasedAgent:
    """Where to aim next, from the scores so far.

        agent = ModelBasedAgent()
        agent.tell(score_thrown_at(agent.aim))

    aim (2,) [mm]; belief (s,): probability of each of `sigmas` (s,) [mm].
    """

    def __init__(self):
        self._known = _table()
        self.sigmas = self._known.sigmas
        self._belief = np.full((len(RATES), N_SIGMAS), 1.0 / (len(RATES) * N_SIGMAS))
        self._shift = RATES / np.log(self.sigmas[1] / self.sigmas[0])
        self._choose()

    @property
    def aim(self) -> np.ndarray:
        """Best aim (2,) [mm] for what is believed."""
        return self._known.aims[self._aimed].copy()

    @property
    def belief(self) -> np.ndarray:
        return self._belief.sum(axis=0)

    @property
    def sigma(self) -> float:
        """Mean of log sigma, as sigma [mm]."""
        return float(np.exp(self.belief @ np.log(self.sigmas)))

    def tell(self, score: int) -> None:
        """What the dart that was thrown at `aim` scored; ValueError for a score that a single dart cannot make."""
        place = np.flatnonzero(np.asarray(POSSIBLE_SCORES) == score)
        if place.size == 0:
            raise ValueError(f"one dart cannot score {score!r}; a miss is 0, the most is 60")
        self._belief *= self._known.likelihood[self._aimed, :, place[0]]
        total = self._belief.sum()
        # A score that nothing believed can explain (a rounded probability of zero) says nothing about what is left.
        self._belief = self._belief / total if total > 0.0 else np.full_like(self._belief, 1.0 / self._belief.size)
        self._predict()
        self._choose()

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

    def _choose(self) -> None:
        self._aimed = int(np.argmax(self._known.expected @ self.belief))
