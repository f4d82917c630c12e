"""A foreign node, as a process of its own: it stands between a publisher and all others, and does
what nobody should do to a graph.

It hears on ORDERS what to do, as JSON: `relay` a topic under the name that the others hear; from
then on `fault` says what becomes of its messages; `attack` begins one of ATTACKS; `end` takes back
all that it does but the relay. It says on DONE what it has begun.
"""

import json
import random
import time
from collections.abc import Callable
from functools import partial

import rclpy
from builtin_interfaces.msg import Time
from dart_skill_msgs.action import Execute, Teach
from dart_skill_msgs.msg import Demonstration, WamCommand
from dart_skill_msgs.srv import Reset
from geometry_msgs.msg import Point, PoseStamped
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.world import joint_names
from dart_skill_nodes.comms.commands import new_sender
from dart_skill_nodes.comms.conversions import at_place, set_stamp, stamp_ns
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, pose_topic
from dart_skill_nodes.comms.presence import be_alive
from dart_skill_nodes.comms.qos import (
    COMPLETE,
    LATCHED,
    WALL,
    MatchingSubscriptions,
    message_class,
)
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.environment import Interrupts
from dart_skill_nodes.process.node_base import make_executor
from tests.benches.faults.cases import GARBAGE

NAME = "stranger"
ORDERS, DONE = f"/{NAME}/orders", f"/{NAME}/done"
ONE_IN = 20
"""One of so many messages is dropped, late or damaged."""
LATE = 0.3
"""[s, wall clock]"""
DAMAGED_BYTES = 3
STEP_NS = 2_000_000
HOUR_NS = 3_600_000_000_000
STRONG = 1e9
"""[N], [N m]"""
OFTEN = 0.01
"""For what answers nothing [s, wall clock]."""


class Relay:
    """Hears a publisher under a name that nobody else knows, and publishes under the one that all
    others hear; `fault`: what it does.
    """

    def __init__(self, node: Node, heard: str, told: str):
        self.fault = ""
        self._node, self._told, self._publisher, self._count = node, told, None, 0
        self._random = random.Random(0)
        self._late: list[tuple[float, bytes]] = []
        self._heard = MatchingSubscriptions(node)
        self._heard.subscribe(
            heard, self._pass_on, depth=COMPLETE.depth, raw=True, on_offer=self._offer_the_same
        )
        node.create_timer(OFTEN, self._send_late, clock=WALL)

    def _offer_the_same(self, offers: list) -> None:
        offered = offers[0].qos_profile
        qos = QoSProfile(
            depth=COMPLETE.depth, reliability=offered.reliability, durability=offered.durability
        )
        self._publisher = self._node.create_publisher(
            message_class(offers[0].topic_type), self._told, qos
        )

    def _pass_on(self, data: bytes) -> None:
        self._count += 1
        if self.fault == "lose" or (self.fault == "drop" and self._is_meant):
            return
        if self.fault == "delay" and self._is_meant:
            self._late.append((time.monotonic() + LATE, data))
            return
        self._publisher.publish(
            self._damaged(data) if self.fault == "corrupt" and self._is_meant else data
        )
        if self.fault == "duplicate":
            self._publisher.publish(data)

    @property
    def _is_meant(self) -> bool:
        return self._count % ONE_IN == 0

    def _damaged(self, data: bytes) -> bytes:
        """Some of its bytes changed, or its end cut off; the four bytes stay that say how it is
        encoded.
        """
        damaged = bytearray(data)
        if self._random.random() < 0.2:
            return bytes(damaged[: self._random.randrange(4, len(damaged))])
        for _ in range(DAMAGED_BYTES):
            damaged[self._random.randrange(4, len(damaged))] = self._random.randrange(256)
        return bytes(damaged)

    def _send_late(self) -> None:
        while self._late and self._late[0][0] < time.monotonic():
            self._publisher.publish(self._late.pop(0)[1])


