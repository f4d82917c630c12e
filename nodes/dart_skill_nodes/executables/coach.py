"""The coach: lets the arm execute its skill, gives what came of it to the learner, and chooses
where it is tried next.

Action /practice. What it knows of a trial comes from the motion capture, through commander and
recorder. In a simulated world it resets before each throw; with a real arm a person puts the ball
into the hand, and the coach says when.
"""

from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute, Practice
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import AddTrial, Plan
from geometry_msgs.msg import PoseStamped
from rclpy.action import CancelResponse, GoalResponse

from dart_skill.arm import Grip
from dart_skill.recording import HAND
from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill.skills.practice import target_choice_of
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.person import Patience, PersonAtTheArm
from dart_skill_nodes.client.service_calls import PATIENCE, RecorderCalls, ServiceCalls
from dart_skill_nodes.client.trial_sequence import TrialSequence
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.arm_time import FreezeDetector
from dart_skill_nodes.comms.coroutines import (
    CoroutineActionServer,
    Promise,
    finish_by_success,
    within,
)
from dart_skill_nodes.comms.matching_qos import MatchingSubscriptions
from dart_skill_nodes.comms.names import pose_topic
from dart_skill_nodes.comms.presence import LOOK, Cameras, Presence, subscribers
from dart_skill_nodes.comms.qos import WALL
from dart_skill_nodes.comms.refusals import GuardedNode
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
    Parameter("skill", "that is practised"),
    Parameter("seed", "of the situations among which it chooses", 0, 2**31 - 1),
    Parameter("frame_id", "frame of situations"),
    Parameter("near", "nearest basket, from the base axis [m]", 0.5, 5.0),
    Parameter("far", "farthest basket [m]", 0.5, 5.0),
    Parameter("side", "largest azimuth to either side [rad]", 0.0, 3.14),
    Parameter("rim", "height of the rim [m]", 0.0, 2.0),
    Parameter("candidates", "baskets among which it chooses the next one", 1, 1000),
    Parameter(
        "watch_time", "the ball is watched so long after the hand was told to open [s]", 0.3, 5.0
    ),
    Parameter(
        "simulated",
        "a simulator is reset before each throw; else a person puts ball and basket to their"
        " places",
    ),
    Parameter("longest_wait", "for the person [s, wall clock]", 1.0, 3600.0),
    Parameter(
        "stand_back", "between the ball that rests in the hand and the throw [s]", 0.0, 60.0
    ),
    Parameter("seat_tolerance", "of the ball from its place in the hand [m]", 0.01, 0.2),
    Parameter("basket_tolerance", "of the basket from where it shall be [m]", 0.01, 0.5),
]


