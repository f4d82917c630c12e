"""A laboratory and the hardware layout side by side, for one task."""

from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from tests.foreign_arm.driver import Driver
from tests.foreign_arm.laboratory import Laboratory
from tests.foreign_arm.outsider import Outsider, hardware_graph
from tests.foreign_arm.person import Person
from tests.foreign_arm.plant import Plant, Scene


@dataclass(frozen=True)
class Task:
    """What differs from one skill to the next.

    Parameters
    ----------
    skill
        Its name.
    scene, person, outsider
        What there is beside the arm, who guides it, and who sits at the terminal.
    posture
        In which the arm stands at the beginning (7,) [rad].
    """

    skill: str
    scene: type[Scene]
    person: type[Person]
    outsider: type[Outsider]
    posture: np.ndarray


@contextmanager
def session(folder, task, seed, lockstep):
    """A driver, somebody at a terminal, and the hardware layout beside them; the arm is free to be
    guided.
    """
    laboratory = Laboratory.drawn(seed)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with hardware_graph(folder, task.skill) as graph:
            executor = SingleThreadedExecutor()
            plant = Plant(laboratory, task.posture, task.scene())
            driver = Driver(executor, plant, task.person(laboratory, plant), lockstep)
            outsider = task.outsider(executor, driver)
            outsider.wait_for_graph(graph)
            assert outsider.call("/commander/release_arm", data=True).success
            yield outsider
    finally:
        rclpy.try_shutdown()
