"""How a simulated arm and its world differ from a perfect one."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from dart_skill.arm import SafetyLimits
from dart_skill.common.constants import N_JOINTS
from dart_skill.simulation._basket import Basket
from dart_skill.simulation._board import Board

OF_EACH_JOINT = ("start_posture", "mass_scale", "joint_stiffness", "joint_offset")
"""Settings with a number for each joint."""
NO_PARAMETERS = ("step_ns", "reset_ns", "hand_clearance", "basket", "board", "limits")
"""Settings that are no parameters of the simulator of that name."""


@dataclass(frozen=True)
class PlantSettings:
    """How the stand-in differs from a perfect arm; each value is a parameter of the simulator
    node.

    Parameters
    ----------
    step_ns
        Control period [ns].
    reset_ns
        How far a reset moves the clock on, so that everybody notices the gap [ns].
    start_posture
        Joint angles after a reset (7,) [rad].
    gravity_error
        Share of the gravity torque that compensation misses; calibrated arms show 5 %
        (docs/sources.md).
    friction_scale, motor_scale
        Factors on the joint friction, and on what the motors can do.
    base_turn
        The arm's base stands turned about the vertical, which the controller does not know [rad].
    hand_delay, hand_spread
        Mean and standard deviation of the time from the command to the ball being free [s].
    hand_clearance
        A released ball that is farther from the hand than this can touch the hand again [m].
    basket
        Where balls are thrown.
    ball_mass_scale, ball_drag_scale
        Factors on the mass and on the drag of the ball.
    mass_scale
        Factors on the masses of the links (7,).
    stiction
        What static friction is more than Coulomb friction, as a share of it.
    joint_stiffness
        Of the cables between motors and links (7,) [N m/rad]; all 0: rigid. Encoders sit on the
        motors.
    joint_offset
        What the encoders read too high (7,) [rad].
    encoder_step
        Of an angle [rad]; 0: none.
    speed_filter
        Corner of the low-pass on the speeds [rad/s]; 0: speeds are exact.
    command_delay
        Control periods until a command acts.
    seat_spread
        Standard deviation of a coordinate of where the ball sits in the hand [m].
    release_turn, release_speed
        Standard deviations of the direction [rad] and of the speed, as a share, with which it
        leaves the hand.
    board
        Where there is one, darts are thrown at it, and there is no basket.
    limits
        That the arm's own safety module watches; None: it has none.
    """

    step_ns: int = 2_000_000
    reset_ns: int = 1_000_000_000
    start_posture: tuple[float, ...] = (0.0,) * N_JOINTS
    gravity_error: float = 0.05
    friction_scale: float = 1.0
    motor_scale: float = 1.0
    base_turn: float = 0.0
    hand_delay: float = 0.030
    hand_spread: float = 0.004
    hand_clearance: float = 0.10
    basket: Basket = Basket()
    ball_mass_scale: float = 1.0
    ball_drag_scale: float = 1.0
    mass_scale: tuple[float, ...] = (1.0,) * N_JOINTS
    stiction: float = 0.0
    joint_stiffness: tuple[float, ...] = (0.0,) * N_JOINTS
    joint_offset: tuple[float, ...] = (0.0,) * N_JOINTS
    encoder_step: float = 0.0
    speed_filter: float = 0.0
    command_delay: int = 0
    seat_spread: float = 0.0
    release_turn: float = 0.0
    release_speed: float = 0.0
    board: Board | None = None
    limits: SafetyLimits | None = None

    @property
    def step(self) -> float:
        return self.step_ns * 1e-9

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> "PlantSettings":
        """Settings from the parameters of the simulator node.

        Raises
        ------
        ValueError
            Names a value that makes no sense.
        """
        basket = Basket(
            position=tuple(parameters["basket_position"]),
            radius=parameters["basket_radius"],
            depth=parameters["basket_depth"],
            restitution=parameters["basket_restitution"],
        )
        own: dict[str, Any] = {
            one.name: parameters[one.name] for one in fields(cls) if one.name not in NO_PARAMETERS
        }
        each = {name: tuple(float(value) for value in own[name]) for name in OF_EACH_JOINT}
        return cls(
            basket=basket, limits=SafetyLimits.from_parameters(parameters), **{**own, **each}
        )

    def __post_init__(self) -> None:
        for name in OF_EACH_JOINT:
            values = getattr(self, name)
            if len(values) != N_JOINTS or not np.isfinite(values).all():
                raise ValueError(f"{name} {values} is not {N_JOINTS} finite numbers")
        if not (min(self.mass_scale) > 0.0):
            raise ValueError(f"mass_scale {self.mass_scale} must be positive")
        if min(self.joint_stiffness) < 0.0 or (
            any(self.joint_stiffness) and not all(self.joint_stiffness)
        ):
            raise ValueError(
                f"joint_stiffness {self.joint_stiffness} must be positive for all joints, or 0"
                " for all"
            )

    @property
    def elastic(self) -> bool:
        return any(self.joint_stiffness)
