"""The policy of PoWER, a Gaussian over parameters (d,), its update from weighted trials (5.1),
(5.2), and the size of its exploration: the noise of section 5.2.1 that is added to the covariance,
or an automatic size.

Inside, a parameter is measured from the start of the search, in units of the spread at the start.
So the units of the parameters make no difference.
"""

from __future__ import annotations

import numpy as np

from dart_skill.policy_search._search import SearchSettings


def with_constant_noise(variances: np.ndarray, minimum: float) -> np.ndarray:
    """Figure 5.2, Sigma_0 = minimum^2 I: the same for all eigenvalues (d,).

    Parameters
    ----------
    variances
        The eigenvalues.
    """
    return variances + minimum**2


def with_proportional_noise(variances: np.ndarray, minimum: float) -> np.ndarray:
    """Figure 5.3: the same total noise as with Sigma_0, distributed in proportion to the
    eigenvalues (d,); the shape is kept.

    Parameters
    ----------
    variances
        The eigenvalues.
    minimum
        Standard deviation of Sigma_0.
    """
    total = variances.sum()
    share = variances / total if total > 0 else np.full(variances.shape, 1 / variances.size)
    return variances + variances.size * minimum**2 * share


NOISE = {"constant": with_constant_noise, "proportional": with_proportional_noise}


class PathLength:
    """Size and shape of exploration from the path of recent updates (n,), each in units of the
    standard deviations.

    If updates point in the same direction, the path is longer than by chance, and the size grows.
    If they cancel, the path is shorter, and the size shrinks. The shape is also stretched along
    the path. This is the rule of CMA-ES, with the constants of N. Hansen, The CMA evolution
    strategy: a tutorial, 2016 (arXiv:1604.00772). For `diagonal` covariances the rates are higher
    (R. Ros and N. Hansen, A simple modification in CMA-ES, PPSN X, 2008). PoWER can use this rule
    because (5.1) is the same weighted average (F. Stulp and O. Sigaud, Path integral policy
    improvement with covariance matrix adaptation, ICML 2012).
    """

    def __init__(self, n: int, diagonal: bool):
        self.path: np.ndarray = np.zeros(n)
        self.shape_path: np.ndarray = np.zeros(n)
        self.diagonal = diagonal

    def advance(
        self, step: np.ndarray, moved: np.ndarray, effective: float, known: np.ndarray
    ) -> float:
        """Factor for the size after a step (n,), which is N(0, I) distributed if all trials are
        equally good.

        Parameters
        ----------
        moved : (n,)
            The step multiplied by the root of the shape.
        effective
            Effective number of trials, 1 / sum of the squared weights.
        known : (n,)
            Mask of the parameters about which the returns say something.
        """
        n = int(known.sum())
        rate = (effective + 2) / (n + effective + 5)
        shape_rate = (4 + effective / n) / (n + 4 + 2 * effective / n)
        self.path[known] = _followed(self.path, step, rate)[known]
        self.shape_path[known] = _followed(self.shape_path, moved, shape_rate)[known]
        expected = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
        damping = 1 + 2 * max(0.0, np.sqrt((effective - 1) / (n + 1)) - 1) + rate
        return float(np.exp(rate / damping * (np.linalg.norm(self.path[known]) / expected - 1)))

    def shape_rates(self, effective: float) -> tuple[float, float]:
        """Learning rates of the shape: for the path, and for the weighted covariance of the trials
        (5.2).

        Parameters
        ----------
        effective
            Number of trials that count.
        """
        n = self.path.size
        faster = (n + 2) / 3 if self.diagonal else 1.0
        along_path = faster * 2 / ((n + 1.3) ** 2 + effective)
        of_trials = faster * 2 * (effective - 2 + 1 / effective) / ((n + 2) ** 2 + effective)
        return along_path, min(of_trials, 1 - along_path)


def _followed(path: np.ndarray, step: np.ndarray, rate: float) -> np.ndarray:
    return (1 - rate) * path + np.sqrt(rate * (2 - rate)) * step


