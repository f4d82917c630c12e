"""Distances along the best alignment, against their definition."""

import numpy as np
import pytest

from dart_skill.movement import warped_distance
from dart_skill.movement._patterns import mean_warped_distances


def warped_one_by_one(first, second):
    """Dynamic time warping as it is written in the books."""
    total = np.full((len(first) + 1, len(second) + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(len(first)):
        for j in range(len(second)):
            total[i + 1, j + 1] = np.linalg.norm(first[i] - second[j]) + min(
                total[i, j], total[i, j + 1], total[i + 1, j]
            )
    return total[-1, -1]


@pytest.mark.parametrize("lengths", [(1, 1), (1, 6), (9, 9), (20, 13)])
def test_warped_distance_is_that_of_the_definition(lengths):
    rng = np.random.default_rng(2)
    first, second = (rng.normal(size=(n, 2)) for n in lengths)
    distance, pairs = warped_distance(first, second)
    assert distance == pytest.approx(warped_one_by_one(first, second), rel=1e-12)
    assert max(lengths) <= pairs <= sum(lengths) - 1


def test_another_pace_costs_nothing():
    path = np.random.default_rng(3).normal(size=(10, 2))
    assert warped_distance(path, np.repeat(path, 3, axis=0)) == (0.0, 30)


def test_all_pairs_at_once_are_the_pairs_one_by_one():
    paths = np.random.default_rng(4).normal(size=(5, 12, 3))
    expected = [
        [total / pairs for total, pairs in (warped_distance(one, other) for other in paths)]
        for one in paths
    ]
    np.testing.assert_allclose(mean_warped_distances(list(paths)), expected, atol=1e-12)


def test_other_dimensions_are_refused():
    with pytest.raises(ValueError, match="second"):
        warped_distance(np.zeros((3, 2)), np.zeros((3, 4)))
