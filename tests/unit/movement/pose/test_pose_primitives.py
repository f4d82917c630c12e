"""Primitives of position and orientation: against numerical integration of their equations, the
linear primitives, and laws.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dart_skill.movement import DiscretePrimitive, RhythmicPrimitive
from dart_skill.movement.pose import (
    DiscretePosePrimitive,
    RhythmicPosePrimitive,
    angles_between,
    exponential,
    logarithm,
)
from tests.unit.movement.pose.random_poses import apart, blocks, flipped, orientations, turned

TIME = np.linspace(0.0, 2.0, 201)
BLEND = (TIME / 2.0) ** 3 * (10.0 - 15.0 * TIME / 2.0 + 6.0 * (TIME / 2.0) ** 2)
CIRCLES = np.linspace(0.0, 4.0, 401)


@pytest.fixture
def rng():
    return np.random.default_rng(9)


def turn_by(degrees, rng):
    """Poses (201, 7) from rest to rest that turn by so many degrees about an axis that leans on
    the way.
    """
    axis = np.column_stack(
        [0.2 * np.sin(np.pi * BLEND), 0.1 * BLEND * (1.0 - BLEND), np.ones(201)]
    )
    path = Rotation.from_rotvec(np.radians(degrees) * BLEND[:, None] * axis) * Rotation.from_quat(
        orientations(1, rng)[0]
    )
    place = np.outer(BLEND, [0.4, -0.2, 0.1]) + np.outer(
        np.sin(np.pi * BLEND) ** 2, [0.0, 0.1, 0.1]
    )
    return np.column_stack([place, path.as_quat()])


def stirring(rng, period=1.0, swing=1.2):
    """Poses (401, 7) that repeat: a circle, and a wrist that swings about two axes."""
    angle = 2.0 * np.pi * CIRCLES / period
    swings = swing * np.column_stack(
        [np.sin(angle), 0.6 * np.cos(angle), 0.3 * np.sin(2.0 * angle)]
    )
    path = Rotation.from_rotvec(swings) * Rotation.from_quat(orientations(1, rng)[0])
    return np.column_stack(
        [0.1 * np.cos(angle), 0.1 * np.sin(angle), np.full(401, 0.3), path.as_quat()]
    )


def coordinates(poses, base):
    """Position and rotation vector (n, 6) from a base; the vectors go on over half a turn, and
    those of the base itself are shortest.
    """
    vectors = (Rotation.from_quat(poses[:, 3:]) * Rotation.from_quat(base).inv()).as_rotvec()
    for k in range(len(vectors) - 2, -1, -1):
        length = np.linalg.norm(vectors[k]) or 1.0
        turns = np.round((length - vectors[k + 1] @ vectors[k] / length) / (2.0 * np.pi))
        vectors[k] *= 1.0 - 2.0 * np.pi * turns / length
    return np.column_stack([poses[:, :3], vectors])


def stepped(primitive, state, n, dt=0.01, **wishes):
    states = [state]
    for _ in range(n):
        states.append(primitive.step(states[-1], dt, **wishes))
    return states


# --- discrete ---


@pytest.mark.parametrize("degrees", [60.0, 179.9, 180.0, 260.0, 330.0])
def test_a_demonstration_comes_back_through_half_a_turn(degrees, rng):
    poses = turn_by(degrees, rng)
    primitive = DiscretePosePrimitive(40).fit(TIME, flipped(poses, rng))
    made = primitive.open_loop(TIME)
    assert np.degrees(angles_between(made.pose, poses).max()) < 0.1
    np.testing.assert_allclose(made.pose[:, :3], poses[:, :3], atol=2e-4)
    assert np.degrees(np.linalg.norm(primitive.start_turn_)) == pytest.approx(degrees, abs=1e-6)


def test_it_is_the_linear_primitive_in_rotation_vectors_from_the_goal(rng):
    poses = turn_by(250.0, rng)
    flat = coordinates(poses, poses[-1, 3:])
    linear, curved = (
        DiscretePrimitive(30).fit(TIME, flat),
        DiscretePosePrimitive(30).fit(TIME, poses),
    )
    np.testing.assert_allclose(curved.weights_, linear.weights_, atol=1e-6)
    wanted = linear.open_loop(TIME)
    made = curved.open_loop(TIME)
    assert (
        apart(
            made.pose,
            (
                Rotation.from_rotvec(wanted.position[:, 3:]) * Rotation.from_quat(poses[-1, 3:])
            ).as_quat(),
        )
        < 1e-8
    )


def test_the_movement_solves_the_equations_of_koutras_and_doulgeri(rng):
    """tau^2 e'' = -K e - D tau e' + f with e = log(q g*), q' = w q / 2 and w = J(e) e', by scipy."""
    poses = turn_by(120.0, rng)
    options = {"stiffness": 120.0, "phase_scaled": True, "goal_path": "fixed"}
    primitive = DiscretePosePrimitive(20, **options).fit(TIME, poses)
    goal, duration, first = exponential(poses[-1], [0.1, 0.0, 0.0, 0.2, 0.1, 0.0]), 1.5, poses[0]
    made = primitive.open_loop(
        np.linspace(0.0, 1.5, 61),
        primitive.begin(first, goal=goal, duration=duration, velocity=np.zeros(6)),
    )
    aim = Rotation.from_quat(goal[3:])

    def jacobian(vector):
        axis = np.linalg.norm(vector) or 1.0
        cross = np.array(
            [[0, -vector[2], vector[1]], [vector[2], 0, -vector[0]], [-vector[1], vector[0], 0]]
        )
        return (
            np.eye(3)
            + (1 - np.cos(axis)) / axis**2 * cross
            + (axis - np.sin(axis)) / axis**3 * cross @ cross
        )

    def slope(t, state):
        vector = (Rotation.from_quat(state[3:7]) * aim.inv()).as_rotvec()
        force = (primitive.activations([t / duration]) @ primitive.weights_)[0]
        rate = jacobian(vector) @ state[10:]
        spin = 0.5 * np.array([*np.cross(rate, state[3:6]) + rate * state[6], -rate @ state[3:6]])
        away = np.concatenate([state[:3] - goal[:3], vector])
        pull = (force - 120.0 * away) / duration**2 - 2.0 * np.sqrt(120.0) / duration * state[7:]
        return np.concatenate([state[7:10], spin, pull])

    found = solve_ivp(
        slope,
        (0.0, 1.5),
        np.concatenate([first, np.zeros(6)]),
        t_eval=made.time,
        rtol=1e-9,
        atol=1e-11,
        method="DOP853",
    ).y.T
    assert apart(made.pose, found[:, 3:7]) < 1e-5
    np.testing.assert_allclose(made.pose[:, :3], found[:, :3], atol=1e-5)


