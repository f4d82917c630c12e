"""Darts: the board, the thrower's spread, where to aim (thesis chapter 6).

All lengths are in millimetres. The origin is the centre of the bull; x points to the right and y
up, as the thrower sees the board. A dart lands at aim + bias + N(0, covariance). A bed is an area
of the board with one score, such as treble 20.
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
