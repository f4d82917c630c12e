"""A page of the live view without a browser: it speaks viser's websocket protocol, sees what is
sent, clicks and drags.
"""

import time
from urllib.parse import parse_qs, urlsplit

import msgspec.msgpack
import numpy as np
import viser
import zstandard
from viser import _messages
from websockets.sync.client import connect

EYE = (0.0, -5.0, 2.0)
"""Where the page looks from."""


class PageClient:
    """What a browser would know. url: of the page; origin: what a browser would say that the page
    comes from.
    """

    def __init__(self, url, origin=None):
        protocol = f"viser-v{viser.__version__}"
        address = parse_qs(urlsplit(url).query).get("websocket", [url.replace("http", "ws", 1)])[0]
        self._socket = connect(
            address,
            subprotocols=[protocol],
            origin=origin,
            max_size=None,
            compression=None,
            ping_interval=None,
        )
        self.texts, self.controls, self.places, self.nodes, self.commands = {}, {}, {}, {}, {}
        self.looks = 0  # times that the page was told where to look from
        camera = {
            "wxyz": (1.0, 0.0, 0.0, 0.0),
            "position": EYE,
            "look_at": (0.0, 0.0, 0.0),
            "up_direction": (0.0, 0.0, 1.0),
        }
        self.send(
            _messages.ViewerCameraMessage(
                **camera, fov=1.0, near=0.1, far=100.0, image_height=600, image_width=800
            )
        )

    def send(self, message):
        """A message of viser's protocol."""
        self._socket.send(msgspec.msgpack.encode(message.as_serializable_dict()))

    def send_bytes(self, data):
        """What is no message of viser's protocol."""
        self._socket.send(data)

    def click(self, label):
        """A click on a button."""
        self.send(_messages.GuiUpdateMessage(self._uuid(label), {"value": True}))

    def press(self, command):
        """The key of a command."""
        self.wait_for(lambda: command in self.commands.values(), what=f"a key for '{command}'")
        uuid = next(uuid for uuid, label in self.commands.items() if label == command)
        self.send(_messages.CommandTriggerMessage(uuid))

    def set(self, label, value):
        """A new value of a slider, a number, a choice or a check box."""
        self.send(_messages.GuiUpdateMessage(self._uuid(label), {"value": value}))

    def drag(self, name, start, *places, let_go=True, modifier=None):
        """Take hold of a node at a point (3,) of it, move the pointer over each place (3,), and
        let go; modifier: a key that is held.
        """
        steps = [("start", start), *(("update", place) for place in places)] + [
            ("end", places[-1])
        ] * let_go
        for phase, place in steps:
            grip, pointer = (tuple(float(x) for x in point) for point in (start, place))
            self.send(
                _messages.SceneNodeDragMessage(
                    phase, name, None, grip, (0.5, 0.5), pointer, (0.5, 0.5), "left", modifier
                )
            )

    def is_disabled(self, label):
        """Whether a button cannot be clicked."""
        return self.controls[self._uuid(label)]["disabled"]

    def says(self, text):
        """Whether a text stands somewhere in the panel."""
        return any(text in content for content in self.texts.values())

    def wait_for(self, condition, limit=30.0, what="what was waited for", meanwhile=lambda: None):
        """Listen until the condition holds; `meanwhile` is called again and again."""
        until = time.monotonic() + limit
        while not condition():
            if time.monotonic() > until:
                said = what() if callable(what) else what
                raise AssertionError(
                    f"{said} did not come in {limit:.0f} s; the panel says"
                    f" {list(self.texts.values())[:1]}"
                )
            self.listen(0.05)
            meanwhile()

    def _uuid(self, label):
        self.wait_for(
            lambda: any(one["label"] == label for one in self.controls.values()),
            what=f"a control '{label}'",
        )
        return next(uuid for uuid, one in self.controls.items() if one["label"] == label)

    def listen(self, seconds=0.001):
        """Take all that has been sent, and what comes in so long a time if nothing has."""
        try:
            while True:
                frame = self._socket.recv(timeout=seconds)
                size = int.from_bytes(frame[8:16], "little")
                for message in msgspec.msgpack.decode(
                    zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
                )["messages"]:
                    self._take(message)
                seconds = 0.0
        except TimeoutError:
            return

    def _take(self, message):
        kind = message["type"]
        if kind == "GuiHtmlMessage":
            self.texts[message["uuid"]] = message["props"]["content"]
        elif kind.startswith("Gui") and "label" in message.get("props", {}):
            self.controls[message["uuid"]] = {"disabled": False, **message["props"]}
        elif kind == "GuiUpdateMessage":
            self.texts |= (
                {message["uuid"]: message["updates"]["content"]}
                if "content" in message["updates"]
                else {}
            )
            self.controls.get(message["uuid"], {}).update(message["updates"])
        elif kind == "RegisterCommandMessage":
            self.commands[message["uuid"]] = message["props"]["label"]
        elif kind == "SetCameraPositionMessage":
            self.looks += 1
        elif kind == "SetPositionMessage":
            self.places[message["name"]] = np.array(message["position"])
        elif "props" in message and "name" in message:
            self.nodes[message["name"]] = kind

    def close(self):
        """Leave the page."""
        self._socket.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
