"""When to let go: the release at which it matters least that the hand opens early or late.

A hand that opens a few milliseconds off lets the ball leave the planned path at another point, so
that it comes down elsewhere. Along most swings there is a release at which that does not change
the hit to first order: earlier the hand is still too slow, later it points too low. How far off
its own hand is, the arm has seen in its throws; where a ball goes that leaves the path then, the
plan tells, and the misses that it left unexplained say how much the plan is wrong about that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.surface import BASKETS, Game
from dart_skill.skills.learning import landing_if_late

STEP = 0.005
"""A release is moved no farther than this [s] at a time: beyond, the path that was planned for the
old one says little.
"""
GRID = 0.001
"""Step of the instants at which hits are computed [s]."""
LEAST = 8
"""Throws that are needed before anything is said."""
MEMORY = 100
"""Latest throws that count."""
DOUBT = 0.01
"""As if throws late by this [s], taken together, had missed as the plan says: a few that are all
on time tell nothing of a slope.
"""
ROUNDS = 8


class Steadiness:
    """Remembers how late own releases were, and what of their misses the plan did not explain."""

    def __init__(self, game: Game = BASKETS):
        self._game = game
        self._throws: list[tuple[tuple[float, ...], float, np.ndarray]] = []

    def __len__(self) -> int:
        return len(self._throws)

    def add(self, kind: tuple[float, ...], late: float, miss: np.ndarray) -> None:
        """A release that came `late` [s], and the miss (2,) [m] that is not due to it by the plan;
        one that was not seen tells nothing.

        Throws of one kind, for one target, have the rest of their miss in common.
        """
        if np.isfinite(late) and np.isfinite(miss).all():
            self._throws = [*self._throws, (kind, float(late), np.asarray(miss, dtype=float))][
                -MEMORY:
            ]

    def state(self) -> list:
        """What is remembered, for JSON; kinds must be tuples of numbers."""
        return [[list(kind), late, miss.tolist()] for kind, late, miss in self._throws]

    def restore(self, state: list) -> None:
        """Remember what `state` gave, and nothing else.

        Parameters
        ----------
        state
            As it was returned.
        """
        self._throws = [
            (tuple(map(float, kind)), float(late), np.array(miss, dtype=float))
            for kind, late, miss in state
        ]

    @property
    def slopes(self) -> np.ndarray:
        """What a late release does to a hit beyond what the plan says (2,) [m/s]."""
        steepness, weight = np.zeros(2), DOUBT**2
        for kind in {kind for kind, *_ in self._throws}:
            late, miss = (
                np.array(part)
                for part in zip(
                    *(throw[1:] for throw in self._throws if throw[0] == kind), strict=True
                )
            )
            off = late - late.mean()
            steepness += off @ miss
            weight += off @ off
        return steepness / weight

    def scatter(self, plan: MotionPlan, shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the own hand does to the hits of a plan whose release is shifted (n,) [s].

        Their root mean square deviation from their mean (n,) [m], and how far their median (n, 2)
        [m] is from where the plan means to hit: about the best release early and late hits go
        astray to one side, a few of them far.
        """
        late = np.array([late for _, late, _ in self._throws])
        when = np.asarray(shifts, dtype=float)[:, None] + late
        grid = np.arange(when.min() - GRID, when.max() + 2 * GRID, GRID)
        meant = landing_if_late(plan, 0.0, self._game)
        hits = np.array(
            [
                self._game.surface.miss(hit - meant, meant)
                for hit in landing_if_late(plan, grid, self._game)
            ]
        )
        # what is due to the mean belongs to the repeatable miss
        hits += (grid - late.mean())[:, None] * self.slopes
        # (n, throws, 2)
        scattered = np.stack([np.interp(when, grid, axis) for axis in hits.T], axis=-1)
        return np.sqrt(scattered.var(axis=1).sum(axis=-1)), np.median(scattered, axis=1)

    def steadiest(
        self, plan_for: Callable[[float], MotionPlan], start: float, farthest: float
    ) -> tuple[float, np.ndarray]:
        """The shift of the release [s] at which hits scatter least, and the median (2,) [m] of
        their deviations there.

        Parameters
        ----------
        plan_for
            The plan for a shift; it is looked for from `start` on, and up to `farthest` to either
            side.
        """
        shift = best = float(np.clip(start, -farthest, farthest))
        least, centre = np.inf, np.zeros(2)
        for _ in range(ROUNDS):
            moves = np.arange(-round(STEP / GRID), round(STEP / GRID) + 1) * GRID
            rms, middle = self.scatter(plan_for(shift), moves)
            here = len(moves) // 2
            if rms[here] < least:
                best, least, centre = shift, rms[here], middle[here]
            rms[np.abs(shift + moves) > farthest + 1e-9] = np.inf
            move = moves[int(rms.argmin())]
            if move == 0.0:
                break
            shift += move
        return best, centre
