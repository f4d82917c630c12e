"""How another recording may count the joints of the arm: in another order, unit or direction, or
from other zeros.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from itertools import permutations, product

import numpy as np

from dart_skill.arm import (
    ArmModel,
    OrientationFit,
    PositionFit,
    fit_orientations,
    fit_positions,
    similarity,
    turn_angles,
)
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.quaternions import matrices
from dart_skill.recording.imports import ANGLE_UNITS, LENGTH_UNITS, QUATERNION_ORDERS

ROUGH = 16
"""Number of instants at which every order and every choice of signs is tried."""
BEST = 15
"""Number of them that are looked at closely."""
GRID = np.pi / 9.0
"""Step in which the zero of one joint is looked for [rad]."""
ANY_ZERO = 3.0
"""Standard deviation of a joint's zero, where other things explain as much [rad]."""
GOOD_POSITION = 0.005
"""What good cameras and a good arm leave of a position [m]."""
GOOD_ANGLE = 0.03
"""What they leave of an orientation [rad]."""
GOOD_SCALE = 0.03
"""Share by which good cameras and a good arm differ about a length."""
GOOD = 1.5
"""Largest error, in these parts, of an explanation that needs no better one."""
NEGLIGIBLE = 0.5
"""Error below which explanations are alike, in these parts."""
FAR = 10.0
"""Residual from which a sample counts less in the search for zeros, in these parts."""
SMALL_ZERO = 0.005
"""Largest difference of a zero that is none [rad]."""
MIRROR = np.diag([1.0, 1.0, -1.0])
"""Matrix that mirrors the z axis of a body that is told in left-handed axes."""
APART = 0.3
"""Largest inaccuracy of a world or a body that was set up to agree [rad]."""
LIKELY = 1.5
"""Largest ratio of the rough error of a reading of orientations to the least one with which it is
looked at closely.
"""
STARTS = 9
"""Number of beginnings of a fit of orientations of which some may have leapt."""
LEAST_TURNED = 10
"""Smallest number of instants with an orientation that tells something."""
IN_RADIANS = 2.2 * np.pi
"""Largest angle of an arm whose joints turn less than once [rad]."""


@dataclass(frozen=True)
class JointConvention:
    """How recorded joints become those of the arm: unit * sign * recorded[order] + zero.

    Parameters
    ----------
    angle
        Unit, of ANGLE_UNITS.
    order
        For each joint of the arm, the place of its number in the recording.
    signs
        1 or -1 for each joint of the arm.
    zeros
        For each joint of the arm [rad].
    """

    angle: str = "rad"
    order: tuple[int, ...] = field(default_factory=lambda: tuple(range(joint_count())))
    signs: tuple[float, ...] = field(default_factory=lambda: (1.0,) * joint_count())
    zeros: tuple[float, ...] = field(default_factory=lambda: (0.0,) * joint_count())

    def joints(self, recorded: np.ndarray) -> np.ndarray:
        """Joints (..., 7) of the arm [rad] from recorded ones (..., 7)."""
        return ANGLE_UNITS[self.angle] * np.array(self.signs) * recorded[
            ..., list(self.order)
        ] + np.array(self.zeros)


@dataclass(frozen=True)
class QuaternionReading:
    """How the four numbers of a recorded orientation are read.

    Parameters
    ----------
    order
        Of QUATERNION_ORDERS.
    is_inverse
        Whether they turn the axes of the world into those of the body.
    is_mirrored
        Whether they are told in left-handed axes.
    """

    order: str = "xyzw"
    is_inverse: bool = False
    is_mirrored: bool = False

    def rotations(self, recorded: np.ndarray) -> np.ndarray:
        """Rotations (n, 3, 3) of recorded numbers (n, 4); of left-handed axes those after the
        world was mirrored at its origin.
        """
        found = matrices(recorded[:, QUATERNION_ORDERS[self.order]])
        found = found.transpose(0, 2, 1) if self.is_inverse else found
        return -found @ MIRROR if self.is_mirrored else found


def _turn_between(turned: OrientationFit, moved: PositionFit, reading: QuaternionReading) -> float:
    """Angle between the worlds of orientations and of positions [rad]; half a turn if only one of
    them is mirrored.
    """
    mirrored = bool(np.linalg.det(moved.world) < 0.0)
    if mirrored != reading.is_mirrored:
        return np.pi
    return float(
        turn_angles((turned.world.T @ (-moved.world if mirrored else moved.world))[None])[0]
    )


