"""How far an arm can throw: an upper bound, from the limits of its joints alone.

The arm swings in a vertical plane (`SwingPlane`). In a posture the hand is fastest in a direction u,
without moving aside (w), at the speeds qd of

    max u . J qd   so that   w . J qd = 0,   |qd_i| <= limit_i.

Its dual has one unknown, min over s of sum_i limit_i |a_i - s b_i| with a = J'u and b = J'w, which is
convex and piecewise linear: the least of its values at s = a_i / b_i is the speed. From rest, at
constant acceleration of the joints, the swing takes a given time; it must begin within the ranges of
the joints, and needs torques (Gallant and Gosselin, "Maximizing the throwing distance of robotic
manipulators", J. Mechanisms Robotics 16(9), have the whole optimisation). A ball without drag flies
from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.arm._description import ArmSwing
from dart_skill.arm._swing_plane import MARGIN, SwingPlane, swing_plane
from dart_skill.arm._urdf_arm import UrdfArm, load_arm
from dart_skill.common.constants import GRAVITY
from dart_skill.common.world import the_world

SWINGS = (0.3, 0.4, 0.5, 0.7)
"""Times that a swing may take [s]."""
POSTURES = 4_000
"""Number of postures that are tried."""
ROUNDS = 8
"""Number of times that the neighbours of the best are tried."""
NARROWS = 0.5
"""Each of these is so much narrower than the one before."""
INSTANTS = 21
"""Number of instants of a swing at which torques are looked at."""
WAYPOINTS = 9
"""Number of instants of swing and follow-through, each, at which the hand must be clear."""
CLEAR = 0.25
"""Distance that the hand keeps from the axis of the base, below the shoulder, and above it [m]."""
FOLLOW_THROUGH = 0.45
"""Time in which a person brings the arm to rest after the release [s]."""
GUIDED_SPEED = 0.7
"""Share of the speed of each joint at which a person guides an arm: hands that lag behind a swing
and catch up must not pass the limit.
"""
GUIDED_DISTANCE = 0.9
"""A slower swing that throws so far, as a share of the farthest, is easier to guide."""
NOTHING = 1e-9
"""A joint that moves the hand aside by less does not [m/rad]."""


@dataclass(frozen=True)
class ThrowingBound:
    """The farthest throw.

    Parameters
    ----------
    distance
        Of the rim from the axis of the base [m].
    speed, angle
        Of the hand at the release [m/s], above the horizontal [rad].
    release
        Where that is (2,): from the axis of the base, in the direction of the throw, and above the
        floor [m].
    angles, rates
        Of all joints at the release (n,) [rad], [rad/s].
    swing
        Time of the swing from rest [s].
    torque_share
        Largest torque over its limit, with the hand empty.
    tightest
        Index of the joint with that torque.
    plane
        In which the arm swings.
    turn
        Of the first joint, with which it throws along the x axis [rad].
    """

    distance: float
    speed: float
    angle: float
    release: np.ndarray
    angles: np.ndarray
    rates: np.ndarray
    swing: float
    torque_share: float
    tightest: int
    plane: SwingPlane
    turn: float

    @property
    def start(self) -> np.ndarray:
        """Angles at which the swing begins (n,) [rad]."""
        return self.angles - 0.5 * self.swing * self.rates

    @property
    def turned_start(self) -> np.ndarray:
        """The same of an arm that throws along the x axis (n,) [rad]."""
        start = self.start
        return np.concatenate([start[:1] + self.turn, start[1:]])


def fastest(
    jacobian: np.ndarray, limits: np.ndarray, direction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Greatest speed of the hand (k,) in a direction, without moving aside, and the speeds of the
    joints (k, m) that give it.

    Parameters
    ----------
    jacobian
        In the plane (k, 2, m).
    limits
        Of the joints (m,) [rad/s].
    direction
        Unit vector (2,).
    """
    along = np.einsum("i,kim->km", direction, jacobian)
    aside = np.einsum("i,kim->km", [-direction[1], direction[0]], jacobian)
    # joints that do not move the hand aside have no breakpoint: any other one serves
    moves = np.abs(aside) > NOTHING
    slopes = np.divide(along, aside, out=np.zeros_like(along), where=moves)
    values = np.abs(along[:, None] - slopes[:, :, None] * aside[:, None]) @ limits
    best = values.argmin(axis=1)
    rows = np.arange(len(best))
    rates = limits * np.sign(along - slopes[rows, best, None] * aside)
    # the joint of the breakpoint takes what keeps the hand from moving aside
    rates[rows, best] = 0.0
    rest = -(rates * aside).sum(axis=1)
    rates[rows, best] = np.divide(
        rest, aside[rows, best], out=np.zeros_like(rest), where=moves[rows, best]
    )
    return values[rows, best], rates


