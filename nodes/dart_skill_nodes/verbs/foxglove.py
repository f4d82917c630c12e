"""`dart-skill view --foxglove` without a bag: the graph that runs, live in Foxglove. It listens,
and publishes nothing.

Beside what it hears it sends what viewers need to show the arm, where it is not published:
/robot_description, /tf and /tf_static.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

from dart_skill.common.world import the_world
from dart_skill.recording import definition, types_for
from dart_skill.view import FoxgloveServer
from dart_skill_nodes.process.environment import Interrupts, stay_on_this_machine

LOOK = 0.5
"""New topics are looked for so often [s, wall clock]."""
SETTLES = 2.0
"""The address is printed so long after the start, when the topics are known [s]: foxglove-sdk may
miss a client that asks for a topic at once.
"""
TF_RATE = 50.0
"""Rate of /tf, where no node publishes it [1/s]."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No options of its own: those of `dart-skill view`."""


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Serve until Ctrl-C; returns the exit status."""
    with FoxgloveServer(options.foxglove_port) as server:
        return _serve(server, Interrupts(), partial(options.say, server))


def _serve(server: FoxgloveServer, interrupts: Interrupts, say: Callable[[], None]) -> int:
    stay_on_this_machine()
    from dart_skill_nodes.process.node_base import node_of_command

    with node_of_command("foxglove_view") as (node, spin):
        view, due = GraphView(node, server), time.monotonic() + SETTLES
        while not interrupts:
            if due is not None and time.monotonic() >= due:
                say()
                due = None
            spin(0.01)
            view.hand_on()
        view.close()
    return 0


class GraphView:
    """What a node hears of a graph, handed on to a server; call `hand_on` often.

    refused: why messages of a topic are not shown.
    """

    def __init__(self, node, server: FoxgloveServer):
        from dart_skill_nodes.comms.raw_batches import RawBatches

        self._node, self._server, self._batches = node, server, RawBatches(node)
        self.refused: dict[str, str] = {}
        self._tf, self._next_look = None, 0.0

    def hand_on(self) -> None:
        """Take in what has come, and look for new topics."""
        if time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + LOOK
            self._look()
        for message in self._batches.take():
            self._server.publish(message.topic, message.data, message.received_ns)
            self._show_arm(message.topic, message.received_ns, message.data)

    def close(self) -> None:
        """Hear nothing any more."""
        self._batches.close()

    def _look(self) -> None:
        from dart_skill_nodes.comms.qos import message_class

        for topic, types in self._node.get_topic_names_and_types():
            # what passes between actions, and signs of life, as `ros2 topic list` hides them
            hidden = "/_" in topic
            if hidden or topic in {*self._batches.topics, *self._server.topics, *self.refused}:
                continue
            try:
                message_class(types[0])
                self._batches.listen(
                    topic, partial(self._add, topic, definition(types_for(types[0]), types[0]))
                )
            except (ImportError, AttributeError, ValueError) as error:
                self.refused[topic] = str(error)
                self._node.get_logger().warning(f"{topic} is not shown: {error}")

    def _add(self, topic: str, text: str, offers: list) -> None:
        if topic not in self._server.topics:
            lasting = any(
                "TRANSIENT_LOCAL" in offer.qos_profile.durability.name for offer in offers
            )
            self._server.add_topic(topic, offers[0].topic_type, text, lasting)

    def _show_arm(self, topic: str, stamp_ns: int, data: bytes) -> None:
        from dart_skill_nodes.comms.for_viewers import TfMessages

        if self._tf is None:
            there = {
                *self._batches.topics,
                *(name for name, _ in self._node.get_topic_names_and_types()),
            }
            self._tf = TfMessages(the_world().frame_id, TF_RATE, there)
            for name, (type_name, qos) in self._tf.topics.items():
                text = definition(types_for(type_name), type_name)
                self._server.add_topic(
                    name, type_name, text, "TRANSIENT_LOCAL" in qos.durability.name
                )
        for name, message in self._tf.messages(topic, stamp_ns, data):
            self._server.publish(name, message, stamp_ns)
