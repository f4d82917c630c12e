"""Which demonstrations fit together: good ones pass, late ones are called late, wrong ones wrong,
far targets are no crime.
"""

import numpy as np
import pytest

from dart_skill.movement import check_alignment

CLOCK = np.linspace(-0.6, 0.5, 111)


def throw(rng, distance=1.0, late=0.0, noise=3e-3):
    t = np.clip((CLOCK - late + 0.5) / 0.9, 0.0, 1.0)
    u = t**3 * (10 - 15 * t + 6 * t * t)
    path = np.column_stack([distance * u, 0.3 * np.sin(np.pi * u), 0.2 * u * (2 - distance)])
    bend = rng.normal(0.0, noise, 3) * np.sin(np.pi * u)[:, None]
    return path + bend + rng.normal(0.0, 1e-4, path.shape)


def shown(rng, n=12, **odd):
    distances = rng.uniform(0.8, 1.6, n)
    return distances, [throw(rng, distance) for distance in distances]


@pytest.mark.parametrize("seed", range(15))
def test_good_demonstrations_fit_whatever_their_targets(seed):
    distances, paths = shown(np.random.default_rng(seed))
    fits = check_alignment([CLOCK] * 12, paths, distances[:, None])
    assert all(fit.fits for fit in fits), [fit for fit in fits if not fit.fits]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("late", [0.2, -0.25])
def test_a_late_one_is_called_late(seed, late):
    rng = np.random.default_rng(seed)
    distances, paths = shown(rng)
    paths[3] = throw(rng, distances[3], late)
    fits = check_alignment([CLOCK] * 12, paths, distances[:, None])
    assert [i for i, fit in enumerate(fits) if not fit.fits] == [3]
    assert (
        fits[3].lag == pytest.approx(late, abs=0.03)
        and ("late" if late > 0 else "early") in fits[3].reason
    )


@pytest.mark.parametrize("seed", range(8))
def test_wrong_ones_are_found_and_do_not_set_the_measure(seed):
    """Two of twelve: one that goes round the other side, one to another target than it says."""
    rng = np.random.default_rng(seed)
    distances, paths = shown(rng)
    paths[1] = paths[1] * [1.0, -1.0, 1.0]
    paths[7] = throw(rng, distances[7] + 0.5)
    fits = check_alignment([CLOCK] * 12, paths, distances[:, None])
    assert [i for i, fit in enumerate(fits) if not fit.fits] == [1, 7], fits
    assert "strays" in fits[1].reason


def test_without_tasks_the_median_of_the_others_is_the_measure():
    rng = np.random.default_rng(0)
    paths = [throw(rng) for _ in range(6)]
    paths[2] = paths[2] + 0.5
    fits = check_alignment([CLOCK] * 6, paths)
    assert [i for i, fit in enumerate(fits) if not fit.fits] == [2]


def test_units_do_not_matter():
    distances, paths = shown(np.random.default_rng(1))
    one = check_alignment([CLOCK] * 12, paths, distances[:, None])
    other = check_alignment(
        [CLOCK] * 12, [path * [1e3, 1.0, 1e-3] for path in paths], 1e3 * distances[:, None]
    )
    np.testing.assert_allclose(
        [fit.deviation for fit in other], [fit.deviation for fit in one], rtol=1e-2
    )


def test_a_tolerance_keeps_those_that_hardly_differ_from_being_strict():
    rng = np.random.default_rng(2)
    paths = [throw(rng, noise=1e-5) for _ in range(8)]
    paths[5] = paths[5] + 0.004
    assert not check_alignment([CLOCK] * 8, paths)[5].fits
    assert check_alignment([CLOCK] * 8, paths, tolerance=0.003)[5].fits


def test_bad_input_is_named():
    rng = np.random.default_rng(0)
    paths = [throw(rng) for _ in range(5)]
    with pytest.raises(ValueError, match="at least 4"):
        check_alignment([CLOCK] * 3, paths[:3])
    with pytest.raises(ValueError, match="no time in common"):
        check_alignment([CLOCK] * 4 + [CLOCK + 9.0], paths)
    with pytest.raises(ValueError, match="as many tasks"):
        check_alignment([CLOCK] * 5, paths, np.zeros((2, 1)))
    with pytest.raises(ValueError, match="demonstration 4 has 2 movement variables"):
        check_alignment([CLOCK] * 5, paths[:4] + [paths[4][:, :2]])
