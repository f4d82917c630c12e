"""The registration of cameras and arm by what both say of the hand: R_i = X A_i Y and p_i = X (a_i
+ A_i s) + t.

A_i and a_i are the hand by the arm's kinematics, R_i and p_i what the cameras see. X and t are the
base in the world of the cameras, Y and s the tracked body on the hand. `fit_registration` finds
small deviations from what is expected, by a prior. `measure_registration` expects nothing, and
says how well the postures determine what it finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from dart_skill.arm._model import ArmModel
from dart_skill.arm._registration import KnownRegistration, Registration
from dart_skill.common.checks import as_finite, check_unit_quaternions, to_the_nanosecond
from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    matrices,
    of_matrices,
    product,
    rotate,
    to_vectors,
    unit,
)

POSITION = 0.004
"""Error of the arm's kinematics at one instant while a person pushes the arm [m]; neighbouring
instants have nearly the same error.
"""
ANGLE = 0.01
"""Error of the orientation that neighbouring instants share [rad]."""
USUAL = np.repeat([0.02, 0.02, 0.02, 0.01, 0.01], [3, 3, 3, 3, 1])
"""Standard deviations of turn [rad], shift [m], hand_turn [rad], hand_shift [m] and delay [s] of a
system that was set up with care.
"""
ROUNDS = 3
"""Number of steps of the fit with a prior."""
ANYTHING = np.repeat([3.0, 3.0, 3.0, 0.3, 0.01], [3, 3, 3, 3, 1])
"""Prior of a system of which nothing is known; only of the delay is the usual said, which an
arm that rests does not tell.
"""
LEAST_POSITION = 0.001
"""Error that the kinematics of every arm has [m]; what is left of a fit may be less by chance."""
LEAST_ANGLE = 0.002
"""Error of the orientation that the kinematics of every arm has [rad]."""
SETTLED = 1e-9
"""Change of the unknowns below which a measurement ends."""
MOST_ROUNDS = 50
"""Rounds after which a measurement ends in any case."""
HALF_TURN = 3.0
"""Nearer to half a turn the axis of a turn is not sure [rad]."""
FIRMEST = np.repeat([0.002, 0.002, 0.002, 0.002, 0.001], [3, 3, 3, 3, 1])
"""No measurement is taken to be more certain than this, because cables give and stamps jitter;
units as in `USUAL`.
"""


@dataclass(frozen=True)
class Sightings:
    """The hand at k instants, as cameras and arm say.

    Parameters
    ----------
    position, quaternion
        As the cameras see it, (k, 3) [m] and (k, 4).
    arm_position, arm_quaternion
        As the arm's kinematics has it, (k, 3) [m] and (k, 4).
    arm_velocity
        Of that, (k, 6), linear over angular [m/s], [rad/s].
    """

    position: np.ndarray
    quaternion: np.ndarray
    arm_position: np.ndarray
    arm_quaternion: np.ndarray
    arm_velocity: np.ndarray

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def of_joints(
        cls,
        model: ArmModel,
        joints: np.ndarray,
        speeds: np.ndarray,
        position: np.ndarray,
        quaternion: np.ndarray,
    ) -> Sightings:
        """Sightings from joint angles and speeds (k, n) [rad], [rad/s] and the poses (k, 3) [m],
        (k, 4) that the cameras saw then.

        Parameters
        ----------
        model
            Of the arm.
        """
        place, rotation, velocity = model.hand_states(joints, speeds)
        return cls(position, quaternion, place, of_matrices(rotation), velocity)

    @classmethod
    def together(cls, parts: Sequence[Sightings]) -> Sightings:
        """All sightings of several.

        Parameters
        ----------
        parts
            The several.
        """
        return cls(*(np.concatenate([getattr(one, f.name) for one in parts]) for f in fields(cls)))


@dataclass(frozen=True)
class RegistrationFit:
    """A registration that was measured, and how good it is.

    Parameters
    ----------
    registration
        The fitted one; its delay is 0 where the arm rested.
    spread
        (13,) standard deviations of the unknowns, as in `KnownRegistration`, from what is left and
        from the postures.
    position_error, angle_error
        Root mean square of what is left [m], [rad].
    worst_position, worst_angle
        The largest of it [m], [rad].
    n_sightings
        How many there were.
    turned
        Largest angle between two of the hand's orientations [rad].
    condition
        Of the normal equations in parts of a radian and 0.5 m: large where the postures say
        nothing of a direction.
    """

    registration: Registration
    spread: np.ndarray
    position_error: float
    angle_error: float
    worst_position: float
    worst_angle: float
    n_sightings: int
    turned: float
    condition: float

    @property
    def known(self) -> KnownRegistration:
        """What may be expected elsewhere on account of it."""
        return KnownRegistration(
            self.registration, tuple(np.maximum(self.spread, FIRMEST).tolist())
        )


def fit_registration(
    seen: Sequence[Sightings], known: KnownRegistration | None = None
) -> Registration:
    """The most probable registration: least squares with a prior, by the method of Gauss and
    Newton on rotation vectors.

    The prior is a registration that was measured before (`known`), or that of a system that was
    set up with care (`USUAL`).

    Parameters
    ----------
    seen
        What cameras and arm say of the hand.
    """
    if not sum(len(one) for one in seen):
        return Registration() if known is None else known.registration
    together = Sightings.together(seen)
    if known is None:
        return _after(
            Registration(), _gauss_newton(together, np.zeros(13), USUAL, (POSITION, ANGLE), ROUNDS)
        )
    expected = known.registration
    change = _gauss_newton(
        _as_expected(together, expected),
        _centre(expected),
        np.array(known.spread),
        (POSITION, ANGLE),
        ROUNDS,
    )
    return _after(expected, change)


def measure_registration(seen: Sightings) -> RegistrationFit:
    """The registration of sightings (k of them, k >= 3), whatever it is.

    It begins with the turn that fits the axes of the turns between postures best, and goes on with
    Gauss and Newton. Postures that do not determine it give a result with a large `spread` and
    `condition`.

    Parameters
    ----------
    seen
        What cameras and arm say of the hand.

    Raises
    ------
    ValueError
        For fewer, or for values that are not finite.
    """
    if len(seen) < 3:
        raise ValueError(
            f"{len(seen)} postures are too few to register cameras and arm: show at least 3"
        )
    for field in fields(Sightings):
        as_finite(getattr(seen, field.name), f"sightings.{field.name}", 2)
    for name in ("quaternion", "arm_quaternion"):
        check_unit_quaternions(f"sightings.{name}", getattr(seen, name), len(seen))
    expected = _first_guess(seen)
    for _ in range(MOST_ROUNDS):
        centre = _centre(expected)
        change = _gauss_newton(
            _as_expected(seen, expected), centre, ANYTHING, (LEAST_POSITION, LEAST_ANGLE), 1
        )
        expected = _after(expected, change)
        if np.abs(change - centre).max() < SETTLED:
            break
    return _judged(seen, expected)


def _judged(seen: Sightings, found: Registration) -> RegistrationFit:
    """How well sightings fit a registration, and how well they determine it."""
    off, twist, rows, turned = linearised(_as_expected(seen, found), _centre(found))
    distances, angles = np.linalg.norm(off, axis=1), np.linalg.norm(twist, axis=1)
    position, angle = (
        float(np.sqrt(np.mean(np.square(values)))) for values in (distances, angles)
    )
    design = np.concatenate(
        [
            rows.reshape(-1, 13) / max(position, LEAST_POSITION),
            turned.reshape(-1, 13) / max(angle, LEAST_ANGLE),
            np.diag(1.0 / ANYTHING),
        ]
    )
    # Neighbouring instants are off alike: what is left does not average out below a tenth of
    # itself.
    share = max(1.0, len(seen) / 100.0)
    covariance = np.linalg.inv(design.T @ design / share)
    scaled = np.concatenate(
        [rows[..., :12].reshape(-1, 12) / 0.5, turned[..., :12].reshape(-1, 12)]
    ) * np.repeat([1.0, 0.5, 1.0, 0.5], 3)
    with np.errstate(divide="ignore"):
        condition = float(np.linalg.cond(scaled))
    hands = seen.arm_quaternion
    widest = max(
        float(np.linalg.norm(to_vectors(product(hand * CONJUGATE, hands)), axis=1).max())
        for hand in hands
    )
    spread = np.sqrt(np.diag(covariance))
    return RegistrationFit(
        found,
        spread,
        position,
        angle,
        float(distances.max()),
        float(angles.max()),
        len(seen),
        widest,
        condition,
    )


def _centre(expected: Registration) -> np.ndarray:
    """The unknowns (13,) in the world of an expected registration, where only hand_shift and delay
    are left.
    """
    return np.concatenate([np.zeros(9), expected.hand_shift, [expected.delay]])


def _first_guess(seen: Sightings) -> Registration:
    """Turns that explain the orientations, and the shifts that go with them; where nothing tells,
    the smallest.
    """
    camera, arm = unit(seen.quaternion), unit(seen.arm_quaternion)
    # The turns from posture to posture are the same seen in two worlds: X takes the axes of one to
    # those of the other.
    first, second = np.array(_pairs(len(seen))).T
    seen_axes, arm_axes = (
        to_vectors(product(one[first], one[second] * CONJUGATE)) for one in (camera, arm)
    )
    # which way round is not sure of half a turn
    clear = np.linalg.norm(arm_axes, axis=1) < HALF_TURN
    base = of_matrices(_best_turn(seen_axes[clear].T @ arm_axes[clear])[None])[0]
    turned = product(base, arm)
    hands = product(turned * CONJUGATE, camera)
    hand = np.linalg.eigh(hands.T @ hands)[1][:, -1]  # the mean of them, whatever their signs
    levers = matrices(turned)
    design = np.concatenate(
        [np.broadcast_to(np.eye(3), (len(seen), 3, 3)), levers], axis=2
    ).reshape(-1, 6)
    left = (seen.position - rotate(base, seen.arm_position)).ravel()
    shifts = np.linalg.lstsq(design, left, rcond=1e-6)[0]
    return Registration(tuple(base), tuple(shifts[:3]), tuple(hand), tuple(shifts[3:]))


def _pairs(n: int) -> list[tuple[int, int]]:
    """Postures that are compared: each with those that follow it after 1, 2, 4, ... others."""
    return [
        (i, i + gap)
        for gap in (2**power for power in range(n.bit_length()))
        for i in range(n - gap)
    ]


def _best_turn(products: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that takes axes b to axes a best, by the sum of a b' (3, 3); of several
    about the one nearest to none.
    """
    # A little of "no turn" decides what the axes leave open, as where all of them are parallel.
    left, _, right = np.linalg.svd(products + 1e-3 * (np.linalg.norm(products) + 1e-9) * np.eye(3))
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right


