"""PoWER (thesis 5.1) over a correction of the aim, which chooses by itself what to explore.

A correction has an offset and a slope over the distance, along and across. The first throws are
made as they are planned. Their misses, by Bayesian linear regression, say where the correction
probably is and how little is known of it (C. Bishop, Pattern Recognition and Machine Learning,
2006, 3.3). PoWER begins there and explores as far as that: much where little is known, and nearly
nothing where the misses leave no doubt. From then on the error of a throw is its return, and the
length of the path of updates sets the size of the exploration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.arm import MotionPlan, same_plan
from dart_skill.movement import azimuth_of, turn_matrix
from dart_skill.policy_search import PoWER, SearchTrial, generator_state, restored_generator

MIDDLE = 2.0
"""Distance [m] at which the slope of the correction changes nothing."""
PRIOR_SPREAD = np.array([0.05, 0.05, 0.02, 0.02])
"""Standard deviations of what is thought of a correction before any throw: offset along [m], slope
along [1], offset and slope across.
"""
FIRST = 5
"""Throws as they are planned, before anything is explored: one more than the correction has
parameters.
"""
LEAST_SCATTER = 0.001
"""Standard deviation of a miss that does not repeat itself, at least [m]: as one plan that is
thrown again scatters.
"""
OPEN = 20
"""Throws that were planned to explore and not reported, at most; older ones are given up."""


@dataclass(frozen=True, eq=False)
class _Explored:
    plan: MotionPlan
    trial: SearchTrial


class CorrectionSearch:
    """Offset and slope of a correction of the aim, along and across, by PoWER.

    Parameters
    ----------
    rng
        Numpy Generator of its trials.
    """

    def __init__(self, rng: np.random.Generator):
        self._rng = rng
        self._search: PoWER | None = None
        # distance from MIDDLE, miss along, miss across
        self._seen: list[tuple[float, float, float]] = []
        self._open: list[_Explored] = []

    @property
    def parameters(self) -> np.ndarray:
        """The best correction so far (4,): offset along [m], slope along [1], offset across [m],
        slope across [1].
        """
        return np.zeros(4) if self._search is None else self._search.parameters

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations (4,) of the next trial; zero before anything is explored."""
        return np.zeros(4) if self._search is None else self._search.spread

    @property
    def open(self) -> int:
        """Plans that explore and whose throws have not been reported."""
        return len(self._open)

    def ask(self) -> SearchTrial | None:
        """A correction to be tried; None while throws are made as they are planned."""
        return None if self._search is None else self._search.ask()

    def shifted(self, target: np.ndarray, trial: SearchTrial | None = None) -> np.ndarray:
        """The point (3,) [m] to plan for, so that the ball comes down on a target.

        Parameters
        ----------
        target : (3,)
            Centre of the rim [m].
        trial
            With its correction instead of the best.
        """
        along, along_slope, across, across_slope = (
            self.parameters if trial is None else trial.parameters
        )
        away = np.hypot(target[0], target[1]) - MIDDLE
        shift = np.array([along + along_slope * away, across + across_slope * away, 0.0])
        return target + turn_matrix(azimuth_of(target)) @ shift

    def remember(self, plan: MotionPlan, trial: SearchTrial) -> None:
        """The plan that a trial became, by which its throw is known."""
        self._open = [*self._open[-OPEN + 1 :], _Explored(plan, trial)]

    def tell(self, plan: MotionPlan, landing: np.ndarray) -> None:
        """What became of a plan, whether it was one that explores or not.

        Parameters
        ----------
        landing : (3,) [m]
        """
        error = landing - plan.thrown.target
        explored = next((one for one in self._open if same_plan(one.plan, plan)), None)
        if explored is not None and self._search is not None:
            self._open.remove(explored)
            self._search.tell(explored.trial, -float(np.linalg.norm(error)))
        elif self._search is None:
            along, across, _ = turn_matrix(azimuth_of(plan.thrown.target)).T @ error
            self._seen.append(
                (float(np.hypot(*plan.thrown.target[:2])) - MIDDLE, float(along), float(across))
            )
            if len(self._seen) == FIRST:
                self._begin()

    def state(self) -> dict:
        """What was seen and searched, for JSON; plans whose throws have not been reported are
        given up.
        """
        seen = [list(one) for one in self._seen]
        if self._search is None:
            return {"seen": seen, "generator": generator_state(self._rng), "search": None}
        # which has the generator from here on
        return {
            "seen": seen,
            "generator": None,
            "search": self._search.state(),
        }

    def restore(self, state: dict) -> None:
        """Go on from what `state` gave.

        Parameters
        ----------
        state
            As it was returned.
        """
        self._seen = [
            (float(away), float(along), float(across)) for away, along, across in state["seen"]
        ]
        self._open = []
        if state["search"] is None:
            self._rng, self._search = restored_generator(state["generator"]), None
            return
        self._search = PoWER.from_state(state["search"])
        if self.parameters.shape != (4,):
            raise ValueError(
                f"a correction has 4 parameters, and {self.parameters.shape} were saved"
            )

    def _begin(self) -> None:
        away, *misses = np.array(self._seen).T
        fits = [
            correction_of(away, miss, before)
            for miss, before in zip(misses, np.split(PRIOR_SPREAD, 2), strict=True)
        ]
        mean, spread = (np.concatenate(part) for part in zip(*fits, strict=True))
        self._search = PoWER(mean, spread, rng=self._rng)


def correction_of(
    away: np.ndarray, miss: np.ndarray, before: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Offset and slope (2,) that take misses away, by Bayesian linear regression, and their
    standard deviations (2,).

    Parameters
    ----------
    away : (n,)
        Distances of the throws, from MIDDLE [m].
    miss : (n,)
        How much too far each was [m].
    before : (2,)
        Standard deviations of offset [m] and slope [1] before any throw.
    """
    inputs = np.column_stack([np.ones_like(away), away])
    fit, _, rank, _ = np.linalg.lstsq(inputs, miss, rcond=None)
    left = np.sum((miss - inputs @ fit) ** 2) / max(len(miss) - rank, 1)
    variance = max(float(left), LEAST_SCATTER**2)
    covariance = np.linalg.inv(np.diag(before**-2.0) + inputs.T @ inputs / variance)
    return -covariance @ inputs.T @ miss / variance, np.sqrt(np.diagonal(covariance))
