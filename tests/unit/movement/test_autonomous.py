"""The state-driven policy: as demonstrated when left alone, waits when held, skips when pushed,
always comes to the goal.
"""

import numpy as np
import pytest

from dart_skill.movement import (
    AutonomousDSGMR,
    PhaseRule,
    TaskFrame,
    attractor_from_motion,
    lift,
    smooth_derivatives,
)

WORLD = [TaskFrame(np.eye(3), np.zeros(3))]
STAMPS = np.linspace(-0.3, 1.3, 161)


def wind_up_and_reach(rng, goal=(1.0, 0.0)):
    """Rests, goes back first, then forth past its start to the goal, and rests: a state field
    cannot hold it.
    """
    s = np.clip(STAMPS, 0.0, 1.0)
    u = s**3 * (10 - 15 * s + 6 * s * s)
    along = u - 0.6 * np.sin(np.pi * u) * (1 - u)
    path = along[:, None] * np.asarray(goal) + 0.3 * np.sin(np.pi * u)[:, None] * np.array(
        [-goal[1], goal[0]]
    )
    return path + rng.normal(0.0, 0.01, 2) + rng.normal(0.0, 1e-4, path.shape)


@pytest.fixture(scope="module")
def demonstrations():
    rng = np.random.default_rng(0)
    return [wind_up_and_reach(rng) for _ in range(8)]


@pytest.fixture(scope="module")
def model(demonstrations):
    motions = [smooth_derivatives(STAMPS, path) for path in demonstrations]
    return AutonomousDSGMR(12).fit([STAMPS] * 8, motions, [WORLD] * 8)


@pytest.fixture(scope="module")
def policy(model):
    return model.policy(WORLD)


def phase_at(run, time):
    return float(np.interp(time, run.time, run.phase))


def test_left_alone_it_moves_as_demonstrated(policy, demonstrations):
    run = policy.run([0.0, 0.0], [0.0, 0.0], duration=3.0)
    mean = np.mean(demonstrations, axis=0)
    expected = np.column_stack([np.interp(run.phase, STAMPS, column) for column in mean.T])
    assert np.abs(run.position - expected).max() < 0.03
    assert run.position[:, 0].min() < 0.7 * mean[:, 0].min() < 0.0, "it winds up"
    taken = np.interp(0.9, run.phase, run.time) - np.interp(0.2, run.phase, run.time)
    assert taken == pytest.approx(0.7, abs=0.1), "at about the demonstrated pace"


@pytest.mark.parametrize("seed", range(10))
def test_it_comes_to_the_goal_from_any_start(policy, seed):
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2, 2)
    run = policy.run(rng.normal(0.0, size, 2), rng.normal(0.0, size, 2), duration=40.0, step=0.01)
    assert (
        np.linalg.norm(run.position[-1] - policy.goal) < 1e-6
        and np.linalg.norm(run.velocity[-1]) < 1e-6
    )


def test_the_phase_never_stands_still_nor_goes_back(policy):
    rng = np.random.default_rng(4)
    run = policy.run(
        [0.0, 0.0], [0.0, 0.0], duration=6.0, push=lambda t, x, v: rng.normal(0.0, 100.0, 2)
    )
    rates = np.diff(run.phase) / 0.002
    under_way = run.phase[1:] < policy.phase[-1]
    assert rates[under_way].min() >= policy.rule.slowest * (
        1 - 1e-9
    ) and rates.max() <= policy.rule.fastest * (1 + 1e-9)


def test_held_in_place_it_waits_and_then_goes_on(policy):
    """Two seconds in a firm grip: a clock would be at the end of the movement."""
    run = policy.run([0.0, 0.0], [0.0, 0.0], duration=0.8)
    held_at = run.position[-1]

    def grip(time, position, velocity):
        return 4e3 * (held_at - position) - 120.0 * velocity if 0.8 <= time < 2.8 else np.zeros(2)

    run = policy.run([0.0, 0.0], [0.0, 0.0], duration=7.0, push=grip)
    passed = phase_at(run, 2.8) - phase_at(run, 0.8)
    assert passed < 0.25, f"the phase went on by {passed:.2f} s"
    after = (run.time > 2.8) & (run.phase < 1.2)
    expected = np.column_stack(
        [np.interp(run.phase[after], policy.phase, column) for column in policy.state[:, :2].T]
    )
    assert np.abs(run.position[after] - expected)[-1].max() < 0.05, "back on the demonstrated path"
    assert np.linalg.norm(run.position[-1] - policy.goal) < 1e-3


