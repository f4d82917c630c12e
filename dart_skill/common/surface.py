"""What is thrown, and the surface on which a throw is judged: the plane of a basket's rim, or that
of a dart board.

Both surfaces have one interface, so that teaching, learning, planning and practice are the same
for both. The coordinates of a point are two numbers as seen from the arm's base axis: its reach
[m], which the speed of a throw decides, the distance of a rim or the height on a board; and its
azimuth [rad]. A miss is two lengths [m]: in the direction of growing reach, and to the left.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from dart_skill.common.flight import DART, TENNIS_BALL, Ball, Landing, crossing, landing

BOARD_DIAMETER = 0.451
"""Diameter of a dart board, the black rim around the doubles included [m]."""
STUCK = 0.02
"""What is less far before the face of a board is in it: cameras are off by millimetres [m]."""


@dataclass(frozen=True)
class Rims:
    """Horizontal planes, each through its target, which is the centre of a rim; they are crossed
    going down.
    """

    what = "basket"

    def crossing(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        target: np.ndarray,
        ball: Ball = TENNIS_BALL,
    ) -> Landing:
        """Where flights with position, velocity (..., 3) at their start meet the surface of a
        target (3,).
        """
        return landing(position, velocity, target[2], ball)

    def reached(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        target: np.ndarray,
        ball: Ball = TENNIS_BALL,
    ) -> float:
        """Reach [m] of a flight that starts in the plane y = 0, in the direction x, if that plane
        were turned to the target (3,).

        Parameters
        ----------
        position, velocity
            (3,) at the start.
        """
        return float(landing(position, velocity, target[2], ball).position[0])

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """Reach and azimuth (..., 2) of points (..., 3)."""
        found, x, y = np.empty((*points.shape[:-1], 2)), points[..., 0], points[..., 1]
        np.hypot(x, y, out=found[..., 0])
        np.arctan2(y, x, out=found[..., 1])
        return found

    def point(self, coordinates: np.ndarray, target: np.ndarray) -> np.ndarray:
        """The point (3,) with coordinates (2,) on the surface of a target (3,)."""
        return np.array(
            [
                coordinates[0] * np.cos(coordinates[1]),
                coordinates[0] * np.sin(coordinates[1]),
                target[2],
            ]
        )

    def miss(self, difference: np.ndarray, at: np.ndarray) -> np.ndarray:
        """A difference of points (3,), at a point (3,), as along and across (2,)."""
        return (difference @ _turn(np.arctan2(at[1], at[0])))[:2]

    def offset(self, miss: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The difference (3,) that a miss (2,) is at a point (3,)."""
        return np.array([*(_turn(np.arctan2(at[1], at[0]))[:2, :2] @ miss), 0.0])

    def seen_from(
        self, target: np.ndarray, place: np.ndarray, miss: np.ndarray
    ) -> tuple[float, float]:
        """How far from a target (3,) a miss (2,) of the place with coordinates (2,) is: two
        lengths.
        """
        distance, azimuth = self.coordinates(target)
        return float(place[0] + miss[0] - distance), float(
            place[0] * (place[1] - azimuth) + miss[1]
        )

    def apart(self, point: np.ndarray, target: np.ndarray) -> float:
        """Distance [m] of a point of the surface from a target."""
        return float(np.linalg.norm(point[:2] - target[:2]))

    def far(self, reach: float) -> str:
        """A reach in words."""
        return f"{reach:.2f} m from the base axis"

    def passed(self, path: np.ndarray, target: np.ndarray) -> bool:
        """Whether what was seen on a path (n, 3) was above the plane of a rim (3,), and last below
        it.
        """
        return len(path) > 0 and bool(path[:, 2].max() > target[2] > path[-1, 2])


