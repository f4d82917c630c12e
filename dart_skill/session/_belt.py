"""A skill that reacts beside a belt in one process, without ROS: shown, learned, carried out and
judged by what the cameras see.
"""

from __future__ import annotations

from collections.abc import Iterable

from dart_skill.arm import Mode
from dart_skill.session._arm import parameters_of_arm
from dart_skill.session._reaching_person import ReachingPerson
from dart_skill.session._session_bag import SessionBag
from dart_skill.session._skill_session import Push, Sees, SkillSession, SkillTrial, nobody
from dart_skill.simulation import Belt, Conveyor, Person, PlantSettings
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.protocol import Skill

LOOKED, GLANCED = 0.5, 0.2
"""The cup is looked at for so long before the arm begins, and before a person does [s]."""


class BeltSession(SkillSession):
    """Simulator, motion capture, a person and the commander, stepped together; poses reach a guide
    as late as the cameras deliver them.

    * skill: that is taught; its body is the cup.
    * seed: int, default 0. Everything random comes from it.
    * arm: of config/fleet.yaml, default "ideal"; settings: further parameters, each as
      NODE.PARAMETER=VALUE.
    * bag: that everything is written into, default None.
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
        super().__init__(
            skill,
            Conveyor(PlantSettings.from_parameters(of("wam_simulator")), seed),
            of,
            seed,
            bag,
        )
        self.person = ReachingPerson(seed, Person.from_parameters(of("teacher")), skill.moves)

    def teach(self, belt: Belt) -> SkillTrial:
        """A person shows the movement once, with a cup on a belt."""
        self.person.forget()
        self._start(belt, self.person)
        self._run("look", self._looked_at, lambda: True, watch=GLANCED)
        self.commander.release_arm(True)
        self.person.begin(self.plant.arm_state)
        self._run(
            "demonstration", lambda: self.person.step(self.plant.arm_state), self._shown, watch=0.0
        )
        trial = self._trial(f"demonstration_{self.plant.state.episode}")
        self._sees = None
        self.commander.release_arm(False)
        return trial

    def _shown(self) -> bool:
        return self.person.done(self.plant.arm_state)

    def _looked_at(self) -> None:
        self.person.look(self.plant.arm_state)

    def execute(self, guide: ReactiveGuide, belt: Belt, push: Push = nobody) -> SkillTrial:
        """Carry out a movement with a cup on a belt; push: what somebody does to the arm
        meanwhile. guide: of the hand.
        """
        self._start(belt, guide)
        try:
            self._run("look", nobody, lambda: True, watch=LOOKED)
            self.commander.follow(guide)
            self._run(
                guide.what,
                push,
                lambda: self.commander.mode == Mode.HOLDING and not self.commander.executing,
                watch=0.0,
            )
        finally:
            self._sees = None
        return self._trial(f"trial_{self.plant.state.episode}")

    def _start(self, belt: Belt, sees: Sees) -> None:
        self.plant.run(belt)
        self._begin()
        self._sees = sees
