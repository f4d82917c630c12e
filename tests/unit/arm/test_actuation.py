"""Motors and friction: limits per motor written out, and friction as closed forms of a single
joint.
"""

import numpy as np
import pytest

from dart_skill.arm import Actuation, ArmModel, the_arm
from tests.interpreted import interpreted

WAM = the_arm()
MOTORS = WAM.motors
STEP = 0.002
PEAK = WAM.of_joints("peak_torque")
COULOMB, VISCOUS = WAM.of_joints("coulomb_friction"), WAM.of_joints("viscous_friction")
POSTURE = np.array([0.0, -0.9, 0.3, -0.75, 0.2, -0.35, 0.1])


@pytest.fixture(scope="module")
def actuation():
    return Actuation(WAM)


@pytest.fixture(scope="module")
def inertia():
    return ArmModel(ball_in_hand=True).mass_matrix(POSTURE)


STICTION_SPEED = 1e-3
"""Largest speed of a joint that is stuck [rad/s]."""


def one(joint, value):
    return np.where(np.arange(7) == joint, value, 0.0)


def alone(joint):
    """Speed of a joint, moving alone, at which its motors run without load."""
    column = np.abs(MOTORS.joint_to_motor[:, joint])
    return (MOTORS.no_load_speed[column > 0] / column[column > 0]).min()


def run(actuation, inertia, torque, velocity, duration):
    """Joint velocities (n + 1, 7) under constant torque and inertia."""
    velocities = [np.array(velocity, dtype=float)]
    for _ in range(round(duration / STEP)):
        velocities.append(
            velocities[-1] + STEP * actuation.acceleration(inertia, torque, velocities[-1], STEP)
        )
    return np.array(velocities)


def test_a_torque_within_all_limits_arrives(actuation):
    torque = 0.9 * PEAK * np.array([1, -1, 1, 1, 1, -1, 1]) / 2
    np.testing.assert_allclose(actuation.deliverable(torque, np.zeros(7)), torque, atol=1e-12)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1, 1])
def test_no_more_than_the_peak_torque_arrives(actuation, joint, sign):
    np.testing.assert_allclose(
        actuation.deliverable(one(joint, sign * 1e4), np.zeros(7)),
        one(joint, sign * PEAK[joint]),
        atol=1e-9,
    )


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1, 1])
def test_no_torque_is_left_at_the_no_load_speed_and_braking_beyond(actuation, joint, sign):
    asked, velocity = one(joint, sign * PEAK[joint]), one(joint, sign * alone(joint))
    np.testing.assert_allclose(
        actuation.deliverable(asked, velocity), 0.0, atol=1e-2 * PEAK[joint]
    )
    beyond = actuation.deliverable(asked, 1.1 * velocity)
    stall = np.abs(MOTORS.joint_to_motor[:, joint]) @ MOTORS.stall_torque
    assert sign * beyond[joint] == pytest.approx(-0.1 * stall, rel=0.02), (
        "the line of torque over speed goes on"
    )


@pytest.mark.parametrize("joint", range(7))
def test_against_the_motion_the_whole_peak_torque_is_there(actuation, joint):
    torque = actuation.deliverable(one(joint, -PEAK[joint]), one(joint, 0.95 * alone(joint)))
    assert torque[joint] == pytest.approx(-PEAK[joint])


@pytest.mark.parametrize("share", [0.8, 0.9, 0.97])
def test_torque_falls_linearly_to_the_no_load_speed(actuation, share):
    """J1 has a motor of its own: N tau_stall (1 - v / v0), where that is below the peak."""
    line = 42.0 * MOTORS.stall_torque[0] * (1 - share)
    expected = min(PEAK[0], line)
    assert actuation.deliverable(one(0, 1e3), one(0, share * alone(0)))[0] == pytest.approx(
        expected, rel=1e-6
    )


