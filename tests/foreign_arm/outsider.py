"""What a person with a terminal does: services and the action of the graph, called by a plain rclpy node while the driver goes on."""

import os
import signal
import subprocess
from contextlib import contextmanager

from dart_skill_msgs.action import Practice, Throw
from dart_skill_msgs.srv import Learn, StopDemonstration
from geometry_msgs.msg import Point
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

SERVICES = {
    "/commander/release_arm": SetBool,
    "/commander/stop": Trigger,
    "/demonstration_recorder/start": Trigger,
    "/demonstration_recorder/stop": StopDemonstration,
    "/skill_learner/learn": Learn,
}


@contextmanager
def running(command, log):
    """A process with its output in a file, which is ended as by Ctrl-C."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w") as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True, cwd=log.parent)
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(timeout=20.0)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def hardware_graph(folder):
    """The hardware layout, until the end of the context; its log and the bag of demonstrations are in the folder."""
    return running(["dart-skill", "up", "--layout", "hardware", "--output", str(folder / "up")], folder / "up.log")


class Outsider(Node):
    """Calls what the documentation names. Everything spins in the driver's executor."""

    def __init__(self, executor, driver):
        super().__init__("outsider")
        executor.add_node(self)
        self.driver = driver
        self._calls = {name: self.create_client(kind, name) for name, kind in SERVICES.items()}
        self._throw = ActionClient(self, Throw, "/throw")
        self._practice = ActionClient(self, Practice, "/practice")

    def wait_for_graph(self, limit=60.0):
        """Until every service and the action are there, and a second longer: a server may find its client later."""
        parts = [*(client.service_is_ready for client in self._calls.values()), self._throw.server_is_ready]
        self.driver.run_until(lambda: all(part() for part in parts), limit)
        self.driver.run(1.0)

    def _wait(self, future, limit):
        self.driver.run_until(future.done, limit)
        return future.result()

    def call(self, name, limit=60.0, **fields):
        """Call a service until it no longer says that its answer is pending, for 5 s of the arm's time at most."""
        for _ in range(50):
            response = self._wait(self._calls[name].call_async(SERVICES[name].Request(**fields)), limit)
            if not getattr(response, "pending", False):
                return response
            self.driver.run(0.1)
        return response

    def do(self, *tasks, limit=300.0):
        """Let the person do these, until the end of the last one."""
        self.driver.person.begin(*tasks)
        self.driver.run_until(lambda: not self.driver.person.busy, limit)

    def teach(self, rim, keep=False):
        """One guided throw at a basket (3,): whether it went in, and the recorder's answer to ~/stop; misses are kept only with `keep`."""
        person = self.driver.person
        self.driver.plant.place_basket(rim)
        self.do(person.cock(rim), person.bring_ball(), person.wait(0.3))
        started = self.call("/demonstration_recorder/start")
        assert started.success, started.message
        self.do(person.throw(rim))
        hit = person.in_basket(rim)
        person.aim.learn(rim, person.landing)
        return hit, self.stop(hit or keep)

    def stop(self, keep):
        """End the recording of a throw with what was published up to now; the recorder's answer."""
        until = self.driver.stamp(self.driver.plant.steps - 1)
        return self.call("/demonstration_recorder/stop", keep=keep, reason="" if keep else "missed", until=until)

    def prepare(self, rim):
        """The basket stands there (3,), the ball is in the hand."""
        self.driver.plant.place_basket(rim)
        self.do(self.driver.person.bring_ball())

    def throw(self, rim, limit=120.0):
        """The arm throws at a basket (3,); the result of the action."""
        goal = Throw.Goal(target=Point(x=rim[0], y=rim[1], z=rim[2]))
        goal.header.frame_id = "world"
        return self._act(self._throw, goal, limit)

    def practise(self, throws, limit=120.0):
        """The coach lets the arm throw at the basket where the cameras see it; the result of the action."""
        self.driver.run_until(self._practice.server_is_ready, limit)
        self.driver.run(1.0)
        return self._act(self._practice, Practice.Goal(throws=throws, follow_basket=True), limit)

    def _act(self, client, goal, limit):
        handle = self._wait(client.send_goal_async(goal), limit)
        assert handle.accepted
        return self._wait(handle.get_result_async(), limit).result
