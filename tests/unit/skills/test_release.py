"""Where a ball comes down that leaves the hand at one instant or another: closed forms,
polynomials, and flights simulated from there.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    STRETCHED,
    CommanderSettings,
    ExpectedThrow,
    Gains,
    Grip,
    GripEvent,
    HandPath,
    MotionPlan,
    PlanRefused,
    Registration,
    check_plan,
    the_arm,
)
from dart_skill.common.flight import DART, TENNIS_BALL, crossing, landing
from dart_skill.common.surface import BASKETS, RIMS, BoardFace, Game, game_at
from dart_skill.skills.learning import (
    EARLIEST_RELEASE,
    LATEST_RELEASE,
    certainly_within,
    configuration,
    farthest,
    hits_along,
    landing_if_late,
    learn_throwing,
    nearest_step,
    stretched_at,
    weights_at,
)

VACUUM = Game(replace(TENNIS_BALL, drag_coefficient=0.0), RIMS)
GRIP = the_arm().hand.ball_centre
RATE, LENGTH, SHOULDER, RIM = 3.0, 0.8, 1.4, 0.4
"""An arm that turns about the y axis through a shoulder above the base: rate [rad/s], length to
the ball [m], heights [m].
"""


def grip_at(time):
    """Position and velocity (..., 3) of the ball in that arm's hand, which points straight up at
    0.3 s.
    """
    angle = RATE * (np.asarray(time, dtype=float) - 0.3)
    zero = np.zeros_like(angle)
    position = np.stack([LENGTH * np.sin(angle), zero, SHOULDER + LENGTH * np.cos(angle)], axis=-1)
    return position, RATE * LENGTH * np.stack([np.cos(angle), zero, -np.sin(angle)], axis=-1)


def hand_at(time):
    """The hand frame to it: position (n, 3), quaternion (n, 4), velocity (n, 6)."""
    turned = Rotation.from_rotvec(np.outer(RATE * (time - 0.3), [0.0, 1.0, 0.0]))
    grip, speed = grip_at(time)
    arm, turning = turned.apply(GRIP), np.tile([0.0, RATE, 0.0], (len(time), 1))
    return grip - arm, turned.as_quat(), np.hstack([speed - np.cross(turning, arm), turning])


def plan_of(target, release=0.2, time=None):
    """A plan along that arm's path."""
    time = np.arange(0.0, 0.6, 0.004) if time is None else time
    position, quaternion, velocity = hand_at(time)
    path = HandPath(time, position, quaternion, velocity, np.zeros((len(time), 6)))
    gains = Gains(200.0, 28.0)
    return MotionPlan(
        path,
        position,
        quaternion,
        gains,
        gains,
        np.zeros(7),
        release,
        events=(GripEvent(release - 0.03, Grip.OPEN, release),),
        throw=ExpectedThrow(target, target, target),
    )


def vacuum_reach(time):
    """Of the ball that leaves that arm at a time, on the plane of the rim: a parabola in closed
    form.
    """
    (x, _, z), (u, _, w) = grip_at(time)
    return x + u * (w + np.sqrt(w**2 + 2.0 * 9.81 * (z - RIM))) / 9.81


def test_the_weights_are_those_of_the_parabola_through_three_points():
    rng = np.random.default_rng(0)
    time, values = np.cumsum(rng.uniform(0.5, 1.5, 9)), rng.standard_normal((9, 2))
    k, when = np.array([[1, 3], [7, 5]]), rng.uniform(time[0], time[-1], (2, 2))
    weights = weights_at(time, k, when)
    assert weights.shape == (2, 2, 3)
    for index in np.ndindex(2, 2):
        near = slice(k[index] - 1, k[index] + 2)
        expected = [
            np.polyval(np.polyfit(time[near], axis, 2), when[index]) for axis in values[near].T
        ]
        assert_allclose(weights[index] @ values[near], expected, rtol=1e-6)