def throwing_bound(
    arm: UrdfArm,
    rim: float,
    angle: float = 0.25 * np.pi,
    seed: int = 0,
) -> ThrowingBound:
    """The farthest throw of an arm into a rim at a height [m] above the floor, at an angle above the
    horizontal [rad].

    Parameters
    ----------
    seed
        Of the postures that are tried.

    Raises
    ------
    ValueError
        If the arm has no plane, or reaches no rim at that height.
    """
    return max(_throws(arm, rim, angle, seed), key=lambda bound: bound.distance)


def guided_bound(
    arm: UrdfArm, rim: float, side: float, angle: float = 0.25 * np.pi
) -> ThrowingBound:
    """The throw that a person guides an arm through: `GUIDED_SPEED` of what its joints can do, from
    rest to rest, the hand clear of the base, and the slowest swing that gets nearly as far as the
    farthest.

    Parameters
    ----------
    side
        Largest azimuth to either side at which the arm shall throw [rad].
    rim, angle
        As of `throwing_bound`.

    Raises
    ------
    ValueError
        If there is none.
    """
    throws = _throws(arm, rim, angle, 0, GUIDED_SPEED, FOLLOW_THROUGH)
    low, high = arm.lower[0] + side, arm.upper[0] - side
    turned = [one for one in throws if low <= one.plane.rest[0] + one.turn <= high]
    if not turned:
        raise ValueError(
            f"arm {arm.name}: its first joint cannot turn {np.degrees(side):.0f} degrees to either"
            " side of the direction in which it throws"
        )
    farthest = max(one.distance for one in turned)
    far = [one for one in turned if one.distance >= GUIDED_DISTANCE * farthest]
    return max(far, key=lambda bound: (bound.swing, bound.distance))


def _throws(
    arm: UrdfArm,
    rim: float,
    angle: float,
    seed: int,
    share: float = 1.0,
    follow_through: float = 0.0,
) -> list[ThrowingBound]:
    """The farthest throw of each time of a swing, to either side of the plane; ValueError if there
    is none.

    Parameters
    ----------
    share
        Of the speeds of the joints.
    follow_through
        Time in which the joints come to rest after the release, within their ranges [s]; then the
        hand keeps away from the base, too.
    """
    plane, rng = swing_plane(arm), np.random.default_rng(seed)
    found = [
        bound
        for swing in SWINGS
        for side in (1.0, -1.0)
        if (
            bound := _best(
                arm,
                plane,
                rim,
                np.array([side * np.cos(angle), np.sin(angle)]),
                share,
                (swing, follow_through),
                rng,
            )
        )
    ]
    if not found:
        raise ValueError(
            f"arm {arm.name}: no posture throws at {np.degrees(angle):.0f} degrees to a height of"
            f" {rim:.2f} m"
        )
    return found


def widest_swing(name: str) -> ArmSwing:
    """The swing with which a person throws with an arm of config/arms/ to where baskets stand.

    Raises
    ------
    ValueError
        If it throws nowhere.
    """
    arm, world = load_arm(name), the_world()
    bound = guided_bound(arm, world.rim, world.side)
    joints, rest = bound.plane.joints, bound.plane.rest.copy()
    rest[0] += bound.turn
    start, release, rates = (row[joints] for row in (bound.start, bound.angles, bound.rates))
    return ArmSwing(joints, start, release, rates, rest, bound.swing)


def _turn(arm: UrdfArm, angles: np.ndarray, is_before: bool) -> float:
    """By how much the first joint must turn an arm whose hand is released before the axis of the
    base, or behind it, so that it throws along the x axis [rad].
    """
    hand = arm.hand(angles).translation
    # released behind the axis of the base, it throws over it
    back = 0.0 if is_before else np.pi
    return float(np.remainder(back - np.arctan2(hand[1], hand[0]) + np.pi, 2.0 * np.pi) - np.pi)


