"""The instant at which two paths move alike: against NumPy's polynomials."""

import numpy as np
import pytest

from dart_skill.skills.observation import parting


def differences(seed, n=17):
    """Times (n,) in -1 to 1, and differences (n, 3) [m] of two paths that part somewhere in
    between.
    """
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(-1.0, 1.0, n))
    return time, np.cumsum(rng.standard_normal((n, 3)), axis=0) * 1e-3


def fine(time):
    return np.linspace(time[0], time[-1], 20001)


@pytest.mark.parametrize("degree", [4, 5])
@pytest.mark.parametrize("seed", range(5))
def test_the_difference_is_slowest_there_of_the_places_where_it_is_least(seed, degree):
    """On a fine grid: no extreme of the speed nearer to the origin, or as near, has less speed."""
    time, difference = differences(seed)
    best, _, distance = parting(time, difference, degree)
    curves = [np.polynomial.Polynomial.fit(time, column, degree) for column in difference.T]
    assert distance == pytest.approx(np.sqrt(sum(one(best) ** 2 for one in curves)), rel=1e-9)
    places = fine(time)
    speed = np.sqrt(sum(one.deriv()(places) ** 2 for one in curves))
    far = np.sqrt(sum(one(places) ** 2 for one in curves))
    extremes = np.flatnonzero((speed[1:-1] < speed[:-2]) & (speed[1:-1] < speed[2:])) + 1
    as_near = extremes[far[extremes] < distance + 1e-4]
    assert (
        np.sqrt(sum(one.deriv()(best) ** 2 for one in curves))
        <= speed[as_near].min(initial=np.inf) + 1e-7
    )


def test_paths_that_part_at_an_instant_part_there():
    time = np.linspace(-1.0, 1.0, 15)
    difference = np.outer((time - 0.3) ** 2, [0.01, -0.02, 0.03])
    best, deviation, distance = parting(time, difference, 4)
    assert best == pytest.approx(0.3, abs=1e-6)
    assert deviation < 1e-9 and distance < 1e-9


def test_the_deviation_is_that_of_repeated_samples():
    rng, time = np.random.default_rng(0), np.linspace(-1.0, 1.0, 15)
    exact = np.outer((time - 0.1) ** 2, [0.01, -0.02, 0.03])
    told = [
        parting(time, exact + 1e-5 * rng.standard_normal(exact.shape), 4)[:2] for _ in range(300)
    ]
    assert np.std([best for best, _ in told]) == pytest.approx(
        np.median([deviation for _, deviation in told]), rel=0.2
    )


def test_too_few_samples_determine_no_polynomial():
    with pytest.raises(ValueError, match="not positive definite"):
        parting(np.zeros(6), np.zeros((6, 3)), 4)


def test_the_deviation_is_how_far_noise_moves_the_instant():
    time, rng = np.linspace(-1.0, 1.0, 41), np.random.default_rng(5)
    path = np.outer((time - 0.2) ** 2, [0.3, -0.2, 0.1])
    found = [parting(time, path + 1e-3 * rng.normal(size=(41, 3)), 4) for _ in range(200)]
    instants, deviations, _ = np.transpose(found)
    assert instants.std() == pytest.approx(np.median(deviations), rel=0.15)
    assert instants.mean() == pytest.approx(0.2, abs=4 * instants.std() / np.sqrt(200))


def test_markers_that_are_millimetres_off_do_not_move_the_instant():
    """The paths come nearer to each other elsewhere, where they do not move alike."""
    time, way = np.linspace(-1.0, 1.0, 15), np.array([0.01, -0.02, 0.02])
    off = -0.004 * way / np.linalg.norm(way)
    best, deviation, distance = parting(time, off + np.outer((time - 0.3) ** 2, way), 4)
    assert best == pytest.approx(0.3, abs=1e-6) and deviation < 1e-6
    assert distance == pytest.approx(0.004)


def test_two_instants_at_which_the_paths_move_alike_make_a_large_deviation():
    time, rng = np.linspace(-1.0, 1.0, 15), np.random.default_rng(3)
    path = np.outer((time**2 - 0.16) ** 2, [0.0, 0.3, 0.1])
    for _ in range(20):
        best, deviation, _ = parting(time, path + 1e-5 * rng.standard_normal((15, 3)), 4)
        assert abs(best) == pytest.approx(0.4, abs=1e-3)
        assert deviation == pytest.approx(0.8, abs=2e-3)
