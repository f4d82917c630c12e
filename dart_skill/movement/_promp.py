"""Probabilistic movement primitives: A. Paraschos, C. Daniel, J. Peters and G. Neumann,
Probabilistic movement primitives, NeurIPS 2013.

Of each demonstration the weights w of normalised Gaussian basis functions psi(t) of the phase are
found by ridge regression, for each movement variable; a movement is y(t) = Psi(t)' w with w ~ N(mu,
S) over all weights. A via point y* with covariance S* is an observation of w:

    L = S Psi (S* + Psi' S Psi)^-1,    mu+ = mu + L (y* - Psi' mu),    S+ = S - L Psi' S.

Few demonstrations say little of S, which has as many rows as there are weights. With a prior it is
the mode under an inverse Wishart distribution whose own mode says that the variables are not
correlated with each other (S. Gomez-Gonzalez, G. Neumann, B. Schoelkopf and J. Peters, Adaptation and
robust learning of probabilistic movement primitives, IEEE T-RO 36, 2020).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_number, as_vector
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.mixture import symmetric
from dart_skill.movement._on_steps import on_steps
from dart_skill.movement._via_points import TimedViaPoints, arrays_of

N_STEPS = 100
"""Steps at which the basis functions are fitted to a demonstration."""
RIDGE = 1e-8
"""Regularisation of the regression, relative to the mean square of the basis functions."""


class ProMP(TimedViaPoints, SavableModel):
    """Movement of d variables as a Gaussian over weights of basis functions.

    Fitted attributes: means_ (d, K), of the weights; covariance_ (d K, d K).

    Parameters
    ----------
    n_basis
        Int, default 15. K, the number of basis functions.
    covariance_prior
        Float, default 0. So many demonstrations say that the variables are not correlated.
    covariance_floor
        Float, default 1e-9. Least variance of a weight, relative to the mean variance of the
        samples: what keeps two via points apart where two demonstrations show one direction.
    """

    def __init__(
        self, n_basis: int = 15, *, covariance_prior: float = 0.0, covariance_floor: float = 1e-9
    ) -> None:
        self.n_basis = as_count(n_basis, "n_basis", 2)
        self.covariance_prior = as_number(covariance_prior, "covariance_prior", strict=False)
        self.covariance_floor = as_number(covariance_floor, "covariance_floor")

    def fit(self, samples: Sequence[ArrayLike], weights: ArrayLike | None = None) -> ProMP:
        """Learn from demonstrations.

        Parameters
        ----------
        samples
            [t, y] (n_i, 1 + d) of each. Its stamps are stretched to the mean first and last ones.
        weights
            For each demonstration one number: how much it counts. Default None: all alike.

        Returns
        -------
        ProMP
            Self.

        Raises
        ------
        ValueError
            For what cannot be learned from.
        """
        time, rows, shares = on_steps(samples, weights, max(N_STEPS, 2 * self.n_basis))
        basis = _basis(np.linspace(0.0, 1.0, len(time)), self.n_basis)
        square = basis.T @ basis
        ridge = RIDGE * np.trace(square) / self.n_basis * np.eye(self.n_basis)
        # (N, d, K)
        found = np.swapaxes(np.linalg.solve(square + ridge, basis.T @ rows), 1, 2)
        mean = np.tensordot(shares, found, axes=1)
        off = ((found - mean) * np.sqrt(shares)[:, None, None]).reshape(len(rows), -1)
        variance = float(np.var(rows.reshape(-1, rows.shape[2]), axis=0).mean())
        self._set(time[[0, -1]], mean, self._believed(off.T @ off, len(rows), variance))
        self.n_demonstrations_ = len(rows)
        return self

    def _believed(self, covariance: np.ndarray, n: int, variance: float) -> np.ndarray:
        """Covariance (d K, d K) with what the prior says, and the floor."""
        d = len(covariance) // self.n_basis
        apart = covariance * np.kron(np.eye(d), np.ones((self.n_basis, self.n_basis)))
        strength = self.covariance_prior
        floor = max(self.covariance_floor * variance, np.finfo(float).tiny ** 0.5)
        mixed = (n * covariance + strength * apart) / (n + strength)
        return mixed + floor * np.eye(len(covariance))

    def _set(self, ends: np.ndarray, means: np.ndarray, covariance: np.ndarray) -> None:
        self._ends, self.means_, self.covariance_, self._vias = ends, means, covariance, ()

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        self._require_no_vias()
        return {"ends": self._ends, "means": self.means_, "covariance": self.covariance_}

    def _from_arrays(self, arrays: Arrays) -> None:
        means = array_of(arrays, "means", (None, self.n_basis))
        covariance = array_of(arrays, "covariance", (means.size, means.size))
        self._set(array_of(arrays, "ends", (2,)), means, covariance)

    def _fitted_to(self) -> str:
        if not hasattr(self, "means_"):
            return ""
        return f"{self._shown()}{len(self.means_)} movement variables"

    @property
    def _first_and_last(self) -> tuple[float, float]:
        self._require_fitted()
        return float(self._ends[0]), float(self._ends[1])

    @property
    def _n_outputs(self) -> int:
        self._require_fitted()
        return len(self.means_)

    def _maps(self, time: np.ndarray) -> np.ndarray:
        """Psi' (k, d, d K) at instants (k,) [s]."""
        first, last = self._ends
        basis = _basis((time - first) / (last - first), self.n_basis)
        return np.einsum("de,tk->tdek", np.eye(len(self.means_)), basis).reshape(
            len(time), len(self.means_), -1
        )

    def weights(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (d K,) and covariance (d K, d K) of the weights, given the via points."""
        self._require_fitted()
        mean, covariance = self.means_.reshape(-1), self.covariance_
        if not self._vias:
            return mean, covariance
        at, wanted, noise = arrays_of(self._vias)
        maps = self._maps(at)
        d, seen = maps.shape[1], maps.reshape(-1, len(mean))
        inside = seen @ covariance @ seen.T
        for k, one in enumerate(noise):
            inside[k * d : (k + 1) * d, k * d : (k + 1) * d] += one
        gain = np.linalg.solve(symmetric(inside), seen @ covariance)
        off = wanted.reshape(-1) - seen @ mean
        return mean + off @ gain, symmetric(covariance - gain.T @ (seen @ covariance))

    def retrieve(self, time: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Mean (k, d) and covariance (k, d, d) at instants (k,) [s], given the via points. Before
        the first and after the last instant that were shown they stay.
        """
        mean, covariance = self.weights()
        maps = self._maps(np.clip(as_vector(time, "time"), *self._ends))
        return maps @ mean, maps @ covariance @ np.swapaxes(maps, 1, 2)


def _basis(phase: np.ndarray, n: int) -> np.ndarray:
    """n normalised Gaussians (k, n) of the phase (k,), whose standard deviation is the distance of
    their centres.
    """
    centres = np.linspace(0.0, 1.0, n)
    heights = np.exp(-0.5 * np.square((phase[:, None] - centres) * (n - 1)))
    return heights / heights.sum(axis=1, keepdims=True)
