"""What the controls of the live view set in motion: lessons, learning, throws, practice, the
basket, stopping. One job at a time.
"""

import itertools
from collections.abc import Callable

import numpy as np
from dart_skill_msgs.action import Execute, Practice, Teach
from dart_skill_msgs.msg import Outcome, Situation
from dart_skill_msgs.srv import Learn, PlaceBody, Step
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger

from dart_skill.common.regions import Region
from dart_skill.skills.practice import TEACH
from dart_skill.skills.protocol import Skill, SkillWords
from dart_skill.view import Panel, Request
from dart_skill_nodes.client.node_inspector import NodeInspector
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.client.trial_sequence import TrialSequence
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import pause, start
from dart_skill_nodes.process.graph_processes import GraphFailure

LONGEST_JOB = 86_400.0
"""Longest practice or lesson [s, wall clock]."""
LOOK_STEPS = 20
"""Steps of a world that is held, in which the cameras see that the basket was moved: more than
their latency.
"""
TO_PRESS = {
    TEACH: "press Teach, then Learn",
    "call /commander/reset": "press Reset after a stop",
}
"""Remedies of nodes, and the buttons of the page for them."""
SEEN_WITHIN, SEEN_AFTER = 0.02, 3.0
"""A basket that was put somewhere is seen so near to the place [m], within so long [s, wall
clock].
"""


