"""Landscapes that change: highest rewards against independent searches, what changes and what
stays, and the searches that run on them.
"""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import differential_evolution

from dart_skill.cli import main
from dart_skill.experiments.studies import landscapes
from dart_skill.experiments.studies.dart_search import (
    METHODS,
    offline_error,
    run,
    search_task,
)
from dart_skill.experiments.studies.landscapes import (
    BOX,
    EASE,
    ELBOW,
    HEIGHTS,
    HILL,
    LANDSCAPES,
    LENGTHS,
    N_TRIALS,
    RADII,
    RANGE,
    REST,
    SHIFT,
    TOLERANCE,
    Hills,
    Peaks,
    PlanarArm,
    StagedLandscape,
    reflected,
)

OBSTACLE = 0.9
BOUNDS = {
    "moving_peaks_2": BOX,
    "moving_peaks_5": BOX,
    "vanishing_peak": (-4.0, 4.0),
    "half_range": (-RANGE, RANGE),
}
BOUNDS["stuck_joint"] = BOUNDS["half_range"]
HILLS = Hills(np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 0.8]))
OTHERS = [method for method in METHODS if method != "model_based"]


def drawn(name: str, seed: int = 0) -> StagedLandscape:
    return LANDSCAPES[name](np.random.default_rng(seed))


def evolved(
    landscape: StagedLandscape, trial: int, bounds: tuple[float, float], n_runs: int = 6
) -> float:
    """Highest reward that differential evolution finds in so many runs, each of which may end on a
    lower hill.
    """
    look = {
        "popsize": 15,
        "tol": 1e-9,
        "maxiter": 300,
        "vectorized": True,
        "updating": "deferred",
        "polish": False,
    }
    everywhere = [bounds] * landscape.start.size

    def loss(points: np.ndarray) -> np.ndarray:
        return -landscape.rewards(points.T, trial)

    return max(
        -differential_evolution(loss, everywhere, seed=seed, **look).fun for seed in range(n_runs)
    )


@pytest.fixture
def short(monkeypatch):
    """Two hills for 200 trials, the better one blocked half-way, under the name of the vanishing
    peak.
    """
    monkeypatch.setattr(landscapes, "N_TRIALS", 200)
    blocked = HILLS._replace(obstacle=OBSTACLE)
    made = StagedLandscape(np.zeros(2), 1.0, [HILLS, blocked], (100,))
    monkeypatch.setitem(LANDSCAPES, "vanishing_peak", lambda rng: made)


@pytest.mark.parametrize("name", LANDSCAPES)
@pytest.mark.parametrize("seed", [0, pytest.param(5, marks=pytest.mark.slow)])
def test_the_highest_reward_is_what_an_independent_search_finds(name, seed):
    landscape = drawn(name, seed)
    for trial in [0, *landscape.changes[:1]]:
        found = evolved(landscape, trial, BOUNDS[name])
        assert found == pytest.approx(landscape.best[trial], rel=1e-6), f"trial {trial}"


@pytest.mark.parametrize("name", LANDSCAPES)
def test_the_best_and_the_rewards_change_together_and_at_no_other_trial(name):
    landscape = drawn(name, 1)
    places = np.random.default_rng(0).uniform(*BOUNDS[name], (50, landscape.start.size))
    for change in landscape.changes:
        before, after, later = (
            landscape.rewards(places, trial) for trial in (change - 1, change, change + 1)
        )
        assert not np.array_equal(before, after) and np.array_equal(after, later)
    assert set(np.flatnonzero(np.diff(landscape.best)) + 1) <= set(landscape.changes)
    assert landscape.best.shape == (N_TRIALS,)


@pytest.mark.parametrize("name", LANDSCAPES)
def test_the_same_generator_draws_the_same_landscape_and_another_a_different_one(name):
    one, same, other = drawn(name, 4), drawn(name, 4), drawn(name, 7)
    places = np.random.default_rng(0).uniform(*BOUNDS[name], (50, one.start.size))
    assert one.changes == same.changes and np.array_equal(one.best, same.best)
    assert np.array_equal(one.rewards(places, 0), same.rewards(places, 0))
    assert not np.array_equal(one.rewards(places, 0), other.rewards(places, 0))


