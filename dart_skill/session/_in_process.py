"""The whole graph in one process, without ROS: the same steps in the same order as the nodes take,
bit for bit.

Batches of experiments run on it, and a test compares it with the nodes over DDS.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dart_skill.arm import Command, Commander, CommanderSettings, Grip, Mode, MotionPlan
from dart_skill.common.configuration import node_parameters
from dart_skill.common.surface import game_at
from dart_skill.common.world import THROW, THROW_BODIES, the_world
from dart_skill.recording import HAND, Demonstration
from dart_skill.session._session_bag import SessionBag
from dart_skill.session._step_loop import Push, StepLoop, no_push, parameters_of_arm
from dart_skill.simulation import (
    BasketWalls,
    Board,
    ControllerSettings,
    Frame,
    MotionCapture,
    MotionCaptureConfig,
    Person,
    Phase,
    Plant,
    PlantSettings,
    PlantState,
    SimulatedController,
    Swing,
    Teacher,
)
from dart_skill.skills.observation import ARRIVAL_NS, Outcome, ThrowLog, judge_flight

RESTING = (Mode.HOLDING, Mode.STOPPING)


@dataclass(frozen=True)
class Trial:
    """One throw: what the cameras made of it, the throw as a demonstration, and the simulator's
    own word on it: whether the ball is in the basket, or the dart in the board.

    Parameters
    ----------
    outcome
        By the cameras.
    ball_was_in
        By the simulator.
    states
        Of the plant, where they are kept.
    """

    outcome: Outcome
    demonstration: Demonstration
    ball_was_in: bool
    message: str = ""
    states: list[PlantState] = field(default_factory=list, repr=False)


class Session(StepLoop):
    """Simulator, motion capture, teacher, recorder and commander, stepped together.

    With a board in the plant's settings darts are thrown. Targets are then points of the board.

    Parameters
    ----------
    seed
        Int, default 0. Everything random comes from it.
    plant
        Settings of the simulated world, default those of config/wam_simulator.yaml.
    cameras
        Motion-capture system, default that of config/optitrack.yaml.
    commander
        Gains and limits, default those of config/commander.yaml.
    person
        Who guides the arm, default that of config/teacher.yaml.
    swing
        The throw that the person has in mind, default `Swing()`.
    keep_states
        Bool, default False. Whether a `Trial` keeps the simulator's states.
    bag
        That everything is written into, default None.
    controller
        Of an arm that is driven to positions; default None, the arm takes torques.
    """

    _log: ThrowLog

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
        controller: ControllerSettings | None = None,
    ):
        settings = plant or PlantSettings.from_parameters(
            node_parameters("wam_simulator.yaml", "wam_simulator")
        )
        name = THROW if settings.board is None else "darts"
        bodies = THROW_BODIES if settings.board is None else ("dart", "board")
        self._roles = (HAND, *bodies)
        cameras = cameras or MotionCaptureConfig.from_parameters(
            node_parameters("optitrack.yaml", "mock_optitrack")
        )
        world, gains = Plant(settings, seed), commander or CommanderSettings.configured()
        load, driven = world.description_of_load, None
        answers = Commander(gains, load)
        if controller is not None:
            from dart_skill.arm import TrajectoryCommander  # with parts of SciPy

            driven = SimulatedController(world.arm_state.position, controller)
            answers = TrajectoryCommander(gains, load, controller=driven)
        super().__init__(
            world,
            answers,
            MotionCapture(replace(cameras, bodies=self._roles), seed),
            bag,
            ThrowLog(skill=name, bodies=bodies),
            driven,
        )
        self._game = game_at(() if settings.board is None else settings.board.position)
        person = person or Person.from_parameters(node_parameters("teacher.yaml", "teacher"))
        self.teacher = Teacher(seed, swing, person, game=self._game)
        self._keep_states = keep_states

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

        Parameters
        ----------
        settings
            Further parameters, each as NODE.PARAMETER=VALUE.
        board
            At which darts are thrown.
        others
            As of a session.
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

    def throw(self, plan: MotionPlan) -> Trial:
        """One planned throw.

        Parameters
        ----------
        plan
            From a skill.
        """
        self._look_after_the_arm()
        self._begin(plan.thrown.target, no_push)
        self.commander.execute(plan)

        def over() -> bool:
            return not self.commander.executing and self.commander.mode in RESTING

        return self._carry_out(plan.thrown.target, no_push, over, "throw")

    def _guided_throw(self, target: np.ndarray, correct: bool) -> Trial:
        self._look_after_the_arm()
        self.commander.release_arm(True)
        self._begin(target, lambda: Command(self.plant.state_stamp_ns))
        self.teacher.begin(target, self.plant.arm_state, correct)
        trial = self._carry_out(
            target,
            lambda: self.teacher.step(self.plant.arm_state),
            lambda: self.teacher.phase == Phase.WATCHING,
            "demonstration",
        )
        self.commander.release_arm(False)
        return trial

    def _look_after_the_arm(self) -> None:
        """An arm that a limit stopped in the last throw may move again in a world that is built
        anew.
        """
        if self.commander.stopped_by:
            self.plant.reset()
            self.commander.step(self.plant.arm_state)
            self.commander.reset()

    def _begin(self, target: np.ndarray, push: Push) -> None:
        """Reset, and the first step: as in the graph, its state is answered before a person or the
        commander begins to move the arm.
        """
        self._watch_anew()
        self.plant.reset(target)
        arm = self.plant.arm_state
        self._sense(arm)
        self._answer(arm, push)

    def _carry_out(
        self, target: np.ndarray, push: Push, over: Callable[[], bool], kind: str
    ) -> Trial:
        """Step through a throw, and look back at it; ValueError if nothing was thrown."""

        def watched_until() -> int:
            now_ns = self.plant.state_stamp_ns
            return max(now_ns, (self._log.opened_ns or now_ns) + the_world().watch_ns)

        states: list[PlantState] = []
        self._kept = states if self._keep_states else None
        try:
            over_ns = self._step_until(push, over, watched_until)
        except TimeoutError:
            over_ns = self.plant.state_stamp_ns
        self._kept = None
        self._sense(self.plant.arm_state)
        self._deliver()
        if self._bag is not None:
            self._bag.end_of_movement()
        if self.plant.fault:
            raise ValueError(f"the arm's safety module stopped it: {self.plant.fault}")
        if self._log.opened_ns is None and self.commander.message:
            raise ValueError(f"the throw was stopped: {self.commander.message}")
        until_ns, state, game = over_ns - ARRIVAL_NS, self.plant.state, self._game
        demonstration = self._log.cut(f"{kind}_{state.episode}", until_ns)
        assert self._log.opened_ns is not None  # or there would have been nothing to cut
        seen = self._log.ball_between(self._log.opened_ns, until_ns)
        outcome = judge_flight(
            *seen, target, self.plant.settings.basket.radius, game.projectile, surface=game.surface
        )
        return Trial(outcome, demonstration, state.ball_in_basket, self.commander.message, states)

    def _hear(self, command: Command) -> None:
        """Note when the hand is told to open."""
        if command.grip == Grip.OPEN:
            self._log.add_opening(command.stamp_ns)

    def _frame(self) -> Frame:
        """What the cameras look at; walls of the basket, or the board, hide what is behind them."""
        state, settings = self.plant.state, self.plant.settings
        ends, radii = self._geometry.capsules(state.position, settings.base_turn)
        basket = settings.basket
        walls: BasketWalls | None = BasketWalls(state.basket, basket.radius, basket.depth)
        if settings.board is not None:
            board_ends, board_radii = settings.board.capsules
            ends, radii = np.concatenate([ends, board_ends]), np.concatenate([radii, board_radii])
            walls = None
        bodies = dict(zip(self._roles, self.plant.bodies.values(), strict=True))
        number = state.step // self._frame_steps
        return Frame(state.stamp_ns, bodies, (ends, radii), walls, number)
