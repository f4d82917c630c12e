"""The demonstration recorder: everything goes into an MCAP bag as it comes; between ~/start and ~/stop a throw is cut out of it.

Messages are received and written as raw CDR. Only what cutting needs is decoded: poses, one joint state per pose, the hand's button.
"""

import importlib
import struct
from datetime import datetime
from pathlib import Path

from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import StopDemonstration
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from dart_skill.configuration import config_path
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import (
    DEMONSTRATION_TYPE,
    BagWriter,
    definition,
    demonstration_message,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.robot.command import Grip
from dart_skill.robot.description import wam_description
from dart_skill.robot.urdf import write_urdf
from dart_skill_nodes import conversions
from dart_skill_nodes.support import (
    COMPLETE,
    LATCHED,
    OK,
    SENSOR_COMPLETE,
    WARN,
    Diagnostics,
    Parameter,
    autostart,
    declare,
    run,
)
from dart_skill_nodes.watching import FRAME_NS, ROLES, Watcher

TABLE = [
    Parameter("frame_id", "frame of the poses"),
    Parameter("bag", "folder of the bag; empty: demonstrations_<date> in the working directory"),
    Parameter("seed", "of the run, written into the bag", 0, 2**31 - 1),
    Parameter("topics", "what is recorded"),
    Parameter("hand_body", "tracked body that is the hand"),
    Parameter("ball_body", "tracked body that is the ball"),
    Parameter("basket_body", "tracked body that is the basket"),
    Parameter("start_threshold", "speed at which a motion begins [m/s]", 0.01, 5.0),
    Parameter("stop_threshold", "speed at which a motion ends [m/s]", 0.01, 5.0),
    Parameter("min_duration", "shorter motions are ignored [s]", 0.0, 10.0),
    Parameter("max_pause", "a shorter rest does not end a motion [s]", 0.0, 10.0),
    Parameter("run_up", "kept before the motion [s]", 0.0, 5.0),
    Parameter("settle", "kept after the motion [s]", 0.0, 5.0),
    Parameter("speed_window", "over which the speed is estimated [s]", 0.02, 1.0),
]
KNOWN_TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wam/command": "dart_skill_msgs/msg/WamCommand",
    "/wam/teacher_wrench": "dart_skill_msgs/msg/WamCommand",
    "/demonstrations": "dart_skill_msgs/msg/Demonstration",
}


