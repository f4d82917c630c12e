"""What is solved for before a throw is planned, chosen by the setting `refinement`: the aim, so that
by the plan the ball comes down on the target, and the release, so that it matters least that a hand
opens early or late.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.skills.learning._first_aim import LEAST_SPAN, FirstAim
from dart_skill.skills.learning._planned_path import PlannedPath
from dart_skill.skills.learning._release import certainly_within, farthest, stretched_at
from dart_skill.skills.protocol import Part, Skill, model_type

if TYPE_CHECKING:
    from dart_skill.skills.learning._throwing import ThrowingSkill

AIM_TOLERANCE = 5e-4
"""Miss in reach and azimuth at which the search for the aim stops [m], [rad]."""
WORST_AIM = 5e-3
"""Largest miss that the search accepts [m], [rad]."""
LONGEST_AIM_STEP = 0.15
"""Longest step of the search [m], [rad]."""
MOST_AIMS = 25
"""Largest number of aims that are tried after the first."""
EARLIEST_RELEASE = -0.04
"""Earliest release that is looked for, relative to the one that was shown [s]."""
LATEST_RELEASE = 0.10
"""Latest release that is looked for, relative to the one that was shown [s]."""
NEAR = 2.0
"""Steps of the plan before and after a release that is as shown."""


class Unreachable(ValueError):
    """No plan for this target; the message says why and what would be reachable."""


@dataclass(frozen=True, eq=False)
class PlannedThrow:
    """A course, and what comes of it.

    Parameters
    ----------
    course
        Of the hand.
    release
        On its clock [s].
    landing
        Where the ball comes down if the hand follows the course and opens then (3,) [m].
    """

    course: PlannedPath
    release: float
    landing: np.ndarray


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The throw for an aim.

    * aim: reach and azimuth (2,).
    * throw: what comes of it.
    * miss: landing minus target, in reach and azimuth (2,).
    """

    aim: np.ndarray
    throw: PlannedThrow
    miss: np.ndarray

    @property
    def off(self) -> float:
        """Larger absolute value of the two."""
        return float(np.abs(self.miss).max())


class Refinement(Part):
    """Nothing is solved for: the target is aimed at, and the hand opens as it was shown."""

    def window(self, learned: ThrowingSkill) -> tuple[float, float]:
        """First and last instant at which the hand may open, relative to what was shown [s]."""
        return -NEAR * learned.configuration.step, NEAR * learned.configuration.step

    def release(self, learned: ThrowingSkill, near: PlannedPath, hits: np.ndarray) -> float:
        """Instant at which the hand opens [s].

        Parameters
        ----------
        near
            Course in the window.
        hits
            Where balls come down that leave the hand at its steps (n, 3) [m].
        """
        return learned.release

    def throw(self, learned: ThrowingSkill, target: np.ndarray) -> tuple[np.ndarray, PlannedThrow]:
        """The point that is aimed at (3,) [m], and the throw, for a target (3,) [m].

        Raises
        ------
        Unreachable
            If there is none.
        """
        return target, learned.throw_for(target)


class _OfThrows(Refinement):
    @classmethod
    def refusal(cls, skill: Skill) -> str:
        from dart_skill.skills.learning._throwing import ThrowingSkill

        thrown = issubclass(model_type(skill), ThrowingSkill)
        return "" if thrown else "nothing of it is thrown"


class FarthestRelease(_OfThrows):
    """The hand opens where the ball flies farthest, which depends least on the instant."""

    def window(self, learned: ThrowingSkill) -> tuple[float, float]:
        return EARLIEST_RELEASE, LATEST_RELEASE

    def release(self, learned: ThrowingSkill, near: PlannedPath, hits: np.ndarray) -> float:
        k, after = farthest(learned.surface.coordinates(hits)[:, 0])
        top = float(near.time[k] + after * (near.time[k + 1] - near.time[k]))
        # Few demonstrations may send the hand beyond the arm's reach: then it lets go before it is
        # there.
        if certainly_within(near.position[:, :3], learned.registration):
            return top
        position, _ = learned.registration.poses(near.position[:, :3], near.hand_quaternion)
        return min(top, max(float(near.time[0]), stretched_at(near.time, position)))


