"""The teacher: a simulated person who guides the arm by its hand and elbow until a throw goes in.

Action /teach. While it guides, the teacher takes part in the simulator's handshake: it answers every /joint_states once, on
/wam/teacher_wrench. It sees the ball through the motion capture like everybody else, and starts and stops the recorder.
"""

from dart_skill_msgs.action import Teach
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import Reset
from rclpy.action import CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from dart_skill.robot import Command, Grip
from dart_skill.simulation import Person, Phase, Teacher
from dart_skill.skill.observe import ARRIVAL_NS
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.service_calls import Judge, Recording, ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import CoroutineActionServer, Promise, finish_by_success, pause
from dart_skill_nodes.comms.joint_states import hear_joint_states
from dart_skill_nodes.comms.qos import COMPLETE
from dart_skill_nodes.process.node_base import OK, Diagnostics, Parameter, declare, run

TABLE = [
    Parameter("seed", "everything random comes from it", 0, 2**31 - 1),
    Parameter("frame_id", "frame of targets and wrenches"),
    Parameter("max_attempts", "throws at one basket at most", 1, 100),
    Parameter("watch_time", "the ball is watched so long after the button was pressed [s]", 0.3, 5.0),
    Parameter("release_point", "standard deviation of the release point [m]", 0.0, 0.2),
    Parameter("duration", "of the duration of the swing [share]", 0.0, 0.3),
    Parameter("speed", "of the speed of the swing [share]", 0.0, 0.3),
    Parameter("direction", "of the direction of the swing [rad]", 0.0, 0.3),
    Parameter("timing", "of pressing the button [s]", 0.0, 0.1),
    Parameter("expected_hand_delay", "the person presses so long before the release [s]", 0.0, 0.5),
    Parameter("tremble", "of the hand's trembling force [N]", 0.0, 20.0),
    Parameter("tremble_rate", "corner frequency of the trembling [Hz]", 0.1, 50.0),
    Parameter("pause", "shortest and longest wait before the swing [s]"),
    Parameter("firm_hand", "stiffness and damping of the hand's hold [N/m, N s/m]"),
    Parameter("firm_wrist", "the same for turning [N m/rad, N m s/rad]"),
    Parameter("firm_elbow", "stiffness and damping of the hand at the elbow [N/m, N s/m]"),
    Parameter("strongest_push", "of either hand [N]", 1.0, 500.0),
    Parameter("strongest_twist", "of the wrist [N m]", 0.1, 50.0),
]


class TeacherNode(Node):
    """Guided throws as an action."""

    def __init__(self):
        super().__init__("teacher")
        self.p = declare(self, "teacher.yaml", TABLE)
        self._teacher = Teacher(self.p["seed"], person=Person.from_parameters(self.p))
        self._goal, self._over, self._begin, self._last_ns = None, None, None, None
        calls = ServiceCalls(self)
        self._call, self._recording, self._judge = calls.call, Recording(self, calls), Judge(self, calls)
        self._message = WamCommand()
        self._message.header.frame_id = self.p["frame_id"]
        self._wrench = self.create_publisher(WamCommand, "/wam/teacher_wrench", COMPLETE)
        self._states = hear_joint_states(self, self._on_state, raw=True)
        self._reset = self.create_client(Reset, "/simulation/reset")
        self._pause = self.create_client(SetBool, "/simulation/pause")
        self._free_arm = self.create_client(SetBool, "/commander/release_arm")
        accept = {"goal_callback": self._on_goal, "cancel_callback": lambda _: CancelResponse.ACCEPT}
        self._action = CoroutineActionServer(self, Teach, "/teach", self._teach, finish_by_success, **accept)
        self._diagnostics = Diagnostics(self, lambda: (OK, self._teacher.phase.value, {}))

    # the hands

    def _on_state(self, data: bytes) -> None:
        if self._goal is None:
            return
        state = conversions.arm_state(deserialize_message(data, JointState))
        if state.stamp_ns != self._last_ns:
            self._last_ns = state.stamp_ns
            conversions.fill_command(self._message, self._push(state))
        self._wrench.publish(self._message)
        if self._over is not None and self._ended_ns is not None and self._last_ns >= self._ended_ns:
            self._over.keep()

    def _push(self, state) -> Command:
        if self._begin is not None:
            target, correct, self._begin = *self._begin, None
            self._teacher.begin(target, state, correct)
            self._guiding = True
        if not self._guiding:
            return Command(state.stamp_ns)
        push = self._teacher.step(state)
        if push.grip == Grip.OPEN:
            self._opened_ns = state.stamp_ns
        if self._ended_ns is None and self._teacher.phase == Phase.WATCHING:
            self._ended_ns = max(state.stamp_ns, self._opened_ns + round(self.p["watch_time"] * 1e9))
        return push

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None:
            self.get_logger().warning("a lesson is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    async def _teach(self, goal_handle) -> Teach.Result:
        self._goal, self._guiding = goal_handle, False
        result = Teach.Result()
        try:
            await self._lesson(goal_handle, result)
        except (CallFailed, ValueError) as error:
            result.success, result.message = False, str(error)
            self.get_logger().error(f"the lesson ends: {error}")
        finally:
            self._goal, self._over = None, None
        return result

    async def _lesson(self, goal_handle, result) -> None:
        target = conversions.vector(goal_handle.request.target)
        attempts = goal_handle.request.max_attempts or self.p["max_attempts"]
        for attempt in range(1, attempts + 1):
            result.attempts = attempt
            self._feed("preparing", attempt)
            self._teacher.check(target, attempt > 1)
            await self._guided_throw(target, attempt)
            outcome = result.outcome = await self._judge.outcome(target, self._opened_ns, self._ended_ns - ARRIVAL_NS)
            reason = "" if outcome.in_basket else "missed"
            kept = await self._recording.stop(self._ended_ns - ARRIVAL_NS, bool(outcome.in_basket), reason)
            if goal_handle.is_cancel_requested:
                result.message = "cancelled"
                break
            if outcome.in_basket and kept.success:
                result.success, result.message = True, "in"
                break
            result.message = kept.message or "missed"
            if outcome.landing_seen:
                self._teacher.learn_from(conversions.vector(outcome.landing))
        reset = Reset.Request(paused=True)
        await self._call(self._reset, reset)

    async def _guided_throw(self, target, attempt: int) -> None:
        self._guiding, self._ended_ns, self._opened_ns = False, None, 0
        await self._recording.start()
        await self._call(self._free_arm, SetBool.Request(data=True))
        reset = Reset.Request(move_basket=True, basket=conversions.point(target), paused=True, guided=True)
        first = await self._call(self._reset, reset)
        await self._until(lambda: (self._last_ns or 0) >= conversions.stamp_ns(first.stamp), "the state after the reset")
        self._begin, self._over = (target, attempt > 1), Promise()
        self._feed("armed", attempt)
        await self._call(self._pause, SetBool.Request(data=False))
        await self._over
        await self._call(self._pause, SetBool.Request(data=True))
        await self._call(self._free_arm, SetBool.Request(data=False))

    async def _until(self, condition, what: str) -> None:
        """Wait for a message that the graph has sent already; CallFailed if it does not come in 10 s."""
        for _ in range(1000):
            if condition():
                return
            await pause(self, 0.01)
        raise CallFailed(f"{what} did not arrive in 10 s")

    def _feed(self, phase: str, attempt: int) -> None:
        self._goal.publish_feedback(Teach.Feedback(phase=phase, attempt=attempt))


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill teacher`."""
    run(lambda: [TeacherNode()], args)


if __name__ == "__main__":
    main()
