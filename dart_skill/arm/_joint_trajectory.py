"""A planned motion as a path of the joints in time, for arms whose controllers take positions.

A plan is the motion that the law (7.19) makes of a hand without an arm. The joints' path is what the
law makes of it on the model of the arm, which the torques of `HandPull` follow, too. A throw asks
joints for speeds that they do not have, as where the elbow is straight; there `LimitedMotion` finds
the path that has the ball where the plan lets it go, and as fast. It begins and ends at rest: from
where the plan may be left, every joint is braked by a polynomial of fourth order whose speed and acceleration go on without a jump and end
at zero. Between its instants, 10 ms apart, it is the polynomial of fifth order through angles,
speeds and accelerations, as joint_trajectory_controller has it. It is made and checked as a whole
before anything is sent: ranges, speeds and torques of the joints.

How it reaches an arm is the business of `TrajectoryCommander`, which takes the place of the
commander of torques behind the same calls, so that the graph, its limits and its refusals stay as
they are; its controller is a `TrajectoryController`: an action of ROS in the node, a simulated one
in a session. A motion begins at a stamp of the arm's own clock in the near future, at which the arm
knows the path already. How far the arm lags behind it is measured while it moves, and the hand is
told to open when the arm, not the clock, is where the plan opens it. Nothing is sent while the arm
is held, since such a controller holds by itself, nor while a person guides it, in the freedrive of
the arm's maker: lessons are recorded from joint states and poses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import BPoly

from dart_skill.arm._command import Speed
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._guide import Fingers, PlanGuide
from dart_skill.arm._hand_pull import HandPull
from dart_skill.arm._impedance import Impedance, JointServo, minimum_jerk
from dart_skill.arm._limited_motion import LimitedMotion
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import GripEvent, MotionPlan, check_shapes
from dart_skill.arm._plan_checks import CommanderSettings, PlanRefused
from dart_skill.arm._range import time_to_end

STEP = 0.002
"""Step of the law on the model [s]."""
EVERY = 5
"""Steps between two instants of a trajectory."""
MISSED = 0.005, 0.05
"""Distance [m] and difference of speed [m/s] at an event above which a plan is refused: they move a
landing by 2 to 4 cm.
"""
LATE = 0.03
"""A throw is followed for so long after its end, in which late fingers let go [s]."""
BRAKES = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)
"""Times in which the arm may be braked at the end of a motion, in the order in which they are tried [s]:
a ball that flies over the hand, as of an arm that throws over its base, needs it out of the way.
"""
SOONEST = 0.1
"""A joint near the end of its range is braked within at least so long [s]."""


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """A path of the joints at n instants, from rest to rest.

    Parameters
    ----------
    time
        (n,), from 0, increasing [s].
    position, velocity, acceleration
        (n, joints) each [rad], [rad/s], [rad/s^2].
    events
        What the fingers do, on the same clock.
    carries
        Whether the hand holds something at the start.
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    events: tuple[GripEvent, ...] = ()
    carries: bool = False

    def __post_init__(self) -> None:
        shape = (len(self.time), np.shape(self.position)[-1])
        rows = dict.fromkeys(("position", "velocity", "acceleration"), shape)
        check_shapes("trajectory", self, {"time": shape[:1], **rows})
        if shape[0] < 2 or self.time[0] != 0.0 or (np.diff(self.time) <= 0.0).any():
            raise ValueError("trajectory.time must hold at least two increasing instants, from 0")

    @property
    def duration(self) -> float:
        """Time of the last instant [s]."""
        return float(self.time[-1])

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds (joints,) at a time [s]; before and after it the arm rests."""
        position, velocity = self._curves
        inside = min(max(time, 0.0), self.duration)
        return position(inside), velocity(inside)

    @cached_property
    def _curves(self) -> tuple[BPoly, BPoly]:
        rows = np.stack([self.position, self.velocity, self.acceleration], axis=1)
        curve = BPoly.from_derivatives(self.time, rows)
        return curve, curve.derivative()


def way_to(start: np.ndarray, posture: np.ndarray, duration: float) -> JointTrajectory:
    """The rest-to-rest motion of least jerk between two postures (joints,) [rad].

    Parameters
    ----------
    duration
        Of the whole motion [s].
    """
    time = np.linspace(0.0, duration, max(2, round(duration / (EVERY * STEP)) + 1))
    rows = [minimum_jerk(start, posture, duration, float(at)) for at in time]
    q, qd, qdd = (np.array(part) for part in zip(*rows, strict=True))
    return JointTrajectory(time, q, qd, qdd)


def planned_trajectory(
    plan: MotionPlan,
    settings: CommanderSettings,
    description: ArmDescription,
) -> JointTrajectory:
    """The path of the joints of a plan, as the arm has it.

    A pace is left out: nothing that holds the hand back makes an arm wait that is driven to
    positions.

    Parameters
    ----------
    settings
        The law, and what the arm must not exceed.
    description
        Of the arm.

    Raises
    ------
    PlanRefused
        Names joint, value, limit and remedy, if a joint cannot do it.
    """
    plan = replace(plan, pace=None)
    rows = [np.array(part) for part in zip(*_moved(plan, settings, description), strict=True)]
    time = STEP * np.arange(len(rows[0]))
    if plan.speed == Speed.THROW:
        time = time[time <= plan.end + LATE]
        rows = _exact_at_events(plan, time, rows[1][: len(time)], description)
    check = TrajectoryLimits(settings, description)
    q, qd, qdd = rows
    moved = JointTrajectory(time, q, qd, qdd, plan.events, plan.carries)
    if broken := check.broken(moved):
        raise PlanRefused(f"{broken[1]}: {_remedy(plan)}")
    tried = []
    for brake in BRAKES:
        whole = _braked(moved, brake, description)
        if (broken := check.broken(whole)) is None:
            return _thinned(whole)
        tried.append(broken)
    raise PlanRefused(f"after its end {min(tried)[1]}, however it is braked: {_remedy(plan)}")


def _exact_at_events(
    plan: MotionPlan, time: np.ndarray, speeds: np.ndarray, description: ArmDescription
) -> list[np.ndarray]:
    """Angles, speeds and accelerations (n, joints) with which what the hand holds is where it is
    planned, and as fast, at the events; PlanRefused if the joints are too slow for that.
    """
    motion = LimitedMotion(plan, float(time[-1]), description)
    rows = list(motion.found(speeds, time))
    away, slower = motion.missed
    if away > MISSED[0] or slower > MISSED[1]:
        fastest = description.of_joints("no_load_speed")
        share = np.abs(rows[1]) / fastest
        j = int(share.max(axis=0).argmax())
        raise PlanRefused(
            f"the joints are too slow: where the hand lets go it would be {100 * away:.1f} cm and"
            f" {slower:.2f} m/s off, with {description.joints[j].name} at"
            f" {share.max() * fastest[j]:.2f} rad/s; its limit is {fastest[j]:.2f} rad/s:"
            f" {_remedy(plan)}"
        )
    return rows


def _remedy(plan: MotionPlan) -> str:
    """What helps against a plan that a joint cannot do."""
    if plan.speed == Speed.THROW:
        return "choose a nearer target, or show it slower"
    return "show it slower, or farther from the ends of the joints' ranges"


def _moved(
    plan: MotionPlan, settings: CommanderSettings, description: ArmDescription
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Angles, speeds and accelerations (joints,) of the motion, step by step, until the plan may
    be left.
    """
    model, guide = ArmModel(description), PlanGuide(plan, settings.follow_time)
    pull = HandPull(settings, description, JointServo(Impedance(model)))
    pull.begin(plan.start_posture)
    q, qd, k = plan.start_posture, np.zeros(description.n_joints), 0
    while True:
        now = guide.look(k * STEP, model.hand_state(q, qd), 0)
        if now.over:
            return
        q, qd, qdd = pull.expect(plan.start_posture, now, k * STEP)[2]
        yield q, qd, qdd
        k += 1


