"""
A skill of one's own
====================

A skill says what is particular to it: which bodies it needs, and what counts as done. The rest,
from recordings to plans, is the same for all skills. Here the hand presses a button from above.
Eight demonstrations come from formulas, with the noise of cameras; those of a real arm have the
same form. The plan for a button at a new place can be carried out by any arm that follows poses.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.arm import ArmModel
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND, Demonstration, Track
from dart_skill.skills.learning import LearnedSkill
from dart_skill.skills.protocol import Skill, TaskOutcome


class Press(Skill):
    """Press a button."""

    name = "press"
    bodies = ("button",)

    def judge(self, seen, situation):
        """Of what the cameras saw: is the hand over the button, and near to it?"""
        last = seen.track(HAND).pose_at(seen.hand_time[-1])
        error = float(
            np.linalg.norm(situation.pose("button").sees(last).position - ABOVE.position)
        )
        return TaskOutcome(
            error < 0.01, error, "" if error < 0.01 else "the hand ended beside the button"
        )


# %%
# What is shown
# -------------
# The hand leaves its place, comes over the button, and down on it with the button's axes.

POSTURE = np.array([-0.7, 0.6, 0.0, 1.9, 0.0, 0.6416, 0.0])  # where every movement starts [rad]
place, turn = ArmModel().hand_pose(POSTURE)
START = Pose(place, Rotation.from_matrix(turn).as_quat())
# of the hand at the end, as the button sees it
ABOVE = Pose(np.array([0.0, 0.0, 0.15]), np.array([0.0, 1.0, 0.0, 0.0]))
time = np.arange(0.0, 4.0, 0.01)  # [s]


def smooth(share):
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def button(rng):
    """A pose of the button: a place on the table, turned about the vertical."""
    x, y, angle = rng.uniform([0.5, 0.0, -0.5], [0.7, 0.2, 0.5])
    return Pose(np.array([x, y, 1.15]), Rotation.from_rotvec([0.0, 0.0, angle]).as_quat())


def show(number, body, rng):
    """One demonstration: tracks of hand and button, and the joints of the arm where it waits."""
    share = (time - 1.0) / rng.uniform(1.8, 2.2)
    over, down, last = smooth(share / 0.6), smooth((share - 0.5) / 0.5), body.place(ABOVE)
    hand = START.position + np.outer(over, last.position - START.position)
    hand[:, 2] += 0.08 * over * (1.0 - down)
    turned = Slerp([0.0, 1.0], Rotation.from_quat([START.quaternion, last.quaternion]))(
        np.minimum(over, 1.0)
    )
    shaken = Rotation.from_rotvec(rng.normal(0.0, 1e-3, hand.shape)) * turned
    noise = rng.normal(0.0, 1e-4, (2, *hand.shape))
    tracks = {
        HAND: Track(time, hand + noise[0], shaken.as_quat()),
        "button": Track(time, body.position + noise[1], np.tile(body.quaternion, (len(time), 1))),
    }
    waits = time[time <= 1.0]
    joints = np.tile(POSTURE, (len(waits), 1))
    return Demonstration(
        f"shown_{number}",
        tracks,
        joint_time=waits,
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
    )


rng = np.random.default_rng(0)
shown = [show(number, button(rng), rng) for number in range(8)]

# %%
# Learned, and planned for buttons that nobody showed
# ---------------------------------------------------

learned = LearnedSkill(Press(), shown)
situations = [Situation({HAND: START, "button": button(rng)}) for _ in range(3)]
plans = [learned.plan(situation) for situation in situations]
ends = [Pose(plan.path.position[-1], plan.path.quaternion[-1]) for plan in plans]
ends = [
    situation.pose("button").sees(end) for situation, end in zip(situations, ends, strict=True)
]
errors = [1e3 * np.linalg.norm(end.position - ABOVE.position) for end in ends]
print(
    "the plans end",
    ", ".join(f"{error:.1f}" for error in errors),
    "mm from where the hand shall press",
)

# %%

figure, axes = plt.subplots(figsize=(6.0, 4.4), layout="constrained")
for one in shown:
    axes.plot(*one.hand_position[:, [1, 2]].T, color="0.75")
for situation, plan in zip(situations, plans, strict=True):
    axes.plot(*plan.path.position[:, [1, 2]].T, color="tab:blue")
    axes.plot(*situation.pose("button").position[[1, 2]], "s", color="tab:orange")
axes.set(
    xlabel="y [m]",
    ylabel="height [m]",
    title="from the front; grey: shown, blue: planned, squares: buttons",
)
plt.show()

assert max(errors) < 5.0
