"""The world that stands in for hardware: the arm, its hand, what it works with, the cameras, and
the people who guide it.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
