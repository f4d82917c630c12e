"""Settings of the commander, and whether a plan may be carried out with them: which registration
counts for it, and whether the arm can follow it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from dart_skill.arm._command import Speed
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._impedance import rotation_error
from dart_skill.arm._inverse import nearer, off_by
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import MotionPlan
from dart_skill.arm._registration import Registration
from dart_skill.arm._safety import SafetyLimits
from dart_skill.arm._trajectory_settings import TrajectorySettings
from dart_skill.common.configuration import node_parameters
from dart_skill.common.quaternions import CONJUGATE, matrices, product, to_vectors, unit

STRETCHED = 0.005
"""Nearer than this to its full reach the arm cannot follow a plan: the elbow may turn over [m]."""
EVERY = 0.02
"""Postures along a path are looked for so far from each other [s]."""
TOO_FAR = 0.02
"""A hand that is farther from its path cannot follow it [m]."""
TOO_TURNED = 0.2
"""The same of its orientation [rad]."""
TRACKING = ("joints", "hand", "none")
"""What may keep the arm on its motion."""
OUTPUTS = ("torque", "trajectory")
"""What the arm's driver may take."""
MOST_OFFSET = 0.05
"""Distance between the places of the hand by the registration of a plan and by the measured one
above which the plan is refused [m].
"""
MOST_TURN = 0.15
"""Turn of the hand above which the plan is refused [rad]."""


PARTS: dict[str, type[SafetyLimits] | type[TrajectorySettings]] = {
    "limits": SafetyLimits,
    "trajectory": TrajectorySettings,
}
"""Settings of the commander that are settings of their own, from the same parameters."""


@dataclass(frozen=True)
class CommanderSettings:
    """Gains and limits; each is a parameter of the commander node, and its value stands in
    config/commander.yaml.

    Parameters
    ----------
    tracking_stiffness, tracking_damping
        Pull towards the predicted motion on top of the attractor's, per unit mass [1/s^2], [1/s].
    tracking_stiffness_rotation, tracking_damping_rotation
        The same for orientation [1/s^2], [1/s].
    tracking
        What keeps the arm on the motion that (7.19) predicts: "joints", a servo of the joints, the
        motion's torques fed forward; "hand", a second pull of the hand; "none", the law alone.
    friction_compensation
        Share of the identified joint friction, 0 to 1.
    approach_speed
        Fastest joint on the way to the start of a throw [rad/s].
    settle_speed, settle_time
        The arm rests below this joint speed [rad/s], for so long before a throw [s].
    settle_limit
        The throw begins even if the arm does not rest for so long [s].
    farthest_error
        Distance of the hand from the plan at which a throw is stopped [m].
    longest_gap
        Between two states of the arm; after a longer one the arm is held where it is found [s].
    follow_time
        The hand stays on the plan so long after the release [s]. Then joint damping brings the arm
        to rest: the plan beyond is of no use to the ball, and leads through the stretched arm.
    limits
        Of the arm, from config/limits.yaml.
    output
        What the arm's driver takes: "torque", or "trajectory" of the joints.
    trajectory
        How a controller of trajectories is used.
    """

    tracking: str
    tracking_stiffness: float
    tracking_damping: float
    tracking_stiffness_rotation: float
    tracking_damping_rotation: float
    friction_compensation: float
    approach_speed: float
    settle_speed: float
    settle_time: float
    settle_limit: float
    farthest_error: float
    longest_gap: float
    follow_time: float
    limits: SafetyLimits
    output: str
    trajectory: TrajectorySettings

    def __post_init__(self) -> None:
        if self.output not in OUTPUTS:
            raise ValueError(f"output is '{self.output}': choose one of {', '.join(OUTPUTS)}")
        if self.tracking not in TRACKING:
            raise ValueError(f"tracking is '{self.tracking}': choose one of {', '.join(TRACKING)}")

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> "CommanderSettings":
        """Settings from the parameters of the commander node."""
        own = {f.name: parameters[f.name] for f in fields(cls) if f.name not in PARTS}
        parts: dict[str, Any] = {
            name: kind.from_parameters(parameters) for name, kind in PARTS.items()
        }
        return cls(**own, **parts)

    @classmethod
    def configured(cls, **changes: float | str) -> "CommanderSettings":
        """Settings of config/commander.yaml and limits.yaml, some of them changed.

        Raises
        ------
        KeyError
            Names what is no setting.
        """
        known = {f.name for kind in (cls, *PARTS.values()) for f in fields(kind)} - set(PARTS)
        if unknown := set(changes) - known:
            raise KeyError(f"{', '.join(sorted(unknown))}: no setting of the commander")
        return cls.from_parameters({**node_parameters("commander.yaml", "commander"), **changes})


class PlanRefused(ValueError):
    """The plan cannot be thrown; the message says which value breaks which limit."""


def registered(plan: MotionPlan, measured: Registration | None) -> MotionPlan:
    """The plan with the registration that counts, as of `agreed`."""
    return replace(
        plan,
        registration=agreed(plan.registration, measured, plan.path.position, plan.path.quaternion),
    )


