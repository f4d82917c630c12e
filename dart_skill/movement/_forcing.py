"""The learned part of a movement primitive: normalised kernels over the phase, (7.11), and the
regression that finds their weights, (7.12) and (7.13).

Progress s is time in units of the duration (or period): s = 0 at the start, 1 at the end. With it
the canonical system (7.6) has a closed form: z = exp(-decay s) solves z' = -tau decay z, and the
angle 2 pi s solves z' = tau omega.

The goal of a discrete primitive moves, too: `blend` is a smooth path from start to goal, and
`blend_attractor` its attractor (7.20), which makes a spring-damper follow the path.

The spring-damper is integrated by classical Runge-Kutta steps of x'' = stiffness (u(s) - x) -
damping x' with a drive that is known beforehand. The system is linear. So the four evaluations of
a step become one equation, x+ = R x + g0 u(s) + g1 u(s + h/2) + g2 u(s + h), with matrices that
depend on h only. The result is the same, and all steps can be computed at once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from dart_skill.movement._attractor import recur

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
        exponent = np.stack([np.ones_like(phase), phase, phase * phase], axis=1) @ self._exponents
        if progress.max(initial=0.0) > 1.0:
            # Beyond the last centre all kernels would underflow; relative to the last kernel they
            # do not.
            exponent += np.square(np.maximum(self.centres[-1] - phase, 0.0) / self.widths[-1])[
                :, None
            ]
        return np.exp(exponent)


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
        waves = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
        return np.exp(waves @ self._exponents)


Kernels = GaussianKernels | PeriodicKernels


def _ties(neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matrix of the squares of differences (m, n_basis), and the penalties of the joint
    regression, both (n_basis, n_basis).
    """
    tie = neighbours.T @ neighbours
    return tie, NEIGHBOUR_PENALTY * tie + SIZE_PENALTY * np.eye(len(tie))


def normalised(raw: np.ndarray) -> np.ndarray:
    """Rows (n, n_basis) scaled to sum to one: the denominator of (7.11)."""
    return raw / raw.sum(axis=1, keepdims=True)


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
    smooths the movement by a kernel's width.
    """
    share = np.sqrt(weights)
    features = psi * (share * gate)[:, None]
    normal = features.T @ features
    normal += normal.sum() / len(normal) * kernels.penalty
    return np.linalg.solve(normal, features.T @ (share[:, None] * target))


REGRESSIONS = {"joint": regress_jointly, "local": regress_locally}
"""Regressions by name."""


BLEND = Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
"""Path from 0 at s = 0 to 1 at s = 1, whose first four derivatives are zero at both ends."""


def blend(progress: np.ndarray) -> np.ndarray:
    """Path (n,) from 0 at s <= 0 to 1 at s >= 1, four times differentiable.

    So an integration of fourth order keeps its order, wherever its steps are.
    """
    return BLEND(np.clip(progress, 0.0, 1.0))


def within(progress: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    """Progress (n,) as a share of a window of it, 0 before and 1 afterwards."""
    begins, ends = window
    return np.clip((progress - begins) / (ends - begins), 0.0, 1.0)


def blend_attractor(stiffness: float, damping: float) -> Polynomial:
    """(7.20) for the blend over s in [0, 1]: the attractor that makes a spring-damper move along
    it.

    Parameters
    ----------
    stiffness
        Of the spring-damper [1/s^2].
    damping
        Of the spring-damper [1/s].
    """
    return BLEND + BLEND.deriv() * (damping / stiffness) + BLEND.deriv(2) / stiffness


class Steps(NamedTuple):
    """m steps of integration.

    Parameters
    ----------
    stages : (2 m + 1,)
        Ends and middles of the steps.
    length
        One number, or (m,) if they differ.
    per_node
        Number of steps from one node to the next.
    """

    stages: np.ndarray
    length: float | np.ndarray
    per_node: int


def divide(nodes: np.ndarray, longest: float) -> Steps:
    """Steps from node to node (n,), none of which is longer than `longest`."""
    if len(nodes) == 1:
        return Steps(nodes, longest, 1)
    gaps = nodes[1:] - nodes[:-1]
    longest_gap = float(gaps.max())
    per_node = max(1, math.ceil(longest_gap / longest - 1e-9))
    length = gaps / per_node
    even = longest_gap - gaps.min() <= 1e-9 * longest_gap
    fractions = np.arange(2 * per_node) / (2 * per_node)
    stages = np.append(nodes[:-1, None] + gaps[:, None] * fractions, nodes[-1])
    return Steps(stages, float(length.mean()) if even else np.repeat(length, per_node), per_node)


def step_gains(
    length: float | np.ndarray, stiffness: float, damping: float
) -> tuple[np.ndarray, np.ndarray]:
    """R (..., 2, 2) and [g0, g1, g2] (..., 2, 3) on a state of position and velocity, for one step
    length or for m of them. The drive is an acceleration.
    """
    h = np.asarray(length, dtype=float)[..., None, None]
    a = h * np.array([[0.0, 1.0], [-stiffness, -damping]])
    a2 = a @ a
    a3 = a2 @ a
    eye = np.eye(2)
    first, middle, last = (
        eye + a + a2 / 2.0 + a3 / 4.0,
        4.0 * eye + 2.0 * a + a2 / 2.0,
        np.broadcast_to(eye, a.shape),
    )
    # The drive is an acceleration: it enters through the second column.
    kicks = h / 6.0 * np.stack([first[..., 1], middle[..., 1], last[..., 1]], axis=-1)
    return eye + a + a2 / 2.0 + a3 / 6.0 + a2 @ a2 / 24.0, kicks


def integrate(
    steps: Steps, stiffness: float, damping: float, state: np.ndarray, drive: np.ndarray
) -> np.ndarray:
    """Position and velocity (2, n, d) at the n nodes.

    Parameters
    ----------
    state : (2, d)
        Position and velocity at the first node.
    drive : (2 m + 1, d)
        At the stages.
    """
    transitions, kicks = step_gains(steps.length, stiffness, damping)
    # Kicks (2, 1, 1) for one length, (2, m, 1) for many.
    first, middle, last = (kick.T.reshape(2, -1, 1) for kick in np.moveaxis(kicks, -1, 0))
    states = np.empty((2, len(drive) // 2 + 1, drive.shape[1]))
    states[:, 0] = state
    states[:, 1:] = first * drive[:-1:2] + middle * drive[1::2] + last * drive[2::2]
    if transitions.ndim == 2:
        states = recur(transitions, states)
    else:
        for k, transition in enumerate(transitions):
            states[:, k + 1] += transition @ states[:, k]
    return states[:, :: steps.per_node]
