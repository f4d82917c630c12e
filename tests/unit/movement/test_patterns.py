"""The patterns among demonstrations: found where there are some, and not where one pattern varies."""

import numpy as np
import pytest

from dart_skill.movement import find_patterns, resampled, warped_distance

S = np.linspace(0.0, 1.0, 80)


def arc(height, rng, spread=0.02):
    """A way over or below, with starts and heights that vary."""
    start = rng.normal(0.0, spread, 2)
    return (
        np.column_stack([S, (height + rng.normal(0.0, spread)) * np.sin(np.pi * S)])
        + start * (1.0 - S)[:, None]
    )


def silhouette_one_by_one(distances, labels):
    """As Rousseeuw writes it."""
    values = []
    for i, label in enumerate(labels):
        own = [distances[i, j] for j in range(len(labels)) if labels[j] == label and j != i]
        if not own:
            values.append(0.0)
            continue
        other = min(
            np.mean([distances[i, j] for j in range(len(labels)) if labels[j] == k])
            for k in set(labels) - {label}
        )
        values.append((other - np.mean(own)) / max(other, np.mean(own)))
    return np.mean(values)


@pytest.mark.parametrize("seed", range(5))
def test_two_ways_are_two_patterns_in_the_order_in_which_they_were_shown(seed):
    rng = np.random.default_rng(seed)
    found = find_patterns([arc(height, rng) for height in (0.5, 0.5, -0.5, 0.5, -0.5, -0.5, 0.5)])
    assert [group.tolist() for group in found.groups] == [
        [0, 1, 3, 6],
        [2, 4, 5],
    ] and found.silhouette > 0.9
    assert found.in_words == "2 patterns: demonstrations 0, 1, 3 and 6; 2, 4 and 5"


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("count", [4, 7, 13])
def test_one_way_that_varies_is_one_pattern(seed, count):
    rng = np.random.default_rng([seed, count])
    found = find_patterns([arc(0.5, rng, spread=0.1) for _ in range(count)])
    assert found.in_words == "one pattern" and found.labels.tolist() == [0] * count


def test_neither_pace_nor_number_of_samples_makes_a_pattern():
    rng = np.random.default_rng(0)
    paths = [arc(0.5, rng)[:: 1 + i % 3] for i in range(6)]
    slow = resampled(paths[0], 300) ** [1.0, 1.0]
    assert len(find_patterns([*paths, slow]).groups) == 1


def test_a_start_says_which_pattern_it_is():
    rng = np.random.default_rng(1)
    left, right = ([arc(0.3, rng) + [0.0, side] for _ in range(3)] for side in (1.0, -1.0))
    found = find_patterns([*left, *right])
    assert found.beginning_at([0.0, 0.8]) == 0 and found.beginning_at([0.1, -2.0]) == 1


def test_equal_demonstrations_are_one_pattern():
    assert find_patterns([arc(0.5, np.random.default_rng(0))] * 5).in_words == "one pattern"


@pytest.mark.parametrize(
    ("positions", "options", "why"),
    [
        ([np.zeros((5, 2))] * 3, {}, "at least 4 demonstrations, got 3"),
        (
            [np.zeros((5, 2))] * 3 + [np.zeros((5, 3))],
            {},
            "demonstration 3 has 3 movement variables, the first has 2",
        ),
        ([np.zeros((5, 2))] * 4, {"least_silhouette": 0.0}, "least_silhouette"),
        ([np.zeros((5, 2))] * 4, {"least_separation": -1.0}, "least_separation"),
        ([np.full((5, 2), np.nan)] * 4, {}, "positions of demonstration 0"),
    ],
)
def test_what_cannot_be_compared_is_refused(positions, options, why):
    with pytest.raises(ValueError, match=why):
        find_patterns(positions, **options)


def test_resampling_keeps_the_ends_and_straight_lines():
    line = np.outer(np.arange(11.0), [1.0, -2.0])
    np.testing.assert_allclose(
        resampled(line, 4), np.outer([0.0, 10 / 3, 20 / 3, 10.0], [1.0, -2.0])
    )


@pytest.mark.parametrize("seed", range(3))
def test_silhouette_and_separation_are_those_of_the_definition(seed):
    """Of paths that stay at a point, whose distances are those of the points."""
    points = np.random.default_rng(seed).normal(size=(9, 2)) + np.repeat(
        [[0.0], [40.0]], [5, 4], 0
    )
    found = find_patterns(points[:, None])
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    assert found.labels.tolist() == [0] * 5 + [1] * 4
    wanted = silhouette_one_by_one(distances, found.labels.tolist())
    assert found.silhouette == pytest.approx(wanted, rel=1e-12)
    own = found.labels[:, None] == found.labels
    assert found.separation == pytest.approx(distances[~own].min() / distances[own].max())


@pytest.mark.parametrize(("count", "at_most"), [(4, 0.15), (7, 0.05), (10, 0.0)])
def test_one_pattern_is_seldom_taken_for_several_even_in_one_dimension(count, at_most):
    """The shares of the module's docstring."""
    draws = [
        np.random.default_rng([seed, count, 1]).normal(size=(count, 1, 1)) for seed in range(100)
    ]
    wrong = sum(len(find_patterns(points).groups) > 1 for points in draws)
    assert wrong <= 100 * at_most


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


def test_other_dimensions_are_refused():
    with pytest.raises(ValueError, match="second"):
        warped_distance(np.zeros((3, 2)), np.zeros((3, 4)))
