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

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from dart_skill.arm import (
    ExpectedThrow,
    Gains,
    GainsOverTime,
    GripEvent,
    MotionPlan,
    Pace,
    Speed,
    the_arm,
)
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.constants import Grip
from dart_skill.common.words import counted
from dart_skill.movement import (
    DSGMR,
    Motion,
    attractor_with_gains,
    azimuth_of,
    choose_width,
    stable_gains,
    stiffness_from_covariance,
)
from dart_skill.recording import Demonstration
from dart_skill.skills.learning._ball_path import ball_states
from dart_skill.skills.learning._outliers import ways_apart
from dart_skill.skills.learning._planned_path import PlannedPath
from dart_skill.skills.learning._preparation import RATE, PreparedThrow, prepare
from dart_skill.skills.learning._refinement import PlannedThrow, Unreachable
from dart_skill.skills.learning._release import hit_at
from dart_skill.skills.learning._task_frames import frames_for
from dart_skill.skills.learning._throw_model import Model, ThrowModel
from dart_skill.skills.protocol import DEFAULT, Skill, ThrowSettings

LEAST_DEMONSTRATIONS = 2
REACH_MARGIN = 0.25
"""How far beyond the demonstrated distances a plan may aim, as a share of them: docs/throwing.md has
what comes of it.
"""
SIDE_MARGIN = np.deg2rad(45.0)
"""How far beyond the demonstrated azimuths a plan may aim [rad]."""
LONGEST_DRIVE = 1.5
"""A movement that is driven by the state may take so many times as long as shown."""
AT_REST = np.zeros(5)


