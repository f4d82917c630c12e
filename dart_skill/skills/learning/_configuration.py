"""Named configurations of the throwing skill: which frames, how many components, how
demonstrations are aligned and weighted.

`thesis` is what chapter 8 describes; `default` is DS-GMR as the thesis means it, with what LADDER
names in addition; `intervals` is the plainest that throws as well. docs/throwing.md holds the
comparison.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dart_skill.arm import KnownRegistration, Registration
from dart_skill.common.constants import PARTITIONS
from dart_skill.common.surface import Game, game_at

FRAMES = ("thesis", "start", "azimuth", "azimuth_target")
ALIGNMENTS = ("start", "release")
DRIVES = ("time", "state")
CHANGED = ("components", "frames", "stiffness", "orientation_stiffness")
"""What `changed` may change, beside the bounds of the stiffness."""
RELEASES = ("shown", "farthest")


@dataclass(frozen=True)
class SkillConfiguration:
    """How demonstrations become a model and a model becomes a plan.

    Parameters
    ----------
    name
        Str, default "default".
    frames
        Task frames, default "azimuth_target". "thesis": those of (8.2). "start": those of (8.3).
        "azimuth": one frame at the base, turned to the target's azimuth. "azimuth_target": that
        frame and one at the target.
    components
        Int, default 16. `n_components` of the DS-GMR.
    partition
        "time" or "em", default "em". `partition` of the DS-GMR.
    overlap
        Float, default 0.7. `overlap` of the DS-GMR; 0: that of the DS-GMR, which depends on the
        partition.
    inputs_once
        Bool, default True. Whether time and distance, which all frames see alike, count once in
        the product of the frames (`n_shared` of the mixture), or once for each frame, as (7.21)
        stands.
    distance_input
        Bool, default True. Whether the distance of the target is an input of the regression
        besides time.
    alignment
        "release" or "start", default "release". Instant that all demonstrations share: the release
        of the ball or the start of the motion.
    relabel
        Bool, default True. Whether the task parameter of a demonstration is where its ball landed,
        and not where the basket stood.
    width
        Float, default 0 [m]. Demonstrations are weighted by a Gaussian of this width of the
        distance between their target and the new one (8.4.2); 0: all count alike.
    widths
        Floats [m], default none. The width is chosen among these by cross-validation.
    nearest
        Int, default 0. Number of the nearest demonstrations that are used (8.4.2); 0: all.
    solve_aim
        Bool, default True. Whether the task parameter is changed until the plan's predicted
        landing is on the target.
    stiffness
        Float, default 200 [1/s^2]. kp of (7.19), with critical damping.
    orientation_stiffness
        Float, default 0 [1/s^2]. kp of the orientation, if it is another one; 0: the same.
    stiffness_range
        (least, most) [1/s^2], default empty. The plan's stiffness of the position changes within
        these bounds: high where and in which direction the demonstrations agreed
        (`stiffness_from_covariance`). Empty: it is constant.
    step
        Float, default 0.004 [s]. Of the plan.
    drive
        "time" or "state", default "time". What drives the movement: a clock (`DSGMR`), or the
        state of the arm (`AutonomousDSGMR`, chapter 9).
    release
        "farthest" or "shown", default "farthest". Release where the ball flies farthest, which
        depends least on the instant at which the hand opens, or as demonstrated.
    board
        (x, y, z) [m], default empty. Position of the bull of a board for darts; empty for balls
        and baskets.
    registration
        Of cameras and arm as it was measured before (`dart-skill check arm`), default None. The
        demonstrations correct it; None: they tell it alone.
    """

    name: str = "default"
    frames: str = "azimuth_target"
    components: int = 16
    partition: str = "em"
    distance_input: bool = True
    alignment: str = "release"
    relabel: bool = True
    width: float = 0.0
    widths: tuple[float, ...] = ()
    nearest: int = 0
    solve_aim: bool = True
    stiffness: float = 200.0
    step: float = 0.004
    drive: str = "time"
    release: str = "farthest"
    # left out of a model's name, which its tasks decide anyway
    board: tuple[float, ...] = field(default=(), repr=False)
    # a model's name has these if they are given
    registration: KnownRegistration | None = field(default=None, repr=False)
    orientation_stiffness: float = field(default=0.0, repr=False)
    stiffness_range: tuple[float, ...] = field(default=(), repr=False)
    overlap: float = field(default=0.7, repr=False)
    inputs_once: bool = field(default=True, repr=False)

    def __post_init__(self) -> None:
        if self.frames not in FRAMES:
            raise ValueError(
                f"frames '{self.frames}' is unknown: choose one of {', '.join(FRAMES)}"
            )
        if self.alignment not in ALIGNMENTS:
            raise ValueError(
                f"alignment '{self.alignment}' is unknown: choose one of {', '.join(ALIGNMENTS)}"
            )
        if self.partition not in PARTITIONS:
            raise ValueError(
                f"partition '{self.partition}' is unknown: choose one of {', '.join(PARTITIONS)}"
            )
        if self.drive not in DRIVES:
            raise ValueError(f"drive '{self.drive}' is unknown: choose one of {', '.join(DRIVES)}")
        if self.release not in RELEASES:
            raise ValueError(
                f"release '{self.release}' is unknown: choose one of {', '.join(RELEASES)}"
            )
        for name, least in (
            ("orientation_stiffness", 0.0),
            ("overlap", 0.0),
            ("components", 1),
            ("width", 0.0),
            ("nearest", 0),
            ("stiffness", 1e-6),
            ("step", 1e-4),
        ):
            if not getattr(self, name) >= least:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least {least}")
        object.__setattr__(self, "widths", tuple(float(width) for width in self.widths))
        if not all(width > 0.0 for width in self.widths):
            raise ValueError(f"widths are {self.widths}; all must be positive")

        object.__setattr__(
            self, "stiffness_range", tuple(float(value) for value in self.stiffness_range)
        )
        if self.stiffness_range and not (
            len(self.stiffness_range) == 2
            and 0.0 < self.stiffness_range[0] <= self.stiffness_range[1]
        ):
            raise ValueError(
                f"stiffness_range is {self.stiffness_range}: give the least and the largest"
                " stiffness, or none"
            )
        if self.stiffness_range and self.drive == "state":
            raise ValueError(
                "stiffness_range needs a movement that time drives: the other one knows no"
                " covariance of its attractor"
            )
        object.__setattr__(self, "board", tuple(float(value) for value in self.board))
        game_at(self.board)

    @classmethod
    def from_saved(cls, values: Mapping[str, Any]) -> SkillConfiguration:
        """That of which `dataclasses.asdict` made these values.

        Raises
        ------
        ValueError, TypeError
            For a name that is none, if they make no sense.
        """
        known = values["registration"]
        if known is not None:
            known = KnownRegistration(
                Registration(**known["registration"]), tuple(known["spread"])
            )
        return cls(**{**values, "registration": known})

    @property
    def game(self) -> Game:
        """What is thrown at what."""
        return game_at(self.board)

    @property
    def stiffness_of_features(self) -> float | np.ndarray:
        """kp of x, y, z, alpha, beta: one number, or (5,)."""
        return (
            np.repeat([self.stiffness, self.orientation_stiffness], [3, 2])
            if self.orientation_stiffness
            else self.stiffness
        )

    @property
    def turns(self) -> bool:
        """Whether the frames turn with the target's azimuth."""
        return self.frames.startswith("azimuth")

    def angle_azimuth(self, azimuth: float) -> float:
        """Azimuth of the axes in which alpha and beta are measured [rad]: the thesis measures them
        in the world's.
        """
        return azimuth if self.turns else 0.0


