"""Carrying out a skill: bodies that move, and a model that is asked while the arm moves."""

from dart_skill.skills.execution._hand_seen import HandSeen
from dart_skill.skills.execution._moving_body import BodyMotion, MovingBody
from dart_skill.skills.execution._reactive_guide import ReactiveGuide, ReactiveSettings

__all__ = ["BodyMotion", "HandSeen", "MovingBody", "ReactiveGuide", "ReactiveSettings"]