@pytest.mark.parametrize("name", LANDSCAPES)
def test_rewards_are_never_negative_as_the_mixture_needs_it(name):
    landscape = drawn(name, 2)
    places = landscape.start + 50 * landscape.spread * np.random.default_rng(0).standard_normal(
        (200, landscape.start.size)
    )
    assert all(landscape.rewards(places, trial).min() >= 0.0 for trial in (0, N_TRIALS - 1))


def test_a_peak_is_half_as_high_at_its_radius():
    peak = Peaks(np.array([60.0]), np.array([7.0]), np.array([[20.0, 30.0]]))
    np.testing.assert_allclose(
        peak.rewards(np.array([[20.0, 30.0], [27.0, 30.0], [20.0, 9.0]])), [60.0, 30.0, 6.0]
    )


def test_peaks_move_by_the_shift_and_stay_within_their_bounds():
    rng = np.random.default_rng(0)
    peaks = Peaks(np.full(40, 69.0), np.full(40, 6.0), rng.uniform(*BOX, (40, 5)))
    for _ in range(20):
        before, peaks = peaks, peaks.moved(rng)
        moved = np.linalg.norm(peaks.centres - before.centres, axis=1)
        inside = np.all((before.centres > SHIFT) & (before.centres < BOX[1] - SHIFT), axis=1)
        np.testing.assert_allclose(moved[inside], SHIFT)
        for values, (low, high) in (
            (peaks.heights, HEIGHTS),
            (peaks.radii, RADII),
            (peaks.centres, BOX),
        ):
            assert low <= values.min() <= values.max() <= high


def test_reflection_at_the_bounds_goes_back_and_forth():
    np.testing.assert_allclose(
        reflected(np.array([3.0, 11.0, -2.0, 23.0, 10.0]), 0.0, 10.0), [3.0, 9.0, 2.0, 3.0, 10.0]
    )


def test_under_the_obstacle_is_nothing_and_beside_it_all_is_as_before():
    landscape = drawn("vanishing_peak", 3)
    (moment,), (first, second) = landscape.changes, landscape.stages[0].tops
    beside = first + 1.01 * OBSTACLE * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    places = np.vstack([first, first + 0.6 * OBSTACLE, second, beside])
    before, after = landscape.rewards(places, moment - 1), landscape.rewards(places, moment)
    assert before[0] == landscape.best[moment - 1] == 1.0 and np.array_equal(after[:2], [0.0, 0.0])
    assert np.array_equal(before[2:], after[2:]) and after[2] == landscape.best[moment]


def test_a_low_second_hill_leaves_what_sticks_out_beside_the_obstacle():
    hills = Hills(np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([1.0, 0.1]), obstacle=0.5)
    assert hills.best == pytest.approx(np.exp(-0.5 * (0.5 / HILL) ** 2))
    assert hills.rewards(np.array([[0.5, 0.0]]))[0] == pytest.approx(hills.best)
    assert Hills(hills.tops, hills.heights, obstacle=3.1).best < 0.1, (
        "the second top is covered too"
    )


def test_the_reward_of_the_arm_is_that_of_its_formula():
    arm = PlanarArm(np.array([0.6, 0.1]), np.full(4, -RANGE), np.full(4, RANGE))
    angles, heading, tip = np.array([0.3, -0.7, 1.1, 0.2]), 0.0, np.zeros(2)
    for angle, length in zip(angles, LENGTHS, strict=True):
        heading += angle
        tip += length * np.array([np.cos(heading), np.sin(heading)])
    np.testing.assert_allclose(arm.tip(angles[None])[0], tip)
    cost = np.sum((tip - arm.target) ** 2) / TOLERANCE**2 + np.sum(((angles - REST) / EASE) ** 2)
    assert arm.rewards(angles[None])[0] == pytest.approx(1.0 / (1.0 + cost))


