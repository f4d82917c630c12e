"""From a plan to commands: one pure step per state of the arm.

    HOLDING -> APPROACHING -> SETTLING -> EXECUTING -> FOLLOWING_THROUGH -> HOLDING,  any -> STOPPING -> HOLDING,  FREE,
    HOLDING -> MOVING -> HOLDING

In EXECUTING a guide says what pulls the hand: the attractors (7.19) of a plan, or of a model that
is asked at every state. Between two motions the joints are held. A limit that fires brings the arm
to a damped stop and leaves its reason in `message`.
"""

import math
from collections.abc import Callable, Mapping
from enum import Enum

import numpy as np

from dart_skill.arm._command import REST_SPEED, ArmState, Command, Speed
from dart_skill.arm._contact import Yielding
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._guide import CarefulGuide, Guidance, Guide, PlanGuide
from dart_skill.arm._hand_pull import HandPull
from dart_skill.arm._impedance import (
    Impedance,
    JointServo,
    PoseGains,
    Reference,
    minimum_jerk,
)
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import MotionPlan
from dart_skill.arm._plan_checks import (
    CommanderSettings,
    PlanRefused,
    agreed,
    check_plan,
    check_range,
    registered,
)
from dart_skill.arm._registration import Registration
from dart_skill.arm._safety import SafetyModule
from dart_skill.arm._the_arm import the_arm
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import Grip

