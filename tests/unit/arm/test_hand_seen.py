"""Where the hand is seen, from where the arm takes it to be."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ARM_MEMORY, FILTER_TIME, HandSeen, RestTakenOut

NS = 1_000_000_000
UNTURNED = np.array([0.0, 0.0, 0.0, 1.0])
OFF = np.array([0.004, -0.003, 0.006])


def looked(until, off=lambda time: OFF, late=0.02, noise=0.0, speed=0.5):
    """An arm at 500 Hz whose hand moves along x, and cameras at 100 Hz that see it `off` elsewhere
    (3,) and say so `late` [s].
    """
    seen, rng, beside = HandSeen("hand"), np.random.default_rng(0), []
    for k in range(round(until * 500)):
        time = 0.002 * k
        there = np.array([speed * time, 0.0, 0.0])
        beside.append(seen.offset(round(time * NS), there, np.eye(3)).shift)
        then = time - late
        if k % 5 == 0 and then >= 0.0:
            seen.see(
                "hand",
                round(then * NS),
                np.array([speed * then, 0.0, 0.0]) + off(then) + noise * rng.standard_normal(3),
                UNTURNED,
            )
    return np.array(beside)


@pytest.mark.parametrize("late", [0.0, 0.006, 0.05])
def test_poses_that_come_late_are_compared_with_the_arm_of_then(late):
    assert looked(0.5, late=late)[-1] == pytest.approx(OFF, abs=1e-9)


def test_poses_that_are_stamped_late_wait_for_the_arm():
    """Stamps of receipt, of cameras whose poses come sooner than the arm's next state."""
    assert looked(0.5, late=-0.006)[-1] == pytest.approx(OFF, abs=1e-9)


def test_poses_of_another_time_are_not_kept():
    seen = HandSeen("hand")
    for k in range(200):
        seen.offset(k * 2_000_000, np.zeros(3), np.eye(3))
        seen.see("hand", NS * 1000 + k * 2_000_000, 9.0 * OFF, UNTURNED)
    for k in range(200, 400):
        seen.see("hand", k * 2_000_000, OFF, UNTURNED)
        said = seen.offset(k * 2_000_000, np.zeros(3), np.eye(3))
    assert said.shift == pytest.approx(OFF)


def test_the_first_pose_counts_fully_and_later_ones_are_averaged():
    beside = looked(4.0, noise=1e-3)
    assert not beside[:10].any() and np.linalg.norm(beside[100] - OFF) < 5e-3
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
    seen.see("hand", NS, OFF, UNTURNED)
    for k in range(100):
        seen.offset(NS + k * 2_000_000, np.zeros(3), np.eye(3))
    for stamp in (NS - 1, NS + round(0.19 * NS) - round(ARM_MEMORY * NS) - 3_000_000, 2 * NS):
        seen.see("hand", stamp, OFF, UNTURNED)
    assert not seen.offset(NS + 200_000_000, np.zeros(3), np.eye(3)).shift.any()


def test_a_pose_that_comes_again_changes_nothing():
    seen = HandSeen("hand")
    for k in range(20):
        seen.offset(k * 2_000_000, np.zeros(3), np.eye(3))
    seen.see("hand", 20_000_000, OFF, UNTURNED)
    seen.see("hand", 20_000_000, 9.0 * OFF, UNTURNED)
    looked = [seen.offset(k * 2_000_000, np.zeros(3), np.eye(3)).shift for k in range(20, 120)]
    assert looked[-1] == pytest.approx(OFF)


def turned(seen, rotvec, states=300):
    """What is said of the turn at the end, of an arm at rest that is seen turned all the time."""
    for k in range(states):
        said = seen.offset(k * 2_000_000, np.zeros(3), np.eye(3))
        if k > 10 and k % 5 == 0:
            turn = Rotation.from_rotvec(rotvec).as_quat()
            seen.see("hand", k * 2_000_000, np.zeros(3), turn)
    return said


def test_a_turn_is_told_as_a_rotation_vector():
    turn = np.array([0.02, -0.03, 0.01])
    assert turned(HandSeen("hand"), turn).turn == pytest.approx(turn, abs=1e-6)


def test_the_correction_is_limited_in_size_and_rate():
    beside = looked(3.0, off=lambda time: np.array([0.5, 0.0, 0.0]), late=0.0)
    steps = np.linalg.norm(np.diff(beside, axis=0), axis=1)
    assert steps.max() == pytest.approx(0.05 * 0.002) and beside[-1] == pytest.approx([0.03, 0, 0])
    said = turned(HandSeen("hand"), np.array([0.0, 0.0, 1.0]), states=1000)
    assert said.turn == pytest.approx([0.0, 0.0, 0.1])
    eyes = HandSeen("hand", largest=(np.inf, np.inf))
    assert turned(eyes, np.array([0.0, 0.0, 0.3]), states=1000).turn == pytest.approx(
        [0.0, 0.0, 0.3]
    )


def test_a_body_that_was_seen_and_is_not_any_more_is_lost_and_its_offset_stays():
    seen = HandSeen("hand")
    turned(seen, np.array([0.0, 0.0, 0.02]))
    last = 295 * 2_000_000
    assert not HandSeen("hand").is_lost(NS) and not seen.is_lost(last + 90_000_000)
    assert seen.is_lost(last + 110_000_000)
    later = seen.offset(last + 400_000_000, np.zeros(3), np.eye(3))
    assert later.turn == pytest.approx([0.0, 0.0, 0.02], abs=1e-6)


def test_what_friction_leaves_of_the_distance_is_taken_out():
    """A hand that stays 3 mm and 0.01 rad behind what it is asked."""
    rest, behind = RestTakenOut(), np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.01])
    aimed = np.zeros(6)
    for k in range(1000):
        aimed = np.concatenate(rest.at(0.002 * k, -aimed - behind))
    assert -aimed == pytest.approx(behind, rel=1e-2)


def test_a_hand_that_something_holds_is_not_pulled_harder_and_harder():
    rest = RestTakenOut()
    for k in range(5000):
        said = np.concatenate(rest.at(0.002 * k, np.array([0.02, 0.0, 0.0, 0.0, 0.0, 0.0])))
    assert not said.any()
    for k in range(5000, 10000):
        said = np.concatenate(rest.at(0.002 * k, np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])))
    assert said[0] == pytest.approx(0.015)


def test_poses_of_other_bodies_say_nothing():
    seen = HandSeen("hand")
    for k in range(20):
        seen.offset(k * 2_000_000, np.zeros(3), np.eye(3))
    seen.see("cup", 20_000_000, OFF, UNTURNED)
    assert not seen.newest_ns
