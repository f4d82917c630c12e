"""What is drawn of an arm beside its capsules, so that one sees where it bends and whether its hand
is open: a housing at each joint, and three fingers.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmDescription
from dart_skill.view.shapes import Mesh, capsule, cylinder, joined

SLENDER = 0.04
"""Radius of a housing where no link is near its joint [m]."""
THICKEST = 0.075
"""Largest radius of a housing: it is inside a link that is thicker [m]."""
NEAR_JOINT = 0.12
"""A capsule that ends so near to a joint is one of the links that meet there [m]."""
THICKER = 1.12
"""Radius of a housing, in parts of that of the thinnest link that meets there."""
FINGERS = 3
"""Number of fingers."""
FINGER = 0.009
"""Radius of a finger [m]."""
ROOT = 0.03
"""Distance of the roots of the fingers from the axis of the hand [m]."""
KNUCKLE = 0.055
"""Distance of their knuckles from it [m]."""
TIP = {True: 0.105, False: 0.03}
"""Distance of their tips from it, of an open hand and of a closed one [m]."""


def housings(description: ArmDescription) -> dict[str, Mesh]:
    """A cylinder about the axis of each joint, by the link that it turns, in that link's frame."""
    found = {}
    for joint in description.joints:
        at = {joint.child: np.zeros(3), joint.parent: joint.xyz}
        met = [
            one.radius
            for one in description.capsules
            if one.link in at
            and min(np.linalg.norm(end - at[one.link]) for end in (one.start, one.end))
            < NEAR_JOINT
        ]
        radius = min(THICKEST, THICKER * min(met, default=SLENDER))
        found[joint.child] = cylinder(radius, 1.7 * radius)
    return found


def fingers(description: ArmDescription, is_open: bool) -> Mesh:
    """The fingers in the frame of the hand: they reach around what it grips."""
    grip = float(description.hand.ball_centre[2])
    parts = []
    for angle in 2 * np.pi * np.arange(FINGERS) / FINGERS + 0.5 * np.pi:
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        root, knuckle, tip = (
            distance * out + [0.0, 0.0, height * grip]
            for distance, height in ((ROOT, 0.5), (KNUCKLE, 0.85), (TIP[is_open], 1.25))
        )
        parts += [capsule(root, knuckle, FINGER), capsule(knuckle, tip, FINGER)]
    return joined(parts)