def _as_expected(seen: Sightings, expected: Registration) -> Sightings:
    """Sightings in a world in which, if the expected registration is right, nothing is turned or
    shifted but the body from the hand.
    """
    base, hand = (
        unit(np.array(expected.turn)) * CONJUGATE,
        unit(np.array(expected.hand_turn)) * CONJUGATE,
    )
    camera = product(product(base, seen.quaternion), hand)
    position = rotate(base, seen.position - np.array(expected.shift))
    return Sightings(position, camera, seen.arm_position, seen.arm_quaternion, seen.arm_velocity)


def _after(expected: Registration, unknown: np.ndarray) -> Registration:
    """The expected registration with deviations (13,) that were found in its world."""
    turn, shift, hand_turn, hand_shift = np.split(unknown[:12], 4)
    base = unit(np.array(expected.turn))
    hand = unit(product(from_vectors(hand_turn), np.array(expected.hand_turn)))
    moved = rotate(base, shift) + np.array(expected.shift)
    turned = unit(product(base, from_vectors(turn)))
    return Registration(
        tuple(turned),
        tuple(moved),
        tuple(hand),
        tuple(hand_shift),
        to_the_nanosecond(float(unknown[12])),
    )


def _gauss_newton(
    seen: Sightings,
    centre: np.ndarray,
    spread: np.ndarray,
    noise: tuple[float, float],
    rounds: int,
) -> np.ndarray:
    """Unknowns (13,) of a registration near none: turn, shift, hand_turn, hand_shift, delay.
    centre, spread (13,): of the prior.
    """
    unknown = centre.copy()
    for _ in range(rounds):
        off, twist, rows, turned = linearised(seen, unknown)
        design = (
            np.concatenate([rows.reshape(-1, 13) / noise[0], turned.reshape(-1, 13) / noise[1]])
            * spread
        )
        left = np.concatenate([off.ravel() / noise[0], twist.ravel() / noise[1]])
        # Normal equations in parts of the prior's deviations: an error of a step by rounding is
        # made up for by the next one.
        gradient = design.T @ left + (centre - unknown) / spread
        unknown = unknown + spread * np.linalg.solve(design.T @ design + np.eye(13), gradient)
    return unknown


