"""What task frames see of samples; and products of the Gaussians that they see, mapped into the
world: (7.21).

A frame (A, b) whose Gaussian has the mean mu and the covariance L L' says of a point x of the
world that L^-1 A^-1 (x - b) has the mean L^-1 mu and the covariance one. What all frames say is
one least-squares problem in x - about, where `about` is the middle of the mapped means. It is
solved by Householder's QR, so that no condition number is squared. This module is compiled
(docs/development.md): _frame_products.pxd beside it has the types.
"""

import math

import numpy as np

from dart_skill.common.small_matrices import invert_into

# A direction of the world counts as seen when the frames tell it apart from the others by this
# share at least.
LEAST_PIVOT = 1e-12


def write_seen(
    world: np.ndarray, inverses: np.ndarray, b: np.ndarray, place: np.ndarray, columns: np.ndarray
) -> None:
    """Write samples as a frame sees them, A^-1 (x - b).

    Parameters
    ----------
    world
        (n, m), the samples.
    inverses, b
        A^-1 (s, d, m) and (s, m) of its places.
    place
        (n,), which of these it has, -1 where it is missing.
    columns
        (d, n), are written, but where it is missing.
    """
    offset = np.empty(world.shape[1])
    for n in range(world.shape[0]):
        s = place[n]
        if s >= 0:
            for j in range(offset.shape[0]):
                offset[j] = world[n, j] - b[s, j]
            for i in range(columns.shape[0]):
                total = 0.0
                for j in range(offset.shape[0]):
                    total += inverses[s, i, j] * offset[j]
                columns[i, n] = total


