"""Stand a part beside a holder: a skill for the whole graph. A person shows it, the arm learns it,
and the cameras say what came of it.
"""

import numpy as np

from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import Demonstration
from dart_skill.skills.place import Place
from dart_skill.skills.protocol import Skill, TaskOutcome

STANDS = Pose(np.array([0.0, 0.14, 0.05]))
"""Where the part shall stand, as the holder sees it [m]."""
NEAR = 0.008
"""So near to it is good enough [m]."""


class Beside(Skill):
    """The part is taken, carried, and stood beside the holder."""

    name = "beside"
    bodies = ("part", "holder")
    in_hand = in_the_way = "part"

    def goal(self, situation: Situation) -> Pose:
        return situation.pose("holder").place(STANDS)

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        holder = Place.configured().draw(rng, wide=False).pose("holder")
        # it stands on the table itself
        level = holder.position * [1.0, 1.0, 0.0] + [
            0.0,
            0.0,
            1.1603,
        ]
        return Situation({"holder": Pose(level, holder.quaternion)})

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        part = seen.track("part")
        stands = situation.pose("holder").sees(part.pose_at(part.time[-1])).position
        miss = (stands - STANDS.position) * [1.0, 1.0, 0.0]
        error = float(np.linalg.norm(miss))
        return TaskOutcome(
            error < NEAR,
            error,
            "" if error < NEAR else f"the part stands {1e3 * error:.0f} mm from there",
            miss,
        )
