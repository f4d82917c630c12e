"""From a plan to commands: one pure step per state of the arm.

    HOLDING -> APPROACHING -> SETTLING -> EXECUTING -> FOLLOWING_THROUGH -> HOLDING,  any -> STOPPING -> HOLDING,  FREE,
    HOLDING -> MOVING -> HOLDING

In EXECUTING a guide says what pulls the hand: the attractors (7.19) of a plan, or of a model that
is asked at every state. Between two motions the joints are held. A limit that fires brings the arm
to a damped stop and leaves its reason in `message`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum

import numpy as np

from dart_skill.arm._command import REST_SPEED, ArmState, Command, Speed
from dart_skill.arm._description import WamDescription, wam_description
from dart_skill.arm._drive import coasted, cut, with_swing
from dart_skill.arm._guide import Guidance, Guide, PlanGuide
from dart_skill.arm._impedance import (
    Impedance,
    JointServo,
    PoseGains,
    Reference,
    minimum_jerk,
    rotation_error,
)
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import MotionPlan
from dart_skill.arm._registration import Registration
from dart_skill.arm._safety import SafetyLimits, SafetyModule
from dart_skill.common.configuration import node_parameters
from dart_skill.common.constants import N_JOINTS, Grip
from dart_skill.common.quaternions import CONJUGATE, matrices, product, to_vectors, unit

STRETCHED = 0.005
"""Nearer than this to its full reach the arm cannot follow a plan: the elbow may turn over [m]."""

TRACKING = ("joints", "hand", "none")

MOST_OFFSET = 0.05
"""Distance between the places of the hand by the registration of a plan and by the measured one
above which the plan is refused [m].
"""
MOST_TURN = 0.15
"""The same of the orientation [rad]."""
NO_TORQUE = np.zeros(N_JOINTS)
"""What the commander asks of a joint is cut to its limit: there is nothing to watch."""
JUMP = 0.1
"""Distance of a joint from its last position, beside what it moves meanwhile, that no arm makes
[rad]: the state is another arm's.
"""
JUMP_SPEED = 30.0
"""Speed with which a joint may have moved meanwhile [rad/s]."""
LONGEST_STOP = 2.0
"""An arm that still creeps after so long, because gravity is compensated badly, is held where it
is [s].
"""


class Mode(Enum):
    """What the commander is doing."""

    HOLDING = "holding"
    FREE = "free"
    APPROACHING = "approaching"
    SETTLING = "settling"
    EXECUTING = "executing"
    FOLLOWING_THROUGH = "following_through"
    STOPPING = "stopping"
    MOVING = "moving"


CAREFUL = (Mode.HOLDING, Mode.MOVING, Mode.APPROACHING, Mode.SETTLING)
"""In the others the arm may be as fast as a throw: an arm that is released is guided through one,
and one that stops was in one. What a motion needs its guide says.
"""
UNDER_WAY = (Mode.APPROACHING, Mode.SETTLING, Mode.EXECUTING, Mode.FOLLOWING_THROUGH)


@dataclass(frozen=True)
class CommanderSettings:
    """Gains and limits; each is a parameter of the commander node, and its value stands in
    config/commander.yaml.

    Parameters
    ----------
    tracking_stiffness, tracking_damping
        Pull towards the predicted motion on top of the attractor's, per unit mass [1/s^2], [1/s].
    tracking_stiffness_rotation, tracking_damping_rotation
        The same for orientation [1/s^2], [1/s].
    tracking
        What keeps the arm on the motion that (7.19) predicts: "joints", a servo of the joints, the
        motion's torques fed forward; "hand", a second pull of the hand; "none", the law alone.
    friction_compensation
        Share of the identified joint friction, 0 to 1.
    approach_speed
        Fastest joint on the way to the start of a throw [rad/s].
    settle_speed, settle_time
        The arm rests below this joint speed [rad/s], for so long before a throw [s].
    settle_limit
        The throw begins even if the arm does not rest for so long [s].
    farthest_error
        Distance of the hand from the plan at which a throw is stopped [m].
    longest_gap
        Between two states of the arm; after a longer one the arm is held where it is found [s].
    follow_time
        The hand stays on the plan so long after the release [s]. Then joint damping brings the arm
        to rest: the plan beyond is of no use to the ball, and leads through the stretched arm.
    limits
        Of the arm, from config/limits.yaml.
    """

    tracking: str
    tracking_stiffness: float
    tracking_damping: float
    tracking_stiffness_rotation: float
    tracking_damping_rotation: float
    friction_compensation: float
    approach_speed: float
    settle_speed: float
    settle_time: float
    settle_limit: float
    farthest_error: float
    longest_gap: float
    follow_time: float
    limits: SafetyLimits

    def __post_init__(self) -> None:
        if self.tracking not in TRACKING:
            raise ValueError(f"tracking is '{self.tracking}': choose one of {', '.join(TRACKING)}")

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> "CommanderSettings":
        """Settings from the parameters of the commander node."""
        own = {f.name: parameters[f.name] for f in fields(cls) if f.name != "limits"}
        return cls(**own, limits=SafetyLimits.from_parameters(parameters))

    @classmethod
    def configured(cls, **changes: float | str) -> "CommanderSettings":
        """Settings of config/commander.yaml and limits.yaml, some of them changed.

        Raises
        ------
        KeyError
            Names what is no setting.
        """
        if unknown := set(changes) - {
            f.name for kind in (cls, SafetyLimits) for f in fields(kind) if f.name != "limits"
        }:
            raise KeyError(f"{', '.join(sorted(unknown))}: no setting of the commander")
        return cls.from_parameters({**node_parameters("commander.yaml", "commander"), **changes})


class PlanRefused(ValueError):
    """The plan cannot be thrown; the message says which value breaks which limit."""


class Commander:
    """Answers every state of the arm with one command.

    Parameters
    ----------
    settings
        Gains, limits and times; None: those of `CommanderSettings`.
    description
        The arm; None: the WAM.
    measured
        Registration of cameras and arm as it was measured before; None: that of a plan is
        believed.
    """

    _guide: Guide  # of the last motion: only its modes ask for it
    _posture_before: np.ndarray  # of the joints, before that motion
    _start: np.ndarray
    _goal: np.ndarray  # of the last motion to a posture

    def __init__(
        self,
        settings: CommanderSettings | None = None,
        description: WamDescription | None = None,
        measured: Registration | None = None,
    ):
        self.settings = settings or CommanderSettings.configured()
        self._measured = measured
        self._description = description or wam_description()
        share = self.settings.friction_compensation
        self._lower, self._upper = (
            self._description.of_joints("lower"),
            self._description.of_joints("upper"),
        )
        self._loaded = Impedance(ArmModel(self._description, ball_in_hand=True), share)
        self._empty = Impedance(ArmModel(self._description, ball_in_hand=False), share)
        # always in the state of the arm, not in that of an expected motion
        self._model = ArmModel(self._description)
        self._servo = JointServo(Impedance(self._model, share))
        s = self.settings
        self._safety = SafetyModule(s.limits, self._description)
        self._tracking = PoseGains.of(
            (s.tracking_stiffness, s.tracking_damping),
            (s.tracking_stiffness_rotation, s.tracking_damping_rotation),
        )
        self._mode, self.message, self.stopped_by = Mode.HOLDING, "", ""
        self._hold: np.ndarray | None = None
        self._found = (
            False  # whether the arm that is held was seen to rest since it was left to others
        )
        self._requested: Guide | None = None
        self.what = "motion"  # the last one, in a word
        self._requested_move: np.ndarray | None = None
        self._grip, self._carries = Grip.UNSPECIFIED, False
        self._expected: tuple[np.ndarray, np.ndarray, np.ndarray, float] | None = None
        self._braking: tuple[np.ndarray, np.ndarray] | None = None
        self._entered_ns: int | None = 0
        self._last: ArmState | None = None
        self.time, self.tracking_error = float("nan"), float("nan")
        self.reference: Reference | None = None
        self.opened_ns: int | None = None

    @property
    def mode(self) -> Mode:
        return self._mode

    @property
    def executing(self) -> bool:
        """Whether a motion is under way, from the approach to the end of the follow-through."""
        return self._requested is not None or self._mode in UNDER_WAY

    def execute(self, plan: MotionPlan) -> None:
        """Begin a planned motion with the next state.

        Parameters
        ----------
        plan
            Of the hand.

        Raises
        ------
        PlanRefused
            If a limit forbids it.
        """
        self._check_ready()
        plan = registered(plan, self._measured).as_the_arm_has_it()
        check_plan(plan, self.settings, self._description)
        self._request(PlanGuide(plan, self.settings.follow_time))

    def follow(self, guide: Guide) -> None:
        """Begin a motion with the next state, in which a guide says at every state what the hand
        shall do.

        Parameters
        ----------
        guide
            Who says it.
        """
        self._check_ready()
        check_range("the start posture", guide.start_posture, self._lower, self._upper)
        self._request(guide)

    def agreed(
        self, own: Registration, position: np.ndarray, quaternion: np.ndarray
    ) -> Registration:
        """The registration that counts for a motion whose hand starts there (3,), (4,), as the
        cameras see it.

        Parameters
        ----------
        own
            The guide's registration.
        position, quaternion
            Of the hand.

        Raises
        ------
        PlanRefused
            If none.
        """
        return agreed(own, self._measured, position[None], quaternion[None])

    def _request(self, guide: Guide) -> None:
        self._requested, self.what, self.message, self.opened_ns = guide, guide.what, "", None

    def _begin(self, guide: Guide, state: ArmState) -> None:
        self._requested = None
        self._guide, self._grip, self._carries, self._expected = (
            guide,
            Grip.UNSPECIFIED,
            False,
            None,
        )
        self._posture_before = np.array(guide.start_posture, dtype=float)
        self._taken_out = np.zeros(N_JOINTS)  # by the torques of a careful motion
        self._begin_way(self._posture_before, state)
        self._enter(Mode.APPROACHING, state)

    def _begin_way(self, posture: np.ndarray, state: ArmState) -> None:
        self._start = state.position.copy()
        self._approach = self._time_to(posture, self._start)

    def _time_to(self, posture: np.ndarray, start: np.ndarray) -> float:
        """Time of a way between postures (7,) on which no joint is faster than it may be [s]."""
        return max(
            0.3, 1.875 * float(np.abs(posture - start).max()) / self.settings.approach_speed
        )

    def _check_ready(self) -> None:
        """PlanRefused unless the arm is held at rest, so that it may begin to move."""
        self.check_free_to_move()
        if self.executing or self.moving or self._mode == Mode.STOPPING:
            raise PlanRefused(
                f"a {self.what} is under way, or the arm has not come to rest: wait for it or stop"
                " it first"
            )

    def check_free_to_move(self) -> None:
        """PlanRefused while the arm is stopped until a reset, or released."""
        self._check_not_stopped()
        if self._mode == Mode.FREE:
            raise PlanRefused(
                "the arm is released, and a person may hold it: hold it first (~/release_arm with"
                " false)"
            )

    def _check_not_stopped(self) -> None:
        if self.stopped_by:
            raise PlanRefused(
                f"the arm is {self.stopped_by}, and stays so until it is reset: look at it, then"
                " call /commander/reset"
            )

    @property
    def moving(self) -> bool:
        """Whether the arm is on its way to a posture."""
        return self._requested_move is not None or self._mode == Mode.MOVING

    def move_to(self, posture: np.ndarray, state: ArmState) -> float:
        """Move to a posture (7,) [rad] from the next state on, and hold it: how long it takes from
        this state [s].

        Raises
        ------
        PlanRefused
            Where the arm is not held, or the posture is outside the joints' range.
        """
        self._check_ready()
        posture = np.asarray(posture, dtype=float)
        if posture.shape != (N_JOINTS,) or not np.isfinite(posture).all():
            raise PlanRefused(
                f"the posture is {posture.tolist()}: give {N_JOINTS} finite joint angles"
            )
        margin = self.settings.limits.joint_margin
        check_range("the posture", posture, self._lower + margin, self._upper - margin)
        self._requested_move, self.message = posture, ""
        return self._time_to(posture, state.position)

    def release_arm(self, free: bool) -> None:
        """Leave the arm to gravity compensation alone, or hold it again where it is.

        Parameters
        ----------
        free
            Whether to leave it.

        Raises
        ------
        PlanRefused
            While it moves.
        """
        if self.executing or self.moving:
            raise PlanRefused(
                f"a {self.what} is under way, or the arm moves to a posture: stop it before it is"
                " released (~/stop)"
            )
        if free:
            self._check_not_stopped()
        self._mode, self._hold, self._found = (Mode.FREE if free else Mode.HOLDING), None, False

    @property
    def warning(self) -> str:
        """What is near a limit of config/limits.yaml now; empty if nothing is."""
        return self._safety.warning

    def stop(self, reason: str, until_reset: bool = False) -> None:
        """Bring the arm to a damped stop and hold it; `reason` is kept as the message.

        Parameters
        ----------
        until_reset
            Nothing moves it before `reset`.
        """
        self.stopped_by = self.stopped_by or (reason if until_reset else "")
        self.message, self._requested, self._requested_move = reason, None, None
        self._mode, self._entered_ns, self._braking = Mode.STOPPING, None, None

    def reset(self) -> None:
        """An arm that was stopped, by a person or by a limit, may move again.

        Raises
        ------
        PlanRefused
            While it still comes to rest.
        """
        if self._mode == Mode.STOPPING:
            raise PlanRefused(
                "the arm has not come to rest yet: look at it, and call /commander/reset again"
            )
        self.stopped_by = ""
        self._safety.reset()

    def step(self, state: ArmState) -> Command:
        """The command that answers `state`.

        Raises
        ------
        ValueError
            For a state that is not finite.
        """
        terms = self._model.at(state.position, state.velocity)
        if not terms.are_finite:
            raise ValueError(
                f"joint state of {state.stamp_ns} ns is not finite: {state.position},"
                f" {state.velocity}"
            )
        self._compare_with_last(state)
        if self._requested is not None:
            self._begin(self._requested, state)
        if self._requested_move is not None:
            self._goal = self._requested_move
            self._requested_move = None
            self._begin_way(self._goal, state)
            self._enter(Mode.MOVING, state)
        if self._entered_ns is None:
            self._entered_ns = state.stamp_ns
        self.time = (state.stamp_ns - self._entered_ns) * 1e-9
        command = self._answer(state)
        fault = self._safety.look_at(terms, NO_TORQUE, command.speed)
        if fault and not self.stopped_by:
            self.stop(f"stopped: {fault}", until_reset=True)
            command = self._answer(state)
        return self._safety.limited_at(terms, command)

    def _answer(self, state: ArmState) -> Command:
        return self._ANSWERS[self._mode](self, state)

    def _command(
        self,
        state: ArmState,
        torque: np.ndarray,
        wrench: np.ndarray | None = None,
        grip: Grip = Grip.UNSPECIFIED,
    ) -> Command:
        """The answer to a state, with the level of speed that the mode needs."""
        if wrench is None:
            wrench = np.zeros(6)
        careful = self._mode in CAREFUL or (
            self._mode is Mode.EXECUTING and self._guide.speed == Speed.CAREFUL
        )
        return Command(
            state.stamp_ns, wrench, torque, grip, Speed.CAREFUL if careful else Speed.THROW
        )

    # one method per mode

    def _holding(self, state: ArmState) -> Command:
        if not self._found and _fastest(state) > REST_SPEED:
            self._enter(Mode.STOPPING, state)
            return self._stopping(state)
        self._found = True
        if self._hold is None:
            self._hold = state.position.copy()
        return self._command(state, self._servo.hold(state.position, state.velocity, self._hold))

    def _free(self, state: ArmState) -> Command:
        return self._command(state, np.zeros(N_JOINTS))

    def _approaching(self, state: ArmState) -> Command:
        if self.time >= self._approach:
            self._enter(Mode.SETTLING, state)
            self._quiet_ns = state.stamp_ns
            return self._settling(state)
        return self._joint_command(
            state, *minimum_jerk(self._start, self._posture_before, self._approach, self.time)
        )

    def _moving(self, state: ArmState) -> Command:
        if self.time >= self._approach:
            self._hold = self._goal
            self._enter(Mode.HOLDING, state)
            return self._holding(state)
        return self._joint_command(
            state, *minimum_jerk(self._start, self._goal, self._approach, self.time)
        )

    def _settling(self, state: ArmState) -> Command:
        if _fastest(state) > self.settings.settle_speed:
            self._quiet_ns = state.stamp_ns
        quiet = (state.stamp_ns - self._quiet_ns) * 1e-9
        if quiet >= self.settings.settle_time or self.time >= self.settings.settle_limit:
            self._enter(Mode.EXECUTING, state)
            return self._executing(state)
        return self._command(
            state, self._servo.hold(state.position, state.velocity, self._posture_before)
        )

    def _executing(self, state: ArmState) -> Command:
        hand = self._model.hand_state(state.position, state.velocity)
        now = self._guide.look(self.time, hand, state.stamp_ns)
        if now.over:
            self._enter(Mode.FOLLOWING_THROUGH, state)
            return self._following_through(state)
        self._carries = now.carries
        self.reference, self.tracking_error = (
            now.reference,
            math.dist(now.reference.position, hand.position),
        )
        if reason := now.fault or self._limit_broken(state, now.off):
            self.stop(reason)
            return self._stopping(state)
        if self.settings.tracking == "joints":
            wrench, torque = self._follow(state, now)
        else:
            tracking = self._tracking if self.settings.tracking == "hand" else None
            acceleration = self._arm_now.pulled(
                state.position, state.velocity, now.reference, now.gains, tracking
            )
            wrench, torque = self._arm_now.act(
                state.position, state.velocity, acceleration, self._posture(state.position, now)
            )
        limits = self.settings.limits
        wrench = cut(wrench, limits.strongest_force, limits.strongest_moment)
        return self._command(state, torque, wrench, self._told(now.grip, state))

    @property
    def _arm_now(self) -> Impedance:
        return self._loaded if self._carries else self._empty

    def _posture(self, position: np.ndarray, now: Guidance) -> np.ndarray:
        """What the free motion of the arm aims at (7,): the posture of the start, or of the plan,
        but for the joints that swing.
        """
        return with_swing(self._posture_before if now.posture is None else now.posture, position)

    def _follow(self, state: ArmState, now: Guidance) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and torque (7,) of the motion that (7.19) makes of the plan on the model of
        the arm, and a pull of the joints to it.

        The law acts on the model, where nothing is late or noisy; of the arm's own sensors only
        the joints' servo lives.
        """
        q, qd = self._expected_now(state)
        acceleration = self._arm_now.pulled(q, qd, now.reference, now.gains, self._tracking)
        wrench, torque, qdd = self._arm_now.moved(q, qd, acceleration, self._posture(q, now))
        if self._guide.speed == Speed.CAREFUL and self._expected is not None:
            self._taken_out = self._servo.take_out(
                self._taken_out, state.position, q, self.time - self._expected[3]
            )
        self._expected = q, qd, qdd, self.time
        return wrench, torque + self._taken_out + self._servo.follow(
            state.position, state.velocity, q, qd
        )

    def _expected_now(self, state: ArmState) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds (7,) of the expected motion, which begins at rest where the arm is."""
        if self._expected is None:
            return state.position.copy(), np.zeros(N_JOINTS)
        q, qd, qdd, then = self._expected
        return coasted(q, qd, qdd, self.time - then)

    def _following_through(self, state: ArmState) -> Command:
        return self._come_to_rest(state)

    def _stopping(self, state: ArmState) -> Command:
        return self._come_to_rest(state)

    def _come_to_rest(self, state: ArmState) -> Command:
        if _fastest(state) < REST_SPEED or self.time > LONGEST_STOP:
            self._hold, self._found = None, True
            self._enter(Mode.HOLDING, state)
            return self._holding(state)
        if self.settings.tracking != "joints":
            return self._command(state, self._servo.damp(state.velocity), grip=self._still_told())
        if self._braking is None:
            self._braking = state.position.copy(), state.velocity.copy()
        torque = self._servo.brake(state.position, state.velocity, *self._braking, self.time)
        return self._command(state, torque, grip=self._still_told())

    _ANSWERS: Mapping[Mode, Callable[["Commander", ArmState], Command]] = {
        Mode.HOLDING: _holding,
        Mode.FREE: _free,
        Mode.APPROACHING: _approaching,
        Mode.SETTLING: _settling,
        Mode.EXECUTING: _executing,
        Mode.FOLLOWING_THROUGH: _following_through,
        Mode.STOPPING: _stopping,
        Mode.MOVING: _moving,
    }

    # helpers

    def _compare_with_last(self, state: ArmState) -> None:
        """What the time and the way since the last state tell."""
        if self._last is not None:
            gap = (state.stamp_ns - self._last.stamp_ns) * 1e-9
            if 0.0 <= gap <= self.settings.longest_gap:
                self._refuse_jump(state, self._last, gap)
            else:
                self._bridge(gap)
        self._last = state

    def _refuse_jump(self, state: ArmState, last: ArmState, gap: float) -> None:
        """ValueError for a state that the arm cannot have come to from the last one; after a gap
        it may be anywhere.
        """
        ways = [abs(way) for way in (state.position - last.position).tolist()]
        if (most := max(ways)) > JUMP + JUMP_SPEED * gap:
            name = self._description.joints[ways.index(most)].name
            raise ValueError(
                f"{name} jumped by {most:.2f} rad within {gap:.3f} s: that is another arm, or the"
                " message is damaged"
            )

    def _bridge(self, gap: float) -> None:
        """After a gap in the states, as when the world was reset, the arm is held where it is
        found; a free arm stays free.
        """
        if self._mode in UNDER_WAY:
            self.message = f"{_gone_by(gap)} during a {self.what}"
        if self._mode == Mode.MOVING:
            self.message = f"{_gone_by(gap)} while it moved to a posture"
        self._hold, self._found = None, False
        if self._mode != Mode.FREE:
            self._mode = Mode.HOLDING

    def _enter(self, mode: Mode, state: ArmState) -> None:
        self._braking = None
        self._mode, self._entered_ns, self.time = mode, state.stamp_ns, 0.0

    def _joint_command(
        self, state: ArmState, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray
    ) -> Command:
        return self._command(state, self._servo.torque(state.position, state.velocity, q, qd, qdd))

    def _still_told(self) -> Grip:
        """What every command says to the hand after the throw: the same as before, until the arm
        is at rest.
        """
        return self._grip if self._mode == Mode.FOLLOWING_THROUGH else Grip.UNSPECIFIED

    def _told(self, grip: Grip, state: ArmState) -> Grip:
        """Say this to the hand in every command from now on, so that an arm that takes only the
        newest command misses nothing.
        """
        if grip == Grip.OPEN and self.opened_ns is None:
            self.opened_ns = state.stamp_ns
        self._grip = grip
        return grip

    def _limit_broken(self, state: ArmState, off: float) -> str:
        margin = self.settings.limits.joint_margin
        room = np.minimum(state.position - self._lower, self._upper - state.position).tolist()
        if not min(room) >= margin:
            j = room.index(min(room))
            return (
                f"j{j + 1} is at {state.position[j]:.3f} rad, closer than {margin} rad to the end"
                " of its range"
            )
        if off > self.settings.farthest_error:
            return (
                f"the hand is {off:.3f} m from the plan, farther than the limit of"
                f" {self.settings.farthest_error} m"
            )
        return ""


def _fastest(state: ArmState) -> float:
    """Speed of the fastest joint [rad/s]."""
    return max(abs(speed) for speed in state.velocity.tolist())


def _gone_by(gap: float) -> str:
    """A gap between two states [s], in words."""
    return (
        f"no state of the arm for {gap:.2f} s"
        if gap > 0.0
        else f"the states of the arm went back in time by {-gap:.3f} s"
    )


def registered(plan: MotionPlan, measured: Registration | None) -> MotionPlan:
    """The plan with the registration that counts, as of `agreed`."""
    return replace(
        plan,
        registration=agreed(plan.registration, measured, plan.path.position, plan.path.quaternion),
    )


def agreed(
    own: Registration, measured: Registration | None, position: np.ndarray, quaternion: np.ndarray
) -> Registration:
    """The measured registration if a plan has none of its own, else that.

    Demonstrations without joint states teach no registration, and one of before the cameras were
    moved is wrong.

    Parameters
    ----------
    position, quaternion
        Of the hand as the cameras shall see it (n, 3), (n, 4).

    Raises
    ------
    PlanRefused
        If they contradict each other.
    """
    if measured is None:
        return own
    if own.is_none:
        return measured
    (at, hand), (there, other) = (one.poses(position, quaternion) for one in (own, measured))
    offset = float(np.linalg.norm(at - there, axis=1).max())
    turn = float(np.linalg.norm(to_vectors(product(hand, other * CONJUGATE)), axis=1).max())
    if offset > MOST_OFFSET or turn > MOST_TURN:
        raise PlanRefused(
            f"the plan has the hand {offset:.3f} m and {turn:.2f} rad from where the registration"
            " file does: were cameras, base or body moved since it was measured, or the throws"
            " shown before? Measure again (dart-skill check arm), or teach again"
        )
    return own


def check_plan(plan: MotionPlan, settings: CommanderSettings, description: WamDescription) -> None:
    """PlanRefused, with the value and the limit, if the plan leaves the joints' range or the
    hand's speed limit.
    """
    lower, upper = description.of_joints("lower"), description.of_joints("upper")
    check_range("the start posture", plan.start_posture, lower, upper)
    speed = float(np.linalg.norm(plan.path.velocity[:, :3], axis=1).max())
    fastest = (
        settings.limits.fastest_hand if plan.speed == Speed.THROW else settings.limits.careful_hand
    )
    if speed > fastest:
        raise PlanRefused(
            f"the plan moves the hand at {speed:.2f} m/s; the limit of a {plan.what} is {fastest}"
            " m/s: choose a nearer target"
        )
    shoulder = np.array([0.0, 0.0, description.mount_height + description.shoulder_height])
    reach = description.reach
    swing = plan.path.position[plan.path.time <= plan.end]
    farthest = float(np.linalg.norm(swing - shoulder, axis=1).max())
    if farthest > reach - STRETCHED:
        raise PlanRefused(
            f"the plan takes the hand {farthest:.3f} m from the shoulder; the arm is stretched at"
            f" {reach:.3f} m: choose a nearer target, or drop what was shown with a straight"
            " elbow, and show it with a bent one"
        )
    model = ArmModel(description)
    position, rotation = model.hand_pose(plan.start_posture)
    offset = float(np.linalg.norm(position - plan.path.position[0]))
    turn = float(np.linalg.norm(rotation_error(matrices(unit(plan.path.quaternion[0])), rotation)))
    if offset > 0.05 or turn > 0.3:
        raise PlanRefused(
            f"the start posture holds the hand {offset:.3f} m and {turn:.2f} rad from where the"
            " path begins"
        )


def check_range(what: str, posture: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
    """PlanRefused unless joint angles (7,) are between two others, with the joint that is not."""
    outside = (posture < lower) | (posture > upper)
    if outside.any():
        j = int(np.argmax(outside))
        raise PlanRefused(
            f"{what} has j{j + 1} at {posture[j]:.2f} rad, outside {lower[j]:.2f} to"
            f" {upper[j]:.2f}"
        )
