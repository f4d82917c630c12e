"""What repeats in the misses of a thrower is learned and taken out; accidents are not, and changes
are noticed.
"""

from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dart_skill.common.surface import RIMS
from dart_skill.mixture import Gaussian
from dart_skill.movement import turn_matrix
from dart_skill.skills.learning import configuration, landing_if_late, learn_throwing
from dart_skill.skills.practice import (
    DIFFERENCES,
    NOISES,
    SHARES,
    USUAL_SCATTER,
    Correction,
    CorrectionSettings,
    NewtonCorrection,
    polar,
    repeatable_miss,
)


def places(n, rng):
    return np.column_stack([rng.uniform(1.5, 2.5, n), rng.uniform(-0.8, 0.8, n)])


def told(function, n, noise, seed):
    """A correction that was told n throws of a thrower who misses by a function of the place, and
    by noise.
    """
    rng = np.random.default_rng(seed)
    correction = Correction()
    for place in places(n, rng):
        correction.add(place, function(place) + noise * rng.standard_normal(2))
    return correction


def crooked(place):
    """Misses 12 cm short on average, more for far baskets, and drifts to one side with the
    azimuth.
    """
    return np.array([-0.12 - 0.05 * (place[0] - 2.0), 0.03 * np.sin(2.0 * place[1])])


def test_knows_nothing_before_the_first_throw():
    mean, deviation = Correction().predict([[2.0, 0.0]])
    np.testing.assert_array_equal(mean, [[0.0, 0.0]])
    np.testing.assert_allclose(
        deviation, [[np.sqrt((0.01**2 + 0.03**2 + 0.1**2 + 0.3**2) / 4)] * 2]
    )
    np.testing.assert_array_equal(Correction().shifted([2.0, 0.5, 0.4]), [2.0, 0.5, 0.4])


def test_learns_a_function_of_the_place():
    correction = told(crooked, 25, 0.004, seed=0)
    new = places(50, np.random.default_rng(1))
    error = correction.predict(new)[0] - np.array([crooked(place) for place in new])
    assert np.sqrt(np.mean(error**2)) < 0.004, (
        "25 throws that each vary by 4 mm tell the function to less than that"
    )


def rough(place):
    """Misses that change from one distance to the next, and are the same all around."""
    return 0.01 * np.array([np.sin(40.0 * place[0]), np.cos(25.0 * place[0])])


def covariance(offset, places, difference, scale):
    """Of repeatable misses at places (n, 2), written out from the definition of the process."""
    apart = (places[:, None] - places) / np.array(scale)
    return offset**2 + difference**2 * np.exp(-0.5 * np.sum(apart**2, axis=2))


def averaged(correction, new):
    """Mean and variance (2,) at a new place, averaged by conditioning the joint density of every
    hypothesis (Table 3.1) in turn; and the expected share.
    """
    settings, known, told = correction.settings, correction.throws[:, :2], correction.throws
    rows = []
    scales = list(product(settings.lengths, settings.turns))
    for share, noise, difference, offset, scale in product(
        SHARES, NOISES, DIFFERENCES, settings.offsets, scales
    ):
        joint = covariance(offset, np.vstack([known, new]), difference, scale) + np.diag(
            [*[noise**2] * len(known), 0.0]
        )
        prior = (
            -0.1 * np.log2(noise / USUAL_SCATTER) ** 2 - np.log2(difference / USUAL_SCATTER) ** 2
        )
        for axis in range(2):
            misses = told[:, 2 + axis] - share * told[:, 4 + axis]
            density = multivariate_normal.logpdf(misses, cov=joint[:-1, :-1]) + prior
            fit = Gaussian(np.zeros(len(joint)), joint).condition(range(len(known)), misses)
            rows.append((axis, share, density, fit.mean[0], fit.covariance[0, 0]))
    axis, share, density, mean, variance = np.array(rows).T
    weight = np.exp(density - density.max())
    of_share = np.array(
        [np.prod([weight[(share == one) & (axis == a)].sum() for a in range(2)]) for one in SHARES]
    )
    of_share /= of_share.sum()
    means, variances = np.zeros(2), np.zeros(2)
    for a, (one, probability) in product(range(2), zip(SHARES, of_share, strict=True)):
        own = (axis == a) & (share == one)
        weights = probability * weight[own] / weight[own].sum()
        means[a] += weights @ mean[own]
        variances[a] += weights @ (variance[own] + mean[own] ** 2)
    return means, variances - means**2, float(of_share @ SHARES)


@pytest.mark.parametrize("function", [crooked, rough])
def test_is_the_average_of_all_hypotheses_by_their_evidence(function):
    rng, new = np.random.default_rng(2), np.array([1.7, 0.3])
    correction = Correction(
        CorrectionSettings(offsets=(0.02, 0.1), lengths=(0.1, 0.4), turns=(3.0,))
    )
    for place in places(6, rng):
        late = 0.01 * rng.standard_normal(2)
        correction.add(place, function(place) + 0.004 * rng.standard_normal(2) + 0.7 * late, late)
    mean, deviation = correction.predict(new)
    means, variances, share = averaged(correction, new)
    np.testing.assert_allclose(mean[0], means, atol=1e-9)
    np.testing.assert_allclose(deviation[0] ** 2, variances, rtol=1e-6, atol=1e-12)
    assert correction.share == pytest.approx(share)


