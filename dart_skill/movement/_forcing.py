"""The learned part of a movement primitive: normalised kernels over the phase, (7.11), and the
regression that finds their weights, (7.12) and (7.13).

Progress s is time in units of the duration (or period): s = 0 at the start, 1 at the end. With it
the canonical system (7.6) has a closed form: z = exp(-decay s) solves z' = -tau decay z, and the
angle 2 pi s solves z' = tau omega.

The goal of a discrete primitive moves, too: `blend` is a smooth path from start to goal, and
`BlendAttractor` its attractor (7.20), which makes a spring-damper follow the path.
"""

import numpy as np

OVERLAP = 0.5
"""Value of a kernel at the centre of its neighbour."""
NEIGHBOUR_PENALTY = 1e-8
"""Regularisation of the joint regression, relative to the mean weight of a kernel, which draws the
weights of neighbours together where no sample separates them.
"""
SIZE_PENALTY = 1e-11
"""Regularisation in the same unit, which draws all weights to zero."""


class GaussianKernels:
    """Gaussians of z (7.11), centres equally spaced in time over s = 0..1."""

    def __init__(self, n_basis: int, decay: float):
        self.decay = decay
        self.centres = np.exp(-decay * np.linspace(0.0, 1.0, n_basis))
        spacing = -np.diff(self.centres)
        self.widths = np.append(spacing, spacing[-1]) / np.sqrt(-np.log(OVERLAP))
        self.tie, self.penalty = _ties(np.diff(np.eye(n_basis), axis=0))
        # -(z - c)^2 / h^2 in powers of z, so that all exponents are one matrix product.
        self._exponents = (
            np.stack([-np.square(self.centres), 2.0 * self.centres, -np.ones(n_basis)])
            / self.widths**2
        )

    def phase(self, progress: np.ndarray) -> np.ndarray:
        """z (7.6) at progress (n,)."""
        return np.exp(-self.decay * progress)

    def raw(self, progress: np.ndarray) -> np.ndarray:
        """Numerators (n, n_basis) of (7.11), up to a common factor per row."""
        phase = self.phase(progress)
        exponent = _rows(phase, phase * phase) @ self._exponents
        if progress.max(initial=0.0) > 1.0:
            # Beyond the last centre all kernels would underflow; relative to the last kernel they
            # do not.
            exponent += np.square(np.maximum(self.centres[-1] - phase, 0.0) / self.widths[-1])[
                :, None
            ]
        return np.exp(exponent, out=exponent)


class PeriodicKernels:
    """Kernels exp(2 (cos(z - c) - 1) / h^2) of the angle z, periodic (Ijspeert et al. 2013,
    equation 2.8).

    Near their centre they equal the Gaussians of (7.11).
    """

    def __init__(self, n_basis: int):
        self.centres = 2.0 * np.pi * np.arange(n_basis) / n_basis
        self.widths = np.full(n_basis, 2.0 * np.sin(np.pi / n_basis) / np.sqrt(-np.log(OVERLAP)))
        self.tie, self.penalty = _ties(np.eye(n_basis) - np.roll(np.eye(n_basis), 1, axis=0))
        # Coefficients of cos(z - c) - 1 with respect to 1, cos z and sin z.
        self._exponents = np.stack(
            [-np.ones(n_basis), np.cos(self.centres), np.sin(self.centres)]
        ) * (2.0 / self.widths**2)

    def phase(self, progress: np.ndarray) -> np.ndarray:
        """Angle z (7.6) at progress (n,), within one turn."""
        return 2.0 * np.pi * np.mod(progress, 1.0)

    def raw(self, progress: np.ndarray) -> np.ndarray:
        """Numerators (n, n_basis) of the kernels."""
        angle = self.phase(progress)
        exponent = _rows(np.cos(angle), np.sin(angle)) @ self._exponents
        return np.exp(exponent, out=exponent)


Kernels = GaussianKernels | PeriodicKernels


