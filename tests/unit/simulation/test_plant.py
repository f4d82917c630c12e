"""The simulated world against independent mechanics: Pinocchio for the arm, Runge-Kutta for the
ball, statistics for the hand.
"""

import gc
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import Actuation, ArmModel, Command, Grip, the_arm
from dart_skill.common.configuration import node_parameters
from dart_skill.common.flight import TENNIS_BALL, flight
from dart_skill.simulation import Basket, Plant, PlantSettings, PlantState, connect

WAM = the_arm()
STEP = 0.002
RENEWED = 50
"""Number of episodes after which the physics server is another one."""
COULOMB = WAM.of_joints("coulomb_friction")
GRIP = WAM.hand.ball_centre
CLEAR_OF_BASKET = np.array([3.0, 3.0, 0.4])
IDEAL = {"friction_scale": 0.0, "gravity_error": 0.0}


def run(plant, steps, wrench=None, joint_torque=None, push=None, grip=Grip.UNSPECIFIED):
    """States (steps + 1) under constant commands; the grip is told with the first."""
    states = [plant.state]
    for _ in range(steps):
        stamp = plant.state_stamp_ns
        command = Command(
            stamp,
            np.zeros(6) if wrench is None else wrench,
            np.zeros(7) if joint_torque is None else joint_torque,
            grip,
        )
        plant.step(command, None if push is None else Command(stamp, *push))
        states.append(plant.state)
        grip = Grip.UNSPECIFIED
    return states


def free_ball(plant):
    """Open the hand and wait until the ball is out."""
    while plant.state.ball_held:
        run(plant, 1, grip=Grip.OPEN)


def launch(plant, position, velocity=(0.0, 0.0, 0.0)):
    """Put the free ball somewhere; the plant itself offers no such thing."""
    world, ball = plant._world, plant._ball
    world.resetBasePositionAndOrientation(ball, list(position), [0, 0, 0, 1])
    # the plant's steps are a leapfrog
    half_a_step_earlier = np.array(velocity) + [
        0.0,
        0.0,
        0.5 * STEP * WAM.gravity,
    ]
    world.resetBaseVelocity(ball, half_a_step_earlier.tolist(), [0, 0, 0])
    plant._observe()


def grip_point(state):
    return state.hand_position + Rotation.from_quat(state.hand_quaternion).apply(GRIP)


def one(joint, value):
    return np.where(np.arange(7) == joint, value, 0.0)


def same(first: PlantState, second: PlantState, but=()):
    return [
        name for name in vars(first)
        if name not in but and not np.array_equal(getattr(first, name), getattr(second, name))
    ]  # fmt: skip


# the arm


@pytest.mark.parametrize("seed", range(4))
def test_joints_accelerate_as_an_arm_with_rotors_does(make_plant, seed):
    """qdd = (M + MR)^-1 (tau - h), with M, h by Pinocchio from the DH table and MR by the
    transmission.
    """
    rng = np.random.default_rng(seed)
    plant = make_plant(start_posture=tuple(rng.uniform(-0.6, 0.6, 7)), **IDEAL)
    free_ball(plant)
    model, torque = ArmModel(), rng.normal(0.0, 0.1, 7) * WAM.of_joints("peak_torque")
    states = run(plant, 60, joint_torque=torque)
    assert np.abs(states[-1].velocity).max() > 0.5
    for before, after in zip(states[:-1], states[1:], strict=True):
        realised = (after.velocity - before.velocity) / STEP
        bias = model.coriolis_torque(before.position, before.velocity) + model.gravity_torque(
            before.position
        )
        expected = np.linalg.solve(model.mass_matrix(before.position), after.effort - bias)
        np.testing.assert_allclose(
            realised, expected, atol=1e-4 * max(1.0, np.abs(expected).max())
        )


