"""Kernelised movement primitives: Y. Huang, L. Rozo, J. Silverio and D. G. Caldwell, Kernelized
movement primitives, International Journal of Robotics Research 38, 2019.

A mixture over time and position gives a reference N(m_n, S_n) at N instants, by regression. With the
kernel k(t, t') = a exp(-(t - t')^2 / (2 l^2)) and k = [k(t, t_1) I, ..., k(t, t_N) I], K of the same
for all pairs, and S = blockdiag(S_1, ..., S_N), the movement at any instant is

    mean = k (K + lambda S)^-1 m,    covariance = k(t, t) I - k (K + lambda S)^-1 k'.

A via point is one more reference, which takes the place of those that are near. The units of the
movement make no difference here: m is counted from the mean position, and a is the mean variance of
the samples. So this is a Gaussian process whose observations have the noise lambda S, and the
covariance is of that; theirs has the factor N / lambda.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_vector
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.mixture import symmetric
from dart_skill.movement._frames import TaskFrame
from dart_skill.movement._on_steps import on_steps
from dart_skill.movement._task_parameterised import TaskParameterisedMixture
from dart_skill.movement._via_points import TimedViaPoints, arrays_of

NEAR = 0.5
"""A via point takes the place of references nearer than this, in parts of their distance."""


class KMP(TimedViaPoints, SavableModel):
    """Movement of d variables by a kernel over time.

    Fitted attributes: time_ (n,) [s], means_ (n, d), covariances_ (n, d, d), the reference.

    Parameters
    ----------
    n_components
        Int, default 8, of the mixture that makes the reference.
    n_references
        Int, default 100. N.
    regularisation
        Float, default 1. Lambda: how much the covariances of the reference count.
    length
        Float [s], default None: 0.144 of the movement, 24 in the place of 1 / (2 l^2) on a phase from
        0 to 1. l of the kernel, over which a via point draws the path.
    """

    def __init__(
        self,
        n_components: int = 8,
        *,
        n_references: int = 100,
        regularisation: float = 1.0,
        length: float | None = None,
    ) -> None:
        self.n_components = as_count(n_components, "n_components")
        self.n_references = as_count(n_references, "n_references", 2)
        self.regularisation = as_number(regularisation, "regularisation")
        self.length = None if length is None else as_number(length, "length")

    def fit(self, samples: Sequence[ArrayLike], weights: ArrayLike | None = None) -> KMP:
        """Learn from demonstrations.

        Parameters
        ----------
        samples
            [t, y] (n_i, 1 + d) of each. Its stamps are stretched to the mean first and last ones.
        weights
            For each demonstration one number: how much it counts. Default None: all alike.

        Returns
        -------
        KMP
            Self.

        Raises
        ------
        ValueError
            For what cannot be learned from.
        """
        time, rows, shares = on_steps(samples, weights, self.n_references)
        d = rows.shape[2]
        features = [np.column_stack([time, one]) for one in rows]
        world = [TaskFrame(np.eye(1 + d), np.zeros(1 + d))]
        mixture = TaskParameterisedMixture(self.n_components).fit(
            features, [world] * len(rows), shares
        )
        mean, covariance = mixture.regress(world, time[:, None], [0], np.arange(1, 1 + d))
        assert covariance is not None  # it was asked for
        self._set(time, mean, covariance, rows.reshape(-1, d).var(axis=0).mean())
        self.n_demonstrations_ = len(rows)
        return self

    def _set(
        self, time: np.ndarray, means: np.ndarray, covariances: np.ndarray, height: np.ndarray
    ) -> None:
        self.time_, self.means_, self.covariances_, self._vias = time, means, covariances, ()
        self._height = float(height)

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        self._require_no_vias()
        return {
            "time": self.time_,
            "means": self.means_,
            "covariances": self.covariances_,
            "height": np.array(self._height),
        }

    def _from_arrays(self, arrays: Arrays) -> None:
        time = array_of(arrays, "time", (None,))
        means = array_of(arrays, "means", (len(time), None))
        covariances = array_of(arrays, "covariances", (*means.shape, means.shape[1]))
        self._set(time, means, covariances, array_of(arrays, "height", ()))

    def _fitted_to(self) -> str:
        if not hasattr(self, "means_"):
            return ""
        n, d = self.means_.shape
        return f"{self._shown()}{d} movement variables, {n} references"

    @property
    def _n_outputs(self) -> int:
        self._require_fitted()
        return self.means_.shape[1]

    def _references(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Instants (N,), means (N, d) and covariances (N, d, d) with the via points."""
        if not self._vias:
            return self.time_, self.means_, self.covariances_
        at, wanted, noise = arrays_of(self._vias)
        near = NEAR * (self.time_[1] - self.time_[0])
        kept = (np.abs(self.time_[:, None] - at) > near).all(axis=1)
        return (
            np.concatenate([self.time_[kept], at]),
            np.concatenate([self.means_[kept], wanted]),
            np.concatenate([self.covariances_[kept], noise]),
        )

    def _kernel(self, time: np.ndarray, others: np.ndarray) -> np.ndarray:
        """K (n, m) of instants (n,) and (m,) [s]."""
        length = self.length or np.sqrt(0.5 / 24.0) * (self.time_[-1] - self.time_[0])
        return self._height * np.exp(-0.5 * np.square((time[:, None] - others) / length))

    def retrieve(self, time: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Mean (k, d) and covariance (k, d, d) at instants (k,) [s], given the via points. Before
        the first and after the last instant that were shown they stay.

        Raises
        ------
        ValueError
            Where two via points say two things of one instant.
        """
        first, last = self._first_and_last
        asked = np.clip(as_vector(time, "time"), first, last)
        at, means, covariances = self._references()
        n, d = means.shape
        middle = self.means_.mean(axis=0)
        weighted = np.zeros((n, d, n, d))
        weighted[np.arange(n), :, np.arange(n)] = self.regularisation * covariances
        matrix = _blocks(self._kernel(at, at), d) + weighted.reshape(n * d, n * d)
        across = _blocks(self._kernel(asked, at), d)
        try:
            gain = np.linalg.solve(symmetric(matrix), across.T).T
        except np.linalg.LinAlgError:
            raise ValueError(
                "two via points are at the same instant: leave one out, or give them covariances"
            ) from None
        mean = middle + (gain @ (means - middle).reshape(-1)).reshape(-1, d)
        told = np.einsum("tia,tja->tij", gain.reshape(-1, d, n * d), across.reshape(-1, d, n * d))
        return mean, self._height * np.eye(d) - symmetric(told)


def _blocks(kernel: np.ndarray, d: int) -> np.ndarray:
    """K (n d, m d) of blocks k I from k (n, m)."""
    n, m = kernel.shape
    return np.einsum("nm,ij->nimj", kernel, np.eye(d)).reshape(n * d, m * d)
