"""Asking and telling: failures, parallel trials, saving, and what is refused."""

import json
from itertools import islice

import numpy as np
import pytest

from dart_skill.policy_search import Niches, PoWER, PrimitivePoWER, Sharpening

ACTIVATIONS = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])


def vector_search(seed=0, **options):
    return PoWER(np.ones(3), 0.5, rng=np.random.default_rng(seed), **options)


def primitive_search(seed=0, **options):
    return PrimitivePoWER(
        np.ones((2, 2)), ACTIVATIONS, 0.5, rng=np.random.default_rng(seed), **options
    )


def earned(trial):
    return float(-np.sum(trial.parameters**2))


BOTH = pytest.mark.parametrize("make", [vector_search, primitive_search])


@BOTH
def test_a_loop_over_a_search_asks_without_end(make):
    search = make()
    numbers = []
    for trial in islice(search, 25):
        numbers.append(trial.number)
        search.tell(trial, earned(trial))
    assert numbers == list(range(25)) and search.n_told == 25 and search.n_updates > 0


def test_maximise_is_the_loop():
    loop, call = vector_search(), vector_search()
    for trial in loop.trials(50):
        loop.tell(trial, earned(trial))
    np.testing.assert_array_equal(call.maximise(lambda x: -np.sum(x**2), 50), loop.parameters)
    assert call.best_return == loop.best_return == earned(loop.best_trial)


@BOTH
def test_a_search_ends_when_its_exploration_is_below_the_tolerance(make):
    search = make()
    for trial in search.trials(tolerance=0.01):
        search.tell(trial, earned(trial))
    assert search.exploration_size < 0.01
    assert list(search.trials(10, tolerance=0.01)) == []


@BOTH
def test_a_failed_trial_is_counted_and_teaches_nothing(make):
    search, without = make(batch=6), make(batch=6)
    for number, trial in enumerate(search.trials(6)):
        assert not search.tell(trial, np.nan if number % 2 else -np.inf)
    assert search.n_failed == 6 and search.n_told == 0 and search.best_trial is None
    np.testing.assert_array_equal(search.parameters, without.parameters)
    for trial in search.trials(6):
        updated = search.tell(trial, earned(trial))
    assert updated and search.n_updates == 1


@BOTH
def test_trials_may_be_open_together_and_told_in_any_order(make):
    search = make()
    trials = [search.ask() for _ in range(30)]
    for index in np.random.default_rng(1).permutation(30):
        search.tell(trials[index] if index % 2 else trials[index].number, earned(trials[index]))
    assert search.n_told == 30 and search.n_updates == 30 // search.settings.batch
    assert search.best_trial.number == np.argmax([earned(trial) for trial in trials])


def test_a_crowd_of_workers_that_answer_late_still_converges():
    lost = []
    for seed in range(5):
        rng, search = np.random.default_rng(seed), vector_search(seed)
        waiting = [search.ask() for _ in range(20)]
        for _ in range(1000):
            trial = waiting.pop(rng.integers(20))
            search.tell(trial, earned(trial))
            waiting.append(search.ask())
        lost.append(np.sum(search.parameters**2))
    assert np.median(lost) < 1e-4, lost


@BOTH
def test_a_trial_counts_once_and_only_where_it_was_asked(make):
    search, other = make(0), make(1)
    trial = search.ask()
    for stranger in (7, -1, "0", None, True, 0.0):
        with pytest.raises(ValueError, match="was never asked"):
            search.tell(stranger, 1.0)
    with pytest.raises(ValueError, match="comes from another search"):
        search.tell(other.ask(), 1.0)
    search.tell(trial, 1.0)
    with pytest.raises(ValueError, match="told before"):
        search.tell(trial, 1.0)


