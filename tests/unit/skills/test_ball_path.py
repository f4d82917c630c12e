"""Where a held ball is along a movement, beside rotations of SciPy and differences of its places."""

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.skills.learning import ball_states

AZIMUTH, ROLL, CENTRE = 0.7, -0.3, np.array([0.01, -0.02, 0.12])


def movement(time):
    """Position and velocity (n, 5), x, y, z, alpha, beta, of a smooth movement at times (n,)."""
    rates, phases = np.array([3.0, 2.0, 5.0, 4.0, 1.5]), np.arange(5.0)
    return np.sin(rates * time[:, None] + phases), rates * np.cos(rates * time[:, None] + phases)


def hand_at(position):
    """Orientations of a hand by their angles (8.4.1)."""
    angles = np.column_stack([np.full(len(position), AZIMUTH), -position[:, 3], position[:, 4]])
    return Rotation.from_euler("ZYZ", angles) * Rotation.from_euler("XY", [ROLL, np.pi / 2])


def test_the_ball_is_at_its_seat_in_the_hand_and_moves_with_it():
    time, step = np.linspace(0.0, 1.0, 11), 1e-5
    position, velocity = movement(time)
    places, speeds = ball_states(position, velocity, AZIMUTH, ROLL, CENTRE)
    np.testing.assert_allclose(
        places, position[:, :3] + hand_at(position).apply(CENTRE), atol=1e-14
    )
    before, after = (
        ball_states(*movement(time + late), AZIMUTH, ROLL, CENTRE)[0] for late in (-step, step)
    )
    np.testing.assert_allclose(speeds, (after - before) / (2.0 * step), atol=1e-8)
