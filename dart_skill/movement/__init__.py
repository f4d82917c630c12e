"""Movements: attractors, task frames, task-parameterised mixtures, DS-GMR, movement primitives,
orientation and segmentation (thesis 7 and 8).
"""

from dart_skill.common.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