def linearised(
    seen: Sightings, unknown: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What is left of positions (n, 3) and rotations (n, 3), and the first derivatives (n, 3, 13)
    of both.

    Parameters
    ----------
    unknown
        (13,), turn, shift, hand_turn, hand_shift, three each, and delay, at which the equations
        are linear.
    """
    turn, shift, hand_turn, hand_shift = np.split(unknown[:12], 4)
    delay, speeds = unknown[12], seen.arm_velocity
    base = from_vectors(turn)
    arm = product(from_vectors(-delay * speeds[:, 3:]), seen.arm_quaternion)
    lever = seen.arm_position - delay * speeds[:, :3] + rotate(arm, hand_shift)
    expected = product(product(base, arm), from_vectors(hand_turn))
    off = seen.position - shift - rotate(base, lever)
    twist = to_vectors(product(seen.quaternion, expected * CONJUGATE))
    rows, turned = np.zeros((2, len(seen), 3, 13))
    rows[:, :, 0:3] = np.cross(np.eye(3), lever[:, None]).swapaxes(1, 2)  # turn x lever
    rows[:, :, 3:6] = turned[:, :, 0:3] = np.eye(3)
    rows[:, :, 9:12] = turned[:, :, 6:9] = matrices(arm)
    rows[:, :, 12], turned[:, :, 12] = -speeds[:, :3], -speeds[:, 3:]
    return off, twist, rows, turned
