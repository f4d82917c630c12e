"""Settings of skills that throw, and named changes of them: which frames, how many components, how
demonstrations are aligned and weighted.

`thesis` is what chapter 8 describes; `default` is DS-GMR as the thesis means it, with what STEPS
names in addition; `intervals` is the plainest that throws as well. docs/throwing.md holds the
comparison.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from dart_skill.common.surface import Game, game_at
from dart_skill.skills.protocol._settings import OF_REACTING, SkillSettings

FRAMES = (("base", "target"), ("start", "target"), ("azimuth",), ("azimuth", "target"))
"""Task frames that a throw may have: those of (8.2), those of (8.3), one at the base that is
turned to the azimuth of the target, or that one and one at the target.
"""
ALIGNMENTS = ("start", "release")
"""Instants that all demonstrations may share."""
PRACTICE_METHODS = ("residual", "newton", "bootstrap", "both", "power", "none")
"""Ways to learn from own throws (`skills.practice.PractisingSkill`)."""


@dataclass(frozen=True)
class ThrowSettings(SkillSettings):
    """Beside those of every skill, for skills that throw:

    Parameters
    ----------
    name
        Of the configuration from which they are.
    frames
        One of FRAMES.
    inputs_once
        Whether time and distance, which all frames see alike, count once in the product of the
        frames (`n_shared` of the mixture), or once for each frame, as (7.21) stands.
    distance_input
        Whether the distance of the target is an input of the regression besides time.
    alignment
        "release" or "start": the instant that all demonstrations share, the release of the ball or
        the start of the motion.
    relabel
        Whether the task parameter of a demonstration is where its ball landed, and not where the
        basket stood.
    by_motion
        Whether it is where the motion of the hand led, and not where the fingers and the scatter
        of the hand let the ball land.
    width
        Demonstrations are weighted by a Gaussian of this width of the distance between their
        target and the new one (8.4.2) [m]; 0: all count alike.
    widths
        The width is chosen among these by cross-validation [m]; empty: it is not.
    nearest
        Number of the nearest demonstrations that are used (8.4.2); 0: all.
    board
        Position of the bull of a board for darts (3,) [m]; empty for balls and baskets.
    """

    representation: str = "dsgmr"
    refinement: str = "flight"
    targets: str = "informative"
    frames: tuple[str, ...] = ("azimuth", "target")
    components: int = 16
    stiffness: float = 200.0
    orientation_stiffness: float = 0.0
    name: str = "default"
    distance_input: bool = True
    inputs_once: bool = True
    alignment: str = "release"
    relabel: bool = True
    # a model's name has the places of its tasks
    by_motion: bool = field(default=False, repr=False)
    width: float = 0.0
    widths: tuple[float, ...] = ()
    nearest: int = 0
    # a model's name has the places of its tasks
    board: tuple[float, ...] = field(default=(), repr=False)

    FROM_ELSEWHERE: ClassVar[frozenset[str]] = frozenset({"registration", "name", "board"})
    SIGNED: ClassVar[frozenset[str]] = frozenset({"board"})
    UNUSED: ClassVar[frozenset[str]] = OF_REACTING | {
        "start_speed",
        "stop_speed",
        "shortest",
        "settle",
        "grip_time",
        "prior",
        "least_demonstrations",
    }

    def __post_init__(self) -> None:
        for name in ("widths", "board", "stiffness_range"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        super().__post_init__()
        if self.frames not in FRAMES:
            known = "; ".join(", ".join(names) for names in FRAMES)
            raise ValueError(
                f"frames '{', '.join(self.frames)}' are unknown: choose one of {known}"
            )
        if self.alignment not in ALIGNMENTS:
            raise ValueError(
                f"alignment '{self.alignment}' is unknown: choose one of {', '.join(ALIGNMENTS)}"
            )
        if not all(width > 0.0 for width in self.widths):
            raise ValueError(f"widths are {self.widths}; all must be positive")
        game_at(self.board)

    @property
    def game(self) -> Game:
        """What is thrown at what."""
        return game_at(self.board)

    @property
    def stiffness_of_features(self) -> float | np.ndarray:
        """Kp of x, y, z, alpha, beta: one number, or (5,)."""
        return (
            np.repeat([self.stiffness, self.orientation_stiffness], [3, 2])
            if self.orientation_stiffness
            else self.stiffness
        )

    @property
    def frames_turn(self) -> bool:
        """Whether the frames turn with the target's azimuth."""
        return self.frames[0] == "azimuth"

    def angle_azimuth(self, azimuth: float) -> float:
        """Azimuth of the axes in which alpha and beta are measured [rad]: the thesis measures them
        in the world's.
        """
        return azimuth if self.frames_turn else 0.0