def test_a_new_goal_is_reached_and_the_pace_does_not_change_the_path(rng):
    poses = turn_by(200.0, rng)
    primitive = DiscretePosePrimitive(30).fit(TIME, poses)
    goal = exponential(poses[-1], [0.1, 0.1, 0.0, 0.3, -0.4, 0.2])
    slow = primitive.open_loop(
        np.linspace(0.0, 6.0, 201), primitive.begin(goal=goal, duration=4.0)
    )
    fast = primitive.open_loop(
        np.linspace(0.0, 1.5, 201), primitive.begin(goal=goal, duration=1.0)
    )
    assert apart(slow.pose, fast.pose) < 1e-6
    np.testing.assert_allclose(4.0 * slow.velocity, fast.velocity, atol=1e-4)
    assert (
        np.degrees(angles_between(slow.pose[-1], goal)) < 0.1
        and np.abs(slow.pose[-1, :3] - goal[:3]).max() < 1e-3
    )


def test_a_goal_that_changes_on_the_way_is_reached_without_a_jump(rng):
    poses = turn_by(150.0, rng)
    primitive = DiscretePosePrimitive(30).fit(TIME, poses)
    goal = exponential(poses[-1], [0.1, 0.0, 0.0, 0.0, 0.5, 0.0])
    before = stepped(primitive, primitive.begin(), 100)
    after = stepped(primitive, before[-1], 200, goal=goal, duration=2.5)
    assert np.degrees(angles_between(after[-1].pose, goal)) < 0.3
    np.testing.assert_allclose(
        after[-1].goal,
        goal * np.sign(goal[3:] @ after[-1].goal[3:]) ** np.r_[0, 0, 0, 1, 1, 1, 1],
        atol=1e-4,
    )
    just_after = primitive.step(before[-1], 1e-5, goal=goal)
    np.testing.assert_allclose(just_after.acceleration, before[-1].acceleration, atol=1e-2)
    np.testing.assert_allclose(
        primitive.step(before[-1], 1e-5, duration=2.5).velocity, before[-1].velocity, atol=1e-3
    )


