"""Following several optima: hills that overtake, vanish or coincide, and what is promised of every
search.
"""

import json

import numpy as np
import pytest

from dart_skill.policy_search import Niche, Niches, PoWER, Surrogate, forecast

SEEDS = range(5)
LEFT, RIGHT = np.array([-0.4, -0.2]), np.array([1.1, 0.9])
LIMITS = (0.01, 2.0)


def search(seed=0, d=2, **options):
    return Niches(np.zeros(d), 1.0, rng=np.random.default_rng(seed), **options)


def hill(point, top, height, width=0.5):
    return height * np.exp(-0.5 * np.sum((np.asarray(point) - top) ** 2) / width**2)


def two_hills(point, time):
    """The right hill overtakes at 2/3 of the time; they are apart: no uphill path leads from one
    to the other.
    """
    return hill(point, LEFT, 10 - time) + hill(point, RIGHT, 7 + 3.5 * time)


def vanishing(point, time):
    return hill(point, LEFT, 10.0 if time < 0.6 else 0.0) + hill(point, RIGHT, 9.0 - time)


def learnt(one, landscape, n_trials=1200):
    for n in range(n_trials):
        trial = one.ask()
        one.tell(trial, landscape(trial.parameters, n / n_trials))
    return one


@pytest.mark.slow
def test_the_lower_of_two_hills_is_found_before_it_overtakes_and_taken_when_it_did():
    at_the_right = {"niches": 0, "power": 0}
    for seed in SEEDS:
        power = PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(seed), limits=(0.03, 10.0))
        for name, one in (("niches", search(seed, waiting=0.05)), ("power", power)):
            learnt(one, two_hills)
            at_the_right[name] += np.linalg.norm(one.parameters - RIGHT) < 0.02
    assert at_the_right["niches"] == len(SEEDS) and at_the_right["power"] == 0, at_the_right


def test_both_hills_are_known_while_they_are_near_a_tie():
    one = learnt(search(1, waiting=0.05), lambda point, time: two_hills(point, 0.6), 400)
    places, gaps = one.optima
    assert gaps[0] == 0 and (np.diff(gaps) >= 0).all()
    for top in (LEFT, RIGHT):
        assert np.linalg.norm(places - top, axis=1).min() < 0.05, places
    np.testing.assert_allclose(one.parameters, places[0])


@pytest.mark.slow
def test_a_hill_that_vanishes_is_left_for_the_next_best():
    for seed in SEEDS:
        one = learnt(search(seed), vanishing)
        assert np.linalg.norm(one.parameters - RIGHT) < 0.05, (seed, one.parameters)


def test_a_hill_that_moves_is_followed_closely_at_little_cost():
    def moving(point, time):
        return hill(point, np.array([0.5 * time, -0.5 * time]), 10.0, 1.0)

    one, late = search(0), []
    for n in range(800):
        trial = one.ask()
        earned = moving(trial.parameters, n / 800)
        one.tell(trial, earned)
        late += [10 - moving(one.parameters, n / 800)] if n > 100 else []
    assert np.mean(late) < 0.001, np.mean(late)


def test_niches_keep_clear_of_each_other():
    one = search(3, clearing=0.7)
    for n in range(600):
        trial = one.ask()
        one.tell(trial, two_hills(trial.parameters, n / 600))
        places = one.optima[0]
        for index in range(1, len(places)):
            assert (
                np.linalg.norm(places[:index] - places[index], axis=1).min()
                > 0.8 * 0.7 * np.sqrt(2) - 1e-9
            )


def test_two_niches_at_one_place_become_one():
    one = learnt(search(0), two_hills, 100)
    state = one.state()
    twin = {**state["policy"]["niches"][0], "identity": 99, "relative": -1.0}
    state["policy"]["niches"] = [state["policy"]["niches"][0], twin]
    one = Niches.from_state(state)
    assert one.n_components == 2
    while 99 in [niche.identity for niche in one._niches] and one.n_asked < 110:
        trial = one.ask()
        one.tell(trial, two_hills(trial.parameters, 0.1))
    places = one.optima[0]
    assert all(np.linalg.norm(places[0] - place) > 0.8 * np.sqrt(2) for place in places[1:])


def test_nothing_but_the_units_changes_with_the_units():
    metres = learnt(search(2), two_hills, 200)
    millimetres = Niches(np.zeros(2), 1024.0, rng=np.random.default_rng(2))
    learnt(millimetres, lambda point, time: two_hills(point / 1024.0, time), 200)
    np.testing.assert_array_equal(millimetres.parameters, 1024.0 * metres.parameters)


def test_returns_may_have_any_scale_and_offset():
    plain = learnt(search(2), two_hills, 300)
    scaled = learnt(search(2), lambda point, time: 1024.0 * two_hills(point, time) - 4096.0, 300)
    np.testing.assert_allclose(scaled.parameters, plain.parameters, atol=1e-3)


@pytest.mark.parametrize("d", [1, 3, 6, 12])
def test_a_bowl_of_any_dimension_is_climbed(d):
    target = np.full(d, 0.4)
    one = search(0, d)
    one.maximise(lambda point: -np.sum((point - target) ** 2), 60 * d)
    np.testing.assert_allclose(one.parameters, target, atol=0.02)


