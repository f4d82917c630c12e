"""Linear equations with a handful of unknowns, such as those of the joints of an arm.

For matrices this small a call of LAPACK takes several times as long as its arithmetic. This module
is compiled (docs/development.md): small_matrices.pxd beside it has the types.
"""

import math

import numpy as np


def factor_into(matrix: np.ndarray, lower: np.ndarray) -> None:
    """Write the Cholesky factor L of a matrix L L' (n, n); what is above the diagonal stays as it
    is.

    Parameters
    ----------
    matrix
        (n, n) symmetric and positive definite; its lower triangle is read, and it may be `lower`
        itself.
    lower
        (n, n), is written.

    Raises
    ------
    ValueError
        If the matrix is not positive definite.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] = rest / lower[j, j]
            elif rest > 0.0:
                lower[i, i] = math.sqrt(rest)
            else:
                raise ValueError(
                    f"a matrix of {n} rows is not positive definite: its pivot {i} is {rest:g}"
                )


def solve_into(lower: np.ndarray, right: np.ndarray, solution: np.ndarray) -> None:
    """Write the solution x (n,) of L L' x = right.

    Parameters
    ----------
    lower
        The factor L (n, n).
    right
        (n,), may be `solution` itself.
    solution
        (n,), is written.
    """
    n = right.shape[0]
    for i in range(n):
        rest = right[i]
        for k in range(i):
            rest -= lower[i, k] * solution[k]
        solution[i] = rest / lower[i, i]
    for i in range(n - 1, -1, -1):
        rest = solution[i]
        for k in range(i + 1, n):
            rest -= lower[k, i] * solution[k]
        solution[i] = rest / lower[i, i]


def invert_into(lower: np.ndarray, inverse: np.ndarray) -> None:
    """Write the inverse of a lower triangle L (n, n), which is one, too.

    Parameters
    ----------
    lower
        (n, n); what is above the diagonal is not read.
    inverse
        (n, n), is written, with zeros above the diagonal; not `lower` itself.
    """
    n = lower.shape[0]
    for j in range(n):
        for i in range(j):
            inverse[i, j] = 0.0
        inverse[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, n):
            rest = 0.0
            for k in range(j, i):
                rest -= lower[i, k] * inverse[k, j]
            inverse[i, j] = rest / lower[i, i]
