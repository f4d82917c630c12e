"""Where the hand is seen, from where the arm takes it to be."""

import numpy as np
import pytest

from dart_skill.skills.execution import ARM_MEMORY, FILTER_TIME, HandSeen

NS = 1_000_000_000
OFF = np.array([0.004, -0.003, 0.006])


def looked(until, off=lambda time: OFF, late=0.02, noise=0.0, speed=0.5):
    """An arm at 500 Hz whose hand moves along x, and cameras at 100 Hz that see it `off` elsewhere
    (3,) and say so `late` [s].
    """
    seen, rng, beside = HandSeen("hand"), np.random.default_rng(0), []
    for k in range(round(until * 500)):
        time = 0.002 * k
        beside.append(seen.beside(round(time * NS), np.array([speed * time, 0.0, 0.0])))
        then = time - late
        if k % 5 == 0 and then >= 0.0:
            seen.see(
                round(then * NS),
                np.array([speed * then, 0.0, 0.0]) + off(then) + noise * rng.standard_normal(3),
            )
    return np.array(beside)


@pytest.mark.parametrize("late", [0.0, 0.006, 0.05])
def test_poses_that_come_late_are_compared_with_the_arm_of_then(late):
    assert looked(0.5, late=late)[-1] == pytest.approx(OFF, abs=1e-9)


def test_the_first_pose_counts_fully_and_later_ones_are_averaged():
    beside = looked(4.0, noise=1e-3)
    assert not beside[:10].any() and np.linalg.norm(beside[20] - OFF) < 5e-3
    assert np.std(beside[500:], axis=0) == pytest.approx(
        np.full(3, 1e-3 * np.sqrt(0.01 / (2.0 * FILTER_TIME))), rel=0.6
    )


def test_what_changes_is_followed_with_the_time_constant():
    rate = np.array([0.01, 0.0, 0.0])
    assert looked(3.0, off=lambda time: time * rate, late=0.0)[-1] == pytest.approx(
        (3.0 - FILTER_TIME) * rate, abs=3e-4
    )


def test_a_pose_of_before_the_arm_was_heard_or_of_long_ago_says_nothing():
    seen = HandSeen("hand")
    seen.see(NS, OFF)
    for k in range(100):
        seen.beside(NS + k * 2_000_000, np.zeros(3))
    for stamp in (NS - 1, NS + round(0.19 * NS) - round(ARM_MEMORY * NS) - 3_000_000, 2 * NS):
        seen.see(stamp, OFF)
    assert not seen.beside(NS + 200_000_000, np.zeros(3)).any()


def test_a_pose_that_comes_again_changes_nothing():
    seen = HandSeen("hand")
    for k in range(20):
        seen.beside(k * 2_000_000, np.zeros(3))
    seen.see(20_000_000, OFF)
    seen.see(20_000_000, 9.0 * OFF)
    assert seen.beside(40_000_000, np.zeros(3)) == pytest.approx(OFF)
