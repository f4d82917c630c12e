"""The live view: a page that shows the arm, what it has learned and what it does, with controls; without ROS.

It needs viser, an optional package (requirements/optional.txt). `open_server` gives a server, `Scene` fills it, `Panel` adds the controls.
"""

from dart_skill.view.panel import Knob, NodeStatus, Panel, Request
from dart_skill.view.scene import Scene
from dart_skill.view.server import ViewUnavailable, open_server, url_of

__all__ = ["Knob", "NodeStatus", "Panel", "Request", "Scene", "ViewUnavailable", "open_server", "url_of"]
