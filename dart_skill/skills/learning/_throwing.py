"""The throwing skill: DS-GMR over demonstrations, and plans for baskets that were not demonstrated.

`DSGMR` learns the movement and makes it for a new task parameter; in configurations in which the
state of the arm drives the movement it is `AutonomousDSGMR`. docs/learning.md explains both. This
module adds what is particular to throwing:

* The aim: a plan predicts where its ball comes down. The task parameter is changed until that
  point lies on the target.
* The release: as demonstrated, or where on the path the ball flies farthest. There it matters
  least that a hand opens early or late.
* The delay of the hand, learned with the motion.
* The region of targets that the demonstrations allow.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from dart_skill.arm import Gains, GainsOverTime, Pace, ThrowPlan, fit_registration, wam_description
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    DSGMR,
    AutonomousDSGMR,
    Motion,
    TaskFrame,
    angles_from_quaternions,
    attractor_with_gains,
    azimuth_of,
    choose_width,
    gaussian_weights,
    nearest_weights,
    quaternions_from_angles,
    stable_gains,
    stiffness_from_covariance,
    turn_about_z,
    turn_matrix,
)
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._ball_path import ball_states
from dart_skill.skills.learning._configuration import DEFAULT, SkillConfiguration
from dart_skill.skills.learning._first_aim import LEAST_SPAN, FirstAim
from dart_skill.skills.learning._planned_path import PlannedPath
from dart_skill.skills.learning._preparation import PreparedThrow, prepare
from dart_skill.skills.learning._release import certainly_within, farthest, hit_at, stretched_at
from dart_skill.skills.learning._task_frames import frames_for

LEAST_DEMONSTRATIONS = 2
MARGIN = 0.05
"""Time before the start and after the stop of a motion that is learned, too [s]."""
REACH_MARGIN = 0.25
"""How far beyond the demonstrated distances a plan may aim, as a share of them: docs/throwing.md has
what comes of it.
"""
SIDE_MARGIN = np.deg2rad(45.0)
"""How far beyond the demonstrated azimuths a plan may aim [rad]."""
LONGEST_DRIVE = 1.5
"""A movement that is driven by the state may take so many times as long as shown."""
AIM_TOLERANCE, WORST_AIM, LONGEST_AIM_STEP = 5e-4, 5e-3, 0.15
"""Limits of the search for the aim: where it stops, what it accepts at worst, its longest step;
metres, and radians of azimuth.
"""
MOST_AIMS = 25
"""Largest number of aims that are tried after the first."""
EARLIEST, LATEST = -0.04, 0.10
"""The release at which the ball flies farthest is looked for from and to so long after the one
that was shown [s].
"""
AT_REST = np.zeros(5)
TIMES_FOUND = 1e-3
"""EM stops at this rise of the mean log-likelihood where components are fitted anew: only their
times and shares are taken from it.
"""
FINE = 1e-3
"""Noise of a recorded hand [m] up to which a demonstration counts in full, however much better the
others were seen.
"""

Model = DSGMR | AutonomousDSGMR


class Unreachable(ValueError):
    """No plan for this target; the message says why and what would be reachable."""


@dataclass(frozen=True, eq=False)
class _Throw:
    """A course, the release [s] on its clock, and where the ball comes down (3,) [m] if the hand
    follows the course and opens then.
    """

    course: PlannedPath
    release: float
    landing: np.ndarray


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The throw for an aim (2,), which is reach and azimuth, and its miss (2,): landing minus
    target, in reach and azimuth.
    """

    aim: np.ndarray
    throw: _Throw
    miss: np.ndarray

    @property
    def off(self) -> float:
        """Larger absolute value of the two."""
        return float(np.abs(self.miss).max())