def _ties(neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matrix of the squares of differences (m, n_basis), and the penalties of the joint
    regression, both (n_basis, n_basis).
    """
    tie = neighbours.T @ neighbours
    return tie, NEIGHBOUR_PENALTY * tie + SIZE_PENALTY * np.eye(len(tie))


def _rows(second: np.ndarray, third: np.ndarray) -> np.ndarray:
    """Columns 1, second and third as one array (n, 3); np.stack would be too slow for online
    steps.
    """
    columns = np.empty((3, len(second)))
    columns[0], columns[1], columns[2] = 1.0, second, third
    return columns.T


def normalised(raw: np.ndarray) -> np.ndarray:
    """Rows (n, n_basis) scaled in place to sum to one: the denominator of (7.11)."""
    raw /= (raw @ np.ones(raw.shape[1]))[:, None]
    return raw


def transformation(raw: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """f (n, d) of (7.10) from numerators (n, n_basis) and weights (n_basis, d)."""
    return (raw @ weights) / raw.sum(axis=1, keepdims=True)


def regress_locally(
    psi: np.ndarray, gate: np.ndarray, target: np.ndarray, weights: np.ndarray, kernels: Kernels
) -> np.ndarray:
    """(7.13): each kernel by itself fits gate * theta to the targets (n, d).

    The samples are weighted by psi and by their own weights (n,). The weight of a kernel that no
    sample reaches is interpolated between its neighbours.
    """
    weighted = psi * (weights * gate)[:, None]
    evidence = gate @ weighted
    reached = evidence > 1e-12 * evidence.max()
    theta = np.zeros((psi.shape[1], target.shape[1]))
    theta[reached] = (weighted.T @ target)[reached] / evidence[reached, None]
    if not reached.all():
        tie = kernels.tie
        theta[~reached] = np.linalg.lstsq(
            tie[~reached][:, ~reached], -tie[~reached][:, reached] @ theta[reached], rcond=None
        )[0]
    return theta


def regress_jointly(
    psi: np.ndarray, gate: np.ndarray, target: np.ndarray, weights: np.ndarray, kernels: Kernels
) -> np.ndarray:
    """All kernels together fit (7.10) to the targets (n, d), by weighted least squares.

    (7.13) fits each kernel as if it were alone, although neighbours overlap and add up. That is
    the first Jacobi step towards this solution (the normal matrix is replaced by its row sums). It
    smooths the movement by a kernel's width. psi is overwritten: a second array of its size would
    take longer to get from the system than to compute.
    """
    share = np.sqrt(weights)
    features = np.multiply(psi, (share * gate)[:, None], out=psi)
    normal = features.T @ features
    normal += normal.sum() / len(normal) * kernels.penalty
    return np.linalg.solve(normal, features.T @ (share[:, None] * target))


REGRESSIONS = {"joint": regress_jointly, "local": regress_locally}


# The blend is s^5 times this polynomial, lowest power first: its first four derivatives are zero
# at s = 0 and s = 1.
BLEND = [126.0, -420.0, 540.0, -315.0, 70.0]


def blend(progress: np.ndarray) -> np.ndarray:
    """Path (n,) from 0 at s <= 0 to 1 at s >= 1, four times differentiable.

    So an integration of fourth order keeps its order, wherever its steps are.
    """
    return _polynomial(np.clip(progress, 0.0, 1.0), 5, BLEND)


class BlendAttractor:
    """(7.20) for the blend: the attractor that makes a spring-damper move along it.

    Parameters
    ----------
    stiffness
        Of the spring-damper [1/s^2].
    damping
        Of the spring-damper [1/s].
    """

    def __init__(self, stiffness: float, damping: float):
        path, powers = np.concatenate([np.zeros(5), BLEND]), np.arange(1.0, 10.0)
        velocity = powers * path[1:]
        path[:-1] += velocity * (damping / stiffness)
        path[:-2] += powers[:-1] * velocity[1:] / stiffness
        self._coefficients = path[3:].tolist()

    def __call__(self, progress: np.ndarray) -> np.ndarray:
        return _polynomial(np.clip(progress, 0.0, 1.0), 3, self._coefficients)


def _polynomial(s: np.ndarray, power: int, coefficients: list[float]) -> np.ndarray:
    """s^power (c_0 + c_1 s + ...) by Horner's rule."""
    value = coefficients[-1] * s
    for coefficient in coefficients[-2:0:-1]:
        value += coefficient
        value *= s
    return (value + coefficients[0]) * s**power
