"""What the demonstration recorder makes of what it sees: a skill's own words, between messages."""

from __future__ import annotations

from dart_skill_msgs.msg import Outcome as OutcomeMsg
from dart_skill_msgs.msg import Situation as SituationMsg
from dart_skill_msgs.srv import Judge

from dart_skill.arm import Grip
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import HAND, Demonstration, read_command
from dart_skill.skills.practice import Learner
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.tracked_bodies import TrackedBodies


class Observer:
    """Cuts demonstrations of a skill out of what is seen, and judges movements.

    * skill: whose movements they are; learner: that says what can be learned from.
    * thresholds: of the speed of the hand.
    * frame_id: of the poses.

    Attributes: roles, of the bodies that are tracked; log, what was seen of them.
    """

    def __init__(
        self, skill: Skill, learner: Learner, thresholds: VelocityThreshold, frame_id: str
    ):
        self._skill, self._learner, self._frame_id = skill, learner, frame_id
        self._thresholds = thresholds
        self.roles, self.log = (HAND, *skill.bodies), skill.sensor_log()

    def hear_command(self, stamp_ns: int, data: bytes) -> None:
        """A serialised command: what the fingers are told."""
        self.log.add_told(stamp_ns, Grip(read_command(data)[2]))

    def cut(self, up_to_ns: int) -> Demonstration:
        """What was recorded, up to a stamp; ValueError says what is missing."""
        return self._skill.record(self.log, up_to_ns, self._thresholds)

    def lags(self, tracked: TrackedBodies, one: Demonstration, up_to_ns: int) -> bool:
        """Whether poses may be on their way that decide what became of a demonstration."""
        late = any(
            tracked.is_late(role, up_to_ns)
            for role in self._skill.decisive
            if role not in self._skill.awaited
        )
        opened = one.stamp_ns + round(1e9 * one.opened) if one.opened == one.opened else 0
        return late and not self._skill.is_decided(self.log, one.situation, opened, up_to_ns)

    def check(self, one: Demonstration) -> None:
        """ValueError says why it cannot be learned from."""
        self._learner.finding(one)

    def late(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> bool:
        """Whether poses may be on their way that decide what is asked for."""
        if not any(tracked.is_late(role, until_ns) for role in self._skill.decisive):
            return False
        asked, told = self._asked(request), conversions.stamp_ns(request.told)
        return not self._skill.is_decided(self.log, asked, told, until_ns)

    def _asked(self, request: Judge.Request):
        return conversions.asked(request.situation, self._skill)

    def judge(self, tracked: TrackedBodies, request: Judge.Request, until_ns: int) -> OutcomeMsg:
        """What became of a movement; ValueError says why that cannot be told."""
        asked, told = self._asked(request), conversions.stamp_ns(request.told)
        begun = conversions.stamp_ns(request.begun) or told
        if not begun or not tracked.remembers(self._skill.judged_since(begun, told)):
            raise ValueError(
                f"the movement that began at {begun} ns is too long ago, or never began: it was"
                " forgotten"
            )
        until = until_ns or tracked.newest_ns
        outcome, situation = self._skill.outcome(self.log, asked, begun, told, until)
        return conversions.task_outcome_msg(
            outcome,
            conversions.situation_msg(situation),
            self._skill.name,
            self._frame_id,
            told or begun,
        )

    def look(self, until_ns: int) -> SituationMsg:
        """Where the bodies beside the hand were seen just before a stamp; ValueError says which
        one was not.
        """
        return conversions.situation_msg(self.log.situation_at(until_ns))
