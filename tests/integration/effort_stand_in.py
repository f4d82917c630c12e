"""A stand-in for ros2_control: an arm with joint friction that takes efforts, and publishes its
joints with the wall clock, whatever comes.

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
FEW = 10
"""Steps that are made up for at once; what is later is left out."""


class StandIn(Node):
    """Its effort controller takes the joints from hand to base."""

    def __init__(self):
        super().__init__("effort_stand_in")
        self._model, self._q, self._qd, self._effort = ArmModel(), START.copy(), np.zeros(7), None
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
        self._effort = np.array(message.data)[::-1]

    def _push(self, message):
        self._qd = self._qd + np.array(message.data)

    def step(self):
        """2 ms; until the first effort comes the arm has its brakes on."""
        if self._effort is not None:
            load = self._model.gravity_torque(self._q) + self._model.coriolis_torque(
                self._q, self._qd
            )
            inertia = self._model.mass_matrix(self._q)
            self._qd = self._qd + PERIOD * self._friction.acceleration(
                inertia, self._effort - load, self._qd, PERIOD
            )
            self._q = self._q + PERIOD * self._qd

    def tell(self):
        """The joints as they are."""
        sec, nanosec = divmod(time.time_ns(), 10**9)
        message = JointState(name=NAMES, position=self._q.tolist(), velocity=self._qd.tolist())
        message.header.stamp = Time(sec=sec, nanosec=nanosec)
        self._states.publish(message)


def main():
    """Steps follow the wall clock until SIGINT."""
    ended = []
    signal.signal(signal.SIGINT, lambda *_: ended.append(True))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    arm, due = StandIn(), time.monotonic()
    while not ended:
        behind = min(FEW, int((time.monotonic() - due) / PERIOD))
        for _ in range(behind):
            arm.step()
        due = due + behind * PERIOD if behind < FEW else time.monotonic()
        if behind:
            arm.tell()
        rclpy.spin_once(arm, timeout_sec=max(0.0, due + PERIOD - time.monotonic()))
    arm.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