class DemonstrationRecorder(LifecycleNode):
    """A managed node: configuring opens the bag, cleaning up or shutting down closes it. It starts itself unless `autostart` is false."""

    def __init__(self):
        super().__init__("demonstration_recorder")
        self.p = declare(self, "demonstration_recorder.yaml", TABLE)
        self.declare_parameter("autostart", True)
        self._bag, self._count, self._recording, self._now_ns = None, 0, False, 0
        self._newest: dict[str, int] = {}
        if self.get_parameter("autostart").value:
            autostart(self)

    # life cycle

    def on_configure(self, state) -> TransitionCallbackReturn:
        try:
            self._thresholds = VelocityThreshold(
                start=self.p["start_threshold"], stop=self.p["stop_threshold"], window=self.p["speed_window"],
                **{name: self.p[name] for name in ("min_duration", "max_pause", "run_up", "settle")},
            )  # fmt: skip
            path = Path(self.p["bag"] or f"demonstrations_{datetime.now():%Y_%m_%d-%H_%M_%S}")
            self._bag = BagWriter(path, custom_data={"seed": str(self.p["seed"])})
        except (ValueError, OSError) as error:
            self.get_logger().error(f"not configured: {error}")
            return TransitionCallbackReturn.FAILURE
        self._attach()
        self._watcher = Watcher(self, self.p["frame_id"], subscribe=False)
        self._role_of = {f"/vrpn_mocap/{self.p[f'{role}_body']}/pose": role for role in ROLES}
        self._needed = {"/joint_states", "/wam/command", "/wam/teacher_wrench", *self._role_of}
        self._silent = {"/joint_states", "/wam/command", *(t for t, role in self._role_of.items() if role == "hand")}
        self._demonstrations = self.create_publisher(DemonstrationMsg, "/demonstrations", LATCHED)
        self._types = typestore()
        for topic in [*self.p["topics"], *sorted(self._needed - set(self.p["topics"]))]:
            self._subscribe(topic)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(StopDemonstration, "~/stop", self._on_stop)
        self._diagnostics = Diagnostics(self, self._describe)
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state) -> TransitionCallbackReturn:
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state) -> TransitionCallbackReturn:
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        self._close()
        super().destroy_node()

    def _close(self) -> None:
        if self._bag is not None:
            self._bag.close()
            self._bag = None

    def _attach(self) -> None:
        """What somebody needs to understand the bag: the arm, and the parameters in force."""
        self._bag.add_attachment("wam.urdf", write_urdf(wam_description()), "application/xml")
        for name in ("wam.yaml", "wam_simulator.yaml", "optitrack.yaml", "commander.yaml", "teacher.yaml"):
            self._bag.add_attachment(name, config_path(name).read_text(encoding="utf-8"), "application/yaml")

    # recording

    def _subscribe(self, topic: str) -> None:
        type_name = KNOWN_TYPES.get(topic, "geometry_msgs/msg/PoseStamped" if topic.startswith("/vrpn_mocap/") else None)
        if type_name is None:
            type_name = self._type_on_the_graph(topic)
        sensor, latched = topic.startswith("/vrpn_mocap/"), topic == "/demonstrations"
        profile = qos_yaml("best_effort" if sensor else "reliable", "transient_local" if latched else "volatile")
        if topic in self.p["topics"]:
            text, digest = definition(self._types, type_name), type_hash(self._types, type_name)
            self._bag.add_topic(topic, type_name, text, profile, digest)
        qos = SENSOR_COMPLETE if sensor else (LATCHED if latched else COMPLETE)
        look = {"/joint_states": self._look_at_joints, "/wam/command": self._look_at_grip}
        look["/wam/teacher_wrench"] = self._look_at_grip
        if role := self._role_of.get(topic):
            look[topic] = lambda ns, data: self._watcher.take(role, data)
        extra = look.get(topic)
        if latched:
            return  # its own publication is written where it is made: a node does not hear itself reliably in order
        self.create_subscription(_message_class(type_name), topic, lambda data, t=topic, e=extra: self._record(t, data, e), qos, raw=True)

    def _type_on_the_graph(self, topic: str) -> str:
        types = dict(self.get_topic_names_and_types()).get(topic)
        if not types:
            raise ValueError(f"nobody publishes {topic}, so its type is not known: start its publisher first, or leave it out")
        return types[0]

    def _record(self, topic: str, data: bytes, look) -> None:
        self._silent.discard(topic)
        sec, nanosec = struct.unpack_from("<iI", data, 4)
        ns = sec * conversions.GIGA + nanosec
        self._now_ns, self._newest[topic] = max(self._now_ns, ns), ns
        if self._bag is not None and topic in self.p["topics"]:
            self._bag.write(topic, self._now_ns, ns, bytes(data))
        if look is not None and self._recording:
            look(ns, data)

    def _look_at_joints(self, ns: int, data: bytes) -> None:
        joints = self._watcher.log
        if joints.wants_joints(ns):
            state = conversions.arm_state(deserialize_message(data, JointState))
            joints.add_joints(ns, state.position, state.velocity)

    def _look_at_grip(self, ns: int, data: bytes) -> None:
        # The grip is the last field, padded to four bytes: decode the one message in thousands that has one.
        if any(data[-4:]) and deserialize_message(data, WamCommand).grip == Grip.OPEN:
            self._watcher.log.add_opening(ns)

    # services

    def _on_start(self, request, response):
        if silent := ", ".join(sorted(self._silent)):
            response.success, response.message = False, f"nothing has come on {silent} yet: is the node running that publishes it?"
            return response
        self._watcher.clear()
        self._newest.clear()
        self._recording = True
        response.success, response.message = True, str(self._bag.path)
        return response

    def _on_stop(self, request, response):
        if not self._recording:
            response.success, response.message = False, "no demonstration is being recorded: call ~/start first"
            return response
        until = conversions.stamp_ns(request.until)
        response.pending = self._arrived_ns < until  # never, if the caller asks for what there is
        if response.pending:
            response.success, response.message = False, f"messages have come up to {self._arrived_ns} ns only, not {until} ns"
            return response
        self._recording = False
        return self._cut(request, response, until or self._now_ns)

    @property
    def _arrived_ns(self) -> int:
        """Up to this stamp everything has come: a topic that was heard since ~/start may lag behind the others."""
        steps = (newest for topic, newest in self._newest.items() if topic in self._needed and topic not in self._role_of)
        return min(self._watcher.newest_ns - FRAME_NS, min(steps, default=0))

    def _cut(self, request, response, until: int):
        try:
            one = self._watcher.log.cut(f"demonstration_{self._count + 1}", until, self._thresholds)
            response.success, response.demonstration = True, conversions.demonstration_msg(one)
        except ValueError as error:
            response.success, response.message = False, str(error)
            self.get_logger().error(f"no demonstration: {error}")
            return response
        if request.keep:
            self._count += 1
            self._demonstrations.publish(response.demonstration)
            if "/demonstrations" in self.p["topics"]:
                # Not by serialize_message: Fast DDS's size estimate leaves stray bytes behind empty sequences.
                data = serialize(self._types, DEMONSTRATION_TYPE, demonstration_message(self._types, one))
                self._bag.write("/demonstrations", self._now_ns, until, data)
            self._bag.flush(to_disk=True)
        return response

    def _describe(self):
        if self._bag is None:
            return WARN, "no bag is open", {}
        values = {"bag": self._bag.path, "demonstrations": self._count, "rejected": self._watcher.log.rejected}
        return OK, "recording" if self._recording else "waiting", {**values, **self._bag.counts}


def _message_class(type_name: str) -> type:
    package, _, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill demonstration_recorder`."""
    run(lambda: [DemonstrationRecorder()], args)


if __name__ == "__main__":
    main()
