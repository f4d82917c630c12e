"""Between messages and the library's dataclasses. Stamps are integer nanoseconds, quaternions x, y, z, w.

Here, and nowhere else, the fields of messages are checked: what comes out are finite numbers of the right shape, or a ValueError.
"""

import math
import struct
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Duration, Time
from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import ThrowPlan as ThrowPlanMsg
from dart_skill_msgs.msg import TrialOutcome, WamCommand
from geometry_msgs.msg import Point, PointStamped, PoseStamped, Transform, Twist
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from dart_skill.checks import as_place
from dart_skill.recording import Demonstration, demonstration_from_message, fill_demonstration_message
from dart_skill.robot import ArmState, Command, Gains, Grip, HandPath, Registration, Speed, ThrowPlan, all_finite
from dart_skill.skill.observe import Outcome, Release
from dart_skill.world import joint_order

GIGA = 1_000_000_000
UNIT = 1e-3
"""A quaternion's length is 1 within this."""
NEW = {
    "geometry_msgs/msg/PoseStamped": PoseStamped,
    "geometry_msgs/msg/PointStamped": PointStamped,
    "sensor_msgs/msg/JointState": JointState,
}


LEADING_STAMP = struct.Struct("<4xiI")
"""A stamp behind the encapsulation (CDR, little-endian, as on every machine that ROS 2 supports)."""


def decoded(data: bytes, kind: type):
    """The message of a type in serialised bytes; ValueError if they are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # rclpy raises whatever its middleware does
        raise ValueError(f"{len(data)} bytes are no {kind.__name__}: the publisher has another type, or sends damaged bytes") from error


def stamp_ns(stamp: Time | Duration) -> int:
    """A stamp or duration as nanoseconds."""
    return stamp.sec * GIGA + stamp.nanosec


def checked_stamp_ns(stamp: Time, what: str = "it") -> int:
    """A stamp as nanoseconds; ValueError, with `what` it is of, for one before time began."""
    if stamp.sec < 0 or stamp.nanosec >= GIGA:
        raise ValueError(f"{what} is stamped {stamp.sec} s and {stamp.nanosec} ns: stamps are not negative, and below 1 s of nanoseconds")
    return stamp.sec * GIGA + stamp.nanosec


def leading_stamp_ns(data: bytes) -> int:
    """The stamp that serialised messages begin with whose first field is a header or a time; ValueError for one that is none."""
    if len(data) < LEADING_STAMP.size:
        raise ValueError(f"{len(data)} bytes are no message that begins with a stamp")
    sec, nanosec = LEADING_STAMP.unpack_from(data)
    if sec < 0 or nanosec >= GIGA:
        raise ValueError(f"it is stamped {sec} s and {nanosec} ns: stamps are not negative, and below 1 s of nanoseconds")
    return sec * GIGA + nanosec


def time_msg(ns: int) -> Time:
    """Nanoseconds as a stamp."""
    sec, nanosec = divmod(int(ns), GIGA)
    return Time(sec=sec, nanosec=nanosec)


def duration_msg(seconds: float) -> Duration:
    """Seconds as a duration, to the nanosecond."""
    sec, nanosec = divmod(round(seconds * 1e9), GIGA)
    return Duration(sec=sec, nanosec=nanosec)


def seconds(duration: Duration) -> float:
    """A duration in seconds."""
    return stamp_ns(duration) * 1e-9


def set_stamp(stamp: Time, ns: int) -> None:
    """Write nanoseconds into a stamp in place: cheaper than a new one."""
    stamp.sec, stamp.nanosec = divmod(ns, GIGA)


def point(values) -> Point:
    """(3,) as a point."""
    x, y, z = (float(v) for v in values)
    return Point(x=x, y=y, z=z)


def vector(message) -> np.ndarray:
    """x, y, z of a point or vector message as (3,)."""
    return np.array([message.x, message.y, message.z])


def place(message, what: str) -> np.ndarray:
    """x, y, z of a point as a place (3,) in this world [m]; ValueError, with `what` is there, for one that is none."""
    return as_place(vector(message), what)


def quaternion(message) -> np.ndarray:
    """x, y, z, w of a quaternion message as (4,)."""
    return np.array([message.x, message.y, message.z, message.w])


def unit_quaternion(message, what: str) -> np.ndarray:
    """x, y, z, w of a quaternion message as (4,); ValueError, with `what` is turned so, for one that is not of unit length."""
    turn = quaternion(message)
    if not abs(math.hypot(*turn) - 1.0) < UNIT:
        raise ValueError(f"the orientation of {what} is {turn.tolist()}: give a quaternion of unit length, x, y, z, w")
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
    """The state of the arm in a JointState, in the order of the arm's joints; ValueError for names and numbers that are not those."""
    names, position, velocity = tuple(message.name), message.position, message.velocity
    if not len(names) == len(position) == len(velocity):
        counts = f"{len(names)} names, {len(position)} positions and {len(velocity)} velocities"
        raise ValueError(f"/joint_states has {counts}: the driver must give one of each for every joint")
    try:
        order = joint_order(names)
    except ValueError as error:
        raise ValueError(f"/joint_states: {error}") from error
    state = ArmState(checked_stamp_ns(message.header.stamp, "/joint_states"), np.array(position)[order], np.array(velocity)[order])
    if not (all_finite(state.position) and all_finite(state.velocity)):
        raise ValueError(f"/joint_states: positions {state.position}, velocities {state.velocity}: the driver must give finite numbers")
    return state


