"""Throws of a ball into a basket for figures 8.6 to 8.11: 13 lessons in process, and what models
make of them.

All figures of one seed share their lessons: the teacher throws once.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dart_skill.arm import MotionPlan, the_arm
from dart_skill.common.flight import flight, landing
from dart_skill.common.regions import targets_for
from dart_skill.figures import HandRecording
from dart_skill.movement import rotate, smooth_derivatives
from dart_skill.recording import Demonstration
from dart_skill.session import Session, Trial
from dart_skill.skills.learning import (
    PreparedThrow,
    ThrowingSkill,
    configuration,
    frames_for,
    learn_prepared,
    prepare,
)

N_DEMONSTRATIONS = 13
"""Number of lessons."""
N_NEW = 10
"""Number of baskets that were not demonstrated."""


@lru_cache(maxsize=4)
def lessons(seed: int) -> tuple[Trial, ...]:
    """One lesson at each of 13 baskets within 45 degrees and 1.5 to 2.5 m; those that went in."""
    session = Session(seed, keep_states=True)
    try:
        targets = targets_for(seed, N_DEMONSTRATIONS, 0)[0]
        trials = [session.teach(target)[-1] for target in targets]
    finally:
        session.close()
    return tuple(trial for trial in trials if trial.outcome.in_basket)


def recording_of(lesson: Trial) -> HandRecording:
    """The whole recording that a demonstration was cut from: the hand at 100 Hz, as the cameras
    see, where the arm's own encoders have it.
    """
    d, states = lesson.demonstration, lesson.states[::5]
    none = np.empty(0, dtype=np.int64)
    stamps = np.array([state.stamp_ns for state in states])
    hand = np.array([state.hand_position for state in states])
    opened_ns = d.stamp_ns + round(d.opened * 1e9)
    return HandRecording(stamps, hand, none, np.empty((0, 3)), d.target, none, opened_ns)


@lru_cache(maxsize=8)
def skill(seed: int, name: str) -> ThrowingSkill:
    """What a configuration learns from the lessons."""
    return learn_prepared(list(prepared(seed, name)), configuration(name))


@lru_cache(maxsize=8)
def prepared(seed: int, name: str) -> tuple[PreparedThrow, ...]:
    """The lessons as a configuration sees them."""
    return tuple(prepare(one.demonstration, configuration(name)) for one in lessons(seed))


def new_baskets(seed: int) -> np.ndarray:
    """Baskets (10, 3) [m] that were not demonstrated; figures draw the first."""
    return targets_for(seed, N_DEMONSTRATIONS, N_NEW)[1]


def miss_of(plan: MotionPlan) -> float:
    """Distance from the basket to where the plan itself expects the ball [cm]."""
    return 100 * float(np.linalg.norm((plan.thrown.landing - plan.thrown.target)[:2]))


def median_misses(seed: int, names: tuple[str, ...]) -> dict[str, float]:
    """The median of `miss_of` over the new baskets for which there is a plan, of models by name."""
    medians = {}
    for name in names:
        misses = []
        for basket in new_baskets(seed):
            try:
                misses.append(miss_of(skill(seed, name).plan(basket)))
            except ValueError:
                continue
        medians[name] = round(float(np.median(misses)), 1) if misses else float("nan")
    return medians


class DrawnThrow(NamedTuple):
    """A throw to draw: time (n,) [s], hand position (n, 3), quaternion (n, 4), the instant of the
    release, flight (m, 3), target (3,).
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    release: float
    flight: np.ndarray
    target: np.ndarray

    @property
    def speed(self) -> float:
        """Speed of the hand at the release [m/s]."""
        speed = np.linalg.norm(np.gradient(self.position, self.time, axis=0), axis=1)
        return float(np.interp(self.release, self.time, speed))

    @property
    def jerk(self) -> float:
        """Root mean square of the third derivative of the path [m/s^3], sampled and smoothed alike
        whatever it comes from.
        """
        grid = np.arange(self.time[0], self.time[-1], 0.01)
        path = np.column_stack([np.interp(grid, self.time, column) for column in self.position.T])
        acceleration = smooth_derivatives(grid, path, noise=1e-4).acceleration
        squares = np.sum(np.gradient(acceleration, grid, axis=0) ** 2, axis=1)
        return float(np.sqrt(np.mean(squares)))


