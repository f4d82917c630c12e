"""One step loop for all skills in one process, without ROS: world, cameras, commander and who
guides the arm, stepped together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from dart_skill.arm import Command, Commander, CommanderSettings, Grip
from dart_skill.recording import WORDS
from dart_skill.session._session_bag import SessionBag
from dart_skill.simulation import (
    ArmGeometry,
    Conveyor,
    Frame,
    LatencyQueue,
    MotionCapture,
    Workbench,
)
from dart_skill.skills.observation import SensorLog
from dart_skill.skills.protocol import HAND, Demonstration, Event, Skill, TaskOutcome, Track

LONGEST = 30.0
"""A movement that takes longer is given up [s]."""
WATCHED = 0.5
"""The bodies are watched for so long after a movement [s]."""
Push = Callable[[], Command | None]
"""What somebody does to the arm in its present state."""


class Sees(Protocol):
    """What receives the poses that the cameras deliver: a guide, or a person."""

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body: (3,) [m], (4,)."""


def nobody() -> None:
    """Nobody touches the arm."""


@dataclass(frozen=True, eq=False)
class SkillTrial:
    """One movement: what was seen of it, what the skill says came of it, and why it was stopped,
    if it was.

    * outcome: what the skill says.
    """

    seen: Demonstration
    outcome: TaskOutcome
    message: str = ""


class SkillSession:
    """Base of sessions: they make the world, and say how a movement is shown and carried out.

    * skill: that is taught; its bodies are those of the world.
    * plant: the world.
    * of: from the name of a node to its parameters.
    * seed: of the cameras.
    * bag: that everything is written into, default None.
    """

    plant: Workbench | Conveyor

    def __init__(
        self,
        skill: Skill,
        plant: Workbench | Conveyor,
        of: Callable[[str], Mapping[str, Any]],
        seed: int,
        bag: SessionBag | None = None,
    ):
        self.skill, self.plant, self._bag = skill, plant, bag
        self._capture = MotionCapture(
            {**of("mock_optitrack"), "bodies": (HAND, *skill.bodies)}, seed
        )
        self.commander = Commander(
            CommanderSettings.from_parameters(of("commander")), self.plant.description
        )
        self._geometry = ArmGeometry()
        self._frame_steps = round(1e9 / self._capture.config.rate / self.plant.settings.step_ns)
        self._sees: Sees | None = None

    def close(self) -> None:
        """Release PyBullet."""
        self.plant.close()

    def _begin(self) -> None:
        """The world is reset, the arm held, and nothing seen yet."""
        if self.commander.stopped_by:
            self.commander.reset()
        self.plant.reset()
        self._watch_anew()
        self._step(self.commander.step(self.plant.arm_state), None)

    def _step(self, command: Command, push: Command | None) -> None:
        if self._bag is not None:
            self._bag.step(self.plant.arm_state, command, push)
        self.plant.step(command, push)

    def _watch_anew(self) -> None:
        self._log, self._due = SensorLog(()), LatencyQueue()
        self._exposed: list[Frame] = []
        self._seen: dict[str, list] = {}
        self._told: list[Event] = []

    def _run(
        self, what: str, push: Push, over: Callable[[], bool], watch: float = WATCHED
    ) -> None:
        """Step until a movement is over, and then watch on."""
        begun, ended = self.plant.state_stamp_ns, None
        while ended is None or self.plant.state_stamp_ns < ended + watch * 1e9:
            arm = self.plant.arm_state
            self._log.add_joints(arm.stamp_ns, arm.position, arm.velocity)
            if self.plant.step_count % self._frame_steps == 0:
                self._exposed.append(self._frame())
            if self._sees is not None:
                self._deliver()
            command, pushed = self.commander.step(arm), push()
            for answer in (command, pushed):
                if answer is not None:
                    self._hear(answer)
            self._step(command, pushed)
            ended = self.plant.state_stamp_ns if ended is None and over() else ended
            if (self.plant.state_stamp_ns - begun) * 1e-9 > LONGEST:
                raise ValueError(
                    f"{what} is not over after {LONGEST:.0f} s:"
                    f" {self.commander.message or self.commander.mode.value}"
                )

    def _hear(self, command: Command) -> None:
        """Note what a command says to the fingers, when it changes: a commander repeats it with
        every command.
        """
        if command.grip != Grip.UNSPECIFIED and (
            not self._told or self._told[-1].grip != command.grip
        ):
            self._told.append(Event(WORDS[command.grip], command.stamp_ns * 1e-9))

    def _frame(self) -> Frame:
        plant = self.plant
        capsules = self._geometry.capsules(
            np.array(plant.joint_position), plant.settings.base_turn
        )
        return Frame(
            plant.state_stamp_ns,
            plant.bodies,
            capsules,
            number=plant.step_count // self._frame_steps,
        )

    def _deliver(self) -> None:
        """Note what the cameras have delivered by now, and pass it to guide or person. All frames
        at once take a tenth of the time.
        """
        if self._exposed:
            self._due.push(self._capture.observe_frames(self.plant.state.episode, self._exposed))
            self._exposed = []
        come = self._due.due(self.plant.state_stamp_ns)
        if self._bag is not None:
            self._bag.see(come)
        for sample in come:
            self._seen.setdefault(sample.name, []).append(
                (sample.stamp_ns * 1e-9, sample.position, sample.quaternion)
            )
            if self._sees is not None:
                self._sees.see(sample.name, sample.stamp_ns, sample.position, sample.quaternion)

    def _tracks(self) -> dict[str, Track]:
        """What the cameras have delivered by now, by body."""
        self._deliver()
        return {
            name: Track(*(np.array(part) for part in zip(*rows, strict=True)))
            for name, rows in self._seen.items()
        }

    def _trial(self, name: str) -> SkillTrial:
        rows, stamps = np.array(self._log.joints.rows), np.array(self._log.joints.stamps) * 1e-9
        tracks = self._tracks()
        if self._bag is not None:
            self._bag.end_of_movement()
        seen = Demonstration(
            id=name,
            tracks=tracks,
            skill=self.skill.name,
            joint_time=stamps,
            joint_position=rows[:, :7],
            joint_velocity=rows[:, 7:],
            events=tuple(self._told),
        )
        begin = self._told[0].time if self._told else float(seen.hand_time[0])
        outcome = self.skill.judge(seen, self.skill.situation(seen, begin))
        return SkillTrial(seen, outcome, self.commander.message)
