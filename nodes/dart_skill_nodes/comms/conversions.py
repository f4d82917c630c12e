"""Between messages and the library's dataclasses. Stamps are integer nanoseconds, quaternions x,
y, z, w.

Here, and nowhere else, the fields of messages are checked: what comes out are finite numbers of
the right shape, or a ValueError.
"""

import math
import struct
from array import array
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Duration, Time
from dart_skill_msgs.msg import BodyState, BodyTrack, Event, SimulationState, WamCommand
from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import Outcome as OutcomeMsg
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.msg import Situation as SituationMsg
from geometry_msgs.msg import Point, Pose, PoseStamped, Transform, Twist
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from dart_skill.arm import (
    ArmState,
    Command,
    ExpectedThrow,
    Gains,
    GainsOverTime,
    Grip,
    GripEvent,
    HandPath,
    MotionPlan,
    Pace,
    Registration,
    Speed,
    all_finite,
)
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.checks import as_place
from dart_skill.common.constants import NS_PER_S
from dart_skill.common.pace import PhaseRule
from dart_skill.common.situation import Pose as BodyPose
from dart_skill.common.situation import Situation
from dart_skill.recording import (
    WORDS,
    Demonstration,
    demonstration_from_message,
    fill_demonstration_message,
    grip_of,
    joint_layout,
    named,
)
from dart_skill.skills.protocol import Skill, TaskOutcome
from dart_skill.skills.throw import LANDING, Throw

if TYPE_CHECKING:
    from dart_skill.skills.learning import Policy
    from dart_skill.skills.practice import Planned

UNIT = 1e-3
"""A quaternion's length is 1 within this."""
NEW = {
    "dart_skill_msgs/msg/BodyTrack": BodyTrack,
    "dart_skill_msgs/msg/Event": Event,
    "geometry_msgs/msg/Pose": Pose,
    "geometry_msgs/msg/PoseStamped": PoseStamped,
    "sensor_msgs/msg/JointState": JointState,
}
"""What makes the messages inside a demonstration."""
BASKET, BOARD, MISS = "basket", "board", "miss"
"""Names in messages: the bodies at which a throw is aimed, the instants that its outcome tells of,
and the miss of another skill.
"""

BASKETS = Throw()
"""The skill of throwing at baskets."""
ENCAPSULATION, TIME = b"\0\1\0\0", struct.Struct("<iI")
LEADING_STAMP = struct.Struct("<4xiI")
"""A stamp behind the encapsulation (CDR, little-endian, as on every machine that ROS 2 supports).
"""


EPISODE_AND_STEP = ("episode", "step")
"""What differs from one SimulationState to the next beside its numbers."""


