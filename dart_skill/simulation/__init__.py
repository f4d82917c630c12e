"""The world that stands in for hardware: the arm, its hand, what it works with, the cameras, and
the people who guide it.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.simulation._arm_geometry import ArmGeometry
    from dart_skill.simulation._basket import Basket
    from dart_skill.simulation._board import Board
    from dart_skill.simulation._bullet import connect
    from dart_skill.simulation._carrier import Carrier, Carrying
    from dart_skill.simulation._conveyor import Belt, Conveyor
    from dart_skill.simulation._guiding import Guiding, Holder
    from dart_skill.simulation._motion_capture import (
        BasketWalls,
        Camera,
        Frame,
        LatencyQueue,
        MotionCapture,
        MotionCaptureConfig,
        Sample,
    )
    from dart_skill.simulation._plant import Plant, PlantState
    from dart_skill.simulation._plant_settings import PlantSettings
    from dart_skill.simulation._pulled_hand import PulledHand, Pulling
    from dart_skill.simulation._reacher import Reacher, Reaching
    from dart_skill.simulation._stillness import Stillness
    from dart_skill.simulation._teacher import Person, Phase, Swing, Teacher
    from dart_skill.simulation._workbench import Bench, Workbench
    from dart_skill.simulation._worlds import CHANGES, WORLDS, changed, make_world
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_arm_geometry": "ArmGeometry",
            "_basket": "Basket",
            "_board": "Board",
            "_bullet": "connect",
            "_carrier": "Carrier Carrying",
            "_conveyor": "Belt Conveyor",
            "_guiding": "Guiding Holder",
            "_motion_capture": (
                "BasketWalls Camera Frame LatencyQueue MotionCapture MotionCaptureConfig Sample"
            ),
            "_plant": "Plant PlantState",
            "_plant_settings": "PlantSettings",
            "_pulled_hand": "PulledHand Pulling",
            "_reacher": "Reacher Reaching",
            "_stillness": "Stillness",
            "_teacher": "Person Phase Swing Teacher",
            "_workbench": "Bench Workbench",
            "_worlds": "CHANGES WORLDS changed make_world",
        },
    )

__all__ = [
    "ArmGeometry",
    "Basket",
    "BasketWalls",
    "Belt",
    "Bench",
    "Board",
    "CHANGES",
    "Camera",
    "Carrier",
    "Carrying",
    "Conveyor",
    "Frame",
    "Guiding",
    "Holder",
    "LatencyQueue",
    "MotionCapture",
    "MotionCaptureConfig",
    "Person",
    "Phase",
    "Plant",
    "PlantSettings",
    "PlantState",
    "PulledHand",
    "Pulling",
    "Reacher",
    "Reaching",
    "Sample",
    "Stillness",
    "Swing",
    "Teacher",
    "WORLDS",
    "Workbench",
    "changed",
    "connect",
    "make_world",
]
