"""The throwing skill: DS-GMR over demonstrations, and plans for baskets that nobody demonstrated.

Learning encodes attractor trajectories in task frames (7.21). Planning retrieves an attractor by GMR (3.4, 3.5), follows it with the
spring-damper (7.19), and knows where its own release would send the ball: the task parameter is moved until that point lies on the
target. The delay of the hand is learned with the motion, and so is the release, unless the skill lets go where the ball flies farthest:
there it matters least that a hand opens early or late.
"""

import hashlib
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from dart_skill.checks import to_the_nanosecond
from dart_skill.mixture import GaussianMixture, regress
from dart_skill.movement import TaskParameterisedMixture, follow_attractor
from dart_skill.movement.attractor import critical_damping
from dart_skill.movement.autonomous import AutonomousPolicy, PhaseRule
from dart_skill.movement.frames import azimuth_of, turn_matrix
from dart_skill.movement.locality import choose_width, gaussian_weights, nearest_weights
from dart_skill.movement.orientation import angles_from_quaternions, quaternions_from_angles, turn_about_z
from dart_skill.recording import Demonstration
from dart_skill.robot.throw_plan import Gains, HandPath, ThrowPlan
from dart_skill.skill.learn.configuration import DEFAULT, SkillConfiguration
from dart_skill.skill.learn.preparation import PreparedThrow, prepare
from dart_skill.skill.learn.release import farthest, hits_along, nearest_step, stretched_at, weights_at
from dart_skill.skill.learn.task_frames import frames_for

LEAST_DEMONSTRATIONS = 2
REACH_MARGIN = 0.25
"""How far beyond the demonstrated distances a plan may aim, as a share of them: docs/skill.md has what comes of it."""
SIDE_MARGIN = np.deg2rad(45.0)
"""How far beyond the demonstrated azimuths a plan may aim [rad]."""
LONGEST_DRIVE = 1.5
"""A movement that is driven by the state may take so many times as long as shown."""
AIM_TOLERANCE, WORST_AIM, LONGEST_AIM_STEP = 5e-4, 5e-3, 0.15
"""Of the search for the aim: where it stops, what it accepts at worst, its longest step; metres, and radians of azimuth."""
EARLIEST, LATEST = -0.04, 0.10
"""The release at which the ball flies farthest is looked for from and to so long after the one that was shown [s]."""


class Unreachable(ValueError):
    """No plan for this target; the message says why and what would be reachable."""


@dataclass(frozen=True)
class _Course:
    """A retrieved movement for one task parameter, in axes turned by its azimuth for the angles."""

    time: np.ndarray
    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    azimuth: float
    roll: float
    release: float = np.nan
    landing: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))

    def part(self, start: int, stop: int) -> "_Course":
        """The course between two indices."""
        rows = {name: getattr(self, name)[start:stop] for name in ("time", "attractor", "position", "velocity", "acceleration")}
        return replace(self, **rows)