def test_the_nearest_step_has_one_on_either_side():
    time = np.array([0.0, 1.0, 3.0, 4.0, 4.5])
    when = np.array([-9.0, 0.2, 1.9, 2.1, 3.8, 4.4, 9.0])
    inner = [1 + int(np.abs(time[1:-1] - instant).argmin()) for instant in when]
    assert nearest_step(time, when).tolist() == inner
    assert nearest_step(time, 2.1) == 2


@pytest.mark.parametrize("top", [2.0, 2.3, 2.5, 2.7, 4.49])
def test_the_top_of_a_parabola_is_found_between_its_samples(top):
    k, after = farthest(3.0 - 0.1 * (np.arange(6) - top) ** 2)
    assert k + after == pytest.approx(top, abs=1e-9)


@pytest.mark.parametrize(
    ("reach", "expected"),
    [(np.arange(5.0), 4.0), (-np.arange(5.0), 0.0), (np.exp(np.arange(5.0)), 4.0)],
)
def test_where_a_reach_only_grows_or_falls_the_end_is_the_farthest(reach, expected):
    k, after = farthest(reach)
    assert k + after == expected


def test_instants_at_which_no_ball_comes_down_are_left_out():
    assert farthest(np.array([1.0, 2.0, np.nan, 5.0, 6.0, 5.5, 3.0]))[0] == 4
    assert farthest(np.array([np.nan, np.nan, 4.0, np.nan, 1.0])) == (2, 0.0)
    k, after = farthest(np.full(5, np.nan))
    assert 1 <= k <= 3 and after == 0.0


def test_a_turning_arm_throws_farthest_where_the_closed_form_does():
    """In vacuum, against a search for the maximum of the parabola's reach."""
    best = minimize_scalar(
        lambda t: -vacuum_reach(t), bounds=(0.05, 0.5), method="bounded", options={"xatol": 1e-9}
    )
    time = np.arange(0.0, 0.5, 0.004)
    hits = hits_along(*hand_at(time), np.array([1.0, 0.0, RIM]), VACUUM)
    assert_allclose(hits[:, 0], [vacuum_reach(t) for t in time], atol=1e-9)
    assert_allclose(hits[:, 2], RIM, atol=1e-6)
    k, after = farthest(hits[:, 0])
    found = time[k] + after * 0.004
    assert found == pytest.approx(best.x, abs=1e-4)
    assert weights_at(time, k, found) @ hits[k - 1 : k + 2, 0] == pytest.approx(
        -best.fun, abs=1e-6
    )


LATE = np.array([-0.0151, -0.004, -0.0013, 0.0, 0.0007, 0.01, 0.0222])


def test_a_late_ball_comes_down_where_a_flight_from_that_instant_does():
    """The arm's own state at instants between the steps of the plan, and the flight from there."""
    target = np.array([1.0, 0.0, RIM])
    found = landing_if_late(plan_of(target), LATE)
    assert found.shape == (len(LATE), 3)
    assert_allclose(found, landing(*grip_at(0.2 + LATE), RIM, TENNIS_BALL).position, atol=2e-5)
    one = landing_if_late(plan_of(target), LATE[1])
    assert one.shape == (3,)
    assert_allclose(one, found[1], atol=1e-12)


def test_a_late_dart_meets_the_board_where_a_flight_from_that_instant_does():
    face = BoardFace((1.3, 0.2, 1.5))
    found = landing_if_late(plan_of(np.array([1.3, 0.2, 1.5])), LATE, game_at(face.bull))
    assert_allclose(
        found, crossing(*grip_at(0.2 + LATE), face.normal, face.distance, DART).position, atol=2e-5
    )


@pytest.mark.parametrize(("late", "when"), [(5.0, 0.596), (-5.0, 0.0)])
def test_a_ball_that_leaves_before_or_after_the_path_counts_as_leaving_at_its_end(late, when):
    found = landing_if_late(plan_of(np.array([1.0, 0.0, -3.0])), late)
    assert_allclose(found, landing(*grip_at(when), -3.0, TENNIS_BALL).position, atol=1e-9)


