"""An agent that knows the board and learns its own precision from its own darts, throw by throw, while that precision changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._recent_hits import RecentHits
from dart_skill.darts._sigma_belief import SigmaBelief
from dart_skill.darts._spread import Spread

EVIDENCE = ("scores", "hits")


class ModelBasedAgent:
    """Where to aim next, from what became of the darts so far. What an aim earns is known for every spread, so that nothing is tried out.

        agent = ModelBasedAgent()
        agent.tell(score_thrown_at(agent.aim))

    * learns_from: "scores" or "hits", default "scores"; what is told of a dart, and with it what is estimated. Scores: a belief over one
      sigma and its change per throw, by a hidden Markov model; the aim is the best under all that is believed. Hits: the most likely
      covariance of the last ones about their aims, in which a bias counts as spread; the aim is the best for that.
    * window: int, default 50; so many last hits count.
    * least: int, default 10; hits before the first estimate, until then the bull is aimed at.
    * every: int, default 5; hits from one estimate to the next. These three are for an agent that learns from hits.
    """

    def __init__(self, learns_from: str = "scores", *, window: int = 50, least: int = 10, every: int = 5):
        if learns_from not in EVIDENCE:
            raise ValueError(f"an agent cannot learn from '{learns_from}': choose one of {', '.join(EVIDENCE)}")
        self.learns_from = learns_from
        self._estimate = SigmaBelief() if learns_from == "scores" else RecentHits(window, least, every)
        self._beyond: set[str] = set()
        self._best = self._estimate.choose(self._beyond)

    @property
    def aim(self) -> np.ndarray:
        """Best aim (2,) [mm] for what is known."""
        return self._best.point.copy()

    @property
    def bed(self) -> str:
        """Name of the bed that is aimed at, such as T20."""
        return self._best.bed

    @property
    def expected_score(self) -> float:
        """Of a dart at the aim [points], nan before there is an estimate."""
        return self._best.expected_score

    @property
    def spread(self) -> Spread | None:
        """As estimated, None before there is an estimate."""
        return self._estimate.spread

    @property
    def sigma(self) -> float:
        """Of the spread [mm]: from scores the mean of log sigma, from hits (det covariance)^(1/4), nan before there is an estimate."""
        return self._estimate.sigma

    @property
    def sigmas(self) -> np.ndarray:
        """Sigmas (s,) [mm] that are held for possible, of an agent that learns from scores."""
        return self._of_scores.sigmas

    @property
    def belief(self) -> np.ndarray:
        """Probability (s,) of each of `sigmas`, of an agent that learns from scores."""
        return self._of_scores.belief

    def tell(self, seen: int | ArrayLike) -> None:
        """What became of the dart that was thrown at `aim`: its score, or where it hit (2,) [mm]; ValueError for what no dart does."""
        if self._estimate.tell(seen):
            self._best = self._estimate.choose(self._beyond)

    def cannot(self) -> None:
        """No throw came about at `aim`: its bed is not aimed at any more, unless it is the last one. The bull always is."""
        self._beyond.add(self.bed)
        self._best = self._estimate.choose(self._beyond)

    @property
    def _of_scores(self) -> SigmaBelief:
        if not isinstance(self._estimate, SigmaBelief):
            raise ValueError("an agent that learns from hits has no belief over sigmas, but one estimate: ask for its spread or sigma")
        return self._estimate