def test_pushed_ahead_it_skips(policy):
    k = int(np.argmin(np.abs(policy.phase - 0.6)))
    free = policy.run(policy.state[k, :2], policy.state[k, 2:], duration=2.0)
    assert free.phase[0] == pytest.approx(0.6, abs=0.03), "it knows where it is"
    ahead = policy.advance(0.5, policy.state[k, :2], policy.state[k, 2:], 0.01)
    behind = policy.advance(0.7, policy.state[k, :2], policy.state[k, 2:], 0.01)
    assert ahead - 0.5 > 0.015 and behind - 0.7 < 0.005


@pytest.mark.parametrize("step", [0.0005, 0.001, 0.004, 0.01])
def test_any_rate_gives_the_same_movement(policy, step):
    fine = policy.run([0.05, -0.05], [0.0, 0.0], duration=1.2, step=0.00025)
    run = policy.run([0.05, -0.05], [0.0, 0.0], duration=1.2, step=step)
    expected = np.column_stack(
        [np.interp(run.time, fine.time, column) for column in fine.position.T]
    )
    assert np.abs(run.position - expected).max() < 1.5 * step


def test_turning_and_moving_the_task_turns_and_moves_the_motion(demonstrations, policy):
    angle, offset = 0.7, np.array([0.4, -1.1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = np.eye(3)
    matrix[1:, 1:] = turn
    frame = [TaskFrame(matrix, np.concatenate([[0.0], offset]))]
    motions = [smooth_derivatives(STAMPS, path) for path in demonstrations]
    run = (
        AutonomousDSGMR(12)
        .fit([STAMPS] * 8, motions, [WORLD] * 8)
        .policy(frame)
        .run(offset, [0.0, 0.0], duration=1.5)
    )
    expected = policy.run([0.0, 0.0], [0.0, 0.0], duration=1.5)
    np.testing.assert_allclose(run.position, expected.position @ turn.T + offset, atol=1e-6)
    np.testing.assert_allclose(run.phase, expected.phase, atol=1e-6)


def test_two_frames_bring_it_to_new_goals():
    rng = np.random.default_rng(3)
    goals = rng.uniform([0.8, -0.4], [1.4, 0.4], (8, 2))
    frames = [[WORLD[0], TaskFrame(np.eye(3), [0.0, *goal])] for goal in goals]
    motions = [smooth_derivatives(STAMPS, wind_up_and_reach(rng, goal)) for goal in goals]
    model = AutonomousDSGMR(10).fit([STAMPS] * 8, motions, frames)
    for goal in ([1.0, 0.2], [1.3, -0.3]):
        run = model.reproduce(
            [WORLD[0], TaskFrame(np.eye(3), [0.0, *goal])], [0.0, 0.0], [0.0, 0.0], duration=5.0
        )
        assert np.linalg.norm(run.position[-1] - goal) < 0.03


@pytest.mark.parametrize("partition", ["em", "time"])
def test_attractors_that_are_known_are_not_computed_again(demonstrations, partition):
    motions = [smooth_derivatives(STAMPS, path) for path in demonstrations]
    known = [attractor_from_motion(*motion, 200.0) for motion in motions]
    computed = AutonomousDSGMR(12, partition=partition).fit([STAMPS] * 8, motions, [WORLD] * 8)
    given = AutonomousDSGMR(12, partition=partition).fit(
        [STAMPS] * 8, [m[:2] for m in motions], [WORLD] * 8, attractors=known
    )
    np.testing.assert_array_equal(given.mixture_.means_, computed.mixture_.means_)
    np.testing.assert_array_equal(given.mixture_.covariances_, computed.mixture_.covariances_)


def test_an_input_says_how_far_to_go():
    rng, distances = np.random.default_rng(5), np.linspace(0.8, 1.4, 8)
    motions = [smooth_derivatives(STAMPS, wind_up_and_reach(rng, (one, 0.0))) for one in distances]
    frame = [TaskFrame(np.eye(4), np.zeros(4))]
    model = AutonomousDSGMR(12, n_inputs=1, partition="time").fit(
        [STAMPS] * 8, motions, [frame] * 8, inputs=[[one] for one in distances]
    )
    assert model.mixture_.n_dims == 8, "t, distance, x, x', y"
    for distance in (0.9, 1.3):
        run = model.reproduce(frame, [0.0, 0.0], [0.0, 0.0], duration=5.0, inputs=[distance])
        assert np.linalg.norm(run.position[-1] - [distance, 0.0]) < 0.03


def test_a_policy_may_be_worked_out_at_other_phases(model, policy):
    phase = np.arange(-0.2, 1.2, 0.002)
    other = model.policy(WORLD, phase=phase)
    np.testing.assert_array_equal(other.phase, phase)
    np.testing.assert_allclose(other.attractor(0.5), policy.attractor(0.5), atol=1e-3)
    assert (
        model.reproduce(WORLD, [0.0, 0.0], [0.0, 0.0], duration=3.0, phase=phase).phase[-1]
        == phase[-1]
    )


def test_a_frame_with_inputs_is_lifted_as_one_without():
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    matrix = np.eye(4)
    matrix[2:, 2:] = turn
    lifted = lift(TaskFrame(matrix, [0.0, 0.0, 0.5, 0.6]), 1)
    plain = lift(TaskFrame(np.delete(np.delete(matrix, 1, 0), 1, 1), [0.0, 0.5, 0.6]))
    np.testing.assert_array_equal(np.delete(np.delete(lifted.A, 1, 0), 1, 1), plain.A)
    np.testing.assert_array_equal(np.delete(lifted.b, 1), plain.b)
    np.testing.assert_array_equal(lifted.A[1], np.eye(8)[1])


def test_a_frame_that_is_missing_is_no_factor(demonstrations):
    motions = [smooth_derivatives(STAMPS, path) for path in demonstrations]
    two = AutonomousDSGMR(12).fit([STAMPS] * 8, motions, [WORLD * 2] * 8)
    alone = two.product([WORLD[0], None])
    assert (
        np.linalg.det(alone.covariances_) > np.linalg.det(two.product(WORLD * 2).covariances_)
    ).all()


@pytest.mark.parametrize(
    "form",
    [np.ndarray.tolist, lambda path: path[:3].tolist(), lambda path: (path,), lambda _: None],
)
@pytest.mark.parametrize("known", [False, True])
def test_positions_of_any_kind_are_answered_with_what_makes_a_motion(demonstrations, form, known):
    """Lists of rows, a tuple of one part and None once met other errors, one of them a TypeError,
    and none said what to give.
    """
    path = demonstrations[0]
    with pytest.raises(
        ValueError,
        match=(
            r"a motion must hold position.*; smooth_derivatives\(time, positions\) makes one of"
            r" positions"
        ),
    ):
        AutonomousDSGMR(3).fit(
            [STAMPS], [form(path)], [WORLD], attractors=[path] if known else None
        )


def test_one_demonstration_without_its_list_is_answered_with_where_lists_go(demonstrations):
    with pytest.raises(
        ValueError, match="got 161, 3 and 1; each is a list with one entry for each demonstration"
    ):
        AutonomousDSGMR(3).fit(STAMPS, smooth_derivatives(STAMPS, demonstrations[0]), WORLD)


def test_bad_input_is_named(model, policy, demonstrations):
    with pytest.raises(ValueError, match="position must have length 2|position"):
        policy.advance(0.0, [0.0, 0.0, 0.0], [0.0, 0.0], 0.01)
    with pytest.raises(ValueError, match="velocity"):
        policy.locate([0.0, 0.0], [np.nan, 0.0])
    with pytest.raises(ValueError, match="either side of 1"):
        PhaseRule(slowest=1.5)
    with pytest.raises(ValueError, match="slowest"):
        PhaseRule(slowest=0.0)
    with pytest.raises(ValueError, match="call fit first"):
        AutonomousDSGMR(3).policy(WORLD)
    with pytest.raises(ValueError, match="as many"):
        AutonomousDSGMR(3).fit([STAMPS], [], [WORLD])
    path = demonstrations[0]
    with pytest.raises(
        ValueError, match="got 2 parts of shapes .*; give the acceleration, or its attractor"
    ):
        AutonomousDSGMR(3).fit([STAMPS], [(path, path)], [WORLD])
    with pytest.raises(ValueError, match="attractors has 2 entries for 1 demonstrations"):
        AutonomousDSGMR(3).fit([STAMPS], [(path, path)], [WORLD], attractors=[path, path])
    with pytest.raises(ValueError, match="must be as long, got 161, 161, 160"):
        AutonomousDSGMR(3).fit([STAMPS[1:]], [(path, path)], [WORLD], attractors=[path[1:]])
    with pytest.raises(ValueError, match="equally spaced"):
        model.policy(WORLD, phase=[0.0, 0.1, 0.3])
    mixed = np.eye(3)
    mixed[1, 0] = 0.5
    with pytest.raises(ValueError, match="mixes time"):
        lift(TaskFrame(mixed, np.zeros(3)))


def unequal_durations(rng):
    """Eight reaches to (1, 0) that last 0.8 to 1.2 s and end at once, without a rest: their clocks
    and motions.
    """
    clocks, motions = [], []
    for duration in np.linspace(0.8, 1.2, 8):
        clock = np.linspace(0.0, duration, 101)
        s = clock / duration
        path = (
            np.outer(s**2 * (3.0 - 2.0 * s), [1.0, 0.0])
            + np.outer(np.sin(np.pi * s), [0.0, 0.2])
            + rng.normal(0.0, 1e-4, (101, 2))
        )
        clocks.append(clock)
        motions.append(smooth_derivatives(clock, path))
    return clocks, motions


def test_it_ends_where_the_demonstrations_ended():
    """The regression at the mean duration is elsewhere: some have ended by then, others have not."""
    clocks, motions = unequal_durations(np.random.default_rng(1))
    model = AutonomousDSGMR(8).fit(clocks, motions, [WORLD] * 8)
    wanted = np.mean([motion.position[-1] for motion in motions], axis=0)
    regressed = model.policy(WORLD, phase=np.linspace(*model.ends, 400))
    assert np.linalg.norm(regressed.goal - wanted) > 2e-3
    np.testing.assert_allclose(model.goal(WORLD), wanted, atol=1e-9)
    for start in np.random.default_rng(2).uniform(-0.5, 1.5, (5, 2)):
        run = model.reproduce(WORLD, start, [0.0, 0.0], duration=25.0, step=0.01)
        assert np.linalg.norm(run.position[-1] - wanted) < 1e-6


def test_the_course_before_the_end_is_that_of_the_regression(model):
    with_end, regressed = (
        model.policy(WORLD),
        model.policy(WORLD, phase=np.linspace(*model.ends, 400)),
    )
    np.testing.assert_array_equal(with_end.attractors[:400], regressed.attractors)
    np.testing.assert_array_equal(with_end.state[:400], regressed.state)
    assert np.abs(np.diff(with_end.attractors[399:], axis=0)).max() < 0.01, "no jump to the goal"


def test_a_goal_may_be_given(model):
    run = model.reproduce(WORLD, [0.0, 0.0], [0.0, 0.0], duration=20.0, step=0.01, goal=[1.2, 0.3])
    np.testing.assert_allclose(run.position[-1], [1.2, 0.3], atol=1e-6)
    with pytest.raises(ValueError, match="goal"):
        model.policy(WORLD, goal=[1.0, 0.0, 0.0])


def test_the_goal_goes_with_the_frame_in_which_the_demonstrations_agreed():
    rng = np.random.default_rng(3)
    goals = rng.uniform([0.8, -0.4], [1.4, 0.4], (8, 2))
    frames = [[WORLD[0], TaskFrame(np.eye(3), [0.0, *goal])] for goal in goals]
    motions = [smooth_derivatives(STAMPS, wind_up_and_reach(rng, goal)) for goal in goals]
    model = AutonomousDSGMR(10).fit([STAMPS] * 8, motions, frames)
    off = np.mean(
        [motion.position[-1] - goal for motion, goal in zip(motions, goals, strict=True)], axis=0
    )
    new = np.array([1.1, 0.1])
    assert (
        np.linalg.norm(model.goal([WORLD[0], TaskFrame(np.eye(3), [0.0, *new])]) - new - off)
        < 0.005
    )


def test_one_demonstration_has_an_end_too(demonstrations):
    motion = smooth_derivatives(STAMPS, demonstrations[0])
    model = AutonomousDSGMR(6).fit([STAMPS], [motion], [WORLD])
    np.testing.assert_allclose(model.goal(WORLD), motion.position[-1], atol=1e-9)


def test_a_mixture_from_elsewhere_has_no_ends(model):
    other = AutonomousDSGMR.of_mixture(model.mixture_, model.ends)
    np.testing.assert_array_equal(other.policy(WORLD).goal, other.policy(WORLD).attractors[-1])
    with pytest.raises(ValueError, match="give a goal"):
        other.goal(WORLD)
