"""The graph under test: started, taught, hurt in one place at one moment, watched meanwhile, and asked to work again."""

import signal
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
from dart_skill_msgs.action import Throw
from dart_skill_msgs.msg import WamCommand
from rcl_interfaces.srv import GetParameters
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from dart_skill.recording.bags import check_bag, recover
from dart_skill.regions import targets_for
from dart_skill.robot import wam_description
from dart_skill_nodes.client.failures import CallFailed, GraphFailure
from dart_skill_nodes.client.graph_client import GraphClient
from dart_skill_nodes.comms.raw_batches import RawBatches
from dart_skill_nodes.process.graph_processes import LAYOUTS, Graph, parameters_of
from dart_skill_nodes.verbs.faults.cases import HELD_UP, HOLD_UP, KILL, Case
from dart_skill_nodes.verbs.faults.reactions import Reaction

SEED = 0
SWINGS = 1.5
"""Joint speed that only a throw reaches: approaches are slower [rad/s]."""
STANDS_NS = 700_000_000
"""Without a new state for so long the time of the arm stands still [ns, wall clock]."""
SETTLE = 1.0
"""The arm is watched so long after the client's answer [s, wall clock]."""
PATIENCE = 30.0
"""A client without an answer after so long has none [s, wall clock]."""
BACK = 60.0
"""For a node that was started again, and for each thing that is then tried [s, wall clock]."""
PUSHERS = {"/wam/command": "commander", "/wam/teacher_wrench": "teacher"}
EXTRA = ("recorder", "viewer")
REPLAYED = LAYOUTS["replay"]
LOOKED_AT = 20
"""One of so many commands is looked at."""
FAILURES = (GraphFailure, CallFailed, ValueError)


class ArmMeter:
    """How fast and how strong the joints were, and who pushed, since `clear`."""

    def __init__(self, client: GraphClient):
        self._batches = RawBatches(client.node)
        for topic in ("/joint_states", *PUSHERS):
            self._batches.listen(topic)
        self._seen = dict.fromkeys(PUSHERS, 0)
        self._stamp, self.newest_ns = (0, 0), 0
        self.clear()

    @property
    def speed(self) -> float:
        """Of the fastest joint now [rad/s]; none where the arm's time stands still."""
        return self.last if time.time_ns() - self.newest_ns < STANDS_NS else 0.0

    def clear(self) -> None:
        """Forget what was."""
        self.fastest = self.strongest = self.last = 0.0
        self.pushed: set[str] = set()

    def take(self) -> None:
        """Look at what has come."""
        for message in self._batches.take():
            if message.topic == "/joint_states":
                state = deserialize_message(message.data, JointState)
                self.last = float(np.abs(state.velocity).max())
                self.fastest = max(self.fastest, self.last)
                self.strongest = max(self.strongest, float(np.abs(state.effort).max()))
                stamp = (state.header.stamp.sec, state.header.stamp.nanosec)
                if stamp != self._stamp:  # the simulator repeats a state that nobody answers
                    self._stamp, self.newest_ns = stamp, message.received_ns
                continue
            self._seen[message.topic] += 1
            if self._seen[message.topic] % LOOKED_AT == 0:
                command = deserialize_message(message.data, WamCommand)
                if np.abs(command.joint_torque).max() > 0.0 or _force(command) > 0.0:
                    self.pushed.add(PUSHERS[message.topic])

    def close(self) -> None:
        """Hear nothing any more."""
        self._batches.close()


def _force(command: WamCommand) -> float:
    force = command.wrench.force
    return abs(force.x) + abs(force.y) + abs(force.z)


class WatchedClient(GraphClient):
    """A client that does something else, too, whenever it lets messages come in; it knows no process of the graph, as a stranger's."""

    def __init__(self) -> None:
        self.meanwhile: list[Callable[[], None]] = []
        super().__init__(name="faults", patience=PATIENCE)

    def spin(self) -> None:
        super().spin()
        for look in self.meanwhile:
            look()


