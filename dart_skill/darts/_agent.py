"""An agent that knows the board. It estimates its own spread from its own darts while that spread
changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.darts._recent_hits import RecentHits
from dart_skill.darts._sigma_belief import SigmaBelief
from dart_skill.darts._spread import Spread

EVIDENCE = ("scores", "hits")


class ModelBasedAgent:
    """Aims where the expected score is highest for the spread that is estimated from the darts so
    far.

    The expected score of every aim is known for every spread, so that the agent needs no
    exploration.

        agent = ModelBasedAgent()
        agent.tell(score_thrown_at(agent.aim))

    Parameters:

    * learns_from: "scores" or "hits", default "scores". What the agent learns of a dart, and what
      it estimates: "scores": one sigma that changes from throw to throw, as a probability
      distribution (a hidden Markov model). The aim has the highest expected score under that
      distribution. "hits": the most likely covariance of the last hits about their aims. A bias
      counts as spread. The aim has the highest expected score for that covariance.
    * window: int, default 50, for "hits". Number of the last hits that are used.
    * least: int, default 10, for "hits". Number of hits before the first estimate; until then the
      aim is the bull.
    * every: int, default 5, for "hits". Number of hits between two estimates.
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

        seen: its score, or its hit (2,) [mm], as `learns_from` says; ValueError for what is
        impossible.
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