def decoded(data: bytes, kind: type):
    """The message of a type in serialised bytes; ValueError if they are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # rclpy raises whatever its middleware does
        raise ValueError(
            f"{len(data)} bytes are no {kind.__name__}: the publisher has another type, or sends"
            " damaged bytes"
        ) from error


def stamp_ns(stamp: Time | Duration) -> int:
    """A stamp or duration as nanoseconds."""
    return stamp.sec * NS_PER_S + stamp.nanosec


def checked_stamp_ns(stamp: Time, what: str = "it") -> int:
    """A stamp as nanoseconds; ValueError, with `what` it is of, for one before time began."""
    return _checked_ns(stamp.sec, stamp.nanosec, what)


def _checked_ns(sec: int, nanosec: int, what: str) -> int:
    if sec < 0 or nanosec >= NS_PER_S:
        raise ValueError(
            f"{what} is stamped {sec} s and {nanosec} ns: stamps are not negative, and below 1 s of"
            " nanoseconds"
        )
    return sec * NS_PER_S + nanosec


def leading_stamp_ns(data: bytes) -> int:
    """The stamp that serialised messages begin with whose first field is a header or a time;
    ValueError for one that is none.
    """
    if len(data) < LEADING_STAMP.size:
        raise ValueError(f"{len(data)} bytes are no message that begins with a stamp")
    return _checked_ns(*LEADING_STAMP.unpack_from(data), "it")


class GroundTruth(NamedTuple):
    """What a camera of a simulated world needs of it: stamp [ns], episode and step, joint angles
    (7,) [rad], the turn of the arm's base about the vertical [rad], and poses of the bodies by
    role: position (3,) [m] and quaternion (4,).
    """

    stamp_ns: int
    episode: int
    step: int
    joint_position: np.ndarray
    base_turn: float
    bodies: dict[str, tuple[np.ndarray, np.ndarray]]


def ground_truth(
    like: SimulationState, ns: int, numbers: np.ndarray, counters: Sequence[int]
) -> GroundTruth:
    """What a SimulationState says. like: one with the same bodies; ns: its stamp; numbers: all of
    its float64; counters: episode, step.
    """
    for what in ("joint_position", "joint_velocity", "joint_effort"):
        _check_joints(len(getattr(like, what)), what)
    rows = numbers[3 * joint_count() : -1].reshape(len(like.bodies), -1)  # pose and twist
    bodies = {body.name: (row[:3], row[3:7]) for body, row in zip(like.bodies, rows, strict=True)}
    return GroundTruth(ns, *counters, numbers[: joint_count()], float(numbers[-1]), bodies)


def time_msg(ns: int) -> Time:
    """Nanoseconds as a stamp."""
    sec, nanosec = divmod(int(ns), NS_PER_S)
    return Time(sec=sec, nanosec=nanosec)


def duration_msg(seconds: float) -> Duration:
    """Seconds as a duration, to the nanosecond."""
    return _nanoseconds(round(seconds * 1e9))


def seconds(duration: Duration) -> float:
    """A duration in seconds."""
    return stamp_ns(duration) * 1e-9


def _nanoseconds(ns: int) -> Duration:
    sec, nanosec = divmod(ns, NS_PER_S)
    return Duration(sec=sec, nanosec=nanosec)


def leading_stamp_bytes(ns: int) -> bytes:
    """A serialised message that is nothing but a stamp, as of /clock."""
    return ENCAPSULATION + TIME.pack(*divmod(ns, NS_PER_S))


def set_stamp(stamp: Time, ns: int) -> None:
    """Write nanoseconds into a stamp in place: cheaper than a new one."""
    stamp.sec, stamp.nanosec = divmod(ns, NS_PER_S)


def point(values) -> Point:
    """(3,) as a point."""
    x, y, z = (float(v) for v in values)
    return Point(x=x, y=y, z=z)


def vector(message) -> np.ndarray:
    """x, y, z of a point or vector message as (3,)."""
    return np.array([message.x, message.y, message.z])


def place(message, what: str) -> np.ndarray:
    """x, y, z of a point as a place (3,) in this world [m]; ValueError, with `what` is there, for
    one that is none.
    """
    return as_place(vector(message), what)


def quaternion(message) -> np.ndarray:
    """x, y, z, w of a quaternion message as (4,)."""
    return np.array([message.x, message.y, message.z, message.w])


def unit_quaternion(message, what: str) -> np.ndarray:
    """x, y, z, w of a quaternion message as (4,); ValueError, with `what` is turned so, for one
    that is not of unit length.
    """
    return as_unit_quaternion(quaternion(message), what)


def as_unit_quaternion(turn: np.ndarray, what: str) -> np.ndarray:
    """The quaternion (4,) x, y, z, w itself; ValueError, with `what` is turned so, if it is not of
    unit length.
    """
    if not abs(math.hypot(*turn) - 1.0) < UNIT:
        raise ValueError(
            f"the orientation of {what} is {turn.tolist()}: give a quaternion of unit length, x,"
            " y, z, w"
        )
    return turn


def set_vector(message, values) -> None:
    """Write (3,) into a point or vector message."""
    message.x, message.y, message.z = values.tolist() if isinstance(values, np.ndarray) else values


def set_pose(message, position: np.ndarray, orientation: np.ndarray) -> None:
    """Write position (3,) and quaternion (4,) into a pose message."""
    set_vector(message.position, position)
    target = message.orientation
    target.x, target.y, target.z, target.w = orientation.tolist()


def arm_state(message: JointState) -> ArmState:
    """The state of the arm in a JointState, in the order of the arm's joints; ValueError for names
    and numbers that are not those.
    """
    ns = checked_stamp_ns(message.header.stamp, "/joint_states")
    return state_of_joints(
        tuple(message.name), np.array(message.position), np.array(message.velocity), ns
    )


def state_of_joints(
    names: tuple[str, ...], position: np.ndarray, velocity: np.ndarray, ns: int
) -> ArmState:
    """The state of the arm in what a driver says of its joints (n,) each; ValueError as of
    `arm_state`. ns: its stamp [ns].
    """
    layout = joint_layout(names, len(position), len(velocity))
    if not layout.is_of_others and not len(names) == len(position) == len(velocity):
        counts = f"{len(names)} names, {len(position)} positions and {len(velocity)} velocities"
        raise ValueError(
            f"/joint_states has {counts}: the driver must give one of each for every joint"
        )
    try:
        state = ArmState(ns, *layout.row(position, velocity))
    except ValueError as error:
        raise ValueError(f"/joint_states: {error}") from error
    if not (all_finite(state.position) and all_finite(state.velocity)):
        raise ValueError(
            f"/joint_states: positions {state.position}, velocities {state.velocity}: the driver"
            " must give finite numbers"
        )
    return state


def of_others(message: JointState) -> str:
    """Why a JointState says nothing of the arm, as that of a gripper; empty if it may."""
    layout = joint_layout(tuple(message.name), len(message.position), len(message.velocity))
    return layout.why if layout.is_of_others else ""


def order_of(names: Sequence[str], wanted: Sequence[str], what: str) -> list[int]:
    """Places in `names` of the wanted ones; ValueError, with `what` they are, if one is missing,
    or they are not those.
    """
    missing = [name for name in wanted if name not in names]
    if missing or len(set(wanted)) != len(wanted):
        raise ValueError(
            f"{what}: {', '.join(missing) or 'a name twice'}: they must be among"
            f" {', '.join(names)}, each once"
        )
    return [list(names).index(name) for name in wanted]


def command(message: WamCommand) -> Command:
    """The command in a message; ValueError for an unknown grip or speed, and torques of other
    joints.
    """
    force, torque = message.wrench.force, message.wrench.torque
    numbers = np.array(
        [force.x, force.y, force.z, torque.x, torque.y, torque.z, *message.joint_torque]
    )
    return command_of_numbers(message, stamp_ns(message.header.stamp), numbers)


def command_of_numbers(message: WamCommand, ns: int, numbers: np.ndarray) -> Command:
    """The command with the grip and speed of a message, a stamp [ns], and numbers (6 + n,): wrench,
    then the torque of each joint.
    """
    grip, speed, count = Grip(message.grip), Speed(message.speed), len(numbers) - 6
    if not count:
        return Command(ns, numbers, grip=grip, speed=speed)
    _check_joints(count, "joint_torque")
    return Command(ns, numbers[:6], numbers[6:], grip, speed)


def _check_joints(count: int, what: str) -> None:
    """ValueError for a number of joints that is not the arm's."""
    if count != joint_count():
        raise ValueError(
            f"{what} has {count} numbers, and the arm has {joint_count()} joints: does the"
            " publisher drive another arm?"
        )


