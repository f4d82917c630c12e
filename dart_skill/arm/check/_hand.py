"""The tracked body on the hand against the arm's own kinematics: where base and body are seen, and
whether the postures tell.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, RegistrationFit, Sightings, measure_registration
from dart_skill.arm.check._heard import Grade, Heard, Line, graded, line, worst
from dart_skill.arm.check._joints import speeds_of

STEP = 0.05
"""The hand is looked at whenever a joint has moved by so much since the last time [rad]."""
FAST = 1.0
"""And no joint is faster [rad/s]: how late stamps are counts little then."""
MOST = 400
"""Largest number of postures that are compared."""
NEAREST = 0.01
"""Joint states are so near in time to a pose that is compared with them [s]."""
LEFT = 0.005, np.deg2rad(1.0)
"""Root mean square that a good fit leaves over [m], [rad]."""
TOO_MUCH_LEFT = 0.015, np.deg2rad(3.0)
"""Root mean square above which nothing may move [m], [rad]."""
SURE = 0.005, np.deg2rad(0.5)
"""Standard deviation of the registration that is good [m], [rad]."""
TOO_UNSURE = 0.015, np.deg2rad(1.5)
"""Standard deviation of the registration above which nothing may move [m], [rad]."""
BASE = 0.04, np.deg2rad(2.5)
"""Shift and turn of the base in the cameras' world that throws find out by themselves [m], [rad]."""
TOO_FAR_BASE = 0.15, np.deg2rad(10.0)
"""Shift and turn of the base that a plan still reaches [m], [rad]."""
BODY = 0.02, np.deg2rad(2.5)
"""Shift and turn of the tracked body on the hand that throws find out by themselves [m], [rad]; its
origin is on the mounting face, and z points out of the palm.
"""
TOO_FAR_BODY = 0.05, np.deg2rad(15.0)
"""Shift and turn of the tracked body that a plan still reaches [m], [rad]."""
HEIGHT = 0.02
"""Difference of the seen height of the base from that of the mount that is good [m]."""
TOO_HIGH = 0.1
"""Difference of the heights above which nothing may move [m]."""
UNKNOWNS = [
    f"{part} {axis}"
    for part in ("turn of the base", "shift of the base", "turn of the body", "shift of the body")
    for axis in "xyz"
]
"""Names of the unknowns of a registration."""


def sightings_of(heard: Heard, model: ArmModel) -> Sightings:
    """The hand by cameras and by joints, once for each posture that is a little different from the
    last one.
    """
    joints, hand = heard.joints, heard.poses["hand"]
    states, frames = (
        joints.forward,
        hand.forward
        & np.isfinite(hand.position).all(axis=1)
        & np.isfinite(hand.quaternion).all(axis=1),
    )
    if np.count_nonzero(states) < 3 or not frames.any():
        return Sightings(*(np.empty((0, n)) for n in (3, 4, 3, 4, 6)))
    zero = joints.stamp_ns[0]
    time, seen = (joints.stamp_ns[states] - zero) * 1e-9, (hand.stamp_ns[frames] - zero) * 1e-9
    q = np.column_stack([np.interp(seen, time, column) for column in joints.position[states].T])
    qd = speeds_of(time, joints.position[states], seen)
    after = np.clip(np.searchsorted(time, seen), 1, len(time) - 1)
    near = np.maximum(time[after] - seen, seen - time[after - 1]) < NEAREST
    usable = np.flatnonzero(near & (np.abs(qd).max(axis=1) < FAST))
    chosen = _different(q, usable)
    norm = np.linalg.norm(hand.quaternion[frames], axis=1, keepdims=True)
    quaternion = hand.quaternion[frames] / np.where(norm > 0.0, norm, 1.0)
    return Sightings.of_joints(
        model, q[chosen], qd[chosen], hand.position[frames][chosen], quaternion[chosen]
    )