@pytest.mark.parametrize("scatter", [0.002, 0.01, 0.05])
def test_the_scatter_of_the_throws_is_told_from_them(scatter):
    correction = told(crooked, 60, scatter, seed=11)
    assert np.all(np.abs(np.log2(correction.noise / scatter)) < 0.6), correction.noise


@pytest.mark.parametrize("true", [0.0, 1.0])
def test_the_throws_tell_whether_the_instant_of_the_release_explains_anything(true):
    """Seen well, a late release explains its part of the miss; seen badly, what is computed from
    it is noise.
    """
    rng, correction = np.random.default_rng(12), Correction()
    for place in places(30, rng):
        late = 0.008 * rng.standard_normal(2)
        correction.add(place, crooked(place) + 0.003 * rng.standard_normal(2) + true * late, late)
    assert abs(correction.share - true) < 0.1, correction.share
    new = places(50, rng)
    error = correction.predict(new)[0] - np.array([crooked(place) for place in new])
    assert np.sqrt(np.mean(error**2)) < 0.003


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.02, 0.05])
def test_scatter_is_not_learned(scatter):
    """Of a thrower who misses nothing again and again: what three, ten or thirty throws pretend is
    small, on average over 40 throwers. The mean miss alone, for a learner who knows that places do
    not differ, would be off by a share 1/n of the scatter's variance.
    """
    rng = np.random.default_rng(13)
    for n in (3, 10, 30):
        wrong = []
        for _ in range(40):
            correction = Correction()
            for place in places(n, rng):
                correction.add(place, scatter * rng.standard_normal(2))
            wrong.append(np.mean(correction.predict(places(20, rng))[0] ** 2))
        assert np.mean(wrong) < 2.5 * scatter**2 / n, (n, np.sqrt(np.mean(wrong)))


def test_a_miss_that_changes_from_one_distance_to_the_next_is_learned_all_around():
    """Forty throws at any azimuth tell the curve over the distance to a few millimetres."""
    correction = told(rough, 40, 0.001, seed=9)
    new = places(50, np.random.default_rng(10))
    error = correction.predict(new)[0] - np.array([rough(place) for place in new])
    assert np.sqrt(np.mean(error**2)) < 0.0025, np.sqrt(np.mean(error**2))


def test_a_plan_for_the_shifted_point_comes_down_on_the_target():
    correction, target = told(crooked, 25, 0.002, seed=3), np.array([1.4, 1.2, 0.4])
    point = correction.shifted(target)
    comes_down = point[:2] + turn_matrix(polar(point)[1])[:2, :2] @ crooked(polar(point))
    assert np.linalg.norm(comes_down - target[:2]) < 0.005
    assert point[2] == target[2]


def test_an_accident_is_not_learned():
    correction = told(crooked, 10, 0.004, seed=4)
    before = correction.predict([[2.0, 0.0]])[0]
    correction.add([2.0, 0.1], [0.5, -0.4])
    correction.add([1.8, 0.2], crooked([1.8, 0.2]))
    np.testing.assert_allclose(correction.predict([[2.0, 0.0]])[0], before, atol=0.003)
    assert correction.n_forgotten == 0 and len(correction) == 11


@pytest.mark.parametrize("seed", range(20))
def test_throws_that_are_all_alike_are_no_change(seed):
    """Whatever the first ones happen to be: by chance three throws may agree to a tenth of what
    throws vary by.
    """
    correction = told(crooked, 12, 0.004, seed)
    assert correction.n_forgotten == 0


def test_a_change_is_noticed_at_its_second_throw():
    """A heavier ball: everything falls 20 cm shorter from now on."""
    correction = told(crooked, 30, 0.004, seed=5)
    for place in ([2.0, 0.1], [1.7, -0.4]):
        correction.add(place, crooked(place) + [-0.2, 0.0])
    assert correction.n_forgotten == 1 and len(correction) == 2
    left = correction.predict([[1.9, 0.0]])[0][0] - crooked([1.9, 0.0]) - [-0.2, 0.0]
    assert np.abs(left).max() < 0.02


def test_one_place_where_throws_go_wrong_changes_nothing_elsewhere():
    """Far baskets at one side are missed by 30 cm, again and again: the arm is the same."""
    correction = told(crooked, 30, 0.004, seed=7)
    before = correction.predict([[1.6, -0.6]])[0]
    for place in ([2.6, 0.9], [2.65, 0.85], [2.55, 0.95]):
        correction.add(place, crooked(place) + [0.0, 0.3])
    np.testing.assert_allclose(correction.predict([[1.6, -0.6]])[0], before, atol=0.02)
    assert correction.n_forgotten == 0


