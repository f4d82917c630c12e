"""Settings of a skill, from its YAML file: strict, so that a key with a typing error is not
silently left out.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dart_skill.common.constants import PARTITIONS

S = TypeVar("S", bound="SkillSettings")
COMPONENTS = (4, 6, 8, 12, 16, 20, 24, 32)
"""Numbers of components among which one is chosen on request."""
OVERLAP = 0.7
"""Overlap of the components in time, relative to their intervals, after EM: that of throws."""
BIC, CROSS_VALIDATION = "bic", "cross_validation"
"""How: by the Bayesian information criterion, or by what the others teach for each demonstration
that is left out.
"""


def check_way(way: str) -> None:
    """ValueError for a way to choose the number of components that there is not; an empty one
    chooses nothing.
    """
    if way not in ("", BIC, CROSS_VALIDATION):
        raise ValueError(
            f"choose_components is '{way}': give {BIC}, {CROSS_VALIDATION}, or nothing"
        )


@dataclass(frozen=True)
class SkillSettings:
    """How demonstrations become a model and a model becomes a plan. A skill may have more of them,
    in a class derived from this one.

    Parameters
    ----------
    components
        Int. `n_components` of the DS-GMR.
    stiffness, orientation_stiffness
        Kp of (7.19) [1/s^2], with critical damping.
    step
        Of a plan [s].
    start_speed, stop_speed
        Thresholds of the hand's speed between which a movement lies [m/s].
    shortest
        Shorter movements are ignored [s].
    settle
        The hand is at rest for so long after the movement, which is learned, too [s].
    grip_time
        The fingers have closed, or opened, so long after they were told [s].
    prior
        How many demonstrations it takes to believe that one direction varies less than another.
    least_demonstrations
        That are learned from.
    partition
        "time", every component has its own interval of the same length, or "em", EM finds which
        samples belong to it, and `TaskParameterisedMixture.fit_around` follows, as in throws.
    frames
        Names of the task frames that count (`Skill.frame_names`); empty: all.
    stiffness_range
        Least and largest stiffness of the position [1/s^2]; between them it is high where and in
        which direction the demonstrations agreed (`stiffness_from_covariance`). Empty: it is
        constant. Of a plan that is made beforehand.
    """

    components: int = 12
    stiffness: float = 400.0
    orientation_stiffness: float = 400.0
    step: float = 0.004
    start_speed: float = 0.05
    stop_speed: float = 0.02
    shortest: float = 0.3
    settle: float = 0.2
    grip_time: float = 0.1
    prior: float = 2.0
    least_demonstrations: int = 2
    # the names of models have these three only where they are given
    partition: str = field(default="time", repr=False)
    frames: tuple[str, ...] = field(default=(), repr=False)
    stiffness_range: tuple[float, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if isinstance(value, bool | str) or one.name == "frames" or value == ():
                continue
            if not (np.isfinite(value).all() and np.min(value) >= 0.0):
                raise ValueError(f"{one.name} is {value}; it must be finite and not negative")
        for name in (
            "components",
            "stiffness",
            "orientation_stiffness",
            "step",
            "least_demonstrations",
        ):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.partition not in PARTITIONS:
            raise ValueError(
                f"partition is '{self.partition}': give one of {', '.join(PARTITIONS)}"
            )
        bounds = self.stiffness_range
        if bounds and not (len(bounds) == 2 and 0.0 < bounds[0] <= bounds[1]):
            raise ValueError(
                f"stiffness_range is {bounds}: give the least and the largest stiffness, or none"
            )
        if not all(isinstance(name, str) for name in self.frames):
            raise ValueError(f"frames are {self.frames}: give names, or none")

    @property
    def rarely_given(self) -> tuple[tuple | str, ...]:
        """Settings that the name of a model has only where they are given."""
        return tuple(
            value
            for value in (self.frames, self.stiffness_range, self.partition)
            if value and value != "time"
        )

    @property
    def overlap(self) -> float | None:
        """`overlap` of the DS-GMR: after EM that of throws, else None."""
        return OVERLAP if self.partition == "em" else None

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the settings that a file may have. Default: all of the class."""
        return tuple(one.name for one in fields(cls))

    @classmethod
    def from_file(cls: type[S], path: Path) -> S:
        """Settings of a YAML file.

        Raises
        ------
        ValueError
            Names what is unknown, missing, or no number.
        """
        import yaml

        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except yaml.YAMLError as error:
            raise ValueError(f"{path} is not YAML: {error}") from error
        if not isinstance(content, dict):
            raise ValueError(f"{path} holds no settings: write one 'name: value' in a line")
        return cls.from_mapping(content, str(path))

    @classmethod
    def from_mapping(cls: type[S], content: dict[str, Any], where: str) -> S:
        """The same from names and values; `where` they stand, for messages.

        Parameters
        ----------
        content
            Values by name.

        Raises
        ------
        ValueError
            For a name or value that cannot be.
        """
        known = {one.name: one for one in fields(cls) if one.name in cls.names()}
        if unknown := sorted(set(content) - set(known)):
            raise ValueError(
                f"{where}: {', '.join(map(str, unknown))} is no setting; there are"
                f" {', '.join(known)}"
            )
        values: dict[str, Any] = {}
        for name, value in content.items():
            wanted = _kind_of(known[name].default)
            if not isinstance(value, wanted) or (isinstance(value, bool) and bool not in wanted):
                raise ValueError(
                    f"{where}: {name} is {value!r}; it must be of type"
                    f" {' or '.join(one.__name__ for one in wanted)}"
                )
            values[name] = tuple(value) if isinstance(value, list) else value
        try:
            return cls(**values)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error


@dataclass(frozen=True)
class ReactiveSkillSettings(SkillSettings):
    """Settings of a skill that reacts (`Skill.reacts`), beside those of every skill:

    Parameters
    ----------
    oldest
        Of the newest pose of a body [s]; an older one stops the motion.
    follow_on
        The hand stays with the bodies so long after the end of what was shown [s].
    slowest, fastest
        Rates of the phase; 1 is the pace that was shown. What is held back waits, what is pushed
        ahead skips.
    time_constant
        Of the correction of the phase [s].
    ignored
        What a hand lags or leads by without a disturbance [s].
    catch_up
        A hand that was left behind catches up no faster than so much above the speed of the motion
        [m/s].
    """

    oldest: float = 0.15
    follow_on: float = 0.3
    slowest: float = 0.01
    fastest: float = 1.3
    time_constant: float = 0.02
    ignored: float = 0.01
    catch_up: float = 0.25

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("oldest", "slowest", "time_constant", "catch_up"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        if not self.slowest < 1.0 < self.fastest:
            raise ValueError(
                f"slowest is {self.slowest} and fastest {self.fastest}; they must lie on either"
                " side of 1, the pace that was shown"
            )


def _kind_of(default: object) -> tuple[type, ...]:
    """Types that the value of a setting with this default may have in a file."""
    assert default is not MISSING, "a setting has a default"
    if isinstance(default, float):
        return (float, int)
    if isinstance(default, tuple):
        return (list, tuple)
    return (type(default),)
