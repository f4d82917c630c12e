"""What regression writes for each component and query, beside NumPy's matrices."""

import numpy as np
import pytest

from dart_skill.mixture import Gaussian, Regression, _regression, _regression_terms
from tests.interpreted import interpreted
from tests.unit.mixture.random_mixture import random_mixture

PLAIN = interpreted("dart_skill.mixture._regression_terms")
NAMES = [name for name in vars(PLAIN) if name.startswith("write_") or name == "normalise"]


@pytest.mark.parametrize(("into", "out"), [([0], [1, 2, 3]), ([3, 0], [1, 4]), ([1, 2, 4], [0])])
def test_conditionals_are_those_of_the_components(into, out):
    mixture = random_mixture(np.random.default_rng(0), 3, 5)
    input_means, whiteners, log_volumes, lines, within = _regression.Conditionals.of(
        mixture.means_, mixture.covariances_, np.array(into), np.array(out)
    )
    for k, (mean, covariance) in enumerate(zip(mixture.means_, mixture.covariances_, strict=True)):
        of_inputs = covariance[np.ix_(into, into)]
        query = input_means[k] + np.arange(1.0, 1.0 + len(into))
        # `condition` leaves the others in ascending order
        order = sorted([*into, *out])
        conditional = Gaussian(mean[order], covariance[np.ix_(order, order)]).condition(
            [order.index(i) for i in into], query
        )
        places = [sorted(out).index(i) for i in out]
        np.testing.assert_allclose(
            np.linalg.inv(whiteners[k].T @ whiteners[k]), of_inputs, rtol=1e-8, atol=1e-10
        )
        assert 2.0 * log_volumes[k] == pytest.approx(np.linalg.slogdet(of_inputs)[1])
        np.testing.assert_allclose(
            lines[k, 0] + np.arange(1.0, 1.0 + len(into)) @ lines[k, 1:],
            conditional.mean[places],
            rtol=1e-8,
        )
        np.testing.assert_allclose(
            within[k], conditional.covariance[np.ix_(places, places)], rtol=1e-8, atol=1e-10
        )


def test_a_log_density_that_overflows_or_is_not_a_number_is_seen():
    inputs, constants = np.array([[0.0, 0.0], [1e160, 0.0], [1e308, 1e308]]), np.zeros(2)
    whiteners = np.array([np.eye(2), [[1.0, 0.0], [-1e10, 1e10]]])
    for module in (_regression_terms, PLAIN):
        logs, top = np.empty((3, 2)), np.empty(3)
        with np.errstate(all="ignore"):
            module.write_logs(inputs, np.zeros((2, 2)), whiteners, constants, logs, top)
        assert np.isfinite(top).tolist() == [True, False, False]


@pytest.mark.parametrize(("n_components", "n_inputs"), [(1, 1), (3, 1), (9, 1), (4, 2)])
def test_compiled_and_interpreted_have_the_same_bits(monkeypatch, n_components, n_inputs):
    rng = np.random.default_rng(n_components)
    mixture, queries = (
        random_mixture(rng, n_components, n_inputs + 3),
        rng.normal(0.0, 3.0, (7, n_inputs)),
    )
    dims = rng.permutation(n_inputs + 3)
    compiled = Regression(mixture, dims[:n_inputs], dims[n_inputs:])(queries)
    for name in NAMES:
        monkeypatch.setattr(_regression, name, getattr(PLAIN, name))
    for one, other in zip(
        compiled, Regression(mixture, dims[:n_inputs], dims[n_inputs:])(queries), strict=True
    ):
        np.testing.assert_array_equal(one, other)
