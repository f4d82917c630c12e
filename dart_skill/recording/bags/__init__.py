"""Bags of rosbag2 and their message types: read, written, checked, recovered and played.

What is done with whole bags is imported only then, so that each command of `dart-skill bag` starts
as fast as it can.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
