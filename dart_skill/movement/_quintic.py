"""Splines of degree 5 as sums of B-splines: their values, and least squares with them, whose equations have six bands.

At each point six successive B-splines are not zero: `first` is the index of the first of them. This module is compiled
(docs/development.md): _quintic.pxd beside it has the types.
"""

import math

import numpy as np

DEGREE = 5
WIDTH = DEGREE + 1


def values(knots: np.ndarray, first: np.ndarray, points: np.ndarray, order: int) -> np.ndarray:
    """Derivatives (p, 6) of the B-splines that are not zero at points, by the recursion of Cox and de Boor.

    * knots: (k,), increasing, the first and the last six alike.
    * first: (p,), so that each point lies between the knots first + 5 and first + 6.
    * points: (p,).
    * order: of the derivatives, 0 to 5.
    """
    found, now, raised = np.empty((points.shape[0], WIDTH)), np.empty(WIDTH), np.empty(WIDTH)
    result, lower, higher = found, now, raised
    for p in range(points.shape[0]):
        span = first[p] + DEGREE
        _of_degree(knots, span, points[p], DEGREE - order, lower)
        for degree in range(DEGREE - order + 1, WIDTH):
            _differentiate(knots, span, degree, lower, higher)
        for k in range(WIDTH):
            result[p, k] = lower[k]
    return found


def sum_of_squares(first: np.ndarray, rows: np.ndarray, n: int) -> np.ndarray:
    """Bands (6, n), from the main diagonal down, of the matrix B'B whose rows (p, 6) begin at the columns first (p,).

    * first: (p,).
    * rows: (p, 6).
    * n: number of columns of B.
    """
    found = np.zeros((WIDTH, n))
    bands = found
    for p in range(rows.shape[0]):
        for k in range(WIDTH):
            for below in range(WIDTH - k):
                bands[below, first[p] + k] += rows[p, k] * rows[p, k + below]
    return found


def sums(first: np.ndarray, rows: np.ndarray, samples: np.ndarray, n: int) -> np.ndarray:
    """B'x (n, d) of samples x.

    * first, rows: of B, as in `sum_of_squares`.
    * samples: (p, d).
    * n: number of columns of B.
    """
    found = np.zeros((n, samples.shape[1]))
    result = found
    for p in range(rows.shape[0]):
        for k in range(WIDTH):
            for dim in range(samples.shape[1]):
                result[first[p] + k, dim] += rows[p, k] * samples[p, dim]
    return found


def combined(first: np.ndarray, rows: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """B c (p, d) of coefficients c.

    * first, rows: of B, as in `sum_of_squares`.
    * coefficients: (n, d).
    """
    found = np.zeros((rows.shape[0], coefficients.shape[1]))
    result = found
    for p in range(rows.shape[0]):
        for k in range(WIDTH):
            for dim in range(coefficients.shape[1]):
                result[p, dim] += rows[p, k] * coefficients[first[p] + k, dim]
    return found


def solve(bands: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution (n, d) of A x = right, by Cholesky's factors.

    * bands: (6, n), of the symmetric matrix A, from the main diagonal down.
    * right: (n, d).

    ValueError if A is not positive definite.
    """
    lower = factor(bands)
    return backward(lower, forward(lower, right))


def solve_penalised(bands: np.ndarray, roughness: np.ndarray, penalties: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solutions (n, d) of (A + penalty R) x = right, where each column has a penalty of its own.

    * bands, roughness: (6, n), of A and R, as of `solve`.
    * penalties: (d,).
    * right: (n, d).

    ValueError if one of these matrices is not positive definite.
    """
    n, n_dims = right.shape[0], right.shape[1]
    found, summed = np.empty((n, n_dims)), np.empty((WIDTH, n))
    solution, total = found, summed
    dim = 0
    while dim < n_dims:
        for below in range(WIDTH):
            for i in range(n):
                total[below, i] = bands[below, i] + penalties[dim] * roughness[below, i]
        end = dim + 1
        while end < n_dims and penalties[end] == penalties[dim]:
            end += 1
        alike = solve(summed, right[:, dim:end])
        for i in range(n):
            for column in range(dim, end):
                solution[i, column] = alike[i, column - dim]
        dim = end
    return found


def factor(bands: np.ndarray) -> np.ndarray:
    """Bands (6, n) of Cholesky's factor L.

    * bands: as of `solve`.

    ValueError if the matrix is not positive definite.
    """
    n, found = bands.shape[1], np.zeros((WIDTH, bands.shape[1]))
    lower = found
    for j in range(n):
        for below in range(min(WIDTH, n - j)):
            rest = bands[below, j]
            for k in range(1, min(WIDTH - below, j + 1)):
                rest -= lower[k, j - k] * lower[k + below, j - k]
            if below > 0:
                lower[below, j] = rest / lower[0, j]
            elif rest > 0.0:
                lower[0, j] = math.sqrt(rest)
            else:
                raise ValueError(f"not positive definite: its pivot {j} is {rest:g}")
    return found


def forward(lower: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution (n, d) of L x = right.

    * lower: bands (6, n) of L, as `factor` gives them.
    * right: (n, d).
    """
    n, n_dims = lower.shape[1], right.shape[1]
    found = np.empty((n, n_dims))
    solution = found
    for i in range(n):
        for dim in range(n_dims):
            solution[i, dim] = right[i, dim]
        for k in range(1, min(WIDTH, i + 1)):
            for dim in range(n_dims):
                solution[i, dim] -= lower[k, i - k] * solution[i - k, dim]
        for dim in range(n_dims):
            solution[i, dim] /= lower[0, i]
    return found


def backward(lower: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution (n, d) of L' x = right.

    * lower: bands (6, n) of L, as `factor` gives them.
    * right: (n, d).
    """
    n, n_dims = lower.shape[1], right.shape[1]
    found = np.empty((n, n_dims))
    solution = found
    for i in range(n - 1, -1, -1):
        for dim in range(n_dims):
            solution[i, dim] = right[i, dim]
        for k in range(1, min(WIDTH, n - i)):
            for dim in range(n_dims):
                solution[i, dim] -= lower[k, i] * solution[i + k, dim]
        for dim in range(n_dims):
            solution[i, dim] /= lower[0, i]
    return found


def _of_degree(knots: np.ndarray, span: int, point: float, degree: int, found: np.ndarray) -> None:
    """Write the values (degree + 1,) of the B-splines of a degree at a point between the knots span and span + 1."""
    found[0] = 1.0
    for q in range(1, degree + 1):
        saved = 0.0
        for r in range(q):
            before, after = point - knots[span + 1 - q + r], knots[span + 1 + r] - point
            share = found[r] / (before + after)
            found[r] = saved + after * share
            saved = before * share
        found[q] = saved


def _differentiate(knots: np.ndarray, span: int, degree: int, lower: np.ndarray, higher: np.ndarray) -> None:
    """Replace derivatives (degree,) of the B-splines of the degree below by the next derivatives (degree + 1,) of those of a degree."""
    for r in range(degree + 1):
        i = span - degree + r
        higher[r] = 0.0
        if r > 0:
            higher[r] += degree * lower[r - 1] / (knots[i + degree] - knots[i])
        if r < degree:
            higher[r] -= degree * lower[r] / (knots[i + degree + 1] - knots[i + 1])
    for r in range(degree + 1):
        lower[r] = higher[r]
