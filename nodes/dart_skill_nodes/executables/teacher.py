"""The teacher: a simulated person who guides the arm by its hand and elbow until a movement
succeeds.

Action /teach. While it guides, the teacher takes part in the simulator's handshake: it answers
every /joint_states once, on /wam/teacher_wrench. It sees all bodies through the motion capture
like everybody else, and starts and stops the recorder.

A lesson with `by_pointer` is given by another person: the hands follow the poses on ~/pointer, the
fingers do what ~/grip says, and ~/done ends it.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Teach
from dart_skill_msgs.msg import Situation, WamCommand
from dart_skill_msgs.srv import Reset, Step
from geometry_msgs.msg import PoseStamped
from rclpy.action import CancelResponse, GoalResponse
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import REST_SPEED, ArmState, Command, Grip
from dart_skill.recording import HAND
from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.service_calls import BodyLocator, Judge, RecorderCalls, ServiceCalls
from dart_skill_nodes.client.trial_sequence import LOOK_STEPS
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.arm_time import FreezeDetector, TimeOfTheArm
from dart_skill_nodes.comms.commands import CommandWriter, new_sender
from dart_skill_nodes.comms.coroutines import (
    CoroutineActionServer,
    Promise,
    finish_by_success,
    pause,
)
from dart_skill_nodes.comms.joint_states import StateReader, hear_joint_states
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES, pose_topic
from dart_skill_nodes.comms.presence import LOOK, Cameras, publishers, subscribers
from dart_skill_nodes.comms.qos import COMPLETE, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.seen_in_step import SeenInStep, Sighting
from dart_skill_nodes.comms.showing import PointerShowing, showing_of
from dart_skill_nodes.process.node_base import (
    OK,
    Diagnostics,
    Parameter,
    declare,
    declare_bodies,
    run,
    skill_of,
)

TABLE = [
    Parameter("seed", "everything random comes from it", 0, 2**31 - 1),
    Parameter("frame_id", "frame of targets and wrenches"),
    Parameter(
        "skill",
        "that it shows; without its bodies among those that are tracked nobody sees what becomes"
        " of it",
    ),
    Parameter("max_attempts", "in one situation at most", 1, 100),
    Parameter(
        "watch_time", "the ball is watched so long after the button was pressed [s]", 0.3, 5.0
    ),
    Parameter("release_point", "standard deviation of the release point [m]", 0.0, 0.2),
    Parameter("duration", "of the duration of the swing [share]", 0.0, 0.3),
    Parameter("speed", "of the speed of the swing [share]", 0.0, 0.3),
    Parameter("direction", "of the direction of the swing [rad]", 0.0, 0.3),
    Parameter("timing", "of pressing the button [s]", 0.0, 0.1),
    Parameter(
        "expected_hand_delay", "the person presses so long before the release [s]", 0.0, 0.5
    ),
    Parameter("tremble", "of the hand's trembling force [N]", 0.0, 20.0),
    Parameter("tremble_rate", "corner frequency of the trembling [Hz]", 0.1, 50.0),
    Parameter("pause", "shortest and longest wait before the swing [s]"),
    Parameter("firm_hand", "stiffness and damping of the hand's hold [N/m, N s/m]"),
    Parameter("firm_wrist", "the same for turning [N m/rad, N m s/rad]"),
    Parameter("firm_elbow", "stiffness and damping of the hand at the elbow [N/m, N s/m]"),
    Parameter("strongest_push", "of either hand [N]", 1.0, 500.0),
    Parameter("strongest_twist", "of the wrist [N m]", 0.1, 50.0),
]


LONGEST_GAP = 0.1
"""Between two states of an arm that is guided [s]."""
FINDS, FINDS_AGAIN = 15, 4
"""Looks for the cameras, until there are none: by a teacher that has just been started, and by one
that knew some.
"""
LONGEST_BRAKE = 10
"""Looks at an arm that is braked, until it is not waited for any more."""
LISTENS = 20
"""Looks after a lesson until the states of the arm are not heard any more, as no other lesson
follows.
"""


class TeacherNode(GuardedNode):
    """Guided movements as an action."""

    def __init__(self):
        super().__init__("teacher")
        self.p = declare(self, "teacher.yaml", TABLE)
        skill = skill_of(self)
        name_of = declare_bodies(self, (HAND, *skill.bodies))
        self._skill, self._person, self._pointer = (
            skill,
            showing_of(skill, self.p),
            PointerShowing(skill, self.p["frame_id"]),
        )
        self._showing = self._person
        self._goal, self._over, self._begin, self._last_ns = None, None, None, None
        self._cameras = Cameras(self, pose_topic(name_of[skill.moves]))
        self._time = TimeOfTheArm(self)
        self._withdrawn, self._unseen = "", ""
        self._needed, self._awake, self._speed = (), FreezeDetector(), 0.0
        calls = ServiceCalls(self)
        self._call, self._recording, self._judge = (
            calls.call,
            RecorderCalls(self, calls),
            Judge(self, calls),
        )
        self._eyes, self._step = (
            BodyLocator(self, calls),
            self.create_client(Step, "simulation/step"),
        )
        self._reader, self._writer, self._written = (
            StateReader(),
            CommandWriter(new_sender(), self.p["frame_id"]),
            b"",
        )
        self._wrench = self.create_publisher(WamCommand, GUIDING, COMPLETE)
        self._seen = (
            SeenInStep(self, name_of, self.p["frame_id"], self._answer)
            if self._person.watches
            else None
        )
        self._states, self._idle = hear_joint_states(self, self._on_state, raw=True), 0
        self._reset = self.create_client(Reset, "simulation/reset")
        self._pause = self.create_client(SetBool, "simulation/pause")
        self._free_arm = self.create_client(SetBool, "commander/release_arm")
        self.create_subscription(
            Time, "commander/stopped", lambda _: self._withdraw("stopped by /commander/stop"), 10
        )
        self.create_subscription(PoseStamped, "~/pointer", self._pointer.pull, 10)
        self.create_service(
            SetBool,
            "~/grip",
            partial(self._obey, lambda request: self._pointer.grip(request.data)),
        )
        self.create_service(
            Trigger, "~/done", partial(self._obey, lambda _: self._pointer.finish())
        )
        self.create_timer(LOOK, self._watch, clock=WALL)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Teach, "teach", self._teach, finish_by_success, **accept
        )
        self._diagnostics = Diagnostics(self, lambda: (OK, self._showing.phase, {}))

    # the hands

    def _on_state(self, data: bytes) -> None:
        if self._goal is None:
            return
        self._notice_a_gap()
        state = self._reader.read(data)
        if self._seen is not None and self._seen.goes_on:
            self._seen.offer(state.stamp_ns, state)
        else:
            self._answer(state)

    def _answer(self, state: ArmState, sightings: Sequence[Sighting] = ()) -> None:
        """Push the arm in a state; sightings: what the person has seen meanwhile."""
        for one in sightings:
            self._showing.see(*one)
        if state.stamp_ns != self._last_ns:
            self._notice_a_jump(state.stamp_ns)
            self._last_ns, self._speed = state.stamp_ns, max(map(abs, state.velocity.tolist()))
            self._time.goes_on()
            self._written = self._writer.write(self._try_to_push(state))
        self._wrench.publish(self._written)
        if (
            self._over is not None
            and self._ended_ns is not None
            and self._last_ns >= self._ended_ns
        ):
            self._over.keep()

    def _notice_a_jump(self, ns: int) -> None:
        """A person lets go of an arm that is suddenly elsewhere: the world was reset, or
        states got lost.
        """
        gap = 0.0 if self._last_ns is None else (ns - self._last_ns) * 1e-9
        if self._guiding and not 0.0 <= gap <= LONGEST_GAP:
            self._withdraw(
                f"the arm's time jumped by {gap:.3f} s while it was guided: did somebody reset the"
                " world?"
            )

    def _try_to_push(self, state) -> Command:
        """The push for a state; a person who does not know how to go on pushes no more, and the
        lesson ends.
        """
        try:
            return self._push(state)
        except ValueError as error:
            self._guiding = False
            if self._over is not None:
                self._over.keep(str(error))
            return Command(state.stamp_ns)

    def _push(self, state) -> Command:
        if self._begin is not None:
            situation, again = self._begin
            self._begin = None
            self._showing.begin(situation, state, again)
            self._guiding, self._begun_ns = True, state.stamp_ns
        if not self._guiding:
            return Command(state.stamp_ns)
        push = self._showing.step(state)
        if push.grip == Grip.OPEN:
            self._opened_ns = state.stamp_ns
        if self._ended_ns is None and self._showing.is_over(state):
            self._ended_ns = max(
                state.stamp_ns, self._opened_ns + round(self.p["watch_time"] * 1e9)
            )
        return push

    # another person's hands

    @staticmethod
    def _obey(what: Callable, request, response):
        """Do what is asked of the hand that is held; the answer says why that cannot be."""
        try:
            what(request)
            response.success = True
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    # the action

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None:
            self.get_logger().warning("a lesson is refused: another one is under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self._withdraw("cancelled")
        return CancelResponse.ACCEPT

    def _withdraw(self, reason: str) -> None:
        """The lesson under way goes on no more: the hands let go of the arm."""
        if self._goal is None or self._withdrawn:
            return
        self._withdrawn, self._guiding, self._begin = reason, False, None
        if self._over is not None:
            self._over.keep()

    def _notice_a_gap(self) -> None:
        """A teacher that was frozen lets go. One whose timers wait, because states come as fast as
        they can, was not.
        """
        if frozen := self._awake.frozen():
            self._withdraw(f"the teacher was held up for {frozen:.1f} s")

    def _watch(self) -> None:
        """End a lesson when a node that moves the arm has gone, or the client that asked for the
        lesson.
        """
        self._unseen = self._cameras.missing
        self._time.look()
        self._notice_a_gap()
        if self._goal is None:
            self._idle += 1
            if self._idle == LISTENS:
                self._states.rest()
            return
        for one in self._needed:
            if one.gone:
                self._withdraw(f"{one} has gone during the lesson")
        if self._guiding and self._time.stalled:
            self._withdraw(self._time.stalled)

    async def _teach(self, goal_handle) -> Teach.Result:
        self._goal, self._guiding, self._withdrawn, self._idle = goal_handle, False, "", 0
        if self._states.rests:
            self._states.go_on()
        self._needed = (
            publishers(self, JOINT_STATES),
            publishers(self, COMMANDS),
            subscribers(self, "teach/_action/feedback"),
        )
        result = Teach.Result()
        try:
            await self._lesson(goal_handle, result)
        except (CallFailed, ValueError) as error:
            result.success, result.message = False, str(error)
            self.get_logger().error(f"the lesson ends: {error}")
            await self._let_go()
        finally:
            if self._seen is not None:
                self._seen.end()
            self._goal, self._over, self._showing = None, None, self._person
            self._pointer.forget()
        return result

    async def _let_go(self) -> None:
        """After a lesson that was broken off: the commander brakes the arm, and the simulator
        waits for no teacher.
        """
        simulator, commander = (one.gone for one in self._needed[:2])
        with suppress(CallFailed):
            if not commander:
                await self._call(self._free_arm, SetBool.Request(data=False))
            for _ in range(0 if simulator or commander or not self._withdrawn else LONGEST_BRAKE):
                if self._speed < REST_SPEED or self._time.stalled:
                    break
                await pause(self, LOOK)
        with suppress(CallFailed):
            if not simulator:
                await self._call(self._reset, Reset.Request(paused=True))

    async def _lesson(self, goal_handle, result) -> None:
        situation, by_pointer = goal_handle.request.situation, goal_handle.request.by_pointer
        self._showing = self._pointer if by_pointer else self._person
        attempts = 1 if by_pointer else goal_handle.request.max_attempts or self.p["max_attempts"]
        for attempt in range(1, attempts + 1):
            result.attempts = attempt
            await self._need_cameras()
            self._feed("preparing", attempt)
            self._showing.check(situation, attempt > 1)
            await self._guided_movement(situation, attempt)
            until = self._ended_ns - ARRIVAL_NS
            outcome = result.outcome = await self._judge.outcome(
                situation, self._opened_ns, until, self._begun_ns
            )
            reason = "" if outcome.success else outcome.message or "missed"
            kept = await self._recording.stop(
                self._ended_ns - ARRIVAL_NS, bool(outcome.success), reason
            )
            self._go_on()
            if outcome.success and kept.success:
                result.success, result.message = True, "in"
                break
            result.message = kept.message or reason
            self._showing.learn_from(outcome)
        reset = Reset.Request(paused=True)
        await self._call(self._reset, reset)

    async def _guided_movement(self, situation: Situation, attempt: int) -> None:
        self._guiding, self._ended_ns, self._opened_ns, self._begun_ns = False, None, 0, 0
        await self._recording.start(lambda: self._call(self._pause, SetBool.Request(data=False)))
        await self._call(self._free_arm, SetBool.Request(data=True))
        reset = Reset.Request(
            situation=situation, paused=True, guided=True, real_time=self._showing is self._pointer
        )
        first = await self._call(self._reset, reset)
        if self._showing.watches and self._seen is not None:
            self._showing.forget()
            self._seen.begin(conversions.stamp_ns(first.stamp))
        await self._until(
            lambda: (self._last_ns or 0) >= conversions.stamp_ns(first.stamp),
            "the state after the reset",
        )
        self._go_on()
        seen = await self._look() if self._showing.looks else situation
        self._begin, self._over = (seen, attempt > 1), Promise()
        self._feed("armed", attempt)
        await self._call(self._pause, SetBool.Request(data=False))
        if self._showing is self._pointer:
            await self._until(lambda: self._pointer.guides, "the first state of a running world")
            self._feed("held", attempt)
        failure = await self._over
        self._go_on()
        await self._call(self._pause, SetBool.Request(data=True))
        await self._call(self._free_arm, SetBool.Request(data=False))
        if failure:
            raise CallFailed(failure)

    async def _look(self) -> Situation:
        """Where the person sees the bodies, in a held world that goes on for a moment."""
        end_ns = conversions.stamp_ns(
            (await self._call(self._step, Step.Request(steps=LOOK_STEPS))).stamp
        )
        await self._until(lambda: (self._last_ns or 0) >= end_ns, "the state after a look")
        return await self._eyes.look(end_ns - ARRIVAL_NS)

    async def _need_cameras(self) -> None:
        """CallFailed without cameras, once a teacher that has just been started could have found
        them.
        """
        for _ in range(FINDS_AGAIN if self._cameras.met else FINDS):
            if not self._unseen:
                return
            await pause(self, LOOK)
        raise CallFailed(f"{self._unseen}; nobody would see {self._skill.words.outcome}")

    def _go_on(self) -> None:
        """CallFailed if the lesson shall not go on."""
        if self._withdrawn:
            raise CallFailed(self._withdrawn)

    async def _until(self, condition, what: str) -> None:
        """Wait for a message that the graph has sent already; CallFailed if it does not come in 10
        s.
        """
        for _ in range(1000):
            if condition() or self._withdrawn:
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
