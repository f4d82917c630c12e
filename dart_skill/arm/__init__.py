"""The WAM: its description, its URDF, the controller's model of it, and the impedance law."""

from typing import TYPE_CHECKING

from dart_skill.arm._command import (
    REST_SPEED,
    ArmState,
    Command,
    HeldCommand,
    Speed,
    all_finite,
    check_command,
)
from dart_skill.arm._description import DART, HeldBall, WamDescription, wam_description, with_box
from dart_skill.arm._motion_plan import Gains, GainsOverTime, GripEvent, HandPath, MotionPlan, Pace
from dart_skill.arm._registration import (
    KnownRegistration,
    Registration,
    load_registration,
    save_registration,
)
from dart_skill.arm._throw_plan import ThrowPlan, same_plan
from dart_skill.arm._transforms import Transform, fixed_transforms, joint_transforms
from dart_skill.arm._urdf import write_urdf
from dart_skill.common.constants import Grip
from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.arm._actuation import Actuation
    from dart_skill.arm._commander import (
        STRETCHED,
        Commander,
        CommanderSettings,
        Mode,
        PlanRefused,
    )
    from dart_skill.arm._effort_bridge import BridgePhase, BridgeSettings, EffortBridge
    from dart_skill.arm._guide import Fingers, Guidance, Guide, PlanGuide, References, paced
    from dart_skill.arm._hand_eye import (
        OrientationFit,
        PositionFit,
        fit_orientations,
        fit_positions,
        similarity,
        turn_angles,
    )
    from dart_skill.arm._impedance import (
        Impedance,
        PoseGains,
        Reference,
        attractor_acceleration,
        minimum_jerk,
        rotation_error,
    )
    from dart_skill.arm._model import ArmModel, HandState
    from dart_skill.arm._registration_fit import (
        RegistrationFit,
        Sightings,
        fit_registration,
        measure_registration,
    )
    from dart_skill.arm._safety import SafetyLimits, SafetyModule, check_push
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_actuation": "Actuation",
            "_commander": "STRETCHED Commander CommanderSettings Mode PlanRefused",
            "_effort_bridge": "BridgePhase BridgeSettings EffortBridge",
            "_guide": "Fingers Guidance Guide PlanGuide References paced",
            "_hand_eye": (
                "OrientationFit PositionFit fit_orientations fit_positions similarity turn_angles"
            ),
            "_impedance": (
                "Impedance PoseGains Reference attractor_acceleration minimum_jerk rotation_error"
            ),
            "_model": "ArmModel HandState",
            "_registration_fit": (
                "RegistrationFit Sightings fit_registration measure_registration"
            ),
            "_safety": "SafetyLimits SafetyModule check_push",
        },
    )

__all__ = [
    "Actuation",
    "ArmModel",
    "ArmState",
    "HeldBall",
    "DART",
    "BridgeSettings",
    "Command",
    "Commander",
    "CommanderSettings",
    "EffortBridge",
    "Fingers",
    "Gains",
    "GainsOverTime",
    "Grip",
    "GripEvent",
    "Guidance",
    "Guide",
    "HandPath",
    "HandState",
    "HeldCommand",
    "Impedance",
    "KnownRegistration",
    "Mode",
    "MotionPlan",
    "Pace",
    "PlanGuide",
    "BridgePhase",
    "OrientationFit",
    "PlanRefused",
    "PositionFit",
    "Registration",
    "RegistrationFit",
    "PoseGains",
    "Reference",
    "References",
    "REST_SPEED",
    "STRETCHED",
    "SafetyLimits",
    "SafetyModule",
    "Sightings",
    "Speed",
    "ThrowPlan",
    "Transform",
    "WamDescription",
    "all_finite",
    "attractor_acceleration",
    "check_command",
    "check_push",
    "fit_orientations",
    "fit_positions",
    "fit_registration",
    "fixed_transforms",
    "joint_transforms",
    "load_registration",
    "measure_registration",
    "minimum_jerk",
    "paced",
    "rotation_error",
    "same_plan",
    "similarity",
    "save_registration",
    "turn_angles",
    "wam_description",
    "with_box",
    "write_urdf",
]