def test_the_held_ball_weighs_on_the_arm(make_plant):
    """From rest: gravity compensation knows the hand but not the ball, and the ball's inertia
    counts.
    """
    plant = make_plant(start_posture=(0.2, 0.7, 0.1, 0.4, 0.0, 0.3, 0.0), **IDEAL)
    empty, loaded = ArmModel(), ArmModel(ball_in_hand=True)
    torque = np.array([2.0, -3.0, 1.0, 2.0, 0.3, -0.5, 0.05])
    before, after = run(plant, 1, joint_torque=torque)
    q = before.position
    net = torque + empty.gravity_torque(q) - loaded.gravity_torque(q)
    expected = np.linalg.solve(loaded.mass_matrix(q), net)
    np.testing.assert_allclose(
        after.velocity / STEP, expected, rtol=0.02, atol=0.02 * np.abs(expected).max()
    )


def test_the_wrench_of_a_command_acts_at_the_hand_frame(make_plant):
    plant = make_plant(start_posture=(0.2, 0.7, 0.1, 0.4, 0.0, 0.3, 0.0), **IDEAL)
    wrench = np.array([3.0, -2.0, 4.0, 0.2, -0.3, 0.1])
    effort = run(plant, 1, wrench=wrench)[-1].effort
    model, q = ArmModel(), np.array(plant.settings.start_posture)
    np.testing.assert_allclose(
        effort, model.jacobian(q).T @ wrench + model.gravity_torque(q), atol=1e-6
    )


def test_a_push_moves_the_arm_without_the_motors(make_plant):
    """Force at the hand and, as joint torque, at the elbow: both act, neither goes through the
    motors' limits.
    """
    wrench, elbow = (
        np.array([5.0, 8.0, -3.0, 0.1, 0.2, 0.3]),
        np.array([4.0, -2.0, 3.0, 1.0, 0.2, 0.3, 0.1]),
    )
    commanded, pushed = make_plant(**IDEAL), make_plant(**IDEAL)
    expected = run(commanded, 30, wrench, elbow)[-1]
    actual = run(pushed, 30, push=(wrench, elbow))[-1]
    np.testing.assert_allclose(actual.position, expected.position, atol=1e-9)
    np.testing.assert_allclose(actual.velocity, expected.velocity, atol=1e-7)
    gravity = ArmModel().gravity_torque(np.array(make_plant(**IDEAL).settings.start_posture))
    np.testing.assert_allclose(
        run(make_plant(**IDEAL), 1, push=(wrench, elbow))[-1].effort, gravity, atol=1e-6
    )


def test_motor_limits_hold_for_commands_and_not_for_pushes(make_plant):
    strong = one(6, 20.0)
    assert run(make_plant(**IDEAL), 1, joint_torque=strong)[-1].effort[6] == pytest.approx(
        WAM.joints[6].peak_torque
    )
    pushed, commanded = (
        run(make_plant(**IDEAL), 2, **{key: value})[-1].velocity[6]  # fmt: skip
        for key, value in (("push", (np.zeros(6), strong)), ("joint_torque", strong))
    )
    assert pushed == pytest.approx(commanded * 20.0 / WAM.joints[6].peak_torque, rel=0.05)


def test_effort_is_what_the_actuation_delivers(make_plant):
    plant, actuation, model = make_plant(), Actuation(WAM), ArmModel()
    torque = np.array([60.0, 90.0, -50.0, 30.0, 5.0, -9.0, 2.0])
    states = run(plant, 80, joint_torque=torque)
    for before, after in zip(states[::8], states[1::8], strict=False):
        asked = torque + 0.95 * model.gravity_torque(before.position)
        np.testing.assert_allclose(
            after.effort, actuation.deliverable(asked, before.velocity), atol=1e-6
        )


def test_gravity_compensation_without_an_error_holds_the_arm_still(make_plant):
    """Without friction, too; the hand is opened at once, since nobody compensates the weight of
    the ball.
    """
    posture = (0.3, 0.9, 0.2, 0.8, 0.1, 0.4, 0.2)
    plant = make_plant(start_posture=posture, hand_delay=0.0, hand_spread=0.0, **IDEAL)
    states = run(plant, 250, grip=Grip.OPEN)
    assert np.abs([s.velocity for s in states]).max() < 1e-6
    np.testing.assert_allclose(states[-1].position, posture, atol=1e-6)


