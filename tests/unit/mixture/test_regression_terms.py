"""The compiled terms of a regression and their Python source."""

import numpy as np
import pytest

from dart_skill.mixture import Regression
from tests.interpreted import interpreted
from tests.unit.mixture.random_mixture import random_mixture

PLAIN = interpreted("dart_skill.mixture._regression_terms")
NAMES = [name for name in vars(PLAIN) if name.startswith("write_") or name == "normalise"]


@pytest.mark.parametrize(("n_components", "n_inputs"), [(1, 1), (3, 1), (9, 1), (4, 2)])
def test_compiled_and_interpreted_have_the_same_bits(monkeypatch, n_components, n_inputs):
    rng = np.random.default_rng(n_components)
    mixture = random_mixture(rng, n_components, n_inputs + 3)
    queries = rng.normal(0.0, 3.0, (7, n_inputs))
    dims = rng.permutation(n_inputs + 3)
    compiled = Regression(mixture, dims[:n_inputs], dims[n_inputs:])(queries)
    for name in NAMES:
        monkeypatch.setattr(f"dart_skill.mixture._regression.{name}", getattr(PLAIN, name))
    plain = Regression(mixture, dims[:n_inputs], dims[n_inputs:])(queries)
    for one, other in zip(compiled, plain, strict=True):
        np.testing.assert_array_equal(one, other)
