"""Where the links of the arm are, from the joints of its URDF: what of it hides bodies from
cameras, what a wrench does to its joints, and what its masses do.

It is asked at every step of the arm. So it is compiled (docs/development.md): _arm_geometry.pxd
beside it has the types.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dart_skill.arm import WamDescription, fixed_transforms, wam_description
from dart_skill.common.constants import N_JOINTS


class ArmGeometry:
    """Frames in the world: that of a joint stands at `xyz`, rolled about x, in the frame before
    it, and turns about its own z axis.

    Parameters
    ----------
    description
        Of the arm, default the WAM.
    """

    def __init__(self, description: WamDescription | None = None):
        description = description or wam_description()
        base, hand = fixed_transforms(description)
        frames = [base.child, *(joint.child for joint in description.joints), hand.child]
        self._steps = np.array(
            [base.translation, *(joint.xyz for joint in description.joints), hand.translation]
        )
        self._roll = np.array(
            [
                (round(math.cos(joint.roll), 15), round(math.sin(joint.roll), 15))
                for joint in description.joints
            ]
        )
        self._frame_of = np.array(
            [frames.index(capsule.link) for capsule in description.capsules], dtype=np.intp
        )
        self._local = np.array([(capsule.start, capsule.end) for capsule in description.capsules])
        self._radii = np.array([capsule.radius for capsule in description.capsules])
        self._axes, self._origin = np.zeros((len(frames), 3, 3)), np.zeros((len(frames), 3))

    def capsules(
        self, position: np.ndarray, base_turn: float = 0.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """End points (c, 2, 3) and radii (c,) [m] at angles (7,) [rad]; the base may stand turned
        about the vertical [rad].

        Raises
        ------
        ValueError
            For angles of another number.
        """
        angles = np.asarray(position, dtype=float)
        if angles.shape != (N_JOINTS,):
            raise ValueError(f"position = {position}: give {N_JOINTS} joint angles [rad]")
        self._place_frames(angles, base_turn)
        return self._ends(), self._radii

    def in_joints(self, position: np.ndarray, wrench: np.ndarray) -> np.ndarray | None:
        """A wrench at the hand as torques of the joints, J' wrench (7,) [N m]; None for none,
        which spares the kinematics.

        About the axis z of a joint at p, force f and moment m at the hand turn with z . (m + (hand
        - p) x f).

        Parameters
        ----------
        position
            Angles (7,) [rad].
        wrench
            (6,), force [N] over moment [N m], world axes.
        """
        if is_zero(wrench):
            return None
        self._place_frames(position, 0.0)
        n, axes, origin = position.shape[0], self._axes, self._origin
        result = np.empty(n)
        torque = result
        for k in range(1, n + 1):
            x, y, z = (
                origin[n + 1, 0] - origin[k, 0],
                origin[n + 1, 1] - origin[k, 1],
                origin[n + 1, 2] - origin[k, 2],
            )
            torque[k - 1] = axes[k, 0, 2] * (wrench[3] + y * wrench[2] - z * wrench[1])
            torque[k - 1] += axes[k, 1, 2] * (wrench[4] + z * wrench[0] - x * wrench[2])
            torque[k - 1] += axes[k, 2, 2] * (wrench[5] + x * wrench[1] - y * wrench[0])
        return result

    def _place_frames(self, angles: np.ndarray, base_turn: float) -> None:
        """Origins and axes, as columns, of all frames in the world: base, joints, hand."""
        axes, n = self._axes, angles.shape[0]
        self._origin[0, 2] = self._steps[0, 2]
        axes[0, 0, 0] = axes[0, 1, 1] = math.cos(base_turn)
        axes[0, 1, 0] = math.sin(base_turn)
        axes[0, 0, 1] = -axes[0, 1, 0]
        axes[0, 2, 2] = 1.0
        for k in range(1, n + 1):
            self._step_to(k)
            cosine, sine = math.cos(angles[k - 1]), math.sin(angles[k - 1])
            level, tilted = self._roll[k - 1, 0], self._roll[k - 1, 1]
            for i in range(3):
                rolled = level * axes[k - 1, i, 1] + tilted * axes[k - 1, i, 2]
                axes[k, i, 0] = cosine * axes[k - 1, i, 0] + sine * rolled
                axes[k, i, 1] = cosine * rolled - sine * axes[k - 1, i, 0]
                axes[k, i, 2] = level * axes[k - 1, i, 2] - tilted * axes[k - 1, i, 1]
        self._step_to(n + 1)
        for i in range(3):
            for j in range(3):
                axes[n + 1, i, j] = axes[n, i, j]

    def _step_to(self, k: int) -> None:
        """The origin of a frame, from the frame before it."""
        for i in range(3):
            self._origin[k, i] = self._origin[k - 1, i]
            for j in range(3):
                self._origin[k, i] += self._axes[k - 1, i, j] * self._steps[k, j]

    def _ends(self) -> np.ndarray:
        """End points of the capsules in the world (c, 2, 3)."""
        n_capsules = self._frame_of.shape[0]
        result = np.empty((n_capsules, 2, 3))
        ends = result
        for c in range(n_capsules):
            k = self._frame_of[c]
            for end in range(2):
                for i in range(3):
                    ends[c, end, i] = self._origin[k, i]
                    for j in range(3):
                        ends[c, end, i] += self._axes[k, i, j] * self._local[c, end, j]
        return result


def is_zero(values: np.ndarray) -> bool:
    """Whether all numbers (n,) are 0."""
    for i in range(values.shape[0]):
        if values[i] != 0.0:
            return False
    return True


class ArmDynamics(ArmGeometry):
    """Mass matrix, gravity and Coriolis terms of the links, without rotors and friction.

    Newton and Euler's equations of each link, forwards and backwards, and for the mass matrix the
    links beyond each joint taken as one body (Featherstone, Rigid Body Dynamics Algorithms, 5.3
    and 6.2). Everything is in world axes.

    Parameters
    ----------
    description
        Of the arm, default the WAM.
    ball_in_hand
        Whether the ball moves with the hand.
    """

    def __init__(self, description: WamDescription | None = None, ball_in_hand: bool = False):
        description = description or wam_description()
        super().__init__(description)
        hand, plate, ball = description.hand, description.tool_plate, description.ball
        held = [replace(hand.inertial, centre=plate + hand.inertial.centre)]
        if ball_in_hand:
            held.append(
                replace(
                    hand.inertial,
                    mass=ball.mass,
                    centre=plate + hand.ball_centre,
                    inertia=ball.inertia * np.eye(3),
                )
            )
        *links, last = description.links_urdf
        bodies = [*([one] for one in links), [last, *held]]
        self._masses, self._centres, self._inertias = (
            np.array(part) for part in zip(*map(as_one_body, bodies), strict=True)
        )
        n = N_JOINTS
        self._mass_matrix, self._bias, self._still = np.zeros((n, n)), np.zeros(n), np.zeros(n)
        self._arms, self._turned = np.zeros((n + 1, 3)), np.zeros((n + 1, 3, 3))
        self._spin, self._spin_rate, self._acceleration = (
            np.zeros((n + 1, 3)),
            np.zeros((n + 1, 3)),
            np.zeros((n + 1, 3)),
        )
        # a base that is lifted feels what one under gravity does
        self._acceleration[0, 2] = description.gravity
        self._force, self._moment = np.zeros((n + 2, 3)), np.zeros((n + 2, 3))
        self._offset, self._moved, self._momentum = np.zeros(3), np.zeros(3), np.zeros(3)
        self._centre, self._inertia = np.zeros(3), np.zeros((3, 3))

    def gravity_torque(self, position: np.ndarray) -> np.ndarray:
        """Torque that holds the arm (7,) [N m] at angles (7,) [rad], in an array that the next
        call writes anew.
        """
        self._place_bodies(position)  # of a body that does not turn the inertia is not asked
        self._newton_euler(self._still)
        return self._bias

    def terms(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix (7, 7) [kg m^2], and the torque at zero acceleration (7,) [N m], in arrays
        that the next call writes anew.

        Parameters
        ----------
        position, velocity
            Of the joints (7,) [rad], [rad/s].
        """
        self._place_bodies(position)
        self._turn_inertias()
        self._newton_euler(velocity)
        self._add_up_bodies()
        return self._mass_matrix, self._bias

    def _place_bodies(self, position: np.ndarray) -> None:
        """Find for each link the way from its joint to its centre of mass, in world axes."""
        self._place_frames(position, 0.0)
        for k in range(1, self._masses.shape[0] + 1):
            for i in range(3):
                self._arms[k, i] = 0.0
                for j in range(3):
                    self._arms[k, i] += self._axes[k, i, j] * self._centres[k - 1, j]

    def _turn_inertias(self) -> None:
        """Inertia of each link about its centre of mass, in world axes: R I R'."""
        axes, turned, half = self._axes, self._turned, self._inertia
        for k in range(1, self._masses.shape[0] + 1):
            for i in range(3):
                for j in range(3):
                    half[i, j] = 0.0
                    for m in range(3):
                        half[i, j] += axes[k, i, m] * self._inertias[k - 1, m, j]
            for i in range(3):
                for j in range(i + 1):
                    turned[k, i, j] = 0.0
                    for m in range(3):
                        turned[k, i, j] += half[i, m] * axes[k, j, m]
                    turned[k, j, i] = turned[k, i, j]

    def _newton_euler(self, speeds: np.ndarray) -> None:
        """Torque at zero acceleration: motion from the base to the hand, then forces from the hand
        to the base.
        """
        axes, origin, spin, rate = self._axes, self._origin, self._spin, self._spin_rate
        bias, n = self._bias, self._masses.shape[0]
        for k in range(1, n + 1):
            for i in range(3):
                self._offset[i] = origin[k, i] - origin[k - 1, i]
            self._accelerate(k - 1)
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                self._acceleration[k, i] = self._moved[i]
                rate[k, i] = rate[k - 1, i] + speeds[k - 1] * (
                    spin[k - 1, j] * axes[k, m, 2] - spin[k - 1, m] * axes[k, j, 2]
                )
                spin[k, i] = spin[k - 1, i] + speeds[k - 1] * axes[k, i, 2]
        for k in range(n, 0, -1):
            self._balance(k)
            bias[k - 1] = 0.0
            for i in range(3):
                bias[k - 1] += axes[k, i, 2] * self._moment[k, i]

    def _accelerate(self, k: int) -> None:
        """Acceleration of the point of a link that is `offset` from its joint: a + w' x d + w x (w
        x d).
        """
        spin, rate, offset = self._spin, self._spin_rate, self._offset
        along = squared = 0.0
        for i in range(3):
            along += spin[k, i] * offset[i]
            squared += spin[k, i] * spin[k, i]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            self._moved[i] = (
                self._acceleration[k, i] + rate[k, j] * offset[m] - rate[k, m] * offset[j]
            )
            self._moved[i] += spin[k, i] * along - offset[i] * squared

    def _balance(self, k: int) -> None:
        """Force and moment that a joint passes on to its link: what moves the link, and what it
        passes on to the next one.
        """
        spin, rate, force, moment, momentum = (
            self._spin,
            self._spin_rate,
            self._force,
            self._moment,
            self._momentum,
        )
        for i in range(3):
            self._offset[i] = self._arms[k, i]
        self._accelerate(k)
        for i in range(3):
            momentum[i] = moment[k, i] = 0.0
            for j in range(3):
                momentum[i] += self._turned[k, i, j] * spin[k, j]
                moment[k, i] += self._turned[k, i, j] * rate[k, j]
            self._moved[i] *= self._masses[k - 1]
            force[k, i] = self._moved[i] + force[k + 1, i]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            moment[k, i] += moment[k + 1, i] + spin[k, j] * momentum[m] - spin[k, m] * momentum[j]
            moment[k, i] += self._offset[j] * self._moved[m] - self._offset[m] * self._moved[j]
            moment[k, i] += (self._origin[k + 1, j] - self._origin[k, j]) * force[k + 1, m]
            moment[k, i] -= (self._origin[k + 1, m] - self._origin[k, m]) * force[k + 1, j]

    def _add_up_bodies(self) -> None:
        """Mass matrix: moments about each joint when a joint beyond it accelerates, and with it
        all links beyond that.
        """
        axes, origin, centre, force, moment = (
            self._axes,
            self._origin,
            self._centre,
            self._moved,
            self._momentum,
        )
        mass, n, matrix = 0.0, self._masses.shape[0], self._mass_matrix
        for i in range(3):
            centre[i] = 0.0
            for j in range(3):
                self._inertia[i, j] = 0.0
        for k in range(n, 0, -1):
            self._take_in(k, mass)
            mass += self._masses[k - 1]
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                force[i] = mass * (
                    axes[k, j, 2] * (centre[m] - origin[k, m])
                    - axes[k, m, 2] * (centre[j] - origin[k, j])
                )
                moment[i] = 0.0
                for c in range(3):
                    moment[i] += self._inertia[i, c] * axes[k, c, 2]
            for joint in range(1, k + 1):
                total = 0.0
                for i in range(3):
                    j, m = (i + 1) % 3, (i + 2) % 3
                    lever = (centre[j] - origin[joint, j]) * force[m] - (
                        centre[m] - origin[joint, m]
                    ) * force[j]
                    total += axes[joint, i, 2] * (moment[i] + lever)
                matrix[k - 1, joint - 1] = matrix[joint - 1, k - 1] = total

    def _take_in(self, k: int, mass: float) -> None:
        """A link becomes one body with those beyond it, of a mass: their centre of mass, and their
        inertia about it.
        """
        apart, squared, whole = self._offset, 0.0, mass + self._masses[k - 1]
        for i in range(3):
            apart[i] = self._origin[k, i] + self._arms[k, i] - self._centre[i]
            self._centre[i] += self._masses[k - 1] / whole * apart[i]
            squared += apart[i] * apart[i]
        reduced = mass * self._masses[k - 1] / whole
        for i in range(3):
            for j in range(3):
                self._inertia[i, j] += self._turned[k, i, j] - reduced * apart[i] * apart[j]
            self._inertia[i, i] += reduced * squared


def as_one_body(parts: Sequence[Any]) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass (3,) and inertia about it (3, 3) of bodies that are fixed to each
    other.
    """
    mass = sum(one.mass for one in parts)
    centre = sum(one.mass * one.centre for one in parts) / mass
    inertia = np.zeros((3, 3))
    for one in parts:
        apart = one.centre - centre
        inertia += one.inertia + one.mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return mass, centre, inertia