def test_a_goal_that_keeps_turning_is_followed_beyond_half_a_turn(rng):
    primitive = DiscretePosePrimitive(30).fit(TIME, turn_by(60.0, rng))
    state, first = primitive.begin(), primitive.goal_
    for k in range(300):
        angle = np.radians(min(200.0, 2.0 * k))
        state = primitive.step(
            state, 0.03, goal=exponential(first, [0.0, 0.0, 0.0, 0.0, angle, 0.0])
        )
    wanted = exponential(first, [0.0, 0.0, 0.0, 0.0, np.radians(200.0), 0.0])
    assert np.degrees(angles_between(state.pose, wanted)) < 0.1
    assert np.linalg.norm(state.inner.position[3:]) == pytest.approx(np.radians(200.0), abs=0.01)


def test_steps_are_the_open_loop(rng):
    for primitive in (
        DiscretePosePrimitive(25).fit(TIME, turn_by(200.0, rng)),
        RhythmicPosePrimitive(25).fit(CIRCLES, stirring(rng)),
    ):
        states, made = (
            stepped(primitive, primitive.begin(), 80),
            primitive.open_loop(0.01 * np.arange(81)),
        )
        assert apart(np.array([state.pose for state in states]), made.pose) < 1e-6
        np.testing.assert_allclose([state.velocity for state in states], made.velocity, atol=1e-5)
        np.testing.assert_allclose(
            [state.acceleration for state in states], made.acceleration, atol=1e-3
        )
        np.testing.assert_allclose(
            np.gradient(made.pose[:, :3], 0.01, axis=0)[1:-1], made.velocity[1:-1, :3], atol=1e-2
        )


def test_turning_the_demonstration_turns_the_movement_and_signs_do_not_matter(rng):
    rotation, shift = Rotation.random(random_state=6), rng.normal(size=3)
    for kind, time, poses in (
        (DiscretePosePrimitive, TIME, turn_by(220.0, rng)),
        (RhythmicPosePrimitive, CIRCLES, stirring(rng)),
    ):
        here, there = (
            kind(25).fit(time, poses),
            kind(25).fit(time, flipped(turned(poses, rotation, 0, shift), rng)),
        )
        # Whether a track is smoothed depends on its noise, which is zero but for rounding.
        one, other = here.open_loop(time), there.open_loop(time)
        assert apart(other.pose, turned(one.pose, rotation, 0, shift)) < 1e-10
        np.testing.assert_allclose(
            other.pose[:, :3], turned(one.pose, rotation, 0, shift)[:, :3], atol=1e-10
        )
        np.testing.assert_allclose(other.velocity, one.velocity @ blocks(rotation).T, atol=1e-8)