def _braked(moved: JointTrajectory, lasts: float, description: ArmDescription) -> JointTrajectory:
    """The same motion with every joint brought to rest at its end, within a time [s], or sooner
    where the end of its range is near.
    """
    start, speed, change = moved.position[-1], moved.velocity[-1], moved.acceleration[-1]
    room = 1.8 * time_to_end(start, speed, description.ends)
    times = np.clip(room, SOONEST, lasts)
    after = STEP * np.arange(1, round(lasts / STEP) + 1)
    s = np.minimum(after[:, None] / times, 1.0)
    way = speed * (s**4 / 2 - s**3 + s) + change * times * (s**4 / 4 - 2 * s**3 / 3 + s**2 / 2)
    rate = speed * (2 * s**3 - 3 * s**2 + 1) + change * times * (s**3 - 2 * s**2 + s)
    slows = (speed * (6 * s**2 - 6 * s) + change * times * (3 * s**2 - 4 * s + 1)) / times
    return replace(
        moved,
        time=STEP * np.arange(len(moved.time) + len(after)),
        position=np.vstack([moved.position, start + times * way]),
        velocity=np.vstack([moved.velocity, rate]),
        acceleration=np.vstack([moved.acceleration, slows]),
    )


def _thinned(dense: JointTrajectory) -> JointTrajectory:
    """The same with fewer instants; its last one is kept, at rest."""
    rows = np.unique(np.append(np.arange(0, len(dense.time), EVERY), len(dense.time) - 1))
    still = dense.velocity[rows], dense.acceleration[rows]
    for part in still:
        part[-1] = 0.0
    return replace(
        dense,
        time=dense.time[rows],
        position=dense.position[rows],
        velocity=still[0],
        acceleration=still[1],
    )


