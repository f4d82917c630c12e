"""The whole graph in one process, without ROS: the same steps in the same order as the nodes take,
bit for bit.

Batches of experiments run on it, and a test compares it with the nodes over DDS.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dart_skill.arm import ArmState, Command, Commander, CommanderSettings, Grip, Mode, ThrowPlan
from dart_skill.common.configuration import node_parameters
from dart_skill.common.surface import game_at
from dart_skill.common.world import THROW, THROW_BODIES, the_world
from dart_skill.recording import HAND, Demonstration
from dart_skill.session._arm import parameters_of_arm
from dart_skill.session._session_bag import SessionBag
from dart_skill.simulation import (
    ArmGeometry,
    BasketWalls,
    Board,
    Frame,
    LatencyQueue,
    MotionCapture,
    MotionCaptureConfig,
    Person,
    Phase,
    Plant,
    PlantSettings,
    PlantState,
    Swing,
    Teacher,
)
from dart_skill.skills.observation import ARRIVAL_NS, Outcome, ThrowLog, judge_flight

LONGEST_THROW = 15.0
RESTING = (Mode.HOLDING, Mode.STOPPING)
Step = Callable[[ArmState], tuple[Command, Command | None]]
"""From a state to the command of the controller and, if somebody guides the arm, their push."""


@dataclass(frozen=True)
class Trial:
    """One throw: what the cameras made of it, the throw as a demonstration, and the simulator's
    own word on it: whether the ball is in the basket, or the dart in the board.

    * outcome: by the cameras.
    * ball_was_in: by the simulator.
    * states: of the plant, where they are kept.
    """

    outcome: Outcome
    demonstration: Demonstration
    ball_was_in: bool
    message: str = ""
    states: list[PlantState] = field(default_factory=list, repr=False)


class Session:
    """Simulator, motion capture, teacher, recorder and commander, stepped together.

    With a board in the plant's settings darts are thrown. Targets are then points of the board.

    * seed: int, default 0. Everything random comes from it.
    * plant: settings of the simulated world, default those of config/wam_simulator.yaml.
    * cameras: motion-capture system, default that of config/optitrack.yaml.
    * commander: gains and limits, default those of config/commander.yaml.
    * person: who guides the arm, default that of config/teacher.yaml.
    * swing: the throw that the person has in mind, default `Swing()`.
    * keep_states: bool, default False. Whether a `Trial` keeps the simulator's states.
    * bag: that everything is written into, default None.
    """

    def __init__(
        self,
        seed: int = 0,
        plant: PlantSettings | None = None,
        cameras: MotionCaptureConfig | None = None,
        commander: CommanderSettings | None = None,
        person: Person | None = None,
        swing: Swing | None = None,
        keep_states: bool = False,
        bag: SessionBag | None = None,
    ):
        settings = plant or PlantSettings.from_parameters(
            node_parameters("wam_simulator.yaml", "wam_simulator")
        )
        self.plant = Plant(settings, seed)
        name = THROW if settings.board is None else "darts"
        bodies = THROW_BODIES if settings.board is None else ("dart", "board")
        self._roles = (HAND, *bodies)
        cameras = cameras or MotionCaptureConfig.from_parameters(
            node_parameters("optitrack.yaml", "mock_optitrack")
        )
        self.capture = MotionCapture(replace(cameras, bodies=self._roles), seed)
        self._game = game_at(() if settings.board is None else settings.board.position)
        person = person or Person.from_parameters(node_parameters("teacher.yaml", "teacher"))
        self.teacher = Teacher(seed, swing, person, game=self._game)
        limits = commander or CommanderSettings.configured()
        self.commander = Commander(limits, self.plant.description_of_load)
        self._geometry = ArmGeometry()
        self._exposed: list[PlantState] = []
        self._log, self._keep, self._bag = ThrowLog(skill=name, bodies=bodies), keep_states, bag
        self._frame_steps = round(1e9 / self.capture.config.rate / self.plant.settings.step_ns)
        self.steps = 0

    @classmethod
    def on_arm(
        cls,
        name: str,
        seed: int = 0,
        settings: Iterable[str] = (),
        board: Board | None = None,
        **others: Any,
    ) -> "Session":
        """A session with an arm of config/fleet.yaml, "ideal" or another name, or "fleet:SEED".

        settings: further parameters, each as NODE.PARAMETER=VALUE; board: at which darts are
        thrown; others: as of a session.
        """
        of = parameters_of_arm(name, settings)
        others.setdefault("commander", CommanderSettings.from_parameters(of("commander")))
        return cls(
            seed,
            replace(PlantSettings.from_parameters(of("wam_simulator")), board=board),
            cameras=MotionCaptureConfig.from_parameters(of("mock_optitrack")),
            person=Person.from_parameters(of("teacher")),
            **others,
        )

    def close(self) -> None:
        """Release PyBullet."""
        self.plant.close()

    def teach(self, target: np.ndarray, attempts: int = 5) -> list[Trial]:
        """Guided throws at one basket until one goes in, or the attempts are used up."""
        trials = []
        for attempt in range(attempts):
            trials.append(self._guided_throw(np.asarray(target, dtype=float), correct=attempt > 0))
            outcome = trials[-1].outcome
            if outcome.in_basket:
                break
            if outcome.landing_seen:
                self.teacher.learn_from(outcome.landing)
        self.plant.reset()
        return trials

    def throw(self, plan: ThrowPlan) -> Trial:
        """One planned throw. plan: from a skill."""
        self._look_after_the_arm()
        arm = self._begin(plan.target)
        self.commander.execute(plan.motion)

        def step(arm: ArmState) -> tuple[Command, None]:
            return self.commander.step(arm), None

        return self._run(arm, plan.target, step, lambda: self.commander.mode in RESTING, "throw")

    def _look_after_the_arm(self) -> None:
        """An arm that a limit stopped in the last throw may move again in a world that is built
        anew.
        """
        if self.commander.stopped_by:
            self.plant.reset()
            self.commander.step(self.plant.arm_state)
            self.commander.reset()

    def _guided_throw(self, target: np.ndarray, correct: bool) -> Trial:
        self._look_after_the_arm()
        self.commander.release_arm(True)
        arm = self._begin(target, guided=True)
        self.teacher.begin(target, arm, correct)

        def step(arm: ArmState) -> tuple[Command, Command]:
            return self.commander.step(arm), self.teacher.step(arm)

        trial = self._run(
            arm, target, step, lambda: self.teacher.phase == Phase.WATCHING, "demonstration"
        )
        self.commander.release_arm(False)
        return trial

    def _begin(self, target: np.ndarray, guided: bool = False) -> ArmState:
        """Reset, and the first step: as in the graph, its state is answered before a person or the
        commander begins to move the arm.
        """
        self._log.clear()
        self._exposed.clear()
        self.plant.reset(target)
        arm = self._sense()
        command, push = self.commander.step(arm), Command(arm.stamp_ns) if guided else None
        self._write(arm, command, push)
        self.plant.step(command, push)
        return self._sense()

    def _write(self, arm: ArmState, command: Command, push: Command | None) -> None:
        if self._bag is not None:
            self._bag.step(arm, command, push)

    def _run(
        self,
        arm: ArmState,
        target: np.ndarray,
        step: Step,
        moved_through: Callable[[], bool],
        kind: str,
    ) -> Trial:
        states: list[PlantState] = []
        over_ns: int | None = None
        begun = arm.stamp_ns
        while over_ns is None or arm.stamp_ns < over_ns:
            if self._keep:
                states.append(self.plant.state)
            command, push = step(arm)
            self._write(arm, command, push)
            for answer in (command, push):
                if answer is not None and answer.grip == Grip.OPEN:
                    self._log.add_opening(answer.stamp_ns)
            self.plant.step(command, push)
            arm = self._sense()
            self.steps += 1
            if over_ns is None and moved_through():
                opened = self._log.opened_ns or arm.stamp_ns
                over_ns = max(arm.stamp_ns, opened + the_world().watch_ns)
            if (arm.stamp_ns - begun) * 1e-9 > LONGEST_THROW:
                break
        return self._trial(target, states, kind, over_ns or arm.stamp_ns)

    def _sense(self) -> ArmState:
        """What the arm's own sensors say now; the cameras expose a frame when it is time."""
        arm = self.plant.arm_state
        self._log.add_joints(arm.stamp_ns, arm.position, arm.velocity)
        if self.plant.step_count % self._frame_steps == 0:
            self._exposed.append(self.plant.state)
        return arm

    def _look_back(self, now_ns: int) -> None:
        """Log what the cameras have delivered by now: nobody looks at it before a throw is over,
        and many frames at once take less time.
        """
        queue = LatencyQueue()
        queue.push(
            self.capture.observe_frames(
                self._exposed[0].episode, [self._frame(state) for state in self._exposed]
            )
        )
        come = queue.due(now_ns)
        if self._bag is not None:
            self._bag.see(come)
        for sample in come:
            self._log.take(sample.name, sample.stamp_ns, sample.position, sample.quaternion)

    def _frame(self, state: PlantState) -> Frame:
        hand, thrown, aimed_at = self._roles
        bodies = {
            hand: (state.hand_position, state.hand_quaternion),
            thrown: (state.ball_position, state.ball_quaternion),
            aimed_at: (state.basket, np.array([0.0, 0.0, 0.0, 1.0])),
        }
        basket, board, number = (
            self.plant.settings.basket,
            self.plant.settings.board,
            state.step // self._frame_steps,
        )
        capsules = self._geometry.capsules(state.position, self.plant.settings.base_turn)
        if board is None:
            return Frame(
                state.stamp_ns,
                bodies,
                capsules,
                BasketWalls(state.basket, basket.radius, basket.depth),
                number,
            )
        ends, radii = (
            np.concatenate(parts) for parts in zip(capsules, board.capsules, strict=True)
        )
        return Frame(state.stamp_ns, bodies, (ends, radii), number=number)

    def _trial(
        self, target: np.ndarray, states: list[PlantState], kind: str, over_ns: int
    ) -> Trial:
        state = self.plant.state
        self._look_back(state.stamp_ns)
        if self._bag is not None:
            self._bag.end_of_movement()
        if self.plant.fault:
            raise ValueError(f"the arm's safety module stopped it: {self.plant.fault}")
        if self._log.opened_ns is None and self.commander.message:
            raise ValueError(f"the throw was stopped: {self.commander.message}")
        until_ns = over_ns - ARRIVAL_NS
        demonstration = self._log.cut(f"{kind}_{state.episode}", until_ns)
        assert self._log.opened_ns is not None  # or there would have been nothing to cut
        seen, game = self._log.ball_between(self._log.opened_ns, until_ns), self._game
        outcome = judge_flight(
            *seen, target, self.plant.settings.basket.radius, game.projectile, surface=game.surface
        )
        return Trial(outcome, demonstration, state.ball_in_basket, self.commander.message, states)