class Stranger(GuardedNode):
    """Does as it is told, until it is told to end it."""

    def __init__(self):
        super().__init__(NAME)
        self._relays: dict[str, Relay] = {}
        self._used: list[Callable[[], object]] = []  # how to take back what an attack needs
        self._sender = new_sender()
        self._done = self.create_publisher(String, DONE, LATCHED)
        self.create_subscription(String, ORDERS, self._on_order, 10)
        be_alive(self)

    def _on_order(self, message: String) -> None:
        order = json.loads(message.data)
        if "relay" in order:
            self._relays.setdefault(order["relay"], Relay(self, order["heard"], order["relay"]))
        if "fault" in order:
            for relay in self._relays.values():
                relay.fault = order["fault"]
        if "attack" in order:
            ATTACKS[order["attack"]](self)
        if "end" in order:
            self._end()
        self._done.publish(message)

    def _end(self) -> None:
        for relay in self._relays.values():
            relay.fault = ""
        while self._used:
            self._used.pop()()

    # means of attacks

    def publisher(self, kind: type, topic: str, qos: QoSProfile = COMPLETE):
        """One that leaves when the attack ends."""
        made = self.create_publisher(kind, topic, qos)
        self._used.append(partial(self.destroy_publisher, made))
        return made

    def often(self, do: Callable[[], object]) -> None:
        """Do something again and again."""
        timer = self.create_timer(OFTEN, do, clock=WALL)
        self._used.append(partial(self.destroy_timer, timer))

    def answering(self, do: Callable[[JointState], object]) -> None:
        """Do something with each state of the arm, as fast as a commander would."""
        heard = self.create_subscription(JointState, "joint_states", do, 10)
        self._used.append(partial(self.destroy_subscription, heard))

    def ask(self, kind: type, service: str, request: object) -> None:
        """Call a service, whatever comes of it."""
        client = self.create_client(kind, service)
        client.wait_for_service(2.0)
        client.call_async(request)

    def send(self, kind: type, action: str, goal: object) -> None:
        """Send a goal, whatever comes of it."""
        client = ActionClient(self, kind, action)
        client.wait_for_server(2.0)
        client.send_goal_async(goal)

    def command(
        self, state: JointState, ahead_ns: int = 0, newtons: float = STRONG, sender: int = 0
    ) -> WamCommand:
        """A push that answers a state, or one that comes so much later."""
        message = WamCommand(
            sender=sender or self._sender, speed=WamCommand.SPEED_THROW, joint_torque=[newtons] * 7
        )
        message.header.frame_id = "world"
        set_stamp(message.header.stamp, stamp_ns(state.header.stamp) + ahead_ns)
        message.wrench.force.x = message.wrench.force.z = newtons
        return message


def _push(one: Stranger, topic: str, **how) -> None:
    out = one.publisher(WamCommand, topic)
    one.answering(lambda state: out.publish(one.command(state, **how)))


def _copy_the_sender(one: Stranger) -> None:
    """Pushes under the number of the commander, which anybody can read."""
    out, known = one.publisher(WamCommand, COMMANDS), []
    one.create_subscription(
        WamCommand,
        COMMANDS,
        lambda message: known.append(message.sender) if not known else None,
        10,
    )
    one.answering(
        lambda state: out.publish(one.command(state, sender=known[0])) if known else None
    )


def _reversed_states(one: Stranger) -> None:
    """A second arm whose joints are the other way round, always a step ahead."""
    out = one.publisher(JointState, "joint_states")
    seen = [0]

    def answer(state: JointState) -> None:
        ns = stamp_ns(state.header.stamp)
        if ns <= seen[0]:
            return  # its own
        seen[0] = ns + STEP_NS
        set_stamp(state.header.stamp, ns + STEP_NS)
        state.position, state.velocity = state.position[::-1], state.velocity[::-1]
        out.publish(state)

    one.answering(answer)