class ViewerJobs:
    """Obeys requests of the panel as routines of `node`.

    panel: says what goes on, and shows whether a job is under way; seen: gives where the basket is
    seen (3,), or None; heard: number of demonstrations that were published. skill: in
    whose situations something is taught and tried. job: name of the one under way, empty: none;
    progress: how far it is, such as "lesson 3 of 5".
    """

    def __init__(
        self,
        node: Node,
        region: Region,
        seed: int,
        frame_id: str,
        panel: Panel,
        seen: Callable[[], np.ndarray | None],
        heard: Callable[[], int],
        skill: Skill,
    ):
        self._node, self._region, self._frame_id = node, region, frame_id
        self._rng, self._skill, self._has_basket = (
            np.random.default_rng([seed, 7]),
            skill,
            conversions.BASKET in skill.bodies,
        )
        self.say, self._show_busy, self._threw = panel.say, panel.set_busy, panel.add_throw
        self._seen, self.heard = seen, heard
        self._calls = ServiceCalls(node)
        self.inspector = NodeInspector(node, self._calls)
        self.job, self._handle, self._stopping, self._said = "", None, False, ""
        self.progress, self._wanted_trials = "", 0
        self._wanted, self._placing, self._placed_at = None, False, None
        self._when_over: Callable[[str], None] = lambda job: None
        self._actions = {
            name: ActionClient(node, kind, name)
            for name, kind in (("teach", Teach), ("practice", Practice))
        }
        self._learn = node.create_client(Learn, "skill_learner/learn")
        self._sequence = TrialSequence(node, self._calls, frame_id)
        self._step = node.create_client(Step, "simulation/step")
        self._place = node.create_client(PlaceBody, "simulation/place_body")
        self._stop = node.create_client(Trigger, "commander/stop")
        self._reset = node.create_client(Trigger, "commander/reset")
        self._jobs = {
            "teach": self._teach,
            "learn": self._learn_from_all,
            "throw": self._throw,
            "practice": self._practise,
        }

    def add(self, what: str, job: Callable) -> None:
        """A further job, a routine, for requests of that name."""
        self._jobs[what] = job

    def when_over(self, callback: Callable[[str], None]) -> None:
        """Call with the name of each job that has ended."""
        self._when_over = callback

    def cancel(self) -> None:
        """What is under way ends, and nothing else is stopped."""
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def obey(self, request: Request) -> None:
        """Begin what was asked for; refuse a second job while there is one."""
        what, values = request.what, request.values
        if what == "place_basket":
            self._wanted = values["place"]
            if not self._placing:
                self._placing = True
                start(self._node, self._place_basket(), self._placed)
        elif what == "stop":
            start(self._node, self._stop_all(), self.tell)
        elif what == "reset":
            start(self._node, self._free_arm(), self.tell)
        elif what == "set":
            start(self._node, self._set(**values), self.tell)
        elif self.job:
            self.say(f"{what} has to wait: {self.job} is under way", True)
        else:
            self._begin(what, values)

    # jobs

    def _begin(self, what: str, values) -> None:
        self.job, self._stopping, self._said = what, False, ""
        self._show_busy(True)
        start(self._node, self._jobs[what](**values), self._ended)

    def _ended(self, text, error: Exception | None) -> None:
        ended = self.job
        self.job = ""
        self._handle = None
        self.progress, self._wanted_trials = "", 0
        self._show_busy(False)
        self.tell(text, error)
        self._when_over(ended)

    def _say_once(self, text: str) -> None:
        if text != self._said:
            self._said = text
            self.say(text, False)

    def tell(self, text, error: Exception | None) -> None:
        """What came of a routine, on the page."""
        if error is not None and not isinstance(error, GraphFailure | ValueError):
            self._node.get_logger().error(f"{type(error).__name__}: {error}")
        if error is not None or text:
            self.say(_to_press(str(error)) if error is not None else text, error is not None)

    async def _teach(self, demonstrations: int) -> str:
        shown = 0
        for situation in self.situations(2 * demonstrations):
            if shown == demonstrations or self._stopping:
                break
            self.progress = f"lesson {shown + 1} of {demonstrations}"
            self.say(self.progress, False)
            result = await self.carry_out("teach", Teach.Goal(situation=situation))
            shown += bool(result.success)
        then = ", stopped" if self._stopping else ". Next: press Learn" if shown else ""
        return f"{shown} of {demonstrations} demonstrations shown{then}"

    def trial_in_words(self, what: str, number: int) -> str:
        """Such as "throw 3 of 10"; without the second number where another client asked for them."""
        return f"{what} {number}" + (
            f" of {self._wanted_trials}" if self._wanted_trials >= number else ""
        )

    def situations(self, n: int) -> list[Situation]:
        """In which something is shown."""
        if self._has_basket:
            return [conversions.at_place(target) for target in self._region.spread(n, self._rng)]
        return [conversions.situation_msg(one) for one in self._skill.draws(self._rng, n)]

    async def _learn_from_all(self, configuration: str) -> str:
        request = Learn.Request(configuration=configuration, at_least=self.heard())
        for _ in range(200):
            response = await self._calls.call(self._learn, request, may_refuse=True)
            if not response.pending:
                break
            await pause(self._node, 0.1)
        if not response.success:
            raise GraphFailure(response.message)
        return f"{response.message}. Next: press {self._skill.words.do}"

    async def _throw(self) -> str:
        if not self._has_basket:
            # the coach draws a situation, or chooses what to aim at
            result = await self._practice(1, False, only_throw=True)
            return (
                in_words(result.outcomes[-1], self._skill.words)
                if result.success
                else result.message
            )
        target = await self._target()
        if not self._sequence.reset_client.service_is_ready():
            # a person puts the ball into the hand: the coach says when
            return await self._practise(1, True, only_throw=True)
        first_stamp = await self._sequence.reset()
        under_way = await self._sequence.begin(
            conversions.at_place(target),
            first_stamp,
            lambda phase: self._say_once(phase.replace("_", " ")),
        )
        result = await self._sequence.end(under_way)
        if result.code != Execute.Goal.OUTCOME_EXECUTED:
            raise GraphFailure(f"no throw: {result.message}")
        return self._judge(result.outcome)

    def _judge(self, outcome) -> str:
        self._threw(float(outcome.error) if outcome.seen else float("nan"), bool(outcome.success))
        return in_words(outcome, self._skill.words)

    async def _practise(self, throws: int, follow_basket: bool, only_throw: bool = False) -> str:
        return (await self._practice(throws, follow_basket, only_throw)).message

    async def _practice(
        self, throws: int, follow_basket: bool, only_throw: bool
    ) -> Practice.Result:
        self._wanted_trials = throws
        goal = Practice.Goal(trials=throws, follow_bodies=follow_basket, only_execute=only_throw)
        result = await self.carry_out("practice", goal)
        if not result.success and not self._stopping:
            raise GraphFailure(result.message)
        return result

    # the basket

    async def _place_basket(self) -> None:
        while self._wanted is not None:
            place = self._wanted
            self._wanted = None
            if not self._place.service_is_ready():
                raise GraphFailure(
                    "the basket is not moved from here: nobody serves /simulation/place_body"
                )
            await self._calls.call(
                self._place,
                PlaceBody.Request(body=conversions.BASKET, pose=conversions.pose_at(place)),
            )
            # refused while the world runs anyway
            await self._calls.call(self._step, Step.Request(steps=LOOK_STEPS), may_refuse=True)
            self._placed_at = place

    def _placed(self, _, error: Exception | None) -> None:
        self._placing, self._wanted = False, None
        self.tell("", error)

    async def _target(self) -> np.ndarray:
        """Where the basket is seen (3,), if it was just moved only when that has been seen."""
        for k in itertools.count():
            seen, placed = self._seen(), self._placed_at
            if (
                seen is not None
                and not self._placing
                and (placed is None or np.linalg.norm(seen - placed) < SEEN_WITHIN)
            ):
                self._placed_at = None
                return seen
            if k * 0.02 > SEEN_AFTER:
                break
            await pause(self._node, 0.02)
        self._placed_at = None
        if seen is None:
            raise GraphFailure(
                "no basket is seen: is the motion capture running, and is a basket tracked?"
            )
        return seen

    # the rest

    async def _stop_all(self) -> str:
        self._stopping = True
        self._sequence.cancel()
        self.cancel()
        if not self._stop.service_is_ready():
            raise GraphFailure("nobody serves /commander/stop: is the commander running?")
        await self._calls.call(self._stop, Trigger.Request())
        return "stopped. Look at the arm, then press Reset after a stop"

    async def _free_arm(self) -> str:
        await self._calls.call(self._reset, Trigger.Request())
        return "the arm may move again"

    async def _set(self, node: str, name: str, value: float) -> str:
        await self.inspector.set(node, name, value)
        return f"{name} = {value:g}"

    async def carry_out(self, name: str, goal):
        """Result of an action's goal; GraphFailure if its server goes away."""

        def sent(handle) -> None:
            self._handle = handle

        try:
            return await self._calls.act(self._actions[name], name, goal, LONGEST_JOB, sent)
        finally:
            self._handle = None


def _to_press(text: str) -> str:
    """What nodes say is to be called, as what is to be pressed on the page."""
    for called, pressed in TO_PRESS.items():
        text = text.replace(called, pressed)
    return text


def in_words(outcome: Outcome, words: SkillWords) -> str:
    """What became of a trial. words: of its skill."""
    (unit, per_metre), done = words.unit, words.done if outcome.success else words.failed
    return (
        f"{done}, {per_metre * outcome.error:.1f} {unit} {words.off}"
        if outcome.seen
        else f"{done}, {words.unseen}"
    )
