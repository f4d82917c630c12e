"""What a person with a terminal does: services and the action of the graph, called by a plain
rclpy node while the driver goes on.
"""

import json
import os
import signal
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

from dart_skill_msgs.action import Execute, Practice
from dart_skill_msgs.msg import Situation
from dart_skill_msgs.srv import (
    DropDemonstration,
    GetPlan,
    Learn,
    ListDemonstrations,
    StopDemonstration,
)
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from dart_skill_nodes.process.environment import ENDS_WITH

LIMIT, LONG = 240.0, 600.0
"""Nothing takes longer, on whatever machine: answers and starting nodes; commands and what a
person does [s, wall clock].
"""
PENDING = 30.0
"""What comes late is waited for so long [s, wall clock]. Fast DDS repeats what got lost on a busy
machine after 3 s, or twice that.
"""
RECORDERS = ("/demonstration_recorder", "/again")
"""The one of the layout, and one that a test starts."""
SERVICES = {
    "/commander/get_plan": GetPlan,
    "/commander/release_arm": SetBool,
    "/commander/stop": Trigger,
    "/commander/reset": Trigger,
    **{
        f"{recorder}/{name}": kind
        for recorder in RECORDERS
        for name, kind in (("start", Trigger), ("stop", StopDemonstration))
    },
    "/skill_learner/learn": Learn,
    "/skill_learner/demonstrations": ListDemonstrations,
    "/skill_learner/drop_demonstration": DropDemonstration,
}