def test_shared_motors_are_limited_by_the_speeds_of_both_joints(actuation):
    """J2 at 2 rad/s alone keeps its torque; with J3 turning at -4 rad/s one of the two motors runs
    beyond its no-load speed.
    """
    alone_fast = actuation.deliverable(one(1, 100.0), one(1, 2.0))
    np.testing.assert_allclose(alone_fast, one(1, 100.0), atol=1e-9)
    velocity = one(1, 2.0) + one(2, -4.0)
    first, second = 28.25 * 2.0 + 16.8155 * 4.0, -28.25 * 2.0 + 16.8155 * 4.0
    assert first > MOTORS.no_load_speed[1] > abs(second)
    stall, slope = MOTORS.stall_torque[1], MOTORS.stall_torque[1] / MOTORS.no_load_speed[1]
    share = 100.0 / 28.25 / 2  # of either motor, one forwards and one backwards
    motor = np.clip(
        [share, -share],
        -stall - slope * np.array([first, second]),
        stall - slope * np.array([first, second]),
    )
    expected = one(1, 28.25 * (motor[0] - motor[1])) + one(2, -16.8155 * (motor[0] + motor[1]))
    delivered = actuation.deliverable(one(1, 100.0), velocity)
    np.testing.assert_allclose(delivered, expected, atol=1e-9)
    assert delivered[1] < 99.0 and abs(delivered[2]) > 1.0, (
        "the limit of one motor shows at both joints"
    )


def test_shorted_motors_brake(actuation):
    rng = np.random.default_rng(0)
    for velocity in rng.normal(size=(20, 7)):
        torque = actuation.braking(velocity)
        assert torque @ velocity < 0
        np.testing.assert_allclose(actuation.braking(-velocity), -torque)
    expected = -(42.0**2) * MOTORS.stall_torque[0] / MOTORS.no_load_speed[0] * 0.1
    assert actuation.braking(one(0, 0.1))[0] == pytest.approx(expected)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("share", [-0.95, 0.5, 0.95])
def test_a_joint_under_less_than_its_coulomb_torque_stays(actuation, inertia, joint, share):
    own = np.diag(np.diag(inertia))
    velocity = run(actuation, own, one(joint, share * COULOMB[joint]), np.zeros(7), 1.0)
    assert np.abs(velocity).max() < STICTION_SPEED, np.abs(velocity).max(axis=0)


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_joint_above_its_coulomb_torque_moves_as_newton_says(actuation, inertia, joint, sign):
    """M dv/dt = tau - c - d v from rest: v = (tau - c) / d (1 - exp(-d t / M))."""
    own, duration, torque = np.diag(np.diag(inertia)), 0.4, 3.0 * COULOMB[joint]
    velocity = run(actuation, own, one(joint, sign * torque), np.zeros(7), duration)[-1, joint]
    mass, damping = own[joint, joint], VISCOUS[joint]
    expected = sign * (torque - COULOMB[joint]) / damping * -np.expm1(-damping * duration / mass)
    assert velocity == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("joint", range(7))
def test_a_coasting_joint_stops_where_friction_has_used_up_its_motion(actuation, inertia, joint):
    """Angle until rest from v0: M / d (v0 - c / d log(1 + d v0 / c))."""
    own, start = np.diag(np.diag(inertia)), 1.0
    angle = STEP * run(actuation, own, np.zeros(7), one(joint, start), 2.0)[:, joint].sum()
    mass, damping, coulomb = own[joint, joint], VISCOUS[joint], COULOMB[joint]
    expected = mass / damping * (start - coulomb / damping * np.log1p(damping * start / coulomb))
    assert angle == pytest.approx(expected, abs=2 * STEP * start + 0.02 * expected)


def test_friction_never_turns_a_motion_round(actuation, inertia):
    """Joint by joint, with the inertia of each alone; from any speed to rest."""
    own, rng = np.diag(np.diag(inertia)), np.random.default_rng(2)
    for start in rng.normal(0.0, [1.0], (20, 7)) * rng.choice([1e-3, 0.05, 1.0, 4.0], (20, 7)):
        velocity = run(actuation, own, np.zeros(7), start, 0.2)
        assert (velocity * np.sign(start) >= 0).all()
        assert (np.diff(np.abs(velocity), axis=0) <= 0).all()


def test_compiled_and_interpreted_have_the_same_bits():
    plain, rng = interpreted("dart_skill.arm._actuation"), np.random.default_rng(0)
    for stiction in (0.0, 0.3):
        pair = [
            kind(WAM, friction_scale=1.3, motor_scale=0.8, stiction=stiction)
            for kind in (Actuation, plain.Actuation)
        ]
        for _ in range(20):
            torque, velocity = 80.0 * rng.standard_normal(7), 3.0 * rng.standard_normal(7)
            inertia = ArmModel(WAM).mass_matrix(rng.standard_normal(7))
            ours, theirs = (
                [one.deliverable(torque, velocity), one.braking(velocity), one.damping(velocity)]
                for one in pair
            )
            ours, theirs = (
                [*done, one.acceleration(inertia, torque, velocity, STEP)]
                for done, one in zip((ours, theirs), pair, strict=True)
            )
            np.testing.assert_array_equal(ours, theirs)