def test_a_push_moves_the_hand_and_a_tracking_error_makes_it_wait(rng):
    for primitive in (
        DiscretePosePrimitive(25).fit(TIME, turn_by(100.0, rng)),
        RhythmicPosePrimitive(25).fit(CIRCLES, stirring(rng)),
    ):
        state = stepped(primitive, primitive.begin(), 30)[-1]
        push = np.array([0.0, 0.0, 1.0, 0.0, 2.0, 0.0])
        free, pushed = primitive.step(state, 1e-3), primitive.step(state, 1e-3, coupling=push)
        # The spring answers at once, by a few parts in a hundred.
        np.testing.assert_allclose((pushed.velocity - free.velocity) / 1e-3, push, atol=0.1)
        np.testing.assert_allclose(pushed.acceleration - free.acceleration, push, atol=0.1)
        held = stepped(primitive, state, 50, tracking_error=[0.0, 0.0, 0.0, 0.0, 0.0, 1.0])[-1]
        free = stepped(primitive, state, 50)[-1]
        assert (held.progress - state.progress) % 1.0 < 0.5 * (
            (free.progress - state.progress) % 1.0
        )
        assert held.pace < 0.05


def test_it_continues_from_a_measured_pose(rng):
    for primitive in (
        DiscretePosePrimitive(25).fit(TIME, turn_by(100.0, rng)),
        RhythmicPosePrimitive(25).fit(CIRCLES, stirring(rng)),
    ):
        state = stepped(primitive, primitive.begin(), 50)[-1]
        measured = replace(
            state,
            pose=exponential(state.pose, [0.0, 0.01, 0.0, 0.1, 0.0, 0.0]),
            velocity=np.zeros(6),
        )
        after = primitive.step(measured, 1e-6)
        assert apart(after.pose, measured.pose) < 1e-8 and np.abs(after.velocity).max() < 1e-3


def test_parameters_are_those_of_six_columns(rng):
    for primitive in (
        DiscretePosePrimitive(25).fit(TIME, turn_by(100.0, rng)),
        RhythmicPosePrimitive(25).fit(CIRCLES, stirring(rng)),
    ):
        assert primitive.parameters.shape == (150,) and primitive.n_dims == 6
        same, other = (
            primitive.with_parameters(primitive.parameters),
            primitive.with_parameters(np.zeros(150)),
        )
        np.testing.assert_array_equal(same.open_loop(0.02).pose, primitive.open_loop(0.02).pose)
        assert not other.weights_.any() and primitive.weights_.any()
        np.testing.assert_allclose(primitive.activations([0.1, 0.9]).sum(1), 1.0)


PEER = {60.0: 0.067, 120.0: 0.133, 170.0: 0.189, 190.0: 178.298, 260.0: 2.692, 330.0: 1.703}
"""Worst orientation error [degrees] by turn [degrees] of CartesianDMP(execution_time=2.0, dt=0.01,
n_weights_per_dim=40) of movement_primitives 0.9.1 (PyPI; numpy 2.4, Python 3.11) after `imitate`
of `peers_turn` with continuous signs, laid out by `open_loop`. With dt=0.001 the numbers are the
same.
"""


def peers_turn(degrees):
    axis = np.column_stack(
        [0.2 * np.sin(np.pi * BLEND), 0.1 * BLEND * (1.0 - BLEND), np.ones(201)]
    )
    path = Rotation.from_rotvec(np.radians(degrees) * BLEND[:, None] * axis) * Rotation.from_quat(
        [0.5, 0.5, 0.5, 0.5]
    )
    place = np.outer(BLEND, [0.4, -0.2, 0.1]) + np.outer(
        np.sin(np.pi * BLEND) ** 2, [0.0, 0.1, 0.1]
    )
    return np.column_stack([place, path.as_quat()])


