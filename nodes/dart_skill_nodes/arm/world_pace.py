"""How fast the time of a simulated world goes, and whether the world rests."""

import time
from collections.abc import Callable, Iterable

from dart_skill.arm import Command, HeldCommand
from dart_skill.simulation import Plant, Stillness

UNASKED = 0.5
"""Time after which a world rests that has not been asked for anything since the start: ball and
basket have settled by then [s].
"""
BEHIND = 0.05
"""Time that is lost is made up for by so much at most [s, wall clock]."""


class WorldPace:
    """Holds the time of a plant back, and lets a world rest in which nothing moves.

    * speed_factor: simulated seconds per second at most; 0: no limit.
    * rest_after: the world rests when nothing has moved for so long; 0: never [s].
    * watched: whether a person watches, for whom it is no faster than the machine's time.
    * rests: whether nothing has moved for long, and no client waits for steps.
    """

    def __init__(self, plant: Plant):
        self._plant, self._stillness = plant, Stillness()
        self.speed_factor = self.rest_after = 0.0
        self.watched = self.rests = False
        self._asked = False  # whether a client has asked for anything
        self._next = time.monotonic()  # when the next step is due

    def wake(self) -> None:
        """Go on at full speed: a client has asked for something."""
        self._stillness.wake(self._plant.state_stamp_ns)
        self._asked, self.rests = True, False

    def look_for_rest(self, waits: bool) -> None:
        """See whether something moves: now and then, and at each step of a world that rests.

        * waits: whether a client waits for steps, so that the world must not rest.
        """
        ns = self._plant.state_stamp_ns
        if not (self.rests or self._stillness.is_due(ns)):
            return
        self._stillness.look(ns, self._plant.joint_velocity, self._plant.bodies)
        still_for = (ns - self._stillness.since_ns) * 1e-9
        rest_after = self.rest_after if self._asked else min(self.rest_after, UNASKED)
        self.rests = not waits and 0.0 < rest_after < still_for

    def hold_back(self) -> None:
        """Wait until the next step is due."""
        factor = self.speed_factor
        if self.watched:
            factor = min(factor or 1.0, 1.0)
        if factor <= 0.0:
            return
        now = time.monotonic()
        self._next = max(self._next, now - BEHIND) + self._plant.settings.step / factor
        if self._next > now:
            time.sleep(self._next - now)


class HeldAnswers:
    """The newest commands of commander and teacher, for a world that does not wait for them.

    * timeout: age beyond which a command does not hold any more [s].
    * complain: called with what is too old.
    """

    def __init__(self, plant: Plant, senders: Iterable[str], timeout: float, complain: Callable):
        self._plant, self._timeout, self._complain = plant, timeout, complain
        self._held = {who: HeldCommand(timeout) for who in senders}

    def take(self, who: str, command: Command) -> None:
        """The next command of a sender; ValueError if it is out of order."""
        self._held[who].take(command)

    def awaits(self, who: str) -> bool:
        """Whether a sender that has sent commands has not answered the present state yet."""
        held = self._held[who]
        return held.has_come and not held.is_for(self._plant.state_stamp_ns)

    def now(self, engaged: tuple[str, ...]) -> tuple[Command, Command | None, bool]:
        """Command and push as answers to the present state, and whether they are fresh; the command
        brakes the arm when one of them is too old.
        """
        ns = self._plant.state_stamp_ns
        answers = {who: self._held[who].answer_to(ns) for who in engaged}
        late = [who for who in engaged if answers[who] is None and self._held[who].has_come]
        if late:
            self._complain(
                f"no command of the {late[0]} for more than {self._timeout} s: the arm is braked"
            )
        command = answers["commander"]
        if command is None or "teacher" in late:
            return self._plant.braking(), answers.get("teacher"), False
        return command, answers.get("teacher"), True
