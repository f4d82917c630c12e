"""Nodes of one process hand each other their messages, and nobody can tell but by the clock."""

import threading
import time

import pytest
import rclpy
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int32

from dart_skill_nodes.comms.in_process import SLICE, exchanging, kept_for, spin_once
from dart_skill_nodes.comms.qos import WALL
from dart_skill_nodes.comms.raw_batches import never_called, taken, unspun_node
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import make_executor

RELIABLE = QoSProfile(depth=1000)
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Process:
    """Two nodes that one thread spins, as in `composed`, and an outsider: a node that takes no
    part in the exchange.
    """

    def __init__(self, exchange):
        self.exchange, self.executor = exchange, make_executor()
        self.speaker, self.listener = GuardedNode("speaker"), GuardedNode("listener")
        self.outsider = rclpy.create_node("outsider")
        for node in (self.speaker, self.listener, self.outsider):
            self.executor.add_node(node)

    def close(self):
        for node in (self.speaker, self.listener, self.outsider):
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()

    def until(self, condition, what):
        limit = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < limit, f"{what} did not come true in 60 s"
            spin_once(self.executor, self.exchange, 0.01)


@pytest.fixture
def process(ros):
    with exchanging() as exchange:
        process = Process(exchange)
        yield process
        process.close()


def numbers(messages):
    return [message.data for message in messages]


def test_messages_come_in_order_without_the_middleware(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", RELIABLE)
    for _ in range(2):
        process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 2, "two subscriptions that are discovered"
    )
    message = Int32()
    for message.data in range(100):  # one message that is filled again and again, as nodes have it
        publisher.publish(message)
    process.until(lambda: len(heard) == 200, "200 messages")
    assert numbers(heard) == [number for number in range(100) for _ in range(2)]
    assert process.exchange.heard == 0, "nothing went through the middleware"


def test_everybody_hears_each_message_once_while_outsiders_come_and_go(process):
    inside, raw, outside = [], [], []
    publisher = process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.listener.create_subscription(Int32, "said", inside.append, RELIABLE)
    process.listener.create_subscription(Int32, "said", raw.append, RELIABLE, raw=True)
    process.until(
        lambda: publisher.get_subscription_count() == 2, "two subscriptions that are discovered"
    )
    said = 0

    def say(count):
        nonlocal said
        for _ in range(count):
            publisher.publish(Int32(data=said))
            said += 1
        process.until(lambda: len(inside) == len(raw) == said, f"{said} messages")

    for _ in range(3):
        say(10)
        before = process.exchange.heard
        subscription = process.outsider.create_subscription(
            Int32, "said", outside.append, RELIABLE
        )
        process.until(
            lambda: publisher.get_subscription_count() == 3, "an outsider that is discovered"
        )
        say(10)
        assert process.exchange.heard == before + 20, "all through the middleware, in one order"
        process.until(lambda: outside and outside[-1].data == said - 1, "what the outsider hears")
        process.outsider.destroy_subscription(subscription)
        process.until(lambda: publisher.get_subscription_count() == 2, "an outsider that has gone")
    assert numbers(inside) == list(range(said))
    assert numbers(outside) == [*range(10, 20), *range(30, 40), *range(50, 60)]


def test_no_message_overtakes_another_where_nobody_has_heard_the_last_ones_yet(process):
    """In real time a process that was late heard states of 0.2 s ago after those of now, when
    somebody outside came or went.
    """
    heard, publisher, said = (
        [],
        process.speaker.create_publisher(Int32, "said", RELIABLE),
        iter(range(1000)),
    )
    process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )

    def say_while(subscriptions):
        limit = time.monotonic() + 60.0
        # this process is late: nobody spins it
        while Publisher.get_subscription_count(publisher) != subscriptions:
            assert time.monotonic() < limit, f"{subscriptions} subscriptions are not discovered"
            time.sleep(1e-3)
        process.exchange.turns += 1  # as one that is over before anybody has heard anything
        for number in [next(said) for _ in range(5)]:
            publisher.publish(Int32(data=number))

    for _ in range(3):
        say_while(1)
        outsider = process.outsider.create_subscription(Int32, "said", lambda _: None, RELIABLE)
        say_while(2)
        process.outsider.destroy_subscription(outsider)
    say_while(1)
    process.until(lambda: len(heard) == 35, "35 messages")
    assert numbers(heard) == list(range(35))
    before = process.exchange.heard
    publisher.publish(Int32(data=next(said)))
    process.until(lambda: len(heard) == 36, "one more")
    assert process.exchange.heard == before, "without the middleware again"