def test_surprises_in_opposite_directions_are_two_accidents():
    correction = told(crooked, 10, 0.004, seed=6)
    correction.add([2.0, 0.0], [0.4, 0.0])
    correction.add([2.0, 0.0], [-0.6, 0.0])
    assert correction.n_forgotten == 0 and len(correction) == 10


def test_only_the_latest_throws_are_remembered_and_no_plan_is_moved_too_far():
    correction = Correction(CorrectionSettings(memory=5, farthest=0.2))
    for _ in range(8):
        correction.add([2.0, 0.0], [-1.0, 0.0])
    assert len(correction) == 5
    assert np.linalg.norm(correction.shifted([2.0, 0.0, 0.4]) - [2.0, 0.0, 0.4]) == pytest.approx(
        0.2
    )


@pytest.mark.parametrize("miss", [[np.nan, 0.0], [0.1], [np.inf, 0.0]])
def test_a_miss_that_is_no_miss_is_refused(miss):
    with pytest.raises(ValueError, match="was the landing seen"):
        Correction().add([2.0, 0.0], miss)


@pytest.mark.parametrize(
    "values",
    [
        {"offsets": (0.0,)},
        {"offsets": ()},
        {"lengths": (0.5, -1.0)},
        {"lengths": ()},
        {"turns": (0.0,)},
        {"turns": ()},
        {"memory": 0},
        {"surprise": np.nan},
    ],
)
def test_settings_that_make_no_sense_are_refused(values):
    with pytest.raises(ValueError, match="finite positive"):
        CorrectionSettings(**values)


def test_a_plan_sends_the_ball_where_it_says(demonstrations):
    plan = learn_throwing(demonstrations).plan(demonstrations[0].target)
    np.testing.assert_allclose(landing_if_late(plan, 0.0), plan.thrown.landing, atol=2e-3)


def test_a_late_release_explains_its_part_of_the_miss(demonstrations):
    """The hand opens 5 ms late: the ball comes down elsewhere by centimetres, and nothing of it is
    the place's fault.
    """
    plan = learn_throwing(demonstrations, configuration("shown_release")).plan(
        demonstrations[0].target
    )
    where = landing_if_late(plan, 0.005)
    assert np.linalg.norm(where - landing_if_late(plan, 0.0)) > 0.01
    place, miss, explained = repeatable_miss(
        plan, where + turn_matrix(polar(plan.thrown.target)[1]) @ [0.03, -0.01, 0.0], 0.005
    )
    np.testing.assert_allclose(place, polar(plan.thrown.target), atol=2e-3)
    np.testing.assert_allclose(miss - explained, [0.03, -0.01], atol=1e-4)
    _, unseen, explained = repeatable_miss(plan, where, np.nan)
    assert np.linalg.norm(unseen) > 0.01 and not explained.any(), (
        "a release that nobody saw counts as one on time"
    )


def test_a_release_where_the_ball_flies_farthest_leaves_little_to_explain(demonstrations):
    """Early or late, the ball comes down a little nearer: by a square of the time, so that half of
    it is a quarter.
    """
    plan = learn_throwing(demonstrations).plan(demonstrations[0].target)
    short = {
        late: polar(landing_if_late(plan, 0.0))[0] - polar(landing_if_late(plan, late))[0]
        for late in (-0.01, -0.005, 0.005, 0.01)
    }
    assert all(0.0 < value < 0.012 for value in short.values()), short
    for side in (-1, 1):
        assert short[side * 0.01] / short[side * 0.005] == pytest.approx(4.0, rel=0.25), short


def test_a_newton_step_lands_on_the_target_where_the_miss_is_the_same_everywhere():
    target, miss = np.array([2.0, 0.5, 0.4]), np.array([-0.12, 0.03])
    newton = NewtonCorrection()
    np.testing.assert_array_equal(newton.shifted(target), target)
    newton.add(RIMS.coordinates(target), miss)
    aim = newton.shifted(target)
    np.testing.assert_allclose(aim + RIMS.offset(miss, aim), target, atol=0.003)


def test_newtons_steps_converge_where_the_miss_depends_on_the_aim():
    target, newton, left = np.array([2.0, 0.5, 0.4]), NewtonCorrection(), []
    for _ in range(6):
        aim = newton.shifted(target)
        place = RIMS.coordinates(aim)
        landing = aim + RIMS.offset(crooked(place), aim)
        left.append(np.linalg.norm(landing - target))
        newton.add(place, crooked(place))
    assert np.all(np.diff(left) < 0.0) and left[0] > 0.1 and left[-1] < 1e-4, left


def test_newton_forgets_all_but_the_last_throw_and_refuses_what_is_not_finite():
    newton = NewtonCorrection()
    newton.remember(np.arange(12.0).reshape(2, 6) / 100.0)
    np.testing.assert_allclose(newton.throws, [np.arange(6, 12) / 100.0])
    np.testing.assert_allclose(newton.predict([[1.0, 0.0], [2.0, 0.0]])[0], [[0.08, 0.09]] * 2)
    with pytest.raises(ValueError, match="finite"):
        newton.add(np.array([2.0, 0.0]), np.array([np.nan, 0.0]))
    assert len(newton) == 1
