"""Linear equations and eigenvalues of a handful of unknowns, such as those of the joints of an arm.

For matrices this small a call of LAPACK takes several times as long as its arithmetic. This module is compiled
(docs/development.md): small_matrices.pxd beside it has the types.
"""

import math

import numpy as np


def solve_positive_definite(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution x (n,) of matrix x = right, by Cholesky's factors.

    * matrix: (n, n) symmetric and positive definite; its lower triangle is read.
    * right: (n,).

    ValueError if the matrix is not positive definite.
    """
    n = len(right)
    lower, solution = np.empty((n, n)), np.empty(n)
    factor_into(matrix, lower)
    solve_into(lower, right, solution)
    return solution


def factor_into(matrix: np.ndarray, lower: np.ndarray) -> None:
    """Write the Cholesky factor L of a matrix L L' (n, n); what is above the diagonal stays as it is.

    * matrix: (n, n) symmetric and positive definite; its lower triangle is read, and it may be `lower` itself.
    * lower: (n, n), is written.

    ValueError if the matrix is not positive definite.
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
                raise ValueError(f"a matrix of {n} rows is not positive definite: its pivot {i} is {rest:g}")


def solve_into(lower: np.ndarray, right: np.ndarray, solution: np.ndarray) -> None:
    """Write the solution x (n,) of L L' x = right.

    * lower: the factor L (n, n).
    * right: (n,), may be `solution` itself.
    * solution: (n,), is written.
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


def eigen_into(matrix: np.ndarray, values: np.ndarray, directions: np.ndarray) -> None:
    """Write eigenvalues and eigenvectors of a symmetric matrix, by the symmetric QR algorithm (Golub and Van Loan, 8.3).

    * matrix: (n, n) symmetric, is overwritten.
    * values: (n,), is written; in no order.
    * directions: (n, n), is written: in each row the unit vector that belongs to a value.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(n):
            directions[i, j] = 0.0
        directions[i, i] = 1.0
    for k in range(n - 2):
        _reflect(matrix, directions, k)
    for i in range(n):
        values[i] = matrix[i, i]
    for high in range(n - 1, 0, -1):
        for _ in range(30):  # two or three suffice
            if not _is_coupled(matrix, values, high):
                break
            low = high - 1
            while low > 0 and _is_coupled(matrix, values, low):
                low -= 1
            _chase(matrix, values, directions, low, high)


def _reflect(matrix: np.ndarray, directions: np.ndarray, k: int) -> None:
    """Householder's reflection that leaves zeros in column k below the first subdiagonal, from both sides, and of the directions."""
    n, length, along = matrix.shape[0], 0.0, 0.0
    for i in range(k + 1, n):
        length += matrix[i, k] * matrix[i, k]
    length = math.sqrt(length)
    if length == 0.0:
        return
    if matrix[k + 1, k] > 0.0:
        length = -length
    # The mirror's normal v stands in column k, its image p = 2 A v / v'v in row k.
    matrix[k + 1, k] -= length
    scale = -1.0 / (length * matrix[k + 1, k])
    for i in range(k + 1, n):
        total = 0.0
        for j in range(k + 1, n):
            total += matrix[i, j] * matrix[j, k]
        matrix[k, i] = scale * total
        along += 0.5 * scale * matrix[k, i] * matrix[i, k]
    for i in range(k + 1, n):
        matrix[k, i] -= along * matrix[i, k]
    for i in range(k + 1, n):
        for j in range(k + 1, n):
            matrix[i, j] -= matrix[i, k] * matrix[k, j] + matrix[k, i] * matrix[j, k]
    for j in range(n):
        total = 0.0
        for i in range(k + 1, n):
            total += matrix[i, k] * directions[i, j]
        for i in range(k + 1, n):
            directions[i, j] -= scale * total * matrix[i, k]
    matrix[k + 1, k] = length


def _is_coupled(matrix: np.ndarray, values: np.ndarray, i: int) -> bool:
    """Whether the subdiagonal couples value i with the one before it by more than rounding."""
    return abs(matrix[i, i - 1]) > 1e-16 * (abs(values[i - 1]) + abs(values[i]))


def _chase(matrix: np.ndarray, values: np.ndarray, directions: np.ndarray, low: int, high: int) -> None:
    """One implicit step of QR with Wilkinson's shift on the rows from low to high: turns of two successive rows each."""
    n, beside = matrix.shape[0], matrix[high, high - 1]
    half = 0.5 * (values[high - 1] - values[high])
    root = math.sqrt(half * half + beside * beside)
    if half < 0.0:
        root = -root
    x, z = values[low] - values[high] + beside * beside / (half + root), matrix[low + 1, low]
    for k in range(low, high):
        length = math.sqrt(x * x + z * z)
        if length == 0.0:
            return
        cosine, sine = x / length, z / length
        first, second, beside = values[k], values[k + 1], matrix[k + 1, k]
        both = 2.0 * cosine * sine * beside
        values[k] = cosine * cosine * first + sine * sine * second + both
        values[k + 1] = sine * sine * first + cosine * cosine * second - both
        matrix[k + 1, k] = cosine * sine * (second - first) + (cosine * cosine - sine * sine) * beside
        if k > low:
            matrix[k, k - 1] = length
        if k < high - 1:
            x, z = matrix[k + 1, k], sine * matrix[k + 2, k + 1]
            matrix[k + 2, k + 1] *= cosine
        for j in range(n):
            first, second = directions[k, j], directions[k + 1, j]
            directions[k, j] = cosine * first + sine * second
            directions[k + 1, j] = cosine * second - sine * first


def invert_into(lower: np.ndarray, inverse: np.ndarray) -> None:
    """Write the inverse of a lower triangle L (n, n), which is one, too.

    * lower: (n, n); what is above the diagonal is not read.
    * inverse: (n, n), is written, with zeros above the diagonal; not `lower` itself.
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
