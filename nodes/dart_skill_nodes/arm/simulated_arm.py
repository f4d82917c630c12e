"""A simulated arm as its node has it: what it says of itself, for the nodes that answer it, and for
viewers and judges; and how fast the time of its world goes.
"""

import time
from collections.abc import Callable

import numpy as np
from dart_skill_msgs.msg import BodyState, SimulationState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from dart_skill.arm import fixed_transforms, joint_transforms, the_arm, write_urdf
from dart_skill.simulation import Plant, PlantSettings, Stillness
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.fixed_layout import FixedLayout
from dart_skill_nodes.comms.for_viewers import LiveTransforms
from dart_skill_nodes.comms.names import CLOCK, DESCRIPTION, JOINT_STATES
from dart_skill_nodes.comms.qos import CLOCK_QOS, COMPLETE, FRAMES, NEWEST
from dart_skill_nodes.process.node_base import ERROR, OK, WARN
from dart_skill_nodes.process.parameters import described

UNASKED = 0.5
"""Time after which a world rests that has not been asked for anything since the start: ball and
basket have settled by then [s].
"""
OF_TIME = ("speed_factor", "rest_after")
"""Parameters that say how fast time goes, which count at once."""
BEHIND = 0.05
"""Time that is lost is made up for by so much at most; in real time the arm's time falls behind by the
rest [s, wall clock].
"""
STILL = np.zeros(3)


class StatePublisher:
    """Publishes the present state of a plant.

    * parameters: of the node, in force: frame_id, base_turn, ground_truth_period.

    Attribute: at, when the last state was published [s, wall clock].
    """

    def __init__(self, node: Node, plant: Plant, parameters: dict):
        self._plant, self._p, self.at = plant, parameters, 0.0
        frame, arm = parameters["frame_id"], the_arm()
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
        self._tool.header.frame_id = frame
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
            self._transforms.publish(joint_transforms(the_arm(), plant.joint_position), ns)

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
        joints = [0.0] * len(self._plant.state.position)
        message = SimulationState(
            joint_position=joints,
            joint_velocity=joints,
            joint_effort=joints,
            bodies=[BodyState(name=name) for name in bodies],
            held=held,
            success=success,
        )
        message.header.frame_id = self._p["frame_id"]
        return FixedLayout(message, conversions.EPISODE_AND_STEP)


class WorldPace:
    """Holds the time of a plant back, and lets a world rest in which nothing moves.

    * speed_factor: simulated seconds per second at most; 0: no limit.
    * rest_after: the world rests when nothing has moved for so long; 0: never [s].
    * watched: whether a person watches, for whom it is no faster than the machine's time.
    * rests: whether nothing has moved for long, and no client waits for steps.
    """

    def __init__(self, node: Node, plant: Plant):
        self._node, self._plant, self._stillness = node, plant, Stillness()
        self.watched = self.rests = False
        self._asked = False  # whether a client has asked for anything
        self._next = time.monotonic()  # when the next step is due
        self._read()
        node.add_post_set_parameters_callback(self._read)

    def _read(self, _=()) -> None:
        """Take the parameters whenever they were changed: reading one takes as long as a message."""
        self.speed_factor, self.rest_after = (
            self._node.get_parameter(name).value for name in OF_TIME
        )

    def wake(self) -> None:
        """Go on at full speed: a client has asked for something."""
        self._stillness.wake(self._plant.state_stamp_ns)
        self._asked, self.rests = True, False

    def look_for_rest(self, waits: bool) -> None:
        """See whether something moves: now and then, and at each step of a world that rests.

        * waits: whether a client waits for steps, so that the world must not rest.
        """
        ns = self._plant.state_stamp_ns
        if not (self.rests or self._stillness.is_due(ns)):
            return
        self._stillness.look(ns, self._plant.joint_velocity, self._plant.bodies)
        still_for = (ns - self._stillness.since_ns) * 1e-9
        rest_after = self.rest_after if self._asked else min(self.rest_after, UNASKED)
        self.rests = not waits and 0.0 < rest_after < still_for

    def hold_back(self) -> None:
        """Wait until the next step is due."""
        factor = self.speed_factor
        if self.watched:
            factor = min(factor or 1.0, 1.0)
        if factor <= 0.0:
            return
        now = time.monotonic()
        self._next = max(self._next, now - BEHIND) + self._plant.settings.step / factor
        if self._next > now:
            time.sleep(self._next - now)

    def is_due(self, counts: bool = True) -> bool:
        """Real time: whether a step is due, which is to be made then; counts: whether time goes on
        for this world.
        """
        now = time.monotonic()
        if not counts:
            self._next = now
        if not counts or now < self._next:
            return False
        period = self._plant.settings.step / (self.speed_factor or 1.0)
        self._next = max(self._next + period, now - BEHIND)
        return True


def let_it_change(node: Node, plant: Plant, parameters: dict) -> Callable[[], None]:
    """Let parameters of the plant be changed while a node runs; a function that takes the changes
    over into the plant, and into the parameters in force. A change to an arm that cannot be is refused
    when it is asked for.
    """
    changeable = [
        name
        for name, row in described("wam_simulator").items()
        if row.get("changes") and name not in OF_TIME
    ]

    def check(changes) -> SetParametersResult:
        try:
            changed = {one.name: one.value for one in changes}
            PlantSettings.from_parameters({**parameters, **changed})
        except (TypeError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def take() -> None:
        now = {name: node.get_parameter(name).value for name in changeable}
        if any(parameters[name] != value for name, value in now.items()):
            parameters.update(now)
            plant.change(PlantSettings.from_parameters(parameters))

    node.add_on_set_parameters_callback(check)
    return take
