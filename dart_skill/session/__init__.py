"""Teaching, learning and throwing in one process without ROS, learning from a bag, and the results of
a run.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
