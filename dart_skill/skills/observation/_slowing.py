"""How much the air slows a ball that flies, against the ball that is expected: a ball of another mass
is another ball in the air, too.

    x(t) = x0 + v0 t + a t^2 / 2 + s d(t)

d(t) is what the drag of the expected ball takes from its way, s the share that is seen of it. The
acceleration a is the same for all flights, and is told from them: so neither cameras that stand
askew nor a length that is a little wrong are taken for air.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dart_skill.common.flight import Ball, flight
from dart_skill.skills.observation._free_flight import FreeFlight

UNLIKE = 1.4
"""Factor on what the air does from which on it is another ball; those of a kind differ by 1.2."""
SURE = 3.0
"""So many standard deviations it must be beyond that."""
LEAST_SHARE = 0.05
"""A smaller share tells no mass."""


@dataclass(frozen=True, eq=False)
class Slowing:
    """Normal equations of a (3,) and s, summed over flights.

    Parameters
    ----------
    matrix
        (4, 4), the inverse of their covariance.
    right
        (4,), the right side.
    """

    matrix: np.ndarray
    right: np.ndarray

    @classmethod
    def none(cls) -> Slowing:
        """Equations that no flight has added to."""
        return cls(np.zeros((4, 4)), np.zeros(4))

    @classmethod
    def of(cls, time: np.ndarray, position: np.ndarray, free: FreeFlight, ball: Ball) -> Slowing:
        """Equations of one flight in samples (n,) [s], (n, 3) [m] of a ball.

        Parameters
        ----------
        ball
            That is expected.
        """
        since = time[free.samples] - free.fit.time
        taken = flight(free.fit.position, free.fit.velocity, since, ball)[0] - (
            free.fit.position
            + free.fit.velocity * since[:, None]
            - 0.5 * ball.gravity * np.outer(since**2, [0.0, 0.0, 1.0])
        )
        lines, _ = np.linalg.qr(np.column_stack([np.ones_like(since), since]))

        def bent(values: np.ndarray) -> np.ndarray:
            return values - lines @ (lines.T @ values)

        half, seen, drag = bent(0.5 * since**2), bent(position[free.samples]), bent(taken)
        matrix = np.diag([*np.full(3, half @ half), np.sum(drag**2)])
        matrix[:3, 3] = matrix[3, :3] = half @ drag
        right = np.append(half @ seen, np.sum(drag * seen))
        return cls(matrix / free.noise**2, right / free.noise**2)

    @classmethod
    def together(cls, flights: Iterable[Slowing]) -> Slowing:
        """Sum of the equations of flights."""
        each = list(flights)
        return cls(
            sum((one.matrix for one in each), np.zeros((4, 4))),
            sum((one.right for one in each), np.zeros(4)),
        )

    @property
    def share(self) -> tuple[float, float]:
        """The share s, and its standard deviation; nan and inf where no flight tells it."""
        if np.linalg.matrix_rank(self.matrix) < 4:
            return float("nan"), float("inf")
        covariance = np.linalg.inv(self.matrix)
        return float((covariance @ self.right)[3]), float(np.sqrt(covariance[3, 3]))

    def in_words(self, ball: Ball) -> str:
        """What is wrong with the mass of the ball that is expected; empty if nothing is known to be."""
        share, spread = self.share
        if not (share + SURE * spread < 1.0 / UNLIKE or share - SURE * spread > UNLIKE):
            return ""
        mass = ball.mass / max(share, LEAST_SHARE)
        return (
            f"the air slows the ball {share:.2f} times as much as one of {1e3 * ball.mass:.0f} g: if"
            f" its diameter is {ball.diameter:g} m, it has about {1e3 * mass:.0f} g; put its mass"
            " into config/world.yaml (ball_mass), start again and learn again"
        )