class TrajectoryLimits:
    """What the joints of an arm can do along a trajectory: ranges, speeds, accelerations, and the
    torques that gravity, friction and the motion need.

    Parameters
    ----------
    settings
        Of the commander.
    description
        Of the arm.
    """

    def __init__(
        self,
        settings: CommanderSettings,
        description: ArmDescription,
    ):
        self._names = [joint.name for joint in description.joints]
        margin, (lower, upper) = settings.limits.joint_margin, description.ends
        self._lower, self._upper = lower + margin, upper - margin
        self._fastest = description.of_joints("no_load_speed")
        self._strongest = settings.limits.torque_share * description.of_joints("peak_torque")
        self._acceleration = np.full(len(self._names), settings.trajectory.fastest_acceleration)
        self._coulomb, self._viscous = (
            description.of_joints(f"{kind}_friction") for kind in ("coulomb", "viscous")
        )
        self._models = {
            carries: ArmModel(description, ball_in_hand=carries) for carries in (False, True)
        }

    def broken(self, trajectory: JointTrajectory) -> tuple[float, str] | None:
        """What is exceeded most, as a share of its limit, and in words; None if nothing is."""
        middle, half = 0.5 * (self._lower + self._upper), 0.5 * (self._upper - self._lower)
        torque = np.array([self._torque(trajectory, k) for k in range(len(trajectory.time))])
        found = [
            self._worst(trajectory, trajectory.position - middle, half, "", ""),
            self._worst(trajectory, trajectory.velocity, self._fastest, "turn at", "rad/s"),
            self._worst(
                trajectory, trajectory.acceleration, self._acceleration, "gain", "rad/s^2"
            ),
            self._worst(trajectory, torque, self._strongest, "need", "N m"),
        ]
        share, text = max(found)
        return (share, text) if share > 1.0 else None

    def _worst(
        self, trajectory: JointTrajectory, of: np.ndarray, most: np.ndarray, does: str, unit: str
    ) -> tuple[float, str]:
        """The largest share of a limit (joints,) in a row of numbers (n, joints), and its words."""
        share = np.abs(of) / most
        k, j = np.unravel_index(int(share.argmax()), share.shape)
        name, when = self._names[j], f"after {trajectory.time[k]:.2f} s"
        if not does:
            angle, range_ = trajectory.position[k, j], (self._lower[j], self._upper[j])
            return float(share[k, j]), (
                f"{name} would be at {angle:.2f} rad {when}, outside {range_[0]:.2f} to"
                f" {range_[1]:.2f} rad"
            )
        return float(share[k, j]), (
            f"{name} would {does} {abs(of[k, j]):.2f} {unit} {when}; its limit is"
            f" {most[j]:.2f} {unit}"
        )

    def _torque(self, trajectory: JointTrajectory, k: int) -> np.ndarray:
        """What moves the joints at an instant (joints,) [N m]."""
        q, qd = trajectory.position[k], trajectory.velocity[k]
        fingers = Fingers(trajectory.events, trajectory.carries)
        model = self._models[fingers.at(float(trajectory.time[k]))[1]]
        rubs = self._coulomb * np.sign(qd) + self._viscous * qd
        moves = model.mass_matrix(q) @ trajectory.acceleration[k] + model.coriolis_torque(q, qd)
        return moves + model.gravity_torque(q) + rubs
