"""How many throws the best of all plans would get in, if the fingers gave the ball another
direction and speed each time.

No plan can foresee this scatter. But a plan chooses how steeply the ball flies, and where it aims:
a flat throw is more sensitive to the direction, a steep one to the speed. The bound tries all of
them from the place where the ball was let go, whatever the arm can do.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from dart_skill.common.flight import TENNIS_BALL, Ball, landing
from dart_skill.movement import azimuth_of

ELEVATIONS = np.radians(np.arange(-20.0, 61.0, 5.0))
FASTEST = 12.0
"""Faster than any WAM [m/s]: the bound shall not be one of the arm."""
FASTER = np.linspace(-0.04, 0.04, 9)
"""Shares by which a throw is faster than the one that hits the centre: with a curved spread the
best aim is beside it.
"""
SAMPLES = 4000


def best_share(
    position: np.ndarray,
    target: np.ndarray,
    turn: float,
    speed: float,
    radius: float,
    ball: Ball = TENNIS_BALL,
    seed: int = 0,
) -> float:
    """Largest share of throws that come down within `radius` [m] of the target, over all
    directions and speeds.

    Parameters
    ----------
    position, target
        (3,) [m], where the ball leaves the hand, and the centre of the rim.
    turn
        Standard deviation of the direction on each of three axes [rad].
    speed
        Of the speed, as a share. Each direction and speed is tried with the same 4000 samples.

    Raises
    ------
    ValueError
        If no speed reaches the target.
    """
    rng = np.random.default_rng(seed)
    turns, shares = (
        Rotation.from_rotvec(turn * rng.standard_normal((SAMPLES, 3))),
        1.0 + speed * rng.standard_normal(SAMPLES),
    )
    position, target = np.asarray(position, dtype=float), np.asarray(target, dtype=float)
    shares_in = []
    for velocity in _velocities(position, target, ball):
        for more in FASTER:
            scattered = shares[:, None] * turns.apply((1.0 + more) * velocity)
            away = (
                landing(
                    np.broadcast_to(position, (SAMPLES, 3)), scattered, target[2], ball
                ).position
                - target
            )
            shares_in.append(np.mean(np.hypot(away[:, 0], away[:, 1]) < radius))
    if not shares_in:
        raise ValueError(f"no throw from {position} m reaches {target} m at up to {FASTEST} m/s")
    return float(max(shares_in))


def _velocities(position: np.ndarray, target: np.ndarray, ball: Ball) -> list[np.ndarray]:
    """One (3,) [m/s] for each elevation at which there is a speed that hits the target."""
    away = target - position
    azimuth, distance = azimuth_of(away), float(np.hypot(away[0], away[1]))
    found = []
    for elevation in ELEVATIONS:
        direction = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )

        def beyond(speed: float, direction: np.ndarray = direction) -> float:
            hit = landing(position, speed * direction, target[2], ball).position[:2] - position[:2]
            return float(np.hypot(*hit)) - distance

        if beyond(0.1) < 0.0 < beyond(FASTEST):
            found.append(brentq(beyond, 0.1, FASTEST, xtol=1e-4) * direction)
    return found
