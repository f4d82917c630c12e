"""One step loop for all sessions in one process, without ROS: world, cameras, commander and what
guides the arm, stepped together in the order of the nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from dart_skill.arm import ArmState, Command, Commander, Mode
from dart_skill.common.configuration import node_file, node_parameters
from dart_skill.common.fleet import arm_with
from dart_skill.session._session_bag import SessionBag
from dart_skill.simulation import (
    ArmGeometry,
    Frame,
    LatencyQueue,
    MotionCapture,
    Plant,
    PlantState,
    Sample,
    SimulatedController,
)
from dart_skill.skills.observation import SensorLog

HAS = {"wam_simulator", "mock_optitrack", "teacher", "commander"}
"""Nodes whose part a session plays."""
Push = Callable[[], Command | None]
"""What is done to the arm in its present state."""


class Sees(Protocol):
    """What receives the poses that the cameras deliver: a guide, or a person."""

    def see(self, body: str, stamp_ns: int, position: Any, quaternion: Any) -> None:
        """A pose of a body: (3,) [m], (4,)."""


def no_push() -> None:
    """The arm is not touched."""


def parameters_of_arm(name: str, settings: Iterable[str] = ()) -> Callable[[str], dict[str, Any]]:
    """From the name of a node to its parameters.

    Parameters
    ----------
    name
        Of an arm of config/fleet.yaml, "ideal" or another one, or "fleet:SEED".
    settings
        Further parameters, each as NODE.PARAMETER=VALUE.

    Raises
    ------
    ValueError
        For parameters of a node that no session has.
    """
    differs = arm_with(name, settings)
    if unknown := set(differs) - HAS:
        raise ValueError(
            f"config/fleet.yaml: the arm '{name}' sets parameters of {', '.join(sorted(unknown))},"
            " which no session has"
        )
    return lambda node: {**node_parameters(node_file(node), node), **differs.get(node, {})}


class StepLoop:
    """Base of sessions. They make the world, and say how a movement is shown and carried out.

    Parameters
    ----------
    plant
        The world.
    commander
        Controls the arm.
    cameras
        Motion capture of hand and bodies.
    bag
        That everything is written into, None for none.
    log
        Of what sensors see.
    controller
        Of an arm that is driven to positions, whose states come as often as it sends them; None: the
        arm takes torques.
    """

    longest = 30.0
    """A movement that takes longer is given up [s]."""

    def __init__(
        self,
        plant: Plant,
        commander: Commander,
        cameras: MotionCapture,
        bag: SessionBag | None,
        log: SensorLog,
        controller: SimulatedController | None = None,
    ):
        if commander.settings.output == "trajectory" and controller is None:
            raise ValueError(
                "output is 'trajectory', and the simulated arm takes torques here: only `dart-skill"
                " experiment throws --trajectory RATE` has a controller of trajectories"
            )
        self.plant, self.commander, self.capture = plant, commander, cameras
        self._bag, self._log, self._geometry = bag, log, ArmGeometry()
        self._frame_steps = round(1e9 / cameras.config.rate / plant.settings.step_ns)
        self._sees: Sees | None = None
        self._kept: list[PlantState] | None = None
        self.steps = 0
        self._controller, self._answered = controller, Command(0)
        rate = 0.0 if controller is None else controller.settings.rate
        self._tells_every = round(1e9 / rate / plant.settings.step_ns) if rate else 1

    def close(self) -> None:
        """Release PyBullet."""
        self.plant.close()

    def _watch_anew(self) -> None:
        """Nothing was seen or said yet."""
        self._log.clear()
        self._due, self._exposed = LatencyQueue(), list[Frame]()

    def _answer(self, arm: ArmState, push: Push) -> tuple[Command, Command | None]:
        """What commander and person answer to a state; the world goes on with it."""
        if self._tells:
            self._answered = self.commander.step(arm)
        command = self._answered if self._tells else self._answered.answering(arm.stamp_ns)
        pushed = push()
        if self._bag is not None:
            self._bag.step(arm, command, pushed)
        self.plant.step(self._driven(arm, command), pushed)
        return command, pushed

    @property
    def _tells(self) -> bool:
        """Whether the arm tells its state now."""
        return self.plant.step_count % self._tells_every == 0

    def _driven(self, arm: ArmState, command: Command) -> Command:
        """What moves the arm: the command, or drives that follow a controller; a person guides an
        arm whose drives give way.
        """
        controller = self._controller
        if controller is None:
            return command
        if self.commander.mode is Mode.FREE:
            controller.hold(arm.position)
        controller.update(arm.stamp_ns, arm.position)
        if self.commander.mode is Mode.FREE:
            return command
        driven = controller.command(arm, self.commander.model)
        return replace(driven, grip=command.grip, speed=command.speed)

    def _step_until(self, push: Push, over: Callable[[], bool], watch: Callable[[], int]) -> int:
        """Step until a movement is over, and then watch on; returns when that ends [ns].

        Parameters:

        * push: what is done to the arm.
        * over: whether the movement is over.
        * watch: until when the bodies are watched once it is [ns].

        TimeoutError if it takes too long.
        """
        begun, until = self.plant.state_stamp_ns, None
        while until is None or self.plant.state_stamp_ns < until:
            arm = self.plant.arm_state
            self._sense(arm)
            if self._sees is not None:
                self._deliver()
            for answer in self._answer(arm, push):
                if answer is not None:
                    self._hear(answer)
            self.steps += 1
            if until is None and over():
                until = watch()
            if (self.plant.state_stamp_ns - begun) * 1e-9 > self.longest:
                raise TimeoutError
        return until

    def _sense(self, arm: ArmState) -> None:
        """Note what the sensors of the arm say; the cameras expose a frame when it is time."""
        if self._tells:
            self._log.add_joints(arm.stamp_ns, arm.position, arm.velocity)
        if self.plant.step_count % self._frame_steps == 0:
            self._exposed.append(self._frame())
        if self._kept is not None:
            self._kept.append(self.plant.state)

    def _hear(self, command: Command) -> None:
        """Note what a command says to the fingers."""

    def _frame(self) -> Frame:
        plant = self.plant
        angles = np.array(plant.joint_position)
        capsules = self._geometry.capsules(angles, plant.settings.base_turn)
        number = plant.step_count // self._frame_steps
        return Frame(plant.state_stamp_ns, plant.bodies, capsules, number=number)

    def _deliver(self) -> None:
        """Take in what the cameras have delivered by now. Many frames at once take less time."""
        if self._exposed:
            self._due.push(self.capture.observe_frames(self.plant.state.episode, self._exposed))
            self._exposed = []
        come = self._due.due(self.plant.state_stamp_ns)
        if self._bag is not None:
            self._bag.see(come)
        for sample in come:
            self._take(sample)

    def _take(self, sample: Sample) -> None:
        """Note a pose that the cameras delivered."""
        self._log.take(sample.name, sample.stamp_ns, sample.position, sample.quaternion)
