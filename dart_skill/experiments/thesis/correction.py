"""`correction`: the loop that cameras close about a careful arm (docs/fleet.md). What is left of an
error that encoders make, over time, and the modulus margin over the time constant of the filter. The
thesis has no such figure.

Each joint is two inertias and a cable. The servo acts on the side of the motor, late and with
filtered speeds; cameras see the side of the link, late, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from dart_skill.arm import FILTER_TIME, TAKES_OUT, the_arm
from dart_skill.common.configuration import load_yaml

LINKS = np.array(
    [[0.3, 3.5], [1.5, 4.0], [0.1, 1.0], [0.3, 0.9], [0.01, 0.08], [0.03, 0.08], [0.003, 0.01]]
)
"""Smallest and largest inertia of the link side that a joint has in throws [kg m^2]."""
LEAST_FRICTION = 0.7 * np.array([1.5, 0.9, 0.5, 0.25, 0.016, 0.1, 0.0027])
"""Viscous part of the friction of each joint [N m s/rad]."""
PERIOD = 0.002
"""Time between two states of the arm [s]."""
SPEED_FILTER = 180.0
"""Corner of the low-pass of measured speeds [rad/s]."""
DAMPING_RATIO = 0.05
"""Damping of a cable of the simulated transmission, in parts of the critical one."""
GIVES = 1300.0, 100.0
"""Stiffness [1/s^2] and damping [1/s] of attractor and second pull together: how a shift of what is
wanted becomes motion of the model.
"""
FRAME = 0.005
"""Half a frame of cameras with 100 Hz [s]: a pose is so old in the mean."""
OMEGA = 0.02 * np.arange(1.0, 30_001.0)
"""Angular frequencies of which a response over time is made [rad/s]."""
CABLES = (0.5, 1.0, 2.0)
"""Stiffness of cables, as shares of those of config/fleet.yaml."""
LATE = (0.0, 0.006, 0.012, 0.02)
"""By which cameras are late [s]."""


class Joint(NamedTuple):
    """One joint of an arm, and the cameras.

    Parameters
    ----------
    number
        From 0 on.
    link
        Inertia of the link side [kg m^2].
    stiffness
        Of the cable [N m/rad].
    late
        By which the cameras are late [s].
    """

    number: int
    link: float
    stiffness: float
    late: float


def all_joints() -> list[Joint]:
    """Every joint with light and heavy loads, soft and stiff cables, early and late cameras."""
    stiffness = load_yaml("fleet.yaml")["fleet"]["wam_simulator"]["joint_stiffness"]["times"]
    return [
        Joint(number, float(link), share * stiffness[number], late)
        for number in range(len(LINKS))
        for link in LINKS[number]
        for share in CABLES
        for late in LATE
    ]


class Loop(NamedTuple):
    """Frequency responses (n,) of the loop, at angular frequencies.

    Parameters
    ----------
    moves
        From where the hand is aimed at to where the joints have it.
    seen
        From there to where cameras see the hand.
    eyes
        Of the cameras and the filter.
    rest
        Of the integral of what is left.
    """

    moves: np.ndarray
    seen: np.ndarray
    eyes: np.ndarray
    rest: np.ndarray

    @property
    def opened(self) -> np.ndarray:
        """The loop, cut where the hand is aimed at (n,)."""
        gives = (self.seen - 1.0) * self.eyes
        return self.moves * (self.rest * (1.0 + gives) + gives)

    @property
    def left(self) -> np.ndarray:
        """From an error of the joints to what cameras see of it (n,)."""
        aimed = -(1.0 + self.rest) * self.eyes / (1.0 + self.opened)
        return 1.0 + self.seen * self.moves * aimed


def loop_of(joint: Joint, takes_out: float, filter_time: float, omega: np.ndarray) -> Loop:
    """The loop of a joint.

    Parameters
    ----------
    joint
        With its cameras.
    takes_out
        Rate at which what is left is taken out [1/s].
    filter_time
        Of the difference that cameras see [s].
    omega : (n,)
        [rad/s], above 0.
    """
    s, j, delay = 1j * omega, joint.number, 1
    motor, gains = the_arm().motors.reflected_inertia[j, j], the_arm().servo
    late = np.exp(-s * (delay + 0.5) * PERIOD)
    spring = joint.stiffness + 2.0 * DAMPING_RATIO * np.sqrt(joint.stiffness * motor) * s
    friction = LEAST_FRICTION[j] * s
    damped = gains.following_damping[j] * s * SPEED_FILTER / (s + SPEED_FILTER)
    servo = (gains.following_stiffness[j] + damped) * late
    seen = spring / (joint.link * s**2 + spring)
    fed = (motor + joint.link) * s**2 * late + friction
    follows = (servo + fed) / (motor * s**2 + friction + spring * (1.0 - seen) + servo)
    model = GIVES[0] / (s**2 + GIVES[1] * s + GIVES[0])
    eyes = np.exp(-s * (joint.late + FRAME)) / (filter_time * s + 1.0)
    return Loop(follows * model, seen, eyes, takes_out / s)


def margin(takes_out: float, filter_time: float) -> float:
    """Least modulus margin, the distance of the loop from -1, over all joints.

    Parameters
    ----------
    takes_out, filter_time
        As of `loop_of`.
    """
    omega = np.logspace(-1, 2.7, 3000)
    return min(
        float(np.abs(1.0 + loop_of(joint, takes_out, filter_time, omega).opened).min())
        for joint in all_joints()
    )


def step_left(
    joints: Sequence[Joint], takes_out: float, filter_time: float, times: np.ndarray
) -> np.ndarray:
    """What cameras see, as a share, of errors that joints make from 0 on: (len(joints), m).

    Parameters
    ----------
    times : (m,)
        After that [s], above 0.
    takes_out, filter_time
        As of `loop_of`.
    joints
        Each of them alone.
    """
    left = [loop_of(joint, takes_out, filter_time, OMEGA).left for joint in joints]
    return step_of(np.array(left), times)


def step_of(responses: np.ndarray, times: np.ndarray) -> np.ndarray:
    """What follows a step from 0 to 1: the integral of 2 / pi Re(H) sin(omega t) / omega.

    Parameters
    ----------
    responses : (k, n)
        H at `OMEGA`; 1 for what is faster.
    times : (m,)
        After the step [s], above 0.

    Returns
    -------
    (k, m)
    """
    waves, slower = np.sin(np.outer(OMEGA, times)) / OMEGA[:, None], responses.real - 1.0
    # by trapezoids; at 0 the wave is t
    return 1.0 + 2.0 / np.pi * OMEGA[0] * (slower @ waves + 0.5 * np.outer(slower[:, 0], times))


def draw_correction(seed: int = 0) -> tuple[Figure, dict]:
    """Left: what is left of an error. Right: the margin."""
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    over_time, over_filter = figure.subplots(1, 2)
    times, joints = np.linspace(0.0, 1.2, 241)[1:], all_joints()
    left = step_left(joints, TAKES_OUT, FILTER_TIME, times)
    over_time.fill_between(times, left.min(axis=0), left.max(axis=0), alpha=0.3, lw=0)
    over_time.plot(times, np.median(left, axis=0), label="median, all joints within the band")
    over_time.set(xlabel="time since the error [s]", ylabel="share that cameras still see")
    over_time.legend()
    filters = np.array([0.03, 0.05, 0.07, 0.1, 0.14, 0.2])
    margins = {
        "cameras alone": [margin(0.0, one) for one in filters],
        f"and what is left, at {TAKES_OUT:g} 1/s": [margin(TAKES_OUT, one) for one in filters],
    }
    for name, values in margins.items():
        over_filter.plot(filters, values, marker="o", label=name)
    over_filter.axvline(FILTER_TIME, color="0.7", zorder=0)
    over_filter.set(xlabel="time constant of the filter [s]", ylabel="least modulus margin")
    over_filter.set_ylim(0.0, 1.0)
    over_filter.legend()
    settled = times[np.flatnonzero(np.abs(left).max(axis=0) > 0.05)[-1]]
    measured = {
        "margin_of_cameras_alone": margin(0.0, FILTER_TIME),
        "margin": margin(TAKES_OUT, FILTER_TIME),
        "overshoot": float(-left.min()),
        "within_5_percent_s": float(settled),
    }
    return figure, measured
