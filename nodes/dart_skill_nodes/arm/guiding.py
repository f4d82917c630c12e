"""The hands of a person who guides the arm: how a simulated person shows a throw, or any other skill,
how another person pulls the hand with a pointer, and the pushes that answer the states of the arm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from dart_skill_msgs.msg import Outcome, Situation
from geometry_msgs.msg import PoseStamped

from dart_skill.arm import ArmState, Command, Grip
from dart_skill.simulation import Person, Phase, PulledHand, Swing, Teacher
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.commands import CommandWriter, new_sender
from dart_skill_nodes.comms.coroutines import Promise
from dart_skill_nodes.comms.seen_in_step import Sighting

LONGEST_GAP = 0.1
"""Longest time between two states of an arm that is guided [s]."""


class Showing:
    """How a person shows a skill; for a subclass to fill in.

    looks: whether the person must see where the bodies are before they begin. watches: whether
    they look at them all the time; `see` is for those alone. phase: what the person does, in a
    word. _person: who answers states.
    """

    looks = watches = False
    phase = "waiting"
    _person: Any

    def check(self, situation: Situation, again: bool) -> None:
        """ValueError where it cannot be shown; again: after one that missed."""
        conversions.situation(situation)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        """From a state of the arm on; situation: as asked for, or as it is seen."""

    def step(self, state: ArmState) -> Command:
        """The push that answers a state."""
        return self._person.step(state)

    def is_over(self, state: ArmState) -> bool:
        """Whether the person has let go."""
        raise NotImplementedError

    def learn_from(self, outcome: Outcome) -> None:
        """What became of it, before the next attempt."""

    def forget(self) -> None:
        """The world was reset, or the lesson has ended: nothing is seen or held."""

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body, as the cameras deliver it: stamp [ns], (3,) [m], (4,)."""


class ThrowShowing(Showing):
    """A person who swings."""

    def __init__(self, skill: Any, p: dict[str, Any]):
        swing = Swing(cocked=skill.cocked) if skill.cocked else None
        person = Person.from_parameters(p)
        self._skill = skill
        self._person = Teacher(p["seed"], swing, person, game=skill.game)

    @property
    def phase(self) -> str:
        return self._person.phase.value

    def _target(self, situation: Situation) -> np.ndarray:
        return self._skill.target(conversions.aimed(situation, self._skill))

    def check(self, situation: Situation, again: bool) -> None:
        self._person.check(self._target(situation), again)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._person.begin(self._target(situation), state, again)

    def is_over(self, state: ArmState) -> bool:
        return self._person.phase == Phase.WATCHING

    def learn_from(self, outcome: Outcome) -> None:
        if outcome.seen:
            self._person.learn_from(conversions.seen_at(outcome, conversions.LANDING))


class CarryShowing(Showing):
    """A person who carries the first body of a skill to where it shall be, and looks at it."""

    looks = watches = True
    word = "carrying"

    def __init__(self, skill: Skill, p: dict[str, Any]):
        self._skill = skill
        self._person = self._make_person(p["seed"], Person.from_parameters(p))

    def _make_person(self, seed: int, person: Person) -> Any:
        # with rotations of SciPy, which a teacher of throws does without
        from dart_skill.session import carrier_of

        return carrier_of(self._skill, seed, person)

    def forget(self) -> None:
        self._person.forget()

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        self._person.see(body, stamp_ns, position, quaternion)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        seen = conversions.situation(situation)
        first, goal = seen.pose(self._skill.moves), self._skill.goal(seen)
        self._person.begin(
            state, (first.position, first.quaternion), (goal.position, goal.quaternion)
        )
        self.phase = self.word

    def is_over(self, state: ArmState) -> bool:
        over = self._person.done(state)
        self.phase = "waiting" if over else self.word
        return over


class StirShowing(CarryShowing):
    """A person who goes round with the first body of a skill."""

    word = "stirring"


class ReachShowing(CarryShowing):
    """A person who follows the body that a skill reacts to with their eyes, and brings the hand
    into it.
    """

    word = "reaching"

    def _make_person(self, seed: int, person: Person) -> Any:
        from dart_skill.session import ReachingPerson

        return ReachingPerson(seed, person, self._skill.moves)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._person.begin(state)
        self.phase = self.word