def _six_joints(one: Stranger) -> None:
    out, zeros = one.publisher(JointState, "joint_states"), [0.0] * 6

    def answer(state: JointState) -> None:
        if len(state.name) > len(zeros):  # not its own
            out.publish(
                JointState(
                    header=state.header, name=joint_names()[:6], position=zeros, velocity=zeros
                )
            )

    one.answering(answer)


def _poses(one: Stranger, **fields) -> None:
    outs = [one.publisher(PoseStamped, pose_topic(body)) for body in ("hand", "ball")]
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = "world", fields.get("stamp", Time())
    message.pose.position = fields.get("position", Point())
    one.often(lambda: [out.publish(message) for out in outs])


def _clock(one: Stranger) -> None:
    out = one.publisher(Clock, "clock", QoSProfile(depth=10))
    one.often(lambda: out.publish(Clock(clock=Time(sec=-5))))


def _garbage(one: Stranger) -> None:
    """Bytes that are no messages, on all that nodes hear."""
    kinds = dict.fromkeys((COMMANDS, GUIDING), WamCommand)
    kinds |= {pose_topic("hand"): PoseStamped, "demonstrations": Demonstration}
    outs = [
        one.publisher(kind, topic, LATCHED if topic == "demonstrations" else COMPLETE)
        for topic, kind in kinds.items()
    ]
    bad = b"\x00\x01\x00\x00" + b"\xff" * 60
    one.often(lambda: [out.publish(bad) for out in outs])


def _guided_reset(one: Stranger) -> None:
    """Says that a person guides the arm, and pushes as no person does."""
    _push(one, GUIDING)
    one.ask(Reset, "simulation/reset", Reset.Request(guided=True))


def _parameters(one: Stranger) -> None:
    """Values that no arm has."""
    values = {"wam_simulator": {"gravity_error": -3.0, "speed_factor": float("nan"), "motor_scale": 1e308, "ball_mass_scale": -1.0},
              "mock_optitrack": {"basket_radius": -3.0, "basket_depth": float("nan")},
              "commander": {"farthest_error": 1e9, "fastest_hand": 1e9}}  # fmt: skip
    for node, wrong in values.items():
        asked: list[ParameterMsg] = [
            Parameter(name, value=value).to_parameter_msg() for name, value in wrong.items()
        ]
        one.ask(SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=asked))


ATTACKS: dict[str, Callable[[Stranger], None]] = {
    "strong_commands": partial(_push, topic=COMMANDS),
    "future_commands": partial(_push, topic=COMMANDS, ahead_ns=HOUR_NS, newtons=30.0),
    "nan_commands": partial(_push, topic=COMMANDS, newtons=float("nan")),
    "commands_under_its_number": _copy_the_sender,
    "strong_pushes": partial(_push, topic=GUIDING),
    "reversed_states": _reversed_states,
    "six_joints": _six_joints,
    "poses_before_time": partial(_poses, stamp=Time(sec=-1)),
    "poses_beyond_the_world": partial(_poses, position=Point(x=1e308)),
    "clock_before_time": _clock,
    GARBAGE: _garbage,
    "guided_reset": _guided_reset,
    "reset": lambda one: one.ask(Reset, "simulation/reset", Reset.Request()),
    "parameters": _parameters,
    "release": lambda one: one.ask(SetBool, "commander/release_arm", SetBool.Request(data=True)),
    "stop": lambda one: one.ask(Trigger, "commander/stop", Trigger.Request()),
    "second_goal": lambda one: one.send(
        Execute, "execute", Execute.Goal(situation=at_place([2.0, 0.0, 0.4]))
    ),
    "lesson_at_the_origin": lambda one: one.send(
        Teach, "teach", Teach.Goal(situation=at_place([0.0, 0.0, 0.0]))
    ),
}
"""By name, what a stranger does."""


def main() -> None:
    """Until it is told to end."""
    interrupts = Interrupts()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    stranger, executor = Stranger(), make_executor()
    executor.add_node(stranger)
    while rclpy.ok() and not interrupts:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    stranger.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
