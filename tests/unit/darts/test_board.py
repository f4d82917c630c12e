"""The board: beds, scores, names, and what is refused."""

import numpy as np
import pytest

from dart_skill.darts import (
    BED_NAMES,
    BED_SCORES,
    PROFESSIONALS,
    RADII,
    SECTORS,
    Spread,
    as_target,
    bed_at,
    bed_centres,
    estimate_from_scores,
    name_at,
    place_of,
    professional,
    score,
)

NUMBERS = [20, 1, 18, 4, 13, 6, 10, 15, 2, 17, 3, 19, 7, 16, 8, 11, 14, 9, 12, 5]


def at(radius, degrees):
    """Point at a radius and an angle clockwise from the top."""
    return [radius * np.sin(np.radians(degrees)), radius * np.cos(np.radians(degrees))]


def test_the_board_has_twenty_up_six_right_three_down_and_eleven_left():
    points = [[0.0, 130.0], [130.0, 0.0], [0.0, -130.0], [-130.0, 0.0]]
    assert score(points).tolist() == [20, 6, 3, 11]


def test_every_sector_has_its_number_and_every_ring_its_factor():
    for turn, number in enumerate(NUMBERS):
        ring = [
            at(radius, 18.0 * turn + 8.9)
            for radius in (20.0, 98.9, 99.1, 106.9, 107.1, 161.9, 162.1, 169.9, 170.1)
        ]
        assert score(ring).tolist() == [
            number,
            number,
            3 * number,
            3 * number,
            number,
            number,
            2 * number,
            2 * number,
            0,
        ]


def test_the_bull_scores_the_same_all_round():
    angles = np.linspace(0.0, 360.0, 37)
    assert set(score([at(6.3, a) for a in angles]).tolist()) == {50}
    assert set(score([at(15.8, a) for a in angles]).tolist()) == {25}


def test_a_point_on_a_circle_belongs_to_the_ring_inside_it():
    assert score([[0.0, radius] for radius in RADII]).tolist() == [50, 25, 20, 60, 20, 40]
    assert score([[0.0, np.nextafter(radius, 999.0)] for radius in RADII]).tolist() == [
        25,
        20,
        60,
        20,
        40,
        0,
    ]


def test_scores_keep_the_shape_of_the_points():
    assert score(np.zeros((4, 3, 2))).shape == (4, 3)
    assert score([0.0, 0.0]).shape == ()


def test_mean_score_of_uniform_throws_is_the_published_one(rng):
    """12.82 on average (Tibshirani, Price and Taylor, 2011); the exact value follows from the
    areas of the rings.
    """
    areas = np.diff(np.concatenate([[0.0], RADII**2])) / RADII[-1] ** 2
    exact = areas @ [50.0, 25.0, 10.5, 31.5, 10.5, 21.0]
    assert exact == pytest.approx(12.82, abs=0.005)
    n = 200_000
    points = (
        RADII[-1]
        * np.sqrt(rng.random(n))[:, None]
        * np.array([at(1.0, a) for a in 360.0 * rng.random(n)])
    )
    assert score(points).mean() == pytest.approx(exact, abs=5 * score(points).std() / np.sqrt(n))


def test_each_bed_contains_its_own_middle():
    assert bed_at(bed_centres()).tolist() == list(range(82))
    assert len(BED_NAMES) == len(BED_SCORES) == 83
    assert SECTORS.tolist() == NUMBERS


def test_names_lead_to_points_and_back():
    for name in ("DB", "T20", "D16", "S5", "T19"):
        assert name_at(as_target(name)) == name
    assert as_target("t20") == pytest.approx([0.0, 103.0])
    assert as_target("bull").tolist() == [0.0, 0.0]
    assert place_of([0.0, 200.0]) == "outside D20"


@pytest.mark.parametrize(
    "number", [-1, 23, 29, 31, 35, 37, 41, 43, 44, 46, 47, 49, 52, 53, 55, 56, 58, 59, 61, 180]
)
def test_scores_that_cannot_be_thrown_are_refused_with_their_place(number):
    with pytest.raises(ValueError, match=f"throw 2: score {number} cannot be thrown"):
        estimate_from_scores([20, number])


