"""The main job in one process, without ROS: a person shows a skill, it is learned, the arm carries
it out in other situations.

Lessons, plans and landings of throws are those of the graph, to the last bit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.configuration import node_parameters
from dart_skill.common.situation import Situation
from dart_skill.darts import ModelBasedAgent, place_of
from dart_skill.session._bench_and_belt import BeltSession, BenchSession
from dart_skill.session._darts import DartsRun, Hit, own_dart, play_leg, throw_dart
from dart_skill.session._in_process import Session
from dart_skill.session._session_bag import LAYOUT, SessionBag
from dart_skill.session._summary import RunSummary, TrialResult
from dart_skill.simulation import Board, Swing
from dart_skill.skills.practice import Learner, Lesson
from dart_skill.skills.protocol import Skill, TaskOutcome

DIFFERS = (
    "a person and the cameras look at the bodies for another moment than on the graph: trials"
    " differ from those there"
)
"""What is said of skills at the bench and beside the belt."""
Say = Callable[[str], None]
"""Takes a line of progress."""


@dataclass(frozen=True)
class Job:
    """What a demo is asked for.

    Parameters
    ----------
    seed
        Of everything random.
    demonstrations, throws
        How many.
    bag
        Folder of its bag, which must not exist.
    arm
        Of config/fleet.yaml.
    settings
        Further parameters, each as NODE.PARAMETER=VALUE.
    configuration
        Of the skill, empty: as config/skill_learner.yaml has it.
    """

    seed: int
    demonstrations: int
    throws: int
    bag: Path
    arm: str = "ideal"
    settings: tuple[str, ...] = ()
    configuration: str = ""


def demo(job: Job, skill: Skill, say: Say) -> RunSummary:
    """Show a skill, learn it, and try it.

    Raises
    ------
    ValueError
        Says why the job cannot be done.
    """
    begun = time.monotonic()
    kind = _KINDS.get((skill.world, skill.told_by))
    if kind is None:
        raise ValueError(
            f"in process there are throw, darts, place, reach and stir: '{skill.name}' needs the graph,"
            " so leave out --layout in-process"
        )
    if kind is _Moving:
        say(DIFFERS)
    with ExitStack() as stack:
        arm = kind(skill, job, stack.enter_context(SessionBag(job.bag, job.seed, skill)))
        session = stack.enter_context(closing(arm.session))
        ready = time.monotonic()
        lessons, situations = skill.situations(job.seed, job.demonstrations, job.throws)
        shown, attempts = _show_all(arm, lessons, job, say)
        say(arm.learn(shown, job))
        tried_at, steps = time.monotonic(), session.steps
        darts = None
        agent = skill.agent()
        if agent is not None:
            assert isinstance(arm, _Throwing)  # an agent aims what is thrown
            trials, darts = arm.practise_darts(agent, job, say)
        else:
            trials = [
                _tried(arm, one, f"{skill.name} {number}/{job.throws}", say)
                for number, one in enumerate(situations, start=1)
            ]
        done = time.monotonic()
    step = session.plant.settings.step
    return RunSummary(
        skill=skill,
        seed=job.seed,
        bag=str(job.bag),
        demonstrations=job.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=LAYOUT,
        real_time_factor=session.steps * step / (done - ready),
        trial_real_time_factor=(session.steps - steps) * step / (done - tried_at),
        darts=darts,
    )


def _show_all(
    arm: _Throwing | _Moving, lessons: Iterator[Situation], job: Job, say: Say
) -> tuple[list[Any], int]:
    """What was shown, elsewhere for what failed, and how many attempts that took."""
    kept: list[Any] = []
    attempts, wanted, skill = 0, job.demonstrations, arm.skill
    for _ in range(2 * wanted):
        situation = next(lessons)
        lesson = arm.show(situation)
        attempts += lesson.attempts
        if not lesson.why:
            kept.append(lesson.shown)
        how = (
            f"given up: {lesson.why}"
            if lesson.why
            else f"{skill.words.lesson} after {lesson.attempts}"
        )
        say(f"demonstration {len(kept)}/{wanted}: {skill.in_words(situation)}: {how}")
        if len(kept) == wanted:
            return kept, attempts
    raise ValueError(f"only {len(kept)} of {wanted} demonstrations succeeded")


def _tried(arm: _Throwing | _Moving, situation: Situation, what: str, say: Say) -> TrialResult:
    try:
        result = arm.attempt(situation)
        became = result.in_words(arm.skill.words)
    except ValueError as error:
        outcome = TaskOutcome(False, math.nan, str(error))
        result = TrialResult(situation, outcome, str(error))
        became = f"no {arm.skill.words.trial}: {error}"
    say(f"{what}: {arm.skill.in_words(situation)}: {became}")
    return result


@dataclass(frozen=True)
class _Lesson:
    """One lesson.

    * attempts: guided movements that it took.
    * shown: the demonstration, None if it failed.
    * why: it failed, empty for one that succeeded.
    """

    attempts: int
    shown: Any = None
    why: str = ""


class _Throwing:
    """Balls and baskets, or darts and a board."""

    def __init__(self, skill: Any, job: Job, bag: SessionBag):
        self.skill, self._bag = skill, bag
        board = Board(skill.middle) if skill.world == "board" else None
        swing = None if skill.cocked is None else Swing(skill.cocked)
        self.session = Session.on_arm(
            job.arm, job.seed, job.settings, board=board, swing=swing, bag=bag
        )
        self._attempts = int(node_parameters("teacher.yaml", "teacher")["max_attempts"])

    def show(self, situation: Situation) -> _Lesson:
        """A person shows it at one target until it succeeds, or they give up."""
        try:
            trials = self.session.teach(self.skill.target(situation), self._attempts)
        except ValueError as error:
            return _Lesson(1, why=str(error))
        if not trials[-1].outcome.in_basket:
            return _Lesson(len(trials), why="missed")
        shown = trials[-1].demonstration
        self._bag.keep_throw(shown, self.session.plant.state.stamp_ns)
        return _Lesson(len(trials), shown)

    def learn(self, shown: list[Any], job: Job) -> str:
        """Learn it as the learner node does with the parameters of config/; what there is to say
        of the skill.
        """
        practice, lesson = _learned(self.skill, shown, job)
        self._learned = practice.practising
        return "; ".join([lesson.said, *lesson.facts])

    def attempt(self, situation: Situation) -> TrialResult:
        """The arm throws; ValueError says why that cannot be."""
        target = self.skill.target(situation)
        trial = self.session.throw(self._learned.plan(target))
        seen = trial.outcome
        landing, error = (seen.landing, seen.landing_error) if seen.landing_seen else (None, None)
        return TrialResult.of_throw(target, landing, error, seen.in_basket, trial.message)

    def practise_darts(
        self, agent: ModelBasedAgent, job: Job, say: Say
    ) -> tuple[list[TrialResult], DartsRun]:
        """Own darts where the own spread scores most, and a leg of 501."""
        skill = self.skill
        darts, trials = [], []
        for number in range(1, job.throws + 1):
            dart, hit = own_dart(self.session, self._learned, skill, agent)
            off = (
                "not seen"
                if hit.place is None
                else f"{np.linalg.norm(np.subtract(dart.hit, dart.aim)):.0f} mm off,"
                f" {dart.score} points"
            )
            say(f"dart {number} at {place_of(np.array(dart.aim))}: {off} {hit.note}".rstrip())
            darts.append(dart)
            trials.append(TrialResult(skill.aimed(np.array(dart.aim)), hit.outcome, dart.note))

        def throw(aim: np.ndarray) -> Hit:
            return throw_dart(self.session, self._learned, skill, aim)

        leg = play_leg(agent, throw, say)
        return trials, DartsRun(job.seed, "in process", skill.middle, (), tuple(darts), leg)


class _Moving:
    """Skills at the bench or beside the belt."""

    def __init__(self, skill: Skill, job: Job, bag: SessionBag):
        self.skill, self._bag = skill, bag
        kind = BeltSession if skill.world == "belt" else BenchSession
        self.session = kind(skill, job.seed, arm=job.arm, settings=job.settings, bag=bag)

    def show(self, situation: Situation) -> _Lesson:
        """A person shows it once."""
        try:
            trial = self.session.show(situation)
        except ValueError as error:
            return _Lesson(1, why=str(error))
        if not trial.outcome.success:
            return _Lesson(1, why=trial.outcome.reason)
        stamp_ns = self.session.plant.state_stamp_ns
        return _Lesson(1, self._bag.keep_movement(trial.seen, stamp_ns))

    def learn(self, shown: list[Any], job: Job) -> str:
        """Learn it; what there is to say of the model."""
        practice, lesson = _learned(self.skill, shown, job)
        self._learned = practice.model
        return f"{lesson.said}: model {lesson.model_id}"

    def attempt(self, situation: Situation) -> TrialResult:
        """The arm does it; ValueError says why that cannot be."""
        trial = self.session.attempt(self._learned, situation)
        return TrialResult(situation, trial.outcome, trial.message)


def _learned(skill: Skill, shown: list[Any], job: Job) -> tuple[Any, Lesson]:
    """What the learner node would have learned with the parameters of config/, and what there is to
    say of it.
    """
    learner = Learner(skill)
    lesson = learner.learn(shown, job.configuration)
    return learner.practice, lesson


_KINDS: dict[tuple[str, str], type[_Throwing] | type[_Moving]] = {
    ("basket", "landings"): _Throwing,
    ("board", "darts"): _Throwing,
    ("bench", "trials"): _Moving,
    ("belt", "trials"): _Moving,
    ("stove", "trials"): _Moving,
}
"""What the demo can do without nodes: world of a skill, and how it is told."""