class CoachNode(GuardedNode):
    """Practice as an action: reset, or ask the person, throw, look, learn, and again."""

    def __init__(self):
        super().__init__("coach")
        self.p = declare(self, "coach.yaml", TABLE)
        self._skill = skill_of(self)
        self._name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        self._skill.take_world(self.p)
        self._choice = target_choice_of(self._skill, self.p["candidates"], self.p["seed"])
        self._goal, self._sighting, self._stopped = None, None, ""
        self._client: Presence | None = None  # who waits for the result
        self._cameras = Cameras(self, pose_topic(self._name_of[self._skill.moves]))
        self._awake, self._unseen = FreezeDetector(), ""
        self._calls = ServiceCalls(self)
        self._recording = RecorderCalls(self, self._calls)
        self._sequence = TrialSequence(
            self, self._calls, self.p["frame_id"], lambda: self.p["simulated"]
        )
        self._person = None if self.p["simulated"] else self._make_person()
        self.create_subscription(Time, "commander/stopped", self._on_stop, 10)
        self._plan = self.create_client(Plan, "skill_learner/plan")
        self._add_trial = self.create_client(AddTrial, "skill_learner/add_trial")
        self._baskets = MatchingSubscriptions(self)
        if conversions.BASKET in self._name_of:
            self._baskets.subscribe(
                pose_topic(self._name_of[conversions.BASKET]),
                self._on_basket,
                PoseStamped,
                raw=True,
            )
        self.create_timer(LOOK, self._watch, clock=WALL)
        accept = {"goal_callback": self._on_goal, "cancel_callback": self._on_cancel}
        self._action = CoroutineActionServer(
            self, Practice, "practice", self._practise, finish_by_success, **accept
        )
        self._diagnostics = Diagnostics(
            self, lambda: (OK, "practising" if self._goal else "waiting", {})
        )

    def _make_person(self) -> PersonAtTheArm:
        if not self._skill.practised_by_hand:
            raise ValueError(
                "with simulated:=false a person practises throws; let the skill"
                f" '{self._skill.name}' be executed (/execute)"
            )
        patience = Patience(
            *(
                self.p[name]
                for name in ("longest_wait", "stand_back", "seat_tolerance", "basket_tolerance")
            )
        )
        return PersonAtTheArm(self, self._calls, self.p["frame_id"], self._name_of, patience)

    def _asked(self, situation: Situation):
        """What the skill takes of a situation; ValueError for one that is none."""
        return conversions.asked(situation, self._skill)

    def _on_goal(self, goal) -> GoalResponse:
        if self._goal is not None:
            self.get_logger().warning("practice is refused: there is practice under way")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_cancel(self, _) -> CancelResponse:
        self._sequence.cancel()
        return CancelResponse.ACCEPT

    async def _practise(self, goal_handle) -> Practice.Result:
        self._goal = goal_handle
        result = Practice.Result()
        self._stopped = ""
        # the latter: of the last throw that was not made
        self._client, self._why_not = (
            subscribers(self, "practice/_action/feedback"),
            "",
        )
        try:
            situations = list(goal_handle.request.situations)
            for one in situations:
                self._asked(one)
            follow, wanted = (
                goal_handle.request.follow_bodies,
                goal_handle.request.trials or len(situations),
            )
            if follow and situations:
                raise ValueError(
                    "follow_bodies executes where the cameras see the bodies: give no situations"
                )
            if not wanted:
                raise ValueError("nothing to do: give a number of trials, or situations")
            if self._person:
                self._check_no_simulator()
                self._person.withdrawn = self._withdrawn
            for number in range(1, wanted + 1):
                asked = (
                    None
                    if follow
                    else (
                        situations[(number - 1) % len(situations)]
                        if situations
                        else await self._choose()
                    )
                )
                self._go_on()
                await self._one_trial(number, asked, result)
                self._go_on()
            result.success = result.executed == wanted
            result.message = (
                f"{result.executed} of {wanted} {self._things} made, {result.learned} learned"
                f" from{self._why_not}"
            )
        except (CallFailed, ValueError) as error:
            result.success, result.message = False, str(error)
            self.get_logger().error(f"practice ends: {error}")
        finally:
            self._goal = None
        return result

    def _withdrawn(self) -> str:
        """Why nothing shall be thrown any more; empty if it may. An arm that was stopped does
        not go on by itself.
        """
        return "cancelled" if self._goal.is_cancel_requested else self._stopped

    def _go_on(self) -> None:
        """CallFailed if practice shall not go on."""
        if reason := self._withdrawn():
            raise CallFailed(reason)

    def _on_stop(self, _) -> None:
        self._stopped = "the arm was stopped with /commander/stop"

    def _watch(self) -> None:
        """Practice ends when no client waits for it any more, and when this node was away for so long
        that it was given up.
        """
        frozen = self._awake.frozen()
        self._unseen = self._cameras.missing
        if self._goal is None or self._stopped:
            return
        if self._client is not None and self._client.gone:
            self._stopped = f"{self._client} has gone, who asked for practice"
        elif frozen:
            self._stopped = f"the coach was held up for {frozen:.1f} s"
        if self._stopped:
            self._sequence.cancel()

    def _check_no_simulator(self) -> None:
        """Who was told that there is no simulator, and finds one, throws nothing: one of the two
        is a mistake.
        """
        if self._sequence.reset_client.service_is_ready():
            raise CallFailed(
                "the coach was started with simulated:=false, but a simulator runs: end it, or"
                " start the coach with true"
            )

    @property
    def _things(self) -> str:
        """Trials of the skill, in a word."""
        return self._skill.words.trials

    async def _choose(self) -> Situation:
        """The situation where the skill is worst, of those for which the learner has a plan; a
        plan that needs a look comes later.
        """
        situations = [conversions.situation_msg(one) for one in self._choice.candidates()]
        if self._choice.looks or len(situations) == 1:
            return situations[0]
        for situation in situations:
            response = await self._plan_for(situation)
            if response.success:
                return situation
        raise CallFailed(
            f"{self._plan.service_name} has no plan for any of {len(situations)} baskets:"
            f" {response.message}"
        )

    async def _plan_for(self, situation: Situation) -> Plan.Response:
        """A plan for a situation, or why it has none; CallFailed if no situation has."""
        request = Plan.Request(situation=situation)
        request.header.frame_id = self.p["frame_id"]
        response = await self._calls.call(self._plan, request, may_refuse=True)
        if not (response.success or response.unreachable):
            raise CallFailed(f"{self._plan.service_name}: {response.message}")
        return response

    async def _one_trial(
        self, number: int, situation: Situation | None, result: Practice.Result
    ) -> None:
        """situation: in which bodies are put; None: as they are seen."""
        if (
            self._person
            and situation is not None
            and not (planned := await self._plan_for(situation)).success
        ):
            # before a person carries a basket there
            self._not_made(number, situation, planned.message, result)
            return
        prepare = self._prepare_with_person if self._person else self._prepare_in_simulation
        situation, stamp = await prepare(number, situation)
        self._go_on()
        self._feed(number, "executing")
        explore = not self._goal.request.only_execute
        made = await self._sequence.end(
            await self._sequence.begin(situation, stamp, explore=explore)
        )
        feedback = Practice.Feedback(
            number=number, phase="done", outcome=made.outcome, message=made.message
        )
        if made.code == Execute.Goal.OUTCOME_EXECUTED:
            result.executed += 1
            self._check_cameras(f"{self._things[:-1]} {number} was not seen: ")
            if not self._goal.request.only_execute:
                self._feed(number, "learning")
                learned = "; ".join(filter(None, await self._learn_from(made, situation, result)))
                feedback.message = learned or feedback.message.removeprefix(
                    "executed"
                ).removeprefix("; ")
        else:
            self._choice.give_up(self._asked(situation))
            self._why_not = f"; {self._things[:-1]} {number}: {made.message}"
        result.outcomes.append(made.outcome)
        self._goal.publish_feedback(feedback)
        if self._person:
            if made.code != Execute.Goal.OUTCOME_EXECUTED:
                # a person should look at the arm before it moves again
                raise CallFailed(f"throw {number}: {made.message}")
            await self._person.bring(
                np.array(made.plan.start_posture), conversions.stamp_ns(made.outcome.header.stamp)
            )

    def _not_made(
        self, number: int, situation: Situation, why: str, result: Practice.Result
    ) -> None:
        """A situation that the arm does not reach costs its own trial, and not those after it."""
        self._choice.give_up(self._asked(situation))
        self._why_not = f"; {self._things[:-1]} {number}: {why}"
        result.outcomes.append(
            conversions.unseen_outcome_msg(situation, self._skill.name, self.p["frame_id"])
        )
        self._goal.publish_feedback(
            Practice.Feedback(
                number=number, phase="done", outcome=result.outcomes[-1], message=why
            )
        )

    async def _prepare_in_simulation(
        self, number: int, situation: Situation | None
    ) -> tuple[Situation, Time]:
        """Where the bodies are, and the stamp of the first state of a world that was reset for a
        trial there.
        """
        self._feed(number, "resetting")
        if not self._goal.request.only_execute:
            await self._recording.start(lambda: self._sequence.hold(False))
        stamp = await self._sequence.reset(situation)
        if self._choice.looks:
            return await self._sequence.look()
        if situation is None:
            situation = await self._as_it_is(stamp)
        return situation, stamp

    async def _prepare_with_person(
        self, number: int, situation: Situation | None
    ) -> tuple[Situation, Time]:
        """The same when a person has put basket and ball to their places, and the arm is where the
        throw begins.
        """
        self._person.ask = partial(self._ask, number)
        while True:
            place = await self._person.basket(
                None if situation is None else conversions.target_of(situation)
            )
            planned = await self._plan_for(conversions.at_place(place))
            if not planned.success:
                await self._person.another_basket(place, planned.message)
                continue
            await self._person.bring(np.array(planned.plan.start_posture))
            if await self._person.ball(
                conversions.place_of(planned.held, "ball", "the learner"), place
            ):
                break
        if not self._goal.request.only_execute:
            await self._recording.start()
        return conversions.at_place(place), Time()

    def _ask(self, number: int, text: str) -> None:
        """Tell the person what to do, wherever they look."""
        self.get_logger().info(text)
        self._goal.publish_feedback(
            Practice.Feedback(number=number, phase="waiting", message=text)
        )

    async def _as_it_is(self, stamp: Time) -> Situation:
        """Situation of a throw at where what it is thrown at stands; a board is aimed at in the
        middle.
        """
        if not self._skill.situated:
            return Situation()
        return conversions.at_place(await self._basket_seen(conversions.stamp_ns(stamp)))

    async def _basket_seen(self, since_ns: int) -> np.ndarray:
        """Where the cameras see the basket (3,), not before a stamp; a paused world is let run
        until they do.
        """
        self._sighting = Promise()
        self._sighting_since_ns = since_ns
        await self._sequence.hold(False)
        seen = await within(self, self._sighting, PATIENCE)
        self._sighting = None
        await self._sequence.hold(True)
        if seen is None:
            raise CallFailed(f"the basket was not seen for {PATIENCE:.0f} s: is it tracked?")
        return seen

    def _on_basket(self, data: bytes) -> None:
        if self._sighting is None or conversions.leading_stamp_ns(data) < self._sighting_since_ns:
            return
        message = conversions.decoded(data, PoseStamped)
        if message.header.frame_id == self.p["frame_id"]:
            self._sighting.keep(conversions.place(message.pose.position, "the basket"))

    async def _learn_from(
        self, made: Execute.Result, situation: Situation, result: Practice.Result
    ) -> tuple[str, str]:
        """Give the trial to the learner; why it was not learned from, if so, and what there is to
        say of the next one.
        """
        asked, outcome = self._asked(situation), conversions.task_outcome(made.outcome)
        told_ns = conversions.stamp_ns(made.outcome.header.stamp)
        # else it is stamped when it is over
        opens = any(event.name == conversions.WORDS[Grip.OPEN] for event in made.plan.events)
        watched_ns = round(self.p["watch_time"] * 1e9) if opens else 0
        cut = await self._recording.stop(told_ns + watched_ns - ARRIVAL_NS, False, "practice")
        if not cut.success:
            return cut.message, self._choice.tell(asked, np.nan, outcome)
        cut.demonstration.id = f"{self._skill.name}_{told_ns}"
        request = AddTrial.Request(trial=cut.demonstration, plan=made.plan)
        told = await self._calls.call(self._add_trial, request, may_refuse=True)
        left = float(np.hypot(*told.left))
        result.learned += told.success
        return told.message, self._choice.tell(
            asked, left if np.isfinite(left) else outcome.error, outcome
        )

    def _check_cameras(self, what: str = "") -> None:
        """CallFailed without cameras: nothing is seen of a throw then, and nothing is learned from
        it.
        """
        if self._unseen:
            raise CallFailed(f"{what}{self._unseen}")

    def _feed(self, number: int, phase: str) -> None:
        self._goal.publish_feedback(Practice.Feedback(number=number, phase=phase))


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill coach`."""
    run(lambda: [CoachNode()], args)


if __name__ == "__main__":
    main()
