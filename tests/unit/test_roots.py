"""Roots of functions of one number: SciPy's to the last bit, and errors for what has none."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from dart_skill.roots import root

FUNCTIONS = {
    "cosine": (math.cos, 0.1, 3.0),
    "cubic": (lambda x: x**3 - 2.0 * x - 5.0, -1.0, 4.0),
    "exponential": (lambda x: math.exp(3.0 * x) - 10.0, -5.0, 5.0),
    "flat": (lambda x: (x - 0.3) ** 3 + 1e-3 * (x - 0.3), -1.0, 2.0),
    "jump": (lambda x: -0.7 if x < 0.41 else x, 0.0, 1.0),
    "downwards": (lambda x: 1.0 / (1.0 + x) - 0.2, 0.0, 1e6),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-12])
def test_a_root_is_that_of_scipy_to_the_last_bit_with_as_many_calls(name, tolerance):
    function, low, high = FUNCTIONS[name]
    asked = []
    found = root(lambda x: asked.append(x) or function(x), low, high, tolerance)
    theirs, told = brentq(function, low, high, xtol=tolerance, full_output=True)
    assert found == theirs and len(asked) == told.function_calls


def test_random_cubics_have_scipys_roots():
    random = np.random.default_rng(1)
    for a, b, c in random.normal(size=(200, 3)).tolist():

        def cubic(x, a=a, b=b, c=c):
            return x**3 + a * x * x + b * x + c

        assert root(cubic, -9.0, 9.0, 1e-9) == brentq(cubic, -9.0, 9.0, xtol=1e-9)


def test_an_end_may_be_the_root():
    assert root(lambda x: x, 0.0, 1.0, 1e-6) == 0.0
    assert root(lambda x: x - 1.0, 0.0, 1.0, 1e-6) == 1.0


def test_a_function_that_keeps_its_sign_is_refused():
    with pytest.raises(ValueError, match="is 1 at 0 and 2 at 1: it need not cross zero"):
        root(lambda x: 1.0 + x, 0.0, 1.0, 1e-6)
