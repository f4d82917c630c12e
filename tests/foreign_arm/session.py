"""A laboratory and the hardware layout side by side, and lessons in it; the places of its baskets."""

from contextlib import contextmanager

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from tests.foreign_arm.driver import Driver
from tests.foreign_arm.laboratory import Laboratory
from tests.foreign_arm.outsider import Outsider, hardware_graph

RIM = 0.40


def rim(distance, azimuth):
    """Centre of a basket's rim (3,) at a distance [m] and an azimuth [rad]."""
    return np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), RIM])


LESSONS = [
    rim(*place)
    for place in ((1.6, -0.5), (2.1, -0.3), (1.85, 0.0), (1.55, 0.25), (2.15, 0.4), (1.8, 0.6))
]
TARGETS = [rim(*place) for place in ((1.8, -0.35), (2.0, 0.2), (1.7, 0.45))]


@contextmanager
def session(folder, seed, lockstep):
    """A driver, somebody at a terminal, and the hardware layout beside them; the arm is free to be
    guided.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        with hardware_graph(folder):
            executor = SingleThreadedExecutor()
            outsider = Outsider(executor, Driver(executor, Laboratory.drawn(seed), lockstep))
            outsider.wait_for_graph()
            assert outsider.call("/commander/release_arm", data=True).success
            yield outsider
    finally:
        rclpy.try_shutdown()


def teach(outsider, places, attempts=3):
    """One hit at each basket; the demonstrations that the recorder cut out."""
    demonstrations = []
    for place in places:
        for _ in range(attempts):
            hit, stopped = outsider.teach(place)
            if hit:
                break
        assert hit, f"the person missed the basket at {place} {attempts} times"
        assert stopped.success, stopped.message
        demonstrations.append(stopped.demonstration)
    return demonstrations
