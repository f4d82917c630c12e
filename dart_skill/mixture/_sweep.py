"""One iteration of EM over all samples as two matrix products.

White coordinates z are those in which all samples together have mean zero and covariance one. In them the log of prior
times density of a component is linear in the q different products of the entries of (1, z). So the E step is
(K, q) @ (q, n), and the sums of the M step are (K, n) @ (n, q). The samples are processed in slices that fit into the
cache. No array of size (n, K) is stored.

A sample that a block does not see (a row of nan) is stored as (0, 0) instead of (1, z). Then all its products are zero,
and it adds nothing to the density and the sums of this block.

Squares about a common origin lose digits if a component is narrow compared to the range of the samples. White
coordinates keep this loss small. If a bound of the loss is too large, the sweep uses the deviations from each mean
instead. This costs more and is as accurate as the plain form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dart_skill.mixture._gaussian import LOG_2PI, raise_to_floor, symmetric, upper_triangle

SLICE = 4096
EPSILON = float(np.finfo(float).eps)
# The products of up to so many samples are kept between sweeps. For more, computing them again costs no more than reading them.
KEPT = 4 * SLICE
# Those that are kept are gone through in parts of at most so many numbers, which stay in the cache between the two matrix products of an
# iteration: 600 kB, as processors of today have a megabyte and more of it for each core.
PART = 75_000
# Largest error of a log density that is computed from products, and what share of the rise at which EM stops it may be, too.
LARGEST_LOSS, LOSS_SHARE = 1e-10, 1e-4
# A sample whose density, relative to the highest peak, is above this has lost nothing to underflow.
LEAST_DENSITY, LEAST_LOG = 1e-250, -690.0
# A component is dead if its count is below this share of the weight of one sample.
DEAD_SHARE = 1e-3


def seen_rows(block: np.ndarray) -> np.ndarray:
    """(n,) whether a block (n, d) sees each sample; it does not see those whose rows are nan."""
    return ~np.isnan(block[:, 0])


@dataclass(frozen=True, eq=False)
class Components:
    """Components of one block in white coordinates.

    means (K, d); affine (K, d, 1 + d): [-L^-1 mean, L^-1] of the covariances L L', which makes standard normal numbers of (1, z);
    log_volumes (K,): log of sqrt(det(2 pi L L')); precisions (K,): an upper bound of the eigenvalues of each inverse covariance.
    """

    means: np.ndarray
    affine: np.ndarray
    log_volumes: np.ndarray
    precisions: np.ndarray

    @classmethod
    def of(cls, means: np.ndarray, covariances: np.ndarray) -> Components:
        whiteners = np.linalg.inv(np.linalg.cholesky(covariances))
        return cls._of_affine(means, np.concatenate([-(whiteners @ means[:, :, None]), whiteners], axis=2))

    @classmethod
    def of_second_moments(cls, moments: np.ndarray) -> Components:
        """From the means (K, 1 + d, 1 + d) of the outer products of (1, z).

        Their Cholesky factor is [[1, 0], [mean, L]], and the inverse of this [[1, 0], [-L^-1 mean, L^-1]].
        """
        return cls._of_affine(moments[:, 0, 1:], np.linalg.inv(np.linalg.cholesky(moments))[:, 1:])

    @classmethod
    def _of_affine(cls, means: np.ndarray, affine: np.ndarray) -> Components:
        whiteners = affine[:, :, 1:]
        log_volumes = 0.5 * means.shape[1] * LOG_2PI - np.log(np.einsum("kii->ki", whiteners)).sum(1)
        return cls(means, affine, log_volumes, np.einsum("kij,kij->k", whiteners, whiteners))

    @property
    def whiteners(self) -> np.ndarray:
        """L^-1 (K, d, d)."""
        return self.affine[:, :, 1:]

    def of_blocks(self, n_blocks: int) -> list[Components]:
        """Those of each block, if these are the components of equally wide blocks one after the other."""
        n = len(self.means) // n_blocks
        spans = [slice(n * j, n * (j + 1)) for j in range(n_blocks)]
        return [Components(self.means[one], self.affine[one], self.log_volumes[one], self.precisions[one]) for one in spans]

    def moved(self, origin: np.ndarray) -> Components:
        """The same components if their means were told from an origin (K, d)."""
        offsets = self.affine[:, :, :1] - self.whiteners @ origin[:, :, None]
        return replace(self, means=self.means + origin, affine=np.concatenate([offsets, self.whiteners], axis=2))


@dataclass(frozen=True, eq=False)
class Sums:
    """What the M step needs.

    mass (K,): sum of the counts; log_density (n,), in the units of the blocks; for each block an origin (K, d), or None for 0, and
    products (K, 1 + d, 1 + d): the sum over the samples of count times the outer product of (1, z - origin); products of equally wide
    blocks may be one array.
    """

    mass: np.ndarray
    log_density: np.ndarray
    origins: list[np.ndarray] | list[None]
    products: list[np.ndarray] | np.ndarray


class WhiteBlock:
    """Samples (n, d) of one block in white coordinates, x = root z + centre, stored as (1, z): (1 + d, n)."""

    def __init__(self, block: np.ndarray, weights: np.ndarray, floor: float):
        seen = seen_rows(block)
        self.sees_all = bool(seen.all())
        if not self.sees_all:
            block, weights = np.where(seen[:, None], block, 0.0), weights * seen
        share = weights / weights.sum()
        self.floor, self.least_mass = floor, DEAD_SHARE * weights.sum() / seen.sum()
        self.centre = share @ block
        centred = block - self.centre
        # At least the floor, so that a direction without variance can be scaled, too.
        self.root = np.linalg.cholesky(raise_to_floor(symmetric((centred * share[:, None]).T @ centred), floor))
        self.inverse_root = np.linalg.inv(self.root)
        self.log_volume = np.log(np.diagonal(self.root)).sum()
        self.white = np.empty((1 + len(self.centre), len(block)))
        self.white[0] = seen
        np.matmul(self.inverse_root, centred.T, out=self.white[1:])
        if not self.sees_all:
            self.white[1:] *= seen
        self.reach = float(np.einsum("in,in->n", self.white, self.white).max())
        side = len(self.white)
        self.upper, self.square = upper_triangle(side)
        self.n_products = len(self.upper)
        # Squares count half, mixed products twice half.
        self.factors = np.where(self.upper % (side + 1) == 0, -0.5, -1.0)

    def to_white(self, means: np.ndarray, covariances: np.ndarray) -> Components:
        whitened = symmetric(self.inverse_root @ covariances @ self.inverse_root.T)
        return Components.of((means - self.centre) @ self.inverse_root.T, whitened)

    def from_white(self, components: Components) -> tuple[np.ndarray, np.ndarray]:
        lower = self.root @ np.linalg.inv(components.whiteners)
        return components.means @ self.root.T + self.centre, lower @ np.swapaxes(lower, 1, 2)

    def write_products(self, span: slice, out: np.ndarray) -> None:
        """Write the products of the entries of (1, z) for the m samples in span, the upper triangle by rows, to out (q, m)."""
        white, row = self.white[:, span], len(self.white)
        out[:row] = white
        for i in range(1, len(white)):
            np.multiply(white[i], white[i:], out=out[row : row + len(white) - i])
            row += len(white) - i

    def coefficients(self, components: Components) -> np.ndarray:
        """Coefficients (K, q) of the products in the log density."""
        precisions = np.swapaxes(components.affine, 1, 2) @ components.affine
        coefficients = precisions.reshape(len(precisions), -1).take(self.upper, axis=1) * self.factors
        coefficients[:, 0] -= components.log_volumes + self.log_volume
        return coefficients

    def log_peaks(self, components: Components) -> np.ndarray:
        """(K,) the largest log density of each component; 0 is that of a sample that the block does not see."""
        peaks = -(components.log_volumes + self.log_volume)
        return peaks if self.sees_all else np.maximum(peaks, 0.0)

    def deviations(self, components: Components, span: slice) -> np.ndarray:
        """(1, z - mean) of the samples in span from each component: (K, 1 + d, m)."""
        means = np.pad(components.means, ((0, 0), (1, 0)))
        return self.white[:, span] - means[:, :, None] * self.white[0, span]

    def log_densities(self, components: Components, deviations: np.ndarray) -> np.ndarray:
        """(K, m) log densities from (1, deviations) (K, 1 + d, m)."""
        white = components.whiteners @ deviations[:, 1:]
        log_volumes = (components.log_volumes + self.log_volume)[:, None]
        return -0.5 * np.einsum("kin,kin->kn", white, white) - log_volumes * deviations[:, 0]

    def maximise(self, origin: np.ndarray | None, products: np.ndarray) -> Components:
        """Components from the sums; eigenvalues of covariances are at least the floor, in the units of the block.

        A component with almost no count in this block gets mean and covariance of all samples.
        """
        mass = products[:, 0, 0]
        moments = products / np.maximum(mass, self.least_mass)[:, None, None]
        if mass.min() < self.least_mass:
            unowned = mass < self.least_mass
            moments[unowned] = np.eye(moments.shape[1])
            origin = origin if origin is None else np.where(unowned[:, None], 0.0, origin)
        try:
            components = Components.of_second_moments(moments)
            if self._is_above_floor(components):
                return components if origin is None else components.moved(origin)
        except np.linalg.LinAlgError:
            pass
        step = moments[:, 0, 1:]
        covariances = moments[:, 1:, 1:] - step[:, :, None] * step[:, None, :]
        raised = raise_to_floor(symmetric(self.root @ covariances @ self.root.T), self.floor)
        means = step if origin is None else step + origin
        return self.to_white(means @ self.root.T + self.centre, raised)

    def _is_above_floor(self, components: Components) -> bool:
        """Whether all eigenvalues of the covariances are at least the floor in the units of the block: those of the precisions are at most
        the sum of all of them, which nearly always settles it.
        """
        whiteners = components.whiteners @ self.inverse_root
        if np.einsum("kij,kij->k", whiteners, whiteners).max() * self.floor <= 1.0:
            return True
        return bool(np.linalg.norm(whiteners, 2, axis=(1, 2)).max() ** 2 * self.floor <= 1.0)


class Sweep:
    """All samples, prepared for iterations of EM: blocks (n, d_p), weights (n,); floor: least variance of a component; tolerance: the rise
    of the mean log-likelihood at which EM stops.
    """

    def __init__(self, blocks: list[np.ndarray], weights: np.ndarray, floor: float, tolerance: float = 0.0):
        self.weights, self.largest_loss = weights, max(LARGEST_LOSS, LOSS_SHARE * tolerance)
        self.blocks = [WhiteBlock(block, weights, floor) for block in blocks]
        # A row of ones comes first, for the priors: the products of a block are zero for samples that it does not see.
        self.starts = np.cumsum([1] + [block.n_products for block in self.blocks])
        # Where the squares of equally wide blocks are, (P, 1 + d, 1 + d): their M step is done at once.
        alike = len(self.blocks) > 1 and len({block.n_products for block in self.blocks}) == 1
        self.square = self.starts[:-1, None, None] + self.blocks[0].square if alike else None
        self.spans = _spans(len(weights), SLICE if len(weights) > KEPT else min(SLICE, PART // int(self.starts[-1])))
        self._scratch: np.ndarray | None = None
        self._kept = [self._products(span) for span in self.spans] if len(weights) <= KEPT else []
        if not self._kept:
            self._scratch = np.empty((self.starts[-1], max(span.stop - span.start for span in self.spans)))

    def _products(self, span: slice) -> np.ndarray:
        """Products (1 + q, m) of all blocks for the m samples in span, written over those of the last span unless they are kept."""
        out = np.empty((self.starts[-1], span.stop - span.start)) if self._scratch is None else self._scratch[:, : span.stop - span.start]
        out[0] = 1.0
        for block, start in zip(self.blocks, self.starts, strict=False):
            block.write_products(span, out[start : start + block.n_products])
        return out

    def __call__(self, priors: np.ndarray, components: list[Components]) -> Sums:
        """E step, and the sums of the M step that follows."""
        parts = zip(self.blocks, components, strict=True)
        loss = EPSILON * max(block.reach * float(one.precisions.max()) for block, one in parts)
        if loss <= self.largest_loss:
            return self._by_products(np.log(priors), components)
        return self._by_deviations(np.log(priors), components)

    def maximise(self, sums: Sums) -> list[Components]:
        """M step; no component may have a total count of zero."""
        if (found := self._at_once(sums)) is not None:
            return found
        parts = zip(self.blocks, sums.origins, sums.products, strict=True)
        return [block.maximise(origin, products) for block, origin, products in parts]

    def _at_once(self, sums: Sums) -> list[Components] | None:
        """The M step of equally wide blocks in the time of one; None where one of them needs more care."""
        products = sums.products
        if not isinstance(products, np.ndarray) or products[:, :, 0, 0].min() < max(block.least_mass for block in self.blocks):
            return None
        moments = products / products[:, :, :1, :1]
        try:
            found = Components.of_second_moments(moments.reshape(-1, *moments.shape[2:])).of_blocks(len(moments))
        except np.linalg.LinAlgError:
            return None
        return found if all(block._is_above_floor(one) for block, one in zip(self.blocks, found, strict=True)) else None

    def _by_products(self, log_priors: np.ndarray, components: list[Components]) -> Sums:
        parts = [block.coefficients(one) for block, one in zip(self.blocks, components, strict=True)]
        # The highest peak of all components: relative to it no product of prior and density is above one.
        top = sum((block.log_peaks(one) for block, one in zip(self.blocks, components, strict=True)), log_priors).max()
        coefficients = np.concatenate([(log_priors - top)[:, None], *parts], axis=1)
        total, log_density = np.zeros_like(coefficients), np.empty(len(self.weights))
        for i, span in enumerate(self.spans):
            products = self._kept[i] if self._kept else self._products(span)
            counts = coefficients @ products
            np.maximum(counts, LEAST_LOG, out=counts)  # an exponential that underflows takes many times as long
            density = np.exp(counts, out=counts).sum(0)
            if density.min() > LEAST_DENSITY:
                counts *= self.weights[span] / density
                np.log(density, out=log_density[span])
            else:
                log_density[span] = to_counts(np.matmul(coefficients, products, out=counts), self.weights[span])
            total += counts @ products.T
        log_density += top
        squares: list[np.ndarray] | np.ndarray
        if self.square is None:
            squares = [total.take(start + block.square, axis=1) for start, block in zip(self.starts, self.blocks, strict=False)]
        else:
            squares = total.take(self.square, axis=1).swapaxes(0, 1)
        return Sums(total[:, 0], log_density, [None] * len(self.blocks), squares)

    def _by_deviations(self, log_priors: np.ndarray, components: list[Components]) -> Sums:
        mass, log_density = np.zeros(len(log_priors)), np.empty(len(self.weights))
        squares = [np.zeros((len(log_priors), len(block.white), len(block.white))) for block in self.blocks]
        parts = list(zip(self.blocks, components, strict=True))
        for span in self.spans:
            deviations = [block.deviations(one, span) for block, one in parts]
            terms = [block.log_densities(one, deviation) for (block, one), deviation in zip(parts, deviations, strict=True)]
            counts = sum(terms, np.zeros(()))
            counts += log_priors[:, None]
            log_density[span] = to_counts(counts, self.weights[span])
            mass += counts.sum(1)
            for square, deviation in zip(squares, deviations, strict=True):
                square += (deviation * counts[:, None, :]) @ np.swapaxes(deviation, 1, 2)
        return Sums(mass, log_density, [one.means for one in components], squares)


def _spans(n: int, most: int) -> list[slice]:
    """Parts of n samples, of about equal length and at most `most` each; of at least one sample."""
    edges = np.linspace(0, n, -(-n // max(most, 1)) + 1).round().astype(int).tolist()
    return [slice(start, stop) for start, stop in pairwise(edges)]


def to_counts(log_values: np.ndarray, weights: np.ndarray | float) -> np.ndarray:
    """Turn logs of prior times density (K, n) into counts (responsibilities times weights), in place.

    Returns the log density (n,) of the mixture.
    """
    top = log_values.max(0)
    log_values -= top
    np.exp(log_values, out=log_values)
    total = log_values.sum(0)
    log_values *= weights / total
    np.log(total, out=total)
    return np.add(total, top, out=total)
