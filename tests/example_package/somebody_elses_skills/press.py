"""Press a button: the smallest skill. Between bodies everything has a default; only what counts as
pressed must be said.
"""

from dart_skill.common.situation import Situation
from dart_skill.recording import HAND, Demonstration
from dart_skill.skills.protocol import Skill, TaskOutcome

NEAR = 0.01
"""The hand presses a button that it is so near to [m]."""


class Press(Skill):
    name = "press"
    bodies = ("button",)

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        last = seen.track(HAND).pose_at(seen.hand_time[-1])
        error = float(abs(situation.pose("button").sees(last).position).max())
        return TaskOutcome(
            error < NEAR,
            error,
            "" if error < NEAR else f"the hand ended {1e3 * error:.0f} mm from the button",
        )