def test_gravity_compensation_with_an_error_lets_the_arm_sag(make_plant):
    posture = (0.3, 0.9, 0.2, 0.8, 0.1, 0.4, 0.2)
    plant = make_plant(start_posture=posture, friction_scale=0.0, gravity_error=0.05)
    states = run(plant, 50)
    loaded, q = ArmModel(ball_in_hand=True), np.array(posture)
    missing = loaded.gravity_torque(q) - 0.95 * ArmModel().gravity_torque(q)
    expected = np.linalg.solve(loaded.mass_matrix(q), -missing)
    np.testing.assert_allclose(
        states[1].velocity / STEP, expected, atol=0.02 * np.abs(expected).max()
    )
    assert states[-1].hand_position[2] < states[0].hand_position[2] - 0.003


@pytest.mark.parametrize(("joint", "sign"), [(0, 1), (1, -1), (3, 1), (3, -1), (5, 1), (6, -1)])
def test_joint_limits_hold(make_plant, joint, sign):
    lower, upper = WAM.of_joints("lower"), WAM.of_joints("upper")
    limit = upper[joint] if sign > 0 else lower[joint]
    posture = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    posture[joint] = limit - 0.05 * sign
    plant = make_plant(start_posture=tuple(posture), gravity_error=0.0)
    torque = one(joint, sign * 3.0 * COULOMB[joint])
    reached = np.array([s.position[joint] for s in run(plant, 400, joint_torque=torque)])
    assert (sign * (reached - limit)).max() < 0.01, sign * (reached - limit).max()
    assert abs(reached[-1] - limit) < 0.01, "it came to the limit at all"


# the hand


def test_the_ball_stays_in_the_grip_during_a_fast_swing(make_plant):
    plant = make_plant()
    states = run(plant, 140, joint_torque=np.array([0.0, 75.0, 0.0, 4.0, 0.0, 0.5, 0.0]))
    speed = max(np.linalg.norm(s.ball_velocity) for s in states)
    offset = max(np.linalg.norm(s.ball_position - grip_point(s)) for s in states)
    assert speed > 3.0 and offset < 5e-4, (speed, offset)
    assert all(s.ball_held for s in states)


def opening_delay(plant):
    """Seconds from the command to the last state in which the ball is held."""
    states = [*run(plant, 1, grip=Grip.OPEN)]
    while states[-1].ball_held:
        states += run(plant, 1)[1:]
    return (states[-2].stamp_ns - states[0].stamp_ns) * 1e-9


@pytest.mark.parametrize(("delay", "steps"), [(0.0, 0), (0.030, 15), (0.0307, 15), (0.0313, 16)])
def test_a_hand_without_spread_lets_go_at_the_step_nearest_to_its_delay(make_plant, delay, steps):
    assert opening_delay(make_plant(hand_delay=delay, hand_spread=0.0)) == pytest.approx(
        steps * STEP
    )


def test_delay_and_spread_of_many_openings_are_the_ones_asked_for(make_plant):
    """Standard errors of n = 100 openings: 0.4 ms of the mean, 7 % of the spread; limits are at
    three and a half of them.
    """
    plant, delays = make_plant(seed=5), []
    for _ in range(100):
        plant.reset()
        delays.append(opening_delay(plant))
    assert np.mean(delays) == pytest.approx(0.030, abs=1.4e-3)
    assert np.std(delays, ddof=1) == pytest.approx(0.004, rel=0.25)


def test_the_hand_opens_once_and_only_when_told(make_plant):
    plant = make_plant(hand_spread=0.0)
    assert all(s.ball_held for s in run(plant, 100))
    states = run(plant, 10, grip=Grip.OPEN) + run(plant, 10, grip=Grip.OPEN)[1:]
    held = [s.ball_held for s in states]
    assert held.index(False) == 16, "the second command does not begin the delay anew"


