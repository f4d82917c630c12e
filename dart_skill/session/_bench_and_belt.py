"""Skills at a workbench and beside a belt in one process, without ROS: shown, carried out and
judged by what the cameras see.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.arm import (
    ArmState,
    Command,
    Commander,
    CommanderSettings,
    Mode,
    MotionPlan,
)
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND, Demonstration
from dart_skill.session._in_process import RESTING
from dart_skill.session._session_bag import SessionBag
from dart_skill.session._step_loop import Push, Sees, StepLoop, no_push, parameters_of_arm
from dart_skill.simulation import (
    Belt,
    Bench,
    Carrier,
    Conveyor,
    MotionCapture,
    Person,
    Plant,
    PlantSettings,
    Reacher,
    Sample,
    Stirrer,
    Workbench,
    make_world,
)
from dart_skill.skills.execution import MovingBody, ReactiveGuide
from dart_skill.skills.protocol import Skill, TaskOutcome

if TYPE_CHECKING:
    from dart_skill.skills.learning import LearnedSkill

WATCHED = 0.5
"""The bodies are watched for so long after a movement at the bench [s]."""
LOOKED = 0.5
"""The cup is looked at for so long before the arm begins [s]."""
GLANCED = 0.2
"""The cup is looked at for so long before a person begins [s]."""


CARRIERS: dict[str, type[Carrier]] = {"carry": Carrier, "stir": Stirrer}
"""Simulated persons who have a body in the hand, by what `Skill.shown_by` calls them."""


def carrier_of(skill: Skill, seed: int, person: Person | None = None) -> Carrier:
    """The simulated person who shows a skill with a body in the hand.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    person
        How firmly they push.

    Raises
    ------
    ValueError
        For a skill that is shown otherwise.
    """
    if skill.shown_by not in CARRIERS:
        raise ValueError(
            f"'{skill.name}' is shown by '{skill.shown_by}', and here a person can only"
            f" {', '.join(CARRIERS)}"
        )
    kind = CARRIERS[skill.shown_by]
    return kind(seed, person=person, part=skill.moves, **skill.person_settings)


@dataclass(frozen=True, eq=False)
class SkillTrial:
    """One movement.

    Parameters
    ----------
    seen
        What was seen of it.
    outcome
        What the skill says came of it.
    message
        Why it was stopped, empty if it was not.
    """

    seen: Demonstration
    outcome: TaskOutcome
    message: str = ""


class _SkillSession(StepLoop):
    """What sessions of bench and belt have in common: the movement as a demonstration, judged by
    the skill.

    * skill: that is taught; its bodies are those of the world.
    * plant: the world.
    * of: from the name of a node to its parameters.
    * seed: of the cameras.
    * bag: that everything is written into, None for none.
    """

    def __init__(
        self, skill: Skill, plant: Plant, of: Callable, seed: int, bag: SessionBag | None
    ):
        cameras = MotionCapture({**of("mock_optitrack"), "bodies": (HAND, *skill.bodies)}, seed)
        commander = Commander(
            CommanderSettings.from_parameters(of("commander")), plant.description
        )
        super().__init__(plant, commander, cameras, bag, skill.sensor_log())
        self.skill = skill

    def _begin(self) -> None:
        """The world is reset, the arm held, and nothing seen yet."""
        if self.commander.stopped_by:
            self.commander.reset()
        self.plant.reset()
        self._watch_anew()
        self._answer(self.plant.arm_state, no_push)

    def _run(
        self, what: str, push: Push, over: Callable[[], bool], watch: float = WATCHED
    ) -> None:
        """Step until a movement is over, and then watch on; ValueError if it takes too long."""
        try:
            self._step_until(push, over, lambda: self.plant.state_stamp_ns + round(watch * 1e9))
        except TimeoutError:
            raise ValueError(
                f"{what} is not over after {self.longest:.0f} s:"
                f" {self.commander.message or self.commander.mode.value}"
            ) from None

    def _hear(self, command: Command) -> None:
        self._log.add_told(command.stamp_ns, command.grip)

    def _take(self, sample: Sample) -> None:
        super()._take(sample)
        if self._sees is not None:
            self._sees.see(sample.name, sample.stamp_ns, sample.position, sample.quaternion)

    def _trial(self, kind: str, numbers: Mapping[str, float] = MappingProxyType({})) -> SkillTrial:
        self._deliver()
        if self._bag is not None:
            self._bag.end_of_movement()
        name = f"{kind}_{self.plant.state.episode}"
        seen = self._log.seen(name, 0, self.plant.state_stamp_ns, self.skill.name)
        begin = seen.events[0].time if seen.events else float(seen.hand_time[0])
        there = self.skill.situation(seen, begin)
        situation = replace(there, numbers={**there.numbers, **numbers})
        outcome = self.skill.judge(seen, situation)
        return SkillTrial(seen, outcome, self.commander.message)


class BenchSession(_SkillSession):
    """Simulator, motion capture, a person and the commander at a workbench, stepped together.

    Parameters
    ----------
    skill
        That is taught; its bodies are those of the bench.
    seed
        Int, default 0. Everything random comes from it.
    bench
        What stands on the table, default what the skill's settings say of it.
    arm
        Of config/fleet.yaml, default "ideal".
    settings
        Further parameters, each as NODE.PARAMETER=VALUE.
    bag
        That everything is written into, default None.
    """

    plant: Workbench

    def __init__(
        self,
        skill: Skill,
        seed: int = 0,
        bench: Bench | None = None,
        arm: str = "ideal",
        settings: Iterable[str] = (),
        bag: SessionBag | None = None,
    ):
        of = parameters_of_arm(arm, settings)
        own = skill.world_settings if bench is None else asdict(bench)
        settings_of_plant = PlantSettings.from_parameters(of("wam_simulator"))
        plant = make_world(skill.world, settings_of_plant, seed, own=own)
        super().__init__(skill, plant, of, seed, bag)
        self.seed = seed
        self.carrier = carrier_of(skill, seed, Person.from_parameters(of("teacher")))

    def show(self, situation: Situation) -> SkillTrial:
        """A person shows the movement once in a situation."""
        return self.teach(situation.pose(self.plant.movable_body))

    def attempt(self, learned: LearnedSkill, situation: Situation) -> SkillTrial:
        """Carry out what was learned in a situation, for what the cameras see of it."""
        seen = self.situation(situation.pose(self.plant.movable_body))
        asked = replace(seen, numbers=situation.numbers)
        return self.execute(learned.plan(asked), numbers=situation.numbers)

    def teach(self, holder: Pose, goal: Pose | None = None) -> SkillTrial:
        """A person shows the movement once.

        Parameters
        ----------
        goal
            Where they want the part, in the frame of the holder, by default where the skill wants
            it (`Skill.goal`).
        """
        seen = self.situation(holder)
        stands, part = seen.pose(self.plant.movable_body), seen.pose(self.skill.moves)
        there = self.skill.goal(seen) if goal is None else stands.place(goal)
        self.commander.release_arm(True)
        self._sees = self.carrier
        self.carrier.forget()
        self.carrier.begin(
            self.plant.arm_state,
            (part.position, part.quaternion),
            (there.position, there.quaternion),
        )
        self._run(
            "demonstration",
            lambda: self.carrier.step(self.plant.arm_state),
            lambda: self.carrier.done(self.plant.arm_state),
        )
        trial = self._trial("demonstration")
        self._sees = None
        self.commander.release_arm(False)
        return trial

    def situation(self, holder: Pose) -> Situation:
        """What the cameras see when the holder was put to a pose, and the part to its place."""
        self._stand(holder)
        self._run("look", no_push, lambda: True)
        self._deliver()
        return self._log.situation_at(self._log.bodies[HAND].stamps[-1])

    def execute(
        self,
        plan: MotionPlan,
        sees: Sees | None = None,
        push: Push = no_push,
        numbers: Mapping[str, float] = MappingProxyType({}),
    ) -> SkillTrial:
        """Carry out a plan for the situation that was seen last.

        Parameters
        ----------
        sees
            Whom the poses of the cameras reach, default the commander.
        push
            What is done to the arm meanwhile, default nothing.
        numbers
            Of the situation, which were asked for.
        """
        self._watch_anew()
        self.commander.execute(plan)
        self._sees = sees or self.commander
        try:
            self._run(
                plan.what,
                push,
                lambda: not self.commander.executing and self.commander.mode in RESTING,
            )
        finally:
            self._sees = None
        return self._trial("trial", numbers)

    def _stand(self, holder: Pose) -> None:
        self.plant.stand((holder.position, holder.quaternion))
        self._begin()


class BeltSession(_SkillSession):
    """Simulator, motion capture, a person and the commander beside a belt, stepped together; poses
    reach a guide as late as the cameras deliver them.

    Parameters
    ----------
    skill
        That is taught; its body is the cup.
    seed
        Int, default 0. Everything random comes from it.
    arm
        Of config/fleet.yaml, default "ideal".
    settings
        Further parameters, each as NODE.PARAMETER=VALUE.
    bag
        That everything is written into, default None.
    """

    plant: Conveyor

    def __init__(
        self,
        skill: Skill,
        seed: int = 0,
        arm: str = "ideal",
        settings: Iterable[str] = (),
        bag: SessionBag | None = None,
    ):
        of = parameters_of_arm(arm, settings)
        plant = Conveyor(PlantSettings.from_parameters(of("wam_simulator")), seed)
        super().__init__(skill, plant, of, seed, bag)
        self.person = ReachingPerson(seed, Person.from_parameters(of("teacher")), skill.moves)

    def show(self, situation: Situation) -> SkillTrial:
        """A person shows the movement once in a situation."""
        return self.teach(_belt(situation))

    def attempt(self, learned: LearnedSkill, situation: Situation) -> SkillTrial:
        """Carry out what was learned in a situation; a plan is made for where the cup is seen when
        the arm sets off.
        """
        if self.skill.reacts:
            return self.execute(learned.policy.guide(), _belt(situation))
        self._start(_belt(situation), self.commander)
        self._run("look", no_push, lambda: True, watch=LOOKED)
        self._deliver()
        plan = learned.plan(self._log.situation_at(self._log.bodies[HAND].stamps[-1]))
        self.commander.execute(plan)
        self._carry_on(plan.what, no_push)
        return self._trial("trial")

    def teach(self, belt: Belt) -> SkillTrial:
        """A person shows the movement once, with a cup on a belt."""
        person = self.person
        person.forget()
        self._start(belt, person)

        def look() -> None:
            person.look(self.plant.arm_state)

        self._run("look", look, lambda: True, watch=GLANCED)
        self.commander.release_arm(True)
        person.begin(self.plant.arm_state)
        self._run(
            "demonstration",
            lambda: person.step(self.plant.arm_state),
            lambda: person.done(self.plant.arm_state),
            watch=0.0,
        )
        trial = self._trial("demonstration")
        self._sees = None
        self.commander.release_arm(False)
        return trial

    def execute(self, guide: ReactiveGuide, belt: Belt, push: Push = no_push) -> SkillTrial:
        """Carry out a movement with a cup on a belt.

        Parameters
        ----------
        push
            What is done to the arm meanwhile.
        guide
            Of the hand.
        """
        self._start(belt, guide)
        try:
            self._run("look", no_push, lambda: True, watch=LOOKED)
            self.commander.follow(guide)
            self._carry_on(guide.what, push)
        finally:
            self._sees = None
        return self._trial("trial")

    def _carry_on(self, what: str, push: Push) -> None:
        """Step until the movement is over."""
        self._run(
            what,
            push,
            lambda: self.commander.mode == Mode.HOLDING and not self.commander.executing,
            watch=0.0,
        )

    def _start(self, belt: Belt, sees: Sees | None) -> None:
        self.plant.run(belt)
        self._begin()
        self._sees = sees


def _belt(situation: Situation) -> Belt:
    cup = situation.pose("cup")
    return Belt.of((cup.position, cup.quaternion), situation.numbers)


class ReachingPerson:
    """A person who shows how to reach into a cup: their hands, and what they see of cup and hand,
    as well as the cameras do, and as late.

    Tell what is seen by `see`; `begin`, then `step` once per state until `done`.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    person
        How firmly they push.
    cup
        Role of the body into which they reach.
    """

    def __init__(self, seed: int, person: Person | None = None, cup: str = "cup"):
        self._reacher, self._body = Reacher(seed, person=person), cup
        self.forget()

    def forget(self) -> None:
        """Nothing is seen yet: the world was reset."""
        self._cup = MovingBody(self._body)
        self._reacher.forget()

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body: (3,) [m], (4,)."""
        self._reacher.see(body, stamp_ns, position, quaternion)
        if body == self._body:
            self._cup.see(stamp_ns, position, quaternion)

    def look(self, state: ArmState) -> None:
        """Compare what is seen of the hand with where the arm takes it to be, once per state, from
        before the beginning.
        """
        self._reacher.look(state)

    def begin(self, state: ArmState) -> None:
        """Begin where the hand is now.

        Raises
        ------
        ValueError
            If no cup was seen.
        """
        if self._cup.newest_ns is None:
            raise ValueError(f"the {self._body} was not seen: is it tracked and published?")
        self._reacher.begin(state)

    def step(self, state: ArmState) -> Command:
        """The push that answers a state."""
        cup = self._cup.at(state.stamp_ns)
        self._reacher.watch(state, cup.position, cup.velocity)
        return self._reacher.step(state)

    def done(self, state: ArmState) -> bool:
        """Whether the hand has been in the cup for long enough."""
        return self._reacher.done(state)