def agreed(
    own: Registration, measured: Registration | None, position: np.ndarray, quaternion: np.ndarray
) -> Registration:
    """The measured registration if a plan has none of its own, else that.

    Demonstrations without joint states teach no registration, and one of before the cameras were
    moved is wrong.

    Parameters
    ----------
    position, quaternion
        Of the hand as the cameras shall see it (n, 3), (n, 4).

    Raises
    ------
    PlanRefused
        If they contradict each other.
    """
    if measured is None:
        return own
    if own.is_none:
        return measured
    (at, hand), (there, other) = (one.poses(position, quaternion) for one in (own, measured))
    offset = float(np.linalg.norm(at - there, axis=1).max())
    turn = float(np.linalg.norm(to_vectors(product(hand, other * CONJUGATE)), axis=1).max())
    if offset > MOST_OFFSET or turn > MOST_TURN:
        raise PlanRefused(
            f"the plan has the hand {offset:.3f} m and {turn:.2f} rad from where the registration"
            " file does: were cameras, base or body moved since it was measured, or the throws"
            " shown before? Measure again (dart-skill check arm), or teach again"
        )
    return own


def check_plan(plan: MotionPlan, settings: CommanderSettings, description: ArmDescription) -> None:
    """PlanRefused, with the value and the limit, if the plan leaves the joints' range or the
    hand's speed limit.
    """
    lower, upper = description.ends
    check_range("the start posture", plan.start_posture, lower, upper)
    speed = float(np.linalg.norm(plan.path.velocity[:, :3], axis=1).max())
    fastest = (
        settings.limits.fastest_hand if plan.speed == Speed.THROW else settings.limits.careful_hand
    )
    if speed > fastest:
        raise PlanRefused(
            f"the plan moves the hand at {speed:.2f} m/s; the limit of a {plan.what} is {fastest}"
            " m/s: choose a nearer target"
        )
    if why := stretched(plan, description):
        raise PlanRefused(
            f"{why}: choose a nearer target, or drop what was shown with a straight elbow, and"
            " show it with a bent one"
        )
    model = ArmModel(description)
    position, rotation = model.hand_pose(plan.start_posture)
    offset = float(np.linalg.norm(position - plan.path.position[0]))
    turn = float(np.linalg.norm(rotation_error(matrices(unit(plan.path.quaternion[0])), rotation)))
    if offset > 0.05 or turn > 0.3:
        raise PlanRefused(
            f"the start posture holds the hand {offset:.3f} m and {turn:.2f} rad from where the"
            " path begins"
        )


def stretched(plan: MotionPlan, description: ArmDescription) -> str:
    """How far a plan, as the arm has it, goes beyond what it can follow with a bent elbow, in
    words; empty if it does not.
    """
    swing = plan.path.position[plan.path.time <= plan.end]
    farthest = float(np.linalg.norm(swing - description.shoulder, axis=1).max())
    if farthest <= description.reach - STRETCHED:
        return ""
    return (
        f"the plan takes the hand {farthest:.3f} m from the shoulder; the arm is stretched at"
        f" {description.reach:.3f} m"
    )


def unfollowable(plan: MotionPlan, description: ArmDescription) -> str:
    """Where the joints' ranges or the speeds of their motors do not let the hand follow a plan, as
    the arm has it, in words; empty if they do.

    The joints go from posture to posture along the path, by steps of damped least squares.
    """
    model, path = ArmModel(description), plan.path
    lower, upper = description.ends
    fastest = description.of_joints("no_load_speed")
    posture, rotations = plan.start_posture, matrices(unit(path.quaternion))
    before, time = posture, 0.0
    for k in np.searchsorted(path.time, np.arange(0.0, plan.end, EVERY)).tolist():
        for _ in range(2):
            off = off_by(model, posture, path.position[k], rotations[k])
            posture = nearer(model, posture, off).clip(lower, upper)
        off = off_by(model, posture, path.position[k], rotations[k])
        away, turn = float(np.linalg.norm(off[:3])), float(np.linalg.norm(off[3:]))
        if away > TOO_FAR or turn > TOO_TURNED:
            return (
                f"the joints' ranges do not let the hand follow the plan: after {path.time[k]:.1f} s"
                f" it would be {100 * away:.0f} cm and {np.degrees(turn):.0f} degrees off"
            )
        if k and (share := np.abs(posture - before) / (path.time[k] - time) / fastest).max() > 1.0:
            j = int(share.argmax())
            return (
                f"the plan turns {description.joints[j].name} at"
                f" {share[j] * fastest[j]:.1f} rad/s after {path.time[k]:.1f} s; its motor makes"
                f" {fastest[j]:.1f} rad/s"
            )
        before, time = posture, float(path.time[k])
    return ""


def check_range(what: str, posture: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
    """PlanRefused unless joint angles (n,) are between two others, with the joint that is not."""
    outside = (posture < lower) | (posture > upper)
    if outside.any():
        j = int(np.argmax(outside))
        raise PlanRefused(
            f"{what} has j{j + 1} at {posture[j]:.2f} rad, outside {lower[j]:.2f} to"
            f" {upper[j]:.2f}"
        )
