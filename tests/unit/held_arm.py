"""A person who takes hold of a simulated arm and lets it go again."""

import numpy as np

from dart_skill.arm import Command

STIFFNESS = np.array([3000.0, 3000.0, 1500.0, 1500.0, 300.0, 300.0, 80.0])
DAMPING = 0.04 * STIFFNESS
STRONGEST = np.array([90.0, 90.0, 60.0, 60.0, 20.0, 20.0, 8.0])
"""Of both hands at upper arm and forearm [N m]: less than a person may push with in
config/limits.yaml.
"""


class Holder:
    """Holds the arm where it is met, while asked to."""

    def __init__(self):
        self._posture = None

    def push(self, arm, holds):
        """What the person does to an arm in this state; None if they do not touch it."""
        if not holds:
            self._posture = None
            return None
        if self._posture is None:
            self._posture = arm.position.copy()
        torque = STIFFNESS * (self._posture - arm.position) - DAMPING * arm.velocity
        return Command(arm.stamp_ns, joint_torque=np.clip(torque, -STRONGEST, STRONGEST))
