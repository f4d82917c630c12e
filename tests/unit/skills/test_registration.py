"""Cameras and arm are registered by what both say of the hand; a plan in the cameras' world is
done by the arm.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, HandPath, Registration, fit_registration
from dart_skill.skills.learning import learn_throwing
from dart_skill.skills.observation import sightings
from tests.throw_demonstrations import changed_throw

TURN, HAND_TURN = (
    Rotation.from_rotvec([0.004, -0.006, 0.02]),
    Rotation.from_rotvec([0.008, 0.012, -0.01]),
)
TRUE = Registration(
    TURN.as_quat(), (0.006, -0.004, 0.003), HAND_TURN.as_quat(), (0.002, -0.003, 0.001), 0.006
)


def moved(demonstration, seen=TRUE, rng=None, noise=0.0):
    """The demonstration as cameras with this registration would have seen it, if those that saw it
    were exact.
    """
    d, base = demonstration, Rotation.from_quat(seen.turn)
    hand = Rotation.from_quat(d.hand_quaternion)
    position = base.apply(d.hand_position + hand.apply(seen.hand_shift)) + np.array(seen.shift)
    if rng is not None:
        position = position + noise * rng.standard_normal(position.shape)
    return changed_throw(
        d,
        hand_time=d.hand_time + seen.delay,
        hand_position=position,
        hand_quaternion=(base * hand * Rotation.from_quat(seen.hand_turn)).as_quat(),
        ball_time=d.moved.time + seen.delay,
        ball_position=base.apply(np.array(d.moved.position)) + np.array(seen.shift),
        target=base.apply(np.array(d.target)) + np.array(seen.shift),
    )


def numbers(registration):
    """Rotation vector and shift of base and body, and the delay (13,)."""
    turns = [
        Rotation.from_quat(turn).as_rotvec()
        for turn in (registration.turn, registration.hand_turn)
    ]
    return np.concatenate(
        [turns[0], registration.shift, turns[1], registration.hand_shift, [registration.delay]]
    )


@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_turns_shifts_and_delay_come_back(demonstrations, noise):
    model, rng = ArmModel(), np.random.default_rng(0)
    found = fit_registration(
        [sightings(moved(one, TRUE, rng, noise), model) for one in demonstrations]
    )
    np.testing.assert_allclose(numbers(found)[:3], numbers(TRUE)[:3], atol=1.5e-3)
    np.testing.assert_allclose(numbers(found)[6:9], numbers(TRUE)[6:9], atol=2.5e-3)
    assert found.delay == pytest.approx(TRUE.delay, abs=1e-3)
    for one in demonstrations:
        seen = moved(one)
        position, quaternion = found.poses(seen.hand_position, seen.hand_quaternion)
        np.testing.assert_allclose(position, one.hand_position, atol=3e-3)
        turned = Rotation.from_quat(quaternion) * Rotation.from_quat(one.hand_quaternion).inv()
        assert turned.magnitude().max() < 4e-3


def test_a_system_that_is_registered_well_stays_as_it_is(demonstrations):
    found = fit_registration([sightings(one, ArmModel()) for one in demonstrations])
    assert np.abs(numbers(found)).max() < 6e-4


def test_without_joints_nothing_is_told(demonstrations):
    blind = replace(
        demonstrations[0],
        joint_time=np.empty(0),
        joint_position=np.empty((0, 7)),
        joint_velocity=np.empty((0, 7)),
    )
    assert (
        fit_registration([sightings(blind, ArmModel())]) == Registration()
        and Registration().is_none
    )


def test_a_plan_of_badly_registered_cameras_is_the_same_motion_of_the_arm(demonstrations):
    """Learned from what such cameras see, and thrown at a target where they see it, the arm moves
    as with good ones.
    """
    target = np.array([1.8, 0.2, 0.4])
    base = Rotation.from_quat(TRUE.turn)
    plain = learn_throwing(demonstrations).plan(target).as_the_arm_has_it()
    plan = learn_throwing([moved(one) for one in demonstrations]).plan(
        base.apply(target) + np.array(TRUE.shift)
    )
    assert not plan.registration.is_none
    done = plan.as_the_arm_has_it()
    assert done.registration.is_none
    at = np.linspace(0.1, min(plain.end, done.end), 20)
    where = [
        np.column_stack([np.interp(at, one.path.time, column) for column in one.path.position.T])
        for one in (plain, done)
    ]
    assert np.linalg.norm(where[1] - where[0], axis=1).max() < 0.02
    unregistered = np.column_stack(
        [np.interp(at, plan.path.time, column) for column in plan.path.position.T]
    )
    assert np.linalg.norm(unregistered - where[0], axis=1).max() > 0.02


def test_rates_of_a_registered_path_are_those_of_its_positions():
    time = np.linspace(0.0, 1.0, 2001)
    turn = Rotation.from_rotvec(
        np.column_stack([0.4 * np.sin(2 * time), 0.3 * time**2, 0.5 * time])
    )
    position = np.column_stack([np.sin(2 * time), np.cos(time), 0.5 * time**2])
    velocity = np.hstack([np.gradient(position, time, axis=0), _angular(turn, time)])
    path = HandPath(time, position, turn.as_quat(), velocity, np.gradient(velocity, time, axis=0))
    done = path.as_the_arm_has_it(replace(TRUE, hand_shift=(0.05, -0.03, 0.1)))
    inner = slice(5, -5)
    np.testing.assert_allclose(
        done.velocity[inner, :3], np.gradient(done.position, time, axis=0)[inner], atol=2e-3
    )
    np.testing.assert_allclose(
        done.velocity[inner, 3:],
        _angular(Rotation.from_quat(done.quaternion), time)[inner],
        atol=2e-3,
    )
    np.testing.assert_allclose(
        done.acceleration[inner], np.gradient(done.velocity, time, axis=0)[inner], atol=2e-2
    )


def _angular(turn, time):
    steps = (turn[1:] * turn[:-1].inv()).as_rotvec() / np.diff(time)[:, None]
    middle = 0.5 * (steps[1:] + steps[:-1])
    return np.vstack([steps[:1], middle, steps[-1:]])


@pytest.mark.parametrize(
    "change",
    [
        {"turn": (np.nan, 0.0, 0.0, 1.0)},
        {"turn": (0.0, 0.0, 0.0)},
        {"hand_turn": (0.0, 0.0, 0.0, 2.0)},
        {"shift": (0.0, 0.0)},
        {"delay": np.inf},
    ],
)
def test_what_is_no_registration_is_refused(change):
    with pytest.raises(ValueError, match="registration"):
        changed_throw(TRUE, **change)


def test_a_body_that_the_cameras_see_is_where_the_arm_has_it():
    turn, body = Rotation.from_rotvec([0.01, -0.02, 0.1]), Rotation.from_rotvec([0.3, 0.0, 0.2])
    registration = Registration(
        turn=tuple(turn.as_quat()), shift=(0.01, 0.02, -0.03), hand_shift=(0.1, 0.0, 0.0)
    )
    place = np.array([0.6, 0.1, 1.1])
    position, quaternion = registration.of_body(
        turn.apply(place) + registration.shift, (turn * body).as_quat()
    )
    assert position == pytest.approx(place) and Rotation.from_quat(
        quaternion
    ).as_rotvec() == pytest.approx(body.as_rotvec())
    assert Registration().of_body(place, body.as_quat())[0] is place
