"""The simulated dart thrower of thesis 8.1 and 8.2: a point mass drawn to a static attractor, then
free flight to a board.

Demonstrations draw their attractor at random from a region in front of the thrower. They become
attractors again by (7.20) and are encoded in the frames of (8.1), at the origin and at the place
that the dart hit. Practice (8.2) adds each throw, with the place that it really hit, to the
demonstrations.

The thesis gives no numbers; board and throwing line are those of the game, the arm is one that
lands on the board with a throw of 0.1 s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT, GRAVITY
from dart_skill.darts import RADII
from dart_skill.movement import (
    DSGMR,
    attractor_from_motion,
    base_frame,
    critical_damping,
    follow_attractor,
    target_frame,
)

BOARD_RADIUS = float(RADII[-1]) / 1000.0
"""Radius of the outside of the doubles [m]."""
SHOULDER = np.array([0.0, 0.0, 1.55])
STIFFNESS = 400.0
RELEASE, STEP = 0.1, 0.002
"""Length of the movement and its sampling [s]."""
REGION = np.array([[0.98, 1.10], [-0.075, 0.075], [0.225, 0.305]])
"""Where demonstrations draw their attractors, relative to the shoulder: forward, left, up (3, 2)
[m].
"""
N_COMPONENTS = 2


@dataclass(frozen=True, eq=False)
class DartThrow:
    """One throw: time (n,) [s]; attractor, position and velocity (n, 3) of the hand, the release
    last.

    Parameters
    ----------
    hit : (3,)
        Where the dart met the plane of the board, nan where it does not fly towards it.
    aim : (3,)
        If it had one.
    """

    time: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    hit: np.ndarray
    aim: np.ndarray | None = None

    @property
    def arrived(self) -> bool:
        return bool(np.isfinite(self.hit).all())

    @property
    def error(self) -> float:
        """Distance from aim to hit [m], infinite for a dart that never arrives."""
        return float(np.linalg.norm(self.hit - self.aim)) if self.arrived else np.inf

    def flight(self, n: int = 60) -> np.ndarray:
        """Positions (n, 3) from the release to the board."""
        return ballistic(
            self.position[-1],
            self.velocity[-1],
            np.linspace(0.0, time_to_board(self.position[-1], self.velocity[-1]), n),
        )


def ballistic(position: np.ndarray, velocity: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Positions (n, 3) of a projectile at times (n,)."""
    time = np.asarray(time)[:, None]
    return position + velocity * time - 0.5 * GRAVITY * np.array([0.0, 0.0, 1.0]) * time**2


def time_to_board(position: np.ndarray, velocity: np.ndarray) -> float:
    """Time [s] until the plane of the board is reached, nan if the dart does not fly towards it."""
    return float((BULL_DISTANCE - position[0]) / velocity[0]) if velocity[0] > 0.0 else np.nan


def thrown(attractor: np.ndarray, aim: np.ndarray | None = None) -> DartThrow:
    """The throw that an attractor (n, 3) at the stamps of the movement makes."""
    motion = follow_attractor(attractor, STEP, SHOULDER, np.zeros(3), STIFFNESS)
    position, velocity = motion.position, motion.velocity
    hit = ballistic(
        position[-1], velocity[-1], np.array([time_to_board(position[-1], velocity[-1])])
    )[0]
    recorded = attractor_from_motion(*motion, STIFFNESS, critical_damping(STIFFNESS))
    return DartThrow(stamps(), recorded, position, velocity, hit, aim)


def stamps() -> np.ndarray:
    return STEP * np.arange(round(RELEASE / STEP) + 1)


def demonstrate(n: int, rng: np.random.Generator) -> list[DartThrow]:
    """n throws at static attractors drawn from the region."""
    points = SHOULDER + rng.uniform(REGION[:, 0], REGION[:, 1], (n, 3))
    return [thrown(np.tile(point, (len(stamps()), 1))) for point in points]


def random_aims(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) points that are spread evenly over the board."""
    radius, angle = BOARD_RADIUS * np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    return np.column_stack(
        [np.full(n, BULL_DISTANCE), radius * np.cos(angle), BULL_HEIGHT + radius * np.sin(angle)]
    )


def frames_for(aim: np.ndarray) -> list:
    """(8.1): at the origin, which is the shoulder here, and at the aim, first axis towards it."""
    return [base_frame(0), target_frame(aim, (), SHOULDER)]


def learn(throws: list[DartThrow], n_components: int = N_COMPONENTS) -> DSGMR:
    """DS-GMR from throws, each with the place that it hit as its target."""
    samples = [np.column_stack([throw.time, throw.attractor]) for throw in throws]
    return DSGMR(n_components, STIFFNESS).fit(samples, [frames_for(throw.hit) for throw in throws])


def throw_at(model: DSGMR, aim: np.ndarray) -> DartThrow:
    """The throw that a model makes for an aim (3,) on the board."""
    return thrown(model.retrieve(frames_for(aim), stamps())[0], aim)


def practise(
    throws: list[DartThrow], aims: np.ndarray, n_components: int = N_COMPONENTS
) -> list[DartThrow]:
    """(8.2): one attempt per aim (n, 3); after each the model is learned again with all that hit
    the board's plane. The attempts.
    """
    known, attempts = list(throws), []
    for aim in aims:
        attempts.append(throw_at(learn(known, n_components), aim))
        known += [attempts[-1]] if attempts[-1].arrived else []
    return attempts