@contextmanager
def running(command, log):
    """A process with its output in a file, which is ended as by Ctrl-C."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w") as output:
        ends = {**os.environ, ENDS_WITH: str(os.getpid())}  # whatever becomes of the tests
        process = subprocess.Popen(
            command,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            cwd=log.parent,
            env=ends,
        )
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=20.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def hardware_graph(folder, skill):
    """The hardware layout for a skill, until the end of the context; its log and the bag of
    demonstrations are in the folder.
    """
    # a machine that is busy holds up this laboratory for longer than 0.5 s
    settings = (
        "coach.stand_back=1.0",
        "commander.states_timeout=20.0",
    )
    command = ["dart-skill", "up", "--layout", "hardware", "--skill", skill]
    command += ["--output", str(folder / "up")]
    command += [word for setting in settings for word in ("--set", setting)]
    return running(command, folder / "up.log")


class Outsider(Node):
    """Calls what the documentation names. Everything spins in the driver's executor."""

    def __init__(self, executor, driver):
        super().__init__("outsider")
        executor.add_node(self)
        self.driver, self.recorder = driver, RECORDERS[0]
        self._calls = {name: self.create_client(kind, name) for name, kind in SERVICES.items()}
        self._execute = ActionClient(self, Execute, "/execute")
        self._practice = ActionClient(self, Practice, "/practice")
        self.create_subscription(
            Practice.Impl.FeedbackMessage, "/practice/_action/feedback", self._hear, 50
        )
        # what the coach asked of the person, in words, and whether the person does it
        self.asked, self.helps = (
            [],
            False,
        )

    def wait_for_graph(self, graph, limit=LIMIT):
        """Until every service and the action are there, and a second longer: a server may find its
        client later. graph: its process, which must not end.
        """
        actions = (self._execute, self._practice)
        there = [
            client for name, client in self._calls.items() if not name.startswith(RECORDERS[1])
        ]
        parts = [
            *(client.service_is_ready for client in there),
            *(action.server_is_ready for action in actions),
        ]

        def has_ended():
            return graph.poll() is not None

        self.driver.run_until(lambda: has_ended() or all(part() for part in parts), limit)
        assert not has_ended(), "the graph ended by itself: see its log"
        self.driver.run(1.0)

    def _wait(self, future, limit):
        self.driver.run_until(future.done, limit)
        return future.result()

    def call(self, name, limit=LIMIT, **fields):
        """Call a service until it no longer says that its answer is pending, for PENDING on the
        wall clock at most.
        """
        self.driver.run_until(self._calls[name].service_is_ready, limit)
        until = time.monotonic() + PENDING
        while True:
            response = self._wait(
                self._calls[name].call_async(SERVICES[name].Request(**fields)), limit
            )
            if not getattr(response, "pending", False) or time.monotonic() > until:
                return response
            self.driver.run(0.1)

    def do(self, *tasks, limit=LONG):
        """Let the person do these, until the end of the last one."""
        self.driver.person.begin(*tasks)
        self.driver.run_until(lambda: not self.driver.person.busy, limit)

    def start(self):
        """Begin a recording; a recorder that has just been started has not heard of everything yet."""
        for _ in range(100):
            started = self.call(f"{self.recorder}/start")
            if started.success:
                break
            self.driver.run(0.1)
        assert started.success, started.message

    def stop(self, keep):
        """End a recording with what was published up to now; the recorder's answer."""
        until = self.driver.stamp(self.driver.plant.steps - 1)
        return self.call(
            f"{self.recorder}/stop", keep=keep, reason="" if keep else "missed", until=until
        )

    def execute(self, situation=None, limit=120.0):
        """The arm does what it learned, in a situation or in that which the cameras see; the result
        of the action.
        """
        goal = Execute.Goal(situation=situation or Situation())
        goal.header.frame_id = "world"
        return self._act(self._execute, goal, limit)

    def start_practice(self, limit=LIMIT, **goal):
        """The handle of a goal of the coach's, with a person who does nothing."""
        self.asked, self.helps = [], False
        return self._wait(self._practice.send_goal_async(Practice.Goal(**goal)), limit)

    def until_asked(self, words, limit=LIMIT):
        """Go on until the coach asked for something with these words in it."""
        try:
            self.driver.run_until(lambda: any(words in text for text in self.asked), limit)
        except TimeoutError as error:
            raise TimeoutError(f"{error}: the coach asked for {self.asked}") from None

    @contextmanager
    def practising(self, **goal):
        """A goal of the coach's, which is cancelled at the end, whatever comes meanwhile: its
        result is that of the context then.
        """
        practice, handle = SimpleNamespace(result=None), self.start_practice(**goal)
        assert handle.accepted
        try:
            yield practice
        finally:
            self._wait(handle.cancel_goal_async(), LIMIT)
            practice.result = self.result(handle)

    def result(self, handle, limit=LIMIT):
        """The result of a goal."""
        return self._wait(handle.get_result_async(), limit).result

    def type(self, *words, before_enter=(), limit=LONG):
        """Type a command, with a person who does what the coach asks; the object that it prints as
        JSON, and what it says meanwhile.

        before_enter: what is done, one after the other, before the command is given the Enter key
        that it asks for.
        """
        self.asked, self.helps = [], True
        with tempfile.TemporaryDirectory() as folder:
            told, said = Path(folder) / "told", Path(folder) / "said"
            with told.open("w") as out, said.open("w") as err:
                process = subprocess.Popen(
                    [*words, "--json"], stdin=subprocess.PIPE, stdout=out, stderr=err, text=True
                )
            try:
                for number, act in enumerate(before_enter, start=1):
                    self.driver.run_until(
                        lambda n=number: (
                            said.read_text().count("press Enter") >= n
                            or process.poll() is not None
                        ),
                        limit,
                    )
                    assert process.poll() is None, said.read_text()
                    act()
                    assert process.poll() is None, said.read_text()
                    process.stdin.write("\n")
                    process.stdin.flush()
                self.driver.run_until(lambda: process.poll() is not None, limit)
            finally:
                process.kill()
                process.stdin.close()
                self.helps = False
            result, words = told.read_text(), said.read_text()
        assert process.returncode == 0, words
        return json.loads(result), words

    def _hear(self, message):
        feedback = message.feedback
        if feedback.phase == "waiting":
            self.asked.append(feedback.message)
            if self.helps and not self.driver.person.busy:
                self.help_with(feedback.message)

    def help_with(self, asked):
        """Do what the coach asks for, in words."""

    def _act(self, client, goal, limit):
        handle = self._wait(client.send_goal_async(goal), limit)
        assert handle.accepted
        return self._wait(handle.get_result_async(), limit).result


def teach(outsider, situations, attempts=3):
    """One success in each situation; the demonstrations that the recorder cut out."""
    demonstrations = []
    for situation in situations:
        for _ in range(attempts):
            succeeded, stopped = outsider.teach(situation)
            if succeeded:
                break
        assert succeeded, f"the person failed {attempts} times at {situation}"
        assert stopped.success, stopped.message
        demonstrations.append(stopped.demonstration)
    return demonstrations