class PointerShowing(Showing):
    """A person in front of a screen, who pulls the hand with a pointer. ValueErrors say what
    cannot be, and why.
    """

    def __init__(self, skill: Skill, frame_id: str):
        self._skill, self._frame_id, self._person = skill, frame_id, PulledHand()

    @property
    def guides(self) -> bool:
        """Whether the hand may be pulled."""
        return self._person.guides

    @property
    def phase(self) -> str:
        return "pulled" if self.guides else "waiting"

    def check(self, situation: Situation, again: bool) -> None:
        if not self._skill.by_pointer:
            raise ValueError(
                f"'{self._skill.name}' is too fast to be shown with a pointer: ask for a lesson"
                " without by_pointer"
            )
        super().check(situation, again)

    def begin(self, situation: Situation, state: ArmState, again: bool) -> None:
        self._person.begin(state)

    def pull(self, pointer: PoseStamped) -> None:
        """The pointer is there now."""
        if pointer.header.frame_id != self._frame_id:
            raise ValueError(
                f"the pointer is in frame '{pointer.header.frame_id}', not '{self._frame_id}'"
            )
        pose = conversions.body_pose(pointer.pose, "the pointer")
        self._person.pull(pose.position, pose.quaternion)

    def grip(self, closes: bool) -> None:
        """What the fingers are told."""
        self._person.tell(Grip.CLOSE if closes else Grip.OPEN)

    def finish(self) -> None:
        """The movement has been shown."""
        self._person.finish()

    def is_over(self, state: ArmState) -> bool:
        return self._person.over

    def forget(self) -> None:
        self._person.let_go()


SHOWINGS = {
    "swing": ThrowShowing,
    "carry": CarryShowing,
    "stir": StirShowing,
    "follow": ReachShowing,
}
"""Ways of a simulated person, by what `Skill.shown_by` calls them."""


class Hands:
    """Answers the states of the arm with the pushes of a person.

    * frame_id: axes of the wrenches. watch_time: the ball is watched so long after the button [s].
    * push: called with each push, serialised. jumped: called with what is wrong, when the time of
      the arm jumps while it is guided.

    Attributes: showing, how the person shows it; guiding, whether they push; over, kept when the
    movement and the watching have ended, with what went wrong, if so; newest_ns, speed: stamp of
    the newest state, -1 without one [ns], and speed of its fastest joint [rad/s]; begun_ns, opened_ns, ended_ns, stamps of the
    movement, 0 before they are known.
    """

    def __init__(
        self,
        showing: Showing,
        frame_id: str,
        watch_time: float,
        push: Callable[[bytes], None],
        jumped: Callable[[str], None],
    ):
        self.showing, self._watch_ns = showing, round(watch_time * 1e9)
        self._push, self._jumped = push, jumped
        self._writer, self._written = CommandWriter(new_sender(), frame_id), b""
        self.newest_ns, self.speed = -1, 0.0
        self.let_go()

    def let_go(self) -> None:
        """Push no more, and wait for nothing."""
        self.guiding, self._begin = False, None
        self.over: Promise | None = None
        self.begun_ns = self.opened_ns = self.ended_ns = 0

    def begin(self, situation: Situation, again: bool) -> Promise:
        """Show it from the next state on; again: after one that missed."""
        self._begin, self.over = (situation, again), Promise()
        return self.over

    def answer(self, state: ArmState, sightings: Sequence[Sighting] = ()) -> bool:
        """Push the arm in a state; whether it is a new one. sightings: what the person has seen
        meanwhile.
        """
        for one in sightings:
            self.showing.see(*one)
        is_new = state.stamp_ns != self.newest_ns
        if is_new:
            self._notice_a_jump(state.stamp_ns)
            self.newest_ns, self.speed = state.stamp_ns, max(map(abs, state.velocity.tolist()))
            self._written = self._writer.write(self._push_for(state))
        self._push(self._written)
        if self.over is not None and 0 < self.ended_ns <= self.newest_ns:
            self.over.keep()
        return is_new

    def _notice_a_jump(self, ns: int) -> None:
        """A person lets go of an arm that is suddenly elsewhere: the world was reset, or
        states got lost.
        """
        gap = (ns - self.newest_ns) * 1e-9
        if self.guiding and not 0.0 <= gap <= LONGEST_GAP:
            self._jumped(
                f"the arm's time jumped by {gap:.3f} s while it was guided: did somebody reset the"
                " world?"
            )

    def _push_for(self, state: ArmState) -> Command:
        """The push for a state; a person who does not know how to go on pushes no more, and the
        lesson ends.
        """
        try:
            if self._begin is not None:
                situation, again = self._begin
                self._begin = None
                self.showing.begin(situation, state, again)
                self.guiding, self.begun_ns = True, state.stamp_ns
            if not self.guiding:
                return Command(state.stamp_ns)
            push = self.showing.step(state)
            if push.grip == Grip.OPEN:
                self.opened_ns = state.stamp_ns
            if not self.ended_ns and self.showing.is_over(state):
                self.ended_ns = max(state.stamp_ns, self.opened_ns + self._watch_ns)
            return push
        except ValueError as error:
            self.guiding = False
            if self.over is not None:
                self.over.keep(str(error))
            return Command(state.stamp_ns)
