"""The live view: a page that shows the arm, what it has learned and what it does, with controls; without ROS.

It needs viser, an optional package (requirements/optional.txt). `open_server` gives a server, `Scene` fills it, `Panel` adds the controls.
What is used of it is imported only then: the command line opens bags in Rerun without it (`rerun_bag`).
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dart_skill.view.panel import Knob, NodeStatus, Panel, Request
    from dart_skill.view.scene import Scene
    from dart_skill.view.server import ViewUnavailable, open_server, url_of

__all__ = ["Knob", "NodeStatus", "Panel", "Request", "Scene", "ViewUnavailable", "open_server", "url_of"]

_HOME = {
    **dict.fromkeys(("Knob", "NodeStatus", "Panel", "Request"), "panel"),
    "Scene": "scene",
    **dict.fromkeys(("ViewUnavailable", "open_server", "url_of"), "server"),
}


def __getattr__(name: str) -> Any:
    """Every name of `__all__` from the module that has it (PEP 562)."""
    if name in _HOME:
        globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
        return globals()[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
