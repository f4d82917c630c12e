"""How the simulated teacher shows a throw, and how any other skill."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from dart_skill_msgs.msg import Outcome, Situation
from geometry_msgs.msg import PoseStamped

from dart_skill.arm import ArmState, Command, Grip
from dart_skill.simulation import Person, Phase, PulledHand, Swing, Teacher
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.comms import conversions


class Showing(Protocol):
    """One skill, as the teacher needs it.

    looks: whether the person must see where the bodies are before they begin. watches: whether
    they look at them all the time; `forget` and `see` are for those alone.
    """

    looks: bool
    watches: bool

    @property
    def phase(self) -> str:
        """What the person does, in a word."""

    def check(self, situation: Situation, again: bool) -> None:
        """ValueError where it cannot be shown; again: after one that missed."""

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        """From a state of the arm on; situation: as asked for, or as it is seen."""

    def step(self, state: ArmState) -> Command:
        """The push that answers a state."""

    def is_over(self, state: ArmState) -> bool:
        """Whether the person has let go."""

    def learn_from(self, outcome: Outcome) -> None:
        """What became of it, before the next attempt."""

    def forget(self) -> None:
        """The world was reset: nothing is seen yet."""

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body, as the cameras deliver it: stamp [ns], (3,) [m], (4,)."""


class _AtOneGlance:
    """A person who does not look at the bodies while they show it."""

    watches = False

    def forget(self) -> None:
        """Nothing is watched."""

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Nothing is watched."""


class ThrowShowing(_AtOneGlance):
    """A person who swings."""

    looks = False

    def __init__(self, skill: Any, p: dict[str, Any]):
        swing = Swing(cocked=skill.cocked) if skill.cocked else None
        self._skill, self._teacher = (
            skill,
            Teacher(p["seed"], swing, Person.from_parameters(p), game=skill.game),
        )

    @property
    def phase(self) -> str:
        return self._teacher.phase.value

    def check(self, situation: Situation, again: bool) -> None:
        self._teacher.check(self._target(situation), again)

    def _target(self, situation: Situation) -> np.ndarray:
        return self._skill.target(conversions.aimed(situation, self._skill))

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._teacher.begin(self._target(situation), state, again)

    def step(self, state: ArmState) -> Command:
        return self._teacher.step(state)

    def is_over(self, state: ArmState) -> bool:
        return self._teacher.phase == Phase.WATCHING

    def learn_from(self, outcome: Outcome) -> None:
        if outcome.seen:
            self._teacher.learn_from(conversions.seen_at(outcome, conversions.LANDING))


class CarryShowing(_AtOneGlance):
    """A person who carries the first body of a skill to where it shall be."""

    looks = True

    def __init__(self, skill: Skill, p: dict[str, Any]):
        # with rotations of SciPy, which a teacher of throws does without
        from dart_skill.simulation import Carrier

        self._skill, self._carrier, self._carries = (
            skill,
            Carrier(p["seed"], person=Person.from_parameters(p)),
            False,
        )

    @property
    def phase(self) -> str:
        return "carrying" if self._carries else "waiting"

    def check(self, situation: Situation, again: bool) -> None:
        conversions.situation(situation)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        seen = conversions.situation(situation)
        first, goal = seen.pose(self._skill.moves), self._skill.goal(seen)
        self._carrier.begin(
            state, (first.position, first.quaternion), (goal.position, goal.quaternion)
        )
        self._carries = True

    def step(self, state: ArmState) -> Command:
        return self._carrier.step(state)

    def is_over(self, state: ArmState) -> bool:
        self._carries = not self._carrier.done(state)
        return not self._carries

    def learn_from(self, outcome: Outcome) -> None:
        """The next attempt is another one anyway."""


class ReachShowing:
    """A person who follows the body that a skill reacts to with their eyes, and brings the hand
    into it.
    """

    looks = watches = True

    def __init__(self, skill: Skill, p: dict[str, Any]):
        from dart_skill.session import ReachingPerson

        self._person, self._reaches = (
            ReachingPerson(p["seed"], Person.from_parameters(p), skill.moves),
            False,
        )

    @property
    def phase(self) -> str:
        return "reaching" if self._reaches else "waiting"

    def check(self, situation: Situation, again: bool) -> None:
        conversions.situation(situation)

    def forget(self) -> None:
        self._person.forget()

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        self._person.see(body, stamp_ns, position, quaternion)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._person.begin(state)
        self._reaches = True

    def step(self, state: ArmState) -> Command:
        return self._person.step(state)

    def is_over(self, state: ArmState) -> bool:
        self._reaches = not self._person.done(state)
        return not self._reaches

    def learn_from(self, outcome: Outcome) -> None:
        """The next attempt is another one anyway."""


class PointerShowing(_AtOneGlance):
    """A person in front of a screen, who pulls the hand with a pointer. ValueErrors say what
    cannot be, and why.
    """

    looks = False

    def __init__(self, skill: Skill, frame_id: str):
        self._skill, self._frame_id, self._hand = skill, frame_id, PulledHand()

    @property
    def guides(self) -> bool:
        """Whether the hand may be pulled."""
        return self._hand.guides

    @property
    def phase(self) -> str:
        return "pulled" if self.guides else "waiting"

    def check(self, situation: Situation, again: bool) -> None:
        if not self._skill.by_pointer:
            raise ValueError(
                f"'{self._skill.name}' is too fast to be shown with a pointer: ask for a lesson"
                " without by_pointer"
            )
        conversions.situation(situation)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._hand.begin(state)

    def step(self, state: ArmState) -> Command:
        return self._hand.step(state)

    def pull(self, pointer: PoseStamped) -> None:
        """The pointer is there now."""
        if pointer.header.frame_id != self._frame_id:
            raise ValueError(
                f"the pointer is in frame '{pointer.header.frame_id}', not '{self._frame_id}'"
            )
        pose = conversions.body_pose(pointer.pose, "the pointer")
        self._hand.pull(pose.position, pose.quaternion)

    def grip(self, closes: bool) -> None:
        """What the fingers are told."""
        self._hand.tell(Grip.CLOSE if closes else Grip.OPEN)

    def finish(self) -> None:
        """The movement has been shown."""
        self._hand.finish()

    def is_over(self, state: ArmState) -> bool:
        return self._hand.over

    def learn_from(self, outcome: Outcome) -> None:
        """They see for themselves."""

    def forget(self) -> None:
        """The lesson has ended, however it did."""
        self._hand.let_go()


SHOWINGS = {"swing": ThrowShowing, "carry": CarryShowing, "follow": ReachShowing}
"""Ways of a simulated person, by what `Skill.shown_by` calls them."""


def showing_of(skill: Skill, p: dict[str, Any]) -> Showing:
    """How a simulated person shows the skill."""
    return SHOWINGS[skill.shown_by](skill, p)
