"""Another skill than throwing in one process, without ROS: shown, learned, and tried elsewhere."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np

from dart_skill.session._belt import BeltSession
from dart_skill.session._bench import BenchSession
from dart_skill.session._demo import Job, Say
from dart_skill.session._session_bag import LAYOUT, SessionBag
from dart_skill.session._skill_session import SkillSession, SkillTrial
from dart_skill.session._skill_summary import SkillResult, SkillSummary, in_words
from dart_skill.simulation import Belt
from dart_skill.skills.learning import LearnedSkill, ReactiveSkill
from dart_skill.skills.place import Place
from dart_skill.skills.protocol import Demonstration, Situation, Skill, TaskOutcome
from dart_skill.skills.reach import Reach


class _Table(Protocol):
    """One skill, as the demo needs it."""

    @property
    def session(self) -> SkillSession:
        """World, arm and cameras."""

    def show(self, situation: Situation) -> SkillTrial:
        """A person shows it once; ValueError says why that cannot be."""

    def learn(self, shown: list[Demonstration]) -> str:
        """Learn it; the digest of the model."""

    def attempt(self, situation: Situation) -> SkillTrial:
        """The arm does it; ValueError says why that cannot be."""


class _Placing:
    """Parts that go into a holder."""

    def __init__(self, skill: Place, job: Job, bag: SessionBag):
        self._skill = skill
        self.session = BenchSession(skill, job.seed, arm=job.arm, settings=job.settings, bag=bag)

    def show(self, situation: Situation) -> SkillTrial:
        return self.session.teach(situation.pose("holder"), self._skill.seat)

    def learn(self, shown: list[Demonstration]) -> str:
        self._learned = LearnedSkill(self._skill, shown)
        return self._learned.model_id

    def attempt(self, situation: Situation) -> SkillTrial:
        return self.session.execute(
            self._learned.plan(self.session.situation(situation.pose("holder")))
        )


class _Reaching:
    """Cups on a belt."""

    def __init__(self, skill: Reach, job: Job, bag: SessionBag):
        self._skill = skill
        self.session = BeltSession(skill, job.seed, arm=job.arm, settings=job.settings, bag=bag)

    def show(self, situation: Situation) -> SkillTrial:
        return self.session.teach(self._belt(situation))

    def learn(self, shown: list[Demonstration]) -> str:
        self._learned = ReactiveSkill(self._skill, shown)
        return self._learned.model_id

    def attempt(self, situation: Situation) -> SkillTrial:
        return self.session.execute(self._learned.guide(), self._belt(situation))

    @staticmethod
    def _belt(situation: Situation) -> Belt:
        cup = situation.pose("cup")
        return Belt.of((cup.position, cup.quaternion), situation.numbers)


def skill_demo(job: Job, skill: Skill, say: Say) -> SkillSummary:
    """Place or reach, in situations of one seed. ValueError says why the job cannot be done."""
    begun, rng = time.monotonic(), np.random.default_rng([job.seed, 7])
    if not isinstance(skill, (Place, Reach)):
        raise ValueError(
            f"in process there are throw, darts, place and reach: '{skill.name}' needs the graph,"
            " so leave out --layout in-process"
        )
    with SessionBag(job.bag, job.seed, skill) as bag:
        table: _Table = (
            _Placing(skill, job, bag) if isinstance(skill, Place) else _Reaching(skill, job, bag)
        )
        try:
            shown, attempts = _teach(table, bag, skill, job, rng, say)
            say(
                f"learned '{skill.name}' from {len(shown)} demonstrations: model"
                f" {table.learn(shown)}"
            )
            worked, since_ns = time.monotonic(), table.session.plant.state_stamp_ns
            wanted = range(1, job.throws + 1)
            trials = [
                _tried(
                    table, skill, skill.draw(rng, wide=True), f"{skill.name} {k}/{job.throws}", say
                )
                for k in wanted
            ]
            took = time.monotonic() - worked
            simulated = 1e-9 * (
                table.session.plant.state_stamp_ns
                - since_ns
                - job.throws * table.session.plant.settings.reset_ns
            )
        finally:
            table.session.close()
    return SkillSummary(
        skill=skill.name,
        seed=job.seed,
        bag=str(job.bag),
        demonstrations=job.demonstrations,
        attempts=attempts,
        trials=tuple(trials),
        wall_seconds=time.monotonic() - begun,
        layout=LAYOUT,
        real_time_factor=simulated / took,
    )


def _teach(
    table: _Table, bag: SessionBag, skill: Skill, job: Job, rng: np.random.Generator, say: Say
) -> tuple[list[Demonstration], int]:
    """What was shown, in new situations for those in which it failed; and how many attempts that
    took.
    """
    kept: list[Demonstration] = []
    drawn, wanted = skill.draws(rng, job.demonstrations), job.demonstrations
    for lesson in range(2 * wanted):
        situation = drawn[lesson] if lesson < wanted else skill.draw(rng)
        why = ""
        try:
            trial = table.show(situation)
            why = trial.outcome.reason if not trial.outcome.success else ""
        except ValueError as error:
            why = str(error)
        if not why:
            kept.append(bag.keep_movement(trial.seen, table.session.plant.state_stamp_ns))
        say(
            f"demonstration {len(kept)}/{wanted}: {in_words(situation, units=skill.units)}:"
            f" {f'given up: {why}' if why else 'shown'}"
        )
        if len(kept) == wanted:
            return kept, lesson + 1
    raise ValueError(f"only {len(kept)} of {wanted} demonstrations succeeded")


def _tried(table: _Table, skill: Skill, situation: Situation, what: str, say: Say) -> SkillResult:
    try:
        trial = table.attempt(situation)
        result = SkillResult(situation, trial.outcome, trial.message)
    except ValueError as failure:
        result = SkillResult(
            situation, TaskOutcome(False, float("nan"), str(failure)), str(failure)
        )
    off = "not seen" if result.error_m is None else f"{1e3 * result.error_m:.1f} mm"
    became = f"{'done' if result.outcome.success else 'failed'}, {off} {result.why}".rstrip()
    say(f"{what}: {in_words(situation, units=skill.units)}: {became}")
    return result