JUMP = 0.1
"""Distance of a joint from its last position, beside what it moves meanwhile, that no arm makes
[rad]: the state is another arm's.
"""
JUMP_SPEED = 30.0
"""Speed with which a joint may have moved meanwhile [rad/s]."""
COUNTS = 0.02
"""No more of a gap between two states counts as time of a careful motion [s]: it waits on its way."""
LONGEST_WAIT = 0.4
"""A longer gap ends it [s]."""
WAITED = 0.3
"""A joint that was moved farther meanwhile is another arm's, or the world was reset [rad]."""
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
"""Modes of a motion that a guide leads."""


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
        description: ArmDescription | None = None,
        measured: Registration | None = None,
    ):
        self.settings = settings or CommanderSettings.configured()
        self._measured = measured
        self._description = description or the_arm()
        share = self.settings.friction_compensation
        self._lower, self._upper = self._description.ends
        # always in the state of the arm, not in that of an expected motion
        self.model = ArmModel(self._description)
        # what the commander asks of a joint is cut to its limit: there is nothing to watch
        self._no_torque = np.zeros(self._description.n_joints)
        self._servo = JointServo(Impedance(self.model, share))
        self._pull = HandPull(self.settings, self._description, self._servo)
        self._safety = SafetyModule(self.settings.limits, self._description)
        self.mode, self.message, self.stopped_by = Mode.HOLDING, "", ""
        self._hold: np.ndarray | None = None
        self._found = (
            False  # whether the arm that is held was seen to rest since it was left to others
        )
        self._requested: Guide | None = None
        self.what = "motion"  # the last one, in a word
        self._requested_move: np.ndarray | None = None
        self._grip = Grip.UNSPECIFIED
        self._braking: tuple[np.ndarray, np.ndarray] | None = None
        self._entered_ns: int | None = 0
        self._last: ArmState | None = None
        self.time, self.tracking_error = float("nan"), float("nan")
        self.reference: Reference | None = None
        self.opened_ns: int | None = None

    @property
    def executing(self) -> bool:
        """Whether a motion is under way, from the approach to the end of the follow-through."""
        return self._requested is not None or self.mode in UNDER_WAY

    def prepare(self, plan: MotionPlan) -> None:
        """Do what `execute` needs and what takes long; it may be done in a thread of its own.

        Torques need nothing.
        """

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
        seen = registered(plan, self._measured)
        plan = seen.as_the_arm_has_it()
        check_plan(plan, self.settings, self._description)
        guide: Guide
        if plan.speed == Speed.CAREFUL:
            guide = CarefulGuide(
                plan,
                self.settings.follow_time,
                seen.registration,
                self.settings.limits.contact_force,
                self._yielding,
            )
        else:
            guide = PlanGuide(plan, self.settings.follow_time)
        self.follow(guide)

    def _yielding(self, gains: PoseGains, carries: bool, touches: bool) -> Yielding:
        """How far the hand gives way to a force in the newest state."""
        assert self._last is not None  # a guide is asked about a state
        return self._pull.yielding(self._last.position, gains, carries, touches)

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
        self._requested, self.what, self.message, self.opened_ns = guide, guide.what, "", None

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body that the cameras deliver, for the motion under way.

        Parameters
        ----------
        body
            Its role.
        stamp_ns, position, quaternion
            Of the pose, in the world of the cameras [ns], (3,) [m], (4,).
        """
        if (guide := self._requested or (self._guide if self.executing else None)) is not None:
            guide.see(body, stamp_ns, position, quaternion)

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

    def _begin(self, guide: Guide, state: ArmState) -> None:
        self._requested = None
        self._guide, self._grip = guide, Grip.UNSPECIFIED
        self._posture_before = np.array(guide.start_posture, dtype=float)
        self._pull.begin(self._posture_before)
        self._begin_way(Mode.APPROACHING, self._posture_before, state)

    def _begin_way(self, mode: Mode, posture: np.ndarray, state: ArmState) -> None:
        self._start, self._goal = state.position.copy(), posture
        self._duration = self._time_to(posture, self._start)
        self._enter(mode, state)

    def _time_to(self, posture: np.ndarray, start: np.ndarray) -> float:
        """Time of a way between postures (n,) on which no joint is faster than it may be [s]."""
        return max(
            0.3, 1.875 * float(np.abs(posture - start).max()) / self.settings.approach_speed
        )

    def _check_ready(self) -> None:
        """PlanRefused unless the arm is held at rest, so that it may begin to move."""
        self.check_free_to_move()
        if self.executing or self.moving or self.mode == Mode.STOPPING:
            raise PlanRefused(
                f"a {self.what} is under way, or the arm has not come to rest: wait for it or stop"
                " it first"
            )

    def check_free_to_move(self) -> None:
        """PlanRefused while the arm is stopped until a reset, or released."""
        if self.stopped_by:
            raise stays_stopped(self.stopped_by)
        if self.mode == Mode.FREE:
            raise PlanRefused(
                "the arm is released, and a person may hold it: hold it first (~/release_arm with"
                " false)"
            )

    @property
    def _is_careful(self) -> bool:
        """Whether what the arm does now is slower than a throw."""
        return self.mode in CAREFUL or (
            self.mode is Mode.EXECUTING and self._guide.speed == Speed.CAREFUL
        )

    @property
    def moving(self) -> bool:
        """Whether the arm is on its way to a posture."""
        return self._requested_move is not None or self.mode == Mode.MOVING

    def move_to(self, posture: np.ndarray, state: ArmState) -> float:
        """Move to a posture (n,) [rad] from the next state on, and hold it: how long it takes from
        this state [s].

        Raises
        ------
        PlanRefused
            Where the arm is not held, or the posture is outside the joints' range.
        """
        self._check_ready()
        posture = np.asarray(posture, dtype=float)
        if posture.shape != (joint_count(),) or not np.isfinite(posture).all():
            raise PlanRefused(
                f"the posture is {posture.tolist()}: give {joint_count()} finite joint angles"
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
        if free and self.stopped_by:
            raise stays_stopped(self.stopped_by)
        self.mode, self._hold, self._found = (Mode.FREE if free else Mode.HOLDING), None, False

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
        self.mode, self._entered_ns, self._braking = Mode.STOPPING, None, None

    def reset(self) -> None:
        """An arm that was stopped, by a person or by a limit, may move again.

        Raises
        ------
        PlanRefused
            While it still comes to rest.
        """
        if self.mode == Mode.STOPPING:
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
        terms = self.model.at(state.position, state.velocity)
        if not terms.are_finite:
            raise ValueError(
                f"joint state of {state.stamp_ns} ns is not finite: {state.position},"
                f" {state.velocity}"
            )
        self._compare_with_last(state)
        if self._requested is not None:
            self._begin(self._requested, state)
        if self._requested_move is not None:
            self._begin_way(Mode.MOVING, self._requested_move, state)
            self._requested_move = None
        if self._entered_ns is None:
            self._entered_ns = state.stamp_ns
        self.time = (state.stamp_ns - self._entered_ns) * 1e-9
        command = self._ANSWERS[self.mode](self, state)
        fault = self._safety.look_at(terms, self._no_torque, command.speed)
        if fault and not self.stopped_by:
            self.stop(f"stopped: {fault}", until_reset=True)
            command = self._ANSWERS[self.mode](self, state)
        return self._safety.limited_at(terms, command)

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
        speed = Speed.CAREFUL if self._is_careful else Speed.THROW
        return Command(state.stamp_ns, wrench, torque, grip, speed)

    # one method per mode

    def _holding(self, state: ArmState) -> Command:
        if not self._found and _fastest(state) > REST_SPEED:
            self._enter(Mode.STOPPING, state)
            return self._come_to_rest(state)
        self._found = True
        if self._hold is None:
            self._hold = state.position.copy()
        return self._command(state, self._servo.hold(state.position, state.velocity, self._hold))

    def _on_the_way(self, state: ArmState) -> Command:
        if self.time < self._duration:
            wanted = minimum_jerk(self._start, self._goal, self._duration, self.time)
            return self._command(
                state, self._servo.torque(state.position, state.velocity, *wanted)
            )
        if self.mode == Mode.MOVING:
            self._hold = self._goal
            self._enter(Mode.HOLDING, state)
            return self._holding(state)
        self._enter(Mode.SETTLING, state)
        self._quiet_ns = state.stamp_ns
        return self._settling(state)

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
        now = self._look(state, self.time)
        if now is None:
            return self._come_to_rest(state)
        careful = self._guide.speed == Speed.CAREFUL and not now.touches
        wrench, torque = self._pull.at(state, now, self.time, careful)
        self._note_grip(now.grip, state)
        return self._command(state, torque, wrench, now.grip)

    def _look(self, state: ArmState, time: float) -> Guidance | None:
        """What the guide of a motion says at a time on its clock [s]; None if the motion is over, or
        was stopped.
        """
        hand = self.model.hand_state(state.position, state.velocity)
        now = self._guide.look(time, hand, state.stamp_ns)
        if now.over:
            self._enter(Mode.FOLLOWING_THROUGH, state)
            return None
        self.reference, self.tracking_error = (
            now.reference,
            math.dist(now.reference.position, hand.position),
        )
        if reason := now.fault or limit_broken(
            state.position, now.off, self.settings, self._lower, self._upper
        ):
            self.stop(reason)
            return None
        return now

    def _note_grip(self, grip: Grip, state: ArmState) -> None:
        """What the hand is told is said in every command from now on, so that an arm that takes only
        the newest one misses nothing.
        """
        if grip == Grip.OPEN and self.opened_ns is None:
            self.opened_ns = state.stamp_ns
        self._grip = grip

    def _come_to_rest(self, state: ArmState) -> Command:
        if _fastest(state) < REST_SPEED or self.time > LONGEST_STOP:
            self._hold, self._found = None, True
            self._enter(Mode.HOLDING, state)
            return self._holding(state)
        # What the hand was told it is told until the arm is at rest.
        grip = self._grip if self.mode == Mode.FOLLOWING_THROUGH else Grip.UNSPECIFIED
        if self.settings.tracking != "joints":
            return self._command(
                state, self._servo.damp(state.position, state.velocity), grip=grip
            )
        if self._braking is None:
            self._braking = state.position.copy(), state.velocity.copy()
        torque = self._servo.brake(state.position, state.velocity, *self._braking, self.time)
        return self._command(state, torque, grip=grip)

    _ANSWERS: Mapping[Mode, Callable[["Commander", ArmState], Command]] = {
        Mode.HOLDING: _holding,
        Mode.FREE: lambda self, state: self._command(state, np.zeros(joint_count())),
        Mode.APPROACHING: _on_the_way,
        Mode.SETTLING: _settling,
        Mode.EXECUTING: _executing,
        Mode.FOLLOWING_THROUGH: _come_to_rest,
        Mode.STOPPING: _come_to_rest,
        Mode.MOVING: _on_the_way,
    }

    # helpers

    def _compare_with_last(self, state: ArmState) -> None:
        """What the time and the way since the last state tell.

        A state that the arm cannot have come to is refused. A careful motion waits during a short
        gap in the states. After a long one, as when the world was reset, the arm may be anywhere:
        it is held where it is found; a free arm stays free.
        """
        if self._last is not None:
            gap = (state.stamp_ns - self._last.stamp_ns) * 1e-9
            way = state.position - self._last.position
            moves = self._is_careful and self.mode is not Mode.HOLDING
            waits = moves and COUNTS < gap <= LONGEST_WAIT and np.abs(way).max() < WAITED
            if waits and self._entered_ns is not None:
                self._entered_ns += round(1e9 * (gap - COUNTS))
            elif 0.0 <= gap <= self.settings.longest_gap:
                refuse_jump(way, gap, self._description)
            else:
                if self.mode in UNDER_WAY:
                    self.message = f"{_gone_by(gap)} during a {self.what}"
                if self.mode == Mode.MOVING:
                    self.message = f"{_gone_by(gap)} while it moved to a posture"
                self._hold, self._found = None, False
                if self.mode != Mode.FREE:
                    self.mode = Mode.HOLDING
        self._last = state

    def _enter(self, mode: Mode, state: ArmState) -> None:
        self._braking = None
        self.mode, self._entered_ns, self.time = mode, state.stamp_ns, 0.0


def stays_stopped(reason: str) -> PlanRefused:
    """Answer to a call that would move an arm that is stopped."""
    return PlanRefused(
        f"the arm is {reason}, and stays so until it is reset: look at it, then call"
        " /commander/reset"
    )


def limit_broken(
    position: np.ndarray,
    off: float,
    settings: CommanderSettings,
    lower: np.ndarray,
    upper: np.ndarray,
) -> str:
    """Which limit of a motion joints (n,) [rad], or a hand so far off [m], have passed, in words;
    empty for none.
    """
    margin = settings.limits.joint_margin
    room = np.minimum(position - lower, upper - position).tolist()
    if not min(room) >= margin:
        j = room.index(min(room))
        return (
            f"j{j + 1} is at {position[j]:.3f} rad, closer than {margin} rad to the end of its"
            " range"
        )
    if off > settings.farthest_error:
        return (
            f"the hand is {off:.3f} m from the plan, farther than the limit of"
            f" {settings.farthest_error} m"
        )
    return ""


def refuse_jump(way: np.ndarray, gap: float, description: ArmDescription) -> None:
    """ValueError for a way (n,) [rad] that no arm has gone within a gap [s]."""
    ways = [abs(one) for one in way.tolist()]
    if (most := max(ways)) > JUMP + JUMP_SPEED * gap:
        name = description.joints[ways.index(most)].name
        raise ValueError(
            f"{name} jumped by {most:.2f} rad within {gap:.3f} s: that is another arm, or the"
            " message is damaged"
        )


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
