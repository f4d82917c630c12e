"""The safety module: each limit by itself, warning before fault, and a fault that stays."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import (
    ArmModel,
    Command,
    SafetyLimits,
    SafetyModule,
    Speed,
    check_push,
    the_arm,
)
from tests.interpreted import interpreted

LIMITS = SafetyLimits.configured()
RESTING = np.array([0.0, -1.0, 0.0, 0.75, 0.0, -0.6, 0.0])
STILL = np.zeros(7)
MODEL = ArmModel()


def looked(
    position=RESTING,
    velocity=STILL,
    torque=STILL,
    speed=Speed.CAREFUL,
    limits=LIMITS,
    patience=1.0,
):
    """A module that has looked once."""
    module = SafetyModule(limits, patience=patience)
    module.look(
        np.asarray(position, float), np.asarray(velocity, float), np.asarray(torque, float), speed
    )
    return module


def turning(hand):
    """Joint speeds (7,) with which the first joint moves the hand at a speed [m/s], and with it
    the elbow more slowly.
    """
    velocity = np.zeros(7)
    velocity[0] = hand / np.linalg.norm(MODEL.jacobian(RESTING)[:3, 0])
    return velocity


def test_speeds_are_those_of_the_jacobians():
    rng = np.random.default_rng(3)
    for _ in range(20):
        q, qd = rng.uniform(-1, 1, 7), rng.uniform(-3, 3, 7)
        place, hand, elbow = MODEL.speeds(q, qd)
        assert place == pytest.approx(MODEL.hand_pose(q)[0].tolist())
        assert hand == pytest.approx(np.linalg.norm((MODEL.jacobian(q) @ qd)[:3]))
        assert elbow == pytest.approx(np.linalg.norm(MODEL.elbow(q)[1] @ qd))


def test_the_hand_may_be_as_fast_as_its_level_says():
    limits = replace(LIMITS, careful_elbow=10.0, fastest_elbow=10.0)
    for speed, most in ((Speed.CAREFUL, LIMITS.careful_hand), (Speed.THROW, LIMITS.fastest_hand)):
        assert (
            (quiet := looked(velocity=turning(0.85 * most), speed=speed, limits=limits)).fault
            == quiet.warning
            == ""
        )
        near = looked(velocity=turning(0.95 * most), speed=speed, limits=limits)
        assert near.fault == "" and "the hand moves at" in near.warning
        assert (
            f"the limit of {'a throw' if speed else 'an arm that does not throw'} is {most:g} m/s"
            in (looked(velocity=turning(1.05 * most), speed=speed, limits=limits).fault)
        )


def test_the_elbow_has_a_limit_of_its_own():
    module = looked(velocity=[0.0, 2.0, 0, 0, 0, 0, 0], limits=replace(LIMITS, careful_hand=10.0))
    assert module.fault.startswith("the elbow moves at 1.1") and "1 m/s" in module.fault


def test_the_arm_s_own_module_is_more_patient():
    velocity = turning(1.05 * LIMITS.careful_hand)
    assert (
        looked(velocity=velocity, limits=replace(LIMITS, careful_elbow=10.0), patience=1.1).fault
        == ""
    )
    assert looked(velocity=velocity, limits=replace(LIMITS, careful_elbow=10.0)).fault


@pytest.mark.parametrize("joint", range(7))
def test_each_joint_has_its_torque_and_its_range(joint):
    description = the_arm()
    torque, position = np.zeros(7), RESTING.copy()
    torque[joint] = -1.01 * description.of_joints("peak_torque")[joint]
    assert looked(torque=torque).fault.startswith(f"j{joint + 1} is asked for -")
    wide = replace(LIMITS, workspace_low=(-3.0, -3.0, -3.0), workspace_high=(3.0, 3.0, 3.0))
    position[joint] = description.of_joints("upper")[joint] + 0.04
    assert looked(position, limits=wide).fault == ""
    position[joint] += 0.02
    assert (
        f"j{joint + 1} is at {position[joint]:.3f} rad, 0.060 rad beyond its range"
        in looked(position, limits=wide).fault
    )


def test_the_hand_stays_in_its_box():
    x, y, z = MODEL.hand_pose(RESTING)[0]
    for axis, at in zip("xyz", (x, y, z), strict=True):
        low = [-2.0, -2.0, -2.0]
        low["xyz".index(axis)] = at + 0.01
        assert (
            f"the hand is at {axis} {at:.2f} m, outside"
            in looked(limits=replace(LIMITS, workspace_low=tuple(low))).fault
        )


def test_a_fault_stays_until_it_is_reset():
    module = looked(velocity=turning(9.0))
    fault = module.fault
    assert fault and module.look(RESTING, STILL, STILL, Speed.THROW) == fault
    module.reset()
    assert module.look(RESTING, STILL, STILL, Speed.CAREFUL) == module.warning == ""


def test_what_is_not_finite_is_a_fault():
    assert "not finite" in looked(velocity=np.full(7, np.nan)).fault
    for odd in (np.nan, np.inf):
        torque = np.zeros(7)
        torque[4] = odd
        assert "not finite" in looked(torque=torque).fault


def test_a_command_within_the_limits_is_left_alone():
    command = Command(5, np.array([10.0, 0, 0, 0, 1, 0]), np.ones(7))
    assert SafetyModule(LIMITS).limited(command, RESTING) is command


def test_a_command_is_weakened_to_what_gravity_leaves_of_the_limits():
    strongest, rng = the_arm().of_joints("peak_torque"), np.random.default_rng(1)
    for q in rng.uniform(-1.5, 1.5, (20, 7)):
        wrench, torque = rng.normal(0.0, 80.0, 6), rng.normal(0.0, 5.0, 7)
        room = np.maximum(0.0, strongest - np.abs(MODEL.gravity_torque(q)))
        share = min(1.0, (room / np.abs(torque + MODEL.jacobian(q).T @ wrench)).min())
        limited = SafetyModule(replace(LIMITS, torque_share=1.0)).limited(
            Command(5, wrench, torque), q
        )
        np.testing.assert_allclose(limited.wrench, share * wrench, rtol=1e-9)
        np.testing.assert_allclose(limited.joint_torque, share * torque, rtol=1e-9)


def test_a_push_is_no_stronger_than_a_person():
    check_push(Command(0, np.array([150.0, 0, 0, 0, 0, 5.0])), LIMITS)
    for wrench, torque in (
        ([1e9, 0, 0, 0, 0, 0], 0.0),
        ([0, 0, 0, 0, 300.0, 0], 0.0),
        ([0, 0, 0, 0, 0, 0], 600.0),
    ):
        with pytest.raises(ValueError, match="no person pushes with"):
            check_push(
                Command(0, np.array(wrench, float), np.array([torque, 0, 0, 0, 0, 0, 0])), LIMITS
            )


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [("careful_hand", 0.0, "careful_hand"), ("patience", np.nan, "patience"), ("workspace_low", (1, 2), "workspace_low"),
     ("workspace_low", (2.0, 0.0, 0.0), "is empty")],
)  # fmt: skip
def test_limits_that_limit_nothing_are_refused_by_name(name, value, says):
    with pytest.raises(ValueError, match=says):
        replace(LIMITS, **{name: value})


def test_compiled_and_interpreted_levels_say_the_same(monkeypatch):
    compiled = SafetyModule(LIMITS)
    plain = interpreted("dart_skill.arm._joint_checks").Levels
    monkeypatch.setattr("dart_skill.arm._safety.Levels", plain)
    other, rng = SafetyModule(LIMITS), np.random.default_rng(2)
    for q in rng.uniform(-1.5, 1.5, (20, 7)):
        command = Command(5, rng.normal(0.0, 40.0, 6), rng.normal(0.0, 5.0, 7))
        limited = [module.limited(command, q).joint_torque for module in (compiled, other)]
        np.testing.assert_array_equal(*limited)
        for module in (compiled, other):
            module.reset()
        first, second = (
            (module.look(q, 0.3 * q, 9.0 * q, Speed.CAREFUL), module.warning)
            for module in (compiled, other)
        )
        assert first == second