def demonstration(message: DemonstrationMsg) -> Demonstration:
    """The demonstration in a message."""
    return demonstration_from_message(message)


def demonstration_msg(one: Demonstration) -> DemonstrationMsg:
    """A demonstration as a message."""
    return fill_demonstration_message(one, DemonstrationMsg(), lambda name: NEW[name]())


def situation(message: SituationMsg, what: str = "the situation") -> Situation:
    """The situation in a message; ValueError for names that do not fit, places that are none, and
    numbers that are not finite.
    """
    poses = named(f"{what}: bodies", message.bodies, message.poses)
    numbers = numbers_of(message, what)
    return Situation(
        {body: body_pose(pose, f"{what}: {body}") for body, pose in poses.items()}, numbers
    )


def situation_msg(one: Situation) -> SituationMsg:
    """A situation as a message."""
    message = SituationMsg(
        bodies=list(one.poses),
        names=list(one.numbers),
        numbers=[float(number) for number in one.numbers.values()],
    )
    for pose in one.poses.values():
        message.poses.append(pose_msg(pose))
    return message


def body_pose(message: Pose, what: str) -> BodyPose:
    """The pose in a message; ValueError, with `what` has it, for one that is none."""
    return BodyPose(place(message.position, what), unit_quaternion(message.orientation, what))