def _different(q: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Usable instants at which a joint has moved by STEP since the last one that was taken; MOST
    of them, over all.
    """
    chosen: list[int] = []
    for k in usable.tolist():
        if not chosen or np.abs(q[k] - q[chosen[-1]]).max() > STEP:
            chosen.append(k)
    return np.array(chosen, dtype=int)[
        np.unique(np.linspace(0, len(chosen) - 1, min(MOST, len(chosen))).round().astype(int))
    ]


def hand_lines(
    heard: Heard, model: ArmModel, joints_are_right: bool
) -> tuple[list[Line], RegistrationFit | None]:
    """What is left of the fit, whether the postures suffice, base, mount height, body; and the
    fit, if it can be trusted.
    """
    asked = f"left over at most {1e3 * LEFT[0]:.0f} mm, {np.rad2deg(LEFT[1]):.0f} deg"
    check = "hand against kinematics"
    if not joints_are_right:
        return [
            line(check, Grade.NO_GO, "not compared", asked, "set the joints right first")
        ], None
    seen = sightings_of(heard, model)
    if len(seen) < 3:
        remedy = (
            "lead the arm through 8 postures or more, each with the hand turned otherwise, and let"
            " the cameras see it"
        )
        return [
            line(check, Grade.NO_GO, f"{len(seen)} different postures were seen", asked, remedy)
        ], None
    fit = measure_registration(seen)
    left = _left(fit, asked)
    postures = _postures(fit)
    lines = [left, postures, _base(fit), _height(fit, model), _body(fit), _delay(fit)]
    is_trusted = Grade.NO_GO not in (left.verdict, postures.verdict)
    return (lines if is_trusted else lines[:2]), (fit if is_trusted else None)


def _pair(shift: float, turn: float) -> str:
    return f"{1e3 * shift:.1f} mm, {np.rad2deg(turn):.2f} deg"


def _asked(good: tuple[float, float], bearable: tuple[float, float]) -> str:
    """What throws tell by themselves, and what they do with the file of --write."""
    near, far = (
        f"{1e3 * shift:.0f} mm, {np.rad2deg(turn):g} deg" for shift, turn in (good, bearable)
    )
    return f"{near} (with a file {far})"


def _both(
    shift: float, turn: float, good: tuple[float, float], bearable: tuple[float, float]
) -> Grade:
    return worst(graded(shift, good[0], bearable[0]), graded(turn, good[1], bearable[1]))


def _left(fit: RegistrationFit, asked: str) -> Line:
    verdict = _both(fit.position_error, fit.angle_error, LEFT, TOO_MUCH_LEFT)
    measured = (
        f"{_pair(fit.position_error, fit.angle_error)} in {fit.n_sightings} postures, worst"
        f" {1e3 * fit.worst_position:.1f} mm"
    )
    remedy = (
        "zero of a joint, units, another body's name, markers that slip, or another arm than"
        " config/wam.yaml says"
    )
    return line("hand against kinematics", verdict, measured, asked, remedy)


def _postures(fit: RegistrationFit) -> Line:
    unsure = fit.spread[:12].reshape(4, 3)
    turn, shift = float(unsure[[0, 2]].max()), float(unsure[[1, 3]].max())
    measured = (
        f"known to {_pair(shift, turn)}; hand turned by {np.rad2deg(fit.turned):.0f} deg,"
        f" condition {fit.condition:.0f}"
    )
    parts = fit.spread[:12] / np.tile(np.repeat([SURE[1], SURE[0]], 3), 2)
    open_ones = [UNKNOWNS[k] for k in np.argsort(-parts)[:3] if parts[k] > 1.0]
    remedy = (
        f"they say little of {', '.join(open_ones)}: turn the hand about more axes (J1, J3, J5,"
        " J7), far from each other"
    )
    asked = f"to {_pair(SURE[0], SURE[1])}"
    return line("postures", _both(shift, turn, SURE, TOO_UNSURE), measured, asked, remedy)


def _base(fit: RegistrationFit) -> Line:
    turn = Rotation.from_quat(fit.registration.turn).magnitude()
    x, y, _ = fit.registration.shift
    verdict = _both(float(np.hypot(x, y)), float(turn), BASE, TOO_FAR_BASE)
    remedy = "give learner and commander the file of --write (registration_file)"
    if verdict is Grade.NO_GO:
        remedy = (
            "set the origin and the axes of the cameras' world again: origin below J1, x where J1"
            " is zero, z up"
        )
    asked = _asked(BASE, TOO_FAR_BASE)
    return line(
        "base",
        verdict,
        f"at ({1e3 * x:.1f}, {1e3 * y:.1f}) mm, turned by {np.rad2deg(turn):.2f} deg",
        asked,
        remedy,
    )


def _height(fit: RegistrationFit, model: ArmModel) -> Line:
    told = model.description.mount_height
    base = Rotation.from_quat(fit.registration.turn).apply([0.0, 0.0, told]) + np.array(
        fit.registration.shift
    )
    verdict = graded(abs(base[2] - told), HEIGHT, TOO_HIGH)
    remedy = (
        f"set mount_height of config/wam.yaml to {base[2]:.3f}, or the floor of the cameras' world"
        " again"
    )
    return line(
        "mount height",
        verdict,
        f"the base is seen at {base[2]:.3f} m",
        f"{told:.3f} m within {1e3 * HEIGHT:.0f} mm",
        remedy,
    )


def _body(fit: RegistrationFit) -> Line:
    turn, shift = (
        Rotation.from_quat(fit.registration.hand_turn).magnitude(),
        float(np.linalg.norm(fit.registration.hand_shift)),
    )
    verdict = _both(shift, float(turn), BODY, TOO_FAR_BODY)
    remedy = "give learner and commander the file of --write (registration_file)"
    if verdict is Grade.NO_GO:
        remedy = (
            "move the pivot of the rigid body to the mounting face of the hand and turn its axes:"
            " z out of the palm (Motive: Rigid Body)"
        )
    x, y, z = 1e3 * np.array(fit.registration.hand_shift)
    measured = f"at ({x:.1f}, {y:.1f}, {z:.1f}) mm, turned by {np.rad2deg(turn):.2f} deg"
    return line("body on the hand", verdict, measured, _asked(BODY, TOO_FAR_BODY), remedy)


def _delay(fit: RegistrationFit) -> Line:
    asked = "cameras stamp at most 20 ms after the joints"
    if fit.spread[12] > 0.005:
        return line(
            "delay of the stamps", Grade.GO, "not told: the arm rested; throws tell it", asked
        )
    late, spread = 1e3 * fit.registration.delay, 1e3 * fit.spread[12]
    verdict = graded(abs(late), 20.0, 50.0)
    return line(
        "delay of the stamps",
        verdict,
        f"{late:.1f} ms +- {spread:.1f}",
        asked,
        "use_vrpn_timestamps, and chrony on both machines",
    )
