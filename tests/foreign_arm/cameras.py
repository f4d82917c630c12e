"""A camera system: poses at 100 Hz that come late, with noise, with lost frames, and of bodies
that were registered a little wrong.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np

from tests.foreign_arm.arm import PERIOD

FRAME_STEPS = 5  # of the plant: 100 Hz
MARKER_SPREAD = (
    0.1  # of a body's markers, which makes noise of a direction of noise of a place [m]
)


@dataclass(frozen=True)
class Sighting:
    """One pose: the body, the plant's step at which the frame was taken, place (3,) [m], attitude
    (4,) as x, y, z, w.
    """

    body: str
    step: int
    place: np.ndarray
    attitude: np.ndarray


def turned_by(vector):
    """Rotation (3, 3) about a vector (3,) by its length [rad]."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def attitude(rotation):
    """x, y, z, w of a rotation (3, 3): the largest of four candidates (Shepperd)."""
    trace = np.trace(rotation)
    squares = np.append(1.0 + 2.0 * np.diag(rotation) - trace, 1.0 + trace)
    largest = int(np.argmax(squares))
    if largest == 3:
        result = np.array(
            [
                rotation[2, 1] - rotation[1, 2],
                rotation[0, 2] - rotation[2, 0],
                rotation[1, 0] - rotation[0, 1],
                squares[3],
            ]
        )
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        result = np.zeros(4)
        result[i], result[3] = squares[i], rotation[k, j] - rotation[j, k]
        result[j], result[k] = rotation[j, i] + rotation[i, j], rotation[k, i] + rotation[i, k]
    return result / np.linalg.norm(result)


class Cameras:
    """Looks at bodies of a plant at every step, and hands out the frames whose latency has passed."""

    def __init__(self, laboratory, bodies):
        self._laboratory, self._bodies = laboratory, bodies
        self._random = np.random.default_rng([laboratory.seed, 73])
        self._delay = round(laboratory.camera_latency / PERIOD)
        self._pending = deque()
        self.hidden = lambda body: False  # whether something stands before a body now
        self.shift = {body: laboratory.registration_shift * self._direction() for body in bodies}
        self.turn = {
            body: turned_by(laboratory.registration_turn * self._direction()) for body in bodies
        }

    def _direction(self):
        vector = self._random.standard_normal(3)
        return vector / np.linalg.norm(vector)

    def _see(self, plant, body):
        place, rotation = plant.pose(body)
        noise = self._laboratory.camera_noise
        seen = place + rotation @ self.shift[body] + noise * self._random.standard_normal(3)
        tilt = turned_by(noise / MARKER_SPREAD * self._random.standard_normal(3))
        return Sighting(body, plant.steps, seen, attitude(tilt @ rotation @ self.turn[body]))

    def look(self, plant):
        """Sightings that arrive at this step of the plant."""
        if plant.steps % FRAME_STEPS == 0:
            arrives = [self._random.random() >= self._laboratory.camera_loss for _ in self._bodies]
            seen = [
                body
                for body, whole in zip(self._bodies, arrives, strict=True)
                if whole and not self.hidden(body)
            ]
            self._pending.extend(self._see(plant, body) for body in seen)
        arrived = []
        while self._pending and self._pending[0].step + self._delay <= plant.steps:
            arrived.append(self._pending.popleft())
        return arrived
