"""Data spectroscopy: weights against copies, groups that are known, and the bandwidth."""

import numpy as np
import pytest
from scipy.stats import chi2

from dart_skill.experiments import thesis
from dart_skill.experiments.thesis import chapter_5
from dart_skill.mixture import automatic_bandwidth, data_spectroscopy

CENTRES = np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]])


def clusters(seed=0, sizes=(60, 90, 50)):
    labels = np.repeat(np.arange(3), sizes)
    return CENTRES[labels] + np.random.default_rng(seed).normal(size=(len(labels), 2)), labels


def same_partition(one, other):
    return (
        len(set(zip(one.tolist(), other.tolist(), strict=True)))
        == len(set(one.tolist()))
        == len(set(other.tolist()))
    )


@pytest.mark.parametrize("least", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_groups_that_stand_apart_are_found_with_nothing_but_the_points(seed, least):
    points, labels = clusters(seed)
    found = data_spectroscopy(points, least=least)
    assert found.n_groups == 3 and same_partition(found.labels, labels)


def test_one_gaussian_is_one_group():
    assert data_spectroscopy(np.random.default_rng(0).normal(size=(150, 2))).n_groups == 1


@pytest.mark.parametrize("bandwidth", [None, 0.7, 1.5])
@pytest.mark.parametrize("least, tolerance", [(0.0, None), (0.01, None), (0.01, 0.1)])
@pytest.mark.parametrize("seed", range(3))
def test_an_integer_weight_is_so_many_copies(seed, bandwidth, least, tolerance):
    points, _ = clusters(seed, (20, 25, 15))
    counts = np.random.default_rng(seed).integers(1, 5, len(points))
    options = {"bandwidth": bandwidth, "least": least, "tolerance": tolerance}
    weighted = data_spectroscopy(points, counts, counts=True, **options)
    copies = data_spectroscopy(np.repeat(points, counts, axis=0), **options)
    assert weighted.n_groups == copies.n_groups
    assert weighted.bandwidth == copies.bandwidth
    np.testing.assert_array_equal(np.repeat(weighted.labels, counts), copies.labels)
    np.testing.assert_allclose(weighted.eigenvalues * counts.max(), copies.eigenvalues, rtol=1e-9)
    scale = np.sqrt(counts.max())  # weights are taken relative to the largest
    np.testing.assert_allclose(
        np.repeat(weighted.eigenfunctions, counts, axis=0) / scale,
        copies.eigenfunctions,
        atol=1e-8,
    )


def test_the_printed_kernel_is_something_else():
    points, _ = clusters(0, (20, 25, 15))
    counts = np.random.default_rng(0).integers(1, 5, len(points))
    values = [
        data_spectroscopy(points, counts, bandwidth=1.0, reading=reading).eigenvalues[0]
        for reading in ("copies", "printed")
    ]
    kernel = (
        counts[:, None]
        * np.exp(-0.5 * np.square(points[:, None] - points).sum(-1))
        * counts
        / counts.max() ** 2
    )
    assert values[1] == pytest.approx(np.linalg.eigvalsh(kernel)[-1]) and values[
        0
    ] != pytest.approx(values[1], rel=0.01)


def test_the_scale_of_weights_and_of_points_does_not_matter():
    points, _ = clusters()
    weights = np.random.default_rng(1).uniform(0.2, 1.0, len(points))
    known = data_spectroscopy(points, weights)
    scaled = data_spectroscopy(1e3 * points + 5.0, 1e-6 * weights)
    np.testing.assert_array_equal(known.labels, scaled.labels)
    assert scaled.bandwidth == pytest.approx(1e3 * known.bandwidth)


def test_a_group_without_weight_is_none_but_its_points_get_a_label():
    points, labels = clusters()
    weights = np.where(labels == 2, 0.0, 1.0)
    found = data_spectroscopy(points, weights, bandwidth=1.0)
    assert found.n_groups == 2 and len(found.labels) == len(points)
    left_out = data_spectroscopy(points[labels < 2], bandwidth=1.0)
    np.testing.assert_array_equal(found.labels[labels < 2], left_out.labels)


def test_a_lone_point_of_little_weight_is_a_group_only_if_all_eigenvectors_count():
    points, labels = clusters()
    points, weights = (
        np.append(points, [[30.0, 30.0]], axis=0),
        np.append(np.ones(len(points)), 1e-3),
    )
    assert data_spectroscopy(points, weights, bandwidth=1.0, least=0.0).n_groups == 4
    found = data_spectroscopy(points, weights, bandwidth=1.0)
    assert found.n_groups == 3 and same_partition(found.labels[:-1], labels)


def test_the_eigenfunctions_solve_the_eigenproblem():
    points, _ = clusters(3)
    weights = np.random.default_rng(3).uniform(0.1, 1.0, len(points))
    found = data_spectroscopy(points, weights, bandwidth=0.9)
    kernel = np.exp(-0.5 * np.square(points[:, None] - points).sum(-1) / 0.9**2)
    carried = kernel @ (weights[:, None] / weights.max() * found.eigenfunctions)
    np.testing.assert_allclose(carried, found.eigenvalues * found.eigenfunctions, atol=1e-9)
    np.testing.assert_allclose((weights / weights.max()) @ found.eigenfunctions**2, 1.0)
    assert np.all(np.diff(found.eigenvalues) <= 0)


def test_the_bandwidth_is_a_quantile_of_distances_to_near_points():
    points = np.random.default_rng(5).normal(size=(200, 3))
    distances = np.sort(np.linalg.norm(points[:, None] - points, axis=-1), axis=1)
    # The 10th of 200 distances is the 5 % quantile, and the 190th of 200 of these is the 95 % one.
    expected = np.sort(distances[:, 9])[189] / np.sqrt(chi2.ppf(0.95, 3))
    assert automatic_bandwidth(points) == pytest.approx(expected, rel=1e-12)


def test_points_in_one_place_are_one_group():
    found = data_spectroscopy(np.ones((12, 2)))
    assert found.n_groups == 1 and np.ptp(found.labels) == 0
    assert data_spectroscopy([[3.0]]).n_groups == 1
    assert data_spectroscopy([[0.0]] * 10 + [[1.0]] * 9).n_groups >= 1


@pytest.mark.parametrize("seed", range(2))
def test_figure_5_5_finds_the_four(seed):
    measured = thesis.figure_of("5.5", seed)[1]
    assert measured["groups"] == 4 and measured["weight_labelled_as_its_gaussian"] > 0.95, measured
    assert measured["groups_if_all_eigenvectors_count"] > 4, measured


@pytest.mark.parametrize("bandwidth", [0.45, 0.5])
@pytest.mark.parametrize("seed", range(5000, 5003))
def test_any_small_share_of_the_largest_eigenvalue_finds_the_four(seed, bandwidth):
    """Eigenvectors of tiny eigenvalues are those of stray points, whose signs mean nothing."""
    points, weights, _ = chapter_5.weighted_points(seed)
    groups = [
        data_spectroscopy(
            points, weights, bandwidth=bandwidth, reading="printed", least=least
        ).n_groups
        for least in (0.001, 0.01, 0.1)
    ]
    assert groups == [4, 4, 4]


@pytest.mark.parametrize(
    "points, options, message",
    [
        (np.zeros((0, 2)), {}, "empty"),
        ([1.0, 2.0], {}, "reshape"),
        ([[np.nan]], {}, "nan"),
        ([[0.0], [1.0]], {"weights": [1.0]}, "length 2"),
        ([[0.0], [1.0]], {"weights": [0.0, 0.0]}, "all zero"),
        ([[0.0], [1.0]], {"bandwidth": 0.0}, "bandwidth must be above 0"),
        ([[0.0], [1.0]], {"tolerance": -1.0}, "tolerance"),
        ([[0.0], [1.0]], {"least": 1.0}, "least must be below 1"),
        ([[0.0], [1.0]], {"least": -0.1}, "least"),
        ([[0.0], [1.0]], {"reading": "aloud"}, "reading must be one of"),
    ],
)
def test_bad_input_is_refused(points, options, message):
    with pytest.raises(ValueError, match=message):
        data_spectroscopy(points, **options)
