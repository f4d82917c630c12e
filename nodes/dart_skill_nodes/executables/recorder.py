"""The recorder: chosen topics, or all, into a rosbag2 folder, as raw messages with the quality of
service of their publishers.

Beside them it writes what viewers need to show the arm, where it is not published:
/robot_description, /tf and /tf_static.
"""

import json
from datetime import datetime
from functools import partial
from pathlib import Path

from rclpy.lifecycle import TransitionCallbackReturn

from dart_skill.recording import LogTime, types_for
from dart_skill.recording.bags import PlaybackSelection
from dart_skill_nodes.comms.bag_sink import BagKeeper, BagSink, free_folder
from dart_skill_nodes.comms.conversions import leading_stamp_ns
from dart_skill_nodes.comms.for_viewers import TfMessages
from dart_skill_nodes.comms.names import CLOCK, namespace_of
from dart_skill_nodes.comms.qos import WALL, message_class
from dart_skill_nodes.comms.raw_batches import TAKE, RawBatches, RawMessage
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, autostart, run
from dart_skill_nodes.process.parameters import declare, values_of

LOOK = 0.5
"""New topics are looked for so often [s, wall clock]."""


class Recorder(BagKeeper):
    """A managed node: configuring opens the bag, activating records, cleaning up or shutting down
    closes it.

    It starts itself unless `autostart` is false. With use_sim_time the log time is that of /clock,
    else when a message was received.
    """

    def __init__(self):
        super().__init__("recorder")
        self.p = declare(self, "recorder")
        self._bag, self._messages, self._tf, self._active = None, None, None, False
        self._diagnostics = Diagnostics(self, self._describe)
        if self.p["autostart"]:
            autostart(self)

    # life cycle

    def on_configure(self, state) -> TransitionCallbackReturn:
        self.p = values_of(self, self.p)
        self._selection = PlaybackSelection(self.p["topics"], self.p["exclude"])
        notes = dict(_pair(text) for text in self.p["notes"])
        named = self.p["bag"] or f"recording_{datetime.now():%Y_%m_%d-%H_%M_%S}"
        limits = {
            "max_bytes": round(self.p["max_megabytes"] * 1e6),
            "max_duration_ns": round(self.p["max_minutes"] * 60e9),
        }
        self._bag = BagSink(self, free_folder(Path(named)), notes, **limits)
        self._kept, self._made, self._refused = set(), set(), {}
        self._simulated, self._log_time, self._early = (
            self.get_parameter("use_sim_time").value,
            LogTime(),
            [],
        )
        self._messages = RawBatches(self)
        self._clock_topic = self.resolve_topic_name(CLOCK)
        if self._simulated:
            self._listen(self._clock_topic, keep=self._selection.matches(self._clock_topic))
        self._look_for_topics()
        self._ticking = [
            self.create_timer(TAKE, self._take, clock=WALL),
            self.create_timer(LOOK, self._look_for_topics, clock=WALL),
        ]
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state) -> TransitionCallbackReturn:
        self._active = True
        self.get_logger().info(f"recording into {self._bag.writer.path}")
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state) -> TransitionCallbackReturn:
        self._take()
        self._active = False
        return TransitionCallbackReturn.SUCCESS

    def _close(self) -> None:
        if self._bag is None:
            return
        self._take()
        for timer in self._ticking:
            self.destroy_timer(timer)
        self._messages.close()
        self._bag.close(
            {
                "lost": json.dumps(self._messages.lost),
                "not recorded": json.dumps(self._not_recorded),
            }
        )
        self._bag = self._messages = self._tf = None

    # topics

    def _look_for_topics(self) -> None:
        if self._bag is None:
            return  # a last tick of the timer, when all is closed
        for topic, types in self.get_topic_names_and_types():
            if topic in {
                *self._messages.topics,
                *self._refused,
                *self._made,
            } or not self._selection.matches(topic):
                continue
            try:
                message_class(types[0])
                types_for(types[0])
            except (ImportError, AttributeError, ValueError) as error:
                self._refused[topic] = str(error)
                self.get_logger().warning(f"{topic} is not recorded: {error}")
                continue
            self._listen(topic)

    @property
    def _not_recorded(self) -> dict[str, str]:
        """Why messages of a topic are not in the bag."""
        return {**self._refused, **self._messages.strange}

    def _listen(self, topic: str, keep: bool = True) -> None:
        if keep:
            self._kept.add(topic)
            self._messages.listen(topic, partial(self._bag.add_offered, topic))
        else:
            self._messages.listen(topic)

    # messages

    def _take(self) -> None:
        if self._bag is None:
            return
        for message in self._messages.take():
            if message.topic == self._clock_topic and self._simulated:
                self.refusals.accepts(message.topic, self._tell_time, message.data)
            if not self._active or message.topic not in self._kept:
                continue
            if self._simulated and not self._log_time.now_ns:
                self._early.append(message)  # latched before time began
                continue
            for one in (*self._early, message):
                self.refusals.accepts(one.topic, self._write, one)
            self._early.clear()

    def _tell_time(self, data: bytes) -> None:
        self._log_time.take(self._clock_topic, leading_stamp_ns(data))

    def _write(self, message: RawMessage) -> None:
        log_ns = self._log_time.now_ns if self._simulated else message.received_ns
        stamp_ns = self._bag.stamp_ns(message.topic, message.data)
        self._bag.write(
            message.topic, log_ns, log_ns if stamp_ns is None else stamp_ns, message.data
        )
        if self.p["transforms"]:
            self._show(message.topic, log_ns, message.data)

    def _show(self, topic: str, log_ns: int, data: bytes) -> None:
        """What viewers need besides, unless it is published."""
        if self._tf is None:
            there = {
                *self._messages.topics,
                *(name for name, _ in self.get_topic_names_and_types()),
            }
            self._tf = TfMessages(
                self.p["frame_id"], self.p["transform_rate"], there, namespace_of(self)
            )
            for name, (type_name, qos) in self._tf.topics.items():
                self._made.add(name)
                self._bag.add_own(name, type_name, qos)
        for name, message in self._tf.messages(topic, log_ns, data):
            self._bag.write(name, log_ns, log_ns, message)

    def _describe(self):
        if self._bag is None:
            return WARN, "no bag is open", {}
        values = {
            "bag": self._bag.writer.path,
            "lost": sum(self._messages.lost.values()),
            **self._bag.writer.counts,
        }
        values |= {f"{topic} lost": count for topic, count in self._messages.lost.items()}
        if self._bag.failure:
            return ERROR, self._bag.failure, values
        if missed := [
            f"{topic}: {count} messages were lost" for topic, count in self._messages.lost.items()
        ]:
            return WARN, "; ".join([*missed, *self._not_recorded.values()]), values
        if self._not_recorded:
            return WARN, f"not recorded: {'; '.join(self._not_recorded.values())}", values
        return OK, "recording" if self._active else "paused", values


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"notes: '{text}' is not name=text")
    return name, value


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill recorder`."""
    run(lambda: [Recorder()], args)


if __name__ == "__main__":
    main()
