"""A part of a skill that is chosen by its name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dart_skill.skills.protocol._skill import Skill


class Part:
    """Base of what a setting of a skill chooses by name: how movements are encoded, what is solved
    for before a plan, how trials are learned from, what chooses the next one.
    """

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        """Why this part is of no use to a skill; empty where it is. Default: it is."""
        return ""