def test_closing_in_time_keeps_the_ball_and_too_late_does_not_bring_it_back(make_plant):
    plant = make_plant(hand_spread=0.0)
    run(plant, 10, grip=Grip.OPEN)
    assert plant.close_hand()
    assert all(s.ball_held for s in run(plant, 50))
    free_ball(plant)
    assert not plant.close_hand() and not plant.state.ball_held


def test_the_open_hand_does_not_touch_the_ball_that_leaves_it(make_plant):
    """A hand at rest lets go: the ball just falls."""
    plant = make_plant(start_posture=(0.0, 1.5, 0.0, 0.0, 0.0, 0.0, 0.0), hand_spread=0.0)
    begin, *_, end = (s for s in run(plant, 75, grip=Grip.OPEN) if s.step >= 15)
    assert begin.ball_held and not end.ball_held
    expected, _ = flight(
        begin.ball_position,
        begin.ball_velocity,
        np.array([(end.stamp_ns - begin.stamp_ns) * 1e-9]),
    )
    np.testing.assert_allclose(end.ball_position, expected[0], atol=2e-4)


# the ball


@pytest.mark.parametrize("velocity", [(3.5, 0.5, 2.5), (0.0, -4.0, 1.0), (5.0, 0.0, 4.0)])
def test_a_ball_in_flight_follows_the_independent_integration(make_plant, velocity):
    plant = make_plant(start_posture=(0.0,) * 7)
    plant.place_basket(CLEAR_OF_BASKET)
    free_ball(plant)
    launch(plant, [0.9, 0.0, 1.8], velocity)
    states = run(plant, 350)
    time = STEP * np.arange(351)
    expected, _ = flight(states[0].ball_position, np.array(velocity), time)
    error = np.linalg.norm([s.ball_position for s in states] - expected, axis=1)
    assert error.max() < 1e-3, error.max()


def rebound(plant, height):
    """Height of the first rebound and ratio of the speeds after and before it."""
    launch(plant, [1.5, 0.0, height + WAM.ball.radius])
    states = run(plant, round((2.2 * np.sqrt(2 * height / 9.81)) / STEP))
    z, speed = (
        np.array([getattr(s, name)[2] for s in states])
        for name in ("ball_position", "ball_velocity")
    )
    up = np.argmax(speed > 0.05)
    return z[up:].max() - WAM.ball.radius, speed[up] / -speed.min()


def test_the_ball_bounces_off_the_floor_with_its_restitution(make_plant):
    """Wherever between two steps it meets the floor; the rebound is that of the same speed in air."""
    plant = make_plant()
    plant.place_basket(CLEAR_OF_BASKET)
    free_ball(plant)
    drops = np.array(
        [
            rebound(plant, height)
            for height in (2.540, 2.5435, 2.547, 2.5505, 1.0, 1.003, 0.6, 0.602)
        ]
    )
    np.testing.assert_allclose(drops[:, 1], WAM.ball.restitution, rtol=0.01)
    # it hits the floor then
    _, velocity = flight(np.array([0.0, 0.0, 2.54]), np.zeros(3), np.array([0.7294]))
    up = WAM.ball.restitution * -velocity[0, 2]
    rise, _ = flight(np.zeros(3), np.array([0.0, 0.0, up]), np.linspace(0.3, 0.8, 300))
    np.testing.assert_allclose(drops[:4, 0], rise[:, 2].max(), atol=0.02)
    assert 1.25 < drops[0, 0] < 1.50


def test_a_heavier_ball_weighs_more_but_for_drag_falls_alike(make_plant):
    plant = make_plant(ball_mass_scale=2.0)
    plant.place_basket(CLEAR_OF_BASKET)
    free_ball(plant)
    launch(plant, [0.9, 0.0, 1.8], (3.5, 0.0, 2.5))
    states = run(plant, 250)
    heavy = replace(TENNIS_BALL, mass=2.0 * TENNIS_BALL.mass)
    expected, _ = flight(
        states[0].ball_position, np.array([3.5, 0.0, 2.5]), np.array([0.5]), heavy
    )
    np.testing.assert_allclose(states[-1].ball_position, expected[0], atol=1e-3)


# the basket


