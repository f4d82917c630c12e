"""A live server for Foxglove, through its own foxglove-sdk: messages as they are, in CDR, with the
definitions of their types.

Foxglove connects to it as to a robot ("Open connection", Foxglove WebSocket). Clients cannot
send anything to it: it offers no services and no parameters, and takes no messages.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from dart_skill.common.extras import optional
from dart_skill.recording import BagReader, definition

HOST = "127.0.0.1"
FOXGLOVE_PORT = 8765
"""The port that Foxglove suggests."""
NAP = 0.05
"""Longest wait for the end of a playback [s]."""


class FoxgloveServer:
    """A server of topics; a context manager.

    Parameters
    ----------
    port
        0 takes any free one.
    host
        0.0.0.0 serves everybody who reaches the machine.

    Raises
    ------
    ModuleNotFoundError
        Without foxglove-sdk, OSError where the port is taken.
    """

    def __init__(self, port: int = FOXGLOVE_PORT, host: str = HOST, name: str = "dart_skill"):
        self._sdk = optional("foxglove")
        self._context = self._sdk.Context()
        self._channels: dict[str, Any] = {}
        self._kept: dict[str, tuple[bytes, int]] = {}
        self._lasting: set[str] = set()
        self._lock = threading.Lock()
        try:
            self._server = self._sdk.start_server(
                name=name, host=host, port=port, context=self._context, server_listener=_Listener(self._on_subscribe),
                supported_encodings=["cdr"], message_backlog_size=4096,
            )  # fmt: skip
        except RuntimeError as error:  # as the SDK calls whatever goes wrong
            raise OSError(
                f"port {port} on {host} cannot be served ({error}): choose another one with --port"
            ) from error
        self.host, self.port = host, int(self._server.port)

    @property
    def url(self) -> str:
        """What Foxglove wants to know."""
        return f"ws://{self.host}:{self.port}"

    @property
    def topics(self) -> list[str]:
        return list(self._channels)

    def add_topic(self, topic: str, type_name: str, text: str, lasting: bool = False) -> None:
        """A topic of a type, with its definition (`recording.definition`).

        Parameters
        ----------
        lasting
            Clients that come later get the last message, too.
        text
            The definition.
        """
        schema = self._sdk.Schema(name=type_name, encoding="ros2msg", data=text.encode())
        self._channels[topic] = self._sdk.Channel(
            topic, schema=schema, message_encoding="cdr", context=self._context
        )
        if lasting:
            self._lasting.add(topic)

    def publish(self, topic: str, data: bytes, stamp_ns: int) -> None:
        """A serialised message, with the time of its log [ns].

        Parameters
        ----------
        topic
            Its name.
        """
        if topic in self._lasting:
            with self._lock:
                self._kept[topic] = data, stamp_ns
        self._channels[topic].log(data, log_time=stamp_ns)

    def close(self) -> None:
        self._server.stop()

    def __enter__(self) -> FoxgloveServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _on_subscribe(self, topic: str) -> None:
        """In a thread of the SDK, after the client was added."""
        with self._lock:
            kept = self._kept.get(topic)
        if kept is not None:
            self._channels[topic].log(kept[0], log_time=kept[1])


class _Listener:
    """What the SDK calls; all but one of its events are of no interest here."""

    def __init__(self, on_subscribe: Callable[[str], None]):
        self._subscribed = on_subscribe

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._subscribed(channel.topic)

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name.startswith("on_"):
            return lambda *_: None
        raise AttributeError(name)


def serve_bag(
    bag: BagReader,
    server: FoxgloveServer,
    rate: float = 1.0,
    stopped: Callable[[], bool] = lambda: False,
) -> int:
    """Publish the messages of a bag at the pace of their log times, and go on until all are out,
    or it is stopped; how many were.

    Parameters
    ----------
    rate
        2 is twice as fast, 0 as fast as possible. A topic whose type the bag does not define is
        left out.
    server
        To publish with.
    """
    for name in set(_shown(bag)) - set(server.topics):
        server.add_topic(
            name,
            bag.topics[name].type_name,
            definition(bag.types, bag.topics[name].type_name),
            _is_lasting(bag, name),
        )
    begun, count = time.monotonic(), 0
    for message in bag.messages(server.topics, decode=False):
        due = begun + (message.stamp_ns - bag.start_ns) * 1e-9 / rate if rate else 0.0
        while (wait := due - time.monotonic()) > 0.0 and not stopped():
            time.sleep(min(wait, NAP))
        if stopped():
            break
        server.publish(message.topic, message.data, message.stamp_ns)
        count += 1
    return count


def _shown(bag: BagReader) -> Iterator[str]:
    for name, topic in sorted(bag.topics.items()):
        if topic.type_name in bag.types.fielddefs and topic.encoding == "cdr":
            yield name


def _is_lasting(bag: BagReader, topic: str) -> bool:
    """Whether a publisher kept its last message for subscribers that came later."""
    return any("TRANSIENT_LOCAL" in str(profile.durability) for profile in bag.topics[topic].qos)
