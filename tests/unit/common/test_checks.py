"""What is no number is found wherever it stands, and what is one is taken, however large."""

import numpy as np
import pytest

from dart_skill.common.checks import as_samples

pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("n", [1, 40])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_the_place_of_what_is_no_number_is_told(n, order, wrong):
    table = np.asarray(np.random.default_rng(0).normal(size=(n, 3)), order=order)
    table[n - 1, 1] = wrong
    with pytest.raises(ValueError, match=rf"table holds {wrong} at index \({n - 1}, 1\)"):
        as_samples(table, "table")
