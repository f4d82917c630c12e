"""A lesson that a person gives on the page with the mouse: from the ball that is dragged to
/teacher/pointer, and what became of it.
"""

from collections.abc import Callable, Mapping

import numpy as np
from dart_skill_msgs.action import Teach
from dart_skill_msgs.srv import DropDemonstration, ListDemonstrations
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND
from dart_skill.skills.protocol import Skill
from dart_skill.view import DemonstrationRow, HeldHand, Panel, Request, how_far, turned
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.client.viewer_jobs import ViewerJobs
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import pause, start
from dart_skill_nodes.process.graph_processes import GraphFailure

LOOKS = 30
"""Times that the learner is asked for the newest demonstration."""
LONGEST = 120.0
"""The longest that the learner may take to compare all demonstrations [s, wall clock]."""
HELD = "held"
"""Phase of a lesson from when on the hand may be pulled."""


class PulledLesson:
    """Obeys what the page asks of a hand that is held, and shows how far it is to go.

    jobs: which of them is under way; hand, panel: of the page; skill: that is shown; quick: called
    with whether a person holds the hand, who wants to see at once what it does.
    """

    def __init__(
        self,
        node: Node,
        jobs: ViewerJobs,
        hand: HeldHand,
        panel: Panel,
        skill: Skill,
        frame_id: str,
        quick: Callable[[bool], None],
    ):
        assert panel.holding is not None
        self._node, self._jobs, self._hand, self._skill = node, jobs, hand, skill
        self._panel, self._controls = panel, panel.holding
        self._calls, self._message = ServiceCalls(node), PoseStamped()
        self._message.header.frame_id = frame_id
        self._quick = quick
        self._seen: dict[str, Pose] = {}
        self._may_pull = False  # since the teacher has said so
        self._base = self._turned = np.array([0.0, 0.0, 0.0, 1.0])
        self._goal: Pose | None = None
        self._pointer = node.create_publisher(PoseStamped, "teacher/pointer", 10)
        self._grip = node.create_client(SetBool, "teacher/grip")
        self._done = node.create_client(Trigger, "teacher/done")
        self._list = node.create_client(ListDemonstrations, "skill_learner/demonstrations")
        self._drop = node.create_client(DropDemonstration, "skill_learner/drop_demonstration")
        self._asked: dict[str, Callable[[Mapping], None]] = {
            "pull": self._pull, "turn": self._turn, "look": lambda values: self._hand.look(**values), "discard": lambda _: jobs.cancel(),
            "grip": lambda values: self._ask(self._tell(self._grip, SetBool.Request(data=bool(values["closes"])))),
            "done": lambda _: self._ask(self._tell(self._done, Trigger.Request())),
            "undo": lambda _: self._ask(self._undo()),
        }  # fmt: skip
        jobs.add("hold", self._hold)
        jobs.when_over(self._over)

    def obeys(self, request: Request) -> bool:
        """Whether that is for the hand that is held; then it is done."""
        if request.what not in self._asked:
            return False
        self._asked[request.what](request.values)
        return True

    # what is seen

    def see(self, poses: Mapping[str, np.ndarray]) -> None:
        """The newest poses (7,) of hand and bodies, by role."""
        self._seen |= {role: Pose(pose[:3], pose[3:]) for role, pose in poses.items()}
        self._take_hold()
        if self._hand.held and self._goal is not None and self._skill.moves in self._seen:
            lies = self._goal.sees(self._seen[self._skill.moves])
            self._controls.say_where(
                f"the {self._skill.moves} is {how_far(lies.position, lies.rotation)}"
            )

    def hear(self, phase: str) -> None:
        """The phase of the lesson under way."""
        if phase == HELD and self._jobs.job == "hold":
            self._may_pull = True
            self._take_hold()

    def _take_hold(self) -> None:
        """Once the hand may be pulled, and is seen: a world that was held may not have been seen
        yet.
        """
        if not self._may_pull or self._hand.held or HAND not in self._seen:
            return
        hand = self._seen[HAND]
        self._base = self._turned = hand.quaternion
        self._hand.take(hand.position)
        self._controls.set_held(True)
        self._quick(True)
        if self._goal is not None:
            self._hand.show_goal(self._goal.position, self._goal.quaternion)

    # what is asked for

    async def _hold(self) -> str:
        """A lesson in a new situation, which the person on the page gives."""
        situation = self._skill.unhurried(conversions.situation(self._jobs.situations(1)[0]))
        self._goal = self._goal_of(situation)
        self._seen.pop(HAND, None)  # where it was before the world is reset
        self._jobs.say("take the ball at the hand", False)
        result = await self._jobs.carry_out(
            "teach", Teach.Goal(situation=conversions.situation_msg(situation), by_pointer=True)
        )
        if not result.success:
            raise GraphFailure(f"not kept: {result.message}")
        return f"kept: {1e3 * result.outcome.error:.1f} mm off"

    def _goal_of(self, situation: Situation) -> Pose | None:
        """Where the body shall go, if the skill says so."""
        try:
            return self._skill.goal(situation)
        except ValueError:
            return None

    def _pull(self, values: Mapping) -> None:
        if self._hand.held:
            conversions.set_pose(self._message.pose, values["place"], self._turned)
            self._pointer.publish(self._message)

    def _turn(self, values: Mapping) -> None:
        self._turned = turned(self._base, float(values["degrees"]))
        self._pull({"place": self._hand.pointer})

    async def _tell(self, client, request) -> str:
        await self._calls.call(client, request)
        return ""

    async def _undo(self) -> str:
        """The newest demonstration that counts is left out."""
        counting = [one for one in await self._demonstrations(compare=False) if not one.dropped]
        if not counting:
            raise GraphFailure("there is no demonstration to undo")
        answer = await self._calls.call(self._drop, DropDemonstration.Request(id=counting[-1].id))
        await self._show()
        return str(answer.message)

    def _ask(self, routine) -> None:
        start(self._node, routine, self._jobs.tell)

    # what became of it

    def _over(self, job: str) -> None:
        """A job of the page has ended: what was shown, and how it counts, may have changed."""
        self._may_pull = False
        self._hand.let_go()
        if self._controls.held:
            self._controls.set_held(False)
            self._quick(False)
        if job == "learn":
            start(self._node, self._show(compare=True), self._jobs.tell)

    def heard(self) -> None:
        """There is a new demonstration."""
        start(self._node, self._show(compare=False), self._jobs.tell)

    async def _show(self, compare: bool = False) -> str:
        """A line for each demonstration on the page."""
        heard = await self._demonstrations(compare)
        self._controls.show([_row(one) for one in heard])
        return ""

    async def _demonstrations(self, compare: bool) -> list:
        for _ in range(LOOKS):  # the newest may still be on its way to the learner
            answer = await self._calls.call(self._list, ListDemonstrations.Request())
            if len(answer.demonstrations) >= self._jobs.heard():
                break
            await pause(self._node, 0.1)
        if compare:
            answer = await self._calls.call(
                self._list, ListDemonstrations.Request(compare=True), patience=LONGEST
            )
        return list(answer.demonstrations)


def _row(one) -> DemonstrationRow:
    counts = bool(one.readable and not one.dropped)
    seconds = conversions.seconds(one.duration)
    return DemonstrationRow(
        one.id, one.finding, seconds, counts, one.weight, one.unlike, bool(one.outlier)
    )