RIM = np.array([1.8, 0.3, 0.6])
BASKET = Basket()


@pytest.fixture
def thrown(make_plant):
    """A plant whose hand is open, with a basket at RIM away from the arm."""
    plant = make_plant()
    plant.place_basket(RIM)
    free_ball(plant)
    return plant


def around(radius, angle, height):
    return RIM + [radius * np.cos(angle), radius * np.sin(angle), height]


def test_a_ball_dropped_through_the_opening_stays_in(thrown):
    for radius, angle in ((0.0, 0.0), (0.06, 1.0), (0.10, 2.5), (0.11, 4.0)):
        launch(thrown, around(radius, angle, 0.3))
        states = run(thrown, 900)
        assert not states[0].ball_in_basket, "above the rim is not in"
        assert states[-1].ball_in_basket, (radius, angle, states[-1].ball_position - RIM)
        assert np.linalg.norm(states[-1].ball_velocity) < 0.3
        floor = RIM[2] - BASKET.depth + WAM.ball.radius
        assert states[-1].ball_position[2] > floor - 5e-3, (
            "it rests on the basket's floor, not in it"
        )


def test_a_ball_beside_the_opening_is_not_in(thrown):
    for angle in np.linspace(0.0, 2 * np.pi, 9):
        for radius in (0.185, 0.30):
            launch(thrown, around(radius, angle, 0.2))
            assert not any(s.ball_in_basket for s in run(thrown, 400)), (radius, angle)


def test_the_rim_throws_a_ball_back(thrown):
    """Dropped on the outer side of the rim, in the line of the wall: it hits the rim, high above
    the floor, and leaves.
    """
    for angle in np.linspace(0.1, 6.1, 7):
        launch(thrown, around(0.172, angle, 0.2))
        states = run(thrown, 140)
        sideways = np.linalg.norm((states[-1].ball_position - RIM)[:2])
        assert sideways > 0.20 and not states[-1].ball_in_basket, (angle, sideways)


def test_walls_keep_balls_in_all_around(thrown):
    for k, angle in enumerate(2 * np.pi * np.arange(48) / 48):
        launch(
            thrown,
            around(0.0, 0.0, (-0.08, -0.17, -0.30)[k % 3]),
            4.0 * np.array([np.cos(angle), np.sin(angle), 0.0]),
        )
        for state in run(thrown, 60):
            assert np.linalg.norm((state.ball_position - RIM)[:2]) < BASKET.radius, np.rad2deg(
                angle
            )


def test_all_sides_of_the_basket_are_there(thrown):
    """Rays from the axis outwards meet the wall within its inner and outer circle, whatever the
    azimuth and height.
    """
    launch(thrown, [1.0, -2.0, 0.1])
    angles = 2 * np.pi * np.arange(96) / 96 + 0.01
    for height in (-0.02, -0.17, -0.33):
        begin = [list(around(0.0, 0.0, height))] * len(angles)
        hits = thrown._world.rayTestBatch(
            begin, [list(around(0.4, angle, height)) for angle in angles]
        )
        bodies, shares = [hit[0] for hit in hits], np.array([hit[2] for hit in hits])
        assert set(bodies) == {thrown._basket_body}, f"a gap at {height} m"
        assert (shares * 0.4 > BASKET.radius - 2e-3).all() and (
            shares * 0.4 < BASKET.radius + BASKET.wall
        ).all()


def test_the_rim_is_as_wide_and_the_basket_as_deep_as_it_says(thrown):
    launch(thrown, [1.0, -2.0, 0.1])
    down = [
        [list(around(radius, 0.3, height)) for radius in (0.0, 0.10, 0.155)]
        for height in (0.2, -0.5)
    ]
    hits = thrown._world.rayTestBatch(*down)
    depths = np.array([hit[3][2] for hit in hits]) - RIM[2]
    np.testing.assert_allclose(depths, [-BASKET.depth, -BASKET.depth, BASKET.rim / 2], atol=3e-3)


