"""Size of the exploration: the noise of section 5.2.1 that is added to the covariance (5.2), and
an automatic size.

Everything here is in units of the spread at the start of the search, so "1" is that spread in each
parameter.
"""

from __future__ import annotations

import numpy as np

EXPLORATIONS = ("automatic", "constant", "proportional", "fixed")


def with_constant_noise(variances: np.ndarray, minimum: float) -> np.ndarray:
    """Figure 5.2, Sigma_0 = minimum^2 I: the same for all eigenvalues (d,). variances: the
    eigenvalues.
    """
    return variances + minimum**2


def with_proportional_noise(variances: np.ndarray, minimum: float) -> np.ndarray:
    """Figure 5.3: the same total noise as with Sigma_0, distributed in proportion to the
    eigenvalues (d,); the shape is kept.

    variances: the eigenvalues; minimum: standard deviation of Sigma_0.
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

        moved (n,): the step multiplied by the root of the shape. effective: effective number of
        trials, 1 / sum of the squared weights. known (n,): mask of the parameters about which the
        returns say something.
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

        effective: number of trials that count.
        """
        n = self.path.size
        faster = (n + 2) / 3 if self.diagonal else 1.0
        along_path = faster * 2 / ((n + 1.3) ** 2 + effective)
        of_trials = faster * 2 * (effective - 2 + 1 / effective) / ((n + 2) ** 2 + effective)
        return along_path, min(of_trials, 1 - along_path)


def _followed(path: np.ndarray, step: np.ndarray, rate: float) -> np.ndarray:
    return (1 - rate) * path + np.sqrt(rate * (2 - rate)) * step
