"""What a skill says of itself. The rest, from a recording to a plan and on to practice, is the
same for all skills.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from dart_skill.arm import MotionPlan
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND
from dart_skill.skills.protocol._judged_skill import JudgedSkill
from dart_skill.skills.protocol._simulated_skill import SimulatedSkill
from dart_skill.skills.protocol._words import SkillWords


class Planner(Protocol):
    """A skill that was learned."""

    def plan(self, situation: Situation) -> MotionPlan:
        """A movement for a situation."""
        ...


class Skill(JudgedSkill, SimulatedSkill):
    """Base of all skills: every method has a default that serves a movement of the hand between
    bodies. Only `judge` must be written.

    Its class attributes are those of `SkillBase`.
    """

    @property
    def words(self) -> SkillWords:
        """What people are told of it."""
        held, there, standing = self.in_hand, self.in_the_way, " and the ".join(self.standing)
        it = "them" if len(self.standing) > 1 else "it"
        return SkillWords(
            welcome=(
                f"Press Teach to have {self.name} shown, or Take the hand to show it yourself."
                " Then press Learn, then Execute."
            ),
            shown=f"of the skill '{self.name}', guided by a person, in new situations",
            begin=(
                f"bring the hand to where the {self.name} begins, hold it still, and press Enter"
            ),
            stand=f"put the {standing} where the cameras see {it}" if standing else "",
            load=f"put the {held} into the hand, then stand back" if held else "",
            clear=(
                f"take the {there} away from the hand, see that nothing is in its way, then stand"
                " back"
                if there
                else ""
            ),
        )

    def where_to_put(self, role: str, pose: Pose) -> str:
        """What a person is told who shall put a body to a pose."""
        x, y, z = pose.position
        turn = np.degrees(np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]))
        turned = f", turned by {turn:+.0f} degrees" if self.turned else ""
        return f"put the {role} at x {x:.2f}, y {y:.2f}, z {z:.2f} m{turned}"

    def frames(self, situation: Situation) -> list[Pose]:
        """Task frames (7.5.2). Default: one where the hand starts, and one at each body."""
        return [situation.pose(role) for role in (HAND, *self.bodies)]

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names of the task frames, by which settings choose among them. Default: the hand, and
        each body.
        """
        return (HAND, *self.bodies)

    def chosen_frames(self, situation: Situation) -> list[Pose]:
        """The task frames that count: those that the settings name, or all.

        Raises
        ------
        ValueError
            If the skill does not name its frames.
        """
        frames, chosen = self.frames(situation), self.settings.frames
        if not chosen:
            return frames
        if len(self.frame_names) != len(frames):
            raise ValueError(
                f"the skill '{self.name}' has {len(frames)} task frames and names"
                f" {', '.join(self.frame_names)}: write frame_names"
            )
        return [
            frame for name, frame in zip(self.frame_names, frames, strict=True) if name in chosen
        ]

    def check_settings(self) -> None:
        """ValueError for settings that are not of this skill: a task frame that it does not have,
        gains that no model of it can give.
        """
        from dart_skill.skills.protocol._registry import part_of  # which loads skills

        representation = part_of(self, "representation")
        if self.settings.stiffness_range and not representation.tells_covariance:
            raise ValueError(
                f"the representation '{self.settings.representation}' knows no covariance of the"
                " attractor, so give no stiffness_range"
            )
        if unknown := [name for name in self.settings.frames if name not in self.frame_names]:
            raise ValueError(
                f"the skill '{self.name}' has no task frame '{unknown[0]}': choose among"
                f" {', '.join(self.frame_names)}"
            )

    def inputs(self, situation: Situation) -> Sequence[float]:
        """Further inputs of the regression beside time. Default: the numbers of the situation, in
        the order of their names.
        """
        return [situation.numbers[name] for name in sorted(situation.numbers)]

    def refine(self, plan: MotionPlan, situation: Situation, planner: Planner) -> MotionPlan:
        """A plan before it is carried out, by the planner that made it, which may be asked for
        others. Default: as it is.
        """
        return plan

    def corrected(self, situation: Situation, offset: np.ndarray) -> Situation:
        """The situation to plan for where what repeats in the misses is an offset (3,) [m] in the
        axes of the body that is corrected.
        """
        if not self.corrects or not offset.any():
            return situation
        pose = situation.pose(self.corrects)
        return situation.moved(self.corrects, pose.place(Pose(-offset)))

    def in_words(self, situation: Situation) -> str:
        """A situation in words. Default: each body and each number."""
        return situation.in_words(units=self.units)
