"""The coach: lets the arm execute its skill, gives what came of it to the learner, and chooses
where it is tried next.

Action /practice. What it knows of a trial comes from the motion capture, through commander and
recorder. In a simulated world it resets before each trial; with a real arm a person puts the bodies
to their places, and the coach says when.
"""

from contextlib import suppress

from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Practice
from rclpy.action import CancelResponse, GoalResponse

from dart_skill.recording import HAND
from dart_skill_nodes.client.person import PersonAtTheArm
from dart_skill_nodes.client.practice import Practising
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms.coroutines import (
    CoroutineActionServer,
    finish_by_success,
    say_why_it_ended,
)
from dart_skill_nodes.comms.joint_states import TimeOfTheArm
from dart_skill_nodes.comms.names import pose_topic
from dart_skill_nodes.comms.presence import Cameras, Presence, subscribers
from dart_skill_nodes.comms.qos import WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.this_machine import LOOK, FreezeDetector
from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.process.node_base import OK, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, skill_of


class CoachNode(GuardedNode):
    """Practice as an action: reset, or ask the person, execute, look, learn, and again."""

    def __init__(self):
        super().__init__("coach")
        self.p = declare(self, "coach")
        self._skill = skill_of(self)
        self._name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        self._skill.take_world(self.p)
        self._goal, self._stopped, self._unseen = None, "", ""
        self._client: Presence | None = None  # who waits for the result
        self._cameras = Cameras(self, pose_topic(self._name_of[self._skill.moves]))
        self._time, self._freezes = TimeOfTheArm(self), FreezeDetector()
        calls = ServiceCalls(self)
        self._person = None
        if not self.p["simulated"]:
            self._person = PersonAtTheArm(self, self._skill, calls, self._name_of, self.p)
        self._practising = Practising(
            self,
            self._skill,
            self._name_of,
            calls,
            self._person,
            self._go_on,
            lambda: self._unseen,
            self.p,
        )
        self.create_subscription(Time, "commander/stopped", self._on_stop, 10)
        self.create_timer(LOOK, self._watch, clock=WALL)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Practice, "practice", self._practise, finish_by_success, **accept
        )
        self._diagnostics = Diagnostics(
            self, lambda: (OK, "practising" if self._goal else "waiting", {})
        )

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None:
            self.get_logger().warning("practice is refused: there is practice under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self._practising.sequence.cancel()
        return CancelResponse.ACCEPT

    async def _practise(self, goal_handle) -> Practice.Result:
        self._goal, self._stopped = goal_handle, ""
        self._client = subscribers(self, "practice/_action/feedback")
        result, was_held = Practice.Result(), self._time.is_held
        try:
            if self._person:
                self._check_no_simulator()
                self._person.withdrawn = self._withdrawn
            await self._practising.carry_out(goal_handle, result)
        except (GraphFailure, ValueError) as error:
            result.success, result.message = False, str(error)
            say_why_it_ended(self, goal_handle, f"practice ends: {error}")
        finally:
            # as it was found: a client that does not hold the world has the next goal carried out
            with suppress(GraphFailure):
                await self._practising.sequence.hold(was_held)
            self._goal = None
        return result

    def _withdrawn(self) -> str:
        """Why nothing shall be thrown any more; empty if it may. An arm that was stopped does
        not go on by itself.
        """
        return "cancelled" if self._goal.is_cancel_requested else self._stopped

    def _go_on(self) -> None:
        """GraphFailure if practice shall not go on."""
        if reason := self._withdrawn():
            raise GraphFailure(reason)

    def _on_stop(self, _) -> None:
        self._stopped = "the arm was stopped with /commander/stop"

    def _watch(self) -> None:
        """Practice ends when no client waits for it any more, and when this node was away for so long
        that it was given up.
        """
        frozen = self._freezes.frozen()
        self._unseen = self._cameras.missing
        if self._goal is None or self._stopped:
            return
        if self._client is not None and self._client.gone:
            self._stopped = f"{self._client} has gone, who asked for practice"
        elif frozen:
            self._stopped = f"the coach was held up for {frozen:.1f} s"
        if self._stopped:
            self._practising.sequence.cancel()

    def _check_no_simulator(self) -> None:
        """Who was told that there is no simulator, and finds one, executes nothing: one of the two
        is a mistake.
        """
        if self._practising.sequence.reset_client.service_is_ready():
            raise GraphFailure(
                "the coach was started with simulated:=false, but a simulator runs: end it, or"
                " start the coach with true"
            )


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill coach`."""
    run(lambda: [CoachNode()], args)


if __name__ == "__main__":
    main()
