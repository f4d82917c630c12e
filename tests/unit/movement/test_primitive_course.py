"""A primitive among task frames that may move, against what (7.8) makes of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.pace import PhaseRule
from dart_skill.movement import (
    DiscretePrimitive,
    MovingFrame,
    PrimitiveCourse,
    ReactivePolicy,
    SeenMovement,
    TaskFrame,
    ahead_gain,
    answers,
    attractor_from_motion,
    choose_goal_window,
    goal_share,
)
from dart_skill.movement.pose import DiscretePosePrimitive, PosePrimitiveCourse, pose_answers

TIME = np.linspace(0.0, 2.0, 401)
STIFFNESS, RULE = 400.0, PhaseRule(slowest=0.01, fastest=1.3, time_constant=0.02, ignored=0.01)
AXES = Rotation.from_rotvec([0.1, -0.2, 0.7]).as_matrix()
FIRST, LAST = np.array([0.5, -0.1, 1.0]), np.array([0.7, 0.2, 1.1])


def frame(position, axes=None):
    matrix = np.eye(4)
    matrix[1:, 1:] = np.eye(3) if axes is None else axes
    return TaskFrame(matrix, np.append(0.0, position))


def moving(position, velocity, acceleration, axes=None):
    attractor = attractor_from_motion(
        position[None], velocity[None], acceleration[None], STIFFNESS
    )[0]
    return MovingFrame(frame(position, axes), velocity, attractor)


def way(time=TIME):
    """From (-0.2, 0, 0.1) over an arc to the goal at (0.02, 0.01, 0.05), in the last frame [m]."""
    share = goal_share(time / TIME[-1], (0.0, 1.0))[:, None]
    arc = np.sin(np.pi * share) ** 2 * [0.0, 0.05, 0.1]
    return np.array([-0.2, 0.0, 0.1]) + share * [0.22, 0.01, -0.05] + arc


@pytest.fixture(scope="module")
def primitive():
    return DiscretePrimitive(20, goal_window=(0.1, 0.8)).fit(TIME, way())


@pytest.fixture(scope="module")
def course(primitive):
    spread = np.full(len(TIME), 0.004)
    return PrimitiveCourse(
        TIME, *answers(primitive, TIME), primitive.goal_, spread, STIFFNESS, RULE
    )


def test_frames_that_rest_get_the_movement_of_the_primitive(primitive, course):
    """(7.8) from the start in the last frame, with the goal there, turned into the world."""
    start = AXES.T @ (FIRST - LAST)
    made = primitive.open_loop(TIME, primitive.begin(start, velocity=np.zeros(3)))
    moments = [course.moment([frame(FIRST), frame(LAST, AXES)], time) for time in TIME]
    state = np.array([one.state for one in moments])
    assert state[:, :3] == pytest.approx(LAST + made.position @ AXES.T, abs=1e-9)
    assert state[:, 3:] == pytest.approx(made.velocity @ AXES.T, abs=1e-9)
    pulled = np.array([one.acceleration for one in moments])
    assert pulled == pytest.approx(made.acceleration @ AXES.T, abs=1e-7)
    attractors = np.array([one.attractor for one in moments])
    motion = [state[:, :3], state[:, 3:], pulled]
    assert attractors == pytest.approx(attractor_from_motion(*motion, STIFFNESS), abs=1e-9)


def test_it_begins_where_the_hand_is_and_ends_at_the_goal_in_its_frame(course):
    begins, ends = (
        course.moment([frame(FIRST), frame(LAST, AXES)], phase) for phase in course.ends
    )
    assert begins.state[:3] == pytest.approx(FIRST, abs=1e-12)
    assert ends.state[:3] == pytest.approx(LAST + AXES @ course.goal, abs=2e-5)


def test_a_goal_that_moves_carries_its_share_of_the_movement_along(course):
    """x moves by b(s) c(t), by the product rule at the pace that was shown."""
    velocity, acceleration = np.array([0.1, -0.2, 0.0]), np.array([0.0, 0.3, 0.1])
    phase, step = 0.9, TIME[1]

    def place(time):
        return LAST + time * velocity + 0.5 * time**2 * acceleration

    now = course.moment([frame(FIRST), moving(place(0.0), velocity, acceleration, AXES)], phase)
    before, after = (
        course.moment([frame(FIRST), frame(place(dt), AXES)], phase + dt).state[:3]
        for dt in (-step, step)
    )
    rate = (after - before) / (2.0 * step)
    growth = (after - 2.0 * now.state[:3] + before) / step**2
    assert now.state[3:] == pytest.approx(rate, abs=2e-3)
    assert now.acceleration == pytest.approx(growth, abs=0.1)
    standing = now.paced(0.0)[0]
    share = goal_share(np.array([phase / TIME[-1]]), (0.1, 0.8))[0]
    assert standing == pytest.approx(share * velocity, abs=1e-4), "who waits goes with its share"


def test_a_hand_that_is_held_makes_the_phase_wait_and_one_that_is_led_makes_it_go(course):
    frames, policy = [frame(FIRST), frame(LAST, AXES)], ReactivePolicy(course)
    hand, phases = course.moment(frames, 0.8).state[:3], []
    policy.phase = 0.8
    for _ in range(500):
        phases.append(policy.react(frames, hand, np.zeros(3), 0.002).phase)
    assert phases[-1] - 0.8 < 0.1, "held for a second"
    later = course.moment(frames, 1.2).state
    rate = policy.react(frames, later[:3], later[3:], 0.002).rate
    assert rate == RULE.fastest


def test_how_far_a_hand_is_ahead_is_exact_for_a_spread_of_nothing():
    velocity = np.array([[0.3, -0.1, 0.2]])
    assert ahead_gain(velocity, np.zeros(1))[0] @ (0.05 * velocity[0]) == pytest.approx(0.05)


def test_the_window_of_the_goal_is_found_from_one_movement_and_from_several():
    """Movements that are led by (0.2, 0.6) of their time to goals elsewhere."""
    progress = np.linspace(0.0, 1.0, 200)
    rng = np.random.default_rng(0)
    share, arc = goal_share(progress, (0.2, 0.6))[:, None], np.sin(np.pi * progress)[:, None]
    still = np.zeros((200, 3))
    for n in (1, 5):
        shown = [SeenMovement(share * rng.normal(size=3), still) for _ in range(n)]
        assert choose_goal_window(progress, shown) == pytest.approx((0.2, 0.6))
    shown = [SeenMovement(share * rng.normal(size=3) + arc, still) for _ in range(5)]
    assert choose_goal_window(progress, shown) == pytest.approx((0.2, 0.6))


def test_what_moves_with_the_goal_is_what_it_is_at_rest():
    """x = x0 + b(s) (c(t) + g - x0): seen at rest, the way of the frame is left out."""
    progress = TIME / TIME[-1]
    share = goal_share(progress, (0.0, 1.0))
    origin = LAST + np.outer(TIME, [0.1, 0.05, 0.0])
    axes = np.tile(AXES, (len(TIME), 1, 1))
    goal = AXES.T @ (FIRST - LAST) + [0.1, 0.2, -0.1]
    place = FIRST + share[:, None] * (origin + AXES @ goal - FIRST)
    at_rest = SeenMovement.among(place, axes, origin).at_rest(share)
    start = AXES.T @ (FIRST - LAST)
    assert at_rest == pytest.approx(start + share[:, None] * (goal - start), abs=1e-12)


@pytest.mark.parametrize("window", [(0.5, 0.5), (-0.1, 0.5), (0.2, 1.1)])
def test_a_window_that_is_none_is_refused(window):
    with pytest.raises(ValueError, match="goal_window must be two shares in order"):
        DiscretePrimitive(5, goal_window=window)


def test_a_primitive_stands_still_until_its_window_begins_and_is_there_when_it_ends():
    primitive = DiscretePrimitive(10, goal_window=(0.3, 0.6)).fit(TIME, np.zeros((len(TIME), 1)))
    made = primitive.open_loop(TIME, primitive.begin([0.0], goal=[1.0])).position[:, 0]
    assert np.abs(made[TIME <= 0.6]).max() < 1e-12
    assert made == pytest.approx(goal_share(TIME / 2.0, (0.3, 0.6)), abs=1e-6)


def test_the_hand_turns_as_the_pose_primitive_does():
    turns = Rotation.from_rotvec(
        np.outer(1.0 - goal_share(TIME / 2.0, (0.0, 1.0)), [0.2, 0.1, 0.9])
    )
    primitive = DiscretePosePrimitive(20).fit(TIME, np.hstack([way(), turns.as_quat()]))
    spread = np.full(len(TIME), 0.004)
    course = PosePrimitiveCourse(
        *(TIME, *pose_answers(primitive, TIME), primitive.goal_, spread, STIFFNESS, RULE),
        start_turn=primitive.start_turn_,
    )
    began = Rotation.from_rotvec([0.3, -0.1, 1.5])
    local = np.append(
        AXES.T @ (FIRST - LAST), (Rotation.from_matrix(AXES).inv() * began).as_quat()
    )
    made = primitive.open_loop(TIME, primitive.begin(local, velocity=np.zeros(6)))
    frames = [frame(FIRST, began.as_matrix()), frame(LAST, AXES)]
    moments = [course.moment(frames, time).turning for time in TIME]
    wanted = AXES @ Rotation.from_quat(made.pose[:, 3:]).as_matrix()
    assert np.array([one.rotation for one in moments]) == pytest.approx(wanted, abs=1e-9)
    spins = np.array([one.velocity for one in moments])
    assert spins == pytest.approx(made.velocity[:, 3:] @ AXES.T, abs=1e-9)
    assert moments[0].rotation == pytest.approx(began.as_matrix(), abs=1e-12)
