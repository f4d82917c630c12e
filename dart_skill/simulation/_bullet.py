"""PyBullet without its greetings, which it prints when it is imported and whenever a physics server
is made; bodies from URDF text, and the dynamics of an arm.
"""

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from dart_skill.arm import ArmDescription, write_urdf
from dart_skill.common.extras import Absent
from dart_skill.simulation._arm_geometry import ArmGeometry


@contextmanager
def _muted() -> Iterator[None]:
    """What C code prints goes nowhere; errors come as exceptions."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(1), os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    c = ctypes.CDLL(None)
    try:
        c.fflush(None)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        yield
    finally:
        c.fflush(None)  # what is printed to a pipe is kept by C until then
        os.dup2(kept[0], 1)
        os.dup2(kept[1], 2)
        for descriptor in (*kept, nowhere):
            os.close(descriptor)


try:
    with _muted():
        import pybullet
        from pybullet_utils.bullet_client import BulletClient
except ModuleNotFoundError as error:  # not needed where nothing is simulated
    pybullet, BulletClient = Absent(error), object


class _Client(BulletClient):
    """BulletClient looks every function up, and wraps it, at each call; this one remembers."""

    # What BulletClient's destructor asks for, even when an interrupt (Ctrl-C) ended the
    # constructor before there was a connection.
    _client = -1
    _pid = -1

    def __getattr__(self, name: str) -> Any:
        function = super().__getattr__(name)
        self.__dict__[name] = function
        return function


def connect() -> BulletClient:
    """A physics server in this process."""
    with _muted():
        return _Client(pybullet.DIRECT)


def load_urdf(client: BulletClient, urdf: str, position: list[float], turn: float = 0.0) -> int:
    """A body that is fixed to the world at a position (3,) [m], turned about the vertical [rad]."""
    upright = [0.0, 0.0, float(np.sin(turn / 2)), float(np.cos(turn / 2))]
    handle, path = tempfile.mkstemp(suffix=".urdf")
    try:
        with open(handle, "w", encoding="utf-8") as file:
            file.write(urdf)
        return client.loadURDF(
            path, position, upright, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
        )
    finally:
        os.unlink(path)


class ArmDynamics:
    """Mass matrix, gravity and Coriolis terms of the links of an arm, without rotors and friction.

    Attribute: geometry, where its links are.

    Parameters
    ----------
    client
        Physics server in which nothing moves, with the arm's gravity.
    description
        Of the arm.
    ball_in_hand
        Whether the ball moves with the hand.
    """

    def __init__(
        self, client: BulletClient, description: ArmDescription, ball_in_hand: bool = False
    ):
        self._client, self.geometry = client, ArmGeometry(description)
        self._body = load_urdf(client, write_urdf(description, ball_in_hand, False), [0, 0, 0])
        self._still = [0.0] * description.n_joints

    def gravity_torque(self, position: np.ndarray) -> np.ndarray:
        """Torque that holds the arm (n,) [N m] at angles (n,) [rad]."""
        return self._torque(position.tolist(), self._still)

    def terms(self, position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix (n, n) [kg m^2], and the torque at zero acceleration (n,) [N m].

        Parameters
        ----------
        position, velocity
            Of the joints (n,) [rad], [rad/s].
        """
        angles = position.tolist()
        return (
            np.array(self._client.calculateMassMatrix(self._body, angles)),
            self._torque(angles, velocity.tolist()),
        )

    def _torque(self, angles: list[float], speeds: list[float]) -> np.ndarray:
        return np.array(
            self._client.calculateInverseDynamics(self._body, angles, speeds, self._still)
        )