class ThrowingSkill(ThrowModel):
    """A throwing skill learned from demonstrations. `learn` and `learn_prepared` make one; its
    parameters and attributes are those of `ThrowModel`.
    """

    def __init__(
        self,
        configuration: ThrowSettings,
        throws: Sequence[PreparedThrow],
        skill: Skill | None = None,
    ):
        super().__init__(configuration, throws, skill)
        if configuration.widths:
            self.width = choose_width(self._places, configuration.widths, self._predicts).width

    @classmethod
    def of(cls, skill: Skill, throws: Sequence[PreparedThrow]) -> ThrowingSkill:
        """What a skill learns from throws that were prepared for its settings."""
        assert isinstance(skill.settings, ThrowSettings)
        _check_enough(throws)
        skill.check_settings()
        return cls(skill.settings, throws, skill)

    @classmethod
    def learned(cls, skill: Skill, demonstrations: Sequence[Demonstration]) -> ThrowingSkill:
        """What demonstrations teach; ValueError names one that cannot be learned from."""
        return cls.of(skill, [cls.prepared(skill, one) for one in demonstrations])

    @staticmethod
    def prepared(skill: Skill, demonstration: Demonstration) -> PreparedThrow:
        """A demonstration as numbers; ValueError says why it cannot be learned from."""
        assert isinstance(skill.settings, ThrowSettings)
        return prepare(demonstration, skill.settings)

    def plan(self, target: np.ndarray) -> MotionPlan:
        """A throw at the basket whose rim is centred at target (3,) [m], or at a target on the
        board.

        Raises
        ------
        Unreachable
            Says why not.
        """
        target = self._checked(target)
        return self._as_plan(target, *self.refinement.throw(self, target))

    def releasing(self, later: float) -> ThrowingSkill:
        """The same skill, which lets go so much later [s] on the paths that it has learned, and
        aims accordingly.
        """
        other = copy(self)
        other.release = self.release + later
        return other

    def left_out_error(self) -> float:
        """Distance of where a ball would land from where it did, of each demonstration by a model
        of the others: root mean square [m].

        inf if one of them has no plan then.
        """
        others = self.credence * (1.0 - np.eye(len(self.throws)))
        squares = [-self._predicts(i, weights) for i, weights in enumerate(others)]
        return float(np.sqrt(np.mean(squares))) if np.isfinite(squares).all() else float("inf")

    def unlike_the_others(self, i: int) -> float:
        """Distance of the way of demonstration i, until its release, from what the others teach
        for its target [m]; nan where they teach nothing for it.
        """
        weights = self._weights(self._tasks[i]) if self.is_local else self.credence
        others = np.where(np.arange(len(self.throws)) == i, 0.0, weights)
        try:
            course = self._course(self._tasks[i], self._fit(others))
        except Unreachable:
            return float("nan")
        shown = self.throws[i]
        clock = np.arange(self._start, shown.release_time, 1.0 / RATE)
        seen, way = (
            np.column_stack([np.interp(clock, time, column) for column in path[:, :3].T])
            for time, path in ((shown.time, shown.motion), (course.time, course.position))
        )
        return ways_apart(seen, way)

    def _predicts(self, i: int, weights: np.ndarray) -> float:
        """How well a model learned with weights predicts where demonstration i landed: minus the
        squared error, nan if it has no plan.
        """
        task = self._tasks[i]
        try:
            predicted = self.throw_for(task, self._fit(weights)).landing
        except Unreachable:
            return float("nan")
        return -(self.surface.apart(predicted, self.throws[i].seen) ** 2)

    def _checked(self, target: np.ndarray) -> np.ndarray:
        target = np.asarray(target, dtype=float)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise Unreachable(
                f"target {target} is not three finite numbers: give the centre of the rim in"
                " metres"
            )
        surface = self.surface
        shown = self.shown_coordinates
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

    def throw_for(self, task: np.ndarray, model: Model | None = None) -> PlannedThrow:
        """The throw for a task parameter (3,) [m], whose hand opens as the refinement has it.

        Raises
        ------
        Unreachable
            If its ball never comes down.
        """
        course = self._course(task, model or self.model_for(task))
        near = self._around_release(course)
        game, centre = self.configuration.game, the_arm().hand.ball_centre
        states = ball_states(near.position, near.velocity, near.azimuth, near.roll, centre)
        hits = game.surface.crossing(*states, task, game.projectile).position
        release = self.refinement.release(self, near, hits)
        landing = hit_at(near.time, hits, release)
        if not np.isfinite(landing).all():
            where = f"the plane of the {self.surface.what} at {task[2]:.2f} m"
            raise Unreachable(f"the plan for {course.azimuth:.2f} rad never comes down on {where}")
        return PlannedThrow(course, release, landing)

    def _course(self, task: np.ndarray, model: Model) -> PlannedPath:
        """The movement for a task parameter (3,), which starts at rest where the demonstrations
        start.
        """
        c = self.configuration
        start, roll = self._start_features(task)
        frames, inputs = (
            frames_for(task, start, c),
            self._inputs(self.surface.coordinates(task)[0]),
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

    def _around_release(self, course: PlannedPath) -> PlannedPath:
        """The part of a course in which the release can be."""
        earliest, latest = self.refinement.window(self)
        first, stop = np.searchsorted(
            course.time, [self.release + earliest, self.release + latest]
        )
        return course.part(min(first, len(course.time) - 3), stop)

    def covariance_along(self, plan: MotionPlan) -> np.ndarray:
        """How differently the demonstrations went along a plan: covariance (n, 3, 3) of the
        attractor at its instants [m^2], (3.5).
        """
        return self._covariance(plan.thrown.aim, self._start + plan.path.time)

    def _covariance(self, aim: np.ndarray, time: np.ndarray) -> np.ndarray:
        model = self.model_for(aim)
        if not isinstance(model, DSGMR):
            raise ValueError(
                "a movement that the state drives knows no covariance of its attractor:"
                f" '{self.configuration.name}'"
            )
        covariance = model.retrieve(
            self._frames_for(aim), time, self._inputs(self.surface.coordinates(aim)[0])
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

    def _as_plan(self, target: np.ndarray, aim: np.ndarray, throw: PlannedThrow) -> MotionPlan:
        c = self.configuration
        course, gains = (
            self._with_gains(aim, throw.course)
            if c.stiffness_range
            else (throw.course, Gains.critical(c.stiffness))
        )
        release = to_the_nanosecond(throw.release - course.time[0])
        told = to_the_nanosecond(max(0.0, release - self.hand_delay))
        return MotionPlan(
            path=course.hand_path,
            attractor_position=course.attractor[:, :3],
            attractor_quaternion=course.attractor_quaternion,
            position_gains=gains,
            orientation_gains=Gains.critical(c.orientation_stiffness or c.stiffness),
            start_posture=_turned(self._posture, np.arctan2(aim[1], aim[0])),
            end=release,
            what="throw",
            events=(GripEvent(told, Grip.OPEN, release),),
            carries=True,
            speed=Speed.THROW,
            pace=None if course.pace_gain is None else Pace(course.pace_gain_of_hand),
            registration=self.registration,
            throw=ExpectedThrow(target, aim, throw.landing),
            model_id=self.model_id,
        )


def _turned(posture: np.ndarray, azimuth: float) -> np.ndarray:
    """Joint angles (n,) of an arm that is turned about its base [rad]."""
    return np.concatenate([posture[:1] + azimuth, posture[1:]])


def learn_throwing(
    demonstrations: Sequence[Demonstration], configuration: ThrowSettings = DEFAULT
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
    throws: Sequence[PreparedThrow],
    configuration: ThrowSettings = DEFAULT,
    skill: Skill | None = None,
) -> ThrowingSkill:
    """Learn from throws that were prepared before, for the same configuration.

    Parameters
    ----------
    skill
        That is learned; None: one without parts of its own.

    Raises
    ------
    ValueError
        If these are too few.
    """
    _check_enough(throws)
    return ThrowingSkill(configuration, throws, skill)


def _check_enough(throws: Sequence[PreparedThrow]) -> None:
    if len(throws) < LEAST_DEMONSTRATIONS:
        raise ValueError(
            f"only {counted(len(throws), 'demonstration')}: record at least {LEAST_DEMONSTRATIONS}"
        )
