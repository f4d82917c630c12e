"""What people are told of a skill: on pages, by verbs, and by who asks them to guide the arm."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SkillWords:
    """Words for a skill.

    Parameters
    ----------
    welcome
        What a visitor of the live view reads first.
    shown
        What demonstrations are.
    begin, show
        What a person does who guides the arm, before the movement and with it.
    do
        The button that has the skill carried out once.
    trials
        What that is called, many.
    lessons, tries
        Demonstrations, and trials, that are asked for at first.
    done, failed
        A trial that succeeded, and one that did not.
    off, unseen
        What stands behind an error, and in its place.
    outcome
        What is not known without cameras.
    result
        A trial that succeeded, and one that did not, in a word each.
    lesson
        A lesson that succeeded, in a word.
    unit
        Of errors, its name and how many are a metre.
    """

    welcome: str
    shown: str
    begin: str
    show: str = (
        "show it, tell the hand when to open and close, hold still for a second, press Enter"
    )
    do: str = "Execute"
    trials: str = "trials"
    lessons: int = 8
    done: str = "done"
    failed: str = "failed"
    off: str = "off"
    unseen: str = "not seen"
    outcome: str = "what becomes of it"
    unit: tuple[str, float] = ("mm", 1000.0)
    result: tuple[str, str] = ("done", "failed")
    lesson: str = "shown"
    tries: int = 10