def pose_msg(pose: BodyPose) -> Pose:
    """A pose as a message."""
    message = Pose()
    set_pose(message, pose.position, pose.quaternion)
    return message


def pose_at(position) -> Pose:
    """The pose of what is at a place (3,), not turned."""
    return Pose(position=point(position))


def at_place(position, body: str = BASKET) -> SituationMsg:
    """The situation in which one body is at a place (3,), not turned; of a throw that is all."""
    return SituationMsg(bodies=[body], poses=[pose_at(position)])


def place_of(message: SituationMsg, body: str, what: str = "the situation") -> np.ndarray:
    """Where a body is (3,) in a situation; ValueError if it does not say so, or the place is none."""
    where = named(f"{what}: bodies", message.bodies, message.poses)
    if body not in where:
        raise ValueError(
            f"{what} says where {', '.join(sorted(where)) or 'nothing'} is, not the {body}"
        )
    return place(where[body].position, f"the {body}")


def target_of(message: SituationMsg) -> np.ndarray:
    """Centre of the rim at which a throw is aimed (3,); ValueError if the situation has no basket."""
    return place_of(message, BASKET)


def aimed(message: SituationMsg, skill: Any, what: str = "the situation") -> Situation:
    """What a throw needs of a situation; how bodies are turned, and where others are, is of no
    effect. ValueError for what is missing, and for what the throw does not have.
    """
    skill.check_known(message.bodies, message.names)
    poses = {body: BodyPose(place_of(message, body, what)) for body in skill.situated}
    return skill.about(Situation(poses, numbers_of(message, what) if skill.numbers else {}))


def asked(message: SituationMsg, skill: Skill) -> Situation:
    """What a skill takes of a situation that is asked for; ValueError for what it does not have."""
    return situation(message) if skill.turned else aimed(message, skill)


def numbers_of(message: SituationMsg, what: str) -> dict[str, float]:
    """The numbers of a situation by name; ValueError for names that do not fit, and for what is
    not finite.
    """
    numbers = named(f"{what}: numbers", message.names, message.numbers)
    for name, number in numbers.items():
        if not math.isfinite(number):
            raise ValueError(f"{what}: the number {name} is {number}: give a finite one")
    return numbers


def body_state(name: str, position, velocity=(0.0, 0.0, 0.0)) -> BodyState:
    """A body that is not turned, at a place (3,), with a velocity (3,)."""
    message = BodyState(name=name)
    message.pose.position = point(position)
    set_vector(message.twist.linear, np.asarray(velocity, dtype=float))
    return message


def state_of(bodies: Sequence[BodyState], name: str) -> BodyState:
    """State of the body of that name among several; ValueError if there is none."""
    for one in bodies:
        if one.name == name:
            return one
    raise ValueError(f"no {name} among {', '.join(one.name for one in bodies) or 'no bodies'}")


def seen_at(message: OutcomeMsg, instant: str) -> np.ndarray:
    """Where something was at an instant (3,) that an outcome tells of; NaN if it does not."""
    found = [one for one in message.observed if one.name == instant]
    return vector(found[0].pose.position) if found else np.full(3, np.nan)


