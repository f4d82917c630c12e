"""Where a movement shall be made: poses of bodies, and numbers such as a weight."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_vector
from dart_skill.common.constants import UNTURNED


@dataclass(frozen=True, eq=False)
class Pose:
    """Pose of a body in the world: position (3,) [m] and quaternion (4,) x, y, z, w.

    Raises
    ------
    ValueError
        For one that is none.
    """

    position: np.ndarray
    quaternion: np.ndarray = field(default_factory=lambda: np.array(UNTURNED))

    def __post_init__(self) -> None:
        position, quaternion = (
            as_vector(self.position, "position", 3),
            as_vector(self.quaternion, "quaternion", 4),
        )
        length = math.sqrt(quaternion @ quaternion)
        if length < 1e-6:
            raise ValueError(
                f"quaternion {quaternion.tolist()} has length {length:.3g}; it says no orientation"
            )
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion / length)

    @classmethod
    def middle(cls, positions: ArrayLike, quaternions: ArrayLike) -> Pose:
        """Median of places (n, 3) [m], with the mean of orientations (n, 4)."""
        from scipy.spatial.transform import Rotation  # as in `_turn`

        turned = Rotation.from_quat(np.asarray(quaternions)).mean().as_quat()
        return cls(np.median(np.asarray(positions), axis=0), turned)

    @property
    def rotation(self) -> np.ndarray:
        """Axes of the body as columns (3, 3)."""
        return _turn(self).as_matrix()

    def place(self, local: Pose) -> Pose:
        """What is at a pose in this body's frame, in the world.

        Parameters
        ----------
        local
            Position, or pose, in this frame.
        """
        turn = _turn(self)
        return Pose(self.position + turn.apply(local.position), (turn * _turn(local)).as_quat())

    def sees(self, other: Pose) -> Pose:
        """Where another body is in the frame of this one.

        Parameters
        ----------
        other
            Its pose.
        """
        back = _turn(self).inv()
        return Pose(back.apply(other.position - self.position), (back * _turn(other)).as_quat())

    def apart(self, other: Pose) -> tuple[float, float]:
        """Distance of another pose from this one [m], and the angle between both [rad]."""
        turn = (_turn(self).inv() * _turn(other)).magnitude()
        return float(np.linalg.norm(other.position - self.position)), float(turn)


@dataclass(frozen=True, eq=False)
class Situation:
    """What a movement depends on.

    Parameters
    ----------
    poses
        Of bodies by their role.
    numbers
        Whatever else matters, by name.
    """

    poses: Mapping[str, Pose]
    numbers: Mapping[str, float] = field(default_factory=dict)

    def pose(self, role: str) -> Pose:
        """Pose of a body.

        Raises
        ------
        ValueError
            Names it if the situation does not say where it is.
        """
        if role not in self.poses:
            raise ValueError(
                f"where is the {role}? The situation says only where"
                f" {', '.join(sorted(self.poses)) or 'nothing'} is"
            )
        return self.poses[role]

    def moved(self, role: str, pose: Pose) -> Situation:
        """The same situation with one body elsewhere.

        Parameters
        ----------
        pose
            Where it is then.
        """
        return replace(self, poses={**self.poses, role: pose})

    def in_words(self, roles: Sequence[str] = (), units: Mapping[str, str] | None = None) -> str:
        """Where bodies are: `holder at 0.61, 0.12, 1.18 m, turned by +23 degrees`, and numbers:
        `duration 2.4 s`.

        Parameters
        ----------
        roles
            Of the bodies to name, default all.
        units
            Of the numbers, by name (`Skill.units`).
        """
        said = []
        for role, pose in self.poses.items():
            if roles and role not in roles:
                continue
            x, y, z = pose.position
            turn = math.degrees(math.atan2(pose.rotation[1, 0], pose.rotation[0, 0]))
            turned = f", turned by {turn:+.0f} degrees" if abs(turn) > 0.5 else ""
            said.append(f"{role} at {x:.2f}, {y:.2f}, {z:.2f} m{turned}")
        for name, number in self.numbers.items():
            said.append(f"{name} {_short(number)} {(units or {}).get(name, '')}".rstrip())
        return "; ".join(said) or "nothing is said of it"

    def to_json(self) -> dict[str, Any]:
        """Poses of the bodies, and the numbers, by name."""
        poses = {
            role: {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}
            for role, pose in self.poses.items()
        }
        return {**poses, **self.numbers}


def _short(number: float) -> str:
    """A number with three digits; 0 for one that has none within four decimals."""
    return "0" if abs(number) < 1e-4 else f"{number:.3g}"


def _turn(pose: Pose) -> Any:
    """As SciPy turns vectors."""
    from scipy.spatial.transform import Rotation  # most that know of situations turn nothing

    return Rotation.from_quat(pose.quaternion)
