"""Settings of a skill, from its YAML file: strict, so that a key with a typing error is not
silently left out.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from dart_skill.arm import KnownRegistration, Registration
from dart_skill.common.configuration import read_yaml
from dart_skill.common.entries import ConfigurationError

S = TypeVar("S", bound="SkillSettings")
COMPONENTS = (4, 6, 8, 12, 16, 20, 24, 32)
"""Numbers of components among which one is chosen on request."""
BIC = "bic"
"""Choice of the number of components by the Bayesian information criterion."""
CROSS_VALIDATION = "cross_validation"
"""Choice by what the others teach for each demonstration that is left out."""
POSITIVE = (
    "components",
    "stiffness",
    "step",
    "least_demonstrations",
    "oldest",
    "slowest",
    "time_constant",
    "tolerated",
    "catch_up",
)
"""Settings that must be more than 0."""
OF_REACTING = frozenset(
    {
        "oldest",
        "follow_on",
        "slowest",
        "fastest",
        "time_constant",
        "ignored",
        "tolerated",
        "catch_up",
    }
)
"""Settings of a movement that the state drives."""


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
    representation
        Name of how movements are encoded (`part_names("representation")`): "intervals", mixtures
        whose components have equal intervals of time; "dsgmr", EM finds them; "pose", on the
        manifold of positions and orientations; "per_step", a Gaussian at each step of time there;
        "autonomous", driven by the state of the arm; "dmp" and "pose_dmp", movement primitives, of
        which `components` are the kernels; "rhythmic", one that repeats.
    refinement
        Name of what is solved for before a plan is made: "none"; of what is thrown, "aim",
        "release" or both, "flight".
    practice
        Name of how own trials are learned from: "residual", what repeats in the misses is taken
        out; "bootstrap", a trial is one more demonstration; "none". Throws have more.
    targets
        Name of what chooses the next trial of practice: "drawn"; of throws "informative", of darts
        "best_aim".
    components
        Int. `n_components` of the DS-GMR.
    overlap
        Standard deviation of components that EM found, relative to their intervals; 0: as EM has
        it.
    stiffness, orientation_stiffness
        Kp of (7.19) [1/s^2], with critical damping; 0 for the orientation: the same.
    stiffness_range
        Least and largest stiffness of the position [1/s^2]; between them it is high where and in
        which direction the demonstrations agreed (`stiffness_from_covariance`). Empty: it is
        constant. Of a plan that is made beforehand.
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
    frames
        Names of the task frames that count (`Skill.frame_names`); empty: all.
    oldest
        Of the newest pose of a body [s]; an older one stops a motion that reacts.
    follow_on
        The hand stays with the bodies so long after the end of what was shown [s].
    slowest, fastest
        Rates of the phase of a movement that the state drives; 1 is the pace that was shown. What
        is held back waits, what is pushed ahead skips.
    time_constant
        Of the correction of the phase [s].
    ignored
        What a hand lags or leads by without a disturbance [s].
    tolerated
        How far a hand may be beside its way before the movement waits for it, in standard
        deviations of what was shown.
    catch_up
        A hand that was left behind catches up no faster than so much above the speed of the motion
        [m/s].
    registration
        Of cameras and arm as it was measured before (`dart-skill check arm`), which the
        demonstrations correct; None: they tell it alone.
    """

    representation: str = "intervals"
    refinement: str = "none"
    practice: str = "residual"
    targets: str = "drawn"
    components: int = 12
    overlap: float = 0.7
    stiffness: float = 400.0
    orientation_stiffness: float = 400.0
    stiffness_range: tuple[float, ...] = ()
    step: float = 0.004
    start_speed: float = 0.05
    stop_speed: float = 0.02
    shortest: float = 0.3
    settle: float = 0.2
    grip_time: float = 0.1
    prior: float = 2.0
    least_demonstrations: int = 2
    frames: tuple[str, ...] = ()
    oldest: float = 0.15
    follow_on: float = 0.3
    slowest: float = 0.01
    fastest: float = 1.3
    time_constant: float = 0.02
    ignored: float = 0.01
    tolerated: float = 3.0
    catch_up: float = 0.25

    registration: KnownRegistration | None = None

    FROM_ELSEWHERE: ClassVar[frozenset[str]] = frozenset({"registration"})
    """What no file of settings has."""
    SIGNED: ClassVar[frozenset[str]] = frozenset()
    """Settings that may be negative."""
    UNUSED: ClassVar[frozenset[str]] = frozenset()
    """Settings that are without effect for the skills of a class, so that no file has them."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if not isinstance(one.default, float | int | tuple) or isinstance(one.default, bool):
                continue
            if isinstance(value, tuple) and all(isinstance(part, str) for part in value):
                continue
            parts = value if isinstance(value, tuple) else (value,)
            if not all(isinstance(part, int | float) for part in parts):
                raise ValueError(f"{one.name} is {value}; it must be of numbers")
            numbers = np.asarray(value, dtype=float)
            if not np.isfinite(numbers).all():
                raise ValueError(f"{one.name} is {value}; it must be finite")
            if one.name not in self.SIGNED and np.min(numbers, initial=0.0) < 0.0:
                raise ValueError(f"{one.name} is {value}; it must be finite and not negative")
        for name in POSITIVE:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        bounds = self.stiffness_range
        if bounds and not (len(bounds) == 2 and 0.0 < bounds[0] <= bounds[1]):
            raise ValueError(
                f"stiffness_range is {bounds}: give the least and the largest stiffness, or none"
            )
        if not all(isinstance(name, str) for name in self.frames):
            raise ValueError(f"frames are {self.frames}: give names, or none")
        if not self.slowest < 1.0 < self.fastest:
            raise ValueError(
                f"slowest is {self.slowest} and fastest {self.fastest}; they must lie on either"
                " side of 1, the pace that was shown"
            )

    @property
    def rotational_stiffness(self) -> float:
        """Kp of the orientation [1/s^2]."""
        return self.orientation_stiffness or self.stiffness

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the settings that a file may have: all that have an effect."""
        unused = cls.UNUSED | cls.FROM_ELSEWHERE
        return tuple(one.name for one in fields(cls) if one.name not in unused)

    @classmethod
    def from_file(cls: type[S], path: Path) -> S:
        """Settings of a YAML file.

        Raises
        ------
        ConfigurationError
            Names what is unknown, missing, or no number.
        """
        return cls().of_configuration(read_yaml(path), str(path))

    def of_configuration(self: S, changes: Mapping[str, Any], where: str) -> S:
        """`changed`, with ConfigurationError for a name or value of a file of config/ that cannot be."""
        try:
            return self.changed(changes, where)
        except ValueError as error:
            raise ConfigurationError(str(error)) from error

    def changed(self: S, changes: Mapping[str, Any], where: str) -> S:
        """Settings with some values changed.

        Parameters
        ----------
        changes
            Values by name.
        where
            They are from, for messages.

        Raises
        ------
        ValueError
            For a name or value that cannot be.
        """
        known = {one.name: one for one in fields(self) if one.name in self.names()}
        if unknown := sorted(set(changes) - set(known)):
            raise ValueError(
                f"{where}: {', '.join(map(str, unknown))} is no setting; there are"
                f" {', '.join(known)}"
            )
        values: dict[str, Any] = {}
        for name, value in changes.items():
            wanted = _kind_of(known[name].default)
            if not isinstance(value, wanted) or (isinstance(value, bool) and bool not in wanted):
                raise ValueError(
                    f"{where}: {name} is {reprlib.repr(value)}; it must be of type"
                    f" {' or '.join(one.__name__ for one in wanted)}"
                )
            values[name] = tuple(value) if isinstance(value, list) else value
        try:
            changed = replace(self, **values)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error
        for name, value in values.items():
            usual = known[name].default
            count = 0
            if isinstance(usual, tuple) and not any(isinstance(one, str) for one in usual):
                count = len(usual)
            if count and len(value) != count and (count > 1 or not value):
                raise ValueError(f"{where}: {name} is {list(value)}; it must have {count} numbers")
        return changed

    @classmethod
    def from_saved(cls: type[S], values: Mapping[str, Any], where: str) -> S:
        """That of which `dataclasses.asdict` made these values.

        Parameters
        ----------
        where
            They stand, for messages.

        Raises
        ------
        ValueError
            If they make none.
        """
        try:
            one: dict[str, Any] = {
                name: tuple(value) if isinstance(value, list) else value
                for name, value in values.items()
            }
            if (known := values["registration"]) is not None:
                registration = Registration(**known["registration"])
                one["registration"] = KnownRegistration(registration, tuple(known["spread"]))
            return cls(**one)
        except (ValueError, TypeError, KeyError) as error:
            raise ValueError(f"{where} holds no settings of {cls.__name__}: {error}") from error


def _kind_of(default: object) -> tuple[type, ...]:
    """Types that the value of a setting with this default may have in a file."""
    assert default is not MISSING, "a setting has a default"
    if isinstance(default, float):
        return (float, int)
    if isinstance(default, tuple):
        return (list, tuple)
    return (type(default),)
