"""The policy of the multi-optima search, a Gaussian mixture over parameters (d,), and its update
from trials (thesis (5.3)-(5.6)).

As in PoWER's policy, a parameter is measured from the start of the search, in units of the spread
at the start.
"""

from __future__ import annotations

import numpy as np

from dart_skill.mixture import GaussianMixture, symmetric
from dart_skill.policy_search._exploration import NOISE
from dart_skill.policy_search._search import Settings

DEAD_SHARE = 1e-6  # a component with less than this share of all weight is dropped
# least variance of a component relative to its largest one, so that its covariance can be inverted
FLATTEST = 1e-10


def alive(mass: np.ndarray) -> np.ndarray:
    """Which components (K,) are kept, by the weight (K,) that each of them has; none if there is
    no weight at all.
    """
    return mass > DEAD_SHARE * mass.sum()


class MixturePolicy:
    """Components with priors (K,), means (K, d) and covariances (K, d, d), stored as variances (K,
    d) along axes (K, d, d).
    """

    def __init__(self, start: np.ndarray, scale: np.ndarray, settings: Settings):
        d = start.size
        self.start, self.scale, self._settings = start, scale, settings
        self.priors, self.means = np.ones(1), np.zeros((1, d))
        self.variances, self.axes = np.ones((1, d)), np.eye(d)[None]
        self.returns: np.ndarray = np.zeros(1)

    @property
    def covariances(self) -> np.ndarray:
        return symmetric((self.axes * self.variances[:, None]) @ np.swapaxes(self.axes, 1, 2))

    @property
    def components(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Priors, means and covariances, relative to the start of the search."""
        return self.priors, self.means, self.covariances

    @property
    def mixture(self) -> GaussianMixture:
        """The policy in the units of the parameters."""
        means, covariances = (
            self.start + self.scale * self.means,
            self.covariances * np.outer(self.scale, self.scale),
        )
        return GaussianMixture.from_parameters(self.priors, means, covariances)

    def draw(self, component: int, noise: np.ndarray) -> np.ndarray:
        """Parameters (d,) of a trial of one component, from standard normal noise (d,)."""
        coloured = self.axes[component] @ (np.sqrt(self.variances[component]) * noise)
        return self.start + self.scale * (self.means[component] + coloured)

    def relative(self, tried: np.ndarray) -> np.ndarray:
        return (tried - self.start) / self.scale

    def responsibilities(self, points: np.ndarray) -> np.ndarray:
        """(5.6): (K, n) for points (n, d) relative to the start."""
        white = (points - self.means[:, None]) @ (self.axes / np.sqrt(self.variances)[:, None])
        logs = np.log(self.priors) - 0.5 * np.log(self.variances).sum(axis=1)
        logs = logs[:, None] - 0.5 * np.einsum("kni,kni->kn", white, white)
        shares = np.exp(logs - logs.max(axis=0))
        return shares / shares.sum(axis=0)

    def update(self, points: np.ndarray, weights: np.ndarray) -> bool:
        """(5.3)-(5.5) from points (n, d), relative to the start, and weights (K, n); returns
        whether there was any weight.

        The weights are returns times responsibilities, of the M best. A component without weight
        is dropped.
        """
        mass = weights.sum(axis=1)
        kept = alive(mass)
        if not kept.any():
            return False
        weights, mass = weights[kept], mass[kept]
        shares = weights / mass[:, None]
        deviations = points - self.means[kept, None]
        covariances = np.swapaxes(deviations * shares[..., None], 1, 2) @ deviations
        self.priors, self.means = (
            mass / mass.sum(),
            self.means[kept] + (shares[:, None] @ deviations)[:, 0],
        )
        self._set_shapes(covariances, noisy=True)
        return True

    def replace(
        self,
        priors: np.ndarray,
        means: np.ndarray,
        covariances: np.ndarray,
        noisy: bool,
        origins: list[int | None],
    ) -> None:
        """Set other components; noisy: with exploration noise added to their covariances. The
        limits hold in any case.

        origins (K,): which component each of them was before, None for a new one; here it makes no
        difference.
        """
        self.priors, self.means = priors / priors.sum(), means
        self._set_shapes(covariances, noisy)

    def _set_shapes(self, covariances: np.ndarray, noisy: bool) -> None:
        variances, self.axes = np.linalg.eigh(covariances)
        variances = np.maximum(variances, 0.0)
        if noisy:
            noise = NOISE[self._settings.exploration]
            variances = np.array(
                [noise(one, self._settings.minimum_exploration) for one in variances]
            )
        low, high = self._settings.limits
        variances = np.clip(variances, low**2, high**2)
        self.variances = np.maximum(variances, FLATTEST * variances.max(axis=1, keepdims=True))

    def judge(self, points: np.ndarray, returns: np.ndarray) -> None:
        """Set the mean return of each component from the returns (n,) of points (n, d), weighted
        by its responsibilities.
        """
        shares = self.responsibilities(points)
        total = shares.sum(axis=1)
        self.returns = np.where(
            total > 0, shares @ returns / np.where(total > 0, total, 1.0), returns.min()
        )

    def state(self) -> dict:
        return {
            name: getattr(self, name).tolist()
            for name in ("start", "scale", "priors", "means", "variances", "axes", "returns")
        }

    def restore(self, state: dict) -> None:
        for name in ("priors", "means", "variances", "axes", "returns"):
            setattr(self, name, np.array(state[name], dtype=float))
