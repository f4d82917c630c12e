"""What movement primitives learn from: several and weighted demonstrations, noise, units, and
input that is refused.
"""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dart_skill.movement import DiscretePrimitive, RhythmicPrimitive
from tests.unit.movement.primitives import rms

STAMPS = np.linspace(0.0, 1.0, 101)


def reach(side=0.2, stamps=STAMPS, goal=1.0):
    s = stamps / stamps[-1]
    u = s**3 * (10 - 15 * s + 6 * s * s)
    return np.stack([goal * u, side * np.sin(np.pi * u)], 1)


def test_several_demonstrations_are_averaged():
    paths = [reach(side) for side in (0.1, 0.2, 0.6)]
    primitive = DiscretePrimitive(30).fit([STAMPS] * 3, paths)
    np.testing.assert_allclose(primitive.open_loop(STAMPS).position, reach(0.3), atol=1e-4)


def test_demonstrations_of_different_length_pace_and_goal_are_one_movement():
    slow, fast = np.linspace(5.0, 7.0, 150), np.linspace(0.0, 1.0, 80)
    paths = [reach(0.2, slow - 5.0, goal=2.0), reach(0.2, fast, goal=1.0)]
    primitive = DiscretePrimitive(30).fit([slow, fast], paths)
    assert primitive.duration_ == pytest.approx(1.5)
    np.testing.assert_allclose(primitive.goal_, [1.5, 0.0], atol=1e-12)
    for goal in (1.0, 2.0):
        movement = primitive.open_loop(STAMPS, primitive.begin(goal=[goal, 0.0], duration=1.0))
        np.testing.assert_allclose(movement.position[:, 1], reach()[:, 1], atol=1e-4)
        assert movement.position[-1, 0] == pytest.approx(goal, abs=1e-4)


@pytest.mark.parametrize("kind", [DiscretePrimitive, RhythmicPrimitive])
@pytest.mark.parametrize("regression", ["joint", "local"])
def test_a_weight_of_two_is_the_demonstration_twice_and_none_is_without_it(kind, regression):
    turn = np.sin(2 * np.pi * STAMPS[:, None] + [0.0, 1.0])
    paths = (
        [turn, 2.0 * turn + 0.3, turn**3]
        if kind is RhythmicPrimitive
        else [reach(0.1), reach(0.3, goal=1.4), reach(0.9)]
    )
    settings = {"period": 1.0} if kind is RhythmicPrimitive else {}

    def fit(chosen, weights=None):
        return kind(12, regression=regression).fit(
            [STAMPS] * len(chosen), [paths[i] for i in chosen], weights=weights, **settings
        )

    weighted, repeated = fit([0, 1, 2], [2.0, 1.0, 0.0]), fit([0, 0, 1])
    np.testing.assert_allclose(
        weighted.weights_,
        repeated.weights_,
        rtol=1e-7,
        atol=1e-7 * np.abs(repeated.weights_).max(),
    )
    np.testing.assert_allclose(
        weighted.open_loop(0.01).position, repeated.open_loop(0.01).position, atol=1e-9
    )


def test_weights_leave_no_trace_of_their_size():
    one, other = (
        DiscretePrimitive(12).fit(
            [STAMPS] * 2, [reach(0.1), reach(0.5)], weights=np.array([1, 3]) * c
        )
        for c in (1e-6, 1e6)
    )
    np.testing.assert_allclose(one.weights_, other.weights_, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("level", [0.0002, 0.001, 0.005])
def test_noisy_samples_at_100_hertz_give_a_movement_closer_to_the_truth_than_they_are(level):
    time = np.arange(0.0, 1.5001, 0.01)
    truth = reach(0.3, time)
    errors = []
    for seed in range(5):
        noisy = truth + np.random.default_rng(seed).normal(0, level, truth.shape)
        errors.append(rms(DiscretePrimitive(20).fit(time, noisy).open_loop(time).position - truth))
    assert np.median(errors) < 0.9 * level, errors


def test_clean_samples_are_differentiated_closely_enough_to_reproduce_recorded_derivatives():
    # Unevenly spaced, of a sine whose derivatives are known.
    time = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 199))
    time = np.concatenate([[0.0], time, [1.0]])
    position, velocity, acceleration = (
        3.0**k * np.sin(3.0 * time[:, None] + k * np.pi / 2) for k in range(3)
    )
    derived, recorded = (
        DiscretePrimitive(20).fit(time, position),
        DiscretePrimitive(20).fit(time, position, velocity, acceleration),
    )
    partly = DiscretePrimitive(20).fit(time, position, velocity)
    for other in (derived, partly):
        np.testing.assert_allclose(
            other.open_loop(0.01).position, recorded.open_loop(0.01).position, atol=1e-5
        )


