"""A skill that throws, is told what came of it, and throws better: three ways to learn from one's own throws.

`bootstrap` (thesis 8.2): a throw is one more demonstration of how to hit the place where it came down. `residual`: the repeatable miss is
learned and taken out of the next plan (`correction`). `power` (5.1): PoWER searches for the offsets and slopes of such a correction, with
the error as the return. With each of them the hand is told to open as early as it has needed lately (`hand_delay`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dart_skill.checks import to_the_nanosecond
from dart_skill.movement.frames import azimuth_of, turn_matrix
from dart_skill.policy_search import PoWER
from dart_skill.policy_search import Trial as SearchTrial
from dart_skill.recording import Demonstration
from dart_skill.robot.throw_plan import ThrowPlan
from dart_skill.skill.improve.correction import Correction, CorrectionSettings, corrected, repeatable_miss
from dart_skill.skill.improve.hand_delay import HandDelay, likely_late
from dart_skill.skill.improve.practice import Practice, PracticeSettings, Verdict
from dart_skill.skill.improve.steadiness import LEAST, STEP, Steadiness
from dart_skill.skill.learn.configuration import DEFAULT, SkillConfiguration
from dart_skill.skill.learn.preparation import prepare

METHODS = ("residual", "bootstrap", "both", "power", "none")
MIDDLE = 2.0
"""Distance [m] at which the slope of PoWER's correction changes nothing."""
SPREAD = np.array([0.05, 0.05, 0.02, 0.02])
"""Of PoWER's first trials: offset along [m], slope along [1], offset across [m], slope across [1]."""


@dataclass(frozen=True)
class Told:
    """What became of a throw that was told: whether it was learned from, and why not; `left`: along and across, what of the error [m] the
    delay of the hand does not explain, so that a perfect skill would have avoided it, nan if nobody knows; ids of what was forgotten
    for it.
    """

    kept: bool
    reason: str = ""
    left: tuple[float, float] = (np.nan, np.nan)
    forgotten: tuple[str, ...] = ()


