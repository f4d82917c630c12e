"""A controller that takes trajectories, as the commander sees it: the action FollowJointTrajectory
of ros2_control, and the hand on ~/hand_open or by an action of its own.

A trajectory begins at a stamp of the arm's clock, which is the one of the controller: both are
those of its controller manager.
"""

from collections.abc import Callable
from functools import partial

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectoryPoint

from dart_skill.arm import Grip, JointTrajectory
from dart_skill.common.world import joint_names
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import NEWEST

WORDS = {
    -1: "an invalid goal",
    -2: "other joints than its own",
    -3: "an old start",
    -4: "a joint off its path",
    -5: "a joint off its goal",
}
"""Error codes of FollowJointTrajectory."""


class TrajectoryOutput:
    """A `TrajectoryController`: sends each path as one goal of an action.

    * node: of the commander.
    * parameters: of that node.
    """

    def __init__(self, node: Node, parameters: dict):
        self._node, self._p = node, parameters
        self._actions = _actions()
        self._names = list(joint_names())
        self._arm = self._client(self._actions.FollowJointTrajectory, "trajectory_action")
        self._hand = node.create_publisher(Bool, "~/hand_open", NEWEST)
        self._gripper = None
        if parameters["gripper_action"]:
            self._gripper = self._client(self._actions.GripperCommand, "gripper_action")
        self._number, self._handle = 0, None

    def _client(self, kind, parameter: str) -> ActionClient:
        return ActionClient(self._node, kind, self._p[parameter])

    @property
    def missing(self) -> str:
        """Which action nobody offers, in words; empty if all are there."""
        for client, name in ((self._arm, "trajectory_action"), (self._gripper, "gripper_action")):
            if client is not None and not client.server_is_ready():
                return (
                    f"nobody offers the action '{self._p[name]}' ({name} of the commander): is the"
                    " controller active?"
                )
        return ""

    @property
    def has_taken(self) -> bool:
        """See `TrajectoryController`."""
        return self._handle is not None

    def follow(
        self, trajectory: JointTrajectory, start_ns: int, ended: Callable[[str], None]
    ) -> None:
        """See `TrajectoryController`."""
        if self.missing:
            ended(self.missing)
            return
        self._number, self._handle = self._number + 1, None
        goal = self._actions.FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = self._names
        conversions.set_stamp(goal.trajectory.header.stamp, start_ns)
        goal.trajectory.points = [
            JointTrajectoryPoint(
                positions=q.tolist(),
                velocities=qd.tolist(),
                accelerations=qdd.tolist(),
                time_from_start=conversions.duration_msg(float(time)),
            )
            for time, q, qd, qdd in zip(
                trajectory.time,
                trajectory.position,
                trajectory.velocity,
                trajectory.acceleration,
                strict=True,
            )
        ]
        answered = partial(self._on_answer, self._number, ended)
        self._arm.send_goal_async(goal).add_done_callback(answered)

    def _on_answer(self, number: int, ended: Callable[[str], None], future) -> None:
        handle = future.result()
        if not handle.accepted:
            ended("it refuses the trajectory; its own log says why")
        elif number != self._number:  # it was cancelled before it was taken
            handle.cancel_goal_async()
        else:
            self._handle = handle
            over = partial(self._on_result, ended)
            handle.get_result_async().add_done_callback(over)

    def _on_result(self, ended: Callable[[str], None], future) -> None:
        status, result = future.result().status, future.result().result
        if status == GoalStatus.STATUS_SUCCEEDED:
            ended("")
        elif result.error_code == result.SUCCESSFUL:
            ended("it was cancelled there, or another goal took its place")
        else:
            ended(
                result.error_string or WORDS.get(result.error_code, f"error {result.error_code}")
            )

    def cancel(self) -> None:
        """See `TrajectoryController`."""
        self._number += 1
        if self._handle is not None:
            self._handle.cancel_goal_async()
        self._handle = None

    def tell_hand(self, grip: Grip) -> None:
        """See `TrajectoryController`."""
        self._hand.publish(Bool(data=grip == Grip.OPEN))
        if self._gripper is None:
            return
        goal = self._actions.GripperCommand.Goal()
        goal.command.position = self._p[f"gripper_{'open' if grip == Grip.OPEN else 'closed'}"]
        goal.command.max_effort = self._p["gripper_effort"]
        self._gripper.send_goal_async(goal)


def _actions():
    """The actions of control_msgs, which no wheel of ROS has; ValueError says where they are."""
    try:
        from control_msgs import action
    except ModuleNotFoundError as error:
        raise ValueError(
            "output is 'trajectory', and control_msgs is not installed: apt-get install"
            " ros-jazzy-control-msgs"
        ) from error
    return action
