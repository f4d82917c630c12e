"""Rewards blurred by a scatter that shrinks: hills that overtake as they sharpen, the process that
foretells them, and what is promised of every search.
"""

import json

import numpy as np
import pytest
import scipy

from dart_skill.policy_search import BlurredNoise, PoWER, Sharpening

SEEDS = range(3)
BROAD, SHARP = np.array([-0.5, -0.3]), np.array([0.9, 0.7])


def search(seed=0, d=2, **options):
    return Sharpening(np.zeros(d), 1.0, rng=np.random.default_rng(seed), **options)


def blurred_hill(point, top, mass, width, variance):
    """A Gaussian of that width, seen through a blur of that variance."""
    both = width**2 + variance
    return mass / both * np.exp(-0.5 * np.sum((np.asarray(point) - top) ** 2) / both)


def variance_at(time):
    """The length of the blur falls linearly from 1 to 0.15."""
    return (1 - 0.85 * time) ** 2


def landscape(point, time):
    """The sharp hill has half the mass of the broad one, and overtakes it when the blur is down to
    about 0.4.
    """
    return blurred_hill(point, BROAD, 10.0, 0.5, variance_at(time)) + blurred_hill(
        point, SHARP, 5.0, 0.1, variance_at(time)
    )


def learnt(one, landscape=landscape, n_trials=1500, first=0, whole=1500):
    for n in range(first, first + n_trials):
        trial = one.ask()
        one.tell(trial, landscape(trial.parameters, n / whole))
    return one


@pytest.mark.slow
def test_a_low_hill_that_overtakes_as_it_sharpens_is_found_and_a_single_gaussian_misses_it():
    assert landscape(BROAD, 0.5) > landscape(SHARP, 0.5) and landscape(SHARP, 0.9) > landscape(
        BROAD, 0.9
    )
    at_the_sharp_one = {"sharpening": 0, "power": 0}
    for seed in SEEDS:
        power = PoWER(np.zeros(2), 1.0, rng=np.random.default_rng(seed), limits=(0.03, 10.0))
        for name, one in (("sharpening", search(seed)), ("power", power)):
            at_the_sharp_one[name] += np.linalg.norm(learnt(one).parameters - SHARP) < 0.05
    assert at_the_sharp_one == {"sharpening": len(SEEDS), "power": 0}


def test_how_far_trials_scatter_is_told_from_the_rise_of_the_top():
    one = search(1)
    for part in range(10):
        learnt(one, first=100 * part, n_trials=100)
        assert one.blur == pytest.approx(np.sqrt(variance_at(part / 15 + 1 / 15)), abs=0.05)


def alone(point, time):
    """A hill that sharpens where nothing can overtake it."""
    return blurred_hill(point, BROAD, 10.0, 0.3, variance_at(time))


def followed_alone(**settings):
    """The search after 1000 trials on that hill, and what each of them lost, scouts (n,) apart."""
    one, lost, scouted = search(2, **settings), [], []
    for n in range(1000):
        trial = one.ask()
        scouted += [np.linalg.norm(trial.parameters - one.parameters) > 0.5]
        earned = alone(trial.parameters, n / 1000)
        lost += [alone(BROAD, n / 1000) - earned]
        one.tell(trial, earned)
    return one, np.array(lost), np.array(scouted)


def test_scouts_cost_little_and_are_few_where_nothing_can_overtake():
    one, lost, scouted = followed_alone(insurance=0.0)
    assert (
        np.linalg.norm(one.parameters - BROAD) < 0.01
        and scouted.sum() < 100
        and lost.mean() < 0.25
    ), (scouted.sum(), lost.mean())


def test_scouts_without_hope_cost_what_the_insurance_pays_and_no_more():
    rise = alone(BROAD, 1.0) - alone(BROAD, 0.0)
    hopeful, insured = (followed_alone(insurance=insurance) for insurance in (0.0, 4.0))
    assert np.linalg.norm(insured[0].parameters - BROAD) < 0.01
    assert (
        0.5 * 4.0 * rise < insured[1][insured[2]].sum() < 4.0 * rise + hopeful[1][hopeful[2]].sum()
    )


def points_and_blurs(seed, n=25, d=2):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, d)), rng.uniform(0.05, 1.0, n), rng.normal(size=n)


def dense(first, first_blurs, second, second_blurs, reference):
    """The covariance, entry by entry, as products of normal densities."""
    d = first.shape[1]
    covariance = np.empty((len(first), len(second)))
    for i, j in np.ndindex(*covariance.shape):
        both = (first_blurs[i] + second_blurs[j]) * np.eye(d)
        covariance[i, j] = scipy.stats.multivariate_normal(first[i], both).pdf(second[j]) * (
            4 * np.pi * reference
        ) ** (d / 2)
    return covariance


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_process_is_the_dense_posterior_with_an_unknown_mean(d):
    (points, blurs, values), places, error, blur = (
        points_and_blurs(0, d=d),
        points_and_blurs(1, 7, d)[0],
        1e-3,
        0.3,
    )
    process = BlurredNoise(points, blurs, values, error)
    covariance = dense(points, blurs, points, blurs, blurs[-1])
    covariance += np.diag((error + 1e-9) * covariance.diagonal())
    across = dense(places, np.full(7, blur), points, blurs, blurs[-1])
    ones, inverse = np.ones(len(values)), np.linalg.inv(covariance)
    mean = ones @ inverse @ values / (ones @ inverse @ ones)
    variance = (values - mean) @ inverse @ (values - mean) / (len(values) - 1)
    prior = (blurs[-1] / blur) ** (d / 2)
    left = (
        prior
        - np.sum(across @ inverse * across, axis=1)
        + (1 - across @ inverse @ ones) ** 2 / (ones @ inverse @ ones)
    )
    got = process.predict(places, blur)
    np.testing.assert_allclose(got[0], mean + across @ inverse @ (values - mean), rtol=1e-6)
    np.testing.assert_allclose(got[1], np.sqrt(variance * left), rtol=1e-6)
    assert process.mean == pytest.approx(mean, rel=1e-6) and process.variance == pytest.approx(
        variance, rel=1e-6
    )