class GaussianPolicy:
    """The Gaussian N(start + scale * mean, size^2 scale shape scale).

    start, scale and mean are (d,), size is a number, shape is (d, d). The shape is stored as
    variances (d,) along axes (d, d). With `diagonal` the axes are those of the parameters.
    """

    def __init__(
        self, start: np.ndarray, scale: np.ndarray, settings: SearchSettings, diagonal: bool
    ):
        d = start.size
        self.start, self.scale, self._settings = start, scale, settings
        self.mean: np.ndarray = np.zeros(d)
        self.variances: np.ndarray = np.ones(d)
        self.axes: np.ndarray = np.eye(d)
        self.size = 1.0
        self.path = PathLength(d, diagonal)

    @property
    def parameters(self) -> np.ndarray:
        return self.start + self.scale * self.mean

    @property
    def covariance(self) -> np.ndarray:
        root = self.scale[:, None] * self.axes * np.sqrt(self.variances) * self.size
        return root @ root.T

    @property
    def longest(self) -> float:
        """Standard deviation along the longest axis, in units of the spread at the start."""
        return self.size * float(np.sqrt(self.variances.max()))

    def begin(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Go on from another Gaussian with an empty path: mean (d,) and covariance (d, d), in
        spreads from the start.
        """
        variances, axes = np.linalg.eigh(covariance)
        low, high = self._settings.limits
        variances = np.clip(variances, low**2, high**2)
        self.mean, self.size = mean, float(np.sqrt(variances.max()))
        self.path = PathLength(mean.size, self.path.diagonal)
        self._set_shape(variances / self.size**2, axes)

    def draw(self, noise: np.ndarray) -> np.ndarray:
        """Parameters (n, d) from standard normal noise (n, d)."""
        return self.start + self.scale * (self.mean + self.size * self._coloured(noise))

    def update(self, noise: np.ndarray, tried: np.ndarray, weights: np.ndarray) -> None:
        """Update from n trials: the noise (n, d) they were drawn from, the parameters tried (n,
        d), and weights (n, d).

        For each parameter the weights sum to one, or are all zero if the returns say nothing about
        it.
        """
        relative = (tried - self.start) / self.scale - self.mean
        if self._settings.exploration == "automatic":
            self._adapt(noise, weights)
        elif self._settings.exploration != "fixed":
            self.set_covariance(
                self._weighted_covariance(relative, weights), np.any(weights, axis=0)
            )
        self.mean = self.mean + (weights * relative).sum(axis=0)  # (5.1), (7.17)

    def set_covariance(self, covariance: np.ndarray, known: np.ndarray) -> None:
        """(5.2) with the noise of 5.2.1 added to the eigenvalues.

        Parameters
        ----------
        covariance
            (d, d), or its diagonal (d,).
        known
            Mask (d,) of the parameters that change.
        """
        variances, axes = self._decomposed(covariance)
        variances = NOISE[self._settings.exploration](
            variances, self._settings.minimum_exploration
        )
        self._set_shape(np.where(known, variances, self.variances), axes)

    def _adapt(self, noise: np.ndarray, weights: np.ndarray) -> None:
        """Size and shape from the noise of the trials; this is right for trials drawn before the
        last update, too.
        """
        length = np.linalg.norm(weights, axis=0)
        known = length > 0
        step = (weights * noise).sum(axis=0) / np.where(known, length, 1.0)
        effective = float((1 / length[known] ** 2).mean())
        factor = self.path.advance(step, self._coloured(step), effective, known)
        along_path, of_trials = self.path.shape_rates(effective)
        shape = (
            1 - along_path - of_trials
        ) * self.shape() + of_trials * self._weighted_covariance(self._coloured(noise), weights)
        variances, axes = self._decomposed(shape + along_path * self._outer(self.path.shape_path))
        self.size = float(np.clip(self.size * factor, *self._settings.limits))
        self._set_shape(np.where(known, variances, self.variances), axes)

    def _set_shape(self, variances: np.ndarray, axes: np.ndarray) -> None:
        low, high = (limit / self.size for limit in self._settings.limits)
        self.variances, self.axes = np.clip(variances, low**2, high**2), axes

    def _coloured(self, noise: np.ndarray) -> np.ndarray:
        """Noise (..., d) multiplied by the symmetric square root of the shape."""
        if self.path.diagonal:
            return noise * np.sqrt(self.variances)
        return noise @ (self.axes * np.sqrt(self.variances)) @ self.axes.T

    def shape(self) -> np.ndarray:
        """Covariance (d, d), or its diagonal (d,), for size 1, in units of the spread at the start."""
        return self.variances if self.path.diagonal else (self.axes * self.variances) @ self.axes.T

    def _outer(self, vector: np.ndarray) -> np.ndarray:
        return vector**2 if self.path.diagonal else np.outer(vector, vector)

    def _weighted_covariance(self, deviations: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """(5.2) without Sigma_0: (d, d), or its diagonal (d,)."""
        if self.path.diagonal:
            return (weights * deviations**2).sum(axis=0)
        weighted = np.sqrt(weights) * deviations
        return weighted.T @ weighted

    def _decomposed(self, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Variances (d,) along axes (d, d)."""
        return (covariance, self.axes) if self.path.diagonal else np.linalg.eigh(covariance)

    def state(self) -> dict:
        names = ("start", "scale", "mean", "variances", "axes", "size")
        paths = {"path": self.path.path, "shape_path": self.path.shape_path}
        return {name: getattr(self, name) for name in names} | paths

    def restore(self, state: dict) -> None:
        for name in ("mean", "variances", "axes"):
            setattr(self, name, np.array(state[name], dtype=float))
        self.size = float(state["size"])
        for name in ("path", "shape_path"):
            setattr(self.path, name, np.array(state[name], dtype=float))