def task_outcome_msg(
    outcome: TaskOutcome, about: SituationMsg, skill: str, frame_id: str, ns: int
) -> OutcomeMsg:
    """What became of a movement as a message."""
    message = unseen_outcome_msg(about, skill, frame_id, ns)
    message.seen, message.success = math.isfinite(outcome.error), outcome.success
    message.error, message.message = float(outcome.error), outcome.reason
    observed = outcome.observed or {MISS: (outcome.miss, np.zeros(3))}
    message.observed = [body_state(name, *state) for name, state in observed.items()]
    return message


def task_outcome(message: OutcomeMsg) -> TaskOutcome:
    """The outcome in a message."""
    observed = {
        one.name: (vector(one.pose.position), vector(one.twist.linear)) for one in message.observed
    }
    miss = seen_at(message, MISS)
    return TaskOutcome(message.success, message.error, message.message, miss, observed)


def unseen_outcome_msg(about: SituationMsg, skill: str, frame_id: str, ns: int = 0) -> OutcomeMsg:
    """The outcome of a movement that was not judged."""
    message = OutcomeMsg(skill=skill, situation=about, error=math.nan)
    set_stamp(message.header.stamp, ns)
    message.header.frame_id = frame_id
    return message


def throw_plan(message: PlanMsg, skill: Throw = BASKETS) -> MotionPlan:
    """The plan of a throw in a message; ValueError for what is none, or of another skill."""
    if message.skill != skill.name:
        raise ValueError(f"the plan is of the skill '{message.skill}', not of '{skill.name}'")
    motion = motion_plan(message)
    opens = tuple(event for event in motion.events if event.grip == Grip.OPEN)
    if len(opens) != 1 or not isinstance(motion.orientation_gains, Gains):
        raise ValueError(
            f"the plan opens the hand {len(opens)} times: a throw opens it once, with one"
            " stiffness of the orientation"
        )
    throw = ExpectedThrow(
        target=skill.target(aimed(message.situation, skill)),
        aim=skill.target(aimed(message.aim, skill, "the aim")),
        landing=vector(state_of(message.expected, LANDING).pose.position),
    )
    return replace(motion, what="throw", events=opens, throw=throw, model_id=message.model_id)


def planned_msg(planned: "Planned", frame_id: str, skill: Skill) -> PlanMsg:
    """What was planned as a message."""
    plan = planned.plan
    if isinstance(plan, MotionPlan):
        message = plan_msg(plan, frame_id)
        message.skill = skill.name
    else:
        message = policy_msg(plan, frame_id)
    if planned.aim is not None:
        message.aim = situation_msg(planned.aim)
    message.model_id, message.situation = planned.model_id, situation_msg(planned.situation)
    return message


def plan_msg(plan: MotionPlan, frame_id: str) -> PlanMsg:
    """A plan of any skill as a message."""
    message = PlanMsg(skill=plan.what, model_id=plan.model_id)
    message.header.frame_id = frame_id
    if plan.throw is not None:
        message.expected = [body_state(LANDING, plan.throw.landing)]
    message.trajectory = _trajectory(plan, frame_id)
    message.end = duration_msg(plan.end)
    message.events = [event_msg(event) for event in plan.events]
    message.carries, message.speed = plan.carries, int(plan.speed)
    message.position_stiffness, message.position_damping = _numbers_of(plan.position_gains)
    message.orientation_stiffness, message.orientation_damping = _numbers_of(
        plan.orientation_gains
    )
    message.start_posture = plan.start_posture
    if plan.posture is not None:
        message.posture = plan.posture.ravel()
    _say_registration(message, plan.registration)
    if plan.pace is not None:
        message.pace_gain = plan.pace.gain.ravel()
        rule = plan.pace.rule
        message.pace_slowest, message.pace_fastest = rule.slowest, rule.fastest
        message.pace_time_constant, message.pace_ignored = rule.time_constant, rule.ignored
    return message