@pytest.mark.parametrize("bad", [float("nan"), "T21", "D0", "abc", 20.5, True])
def test_what_is_no_score_is_refused(bad):
    with pytest.raises(ValueError, match="throw 1: .* is no score or bed; write"):
        estimate_from_scores([bad])


@pytest.mark.parametrize("bad", [[], "20 20", 20])
def test_what_is_no_list_of_scores_is_refused(bad):
    with pytest.raises(ValueError, match="scores"):
        estimate_from_scores(bad)


@pytest.mark.parametrize(
    "bad", ["20", "25", "miss", "T25", "", [1.0], [[0.0, 0.0]], [0.0, np.inf]]
)
def test_what_is_no_target_is_refused(bad):
    with pytest.raises(ValueError, match="aim"):
        as_target(bad)


@pytest.mark.parametrize("bad", [[1.0, 2.0, 3.0], [np.nan, 0.0], "T20", 5.0])
def test_what_are_no_points_is_refused(bad):
    with pytest.raises(ValueError, match="points"):
        score(bad)


@pytest.mark.parametrize("bad", [0.0, -16.0, float("nan"), float("inf"), 0.016, 1e9, "wide", None])
def test_a_sigma_that_no_thrower_has_is_refused_with_its_unit(bad):
    with pytest.raises(ValueError, match="sigma must .*millimetres"):
        Spread.isotropic(bad)


@pytest.mark.parametrize(
    "covariance, words",
    [
        ([[1.0, 2.0], [2.0, 1.0]], "variances -1 and 3"),
        ([[1.0, 0.0], [0.5, 1.0]], "symmetric"),
        ([1.0, 2.0], "shape"),
        (np.eye(3), "shape"),
    ],
)
def test_a_matrix_that_is_no_covariance_is_refused(covariance, words):
    with pytest.raises(ValueError, match=words):
        Spread(covariance)


def test_sigma_of_a_covariance_is_the_fourth_root_of_its_determinant():
    spread = Spread([[400.0, 0.0], [0.0, 25.0]], [1.0, 2.0])
    assert spread.sigma == pytest.approx(10.0)
    assert spread.deviations == pytest.approx([5.0, 20.0])
    assert spread.scaled_to(20.0).covariance == pytest.approx(4.0 * spread.covariance)
    assert spread.scaled_to(20.0).bias.tolist() == [1.0, 2.0]


def test_impacts_have_the_mean_and_covariance_of_the_spread(rng):
    spread = Spread([[300.0, 100.0], [100.0, 150.0]], [3.0, -4.0])
    impacts = spread.throw(np.tile([10.0, 50.0], (200_000, 1)), rng)
    assert impacts.mean(axis=0) == pytest.approx([13.0, 46.0], abs=0.2)
    assert np.cov(impacts.T) == pytest.approx(spread.covariance, abs=4.0)


def test_professionals_have_the_published_mean_spreads():
    """Haugh and Wang: 7.69 mm at treble 20, 8.07 at the bull, 8.55 at doubles, over sixteen
    players.
    """
    players = [professional(name).all_spreads for name in PROFESSIONALS]
    means = np.mean([[spread.sigma for spread in player] for player in players], axis=0)
    typical = [spread.sigma for spread in professional().all_spreads]
    assert len(players) == 16
    assert means[[0, 4, 5]] == pytest.approx([7.69, 8.07, 8.55], abs=0.01)
    assert typical == pytest.approx(means.tolist(), rel=1e-12)


def test_a_professional_has_the_spread_of_what_is_aimed_at():
    player = professional("van gerwen")
    aims = np.array(
        [as_target(name) for name in ("T20", "T19", "T18", "T17", "DB", "D16", "D20", "S20")]
    )
    assert player.which(aims).tolist() == [0, 1, 2, 3, 4, 5, 5, 0]


def test_an_unknown_professional_is_named():
    with pytest.raises(ValueError, match="'Bristow'.*choose one of Anderson"):
        professional("Bristow")


@pytest.fixture
def rng():
    return np.random.default_rng(4)