@pytest.mark.parametrize(
    ("point", "held"),
    [
        ((0.0, 0.0, -0.1), True), ((0.149, 0.0, -0.1), True), ((0.151, 0.0, -0.1), False), ((0.11, 0.11, -0.1), False),
        ((0.0, 0.0, 0.001), False), ((0.0, 0.0, -0.34), True), ((0.0, 0.0, -0.37), False),
    ],
)  # fmt: skip
def test_what_counts_as_in(point, held):
    assert BASKET.holds(RIM + point, RIM) is held


def test_placing_the_basket_moves_nothing_else(make_plant):
    plant, twin = make_plant(), make_plant()
    plant.place_basket(RIM)
    assert same(plant.state, twin.state) == ["basket"]
    assert same(run(plant, 50)[-1], run(twin, 50)[-1]) == ["basket"]


# episodes


def episode(plant, basket=None):
    """A throw with a release, and every state of it."""
    plant.reset(basket)
    torque = np.array([3.0, 75.0, 2.0, 4.0, 0.0, 0.5, 0.1])
    return run(plant, 60, joint_torque=torque) + run(
        plant, 200, joint_torque=0.5 * torque, grip=Grip.OPEN
    )


def test_the_same_seed_gives_the_same_episode_to_the_last_bit(make_plant):
    first, second = (episode(make_plant(seed=7)) for _ in range(2))
    assert not any(same(a, b) for a, b in zip(first, second, strict=True))


def test_an_episode_does_not_depend_on_how_long_the_one_before_it_went_on(make_plant):
    plant, twin = make_plant(seed=7), make_plant(seed=7)
    run(plant, 137)
    plant.place_basket(RIM)
    run(twin, 11, joint_torque=one(0, 5.0), grip=Grip.OPEN)
    for a, b in zip(episode(plant, RIM), episode(twin, RIM), strict=True):
        assert not same(a, b, but=("stamp_ns",))


def test_a_reset_starts_anew_and_time_goes_on(make_plant):
    plant = make_plant()
    last = episode(plant)[-1]
    state = plant.reset(RIM)
    assert (state.episode, state.step) == (last.episode + 1, 0)
    assert state.stamp_ns == last.stamp_ns + plant.settings.reset_ns
    np.testing.assert_allclose(state.position, plant.settings.start_posture, atol=1e-12)
    np.testing.assert_array_equal(state.velocity, 0.0)
    np.testing.assert_allclose(state.ball_position, grip_point(state), atol=1e-9)
    np.testing.assert_array_equal(state.basket, RIM)
    assert state.ball_held and not state.ball_in_basket
    np.testing.assert_array_equal(plant.reset().basket, RIM)


# bad input


def bad_commands(stamp):
    nan, inf = np.full(6, np.nan), np.append(np.zeros(6), np.inf)
    return [
        (Command(stamp, wrench=nan), "wrench.*nan"),
        (Command(stamp, joint_torque=inf), "joint_torque.*inf"),
        (Command(stamp, wrench=np.zeros(3)), r"wrench has shape \(3,\), not \(6,\)"),
        (
            Command(stamp, joint_torque=np.zeros((7, 1))),
            r"joint_torque has shape \(7, 1\), not \(7,\)",
        ),
        (
            Command(stamp - 2_000_000),
            f"answers the state of {stamp - 2_000_000} ns, but the arm is at {stamp} ns",
        ),
        (Command(stamp + 2_000_000), f"at {stamp} ns: echo its stamp"),
    ]


@pytest.mark.parametrize("case", range(6))
@pytest.mark.parametrize("who", ["command", "push"])
def test_a_bad_command_is_refused_and_changes_nothing(make_plant, case, who):
    """Not even when the other answer, which is good, opens the hand."""
    plant, twin = make_plant(), make_plant()
    bad, message = bad_commands(plant.state_stamp_ns)[case]
    good = Command(plant.state_stamp_ns, grip=Grip.OPEN)
    with pytest.raises(ValueError, match=message):
        plant.step(*((bad, good) if who == "command" else (good, bad)))
    assert not same(plant.state, twin.state)
    assert not same(run(plant, 40)[-1], run(twin, 40)[-1])


