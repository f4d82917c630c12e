"""The WAM: its description, its URDF, the controller's model of it, and the impedance law."""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
