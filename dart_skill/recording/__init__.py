"""Recordings without ROS: bags in and out, message types, demonstrations.

`bags` has modules that check, recover and play bags, `imports` reads what other laboratories
recorded, `mcap` is the container.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
