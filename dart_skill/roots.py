"""The root of a function of one number by Brent's method, step for step as SciPy's `brentq`, whose import takes longer than many roots.

Brent, Algorithms for Minimization Without Derivatives (1973), chapter 4: where the last two or three values allow it, the next step is that
of the secant or of an inverse parabola; else half of the interval.
"""

from __future__ import annotations

from collections.abc import Callable

RELATIVE = 2.0**-50
"""Of a root, added to its tolerance: four times the spacing of floating-point numbers at 1."""
MOST_STEPS = 100


def root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Where a continuous function crosses zero between two numbers.

    * function: of one number.
    * low, high: where its signs differ; ValueError if they do not.
    * tolerance: of the root, in its unit.
    """
    before, here = low, high
    at_before, at_here = float(function(before)), float(function(here))
    if at_before == 0.0 or at_here == 0.0:
        return before if at_before == 0.0 else here
    if (at_before < 0.0) == (at_here < 0.0):
        raise ValueError(f"the function is {at_before:g} at {low:g} and {at_here:g} at {high:g}: it need not cross zero between them")
    other, at_other, last_step, step = before, at_before, 0.0, 0.0  # the root lies between `here` and `other`
    for _ in range(MOST_STEPS):
        if at_before != 0.0 and at_here != 0.0 and (at_before < 0.0) != (at_here < 0.0):
            other, at_other = before, at_before
            last_step = step = here - before
        if abs(at_other) < abs(at_here):
            before, here, other = here, other, here
            at_before, at_here, at_other = at_here, at_other, at_here
        least, half = (tolerance + RELATIVE * abs(here)) / 2.0, (other - here) / 2.0
        if at_here == 0.0 or abs(half) < least:
            return here
        last_step, step = _next(before, here, other, at_before, at_here, at_other, last_step, step, half, least)
        before, at_before = here, at_here
        here += step if abs(step) > least else least if half > 0.0 else -least
        at_here = float(function(here))
    raise ValueError(f"no root found between {low:g} and {high:g} in {MOST_STEPS} steps")


def _next(
    before: float,
    here: float,
    other: float,
    at_before: float,
    at_here: float,
    at_other: float,
    last_step: float,
    step: float,
    half: float,
    least: float,
) -> tuple[float, float]:
    """The step before the next one, and the next one; half of the interval twice where an interpolation is not trusted."""
    if abs(last_step) <= least or abs(at_here) >= abs(at_before):
        return half, half
    if before == other:
        tried = -at_here * (here - before) / (at_here - at_before)
    else:
        by_before, by_other = (at_before - at_here) / (before - here), (at_other - at_here) / (other - here)
        tried = -at_here * (at_other * by_other - at_before * by_before) / (by_other * by_before * (at_other - at_before))
    if 2.0 * abs(tried) < min(abs(last_step), 3.0 * abs(half) - least):
        return step, tried
    return half, half
