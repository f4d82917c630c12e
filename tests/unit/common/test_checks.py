"""What is no number is found wherever it stands, and what is one is taken, however large."""

import numpy as np
import pytest

from dart_skill.common.checks import FEW, as_finite, as_samples

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("n", [1, FEW, 40])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_the_place_of_what_is_no_number_is_told(n, order, wrong):
    table = np.asarray(np.random.default_rng(0).normal(size=(n, 3)), order=order)
    table[n - 1, 1] = wrong
    with pytest.raises(ValueError, match=rf"table holds {wrong} at index \({n - 1}, 1\)"):
        as_samples(table, "table")


@pytest.mark.parametrize("size", [1e-320, 1.0, 1e154, 1e308])
def test_numbers_whose_squares_overflow_are_numbers(size):
    values = size * np.linspace(-1.0, 1.0, 100)
    np.testing.assert_array_equal(as_finite(values, "values"), values)


def test_infinities_of_both_signs_do_not_cancel():
    with pytest.raises(ValueError, match=r"values holds inf at index \(0,\)"):
        as_finite(np.tile([np.inf, -np.inf], 20), "values")
