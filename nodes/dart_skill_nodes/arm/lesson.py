"""A lesson: guided movements in one situation, each in a world that was set anew, until one succeeds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from dart_skill_msgs.action import Teach
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import Reset, Step
from rclpy.node import Node
from std_srvs.srv import SetBool

from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.arm.guiding import Hands, PointerShowing, Showing
from dart_skill_nodes.client.service_calls import OF_THE_RECORDER, RecorderCalls, ServiceCalls
from dart_skill_nodes.client.trial_sequence import LOOK_STEPS
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import pause
from dart_skill_nodes.comms.presence import Cameras
from dart_skill_nodes.comms.seen_in_step import SeenInStep
from dart_skill_nodes.comms.this_machine import LOOK
from dart_skill_nodes.process.graph_processes import GraphFailure

FINDS = 15
"""Looks for the cameras, until there are none, by a teacher that has just been started."""
FINDS_AGAIN = 4
"""Looks for the cameras by a teacher that knew some before."""


class Lesson:
    """Gives the lessons of a node.

    * hands: that guide the arm; seen: what is seen in step with its states, by a person who looks
      at the bodies all the time; cameras: without which there is no lesson.
    * showings: ways of a simulated person, and of one with a pointer.
    * most: attempts in one situation.
    * seed: of the situations that are drawn for goals that name none.
    * go_on: raises GraphFailure if the lesson under way shall not go on.

    Attribute: begun, whether the last one has moved anything; one that is refused has not.
    """

    def __init__(
        self,
        node: Node,
        skill: Skill,
        calls: ServiceCalls,
        hands: Hands,
        seen: SeenInStep | None,
        cameras: Cameras,
        showings: tuple[Showing, PointerShowing],
        most: int,
        seed: int,
        go_on: Callable[[], None],
    ):
        self._node, self._skill, self._call = node, skill, calls.call
        self._hands, self._seen, self._cameras = hands, seen, cameras
        self._person, self._pointer = showings
        self._most, self._go_on, self.begun = most, go_on, False
        self._drawing = np.random.default_rng([seed, 5])
        self._recorder, self._unseen = RecorderCalls(node, calls, *OF_THE_RECORDER), ""
        self._step = node.create_client(Step, "simulation/step")
        self._reset = node.create_client(Reset, "simulation/reset")
        self._pause = node.create_client(SetBool, "simulation/pause")
        self._free_arm = node.create_client(SetBool, "commander/release_arm")

    def look(self) -> None:
        """See whether the cameras are there. To be called every LOOK."""
        self._unseen = self._cameras.missing

    async def give(self, goal_handle, result: Teach.Result) -> None:
        """The lesson of a goal, which fills its result; GraphFailure or ValueError says why it ends."""
        self.begun = False
        request, situation = goal_handle.request, self._situation(goal_handle.request)
        showing = self._hands.showing = self._pointer if request.by_pointer else self._person
        attempts = 1 if request.by_pointer else request.max_attempts or self._most
        for attempt in range(1, attempts + 1):
            feed = partial(_feed, goal_handle, attempt)
            result.attempts = attempt
            await self._need_cameras()
            feed("preparing")
            showing.check(situation, attempt > 1)
            seen = await self._guided_movement(situation, attempt > 1, feed)
            hands, until_ns = self._hands, self._hands.ended_ns - ARRIVAL_NS
            outcome = result.outcome = await self._recorder.outcome(
                seen, hands.opened_ns, until_ns, hands.begun_ns
            )
            reason = "" if outcome.success else outcome.message or "missed"
            kept = await self._recorder.stop(until_ns, bool(outcome.success), reason)
            self._go_on()
            if outcome.success and kept.success:
                result.success, result.message = True, "in"
                return
            result.message = kept.message or reason
            showing.learn_from(outcome)

    def _situation(self, request: Teach.Goal) -> Situation:
        """The situation of a goal; one that is drawn, a new one each time, where it names none."""
        if request.situation.bodies or request.situation.names:
            return request.situation
        drawn = self._skill.draw(self._drawing)
        if request.by_pointer:
            drawn = self._skill.unhurried(drawn)
        return conversions.situation_msg(drawn)

    async def _guided_movement(
        self, situation: Situation, again: bool, feed: Callable[[str], None]
    ) -> Situation:
        """The situation in which the movement was made: as the person saw it, where they look
        first, else as asked. `hands` has the stamps.
        """
        hands, showing = self._hands, self._hands.showing
        hands.let_go()
        await self._recorder.start(lambda: self._hold(False))
        self.begun = True
        await self.free_arm(True)
        watched = showing is self._pointer
        first_ns = await self.set_anew(
            situation=situation, paused=True, guided=True, real_time=watched
        )
        if showing.watches and self._seen is not None:
            showing.forget()
            self._seen.begin(first_ns)
        await self._until(lambda: hands.newest_ns >= first_ns, "the state after the reset")
        seen = situation
        if showing.looks:  # cameras may see a world that is turned and shifted
            seen = await self._where_bodies_are()
            seen.names, seen.numbers = situation.names, situation.numbers
        over = hands.begin(seen, again)
        feed("armed")
        await self._hold(False)
        if showing is self._pointer:
            await self._until(lambda: self._pointer.guides, "the first state of a running world")
            feed("held")
        failure = await over
        self._go_on()
        await self._hold(True)
        await self.free_arm(False)
        if failure:
            raise GraphFailure(failure)
        return seen

    async def free_arm(self, free: bool) -> None:
        """Leave the arm to the hands, or hold it."""
        await self._call(self._free_arm, SetBool.Request(data=free))

    async def set_anew(self, **how) -> int:
        """The stamp of the first state of a world that is reset [ns]; how: as of Reset."""
        stamp = (await self._call(self._reset, Reset.Request(**how))).stamp
        return conversions.stamp_ns(stamp)

    async def _hold(self, held: bool) -> None:
        await self._call(self._pause, SetBool.Request(data=held))

    async def _where_bodies_are(self) -> Situation:
        """Where the person sees the bodies, in a held world that goes on for a moment."""
        stamp = (await self._call(self._step, Step.Request(steps=LOOK_STEPS))).stamp
        end_ns = conversions.stamp_ns(stamp)
        await self._until(lambda: self._hands.newest_ns >= end_ns, "the state after a look")
        return await self._recorder.look(end_ns - ARRIVAL_NS)

    async def _need_cameras(self) -> None:
        """GraphFailure without cameras, once a teacher that has just been started could have found
        them.
        """
        for _ in range(FINDS_AGAIN if self._cameras.met else FINDS):
            if not self._unseen:
                return
            await pause(self._node, LOOK)
        raise GraphFailure(f"{self._unseen}; nobody would see {self._skill.words.outcome}")

    async def _until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for a message that the graph has sent already; GraphFailure if it does not come in 10
        s, or the lesson shall not go on.
        """
        for _ in range(1000):
            self._go_on()
            if condition():
                return
            await pause(self._node, 0.01)
        raise GraphFailure(f"{what} did not arrive in 10 s")


def _feed(goal_handle, attempt: int, phase: str) -> None:
    goal_handle.publish_feedback(Teach.Feedback(phase=phase, attempt=attempt))