def test_noise_is_averaged_over_as_many_trials_as_were_asked_for():
    errors = {1: [], 100: []}
    for repeats in errors:
        for seed in range(3):
            noise = np.random.default_rng(100 + seed)
            one = learnt(
                search(seed, repeats=repeats),
                lambda point, _: hill(point, LEFT, 10.0, 1.0) + 3 * noise.standard_normal(),  # noqa: B023
                400,
            )
            errors[repeats].append(np.linalg.norm(one.parameters - LEFT))
    assert np.median(errors[100]) < 0.4 and np.median(errors[100]) < 0.7 * np.median(errors[1]), (
        errors
    )


def test_the_same_seed_gives_the_same_trials():
    first, second = learnt(search(4), two_hills, 200), learnt(search(4), two_hills, 200)
    assert json.dumps(first.state()) == json.dumps(second.state())


def test_a_saved_search_goes_on_with_the_very_same_trials(tmp_path):
    one = learnt(search(1), two_hills, 300)
    waiting = one.ask()
    one.save(tmp_path / "search.json")
    again = Niches.load(tmp_path / "search.json")
    assert any(niche["visits"] for niche in one.state()["policy"]["niches"])
    assert one.state() == again.state()
    for each in (one, again):
        each.tell(waiting.number, 1.0)
        learnt(each, two_hills, 150)
    assert json.dumps(one.state()) == json.dumps(again.state())


def test_trials_may_be_open_together_fail_and_be_told_in_any_order():
    one, order = search(5), np.random.default_rng(0)
    for _ in range(60):
        trials = [one.ask() for _ in range(8)]
        for index in order.permutation(8):
            failed = order.random() < 0.1
            one.tell(
                trials[index], np.nan if failed else hill(trials[index].parameters, LEFT, 10.0)
            )
    assert one.n_failed > 20 and one.n_told + one.n_failed == 480
    assert np.linalg.norm(one.parameters - LEFT) < 0.02


@pytest.mark.parametrize(
    "options, message",
    [
        ({"drift": 0.0}, "drift"),
        ({"scouting": np.nan}, "scouting"),
        ({"waiting": -0.1}, "waiting"),
        ({"most": 0}, "most"),
        ({"clearing": 0.0}, "clearing"),
        ({"reach": -1.0}, "reach"),
        ({"fading": 0.0}, "fading"),
        ({"repeats": 0}, "repeats"),
        ({"limits": (2.0, 3.0)}, "limits"),
    ],
)
def test_options_out_of_range_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        search(**options)


def test_other_bad_input_is_refused():
    with pytest.raises(ValueError, match="parameters is empty"):
        Niches([], 1.0, rng=np.random.default_rng(0))
    with pytest.raises(ValueError, match="spread must be above 0"):
        Niches([0.0], 0.0, rng=np.random.default_rng(0))
    with pytest.raises(ValueError, match="rng"):
        Niches([0.0], 1.0, rng=7)
    one = search()
    with pytest.raises(ValueError, match="inf"):
        one.tell(one.ask(), np.inf)
    with pytest.raises(ValueError, match="state is of 'PoWER'"):
        Niches.from_state(PoWER([0.0], 1.0, rng=np.random.default_rng(0)).state())


def test_the_model_of_a_niche_finds_the_top_of_a_drifting_quadratic():
    hessian, top, rng = (
        np.array([[-3.0, 1.0], [1.0, -2.0]]),
        np.array([0.1, -0.2]),
        np.random.default_rng(0),
    )
    niche = Niche(0, np.zeros(2), 0.3, np.zeros((2, 2)))
    for number in range(60):
        place = niche.draw(rng)
        away = place - top
        niche.tell(
            (number, place, 5.0 + 0.01 * number + 0.5 * away @ hessian @ away, 0.0),
            1.0,
            1,
            np.inf,
            LIMITS,
        )
    np.testing.assert_allclose(niche.centre, top, atol=1e-3)
    np.testing.assert_allclose(niche.hessian, hessian, rtol=0.05, atol=0.05)
    assert niche.settled and niche.value == pytest.approx(5.59, abs=0.02)


def test_the_draws_of_a_niche_have_the_covariance_of_its_radius():
    rng, niche = (
        np.random.default_rng(0),
        Niche(0, np.array([1.0, 2.0, 3.0]), 0.5, np.zeros((3, 3))),
    )
    points = np.array([niche.draw(rng) for _ in range(20000)])
    np.testing.assert_allclose(points.mean(axis=0), [1, 2, 3], atol=0.02)
    np.testing.assert_allclose(np.cov(points.T), 0.25 * np.eye(3), atol=0.01)