READINGS = tuple(
    QuaternionReading(*one) for one in product(QUATERNION_ORDERS, (False, True), (False, True))
)


@dataclass(frozen=True)
class Explanation:
    """A convention, a reading, and how well they explain what the cameras saw of the hand.

    Parameters
    ----------
    convention
        Of the joints.
    reading
        Of the orientations; None where too few were recorded.
    positions, orientations
        The fits; the latter None without a reading.
    """

    convention: JointConvention
    reading: QuaternionReading | None
    positions: PositionFit
    orientations: OrientationFit | None

    @property
    def is_mirrored(self) -> bool:
        """Whether the cameras' axes are left-handed."""
        return bool(np.linalg.det(self.positions.world) < 0.0)

    @property
    def error(self) -> float:
        """What is left, in parts of what good cameras and a good arm leave."""
        turn = 0.0 if self.orientations is None else self.orientations.error / GOOD_ANGLE
        length = (
            min(abs(np.log(self.positions.scale * unit)) for unit in LENGTH_UNITS.values())
            / GOOD_SCALE
        )
        return float(np.linalg.norm([self.positions.error / GOOD_POSITION, turn, length]))

    @property
    def is_good(self) -> bool:
        """Whether nothing better needs to be looked for; a mirrored world may stand for joints
        that are counted the other way.
        """
        return self.error * 2.0**self.is_mirrored <= GOOD

    def cost(self, told: JointConvention) -> float:
        """The error, doubled for each difference from what is told and for a mirrored world.

        Parameters
        ----------
        told
            Of the joints.
        """
        differences = sum(
            getattr(self.convention, field.name) != getattr(told, field.name)
            for field in fields(told)
        )
        return max(self.error, NEGLIGIBLE) * 2.0 ** (differences + self.is_mirrored)


