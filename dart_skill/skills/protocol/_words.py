"""What people are told of a skill, on pages, by verbs, and by who asks them to guide the arm, and
how its bodies look in viewers.
"""

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
    stand, load, start, clear
        What a person does beside a real arm that practises: with the bodies that stand somewhere,
        with the one in the hand, with the one whose motion starts a trial, and with the one at the
        hand afterwards (`SkillBase.standing`, `in_hand`, `started_by`, `in_the_way`).
    then
        What happens when that person has stood back.
    do
        The button that has the skill carried out once.
    trials
        What that is called, many.
    lessons, tries
        Demonstrations, and trials, that are asked for at first.
    demo_seconds
        What a demo with so many takes over nodes, on two idle cores [s]; 0: not measured.
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
    stand: str = ""
    load: str = ""
    start: str = ""
    clear: str = ""
    then: str = "the arm begins"
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
    demo_seconds: float = 0.0

    @property
    def trial(self) -> str:
        """One of the `trials`."""
        return self.trials.removesuffix("s")


KINDS = {"box": 3, "sphere": 1, "cylinder": 2, "cup": 3, "board": 0}
"""Each with the number of its lengths."""


@dataclass(frozen=True)
class Solid:
    """A part of a body, in the frame of the body.

    Parameters
    ----------
    kind
        "box" with its edges; "sphere" with its radius; "cylinder" along z with radius and length;
        "cup", upright, open at the top, the middle of its floor at its centre, with inner radius,
        height and thickness; "board", a dart board that faces against its x axis.
    lengths
        Of the kind [m].
    centre
        Of the solid (3,) [m].
    """

    kind: str
    lengths: tuple[float, ...] = ()
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no solid '{self.kind}': choose one of {', '.join(KINDS)}")
        if len(self.lengths) != KINDS[self.kind] or not all(
            length > 0.0 for length in self.lengths
        ):
            raise ValueError(
                f"a {self.kind} has {KINDS[self.kind]} positive lengths [m], not {self.lengths}"
            )