def test_who_hears_a_topic_is_counted_once_a_turn(process):
    publisher = process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.listener.create_subscription(Int32, "said", lambda _: None, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    outsider = process.outsider.create_subscription(Int32, "said", lambda _: None, RELIABLE)
    limit = time.monotonic() + 60.0
    while Publisher.get_subscription_count(publisher) != 2:
        assert time.monotonic() < limit, "the second subscription is not discovered"
        time.sleep(1e-3)
    assert publisher.get_subscription_count() == 1
    process.exchange.deliver()
    assert publisher.get_subscription_count() == 2
    process.outsider.destroy_subscription(outsider)


def test_an_outsider_is_heard(process):
    heard = []
    process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    publisher = process.outsider.create_publisher(Int32, "said", RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    publisher.publish(Int32(data=7))
    process.until(lambda: heard, "its message")


def test_who_takes_messages_gets_them_all_in_order(process):
    unspun = unspun_node(process.listener, "ears")
    subscription = unspun.create_subscription(Int32, "/said", never_called, RELIABLE, raw=True)
    newest = unspun.create_subscription(
        Int32, "/said", never_called, QoSProfile(depth=1), raw=True
    )
    publisher = process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 2, "two subscriptions that are discovered"
    )
    begun = time.time_ns()
    for number in range(20):
        publisher.publish(Int32(data=number))
    came = list(taken(subscription))
    assert [data[4] for data, _, _ in came] == list(range(20))
    assert all(
        begun <= received <= time.time_ns() and number is None for _, received, number in came
    )
    assert [data[4] for data, _, _ in taken(newest)] == [19], "its history is one message deep"
    assert not list(taken(subscription)) and not kept_for(subscription)
    unspun.destroy_node()


def test_a_message_from_another_thread_wakes_who_hears_it(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    other = threading.Thread(target=lambda: publisher.publish(Int32(data=1)))
    other.start()
    other.join()
    spin_once(process.executor, process.exchange, 30.0)
    assert numbers(heard) == [1] and process.exchange.heard == 1


def test_what_dds_would_not_connect_is_not_connected(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", BEST_EFFORT)
    process.listener.create_subscription(
        Int32, "said", lambda _: heard.append("reliable"), RELIABLE
    )
    process.listener.create_subscription(
        Int32, "said", lambda _: heard.append("best effort"), BEST_EFFORT
    )
    process.until(lambda: publisher.get_subscription_count() == 1, "the one that matches")
    publisher.publish(Int32())
    process.until(lambda: heard, "a message")
    spin_once(process.executor, process.exchange, 0.0)
    assert heard == ["best effort"]


def test_a_late_joiner_hears_what_is_latched(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", LATCHED)
    publisher.publish(Int32(data=3))
    process.listener.create_subscription(Int32, "said", heard.append, LATCHED)
    process.until(lambda: heard, "what was said before")


def test_a_subscription_that_is_gone_is_called_no_more(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", RELIABLE)
    subscription = process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    publisher.publish(Int32())
    process.listener.destroy_subscription(subscription)
    publisher.publish(Int32())
    spin_once(process.executor, process.exchange, 0.0)
    assert not heard


def test_a_turn_calls_all_that_is_ready(process):
    """One callback a turn made a service wait for as many slices as timers and services were ready
    before it.
    """
    ping = process.speaker.create_publisher(Int32, "ping", RELIABLE)
    # answers itself for ever: turns last a slice
    process.speaker.create_subscription(Int32, "ping", ping.publish, RELIABLE)
    process.until(lambda: ping.get_subscription_count() == 1, "a subscription that is discovered")
    ticks = []
    timers = [
        process.listener.create_timer(
            0.01, lambda: ticks.append(process.exchange.turns), clock=WALL
        )
        for _ in range(5)
    ]
    ping.publish(Int32())
    process.until(lambda: len(ticks) >= 50, "ticks of five timers")
    for timer in timers:
        process.listener.destroy_timer(timer)
    assert max(ticks.count(turn) for turn in set(ticks)) == 5


def test_two_who_answer_each_other_for_ever_hold_up_nobody(process):
    """As simulator and commander do: timers and other processes have their turn, within a few
    slices.
    """
    ping = process.speaker.create_publisher(Int32, "ping", RELIABLE)
    pong = process.listener.create_publisher(Int32, "pong", RELIABLE)
    process.listener.create_subscription(Int32, "ping", pong.publish, RELIABLE)
    process.speaker.create_subscription(Int32, "pong", ping.publish, RELIABLE)
    others, ticks = [], []
    process.listener.create_subscription(Int32, "said", others.append, RELIABLE)
    process.listener.create_timer(SLICE, lambda: ticks.append(1))
    outsider = process.outsider.create_publisher(Int32, "said", RELIABLE)
    every = (ping, pong, outsider)
    process.until(lambda: all(one.get_subscription_count() for one in every), "all connections")
    ping.publish(Int32())
    for number in range(50):
        outsider.publish(Int32(data=number))
    process.until(lambda: len(others) == 50 and len(ticks) > 50, "what others said, and ticks")
    assert numbers(others) == list(range(50))
    assert process.exchange.deliver(), "they still answer each other"


def test_a_refused_message_is_counted_and_the_next_one_heard(process):
    heard = []

    def refuse_odd(message):
        if message.data % 2:
            raise ValueError("odd")
        heard.append(message.data)

    publisher = process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.listener.create_subscription(Int32, "said", refuse_odd, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    for number in range(4):
        publisher.publish(Int32(data=number))
    process.until(lambda: len(heard) == 2, "the even ones")
    assert process.listener.refusals.counts == {"/said": 2}


def test_bytes_that_are_no_message_are_dropped(process):
    heard, publisher = [], process.speaker.create_publisher(Int32, "said", RELIABLE)
    process.listener.create_subscription(Int32, "said", heard.append, RELIABLE)
    process.until(
        lambda: publisher.get_subscription_count() == 1, "a subscription that is discovered"
    )
    publisher.publish(b"\0\1\0\0")
    publisher.publish(Int32(data=5))
    process.until(lambda: heard, "the message after them")
    assert numbers(heard) == [5]