@given(
    scale=st.floats(1e-8, 1e8),
    pace=st.floats(1e-4, 1e4),
    offset=st.floats(-1e3, 1e3),
    phase_scaled=st.booleans(),
    goal_path=st.sampled_from(["smooth", "fixed"]),
    regression=st.sampled_from(["joint", "local"]),
)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_a_change_of_units_changes_nothing_but_units(scale, pace, offset, **form):
    plain = DiscretePrimitive(12, **form).fit(STAMPS, reach(), noise=0.0)
    other = DiscretePrimitive(12, **form).fit(STAMPS * pace, (reach() + offset) * scale, noise=0.0)
    movement, rescaled = plain.open_loop(STAMPS), other.open_loop(STAMPS * pace)
    tolerance = 1e-6 + 1e-9 * abs(offset)
    np.testing.assert_allclose(
        rescaled.position / scale - offset, movement.position, atol=tolerance
    )
    np.testing.assert_allclose(
        rescaled.velocity / scale * pace, movement.velocity, atol=30 * tolerance
    )


def test_a_large_offset_costs_no_accuracy_beyond_its_own_digits():
    primitive = DiscretePrimitive(30).fit(STAMPS, reach() + 1e8, noise=0.0)
    assert rms(primitive.open_loop(STAMPS).position - 1e8 - reach()) < 1e-5


@pytest.mark.parametrize("n_samples", [2, 3, 7, 20])
@pytest.mark.parametrize("regression", ["joint", "local"])
def test_fewer_samples_than_kernels_still_give_a_movement_from_start_to_goal(
    n_samples, regression
):
    time = np.linspace(0.0, 1.0, n_samples)
    primitive = DiscretePrimitive(50, regression=regression).fit(time, reach(0.2, time))
    movement = primitive.open_loop(np.linspace(0.0, 4.0, 401))
    assert np.abs(movement.position).max() < 2.0
    np.testing.assert_allclose(movement.position[-1], [1.0, 0.0], atol=1e-6)
    if n_samples == 20:
        np.testing.assert_allclose(primitive.open_loop(time).position, reach(0.2, time), atol=0.03)


def test_rest_is_a_movement_too():
    movement = DiscretePrimitive(10).fit(STAMPS, np.full((101, 2), 3.0)).open_loop(STAMPS)
    np.testing.assert_allclose(movement.position, 3.0, atol=1e-12)
    np.testing.assert_allclose(movement.velocity, 0.0, atol=1e-12)


def with_value(array, index, value):
    array = array.copy()
    array[index] = value
    return array


PATH = reach()
BAD_DEMONSTRATIONS = {
    "NaN": (
        (STAMPS, with_value(PATH, (3, 1), np.nan)),
        {},
        "position holds nan at index (3, 1); remove or interpolate such values first",
    ),
    "inf": (
        (STAMPS, PATH, with_value(PATH, (0, 0), np.inf)),
        {},
        "velocity holds inf at index (0, 0)",
    ),
    "NaN in time": ((with_value(STAMPS, 5, np.nan), PATH), {}, "time holds nan at index (5,)"),
    "empty": (
        ([], np.zeros((0, 2))),
        {},
        "position is empty, shape (0, 2); at least one sample is needed",
    ),
    "no demonstrations": (([], []), {}, "position must have 2 dimension(s), got shape (0,)"),
    "one sample": (([0.0], [[1.0, 2.0]]), {}, "time holds 1 stamps; at least 2 are needed"),
    "repeated stamp": (
        (with_value(STAMPS, 7, STAMPS[6]), PATH),
        {},
        "at index 6; sort the samples and drop repeated stamps",
    ),
    "backwards": (
        (STAMPS[::-1], PATH),
        {},
        "time must increase, but goes from 1.0 to 0.99 at index 0",
    ),
    "one column": (
        (STAMPS, PATH[:, 0]),
        {},
        "position must have 2 dimension(s), got shape (101,); use reshape(-1, 1)",
    ),
    "other length": ((STAMPS[:-1], PATH), {}, "time must have length 101, got 100"),
    "other shape": (
        (STAMPS, PATH, PATH[:, :1]),
        {},
        "velocity must have the position's shape (101, 2), got (101, 1)",
    ),
    "ragged": ((STAMPS, [[1.0, 2.0], [3.0]]), {}, "position must be a regular array of numbers"),
    "words": ((STAMPS, [["a", "b"]]), {}, "position must be a regular array of numbers"),
    "in the second": (
        ([STAMPS] * 2, [PATH, with_value(PATH, (1, 1), np.nan)]),
        {},
        "position of demonstration 1 holds nan at index (1, 1)",
    ),
    "other columns": (
        ([STAMPS] * 2, [PATH, PATH[:, :1]]),
        {},
        "demonstrations must have the same number of columns, got [1, 2]",
    ),
    "too few stamps": (
        ([STAMPS], [PATH, PATH]),
        {},
        "time must have one entry for each of the 2 demonstrations",
    ),
    "stamps shared": (
        (STAMPS, [PATH, PATH]),
        {},
        "time must have one entry for each of the 2 demonstrations",
    ),
    "negative weight": ((STAMPS, PATH), {"weights": -1.0}, "weights must not be negative, got -1"),
    "no weight": (
        (STAMPS, PATH),
        {"weights": np.zeros(101)},
        "weights are all zero; at least one sample must count",
    ),
    "weights of other length": (
        (STAMPS, PATH),
        {"weights": np.ones(7)},
        "weights must be one number or one per sample (101), got shape (7,)",
    ),
    "negative noise": ((STAMPS, PATH), {"noise": -1.0}, "noise must be at least 0, got -1"),
}


