"""A planned movement of the hand, in the features of the model and in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dart_skill.arm import HandPath
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.quaternions import product
from dart_skill.movement import (
    Reproduction,
    StateDriven,
    quaternions_from_angles,
    turn_matrix,
)


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A movement for one task parameter.

    The features are x, y, z [m] in the world and alpha, beta [rad] in axes turned by an azimuth
    (8.4.1).

    Parameters
    ----------
    time
        (n,) [s].
    attractor, position
        (n, 5), in the features.
    velocity, acceleration
        (n, 5), in the features per s and per s^2.
    azimuth
        Float [rad], by which the axes of the angles are turned about z.
    roll
        Float [rad], the third angle, constant during the movement.
    pace_gain
        (n, 10), how far the hand is ahead by its differences in the features and their velocities,
        for a movement that the state drives; default None: time drives it.
    """

    time: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    azimuth: float
    roll: float
    pace_gain: np.ndarray | None = None

    @classmethod
    def of(
        cls,
        movement: Reproduction | StateDriven,
        azimuth: float,
        roll: float,
        pace_gain: np.ndarray | None = None,
    ) -> PlannedPath:
        """The course of a movement that DS-GMR made."""
        return cls(
            movement.time,
            movement.attractor,
            movement.position,
            movement.velocity,
            movement.acceleration,
            azimuth,
            roll,
            pace_gain,
        )

    def part(self, start: int, stop: int) -> PlannedPath:
        """The course between two indices."""
        return replace(
            self,
            time=self.time[start:stop],
            attractor=self.attractor[start:stop],
            position=self.position[start:stop],
            velocity=self.velocity[start:stop],
            acceleration=self.acceleration[start:stop],
            pace_gain=None if self.pace_gain is None else self.pace_gain[start:stop],
        )

    @cached_property
    def hand_quaternion(self) -> np.ndarray:
        """Orientation (n, 4) of the hand in the world."""
        return self._quaternions(self.position[:, 3:])

    @property
    def attractor_quaternion(self) -> np.ndarray:
        """Orientation (n, 4) of the attractor in the world."""
        return self._quaternions(self.attractor[:, 3:])

    @property
    def hand_velocity(self) -> np.ndarray:
        """Velocity (n, 6) of the hand in the world, linear [m/s] over angular [rad/s]."""
        return np.hstack([self.velocity[:, :3], self._angular_velocity])

    @property
    def hand_path(self) -> HandPath:
        """The motion of the hand frame in the world; its clock starts at 0."""
        return HandPath(
            time=to_the_nanosecond(self.time - self.time[0]),
            position=self.position[:, :3],
            quaternion=self.hand_quaternion,
            velocity=self.hand_velocity,
            acceleration=np.hstack(
                [self.acceleration[:, :3], np.gradient(self._angular_velocity, self.time, axis=0)]
            ),
        )

    @property
    def pace_gain_of_hand(self) -> np.ndarray:
        """Gain of the differences of position, orientation as a rotation vector, velocity and
        angular velocity in the world (n, 12).

        Only valid if the state drives the movement.
        """
        assert self.pace_gain is not None
        gain, angles = self.pace_gain, self._angles_of_rotation
        turned, turning = (
            np.einsum("na,nai->ni", gain[:, columns], angles)
            for columns in (slice(3, 5), slice(8, 10))
        )
        return np.hstack([gain[:, :3], turned, gain[:, 5:8], turning])

    @property
    def _angles_of_rotation(self) -> np.ndarray:
        """Changes of alpha and beta (n, 2, 3) with a small turn in the world: R = R_z(azimuth)
        R_y(-alpha) R_z(beta) R_x(roll).
        """
        alpha, beta = self.position[:, 3], self.position[:, 4]
        zero = np.zeros_like(alpha)
        axes = np.stack(
            [
                np.stack([zero, zero - 1.0, zero], axis=1),
                np.stack([-np.sin(alpha), zero, np.cos(alpha)], axis=1),
                np.stack(
                    [np.cos(beta) * np.cos(alpha), np.sin(beta), np.cos(beta) * np.sin(alpha)],
                    axis=1,
                ),
            ],
            axis=2,
        )
        return np.linalg.inv(turn_matrix(self.azimuth) @ axes)[:, :2]

    def _quaternions(self, angles: np.ndarray) -> np.ndarray:
        """World orientations (n, 4) of alpha, beta (n, 2)."""
        rolled = np.column_stack([angles, np.full(len(angles), self.roll)])
        turn = np.array([0.0, 0.0, np.sin(0.5 * self.azimuth), np.cos(0.5 * self.azimuth)])
        return product(turn, quaternions_from_angles(rolled))

    @cached_property
    def _angular_velocity(self) -> np.ndarray:
        """In world axes (n, 3): of R_z(azimuth) R_y(-alpha) R_z(beta), from alpha and the rates of
        alpha and beta.
        """
        alpha, rates = self.position[:, 3], self.velocity[:, 3:]
        axis_beta = np.column_stack([-np.sin(alpha), np.zeros(len(alpha)), np.cos(alpha)])
        turned = rates[:, 1:] * axis_beta - np.outer(rates[:, 0], [0.0, 1.0, 0.0])
        return turned @ turn_matrix(self.azimuth).T