@pytest.mark.parametrize("degrees", PEER)
def test_a_turn_is_laid_out_closer_than_by_movement_primitives(degrees):
    poses = peers_turn(degrees)
    made = DiscretePosePrimitive(40).fit(TIME, poses).open_loop(TIME)
    # docs/learning.md has this table.
    assert np.degrees(angles_between(made.pose, poses).max()) < min(0.0012, 0.05 * PEER[degrees])


def test_exactly_half_a_turn_is_one_movement_whatever_the_signs():
    poses = np.column_stack(
        [np.zeros((201, 3)), Rotation.from_rotvec(np.outer(BLEND, [0.0, 0.0, np.pi])).as_quat()]
    )
    other = poses * np.repeat([1.0, -1.0], [3, 4])
    one, two = (DiscretePosePrimitive(20).fit(TIME, rows) for rows in (poses, other))
    np.testing.assert_array_equal(one.start_turn_, two.start_turn_)
    assert angles_between(one.open_loop(TIME).pose, poses).max() < 1e-3


def test_a_hand_that_keeps_still_keeps_still():
    still = np.tile(orientations(1, np.random.default_rng(4)), (201, 1))
    made = (
        DiscretePosePrimitive(20)
        .fit(TIME, np.column_stack([np.ones((201, 3)), still]))
        .open_loop(TIME)
    )
    assert (
        angles_between(made.pose[:, 3:], still).max() < 1e-7 and np.abs(made.velocity).max() < 1e-9
    )


# --- rhythmic ---


def test_a_cycle_comes_back_and_its_period_is_found(rng):
    poses = stirring(rng)
    primitive = RhythmicPosePrimitive(30).fit(CIRCLES, flipped(poses, rng))
    assert primitive.period_ == pytest.approx(1.0, abs=1e-3)
    made = primitive.open_loop(CIRCLES)
    assert np.degrees(angles_between(made.pose, poses)[20:-20].max()) < 0.5
    np.testing.assert_allclose(made.pose[20:-20, :3], poses[20:-20, :3], atol=2e-3)
    pose, velocity = primitive.limit_cycle(0.25)
    assert np.degrees(angles_between(pose, poses[25])) < 0.5
    again = primitive.open_loop([0.0, primitive.period_], primitive.begin(phase=0.25))
    assert apart(again.pose[0], again.pose[1]) < 1e-4


def test_it_is_the_linear_primitive_in_rotation_vectors_from_the_baseline(rng):
    poses = stirring(rng)
    primitive = RhythmicPosePrimitive(30).fit(CIRCLES, poses, period=1.0)
    flat = coordinates(poses, primitive.baseline_[3:])
    linear = RhythmicPrimitive(30).fit(CIRCLES, flat, period=1.0)
    np.testing.assert_allclose(linear.baseline_[3:], 0.0, atol=1e-9)
    np.testing.assert_allclose(primitive.weights_, linear.weights_, atol=1e-6)
    wanted = linear.open_loop(CIRCLES).position
    assert (
        apart(
            primitive.open_loop(CIRCLES).pose,
            (
                Rotation.from_rotvec(wanted[:, 3:]) * Rotation.from_quat(primitive.baseline_[3:])
            ).as_quat(),
        )
        < 1e-8
    )


def test_another_baseline_carries_the_cycle_along_smoothly(rng):
    primitive = RhythmicPosePrimitive(30).fit(CIRCLES, stirring(rng))
    there = exponential(primitive.baseline_, [0.2, 0.0, 0.1, 0.0, np.radians(170.0), 0.0])
    before = stepped(primitive, primitive.begin(), 50)
    after = stepped(primitive, before[-1], 150, baseline=there)
    wanted = primitive.limit_cycle(after[-1].progress, baseline=there)
    assert np.degrees(angles_between(after[-1].pose, wanted[0])) < 0.1
    np.testing.assert_allclose(after[-1].velocity, wanted[1], atol=0.02)
    poses = np.array([state.pose for state in before + after[1:]])
    rates = np.array([state.velocity for state in before + after[1:]])
    turns = logarithm(poses[:-1], poses[1:])[:, 3:] / 0.01
    np.testing.assert_allclose(
        turns, 0.5 * (rates[1:, 3:] + rates[:-1, 3:]), atol=0.05 * np.abs(rates).max()
    )