class PractisingSkill:
    """Demonstrations, own throws, and what each method makes of them.

    method: one of METHODS; steady_every: after so many throws the release may be moved farther to where the hand's delay matters least
    (`steadiness`), 0 for never.
    """

    def __init__(
        self,
        shown: Sequence[Demonstration],
        configuration: SkillConfiguration = DEFAULT,
        method: str = "residual",
        memory: PracticeSettings | None = None,
        settings: CorrectionSettings | None = None,
        rng: np.random.Generator | None = None,
        steady_every: int = 0,
    ):
        if method not in METHODS:
            raise ValueError(f"there is no way to practise '{method}': choose one of {', '.join(METHODS)}")
        if method == "power" and configuration.board:
            raise ValueError("PoWER's offsets and slopes are those of baskets: practise darts with residual, bootstrap or both")
        self.method, self._steady_every = method, steady_every
        self.practice = Practice(shown, configuration, memory)
        self.skill = self.practice.learn()
        self._game = configuration.game
        self.correction = Correction(settings, self._game.surface) if method in ("residual", "both") else None
        self._search = PoWER(np.zeros(4), SPREAD, rng=rng or np.random.default_rng(0)) if method == "power" else None
        self._trial: SearchTrial | None = None
        # At a board the release itself is moved, and what the hand's mean delay does there is taken out with it: `steadiness`.
        self.hand = None if method == "none" or configuration.board else HandDelay(throw.hand_delay for throw in self.skill.throws)
        self.steadiness = Steadiness(self._game)
        self.release_shift, self._told, self._let_go = 0.0, 0, None

    def plan(self, target: np.ndarray, explore: bool = False) -> ThrowPlan:
        """A throw at the basket whose rim is centred at target (3,); explore: PoWER tries something new. Unreachable says why not."""
        target = np.asarray(target, dtype=float)
        centre = self._let_go_well(target) if self._steady_every else 0.0
        skill = self.skill.releasing(self.release_shift) if self.release_shift else self.skill
        if self.correction is not None:
            return self._in_time(corrected(skill.plan(self.correction.shifted(target) - centre), target))
        if self._search is not None:
            return self._in_time(corrected(skill.plan(self._searched(target, explore)), target))
        return self._in_time(skill.plan(target))

    def tell(self, plan: ThrowPlan | None, trial: Demonstration) -> Told:
        """What came of a plan of this skill; without a plan the throw is a demonstration, whatever the method."""
        if plan is None:
            verdict = self._bootstrap(trial)
            return Told(verdict.kept, verdict.reason, forgotten=verdict.forgotten)
        try:
            seen = prepare(replace(trial, target=plan.target), replace(self.skill.configuration, relabel=True))
        except ValueError as error:
            self._trial = None
            return Told(False, str(error))
        uncertainty = seen.release.time_uncertainty
        late = likely_late(seen.hand_delay - (plan.release - plan.open_hand), uncertainty)
        place, miss = repeatable_miss(plan, seen.task, late, self._game)
        if not np.isfinite(miss).all():
            self._trial = None
            return Told(False, f"by its plan a ball that leaves the hand {late:.3f} s late comes down nowhere")
        self.steadiness.add((*plan.target, plan.release), late, miss)
        self._told += 1
        if self.hand is not None:
            self.hand.add(seen.hand_delay, uncertainty)
        if self._trial is not None:
            self._search.tell(self._trial, -float(np.linalg.norm(seen.task - plan.target)))
            self._trial = None
        if self.correction is not None:
            self.correction.add(place, miss + self._middle(plan))
        verdict = self._bootstrap(trial) if self.method in ("bootstrap", "both") else Verdict(True)
        # The plan was meant for another place if it was corrected.
        left = self._game.surface.seen_from(plan.target, place, miss)
        return Told(verdict.kept, verdict.reason, left, verdict.forgotten)

    def _in_time(self, plan: ThrowPlan) -> ThrowPlan:
        """The plan with the command to open as early as the hand has needed lately; before the first own throw, as it is."""
        if self.hand is None or not self._told:
            return plan
        return replace(plan, open_hand=to_the_nanosecond(max(0.0, plan.release - self.hand.mean)))

    def _let_go_well(self, target: np.ndarray) -> np.ndarray:
        """Move the release to where hits on a target (3,) scatter least; the median (3,) [m] of the deviations that are left."""
        rounds = self._told // self._steady_every
        if rounds == 0 or len(self.steadiness) < LEAST:
            return np.zeros(3)
        if self._let_go is None or self._let_go[0] != (rounds, *target):
            goal = target if self.correction is None else self.correction.shifted(target)
            found = self.steadiness.steadiest(lambda shift: self.skill.releasing(shift).plan(goal), self.release_shift, rounds * STEP)
            self._let_go = ((rounds, *target), *found)
        _, self.release_shift, centre = self._let_go
        return self._game.surface.offset(centre, target)

    def _middle(self, plan: ThrowPlan) -> np.ndarray:
        """How far from the hit of a release on time the own hand sends the ball, the median (2,) [m]: early and late hits fall short, and
        half of all shall. Where the release itself is moved, plans are made for that already.
        """
        few = self._steady_every or len(self.steadiness) < LEAST
        return np.zeros(2) if few else self.steadiness.scatter(plan, [0.0])[1][0]

    def _searched(self, target: np.ndarray, explore: bool) -> np.ndarray:
        """The point to plan for under PoWER's best correction, or under the one that it tries now."""
        if explore:
            self._trial = self._search.ask()
        along, along_slope, across, across_slope = self._trial.parameters if explore else self._search.parameters
        away = np.hypot(target[0], target[1]) - MIDDLE
        shift = np.array([along + along_slope * away, across + across_slope * away, 0.0])
        return target + turn_matrix(azimuth_of(target)) @ shift

    def _bootstrap(self, trial: Demonstration) -> Verdict:
        verdict = self.practice.add(trial)
        if verdict.kept:
            try:
                self.skill = self.practice.learn()
            except ValueError as error:
                self.practice.withdraw(trial.id, str(error))
                return Verdict(False, str(error))
        return verdict