@pytest.mark.parametrize(
    "position", [[1.0, 2.0], [1.0, np.nan, 0.4], [[1.0, 2.0, 0.4]], [np.inf, 0.0, 0.4]]
)
def test_a_bad_basket_is_refused_and_changes_nothing(make_plant, position):
    plant, twin = make_plant(), make_plant()
    for refuse in (plant.place_basket, plant.reset):
        with pytest.raises(ValueError, match="basket position .* three finite numbers"):
            refuse(position)
    assert not same(plant.state, twin.state)
    assert not same(plant.reset(), twin.reset()), "a refused reset is no episode"


def test_settings_come_from_the_parameters_of_the_node():
    parameters = node_parameters("wam_simulator.yaml", "wam_simulator")
    settings = PlantSettings.from_parameters(
        {**parameters, "friction_scale": 0.7, "basket_radius": 0.2}
    )
    assert settings.friction_scale == 0.7 and settings.basket.radius == 0.2
    assert settings.start_posture == tuple(parameters["start_posture"])
    for bad in ([0.0] * 6, [np.nan] * 7):
        with pytest.raises(ValueError, match="start_posture"):
            PlantSettings.from_parameters({**parameters, "start_posture": bad})


def test_an_interrupt_while_the_physics_server_starts_leaves_nothing_to_complain_about(
    monkeypatch,
):
    """Ctrl-C in the constructor of the client: its destructor ran on an object that had no
    connection yet.
    """

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    complaints = []
    monkeypatch.setattr(pybullet, "connect", interrupted)
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    with pytest.raises(KeyboardInterrupt):
        connect()
    gc.collect()
    assert complaints == []


SILENT = """
from dart_skill.simulation import Plant
plant = Plant()
for _ in range(51):
    plant.reset()
print("done")
"""


def test_physics_prints_nothing():
    """Neither when it is loaded, nor when its server is renewed."""
    done = subprocess.run(
        [sys.executable, "-c", SILENT], capture_output=True, text=True, timeout=120
    )
    assert (done.stdout, done.stderr) == ("done\n", "")


def test_a_change_waits_for_the_next_reset_and_leaves_time_and_seed_alone(make_plant):
    plant, other = make_plant(), make_plant()
    plant.change(replace(plant.settings, friction_scale=3.0, ball_mass_scale=2.0))
    assert plant.settings.friction_scale == 1.0
    before, expected = plant.reset(), other.reset()
    assert plant.settings.friction_scale == 3.0
    assert (before.stamp_ns, before.episode) == (expected.stamp_ns, expected.episode)
    with pytest.raises(ValueError, match="step_ns"):
        plant.change(replace(plant.settings, step_ns=1_000_000))


def test_a_turned_base_turns_the_hand_and_nothing_that_the_joints_know(make_plant):
    plant = make_plant()
    straight = plant.state
    plant.change(replace(plant.settings, base_turn=0.3))
    turned = plant.reset()
    cosine, sine = np.cos(0.3), np.sin(0.3)
    expected = (
        np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        @ straight.hand_position
    )
    np.testing.assert_allclose(turned.hand_position, expected, atol=1e-9)
    np.testing.assert_array_equal(turned.position, straight.position)


def test_weaker_motors_stop_at_a_lower_torque(make_plant):
    strong, weak = make_plant(), make_plant(motor_scale=0.5)
    for plant in (strong, weak):
        plant.step(
            Command(
                plant.state_stamp_ns, joint_torque=np.array([0.0, 500.0, 0.0, 0.0, 0.0, 0.0, 0.0])
            )
        )
    assert weak.joint_effort[1] == pytest.approx(0.5 * strong.joint_effort[1])


def test_a_plant_that_is_reset_again_and_again_needs_no_more_memory():
    """PyBullet keeps 10 kB of every body that it loads: 23 kB a reset."""

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    plant = Plant()
    before = 0
    for episode in range(3 * RENEWED):
        plant.reset()
        before = resident() if episode == RENEWED else before
    assert resident() - before < 1e6
    plant.close()
