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
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import (
    DropDemonstration,
    Learn,
    ListDemonstrations,
    ModelFile,
    StopDemonstration,
)
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.client import Client
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.world import the_world
from dart_skill_nodes.client.failures import GraphFailure
from dart_skill_nodes.client.server_probe import APPEARS, ServerProbe
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.client.trial_sequence import TrialSequence, TrialUnderWay
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import start
from dart_skill_nodes.comms.names import DIAGNOSTICS, full_name, in_graph, nodes_there
from dart_skill_nodes.comms.presence import LOOK, Presence, be_alive, servers
from dart_skill_nodes.comms.this_machine import ENDING, running
from dart_skill_nodes.process.graph_processes import START
from dart_skill_nodes.process.node_base import make_executor

ASK_AGAIN = 0.1
"""The client asks again after this time, when a server let it wait [s, wall clock]."""


class GraphClient:
    """Blocking calls for scripts and tests; `dead` tells of a process of the graph that has ended,
    empty if all run.

    namespace: of the graph, as "/arm1"; that of the process by default. patience, appears: for an
    answer, and for a server to appear [s, wall clock]. throw_seconds (2,): all throws so
    far, simulated and on the wall clock [s].
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
        self._executor, self._dead, self._patience, self._appears = (
            make_executor(),
            dead,
            patience,
            appears,
        )
        self._executor.add_node(self.node)
        self._teach = ActionClient(self.node, Teach, "teach")
        self._practice = ActionClient(self.node, Practice, "practice")
        self._learn = self.node.create_client(Learn, "skill_learner/learn")
        self._sequence = TrialSequence(self.node, ServiceCalls(self.node), the_world().frame_id)
        self._links: dict[object, ServerProbe] = {}
        self._setters: dict[str, Client] = {}
        self._taught, self.throw_seconds = 0, np.zeros(2)
        # when the simulator told its steps last [s, wall clock]
        self.simulated_steps, self.counted_at = (
            0,
            time.monotonic(),
        )
        self.node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)

    def close(self) -> None:
        """Take the client's node off the graph.

        The executor goes first: an EventsExecutor keeps what it serves alive, and a node that was
        only removed from it goes on publishing.
        """
        self._executor.shutdown()
        self.node.destroy_node()

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
        self._reach_action(self._sequence.action_client, "execute", limit)
        if teacher:
            self._reach_action(self._teach, "teach", limit)

    def wait_for_learner(self, limit: float = START) -> None:
        """Wait for the learner, as in a replay without an arm; GraphFailure if there is none."""
        self.reach(self._learn, limit)

    def reach(self, client, limit: float | None = None) -> None:
        """Wait until a client of the node can ask its service and is answered; GraphFailure if it
        is not served.

        Each client has a link of its own, made after it: an older link says nothing of whether the
        server has found a younger client. limit: default: the client's patience where there is a
        server, and as long as one may take to be found where there is none.
        """
        self._up(client, client.service_name, client.service_is_ready, limit)

    def _reach_action(self, client: ActionClient, name: str, limit: float | None = None) -> None:
        self._up(client, f"{name}/_action/send_goal", client.server_is_ready, limit)

    def _up(
        self, client: object, service: str, is_ready: Callable[[], bool], limit: float | None
    ) -> None:
        link = self._links.get(client) or self._links.setdefault(
            client, ServerProbe(self.node, service, is_ready)
        )
        begun = time.monotonic()
        while not link.up():
            waited = time.monotonic() - begun
            if (
                link.is_hopeless(waited, self._patience, self._appears)
                if limit is None
                else waited > limit
            ):
                raise GraphFailure(link.why)
            self.spin()

    def teach(self, target: np.ndarray) -> Teach.Result:
        """Guided throws at one basket until one goes in."""
        return self.show(conversions.at_place(target))

    def show(self, situation: Situation) -> Teach.Result:
        """A movement that is guided in one situation until it succeeds."""
        self._reach_action(self._teach, "teach")
        handle, server = self._accepted(
            self._teach.send_goal_async(Teach.Goal(situation=situation)), "teach"
        )
        result = self.wait(handle.get_result_async(), "the lesson", needed=server).result
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
        loader = self.node.create_client(ModelFile, "skill_learner/load")
        response = self.call(loader, ModelFile.Request(path=str(model.resolve())))
        return response.model_id

    def save(self, model: Path) -> str:
        """Write the learner's model, with what practice has found, to a file that is not there
        yet; its id. GraphFailure says why not.
        """
        saver = self.node.create_client(ModelFile, "skill_learner/save")
        return self.call(saver, ModelFile.Request(path=str(model.resolve()))).model_id

    def release_arm(self, free: bool) -> None:
        """Leave a real arm to the hands of a person, or hold it where it is; GraphFailure if that
        cannot be now.
        """
        self.call(
            self.node.create_client(SetBool, "commander/release_arm"), SetBool.Request(data=free)
        )

    def start_demonstration(self) -> None:
        """From now on what the sensors see may become a demonstration; GraphFailure says what is
        silent.
        """
        self.call(
            self.node.create_client(Trigger, "demonstration_recorder/start"), Trigger.Request()
        )

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
        client = self.node.create_client(ListDemonstrations, "skill_learner/demonstrations")
        return self.call(
            client, ListDemonstrations.Request(configuration=configuration, compare=compare)
        )

    def drop(self, name: str, restore: bool = False) -> str:
        """Leave a demonstration out of what is learned next, or let it count again; GraphFailure
        if there is none of this name.
        """
        client = self.node.create_client(DropDemonstration, "skill_learner/drop_demonstration")
        return self.call(client, DropDemonstration.Request(id=name, restore=restore)).message

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
        return self._asked(client, GetParameters.Request(names=[name])).values[0]

    def throw(self, target: np.ndarray) -> Execute.Result:
        """One throw at a basket that is put there, from a world that is reset."""
        return self.execute(conversions.at_place(target))

    def execute(self, situation: Situation, look: bool = False) -> Execute.Result:
        """One movement in a situation in which bodies are put, from a world that is reset; look:
        it is planned for what the cameras see.
        """
        under_way = self._begin(situation, look)
        begun, over = time.monotonic(), Future()
        under_way.over.when_kept(lambda: over.set_result(None))
        self.wait(over, "the movement", needed=servers(self.node, "execute/_action/send_goal"))
        took = time.monotonic() - begun
        outcome = self.carry_out(self._sequence.end(under_way), "the movement")
        self.throw_seconds += conversions.seconds(outcome.duration), took
        return outcome

    def _begin(self, situation: Situation, look: bool = False) -> TrialUnderWay:
        stamp = self.carry_out(self._sequence.reset(situation), "the reset")
        if look:
            situation, stamp = self.carry_out(self._sequence.look(), "a look at the bodies")
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
        self._reach_action(self._practice, "practice")
        sent = self._practice.send_goal_async(
            goal, feedback_callback=lambda message: on_feedback(message.feedback)
        )
        handle, server = self._accepted(sent, "practice")
        result = handle.get_result_async()
        try:
            return self.wait(result, "practice", patience=np.inf, needed=server).result
        except KeyboardInterrupt:
            handle.cancel_goal_async()
            self.wait(result, "the end of practice", needed=server)
            raise

    def set_parameters(self, node: str, values: dict[str, float]) -> None:
        """Set numbers of a node; GraphFailure if it refuses one."""
        if node not in self._setters:
            self._setters[node] = self.node.create_client(SetParameters, f"{node}/set_parameters")
        client = self._setters[node]
        self.reach(client)
        request = SetParameters.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
            ]
        )
        for name, result in zip(values, self._asked(client, request).results, strict=True):
            if not result.successful:
                raise GraphFailure(
                    f"{node} does not take {name} = {values[name]}: {result.reason}"
                )

    def call(self, client, request, may_refuse: bool = False):
        """Response of a service; GraphFailure if it says no, unless it may."""
        self.reach(client)
        response = self._asked(client, request)
        if not response.success and not may_refuse:
            raise GraphFailure(f"{client.service_name}: {response.message}")
        return response

    def _call_while_pending(self, client, request):
        """Response of a service that may say that its answer is pending: asked again until it does
        not, or the patience is over.
        """
        until = time.monotonic() + self._patience
        while (
            response := self.call(client, request, may_refuse=True)
        ).pending and time.monotonic() < until:
            self._rest()
        return response

    def carry_out(self, coroutine: Coroutine, what: str):
        """Result of a coroutine of the node's; GraphFailure when it fails, a process died or the
        patience is over.
        """
        done = Future()
        start(
            self.node,
            coroutine,
            lambda value, error: (
                done.set_exception(error) if error is not None else done.set_result(value)
            ),
        )
        return self.wait(done, what)

    def wait(
        self, future, what: str, patience: float | None = None, needed: Presence | None = None
    ):
        """Result of a future; GraphFailure when a process died, a node that is needed for it has
        gone, or the patience is over.
        """
        patience = self._patience if patience is None else patience
        begun = looked = time.monotonic()
        while not future.done():
            self.spin()
            now = time.monotonic()
            if now - begun > patience:
                raise GraphFailure(f"{what} took longer than {patience:.0f} s")
            if needed is not None and now - looked > LOOK:
                looked = now
                if needed.gone and not future.done():
                    raise GraphFailure(
                        f"{needed} has gone before the end of {what}: start it again"
                    )
        return future.result()

    def _asked(self, client, request):
        """Response of a service that was reached."""
        return self.wait(
            client.call_async(request),
            client.service_name,
            needed=servers(self.node, client.service_name),
        )

    def spin(self) -> None:
        """Let messages come in for a moment."""
        if dead := self._dead():
            raise GraphFailure(dead)
        self._executor.spin_once(timeout_sec=0.1)

    def _rest(self) -> None:
        """Let messages come in until it is worth asking again."""
        again = time.monotonic() + ASK_AGAIN
        while time.monotonic() < again:
            self.spin()

    def _accepted(self, sent, what: str) -> tuple[ClientGoalHandle, Presence]:
        """Handle of a goal that was sent, and its server."""
        what = full_name(self.node, what)
        server = servers(self.node, f"{what}/_action/send_goal")
        handle = self.wait(sent, what, needed=server)
        if not handle.accepted:
            raise GraphFailure(f"{what} refused the goal: another one is under way")
        return handle, server

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if in_graph(self.node, status.name) == "wam_simulator":
                values = {pair.key: pair.value for pair in status.values}
                self.simulated_steps, self.counted_at = (
                    int(values.get("steps", self.simulated_steps)),
                    time.monotonic(),
                )
