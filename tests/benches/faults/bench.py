"""The graph under test: started, taught, given a fault in one place at one moment, watched
meanwhile, and asked to work again.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Situation
from rcl_interfaces.srv import GetParameters
from std_msgs.msg import String
from std_srvs.srv import Trigger

from dart_skill.arm import Speed, the_arm
from dart_skill.cli.graph_verbs import CHECKOUT
from dart_skill.common.regions import targets_for
from dart_skill.recording.bags import check_bag, recover
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.client.graph_client import GraphClient
from dart_skill_nodes.comms.conversions import at_place, situation_msg
from dart_skill_nodes.comms.qos import LATCHED
from dart_skill_nodes.process.graph_processes import (
    LAYOUTS,
    Graph,
    GraphFailure,
    parameters_of,
)
from tests.benches.faults.arm_meter import ArmMeter
from tests.benches.faults.cases import (
    ATTACK,
    BYSTANDERS,
    COACH,
    CORRUPT,
    DEMONSTRATIONS,
    FREEZE,
    FULL_DISK,
    GARBAGE,
    KILL,
    LEARNER,
    MOMENTS,
    OF_NODES,
    OF_TOPICS,
    RECORDER,
    SIMULATOR,
    TEACHER,
    THROW_SKILL,
    VIEWER,
    Case,
)
from tests.benches.faults.injection import FaultInjection
from tests.benches.faults.reactions import AT_REST, Reaction
from tests.benches.faults.small_disk import SmallDisk
from tests.benches.faults.stranger import DONE, NAME, ORDERS

SEED = 0
SWINGS = 1.5
"""Joint speed that only a throw reaches: approaches are slower [rad/s]."""
MOVES = 0.2
"""The same of a careful movement."""
LESSONS = 4.0
"""Speed of the fastest joint before the wrist in the thirteen lessons of bags/demonstrations
[rad/s].
"""
ENOUGH = 2
"""Demonstrations that are learned from."""
LESSONS_OF_A_SKILL = 5
"""From fewer a dart's swing may come to the end of a joint's range."""
SETTLE, RESTS = 1.0, 0.5
"""The arm is watched so long after the client's answer, or until it has rested for the latter [s,
wall clock].
"""
PATIENCE = 180.0
"""A client without an answer after so long has none [s, wall clock]."""
BACK = 120.0
"""For a node that was started again, and for each thing that is then tried [s, wall clock]."""
KNOWN = 1.0
"""An attack that was begun is known to all after so long [s, wall clock]."""
REPLAYED = LAYOUTS["replay"]
UNDECODABLE = "messages are no "
"""In a finding of `check_bag`: bytes that are not of their topic's type."""
FAILURES = (GraphFailure, ValueError)
BEHIND = "_behind_the_stranger"
"""What a topic is called by its publisher when the stranger stands before it."""


class WatchedClient(GraphClient):
    """A client that does something else, too, whenever it lets messages come in; it knows no
    process of the graph, as a stranger's.
    """

    def __init__(self) -> None:
        self.meanwhile: list[Callable[[], None]] = []
        super().__init__(name="faults", patience=PATIENCE)

    def spin(self) -> None:
        super().spin()
        for look in self.meanwhile:
            look()