def policy_msg(policy: "Policy", frame_id: str) -> PlanMsg:
    """The plan of a skill that reacts, as a message."""
    message = PlanMsg(
        skill=policy.skill.name,
        speed=int(policy.skill.speed),
        policy=array("B", policy.to_bytes()),
    )
    message.header.frame_id = frame_id
    message.events = [event_msg(event) for event in policy.events]
    message.start_posture = policy.start_posture
    _say_registration(message, policy.registration)
    return message


def _say_registration(message: PlanMsg, seen: Registration) -> None:
    message.base, message.body = (
        _transform(seen.shift, seen.turn),
        _transform(seen.hand_shift, seen.hand_turn),
    )
    message.camera_delay = duration_msg(seen.delay)


def event_msg(event: GripEvent) -> Event:
    """What the fingers are told, as a message."""
    first = round(event.time * 1e9)
    return Event(
        name=WORDS[event.grip],
        time_from_start=duration_msg(event.time),
        takes=_nanoseconds(round(event.done * 1e9) - first),
    )


def motion_plan(message: PlanMsg) -> MotionPlan:
    """The plan in a message, of whatever skill; ValueError for a trajectory that is not one of
    attractor and hand.
    """
    points = _checked_points(message.trajectory)
    attractor = [_pose(p.transforms[0]) for p in points]
    hand = [_pose(p.transforms[1]) for p in points]
    return MotionPlan(
        path=HandPath(
            time=np.array([seconds(p.time_from_start) for p in points]),
            position=np.array([pose[:3] for pose in hand]),
            quaternion=np.array([pose[3:] for pose in hand]),
            velocity=np.array([_twist(p.velocities[1]) for p in points]),
            acceleration=np.array([_twist(p.accelerations[1]) for p in points]),
        ),
        attractor_position=np.array([pose[:3] for pose in attractor]),
        attractor_quaternion=np.array([pose[3:] for pose in attractor]),
        position_gains=_gains("position", message.position_stiffness, message.position_damping),
        orientation_gains=_gains(
            "orientation", message.orientation_stiffness, message.orientation_damping
        ),
        start_posture=np.array(message.start_posture),
        end=seconds(message.end),
        what=message.skill,
        events=tuple(_grip_event(one) for one in message.events),
        carries=message.carries,
        speed=Speed(message.speed),
        pace=_pace(message),
        registration=_registration(message),
        posture=_rows_of("posture", message.posture, joint_count()),
    )


def path_msg(plan: PlanMsg) -> Path:
    """The way of the hand in a plan, for viewers; its stamps count from the start of the movement."""
    path = Path(header=plan.header)
    for sample in plan.trajectory.points:
        pose = PoseStamped(header=Header(frame_id=plan.header.frame_id))
        pose.header.stamp = time_msg(stamp_ns(sample.time_from_start))
        hand = sample.transforms[1]
        pose.pose.orientation = hand.rotation
        set_vector(pose.pose.position, vector(hand.translation))
        path.poses.append(pose)
    return path


def _grip_event(message: Event) -> GripEvent:
    first = stamp_ns(message.time_from_start)
    return GripEvent(
        first * 1e-9, grip_of("the plan", message.name), (first + stamp_ns(message.takes)) * 1e-9
    )


def _numbers_of(gains: Gains | GainsOverTime) -> tuple[list[float], list[float]]:
    """Stiffness and damping, each as one number, or nine for each point."""
    if isinstance(gains, Gains):
        return [gains.stiffness], [gains.damping]
    return gains.stiffness.ravel().tolist(), gains.damping.ravel().tolist()