@BOTH
@pytest.mark.parametrize(
    "outcome, message",
    [
        (np.inf, r"\+inf"),
        ("far", "must be a number"),
        ([1.0, 2.0], "shape"),
        (None, "number|failed"),
    ],
)
def test_an_outcome_that_is_no_return_is_refused_and_can_be_told_again(make, outcome, message):
    search = make()
    trial = search.ask()
    if outcome is None:
        assert not search.tell(trial, outcome) and search.n_failed == 1
        return
    with pytest.raises(ValueError, match=message):
        search.tell(trial, outcome)
    search.tell(trial, 1.0)
    assert search.n_told == 1


def test_negative_returns_are_refused_as_weights_at_once():
    search = vector_search(weighting="returns")
    with pytest.raises(ValueError, match="-3 is negative.*'rank' or 'exponential'"):
        search.tell(search.ask(), -3.0)


@BOTH
def test_a_trial_cannot_be_changed(make):
    trial = make().ask()
    with pytest.raises(ValueError, match="read-only"):
        trial.parameters[0] = 0.0


# --- saving
# ------------------------------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("exploration", ["automatic", "constant", "proportional", "fixed"])
def test_a_saved_search_goes_on_with_the_very_same_trials(make, exploration, tmp_path):
    search = make(exploration=exploration)
    for trial in search.trials(41):
        search.tell(trial, earned(trial) if trial.number % 5 else np.nan)
    waiting = search.ask()
    search.save(tmp_path / "search.json")
    twin = type(search).load(tmp_path / "search.json")
    for each in (search, twin):
        each.tell(waiting, earned(waiting))
    for _ in range(40):
        one, other = search.ask(), twin.ask()
        np.testing.assert_array_equal(one.parameters, other.parameters)
        assert search.tell(one, earned(one)) == twin.tell(other, earned(other))
    assert search.state() == twin.state()
    assert twin.best_return == search.best_return and twin.n_failed == search.n_failed > 0


@pytest.mark.parametrize("name", ["PCG64", "PCG64DXSM", "MT19937", "Philox", "SFC64"])
def test_every_generator_of_numpy_can_be_saved(name):
    search = PoWER(np.ones(2), 1.0, rng=np.random.Generator(getattr(np.random, name)(3)))
    search.ask()
    twin = PoWER.from_state(json.loads(json.dumps(search.state())))
    np.testing.assert_array_equal(search.ask().parameters, twin.ask().parameters)


def test_held_noise_is_saved():
    search = primitive_search(hold=2, credit="uniform")
    search.maximise(lambda output: -np.sum(output**2, axis=1), 30)
    twin = PrimitivePoWER.from_state(json.loads(json.dumps(search.state())))
    np.testing.assert_array_equal(search.ask().output, twin.ask().output)


def test_a_state_that_does_not_fit_is_refused():
    state = vector_search().state()
    with pytest.raises(ValueError, match="of 'PoWER', not of 'PrimitivePoWER'"):
        PrimitivePoWER.from_state(state)
    with pytest.raises(ValueError, match="of 'list'"):
        PoWER.from_state([])
    with pytest.raises(ValueError, match="damaged.*'policy'"):
        PoWER.from_state({name: part for name, part in state.items() if name != "policy"})
    with pytest.raises(ValueError, match="generator 'Dice' is not known"):
        PoWER.from_state({**state, "generator": {"bit_generator": "Dice"}})


# --- refused
# -----------------------------------------------------------------------------------------------------

