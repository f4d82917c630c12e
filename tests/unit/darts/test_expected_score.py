"""Expected scores: the exact integral against quadrature over the beds, closed forms and random
darts; the fast map against that.
"""

import subprocess
import sys

import numpy as np
import pytest
from scipy.stats import ncx2

from dart_skill.darts import (
    BED_SCORES,
    RADII,
    Spread,
    bed_at,
    bed_moments,
    bed_probabilities,
    expected_score,
    heat_map,
    score,
    score_derivatives,
)
from tests.unit.darts import reference

AIMS = np.array(
    [
        [0.0, 0.0],
        [0.0, 103.0],
        [-35.0, -99.0],
        [60.3, -140.2],
        [0.0, 99.0],
        [150.0, 90.0],
        [-250.0, 30.0],
    ]
)
SLANTED = np.array([[500.0, -160.0], [-160.0, 120.0]])


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize(
    "covariance",
    [16.0**2 * np.eye(2), 5.0**2 * np.eye(2), 64.6**2 * np.eye(2), SLANTED],
    ids=["16", "5", "64.6", "slanted"],
)
def test_exact_expected_score_agrees_with_quadrature_over_the_beds(covariance):
    found, wanted = expected_score(AIMS, covariance), reference.expected_score(AIMS, covariance)
    assert np.abs(found - wanted).max() < 1e-9, (found, wanted)


def test_a_bias_moves_the_aim():
    spread = Spread(SLANTED, [12.0, -7.0])
    assert expected_score(AIMS, spread) == pytest.approx(
        reference.expected_score(AIMS, SLANTED, [12.0, -7.0]), abs=1e-9
    )


@pytest.mark.parametrize("sigma", [0.5, 3.0, 27.0, 100.0])
def test_probabilities_of_discs_are_those_of_the_noncentral_chi_square(sigma):
    for aim in AIMS:
        beds = bed_probabilities(aim, sigma)
        rings = [beds[0], beds[1], *beds[2:82].reshape(4, 20).sum(axis=1)]
        discs = ncx2.cdf((RADII / sigma) ** 2, 2, aim @ aim / sigma**2)
        assert np.cumsum(rings) == pytest.approx(discs, abs=1e-11)
        assert beds.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_centred_isotropic_spread_treats_all_sectors_alike():
    sigma = 20.0
    rings = bed_probabilities([0.0, 0.0], sigma)[2:82].reshape(4, 20)
    reach = np.exp(-0.5 * (RADII / sigma) ** 2)
    assert rings == pytest.approx(
        np.repeat((reach[1:5] - reach[2:6])[:, None] / 20.0, 20, axis=1), abs=1e-14
    )


def test_expected_score_is_the_probabilities_times_the_scores():
    assert bed_probabilities(AIMS, SLANTED) @ BED_SCORES == pytest.approx(
        expected_score(AIMS, SLANTED), abs=1e-11
    )


def test_a_narrow_spread_scores_what_is_aimed_at_and_half_on_a_wire():
    assert expected_score([[0.0, 103.0], [0.0, 0.0], [0.0, 130.0]], 0.2) == pytest.approx(
        [60.0, 50.0, 20.0], abs=1e-9
    )
    assert expected_score([0.0, 99.0], 0.2) == pytest.approx(0.5 * (60 + 20), abs=0.05)


def test_random_darts_score_the_expectation_on_average(rng):
    spread = Spread(SLANTED, [4.0, 9.0])
    scores = score(spread.throw(np.tile([-40.0, -80.0], (200_000, 1)), rng))
    error = scores.std() / np.sqrt(len(scores))
    assert scores.mean() == pytest.approx(expected_score([-40.0, -80.0], spread), abs=4.5 * error)


@pytest.mark.parametrize("sigma", [5.0, 75.0])
def test_far_off_the_board_nothing_is_expected_and_never_less(sigma, rng):
    aims = rng.uniform(-3000.0, 3000.0, (2000, 2))
    expected = expected_score(aims, sigma)
    assert expected.min() >= 0.0 and expected[np.hypot(*aims.T) > 1000.0].max() < 1e-9


def test_derivatives_are_those_of_the_quadrature():
    step = 0.05
    offsets = step * np.array(
        [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1], [0, 0]]
    )
    right, left, up, down, up_right, down_left, down_right, up_left, here = (
        reference.expected_score(AIMS[2] + offsets, SLANTED)
    )
    local = score_derivatives(AIMS[2:3], Spread(SLANTED))
    gradient = [(right - left) / (2 * step), (up - down) / (2 * step)]
    mixed = (up_right + down_left - down_right - up_left) / (4 * step**2)
    hessian = [
        [(right - 2 * here + left) / step**2, mixed],
        [mixed, (up - 2 * here + down) / step**2],
    ]
    assert local.gradient[0] == pytest.approx(gradient, abs=1e-5)
    assert local.hessian[0] == pytest.approx(np.array(hessian), abs=1e-5)