class ConventionSearch:
    """The search for the convention by which the hand moves as cameras saw it, wherever these
    stand and whatever their unit is.

    Parameters
    ----------
    model
        Of the arm.
    recorded
        (n, 7) joints as they were recorded.
    position
        (n, 3) of the hand, in any axes and unit.
    quaternion
        (n, 4) of the hand, in any order; nan where none was recorded.
    """

    def __init__(
        self, model: ArmModel, recorded: np.ndarray, position: np.ndarray, quaternion: np.ndarray
    ):
        self._model, self._recorded, self._seen = model, recorded, position
        self._turned = np.flatnonzero(np.isfinite(quaternion).all(axis=1))
        enough = len(self._turned) >= LEAST_TURNED
        self._readings = (
            {one: one.rotations(quaternion[self._turned]) for one in READINGS} if enough else {}
        )

    def explain(
        self, convention: JointConvention, starts: int = 1, rounds: int = 6
    ) -> Explanation:
        """How well a convention explains what was seen.

        Parameters
        ----------
        convention
            Of the joints.
        starts, rounds
            As of `fit_orientations`.
        """
        joints = convention.joints(self._recorded)
        place, rotation, _ = self._model.hand_states(joints, np.zeros_like(joints))
        positions = fit_positions(self._seen, place, rotation)
        if not self._readings:
            return Explanation(convention, None, positions, None)
        rotation = rotation[self._turned]
        mirrored = bool(np.linalg.det(positions.world) < 0.0)
        possible = [one for one in self._readings if mirrored or not one.is_mirrored]
        fits = {one: fit_orientations(self._readings[one], rotation, rounds=0) for one in possible}
        least = min(fit.error for fit in fits.values())
        if rounds:
            likely = [
                one for one, fit in fits.items() if starts > 1 or fit.error <= LIKELY * least
            ]
            fits = {
                one: fit_orientations(self._readings[one], rotation, rounds, starts)
                for one in likely
            }

        def cost(one: QuaternionReading) -> float:
            apart = float(
                (one.order != "xyzw")
                + one.is_inverse
                + (_turn_between(fits[one], positions, one) > APART)
            )
            apart += 0.5 * float(turn_angles(fits[one].hand[None])[0] > APART)
            return max(fits[one].error, NEGLIGIBLE * GOOD_ANGLE) * 2.0**apart

        best = min(fits, key=cost)
        return Explanation(convention, best, positions, fits[best])

    def plain(self, told: JointConvention) -> Explanation:
        """The better one of what is told, and the same in the unit that the numbers suggest."""
        return min(
            (self.explain(replace(told, angle=unit), STARTS) for unit in self._units(told)),
            key=lambda one: one.cost(told),
        )

    def _units(self, told: JointConvention) -> list[str]:
        return list(
            dict.fromkeys(
                [told.angle, "deg" if np.abs(self._recorded).max() > IN_RADIANS else "rad"]
            )
        )

    def best(self, told: JointConvention) -> Explanation:
        """The convention that explains most, with as few differences from what is told as will do.

        Parameters
        ----------
        told
            Tried first.
        """
        units = self._units(told)
        found = [self.explain(replace(told, angle=unit), STARTS) for unit in units]
        ways = [self._other_order, self._other_signs, self._other_zeros]
        tried = []
        for way in ways:
            if not any(one.is_good for one in found):
                tried.append(way(replace(told, angle=units[-1])))
                found.append(self.explain(tried[-1]))
        for convention, way in zip(tried, (self._other_signs, self._other_zeros), strict=False):
            if not any(one.is_good for one in found):
                found.append(self.explain(way(convention)))
        return min(found, key=lambda one: one.cost(told))

    def _other_order(self, told: JointConvention) -> JointConvention:
        return self._closest(
            told,
            (
                replace(told, order=tuple(told.order[k] for k in one))
                for one in permutations(range(joint_count()))
            ),
        )

    def _other_signs(self, told: JointConvention) -> JointConvention:
        return self._closest(
            told, (replace(told, signs=one) for one in product((1.0, -1.0), repeat=joint_count()))
        )

    def _closest(
        self, told: JointConvention, choices: Iterable[JointConvention]
    ) -> JointConvention:
        """The one of many that explains most: all are looked at roughly, the best of them closely."""
        every = list(choices)
        rough = slice(None, None, max(1, len(self._seen) // ROUGH))
        joints = np.concatenate([one.joints(self._recorded[rough]) for one in every])
        place, _, _ = self._model.hand_states(joints, np.zeros_like(joints))
        seen, bodies = self._seen[rough], place.reshape(len(every), -1, 3)
        scale, world, shift = similarity(seen, bodies)
        back = (
            np.einsum("mnd,mde->mne", seen[None] - shift[:, None], world)
            / np.maximum(scale, 1e-9)[:, None, None]
        )
        misfit = np.square(back - bodies).sum(axis=(1, 2)) / np.square(
            bodies - bodies.mean(axis=1, keepdims=True)
        ).sum(axis=(1, 2))
        close = [self.explain(every[k]) for k in np.argsort(misfit, kind="stable")[:BEST]]
        return min(close, key=lambda one: one.cost(told)).convention

    def _other_zeros(self, told: JointConvention) -> JointConvention:
        """Zeros of the joints between base and hand: those of the first and the last are turns of
        the world and of the body.
        """
        from scipy.optimize import least_squares

        def moved(zeros: np.ndarray) -> JointConvention:
            return replace(
                told,
                zeros=tuple(
                    float(one)
                    for one in np.array(told.zeros) + np.concatenate([[0.0], zeros, [0.0]])
                ),
            )

        inner = np.eye(joint_count() - 2)
        alone = [turn * axis for axis in inner for turn in np.arange(-np.pi, np.pi, GRID)]
        start = min(alone, key=lambda one: self.explain(moved(one), rounds=0).error)

        def misfit(zeros: np.ndarray) -> np.ndarray:
            found = self.explain(moved(zeros), rounds=2)
            turned = (
                np.empty(0)
                if found.orientations is None
                else found.orientations.residual / GOOD_ANGLE
            )
            return np.concatenate(
                [found.positions.residual / GOOD_POSITION, turned, zeros / ANY_ZERO]
            )

        of_one = np.flatnonzero(start)
        fit = least_squares(
            lambda x: (
                misfit(x[0] * np.sign(start[of_one]) * inner[of_one[0]])
                if len(of_one)
                else misfit(start)
            ),  # fmt: skip
            [float(np.abs(start).max())],
            loss="soft_l1",
            diff_step=1e-4,
            max_nfev=12,
        )
        single = moved(fit.x[0] * np.sign(start))
        if self.explain(single).error < GOOD:
            return single
        fit = least_squares(
            misfit,
            fit.x[0] * np.sign(start),
            loss="soft_l1",
            f_scale=FAR,
            diff_step=1e-4,
            max_nfev=12,
        )
        zeros = (fit.x + np.pi) % (2.0 * np.pi) - np.pi
        return moved(np.where(np.abs(zeros) < SMALL_ZERO, 0.0, zeros))
