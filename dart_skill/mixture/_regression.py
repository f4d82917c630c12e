"""Gaussian mixture regression: thesis (3.3) to (3.5), with the full covariance of the conditional
mixture.

The covariance is sum_k h_k (S_k + (m_k - m)(m_k - m)'). It includes the spread between the
components. It is computed from the deviations m_k - m, so that no digits are lost. The
responsibilities h_k are computed from log densities: far from the data they would otherwise be 0 /
0. There a query belongs to the component whose density falls most slowly. Queries are processed in
slices that fit into the cache.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_dims, as_finite, as_samples, require_near
from dart_skill.mixture._expectation_maximisation import normalise_log
from dart_skill.mixture._gaussian import LOG_2PI, cholesky, symmetric, upper_triangle
from dart_skill.mixture._mixture import GaussianMixture
from dart_skill.mixture._regression_terms import (
    normalise,
    write_conditionals,
    write_lines,
    write_logs,
    write_spread,
)

SLICE = 1024
"""Number of queries that are answered at a time."""


class Conditionals(NamedTuple):
    """What K components say of o outputs, given i inputs.

    Parameters
    ----------
    input_means : (K, i)
        L^-1 of the covariances L L' of the inputs.
    whiteners : (K, i, i)
        L^-1 of the covariances L L' of the inputs.
    log_volumes : (K,)
        Log det L.
    lines : (K, 1 + i, o)
        The outputs' mean at the inputs' mean, and its slopes.
    within : (K, o, o)
        Their covariance about it.
    """

    input_means: np.ndarray
    whiteners: np.ndarray
    log_volumes: np.ndarray
    lines: np.ndarray
    within: np.ndarray

    @classmethod
    def of(
        cls, means: np.ndarray, covariances: np.ndarray, into: np.ndarray, out: np.ndarray
    ) -> Conditionals:
        """Conditionals of components with means (K, d) and covariances (K, d, d): the dimensions
        out (o,), given those of into (i,).
        """
        k, i, o = len(means), len(into), len(out)
        parts = np.empty((k, i, i)), np.empty(k), np.empty((k, 1 + i, o)), np.empty((k, o, o))
        try:
            write_conditionals(means, covariances, into, out, *parts)
        except ValueError:
            # says which one, and how flat it is
            cholesky(covariances[:, into[:, None], into], "covariance of the inputs of component")
            raise
        return cls(means.take(into, axis=1), *parts)


class Regression:
    """Gaussian mixture regression of some dimensions on others, prepared for many calls: (3.3) to
    (3.5).

    A call `regression(inputs)` with inputs (n, i) returns mean (n, o) and covariance (n, o, o) of
    the outputs. With one input dimension, inputs (n,) are n queries.

    Parameters
    ----------
    mixture
        GaussianMixture, fitted or made from parameters.
    input_dims
        i distinct column indices of the mixture, in any order.
    output_dims
        o distinct column indices, none of them an input. Other columns may be left out of both.
    """

    def __init__(self, mixture: GaussianMixture, input_dims: ArrayLike, output_dims: ArrayLike):
        into, out = _split(mixture.n_dims, input_dims, output_dims)
        self._components = components = Conditionals.of(
            mixture.means_, mixture.covariances_, into, out
        )
        self.n_inputs, self.n_outputs = len(into), len(out)
        self._constants = (
            np.log(mixture.priors_) - components.log_volumes - 0.5 * self.n_inputs * LOG_2PI
        )
        # What makes the covariance of shares, and of the upper triangle of the spread between the
        # components.
        self._collector = np.concatenate(
            [components.within.reshape(len(components.within), -1), _unpacking(self.n_outputs)]
        )

    def __call__(self, inputs: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        inputs = self._checked(inputs)
        covariance = np.empty((len(inputs), self.n_outputs**2))
        mean = self._each_slice(inputs, covariance)
        return mean, covariance.reshape(-1, self.n_outputs, self.n_outputs)

    def mean(self, inputs: ArrayLike) -> np.ndarray:
        """Mean (n, o) of the outputs (3.4) without their covariance; equal to the mean of a call
        to the last bit.

        Parameters
        ----------
        inputs
            (n, i).
        """
        return self._each_slice(self._checked(inputs), None)

    def _each_slice(self, inputs: np.ndarray, covariance: np.ndarray | None) -> np.ndarray:
        """Mean (n, o) for inputs (n, i), and their covariances (n, o o), which are written."""
        components, mean = self._components, np.empty((len(inputs), self.n_outputs))
        lines = components.lines.reshape(-1, self.n_outputs)
        for start in range(0, len(inputs), SLICE):
            span = slice(start, start + SLICE)
            here, shares = inputs[span], self._shares(inputs[span], start)
            terms = np.empty((len(here), len(lines)))
            write_lines(here, shares, components.input_means, terms)
            np.matmul(terms, lines, out=mean[span])
            if covariance is not None:
                terms = np.empty((len(here), len(self._collector)))
                write_spread(here, shares, components.input_means, components.lines, terms)
                np.matmul(terms, self._collector, out=covariance[span])
        return mean

    def responsibilities(self, inputs: ArrayLike) -> np.ndarray:
        """h_k of (3.5): (n, K).

        Parameters
        ----------
        inputs
            (n, i).
        """
        return self._shares(self._checked(inputs))

    def log_density(self, inputs: ArrayLike) -> np.ndarray:
        """(n,) log density of the inputs alone: it is low for a query that is far from the
        demonstrations.
        """
        logs, top = self._logs(self._checked(inputs))
        return top + np.log(np.exp(logs, out=logs).sum(1))

    def _checked(self, inputs: ArrayLike) -> np.ndarray:
        given = inputs if isinstance(inputs, np.ndarray) else as_finite(inputs, "inputs")
        return as_samples(
            given[:, None] if given.ndim == 1 and self.n_inputs == 1 else given,
            "inputs",
            self.n_inputs,
        )

    def _logs(self, inputs: np.ndarray, first_row: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Logs (n, K) of prior times density of the inputs (n, i), relative to the largest of each
        input, and the largest logs (n,).
        """
        components, logs, top = (
            self._components,
            np.empty((len(inputs), len(self._constants))),
            np.empty(len(inputs)),
        )
        write_logs(
            inputs, components.input_means, components.whiteners, self._constants, logs, top
        )
        if not top[top.argmin()] > -np.inf:  # nor if it is not a number
            require_near(top, inputs, "inputs", first_row)
        return logs, top

    def _shares(self, inputs: np.ndarray, first_row: int = 0) -> np.ndarray:
        """Responsibilities (n, K) of inputs (n, i)."""
        shares, _ = self._logs(inputs, first_row)
        normalise(np.exp(shares, out=shares))
        return shares


