"""A skill at the workbench in one process, without ROS: shown, learned, carried out and judged by
what the cameras see.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.session._arm import parameters_of_arm
from dart_skill.session._in_process import RESTING
from dart_skill.session._session_bag import SessionBag
from dart_skill.session._skill_session import SkillSession, SkillTrial, nobody
from dart_skill.simulation import Bench, Carrier, Person, PlantSettings, Workbench
from dart_skill.skills.protocol import HAND, Pose, Situation, Skill


class BenchSession(SkillSession):
    """Simulator, motion capture, a person and the commander, stepped together.

    * skill: that is taught; its bodies are those of the bench.
    * seed: int, default 0. Everything random comes from it.
    * bench: what stands on the table, default what the skill's settings say of it.
    * arm: of config/fleet.yaml, default "ideal"; settings: further parameters, each as
      NODE.PARAMETER=VALUE.
    * bag: that everything is written into, default None.
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
        plant = Workbench(
            bench or Bench(**skill.world_settings),
            PlantSettings.from_parameters(of("wam_simulator")),
            seed,
        )
        super().__init__(skill, plant, of, seed, bag)
        self.carrier = Carrier(seed, person=Person.from_parameters(of("teacher")))

    def teach(self, holder: Pose, goal: Pose) -> SkillTrial:
        """A person shows the movement once; goal: where they want the part, in the frame of the
        holder.
        """
        self._stand(holder)
        self.commander.release_arm(True)
        arm = self.plant.arm_state
        self.carrier.begin(arm, self.plant.bodies["part"], _true(holder.place(goal)))
        self._run(
            "demonstration",
            lambda: self.carrier.step(self.plant.arm_state),
            lambda: self.carrier.done(self.plant.arm_state),
        )
        trial = self._trial(f"demonstration_{self.plant.state.episode}")
        self.commander.release_arm(False)
        return trial

    def situation(self, holder: Pose) -> Situation:
        """What the cameras see when the holder was put to a pose, and the part to its place."""
        self._stand(holder)
        self._run("look", nobody, lambda: True)
        tracks = self._tracks()
        now = float(tracks[HAND].time[-1])
        return Situation({role: tracks[role].pose_at(now) for role in self.skill.bodies})

    def execute(self, plan: MotionPlan) -> SkillTrial:
        """Carry out a plan for the situation that was seen last."""
        self._watch_anew()
        self.commander.execute(plan)
        self._run(
            plan.what,
            nobody,
            lambda: not self.commander.executing and self.commander.mode in RESTING,
        )
        return self._trial(f"trial_{self.plant.state.episode}")

    def _stand(self, holder: Pose) -> None:
        self.plant.stand((holder.position, holder.quaternion))
        self._begin()


def _true(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    return pose.position, pose.quaternion
