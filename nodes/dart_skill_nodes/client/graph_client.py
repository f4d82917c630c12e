"""A client of the graph: teaches, learns and throws through actions and services, one call after
the other.
"""

import os
import time
from collections.abc import Callable, Coroutine, Iterable
from pathlib import Path

import numpy as np
import rclpy
from dart_skill_msgs.action import Execute, Practice, Teach
from dart_skill_msgs.msg import Plan, Situation
from dart_skill_msgs.srv import (
    DropDemonstration,
    GetPlan,
    Learn,
    ListDemonstrations,
    ModelFile,
    StopDemonstration,
)
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.client import Client
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.world import the_world
from dart_skill_nodes.client.service_calls import APPEARS, ServiceCalls
from dart_skill_nodes.client.trial_sequence import TrialSequence, TrialUnderWay
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import Deadlines, start
from dart_skill_nodes.comms.names import DIAGNOSTICS, full_name, in_graph, nodes_there
from dart_skill_nodes.comms.presence import be_alive
from dart_skill_nodes.comms.this_machine import ENDING, running
from dart_skill_nodes.process.graph_processes import START, GraphFailure
from dart_skill_nodes.process.node_base import make_executor

ASK_AGAIN = 0.1
"""Time after which the client asks again, when a server let it wait [s, wall clock]."""
FOREVER = 1e8
"""Longest practice [s, wall clock]."""


class BlockingCalls:
    """Calls of services and actions by a node of its own, one after the other; `dead` tells of a
    process of the graph that has ended, empty if all run.

    namespace: of the node, as "/arm1"; that of the process by default. patience, appears: for an
    answer, and for a server to appear [s, wall clock].
    """

    def __init__(
        self,
        dead: Callable[[], str] = lambda: "",
        name: str = "client",
        patience: float = 180.0,
        appears: float = APPEARS,
        namespace: str = "",
    ):
        self.node = rclpy.create_node(name, namespace=namespace or None)
        be_alive(self.node)
        self._executor, self._dead, self._patience = make_executor(), dead, patience
        self._executor.add_node(self.node)
        self._deadlines = Deadlines(self.node, by_hand=True)
        self._calls = ServiceCalls(self.node, patience, appears)
        self._setters: dict[str, Client] = {}

    def close(self) -> None:
        """Take the client's node off the graph.

        The executor goes first: an EventsExecutor keeps what it serves alive, and a node that was
        only removed from it goes on publishing.
        """
        self._executor.shutdown()
        self.node.destroy_node()

    def reach(self, client, limit: float | None = None, action: str = "") -> None:
        """Wait until a client of the node can ask its service, or action, and is answered;
        GraphFailure if it is not served.

        limit: default: the client's patience where there is a server, and as long as one may take
        to be found where there is none.
        """
        self.carry_out(self._calls.reach(client, action, limit), "a server")

    def set_parameters(self, node: str, values: dict[str, float]) -> None:
        """Set numbers of a node; GraphFailure if it refuses one."""
        if node not in self._setters:
            self._setters[node] = self.node.create_client(SetParameters, f"{node}/set_parameters")
        request = SetParameters.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        for name, result in zip(
            values, self.call(self._setters[node], request).results, strict=True
        ):
            if not result.successful:
                raise GraphFailure(
                    f"{node} does not take {name} = {values[name]}: {result.reason}"
                )

    def call(self, client, request, may_refuse: bool = False):
        """Response of a service; GraphFailure if it says no, unless it may."""
        return self.carry_out(self._calls.call(client, request, may_refuse), client.service_name)

    def ask(self, kind, service: str, request):
        """Response of a service that is asked now and then."""
        return self.call(self.node.create_client(kind, service), request)

    def carry_out(self, coroutine: Coroutine, what: str):
        """Result of a coroutine of the node's; GraphFailure when it fails, or a process died."""
        return self.wait(self._started(coroutine), what, patience=np.inf)

    def _started(self, coroutine: Coroutine) -> Future:
        done = Future()
        start(
            self.node,
            coroutine,
            lambda value, error: (
                done.set_exception(error) if error is not None else done.set_result(value)
            ),
        )
        return done

    def wait(self, future, what: str, patience: float | None = None):
        """Result of a future; GraphFailure when a process died, or the patience is over."""
        patience = self._patience if patience is None else patience
        begun = time.monotonic()
        while not future.done():
            self.spin()
            if time.monotonic() - begun > patience:
                raise GraphFailure(f"{what} took longer than {patience:.0f} s")
        return future.result()

    def spin(self) -> None:
        """Let messages come in for a moment."""
        if dead := self._dead():
            raise GraphFailure(dead)
        self._executor.spin_once(timeout_sec=max(0.0, min(0.1, self._deadlines.left)))
        self._deadlines.resume()


