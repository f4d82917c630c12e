"""A mass that is pulled by several springs at once, each with a centre and a stiffness of its own:
(7.18).

`DSGMR` keeps the stiffness constant and moves the attractor (7.19). Here the attractors rest, and
the springs take turns. `attractor` is the moving attractor of (7.19) that pulls as they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_covariances, as_finite, as_number, as_samples, as_vector
from dart_skill.mixture import GaussianMixture
from dart_skill.movement._attractor import attractor_from_motion
from dart_skill.movement._differentiation import Motion
from dart_skill.movement._frames import TaskFrame
from dart_skill.movement._task_parameterised import TaskParameterisedMixture
from dart_skill.movement._time import as_stamps

WEIGHT_OF_PRIOR = 1e-6
"""Weight of the given stiffness against the samples: it decides only where they say nothing."""
TOLERANCE = 1e-9
"""Tolerance of the integration, relative and absolute in units of the movement."""


@dataclass(frozen=True, eq=False)
class SpringMixture:
    """K springs over d movement variables: x'' = sum_i h_i(t) K_i (mu_i - x) - kv x' (7.18).

    Parameters
    ----------
    timing
        Mixture of K components over time alone [s]; h_i(t) are its responsibilities.
    centres
        (K, d), mu_i.
    stiffness
        (K, d, d) [1/s^2], K_i, symmetric and positive definite.
    damping
        Float [1/s], kv.
    """

    timing: GaussianMixture
    centres: np.ndarray
    stiffness: np.ndarray
    damping: float

    def __post_init__(self) -> None:
        centres = as_samples(self.centres, "centres")
        if self.timing.n_dims != 1 or len(self.timing.priors_) != len(centres):
            raise ValueError(
                f"timing must be a mixture of {len(centres)} components over time alone, as many"
                " as there are centres"
            )
        stiffness = as_covariances(self.stiffness, "stiffness", (*centres.shape, centres.shape[1]))
        if (least := float(np.linalg.eigvalsh(stiffness).min())) <= 0.0:
            raise ValueError(f"stiffness has the eigenvalue {least:.3g}; all must be positive")
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "stiffness", stiffness)
        object.__setattr__(self, "damping", as_number(self.damping, "damping", strict=False))

    @classmethod
    def fit(
        cls,
        time: Sequence[ArrayLike],
        motions: Sequence[Motion],
        n_components: int,
        stiffness: float = 200.0,
        damping: float | None = None,
        *,
        bounds: tuple[float, float] | None = None,
        timing: GaussianMixture | None = None,
    ) -> SpringMixture:
        """Springs that move a mass as it was seen to move.

        EM on time and the attractors of (7.20) finds which spring pulls when. Centres and
        stiffness are then the weighted least squares of x'' + kv x' = sum_i h_i K_i (mu_i - x),
        which is linear in K_i and K_i mu_i.

        Parameters
        ----------
        time
            Stamps (n_i,) [s] of each demonstration.
        motions
            Position, velocity and acceleration (n_i, d) of each, as `smooth_derivatives` gives
            them.
        n_components
            K.
        stiffness
            Kp of (7.20) [1/s^2], default 200. Where the demonstrations do not tell the stiffness,
            it is this one.
        damping
            Kv [1/s], default None: critical for `stiffness`.
        bounds
            Least and largest eigenvalue of each K_i [1/s^2], default None: a tenth and ten times
            `stiffness`.
        timing
            Which spring pulls when, a mixture of K components over time, if that is known; default
            None: EM finds it.

        Raises
        ------
        ValueError
            If there are none, or not equally many; or for bounds that are none.
        """
        kp = as_number(stiffness, "stiffness")
        kv = 2.0 * np.sqrt(kp) if damping is None else as_number(damping, "damping", strict=False)
        least, most = (0.1 * kp, 10.0 * kp) if bounds is None else bounds
        if not 0.0 < least <= most:
            raise ValueError(
                f"bounds are {bounds}: give the least and the largest stiffness, both above 0"
            )
        if len(time) != len(motions) or not motions:
            raise ValueError(
                f"{len(time)} arrays of stamps for {len(motions)} motions: give one for each, and"
                " at least one"
            )
        clock = np.concatenate(
            [
                as_stamps(stamps, len(motion.position))
                for stamps, motion in zip(time, motions, strict=True)
            ]
        )
        position, velocity, acceleration = (
            np.concatenate(parts) for parts in zip(*motions, strict=True)
        )
        if timing is None:
            timing = _found_timing(
                time, [attractor_from_motion(*motion, kp, kv) for motion in motions], n_components
            )
        shares, pull = timing.responsibilities(clock[:, None]), acceleration + kv * velocity
        gains = _bounded(_gains(shares, position, pull, kp), least, most)
        return cls(timing, _centres(shares, position, pull, gains), gains, kv)

    def activations(self, time: ArrayLike) -> np.ndarray:
        """h_i (n, K) at stamps (n,) [s]; each row adds up to 1."""
        variance = self.timing.covariances_[:, 0, 0]
        off = as_finite(time, "time", 1)[:, None] - self.timing.means_[:, 0]
        log_density = np.log(self.timing.priors_ / np.sqrt(variance)) - 0.5 * off**2 / variance
        shares = np.exp(log_density - log_density.max(axis=1, keepdims=True))
        return shares / shares.sum(axis=1, keepdims=True)

    def acceleration(
        self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike
    ) -> np.ndarray:
        """(7.18): acceleration (n, d) of a unit mass at position and velocity (n, d), at stamps
        (n,) [s].
        """
        position, velocity = (
            self._samples(position, "position"),
            self._samples(velocity, "velocity"),
        )
        return self._pull(time, position) - self.damping * velocity

    def attractor(self, time: ArrayLike, position: ArrayLike, stiffness: float) -> np.ndarray:
        """The attractor (n, d) of (7.19), with this constant stiffness [1/s^2] and the same
        damping, that pulls a mass at position (n, d) as all springs do.

        Parameters
        ----------
        time
            (n,) [s].
        """
        position = self._samples(position, "position")
        return position + self._pull(time, position) / as_number(stiffness, "stiffness")

    def follow(self, time: ArrayLike, position0: ArrayLike, velocity0: ArrayLike) -> Motion:
        """Motion (n, d) of a unit mass at stamps (n,) [s], from the state (d,) at the first one;
        integrated by an explicit Runge-Kutta method of order 8 (DOP853 of scipy).

        Parameters
        ----------
        position0, velocity0
            The state at the first stamp.
        """
        # a lesson of throws needs none, and would wait for it
        from scipy.integrate import solve_ivp

        stamps, d = as_stamps(time, minimum=2), self.centres.shape[1]
        start = np.concatenate(
            [as_vector(position0, "position0", d), as_vector(velocity0, "velocity0", d)]
        )

        def slope(now: float, state: np.ndarray) -> np.ndarray:
            pull = self._pull([now], state[None, :d])[0]
            return np.concatenate([state[d:], pull - self.damping * state[d:]])

        ends = (float(stamps[0]), float(stamps[-1]))
        step = float(np.sqrt(self.timing.covariances_.min()))  # no spring is stepped over
        solved = solve_ivp(
            slope,
            ends,
            start,
            "DOP853",
            t_eval=stamps,
            rtol=TOLERANCE,
            atol=TOLERANCE,
            max_step=step,
        )
        position, velocity = solved.y[:d].T, solved.y[d:].T
        return Motion(position, velocity, self.acceleration(stamps, position, velocity))

    def _pull(self, time: ArrayLike, position: np.ndarray) -> np.ndarray:
        shares = self.activations(time)
        gains = (shares @ self.stiffness.reshape(len(self.centres), -1)).reshape(
            -1, *self.stiffness.shape[1:]
        )
        return shares @ self._forces - (gains @ position[:, :, None])[:, :, 0]

    @cached_property
    def _forces(self) -> np.ndarray:
        """K_i mu_i (K, d)."""
        return (self.stiffness @ self.centres[:, :, None])[:, :, 0]

    def _samples(self, value: ArrayLike, name: str) -> np.ndarray:
        return as_samples(value, name, self.centres.shape[1])


def _found_timing(
    time: Sequence[ArrayLike], attractors: Sequence[np.ndarray], n_components: int
) -> GaussianMixture:
    """Mixture over time, of one that EM fits to time and attractors (n_i, d); it starts with equal
    intervals of time.
    """
    samples = [
        np.column_stack([stamps, attractor])
        for stamps, attractor in zip(time, attractors, strict=True)
    ]
    whole = TaskFrame(np.eye(samples[0].shape[1]), np.zeros(samples[0].shape[1]))
    fitted = TaskParameterisedMixture(n_components).fit(samples, [[whole]] * len(samples))
    return fitted.product([whole]).marginal([0])


def _gains(shares: np.ndarray, position: np.ndarray, pull: np.ndarray, usual: float) -> np.ndarray:
    """K_i (K, d, d), symmetric: least squares of the pull (n, d) with shares (n, K), as deviations
    from the usual gain, which are 0 where nothing tells them.
    """
    (n, k), d = shares.shape, position.shape[1]
    middle = np.average(position, axis=0)
    rows, columns = np.triu_indices(d)
    entries = np.zeros((len(rows), d, d))
    entries[np.arange(len(rows)), rows, columns] = entries[np.arange(len(rows)), columns, rows] = (
        1.0
    )
    by_gain = -np.einsum("nk,eij,nj->nike", shares, entries, position - middle).reshape(n * d, -1)
    by_force = np.einsum("nk,ij->nikj", shares, np.eye(d)).reshape(n * d, -1)
    m = by_gain.shape[1]
    prior = np.sqrt(WEIGHT_OF_PRIOR * np.square(by_gain).sum(axis=0).mean()) * np.eye(
        m, m + by_force.shape[1]
    )
    unexplained = (pull + usual * (position - middle)).ravel()
    design = np.vstack([np.hstack([by_gain, by_force]), prior])
    found = np.linalg.lstsq(design, np.concatenate([unexplained, np.zeros(m)]), rcond=None)[0]
    return usual * np.eye(d) + np.einsum("ke,eij->kij", found[:m].reshape(k, -1), entries)


def _bounded(gains: np.ndarray, least: float, most: float) -> np.ndarray:
    """The nearest symmetric matrices (K, d, d), in the Frobenius norm, with eigenvalues within
    bounds.
    """
    values, axes = np.linalg.eigh(gains)
    return np.einsum("kij,kj,klj->kil", axes, np.clip(values, least, most), axes)


def _centres(
    shares: np.ndarray, position: np.ndarray, pull: np.ndarray, gains: np.ndarray
) -> np.ndarray:
    """mu_i (K, d) for given gains: least squares of the forces K_i mu_i (K, d)."""
    resisted = np.einsum("nk,kij,nj->ni", shares, gains, position)
    forces = np.linalg.lstsq(shares, pull + resisted, rcond=None)[0]
    return np.linalg.solve(gains, forces[:, :, None])[:, :, 0]
