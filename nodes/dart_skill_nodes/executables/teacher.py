"""The teacher: a simulated person who guides the arm by its hand and elbow until a movement
succeeds.

Action /teach. While it guides, the teacher takes part in the simulator's handshake: it answers
every /joint_states once, on /wam/teacher_wrench. It sees all bodies through the motion capture
like everybody else, and starts and stops the recorder.

A lesson with `by_pointer` is given by another person: the hands follow the poses on ~/pointer, the
fingers do what ~/grip says, and ~/done ends it.
"""

from contextlib import suppress

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Teach
from dart_skill_msgs.msg import WamCommand
from geometry_msgs.msg import PoseStamped
from rclpy.action import CancelResponse, GoalResponse
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import REST_SPEED, ArmState
from dart_skill.recording import HAND
from dart_skill_nodes.arm.guiding import SHOWINGS, Hands, PointerShowing
from dart_skill_nodes.arm.lesson import Lesson
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.coroutines import (
    CoroutineActionServer,
    finish_by_success,
    pause,
    say_why_it_ended,
)
from dart_skill_nodes.comms.joint_states import StateReader, TimeOfTheArm, hear_joint_states
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES, pose_topic
from dart_skill_nodes.comms.presence import Cameras, publishers, subscribers
from dart_skill_nodes.comms.qos import COMPLETE, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.seen_in_step import SeenInStep
from dart_skill_nodes.comms.this_machine import LOOK, FreezeDetector
from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.process.node_base import OK, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, skill_of

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
        self.p = declare(self, "teacher")
        self._skill = skill = skill_of(self)
        name_of, frame_id = declare_bodies(self, (HAND, *skill.bodies)), self.p["frame_id"]
        self._person = SHOWINGS[skill.shown_by](skill, self.p)
        self._pointer = PointerShowing(skill, frame_id)
        self._goal, self._withdrawn, self._needed = None, "", ()
        self._time, self._freezes = TimeOfTheArm(self), FreezeDetector()
        calls = ServiceCalls(self)
        push = self.create_publisher(WamCommand, GUIDING, COMPLETE).publish
        self._hands = Hands(self._person, frame_id, self.p["watch_time"], push, self._withdraw)
        watches = self._person.watches
        self._seen = SeenInStep(self, name_of, frame_id, self._answer) if watches else None
        self._reader, self._idle = StateReader(), 0
        self._states = hear_joint_states(self, self._on_state, raw=True)
        cameras = Cameras(self, pose_topic(name_of[skill.moves]))
        self._lesson = Lesson(
            self,
            skill,
            calls,
            self._hands,
            self._seen,
            cameras,
            (self._person, self._pointer),
            self.p["max_attempts"],
            self.p["seed"],
            self._go_on,
        )
        self.create_subscription(
            Time, "commander/stopped", lambda _: self._withdraw("stopped by /commander/stop"), 10
        )
        self.create_subscription(PoseStamped, "~/pointer", self._pointer.pull, 10)
        self.create_service(SetBool, "~/grip", lambda asked, _: self._pointer.grip(asked.data))
        self.create_service(Trigger, "~/done", lambda *_: self._pointer.finish())
        self.create_timer(LOOK, self._watch, clock=WALL)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Teach, "teach", self._teach, finish_by_success, **accept
        )
        self._diagnostics = Diagnostics(self, lambda: (OK, self._hands.showing.phase, {}))

    # states

    def _on_state(self, data: bytes) -> None:
        if self._goal is None:
            return
        self._notice_a_gap()
        state = self._reader.read(data)
        if self._seen is not None and self._seen.goes_on:
            self._seen.offer(state.stamp_ns, state)
        else:
            self._answer(state)

    def _answer(self, state: ArmState, sightings=()) -> None:
        if self._hands.answer(state, sightings):
            self._time.goes_on()

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
        over = self._hands.over
        self._withdrawn = reason
        self._hands.let_go()
        if over is not None:
            over.keep()

    def _notice_a_gap(self) -> None:
        """A teacher that was frozen lets go. One whose timers wait, because states come as fast as
        they can, was not.
        """
        if frozen := self._freezes.frozen():
            self._withdraw(f"the teacher was held up for {frozen:.1f} s")

    def _watch(self) -> None:
        """End a lesson when a node that moves the arm has gone, or the client that asked for the
        lesson.
        """
        self._lesson.look()
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
        if self._hands.guiding and self._time.stalled:
            self._withdraw(self._time.stalled)

    async def _teach(self, goal_handle) -> Teach.Result:
        self._goal, self._withdrawn, self._idle = goal_handle, "", 0
        self._hands.let_go()
        if self._states.rests:
            self._states.go_on()
        self._needed = (
            publishers(self, JOINT_STATES),
            publishers(self, COMMANDS),
            subscribers(self, "teach/_action/feedback"),
        )
        result, was_held = Teach.Result(), self._time.is_held
        try:
            await self._lesson.give(goal_handle, result)
        except (GraphFailure, ValueError) as error:
            result.success, result.message = False, str(error)
            say_why_it_ended(self, goal_handle, f"the lesson ends: {error}")
            if self._lesson.begun:
                await self._brake()
        finally:
            if self._seen is not None:
                self._seen.end()
            # as it was found: a client that does not hold the world has the next goal carried out
            with suppress(GraphFailure):
                if self._lesson.begun and not self._needed[0].gone:
                    await self._lesson.set_anew(paused=was_held)
            self._goal, self._hands.showing = None, self._person
            self._hands.let_go()
            self._pointer.forget()
        return result

    async def _brake(self) -> None:
        """After a lesson that was broken off the commander brakes the arm."""
        simulator, commander = (one.gone for one in self._needed[:2])
        with suppress(GraphFailure):
            if not commander:
                await self._lesson.free_arm(False)
            for _ in range(0 if simulator or commander or not self._withdrawn else LONGEST_BRAKE):
                if self._hands.speed < REST_SPEED or self._time.stalled:
                    break
                await pause(self, LOOK)

    def _go_on(self) -> None:
        """GraphFailure if the lesson shall not go on."""
        if self._withdrawn:
            raise GraphFailure(self._withdrawn)


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill teacher`."""
    run(lambda: [TeacherNode()], args)


if __name__ == "__main__":
    main()
