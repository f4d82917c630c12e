"""A report: one HTML page of a run, made from its bag, with tables, figures and a replay in three
dimensions; without ROS.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
