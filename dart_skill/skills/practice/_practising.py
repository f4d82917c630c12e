"""A skill that throws, is told what came of it, and throws better: three ways to learn from one's
own throws.

`bootstrap` (thesis 8.2): a throw is one more demonstration of how to hit the place where it came
down. `residual`: the repeatable miss is learned and taken out of the next plan (`correction`).
`power` (5.1): PoWER searches for the offsets and slopes of such a correction, with the error as
the return (`searching`). With each of them the hand is told to open as early as it has needed
lately (`hand_delay`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.recording import Demonstration
from dart_skill.skills.learning import (
    DEFAULT,
    PreparedThrow,
    ThrowingSkill,
    ThrowSettings,
    prepare,
)
from dart_skill.skills.observation import Slowing
from dart_skill.skills.practice._correction import (
    Correction,
    CorrectionSettings,
    corrected,
    repeatable_miss,
)
from dart_skill.skills.practice._hand_delay import USUAL_DELAY_SPREAD, HandDelay, likely_late
from dart_skill.skills.practice._memory import PracticeSettings, TrialMemory, Verdict
from dart_skill.skills.practice._newton import NewtonCorrection
from dart_skill.skills.practice._searching import CorrectionSearch
from dart_skill.skills.practice._steadiness import LEAST, STEP, Steadiness
from dart_skill.skills.protocol import PRACTICE_METHODS, Skill


@dataclass(frozen=True)
class TrialLesson:
    """What became of a throw that was reported.

    Parameters
    ----------
    kept
        Bool, whether something was learned from it.
    reason
        Str, default "". Why nothing was learned.
    left
        (along, across) [m], default nan. The part of the error that the delay of the hand does not
        explain: a perfect skill would have avoided it. nan if it is unknown.
    forgotten
        Ids of the trials that were removed from the memory for this one, default none.
    """

    kept: bool
    reason: str = ""
    left: tuple[float, float] = (np.nan, np.nan)
    forgotten: tuple[str, ...] = ()


CORRECTIONS: dict[str, type[Correction | NewtonCorrection]] = {
    "residual": Correction,
    "both": Correction,
    "newton": NewtonCorrection,
}
"""What learns from misses, by method."""


@dataclass(frozen=True, eq=False)
class _Steadied:
    """The last change of the release.

    Parameters:

    * number: int, of the round of throws in which it was made.
    * target: (3,) [m], for which it was made.
    * shift: float [s], of the release.
    * centre: (2,) [m], median deviation of the hits with this release.
    """

    number: int
    target: np.ndarray
    shift: float
    centre: np.ndarray

    def serves(self, number: int, target: np.ndarray) -> bool:
        """Whether it was made in this round and for this target (3,)."""
        return self.number == number and np.array_equal(self.target, target)


class PractisingSkill:
    """A throwing skill that learns from its own throws.

    Parameters
    ----------
    shown
        Demonstrations of a teacher.
    configuration
        ThrowSettings, default `DEFAULT`.
    method
        One of PRACTICE_METHODS, default "residual".
    memory
        PracticeSettings, how many demonstrations and trials are kept; default None: all.
    settings
        CorrectionSettings, default None: the default ones.
    rng
        Random generator for the trials of PoWER, default None: one with seed 0.
    tried
        Own throws that are remembered as demonstrations, oldest first; default none.
    steady_every
        Int, number of throws in a round; default 0. After each round the release may be moved
        farther to where the delay of the hand matters least (`steadiness`). 0: the release is not
        moved.
    of
        Skill that is practised, which may have parts of its own; default None.

    Attributes
    ----------
    skill
        The ThrowingSkill that was learned last.
    practice
        TrialMemory, the memory of demonstrations and trials.
    correction
        Correction of the repeatable miss, or NewtonCorrection; None if the method has none.
    search
        CorrectionSearch of the method "power"; None with the others.
    hand
        HandDelay that was learned; None if the method "none" is used or darts are thrown.
    steadiness
        Steadiness, what was seen of own releases.
    ball_news
        What the last throw was the first to say against the mass of the ball; empty if nothing.
    release_shift
        Float [s], by which the release was moved.
    """

    def __init__(
        self,
        shown: Sequence[Demonstration],
        configuration: ThrowSettings = DEFAULT,
        method: str = "residual",
        memory: PracticeSettings | None = None,
        settings: CorrectionSettings | None = None,
        rng: np.random.Generator | None = None,
        steady_every: int = 0,
        tried: Sequence[Demonstration] = (),
        of: Skill | None = None,
    ):
        if method not in PRACTICE_METHODS:
            raise ValueError(
                f"there is no way to practise '{method}': choose one of {', '.join(PRACTICE_METHODS)}"
            )
        if method == "power" and configuration.board:
            raise ValueError(
                "PoWER's offsets and slopes are those of baskets: practise darts with residual,"
                " bootstrap or both"
            )
        self.method = method
        self.practice = TrialMemory(shown, configuration, memory, tried, of)
        self.skill = self.practice.learn()
        self._game = configuration.game
        learner = CORRECTIONS.get(method)
        self.correction = None if learner is None else learner(settings, self._game.surface)
        self.search = (
            CorrectionSearch(rng or np.random.default_rng(0)) if method == "power" else None
        )
        # At a board the release itself is moved, and what the hand's mean delay does there is
        # taken out with it: `steadiness`.
        self.hand = (
            None
            if method == "none" or configuration.board
            else HandDelay(self._delay_of(throw) for throw in self.skill.throws)
        )
        self.steadiness = Steadiness(self._game)
        self.release_shift = 0.0
        self._flown, self.ball_news = Slowing.none(), ""
        self._steady_every = steady_every
        self._steadied: _Steadied | None = None
        self._n_told = 0

    def plan(self, target: np.ndarray, explore: bool = False) -> MotionPlan:
        """A throw at the basket whose rim has its centre at target (3,) [m]; Unreachable tells why
        there is none.

        Parameters
        ----------
        explore
            Bool, default False. Whether PoWER may try another correction than the best one.
        """
        target = np.asarray(target, dtype=float)
        self._move_release(target)
        tried = self.search.ask() if self.search is not None and explore else None
        aim = self._aim_for(target) if self.search is None else self.search.shifted(target, tried)
        plan = self._skill.plan(aim)
        if self.correction is not None or self.search is not None:
            plan = corrected(plan, target)
        plan = self._in_time(plan)
        if self.search is not None and tried is not None:
            self.search.remember(plan, tried)
        return plan

    def tell(self, plan: MotionPlan | None, trial: Demonstration) -> TrialLesson:
        """What came of a plan of this skill; without a plan the throw is a demonstration, whatever
        the method.

        Parameters
        ----------
        trial
            Plan and outcome.
        """
        if plan is None:
            verdict = self._bootstrap(trial)
            return TrialLesson(verdict.kept, verdict.reason, forgotten=verdict.forgotten)
        try:
            seen = prepare(
                trial.aimed_at(plan.thrown.target), replace(self.skill.configuration, relabel=True)
            )
        except ValueError as error:
            return TrialLesson(False, str(error))
        self._look_at_the_ball(seen.slowing)
        delay = self._delay_of(seen)
        spread = USUAL_DELAY_SPREAD if self.hand is None else self.hand.spread
        late = likely_late(
            delay - (plan.release - plan.open_hand), seen.release.time_uncertainty, spread
        )
        place, miss, explained = repeatable_miss(plan, seen.seen, late, self._game)
        if not np.isfinite([miss, explained]).all():
            return TrialLesson(
                False,
                f"by its plan a ball that leaves the hand {late:.3f} s late comes down nowhere",
            )
        self.steadiness.add((*plan.thrown.target, plan.release), late, miss - explained)
        self._n_told += 1
        beyond_usual = explained - self._middle(plan)
        if self.hand is not None:
            confirmed = self._confirms(place, miss, beyond_usual)
            self.hand.add(delay, seen.release.time_uncertainty, confirmed)
        if self.search is not None:
            self.search.tell(plan, seen.seen)
        if self.correction is not None:
            self.correction.add(place, miss, beyond_usual)
        verdict = self._bootstrap(trial) if self.method in ("bootstrap", "both") else Verdict(True)
        share = 1.0 if self.correction is None else self.correction.share
        # The plan was meant for another place if it was corrected.
        left = self._game.surface.seen_from(plan.thrown.target, place, miss - share * explained)
        return TrialLesson(verdict.kept, verdict.reason, left, verdict.forgotten)

    @property
    def ball_in_words(self) -> str:
        """What the own throws say against the mass of the ball; empty if nothing."""
        return self.skill.ball_in_words([self._flown])

    def _look_at_the_ball(self, slowing: Slowing) -> None:
        """Take what a flight tells; `ball_news` is what is said of the ball for the first time."""
        known = self.ball_in_words
        self._flown = Slowing.together([self._flown, slowing])
        self.ball_news = "" if known else self.ball_in_words

    @property
    def practised(self) -> int:
        """Own throws of which something was learned."""
        return self._n_told

    def state(self) -> dict:
        """What practice has found, for JSON: a skill that learned from the same demonstrations
        goes on from it with `restore`.

        Misses of the method "residual" are in `correction.throws`. A plan that explores is given
        up if its throw was not reported.
        """
        steadied, search, hand = self._steadied, self.search, self.hand
        return {
            "method": self.method,
            "n_told": self._n_told,
            "n_shown": self.practice.n_shown,
            "hand": None if hand is None else hand.state(),
            "steadiness": self.steadiness.state(),
            "release_shift": self.release_shift,
            "steadied": (
                steadied
                and [
                    steadied.number,
                    steadied.target.tolist(),
                    steadied.shift,
                    steadied.centre.tolist(),
                ]
            ),
            "suspicions": [] if self.correction is None else self.correction.suspicions(),
            "search": None if search is None else search.state(),
        }

    def restore(self, state: dict) -> None:
        """Go on from what `state` gave, as far as the method has use for it.

        Parameters
        ----------
        state
            As it was returned.

        Raises
        ------
        ValueError
            If it is damaged.
        """
        try:
            self._n_told, self.release_shift = int(state["n_told"]), float(state["release_shift"])
            self.steadiness.restore(state["steadiness"])
            number, target, shift, centre = state["steadied"] or (0, None, 0.0, None)
            self._steadied = (
                None
                if target is None
                else _Steadied(int(number), np.array(target), float(shift), np.array(centre))
            )
            if self.hand is not None and state["hand"] is not None:
                self.hand.restore(state["hand"])
            if self.correction is not None:
                self.correction.suspect(state["suspicions"])
            if self.search is not None and state["search"] is not None:
                self.search.restore(state["search"])
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise ValueError(
                f"what practice found is damaged ({error!r}): learn from the bag again"
            ) from error

    def _delay_of(self, throw: PreparedThrow) -> float:
        """From the command to the release [s], without that of the cameras' stamps."""
        return throw.hand_delay - self.skill.registration.delay

    @property
    def _skill(self) -> ThrowingSkill:
        """The skill with its release shifted."""
        return self.skill.releasing(self.release_shift) if self.release_shift else self.skill

    def _aim_for(self, target: np.ndarray) -> np.ndarray:
        """The point (3,) to plan for, so that the ball comes down on the target (3,)."""
        if self.correction is None:
            return target
        aim = self.correction.shifted(target)
        if self._steadied is None:
            return aim
        return aim - self._game.surface.offset(self._steadied.centre, target)

    def _in_time(self, plan: MotionPlan) -> MotionPlan:
        """The plan with the command to open as early as the hand has needed lately; before the
        first own throw, as it is.
        """
        if self.hand is None or not self._n_told:
            return plan
        return plan.opening_at(to_the_nanosecond(plan.release - self.hand.mean))

    def _move_release(self, target: np.ndarray) -> None:
        """Shift the release to where hits on a target (3,) scatter least, once there are enough
        throws; each round allows one step more.
        """
        number = self._n_told // self._steady_every if self._steady_every else 0
        if number == 0 or len(self.steadiness) < LEAST:
            return
        if self._steadied is not None and self._steadied.serves(number, target):
            return
        goal = target if self.correction is None else self.correction.shifted(target)
        shift, centre = self.steadiness.steadiest(
            lambda by: self.skill.releasing(by).plan(goal), self.release_shift, number * STEP
        )
        self._steadied = _Steadied(number, target.copy(), shift, centre)
        self.release_shift = shift

    def _confirms(self, place: np.ndarray, miss: np.ndarray, explained: np.ndarray) -> bool:
        """Whether a miss (2,) [m] at a place (2,) is nearer to what repeats there with what a late
        release explains of it than without.
        """
        repeats = np.zeros(2) if self.correction is None else self.correction.predict(place)[0][0]
        left = miss - repeats
        return bool(np.linalg.norm(left - explained) < np.linalg.norm(left))

    def _middle(self, plan: MotionPlan) -> np.ndarray:
        """How far from the hit of a release on time the own hand sends the ball, the median (2,)
        [m]: early and late hits fall short, and half of all shall. Where the release itself is
        moved, plans are made for that already.
        """
        if self._steady_every or len(self.steadiness) < LEAST:
            return np.zeros(2)
        _, middle = self.steadiness.scatter(plan, np.zeros(1))
        return middle[0]

    def _bootstrap(self, trial: Demonstration) -> Verdict:
        verdict = self.practice.add(trial)
        if verdict.kept:
            try:
                self.skill = self.practice.learn()
            except ValueError as error:
                self.practice.withdraw(trial.id, str(error))
                return Verdict(False, str(error))
        return verdict
