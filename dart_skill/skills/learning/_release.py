"""Where a ball comes down that leaves the path of the hand at one instant or another.

Flights begin at the steps of the path; between three steps a parabola in time tells where the
others end. The reach grows with the instant of the release while the hand gains speed, and falls
again when it points too low: a ball that is let go where it flies farthest comes down, to first
order, at the same place if the hand opens a little early or late.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.arm import STRETCHED, MotionPlan, Registration, the_arm
from dart_skill.common.surface import BASKETS, Game
from dart_skill.movement import rotate


def hits_along(
    position: np.ndarray,
    quaternion: np.ndarray,
    velocity: np.ndarray,
    target: np.ndarray,
    game: Game,
) -> np.ndarray:
    """Where balls meet the surface of a target (n, 3), nan if never, that leave a hand with
    position (n, 3), quaternion (n, 4) and velocity (n, 6), linear over angular.
    """
    arm = rotate(quaternion, the_arm().hand.ball_centre[None])
    speed = velocity[:, :3] + np.cross(velocity[:, 3:], arm)
    return game.surface.crossing(position + arm, speed, target, game.projectile).position


def hit_at(time: np.ndarray, hits: np.ndarray, when: float) -> np.ndarray:
    """Where a ball comes down (3,) that leaves the hand at an instant, if those that leave it at
    steps of time (n,) do at hits (n, 3).
    """
    k = int(nearest_step(time, when))
    before, here, after = time[k - 1 : k + 2].tolist()
    return _weights(before, here, after, when) @ hits[k - 1 : k + 2]


def weights_at(time: np.ndarray, k: np.ndarray | int, when: np.ndarray | float) -> np.ndarray:
    """Weights (..., 3) of the steps k - 1, k and k + 1 of time (n,) in the parabola through them,
    at instants (...).
    """
    return np.moveaxis(_weights(time[k - 1], time[k], time[k + 1], when), 0, -1)


def _weights(before: Any, here: Any, after: Any, when: Any) -> np.ndarray:
    """Weights (3, ...) of three instants (...) in the parabola through them."""
    return np.array(
        [
            (when - here) * (when - after) / ((before - here) * (before - after)),
            (when - before) * (when - after) / ((here - before) * (here - after)),
            (when - before) * (when - here) / ((after - before) * (after - here)),
        ]
    )


def nearest_step(time: np.ndarray, when: np.ndarray | float) -> np.ndarray:
    """The step of time (n,), but for the first and the last, that is nearest to instants (...)."""
    return np.searchsorted(0.5 * (time[1:] + time[:-1]), when).clip(1, len(time) - 2)


def landing_if_late(plan: MotionPlan, late: ArrayLike, game: Game = BASKETS) -> np.ndarray:
    """Where the ball comes down (..., 3) on the plane of the rim, or meets the board, if the hand
    follows the plan and the ball leaves it so late (...) [s]; one that leaves it before or after
    the path counts as leaving at its end.
    """
    path = plan.path
    when = np.clip(plan.release + np.asarray(late, dtype=float), path.time[0], path.time[-1])
    k = nearest_step(path.time, when)
    steps = slice(k.min() - 1, k.max() + 2)
    hits = hits_along(
        path.position[steps],
        path.quaternion[steps],
        path.velocity[steps],
        plan.thrown.target,
        game,
    )
    three = (k - steps.start)[..., None] + np.arange(-1, 2)
    return np.einsum("...i,...ij->...j", weights_at(path.time, k, when), hits[three])


def farthest(reach: np.ndarray) -> tuple[int, float]:
    """Where a reach (n,), nan where there is none, is largest: its step, but for the first and the
    last, and how many steps, at most one, the top of the parabola through its neighbours comes
    after it.
    """
    reach = np.where(np.isnan(reach), -np.inf, reach)
    k = min(max(int(reach.argmax()), 1), len(reach) - 2)
    before, here, after = reach[k - 1 : k + 2].tolist()
    if not math.isfinite(before + here + after):
        return k, 0.0
    bend = before + after - 2.0 * here
    top = 0.5 * (before - after) / bend if bend < 0.0 else float(np.sign(after - before))
    return k, min(max(top, -1.0), 1.0)


def stretched_at(time: np.ndarray, position: np.ndarray) -> float:
    """The first instant of time (n,) at which a hand with position (n, 3) is too far from the
    shoulder for the arm; infinite if there is none.
    """
    over = np.linalg.norm(position - the_arm().shoulder, axis=1) - (the_arm().reach - STRETCHED)
    k = int(np.argmax(over >= 0.0))
    if over[k] < 0.0:
        return np.inf
    return float(time[0] if k == 0 else np.interp(0.0, over[k - 1 : k + 1], time[k - 1 : k + 1]))


def certainly_within(position: np.ndarray, registration: Registration) -> bool:
    """Whether no hand that the cameras see at position (n, 3) is too far from the shoulder for the
    arm, however it is turned: much less work than `stretched_at`, which computes the poses of the
    hand from those of the tracked body.
    """
    shoulder, reach = _seen_by(registration)
    return bool(np.linalg.norm(position - shoulder, axis=1).max() < reach)


@lru_cache(maxsize=16)
def _seen_by(registration: Registration) -> tuple[np.ndarray, float]:
    """The shoulder (3,) in the world of the cameras, and how far from it a tracked body at least
    can be [m]: the same for many plans.
    """
    shoulder = rotate([registration.turn], the_arm().shoulder[None]) + np.array(registration.shift)
    return shoulder, the_arm().reach - STRETCHED - float(np.linalg.norm(registration.hand_shift))
