"""A model that is asked while the robot moves: frames that move, and a phase that waits for the
robot.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.movement import (
    AutonomousDSGMR,
    MovingFrame,
    PhaseRule,
    ReactivePolicy,
    TaskFrame,
    attractor_from_motion,
    lift,
    start_frame,
)

STIFFNESS, STEP = 100.0, 0.005
CLOCK = np.arange(0.0, 2.0, 0.01)
START = np.zeros(3)
RULE = PhaseRule(slowest=0.01, fastest=1.5, time_constant=0.02, ignored=0.01)


def smooth(share):
    """A step of least jerk, its rate and change of rate, (n,) each, at shares of its duration
    (n,).
    """
    s = np.clip(share, 0.0, 1.0)
    return (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 - s) * (1 - 2 * s),
    )


def reach(goal, drift):
    """Motion (position, velocity, acceleration; (n, 3) each) of a hand to a goal that drifts, and
    of that goal.
    """
    step, rate, change = (part[:, None] for part in smooth(CLOCK / 1.8))
    way = goal + CLOCK[:, None] * drift
    hand = (
        step * way,
        rate / 1.8 * way + step * drift,
        change / 1.8**2 * way + 2.0 * rate / 1.8 * drift,
    )
    return hand, (way, np.tile(drift, (len(CLOCK), 1)), np.zeros((len(CLOCK), 3)))


def frame_of(position, velocity, attractor):
    return MovingFrame(TaskFrame(np.eye(4), [0.0, *position]), velocity, attractor)


def frames_of(goal):
    attractor = attractor_from_motion(*goal, STIFFNESS)
    return [
        start_frame(START, n_angles=0),
        [frame_of(*row) for row in zip(goal[0], goal[1], attractor, strict=True)],
    ]


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(0)
    shown = [
        reach(rng.uniform(-0.2, 0.2, 3) + [0.6, 0.0, 0.3], rng.uniform(-0.1, 0.1, 3))
        for _ in range(10)
    ]
    learner = AutonomousDSGMR(8, STIFFNESS, rule=RULE, partition="time")
    return learner.fit(
        [CLOCK] * len(shown), [hand for hand, _ in shown], [frames_of(goal) for _, goal in shown]
    )


def follow(model, goal, drift, hold=(0.0, 0.0)):
    """A unit mass that asks at every step; from hold[0] on it is held for hold[1] seconds. Rows:
    time, phase, x (3), y (3).
    """
    policy, x, v, rows = ReactivePolicy(model), START.copy(), np.zeros(3), []
    for k in range(2000):
        time = STEP * k
        place = goal + time * drift
        frames = [
            start_frame(START, n_angles=0),
            frame_of(place, drift, place + 2.0 / np.sqrt(STIFFNESS) * drift),
        ]
        reaction = policy.react(frames, x, v, STEP)
        rows.append([time, reaction.phase, *x, *reaction.moment.attractor])
        if policy.is_over:
            break
        v = v + STEP * (STIFFNESS * (reaction.moment.attractor - x) - 2.0 * np.sqrt(STIFFNESS) * v)
        if hold[0] <= time < sum(hold):
            v = np.zeros(3)
        x = x + STEP * v
    return np.array(rows)


GOAL, DRIFT = np.array([0.7, -0.1, 0.25]), np.array([0.05, -0.08, 0.0])


def test_it_arrives_where_the_goal_is_then_at_the_pace_that_was_shown(model):
    way = follow(model, GOAL, DRIFT)
    assert way[-1, 0] == pytest.approx(CLOCK[-1], abs=0.15) and way[-1, 1] == pytest.approx(
        model.ends[1]
    )
    assert np.linalg.norm(way[-1, 2:5] - (GOAL + way[-1, 0] * DRIFT)) < 0.01


def test_held_for_a_second_it_waits_and_then_goes_on_without_hurry(model):
    free, held = follow(model, GOAL, DRIFT), follow(model, GOAL, DRIFT, hold=(0.8, 1.0))
    phases = held[(held[:, 0] > 0.9) & (held[:, 0] < 1.8), 1]
    assert np.ptp(phases) < 0.1, "the phase waits"
    assert held[-1, 0] - free[-1, 0] == pytest.approx(1.0, abs=0.2), (
        "and so it arrives a second later"
    )
    assert np.linalg.norm(held[-1, 2:5] - (GOAL + held[-1, 0] * DRIFT)) < 0.01
    speeds = [
        np.linalg.norm(np.diff(way[:, 2:5], axis=0), axis=1).max() / STEP for way in (free, held)
    ]
    assert speeds[1] < 1.5 * speeds[0]


def test_what_moves_with_a_frame_is_at_rest_in_it():
    """Of points that move as the frame does, position, velocity and attractor are the same to
    every frame that moves.
    """
    rng = np.random.default_rng(1)
    point = rng.normal(size=3)
    seen = []
    for _ in range(3):
        place, velocity = rng.normal(size=3), rng.normal(size=3)
        attractor = place + 2.0 / np.sqrt(STIFFNESS) * velocity
        world = np.concatenate([[0.3], place + point, velocity, attractor + point])
        seen.append(lift(frame_of(place, velocity, attractor)).to_frame(world[None])[0])
    np.testing.assert_allclose(seen[1:], [seen[0]] * 2, atol=1e-12)
    np.testing.assert_allclose(seen[0], [0.3, *point, 0.0, 0.0, 0.0, *point], atol=1e-12)


def test_a_frame_that_stands_is_one_that_moves_with_no_speed():
    still = TaskFrame(np.eye(4), [0.0, 0.1, 0.2, 0.3])
    moving = frame_of(still.b[1:], np.zeros(3), still.b[1:])
    for one, other in zip(
        (lift(still).A, lift(still).b), (lift(moving).A, lift(moving).b), strict=True
    ):
        np.testing.assert_array_equal(one, other)


def test_a_frame_has_a_speed_for_each_variable():
    with pytest.raises(ValueError, match="3 and 2 entries, the frame 4"):
        frame_of([0.0, 0.0, 0.0], np.zeros(3), np.zeros(2))


def test_a_model_without_demonstrations_has_no_ends():
    with pytest.raises(ValueError, match="call fit first"):
        ReactivePolicy(AutonomousDSGMR(2, STIFFNESS))


def test_what_waits_moves_on_with_its_frames(model):
    """Both frames drift alike: with the phase at rest the robot drifts as they do, and at the pace
    that was shown it has that drift beside its own motion.
    """
    still = [start_frame(START, n_angles=0), TaskFrame(np.eye(4), [0.0, *GOAL])]
    lag = 2.0 / np.sqrt(STIFFNESS)
    moving = [MovingFrame(one, DRIFT, one.b[1:] + lag * DRIFT) for one in still]
    here, there = model.moment(still, 0.9), model.moment(moving, 0.9)
    np.testing.assert_allclose(there.paced(0.0)[0], DRIFT, atol=1e-9)
    # its acceleration is that of the state's slope, which the regression has not exactly
    np.testing.assert_allclose(there.paced(0.0)[1], 0.0, atol=0.05)
    for rate in (0.3, 1.0):
        velocity, acceleration = there.paced(rate)
        np.testing.assert_allclose(velocity, DRIFT + rate * here.state[3:], atol=1e-9)
        np.testing.assert_allclose(acceleration, rate**2 * here.acceleration, atol=0.05)


def test_what_waits_is_expected_as_fast_as_its_place_moves(model):
    """One frame moves and one does not: else a robot that is exactly there would seem to be behind,
    and both would wait for each other.
    """
    attractor = GOAL + 2.0 / np.sqrt(STIFFNESS) * DRIFT
    for phase in (0.5, 0.9, 1.5):
        places = [
            model.moment(
                [start_frame(START, n_angles=0), frame_of(GOAL + way, DRIFT, attractor + way)],
                phase,
            )
            for way in (np.zeros(3), 0.01 * DRIFT)
        ]
        moved = (places[1].state[:3] - places[0].state[:3]) / 0.01
        np.testing.assert_allclose(places[0].paced(0.0)[0], moved, atol=1e-9)


def test_it_waits_for_a_robot_that_is_beside_its_path_by_more_than_was_shown():
    rule = PhaseRule(tolerated=2.0, slowest=0.01)
    assert rule.rate(0.0, 1.9) == 1.0 and rule.rate(0.0, 4.0) == pytest.approx(0.25)
    assert rule.rate(0.0, 1e3) == 0.01 and PhaseRule().rate(0.0, 1e3) == 1.0


def test_beside_the_path_is_neither_ahead_nor_behind_and_waits_where_it_must_be_precise(model):
    frames = [start_frame(START, n_angles=0), TaskFrame(np.eye(4), [0.0, *GOAL])]
    moment = model.moment(frames, 1.5)
    aside = np.cross(moment.state[3:], [0.0, 0.0, 1.0])
    aside *= 0.03 / np.linalg.norm(aside)
    rates = []
    for rule in (RULE, replace(RULE, tolerated=2.0)):
        policy = ReactivePolicy(
            AutonomousDSGMR.of_mixture(model.mixture_, model.ends, STIFFNESS, rule=rule)
        )
        policy.phase = 1.5
        rates.append(policy.react(frames, moment.state[:3] + aside, moment.state[3:], STEP).rate)
    assert rates[0] > 0.7 and rates[1] < 0.5 * rates[0]


def test_a_robot_on_its_way_is_ahead_or_behind_and_not_beside_it(model):
    frames = [start_frame(START, n_angles=0), TaskFrame(np.eye(4), [0.0, *GOAL])]
    moment = model.moment(frames, 0.9)
    along = 0.02 * moment.alone[:3] / np.linalg.norm(moment.alone[:3])
    assert moment.aside(along) == pytest.approx(0.0, abs=1e-6)
    across = np.cross(along, [0.0, 0.0, 1.0])
    far = np.sqrt(across @ np.linalg.solve(moment.spread, across))
    assert 0.0 < moment.aside(across) <= far + 1e-9
    assert moment.aside(across + 5.0 * along) == pytest.approx(moment.aside(across))
