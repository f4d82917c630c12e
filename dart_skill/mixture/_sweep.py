"""One iteration of EM over all samples as two matrix products.

White coordinates z are those in which all samples together have mean zero and covariance one. In
them the log of prior times density of a component is linear in the q different products of the
entries of (1, z). So the E step is (K, q) @ (q, n), and the sums of the M step are (K, n) @ (n,
q). The samples are processed in slices that fit into the cache. No array of size (n, K) is stored.

A sample that a block does not see (a row of nan) is stored as (0, 0) instead of (1, z). Then all
its products are zero, and it adds nothing to the density and the sums of this block.

Squares about a common origin lose digits if a component is narrow compared to the range of the
samples. White coordinates keep this loss small. If a bound of the loss is too large, the sweep
uses the deviations from each mean instead. This costs more and is as accurate as the plain form.

Equally wide blocks often begin with columns that are the same in all of them, or are turned and
shifted alike in all samples, as time is. White coordinates are told from the first column on
(Cholesky), so that such columns have the same ones in all blocks. Their products are stored once.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from itertools import accumulate, groupby, pairwise
from typing import NamedTuple

import numpy as np

from dart_skill.mixture._gaussian import LOG_2PI, raise_to_floor, symmetric, upper_triangle
from dart_skill.mixture._second_moments import write_coefficients, write_components

SLICE = 4096
"""Largest number of samples that are gone through at a time."""
EPSILON = float(np.finfo(float).eps)
"""Relative rounding error."""
KEPT = 4 * SLICE
"""Largest number of samples whose products are kept between sweeps; of more, computing them again
costs no more than reading them.
"""
PART = 160_000
"""Largest number of kept numbers that are gone through at a time: 1.3 MB, as a core of today's
processors has a megabyte or more of cache. For many components it is half of that.
"""
QUICK = 1_000_000
"""Number of multiplications up to which OpenBLAS has a quicker way."""
LARGEST_LOSS = 1e-10
"""Largest error of a log density that is computed from products."""
LOSS_SHARE = 1e-4
"""Largest such error, as a share of the rise of the likelihood at which EM stops."""
LEAST_DENSITY = 1e-180
"""Density of a sample, relative to the highest peak, above which it loses nothing by LEAST_LOG."""
LEAST_LOG = -460.0
"""Log density of a component, relative to the highest peak, below which it is taken for zero."""
FEW = 0.6
"""Share of exponentials that are not zero up to which these alone are computed."""
ALIKE = 1e-12
"""Difference of white coordinates, which are about one, that is taken for rounding."""
DEAD_SHARE = 1e-3
"""Count of a component below which it is dead, in weights of one sample."""

# glibc gives the memory of an array above a threshold back to the system, and gets the next one
# page by page: a tenth of the time of a fit. The threshold grows to the size of the largest array
# that was freed (mallopt(3), M_MMAP_THRESHOLD), here to 4 MB that are not touched.
np.empty(4 << 20, np.uint8)


def seen_rows(block: np.ndarray) -> np.ndarray:
    """(n,) whether a block (n, d) sees each sample; it does not see those whose rows are nan."""
    return ~np.isnan(block[:, 0])


class Components(NamedTuple):
    """Components of P equally wide blocks in white coordinates.

    Parameters
    ----------
    means : (P, K, d)
    affine : (P, K, d, 1 + d)
        [-L^-1 mean, L^-1] of the covariances L L', which makes standard normal numbers of (1, z).
    log_volumes : (P, K)
        Log of sqrt(det(2 pi L L')).
    precisions : (P, K)
        An upper bound of the eigenvalues of each inverse covariance.
    """

    means: np.ndarray
    affine: np.ndarray
    log_volumes: np.ndarray
    precisions: np.ndarray

    @classmethod
    def of(cls, means: np.ndarray, covariances: np.ndarray) -> Components:
        whiteners = np.linalg.inv(np.linalg.cholesky(covariances))
        affine = np.concatenate([-(whiteners @ means[..., None]), whiteners], axis=-1)
        log_volumes = 0.5 * means.shape[-1] * LOG_2PI - np.add.reduce(
            np.log(whiteners.diagonal(0, -2, -1)), -1
        )
        return cls(means, affine, log_volumes, np.einsum("pkij,pkij->pk", whiteners, whiteners))

    @classmethod
    def of_sums(cls, sums: np.ndarray, d: int) -> Components | None:
        """From the sums (P, K, q) of count times the products of the entries of (1, z), z (d,);
        None if a covariance is singular.
        """
        stack = sums.shape[:2]
        found = cls(
            np.empty((*stack, d)), np.empty((*stack, d, 1 + d)), np.empty(stack), np.empty(stack)
        )
        return found if write_components(sums, *found) else None

    @property
    def whiteners(self) -> np.ndarray:
        """L^-1 (P, K, d, d)."""
        return self.affine[..., 1:]

    def moved(self, origin: np.ndarray) -> Components:
        """The same components if their means were told from an origin (P, K, d)."""
        offsets = self.affine[..., :1] - self.whiteners @ origin[..., None]
        return self._replace(
            means=self.means + origin, affine=np.concatenate([offsets, self.whiteners], axis=-1)
        )


class Sums(NamedTuple):
    """What the M step needs.

    Parameters
    ----------
    mass : (K,)
        Sum of the counts.
    log_density : (n,)
        In the units of the blocks; for each `WhiteBlocks` an origin (P, K, d), or None for 0, and
        products (P, K, q): the sum over the samples of count times the products of the entries of
        (1, z - origin), the upper triangle by rows.
    """

    mass: np.ndarray
    log_density: np.ndarray
    origins: Sequence[np.ndarray | None]
    products: list[np.ndarray]


class WhiteBlocks:
    """Samples (n, d) of P equally wide blocks in white coordinates, x = root z + centre, stored as
    (1, z): white (P, 1 + d, n).

    Attributes
    ----------
    least_peaks : (P,)
        0, the log density of samples that the block does not see, or -inf if it sees all.
    least_mass : (P, 1)
        Below it a component has almost no count there.
    centre : (P, 1, d)
        Root and inverse_root (P, 1, d, d).
    reach : (P, 1)
        Largest square of a sample (1, z).
    steepest
        A bound of the squares of inverse_root.
    """

    def __init__(self, blocks: list[np.ndarray], weights: np.ndarray, floor: float):
        (n, d), p = blocks[0].shape, len(blocks)
        self.floor, self.white, self.centre = floor, np.empty((p, 1 + d, n)), np.empty((p, 1, d))
        self.least_peaks, self.least_mass, self.reach = (
            np.empty(p),
            np.empty((p, 1)),
            np.empty((p, 1)),
        )
        self.root, self.inverse_root = np.empty((p, 1, d, d)), np.empty((p, 1, d, d))
        for j, block in enumerate(blocks):
            self._whiten(j, block, weights)
        self.log_volume = np.log(np.einsum("pkii->pi", self.root)).sum(-1)
        self.most_least_mass = float(self.least_mass.max())
        self.steepest = float(np.square(self.inverse_root).sum((-2, -1)).max())
        self.upper, self.square = upper_triangle(1 + d)
        # Of (1, z) so many entries come first that are the same in all blocks. Products of two of
        # them are stored for the first block only.
        self.n_alike = _n_alike(self.white)
        self.columns = _columns(p, 1 + d, self.n_alike)
        self.n_products = int(self.columns[-1, -1]) + 1

    def _whiten(self, j: int, block: np.ndarray, weights: np.ndarray) -> None:
        seen, white = seen_rows(block), self.white[j]
        sees_all = bool(seen.all())
        if not sees_all:
            block, weights = np.where(seen[:, None], block, 0.0), weights * seen
        share = weights / weights.sum()
        centre = share @ block
        centred = block - centre
        # At least the floor, so that a direction without variance can be scaled, too.
        weighted = np.multiply(centred.T, share, out=white[1:])
        root = np.linalg.cholesky(raise_to_floor(symmetric(weighted @ centred), self.floor))
        inverse_root = np.linalg.inv(root)
        white[0] = seen
        np.matmul(inverse_root, centred.T, out=white[1:])
        if not sees_all:
            white[1:] *= seen
        self.least_peaks[j], self.least_mass[j] = (
            -np.inf if sees_all else 0.0,
            DEAD_SHARE * weights.sum() / seen.sum(),
        )
        self.centre[j], self.root[j], self.inverse_root[j] = centre, root, inverse_root
        self.reach[j] = np.einsum("in,in->n", white, white).max()

    def to_white(self, means: np.ndarray, covariances: np.ndarray) -> Components:
        """From means (P, K, d) and covariances (P, K, d, d) in the units of the blocks."""
        turn = self.inverse_root.swapaxes(-1, -2)
        return Components.of(
            (means - self.centre) @ turn[:, 0], symmetric(self.inverse_root @ covariances @ turn)
        )

    def from_white(self, components: Components) -> tuple[np.ndarray, np.ndarray]:
        lower = self.root @ np.linalg.inv(components.whiteners)
        return components.means @ self.root[:, 0].swapaxes(
            -1, -2
        ) + self.centre, lower @ lower.swapaxes(-1, -2)

    def write_products(self, span: slice, out: np.ndarray) -> None:
        """Write the products of the entries of (1, z) of the samples in span to out (n_products,
        m), where `columns` says.
        """
        row = 0
        for j, white in enumerate(self.white[..., span]):
            n_rows, known = len(white), self.n_alike if j else 0
            for i in range(n_rows):
                n = n_rows - max(i, known)
                if i:
                    np.multiply(white[i], white[n_rows - n :], out=out[row : row + n])
                else:
                    out[row : row + n] = white[known:]
                row += n

    def log_peaks(self, components: Components) -> np.ndarray:
        """(P, K) log density of each component at its mean."""
        return -self.log_volume[:, None] - components.log_volumes

    def deviations(self, components: Components, span: slice) -> np.ndarray:
        """(1, z - mean) of the samples in span from each component: (P, K, 1 + d, m)."""
        means = np.pad(components.means, ((0, 0), (0, 0), (1, 0)))
        return self.white[:, None, :, span] - means[..., None] * self.white[:, None, :1, span]

    def log_densities(self, components: Components, deviations: np.ndarray) -> np.ndarray:
        """(P, K, m) log densities from (1, deviations) (P, K, 1 + d, m)."""
        white = components.whiteners @ deviations[:, :, 1:]
        return (
            -0.5 * np.einsum("pkin,pkin->pkn", white, white)
            + self.log_peaks(components)[..., None] * deviations[:, :, 0]
        )

    def maximise(self, origin: np.ndarray | None, products: np.ndarray) -> Components:
        """Components from the sums; eigenvalues of covariances are at least the floor, in the
        units of the blocks.

        A component with almost no count in a block gets mean and covariance of all samples there.
        """
        if min(products[..., 0].ravel().tolist()) < self.most_least_mass:
            origin, products = self._with_count(origin, products)
        components = Components.of_sums(products, self.white.shape[1] - 1)
        if components is not None and self.are_above_floor(components):
            return components if origin is None else components.moved(origin)
        if len(products) == 1:
            return self._raised(origin, products)
        alone = [slice(j, j + 1) for j in range(len(products))]
        found = [
            self._only(one).maximise(None if origin is None else origin[one], products[one])
            for one in alone
        ]
        return Components(*map(np.concatenate, zip(*found, strict=True)))

    def _with_count(
        self, origin: np.ndarray | None, products: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Origins and products, which are those of all samples, about zero, where a component has
        almost no count.
        """
        unowned = (products[..., 0] < self.least_mass)[..., None]
        of_all = np.equal(self.upper % len(self.square), self.upper // len(self.square))
        return origin if origin is None else np.where(unowned, 0.0, origin), np.where(
            unowned, of_all, products
        )

    def _only(self, which: slice) -> WhiteBlocks:
        """Some of the blocks."""
        few = copy(self)
        for name in (
            "white",
            "centre",
            "root",
            "inverse_root",
            "log_volume",
            "least_peaks",
            "least_mass",
            "reach",
        ):
            setattr(few, name, getattr(self, name)[which])
        return few

    def _raised(self, origin: np.ndarray | None, products: np.ndarray) -> Components:
        """Components of products about the origin, with eigenvalues that are raised to the floor."""
        moments = (products / products[..., :1])[..., self.square]
        step, root = moments[..., 0, 1:], self.root
        covariances = moments[..., 1:, 1:] - step[..., :, None] * step[..., None, :]
        raised = raise_to_floor(symmetric(root @ covariances @ root.swapaxes(-1, -2)), self.floor)
        means = step if origin is None else step + origin
        return self.to_white(means @ root[:, 0].swapaxes(-1, -2) + self.centre, raised)

    def are_above_floor(self, components: Components) -> bool:
        """Whether all eigenvalues of the covariances are at least the floor in the units of the
        blocks: those of the precisions are at most the sum of all of them, which nearly always
        settles it, often by a bound of it.
        """
        if max(components.precisions.ravel().tolist()) * self.steepest * self.floor <= 1.0:
            return True
        whiteners = components.whiteners @ self.inverse_root
        if np.einsum("pkij,pkij->pk", whiteners, whiteners).max() * self.floor <= 1.0:
            return True
        return bool(np.linalg.norm(whiteners, 2, axis=(-2, -1)).max() ** 2 * self.floor <= 1.0)


class Sweep:
    """All samples, prepared for iterations of EM: blocks (n, d_p), weights (n,)

    Parameters
    ----------
    floor
        Least variance of a component.
    tolerance
        The rise of the mean log-likelihood at which EM stops.
    n_components
        About so many there will be. Equally wide blocks that follow each other are gone through at
        once.
    """

    def __init__(
        self,
        blocks: list[np.ndarray],
        weights: np.ndarray,
        floor: float,
        tolerance: float = 0.0,
        n_components: int = 1,
    ):
        self.weights, self.largest_loss = weights, max(LARGEST_LOSS, LOSS_SHARE * tolerance)
        self.blocks = [
            WhiteBlocks(list(alike), weights, floor)
            for _, alike in groupby(blocks, key=lambda block: block.shape[1])
        ]
        # A row of ones comes first, for the priors: the products of a block are zero for samples
        # that it does not see.
        edges = list(accumulate((one.n_products for one in self.blocks), initial=1))
        self.rows, self.n_rows = [slice(*pair) for pair in pairwise(edges)], edges[-1]
        part = PART if _quick_number(n_components) * PART <= QUICK else PART // 2
        self.spans = _spans(
            len(weights), SLICE if len(weights) > KEPT else min(SLICE, part // self.n_rows)
        )
        self._scratch: np.ndarray | None = None
        self._kept = [self._products(span) for span in self.spans] if len(weights) <= KEPT else []
        if not self._kept:
            self._scratch = np.empty(
                (self.n_rows, max(span.stop - span.start for span in self.spans))
            )

    def _products(self, span: slice) -> np.ndarray:
        """Products (1 + q, m) of all blocks for the m samples in span, written over those of the
        last span unless they are kept.
        """
        out = (
            np.empty((self.n_rows, span.stop - span.start))
            if self._scratch is None
            else self._scratch[:, : span.stop - span.start]
        )
        out[0] = 1.0
        for blocks, rows in zip(self.blocks, self.rows, strict=True):
            blocks.write_products(span, out[rows])
        return out

    def to_white(self, means: list[np.ndarray], covariances: list[np.ndarray]) -> list[Components]:
        """From means (K, d_p) and covariances (K, d_p, d_p) of each block, in the units of the
        blocks.
        """
        edges = accumulate((len(one.white) for one in self.blocks), initial=0)
        spans = [slice(*pair) for pair in pairwise(edges)]
        return [
            one.to_white(np.array(means[span]), np.array(covariances[span]))
            for one, span in zip(self.blocks, spans, strict=True)
        ]

    def from_white(
        self, components: list[Components]
    ) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Means (K, d_p) and covariances (K, d_p, d_p) of each block, in the units of the blocks."""
        pairs = [
            blocks.from_white(one) for blocks, one in zip(self.blocks, components, strict=True)
        ]
        return [mean for means, _ in pairs for mean in means], [
            covariance for _, covariances in pairs for covariance in covariances
        ]

    def __call__(self, priors: np.ndarray, components: list[Components]) -> Sums:
        """E step, and the sums of the M step that follows."""
        if self.is_exact_by_products(components):
            return self.by_products(np.log(priors), components)
        return self.by_deviations(np.log(priors), components)

    def is_exact_by_products(self, components: list[Components]) -> bool:
        """Whether squares about a common origin lose few enough digits of the log densities of
        these components.
        """
        parts = zip(self.blocks, components, strict=True)
        loss = EPSILON * max(
            max((blocks.reach * one.precisions).ravel().tolist()) for blocks, one in parts
        )
        return loss <= self.largest_loss

    def sums_of(self, counts: np.ndarray) -> Sums:
        """The sums of an M step from given counts (n, K), by products; log densities are zero."""
        total = np.zeros((counts.shape[1], self.n_rows))
        for i, span in enumerate(self.spans):
            total += counts[span].T @ self._products_of(i).T
        return self._sums(total, np.zeros(len(counts)))

    def maximise(self, sums: Sums) -> list[Components]:
        """M step; no component may have a total count of zero."""
        parts = zip(self.blocks, sums.origins, sums.products, strict=True)
        return [blocks.maximise(origin, products) for blocks, origin, products in parts]

    def _coefficients(
        self, log_priors: np.ndarray, components: list[Components]
    ) -> tuple[np.ndarray, float]:
        """Coefficients (K, 1 + q) of the products in the log of prior times density, relative to a
        bound of it, and this bound: the highest peak of all components. Relative to it no product
        of prior and density is above one. There may be a row of zeros behind them.
        """
        coefficients, highest = (
            np.zeros((_quick_number(len(log_priors)), self.n_rows)),
            log_priors.copy(),
        )
        for blocks, one, rows in zip(self.blocks, components, self.rows, strict=True):
            peaks = blocks.log_volume, blocks.least_peaks
            write_coefficients(
                one.affine, one.log_volumes, *peaks, highest, blocks.columns, coefficients[:, rows]
            )
        top = max(highest.tolist())
        coefficients[: len(log_priors), 0] = log_priors - top
        return coefficients, top

    def by_products(self, log_priors: np.ndarray, components: list[Components]) -> Sums:
        """See `__call__`; by squares about a common origin."""
        coefficients, top = self._coefficients(log_priors, components)
        n, total, log_density = (
            len(log_priors),
            np.zeros(coefficients.shape),
            np.empty(len(self.weights)),
        )
        for i, span in enumerate(self.spans):
            products = self._products_of(i)
            rows = coefficients @ products
            counts = rows[:n]
            _exponentials(counts.reshape(-1))
            density = np.add.reduce(counts, 0)
            if density[density.argmin()] > LEAST_DENSITY:
                counts *= self.weights[span] / density
                np.log(density, out=log_density[span])
            else:
                np.matmul(coefficients, products, out=rows)
                log_density[span] = to_counts(counts, self.weights[span])
            total += rows @ products.T
        log_density += top
        return self._sums(total[:n], log_density)

    def _products_of(self, i: int) -> np.ndarray:
        """Products (1 + q, m) of the samples in span i."""
        return self._kept[i] if self._kept else self._products(self.spans[i])

    def _sums(self, total: np.ndarray, log_density: np.ndarray) -> Sums:
        """From sums (K, 1 + q) of counts times products."""
        parts = zip(self.blocks, self.rows, strict=True)
        sums = [
            total[:, rows].take(blocks.columns, axis=1).swapaxes(0, 1) for blocks, rows in parts
        ]
        return Sums(total[:, 0], log_density, [None] * len(self.blocks), sums)

    def by_deviations(self, log_priors: np.ndarray, components: list[Components]) -> Sums:
        """See `__call__`; by the deviations from each mean."""
        mass, log_density = np.zeros(len(log_priors)), np.empty(len(self.weights))
        sides = [blocks.white.shape[:2] for blocks in self.blocks]
        squares = [np.zeros((p, len(log_priors), side, side)) for p, side in sides]
        parts = list(zip(self.blocks, components, strict=True))
        for span in self.spans:
            deviations = [blocks.deviations(one, span) for blocks, one in parts]
            terms = [
                blocks.log_densities(one, deviation)
                for (blocks, one), deviation in zip(parts, deviations, strict=True)
            ]
            counts = sum((term for its in terms for term in its), np.zeros(()))
            counts += log_priors[:, None]
            log_density[span] = to_counts(counts, self.weights[span])
            mass += counts.sum(1)
            for square, deviation in zip(squares, deviations, strict=True):
                square += (deviation * counts[:, None, :]) @ deviation.swapaxes(-1, -2)
        sums = [
            square.reshape(*square.shape[:2], -1)[..., blocks.upper]
            for blocks, square in zip(self.blocks, squares, strict=True)
        ]
        return Sums(mass, log_density, [one.means for one in components], sums)


def _n_alike(white: np.ndarray) -> int:
    """How many of the first rows of white coordinates (P, 1 + d, n) are the same in all blocks; 0
    for a single one.
    """
    if len(white) == 1:
        return 0
    for i, row in enumerate(white[0]):
        if np.abs(white[1:, i] - row).max() > ALIKE:
            return i
    return len(white[0])


@lru_cache(maxsize=64)
def _columns(n_blocks: int, side: int, n_alike: int) -> np.ndarray:
    """Where the products (P, q) of the entries of each (1, z), the upper triangle (side, side) by
    rows, are among all that are stored.
    """
    own = (np.arange(n_blocks)[:, None] == 0) | (np.triu_indices(side)[1] >= n_alike)
    stored = np.cumsum(own).reshape(own.shape) - 1
    columns = np.where(own, stored, stored[0])
    columns.flags.writeable = False
    return columns


def _spans(n: int, most: int) -> list[slice]:
    """Parts of n samples, of about equal length and at most `most` each; of at least one sample."""
    edges = np.linspace(0, n, -(-n // max(most, 1)) + 1).round().astype(int).tolist()
    return [slice(start, stop) for start, stop in pairwise(edges)]


def _quick_number(n_rows: int) -> int:
    """So many rows, or one more: OpenBLAS multiplies four rows with a long matrix in three
    quarters of the time that it takes for three.
    """
    return n_rows + (n_rows % 4 == 3)


def _exponentials(logs: np.ndarray) -> None:
    """Exponentials of logarithms (n,) in place, 0 of those below LEAST_LOG: where components are
    narrow, most are.
    """
    seen = np.flatnonzero(logs >= LEAST_LOG)
    if len(seen) < FEW * len(logs):
        values = np.exp(logs[seen])
        logs[:] = 0.0
        logs[seen] = values
    else:
        # an exponential that underflows takes many times as long
        np.exp(logs.clip(LEAST_LOG, np.inf, out=logs), out=logs)


def to_counts(log_values: np.ndarray, weights: np.ndarray | float) -> np.ndarray:
    """Turn logs of prior times density (K, n) into counts (responsibilities times weights), in
    place.

    Returns the log density (n,) of the mixture.
    """
    top = log_values.max(0)
    log_values -= top
    np.exp(log_values, out=log_values)
    total = log_values.sum(0)
    log_values *= weights / total
    np.log(total, out=total)
    return np.add(total, top, out=total)