DEFAULT = SkillConfiguration()
THESIS = SkillConfiguration(
    "thesis",
    "start",
    components=3,
    distance_input=False,
    alignment="start",
    relabel=False,
    solve_aim=False,
    release="shown",
    overlap=0.0,
    inputs_once=False,
)
INTERVALS = replace(
    DEFAULT, name="intervals", frames="azimuth", partition="time", overlap=0.0, inputs_once=False
)
CONFIGURATIONS = {
    one.name: one
    for one in (
        DEFAULT,
        INTERVALS,
        THESIS,
        replace(THESIS, name="thesis_local", nearest=3),
        replace(INTERVALS, name="em", components=12, partition="em"),
        # An average of neighbours cannot aim nearer than what was shown, which the farthest
        # release asks for.
        replace(INTERVALS, name="weighted", distance_input=False, width=0.25, release="shown"),
        replace(
            INTERVALS,
            name="cross_validated",
            distance_input=False,
            widths=(0.06, 0.1, 0.15, 0.25, 0.5),
            release="shown",
        ),
        replace(INTERVALS, name="autonomous", drive="state"),
        replace(INTERVALS, name="shown_release", release="shown"),
        replace(INTERVALS, name="two_frames", distance_input=False, frames="azimuth_target"),
    )
}
STEPS = {
    "release_clock": "alignment",
    "where_it_landed": "relabel",
    "turned_frames": "frames",
    "more_components": "components",
    "overlap": "overlap",
    "distance": "distance_input",
    "inputs_once": "inputs_once",
    "solved_aim": "solve_aim",
    "farthest_release": "release",
}
"""What leads from the thesis's configuration to the default one, in this order: what it is called,
and the field of a configuration.
"""


def _ladder() -> dict[str, SkillConfiguration]:
    """That configuration after each step, as `+release_clock`, and the default one without each,
    as `without_release_clock`.
    """
    found: dict[str, SkillConfiguration] = {}
    one = THESIS
    for step, name in STEPS.items():
        one = replace(one, name=f"+{step}", **{name: getattr(DEFAULT, name)})
        without = replace(DEFAULT, name=f"without_{step}", **{name: getattr(THESIS, name)})
        found |= {one.name: one, without.name: without}
    return dict(sorted(found.items(), key=lambda item: item[0].startswith("without")))


LADDER = _ladder()


def changed(
    configuration: SkillConfiguration, parameters: Mapping[str, Any]
) -> tuple[SkillConfiguration, str]:
    """A configuration with parameters of the node skill_learner, and what they change, in words; 0
    and an empty text change nothing.

    Parameters
    ----------
    parameters
        Those of `CHANGED`, least_stiffness and most_stiffness.

    Raises
    ------
    ValueError
        Names one that makes no sense.
    """
    changes = {name: parameters[name] for name in CHANGED if parameters[name]}
    bounds = parameters["least_stiffness"], parameters["most_stiffness"]
    changes |= {"stiffness_range": bounds} if all(bounds) else {}  # one is set before the other
    return replace(configuration, **changes), ", ".join(
        f"{name} {value}" for name, value in changes.items()
    )


def configuration(name: str = "") -> SkillConfiguration:
    """The configuration of that name, also one of LADDER, the default one for an empty name.

    Raises
    ------
    ValueError
        Lists the names there are.
    """
    if not name:
        return DEFAULT
    if name in LADDER:
        return LADDER[name]
    if name not in CONFIGURATIONS:
        raise ValueError(
            f"no configuration '{name}': choose one of {', '.join(sorted(CONFIGURATIONS))}"
        )
    return CONFIGURATIONS[name]