class ThrowingSkill:
    """A model learned from demonstrations. Build it with `learn`."""

    def __init__(self, configuration: SkillConfiguration, throws: list[PreparedThrow]):
        self.configuration = configuration
        self._surface = configuration.game.surface
        self.throws = tuple(throws)
        self._tasks = np.array([throw.task for throw in throws])
        self._start = float(np.median([throw.start for throw in throws])) - 0.05
        self._stop = float(np.median([throw.stop for throw in throws]))
        self.release = float(np.mean([throw.release_time for throw in throws]))
        self._start_pose = np.median([throw.start_pose for throw in throws], axis=0)
        self._posture = np.median([throw.start_posture for throw in throws], axis=0)
        delays = np.array([throw.hand_delay for throw in throws])
        self.hand_delay = float(np.median(delays[np.isfinite(delays)])) if np.isfinite(delays).any() else 0.0
        self.width = configuration.width
        self._whole = None if self._is_local else self._fit(np.ones(len(throws)))
        if configuration.widths:
            self.width = choose_width(self._places, configuration.widths, self._predicts).width

    @property
    def model_id(self) -> str:
        """Digest of what the model was made from: equal demonstrations and configuration give an equal name."""
        digest = hashlib.sha256(repr(self.configuration).encode())
        for throw in self.throws:
            for part in (throw.task, throw.time, throw.attractor):
                digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    def plan(self, target: np.ndarray) -> ThrowPlan:
        """A throw at the basket whose rim is centred at target (3,), or at a target on the board; Unreachable says why not."""
        target = self._checked(target)
        aim, course = self._solve_aim(target) if self.configuration.solve_aim else (target, self._course(target))
        return self._as_plan(target, aim, course)

    def releasing(self, later: float) -> "ThrowingSkill":
        """The same skill, which lets go so much later [s] on the paths that it has learned, and aims accordingly."""
        other = copy(self)
        other.release = self.release + later
        return other

    def mixture(self, target: np.ndarray) -> GaussianMixture:
        """The Gaussians for one task parameter, in the world (7.21)."""
        target = np.asarray(target, dtype=float)
        return self.model_for(target).product(self._frames_for(target))

    def frame_mixtures(self, target: np.ndarray) -> list[GaussianMixture]:
        """The Gaussians of each task frame by itself, for one task parameter, in the world: the factors of `mixture` (7.21)."""
        target = np.asarray(target, dtype=float)
        model, frames = self.model_for(target), self._frames_for(target)
        return [model.product([frame if k == one else None for k, frame in enumerate(frames)]) for one in range(len(frames))]

    def _frames_for(self, target: np.ndarray) -> list:
        return frames_for(target, self._start_features(target)[0], self.configuration)

    # fitting

    @property
    def _is_local(self) -> bool:
        return self.width > 0 or self.configuration.nearest > 0 or bool(self.configuration.widths)

    def _fit(self, weights: np.ndarray) -> TaskParameterisedMixture:
        used = [(throw, weight) for throw, weight in zip(self.throws, weights, strict=True) if weight > 0.0]
        if not used:
            raise Unreachable(f"no demonstration is near enough for '{self.configuration.name}' to learn from: teach one there")
        samples = [self._samples(throw) for throw, _ in used]
        frames = [frames_for(throw.task, throw.motion[0, :3], self.configuration) for throw, _ in used]
        mixture, shares = TaskParameterisedMixture(self.configuration.components), [weight for _, weight in used]
        fit = mixture.fit_in_time if self.configuration.partition == "time" else mixture.fit
        return fit(samples, frames, shares)

    def _samples(self, throw: PreparedThrow) -> np.ndarray:
        kept = (throw.time >= self._start) & (throw.time <= self._stop + 0.05)
        state = [throw.motion[kept], throw.velocity[kept]] if self.configuration.drive == "state" else []
        columns = [throw.time[kept, None], *state, throw.attractor[kept]]
        if self.configuration.distance_input:
            columns.insert(1, np.full((kept.sum(), 1), throw.reach))
        return np.hstack(columns)

    def model_for(self, task: np.ndarray) -> TaskParameterisedMixture:
        """The mixture in its task frames that serves a task (3,): one for all, or one fitted to its neighbours (8.4.2)."""
        return self._whole if self._whole is not None else self._fit(self._weights(task))

    def _weights(self, task: np.ndarray) -> np.ndarray:
        """Weight of each demonstration for a task (8.4.2 and chapter 9): by the distance of their places."""
        place = self._place(task[None])[0]
        if self.configuration.nearest:
            return nearest_weights(self._places, place, self.configuration.nearest)
        return gaussian_weights(self._places, place, self.width)

    def _place(self, tasks: np.ndarray) -> np.ndarray:
        """What of tasks (n, 3) makes throws differ: in turned frames the reach alone (n, 1), else the place on the floor (n, 2)."""
        return self._surface.coordinates(tasks)[:, :1] if self.configuration.turns else tasks[:, :2]

    @property
    def _places(self) -> np.ndarray:
        return self._place(self._tasks)

    def _predicts(self, i: int, weights: np.ndarray) -> float:
        """How well a model learned with weights predicts where demonstration i landed: minus the squared error, nan if it has no plan."""
        task = self._tasks[i]
        try:
            predicted = self._course(task, self._fit(weights)).landing
        except Unreachable:
            return float("nan")
        return -(self._surface.apart(predicted, task) ** 2)

    # planning

    def _checked(self, target: np.ndarray) -> np.ndarray:
        target = np.asarray(target, dtype=float)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise Unreachable(f"target {target} is not three finite numbers: give the centre of the rim in metres")
        surface = self._surface
        (reaches, azimuths), (reach, azimuth) = surface.coordinates(self._tasks).T, surface.coordinates(target).tolist()
        low, high = (1.0 - REACH_MARGIN) * reaches.min(), (1.0 + REACH_MARGIN) * reaches.max()
        if not low <= reach <= high:
            raise Unreachable(f"the {surface.what} is {surface.far(reach)}; the demonstrations reach from {low:.2f} to {high:.2f} m")
        left, right = azimuths.max() + SIDE_MARGIN, azimuths.min() - SIDE_MARGIN
        if not right <= azimuth <= left:
            raise Unreachable(
                f"the {surface.what} is at {np.rad2deg(azimuth):.0f} degrees; the demonstrations reach from {np.rad2deg(right):.0f} to "
                f"{np.rad2deg(left):.0f} degrees"
            )
        return target

    def _solve_aim(self, target: np.ndarray) -> tuple[np.ndarray, _Course]:
        """Task parameter whose course lands on the target, and that course: Broyden's method in reach and azimuth, from the target itself.

        In turned frames the azimuth comes out right by itself and the reach is a smooth function of one variable.
        """
        coordinates, point = self._surface.coordinates, self._surface.point
        wanted, aim, slope = coordinates(target), coordinates(target), np.eye(2)
        course = self._course(point(aim, target))
        miss = coordinates(course.landing) - wanted
        best, found, least = aim, course, np.abs(miss)
        for _ in range(25):
            if np.abs(miss).max() < AIM_TOLERANCE:
                break
            step = -np.linalg.solve(slope, miss)
            step *= min(1.0, LONGEST_AIM_STEP / np.abs(step).max())
            aim = aim + step
            course = self._course(point(aim, target))
            after = coordinates(course.landing) - wanted
            slope += np.outer(after - miss - slope @ step, step) / (step @ step)
            miss = after
            if np.abs(miss).max() < least.max():
                best, found, least = aim, course, np.abs(miss)
        if least.max() > WORST_AIM:
            raise Unreachable(f"no aim was found whose plan lands on {target.round(3)}; the nearest misses by {least[0]:.3f} m")
        return point(best, target), found

    def _course(self, task: np.ndarray, model: TaskParameterisedMixture | None = None) -> _Course:
        azimuth = self.configuration.angle_azimuth(azimuth_of(task))
        start, roll = self._start_features(task)
        mixture = (model or self.model_for(task)).product(frames_for(task, start[:3], self.configuration))
        time = np.arange(self._start, self._stop, self.configuration.step)
        inputs = time[:, None]
        if self.configuration.distance_input:
            inputs = np.column_stack([time, np.full(len(time), self._surface.coordinates(task)[0])])
        if self.configuration.drive == "state":
            return self._carried(self._policy(mixture, inputs), start, task, azimuth, roll)
        n_inputs = inputs.shape[1]
        attractor, _ = regress(mixture, inputs, range(n_inputs), range(n_inputs, n_inputs + 5))
        motion = follow_attractor(attractor, self.configuration.step, start, np.zeros(5), self.configuration.stiffness)
        return self._released(_Course(time, attractor, *motion, azimuth, roll), task)

    def _policy(self, mixture: GaussianMixture, inputs: np.ndarray) -> AutonomousPolicy:
        """The policy that is driven by the state (chapter 9), its phases those of the inputs (n, 1 or 2)."""
        n_inputs, stiffness = inputs.shape[1], self.configuration.stiffness
        mean, covariance = regress(mixture, inputs, range(n_inputs), range(n_inputs, n_inputs + 15))
        spread = covariance[:, :10, :10]
        return AutonomousPolicy(inputs[:, 0], mean[:, :10], spread, mean[:, 10:], stiffness, critical_damping(stiffness), PhaseRule())

    def _carried(self, policy: AutonomousPolicy, start: np.ndarray, task: np.ndarray, azimuth: float, roll: float) -> _Course:
        """The movement of a policy, on the clock on which it comes to the phase of the release when the ball is released."""
        step = self.configuration.step
        run = policy.run(start, np.zeros(5), step=step, duration=LONGEST_DRIVE * (self._stop - self._start))
        time = run.time + self.release - np.interp(self.release, run.phase, run.time)
        kept = time <= self._stop
        course = _Course(time, run.attractor, run.position, run.velocity, run.acceleration, azimuth, roll)
        return self._released(course.part(0, int(kept.sum())), task)

    def _start_features(self, task: np.ndarray) -> tuple[np.ndarray, float]:
        """Where the hand is before it moves: the demonstrations' start turned to the task's azimuth.

        x, y, z, alpha, beta (5,) and the roll, which the throw keeps (8.4.1).
        """
        azimuth = azimuth_of(task)
        position = turn_matrix(azimuth) @ self._start_pose[:3]
        turn = azimuth - self.configuration.angle_azimuth(azimuth)
        angles = self._start_pose[3:]
        if turn:
            angles = angles_from_quaternions(turn_about_z(quaternions_from_angles(angles[None]), turn))[0]
        return np.concatenate([position, angles[:2]]), float(angles[2])

    def _released(self, course: _Course, task: np.ndarray) -> _Course:
        """The course with its release, and where the ball comes down if the hand does what is planned and opens then."""
        shown = self.configuration.release == "shown"
        around = 2.0 * self.configuration.step * np.array([-1.0, 1.0]) if shown else (EARLIEST, LATEST)
        first, stop = np.searchsorted(course.time, np.add(self.release, around))
        near = course.part(min(first, len(course.time) - 3), stop)
        angular = _angular_velocity(near.position[:, 3], near.velocity[:, 3:], near.azimuth)
        velocity = np.hstack([near.velocity[:, :3], angular])
        hits = hits_along(near.position[:, :3], _hand_quaternions(near.position[:, 3:], near), velocity, task, self.configuration.game)
        release = self.release
        if not shown:
            k, after = farthest(self._surface.coordinates(hits)[:, 0])
            top = float(near.time[k] + after * (near.time[k + 1] - near.time[k]))
            # Few demonstrations may send the hand beyond the arm's reach: then it lets go before it is there.
            release = min(top, max(float(near.time[0]), stretched_at(near.time, near.position[:, :3])))
        k = nearest_step(near.time, release)
        landing = weights_at(near.time, k, release) @ hits[k - 1 : k + 2]
        if not np.isfinite(landing).all():
            where = f"the plane of the {self._surface.what} at {task[2]:.2f} m"
            raise Unreachable(f"the plan for {course.azimuth:.2f} rad never comes down on {where}")
        return replace(course, release=release, landing=landing)

    def _as_plan(self, target: np.ndarray, aim: np.ndarray, course: _Course) -> ThrowPlan:
        stiffness = self.configuration.stiffness
        gains = Gains(stiffness, float(critical_damping(stiffness)))
        release = to_the_nanosecond(course.release - course.time[0])
        return ThrowPlan(
            target=target,
            aim=aim,
            predicted_landing=course.landing,
            path=_hand_path(course),
            attractor_position=course.attractor[:, :3],
            attractor_quaternion=_hand_quaternions(course.attractor[:, 3:], course),
            position_gains=gains,
            orientation_gains=gains,
            release=release,
            open_hand=to_the_nanosecond(max(0.0, release - self.hand_delay)),
            start_posture=self._posture + np.array([np.arctan2(aim[1], aim[0]), 0, 0, 0, 0, 0, 0]),
            model_id=self.model_id,
        )


