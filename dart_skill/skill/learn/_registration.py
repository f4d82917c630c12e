"""The registration of cameras and arm, told from demonstrations: both say where the hand was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.checks import to_the_nanosecond
from dart_skill.recording import Demonstration
from dart_skill.robot import ArmModel, Registration

INSTANTS = 24
"""Of a demonstration at which the two are compared."""
POSITION, ANGLE = 0.004, 0.01
"""How far the arm's kinematics is off at one instant while somebody pushes it [m], [rad]: neighbouring instants are off alike."""
USUAL = np.repeat([0.02, 0.02, 0.02, 0.01, 0.01], [3, 3, 3, 3, 1])
"""Standard deviations of turn [rad], shift [m], hand_turn [rad], hand_shift [m] and delay [s] of a system that was set up with care."""
ROUNDS = 3


@dataclass(frozen=True)
class Sightings:
    """The hand at k instants, as cameras and arm say.

    * position, quaternion: as the cameras see it, (k, 3) [m] and (k, 4).
    * arm_position, arm_quaternion: as the arm's kinematics has it, (k, 3) [m] and (k, 4).
    * arm_velocity: of that, (k, 6), linear over angular [m/s], [rad/s].
    """

    position: np.ndarray
    quaternion: np.ndarray
    arm_position: np.ndarray
    arm_quaternion: np.ndarray
    arm_velocity: np.ndarray


def sightings(demonstration: Demonstration, model: ArmModel) -> Sightings:
    """The hand of a demonstration at some instants; none (k = 0) if the arm's joints were not recorded meanwhile."""
    d = demonstration
    if not len(d.joint_time):
        return Sightings(*(np.empty((0, n)) for n in (3, 4, 3, 4, 6)))
    both = np.flatnonzero((d.hand_time >= d.joint_time[0]) & (d.hand_time <= d.joint_time[-1]))
    chosen = both[np.unique(np.linspace(0, len(both) - 1, min(INSTANTS, len(both))).round().astype(int))]
    q, qd = (
        np.column_stack([np.interp(d.hand_time[chosen], d.joint_time, column) for column in columns.T])
        for columns in (d.joint_position, d.joint_velocity)
    )
    states = [model.hand_state(*pair) for pair in zip(q, qd, strict=True)]
    rotations = np.array([state.rotation for state in states]).reshape(-1, 3, 3)
    return Sightings(
        d.hand_position[chosen],
        d.hand_quaternion[chosen],
        np.array([state.position for state in states]).reshape(-1, 3),
        Rotation.from_matrix(rotations).as_quat() if len(chosen) else np.empty((0, 4)),
        np.array([state.velocity for state in states]).reshape(-1, 6),
    )


def fit_registration(seen: Sequence[Sightings]) -> Registration:
    """The most probable registration: least squares with the prior `USUAL`, by the method of Gauss and Newton on rotation vectors."""
    if not sum(len(one.position) for one in seen):
        return Registration()
    position, quaternion, arm_position, arm_quaternion, arm_velocity = (
        np.concatenate([getattr(one, name) for one in seen])
        for name in ("position", "quaternion", "arm_position", "arm_quaternion", "arm_velocity")
    )
    unknown = np.zeros(13)
    camera = Rotation.from_quat(quaternion)
    for _ in range(ROUNDS):
        turn, shift, hand_turn, hand_shift, delay = np.split(unknown, [3, 6, 9, 12])
        base = Rotation.from_rotvec(turn)
        arm = Rotation.from_rotvec(-delay * arm_velocity[:, 3:]) * Rotation.from_quat(arm_quaternion)
        lever = arm_position - delay * arm_velocity[:, :3] + arm.apply(hand_shift)
        off = position - base.apply(lever) - shift
        twist = (camera * (base * arm * Rotation.from_rotvec(hand_turn)).inv()).as_rotvec()
        change = _solve(unknown, off, twist, lever, arm.as_matrix(), arm_velocity)
        unknown = unknown + change
    turn, shift, hand_turn, hand_shift = np.split(unknown[:12], 4)
    turns = [tuple(Rotation.from_rotvec(part).as_quat().tolist()) for part in (turn, hand_turn)]
    shifts = [tuple(part.tolist()) for part in (shift, hand_shift)]
    return Registration(turns[0], shifts[0], turns[1], shifts[1], to_the_nanosecond(float(unknown[12])))


def _solve(unknown: np.ndarray, off: np.ndarray, twist: np.ndarray, lever: np.ndarray, arm: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Change (13,) of the unknowns, from what is left of positions (n, 3) and rotations (n, 3) and their first derivatives."""
    n, eye = len(off), np.broadcast_to(np.eye(3), (len(off), 3, 3))
    zero = np.zeros((n, 3, 3))
    x, y, z = lever.T
    o = np.zeros(n)
    across = np.moveaxis(np.array([[o, z, -y], [-z, o, x], [y, -x, o]]), 2, 0)  # d (w x lever) / d w
    rows = np.concatenate([across, eye, zero, arm, -velocity[:, :3, None]], axis=2) / POSITION
    turned = np.concatenate([eye, zero, arm, zero, -velocity[:, 3:, None]], axis=2) / ANGLE
    design = np.concatenate([rows.reshape(-1, 13), turned.reshape(-1, 13), np.diag(1.0 / USUAL)])
    left = np.concatenate([off.ravel() / POSITION, twist.ravel() / ANGLE, -unknown / USUAL])
    return np.linalg.lstsq(design, left, rcond=None)[0]