def test_its_likelihood_is_that_of_all_contrasts_of_the_values():
    points, blurs, values = points_and_blurs(2, 12)
    contrasts = scipy.linalg.null_space(np.ones((1, 12))).T
    differences = []
    for error in (1e-4, 1e-2):
        process = BlurredNoise(points, blurs, values, error)
        covariance = dense(points, blurs, points, blurs, blurs[-1])
        covariance += np.diag((error + 1e-9) * covariance.diagonal())
        seen = scipy.stats.multivariate_normal(
            np.zeros(11), process.variance * contrasts @ covariance @ contrasts.T
        )
        differences.append(process.log_likelihood - seen.logpdf(contrasts @ values))
    assert differences[0] == pytest.approx(differences[1], abs=1e-6)


def test_the_covariance_is_that_of_one_white_noise_seen_through_two_blurs():
    grid, (first, second), (near, far) = np.linspace(-15, 15, 6001), (0.3, 1.1), (0.2, 0.9)
    weights = [
        scipy.stats.norm(x, np.sqrt(b)).pdf(grid) for x, b in ((near, first), (far, second))
    ]
    norm = np.sum(scipy.stats.norm(0, np.sqrt(second)).pdf(grid) ** 2)
    process = BlurredNoise(
        np.array([[5.0], [far]]), np.array([1.0, second]), np.array([0.0, 1.0]), 0.0
    )
    kernel = process._kernel(np.array([[near]]), np.array([first]))[0, 1]
    assert kernel == pytest.approx(np.sum(weights[0] * weights[1]) / norm, rel=1e-9)


def test_what_is_foretold_obeys_the_heat_equation():
    points, blurs, values = points_and_blurs(3)
    process, place, blur, h = (
        BlurredNoise(points, blurs, values, 1e-2),
        np.array([0.3, -0.2]),
        0.4,
        1e-2,
    )
    cross = place + h * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    heights = process.predict(cross, blur)[0]
    rise = np.diff([process.predict(place[None], blur + side * h**2)[0][0] for side in (-1, 1)])[
        0
    ] / (2 * h**2)
    assert rise == pytest.approx(0.5 * (heights[1:].sum() - 4 * heights[0]) / h**2, rel=1e-2)


def test_what_was_seen_broadly_leaves_more_doubt_the_sharper_the_view():
    points, _, values = points_and_blurs(4)
    process = BlurredNoise(points, np.full(25, 0.5), values, 1e-4)
    doubts = [process.predict(np.zeros((1, 2)), blur)[1][0] for blur in (0.5, 0.3, 0.1, 0.05)]
    assert (np.diff(doubts) > 0).all(), doubts


@pytest.mark.parametrize("d", [1, 3, 5])
def test_a_bowl_of_any_dimension_is_climbed(d):
    target = np.full(d, 0.3)
    one = search(0, d)
    one.maximise(lambda point: -np.sum((point - target) ** 2), 150 * d)
    np.testing.assert_allclose(one.parameters, target, atol=0.02)


def test_nothing_but_the_units_changes_with_the_units():
    metres = learnt(search(2), n_trials=200)
    millimetres = Sharpening(np.zeros(2), 1024.0, rng=np.random.default_rng(2))
    learnt(millimetres, lambda point, time: landscape(point / 1024.0, time), 200)
    np.testing.assert_array_equal(millimetres.parameters, 1024.0 * metres.parameters)


def test_returns_may_have_any_scale():
    plain, scaled = (
        learnt(search(2), n_trials=300),
        learnt(search(2), lambda *where: 1024.0 * landscape(*where), 300),
    )
    np.testing.assert_allclose(scaled.parameters, plain.parameters, atol=1e-3)


def test_a_saved_search_goes_on_with_the_very_same_trials(tmp_path):
    for n_trials in (5, 23, 301, 404):
        one = learnt(search(4), n_trials=n_trials)
        waiting = one.ask()
        one.save(tmp_path / "search.json")
        again = Sharpening.load(tmp_path / "search.json")
        for each in (one, again):
            each.tell(waiting.number, landscape(waiting.parameters, n_trials / 1500))
            learnt(each, n_trials=100, first=n_trials + 1)
        assert json.dumps(one.state()) == json.dumps(again.state())


def test_trials_may_be_open_together_fail_and_be_told_in_any_order():
    one, order = search(5), np.random.default_rng(0)
    for part in range(60):
        trials = [one.ask() for _ in range(8)]
        for index in order.permutation(8):
            failed = order.random() < 0.1
            one.tell(
                trials[index],
                np.nan if failed else landscape(trials[index].parameters, part / 180),
            )
    assert one.n_failed > 20 and one.n_told + one.n_failed == 480
    last = [landscape(place, 59 / 180) for place in (one.parameters, BROAD)]
    assert last[0] > last[1] - 0.1, last


@pytest.mark.parametrize(
    "options, message",
    [
        ({"optimism": -1.0}, "optimism"),
        ({"grain": 0.0}, "grain"),
        ({"every": 0}, "every"),
        ({"clearing": np.nan}, "clearing"),
        ({"reach": -1.0}, "reach"),
        ({"limits": (2.0, 3.0)}, "limits"),
    ],
)
def test_options_out_of_range_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        search(**options)