def _gains(
    what: str, stiffness: Sequence[float], damping: Sequence[float]
) -> Gains | GainsOverTime:
    if len(stiffness) == len(damping) == 1:
        return Gains(float(stiffness[0]), float(damping[0]))
    if len(stiffness) != len(damping) or len(stiffness) % 9 or not len(stiffness):
        sizes = f"{len(stiffness)} and {len(damping)}"
        raise ValueError(
            f"a plan's {what}_stiffness and {what}_damping have {sizes} numbers: give one, or nine"
            " for each point"
        )
    return GainsOverTime(
        *(np.array(values, dtype=float).reshape(-1, 3, 3) for values in (stiffness, damping))
    )


def _rows_of(what: str, numbers: Sequence[float], width: int) -> np.ndarray | None:
    """Numbers (n, width), or None where there are none; ValueError, with `what` they are, for
    another count.
    """
    if not len(numbers):
        return None
    if len(numbers) % width:
        raise ValueError(
            f"a plan's {what} has {len(numbers)} numbers: give {width} for each point of the"
            " trajectory, or none"
        )
    return np.array(numbers, dtype=float).reshape(-1, width)


def _pace(message: PlanMsg) -> Pace | None:
    gain = _rows_of("pace_gain", message.pace_gain, 12)
    if gain is None:
        return None
    rule = PhaseRule(
        message.pace_slowest,
        message.pace_fastest,
        message.pace_time_constant,
        ignored=message.pace_ignored,
    )
    return Pace(gain, rule)


def _checked_points(trajectory: MultiDOFJointTrajectory) -> Sequence[MultiDOFJointTrajectoryPoint]:
    """Points of a trajectory of attractor and hand, each with all of both."""
    if list(trajectory.joint_names) != ["attractor", "hand"]:
        raise ValueError(
            f"a plan's trajectory is of attractor and hand, not of {list(trajectory.joint_names)}"
        )
    for k, point in enumerate(trajectory.points):
        if not len(point.transforms) == len(point.velocities) == len(point.accelerations) == 2:
            counts = (
                f"{len(point.transforms)} transforms, {len(point.velocities)} velocities and"
                f" {len(point.accelerations)} accelerations"
            )
            raise ValueError(
                f"point {k} of the plan's trajectory has {counts}: give two of each, of attractor"
                " and hand"
            )
    return trajectory.points


def _registration(message: PlanMsg) -> Registration:
    """Registration of a plan, that of a client which sets none is none; ValueError if its
    transforms are no transforms.
    """
    base, body = (_pose(one).tolist() for one in (message.base, message.body))
    parts = map(tuple, (base[3:], base[:3], body[3:], body[:3]))
    return Registration(*parts, delay=seconds(message.camera_delay))


def _trajectory(plan: MotionPlan, frame_id: str) -> MultiDOFJointTrajectory:
    trajectory = MultiDOFJointTrajectory(joint_names=["attractor", "hand"])
    trajectory.header.frame_id = frame_id
    path = plan.path
    trajectory.points = [
        MultiDOFJointTrajectoryPoint(
            transforms=[
                _transform(plan.attractor_position[k], plan.attractor_quaternion[k]),
                _transform(path.position[k], path.quaternion[k]),
            ],
            velocities=[Twist(), _twist_msg(path.velocity[k])],
            accelerations=[Twist(), _twist_msg(path.acceleration[k])],
            time_from_start=duration_msg(path.time[k]),
        )
        for k in range(len(path.time))
    ]
    return trajectory


def _transform(position: Sequence[float], orientation: Sequence[float]) -> Transform:
    message = Transform()
    set_vector(message.translation, position)
    target = message.rotation
    target.x, target.y, target.z, target.w = map(float, orientation)
    return message


def _pose(transform: Transform) -> np.ndarray:
    return np.concatenate([vector(transform.translation), quaternion(transform.rotation)])


def _twist(message: Twist) -> np.ndarray:
    return np.concatenate([vector(message.linear), vector(message.angular)])


def _twist_msg(values: np.ndarray) -> Twist:
    message = Twist()
    set_vector(message.linear, values[:3])
    set_vector(message.angular, values[3:])
    return message
