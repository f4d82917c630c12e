"""Whether demonstrations show one pattern or several: a throw over the shoulder and one from below
make no mean that was shown.

The distance of two demonstrations is the mean one along their best alignment. Average linkage
groups them. The number of groups is the one with the largest mean silhouette (Rousseeuw 1987): how
much nearer the own group is than the next one, as a share, from -1 to 1. Groups are patterns if it
is above 0.71, where Kaufman and Rousseeuw (Finding Groups in Data, 1990) speak of a strong
structure, and if they are three times as far apart as they are wide (Dunn 1974). Else the
demonstrations vary, and are one pattern.

How often one pattern is taken for several: of 400 draws from a Gaussian in one dimension, the
worst case, 8.2 % for 4 demonstrations, 2.5 % for 7, none for 10; in two dimensions 2.0 % for 4,
none for 5. The silhouette alone would be wrong in 14, 22 and 26 %.

The best alignment is that of dynamic time warping (Sakoe and Chiba 1978).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_number, as_samples, as_vector, floats


def warped_distance(first: ArrayLike, second: ArrayLike) -> tuple[float, int]:
    """Least sum of distances over monotone alignments of two paths, and how many pairs of samples
    that alignment has.

    D(i, j) = |a_i - b_j| + min(D(i-1, j), D(i, j-1), D(i-1, j-1)).

    Parameters
    ----------
    first
        (n, d).
    second
        (m, d).
    """
    first = as_samples(first, "first")
    second = as_samples(second, "second", first.shape[1])
    totals, pairs = _aligned(np.linalg.norm(first[:, None] - second, axis=2)[None])
    return float(totals[0]), int(pairs[0])


def mean_warped_distances(paths: Sequence[np.ndarray]) -> np.ndarray:
    """Mean distance of any two of N paths along their best alignment (N, N).

    Parameters
    ----------
    paths
        (n, d) each, of the same length.
    """
    stacked = floats(paths)
    rows, columns = np.triu_indices(len(stacked), 1)
    totals, pairs = _aligned(
        np.linalg.norm(stacked[rows, :, None] - stacked[columns, None], axis=3)
    )
    distances = np.zeros((len(stacked), len(stacked)))
    distances[rows, columns] = distances[columns, rows] = totals / pairs
    return distances


def _aligned(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D(n, m), and the number of pairs, of the best alignment (N,) for N matrices of distances (N,
    n, m); one antidiagonal at a time.
    """
    count, n, m = distances.shape
    total = np.full((count, n + 1, m + 1), np.inf)
    total[:, 0, 0] = 0.0
    pairs = np.zeros((count, n + 1, m + 1), dtype=int)
    for diagonal in range(2, n + m + 1):
        i = np.arange(max(1, diagonal - m), min(n, diagonal - 1) + 1)
        j = diagonal - i
        before = np.stack([total[:, i - 1, j - 1], total[:, i - 1, j], total[:, i, j - 1]])
        steps = np.stack([pairs[:, i - 1, j - 1], pairs[:, i - 1, j], pairs[:, i, j - 1]])
        best = np.argmin(before, axis=0)[None]
        total[:, i, j] = distances[:, i - 1, j - 1] + np.take_along_axis(before, best, 0)[0]
        pairs[:, i, j] = 1 + np.take_along_axis(steps, best, 0)[0]
    return total[:, n, m], pairs[:, n, m]


STRONG = 0.71
"""Least mean silhouette of several patterns."""
APART = 3.0
"""Least distance of two patterns, in units of their width."""
N_SAMPLES = 50
"""Number of samples of each path that is compared, equally spaced."""


@dataclass(frozen=True, eq=False)
class Patterns:
    """The patterns among demonstrations, in the order in which they were first shown.

    Parameters
    ----------
    labels : (n,)
        Pattern of each demonstration.
    silhouette
        Mean of the demonstrations for these patterns, from -1 to 1; of one pattern the best that
        two or more would have.
    separation
        Least distance between demonstrations of two patterns, in parts of the largest within one;
        of one pattern as above.
    starts : (n, d)
        Where the demonstrations begin.
    """

    labels: np.ndarray
    silhouette: float
    separation: float
    starts: np.ndarray

    @property
    def groups(self) -> list[np.ndarray]:
        """The demonstrations of each pattern, as indices."""
        return [np.flatnonzero(self.labels == label) for label in range(self.labels.max() + 1)]

    def beginning_at(self, start: ArrayLike) -> int:
        """The pattern of the demonstration that begins nearest to a point.

        Parameters
        ----------
        start
            (d,).
        """
        start = as_vector(start, "start", self.starts.shape[1])
        return int(self.labels[np.argmin(np.linalg.norm(self.starts - start, axis=1))])

    @property
    def in_words(self) -> str:
        """As "2 patterns: demonstrations 0, 1 and 4; 2 and 3", or "one pattern"."""
        if len(self.groups) == 1:
            return "one pattern"
        return (
            f"{len(self.groups)} patterns: demonstrations"
            f" {'; '.join(_listed(group) for group in self.groups)}"
        )


