"""Gaussian mixture regression: thesis (3.3) to (3.5), with the full covariance of the conditional mixture.

The covariance is sum_k h_k (S_k + (m_k - m)(m_k - m)'). It includes the spread between the components. It is computed
from differences, so that no digits are lost: from the deviations m_k - m, or, what is the same, from those of each pair,
sum_(j<k) h_j h_k (m_j - m_k)(m_j - m_k)'. The responsibilities h_k are computed from log densities: far
from the data they would otherwise be 0 / 0. There a query belongs to the component whose density falls most slowly.
Queries lie along the last axis of the arrays and are processed in slices that fit into the cache.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.checks import as_dims, as_finite, as_samples, require_near
from dart_skill.mixture._expectation_maximisation import normalise_log
from dart_skill.mixture._gaussian import LOG_2PI, cholesky, symmetric, upper_triangle
from dart_skill.mixture._mixture import GaussianMixture

SLICE = 1024


class Conditionals(NamedTuple):
    """What K components say of o outputs, given i inputs.

    * input_means (K, i, 1), whiteners (K, i, i): L^-1 of the covariances L L' of the inputs; log_volumes (K,): log det L.
    * output_means (K, o, 1), slopes (K, o, i): the mean of the outputs is a line. within (K, o, o): their covariance.
    """

    input_means: np.ndarray
    whiteners: np.ndarray
    log_volumes: np.ndarray
    output_means: np.ndarray
    slopes: np.ndarray
    within: np.ndarray


class Regression:
    """Gaussian mixture regression of some dimensions on others, prepared for many calls: (3.3) to (3.5).

    A call `regression(inputs)` with inputs (n, i) returns mean (n, o) and covariance (n, o, o) of the outputs. With one
    input dimension, inputs (n,) are n queries.

    Parameters:

    * mixture: GaussianMixture, fitted or made from parameters.
    * input_dims: i distinct column indices of the mixture, in any order.
    * output_dims: o distinct column indices, none of them an input. Other columns may be left out of both.
    """

    def __init__(self, mixture: GaussianMixture, input_dims: ArrayLike, output_dims: ArrayLike):
        into, out = _split(mixture.n_dims, input_dims, output_dims)
        self._prepare(mixture.priors_, _conditionals(mixture.means_, mixture.covariances_, into, out))

    def _prepare(self, priors: np.ndarray, components: Conditionals) -> None:
        self._components = components
        self.n_outputs, self.n_inputs = components.slopes.shape[1:]
        self._times = _times(self.n_inputs)
        log_volumes = components.log_volumes + 0.5 * self.n_inputs * LOG_2PI
        self._constants = (np.log(priors) - log_volumes)[:, None]
        # The pairs of many components are more terms than the deviations of few outputs.
        by_pairs = self.n_inputs == 1 and 3 * len(priors) * (len(priors) - 1) <= 2 * self.n_outputs * (self.n_outputs + 1)
        self._moments: _MomentsByPairs | _MomentsByDeviations = (_MomentsByPairs if by_pairs else _MomentsByDeviations)(components)

    def __call__(self, inputs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        inputs = self._checked(inputs)
        mean, covariance = np.empty((len(inputs), self.n_outputs)), np.empty((len(inputs), self.n_outputs, self.n_outputs))
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            self._moments(*self._shares(inputs[span], start), mean[span], covariance[span])
        return mean, covariance

    def mean(self, inputs: ArrayLike) -> np.ndarray:
        """Mean (n, o) of the outputs (3.4) without their covariance; equal to the mean of a call to the last bit. inputs: (n, i)."""
        inputs = self._checked(inputs)
        mean = np.empty((len(inputs), self.n_outputs))
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            self._moments(*self._shares(inputs[span], start), mean[span])
        return mean

    def responsibilities(self, inputs: ArrayLike) -> np.ndarray:
        """h_k of (3.5): (n, K). inputs: (n, i)."""
        return self._shares(self._checked(inputs))[0].T

    def log_density(self, inputs: ArrayLike) -> np.ndarray:
        """(n,) log density of the inputs alone: it is low for a query that is far from the demonstrations."""
        logs, _, top = self._logs(self._checked(inputs))
        return top + np.log(np.exp(logs - top).sum(0))

    def _checked(self, inputs: ArrayLike) -> np.ndarray:
        given = inputs if isinstance(inputs, np.ndarray) else as_finite(inputs, "inputs")
        return as_samples(given[:, None] if given.ndim == 1 and self.n_inputs == 1 else given, "inputs", self.n_inputs)

    def _logs(self, inputs: np.ndarray, first_row: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Logs (K, n) of prior times density of the inputs (n, i), the inputs' deviations (K, i, n) from the components, and the largest
        logs (n,).
        """
        deviations = inputs.T - self._components.input_means
        with np.errstate(over="ignore", invalid="ignore"):
            white = self._times(self._components.whiteners, deviations)
            squares = np.square(white[:, 0], out=white[:, 0]) if self.n_inputs == 1 else np.einsum("kin,kin->kn", white, white)
            squares *= 0.5
            logs = np.subtract(self._constants, squares, out=squares)
        top = np.maximum.reduce(logs, 0)
        if not top[top.argmin()] > -np.inf:  # nor if it is not a number
            require_near(top, inputs, "inputs", first_row)
        return logs, deviations, top

    def _shares(self, inputs: np.ndarray, first_row: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Responsibilities (K, n) of inputs (n, i), and the inputs' deviations (K, i, n) from the components."""
        logs, deviations, top = self._logs(inputs, first_row)
        logs -= top
        shares = np.exp(logs, out=logs)
        shares *= 1.0 / np.add.reduce(shares, 0)
        return shares, deviations


class _MomentsByDeviations:
    """Mean and covariance of the outputs from the deviations of the components' means, by (3.4) and (3.5)."""

    def __init__(self, components: Conditionals) -> None:
        self._components = components
        self._times = _times(components.slopes.shape[2])

    @cached_property
    def _collector(self) -> np.ndarray:
        """What makes the covariance of shares, and of the upper triangle of the spread between the components; a mean does without."""
        within = self._components.within
        return np.concatenate([within.reshape(len(within), -1), _unpacking(within.shape[1])])

    def __call__(self, shares: np.ndarray, deviations: np.ndarray, mean: np.ndarray, covariance: np.ndarray | None = None) -> None:
        """Write mean (n, o) and total covariance (n, o, o) for shares (K, n) and deviations (K, i, n) of the inputs."""
        means = self._times(self._components.slopes, deviations)
        means += self._components.output_means
        centre = np.einsum("kn,kon->on", shares, means)
        mean[:] = centre.T
        if covariance is None:
            return
        means -= centre
        means *= np.sqrt(shares)[:, None, :]
        row, parts = len(shares), np.empty((len(self._collector), len(mean)))
        parts[:row] = shares
        for i in range(len(centre)):
            np.einsum("kn,kon->on", means[:, i], means[:, i:], out=parts[row : row + len(centre) - i])
            row += len(centre) - i
        np.matmul(parts.T, self._collector, out=covariance.reshape(len(mean), -1))


class _MomentsByPairs:
    """The same for one input, where both are sums of shares, and of products of two shares, times powers of the input; their coefficients
    depend on the mixture only.

    A pair counts most in the middle between its centres. There its powers begin, so that none is large where it counts.
    """

    def __init__(self, components: Conditionals) -> None:
        self._components = components
        # (K, 2, o): each component's mean of the outputs, and its slope
        self._lines = np.concatenate([components.output_means.swapaxes(1, 2), components.slopes.swapaxes(1, 2)], axis=1)

    @cached_property
    def _of_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Middle (p, 1) of each pair; and coefficients (K + 3 p, o o) in the covariance of shares, and of the products of two shares times
        1, s and s s, with s from the middle.
        """
        pairs, within = _pairs(len(self._lines)), self._components.within
        one, other = self._lines.take(pairs, axis=0)
        begin, end = self._components.input_means[:, 0].take(pairs, axis=0)
        half = 0.5 * (end - begin)
        apart = other - one
        apart[:, 0] -= half * (one[:, 1] + other[:, 1])  # in the middle
        squares = apart[:, :, None, :, None] * apart[:, None, :, None]
        terms = np.concatenate([within, squares[:, 0, 0], squares[:, 0, 1] + squares[:, 1, 0], squares[:, 1, 1]])
        return begin + half, terms.reshape(len(terms), -1)

    def __call__(self, shares: np.ndarray, deviations: np.ndarray, mean: np.ndarray, covariance: np.ndarray | None = None) -> None:
        """As of `_MomentsByDeviations`."""
        k, n = shares.shape
        lines = np.empty((k, 2, n))
        lines[:, 0] = shares
        np.multiply(shares, deviations[:, 0], out=lines[:, 1])
        np.matmul(lines.reshape(2 * k, n).T, self._lines.reshape(2 * k, -1), out=mean)
        if covariance is None:
            return
        middles, collector = self._of_pairs
        terms = np.empty((len(collector), n))
        terms[:k] = shares
        constant, linear, square = terms[k:].reshape(3, -1, n)
        s = deviations[0] + (self._components.input_means[0] - middles)
        one, other = shares.take(_pairs(k), axis=0)
        np.multiply(one, other, out=constant)
        np.multiply(constant, s, out=linear)
        np.multiply(linear, s, out=square)
        np.matmul(terms.T, collector, out=covariance.reshape(n, -1))


@lru_cache(maxsize=64)
def _pairs(n: int) -> np.ndarray:
    """Indices (2, p) of the first and of the second of each pair of n."""
    return np.array(np.triu_indices(n, 1))


@lru_cache(maxsize=64)
def _unpacking(n_dims: int) -> np.ndarray:
    """Zeros and ones (q, d d) that make a symmetric matrix of its upper triangle: a product with them is faster than copying."""
    return np.equal.outer(np.arange(n_dims * (n_dims + 1) // 2), upper_triangle(n_dims)[1].ravel()).astype(float)


def _conditionals(means: np.ndarray, covariances: np.ndarray, into: np.ndarray, out: np.ndarray) -> Conditionals:
    """What components with means (K, d) and covariances (K, d, d) say of the dimensions out (o,), given those of into (i,)."""
    i, order = len(into), np.concatenate([into, out])
    means, covariances = means.take(order, axis=1)[..., None], covariances.take(order, axis=1).take(order, axis=2)
    whiteners, log_volumes = _whiteners(covariances[:, :i, :i])
    times = _times(i)
    half = times(whiteners, covariances[:, :i, i:])
    turned = half.swapaxes(1, 2)
    within = covariances[:, i:, i:] - times(turned, half)
    return Conditionals(means[:, :i], whiteners, log_volumes, means[:, i:], times(turned, whiteners), within)


def _whiteners(covariances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """L^-1 (K, i, i) and log det L (K,) of the covariances L L' of the inputs."""
    if covariances.shape[1] == 1 and min(covariances.ravel().tolist()) > 0:
        return 1.0 / np.sqrt(covariances), 0.5 * np.log(covariances[:, 0, 0])
    factors = cholesky(covariances, "covariance of the inputs of component")
    return np.linalg.inv(factors), np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(1)


def _times(n_inputs: int) -> np.ufunc:
    """Product of stacks of matrices over the inputs: with one input it is one of numbers, which is quicker."""
    return np.multiply if n_inputs == 1 else np.matmul


def regress(mixture: GaussianMixture, inputs: ArrayLike, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """(3.3) to (3.5): mean (n, o) and covariance (n, o, o) of the output dimensions, given inputs (n, i).

    With one input dimension, inputs (n,) are n queries. For more than one call, prepare a `Regression`.

    * mixture: over inputs and outputs.
    * input_dims: indices (i,) of the dimensions of the mixture that are given, from 0, such as [0] for time.
    * output_dims: those (o,) that are asked for, in the order of the result.
    """
    return Regression(mixture, input_dims, output_dims)(inputs)


def regress_each(
    priors: np.ndarray, means: np.ndarray, covariances: np.ndarray, inputs: np.ndarray, input_dims: ArrayLike, output_dims: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """`regress` with a mixture of its own for each query: means (n, K, d), covariances (n, K, d, d), inputs (n, i); the priors (K,)
    are common to all.

    input_dims, output_dims: indices (i,) and (o,) of the dimensions that are given and asked for, from 0.
    """
    into, out = _split(means.shape[-1], input_dims, output_dims)
    whiteners = np.linalg.inv(cholesky(covariances[..., into[:, None], into], "covariance of the inputs of component"))
    log_volumes = np.log(np.diagonal(whiteners, axis1=-2, axis2=-1)).sum(-1)
    inputs = as_samples(inputs, "inputs", len(into))
    with np.errstate(over="ignore", invalid="ignore"):
        white = (whiteners @ (inputs[:, None] - means[..., into])[..., None])[..., 0]
        shares, log_density = normalise_log(np.log(priors) + log_volumes - 0.5 * np.square(white).sum(-1))
    require_near(log_density, inputs, "inputs")
    half = whiteners @ covariances[..., into[:, None], out]
    conditional = means[..., out] + (white[..., None, :] @ half)[..., 0, :]
    within = covariances[..., out[:, None], out] - np.swapaxes(half, -1, -2) @ half
    mean = np.einsum("nk,nko->no", shares, conditional)
    spread = (conditional - mean[:, None]) * np.sqrt(shares)[..., None]
    return mean, symmetric(np.einsum("nk,nkop->nop", shares, within) + np.swapaxes(spread, 1, 2) @ spread)


def _split(n_dims: int, input_dims: ArrayLike, output_dims: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    into = as_dims(input_dims, n_dims, "input_dims")
    out = as_dims(output_dims, n_dims, "output_dims")
    both = sorted(set(into.tolist()) & set(out.tolist()))
    if both:
        raise ValueError(f"dimensions {both} are both input and output; choose one")
    return into, out