def test_moments_in_the_beds_are_those_of_random_darts(rng):
    mean, n = np.array([20.0, 60.0]), 200_000
    impacts = Spread(SLANTED).throw(np.tile(mean, (n, 1)), rng)
    beds, offset = bed_at(impacts), impacts - mean
    moments = bed_moments(mean, SLANTED)
    for bed in np.argsort(-moments.probability)[:6]:
        inside = (beds == bed)[:, None] * offset
        assert moments.first[bed] == pytest.approx(
            inside.mean(axis=0), abs=5 * inside.std(axis=0).max() / np.sqrt(n)
        )
        products = np.einsum("ni,nj->nij", inside, offset)
        assert np.abs(moments.second[bed] - products.mean(axis=0)).max() < 5 * products.std(
            axis=0
        ).max() / np.sqrt(n)


def test_moments_of_all_beds_together_are_those_of_the_whole_gaussian():
    moments = bed_moments(np.array([120.0, -90.0]), SLANTED)
    assert moments.probability.sum() == pytest.approx(1.0, abs=1e-12)
    assert moments.first.sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert moments.second.sum(axis=0) == pytest.approx(SLANTED, abs=1e-8)


@pytest.mark.parametrize(
    "sigma, allowed", [(5.0, 0.025), (8.0, 0.005), (16.0, 0.0005), (64.6, 1e-4)]
)
def test_the_fast_map_is_as_accurate_as_documented(sigma, allowed, rng):
    """Required: 0.1 points at 5 mm, 0.02 at 16 mm."""
    heat = heat_map(sigma)
    rows, columns = rng.integers(0, 341, (2, 1500))
    exact = expected_score(np.column_stack([heat.x[columns], heat.y[rows]]), sigma)
    assert np.abs(heat.expected_score[rows, columns] - exact).max() < allowed


def test_the_fast_map_agrees_with_quadrature_over_the_beds():
    heat = heat_map(16.0)
    aims = np.array([[0, 103], [-35, -99], [-2, 106], [100, 100], [-170, 170], [0, 0]])
    assert heat.expected_score[aims[:, 1] + 170, aims[:, 0] + 170] == pytest.approx(
        reference.expected_score(aims, 256.0 * np.eye(2)), abs=5e-4
    )


@pytest.mark.parametrize("spacing", [2.0, 5.0])
@pytest.mark.parametrize("sigma", [6.0, 80.0])
def test_a_slanted_biased_spread_on_any_grid(spacing, sigma, rng):
    spread = Spread(SLANTED, [25.0, -40.0]).scaled_to(sigma)
    heat = heat_map(spread, spacing)
    rows, columns = rng.integers(0, len(heat.x), (2, 300))
    exact = expected_score(np.column_stack([heat.x[columns], heat.y[rows]]), spread)
    assert np.abs(heat.expected_score[rows, columns] - exact).max() < 0.05


def test_nothing_wraps_around_on_a_map_that_is_larger_than_the_board(rng):
    """At 600 mm from the bull with sigma 40 mm the board is out of reach: zero, and not what a
    neighbouring copy would score.
    """
    heat = heat_map(Spread(1600.0 * np.eye(2), [300.0, 0.0]), 5.0, half_width=600.0)
    exact = expected_score(
        np.column_stack([heat.x, np.full(len(heat.x), heat.y[120])]),
        Spread(1600.0 * np.eye(2), [300.0, 0.0]),
    )
    assert np.abs(heat.expected_score[120] - exact).max() < 1e-3
    assert np.abs(heat.expected_score[:, -1]).max() < 1e-6


def test_the_map_has_its_axes_where_it_says():
    heat = heat_map(16.0, 2.0, half_width=101.0)
    assert heat.x.tolist() == heat.y.tolist() == list(range(-100, 101, 2))
    point, value = heat_map(16.0).best
    assert point == pytest.approx([-1.8, 105.9], abs=1.0)
    assert value == pytest.approx(20.689, abs=0.01)


@pytest.mark.parametrize(
    "arguments, words",
    [
        ((0.7,), "use expected_score"),
        ((16.0, 0.0), "spacing"),
        ((16.0, 0.01), "larger spacing"),
        ((16.0, np.nan), "spacing"),
        ((-1.0,), "sigma"),
    ],
)
def test_a_map_that_cannot_be_made_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        heat_map(*arguments)


@pytest.mark.parametrize("bad", [[[np.nan, 0.0]], [1.0, 2.0, 3.0], "T20"])
def test_aims_that_are_no_points_are_refused(bad):
    with pytest.raises(ValueError, match="aims"):
        expected_score(bad, 16.0)


def test_importing_darts_loads_only_what_it_needs_at_once():
    heavy = (
        "scipy.fft",
        "scipy.optimize",
        "scipy.special",
        "scipy.linalg",
        "scipy.stats",
        "matplotlib",
        "dart_skill.experiments",
    )
    program = (
        f"import sys, dart_skill.darts; print([name for name in {heavy} if name in sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )
