"""The best aim, all local optima, and the jumps of the best aim over sigma, against brute force
and independent quadrature.
"""

from functools import lru_cache

import numpy as np
import pytest

from dart_skill.darts import (
    Spread,
    as_target,
    best_aim,
    expected_score,
    local_optima,
    optimum_path,
)
from tests.unit.darts import reference

SLANTED = Spread([[500.0, -160.0], [-160.0, 120.0]], [10.0, -20.0])
COMPASS = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4])
STEP = 3.0


@lru_cache
def brute_force(sigma):
    """Expected scores on a 3 mm grid (n, n), and the grid (n,)."""
    grid = np.arange(-189.0, 190.0, STEP)
    return grid, expected_score(np.stack(np.meshgrid(grid, grid), axis=-1), sigma)


def highest_nodes(grid, values):
    """Nodes (n, 2) higher than their neighbours and than what round-off leaves off the board."""
    inner = values[1:-1, 1:-1]
    shifted = [
        values[1 + i : values.shape[0] - 1 + i, 1 + j : values.shape[1] - 1 + j]
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
        if (i, j) != (0, 0)
    ]
    rows, columns = np.nonzero((inner > np.array(shifted)).all(axis=0) & (inner > 0.1))
    return np.column_stack([grid[1 + columns], grid[1 + rows]])


@pytest.mark.parametrize("sigma", [16.0, 27.0])
def test_the_best_aim_beats_every_node_of_a_grid(sigma):
    grid, values = brute_force(sigma)
    best = best_aim(sigma)
    assert best.expected_score >= values.max()
    row, column = np.unravel_index(values.argmax(), values.shape)
    assert np.hypot(*(best.point - [grid[column], grid[row]])) < 2 * STEP


@pytest.mark.parametrize(
    "spread", [5.0, 16.0, 27.0, 64.6, SLANTED], ids=["5", "16", "27", "64.6", "slanted"]
)
def test_a_tenth_of_a_millimetre_beside_the_best_aim_less_is_scored(spread):
    """By quadrature over the beds, which shares nothing with the search."""
    best = best_aim(spread)
    covariance = spread.covariance if isinstance(spread, Spread) else spread**2 * np.eye(2)
    bias = spread.bias if isinstance(spread, Spread) else np.zeros(2)
    here, *around = reference.expected_score(
        np.vstack([best.point, best.point + 0.1 * COMPASS]), covariance, bias
    )
    assert here == pytest.approx(best.expected_score, abs=1e-9)
    assert max(around) < here, (best.point, np.array(around) - here)


@pytest.mark.parametrize("sigma", [16.0, 27.0])
def test_local_optima_are_those_of_a_fine_grid(sigma):
    found = np.array([aim.point for aim in local_optima(sigma)])
    nodes = highest_nodes(*brute_force(sigma))
    distances = np.hypot(*(found[:, None] - nodes).transpose(2, 0, 1))
    assert len(found) == len(nodes), (found, nodes)
    assert distances.min(axis=0).max() < 1.5 * STEP and distances.min(axis=1).max() < 1.5 * STEP


@pytest.mark.parametrize("spread", [4.0, 10.0, 16.0, SLANTED], ids=["4", "10", "16", "slanted"])
def test_every_local_optimum_is_higher_than_what_is_round_it(spread):
    optima = local_optima(spread)
    values = [aim.expected_score for aim in optima]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(best_aim(spread).expected_score, abs=1e-10)
    for aim in optima:
        assert (
            expected_score(aim.point + 0.1 * COMPASS, spread).max() <= aim.expected_score + 1e-11
        ), aim


def test_a_precise_thrower_has_an_optimum_in_the_bull_and_each_treble_and_double_that_beats_its_neighbours():
    numbers = reference.NUMBERS
    higher = [
        n
        for n, a, b in zip(numbers, np.roll(numbers, 1), np.roll(numbers, -1), strict=True)
        if n > a and n > b
    ]
    wanted = {"DB", *(f"{letter}{number}" for letter in "TD" for number in higher)}
    optima = local_optima(3.0)
    assert {aim.bed for aim in optima} == wanted and len(optima) == len(wanted)


def test_a_precise_thrower_aims_at_the_middle_of_treble_twenty():
    assert best_aim(1.0).point == pytest.approx([0.0, 103.0], abs=0.1)
    assert best_aim(1.0).bed == "T20"


def test_a_bias_is_aimed_against():
    bias = np.array([14.0, -9.0])
    plain, biased = local_optima(16.0), local_optima(Spread.isotropic(16.0, bias))
    assert np.array([aim.point for aim in biased]) + bias == pytest.approx(
        np.array([aim.point for aim in plain]), abs=1e-4
    )


def test_a_mirrored_spread_does_not_have_mirrored_optima_on_an_unsymmetric_board():
    mirrored = Spread(SLANTED.covariance * [[1.0, -1.0], [-1.0, 1.0]])
    assert best_aim(mirrored).point != pytest.approx(
        best_aim(Spread(SLANTED.covariance)).point * [-1.0, 1.0], abs=1.0
    )


@pytest.fixture(scope="module")
def path():
    return optimum_path(6.0, 100.0)


def test_the_best_aim_jumps_once_from_treble_twenty_to_treble_nineteen(path):
    """The published 16.4 mm depends on the grid of the map; without one it is 16.907 mm."""
    (jump,) = path.jumps
    assert jump.sigma == pytest.approx(16.9069, abs=1e-3)
    assert (jump.below.bed, jump.above.bed) == ("T20", "T19")


def test_both_sides_of_the_jump_score_the_same_by_quadrature_and_nothing_scores_more(path):
    (jump,) = path.jumps
    sides = reference.expected_score(
        [jump.below.point, jump.above.point], jump.sigma**2 * np.eye(2)
    )
    assert sides[0] == pytest.approx(sides[1], abs=1e-6)
    assert brute_force(jump.sigma)[1].max() <= sides.max() + 1e-6


@pytest.mark.parametrize("offset, bed", [(-0.02, "T20"), (0.02, "T19")])
def test_beside_the_jump_the_optimum_is_on_its_side(path, offset, bed):
    sigma = path.jumps[0].sigma + offset
    rivals = reference.expected_score(
        [path.jumps[0].below.point, path.jumps[0].above.point], sigma**2 * np.eye(2)
    )
    assert ["T20", "T19"][int(rivals.argmax())] == bed == best_aim(sigma).bed


def test_between_jumps_the_optimum_moves_continuously_and_ends_left_of_the_bull(path):
    before, after = path.pieces
    assert path.sigmas[before][-1] == path.sigmas[after][0] == path.jumps[0].sigma
    for piece in (before, after):
        assert np.hypot(*np.diff(path.aims[piece], axis=0).T).max() < 6.0
    end = path.aims[-1]
    assert -20.0 < end[0] < 0.0 and -10.0 < end[1] < 0.0


def test_the_optimum_scores_less_the_wider_the_spread(path):
    assert (np.diff(path.expected_scores) <= 1e-9).all()


def test_between_neighbouring_sigmas_of_a_piece_no_other_aim_is_better(path):
    """Half way between the sigmas of the path, the best aim lies between those of the path."""
    for index in range(2, len(path.sigmas) - 1, 9):
        if path.sigmas[index + 1] > path.sigmas[index]:
            best = best_aim(0.5 * (path.sigmas[index] + path.sigmas[index + 1])).point
            assert np.hypot(*(best - path.aims[index : index + 2]).T).max() < 6.0, path.sigmas[
                index
            ]


def test_a_spread_of_another_shape_has_its_own_jumps():
    shape = Spread([[2.0, -1.0], [-1.0, 2.0]])
    (jump,) = optimum_path(15.5, 16.5, shape).jumps
    sides = reference.expected_score(
        [jump.below.point, jump.above.point], shape.scaled_to(jump.sigma).covariance
    )
    assert (jump.below.bed, jump.above.bed) == ("T20", "T19")
    assert jump.sigma == pytest.approx(15.958, abs=1e-3)
    assert sides[0] == pytest.approx(sides[1], abs=1e-6)


@pytest.mark.parametrize("ends", [(20.0, 10.0), (16.0, 16.0), (-1.0, 10.0), (5.0, np.nan)])
def test_a_range_that_is_none_is_refused(ends):
    with pytest.raises(ValueError, match="sigma"):
        optimum_path(*ends)


def test_an_aim_names_its_bed():
    assert best_aim(Spread.isotropic(2.0, [0.0, -200.0])).bed == "outside D20"
    assert best_aim(2.0).point == pytest.approx(as_target("T20"), abs=0.1)
