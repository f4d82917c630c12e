"""From what the sensors saw of one guided throw to the numbers that learning needs: release,
landing, attractors in features.

Features are t, x, y, z, alpha, beta (8.4.1), with t = 0 at the instant that all demonstrations
share, and, where the configuration says so, the distance of the target after t. Attractors come
from (7.20).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from dart_skill.arm import (
    ArmModel,
    Registration,
    Sightings,
    fit_registration,
    measure_registration,
    the_arm,
)
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.quantiles import quantile
from dart_skill.common.quaternions import from_vectors, product, rotate
from dart_skill.common.surface import Game
from dart_skill.common.world import the_world
from dart_skill.movement import (
    angles_from_quaternions,
    attractor_from_motion,
    smooth_derivatives,
    turn_about_z,
    turn_matrix,
)
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._ball_path import ball_states
from dart_skill.skills.observation import (
    FreeFlight,
    Release,
    Slowing,
    column_noise,
    find_flight,
    fit_release,
    judge_flight,
    position_noise,
    sightings,
)
from dart_skill.skills.protocol import ThrowSettings

RATE = 100.0
"""Rate at which demonstrations are resampled [Hz]: that of the motion capture."""
SOONEST = -0.005
"""Earliest release relative to the command, as far as a release is seen [s]."""
LATEST = 0.3
"""Latest release relative to the command [s]. The fingers of a BarrettHand need 1 s for their 140
degrees (docs/sources.md), so that they are well away from a ball by then. What is seen beyond is
something else: clocks that disagree, or a button that was pressed for another reason.
"""
AGREED = Registration()
"""Registration of cameras and arm that agree."""
OUTSIDE = 1.0
"""A motion begins and ends within what was recorded of the hand, or not longer before or after
[s].
"""
OFF_POSITION = 0.015
"""Largest distance between the motion that the cameras saw and that of the arm's joints, wherever
the cameras stand: ten times as much as of the worst arm of the fleet, root mean square [m].
"""
OFF_ANGLE = 0.08
"""Largest angle between the orientations of both, root mean square [rad]."""


@dataclass(frozen=True)
class PreparedThrow:
    """A demonstration ready to be learned.

    The features are x, y, z [m] in the world and alpha, beta [rad] in the axes of the
    configuration (8.4.1).

    Parameters
    ----------
    id
        Str, of the demonstration.
    task
        Task parameter (3,) [m]: where the ball came down on the plane of the rim (a dart: where it
        met the board), or where the basket stood.
    azimuth
        Float [rad], of the task.
    reach
        Float [m], distance of the task from the base axis, or its height on the board.
    time
        (n,) [s], 0 at the instant that all demonstrations share.
    motion
        (n, 5), the features.
    velocity
        (n, 5), the features per s.
    attractor
        (n, 5), computed from the motion by (7.20).
    start_pose
        (6,) [m, rad], x, y, z, alpha, beta, roll of the hand at rest, all in axes turned by the
        azimuth.
    start, stop
        Float [s], start and stop of the motion, on the clock of `time`.
    release
        Release, where hand and ball part, on the clock of the demonstration.
    release_time
        Float [s], the release on the clock of `time`.
    start_posture
        (7,) [rad], joints before the motion, J1 relative to the azimuth.
    sightings
        The hand at some instants as cameras and arm say.
    hand_delay
        Float [s], time from the command to the release; nan if the command was not seen, or no
        hand needs so long.
    noise
        Float [m], standard deviation of a coordinate of the hand, as it was recorded.
    seen
        Where the ball came down (3,) [m], also if the task is where the motion led; else the task.
    slowing
        Slowing, what the flight tells of the ball's mass.
    """

    id: str
    task: np.ndarray
    azimuth: float
    reach: float
    time: np.ndarray
    motion: np.ndarray
    velocity: np.ndarray
    attractor: np.ndarray
    start_pose: np.ndarray
    start: float
    stop: float
    release: Release
    release_time: float
    start_posture: np.ndarray
    sightings: Sightings
    hand_delay: float
    noise: float
    seen: np.ndarray
    slowing: Slowing

    @property
    def distance(self) -> float:
        """Horizontal distance of the task from the base axis [m]."""
        return float(np.hypot(self.task[0], self.task[1]))

    @property
    def in_words(self) -> str:
        """What was found, in a line: where the throw went, and how the ball left the hand."""
        speed = float(np.linalg.norm(self.release.velocity))
        place = f"{self.distance:.2f} m, {np.degrees(self.azimuth):+.0f} degrees"
        late = (
            f", {1e3 * self.hand_delay:.0f} ms after the hand was told to open"
            if np.isfinite(self.hand_delay)
            else ""
        )
        return f"a throw to {place}; the ball left the hand at {speed:.1f} m/s{late}"

    def between(self, first: float, last: float) -> PreparedThrow:
        """The same throw with only the samples from `first` to `last` [s]."""
        kept = slice(
            int(np.searchsorted(self.time, first)),
            int(np.searchsorted(self.time, last, side="right")),
        )
        return replace(
            self,
            time=self.time[kept],
            motion=self.motion[kept],
            velocity=self.velocity[kept],
            attractor=self.attractor[kept],
        )


@dataclass(frozen=True)
class _Reading:
    """All of a configuration that a prepared demonstration depends on: configurations that are
    alike in it share what was prepared.

    stiffness: kp of x, y, z, alpha, beta [1/s^2].
    """

    game: Game
    alignment: str
    relabel: bool
    by_motion: bool
    turns: bool
    stiffness: tuple[float, ...]

    @classmethod
    def of(cls, configuration: ThrowSettings) -> _Reading:
        c = configuration
        return cls(
            c.game,
            c.alignment,
            c.relabel,
            c.by_motion,
            c.frames_turn,
            tuple(np.broadcast_to(c.stiffness_of_features, 5).tolist()),
        )


_KEPT: WeakKeyDictionary[Demonstration, dict[_Reading, PreparedThrow]] = WeakKeyDictionary()
"""What was prepared of demonstrations that are still in use. A demonstration never changes."""


def prepare(demonstration: Demonstration, configuration: ThrowSettings) -> PreparedThrow:
    """One demonstration as numbers to learn from.

    It is worked out once for each demonstration, and kept as long as this is in use: after one
    more, a lesson prepares that one alone. Its arrays are read-only.

    Raises
    ------
    ValueError
        Names the demonstration and what is wrong with it.
    """
    kept, reading = _KEPT.setdefault(demonstration, {}), _Reading.of(configuration)
    if reading not in kept:
        try:
            kept[reading] = _sealed(_prepare(demonstration, reading))
        except ValueError as error:
            raise ValueError(f"demonstration {demonstration.id}: {error}") from error
    return kept[reading]


def _sealed(throw: PreparedThrow) -> PreparedThrow:
    """The same, with read-only arrays, as many lessons share them."""
    for part in (throw, throw.release, throw.release.flight, throw.sightings, throw.slowing):
        for value in vars(part).values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
    return throw


def _prepare(demonstration: Demonstration, reading: _Reading) -> PreparedThrow:
    d = demonstration
    if not (
        d.hand_time[0] - OUTSIDE <= d.motion_start <= d.motion_stop <= d.hand_time[-1] + OUTSIDE
    ):
        recorded = f"from {d.hand_time[0]:.4g} to {d.hand_time[-1]:.4g} s"
        raise ValueError(
            f"its motion is from {d.motion_start:.4g} to {d.motion_stop:.4g} s, but the hand was"
            f" recorded {recorded}"
        )
    both = sightings(d, _kinematics())
    _check_joints(both)
    ball, surface = reading.game.projectile, reading.game.surface
    free = find_flight(d.moved.time, d.moved.position, ball) if len(d.moved.time) else None
    grip = the_arm().hand.ball_centre
    release = fit_release(
        d.moved.time,
        d.moved.position,
        d.hand_time,
        d.hand_position,
        d.hand_quaternion,
        grip,
        ball,
        free=free,
    )
    task = _task(d, reading, free)
    shared = release.time if reading.alignment == "release" else d.motion_start
    clock = d.hand_time - shared
    grid = np.arange(np.ceil(clock[0] * RATE), np.floor(clock[-1] * RATE) + 1) / RATE
    seen = task
    if reading.by_motion:
        task = _led_to(seen, d, reading, clock, release.time - shared)
    azimuth = float(np.arctan2(task[1], task[0]))
    turned, features = _features(d, reading, azimuth)
    noise = _noise(clock, features)
    motion = smooth_derivatives(clock, features, noise=noise, at=grid)
    return PreparedThrow(
        id=d.id,
        task=task,
        azimuth=azimuth,
        reach=float(surface.coordinates(task)[0]),
        time=grid,
        motion=motion.position,
        velocity=motion.velocity,
        attractor=attractor_from_motion(*motion, reading.stiffness),
        start_pose=_start_pose(d, azimuth, turned),
        start=float(d.motion_start - shared),
        stop=float(d.motion_stop - shared),
        release=release,
        release_time=float(release.time - shared),
        start_posture=_start_posture(d, azimuth),
        sightings=both,
        hand_delay=_hand_delay(release.time - d.opened),
        noise=float(noise[0]),
        seen=seen,
        slowing=(
            Slowing.none()
            if free is None
            else Slowing.of(d.moved.time, d.moved.position, free, ball)
        ),
    )


def _features(
    d: Demonstration, reading: _Reading, azimuth: float
) -> tuple[np.ndarray, np.ndarray]:
    """Angles of the hand (n, 3) in axes turned by an azimuth, and its features (n, 5)."""
    turned = angles_from_quaternions(turn_about_z(d.hand_quaternion, -azimuth))
    angles = turned if reading.turns else angles_from_quaternions(d.hand_quaternion)
    return turned, np.column_stack([d.hand_position, angles[:, :2]])


def _led_to(
    task: np.ndarray, d: Demonstration, reading: _Reading, clock: np.ndarray, release: float
) -> np.ndarray:
    """Where the motion of the hand leads (3,), whatever the fingers do to the ball: the task (3,)
    where that is nowhere.

    A hand that scatters by as much as the targets are apart gives the same motion other tasks, and
    a model of that does not aim.
    """
    azimuth = float(np.arctan2(task[1], task[0]))
    turned, features = _features(d, reading, azimuth)
    around = np.array([release])
    motion = smooth_derivatives(clock, features, noise=_noise(clock, features), at=around)
    roll, centre = _start_pose(d, azimuth, turned)[5], the_arm().hand.ball_centre
    states = ball_states(
        motion.position, motion.velocity, azimuth if reading.turns else 0.0, roll, centre
    )
    game = reading.game
    place = game.surface.crossing(*states, task, game.projectile).position[0]
    return place if np.isfinite(place).all() else task


def _check_joints(both: Sightings) -> None:
    """ValueError for joints that move the hand otherwise than the cameras saw it: in another order
    or unit, or of another arm.
    """
    # One after the other: the second is long to find, and seldom needed.
    if len(both) < 3 or _explains(AGREED, both) or _explains(fit_registration([both]), both):
        return
    off = measure_registration(both)
    if off.position_error > OFF_POSITION or off.angle_error > OFF_ANGLE:
        far = f"{100 * off.position_error:.0f} cm and {np.degrees(off.angle_error):.0f} degrees"
        raise ValueError(
            f"by its joints the hand moved otherwise than the cameras saw it, by {far}"
        )


def _explains(registration: Registration, both: Sightings) -> bool:
    """Whether so little is left with a registration that with the best one, which is long to find,
    less than the limits must be left.

    The best one has the least sum of squares in parts of 1 mm and 2 mrad: a quarter of OFF_ANGLE
    is 10 parts, half of OFF_POSITION 7.5, together 12.5, which are 12.5 mm and 25 mrad at most.
    """
    position, quaternion = _as_seen(registration, both)
    off = np.square(both.position - position).sum(axis=1)
    cosine = np.abs(np.einsum("ni,ni->n", both.quaternion, quaternion))
    twist = np.square(2.0 * np.arccos(np.minimum(cosine, 1.0)))
    return bool(
        np.mean(off) < (0.5 * OFF_POSITION) ** 2 and np.mean(twist) < (0.25 * OFF_ANGLE) ** 2
    )


def _as_seen(registration: Registration, both: Sightings) -> tuple[np.ndarray, np.ndarray]:
    """Where the cameras would see the hand by the arm's joints, (n, 3) and (n, 4), with a
    registration.
    """
    if registration.is_none and not registration.delay:
        return both.arm_position, both.arm_quaternion
    base, hand, shift, hand_shift = map(
        np.array,
        (registration.turn, registration.hand_turn, registration.shift, registration.hand_shift),
    )
    arm = product(
        from_vectors(-registration.delay * both.arm_velocity[:, 3:]), both.arm_quaternion
    )
    lever = (
        both.arm_position - registration.delay * both.arm_velocity[:, :3] + rotate(arm, hand_shift)
    )
    return rotate(base, lever) + shift, product(product(base, arm), hand)


@lru_cache(maxsize=1)
def _kinematics() -> ArmModel:
    return ArmModel()


def _hand_delay(seen: float) -> float:
    """Time from the command to the release [s] as it was seen, nan if no hand can need so long."""
    return float(seen) if SOONEST <= seen <= LATEST else np.nan


def _noise(time: np.ndarray, features: np.ndarray) -> np.ndarray:
    """Standard deviation of each feature (5,) of a recording (n, 5) at times (n,): the three of
    the position alike.
    """
    return np.concatenate(
        [np.full(3, position_noise(time, features[:, :3])), column_noise(time, features[:, 3:])]
    )


def _start_pose(demonstration: Demonstration, azimuth: float, angles: np.ndarray) -> np.ndarray:
    """Hand pose at rest before the motion (6,), in axes turned by the azimuth, as the angles (n,
    3) are: x, y, z, alpha, beta, roll.
    """
    d = demonstration
    at_rest = _or_first(d.hand_time <= d.motion_start - 0.05)
    position = d.hand_position[at_rest] @ turn_matrix(azimuth)
    return quantile(np.hstack([position, angles[at_rest]]), 0.5)


def _start_posture(demonstration: Demonstration, azimuth: float) -> np.ndarray:
    """Joints before the motion (7,), J1 relative to the azimuth; nan where they were not recorded."""
    d = demonstration
    if not len(d.joint_time):
        return np.full(joint_count(), np.nan)
    posture = quantile(d.joint_position[_or_first(d.joint_time <= d.motion_start)], 0.5)
    posture[0] -= azimuth
    return posture


def _or_first(kept: np.ndarray) -> np.ndarray:
    """Mask (n,) of the samples that are kept; only the first one if no other is."""
    if kept.any():
        return kept
    return np.arange(len(kept)) == 0


def _task(demonstration: Demonstration, reading: _Reading, free: FreeFlight | None) -> np.ndarray:
    """Where the ball came down (3,), or where the basket stood."""
    if not reading.relabel:
        return demonstration.target
    d, game, radius = demonstration, reading.game, the_world().basket_radius
    outcome = judge_flight(
        d.moved.time,
        d.moved.position,
        d.target,
        radius,
        game.projectile,
        free=free,
        surface=game.surface,
    )
    if not outcome.landing_seen:
        raise ValueError(
            "the cameras did not see where the ball landed; learn without relabelling, or track the ball to"
            " the rim"
        )
    return outcome.landing