@dataclass(frozen=True)
class BoardFace:
    """The vertical plane of a board that faces the base axis, through its bull at (x, y, z) [m]."""

    bull: tuple[float, float, float]

    what = "target"

    def __post_init__(self) -> None:
        bull = tuple(float(value) for value in self.bull)
        if len(bull) != 3 or not np.isfinite(bull).all() or np.hypot(*bull[:2]) < 0.1:
            raise ValueError(
                f"bull {self.bull} must be three finite numbers, at least 0.1 m from the base axis"
            )
        object.__setattr__(self, "bull", bull)

    @cached_property
    def distance(self) -> float:
        """Distance of the plane from the base axis [m]."""
        return float(np.hypot(*self.bull[:2]))

    @cached_property
    def normal(self) -> np.ndarray:
        """Horizontal unit vector (3,) from the base axis to the bull."""
        return np.array([self.bull[0], self.bull[1], 0.0]) / self.distance

    @cached_property
    def axes(self) -> np.ndarray:
        """Up and left, as one sees the board, as columns (3, 2)."""
        x, y, _ = self.normal
        return np.array([[0.0, -y], [0.0, x], [1.0, 0.0]])

    def crossing(
        self, position: np.ndarray, velocity: np.ndarray, target: np.ndarray, ball: Ball = DART
    ) -> Landing:
        """Where flights with position, velocity (..., 3) at their start meet the plane.

        Parameters
        ----------
        target
            Without effect, since the plane is the board's.
        """
        return crossing(position, velocity, self.normal, self.distance, ball)

    def reached(
        self, position: np.ndarray, velocity: np.ndarray, target: np.ndarray, ball: Ball = DART
    ) -> float:
        """Reach [m] of a flight that starts in the plane y = 0, in the direction x, if that plane
        were turned to the target (3,).

        Parameters
        ----------
        position, velocity
            (3,) at the start.
        """
        aside = np.arctan2(target[1], target[0]) - np.arctan2(self.bull[1], self.bull[0])
        plane = self.distance / float(np.cos(aside))
        return float(
            crossing(position, velocity, np.array([1.0, 0.0, 0.0]), plane, ball).position[2]
        )

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """Reach and azimuth (..., 2) of points (..., 3)."""
        return np.stack([points[..., 2], np.arctan2(points[..., 1], points[..., 0])], axis=-1)

    def point(self, coordinates: np.ndarray, target: np.ndarray) -> np.ndarray:
        """The point (3,) with coordinates (2,) on the plane."""
        aside = coordinates[1] - np.arctan2(self.bull[1], self.bull[0])
        left = self.axes[:, 1] * self.distance * np.tan(aside)
        return self.distance * self.normal + left + [0.0, 0.0, coordinates[0]]

    def miss(self, difference: np.ndarray, at: np.ndarray) -> np.ndarray:
        """A difference of points (3,) as up and to the left (2,).

        Parameters
        ----------
        at
            Without effect, since the face is a plane.
        """
        return difference @ self.axes

    def offset(self, miss: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The difference (3,) that a miss (2,) is.

        Parameters
        ----------
        at
            Without effect, since the face is a plane.
        """
        return self.axes @ miss

    def seen_from(
        self, target: np.ndarray, place: np.ndarray, miss: np.ndarray
    ) -> tuple[float, float]:
        """How far from a target (3,) a miss (2,) of the place with coordinates (2,) is: two
        lengths.
        """
        up, left = self.miss(self.point(place, target) - target, target) + miss
        return float(up), float(left)

    def apart(self, point: np.ndarray, target: np.ndarray) -> float:
        """Distance [m] of a point of the plane from a target."""
        return float(np.linalg.norm(self.miss(point - target, target)))

    def far(self, reach: float) -> str:
        """A reach in words."""
        return f"{reach:.2f} m above the floor"

    def holds(self, point: np.ndarray) -> bool:
        """Whether a point (3,) of the plane is on the board."""
        return self.apart(point, np.array(self.bull)) <= 0.5 * BOARD_DIAMETER

    def on_board(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) [m] as `dart_skill.darts` has them: (..., 2) [mm] from the bull, to the
        right and up.
        """
        return 1e3 * ((points - np.array(self.bull)) @ self.axes)[..., ::-1] * [-1.0, 1.0]

    def beside_bull(self, right_up: np.ndarray) -> np.ndarray:
        """Points (..., 3) [m] in the world that are so far to the right and up (..., 2) [m] from
        the bull.
        """
        return np.array(self.bull) + (right_up * [-1.0, 1.0])[..., ::-1] @ self.axes.T

    def passed(self, path: np.ndarray, target: np.ndarray) -> bool:
        """Whether what was seen on a path (n, 3) was last on the board, or behind its plane."""
        return len(path) > 0 and self.distance - float(path[-1] @ self.normal) < STUCK


Surface = Rims | BoardFace
RIMS = Rims()


@dataclass(frozen=True)
class Game:
    """What is thrown, as its flight goes, and where it is judged.

    Parameters
    ----------
    projectile
        The ball or dart.
    surface
        Where its flight ends.
    """

    projectile: Ball
    surface: Surface


BASKETS = Game(TENNIS_BALL, RIMS)


@lru_cache(maxsize=8)
def game_at(bull: tuple[float, float, float] | tuple[()] = ()) -> Game:
    """Darts at the board with this bull (x, y, z) [m]; balls and baskets if there is none."""
    return Game(DART, BoardFace(bull)) if bull else BASKETS


def _turn(azimuth: float) -> np.ndarray:
    """Rotation (3, 3) by an azimuth about z."""
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