def test_from_another_start_the_cycle_is_reached(rng):
    primitive = RhythmicPosePrimitive(30).fit(CIRCLES, stirring(rng))
    state = primitive.begin(
        exponential(primitive.baseline_, [0.3, 0.0, 0.0, 2.0, 0.0, 0.0]), velocity=np.zeros(6)
    )
    assert np.abs(state.velocity).max() < 1e-9
    state = stepped(primitive, state, 200)[-1]
    assert np.degrees(angles_between(state.pose, primitive.limit_cycle(state.progress)[0])) < 0.1


# --- what is wrong ---

POSES = turn_by(90.0, np.random.default_rng(0))
ROUND = np.column_stack(
    [np.zeros((201, 3)), Rotation.from_rotvec(np.outer(TIME, [0.0, 0.0, np.pi])).as_quat()]
)
FITTED = DiscretePosePrimitive(10).fit(TIME, POSES)


def spoilt(row, column, value):
    poses = POSES.copy()
    poses[row, column] = value
    return poses


WRONG = {
    r"pose holds nan at index \(3, 4\)": (
        lambda: DiscretePosePrimitive().fit(TIME, spoilt(3, 4, np.nan))
    ),
    r"pose: the quaternion at index \(3,\) has length 0": (
        lambda: DiscretePosePrimitive().fit(TIME, spoilt(3, slice(3, 7), 0.0))
    ),
    "pose must have 7 columns": lambda: DiscretePosePrimitive().fit(TIME, POSES[:, :6]),
    r"got shape \(0, 7\)": lambda: DiscretePosePrimitive().fit([], POSES[:0]),
    "time must have length 201": lambda: DiscretePosePrimitive().fit(TIME[1:], POSES),
    "pose of demonstration 1: the quaternion": (
        lambda: DiscretePosePrimitive().fit([TIME] * 2, [POSES, spoilt(0, 3, 9.0)])
    ),
    "time must have one entry for each of the 2": (
        lambda: DiscretePosePrimitive().fit(TIME, [POSES, POSES])
    ),
    "less than a full turn": lambda: DiscretePosePrimitive().fit(TIME, ROUND),
    "noise must have length 2": (
        lambda: DiscretePosePrimitive().fit(TIME, POSES, noise=0.1 * np.ones(3))
    ),
    "call fit first": lambda: DiscretePosePrimitive().begin(),
    "goal must have 7 columns": lambda: FITTED.begin(goal=np.zeros(3)),
    "goal: the quaternion has length": lambda: FITTED.step(FITTED.begin(), 0.01, goal=np.zeros(7)),
    "velocity must have length 6": lambda: FITTED.begin(velocity=np.zeros(7)),
    "coupling must have length 6": lambda: FITTED.step(FITTED.begin(), 0.01, coupling=np.zeros(3)),
    "tolerance must be above 0": lambda: FITTED.step(
        FITTED.begin(), 0.01, tracking_error=np.zeros(6), tolerance=[0.0, 1.0]
    ),
    "dt must be above 0": lambda: FITTED.step(FITTED.begin(), 0.0),
    "state must be a PoseState": lambda: FITTED.step(3, 0.01),
    "parameters must have length 60": lambda: FITTED.with_parameters(np.zeros(3)),
    "does not repeat": lambda: RhythmicPosePrimitive().fit(TIME, POSES),
    "amplitude must be one number or one per dimension": lambda: (
        RhythmicPosePrimitive(10)
        .fit(CIRCLES, stirring(np.random.default_rng(0)))
        .begin(amplitude=np.ones(9))
    ),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    with pytest.raises(ValueError, match=message):
        WRONG[message]()
