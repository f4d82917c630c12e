"""A stand-in for ros2_control: an arm with joint friction that takes efforts, and publishes its
joints. It makes a step when an effort has come for its last state, so that what it does depends on
no machine's speed.

Nothing compensates its gravity but the efforts. /stand_in/speeds gives its joints speeds, as a
push does. Run as a process of its own.
"""

import signal
import time

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from dart_skill.arm import Actuation, ArmModel

PERIOD = 0.002
NAMES = [f"wam_j{k}" for k in range(1, 8)]
START = np.array([0.0, -0.9, 0.0, 0.8, 0.0, -0.35, 0.0])
AGAIN = 0.1
"""Time after which a state that is not answered is told again [s, wall clock]."""


class StandIn(Node):
    """Its effort controller takes the joints from hand to base."""

    def __init__(self):
        super().__init__("effort_stand_in")
        self._model, self._q, self._qd, self._effort = ArmModel(), START.copy(), np.zeros(7), None
        self._now_ns, self.answered = time.time_ns(), False
        self._friction = Actuation(self._model.description)
        self._states = self.create_publisher(JointState, "/joint_states", QoSProfile(depth=10))
        self.create_subscription(
            Float64MultiArray, "/effort_controller/commands", self._take, QoSProfile(depth=10)
        )
        self.create_subscription(
            Float64MultiArray, "/stand_in/speeds", self._push, QoSProfile(depth=10)
        )

    def _take(self, message):
        assert len(message.data) == 7 and np.isfinite(message.data).all(), message.data
        self._effort, self.answered = np.array(message.data)[::-1], True

    def _push(self, message):
        self._qd = self._qd + np.array(message.data)

    def step(self):
        """2 ms; until the first effort comes the arm has its brakes on."""
        self._now_ns, self.answered = self._now_ns + round(1e9 * PERIOD), False
        bias = self._model.gravity_torque(self._q)
        bias += self._model.coriolis_torque(self._q, self._qd)
        inertia = self._model.mass_matrix(self._q)
        acceleration = self._friction.acceleration(inertia, self._effort - bias, self._qd, PERIOD)
        self._qd = self._qd + PERIOD * acceleration
        self._q = self._q + PERIOD * self._qd

    def tell(self):
        """The joints as they are."""
        sec, nanosec = divmod(self._now_ns, 10**9)
        message = JointState(name=NAMES, position=self._q.tolist(), velocity=self._qd.tolist())
        message.header.stamp = Time(sec=sec, nanosec=nanosec)
        self._states.publish(message)


def main():
    """Until SIGINT, not faster than the wall clock."""
    ended = []
    signal.signal(signal.SIGINT, lambda *_: ended.append(True))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    arm, told = StandIn(), 0.0
    while not ended:
        since = time.monotonic() - told
        if since > AGAIN or (arm.answered and since > PERIOD):
            if arm.answered:
                arm.step()
            arm.tell()
            told = time.monotonic()
        rclpy.spin_once(arm, timeout_sec=PERIOD)
    arm.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
