"""A thrower's sigma, estimated from the scores of single darts while it changes.

The state is log sigma and its change per throw, on a grid. A hidden Markov model predicts the
state. Each score corrects it: the probability of a score is known for every aim and sigma.
"""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._board import BED_SCORES, POSSIBLE_SCORES, place_of
from dart_skill.darts._exact import bed_probabilities
from dart_skill.darts._optimum import Aim
from dart_skill.darts._path import optimum_path
from dart_skill.darts._spread import Spread

LOWEST, HIGHEST, N_SIGMAS = 3.0, 150.0, 200
"""Lowest and highest possible sigma [mm], and number of sigmas between them."""
RATES = np.array([-4.0, -3.0, -2.0, -1.4, -1.0, -0.7, -0.45, -0.25, -0.1, 0.0, 0.1, 0.25]) * 1e-3
"""Possible changes of log sigma per throw; most of them are improvements."""
RATE_CHANGES = 0.005
"""Probability per throw that the rate becomes a neighbouring one."""


@dataclass(frozen=True, eq=False)
class Table:
    """What scores each aim can bring, by sigma.

    * sigmas: (s,) [mm].
    * aims: (a, 2) [mm].
    * likelihood: (a, s, 62), probability of each possible score.
    * expected: (a, s), expected score.
    """

    sigmas: np.ndarray
    aims: np.ndarray
    likelihood: np.ndarray
    expected: np.ndarray


@lru_cache(maxsize=1)
def table() -> Table:
    """The table of all aims and sigmas; it is computed once."""
    sigmas = np.geomspace(LOWEST, HIGHEST, N_SIGMAS)
    path = optimum_path(LOWEST, HIGHEST)
    # Only the best aim of some sigma is ever aimed at.
    aims = np.unique(path.aims.round(2), axis=0)
    beds = np.stack([bed_probabilities(aims, sigma) for sigma in sigmas], axis=1)
    of_score = (np.asarray(BED_SCORES)[:, None] == np.asarray(POSSIBLE_SCORES)).astype(float)
    return Table(sigmas, aims, beds @ of_score, beds @ np.asarray(BED_SCORES, dtype=float))


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
        """Learn from the score of the dart that was thrown at the aim chosen last; returns whether
        the aim must be chosen again.
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
