"""A registration that was measured, as a YAML file: `dart-skill check arm --write` makes it,
learner and commander start from it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dart_skill.arm._registration import Registration
from dart_skill.arm._registration_fit import KnownRegistration, RegistrationFit

PARTS = {"turn": 3, "shift": 3, "hand_turn": 3, "hand_shift": 3, "delay": 1}
"""Unknowns of a registration, and how many numbers of `KnownRegistration.spread` each has."""
HEAD = """\
# Where the cameras see the base and the body on the hand of the arm. Written by: dart-skill check arm --write
# turn (x, y, z, w), shift [m]: of the base in the world of the cameras; hand_turn, hand_shift: of the body in the frame of the hand.
# delay: of the stamps of the cameras [s]. spread: standard deviations, of turns as rotation vectors [rad].
"""


def save_registration(path: str | Path, fit: RegistrationFit) -> None:
    """Write a registration to `path`, which must not exist; FileExistsError if it does. fit: what
    was measured.
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
    """The registration in a file; ValueError names the file, and what of it is wrong."""
    try:
        content = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
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
    except (OSError, ValueError, TypeError, yaml.YAMLError) as error:
        raise ValueError(
            f"{path} is no registration file: {error}; dart-skill check arm --write FILE makes one"
        ) from error


def _section(content: Any, name: str) -> dict:
    section = content.get(name) if isinstance(content, dict) else None
    if not isinstance(section, dict) or set(section) != set(PARTS):
        raise ValueError(f"its section '{name}' must have {', '.join(PARTS)}")
    return section


def _plain(value: Any) -> Any:
    """Numbers as YAML has them, to nine digits."""
    return [round(float(one), 9) for one in value] if np.ndim(value) else round(float(value), 9)
