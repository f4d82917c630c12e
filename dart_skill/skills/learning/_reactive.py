"""A representation that reacts: an autonomous DS-GMR in task frames that may move, asked at every
state of the arm (thesis chapter 9).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import AutonomousDSGMR, Motion, MovingFrame, smooth_derivatives
from dart_skill.recording import Track
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._policy import phase_rule
from dart_skill.skills.learning._pose_features import VECTORS, with_prior
from dart_skill.skills.learning._prepared import RATE, PreparedMovement
from dart_skill.skills.learning._representation import Representation
from dart_skill.skills.observation import position_noise

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill
    from dart_skill.skills.protocol import Skill, ThrowSettings


class Autonomous(Representation):
    """The position of the hand among bodies that may move; the hand keeps the orientation of the
    start.

    A frame that the skill places at a body stands on the attractor (7.20) of its own motion, so
    that a motion is learned as it is relative to the body, whatever the speed of that.

    Attributes
    ----------
    model
        The AutonomousDSGMR over [t, u, x, y, z].
    """

    drive = "state"
    tells_covariance = False
    encodes_throws = True

    @classmethod
    def of_throws(cls, settings: ThrowSettings) -> AutonomousDSGMR:
        return AutonomousDSGMR(
            settings.components, settings.stiffness_of_features, **cls.mixture_of_throws(settings)
        )

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        if not skill.bodies:
            return "it names no body that it reacts to (Skill.bodies)"
        if skill.turns_hand:
            return "the hand would keep the orientation of the start, and this skill turns it"
        return ""

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        s, (model, _) = self.settings, self._fitted()
        mixture = with_prior(model.mixture_, len(shown.movements), s.prior, vectors=3)
        self.model = AutonomousDSGMR.of_mixture(
            mixture, model.ends, s.stiffness, rule=model.rule, n_inputs=model.n_inputs
        )

    def bic(self) -> float:
        model, shown = self._fitted()
        return model.bic(**shown)

    def _fitted(self) -> tuple[AutonomousDSGMR, dict[str, Any]]:
        """The model as the demonstrations alone make it, and what it was fitted to."""
        s, clock = self.settings, np.arange(0.0, self.shown.clock_end, 1.0 / RATE)
        movements = self.shown.movements
        inputs = [self._inputs(one.situation) for one in movements]
        model = AutonomousDSGMR(
            s.components,
            s.stiffness,
            rule=phase_rule(s),
            n_inputs=len(inputs[0]),
            partition=self.partition,
        )
        shown: dict[str, Any] = {
            "times": [clock] * len(movements),
            "motions": [
                self._motion(one, one.time, one.features[:, VECTORS["position"]], clock)
                for one in movements
            ],
            "frames": [self.frames_along(one, clock) for one in movements],
            "inputs": inputs if inputs[0] else None,
        }
        return model.fit(**shown), shown

    def _motion(
        self, movement: PreparedMovement, time: np.ndarray, position: np.ndarray, clock: np.ndarray
    ) -> Motion:
        """What was seen at stamps (n,), (n, 3), stretched to the mean duration, at the instants of
        the clock (m,).
        """
        try:
            noise = position_noise(time, position)
            return smooth_derivatives(
                time * self.shown.duration / movement.duration, position, noise=noise, at=clock
            )
        except ValueError as error:
            raise ValueError(f"demonstration {movement.id}: {error}") from error

    def frames_along(
        self, movement: PreparedMovement, clock: np.ndarray
    ) -> list[list[MovingFrame]]:
        """The task frames at each instant of the clock (m,): a list of m for each frame.

        Parameters
        ----------
        movement
            What was prepared of a demonstration.
        """
        moved = {
            role: self._body_motions(movement, track, clock)
            for role, track in movement.bodies.items()
        }
        instants = [
            dict(zip(moved, motions, strict=True)) for motions in zip(*moved.values(), strict=True)
        ]
        frames = [self._frames(movement.situation, motions) for motions in instants]
        return [list(one) for one in zip(*frames, strict=True)]

    def _body_motions(
        self, movement: PreparedMovement, track: Track, clock: np.ndarray
    ) -> list[BodyMotion]:
        motion = self._motion(movement, track.time, track.position, clock)
        turns = track.resampled(clock * movement.duration / self.shown.duration).quaternion
        return [BodyMotion(*row, age=0.0) for row in zip(*motion, turns, strict=True)]

    def _frames(self, situation: Situation, bodies: Mapping[str, BodyMotion]) -> list[MovingFrame]:
        """The task frames of a moment, in which the bodies move so."""
        return moving_frames(self.shown.skill, situation, bodies, self.settings.stiffness)

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world, where the bodies of a situation
        rest, which says where the hand starts.
        """
        bodies = {role: _resting(situation.pose(role)) for role in self.shown.skill.bodies}
        product = self.model.product(self._frames(situation, bodies))
        before = 1 + self.model.n_inputs
        return product.marginal([0, *range(before, before + 3)])

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        inputs = self._inputs(movement.situation) or None
        first, last = self.model.ends
        frames = zip(*self.frames_along(movement, clock), strict=True)
        phases = first + clock * (last - first) / self.shown.duration
        return np.array(
            [
                self.model.moment(list(here), phase, inputs).state[:3]
                for here, phase in zip(frames, phases, strict=True)
            ]
        )


def _resting(pose: Pose) -> BodyMotion:
    return BodyMotion(pose.position, np.zeros(3), np.zeros(3), pose.quaternion, 0.0)
