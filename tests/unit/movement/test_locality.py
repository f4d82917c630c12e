"""Weights of demonstrations by their tasks, and the width by cross-validation."""

import numpy as np
import pytest

from dart_skill.movement import choose_width, gaussian_weights, nearest_weights

TASKS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [3.0, 4.0]])


def test_the_nearest_count_and_the_others_do_not():
    np.testing.assert_array_equal(nearest_weights(TASKS, [0.1, 0.0], 2), [1, 1, 0, 0])
    np.testing.assert_array_equal(
        nearest_weights(TASKS, [0.5, 0.0], 1), [1, 0, 0, 0], "the first of equals"
    )
    np.testing.assert_array_equal(nearest_weights(TASKS, [0.0, 0.0], 9), np.ones(4))


def test_gaussian_weights_are_the_gaussian_of_the_distance():
    weights = gaussian_weights(TASKS, [0.0, 0.0], 1.0)
    np.testing.assert_allclose(weights[:3], np.exp([0.0, -0.5, -2.0]))
    assert weights[3] == 0.0, "five widths away"


def test_cross_validation_finds_the_bandwidth_of_a_known_problem():
    """Kernel regression of a sine: too narrow sees too few, too wide flattens it."""
    rng = np.random.default_rng(0)
    x = np.sort(rng.uniform(0.0, 2 * np.pi, 60))
    y = np.sin(x) + rng.normal(0.0, 0.1, 60)

    def score(i, weights):
        return -((y[i] - weights @ y / weights.sum()) ** 2)

    choice = choose_width(x[:, None], [1e-4, 0.05, 0.2, 1.0, 5.0], score)
    assert choice.width == 0.2
    assert np.isnan(choice.scores[0]), "so narrow that some point has no neighbour"
    by_hand = np.mean(
        [
            score(
                i,
                np.where(np.arange(60) == i, 0.0, gaussian_weights(x[:, None], x[i : i + 1], 1.0)),
            )
            for i in range(60)
        ]
    )
    assert choice.scores[3] == pytest.approx(by_hand)


def test_the_left_out_demonstration_has_no_weight():
    seen = []
    choose_width(TASKS, [2.0], lambda i, weights: seen.append((i, weights[i])) or 0.0)
    assert seen == [(i, 0.0) for i in range(4)]


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="too few to leave one out"):
        choose_width(TASKS[:2], [1.0], lambda i, w: 0.0)
    with pytest.raises(ValueError, match="try wider"):
        choose_width(TASKS, [1e-3], lambda i, w: 0.0)
    with pytest.raises(ValueError, match="width"):
        gaussian_weights(TASKS, [0.0, 0.0], 0.0)
    with pytest.raises(ValueError, match="task"):
        gaussian_weights(TASKS, [0.0], 1.0)
