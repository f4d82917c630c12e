"""What may happen to a simulated arm, unannounced: its ball, joints, motors, hand or base are
others from then on.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dart_skill.simulation._plant import PlantSettings

CHANGES: dict[str, dict[str, Any]] = {
    "none": {},
    "heavier_ball": {"ball_mass_scale": 2.0},
    "friction": {"friction_scale": 2.0},
    "weaker_motors": {"motor_scale": 0.8},
    "slower_hand": {"hand_delay": 0.045},
    "base_turned": {"base_turn": float(np.deg2rad(5.0))},
}
"""Settings of the plant: a ball of twice the mass, joints with twice the friction, motors with 80
% of their torque, ...
"""


def changed(settings: PlantSettings, change: str) -> PlantSettings:
    """The plant after a change, one of `CHANGES`."""
    return replace(settings, **CHANGES[change])
