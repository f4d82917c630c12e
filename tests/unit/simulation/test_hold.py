"""The hold of a hand, and a swing as a quintic: what the formulas say, and the same compiled and
interpreted.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dart_skill.simulation._hold import Hold, Quintic
from tests.interpreted import interpreted


@pytest.fixture
def ends():
    rng = np.random.default_rng(0)
    return [*rng.normal(size=(4, 7)), 0.7]


def hands(rng):
    return [rng.normal(size=n) for n in (3, 6, 3, 3, 6, 3)]


def test_a_hold_is_a_spring_and_a_damper():
    wanted, wanted_velocity, stray, position, velocity, error = hands(np.random.default_rng(1))
    wrench = Hold(5000.0, 300.0, 25.0, 0.5).pull(
        wanted, wanted_velocity, stray, position, velocity, error
    )
    assert_array_equal(
        wrench[:3],
        5000.0 * (wanted + stray - position) + 300.0 * (wanted_velocity[:3] - velocity[:3]),
    )
    assert_array_equal(wrench[3:], 25.0 * error + 0.5 * (wanted_velocity[3:] - velocity[3:]))


def test_a_quintic_has_its_ends_and_no_acceleration_there(ends):
    start, start_rate, end, end_rate, duration = ends
    quintic, step = Quintic(*ends), 1e-5
    for time, place, rate in ((0.0, start, start_rate), (duration, end, end_rate)):
        position, velocity = quintic.at(time)
        assert_allclose(position, place, atol=1e-12)
        assert_allclose(velocity, rate, atol=1e-12)
        assert_allclose(
            (quintic.at(time + step)[1] - quintic.at(time - step)[1]) / (2.0 * step),
            np.zeros(7),
            atol=1e-5,
        )


def test_a_quintic_has_the_bits_of_its_formula(ends):
    """Demonstrations that were recorded are made again to the last bit."""
    start, start_rate, end, end_rate, duration = ends
    v0, v1, way = start_rate * duration, end_rate * duration, end - start
    c3, c4, c5 = 10 * way - 6 * v0 - 4 * v1, -15 * way + 8 * v0 + 7 * v1, 6 * way - 3 * v0 - 3 * v1
    for time in np.random.default_rng(3).uniform(0.0, duration, 3000).tolist():
        s, (position, velocity) = time / duration, Quintic(*ends).at(time)
        assert_array_equal(position, start + s * (v0 + s**2 * (c3 + s * (c4 + s * c5))))
        assert_array_equal(velocity, (v0 + s**2 * (3 * c3 + s * (4 * c4 + s * 5 * c5))) / duration)


def test_the_velocity_of_a_quintic_is_the_derivative_of_its_position(ends):
    quintic, step = Quintic(*ends), 1e-6
    for time in np.linspace(0.05, 0.65, 7):
        slope = (quintic.at(time + step)[0] - quintic.at(time - step)[0]) / (2.0 * step)
        assert_allclose(quintic.at(time)[1], slope, rtol=1e-6, atol=1e-6)


def test_compiled_and_interpreted_have_the_same_bits(ends):
    plain = interpreted("dart_skill.simulation._hold")
    rng = np.random.default_rng(2)
    for time in rng.uniform(0.0, 0.7, 50).tolist():
        for ours, theirs in zip(
            Quintic(*ends).at(time), plain.Quintic(*ends).at(time), strict=True
        ):
            assert_array_equal(ours, theirs)
        numbers, firm = hands(rng), rng.uniform(0.1, 1e4, 4).tolist()
        assert_array_equal(Hold(*firm).pull(*numbers), plain.Hold(*firm).pull(*numbers))