def find_patterns(
    positions: Sequence[ArrayLike],
    *,
    least_silhouette: float = STRONG,
    least_separation: float = APART,
) -> Patterns:
    """The patterns among at least 4 demonstrations, in frames in which those of one pattern look
    alike.

    Of three, none would have a silhouette that is large enough: one stands alone, and counts 0. A
    pattern may have a single demonstration.

    Parameters
    ----------
    positions
        For each demonstration its movement variables (n_i, d), in units that may be compared.
    least_silhouette
        Float, default 0.71. Least mean silhouette of several patterns.
    least_separation
        Float, default 3. Least distance between two patterns, in parts of the largest within one.

    Raises
    ------
    ValueError
        For fewer demonstrations, or a least value of 0 or less.
    """
    if len(positions) < 4:
        raise ValueError(
            f"patterns are looked for among at least 4 demonstrations, got {len(positions)}"
        )
    least, apart = (
        as_number(least_silhouette, "least_silhouette"),
        as_number(least_separation, "least_separation"),
    )
    paths = [
        as_samples(path, f"positions of demonstration {i}") for i, path in enumerate(positions)
    ]
    for i, path in enumerate(paths):
        if path.shape[1] != paths[0].shape[1]:
            raise ValueError(
                f"demonstration {i} has {path.shape[1]} movement variables, the first has"
                f" {paths[0].shape[1]}"
            )
    distances = mean_warped_distances([resampled(path, N_SAMPLES) for path in paths])
    labels, found = _best_groups(distances)
    between = separation(distances, labels)
    several = found > least and between > apart
    return Patterns(
        labels if several else np.zeros_like(labels),
        found,
        between,
        np.array([path[0] for path in paths]),
    )


def resampled(path: np.ndarray, n: int) -> np.ndarray:
    """A path at n instants, equally spaced over its indices: (n, d).

    Parameters
    ----------
    path
        (m, d).
    """
    place = np.linspace(0.0, len(path) - 1.0, n)
    return np.column_stack([np.interp(place, np.arange(len(path)), column) for column in path.T])


def _best_groups(distances: np.ndarray) -> tuple[np.ndarray, float]:
    """Labels (n,), and their mean silhouette, of the number of groups for which it is largest;
    distances (n, n).
    """
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.spatial.distance import squareform

    tree = linkage(squareform(distances, checks=False), "average")
    cuts = [_in_order(fcluster(tree, count, "maxclust")) for count in range(2, len(distances))]
    cuts = [labels for labels in cuts if labels.any()]
    if not cuts:  # all are the same
        return np.zeros(len(distances), dtype=int), 0.0
    scores = [silhouette(distances, labels) for labels in cuts]
    best = int(np.argmax(scores))
    return cuts[best], scores[best]


def silhouette(distances: np.ndarray, labels: np.ndarray) -> float:
    """Mean over the points of (b - a) / max(a, b), with the mean distances a to the own group and
    b to the nearest other one.

    A point alone in its group counts 0, and so does one for which all are the same (Rousseeuw
    1987).

    Parameters
    ----------
    distances
        (n, n).
    labels
        (n,), from 0 on, of at least two groups.
    """
    member = (labels[:, None] == np.arange(labels.max() + 1)).astype(float)
    sizes, sums = member.sum(axis=0), distances @ member
    own = member.astype(bool)
    within = sums[own] / np.maximum(sizes[labels] - 1.0, 1.0)
    other = np.where(own, np.inf, sums / sizes).min(axis=1)
    largest = np.maximum(within, other)
    counts = (sizes[labels] > 1) & (largest > 0.0)
    return float(
        np.mean(np.where(counts, (other - within) / np.where(largest > 0.0, largest, 1.0), 0.0))
    )


def separation(distances: np.ndarray, labels: np.ndarray) -> float:
    """Least distance between two groups in parts of the largest within one (Dunn 1974); inf if no
    group has any width, 0 of a single group.

    Parameters
    ----------
    distances
        (n, n).
    labels
        (n,).
    """
    same = labels[:, None] == labels
    if same.all():
        return 0.0
    between, within = distances[~same].min(), distances[same].max()
    return float(between / within) if within > 0.0 else np.inf


def _in_order(labels: np.ndarray) -> np.ndarray:
    """The same groups, numbered from 0 in the order in which they first occur."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def _listed(group: np.ndarray) -> str:
    *others, last = map(str, group.tolist())
    return f"{', '.join(others)} and {last}" if others else last