def test_a_joint_stops_at_its_limits_and_a_stuck_one_moves_no_more():
    arm = PlanarArm(np.array([0.6, 0.1]), np.full(4, -RANGE), np.full(4, RANGE))
    commanded = np.array([[0.3, -0.7, 1.1, 0.2], [0.3, 0.4, 1.1, 0.2], [0.3, 9.0, 1.1, 0.2]])
    low, high = arm.low.copy(), arm.high.copy()
    high[ELBOW] = 0.0
    half = PlanarArm(arm.target, low.copy(), high.copy())
    low[ELBOW] = high[ELBOW] = 0.4
    stuck = PlanarArm(arm.target, low, high)
    np.testing.assert_allclose(stuck.rewards(commanded), np.full(3, arm.rewards(commanded)[1]))
    straight = commanded * [1.0, 0.0, 1.0, 1.0]
    np.testing.assert_allclose(
        half.rewards(commanded), [arm.rewards(commanded)[0], *arm.rewards(straight)[1:]]
    )


@pytest.mark.parametrize("seed", range(4))
def test_without_half_its_range_the_arm_has_to_bend_to_the_other_side(seed):
    """The former optimum is gone, and what it can be bent into is worth less than the other one."""
    whole, broken = drawn("half_range", seed).stages
    low, high = broken.low.copy(), broken.high.copy()
    low[[ELBOW, 2]], high[[ELBOW, 2]] = (-0.1, 0.0), (0.0, RANGE)
    same_side = PlanarArm(whole.target, low, high)
    assert same_side.best < 0.7 * broken.best < 0.7 * whole.best


@pytest.mark.parametrize("method", OTHERS)
def test_every_method_but_the_model_based_one_runs_and_regret_is_never_negative(short, method):
    one = run(search_task(method, "vanishing_peak", 1))
    assert len(one["throw_regrets"]) == 20
    assert min(one["throw_regrets"]) >= 0.0 and min(one["best_regrets"]) >= 0.0
    assert 0.0 <= one["offline_error"] <= one["throw_regret"]


@pytest.mark.slow
@pytest.mark.parametrize("method", OTHERS)
def test_methods_count_in_units_of_the_spread(short, monkeypatch, method):
    """Eight times the landscape, start and spread: the same regrets."""
    regrets = []
    for scale in (1.0, 8.0):
        hills = SimpleNamespace(
            best=HILLS.best, rewards=lambda places, scale=scale: HILLS.rewards(places / scale)
        )
        made = StagedLandscape(np.zeros(2), scale, [hills], ())
        monkeypatch.setitem(LANDSCAPES, "vanishing_peak", lambda rng, made=made: made)
        regrets.append(run(search_task(method, "vanishing_peak", 0))["throw_regrets"])
    np.testing.assert_allclose(regrets[1], regrets[0], atol=1e-3)


def test_the_offline_error_is_that_of_the_best_trial_since_the_last_change():
    regrets = np.array([3.0, 5.0, 1.0, 4.0, 2.0, 6.0])
    assert offline_error(regrets, (3,)) == np.mean([3.0, 3.0, 1.0, 4.0, 2.0, 2.0])
    assert offline_error(regrets, ()) is None


@pytest.mark.parametrize(
    ("method", "reward"),
    [("model_based", "thrown"), ("power", "thrown"), ("model_based", "expected")],
)
def test_what_only_darts_have_is_refused_elsewhere(method, reward):
    with pytest.raises(ValueError, match="are for darts, and not for 'half_range'"):
        search_task(method, "half_range", 0, reward)


def test_landscapes_on_the_command_line(short, capsys):
    options = "--methods power,niches --landscapes vanishing_peak --seeds 2 --jobs 1 --json"
    assert main(["experiment", "landscapes", *options.split()]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [(row["method"], row["schedule"], row["runs"]) for row in rows] == [
        ("power", "vanishing_peak", 2),
        ("niches", "vanishing_peak", 2),
    ]
    assert main(["experiment", "landscapes", "--landscapes", "moon", "--jobs", "1"]) == 1
    assert (
        "there is no schedule 'moon': choose one of thesis, extended, thesis_12000"
        in capsys.readouterr().err
    )
