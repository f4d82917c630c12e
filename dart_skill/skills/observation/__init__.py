"""From what the sensors saw to a demonstration, and to what became of a throw."""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