RNG = np.random.default_rng(0)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"parameters": [1.0, np.nan]}, "parameters holds nan at index"),
        ({"parameters": []}, "parameters is empty"),
        ({"parameters": [[1.0]]}, r"parameters must have 1 dimension\(s\)"),
        ({"parameters": "here"}, "parameters must be a regular array of numbers"),
        ({"spread": 0.0}, "spread must be above 0, got 0: give"),
        ({"spread": [1.0, -1.0]}, "spread must be above 0, got -1"),
        (
            {"spread": [1.0, 1.0, 1.0]},
            r"spread must be one number or have shape \(2,\), got \(3,\)",
        ),
        ({"spread": np.inf}, "spread holds inf"),
        (
            {"rng": 3},
            r"rng must be a numpy Generator, got int: use numpy.random.default_rng\(seed\)",
        ),
        ({"exploration": "wild"}, "exploration must be one of .*'automatic'.*got 'wild'"),
        ({"weighting": "loud"}, "weighting must be one of .*'rank'.*got 'loud'"),
        (
            {"best": 9, "latest": 4, "exploration": "constant"},
            "latest = 4 must be at least 2, best = 9 .*raise it",
        ),
        ({"batch": 9, "latest": 4}, "latest = 4 must be at least 2, best = 2 and batch = 9"),
        ({"batch": 4, "latest": 9}, "learns from each trial once.*latest = 9 and batch = 4"),
        ({"batch": 0}, "batch must be an integer of at least 1, got 0"),
        ({"best": 2.5}, "best must be an integer, got 2.5"),
        ({"latest": 1}, "latest = 1 must be at least 2"),
        ({"minimum_exploration": -0.1}, "minimum_exploration must be at least 0, got -0.1"),
        ({"limits": (2.0, 3.0)}, "limits must lie on both sides of 1"),
        ({"limits": (0.0, 3.0)}, "limits must be above 0"),
        ({"limits": 0.5}, "limits must have 1 dimension"),
        (
            {"exploration": "proportional", "minimum_exploration": 1.5},
            "limits must lie on both sides of 1",
        ),
    ],
)
def test_a_vector_search_refuses(changes, message):
    with pytest.raises(ValueError, match=message):
        PoWER(**{"parameters": [1.0, 2.0], "spread": 1.0, "rng": RNG, **changes})


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"weights": [1.0, 2.0]}, r"weights must have 2 dimension\(s\), got shape \(2,\)"),
        ({"weights": np.ones((3, 1))}, "activations must have 3 columns"),
        ({"weights": [[np.nan], [1.0]]}, "weights holds nan"),
        ({"activations": np.zeros((0, 2))}, "activations is empty"),
        ({"activations": [[1.0, 0.0], [2.0, 0.0]]}, "zero at all times for basis 1; leave out"),
        ({"spread": np.ones(2)}, r"spread must be one number or have shape \(2, 1\)"),
        ({"hold": 0}, "hold must be an integer of at least 1"),
        ({"credit": "bank"}, "credit must be one of .*'activation'.*got 'bank'"),
        ({"exploration": "wild"}, "exploration must be one of"),
    ],
)
def test_a_primitive_search_refuses(changes, message):
    with pytest.raises(ValueError, match=message):
        PrimitivePoWER(
            **{
                "weights": np.ones((2, 1)),
                "activations": ACTIVATIONS,
                "spread": 1.0,
                "rng": RNG,
                **changes,
            }
        )


@pytest.mark.parametrize(
    "n_trials, tolerance, message",
    [(-1, 0.0, "n_trials must be an integer"), (5, -1.0, "tolerance must be at least 0")],
)
def test_a_loop_refuses(n_trials, tolerance, message):
    with pytest.raises(ValueError, match=message):
        vector_search().trials(n_trials, tolerance)


@pytest.mark.parametrize("kind", [Niches, Sharpening])
def test_a_search_in_which_everything_fails_stays_where_it_began(kind):
    one = kind(np.zeros(2), 1.0, rng=np.random.default_rng(0))
    for trial in one.trials(100):
        assert not one.tell(trial, np.nan)
    np.testing.assert_array_equal(one.parameters, np.zeros(2))


@pytest.mark.parametrize("kind", [Niches, Sharpening])
def test_returns_that_are_all_alike_lead_nowhere_and_break_nothing(kind):
    one = kind(np.zeros(2), 1.0, rng=np.random.default_rng(0))
    for trial in one.trials(300):
        one.tell(trial, 5.0)
    assert np.isfinite(one.parameters).all() and json.loads(
        json.dumps(one.state(), allow_nan=False)
    )
