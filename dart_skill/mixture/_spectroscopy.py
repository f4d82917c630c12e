"""Number of groups of weighted points, by data spectroscopy, DaSpec (thesis 5.3.2, (5.13)).

T. Shi, M. Belkin and B. Yu, Data spectroscopy: eigenspaces of convolution operators and
clustering, Annals of Statistics 37, 2009. Each group has an eigenfunction of the Gaussian kernel
that does not change its sign. A weight is a number of copies of a point. Then the kernel is
sqrt(w_i) k(x_i, x_j) sqrt(w_j), and an eigenvector v of it belongs to the eigenfunction v /
sqrt(w). Signs and labels are taken from the eigenfunction.

An eigenvector of a tiny eigenvalue says nothing about groups: it belongs to a few points that
weigh next to nothing, and is close to zero everywhere else, where round-off and the threshold
decide on its sign. Therefore only eigenvectors above a share of the largest eigenvalue count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_learnable, as_number, as_weights

NEAR = 0.05
"""Share of the points that are near."""
ALMOST_ALL = 0.95
"""Share of the points, and of the mass of the kernel, that a bandwidth is made for."""
READINGS = ("copies", "printed")
"""What a weight stands for."""
EXACT = 1e-12  # rounding error that is allowed when a share of the weight is compared


@dataclass(frozen=True, eq=False)
class Spectroscopy:
    """Groups of n points, in the order of their eigenvalues, the largest first.

    Parameters
    ----------
    labels : (n,)
        Group of each point.
    eigenvalues : (n_groups,)
    eigenfunctions : (n, n_groups)
        Each is positive at the point where its magnitude is largest.
    bandwidth
        Of the kernel, in the units of the points.
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
    least: float = 0.01,
    tolerance: float | None = None,
    counts: bool = False,
    reading: str = "copies",
) -> Spectroscopy:
    """Groups among points (n, d) with weights (n,) of any scale, equal when None.

    A point with weight zero does not change the groups; it gets the label of the group at its
    place.

    Parameters
    ----------
    bandwidth
        Float, omega of (5.13) in the units of the points; default None: `automatic_bandwidth`.
    least
        Float in [0, 1), default 0.01. Eigenvectors count whose eigenvalue is above this share of
        the largest one. The authors have 0, all of them: then single points of little weight are
        groups. Between 0.001 and 0.1 the share hardly matters.
    tolerance
        Float t. An eigenfunction f does not change its sign if f > -t max |f| at all points of
        weight, or f < t max |f|. Default None: the authors' 1 / n, with n points. For figure 5.5
        it does with reading="printed"; with "copies" the figure needs 0.1.
    counts
        Bool, default False. True: the weights are numbers of copies, so that n counts copies, and
        the result is that of the copied points.
    reading
        "copies" (default), as described above. "printed" takes (5.13) literally: the kernel is w_i
        k w_j, and its eigenvectors give signs and labels. Then a weight of 2 is equal neither to
        two points nor to one.

    Raises
    ------
    ValueError
        For a reading that there is not, or if no eigenvalue can count.
    """
    points = as_learnable(points, "points")
    weights = as_weights(weights, len(points))
    if reading not in READINGS:
        raise ValueError(f"reading must be one of {READINGS}, got {reading!r}")
    distances = _distances(points)
    bandwidth = (
        _bandwidth(distances, weights, points.shape[1])
        if bandwidth is None
        else as_number(bandwidth, "bandwidth")
    )
    if tolerance is None:
        tolerance = 1.0 / float(weights.sum() if counts else np.count_nonzero(weights))
    tolerance, least = (
        as_number(tolerance, "tolerance", strict=False),
        as_number(least, "least", strict=False),
    )
    if least >= 1:
        raise ValueError(f"least must be below 1, the largest eigenvalue, got {least:g}")
    kernel = np.exp(-0.5 * np.square(distances / bandwidth))
    values, functions = _eigenfunctions(kernel, weights / weights.max(), reading, least)
    kept = _keep_their_sign(functions[weights > 0], tolerance)
    # the first has no change of sign, unless equal eigenvalues mix several eigenfunctions
    kept[0] |= not kept.any()
    functions = functions[:, kept]
    return Spectroscopy(
        np.abs(functions).argmax(axis=1), values[kept], functions, float(bandwidth)
    )


def automatic_bandwidth(points: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Bandwidth for points (n, d) with weights (n,), as Shi, Belkin and Yu (2009) choose it.

    For 95 % of the points, the radius that holds 95 % of the kernel's mass also holds at least the
    nearest 5 % of the points. If all points are equal, the bandwidth is 1.
    """
    points = as_learnable(points, "points")
    return _bandwidth(_distances(points), as_weights(weights, len(points)), points.shape[1])


def _bandwidth(distances: np.ndarray, weights: np.ndarray, n_dims: int) -> float:
    from scipy.special import gammaincinv  # most who learn a mixture count no groups

    near = _quantiles(distances, weights, NEAR)
    reach = _quantiles(near[None], weights, ALMOST_ALL)[0]
    # of chi with n_dims degrees of freedom
    quantile = np.sqrt(2.0 * gammaincinv(n_dims / 2.0, ALMOST_ALL))
    if reach == 0.0:
        # Most points have 5 % of all weight at distance zero: take the least distance between
        # different points instead.
        reach = distances[distances > 0].min() if distances.any() else quantile
    return float(reach / quantile)


def _quantiles(values: np.ndarray, weights: np.ndarray, level: float) -> np.ndarray:
    """Weighted quantile (m,) of each row of values (m, n) with weights (n,): the least value at or
    below which this share lies.
    """
    order = np.argsort(values, axis=1, kind="stable")
    reached = np.cumsum(weights[order], axis=1)
    place = (reached >= level * reached[:, -1:] * (1 - EXACT)).argmax(axis=1)
    return np.take_along_axis(values, order, axis=1)[np.arange(len(values)), place]


def _distances(points: np.ndarray) -> np.ndarray:
    return np.sqrt(np.square(points[:, None] - points[None]).sum(axis=2))


def _eigenfunctions(
    kernel: np.ndarray, weights: np.ndarray, reading: str, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (m,) that count, the largest first, and eigenfunctions (n, m), positive where
    their magnitude is largest.
    """
    root = np.sqrt(weights) if reading == "copies" else weights
    values, vectors = np.linalg.eigh(root[:, None] * kernel * root)
    values, vectors = values[::-1], vectors[:, ::-1]
    counted = values > max(least, len(values) * np.finfo(float).eps) * values[0]
    values, functions = values[counted], vectors[:, counted]
    if reading == "copies":
        # v / sqrt(w) without the division, which fails for small weights: the kernel gives an
        # eigenfunction at any point.
        functions = kernel @ (root[:, None] * functions) / values
    largest = np.abs(functions[weights > 0]).argmax(axis=0)
    signs = np.sign(functions[weights > 0][largest, np.arange(len(values))])
    return values, functions * signs


def _keep_their_sign(functions: np.ndarray, tolerance: float) -> np.ndarray:
    """Which (m,) of the functions (n, m) do not change their sign, within the tolerance."""
    limits = tolerance * np.abs(functions).max(axis=0)
    return (functions > -limits).all(axis=0) | (functions < limits).all(axis=0)