def _best(
    arm: UrdfArm,
    plane: SwingPlane,
    rim: float,
    direction: np.ndarray,
    share: float,
    times: tuple[float, float],
    rng: np.random.Generator,
) -> ThrowingBound | None:
    """The farthest throw in one direction at a share of the joints' speeds, with given times [s] of
    swing and follow-through.
    """
    swing, follow = times
    lower, upper = arm.lower[plane.joints] + MARGIN, arm.upper[plane.joints] - MARGIN
    limits, best, farthest = share * arm.speeds[plane.joints], None, 0.0
    width, middle = upper - lower, 0.5 * (lower + upper)
    for _ in range(ROUNDS):
        angles = (middle + width * (rng.random((POSTURES, len(lower))) - 0.5)).clip(lower, upper)
        speed, rates = fastest(plane.jacobian(angles), limits, direction)
        hand = plane.places(angles)[:, -1]
        distance = _distances(hand, speed, direction, rim)
        starts, ends = angles - 0.5 * swing * rates, angles + 0.5 * follow * rates
        within = ((np.minimum(starts, ends) >= lower) & (np.maximum(starts, ends) <= upper)).all(
            axis=1
        )
        within &= hand[:, 1] > arm.mount_height
        if follow:
            within[within] = _keeps_clear(arm, plane, starts[within], angles[within], ends[within])
        distance = np.where(within, distance, -np.inf)
        k = int(distance.argmax())
        if distance[k] > farthest:
            best, farthest, middle = (angles[k], rates[k]), float(distance[k]), angles[k]
        width = NARROWS * width
    return None if best is None else _bound(arm, plane, rim, direction, swing, *best)


def _keeps_clear(
    arm: UrdfArm, plane: SwingPlane, start: np.ndarray, release: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """Whether the hand keeps away from the base, and above its height, all along swings (k,) from
    rest to rest, whose angles at the ends and at the release are given (k, m).
    """
    share = np.linspace(0.0, 1.0, WAYPOINTS)[:, None, None]
    way = np.concatenate(
        [start + share**2 * (release - start), end - (1.0 - share) ** 2 * (end - release)]
    )
    hand = plane.places(way.reshape(-1, way.shape[-1]))[:, -1].reshape(len(way), -1, 2)
    top = plane.first[1] + CLEAR
    beside = (np.abs(hand[..., 0]) > CLEAR) | (hand[..., 1] > top)
    return (beside & (hand[..., 1] > arm.mount_height)).all(axis=0)


def _bound(
    arm: UrdfArm,
    plane: SwingPlane,
    rim: float,
    direction: np.ndarray,
    swing: float,
    angles: np.ndarray,
    rates: np.ndarray,
) -> ThrowingBound:
    """The throw of a posture, as slow as the torques of the joints ask."""
    share, joint = _torque_share(arm, plane, angles, rates, swing)
    slow = 1.0
    while share > 1.0 and slow > 0.1:
        slow -= 0.01
        share, joint = _torque_share(arm, plane, angles, slow * rates, swing)
    hand = plane.places(angles[None])[0, -1]
    speed = float(direction @ plane.jacobian(angles[None])[0] @ (slow * rates))
    whole = np.zeros(len(plane.rest))
    whole[plane.joints] = slow * rates
    forward = np.sign(direction[0])
    before, released = forward * hand[0], plane.whole(angles[None])[0]
    return ThrowingBound(
        float(_distances(hand[None], np.array([speed]), direction, rim)[0]),
        speed,
        float(np.arctan2(direction[1], abs(direction[0]))),
        np.array([before, hand[1]]),
        released,
        whole,
        swing,
        share,
        joint,
        plane,
        _turn(arm, released, before > 0.0),
    )


def _torque_share(
    arm: UrdfArm, plane: SwingPlane, angles: np.ndarray, rates: np.ndarray, swing: float
) -> tuple[float, int]:
    """Largest torque of a swing from rest over its limit, and its joint."""
    share = np.linspace(0.0, 1.0, INSTANTS)[:, None]
    q = plane.whole(angles - 0.5 * swing * rates * (1.0 - share**2))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    qd[:, plane.joints], qdd[:, plane.joints] = share * rates, rates / swing
    shares = (np.abs(arm.torque(q, qd, qdd)) / arm.torques).max(axis=0)
    return float(shares.max()), int(shares.argmax())


def _distances(
    hand: np.ndarray, speed: np.ndarray, direction: np.ndarray, rim: float
) -> np.ndarray:
    """Where balls come down to the height of a rim (k,) [m] from the axis of the base, in the
    direction of the throw; -inf for those that never rise to it.
    """
    rise = speed * direction[1]
    left = rise**2 + 2.0 * GRAVITY * (hand[:, 1] - rim)
    time = (rise + np.sqrt(np.maximum(left, 0.0))) / GRAVITY
    way = np.sign(direction[0]) * hand[:, 0] + np.abs(direction[0]) * speed * time
    return np.where(left >= 0.0, way, -np.inf)
