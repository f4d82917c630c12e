"""Between what cameras see of the hand and what the arm's own kinematics says of it; and the YAML file
of a measured registration, which `dart-skill check arm --write` makes, and learner and commander
start from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from dart_skill.common.checks import as_finite
from dart_skill.common.configuration import read_yaml
from dart_skill.common.quaternions import CONJUGATE, matrices, product, rotate, unit

if TYPE_CHECKING:
    from dart_skill.arm._registration_fit import RegistrationFit

PARTS = {"turn": 3, "shift": 3, "hand_turn": 3, "hand_shift": 3, "delay": 1}
"""Unknowns of a registration, and how many numbers of `KnownRegistration.spread` each has."""
HEAD = """\
# Where the cameras see the base and the body on the hand of the arm. Written by: dart-skill check arm --write
# turn (x, y, z, w), shift [m]: of the base in the world of the cameras; hand_turn, hand_shift: of the body in the frame of the hand.
# delay: of the stamps of the cameras [s]. spread: standard deviations, of turns as rotation vectors [rad].
"""
"""First lines of a registration file."""
ZERO = (0.0, 0.0, 0.0)
"""Shift of what is not shifted [m]."""
SAME = (0.0, 0.0, 0.0, 1.0)
"""Quaternion of what is not turned."""


@dataclass(frozen=True)
class Registration:
    """Where the world of the cameras lies in that of the arm, and the tracked body on the hand.

    The cameras see R = turn R_arm hand_turn and p = turn (p_arm + R_arm hand_shift) + shift where
    the arm's kinematics says R_arm and p_arm. Turns are quaternions.

    Parameters
    ----------
    turn, shift
        Of the arm's base in the world of the cameras, (4,) and (3,) [m].
    hand_turn, hand_shift
        Of the tracked body in the frame of the hand, (4,) and (3,) [m].
    delay
        Of the stamps of the cameras after those of the joints [s].
    """

    turn: tuple[float, ...] = SAME
    shift: tuple[float, ...] = ZERO
    hand_turn: tuple[float, ...] = SAME
    hand_shift: tuple[float, ...] = ZERO
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("turn", "shift", "hand_turn", "hand_shift"):
            value = tuple(float(number) for number in getattr(self, name))
            size = 4 if name.endswith("turn") else 3
            if len(value) != size or not np.isfinite(value).all():
                raise ValueError(
                    f"registration.{name} is {value}; it must be {size} finite numbers"
                )
            if size == 4 and not abs(np.linalg.norm(value) - 1.0) < 1e-3:
                raise ValueError(
                    f"registration.{name} is {value}; it must be a quaternion of unit length"
                )
            object.__setattr__(self, name, value)
        if not np.isfinite(self.delay):
            raise ValueError(f"registration.delay is {self.delay} s; it must be finite")

    @property
    def is_none(self) -> bool:
        """Whether cameras and arm agree."""
        return (self.turn, self.shift, self.hand_turn, self.hand_shift) == (SAME, ZERO, SAME, ZERO)

    @cached_property
    def back(self) -> np.ndarray:
        """From the world of the cameras to that of the arm, a unit quaternion (4,)."""
        return unit(np.array(self.turn)) * CONJUGATE

    @cached_property
    def _hand_back(self) -> np.ndarray:
        """From the tracked body to the hand, a unit quaternion (4,)."""
        return unit(np.array(self.hand_turn)) * CONJUGATE

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from the axes of the cameras' world to those of the arm's."""
        return matrices(self.back)

    def poses(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the arm says of hands that the cameras see at (n, 3), (n, 4).

        Parameters
        ----------
        position, quaternion
            As the cameras see them.
        """
        if self.is_none:
            return position, quaternion
        turned = unit(product(product(self.back, quaternion), self._hand_back))
        return rotate(self.back, position - np.array(self.shift)) - rotate(
            turned, np.array(self.hand_shift)
        ), turned

    def of_body(
        self, position: np.ndarray, quaternion: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where a body other than the hand that the cameras see at a pose (3,), (4,) is in the
        world of the arm.
        """
        if self.is_none:
            return position, quaternion
        return rotate(self.back, position - np.array(self.shift)), unit(
            product(self.back, quaternion)
        )


@dataclass(frozen=True)
class KnownRegistration:
    """A registration that was measured before, and how far it can be off.

    Parameters
    ----------
    registration
        The measured one.
    spread
        (13,), standard deviations of turn [rad], shift [m], hand_turn [rad], hand_shift [m], three
        each, and of the delay [s].
    """

    registration: Registration
    spread: tuple[float, ...]

    def __post_init__(self) -> None:
        spread = as_finite(self.spread, "the spread of a registration", 1)
        if spread.shape != (13,) or not np.all(spread > 0.0):
            raise ValueError(
                f"the spread of a registration is {self.spread}: give 13 positive numbers"
            )
        object.__setattr__(self, "spread", tuple(spread.tolist()))


def save_registration(path: str | Path, fit: RegistrationFit) -> None:
    """Write a registration to `path`, which must not exist.

    Parameters
    ----------
    fit
        What was measured.

    Raises
    ------
    FileExistsError
        If it does.
    """
    found, known = fit.registration, fit.known
    ends = np.cumsum(list(PARTS.values()))[:-1]
    spreads = dict(zip(PARTS, np.split(np.array(known.spread), ends), strict=True))
    content = {
        "registration": {name: _plain(getattr(found, name)) for name in PARTS},
        "spread": {
            name: _plain(values if len(values) > 1 else values[0])
            for name, values in spreads.items()
        },
        "left": {
            "position": round(fit.position_error, 6),
            "angle": round(fit.angle_error, 6),
            "sightings": fit.n_sightings,
        },
    }
    with open(path, "x", encoding="utf-8") as file:
        file.write(
            HEAD + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)
        )


def load_registration(path: str | Path) -> KnownRegistration:
    """The registration in a file.

    Raises
    ------
    ValueError
        Names the file, and what of it is wrong.
    """
    try:
        content = read_yaml(Path(path))
        values, spread = (_section(content, name) for name in ("registration", "spread"))
        numbers = [np.atleast_1d(np.array(spread[name], dtype=float)) for name in PARTS]
        for (name, size), given in zip(PARTS.items(), numbers, strict=True):
            if given.shape != (size,):
                raise ValueError(f"spread.{name} has shape {given.shape}, not ({size},)")
        return KnownRegistration(Registration(**values), tuple(np.concatenate(numbers).tolist()))
    except FileNotFoundError:
        raise ValueError(
            f"there is no registration file {path}: dart-skill check arm --write FILE makes one"
        ) from None
    except (OSError, ValueError, TypeError) as error:
        why = str(error).removeprefix(f"{path} ")
        raise ValueError(
            f"{path} is no registration file: {why}; dart-skill check arm --write FILE makes one"
        ) from error


def _section(content: dict, name: str) -> dict:
    section = content.get(name)
    if not isinstance(section, dict) or set(section) != set(PARTS):
        raise ValueError(f"its section '{name}' must have {', '.join(PARTS)}")
    return section


def _plain(value: Any) -> Any:
    """Numbers as YAML has them, to nine digits."""
    return [round(float(one), 9) for one in value] if np.ndim(value) else round(float(value), 9)
