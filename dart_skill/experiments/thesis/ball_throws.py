"""Throws of a ball into a basket for figures 8.6 to 8.11: 13 lessons in process, and what models
make of them.

All figures of one seed share their lessons: the teacher throws once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dart_skill.arm import ThrowPlan, wam_description
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

N_DEMONSTRATIONS, N_NEW = 13, 10
POSE_STEPS = 5
"""Steps of the simulator between two poses of a recording: 100 Hz, as the cameras see."""


@dataclass(frozen=True, eq=False)
class TaughtThrows:
    """Demonstrations that went in, and the whole recording that each was cut from: the hand as the
    arm's own encoders have it.
    """

    demonstrations: tuple[Demonstration, ...]
    recordings: tuple[HandRecording, ...]


@lru_cache(maxsize=4)
def lessons(seed: int) -> TaughtThrows:
    """One lesson at each of 13 baskets within 45 degrees and 1.5 to 2.5 m; those that went in."""
    session = Session(seed, keep_states=True)
    try:
        trials = [
            session.teach(target)[-1] for target in targets_for(seed, N_DEMONSTRATIONS, 0)[0]
        ]
    finally:
        session.close()
    kept = [trial for trial in trials if trial.outcome.in_basket]
    return TaughtThrows(
        tuple(trial.demonstration for trial in kept), tuple(_recording(trial) for trial in kept)
    )


def _recording(trial: Trial) -> HandRecording:
    d, states = trial.demonstration, trial.states[::POSE_STEPS]
    none = np.empty(0, dtype=np.int64)
    stamps = np.array([state.stamp_ns for state in states])
    hand = np.array([state.hand_position for state in states])
    return HandRecording(
        stamps,
        hand,
        none,
        np.empty((0, 3)),
        d.target,
        none,
        d.stamp_ns + round(d.opened * 1e9),
    )


@lru_cache(maxsize=8)
def skill(seed: int, name: str) -> ThrowingSkill:
    """What a configuration learns from the lessons."""
    return learn_prepared(list(prepared(seed, name)), configuration(name))


@lru_cache(maxsize=8)
def prepared(seed: int, name: str) -> tuple[PreparedThrow, ...]:
    """The lessons as a configuration sees them."""
    return tuple(prepare(one, configuration(name)) for one in lessons(seed).demonstrations)


def new_baskets(seed: int) -> np.ndarray:
    """Baskets (10, 3) [m] that were not demonstrated; figures draw the first."""
    return targets_for(seed, N_DEMONSTRATIONS, N_NEW)[1]


def predicted_misses(seed: int, name: str) -> np.ndarray:
    """Distance (n,) [m] from each new basket to where the plan itself expects the ball; nan
    without a plan.
    """
    learned = skill(seed, name)
    return np.array([_predicted_miss(learned, basket) for basket in new_baskets(seed)])


def _predicted_miss(learned: ThrowingSkill, basket: np.ndarray) -> float:
    try:
        return float(np.linalg.norm((learned.plan(basket).predicted_landing - basket)[:2]))
    except ValueError:
        return float("nan")


@dataclass(frozen=True, eq=False)
class DrawnThrow:
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
        return float(
            np.sqrt(np.mean(np.sum(np.gradient(acceleration, grid, axis=0) ** 2, axis=1)))
        )


def demonstrated(one: Demonstration, throw: PreparedThrow) -> DrawnThrow:
    """A lesson as the cameras saw it, up to the plane of the rim."""
    moving = (one.hand_time >= one.motion_start) & (one.hand_time <= one.motion_stop)
    release = one.motion_start + throw.release_time - throw.start
    flying = (one.moved.time >= release) & (one.moved.position[:, 2] >= one.target[2])
    ball = one.moved.position[flying]
    return DrawnThrow(
        one.hand_time[moving],
        one.hand_position[moving],
        one.hand_quaternion[moving],
        release,
        ball,
        one.target,
    )


def planned(plan: ThrowPlan) -> DrawnThrow:
    """A plan, and the flight that it expects."""
    path = plan.path
    arm = rotate(path.quaternion, wam_description().hand.ball_centre[None])
    columns = np.hstack(
        [path.position + arm, path.velocity[:, :3] + np.cross(path.velocity[:, 3:], arm)]
    )
    position, velocity = np.split(
        np.array([np.interp(plan.release, path.time, column) for column in columns.T]), 2
    )
    times = np.linspace(0.0, float(landing(position, velocity, plan.target[2]).time), 61)
    return DrawnThrow(
        path.time,
        path.position,
        path.quaternion,
        plan.release,
        flight(position, velocity, times)[0],
        plan.target,
    )


def all_demonstrated(seed: int, name: str) -> list[DrawnThrow]:
    """All lessons."""
    return [
        demonstrated(*pair)
        for pair in zip(lessons(seed).demonstrations, prepared(seed, name), strict=True)
    ]


@dataclass(frozen=True, eq=False)
class Angles:
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
    if frame not in FRAMES:
        raise ValueError(f"there is no frame '{frame}': choose one of {', '.join(FRAMES)}")
    throws = prepared(seed, "default" if frame == "turned" else "thesis")
    throws = throws if only is None else tuple(throws[k] for k in only)
    time = np.linspace(0.0, min(one.stop - one.start for one in throws), 91)
    values = [
        [np.interp(time, one.time - one.start, column) for column in _angles(one, frame).T]
        for one in throws
    ]
    releases = [one.release_time - one.start for one in throws]
    return Angles(
        time,
        np.transpose(values, (0, 2, 1)),
        np.array(releases),
        np.array([one.azimuth for one in throws]),
    )


def _angles(throw: PreparedThrow, frame: str) -> np.ndarray:
    if frame != "frame_2":
        return throw.motion[:, 3:5]
    second = frames_for(throw.task, throw.motion[0, :3], configuration("thesis"))[1]
    return second.to_frame(np.column_stack([throw.time, throw.motion]))[:, 4:6]