class Bench:
    """One graph, on which cases are tried one after the other until one leaves it broken.

    extra: nodes besides those of the layout that are there from the start; others of BYSTANDERS
    are started when a case needs them. speed: of simulated time in a case, 0: as fast as it goes.
    skill: that it learns.
    """

    layout = "processes"

    def __init__(
        self,
        folder: Path,
        extra: tuple[str, ...] = (RECORDER, VIEWER),
        speed: float = 1.0,
        skill: str = THROW_SKILL,
    ):
        self._speed, self._skill = speed, load_skill(skill)
        self._enough = ENOUGH if skill == THROW_SKILL else LESSONS_OF_A_SKILL
        self._moves = SWINGS if self._skill.speed == Speed.THROW else MOVES
        self._folder, self._graph, self._bags, self._extra = (
            folder,
            Graph(folder / "logs"),
            0,
            extra,
        )
        self._bag_of: dict[str, Path] = {}
        self._spoiled: set[Path] = set()  # bags that hold what a stranger sent and is no message
        self._disk: SmallDisk | None = None
        self._stranger: subprocess.Popen | None = None
        self._relayed: tuple[str, str] | None = (
            None  # topic before whose publisher the stranger stands, and that publisher
        )
        self.client = WatchedClient()
        self.meter = ArmMeter(self.client.node)
        self.client.meanwhile.append(self.meter.take)
        self._planning, self._phase, self._carried_out = False, "", 0.0
        kind = Execute.Impl.FeedbackMessage
        self.client.node.create_subscription(
            kind, "execute/_action/feedback", self._on_feedback, 10
        )
        self._orders = self.client.node.create_publisher(String, ORDERS, 10)
        self._done: set[str] = set()
        # that the recorder has kept since it was started: who learns anew hears of no others
        self._lessons = 0
        self.client.node.create_subscription(
            String, DONE, lambda message: self._done.add(message.data), LATCHED
        )
        self._reset_arm = self.client.node.create_client(Trigger, "commander/reset")
        rng = np.random.default_rng(SEED)
        *self._shown, self._target = (
            [at_place(target) for targets in targets_for(SEED, 2, 1) for target in targets]
            if skill == THROW_SKILL
            else [situation_msg(self._skill.draw(rng)) for _ in range(LESSONS_OF_A_SKILL + 1)]
        )
        self.usual = (LESSONS, float(the_arm().of_joints("peak_torque").max()))

    def close(self) -> None:
        """End all processes."""
        self.meter.close()
        self.client.close()
        for process in self._graph.processes.values():
            process.send_signal(signal.SIGCONT)
        self._end_stranger()
        self._graph.stop()
        if self._disk is not None:
            self._disk.close()

    # the graph

    def start(self) -> None:
        """Start everything, and teach it."""
        self.client.wait_until_gone((*LAYOUTS[self.layout], *BYSTANDERS))
        for node in (*LAYOUTS[self.layout], *self._extra):
            self._start(node)
        self.client.wait_until_ready()
        self._hurry(True)
        for situation in self._shown:
            self._lesson(situation)
        self._learn()
        self._throw()
        self._hurry(False)
        self._learn_what_is_usual()

    def _learn_what_is_usual(self) -> None:
        """Lessons differ: how fast the arm was in what went without a fault since the meter was
        cleared.
        """
        self.usual = (max(self.usual[0], self.meter.fastest), self.usual[1])

    def _start(self, node: str) -> None:
        parameters = parameters_of(
            node, self.layout, SEED, str(self._new_bag(node)), skill=self._skill.name
        )
        self._lessons = 0 if node == DEMONSTRATIONS else self._lessons
        if node == SIMULATOR:
            parameters["speed_factor"] = self._speed
        if node == RECORDER:
            parameters["bag"] = str(self._bag_of[node])
        if node == VIEWER:
            parameters["port"] = 0
        self._graph.start(node, parameters)

    def _start_again(self, node: str) -> None:
        """End it in order, and start it anew."""
        if (process := self._graph.processes.pop(node, None)) is not None:
            process.send_signal(signal.SIGINT)
            process.wait(BACK)
            self.client.wait_until_gone((node,))
        self._start(node)
        self._reach(node)

    def _reach(self, node: str) -> None:
        """Wait until a node answers."""
        asked = self.client.node.create_client(GetParameters, f"/{node}/get_parameters")
        self.client.reach(asked, BACK)

    def _new_bag(self, node: str) -> Path:
        self._bags += 1
        on_small_disk = self._disk is not None and node == self._filled
        self._bag_of[node] = (
            self._disk.folder if on_small_disk else self._folder
        ) / f"{node}_{self._bags}"
        return self._bag_of[node]

    def _on_feedback(self, message) -> None:
        before, self._phase = self._phase, message.feedback.phase
        if before == MOMENTS["motion"] != self._phase:
            self._carried_out = time.monotonic()
        self._planning = self._planning or self._phase == "planning"

    # what a case needs besides

    def _arrange(self, case: Case) -> None:
        relayed = (case.topic, case.node) if case.topic else None
        if relayed != self._relayed:
            self._stand_before(relayed)
        if case.fault in (*OF_TOPICS, ATTACK):
            self._need_stranger()
        if case.fault == CORRUPT or case.what == GARBAGE:
            self._spoiled.update(self._bag_of.values())
        if case.fault == FULL_DISK:
            self._disk, self._filled = SmallDisk(self._folder / f"disk_{self._bags}"), case.node
            self._start_again(case.node)
        elif case.node == LEARNER and case.fault == KILL and self._lessons < self._enough:
            self._works(*[self._lesson] * (self._enough - self._lessons))
        elif case.node in BYSTANDERS and case.node not in self._graph.processes:
            self._start(case.node)
            self._reach(case.node)

    def _stand_before(self, relayed: tuple[str, str] | None) -> None:
        """Let the messages of a publisher go through the stranger, and no others."""
        before = self._relayed
        self._relayed = relayed
        self._end_stranger()
        self.client.wait_until_gone((NAME,))
        self._graph.remappings.clear()
        if before is not None and (relayed is None or before[1] != relayed[1]):
            self._start_again(before[1])
        if relayed is not None:
            topic, node = relayed
            self._graph.remappings[node] = {topic: topic + BEHIND}
            self._start_again(node)
            self._need_stranger()
            self._order_and_wait(relay=topic, heard=topic + BEHIND)
        self.client.wait_until_ready()

    def _need_stranger(self) -> None:
        if self._stranger is not None:
            return
        with open(self._folder / "logs" / "stranger.log", "ab") as log:
            command = [sys.executable, "-m", "tests.benches.faults.stranger"]
            self._stranger = subprocess.Popen(
                command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, cwd=CHECKOUT
            )
        self._order_and_wait(end=True)

    def _end_stranger(self) -> None:
        if self._stranger is not None:
            self._stranger.send_signal(signal.SIGINT)
            self._stranger.wait(BACK)
        self._stranger = None

    def _order(self, **what) -> None:
        self._done.discard(text := json.dumps(what))
        self._orders.publish(String(data=text))

    def _order_and_wait(self, **what) -> None:
        """Until it is done; said again, as a stranger that has just been started may not have
        heard it.
        """
        until, again = time.monotonic() + BACK, 0.0
        self._done.discard(text := json.dumps(what))
        while text not in self._done:
            if time.monotonic() > until:
                raise GraphFailure(f"the stranger does not do {text}")
            if time.monotonic() > again:
                again = time.monotonic() + SETTLE
                self._orders.publish(String(data=text))
            self.client.spin()

    # a case

    def run(self, case: Case) -> Reaction:
        """Try one case."""
        self._arrange(case)
        injection = FaultInjection(self._graph, case, self._is_time(case), self._order, self._disk)
        self._planning, self._phase, self._carried_out = False, "", 0.0
        self.meter.take()
        self.meter.begin()
        hold_planning = case.phase == "planning" and case.node != LEARNER
        if case.phase == "planning":
            self._signal(LEARNER, signal.SIGSTOP)
        watch = [
            injection.look,
            *(
                [lambda: injection.at and self._signal(LEARNER, signal.SIGCONT)]
                if hold_planning
                else []
            ),
        ]
        injection.on_injection = self.meter.begin_anew
        self.client.meanwhile += watch
        try:
            if case.phase == "idle":
                injection.now()
                self._let_come(KNOWN if case.fault == ATTACK else 0.0)
            until = time.monotonic() + BACK
            succeeded, answer, asked = self._try(lambda: self._job(case))
            # a node that was started anew is not yet known to all
            while not injection.at and not succeeded and time.monotonic() < until:
                self._let_come(SETTLE)
                succeeded, answer, asked = self._try(lambda: self._job(case))
            answered = time.monotonic()
            self._watch_it_rest()
            if case.goes_on and succeeded:
                self._learn_what_is_usual()
        finally:
            for one in watch:
                self.client.meanwhile.remove(one)
        if not injection.at:
            raise GraphFailure(f"{case.name}: its moment never came: {answer}")
        # a motion that does not need what failed is carried out first, however long it takes
        seconds = max(0.0, answered - max(injection.at, asked, self._carried_out))
        measured = (
            self.meter.fastest,
            self.meter.strongest,
            self.meter.speed,
            self.meter.pushed,
            self.meter.at_once,
        )
        if case.phase == "planning":
            self._signal(LEARNER, signal.SIGCONT)
        begun = time.monotonic()
        bag = self._mend(case)
        self.meter.begin()
        afterwards = self._works_again(case, succeeded)
        self._learn_what_is_usual()
        return Reaction(
            case, succeeded, answer, seconds, *measured, bag, afterwards, time.monotonic() - begun
        )

    def _is_time(self, case: Case) -> Callable[[], bool]:
        if case.phase in ("lesson", "swing", "practice"):
            return lambda: self.meter.last > self._moves
        if case.phase in MOMENTS:
            return lambda: self._phase == MOMENTS[case.phase]
        if case.phase == "planning":
            return lambda: self._planning
        return lambda: True

    def _job(self, case: Case) -> str:
        """What the client asks for; what it is told, in words. GraphFailure if it comes to
        nothing.
        """
        if case.phase == "lesson" or (case.phase == "idle" and case.node == TEACHER):
            return self._lesson()
        if case.phase == "practice" or (case.phase == "idle" and case.node == COACH):
            return self._practice()
        if case.phase == "learning" or (case.phase == "idle" and case.node == LEARNER):
            return self._learn()
        return self._throw()

    def _lesson(self, situation: Situation | None = None) -> str:
        """In a situation; default: another one each time."""
        lesson = self.client.show(situation or self._shown[self._lessons % len(self._shown)])
        if not lesson.success:
            raise GraphFailure(lesson.message)
        self._lessons += 1
        return lesson.message

    def _practice(self) -> str:
        messages = []
        practised = self.client.practise(
            situations=[self._target],
            on_feedback=lambda feedback: messages.append(feedback.message),
        )
        if not practised.success or practised.learned < practised.executed:
            raise GraphFailure("; ".join([practised.message, *filter(None, messages)]))
        return practised.message

    def _learn(self) -> str:
        # a learner that was started again hears them one after the other
        heard = max(ENOUGH, min(self._lessons, self._enough))
        return self.client.learn(at_least=heard).message

    def _throw(self) -> str:
        # what the situation does not say the cameras must have seen in the world that is reset
        looks = not set(self._skill.situated) <= set(self._target.bodies)
        thrown = self.client.execute(self._target, look=looks)
        if thrown.code != Execute.Goal.OUTCOME_EXECUTED or not thrown.outcome.seen:
            seen = "" if thrown.outcome.seen else "; landing not seen"
            raise GraphFailure(thrown.message + seen)
        return thrown.message

    def _try(self, job: Callable[[], str]) -> tuple[bool, str, float]:
        """Whether a job succeeded, what the client was told, paths as seen from this graph's
        folder, and when it asked.
        """
        asked, told, succeeded = time.monotonic(), "", False
        try:
            told, succeeded = job(), True
        except FAILURES as failure:
            told = str(failure)
        return succeeded, told.replace(f"{self._folder}/", ""), asked

    # afterwards

    def _mend(self, case: Case) -> str:
        """End what hurts: start a killed node again, let a frozen one go on, send the stranger
        away; what is wrong with its bag.
        """
        if case.fault in (*OF_TOPICS, ATTACK):
            self._order_and_wait(end=True)
            return ""
        wrong = ""
        if case.fault == FULL_DISK and self._disk is not None:
            wrong = self._mend_disk(case, self._disk)
        elif case.fault != KILL:
            self._signal(case.node, signal.SIGCONT)
        else:
            wrong = self._check_bag(case.node) if case.node in (RECORDER, DEMONSTRATIONS) else ""
            self._start(case.node)
        return wrong

    def _mend_disk(self, case: Case, disk: SmallDisk) -> str:
        full = self._bag_of[case.node]
        self._disk = None
        disk.free()
        self._start_again(case.node)
        wrong = self._whole(full)
        disk.close()
        return wrong

    def _check_bag(self, node: str) -> str:
        return self._whole(self._bag_of[node])

    def _whole(self, bag: Path) -> str:
        """What is wrong with a bag that was not closed, once it is recovered."""
        recovered = recover(bag, self._folder / f"{bag.name}_recovered")
        errors = [
            str(finding) for finding in check_bag(recovered.path) if finding.severity == "error"
        ]
        if bag in self._spoiled:
            errors = [text for text in errors if UNDECODABLE not in text]
        if errors or not sum(recovered.messages.values()):
            return f"its bag is not whole: {errors or 'no message'}"
        return ""

    def _works_again(self, case: Case, succeeded: bool) -> str:
        """Why what the case can have broken does not work again within BACK; empty if it does.

        It is tried again, because a node that was frozen first ends what it was doing.
        """
        until = time.monotonic() + BACK
        while (why := self._tries(case, succeeded)) and time.monotonic() < until:
            self._let_come(SETTLE)
        return why

    def _tries(self, case: Case, succeeded: bool) -> str:
        try:
            if case.fault in OF_NODES:
                self._reach(case.node)
            elif not succeeded:
                # an arm that was stopped stays so until then
                self.client.call(self._reset_arm, Trigger.Request(), may_refuse=True)
            self._works(*self._jobs_afterwards(case, succeeded))
        except FAILURES as failure:
            return f"does not work again: {failure}"
        return ""

    def _jobs_afterwards(self, case: Case, succeeded: bool) -> list[Callable[[], str]]:
        """Jobs that need the node with the fault, or else the job during which it came; none where
        that succeeded in spite of it.
        """
        if case.node in BYSTANDERS or (succeeded and case.fault not in (KILL, FREEZE)):
            return []
        learn = [self._learn] if case.node == LEARNER else []
        if case.phase == "lesson" or case.node == TEACHER:
            return [*learn, self._lesson]
        return [
            *learn,
            self._practice if case.phase == "practice" or case.node == COACH else self._throw,
        ]

    def _works(self, *jobs: Callable[[], str]) -> None:
        """Do what the client may ask for, as fast as it goes; GraphFailure if it does not work."""
        if not jobs:
            return
        self._hurry(True)
        for job in jobs:
            job()
        self._hurry(False)

    def _hurry(self, hurry: bool) -> None:
        """Time as fast as it can go, or so that moments are hit and the meter keeps up."""
        if self._speed:
            self.client.set_parameters(
                f"/{SIMULATOR}", {"speed_factor": 0.0 if hurry else self._speed}
            )

    def _watch_it_rest(self) -> None:
        """Until the arm has rested for a while, or should have come to rest."""
        moved = begun = time.monotonic()
        while time.monotonic() < min(moved + RESTS, begun + SETTLE):
            self.client.spin()
            moved = time.monotonic() if self.meter.speed > AT_REST else moved

    def _let_come(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.client.spin()

    def _signal(self, node: str, number: signal.Signals) -> None:
        process = self._graph.processes.get(node)
        if process is not None and process.poll() is None:
            process.send_signal(number)


class ReplayBench(Bench):
    """A graph that replays a bag: player, recorder and learner."""

    layout = "replay"

    def __init__(self, folder: Path, bag: Path):
        self._played = bag
        super().__init__(folder)
        self.usual = (0.0, 0.0)

    def start(self) -> None:
        self.client.wait_until_gone(REPLAYED)

    def run(self, case: Case) -> Reaction:
        """Each case replays the bag from its beginning, on a graph of its own."""
        for node in REPLAYED:
            self._start(node)
        self.client.wait_for_learner()
        injection = FaultInjection(
            self._graph, case, lambda: self.meter.fastest > SWINGS, self._order
        )
        self.meter.begin()
        self.client.meanwhile.append(injection.look)
        try:
            until = time.monotonic() + BACK
            while not injection.at and time.monotonic() < until:
                self.client.spin()
            succeeded, answer, asked = self._try(lambda: self.client.demonstrations().message)
        finally:
            self.client.meanwhile.remove(injection.look)
        seconds, begun = time.monotonic() - asked, time.monotonic()
        bag = self._mend(case)
        if case.node == DEMONSTRATIONS and case.fault == KILL:
            # who records anew wants the bag from its beginning
            self._graph.processes.pop("bag_player").kill()
            self._start("bag_player")
        afterwards = self._learns()
        self._graph.stop()
        self.client.wait_until_gone(REPLAYED)
        return Reaction(
            case,
            succeeded,
            answer,
            seconds,
            0.0,
            0.0,
            0.0,
            (),
            False,
            bag,
            afterwards,
            time.monotonic() - begun,
        )

    def _start(self, node: str) -> None:
        parameters = parameters_of(
            node, "replay", bag=str(self._new_bag(node)), played=str(self._played), rate=4.0
        )
        self._graph.start(node, parameters)

    def _learns(self) -> str:
        try:
            self.client.wait_for_learner(BACK)
            self._learn()
        except FAILURES as failure:
            return f"does not work again: {failure}"
        return ""


def _reaction(bench: Bench, case: Case) -> Reaction:
    """Reaction of a graph to a case; one that could not even be tried leaves a graph that is
    replaced.
    """
    try:
        return bench.run(case)
    except FAILURES as failure:
        return Reaction(
            case,
            False,
            str(failure),
            0.0,
            0.0,
            0.0,
            0.0,
            (),
            False,
            "",
            f"not tried: {failure}",
            0.0,
        )


def run_all(
    cases: list[Case], folder: Path, played: Path, say: Callable[[str], None]
) -> tuple[list[Reaction], tuple[float, float]]:
    """Reactions to cases; and the speed of the joints without a fault, and the torque that the arm
    has at most.

    played: the bag for the cases of a replay. A graph that does not work again is replaced.
    """
    reactions: list[Reaction] = []
    usual, left = (0.0, 0.0), list(cases)
    for attempt in range(1, len(cases) + 2):
        if not left:
            break
        replay = left[0].phase == "replay"
        here = folder / f"graph_{attempt}"
        with closing(
            ReplayBench(here, played) if replay else Bench(here, skill=left[0].skill)
        ) as bench:
            bench.start()
            while left and (left[0].phase == "replay") == replay:
                reactions.append(_reaction(bench, left.pop(0)))
                usual = (max(usual[0], bench.usual[0]), max(usual[1], bench.usual[1]))
                wrong = "; ".join(reactions[-1].faults(usual))
                say(
                    f"{reactions[-1].case.name}: {reactions[-1].seconds:.1f} s:"
                    f" {reactions[-1].answer}: {wrong or 'ok'}"
                )
                if reactions[-1].afterwards:
                    break
    return reactions, usual
