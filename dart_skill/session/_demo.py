"""The main job in one process, without ROS: a person shows throws, they are learned, the arm
throws at new baskets.

The same lessons, plans and landings as the graph's, to the last bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dart_skill.common.configuration import node_parameters
from dart_skill.common.regions import REGION, targets_for
from dart_skill.common.world import THROW
from dart_skill.recording import Demonstration
from dart_skill.session._in_process import Session, Trial
from dart_skill.session._session_bag import LAYOUT, SessionBag
from dart_skill.session._summary import DemoSummary, ThrowResult, basket_in_words, throw_in_words
from dart_skill.skills.learning import changed, configuration
from dart_skill.skills.practice import PracticeSettings, PractisingSkill
from dart_skill.skills.protocol import load_skill
from dart_skill.skills.throw import Throw

Say = Callable[[str], None]
"""Takes a line of progress."""


@dataclass(frozen=True)
class Job:
    """What a demo is asked for.

    * seed: of everything random; demonstrations, throws: how many.
    * bag: folder of its bag, which must not exist.
    * arm: of config/fleet.yaml; settings: further parameters, each as NODE.PARAMETER=VALUE.
    * configuration: of the skill, empty: as config/skill_learner.yaml has it.
    """

    seed: int
    demonstrations: int
    throws: int
    bag: Path
    arm: str = "ideal"
    settings: tuple[str, ...] = ()
    configuration: str = ""


def throwing_demo(job: Job, say: Say) -> DemoSummary:
    """Throws at baskets. ValueError says why the job cannot be done."""
    begun, skill = time.monotonic(), load_skill(THROW)
    assert isinstance(skill, Throw)
    with SessionBag(job.bag, job.seed, skill) as bag:
        session = Session.on_arm(job.arm, job.seed, job.settings, bag=bag)
        try:
            ready, shown = time.monotonic(), Lessons(session, bag, job.demonstrations, say)
            shown.teach(job.seed)
            learned = practising(skill, shown.kept, job.configuration, say)
            threw, before = time.monotonic(), session.steps
            targets = targets_for(job.seed, job.demonstrations, job.throws)[1]
            results = [
                _throw(session, learned, target, f"throw {k}/{len(targets)}", say)
                for k, target in enumerate(targets, start=1)
            ]
        finally:
            session.close()
    done, step = time.monotonic(), session.plant.settings.step
    return DemoSummary(
        seed=job.seed,
        bag=str(job.bag),
        demonstrations=job.demonstrations,
        throws=tuple(results),
        wall_seconds=done - begun,
        real_time_factor=session.steps * step / (done - ready),
        throw_real_time_factor=(session.steps - before) * step / (done - threw),
        attempts=shown.attempts,
        layout=LAYOUT,
    )


class Lessons:
    """Lessons of throwing until so many succeeded. kept: what they show; attempts: guided throws
    that they took.
    """

    def __init__(self, session: Session, bag: SessionBag, wanted: int, say: Say):
        self._session, self._bag, self._wanted, self._say = session, bag, wanted, say
        self._most = int(node_parameters("teacher.yaml", "teacher")["max_attempts"])
        self.kept: list[Demonstration] = []
        self.attempts = 0

    def teach(self, seed: int) -> None:
        """At baskets of a seed; at new ones for those that failed."""
        targets = targets_for(seed, self._wanted, 0)[0]
        spare = iter(REGION.spread(self._wanted, np.random.default_rng([seed, 3])))
        for lesson in range(2 * self._wanted):
            target = targets[lesson] if lesson < self._wanted else next(spare)
            self.show(target, basket_in_words(target))
            if len(self.kept) == self._wanted and lesson >= self._wanted - 1:
                return
        raise self.too_few

    @property
    def too_few(self) -> ValueError:
        """What to say when nobody could show as many."""
        return ValueError(f"only {len(self.kept)} of {self._wanted} demonstrations succeeded")

    def show(self, target: np.ndarray, where: str) -> None:
        """One lesson; a person whom it does not succeed goes on elsewhere."""
        trials: list[Trial] = []
        try:
            trials = self._session.teach(target, self._most)
            why = "" if trials[-1].outcome.in_basket else "missed"
        except ValueError as error:
            why = str(error)
        self.attempts += max(1, len(trials))
        if not why:
            self.kept.append(trials[-1].demonstration)
            self._bag.keep_throw(trials[-1].demonstration, self._session.plant.state.stamp_ns)
        how = f"given up: {why}" if why else f"in after {len(trials)}"
        self._say(f"demonstration {len(self.kept)}/{self._wanted}: {where}: {how}")


def practising(skill: Throw, shown: list[Demonstration], name: str, say: Say) -> PractisingSkill:
    """A skill of throwing that was shown, as the learner node learns it with the parameters of
    config/.
    """
    p = node_parameters("skill_learner.yaml", "skill_learner")
    chosen = skill.configured_for(changed(configuration(name or p["configuration"]), p)[0])
    method, memory = (
        p["practice_method"],
        PracticeSettings(p["practice_capacity"], p["practice_forget"]),
    )
    steady_every = 0 if method == "none" else skill.steady_every
    learned = PractisingSkill(
        shown, chosen, method, memory, skill.correction, steady_every=steady_every
    )
    delay = f"the hand opens {1e3 * learned.skill.hand_delay:.0f} ms after it is told to"
    say(f"learned from {len(shown)} demonstrations with '{chosen.name}'; {delay}")
    return learned


def _throw(
    session: Session, learned: PractisingSkill, target: np.ndarray, what: str, say: Say
) -> ThrowResult:
    x, y, z = target.tolist()
    try:
        trial = session.throw(learned.plan(target))
    except ValueError as failure:
        result, became = (
            ThrowResult((x, y, z), None, None, False, str(failure)),
            f"no throw: {failure}",
        )
    else:
        outcome = trial.outcome
        landing = tuple(outcome.landing.tolist()) if outcome.landing_seen else None
        error_m = float(outcome.landing_error) if outcome.landing_seen else None
        result = ThrowResult((x, y, z), landing, error_m, bool(outcome.in_basket), trial.message)
        became = throw_in_words(result.in_basket, error_m, trial.message)
    say(f"{what}: {basket_in_words(target)}: {became}")
    return result
