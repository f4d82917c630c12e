"""Practice: trial after trial, each of which is prepared, made, and given to the learner."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute, Practice
from dart_skill_msgs.msg import Plan as PlanMsg
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import AddTrial, GetPlan, Plan
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from dart_skill.arm import Grip
from dart_skill.common.situation import Situation as BodySituation
from dart_skill.skills.observation import ARRIVAL_NS
from dart_skill.skills.practice import Poses, target_choice_of
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.client.person import PersonAtTheArm
from dart_skill_nodes.client.service_calls import PATIENCE, RecorderCalls, ServiceCalls
from dart_skill_nodes.client.trial_sequence import TrialSequence
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Promise, within
from dart_skill_nodes.comms.names import pose_topic
from dart_skill_nodes.comms.qos import MatchingSubscriptions
from dart_skill_nodes.process.graph_processes import GraphFailure


class Practising:
    """Lets a skill be practised, in the name of a node.

    * name_of: names of the tracked bodies by role.
    * person: who prepares trials on a real arm; None: a simulator is reset.
    * check: raises GraphFailure if practice shall not go on.
    * unseen: gives why nothing is seen of a trial; empty if the cameras are there.
    * parameters: of the node, in force: frame_id, candidates, seed, watch_time.
    """

    def __init__(
        self,
        node: Node,
        skill: Skill,
        name_of: dict[str, str],
        calls: ServiceCalls,
        person: PersonAtTheArm | None,
        check: Callable[[], None],
        unseen: Callable[[], str],
        parameters: dict,
    ):
        self._node, self._skill, self._calls, self._person = node, skill, calls, person
        self._check, self._unseen, self._p = check, unseen, parameters
        self._choice = target_choice_of(skill, parameters["candidates"], parameters["seed"])
        self._recorder = RecorderCalls(node, calls, "start", "stop")
        self.sequence = TrialSequence(
            node, calls, parameters["frame_id"], lambda: parameters["simulated"]
        )
        self._plan = node.create_client(Plan, "skill_learner/plan")
        self._get_plan = node.create_client(GetPlan, "commander/get_plan")
        self._add_trial = node.create_client(AddTrial, "skill_learner/add_trial")
        self._sighting: Promise | None = None
        self._sighting_since_ns, self._why_not = 0, ""  # the latter: of the last one not made
        self._baskets = MatchingSubscriptions(node)
        if conversions.BASKET in name_of:
            topic = pose_topic(name_of[conversions.BASKET])
            self._baskets.subscribe(topic, self._on_basket, PoseStamped, raw=True)
        self._goal, self._result = None, Practice.Result()

    async def carry_out(self, goal_handle, result: Practice.Result) -> None:
        """All trials of a goal, which fill its result; GraphFailure or ValueError says why practice
        ends before.
        """
        self._goal, self._result, self._why_not = goal_handle, result, ""
        request = goal_handle.request
        situations, follow = list(request.situations), request.follow_bodies
        wanted = request.trials or len(situations)
        for one in situations:
            self._asked(one)
        if follow and situations:
            raise ValueError(
                "follow_bodies executes where the cameras see the bodies: give no situations"
            )
        if not wanted:
            raise ValueError("nothing to do: give a number of trials, or situations")
        for number in range(1, wanted + 1):
            if situations:
                asked = situations[(number - 1) % len(situations)]
            else:
                asked = None if follow else await self._choose()
            self._check()
            await self._one_trial(number, asked)
            self._check()
        things = self._skill.words.trials
        result.success = result.executed == wanted
        result.message = (
            f"{result.executed} of {wanted} {things} made, {result.learned} learned"
            f" from{self._why_not}"
        )

    def _asked(self, situation: Situation):
        """What the skill takes of a situation; ValueError for one that is none."""
        return conversions.asked(situation, self._skill)

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
        raise GraphFailure(
            f"{self._plan.service_name} has no plan for any of {len(situations)} baskets:"
            f" {response.message}"
        )

    async def _plan_for(self, situation: Situation) -> Plan.Response:
        """A plan for a situation, or why it has none; GraphFailure if no situation has."""
        request = Plan.Request(situation=situation)
        request.header.frame_id = self._p["frame_id"]
        response = await self._calls.call(self._plan, request, may_refuse=True)
        if not (response.success or response.unreachable):
            raise GraphFailure(f"{self._plan.service_name}: {response.message}")
        return response

    async def _why_in_vain(self, situation: Situation) -> str:
        """Why a trial in a situation would be in vain; empty if it would not."""
        try:
            for role, pose in self._asked(situation).poses.items():
                self._skill.check_seen(role, pose)
        except ValueError as error:
            return str(error)
        planned = await self._plan_for(situation)
        return "" if planned.success else planned.message

    async def _one_trial(self, number: int, situation: Situation | None) -> None:
        """situation: in which bodies are put; None: as they are seen."""
        if self._person and situation is not None:
            # before a person carries a body there
            if why := await self._why_in_vain(situation):
                frame_id = self._p["frame_id"]
                unseen = conversions.unseen_outcome_msg(situation, self._skill.name, frame_id)
                self._tell(number, unseen, self._not_made(number, situation, why))
                return
        prepare = self._prepare_with_person if self._person else self._prepare_in_simulation
        situation, stamp = await prepare(number, situation)
        self._check()
        self._feed(number, "executing")
        learns = not self._goal.request.only_execute
        made = await self.sequence.end(await self.sequence.begin(situation, stamp, explore=learns))
        is_made, message = made.code == Execute.Goal.OUTCOME_EXECUTED, made.message
        if not is_made:
            self._not_made(number, situation, message)
        else:
            self._result.executed += 1
            if unseen := self._unseen():
                raise GraphFailure(f"{self._skill.words.trial} {number} was not seen: {unseen}")
            if learns:
                self._feed(number, "learning")
                learned = "; ".join(filter(None, await self._learn_from(made, situation)))
                message = learned or message.removeprefix("executed").removeprefix("; ")
        self._tell(number, made.outcome, message)
        if self._person:
            if not is_made:
                # a person should look at the arm before it moves again
                raise GraphFailure(f"{self._skill.words.trial} {number}: {made.message}")
            told_ns = conversions.stamp_ns(made.outcome.header.stamp)
            plan = await self._executed(made)
            await self._person.bring(np.array(plan.start_posture), told_ns)

    def _not_made(self, number: int, situation: Situation, why: str) -> str:
        """A situation that the arm does not reach costs its own trial, and not those after it."""
        self._choice.give_up(self._asked(situation))
        self._why_not = f"; {self._skill.words.trial} {number}: {why}"
        return why

    def _tell(self, number: int, outcome, message: str) -> None:
        """A trial is over."""
        self._result.outcomes.append(outcome)
        self._feed(number, "done", message, outcome)

    def _feed(self, number: int, phase: str, message: str = "", outcome=None) -> None:
        feedback = Practice.Feedback(number=number, phase=phase, message=message)
        if outcome is not None:
            feedback.outcome = outcome
        self._goal.publish_feedback(feedback)

    async def _prepare_in_simulation(
        self, number: int, situation: Situation | None
    ) -> tuple[Situation, Time]:
        """Where the bodies are, and the stamp of the first state of a world that was reset for a
        trial there.
        """
        self._feed(number, "resetting")
        if not self._goal.request.only_execute:
            await self._recorder.start(lambda: self.sequence.hold(False))
        stamp = await self.sequence.reset(situation)
        if self._choice.looks:
            return await self.sequence.look(situation)
        if situation is not None:
            return situation, stamp
        if not self._skill.situated:
            return Situation(), stamp  # a board is aimed at in the middle
        place = await self._basket_seen(conversions.stamp_ns(stamp))
        return conversions.at_place(place), stamp

    async def _prepare_with_person(
        self, number: int, situation: Situation | None
    ) -> tuple[Situation, Time]:
        """The same when a person has put the bodies to their places, and the arm is where the trial
        begins.
        """
        self._person.ask = partial(self._ask, number)
        asked = BodySituation({}) if situation is None else self._asked(situation)
        ready = None
        while ready is None:
            places = await self._person.stand(asked.poses)
            planned = await self._plan_for(self._as_seen(places, asked))
            if not planned.success:
                await self._person.stand_elsewhere(places, planned.message)
                continue
            await self._person.bring(np.array(planned.plan.start_posture))
            held, role = conversions.situation(planned.held, "the learner"), self._skill.in_hand
            ready = await self._person.ready(held.pose(role) if role else None, places)
        if not self._goal.request.only_execute:
            await self._recorder.start()
        return self._as_seen(ready, asked), Time()

    def _as_seen(self, places: Poses, asked: BodySituation) -> Situation:
        """The situation with the bodies at their places, as far as a plan depends on them, and the
        numbers that are asked for.
        """
        poses = {role: pose for role, pose in places.items() if role in self._skill.situated}
        return conversions.situation_msg(BodySituation(poses, asked.numbers))

    def _ask(self, number: int, text: str) -> None:
        """Tell the person what to do, wherever they look."""
        self._node.get_logger().info(text)
        self._feed(number, "waiting", text)

    async def _basket_seen(self, since_ns: int) -> np.ndarray:
        """Where the cameras see the basket (3,), not before a stamp; a paused world is let run
        until they do.
        """
        self._sighting, self._sighting_since_ns = Promise(), since_ns
        await self.sequence.hold(False)
        seen = await within(self._node, self._sighting, PATIENCE)
        self._sighting = None
        await self.sequence.hold(True)
        if seen is None:
            raise GraphFailure(f"the basket was not seen for {PATIENCE:.0f} s: is it tracked?")
        return seen

    def _on_basket(self, data: bytes) -> None:
        if self._sighting is None or conversions.leading_stamp_ns(data) < self._sighting_since_ns:
            return
        message = conversions.decoded(data, PoseStamped)
        if message.header.frame_id == self._p["frame_id"]:
            self._sighting.keep(conversions.place(message.pose.position, "the basket"))

    async def _executed(self, made: Execute.Result) -> PlanMsg:
        """The plan that was executed; GraphFailure if the commander has it no more."""
        request = GetPlan.Request(plan_id=made.plan_id)
        return (await self._calls.call(self._get_plan, request)).plan

    async def _learn_from(self, made: Execute.Result, situation: Situation) -> Sequence[str]:
        """Give the trial to the learner; why it was not learned from, if so, and what there is to
        say of the next one.
        """
        asked, outcome = self._asked(situation), conversions.task_outcome(made.outcome)
        told_ns = conversions.stamp_ns(made.outcome.header.stamp)
        # else it is stamped when it is over
        plan = await self._executed(made)
        opens = any(event.name == conversions.WORDS[Grip.OPEN] for event in plan.events)
        watched_ns = round(self._p["watch_time"] * 1e9) if opens else 0
        cut = await self._recorder.stop(told_ns + watched_ns - ARRIVAL_NS, False, "practice")
        if not cut.success:
            return cut.message, self._choice.tell(asked, np.nan, outcome)
        cut.demonstration.id = f"{self._skill.name}_{told_ns}"
        request = AddTrial.Request(trial=cut.demonstration, plan=plan)
        told = await self._calls.call(self._add_trial, request, may_refuse=True)
        left = float(np.hypot(*told.left))
        self._result.learned += told.success
        error = left if np.isfinite(left) else outcome.error
        return told.message, self._choice.tell(asked, error, outcome)
