"""A stand-in for an arm under joint_trajectory_controller of ros2_control: its joints are where its
drives are. It takes FollowJointTrajectory as that controller is documented, publishes its joints in
lockstep with the commander's answers, and notes on /stand_in/hand where it was when the hand was
told to open.

/stand_in/held takes a Bool: the joints do not move any more, as where something holds them. Run as
a process of its own, with the rate of the controller.
"""

import signal
import sys
import time
from threading import Event

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from control_msgs.action import FollowJointTrajectory
from dart_skill_msgs.msg import WamCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from dart_skill.arm import JointTrajectory, the_arm
from dart_skill.simulation import ControllerSettings, SimulatedController
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LATCHED
from tests.integration.trajectory_names import ACTION, START

AGAIN = 0.1
"""Time after which a state that is not answered is told again [s, wall clock]."""


class StandIn(Node):
    """The controller, its drives, and the joint states."""

    def __init__(self, rate):
        super().__init__("trajectory_stand_in")
        self._controller = SimulatedController(START, ControllerSettings(rate, 0.02))
        self._period_ns, self._now_ns = round(1e9 / rate), time.time_ns()
        self._names = [joint.name for joint in the_arm().joints]
        self.answered, self._held, self._goal, self._cancelled = False, False, None, None
        self._states = self.create_publisher(JointState, "/joint_states", 10)
        self._opened = self.create_publisher(JointState, "/stand_in/opened", LATCHED)
        self.create_subscription(WamCommand, "/wam/command", self._take, 10)
        self.create_subscription(Bool, "/stand_in/held", self._hold, 10)
        self.create_subscription(Bool, "/commander/hand_open", self._hand, LATCHED)
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            ACTION,
            self._result,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
        )

    def _take(self, message):
        self.answered = self.answered or (
            conversions.stamp_ns(message.header.stamp) == self._now_ns
        )

    def _hold(self, message):
        self._held = message.data

    def _hand(self, message):
        if message.data:
            self._opened.publish(self._joints())

    @staticmethod
    def _course(goal):
        points = goal.trajectory.points
        rows = [
            np.array([getattr(point, name) for point in points])
            for name in ("positions", "velocities", "accelerations")
        ]
        times = np.array([conversions.seconds(point.time_from_start) for point in points])
        return JointTrajectory(times, *rows)

    def _on_goal(self, goal):
        start_ns = conversions.stamp_ns(goal.trajectory.header.stamp)
        refused = sorted(goal.trajectory.joint_names) != sorted(self._names)
        refused = refused or self._controller.why_refused(self._course(goal), start_ns)
        return GoalResponse.REJECT if refused else GoalResponse.ACCEPT

    def _on_accepted(self, handle):
        goal = handle.request
        self._goal = handle
        self._controller.follow(
            self._course(goal),
            conversions.stamp_ns(goal.trajectory.header.stamp),
            lambda error: self._over(handle, error),
        )

    def _over(self, handle, error):
        self._error = error
        self._goal = None
        handle.execute()

    def _on_cancel(self, handle):
        self._controller.cancel()
        self._cancelled, self._goal = handle, None
        return CancelResponse.ACCEPT

    def finish_what_was_cancelled(self):
        """The state of a goal changes after the answer to its cancel."""
        if self._cancelled is not None and self._cancelled.is_cancel_requested:
            handle, self._cancelled, self._error = self._cancelled, None, "cancelled"
            handle.execute()

    def _result(self, handle):
        result = FollowJointTrajectory.Result(error_string=self._error)
        if handle.is_cancel_requested:
            handle.canceled()
        elif self._error:
            result.error_code = FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED
            handle.abort()
        else:
            handle.succeed()
        return result

    def step(self):
        """A period of the controller."""
        self._now_ns, self.answered = self._now_ns + self._period_ns, False
        if not self._held:
            self._controller.update(self._now_ns, self._controller.position)

    def _joints(self):
        arm = self._controller
        sec, nanosec = divmod(self._now_ns, 10**9)
        message = JointState(
            name=self._names, position=arm.position.tolist(), velocity=arm.velocity.tolist()
        )
        message.header.stamp = Time(sec=sec, nanosec=nanosec)
        return message

    def tell(self):
        """The joints as they are."""
        self._states.publish(self._joints())


def main():
    """Until SIGINT, not faster than the wall clock."""
    ended, rate = Event(), float(sys.argv[1])
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    arm, told = StandIn(rate), 0.0
    while not ended.is_set():
        since = time.monotonic() - told
        if since > AGAIN or (arm.answered and since > 1.0 / rate):
            if arm.answered:
                arm.step()
            arm.tell()
            told = time.monotonic()
        rclpy.spin_once(arm, timeout_sec=1.0 / rate)
        arm.finish_what_was_cancelled()
    arm.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
