"""What a simulated arm says of itself: its state for the nodes that answer it, and what viewers and
judges hear beside that.
"""

import time

import numpy as np
from dart_skill_msgs.msg import BodyState, SimulationState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from dart_skill.arm import fixed_transforms, joint_transforms, wam_description, write_urdf
from dart_skill.simulation import Plant
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.fixed_layout import FixedLayout
from dart_skill_nodes.comms.names import CLOCK, DESCRIPTION, JOINT_STATES
from dart_skill_nodes.comms.qos import CLOCK_QOS, COMPLETE, FRAMES, NEWEST
from dart_skill_nodes.comms.tf_messages import LiveTransforms
from dart_skill_nodes.process.node_base import ERROR, OK, WARN

STILL = np.zeros(3)


class StatePublisher:
    """Publishes the present state of a plant.

    * parameters: of the node, in force: frame_id, base_turn, ground_truth_period.

    Attribute: at, when the last state was published [s, wall clock].
    """

    def __init__(self, node: Node, plant: Plant, parameters: dict):
        self._plant, self._p, self.at = plant, parameters, 0.0
        frame, arm = parameters["frame_id"], wam_description()
        self._clock = node.create_publisher(Clock, CLOCK, CLOCK_QOS)
        self._joint_states = node.create_publisher(JointState, JOINT_STATES, COMPLETE)
        self._tool_pose = node.create_publisher(PoseStamped, "wam/tool_pose", COMPLETE)
        self._truth = node.create_publisher(SimulationState, "simulation/state", FRAMES)
        self._safety = node.create_publisher(DiagnosticStatus, "wam/safety", NEWEST)
        self._description = node.create_publisher(String, DESCRIPTION, NEWEST)
        self._description.publish(String(data=write_urdf(arm)))
        self._transforms = LiveTransforms(node, frame, fixed_transforms(arm, frame))
        joints = JointState(name=[joint.name for joint in arm.joints])
        joints.position = joints.velocity = joints.effort = [0.0] * len(joints.name)
        self._tool = PoseStamped()
        for message in (joints, self._tool):
            message.header.frame_id = frame
        self._joint_layout = FixedLayout(joints)
        self._truth_layouts: dict[tuple, FixedLayout] = {}  # by what is said beside numbers
        self._level: bytes | None = None

    def publish(self) -> None:
        """The present state. The clock comes first: nothing is stamped later than it shows. Then
        the joint states: in other processes the answer to them is worked out while the rest is
        sent.
        """
        plant, ns = self._plant, self._plant.state_stamp_ns
        if self._clock.get_subscription_count():
            self._clock.publish(conversions.leading_stamp_bytes(ns))
        self.at = time.monotonic()
        numbers = np.array(
            [*plant.joint_position, *plant.joint_velocity, *plant.joint_effort.tolist()]
        )
        self._joint_states.publish(self._joint_layout.pack(ns, numbers))
        if plant.step_count % self._p["ground_truth_period"] == 0:
            self._publish_truth()
        if self._tool_pose.get_subscription_count():
            conversions.set_stamp(self._tool.header.stamp, ns)
            conversions.set_pose(self._tool.pose, plant.hand_position, plant.hand_quaternion)
            self._tool_pose.publish(self._tool)
        if self._transforms.is_due("arm", ns):
            self._transforms.publish(joint_transforms(wam_description(), plant.joint_position), ns)

    def publish_safety(self) -> None:
        """On /wam/safety, when it changes: all is well, something is near its limit, or the motors
        are shorted until a reset.
        """
        fault, warning = self._plant.fault, self._plant.warning
        level = ERROR if fault else WARN if warning else OK
        if level != self._level:
            self._level = level
            self._safety.publish(
                DiagnosticStatus(
                    level=level, name="wam safety", message=fault or warning, hardware_id="wam"
                )
            )

    def _publish_truth(self) -> None:
        state, there, loose = self._plant.state, self._plant.bodies, self._plant.loose_body
        numbers = [state.position, state.velocity, state.effort]
        for name, pose in there.items():
            numbers += [*pose, state.ball_velocity if name == loose else STILL, STILL]
        numbers.append([self._p["base_turn"]])
        said = tuple(there), self._plant.held_body, self._plant.succeeded
        if said not in self._truth_layouts:
            self._truth_layouts[said] = self._truth_layout(*said)
        layout = self._truth_layouts[said]
        self._truth.publish(
            layout.pack(state.stamp_ns, np.concatenate(numbers), state.episode, state.step)
        )

    def _truth_layout(self, bodies: tuple[str, ...], held: str, success: bool) -> FixedLayout:
        message = SimulationState(
            bodies=[BodyState(name=name) for name in bodies], held=held, success=success
        )
        message.header.frame_id = self._p["frame_id"]
        return FixedLayout(message, conversions.EPISODE_AND_STEP)