class FrameProducts:
    """Products for new situations of P frames with K components over m features.

    Parameters
    ----------
    means
        (P, K, m), as the frames see them; zero in directions that a frame does not see.
    whiteners
        (P, K, m, m), L^-1; zero in such directions.
    n_shared
        So many features, the first, are asked of one frame only, and the others from all frames
        given these.
    """

    def __init__(self, means: np.ndarray, whiteners: np.ndarray, n_shared: int):
        n_frames, _, m = means.shape
        self._means, self._whiteners, self._n_shared = means, whiteners, n_shared
        self._about, self._inverse = np.empty(m), np.empty((m, m))
        # The equations of one component lie in columns, the right side comes last.
        self._equations = np.empty((m + 1, n_frames * m))

    def write(
        self,
        A: np.ndarray,
        inverses: np.ndarray,
        b: np.ndarray,
        seen: np.ndarray,
        mean: np.ndarray,
        covariance: np.ndarray,
    ) -> int:
        """Write the products at n moments, and return the first feature that the frames do not
        tell from others, or m.

        Parameters
        ----------
        A, inverses, b
            (n, P, m, m), (n, P, m, m) and (n, P, m), as of `FrameSituation`.
        seen
            (n, P), 0 for a missing frame; at least one of each moment is there.
        mean
            (n, K, m), is written.
        covariance
            (n, K, m, m), is written.
        """
        m, undetermined = mean.shape[2], mean.shape[2]
        for n in range(mean.shape[0]):
            for k in range(mean.shape[1]):
                self._find_middle(A[n], b[n], seen[n], k)
                feature = self._make_triangle(inverses[n], b[n], seen[n], k)
                if feature < m:
                    undetermined = min(undetermined, feature)
                else:
                    self._solve(mean[n, k], covariance[n, k])
        return undetermined

    def _find_middle(self, A: np.ndarray, b: np.ndarray, seen: np.ndarray, k: int) -> None:
        """The mean of component k as the frames map it to the world, averaged over those that are
        there.
        """
        n_seen = 0
        for p in range(seen.shape[0]):
            n_seen += seen[p]
        for i in range(self._about.shape[0]):
            total = 0.0
            for p in range(seen.shape[0]):
                if seen[p]:
                    total += b[p, i]
                    for j in range(self._about.shape[0]):
                        total += A[p, i, j] * self._means[p, k, j]
            self._about[i] = total / n_seen

    def _make_triangle(self, inverses: np.ndarray, b: np.ndarray, seen: np.ndarray, k: int) -> int:
        """As many equations as features, of component k: a triangle, if shared features are the
        last unknowns.

        Whiteners are lower triangles, so the first rows of a frame are of the shared features
        alone, and the others say what the rest is given them. Returns the first feature that is
        not determined, or m.
        """
        m, n_shared, n_rows, first_frame = self._about.shape[0], self._n_shared, 0, -1
        n_others = m - n_shared
        for p in range(seen.shape[0]):
            if seen[p]:
                if first_frame < 0:
                    first_frame = p
                for i in range(n_shared, m):
                    self._put_equation(inverses, b, p, k, i, n_rows)
                    n_rows += 1
        _reflect(self._equations, 0, n_others, n_rows)
        for j in range(n_others):
            if not _is_determined(self._equations, j):
                return n_shared + j
        for i in range(n_shared):
            self._put_equation(inverses, b, first_frame, k, i, n_others + i)
        _reflect(self._equations, n_others, m, m)
        return m

    def _put_equation(
        self, inverses: np.ndarray, b: np.ndarray, p: int, k: int, i: int, row: int
    ) -> None:
        """Row i of what frame p says of component k, as one of the equations. Shared features come
        behind the others.
        """
        m = self._about.shape[0]
        right = 0.0
        for j in range(i + 1):
            right += self._whiteners[p, k, i, j] * self._means[p, k, j]
        for c in range(m):
            total = 0.0
            for j in range(i + 1):
                total += self._whiteners[p, k, i, j] * inverses[p, j, c]
            right += total * (b[p, c] - self._about[c])
            if c < self._n_shared:
                self._equations[m - self._n_shared + c, row] = total
            else:
                self._equations[c - self._n_shared, row] = total
        self._equations[m, row] = right

    def _solve(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Mean (m,) and covariance (m, m) from the triangle R x = r: R^-1 r and R^-1 R^-1'."""
        m = mean.shape[0]
        right = self._equations[m]
        # Columns are rows here, so this is the transpose of R^-1.
        invert_into(self._equations[:m, :m], self._inverse)
        for i in range(m):
            feature = (i + self._n_shared) % m
            total = 0.0
            for c in range(i, m):
                total += self._inverse[c, i] * right[c]
            mean[feature] = self._about[feature] + total
            for j in range(i + 1):
                total = 0.0
                for c in range(i, m):
                    total += self._inverse[c, i] * self._inverse[c, j]
                other = (j + self._n_shared) % m
                covariance[feature, other] = covariance[other, feature] = total


def _reflect(columns: np.ndarray, first: int, stop: int, n_rows: int) -> None:
    """Householder's reflections of rows from `first` to n_rows, so that columns from `first` to
    `stop` end at their diagonal.

    columns (c, r): of the matrix, the last is the right side; is overwritten. What would be zero
    below the diagonal is not.
    """
    for j in range(first, stop):
        square = 0.0
        for i in range(j, n_rows):
            square += columns[j, i] * columns[j, i]
        if square == 0.0:
            continue
        length = math.sqrt(square)
        if columns[j, j] < 0.0:
            length = -length
        columns[j, j] += length
        scale = 1.0 / (length * columns[j, j])
        for c in range(j + 1, columns.shape[0]):
            total = 0.0
            for i in range(j, n_rows):
                total += columns[j, i] * columns[c, i]
            total *= scale
            for i in range(j, n_rows):
                columns[c, i] -= total * columns[j, i]
        columns[j, j] = -length


def _is_determined(columns: np.ndarray, j: int) -> bool:
    """Whether column j of the triangle is more than a sum of those before it."""
    total = 0.0
    for i in range(j + 1):
        total += columns[j, i] * columns[j, i]
    return columns[j, j] * columns[j, j] > LEAST_PIVOT * LEAST_PIVOT * total