def test_a_plan_lets_go_where_its_own_path_throws_farthest(demonstrations):
    """No instant about the release that was shown sends the ball farther; the plan with the
    release of the teacher is far from it.
    """
    target = np.array([1.9, 0.1, 0.4])
    plan, shown = (
        learn_throwing(demonstrations, configuration(name)).plan(target)
        for name in ("default", "shown_release")
    )
    late = np.arange(EARLIEST_RELEASE, LATEST_RELEASE, 0.001) + shown.release - plan.release
    reach = np.hypot(*landing_if_late(plan, late)[:, :2].T)
    at_release = np.hypot(*landing_if_late(plan, 0.0)[:2])
    assert at_release > reach.max() - 1e-5
    for one, least, most in ((plan, 0.0, 0.002), (shown, 0.006, 0.03)):
        hits = np.hypot(*landing_if_late(one, np.array([-0.004, 0.004]))[:, :2].T)
        assert least <= np.abs(hits - 1.9026).max() < most, (one.release, hits)
    assert_allclose(plan.thrown.landing, landing_if_late(plan, 0.0, BASKETS), atol=1e-5)


def test_a_release_that_is_moved_is_moved_only_where_the_teacher_decides_it(demonstrations):
    """`releasing`, by which darts are steadied, moves the release that was shown; the farthest one
    is where it is.
    """
    target = np.array([1.9, 0.1, 0.4])
    skills = [
        learn_throwing(demonstrations, configuration(name))
        for name in ("shown_release", "default")
    ]
    moved = [
        skill.releasing(0.010).plan(target).release - skill.plan(target).release
        for skill in skills
    ]
    assert moved[0] == pytest.approx(0.010, abs=1e-9) and moved[1] == pytest.approx(0.0, abs=1e-4)


def test_an_arm_is_stretched_when_its_hand_passes_its_reach():
    arm, time = the_arm(), np.arange(0.0, 1.0, 0.05)
    shoulder = np.array([0.0, 0.0, arm.mount_height + arm.shoulder_height])
    position = shoulder + np.outer(arm.reach - 0.1 + 0.2 * time, [0.6, 0.0, 0.8])
    assert stretched_at(time, position) == pytest.approx((0.1 - STRETCHED) / 0.2, abs=1e-9)
    assert stretched_at(time[:9], position[:9]) == np.inf
    assert stretched_at(time[12:], position[12:]) == time[12]


@pytest.mark.parametrize("distance", [1.5, 1.7])
def test_a_hand_that_would_go_beyond_the_arms_reach_lets_go_before(demonstrations, distance):
    """Two demonstrations of far throws, asked for a near one: with the teacher's release the
    commander refuses the plan.
    """
    few, target = [demonstrations[0], demonstrations[2]], np.array([distance, 0.0, 0.4])
    with pytest.raises(PlanRefused, match="from the shoulder"):
        check_plan(
            learn_throwing(few, configuration("shown_release")).plan(target),
            CommanderSettings.configured(),
            the_arm(),
        )
    plan = learn_throwing(few).plan(target)
    check_plan(plan.as_the_arm_has_it(), CommanderSettings.configured(), the_arm())
    assert_allclose(plan.thrown.landing, target, atol=5e-3)


def test_hands_that_are_certainly_within_reach_are_within_it_whatever_the_registration():
    rng, said = np.random.default_rng(9), []
    for _ in range(200):
        turns = Rotation.from_rotvec(rng.normal(0.0, 0.3, (2, 3))).as_quat()
        registration = Registration(
            tuple(turns[0]),
            tuple(rng.normal(0.0, 0.1, 3)),
            tuple(turns[1]),
            tuple(rng.normal(0.0, 0.03, 3)),
        )
        position, quaternion = (
            rng.uniform(-0.5, 0.5, (4, 3)) + [0.0, 0.0, SHOULDER],
            Rotation.random(4, random_state=rng).as_quat(),
        )
        inside = (
            stretched_at(np.arange(4.0), registration.poses(position, quaternion)[0]) == np.inf
        )
        said.append(certainly_within(position, registration))
        assert inside or not said[-1]
    assert 10 < sum(said) < 190, sum(said)