Changes = dict[str, Any]
THESIS: Changes = {
    "frames": ("start", "target"),
    "components": 3,
    "distance_input": False,
    "alignment": "start",
    "relabel": False,
    "refinement": "none",
    "overlap": 0.0,
    "inputs_once": False,
}
"""What the thesis has otherwise."""
INTERVALS: Changes = {
    "frames": ("azimuth",),
    "representation": "intervals",
    "overlap": 0.0,
    "inputs_once": False,
}
"""What the plainest that throws as well has otherwise."""
# An average of neighbours cannot aim nearer than what was shown, which the farthest release asks
# for.
NEIGHBOURS: Changes = {**INTERVALS, "distance_input": False, "refinement": "aim"}
STEPS: dict[str, tuple[str, Any]] = {
    "release_clock": ("alignment", "release"),
    "where_it_landed": ("relabel", True),
    "turned_frames": ("frames", ("azimuth", "target")),
    "more_components": ("components", 16),
    "overlap": ("overlap", 0.7),
    "distance": ("distance_input", True),
    "inputs_once": ("inputs_once", True),
    "solved_aim": ("refinement", "aim"),
    "farthest_release": ("refinement", "flight"),
}
"""What leads from the thesis's configuration to the default one, in this order: what it is called,
the setting, and its value in the default one.
"""
WITHOUT = {"solved_aim": "release", "farthest_release": "aim"}
"""Refinement of the default configuration without a step."""


def _ladder() -> dict[str, Changes]:
    """The thesis's changes after each step, as `+release_clock`, and the default without each, as
    `without_release_clock`.
    """
    up, without = dict(THESIS), {}
    found: dict[str, Changes] = {}
    for step, (name, value) in STEPS.items():
        up = {**up, name: value}
        found[f"+{step}"] = up
        without[f"without_{step}"] = {name: WITHOUT.get(step, THESIS[name])}
    return {**found, **without}


LADDER = {name: {"name": name, **one} for name, one in _ladder().items()}
"""Configurations between that of the thesis and the default one."""
CONFIGURATIONS: dict[str, Changes] = {
    name: {"name": name, **one}
    for name, one in {
        "default": {},
        "intervals": INTERVALS,
        "thesis": THESIS,
        "thesis_local": {**THESIS, "nearest": 3},
        "em": {**INTERVALS, "components": 12, "representation": "dsgmr"},
        "weighted": {**NEIGHBOURS, "width": 0.25},
        "cross_validated": {**NEIGHBOURS, "widths": (0.06, 0.1, 0.15, 0.25, 0.5)},
        "autonomous": {**INTERVALS, "representation": "autonomous"},
        "shown_release": {**INTERVALS, "refinement": "aim"},
        "two_frames": {**INTERVALS, "distance_input": False, "frames": ("azimuth", "target")},
    }.items()
}
"""Named changes of the settings of throws."""
DEFAULT = ThrowSettings()


def configuration(name: str = "") -> ThrowSettings:
    """Settings of balls and baskets in the configuration of that name, the default ones for an
    empty name.

    Raises
    ------
    ValueError
        Lists the names there are.
    """
    known = {**CONFIGURATIONS, **LADDER}
    if name and name not in known:
        raise ValueError(
            f"no configuration '{name}': choose one of {', '.join(sorted(CONFIGURATIONS))}"
        )
    return replace(DEFAULT, **known[name]) if name else DEFAULT