@pytest.mark.parametrize("kind", [DiscretePrimitive, RhythmicPrimitive])
@pytest.mark.parametrize("name", BAD_DEMONSTRATIONS)
def test_bad_demonstrations_are_refused_with_value_place_and_remedy(kind, name):
    arguments, settings, message = BAD_DEMONSTRATIONS[name]
    with pytest.raises(ValueError, match=re.escape(message)):
        kind(5).fit(*arguments, **settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"n_basis": 1}, "n_basis must be an integer of at least 2, got 1"),
        ({"n_basis": 5.5}, "n_basis must be an integer, got 5.5"),
        ({"stiffness": 0.0}, "stiffness must be above 0, got 0"),
        (
            {"canonical_decay": 1e3},
            "canonical_decay must be at most 100, got 1000: z would vanish before the end",
        ),
        ({"goal_path": "straight"}, "goal_path must be 'smooth' or 'fixed', got 'straight'"),
        (
            {"regression": "global"},
            "regression must be one of ['joint', 'local', 'path'], got 'global'",
        ),
    ],
)
def test_bad_hyper_parameters_are_named(settings, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        DiscretePrimitive(**settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"duration": 0.0}, "duration must be above 0, got 0"),
        ({"start": [np.nan, 0.0]}, "start holds nan"),
        ({"goal": 1.0}, "goal must have 1 dimension(s), got shape ()"),
        ({"velocity": [0.0, 0.0, 0.0]}, "velocity must have length 2, got 3"),
        ({"amplitude": np.inf}, "amplitude holds inf"),
    ],
)
def test_bad_settings_of_an_execution_are_named(settings, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        DiscretePrimitive(5).fit(STAMPS, PATH).begin(**settings)


def test_bad_stamps_and_parameters_are_named():
    primitive = DiscretePrimitive(5).fit(STAMPS, PATH)
    for times, message in [
        (0.0, "step must be above 0, got 0"),
        ([], "time holds 0 stamps"),
        ([0.0, 0.0], "time must increase"),
        ([0.0, np.nan], "time holds nan"),
    ]:
        with pytest.raises(ValueError, match=message):
            primitive.open_loop(times)
    with pytest.raises(ValueError, match="parameters must have length 10, got 9"):
        primitive.with_parameters(np.zeros(9))
    for progress, message in [
        (0.5, "progress must have 1 dimension"),
        ([0.1, -0.2], "progress must be at least 0.* got -0.2"),
    ]:
        with pytest.raises(ValueError, match=message):
            primitive.activations(progress)


def test_nothing_is_executed_before_something_is_learned():
    for primitive in (DiscretePrimitive(), RhythmicPrimitive()):
        for use in (
            primitive.begin,
            lambda primitive=primitive: primitive.parameters,
            lambda primitive=primitive: primitive.open_loop(0.1),
        ):
            with pytest.raises(ValueError, match="holds no weights yet; call fit first"):
                use()