@lru_cache(maxsize=64)
def _unpacking(n_dims: int) -> np.ndarray:
    """Zeros and ones (q, d d) that make a symmetric matrix of its upper triangle: a product with
    them is faster than copying.
    """
    return np.equal.outer(
        np.arange(n_dims * (n_dims + 1) // 2), upper_triangle(n_dims)[1].ravel()
    ).astype(float)


def regress(
    mixture: GaussianMixture, inputs: ArrayLike, input_dims: ArrayLike, output_dims: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """(3.3) to (3.5): mean (n, o) and covariance (n, o, o) of the output dimensions, given inputs
    (n, i).

    With one input dimension, inputs (n,) are n queries. For more than one call, prepare a
    `Regression`.

    Parameters
    ----------
    mixture
        Over inputs and outputs.
    input_dims
        Indices (i,) of the dimensions of the mixture that are given, from 0, such as [0] for time.
    output_dims
        Those (o,) that are asked for, in the order of the result.
    """
    return Regression(mixture, input_dims, output_dims)(inputs)


def regress_each(
    priors: np.ndarray,
    means: np.ndarray,
    covariances: np.ndarray,
    inputs: np.ndarray,
    input_dims: ArrayLike,
    output_dims: ArrayLike,
) -> tuple[np.ndarray, np.ndarray]:
    """`regress` with a mixture of its own for each query: means (n, K, d), covariances (n, K, d,
    d), inputs (n, i); the priors (K,) are common to all.

    Parameters
    ----------
    input_dims, output_dims
        Indices (i,) and (o,) of the dimensions that are given and asked for, from 0.
    """
    into, out = _split(means.shape[-1], input_dims, output_dims)
    whiteners = np.linalg.inv(
        cholesky(covariances[..., into[:, None], into], "covariance of the inputs of component")
    )
    log_volumes = np.log(np.diagonal(whiteners, axis1=-2, axis2=-1)).sum(-1)
    inputs = as_samples(inputs, "inputs", len(into))
    with np.errstate(over="ignore", invalid="ignore"):
        white = (whiteners @ (inputs[:, None] - means[..., into])[..., None])[..., 0]
        shares, log_density = normalise_log(
            np.log(priors) + log_volumes - 0.5 * np.square(white).sum(-1)
        )
    require_near(log_density, inputs, "inputs")
    half = whiteners @ covariances[..., into[:, None], out]
    conditional = means[..., out] + (white[..., None, :] @ half)[..., 0, :]
    within = covariances[..., out[:, None], out] - np.swapaxes(half, -1, -2) @ half
    mean = np.einsum("nk,nko->no", shares, conditional)
    spread = (conditional - mean[:, None]) * np.sqrt(shares)[..., None]
    return mean, symmetric(
        np.einsum("nk,nkop->nop", shares, within) + np.swapaxes(spread, 1, 2) @ spread
    )


def _split(
    n_dims: int, input_dims: ArrayLike, output_dims: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    into = as_dims(input_dims, n_dims, "input_dims")
    out = as_dims(output_dims, n_dims, "output_dims")
    both = sorted(set(into.tolist()) & set(out.tolist()))
    if both:
        raise ValueError(f"dimensions {both} are both input and output; choose one")
    return into.astype(np.intp, copy=False), out.astype(np.intp, copy=False)