class Bench:
    """One graph, on which cases are tried one after the other until one leaves it broken."""

    layout = "processes"

    def __init__(self, folder: Path):
        self._folder, self._graph, self._bags = folder, Graph(folder / "logs"), 0
        self._bag_of: dict[str, Path] = {}
        self.client = WatchedClient()
        self.meter = ArmMeter(self.client)
        self.client.meanwhile.append(self.meter.take)
        self._planning = False
        kind = Throw.Impl.FeedbackMessage
        self.client.node.create_subscription(kind, "/throw/_action/feedback", self._on_feedback, 10)
        self._shown, (self._target,) = targets_for(SEED, 2, 1)

    def close(self) -> None:
        """End all processes."""
        self.meter.close()
        self.client.close()
        for process in self._graph.processes.values():
            process.send_signal(signal.SIGCONT)
        self._graph.stop()

    # the graph

    def start(self) -> None:
        """Start everything, and teach it."""
        self.client.wait_until_gone((*LAYOUTS[self.layout], *EXTRA))
        for node in (*LAYOUTS[self.layout], *EXTRA):
            self._start(node)
        self.client.wait_until_ready()
        for target in self._shown:
            lesson = self.client.teach(target)
            if not lesson.success:
                raise GraphFailure(f"the bench has no lesson: {lesson.message}")
        self.client.learn()
        self.client.throw(self._target)
        self.usual = (0.0, float(wam_description().of_joints("peak_torque").max()))
        self._learn_what_is_usual()

    def _learn_what_is_usual(self) -> None:
        """Lessons differ: how fast the arm was in what went without a fault since the meter was cleared."""
        self.usual = (max(self.usual[0], self.meter.fastest), self.usual[1])

    def _start(self, node: str) -> None:
        parameters = parameters_of(node, self.layout, SEED, str(self._new_bag(node)))
        if node == "wam_simulator":
            parameters["speed_factor"] = 1.0  # moments are hit, and the meter keeps up
        if node == "recorder":
            parameters["bag"] = str(self._bag_of[node])
        if node == "viewer":
            parameters["port"] = 0
        self._graph.start(node, parameters)

    def _new_bag(self, node: str) -> Path:
        self._bags += 1
        self._bag_of[node] = self._folder / f"{node}_{self._bags}"
        return self._bag_of[node]

    def _on_feedback(self, message) -> None:
        self._planning = self._planning or message.feedback.phase == "planning"

    # a case

    def run(self, case: Case) -> Reaction:
        """Try one case."""
        hurt = _Hurt(self._graph, case, self._is_time(case))
        self._planning = False
        self.meter.take()
        self.meter.clear()
        hold_planning = case.phase == "planning" and case.node != "skill_learner"
        if case.phase == "planning":
            self._signal("skill_learner", signal.SIGSTOP)
        watch = [hurt.look, *([lambda: hurt.at and self._signal("skill_learner", signal.SIGCONT)] if hold_planning else [])]
        hurt.on_hurt = self.meter.clear
        self.client.meanwhile += watch
        try:
            if case.phase == "idle":
                hurt.now()
            succeeded, answer, asked = self._try(lambda: self._job(case))
            answered = time.monotonic()
            self._let_come(SETTLE)
            if case.goes_on and succeeded:
                self._learn_what_is_usual()
        finally:
            for one in watch:
                self.client.meanwhile.remove(one)
        if not hurt.at:
            raise GraphFailure(f"{case.name}: its moment never came: {answer}")
        seconds = max(0.0, answered - max(hurt.at, asked))
        measured = self.meter.fastest, self.meter.strongest, self.meter.speed, tuple(sorted(self.meter.pushed))
        if case.phase == "planning":
            self._signal("skill_learner", signal.SIGCONT)
        begun = time.monotonic()
        bag = self._mend(case)
        self.meter.clear()
        afterwards = self._works_again(case)
        self._learn_what_is_usual()
        return Reaction(case, succeeded, answer, seconds, *measured, bag, afterwards, time.monotonic() - begun)

    def _is_time(self, case: Case) -> Callable[[], bool]:
        if case.phase in ("lesson", "swing", "practice"):
            return lambda: self.meter.last > SWINGS
        if case.phase == "planning":
            return lambda: self._planning
        return lambda: True

    def _job(self, case: Case) -> str:
        """What the client asks for; what it is told, in words. GraphFailure if it comes to nothing."""
        if case.phase == "lesson" or (case.phase == "idle" and case.node == "teacher"):
            return self._lesson()
        if case.phase == "practice" or (case.phase == "idle" and case.node == "coach"):
            return self._practice()
        if case.phase == "learning" or (case.phase == "idle" and case.node == "skill_learner"):
            return self.client.learn().message
        return self._throw()

    def _lesson(self) -> str:
        lesson = self.client.teach(self._shown[0])
        if not lesson.success:
            raise GraphFailure(lesson.message)
        return lesson.message

    def _practice(self) -> str:
        messages = []
        practised = self.client.practise(targets=[self._target], on_feedback=lambda feedback: messages.append(feedback.message))
        if not practised.success or practised.learned < practised.thrown:
            raise GraphFailure("; ".join([practised.message, *filter(None, messages)]))
        return practised.message

    def _throw(self) -> str:
        thrown = self.client.throw(self._target)
        if thrown.code != Throw.Goal.OUTCOME_THROWN or not thrown.outcome.landing_seen:
            seen = "" if thrown.outcome.landing_seen else "; landing not seen"
            raise GraphFailure(thrown.message + seen)
        return thrown.message

    def _try(self, job: Callable[[], str]) -> tuple[bool, str, float]:
        """Whether a job succeeded, what the client was told, and when it asked."""
        asked = time.monotonic()
        try:
            return True, job(), asked
        except FAILURES as failure:
            return False, str(failure), asked

    # afterwards

    def _mend(self, case: Case) -> str:
        """Start a killed node again, let a frozen one go on; what is wrong with the bag of a killed recorder."""
        if case.fault != KILL:
            self._signal(case.node, signal.SIGCONT)
            return ""
        wrong = self._check_bag(case.node) if case.node in ("recorder", "demonstration_recorder") else ""
        self._start(case.node)
        return wrong

    def _check_bag(self, node: str) -> str:
        killed = self._bag_of[node]
        recovered = recover(killed, killed.with_name(f"{killed.name}_recovered"))
        errors = [str(finding) for finding in check_bag(recovered.path) if finding.severity == "error"]
        if errors or not sum(recovered.messages.values()):
            return f"its bag is not whole: {errors or 'no message'}"
        return ""

    def _works_again(self, case: Case) -> str:
        """Why teaching, learning, throwing and practising do not work again within BACK; empty if they do.

        Tried again: whoever was frozen has to end what it did when it was.
        """
        until = time.monotonic() + BACK
        while (why := self._tries_all(case)) and time.monotonic() < until:
            self._let_come(SETTLE)
        return why

    def _tries_all(self, case: Case) -> str:
        try:
            asked = self.client.node.create_client(GetParameters, f"/{case.node}/get_parameters")
            self.client.reach(asked, BACK)
            self.client.wait_until_ready(BACK)
            self._hurry(True)
            self._lesson() if case.phase == "lesson" or case.node == "teacher" else None
            self.client.learn(at_least=2)
            self._throw()
            self._practice() if case.phase == "practice" or case.node == "coach" else None
            self._hurry(False)
        except FAILURES as failure:
            return f"does not work again: {failure}"
        return ""

    def _hurry(self, hurry: bool) -> None:
        """Time as fast as it can go, or so that moments are hit and the meter keeps up."""
        self.client.set_parameters("/wam_simulator", {"speed_factor": 0.0 if hurry else 1.0})

    def _let_come(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.client.spin()

    def _signal(self, node: str, number: signal.Signals) -> None:
        process = self._graph.processes.get(node)
        if process is not None and process.poll() is None:
            process.send_signal(number)


class _Hurt:
    """Does to a node what the case says, when it is time."""

    def __init__(self, graph: Graph, case: Case, is_time: Callable[[], bool]):
        self._graph, self._case, self._is_time = graph, case, is_time
        self.at, self._held, self.on_hurt = 0.0, False, lambda: None

    def look(self) -> None:
        """Whenever something may have come."""
        if not self.at and self._is_time():
            self.now()
        if self._held and time.monotonic() - self.at > HELD_UP:
            self._held = False
            self._graph.processes[self._case.node].send_signal(signal.SIGCONT)

    def now(self) -> None:
        """Do it."""
        process = self._graph.processes[self._case.node]
        self.at = time.monotonic()
        if self._case.fault == KILL:
            del self._graph.processes[self._case.node]
            process.kill()
            process.wait()
        else:
            process.send_signal(signal.SIGSTOP)
        self._held = self._case.fault == HOLD_UP
        self.on_hurt()


class ReplayBench(Bench):
    """A graph that replays a bag: player, recorder and learner."""

    layout = "replay"

    def __init__(self, folder: Path, bag: Path):
        self._played = bag
        super().__init__(folder)

    def start(self) -> None:
        self.client.wait_until_gone(REPLAYED)
        self.usual = (0.0, 0.0)

    def run(self, case: Case) -> Reaction:
        """Each case replays the bag from its beginning, on a graph of its own."""
        for node in REPLAYED:
            self._start(node)
        self.client.wait_for_learner()
        hurt = _Hurt(self._graph, case, lambda: self.meter.fastest > SWINGS)
        self.meter.clear()
        self.client.meanwhile.append(hurt.look)
        try:
            until = time.monotonic() + BACK
            while not hurt.at and time.monotonic() < until:
                self.client.spin()
            succeeded, answer, asked = self._try(lambda: self.client.demonstrations().message)
        finally:
            self.client.meanwhile.remove(hurt.look)
        seconds, begun = time.monotonic() - asked, time.monotonic()
        bag = self._mend(case)
        if case.node == "demonstration_recorder" and case.fault == KILL:
            self._graph.processes.pop("bag_player").kill()  # who records anew wants the bag from its beginning
            self._start("bag_player")
        afterwards = self._learns()
        self._graph.stop()
        self.client.wait_until_gone(REPLAYED)
        return Reaction(case, succeeded, answer, seconds, 0.0, 0.0, 0.0, (), bag, afterwards, time.monotonic() - begun)

    def _start(self, node: str) -> None:
        parameters = parameters_of(node, "replay", bag=str(self._new_bag(node)), played=str(self._played), rate=4.0)
        self._graph.start(node, parameters)

    def _learns(self) -> str:
        try:
            self.client.wait_for_learner(BACK)
            self.client.learn(at_least=2)
        except FAILURES as failure:
            return f"does not work again: {failure}"
        return ""


def run_all(cases: list[Case], folder: Path, played: Path, say: Callable[[str], None]) -> tuple[list[Reaction], tuple[float, float]]:
    """Reactions to cases; and the speed of the joints without a fault, and the torque that the arm has at most.

    played: the bag for the cases of a replay. A graph that does not work again is replaced.
    """
    reactions: list[Reaction] = []
    usual, left = (0.0, 0.0), list(cases)
    for attempt in range(1, len(cases) + 2):
        if not left:
            break
        replay = left[0].phase == "replay"
        here = folder / f"graph_{attempt}"
        with closing(ReplayBench(here, played) if replay else Bench(here)) as bench:
            bench.start()
            while left and (left[0].phase == "replay") == replay:
                reactions.append(bench.run(left.pop(0)))
                usual = (max(usual[0], bench.usual[0]), max(usual[1], bench.usual[1]))
                wrong = "; ".join(reactions[-1].faults(usual))
                say(f"{reactions[-1].case.name}: {reactions[-1].seconds:.1f} s: {reactions[-1].answer}: {wrong or 'ok'}")
                if reactions[-1].afterwards:
                    break
    return reactions, usual