def learn(demonstrations: list[Demonstration], configuration: SkillConfiguration = DEFAULT) -> ThrowingSkill:
    """A skill from demonstrations; ValueError names a demonstration that cannot be used, or says how many are needed."""
    return learn_prepared([prepare(demonstration, configuration) for demonstration in demonstrations], configuration)


def learn_prepared(throws: list[PreparedThrow], configuration: SkillConfiguration = DEFAULT) -> ThrowingSkill:
    """The same from throws that were prepared before, for the same configuration."""
    if len(throws) < LEAST_DEMONSTRATIONS:
        raise ValueError(f"{len(throws)} demonstrations are too few: record at least {LEAST_DEMONSTRATIONS}")
    return ThrowingSkill(configuration, throws)


def _hand_quaternions(angles: np.ndarray, course: _Course) -> np.ndarray:
    """World orientations (n, 4) of alpha, beta (n, 2) in the course's axes, at its constant roll."""
    rolled = np.column_stack([angles, np.full(len(angles), course.roll)])
    return turn_about_z(quaternions_from_angles(rolled), course.azimuth)


def _angular_velocity(alpha: np.ndarray, rates: np.ndarray, azimuth: float) -> np.ndarray:
    """In world axes (n, 3): of R_z(azimuth) R_y(-alpha) R_z(beta), from alpha (n,) and the rates of alpha and beta (n, 2)."""
    axis_beta = np.column_stack([-np.sin(alpha), np.zeros(len(alpha)), np.cos(alpha)])
    turned = rates[:, 1:] * axis_beta - np.outer(rates[:, 0], [0.0, 1.0, 0.0])
    return turned @ turn_matrix(azimuth).T


def _hand_path(course: _Course) -> HandPath:
    """The course as a motion of the hand frame."""
    angular = _angular_velocity(course.position[:, 3], course.velocity[:, 3:], course.azimuth)
    return HandPath(
        time=to_the_nanosecond(course.time - course.time[0]),
        position=course.position[:, :3],
        quaternion=_hand_quaternions(course.position[:, 3:], course),
        velocity=np.hstack([course.velocity[:, :3], angular]),
        acceleration=np.hstack([course.acceleration[:, :3], np.gradient(angular, course.time, axis=0)]),
    )
