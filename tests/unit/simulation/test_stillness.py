"""A world rests when neither joints nor bodies move; the smallest move, and whoever asks for
something, wakes it.
"""

import numpy as np

from dart_skill.simulation import Stillness

SECOND = 1_000_000_000
STILL = np.zeros(7)


def bodies(x=0.0):
    return {"ball": (np.array([x, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]))}


def test_it_is_still_since_the_last_move():
    world = Stillness()
    for second in range(1, 6):
        world.look(second * SECOND, STILL, bodies(0.1 * min(second, 3)))
    assert world.since_ns == 3 * SECOND


def test_a_joint_a_body_that_comes_and_a_call_wake_it():
    world = Stillness()
    world.look(SECOND, STILL, bodies())
    world.look(2 * SECOND, STILL + 0.02, bodies())
    assert world.since_ns == 2 * SECOND
    world.look(3 * SECOND, STILL, {})
    assert world.since_ns == 3 * SECOND
    world.wake(4 * SECOND)
    assert world.since_ns == 4 * SECOND


def test_it_is_looked_at_ten_times_a_second_and_anew_when_time_was_set_back():
    world = Stillness()
    world.look(5 * SECOND, STILL, bodies())
    assert not world.is_due(5 * SECOND + 99_000_000) and world.is_due(5 * SECOND + 100_000_000)
    assert not world.is_due(SECOND) and world.since_ns == SECOND
