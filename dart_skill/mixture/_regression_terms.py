"""What Gaussian mixture regression does for each component, and for each query and component:
(3.3) to (3.5).

Covariances of the outputs are sums over terms that depend on the query, times matrices that do
not. The terms of all queries are written here, and the sums are one product of matrices, which
stays with NumPy, as the exponentials do. This module is compiled (docs/development.md):
_regression_terms.pxd beside it has the types.
"""

import math

import numpy as np

from dart_skill.common.small_matrices import factor_into, invert_into


def write_conditionals(
    means: np.ndarray,
    covariances: np.ndarray,
    into: np.ndarray,
    out: np.ndarray,
    whiteners: np.ndarray,
    log_volumes: np.ndarray,
    lines: np.ndarray,
    within: np.ndarray,
) -> None:
    """Write what each component says of the outputs, given the inputs.

    Parameters
    ----------
    means, covariances
        (K, d) and (K, d, d), positive definite.
    into, out
        Dimensions of the inputs (i,) and of the outputs (o,).
    whiteners
        (K, i, i), L^-1 of the covariances L L' of the inputs; is written, as all that follow.
    log_volumes
        (K,), log det L.
    lines
        (K, 1 + i, o), means of the outputs at the means of the inputs, then their slopes over each
        input, S_ii^-1 S_io.
    within
        (K, o, o), covariance of the outputs about these lines, S_oo - S_oi S_ii^-1 S_io.

    Raises
    ------
    ValueError
        If a covariance of the inputs is not positive definite.
    """
    n_inputs, n_outputs = into.shape[0], out.shape[0]
    lower, half = np.empty((n_inputs, n_inputs)), np.empty((n_inputs, n_outputs))
    for k in range(covariances.shape[0]):
        log_volumes[k] = _whiten_inputs(covariances[k], into, lower, whiteners[k])
        for a in range(n_outputs):
            lines[k, 0, a] = means[k, out[a]]
            for i in range(n_inputs):
                half[i, a] = lines[k, 1 + i, a] = 0.0
                for j in range(i + 1):
                    half[i, a] += whiteners[k, i, j] * covariances[k, into[j], out[a]]
                for j in range(i + 1):
                    lines[k, 1 + j, a] += half[i, a] * whiteners[k, i, j]
        for a in range(n_outputs):
            for b in range(n_outputs):
                within[k, a, b] = covariances[k, out[a], out[b]]
                for i in range(n_inputs):
                    within[k, a, b] -= half[i, a] * half[i, b]


def _whiten_inputs(
    covariance: np.ndarray, into: np.ndarray, lower: np.ndarray, whitener: np.ndarray
) -> float:
    """Write L and L^-1 of the covariance L L' of the inputs, (i, i) each, and return log det L."""
    for i in range(into.shape[0]):
        for j in range(i + 1):
            lower[i, j] = covariance[into[i], into[j]]
    factor_into(lower, lower)
    invert_into(lower, whitener)
    log_volume = 0.0
    for i in range(into.shape[0]):
        log_volume += math.log(lower[i, i])
    return log_volume


def write_logs(
    inputs: np.ndarray,
    input_means: np.ndarray,
    whiteners: np.ndarray,
    constants: np.ndarray,
    logs: np.ndarray,
    top: np.ndarray,
) -> None:
    """Write the logs of prior times density of queries, relative to the largest of each query.

    Parameters
    ----------
    inputs
        (n, i), the queries.
    input_means, whiteners
        (K, i) and (K, i, i), as of `Conditionals`.
    constants
        (K,), the logs at the means.
    logs
        (n, K), are written.
    top
        (n,), the largest logs, are written; not finite where a square overflows in all components,
        or is not a number in one.
    """
    n_inputs, lowest = inputs.shape[1], -math.inf
    for n in range(inputs.shape[0]):
        highest = lowest
        for k in range(constants.shape[0]):
            square = 0.0
            for i in range(n_inputs):
                white = 0.0
                for j in range(i + 1):
                    white += whiteners[k, i, j] * (inputs[n, j] - input_means[k, j])
                square += white * white
            value = constants[k] - 0.5 * square
            logs[n, k] = value
            if value > highest or value != value:
                highest = value
        top[n] = highest
        for k in range(constants.shape[0]):
            logs[n, k] -= highest


def normalise(shares: np.ndarray) -> None:
    """Divide shares (n, K) by the sum of each row, in place."""
    for n in range(shares.shape[0]):
        total = 0.0
        for k in range(shares.shape[1]):
            total += shares[n, k]
        scale = 1.0 / total
        for k in range(shares.shape[1]):
            shares[n, k] *= scale


def write_lines(
    inputs: np.ndarray, shares: np.ndarray, input_means: np.ndarray, terms: np.ndarray
) -> None:
    """Write the terms of the mean (3.4): for each component its share, and that times the inputs
    from their mean.

    Parameters
    ----------
    inputs, shares
        (n, i) and (n, K).
    input_means
        (K, i), of the components.
    terms
        (n, K (1 + i)), are written.
    """
    for n in range(shares.shape[0]):
        place = 0
        for k in range(shares.shape[1]):
            share = shares[n, k]
            terms[n, place] = share
            place += 1
            for i in range(inputs.shape[1]):
                terms[n, place] = share * (inputs[n, i] - input_means[k, i])
                place += 1


def write_spread(
    inputs: np.ndarray,
    shares: np.ndarray,
    input_means: np.ndarray,
    lines: np.ndarray,
    terms: np.ndarray,
) -> None:
    """Write the terms of the covariance (3.5) with any number of inputs: shares, and the spread
    between the components.

    Means of the outputs are told from that of the component with the largest share. Far away there
    is no other, and nothing is left: of means that are told from zero, rounding would be left.

    Parameters
    ----------
    inputs, shares, input_means
        As of `write_lines`.
    lines
        (K, 1 + i, o), outputs of each component at its inputs' mean, and their slopes.
    terms
        (n, K + q), are written; q = o (o + 1) / 2, the upper triangle by rows.
    """
    n_components, n_outputs = shares.shape[1], lines.shape[2]
    apart, mean, spread = (
        np.empty((n_components, n_outputs)),
        np.empty(n_outputs),
        np.empty(terms.shape[1] - n_components),
    )
    for n in range(shares.shape[0]):
        first = 0
        for k in range(1, n_components):
            if shares[n, k] > shares[n, first]:
                first = k
        for a in range(n_outputs):
            mean[a] = 0.0
        for place in range(spread.shape[0]):
            spread[place] = 0.0
        for k in range(n_components):
            for a in range(n_outputs):
                apart[k, a] = lines[k, 0, a] - lines[first, 0, a]
            for i in range(inputs.shape[1]):
                offset, its = (
                    inputs[n, i] - input_means[k, i],
                    inputs[n, i] - input_means[first, i],
                )
                for a in range(n_outputs):
                    apart[k, a] += lines[k, 1 + i, a] * offset - lines[first, 1 + i, a] * its
            for a in range(n_outputs):
                mean[a] += shares[n, k] * apart[k, a]
        for k in range(n_components):
            share, place = shares[n, k], 0
            for a in range(n_outputs):
                weighted = share * (apart[k, a] - mean[a])
                for b in range(a, n_outputs):
                    spread[place] += weighted * (apart[k, b] - mean[b])
                    place += 1
            terms[n, k] = share
        for place in range(spread.shape[0]):
            terms[n, n_components + place] = spread[place]
