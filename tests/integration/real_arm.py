"""A stand-in for a real arm with its cameras: a node that steps one of our worlds in lockstep, and
publishes only what docs/hardware.md asks for. Nobody can reset that world, or hold it.
"""

import time

import numpy as np
from dart_skill_msgs.msg import WamCommand
from geometry_msgs.msg import PoseStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from dart_skill.arm import the_arm
from dart_skill.common.world import pose_topic
from dart_skill.simulation import Workbench
from dart_skill_nodes.comms import conversions

FRAME_STEPS = 5
"""Steps between two frames of the cameras: 100 Hz."""
PATIENCE = 2.0
"""A state that is not answered for so long is answered by nobody: the arm is braked [s, wall clock]."""
NOISE = 1e-4
"""Standard deviation of what the cameras say [m]."""

ASIDE = (0.9, 0.6)
"""Where a part on the table is in nobody's way (2,) [m]."""


class Table(Workbench):
    """A workbench at which a person moves the part, too."""

    def put_part(self, x, y, turn=0.0):
        """Stand the part upright somewhere on the table [m], turned [rad]."""
        place = [x, y, self.table + 0.5 * self.bench.size[2]]
        upright = [0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)]
        self._world.resetBasePositionAndOrientation(self._ball, place, upright)
        self._world.resetBaseVelocity(self._ball, [0, 0, 0], [0, 0, 0])
        self._seen_loose = None

    def lay_aside(self):
        """Take the part away from hand and holder."""
        self.put_part(*ASIDE)

    def put_between_the_fingers(self):
        """Stand the part below the open hand, which points down, turned as the hand is."""
        forward = Rotation.from_quat(self.hand_quaternion).as_matrix()[:, 0]
        self.put_part(*self.hand_position[:2], np.arctan2(-forward[1], -forward[0]))


class RealArm:
    """Steps a plant with the commands that answer its states, whenever a client of the graph waits for
    something. Attribute hidden: roles of bodies that the cameras do not see now.
    """

    def __init__(self, client, plant):
        self.plant, self.hidden = plant, set()
        self._rng, self._answer, self._spin = np.random.default_rng(0), None, client.spin
        client.spin = self.tick
        self._names = [joint.name for joint in the_arm().joints]
        node, quality = client.node, 1000
        self._states = node.create_publisher(JointState, "/joint_states", quality)
        self._poses = {
            role: node.create_publisher(PoseStamped, pose_topic(role), quality)
            for role in plant.bodies
        }
        node.create_subscription(WamCommand, "/wam/command", self._take, quality)

    def _take(self, message):
        if conversions.stamp_ns(message.header.stamp) == self.plant.state_stamp_ns:
            self._answer = conversions.command(message)

    def tick(self):
        """Publish a state and what the cameras see, let messages come in until it is answered, and
        step.
        """
        plant, stamp = self.plant, conversions.time_msg(self.plant.state_stamp_ns)
        state = JointState(name=self._names, position=plant.joint_position)
        state.velocity, state.header.stamp = plant.arm_state.velocity.tolist(), stamp
        self._answer = None
        self._states.publish(state)
        if plant.step_count % FRAME_STEPS == 0:
            for role, pose in plant.bodies.items():
                if role not in self.hidden:
                    self._publish(role, stamp, *pose)
        patience = PATIENCE if self._states.get_subscription_count() else 0.0
        until = time.monotonic() + patience
        self._spin()
        while self._answer is None and time.monotonic() < until:
            self._spin()
        plant.step(self._answer or plant.braking())

    def _publish(self, role, stamp, position, quaternion):
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = "world", stamp
        seen = position + NOISE * self._rng.standard_normal(3)
        conversions.set_pose(message.pose, seen, np.asarray(quaternion, dtype=float))
        self._poses[role].publish(message)