class ThrowingSkill:
    """A throwing skill learned from demonstrations. `learn` and `learn_prepared` make one.

    Parameters
    ----------
    configuration
        How demonstrations become a model and a model becomes a plan.
    throws
        Demonstrations prepared for this configuration.
    throws
        Tuple of the demonstrations.

    Attributes
    ----------
    credence
        (n,) from 0 to 1, how much each of them counts (`credence_of`).
    release
        Float [s], mean release on the clock that the demonstrations share.
    registration
        Of cameras and arm, told from the demonstrations.
    seat
        (3,) [m], centre of the held ball in the frame of the hand's tracked body, the median of
        what was seen.
    hand_delay
        Float [s], median time from the command to the release; 0 if no command was seen.
    width
        Float [m], width of the Gaussian that weights the demonstrations; 0 if all count alike.
    """

    def __init__(self, configuration: SkillConfiguration, throws: Sequence[PreparedThrow]):
        self.configuration = configuration
        self.throws = tuple(throws)
        self._surface = configuration.game.surface
        self._tasks = np.array([throw.task for throw in throws])
        self.credence = credence_of([throw.noise for throw in throws])
        self._start = float(np.median([throw.start for throw in throws])) - MARGIN
        self._stop = float(np.median([throw.stop for throw in throws]))
        self._moving = [throw.between(self._start, self._stop + MARGIN) for throw in throws]
        self.release = float(
            np.average([throw.release_time for throw in throws], weights=self.credence)
        )
        self._start_pose = np.median([throw.start_pose for throw in throws], axis=0)
        self._posture = _median_posture([throw.start_posture for throw in throws])
        self.registration = fit_registration(
            [throw.sightings for throw in throws], configuration.registration
        )
        self.hand_delay = _median_of_seen(
            [throw.hand_delay - self.registration.delay for throw in throws]
        )
        self.seat = np.median([throw.release.grip for throw in throws], axis=0)
        self.width = configuration.width
        self._first_aims: dict[tuple[float, float], FirstAim | None] = {}
        self._whole = None if self._is_local else self._fit(self.credence)
        if configuration.widths:
            self.width = choose_width(self._places, configuration.widths, self._predicts).width

    @cached_property
    def model_id(self) -> str:
        """Digest of what the model was made from: equal demonstrations and configuration give an
        equal name.
        """
        digest = hashlib.sha256(repr(self.configuration).encode())
        if self.configuration.registration is not None:
            digest.update(repr(self.configuration.registration).encode())
        if self.configuration.orientation_stiffness or self.configuration.stiffness_range:
            digest.update(
                repr(
                    (self.configuration.orientation_stiffness, self.configuration.stiffness_range)
                ).encode()
            )
        if self.configuration.overlap or self.configuration.inputs_once:
            digest.update(
                repr((self.configuration.overlap, self.configuration.inputs_once)).encode()
            )
        for throw in self.throws:
            for part in (throw.task, throw.time, throw.attractor):
                digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    @cached_property
    def posture_id(self) -> str:
        """Digest of what plans are made from besides: start posture, registration, seat of the
        ball and delay of the hand.
        """
        digest = hashlib.sha256(repr(self.registration).encode())
        for part in (self._posture, self.seat, np.array(self.hand_delay)):
            digest.update(np.ascontiguousarray(part).tobytes())
        return digest.hexdigest()[:16]

    def plan(self, target: np.ndarray) -> ThrowPlan:
        """A throw at the basket whose rim is centred at target (3,) [m], or at a target on the
        board.

        Raises
        ------
        Unreachable
            Says why not.
        """
        target = self._checked(target)
        if not self.configuration.solve_aim:
            return self._as_plan(target, target, self._throw_for(target))
        attempt = self._solve_aim(target)
        return self._as_plan(target, self._surface.point(attempt.aim, target), attempt.throw)

    def releasing(self, later: float) -> ThrowingSkill:
        """The same skill, which lets go so much later [s] on the paths that it has learned, and
        aims accordingly.
        """
        other = copy(self)
        other.release = self.release + later
        return other

    def mixture(self, target: np.ndarray) -> GaussianMixture:
        """The mixture (7.21) in the world for one task parameter (3,)."""
        target = np.asarray(target, dtype=float)
        return self.model_for(target).product(self._frames_for(target))

    def frame_mixtures(self, target: np.ndarray) -> list[GaussianMixture]:
        """The mixture of each task frame alone, in the world, for one task parameter (3,): the
        factors of `mixture` (7.21).
        """
        target = np.asarray(target, dtype=float)
        model, frames = self.model_for(target), self._frames_for(target)
        return [
            model.product([frame if k == one else None for k, frame in enumerate(frames)])
            for one in range(len(frames))
        ]

    # learning

    def model_for(self, task: np.ndarray) -> Model:
        """The fitted DS-GMR for a task (3,): the same for all tasks, or one fitted to the
        demonstrations near it (8.4.2).
        """
        return self._whole if self._whole is not None else self._fit(self._weights(task))

    def bic(self) -> float:
        """Bayesian information criterion of the model of all demonstrations: lower is better.

        Raises
        ------
        ValueError
            Where each target has its own.
        """
        if self._whole is None:
            raise ValueError(
                f"'{self.configuration.name}' has a model for each target, and BIC compares"
                " nothing: take cross_validation"
            )
        _, shown = self._encoded(np.arange(len(self.throws)))
        return self._whole.bic(**shown, weights=self.credence)

    def left_out_error(self) -> float:
        """Distance of where a ball would land from where it did, of each demonstration by a model
        of the others: root mean square [m].

        inf if one of them has no plan then.
        """
        others = self.credence * (1.0 - np.eye(len(self.throws)))
        squares = [-self._predicts(i, weights) for i, weights in enumerate(others)]
        return float(np.sqrt(np.mean(squares))) if np.isfinite(squares).all() else float("inf")

    def _fit(self, weights: np.ndarray) -> Model:
        """DS-GMR fitted to the demonstrations with weights (n,); those with weight 0 are left out."""
        used = np.flatnonzero(weights)
        if not len(used):
            raise Unreachable(
                f"no demonstration is near enough for '{self.configuration.name}' to learn from:"
                " teach one there"
            )
        model, shown = self._encoded(used)
        return model.fit(**shown, weights=weights[used])

    def _encoded(self, used: np.ndarray) -> tuple[Model, dict[str, Any]]:
        """A model, not fitted yet, and some of the demonstrations as it takes them."""
        c, moving = self.configuration, [self._moving[i] for i in used]
        kind = AutonomousDSGMR if c.drive == "state" else DSGMR
        how: dict[str, Any] = {
            "n_inputs": int(c.distance_input),
            "partition": c.partition,
            "overlap": c.overlap or None,
        }
        how |= {"n_shared": 1 + int(c.distance_input)} if c.inputs_once else {}
        how |= {"tolerance": TIMES_FOUND} if c.overlap else {}
        model = kind(c.components, c.stiffness_of_features, **how)
        frames = [frames_for(self.throws[i].task, self.throws[i].motion[0], c) for i in used]
        if isinstance(model, DSGMR):
            features = [
                model.features(one.time, one.attractor, self._inputs(one.reach)) for one in moving
            ]
            return model, {"attractors": features, "frames": frames}
        return model, {
            "times": [one.time for one in moving],
            "motions": [(one.motion, one.velocity) for one in moving],
            "frames": frames,
            "attractors": [one.attractor for one in moving],
            "inputs": [[one.reach] for one in moving] if c.distance_input else None,
        }

    def _inputs(self, reach: float) -> list[float] | None:
        """Further inputs of the regression beside time."""
        return [reach] if self.configuration.distance_input else None

    def _frames_for(self, task: np.ndarray) -> list[TaskFrame]:
        return frames_for(task, self._start_features(task)[0], self.configuration)

    # which demonstrations count

    @property
    def _is_local(self) -> bool:
        return self.width > 0 or self.configuration.nearest > 0 or bool(self.configuration.widths)

    def _weights(self, task: np.ndarray) -> np.ndarray:
        """Weight of each demonstration for a task (8.4.2 and chapter 9): by the distance of their
        places.
        """
        place = self._place(task[None])[0]
        if self.configuration.nearest:
            return self.credence * nearest_weights(self._places, place, self.configuration.nearest)
        return self.credence * gaussian_weights(self._places, place, self.width)

    def _place(self, tasks: np.ndarray) -> np.ndarray:
        """What of tasks (n, 3) makes throws differ: in turned frames the reach alone (n, 1), else
        the place on the floor (n, 2).
        """
        return (
            self._surface.coordinates(tasks)[:, :1] if self.configuration.turns else tasks[:, :2]
        )

    @property
    def _places(self) -> np.ndarray:
        return self._place(self._tasks)

    def _predicts(self, i: int, weights: np.ndarray) -> float:
        """How well a model learned with weights predicts where demonstration i landed: minus the
        squared error, nan if it has no plan.
        """
        task = self._tasks[i]
        try:
            predicted = self._throw_for(task, self._fit(weights)).landing
        except Unreachable:
            return float("nan")
        return -(self._surface.apart(predicted, task) ** 2)

    # the aim

    def _checked(self, target: np.ndarray) -> np.ndarray:
        target = np.asarray(target, dtype=float)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise Unreachable(
                f"target {target} is not three finite numbers: give the centre of the rim in"
                " metres"
            )
        surface = self._surface
        shown = surface.coordinates(self._tasks)
        reach, azimuth = surface.coordinates(target).tolist()
        low, high = (
            (1.0 - REACH_MARGIN) * shown[:, 0].min(),
            (1.0 + REACH_MARGIN) * shown[:, 0].max(),
        )
        if not low <= reach <= high:
            raise Unreachable(
                f"the {surface.what} is {surface.far(reach)}; the demonstrations reach from"
                f" {low:.2f} to {high:.2f} m"
            )
        right, left = shown[:, 1].min() - SIDE_MARGIN, shown[:, 1].max() + SIDE_MARGIN
        if not right <= azimuth <= left:
            raise Unreachable(
                f"the {surface.what} is at {np.rad2deg(azimuth):.0f} degrees; the demonstrations"
                f" reach from {np.rad2deg(right):.0f} to {np.rad2deg(left):.0f} degrees"
            )
        return target

    def _solve_aim(self, target: np.ndarray) -> _Attempt:
        """The aim whose throw lands on the target, found by Broyden's method in reach and azimuth.
        It starts at the aim that `FirstAim` tells, or at the target.
        """
        attempt, slope = self._first_attempt(target)
        best = attempt
        for _ in range(MOST_AIMS):
            if attempt.off < AIM_TOLERANCE:
                break
            step = -np.linalg.solve(slope, attempt.miss)
            step *= min(1.0, LONGEST_AIM_STEP / np.abs(step).max())
            after = self._attempt(attempt.aim + step, target)
            slope += np.outer(after.miss - attempt.miss - slope @ step, step) / (step @ step)
            attempt = after
            if attempt.off < best.off:
                best = attempt
        if best.off > WORST_AIM:
            raise Unreachable(
                f"no aim was found whose plan lands on {target.round(3)}; the nearest misses by"
                f" {abs(best.miss[0]):.3f} m"
            )
        return best

    def _first_attempt(self, target: np.ndarray) -> tuple[_Attempt, np.ndarray]:
        """The first throw of the search, and how its landing changes with the aim (2, 2), as far
        as that is known.
        """
        place, known = self._surface.coordinates(target), self._first_aim(target)
        told = None if known is None else known.at(place)
        if told is not None:
            with suppress(Unreachable):
                return self._attempt(told[0], target), told[1]
        return self._attempt(place, target), np.eye(2)

    def _first_aim(self, target: np.ndarray) -> FirstAim | None:
        """What three throws tell of all, worked out once for a height of the rim, to the
        millimetre; None where each target has a model of its own, or frames do not turn with
        targets.
        """
        if self._is_local or not self.configuration.turns:
            return None
        level = (self.release, 0.0 if self.configuration.board else round(float(target[2]), 3))
        if level not in self._first_aims:
            self._first_aims[level] = self._told_first_aim(np.array([*target[:2], level[1]]))
        return self._first_aims[level]

    def _told_first_aim(self, target: np.ndarray) -> FirstAim | None:
        shown = self._surface.coordinates(self._tasks)
        low, high = shown[:, 0].min(), shown[:, 0].max()
        if high - low < LEAST_SPAN:
            return None
        aims = np.array(
            [[reach, np.median(shown[:, 1])] for reach in (low, 0.5 * (low + high), high)]
        )
        try:
            landings = [self._throw_for(self._surface.point(aim, target)).landing for aim in aims]
        except Unreachable:
            return None
        return FirstAim.of(aims, self._surface.coordinates(np.array(landings)))

    def _attempt(self, aim: np.ndarray, target: np.ndarray) -> _Attempt:
        throw = self._throw_for(self._surface.point(aim, target))
        return _Attempt(
            aim,
            throw,
            self._surface.coordinates(throw.landing) - self._surface.coordinates(target),
        )

    # the movement and its release

    def _throw_for(self, task: np.ndarray, model: Model | None = None) -> _Throw:
        """The throw for a task parameter (3,)."""
        course = self._course(task, model or self.model_for(task))
        near = self._around_release(course)
        game, centre = self.configuration.game, wam_description().hand.ball_centre
        states = ball_states(near.position, near.velocity, near.azimuth, near.roll, centre)
        hits = game.surface.crossing(*states, task, game.projectile).position
        release = (
            self.release
            if self.configuration.release == "shown"
            else self._farthest_release(near, hits)
        )
        landing = hit_at(near.time, hits, release)
        if not np.isfinite(landing).all():
            where = f"the plane of the {self._surface.what} at {task[2]:.2f} m"
            raise Unreachable(f"the plan for {course.azimuth:.2f} rad never comes down on {where}")
        return _Throw(course, release, landing)

    def _course(self, task: np.ndarray, model: Model) -> PlannedPath:
        """The movement for a task parameter (3,), which starts at rest where the demonstrations
        start.
        """
        c = self.configuration
        start, roll = self._start_features(task)
        frames, inputs = (
            frames_for(task, start, c),
            self._inputs(self._surface.coordinates(task)[0]),
        )
        azimuth, clock = (
            c.angle_azimuth(azimuth_of(task)),
            np.arange(self._start, self._stop, c.step),
        )
        if isinstance(model, DSGMR):
            movement = model.reproduce(
                frames, clock, start, AT_REST, inputs=inputs, step=c.step, covariance=False
            )
            return PlannedPath.of(movement, azimuth, roll)
        longest = LONGEST_DRIVE * (self._stop - self._start)
        policy = model.policy(frames, phase=clock, inputs=inputs)
        run = policy.run(start, AT_REST, step=c.step, duration=longest)
        rate = np.maximum(np.gradient(run.phase, run.time), model.rule.slowest)
        return self._on_the_clock(
            PlannedPath.of(run, azimuth, roll, policy.gain(run.phase) / rate[:, None]), run.phase
        )

    def _on_the_clock(self, course: PlannedPath, phase: np.ndarray) -> PlannedPath:
        """A course driven by the state, with a clock on which its phase (n,) is that of the
        release at the time of the release.
        """
        time = course.time + self.release - np.interp(self.release, phase, course.time)
        return replace(course, time=time).part(0, int(np.count_nonzero(time <= self._stop)))

    def _start_features(self, task: np.ndarray) -> tuple[np.ndarray, float]:
        """Where the hand is before it moves: the demonstrations' start turned to the task's
        azimuth.

        x, y, z, alpha, beta (5,) and the roll, which the throw keeps (8.4.1).
        """
        azimuth = azimuth_of(task)
        position = turn_matrix(azimuth) @ self._start_pose[:3]
        turn = azimuth - self.configuration.angle_azimuth(azimuth)
        angles = self._start_pose[3:]
        if turn:
            angles = angles_from_quaternions(
                turn_about_z(quaternions_from_angles(angles[None]), turn)
            )[0]
        return np.concatenate([position, angles[:2]]), float(angles[2])

    def _around_release(self, course: PlannedPath) -> PlannedPath:
        """The part of a course in which the release can be."""
        if self.configuration.release == "shown":
            earliest, latest = -2.0 * self.configuration.step, 2.0 * self.configuration.step
        else:
            earliest, latest = EARLIEST, LATEST
        first, stop = np.searchsorted(
            course.time, [self.release + earliest, self.release + latest]
        )
        return course.part(min(first, len(course.time) - 3), stop)

    def _farthest_release(self, near: PlannedPath, hits: np.ndarray) -> float:
        """The instant [s] at which the ball flies farthest, for a part of a course whose balls
        come down at hits (n, 3).
        """
        k, after = farthest(self._surface.coordinates(hits)[:, 0])
        top = float(near.time[k] + after * (near.time[k + 1] - near.time[k]))
        # Few demonstrations may send the hand beyond the arm's reach: then it lets go before it is
        # there.
        if certainly_within(near.position[:, :3], self.registration):
            return top
        position, _ = self.registration.poses(near.position[:, :3], near.hand_quaternion)
        return min(top, max(float(near.time[0]), stretched_at(near.time, position)))

    def covariance_along(self, plan: ThrowPlan) -> np.ndarray:
        """How differently the demonstrations went along a plan: covariance (n, 3, 3) of the
        attractor at its instants [m^2], (3.5).
        """
        return self._covariance(plan.aim, self._start + plan.path.time)

    def _covariance(self, aim: np.ndarray, time: np.ndarray) -> np.ndarray:
        model = self.model_for(aim)
        if not isinstance(model, DSGMR):
            raise ValueError(
                "a movement that the state drives knows no covariance of its attractor:"
                f" '{self.configuration.name}'"
            )
        covariance = model.retrieve(
            self._frames_for(aim), time, self._inputs(self._surface.coordinates(aim)[0])
        )[1]
        assert covariance is not None
        return covariance[:, :3, :3]

    def _with_gains(
        self, aim: np.ndarray, course: PlannedPath
    ) -> tuple[PlannedPath, GainsOverTime]:
        """The course with other attractors and gains: the same motion, held the more firmly the
        more the demonstrations agreed.
        """
        wanted = stiffness_from_covariance(
            self._covariance(aim, course.time), *self.configuration.stiffness_range
        )
        stiffness, damping = stable_gains(course.time, wanted)
        motion = Motion(course.position[:, :3], course.velocity[:, :3], course.acceleration[:, :3])
        attractor = attractor_with_gains(motion, stiffness, damping)
        return replace(
            course, attractor=np.hstack([attractor, course.attractor[:, 3:]])
        ), GainsOverTime(stiffness, damping)

    def _as_plan(self, target: np.ndarray, aim: np.ndarray, throw: _Throw) -> ThrowPlan:
        c = self.configuration
        course, gains = (
            self._with_gains(aim, throw.course)
            if c.stiffness_range
            else (throw.course, Gains.critical(c.stiffness))
        )
        release = to_the_nanosecond(throw.release - course.time[0])
        return ThrowPlan(
            target=target,
            aim=aim,
            predicted_landing=throw.landing,
            path=course.hand_path,
            attractor_position=course.attractor[:, :3],
            attractor_quaternion=course.attractor_quaternion,
            position_gains=gains,
            orientation_gains=Gains.critical(c.orientation_stiffness or c.stiffness),
            release=release,
            open_hand=to_the_nanosecond(max(0.0, release - self.hand_delay)),
            start_posture=self._posture + np.array([np.arctan2(aim[1], aim[0]), 0, 0, 0, 0, 0, 0]),
            model_id=self.model_id,
            registration=self.registration,
            pace=None if course.pace_gain is None else Pace(course.pace_gain_of_hand),
        )


