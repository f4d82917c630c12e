"""A plain client of Foxglove's WebSocket protocol: what an application would know of a server."""

import json
import time

from websockets.sync.client import connect

PROTOCOL, MESSAGE = "foxglove.sdk.v1", 1
AGAIN = 2.0
"""foxglove-sdk may know a channel a moment later than it tells of it, and forgets who asked for it
too early: it is asked again [s].
"""


class FoxgloveClient:
    """What a server tells: `info`, `channels` by topic, and `messages` of the topics that it was
    asked for: pairs of topic and bytes.
    """

    def __init__(self, url):
        self._socket = connect(url, subprotocols=[PROTOCOL], max_size=None)
        self.info, self.channels, self.messages, self._asked = {}, {}, [], {}
        self._asked_at = 0.0

    def ask_for(self, topic):
        """Subscribe to a topic that was advertised."""
        number = len(self._asked) + 1
        self._asked[number] = topic
        self._asked_at = time.monotonic()
        wanted = {
            "op": "subscribe",
            "subscriptions": [{"id": number, "channelId": self.channels[topic]["id"]}],
        }
        self._socket.send(json.dumps(wanted))

    def hear_until(self, done, patience=60.0, meanwhile=lambda: None):
        """Take in what comes until done() holds; meanwhile is called again and again."""
        end = time.monotonic() + patience
        while not done():
            assert time.monotonic() < end, (
                f"not within {patience} s; heard of {sorted(self.channels)}, {len(self.messages)}"
                " messages"
            )
            meanwhile()
            if time.monotonic() - self._asked_at > AGAIN:
                for topic in set(self._asked.values()) - {topic for topic, _ in self.messages}:
                    self.ask_for(topic)
            try:
                self._take(self._socket.recv(timeout=0.02))
            except TimeoutError:
                continue

    def close(self):
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _take(self, data):
        if isinstance(data, bytes):
            # opcode, number of the subscription (4 bytes), log time (8 bytes), message
            if data[0] == MESSAGE:
                self.messages.append((self._asked[int.from_bytes(data[1:5], "little")], data[13:]))
            return
        told = json.loads(data)
        if told["op"] == "serverInfo":
            self.info = told
        elif told["op"] == "advertise":
            self.channels |= {channel["topic"]: channel for channel in told["channels"]}
