"""How many groups weighted points form, by data spectroscopy, DaSpec (thesis 5.3.2, (5.13)).

T. Shi, M. Belkin and B. Yu, Data spectroscopy: eigenspaces of convolution operators and clustering, Annals of Statistics 37, 2009. A group
shows as an eigenfunction of the Gaussian kernel that has no change of sign. A weight stands for so many copies of a point: the kernel is
sqrt(w_i) k(x_i, x_j) sqrt(w_j), its eigenvector v stands for the eigenfunction v / sqrt(w), and signs and labels are those of this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from dart_skill.checks import as_learnable, as_number, as_weights

NEAR, ALMOST_ALL = 0.05, 0.95
READINGS = ("copies", "printed")
EXACT = 1e-12  # a share of the weight that is reached but for this is reached


@dataclass(frozen=True, eq=False)
class Spectroscopy:
    """Groups of n points, the strongest first: label (n,) of each point, eigenvalues (n_groups,) and eigenfunctions (n, n_groups), positive
    where they are largest, and the bandwidth of the kernel.
    """

    labels: np.ndarray
    eigenvalues: np.ndarray
    eigenfunctions: np.ndarray
    bandwidth: float

    @property
    def n_groups(self) -> int:
        return len(self.eigenvalues)


def data_spectroscopy(
    points: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    bandwidth: float | None = None,
    core: float = 0.99,
    tolerance: float | None = None,
    counts: bool = False,
    reading: str = "copies",
) -> Spectroscopy:
    """Groups among points (n, d) with weights (n,) of any scale, equal when None.

    bandwidth: omega of (5.13), in the units of the points; None for `automatic_bandwidth`.
    core, tolerance: an eigenfunction f has no change of sign when f > -t for at least the share `core` of all weight, or f < t, where
    t = tolerance s and |f| is s or less for that share. The authors have core = 1 and tolerance = 1 / n, which None stands for, n the
    number of points. Then lone points of little weight are groups; 0.99 leaves them out. Figure 5.5 is a case for a larger tolerance.
    counts: weights are numbers of copies; the result is that of the copies, also with a tolerance that depends on their number.
    reading: "copies", as above; "printed" is (5.13) to the letter, kernel w_i k w_j with signs and labels from its eigenvectors, for which
    a weight of 2 is neither two points nor one.
    A point of weight zero plays no part and gets the label of where it lies.
    """
    points = as_learnable(points, "points")
    weights = as_weights(weights, len(points))
    if reading not in READINGS:
        raise ValueError(f"reading must be one of {READINGS}, got {reading!r}")
    distances = _distances(points)
    bandwidth = _bandwidth(distances, weights, points.shape[1]) if bandwidth is None else as_number(bandwidth, "bandwidth")
    if tolerance is None:
        tolerance = 1.0 / float(weights.sum() if counts else np.count_nonzero(weights))
    tolerance, core = as_number(tolerance, "tolerance", strict=False), as_number(core, "core")
    if core > 1:
        raise ValueError(f"core must be at most 1, all weight, got {core:g}")
    kernel = np.exp(-0.5 * np.square(distances / bandwidth))
    values, functions = _eigenfunctions(kernel, weights / weights.max(), reading)
    kept = _keep_their_sign(functions, weights, core, tolerance)
    kept[0] |= not kept.any()  # the strongest has no change of sign, but for equals that are mixed
    functions = functions[:, kept]
    return Spectroscopy(np.abs(functions).argmax(axis=1), values[kept], functions, float(bandwidth))


def automatic_bandwidth(points: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Bandwidth for points (n, d) with weights (n,), as Shi, Belkin and Yu (2009) choose it: for 95 % of the points, 95 % of the kernel's
    mass reaches the nearest 5 % of the points, or more. In one place all at once, points have none: 1.
    """
    points = as_learnable(points, "points")
    return _bandwidth(_distances(points), as_weights(weights, len(points)), points.shape[1])


def _bandwidth(distances: np.ndarray, weights: np.ndarray, n_dims: int) -> float:
    near = _quantiles(distances, weights, NEAR)
    reach = _quantiles(near[None], weights, ALMOST_ALL)[0]
    quantile = np.sqrt(2.0 * scipy.special.gammaincinv(n_dims / 2.0, ALMOST_ALL))  # of chi with n_dims degrees of freedom
    if reach == 0.0:
        # More than 5 % of all weight lies on single points: the least distance says how fine things are.
        reach = distances[distances > 0].min() if distances.any() else quantile
    return float(reach / quantile)


def _quantiles(values: np.ndarray, weights: np.ndarray, level: float) -> np.ndarray:
    """(m,) least of values (m, n) such that at least this share of the weights (n,) lies on it and below: each row's quantile."""
    order = np.argsort(values, axis=1, kind="stable")
    reached = np.cumsum(weights[order], axis=1)
    place = (reached >= level * reached[:, -1:] * (1 - EXACT)).argmax(axis=1)
    return np.take_along_axis(values, order, axis=1)[np.arange(len(values)), place]


def _distances(points: np.ndarray) -> np.ndarray:
    return np.sqrt(np.square(points[:, None] - points[None]).sum(axis=2))


def _eigenfunctions(kernel: np.ndarray, weights: np.ndarray, reading: str) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (m,), the strongest first, and eigenfunctions (n, m), positive where they are largest."""
    root = np.sqrt(weights) if reading == "copies" else weights
    values, vectors = np.linalg.eigh(root[:, None] * kernel * root)
    values, vectors = values[::-1], vectors[:, ::-1]
    certain = values > len(values) * np.finfo(float).eps * values[0]
    values, functions = values[certain], vectors[:, certain]
    if reading == "copies":
        # v / sqrt(w) without the division, which fails for small weights: the kernel carries an eigenfunction to any place.
        functions = kernel @ (root[:, None] * functions) / values
    largest = np.abs(functions[weights > 0]).argmax(axis=0)
    signs = np.sign(functions[weights > 0][largest, np.arange(len(values))])
    return values, functions * signs


def _keep_their_sign(functions: np.ndarray, weights: np.ndarray, core: float, tolerance: float) -> np.ndarray:
    """Which (m,) of functions (n, m) change their sign nowhere, but for a tolerance."""
    limits = tolerance * _quantiles(np.abs(functions).T, weights, core)
    strays = (1.0 - core + EXACT) * weights.sum()
    return (limits > 0) & (np.minimum(weights @ (functions < -limits), weights @ (functions > limits)) <= strays)