def order_of(names: Sequence[str], wanted: Sequence[str], what: str) -> list[int]:
    """Places in `names` of the wanted ones; ValueError, with `what` they are, if one is missing, or they are not those."""
    missing = [name for name in wanted if name not in names]
    if missing or len(set(wanted)) != len(wanted):
        raise ValueError(f"{what}: {', '.join(missing) or 'a name twice'}: they must be among {', '.join(names)}, each once")
    return [list(names).index(name) for name in wanted]


def fill_command(message: WamCommand, command: Command) -> WamCommand:
    """A command written into a message that is used again and again."""
    set_stamp(message.header.stamp, command.stamp_ns)
    fx, fy, fz, mx, my, mz = command.wrench.tolist()
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = fx, fy, fz, mx, my, mz
    message.joint_torque = command.joint_torque
    message.grip, message.speed = int(command.grip), int(command.speed)
    return message


def command(message: WamCommand) -> Command:
    """The command in a message; ValueError for an unknown grip or speed."""
    force, torque = message.wrench.force, message.wrench.torque
    wrench = np.array([force.x, force.y, force.z, torque.x, torque.y, torque.z])
    return Command(stamp_ns(message.header.stamp), wrench, np.array(message.joint_torque), Grip(message.grip), Speed(message.speed))


def demonstration(message: DemonstrationMsg) -> Demonstration:
    """The demonstration in a message."""
    return demonstration_from_message(message)


def demonstration_msg(one: Demonstration) -> DemonstrationMsg:
    """A demonstration as a message."""
    return fill_demonstration_message(one, DemonstrationMsg(), lambda name: NEW[name]())


def outcome_msg(outcome: Outcome, target: np.ndarray, frame_id: str, ns: int, release: Release | None = None) -> TrialOutcome:
    """What became of a throw as a message; what was not seen is NaN."""
    unseen = np.full(3, np.nan)
    message = TrialOutcome()
    set_stamp(message.header.stamp, ns)
    message.header.frame_id, message.target = frame_id, point(target)
    message.landing_seen, message.in_basket = bool(outcome.landing_seen), bool(outcome.in_basket)
    message.landing, message.landing_error = point(outcome.landing), float(outcome.landing_error)
    message.release = point(release.position if release else unseen)
    set_vector(message.release_velocity, release.velocity if release else unseen)
    return message


def unseen_outcome_msg(target: np.ndarray, frame_id: str, ns: int) -> TrialOutcome:
    """A throw of which nobody says what became of it."""
    return outcome_msg(Outcome(False, np.full(3, np.nan), np.nan, np.nan, False), target, frame_id, ns)


def plan_msg(plan: ThrowPlan, frame_id: str) -> ThrowPlanMsg:
    """A plan as a message."""
    message = ThrowPlanMsg(model_id=plan.model_id)
    message.header.frame_id = frame_id
    message.target, message.aim, message.predicted_landing = map(point, (plan.target, plan.aim, plan.predicted_landing))
    message.trajectory = _trajectory(plan, frame_id)
    message.position_stiffness, message.position_damping = plan.position_gains.stiffness, plan.position_gains.damping
    message.orientation_stiffness = plan.orientation_gains.stiffness
    message.orientation_damping = plan.orientation_gains.damping
    message.release, message.open_hand = duration_msg(plan.release), duration_msg(plan.open_hand)
    message.start_posture = plan.start_posture
    seen = plan.registration
    message.base, message.body = _rigid(seen.turn, seen.shift), _rigid(seen.hand_turn, seen.hand_shift)
    message.camera_delay = duration_msg(seen.delay)
    return message