class GraphClient(BlockingCalls):
    """What a graph offers, for scripts and tests.

    teach_action, practice_action: clients of these actions. throw_seconds (2,): all throws so far,
    simulated and on the wall clock [s]. simulated_steps: of the simulator, as it told last, and
    counted_at when that was [s, wall clock].
    """

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.teach_action = ActionClient(self.node, Teach, "teach")
        self.practice_action = ActionClient(self.node, Practice, "practice")
        self._learn = self.node.create_client(Learn, "skill_learner/learn")
        self._sequence = TrialSequence(self.node, self._calls, the_world().frame_id)
        self._taught, self.throw_seconds = 0, np.zeros(2)
        self.simulated_steps, self.counted_at = 0, time.monotonic()
        self.node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)

    def wait_until_gone(self, nodes: Iterable[str], limit: float = 30.0) -> None:
        """Wait until none of these nodes is on the graph; GraphFailure names those that stay.

        A process that was killed, or whose farewell got lost, stays on the graph until its
        participant's lease is over. Its services look ready, and take requests that will never
        be answered. One whose process lives is not waited for like that.
        """
        nodes, begun = set(nodes), time.monotonic()
        while there := sorted((nodes & nodes_there(self.node)) | (alive := self.running(nodes))):
            if time.monotonic() > begun + (min(limit, ENDING) if alive else limit):
                domain = os.environ.get("ROS_DOMAIN_ID", "0")
                raise GraphFailure(
                    f"{', '.join(there)} on ROS domain {domain} already: end it, or set"
                    " ROS_DOMAIN_ID to another number"
                )
            self.spin()

    def running(self, nodes: Iterable[str]) -> set[str]:
        """Those of some nodes that a process of this machine has, whether DDS has found them or
        not.
        """
        names = {full_name(self.node, name): name for name in nodes}
        return {names[one] for one in running(names)}

    def wait_until_ready(self, limit: float = START, teacher: bool = True) -> None:
        """Wait for every action and service; GraphFailure names what is silent."""
        for client in (self._learn, self._sequence.reset_client, self._sequence.pause_client):
            self.reach(client, limit)
        self.reach(self._sequence.action_client, limit, "execute")
        if teacher:
            self.reach(self.teach_action, limit, "teach")

    def wait_for_learner(self, limit: float = START) -> None:
        """Wait for the learner, as in a replay without an arm; GraphFailure if there is none."""
        self.reach(self._learn, limit)

    def teach(self, target: np.ndarray) -> Teach.Result:
        """Guided throws at one basket until one goes in."""
        return self.show(conversions.at_place(target))

    def show(self, situation: Situation) -> Teach.Result:
        """A movement that is guided in one situation until it succeeds."""
        goal = Teach.Goal(situation=situation)
        act = self._calls.act(self.teach_action, "teach", goal, self._patience)
        result = self.carry_out(act, "the lesson")
        self._taught += result.success
        if result.success:
            self.call(self._sequence.pause_client, SetBool.Request(data=True))
        return result

    def learn(
        self,
        bag: str = "",
        configuration: str = "",
        at_least: int | None = None,
        without: Iterable[str] = (),
    ) -> Learn.Response:
        """Learn from the demonstrations heard, at least so many (default: those taught), or from a
        bag; GraphFailure says why nothing was learned. without: ids of demonstrations that are
        left out.
        """
        at_least = (0 if bag else self._taught) if at_least is None else at_least
        request = Learn.Request(
            bag=bag, configuration=configuration, at_least=at_least, without=list(without)
        )
        response = self._call_while_pending(self._learn, request)
        if not response.success:
            raise GraphFailure(f"{self._learn.service_name}: {response.message}")
        return response

    def load(self, model: Path) -> str:
        """Plan with a model of a file from now on; its id. GraphFailure says why the learner
        refuses it.
        """
        return self._of_file("load", model)

    def save(self, model: Path) -> str:
        """Write the learner's model, with what practice has found, to a file that is not there
        yet; its id. GraphFailure says why not.
        """
        return self._of_file("save", model)

    def _of_file(self, what: str, model: Path) -> str:
        request = ModelFile.Request(path=str(model.resolve()))
        return self.ask(ModelFile, f"skill_learner/{what}", request).model_id

    def release_arm(self, free: bool) -> None:
        """Leave a real arm to the hands of a person, or hold it where it is; GraphFailure if that
        cannot be now.
        """
        self.ask(SetBool, "commander/release_arm", SetBool.Request(data=free))

    def start_demonstration(self) -> None:
        """From now on what the sensors see may become a demonstration; GraphFailure says what is
        silent.
        """
        self.ask(Trigger, "demonstration_recorder/start", Trigger.Request())

    def stop_demonstration(self) -> StopDemonstration.Response:
        """What was recorded since the start, kept as a demonstration if there is a throw in it;
        poses that are late are waited for.
        """
        client = self.node.create_client(StopDemonstration, "demonstration_recorder/stop")
        return self._call_while_pending(client, StopDemonstration.Request(keep=True))

    def demonstrations(
        self, configuration: str = "", compare: bool = False
    ) -> ListDemonstrations.Response:
        """What the learner has heard, and what can be made of it; compare: also how unlike the
        others each is.
        """
        request = ListDemonstrations.Request(configuration=configuration, compare=compare)
        return self.ask(ListDemonstrations, "skill_learner/demonstrations", request)

    def drop(self, name: str, restore: bool = False) -> str:
        """Leave a demonstration out of what is learned next, or let it count again; GraphFailure
        if there is none of this name.
        """
        request = DropDemonstration.Request(id=name, restore=restore)
        return self.ask(DropDemonstration, "skill_learner/drop_demonstration", request).message

    def is_simulated(self, limit: float = START) -> bool:
        """Whether the coach of the graph resets a simulator before each throw; GraphFailure if
        there is no coach to say so.
        """
        return self._of_coach("simulated", limit).bool_value

    def skill(self, limit: float = START) -> str:
        """The skill of the graph; GraphFailure if there is no coach to say so."""
        return self._of_coach("skill", limit).string_value

    def _of_coach(self, name: str, limit: float) -> ParameterValue:
        client = self.node.create_client(GetParameters, "coach/get_parameters")
        self.reach(client, limit)
        return self.call(client, GetParameters.Request(names=[name])).values[0]

    def throw(self, target: np.ndarray) -> Execute.Result:
        """One throw at a basket that is put there, from a world that is reset."""
        return self.execute(conversions.at_place(target))

    def execute(self, situation: Situation, look: bool = False) -> Execute.Result:
        """One movement in a situation in which bodies are put, from a world that is reset; look:
        it is planned for what the cameras see.
        """
        under_way = self.begin(situation, look)
        begun = time.monotonic()
        outcome = self.carry_out(self._sequence.end(under_way), "the movement")
        self.throw_seconds += conversions.seconds(outcome.duration), time.monotonic() - begun
        return outcome

    def executed_plan(self, made: Execute.Result) -> Plan:
        """The plan that was executed; GraphFailure if the commander has it no more."""
        return self.ask(GetPlan, "commander/get_plan", GetPlan.Request(plan_id=made.plan_id)).plan

    def begin(self, situation: Situation, look: bool = False) -> TrialUnderWay:
        """The same, once the arm moves."""
        stamp = self.carry_out(self._sequence.reset(situation), "the reset")
        if look:
            situation, stamp = self.carry_out(
                self._sequence.look(situation), "a look at the bodies"
            )
        return self.carry_out(
            self._sequence.begin(situation, stamp), "the beginning of the movement"
        )

    def practise(
        self,
        throws: int = 0,
        targets: Iterable[np.ndarray] = (),
        follow_basket: bool = False,
        only_throw: bool = False,
        on_feedback=lambda feedback: None,
        situations: Iterable[Situation] = (),
    ) -> Practice.Result:
        """Own throws that are learned from, or only thrown; without targets the coach chooses
        them, or throws where it sees the basket.

        situations: the same as targets, of any skill.

        on_feedback: called with each feedback. Ctrl-C cancels the throws, on the arm too.
        """
        goal = Practice.Goal(
            trials=throws, situations=[*situations, *map(conversions.at_place, targets)]
        )
        goal.follow_bodies, goal.only_execute = follow_basket, only_throw
        sent: list = []
        result = self._started(
            self._calls.act(
                self.practice_action, "practice", goal, FOREVER, sent.append, on_feedback
            )
        )
        try:
            return self.wait(result, "practice", patience=np.inf)
        except KeyboardInterrupt:
            if sent:
                sent[0].cancel_goal_async()
                self.wait(result, "the end of practice")
            raise

    def _call_while_pending(self, client, request):
        """Response of a service that may say that its answer is pending: asked again until it does
        not, or the patience is over.
        """
        until = time.monotonic() + self._patience
        while (
            response := self.call(client, request, may_refuse=True)
        ).pending and time.monotonic() < until:
            again = time.monotonic() + ASK_AGAIN
            while time.monotonic() < again:
                self.spin()
        return response

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if in_graph(self.node, status.name) == "wam_simulator":
                values = {pair.key: pair.value for pair in status.values}
                self.simulated_steps = int(values.get("steps", self.simulated_steps))
                self.counted_at = time.monotonic()
