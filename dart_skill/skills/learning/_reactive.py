"""A representation that reacts: an autonomous DS-GMR in task frames that may move, asked at every
state of the arm (thesis chapter 9).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import AutonomousDSGMR, TaskParameterisedMixture
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning._policy import phase_rule
from dart_skill.skills.learning._pose_features import VECTORS, with_prior
from dart_skill.skills.learning._prepared import RATE, PreparedMovement
from dart_skill.skills.learning._representation import Representation
from dart_skill.skills.learning._shown_frames import frames_along, frames_of, motion_shown

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill
    from dart_skill.skills.protocol import Skill, SkillSettings, ThrowSettings


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
    model: AutonomousDSGMR
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

    @classmethod
    def packed(cls, model: Any) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
        mixture = model.mixture_
        arrays = {"priors": mixture.priors_}
        for k, (means, covariances) in enumerate(
            zip(mixture.means_, mixture.covariances_, strict=True)
        ):
            arrays |= {f"means_{k}": means, f"covariances_{k}": covariances}
        return {"ends": model.ends, "n_inputs": model.n_inputs}, arrays

    @classmethod
    def unpacked(
        cls, settings: SkillSettings, about: dict[str, Any], arrays: dict[str, np.ndarray]
    ) -> AutonomousDSGMR:
        each = range(sum(name.startswith("means_") for name in arrays))
        means, covariances = (
            [arrays[f"{part}_{k}"] for k in each] for part in ("means", "covariances")
        )
        mixture = TaskParameterisedMixture.from_parameters(arrays["priors"], means, covariances)
        rule, ends = phase_rule(settings), tuple(about["ends"])
        return AutonomousDSGMR.of_mixture(
            mixture, ends, settings.stiffness, rule=rule, n_inputs=about["n_inputs"]
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
                motion_shown(
                    self.shown, one, one.time, one.features[:, VECTORS["position"]], clock
                )
                for one in movements
            ],
            "frames": [frames_along(self.shown, one, clock) for one in movements],
            "inputs": inputs if inputs[0] else None,
        }
        return model.fit(**shown), shown

    def mixture(self, situation: Situation) -> GaussianMixture:
        """The mixture (7.21) of time and position in the world, where the bodies of a situation
        rest, which says where the hand starts.
        """
        bodies = {role: _resting(situation.pose(role)) for role in self.shown.skill.bodies}
        product = self.model.product(frames_of(self.shown, situation, bodies))
        before = 1 + self.model.n_inputs
        return product.marginal([0, *range(before, before + 3)])

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        inputs = self._inputs(movement.situation) or None
        first, last = self.model.ends
        frames = zip(*frames_along(self.shown, movement, clock), strict=True)
        phases = first + clock * (last - first) / self.shown.duration
        return np.array(
            [
                self.model.moment(list(here), phase, inputs).state[:3]
                for here, phase in zip(frames, phases, strict=True)
            ]
        )


def _resting(pose: Pose) -> BodyMotion:
    return BodyMotion(pose.position, np.zeros(3), np.zeros(3), pose.quaternion, 0.0)
