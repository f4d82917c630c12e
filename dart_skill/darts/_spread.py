"""The spread of a thrower: darts land at aim + bias + N(0, covariance). It may depend on the
target (Haugh and Wang 2022).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_covariances, as_vector
from dart_skill.darts._board import as_points

SMALLEST = 0.1
"""Smallest standard deviation that is accepted [mm]."""
LARGEST = 2000.0
"""Largest standard deviation that is accepted [mm]."""
LARGEST_BIAS = 1000.0
"""Largest bias that is accepted along either axis [mm]."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Gaussian spread of the darts about the aim.

    Parameters
    ----------
    covariance : (2, 2) [mm^2]
        Standard deviations along its axes from 0.1 to 2000 mm.
    bias : (2,) [mm]
        Default zero: mean of the darts minus the aim, at most 1000 mm.
    """

    covariance: np.ndarray
    bias: np.ndarray = field(default_factory=lambda: np.zeros(2))

    def __post_init__(self) -> None:
        covariance = as_covariances(self.covariance, "covariance", (2, 2))
        bias = as_vector(self.bias, "bias", 2)
        variances = np.linalg.eigvalsh(covariance)
        if not SMALLEST**2 <= variances[0] <= variances[1] <= LARGEST**2:
            raise ValueError(
                f"covariance has the variances {variances[0]:g} and {variances[1]:g} mm^2 along"
                f" its axes; standard deviations of darts lie between {SMALLEST:g} and"
                f" {LARGEST:g} mm"
            )
        if np.abs(bias).max() > LARGEST_BIAS:
            raise ValueError(
                f"bias is {bias.tolist()} mm; beyond {LARGEST_BIAS:g} mm no dart meets the board"
            )
        covariance.flags.writeable = bias.flags.writeable = False
        object.__setattr__(self, "covariance", covariance)
        object.__setattr__(self, "bias", bias)

    @classmethod
    def isotropic(cls, sigma: float, bias: ArrayLike = (0.0, 0.0)) -> Spread:
        """The same standard deviation sigma [mm] in every direction.

        Parameters
        ----------
        bias
            (2,) [mm], default zero.
        """
        return cls(_as_sigma(sigma) ** 2 * np.eye(2), as_vector(bias, "bias", 2))

    @property
    def sigma(self) -> float:
        """(det covariance)^(1/4) [mm]: the standard deviation if the spread is isotropic."""
        # Not from the determinant: that would not return exactly the sigma of `isotropic`.
        return float(np.sqrt(np.prod(self.deviations)))

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations (2,) along the principal axes, ascending [mm]."""
        return np.sqrt(np.linalg.eigvalsh(self.covariance))

    @property
    def is_isotropic(self) -> bool:
        return bool(np.ptp(self.deviations) < 1e-9 * self.sigma)

    def scaled_to(self, sigma: float) -> Spread:
        """The same shape and bias with another sigma [mm]."""
        return Spread(self.covariance * (_as_sigma(sigma) / self.sigma) ** 2, self.bias)

    def throw(self, aims: ArrayLike, rng: np.random.Generator) -> np.ndarray:
        """One impact (..., 2) [mm] for each aim (..., 2) [mm]."""
        aims = as_points(aims, "aims")
        return (
            aims
            + self.bias
            + rng.standard_normal(aims.shape) @ np.linalg.cholesky(self.covariance).T
        )


@dataclass(frozen=True, eq=False)
class SpreadByTarget:
    """A spread for each of several targets (Haugh and Wang 2022). An aim has the spread of the
    nearest target.

    Parameters
    ----------
    targets : (k, 2) [mm]
    spreads
        k spreads, one for each target.
    doubles
        Spread of all aims farther from the bull than DOUBLES_FROM, 150 mm.
    """

    targets: np.ndarray
    spreads: tuple[Spread, ...]
    doubles: Spread
    DOUBLES_FROM = 150.0

    def __post_init__(self) -> None:
        targets = as_points(self.targets, "targets")
        if targets.ndim != 2 or len(targets) != len(self.spreads) or len(targets) == 0:
            raise ValueError(
                f"one spread per target is needed, got targets of shape {targets.shape} and"
                f" {len(self.spreads)} spreads"
            )
        object.__setattr__(self, "targets", targets)

    def which(self, aims: np.ndarray) -> np.ndarray:
        """Index (n,), into `all_spreads`, of the spread of each of the aims (n, 2) [mm]."""
        nearest = np.square(aims[:, None] - self.targets).sum(2).argmin(1)
        return np.where(np.hypot(*aims.T) > self.DOUBLES_FROM, len(self.targets), nearest)

    @property
    def all_spreads(self) -> tuple[Spread, ...]:
        return (*self.spreads, self.doubles)


def as_spread(value: Spread | float | ArrayLike) -> Spread:
    """A Spread from a Spread, a sigma [mm], or a covariance (2, 2) [mm^2]."""
    if isinstance(value, Spread):
        return value
    if np.ndim(value) == 0:
        return Spread.isotropic(np.asarray(value).item())
    return Spread(as_covariances(value, "covariance", (2, 2)))


def _as_sigma(value: float) -> float:
    try:
        sigma = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"sigma must be a number of millimetres, got {value!r}") from None
    if not SMALLEST <= sigma <= LARGEST:
        raise ValueError(
            f"sigma must lie between {SMALLEST:g} and {LARGEST:g} mm, got {sigma:g}; it is a"
            " standard deviation in millimetres"
        )
    return sigma
