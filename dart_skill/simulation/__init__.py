"""The world that stands in for hardware: the arm, its hand, the ball, the basket, the cameras and the teacher."""

from dart_skill.simulation._basket import Basket
from dart_skill.simulation._board import Board
from dart_skill.simulation._changes import CHANGES, changed
from dart_skill.simulation._motion_capture import BasketWalls, Camera, Frame, LatencyQueue, MotionCapture, MotionCaptureConfig
from dart_skill.simulation._plant import Plant, PlantSettings, PlantState
from dart_skill.simulation._teacher import Person, Phase, Swing, Teacher

__all__ = [
    "Basket",
    "BasketWalls",
    "Board",
    "CHANGES",
    "Camera",
    "Frame",
    "LatencyQueue",
    "MotionCapture",
    "MotionCaptureConfig",
    "Person",
    "Phase",
    "Plant",
    "PlantSettings",
    "PlantState",
    "Swing",
    "Teacher",
    "changed",
]