def path_msg(plan: ThrowPlanMsg) -> Path:
    """The way of the hand in a plan, for viewers; its stamps count from the start of the throw."""
    path = Path(header=plan.header)
    for sample in plan.trajectory.points:
        pose = PoseStamped(header=Header(frame_id=plan.header.frame_id))
        pose.header.stamp.sec, pose.header.stamp.nanosec = sample.time_from_start.sec, sample.time_from_start.nanosec
        hand = sample.transforms[1]
        pose.pose.orientation = hand.rotation
        pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = hand.translation.x, hand.translation.y, hand.translation.z
        path.poses.append(pose)
    return path


def plan(message: ThrowPlanMsg) -> ThrowPlan:
    """The plan in a message; ValueError for a trajectory that is not one of attractor and hand."""
    points = _checked_points(message.trajectory)
    attractor = [_pose(p.transforms[0]) for p in points]
    hand = [_pose(p.transforms[1]) for p in points]
    return ThrowPlan(
        target=vector(message.target),
        aim=vector(message.aim),
        predicted_landing=vector(message.predicted_landing),
        path=HandPath(
            time=np.array([seconds(p.time_from_start) for p in points]),
            position=np.array([pose[:3] for pose in hand]),
            quaternion=np.array([pose[3:] for pose in hand]),
            velocity=np.array([_twist(p.velocities[1]) for p in points]),
            acceleration=np.array([_twist(p.accelerations[1]) for p in points]),
        ),
        attractor_position=np.array([pose[:3] for pose in attractor]),
        attractor_quaternion=np.array([pose[3:] for pose in attractor]),
        position_gains=Gains(message.position_stiffness, message.position_damping),
        orientation_gains=Gains(message.orientation_stiffness, message.orientation_damping),
        release=seconds(message.release),
        open_hand=seconds(message.open_hand),
        start_posture=np.array(message.start_posture),
        model_id=message.model_id,
        registration=_registration(message),
    )


def _checked_points(trajectory: MultiDOFJointTrajectory) -> Sequence[MultiDOFJointTrajectoryPoint]:
    """Points of a trajectory of attractor and hand, each with all of both."""
    if list(trajectory.joint_names) != ["attractor", "hand"]:
        raise ValueError(f"a plan's trajectory is of attractor and hand, not of {list(trajectory.joint_names)}")
    for k, point in enumerate(trajectory.points):
        if not len(point.transforms) == len(point.velocities) == len(point.accelerations) == 2:
            counts = f"{len(point.transforms)} transforms, {len(point.velocities)} velocities and {len(point.accelerations)} accelerations"
            raise ValueError(f"point {k} of the plan's trajectory has {counts}: give two of each, of attractor and hand")
    return trajectory.points


def _rigid(turn: Sequence[float], shift: Sequence[float]) -> Transform:
    """A quaternion (4,) and a shift (3,) [m] as a transform."""
    transform = Transform()
    rotation, translation = transform.rotation, transform.translation
    rotation.x, rotation.y, rotation.z, rotation.w = turn
    translation.x, translation.y, translation.z = shift
    return transform


def _registration(message: ThrowPlanMsg) -> Registration:
    """Registration of a plan, that of a client which sets none is none; ValueError if its transforms are no transforms."""
    base, body = (
        ((one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w), (one.translation.x, one.translation.y, one.translation.z))
        for one in (message.base, message.body)
    )
    return Registration(*base, *body, delay=seconds(message.camera_delay))


def _trajectory(plan: ThrowPlan, frame_id: str) -> MultiDOFJointTrajectory:
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


def _transform(position: np.ndarray, orientation: np.ndarray) -> Transform:
    message = Transform()
    set_vector(message.translation, position)
    target = message.rotation
    target.x, target.y, target.z, target.w = orientation.tolist()
    return message


def _pose(transform: Transform) -> np.ndarray:
    t, r = transform.translation, transform.rotation
    return np.array([t.x, t.y, t.z, r.x, r.y, r.z, r.w])


def _twist(message: Twist) -> np.ndarray:
    return np.concatenate([vector(message.linear), vector(message.angular)])


def _twist_msg(values: np.ndarray) -> Twist:
    message = Twist()
    set_vector(message.linear, values[:3])
    set_vector(message.angular, values[3:])
    return message
