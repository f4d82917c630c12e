"""From what the sensors saw of one guided throw to the numbers that learning needs: release, landing, attractors in features.

Features are t, x, y, z, alpha, beta (8.4.1), with t = 0 at the instant that all demonstrations share, and, where the configuration
says so, the distance of the target after t. Attractors come from (7.20).
"""

from dataclasses import dataclass

import numpy as np

from dart_skill.movement import attractor_from_motion, smooth_derivatives
from dart_skill.movement.frames import turn_matrix
from dart_skill.movement.orientation import angles_from_quaternions, turn_about_z
from dart_skill.recording import Demonstration
from dart_skill.robot.description import wam_description
from dart_skill.skill.learn.configuration import SkillConfiguration
from dart_skill.skill.observe.outcome import FreeFlight, Release, find_flight, fit_release, judge_flight
from dart_skill.world import the_world

RATE = 100.0
"""Rate at which demonstrations are resampled [Hz]: that of the motion capture."""


@dataclass(frozen=True)
class PreparedThrow:
    """A demonstration ready to be learned.

    task (3,) is its task parameter: where the ball came down on the plane of the rim (a dart: where it met the board), or where the basket
    stood; its azimuth [rad] and reach [m], the distance from the base axis or the height on the board; time (n,) [s], 0 at the shared
    instant; motion (n, 5) x, y, z in the world and alpha, beta in the axes of the configuration; velocity and attractor (n, 5) likewise;
    start_pose (6,): x, y, z, alpha, beta, roll of the hand at rest, all in axes turned by the azimuth; release [s] on the same clock;
    start_posture (7,) with J1 relative to the azimuth; hand_delay [s] from the command to the ball being free, nan if the command was not
    seen.
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
    hand_delay: float

    @property
    def distance(self) -> float:
        """Horizontal distance of the task from the base axis [m]."""
        return float(np.hypot(self.task[0], self.task[1]))


def prepare(demonstration: Demonstration, configuration: SkillConfiguration) -> PreparedThrow:
    """One demonstration as numbers to learn from; ValueError names the demonstration and what is wrong with it."""
    try:
        return _prepare(demonstration, configuration)
    except ValueError as error:
        raise ValueError(f"demonstration {demonstration.id}: {error}") from error


def _prepare(demonstration: Demonstration, configuration: SkillConfiguration) -> PreparedThrow:
    d = demonstration
    ball, surface = configuration.game.projectile, configuration.game.surface
    free = find_flight(d.ball_time, d.ball_position, ball) if len(d.ball_time) else None
    grip = wam_description().hand.ball_centre
    release = fit_release(d.ball_time, d.ball_position, d.hand_time, d.hand_position, d.hand_quaternion, grip, ball, free=free)
    task = _task(d, configuration, free)
    azimuth = float(np.arctan2(task[1], task[0]))
    shared = release.time if configuration.alignment == "release" else d.motion_start
    turned = angles_from_quaternions(turn_about_z(d.hand_quaternion, -azimuth))
    angles = turned if configuration.turns else angles_from_quaternions(d.hand_quaternion)
    clock = d.hand_time - shared
    grid = np.arange(np.ceil(clock[0] * RATE), np.floor(clock[-1] * RATE) + 1) / RATE
    columns = np.column_stack([d.hand_position, angles[:, :2]])
    motion = smooth_derivatives(clock, columns, noise=np.array([1, 1, 1, 10, 10]) * configuration.noise, at=grid)
    before = d.joint_time <= d.motion_start
    posture = np.median(d.joint_position[before if before.any() else slice(0, 1)], axis=0)
    posture[0] -= azimuth
    return PreparedThrow(
        id=d.id,
        task=task,
        azimuth=azimuth,
        reach=float(surface.coordinates(task)[0]),
        time=grid,
        motion=motion.position,
        velocity=motion.velocity,
        attractor=attractor_from_motion(*motion, configuration.stiffness),
        start_pose=_start_pose(d, azimuth, turned),
        start=float(d.motion_start - shared),
        stop=float(d.motion_stop - shared),
        release=release,
        release_time=float(release.time - shared),
        start_posture=posture,
        hand_delay=float(release.time - d.hand_opened),
    )


def _start_pose(demonstration: Demonstration, azimuth: float, angles: np.ndarray) -> np.ndarray:
    """Hand pose at rest before the motion (6,), in axes turned by the azimuth, as the angles (n, 3) are: x, y, z, alpha, beta, roll."""
    d = demonstration
    at_rest = d.hand_time <= d.motion_start - 0.05
    kept = at_rest if at_rest.any() else slice(0, 1)
    position = d.hand_position[kept] @ turn_matrix(azimuth)
    return np.median(np.hstack([position, angles[kept]]), axis=0)


def _task(demonstration: Demonstration, configuration: SkillConfiguration, free: FreeFlight | None) -> np.ndarray:
    if not configuration.relabel:
        return demonstration.target
    d, game, radius = demonstration, configuration.game, the_world().basket_radius
    outcome = judge_flight(d.ball_time, d.ball_position, d.target, radius, game.projectile, free=free, surface=game.surface)
    if not outcome.landing_seen:
        raise ValueError("nobody saw where the ball landed; learn without relabelling, or track the ball to the rim")
    return outcome.landing