def test_the_surrogate_is_the_posterior_of_a_gaussian_process():
    rng = np.random.default_rng(0)
    points, values, ages = rng.normal(size=(12, 2)), rng.normal(size=12), rng.uniform(0, 2, 12)
    surrogate = Surrogate(points, values, ages, np.ones(12))
    places = rng.normal(size=(3, 2))
    everything, when = np.vstack([points, places]), np.concatenate([ages, np.zeros(3)])
    squares = np.square(everything[:, None] - everything).sum(axis=2)
    joint = surrogate.relief**2 * np.exp(
        -squares / (2 * surrogate.length**2) - np.abs(when[:, None] - when)
    )
    noise = surrogate.relief**2 * (10.0 ** (surrogate.indices[1] - 4) + 1e-8)
    seen, across = joint[:12, :12] + noise * np.eye(12), joint[12:, :12]
    ones = np.ones(12)
    level = ones @ np.linalg.solve(seen, values) / (ones @ np.linalg.solve(seen, ones))
    mean, deviation = surrogate.predict(places)
    np.testing.assert_allclose(
        mean, level + across @ np.linalg.solve(seen, values - level), rtol=1e-6
    )
    variance = np.diag(joint[12:, 12:] - across @ np.linalg.solve(seen, across.T))
    np.testing.assert_allclose(deviation, np.sqrt(variance), rtol=1e-6)


def test_what_the_surrogate_saw_of_broad_hills_tells_less_of_sharp_ones():
    points, values, ones = (
        np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]),
        np.array([5.0, -1.0, 0.0]),
        np.ones(3),
    )
    sharp, broad = (
        Surrogate(points, values, 0 * ones, ones, lengths=lengths, now=0.35)
        for lengths in (0.35 * ones, 1.4 * ones)
    )
    assert sharp.predict(points)[1].max() < 0.1 * sharp.relief
    left = np.sqrt(1 - (2 * 4 / (1 + 16)) ** 4)
    far = Surrogate(100 * points, values, 0 * ones, ones, lengths=1.4 * ones, now=0.35)
    np.testing.assert_allclose(far.predict(100 * points)[1], left * far.relief, rtol=1e-3)
    assert broad.predict(points)[1].min() > 0.5 * broad.relief


def test_the_covariance_of_the_surrogate_is_positive_whatever_the_lengths():
    rng = np.random.default_rng(0)
    for d in (1, 2, 5):
        points, lengths = rng.normal(size=(60, d)), rng.uniform(0.1, 2, 60)
        surrogate = Surrogate(
            points, rng.normal(size=60), np.zeros(60), np.ones(60), lengths=lengths, now=0.5
        )
        squares = np.square(points[:, None] - points).sum(axis=2)
        kernel = surrogate._kernel(squares, lengths[:, None])
        np.testing.assert_allclose(kernel, kernel.T, atol=1e-12)
        assert np.linalg.eigvalsh(kernel).min() > -1e-9 and np.allclose(np.diag(kernel), 1)


def test_a_trend_is_the_line_through_exact_visits_and_stays_uncertain_ahead():
    visits = [(clock, 3.0 - 0.1 * clock, 1e-9) for clock in (1.0, 1.01)]
    value, deviation = forecast(visits, 1.01, 0.2)
    assert value == pytest.approx(3.0 - 0.101) and deviation < 1e-4
    value, deviation = forecast(visits, 3.01, 0.2)
    assert 3.0 - 0.301 < value < 3.0 - 0.101 and deviation > 0.1 * 2


def test_a_trend_of_one_visit_is_level_and_as_uncertain_as_drift_and_its_error():
    value, deviation = forecast([(4.0, -1.0, 0.3)], 7.0, 0.2)
    assert value == -1.0
    assert deviation == pytest.approx(np.sqrt(0.3**2 + (3 * 0.2) ** 2 + (3 * 0.1) ** 2))


def test_the_trend_is_the_posterior_of_linear_regression():
    visits, drift = [(1.0, 0.5, 0.2), (2.0, 0.1, 0.1), (4.0, 0.2, 0.3)], 0.4
    clocks, values, errors = np.array(visits).T
    ages = clocks - 4.0
    # covariance of the line at the visits, its height unknown
    prior = 1e6 + drift**2 * np.outer(ages, ages)
    noise = np.diag(errors**2 + (0.5 * drift * ages) ** 2)
    ahead = 1e6 + drift**2 * 2.0 * ages
    expected = ahead @ np.linalg.solve(prior + noise, values)
    variance = (
        1e6
        + (drift * 2.0) ** 2
        - ahead @ np.linalg.solve(prior + noise, ahead)
        + (0.5 * drift * 2.0) ** 2
    )
    value, deviation = forecast(visits, 6.0, drift)
    assert value == pytest.approx(expected, rel=1e-4) and deviation**2 == pytest.approx(
        variance, rel=1e-4
    )


def test_the_surrogate_forgets_what_is_old():
    points, values = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]), np.array([5.0, -1.0, 0.0])
    place = points[:1]
    new, old = (
        Surrogate(points, values, np.array([age, 0.0, 0.0]), np.ones(3)) for age in (0.0, 20.0)
    )
    assert (
        new.predict(place)[0] == pytest.approx(5.0, abs=0.1)
        and abs(old.predict(place)[0] - 5.0) > 1.0
    )
    assert new.predict(place)[1] < 0.1 * new.relief and old.predict(place)[1] > 0.9 * old.relief
