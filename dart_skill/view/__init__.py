"""The live view: a page that shows the arm, what it has learned and what it does, with controls; without ROS.

It needs viser, an optional package (requirements/optional.txt). `open_server` gives a server, `Scene` fills it, `Panel` adds the controls.
What is used of it is imported only then: the command line opens bags in Rerun without it (`rerun_bag`).
"""

from dart_skill.view._held_hand import HeldHand, how_far, turned
from dart_skill.view._holding_controls import DemonstrationRow
from dart_skill.view._panel import Knob, NodeStatus, Panel, PanelWords, Request
from dart_skill.view._scene import Scene
from dart_skill.view._scene_camera import SceneCamera
from dart_skill.view._server import ViewUnavailable, new_token, open_server, url_of, with_token
from dart_skill.view.rerun_bag import RerunUnavailable

__all__ = [
    "DemonstrationRow",
    "HeldHand",
    "Knob",
    "NodeStatus",
    "Panel",
    "PanelWords",
    "Request",
    "RerunUnavailable",
    "Scene",
    "SceneCamera",
    "ViewUnavailable",
    "how_far",
    "new_token",
    "open_server",
    "turned",
    "url_of",
    "with_token",
]
