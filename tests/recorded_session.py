"""A session that writes what its sensors see as a bag, message for message as the graph's recorder
does. Needs no ROS.
"""

from dataclasses import dataclass, field, fields, is_dataclass, replace

import numpy as np

from dart_skill.arm import wam_description
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    BagWriter,
    definition,
    demonstration_id,
    demonstration_message,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.session import Session
from dart_skill.skills.learning import learn_throwing

GIGA, LATENCY_NS = 1_000_000_000, 5_000_000
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wam/command": "dart_skill_msgs/msg/WamCommand",
    "/wam/teacher_wrench": "dart_skill_msgs/msg/WamCommand",
    **{
        f"/vrpn_mocap/{body}/pose": "geometry_msgs/msg/PoseStamped"
        for body in ("hand", "ball", "basket")
    },
    DEMONSTRATION_TOPIC: DEMONSTRATION_TYPE,
}


@dataclass
class RawMessage:
    """Log time, topic, content of every message."""

    messages: list = field(default_factory=list)

    def add(self, now_ns, topic, stamp_ns, **content):
        content["header"] = header(stamp_ns)
        self.messages.append((now_ns, topic, stamp_ns, content))


class RecordedSession(Session):
    """A session that remembers its joint states, poses and commands. A guided throw is pushed by
    the teacher throughout.
    """

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.heard, self._names = RawMessage(), [joint.name for joint in wam_description().joints]

    def _sense(self):
        arm = super()._sense()
        self.heard.add(
            arm.stamp_ns,
            "/joint_states",
            arm.stamp_ns,
            name=self._names,
            position=arm.position,
            velocity=arm.velocity,
        )
        return arm

    def _run(self, arm, target, step, moved_through, kind):
        def heard(arm):
            command, push = step(arm)
            for topic, answer in (("/wam/command", command), ("/wam/teacher_wrench", push)):
                if answer is not None:
                    force = dict(zip("xyz", answer.wrench[:3].tolist(), strict=True))
                    self.heard.add(
                        arm.stamp_ns,
                        topic,
                        arm.stamp_ns,
                        wrench={"force": force},
                        grip=int(answer.grip),
                    )
            return command, push

        return super()._run(arm, target, heard, moved_through, kind)

    def _look_back(self, now_ns):
        super()._look_back(now_ns)
        for body in ("hand", "ball", "basket"):
            stream = getattr(self._log, body)
            for stamp_ns, row in zip(stream.stamps, np.array(stream.rows).tolist(), strict=True):
                x, y, z, w = row[3:] or (0.0, 0.0, 0.0, 1.0)
                pose = {
                    "position": dict(zip("xyz", row[:3], strict=True)),
                    "orientation": {"x": x, "y": y, "z": z, "w": w},
                }
                self.heard.add(
                    stamp_ns + LATENCY_NS, f"/vrpn_mocap/{body}/pose", stamp_ns, pose=pose
                )

    def write(self, path, demonstrations=()):
        """Everything that was heard, and demonstrations as the recorder publishes them, as a bag
        in order of log time.
        """
        types, shown = typestore(), []
        for one in demonstrations:
            content = demonstration_message(types, as_published(one))
            end_ns = one.stamp_ns + round(1e9 * one.moved.time[-1])
            shown.append((end_ns, DEMONSTRATION_TOPIC, end_ns, content))
        with BagWriter(path, custom_data={"seed": "3"}) as bag:
            for topic, type_name in TYPES.items():
                bag.add_topic(
                    topic,
                    type_name,
                    definition(types, type_name),
                    qos_yaml(),
                    type_hash(types, type_name),
                )
            for now_ns, topic, stamp_ns, content in sorted(
                self.heard.messages + shown, key=lambda item: item[0]
            ):
                bag.write(topic, now_ns, stamp_ns, serialize(types, TYPES[topic], content))


def header(stamp_ns, frame_id="world"):
    """A header's content."""
    sec, nanosec = divmod(int(stamp_ns), GIGA)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}


def as_published(one):
    """A demonstration with the id that the recorder gives it."""
    return replace(one, id=demonstration_id(one.stamp_ns + round(1e9 * one.opened)))


def same(one, other, names=None):
    """Names of the fields in which two dataclasses of arrays differ in any bit."""
    names = names or [item.name for item in fields(one)]
    return [name for name in names if not _equal(getattr(one, name), getattr(other, name))]


def _equal(one, other):
    if is_dataclass(one):
        return same(one, other) == []
    if isinstance(one, dict):
        return list(one) == list(other) and all(_equal(one[key], other[key]) for key in one)
    return np.array_equal(np.asarray(one), np.asarray(other))


TAUGHT = np.array([[1.80, -0.60, 0.40], [2.00, 0.10, 0.40], [2.15, 0.70, 0.40]])
THROWN_AT = np.array([1.95, 0.15, 0.40])


def record(folder):
    """A bag with three guided throws and one of the arm's own: its path, the guided trials, the
    own trial.
    """
    session = RecordedSession(seed=3)
    taught = [session.teach(target, attempts=1)[0] for target in TAUGHT]
    own = session.throw(learn_throwing([trial.demonstration for trial in taught]).plan(THROWN_AT))
    session.close()
    path = folder / "recorded"
    session.write(path, [trial.demonstration for trial in taught])
    return path, taught, own
