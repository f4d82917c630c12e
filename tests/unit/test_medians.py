"""Medians and quantiles are those of NumPy to the last bit."""

import numpy as np
import pytest

from dart_skill.medians import column_medians, median, quantile, row_medians


@pytest.mark.parametrize("n", [1, 2, 3, 10, 119, 360])
def test_they_are_those_of_numpy(n):
    rng = np.random.default_rng(n)
    for values in (rng.normal(size=n), rng.integers(-3, 3, size=n), 1e-9 * rng.normal(size=(n, 3))):
        assert median(values) == np.median(values)
        for share in (0.0, 0.1, 0.25, 0.5, 0.77, 0.99, 1.0):
            assert quantile(values, share) == np.quantile(values, share)


@pytest.mark.parametrize("n", [1, 2, 21, 28])
def test_medians_of_rows_leave_out_what_is_no_number(n):
    rng = np.random.default_rng(n)
    values = np.where(rng.random((300, n)) < 0.3, np.nan, rng.normal(size=(300, n)))
    values[:, 0] = rng.normal(size=300)
    np.testing.assert_array_equal(row_medians(values), np.nanmedian(values, axis=1))


@pytest.mark.parametrize("n", [1, 2, 5, 10, 101])
def test_medians_of_columns_are_those_of_numpy_to_the_last_bit(n):
    rows = np.random.default_rng(n).normal(size=(n, 6))
    np.testing.assert_array_equal(column_medians(rows), np.median(rows, axis=0))