def planned(plan: MotionPlan) -> DrawnThrow:
    """A plan, and the flight that it expects."""
    path = plan.path
    arm = rotate(path.quaternion, the_arm().hand.ball_centre[None])
    turning = np.cross(path.velocity[:, 3:], arm)
    columns = np.hstack([path.position + arm, path.velocity[:, :3] + turning])
    at_release = np.array([np.interp(plan.release, path.time, column) for column in columns.T])
    position, velocity = np.split(at_release, 2)
    times = np.linspace(0.0, float(landing(position, velocity, plan.thrown.target[2]).time), 61)
    ball = flight(position, velocity, times)[0]
    return DrawnThrow(
        path.time, path.position, path.quaternion, plan.release, ball, plan.thrown.target
    )


def all_demonstrated(seed: int, name: str) -> list[DrawnThrow]:
    """All lessons as the cameras saw them, up to the plane of the rim."""
    pairs = zip(lessons(seed), prepared(seed, name), strict=True)
    return [_demonstrated(lesson.demonstration, throw) for lesson, throw in pairs]


def _demonstrated(one: Demonstration, throw: PreparedThrow) -> DrawnThrow:
    moving = (one.hand_time >= one.motion_start) & (one.hand_time <= one.motion_stop)
    release = one.motion_start + throw.release_time - throw.start
    flying = (one.moved.time >= release) & (one.moved.position[:, 2] >= one.target[2])
    hand = one.hand_position[moving], one.hand_quaternion[moving]
    ball = one.moved.position[flying]
    return DrawnThrow(one.hand_time[moving], *hand, release, ball, one.target)


class Angles(NamedTuple):
    """alpha and beta (n_throws, n_steps, 2) [rad] of several throws on one clock, time (n_steps,)
    [s] since the start of the motion.

    Parameters
    ----------
    releases : (n_throws,)
        When each let go on that clock.
    azimuths : (n_throws,)
        Of their targets [rad].
    """

    time: np.ndarray
    values: np.ndarray
    releases: np.ndarray
    azimuths: np.ndarray

    @property
    def spread(self) -> np.ndarray:
        """(2,) Standard deviation of alpha and beta from throw to throw, root mean square over
        time [rad].
        """
        return np.sqrt(self.values.var(axis=0).mean(axis=0))

    @property
    def spread_at_release(self) -> np.ndarray:
        """(2,) Standard deviation of alpha and beta when the ball leaves the hand [rad]."""
        at = [
            [np.interp(release, self.time, column) for column in one.T]
            for release, one in zip(self.releases, self.values, strict=True)
        ]
        return np.std(at, axis=0)


FRAMES = {
    "frame_1": "frame 1, world axes",
    "frame_2": "frame 2, at the target",
    "turned": "turned to the target",
}
"""The thesis's two frames (8.3) and (8.2), and the axes of `default`."""


def angles_in(seed: int, frame: str, only: np.ndarray | None = None) -> Angles:
    """alpha and beta of the demonstrations, or of only those (n,), in one of FRAMES."""
    throws = prepared(seed, "default" if frame == "turned" else "thesis")
    throws = throws if only is None else tuple(throws[k] for k in only)
    time = np.linspace(0.0, min(one.stop - one.start for one in throws), 91)
    values = []
    for one in throws:
        angles = one.motion[:, 3:5]
        if frame == "frame_2":
            second = frames_for(one.task, one.motion[0, :3], configuration("thesis"))[1]
            angles = second.to_frame(np.column_stack([one.time, one.motion]))[:, 4:6]
        values.append([np.interp(time, one.time - one.start, column) for column in angles.T])
    releases = np.array([one.release_time - one.start for one in throws])
    azimuths = np.array([one.azimuth for one in throws])
    return Angles(time, np.transpose(values, (0, 2, 1)), releases, azimuths)
