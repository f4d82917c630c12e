"""The live view: a page that shows the arm, what it has learned and what it does, with controls;
without ROS.

It needs viser, an optional package (requirements/optional.txt). `open_server` gives a server,
`Scene` fills it, `Panel` adds the controls. What is used of it is imported only then: the command
line opens bags in Rerun without it (`rerun`).
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
