"""A skill that reacts: an autonomous DS-GMR in task frames that may move, asked at every state of
the arm (thesis chapter 9).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import AutonomousDSGMR, Motion, MovingFrame, smooth_derivatives
from dart_skill.recording import Demonstration, Track
from dart_skill.skills.execution import BodyMotion, ReactiveGuide
from dart_skill.skills.learning._movement_model import RATE, MovementModel
from dart_skill.skills.learning._moving_frames import moving_frames
from dart_skill.skills.learning._policy import Policy, phase_rule
from dart_skill.skills.learning._pose_features import VECTORS, with_prior
from dart_skill.skills.learning._prepared import PreparedMovement
from dart_skill.skills.observation import position_noise
from dart_skill.skills.protocol import ReactiveSkillSettings, Skill


class ReactiveSkill(MovementModel):
    """A skill learned from demonstrations of its position among bodies that may move; the hand
    keeps the orientation of the start.

    A frame that the skill places at a body stands on the attractor (7.20) of its own motion, so
    that a motion is learned as it is relative to the body, whatever the speed of that.

    Attributes: movements, duration, start, registration as of `LearnedSkill`; model, the
    AutonomousDSGMR over [t, u, x, y, z].

    Parameters
    ----------
    skill
        What is particular to it, with `reacts` and settings derived from `ReactiveSkillSettings`.
    demonstrations
        At least `skill.settings.least_demonstrations`.

    Raises
    ------
    ValueError
        Names one that cannot be learned from.
    """

    def __init__(self, skill: Skill, demonstrations: Sequence[Demonstration]):
        if not skill.reacts or not isinstance(skill.settings, ReactiveSkillSettings):
            raise ValueError(
                f"the skill '{skill.name}' does not react: it needs `reacts = True`, and settings"
                " that say how (ReactiveSkillSettings)"
            )
        if not skill.bodies:
            raise ValueError(
                f"the skill '{skill.name}' names no body that it reacts to (Skill.bodies)"
            )
        super().__init__(skill, demonstrations)
        self._settings = skill.settings
        self.model = self._fit()

    # learning

    def _fit(self) -> AutonomousDSGMR:
        s, (model, _) = self._settings, self._fitted()
        mixture = with_prior(model.mixture_, len(self.movements), s.prior, vectors=3)
        return AutonomousDSGMR.of_mixture(
            mixture, model.ends, s.stiffness, rule=model.rule, n_inputs=model.n_inputs
        )

    def bic(self) -> float:
        """As of `LearnedSkill`."""
        model, shown = self._fitted()
        return model.bic(**shown)

    def _fitted(self) -> tuple[AutonomousDSGMR, dict[str, Any]]:
        """The model as the demonstrations alone make it, and what it was fitted to."""
        s, clock = self._settings, np.arange(0.0, self._clock_end, 1.0 / RATE)
        inputs = [list(self.skill.inputs(one.situation)) for one in self.movements]
        how: dict[str, Any] = {
            "n_inputs": len(inputs[0]),
            "partition": s.partition,
            "overlap": s.overlap,
        }
        model = AutonomousDSGMR(s.components, s.stiffness, rule=phase_rule(s), **how)
        hands = [
            self._motion(one, one.time, one.features[:, VECTORS["position"]], clock)
            for one in self.movements
        ]
        frames = [self.frames_along(one, clock) for one in self.movements]
        shown: dict[str, Any] = {
            "times": [clock] * len(hands),
            "motions": hands,
            "frames": frames,
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
                time * self.duration / movement.duration, position, noise=noise, at=clock
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
        turns = track.resampled(clock * movement.duration / self.duration).quaternion
        return [BodyMotion(*row, age=0.0) for row in zip(*motion, turns, strict=True)]

    def _frames(self, situation: Situation, bodies: Mapping[str, BodyMotion]) -> list[MovingFrame]:
        """The task frames of a moment, in which the bodies move so."""
        return moving_frames(self.skill, situation, bodies, self._settings.stiffness)

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world, where the bodies of a situation
        rest, which says where the hand starts.
        """
        bodies = {role: _resting(situation.pose(role)) for role in self.skill.bodies}
        product = self.model.product(self._frames(situation, bodies))
        before = 1 + self.model.n_inputs
        return product.marginal([0, *range(before, before + 3)])

    # carrying out

    @property
    def policy(self) -> Policy:
        """What it takes to carry the skill out, without what it was learned from."""
        return Policy(
            self.skill,
            self.model,
            self.start,
            self._start_posture,
            self._events,
            self.registration,
            self.offset,
        )

    def guide(self, situation: Situation | None = None) -> ReactiveGuide:
        """As of `Policy.guide`."""
        return self.policy.guide(situation)


def _resting(pose: Pose) -> BodyMotion:
    return BodyMotion(pose.position, np.zeros(3), np.zeros(3), pose.quaternion, 0.0)
