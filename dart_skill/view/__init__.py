"""The live view: a page that shows the arm, what it has learned and what it does, with controls;
without ROS.

It needs viser, an optional package (requirements/optional.txt). `open_server` gives a server,
`Scene` fills it, `Panel` adds the controls. What is used of it is imported only then: the command
line opens bags in Rerun without it (`rerun`).
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.view._foxglove_server import FOXGLOVE_PORT, FoxgloveServer, serve_bag
    from dart_skill.view._held_hand import HeldHand, how_far, turned
    from dart_skill.view._holding_controls import DemonstrationRow
    from dart_skill.view._panel import Knob, NodeStatus, Panel, Request
    from dart_skill.view._scene import Scene
    from dart_skill.view._scene_camera import SceneCamera
    from dart_skill.view._server import ViewUnavailable, new_token, open_server, url_of, with_token
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_foxglove_server": "FOXGLOVE_PORT FoxgloveServer serve_bag",
            "_held_hand": "HeldHand how_far turned",
            "_holding_controls": "DemonstrationRow",
            "_panel": "Knob NodeStatus Panel Request",
            "_scene": "Scene",
            "_scene_camera": "SceneCamera",
            "_server": "ViewUnavailable new_token open_server url_of with_token",
        },
    )

__all__ = [
    "DemonstrationRow",
    "FOXGLOVE_PORT",
    "FoxgloveServer",
    "HeldHand",
    "Knob",
    "NodeStatus",
    "Panel",
    "Request",
    "Scene",
    "SceneCamera",
    "ViewUnavailable",
    "how_far",
    "new_token",
    "open_server",
    "serve_bag",
    "turned",
    "url_of",
    "with_token",
]
