"""How a controller of trajectories is used, and what the arm must not exceed on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from dart_skill.common.checks import as_number


@dataclass(frozen=True)
class TrajectorySettings:
    """How the commander uses a controller of trajectories; each is a parameter of the commander
    node, and its value stands in config/commander.yaml.

    Parameters
    ----------
    trajectory_lead
        A trajectory begins so long after the state at which it is sent [s].
    hand_lead
        The hand is told so much before the plan tells it, as it needs that time [s].
    trajectory_tolerance
        Distance of a joint from its trajectory at which the motion is stopped [rad].
    longest_lag
        The same of how late the arm is [s].
    fastest_acceleration
        Of a joint; a faster plan is refused [rad/s^2].
    """

    trajectory_lead: float
    hand_lead: float
    trajectory_tolerance: float
    longest_lag: float
    fastest_acceleration: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            object.__setattr__(self, field.name, as_number(value, field.name, strict=False))

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> TrajectorySettings:
        """Settings from the parameters of the commander node."""
        return cls(**{field.name: parameters[field.name] for field in fields(cls)})