def learn_throwing(
    demonstrations: Sequence[Demonstration], configuration: SkillConfiguration = DEFAULT
) -> ThrowingSkill:
    """A skill from demonstrations.

    Raises
    ------
    ValueError
        Names a demonstration that cannot be used, or says how many are needed.
    """
    return learn_prepared(
        [prepare(demonstration, configuration) for demonstration in demonstrations], configuration
    )


def learn_prepared(
    throws: Sequence[PreparedThrow], configuration: SkillConfiguration = DEFAULT
) -> ThrowingSkill:
    """The same from throws that were prepared before, for the same configuration.

    Raises
    ------
    ValueError
        If these are too few.
    """
    if len(throws) < LEAST_DEMONSTRATIONS:
        raise ValueError(
            f"{len(throws)} demonstrations are too few: record at least {LEAST_DEMONSTRATIONS}"
        )
    return ThrowingSkill(configuration, throws)


def credence_of(noise: Sequence[float]) -> np.ndarray:
    """How much demonstrations count (n,) whose hands were recorded with such noise (n,) [m]: the
    inverse of the variance, relative to the median of them (weighted least squares, A. Aitken,
    1936), and at most 1.
    """
    own = np.asarray(noise, dtype=float)
    usual = max(float(np.median(own)), FINE)
    return np.square(usual / np.maximum(own, usual))


def _median_posture(postures: list[np.ndarray]) -> np.ndarray:
    """Median of the postures (7,) of those whose joints were recorded; nan if those of none were."""
    seen = [posture for posture in postures if np.isfinite(posture).all()]
    return np.median(seen or postures, axis=0)


def _median_of_seen(values: list[float]) -> float:
    """Median of the finite values; 0 if there are none."""
    seen = np.array(values)[np.isfinite(values)]
    return float(np.median(seen)) if len(seen) else 0.0
