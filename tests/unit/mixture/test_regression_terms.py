"""The compiled terms of a regression and their Python source."""

import numpy as np
import pytest

from dart_skill.mixture import Gaussian, Regression
from tests.interpreted import interpreted
from tests.unit.mixture.random_mixture import random_mixture

PLAIN = interpreted("dart_skill.mixture._regression_terms")
NAMES = [name for name in vars(PLAIN) if name.startswith("write_") or name == "normalise"]


@pytest.mark.parametrize(("into", "out"), [([0], [1, 2, 3]), ([3, 0], [1, 4]), ([1, 2, 4], [0])])
def test_regression_by_one_component_is_its_conditional(into, out):
    mixture = random_mixture(np.random.default_rng(0), 1, 5)
    query = mixture.means_[0][into] + np.arange(1.0, 1.0 + len(into))
    order = sorted([*into, *out])
    conditional = Gaussian(
        mixture.means_[0][order], mixture.covariances_[0][np.ix_(order, order)]
    ).condition([order.index(i) for i in into], query)
    places = [sorted(out).index(i) for i in out]
    means, covariances = Regression(mixture, into, out)(query[None])
    np.testing.assert_allclose(means[0], conditional.mean[places], rtol=1e-8)
    np.testing.assert_allclose(
        covariances[0], conditional.covariance[np.ix_(places, places)], rtol=1e-8, atol=1e-10
    )


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