class SolvedAim(_OfThrows):
    """The task parameter is changed until the plan's own landing is on the target."""

    def __init__(self) -> None:
        self._first_aims: dict[tuple[float, float], FirstAim | None] = {}

    def throw(self, learned: ThrowingSkill, target: np.ndarray) -> tuple[np.ndarray, PlannedThrow]:
        found = self._solve(learned, target)
        return learned.surface.point(found.aim, target), found.throw

    def _solve(self, learned: ThrowingSkill, target: np.ndarray) -> _Attempt:
        """The aim whose throw lands on the target, found by Broyden's method in reach and azimuth.
        It starts at the aim that `FirstAim` tells, or at the target.
        """
        attempt, slope = self._first_attempt(learned, target)
        best = attempt
        for _ in range(MOST_AIMS):
            if attempt.off < AIM_TOLERANCE:
                break
            step = -np.linalg.solve(slope, attempt.miss)
            step *= min(1.0, LONGEST_AIM_STEP / np.abs(step).max())
            after = _attempt(learned, attempt.aim + step, target)
            slope += np.outer(after.miss - attempt.miss - slope @ step, step) / (step @ step)
            attempt = after
            if attempt.off < best.off:
                best = attempt
        if best.off > WORST_AIM:
            raise Unreachable(
                f"no aim was found whose plan lands on {target.round(3)}; the nearest misses by"
                f" {abs(best.miss[0]):.3f} m"
            )
        return best

    def _first_attempt(
        self, learned: ThrowingSkill, target: np.ndarray
    ) -> tuple[_Attempt, np.ndarray]:
        """The first throw of the search, and how its landing changes with the aim (2, 2), as far
        as that is known.
        """
        place, known = learned.surface.coordinates(target), self._first_aim(learned, target)
        told = None if known is None else known.at(place)
        if told is not None:
            with suppress(Unreachable):
                return _attempt(learned, told[0], target), told[1]
        return _attempt(learned, place, target), np.eye(2)

    def _first_aim(self, learned: ThrowingSkill, target: np.ndarray) -> FirstAim | None:
        """What three throws tell of all, worked out once for a height of the rim, to the
        millimetre; None where each target has a model of its own, or frames do not turn with
        targets.
        """
        c = learned.configuration
        if learned.is_local or not c.frames_turn:
            return None
        level = (learned.release, 0.0 if c.board else round(float(target[2]), 3))
        if level not in self._first_aims:
            self._first_aims[level] = _told_first_aim(learned, np.array([*target[:2], level[1]]))
        return self._first_aims[level]


class SolvedFlight(SolvedAim, FarthestRelease):
    """Both: the aim is solved for throws that let go where the ball flies farthest."""


def _attempt(learned: ThrowingSkill, aim: np.ndarray, target: np.ndarray) -> _Attempt:
    surface = learned.surface
    throw = learned.throw_for(surface.point(aim, target))
    return _Attempt(aim, throw, surface.coordinates(throw.landing) - surface.coordinates(target))


def _told_first_aim(learned: ThrowingSkill, target: np.ndarray) -> FirstAim | None:
    surface, shown = learned.surface, learned.shown_coordinates
    low, high = shown[:, 0].min(), shown[:, 0].max()
    if high - low < LEAST_SPAN:
        return None
    aims = np.array([[reach, np.median(shown[:, 1])] for reach in (low, 0.5 * (low + high), high)])
    try:
        landings = [learned.throw_for(surface.point(aim, target)).landing for aim in aims]
    except Unreachable:
        return None
    return FirstAim.of(aims, surface.coordinates(np.array(landings)))
