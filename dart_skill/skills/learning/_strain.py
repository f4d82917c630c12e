"""Whether a guided arm came to a limit of its own: what was shown there it cannot follow when it
repeats the motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from dart_skill.arm import ArmModel, Speed
from dart_skill.recording import Demonstration
from dart_skill.skills.protocol import Skill

NEARLY_STRETCHED = 0.01
"""Nearer than this to its full reach an arm is stretched [m]: a plan may go to half of it."""
NEAR_END = 0.05
"""Nearer than this to the end of its range a joint is at its end [rad]."""
FASTEST = 0.9
"""Share of the speed of a motor without load at which it has no torque left to speak of."""
LETS_GO = 0.05
"""A hand that was told to open has let go by then [s]; what a thrower does later is not repeated."""
RATE = 100.0
"""Postures are looked at so often [Hz]."""


def strain(skill: Skill, one: Demonstration) -> str:
    """Limits of the arm that it came to while a movement was shown, and how to show it otherwise, in
    words; empty if it came to none, or its joints were not recorded.
    """
    kept = _shown(skill, one)
    if not len(kept):
        return ""
    model, q, qd = ArmModel(), one.joint_position[kept], one.joint_velocity[kept]
    return "; ".join(filter(None, [_stretched(model, q), _at_an_end(model, q), _fast(model, qd)]))


def strained(skill: Skill, shown: Iterable[Demonstration]) -> dict[str, str]:
    """Those demonstrations that came to a limit of the arm, and to which, by their ids."""
    return {one.id: why for one in shown if (why := strain(skill, one))}


def strained_in_words(strained: Mapping[str, str]) -> str:
    """What is to be said of them; empty if there are none."""
    each = ", ".join(f"{name} ({why})" for name, why in strained.items())
    return each and f"shown at a limit of the arm, better dropped and shown again: {each}"


def _shown(skill: Skill, one: Demonstration) -> np.ndarray:
    """Indices of the joint states during the movement, of a throw until the hand has let go."""
    described = skill.described(one)
    start, stop = described.motion_start, described.motion_stop
    if skill.speed == Speed.THROW and np.isfinite(one.opened):
        stop = min(stop, one.opened + LETS_GO)
    time = one.joint_time
    during = np.flatnonzero(~(time < start) & ~(time > stop))
    if len(during) < 2:
        return during
    lasts = time[during[-1]] - time[during[0]]
    n = min(len(during), 2 + int(lasts * RATE))
    return during[np.linspace(0, len(during) - 1, n).round().astype(int)]


def _stretched(model: ArmModel, q: np.ndarray) -> str:
    arm, hands = model.description, np.array([model.hand_pose(row)[0] for row in q])
    left = arm.reach - float(np.linalg.norm(hands - arm.shoulder, axis=1).max())
    if left > NEARLY_STRETCHED:
        return ""
    far = f"{100 * max(left, 0.0):.1f} cm from its full reach"
    return f"the arm was stretched, {far}: bend the elbow"


def _at_an_end(model: ArmModel, q: np.ndarray) -> str:
    joints = model.description
    lower, upper = joints.ends
    left = np.minimum(q - lower, upper - q).min(axis=0)
    j = int(left.argmin())
    if left[j] > NEAR_END:
        return ""
    return f"{joints.joints[j].name} was {left[j]:.2f} rad from its end: keep away from that"


def _fast(model: ArmModel, qd: np.ndarray) -> str:
    joints = model.description
    share = (np.abs(qd) / joints.of_joints("no_load_speed")).max(axis=0)
    j = int(share.argmax())
    if share[j] < FASTEST:
        return ""
    return (
        f"{joints.joints[j].name} was at {100 * share[j]:.0f} % of its motor's highest speed: move it"
        " slower"
    )
