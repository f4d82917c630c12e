"""DS-GMR: a task-parameterised mixture of attractor trajectories, retrieved by regression on time
and executed as a spring-damper (thesis 7.5).

Demonstrations become attractors by (7.20). The attractors are encoded by (7.21), retrieved by
(3.4) and (3.5), and followed by (7.19).

`AttractorModel` is the common base of `DSGMR` and `AutonomousDSGMR`: the gains of (7.19), further
inputs of the regression beside time, and a task-parameterised mixture that is fitted by EM or with
one component in each interval of time.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number, as_samples
from dart_skill.common.constants import PARTITIONS
from dart_skill.common.hyper_parameters import Arrays, SavableModel
from dart_skill.mixture import GaussianMixture
from dart_skill.movement._attractor import (
    as_gains,
    attractor_from_motion,
    critical_damping,
    follow_attractor,
)
from dart_skill.movement._differentiation import smooth_derivatives
from dart_skill.movement._placement import Frame, FrameCourse, Weights
from dart_skill.movement._sample_faults import find_faults, without_repeats
from dart_skill.movement._task_parameterised import TaskParameterisedMixture
from dart_skill.movement._time import as_stamps, uniform_step
from dart_skill.movement._via_points import (
    ViaPoints,
    arrays_of,
    conditioned,
    interpolating,
    roots,
)

OVERLAP = 0.7
"""Overlap of components at equal intervals of time."""


class AttractorModel(SavableModel):
    """Base class of the models that learn attractors; `DSGMR` describes its parameters. The
    hyper-parameters of the mixture that they fit are theirs, too.
    """

    _MIXTURE: Any = TaskParameterisedMixture
    _GROWS = True
    """Whether an overlap makes the components grow that EM has found."""
    mixture_: Any

    def __init__(
        self,
        n_components: int,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        *,
        n_inputs: int = 0,
        partition: str = "em",
        overlap: float | None = None,
        **mixture_options: Any,
    ) -> None:
        if partition not in PARTITIONS:
            raise ValueError(f"partition must be one of {PARTITIONS}, got {partition!r}")
        self.stiffness = self._gains(stiffness, "stiffness", True)
        self.damping = (
            critical_damping(self.stiffness)
            if damping is None
            else self._gains(damping, "damping", False)
        )
        self._given_damping = damping  # before a default took the place of None
        self.n_inputs, self.partition = as_count(n_inputs, "n_inputs", 0), partition
        self.overlap = (
            None if overlap is None else as_number(overlap, "overlap", 1e-3, strict=False)
        )
        self._mixture = self._MIXTURE(n_components, **mixture_options)
        self.n_components = self._mixture.n_components

    @staticmethod
    def _gains(value: ArrayLike, name: str, strict: bool) -> np.ndarray:
        """Gains of the movement variables, checked."""
        return as_gains(value, None, name, strict)

    @classmethod
    def _parameters(cls) -> dict[str, inspect.Parameter]:
        return {**super()._parameters(), **cls._MIXTURE._parameters()}

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The hyper-parameters by name, with those of the mixture, as the constructor takes them.

        Parameters
        ----------
        deep
            For scikit-learn.
        """
        known = {**vars(self), **self._mixture.get_params(), "damping": self._given_damping}
        return {name: known[name] for name in self._parameters()}

    @property
    def _fitted(self) -> Any:
        if not hasattr(self, "mixture_"):
            raise ValueError(f"this {type(self).__name__} holds no model yet; call fit first")
        return self.mixture_

    def _to_arrays(self) -> Arrays:
        return self._fitted._to_arrays()

    def _learn(
        self,
        samples: Sequence[ArrayLike],
        frames: Sequence[Sequence[Any]],
        weights: Weights,
        rng: np.random.Generator | None,
    ) -> None:
        """Fit the mixture to features (n_i, m) of each demonstration."""
        if self.partition == "time":
            fitted = self._mixture.fit_in_time(
                samples, frames, weights, OVERLAP if self.overlap is None else self.overlap
            )
        else:
            grown = {"overlap": self.overlap} if self._GROWS else {}
            fitted = self._mixture.fit(samples, frames, weights, rng=rng, **grown)
        self.mixture_, self.n_demonstrations_ = self._with_outputs(fitted), len(samples)

    def _with_outputs(self, mixture: Any) -> Any:
        """The mixture; ValueError if it has no columns besides time and the further inputs."""
        if mixture.n_dims < self.n_inputs + 2:
            raise ValueError(
                f"{mixture.n_dims} columns are too few for time, {self.n_inputs} further inputs"
                " (n_inputs) and an attractor"
            )
        return mixture

    def _from_arrays(self, arrays: Arrays) -> None:
        mixture = self._MIXTURE(**self._mixture.get_params())
        mixture._from_arrays(arrays)
        self.mixture_ = self._with_outputs(mixture)

    @property
    def _blocks_of_columns(self) -> int:
        """How many groups of columns the movement variables fill."""
        return 1

    def _fitted_to(self) -> str:
        if not hasattr(self, "mixture_"):
            return ""
        d = (self.mixture_.n_dims - 1 - self.n_inputs) // self._blocks_of_columns
        inputs = f" and {self.n_inputs} further inputs" if self.n_inputs else ""
        return f"{self._shown()}{d} movement variables{inputs}, {self.mixture_._fitted_to()}"

    def _with_inputs(
        self, time: ArrayLike, inputs: ArrayLike | None, n: int | None = None
    ) -> np.ndarray:
        """Stamps (n,) and further inputs, (q,) or (n, q), as columns (n, 1 + q)."""
        time, q = as_stamps(time, n), self.n_inputs
        given = as_finite([] if inputs is None else inputs, "inputs")
        if given.shape == () and q == 1:
            given = given[None]
        if given.shape not in ((q,), (len(time), q)):
            raise ValueError(
                f"inputs beside time must have shape ({q},), or ({len(time)}, {q}) to change with"
                f" it, got {given.shape}; n_inputs says how many there are"
            )
        return np.column_stack([time, np.broadcast_to(given, (len(time), q))])


SAME_STEP = 1e-6
"""Largest relative difference between a given step and that of the stamps."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """A planned movement, in the units of the movement.

    Parameters
    ----------
    time
        (n,) [s].
    attractor
        (n, d).
    covariance
        (n, d, d), of the attractor; None if it was not asked for.
    position, velocity, acceleration
        (n, d), of the motion that follows the attractor (7.19).
    """

    time: np.ndarray
    attractor: np.ndarray
    covariance: np.ndarray | None
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class DSGMR(ViaPoints, AttractorModel):
    """Movement primitive over d movement variables that is driven by a clock.

    The features are [t, u, y], with m = 1 + q + d columns: time, q further inputs such as the
    distance of a target, and the attractor. Within a component the attractor is a linear function
    of time and the further inputs.

    Attribute after `fit`: mixture_, the fitted TaskParameterisedMixture over [t, u, y].

    Parameters
    ----------
    n_components
        Int, number of components of the mixture.
    stiffness
        One number or (d,), default 200 [1/s^2]. kp of (7.19).
    damping
        One number or (d,) [1/s], default None: critical, 2 sqrt(kp). kv of (7.19).
    n_inputs
        Int, default 0. q, the number of further inputs.
    partition
        "em" or "time", default "em". EM finds which samples belong to a component, or each
        component has its own interval of time.
    overlap
        Float, default None. Standard deviation of a component in time, relative to its interval.
        For partition "time" the default is 0.7. For "em" it is what EM finds; a number makes
        `TaskParameterisedMixture.fit_around` follow EM: smoother attractors, and no component that
        belongs to a few demonstrations.
    mixture_options
        Hyper-parameters of `TaskParameterisedMixture`. With partition "time" only covariance_floor
        and covariance_prior are used.
    """

    @classmethod
    def from_mixture(
        cls,
        mixture: TaskParameterisedMixture,
        stiffness: ArrayLike = 200.0,
        damping: ArrayLike | None = None,
        n_inputs: int = 0,
    ) -> DSGMR:
        """Model around a mixture that is already fitted.

        Parameters
        ----------
        stiffness, damping, n_inputs
            As of the class.
        """
        model = cls(len(mixture.priors_), stiffness, damping, n_inputs=n_inputs)
        model._mixture = model.mixture_ = model._with_outputs(mixture)
        return model

    def encode(
        self,
        time: ArrayLike,
        positions: ArrayLike,
        *,
        noise: float | ArrayLike | None = None,
        at: ArrayLike | None = None,
        inputs: ArrayLike | None = None,
        faults: str = "say",
    ) -> np.ndarray:
        """Features [t, u, y] (n, m) of one demonstration, from noisy movement variables: the
        attractor is computed by (7.20).

        Parameters
        ----------
        time
            Stamps (k,) of the samples [s].
        positions
            Movement variables (k, d).
        noise
            Standard deviation of the samples, as in `smooth_derivatives`; default None: estimated.
        at
            Stamps (n,) of the features [s], default None: those of the samples.
        inputs
            The further inputs u, (q,) or (n, q); default None: there are none.
        faults
            "say" (default), a warning says which repeats and jumps `find_faults` finds, and the
            samples are taken as they are; "refuse", a ValueError says so; "thin", samples that
            repeat are left out first (`without_repeats`), and features are at the stamps that
            remain; "keep", samples are not checked.
        """
        if faults == "say":
            if found := _faults_of(time, positions):
                warnings.warn(
                    f"{found} (faults='thin' or 'refuse' of encode, or retimed; 'keep' says"
                    " nothing)",
                    stacklevel=2,
                )
        elif faults != "keep":
            time, positions = _faultless(time, positions, faults)
        motion = smooth_derivatives(time, positions, noise=noise, at=at)
        return self.features(
            time if at is None else at,
            attractor_from_motion(*motion, self.stiffness, self.damping),
            inputs,
        )

    def features(
        self, time: ArrayLike, attractor: ArrayLike, inputs: ArrayLike | None = None
    ) -> np.ndarray:
        """Features [t, u, y] (n, m) of an attractor (n, d) that was computed before, at stamps
        (n,) [s]; inputs as in `encode`.
        """
        attractor = as_samples(attractor, "attractor")
        return np.column_stack([self._with_inputs(time, inputs, len(attractor)), attractor])

    def fit(
        self,
        attractors: Sequence[ArrayLike],
        frames: Sequence[Sequence[FrameCourse]],
        weights: Weights = None,
        *,
        rng: np.random.Generator | None = None,
    ) -> DSGMR:
        """Learn from demonstrations.

        Parameters
        ----------
        attractors
            For each demonstration its features [t, u, y] (n_i, m), from `encode` or `features`.
        frames
            For each demonstration P task frames of these features, as in
            `TaskParameterisedMixture.fit`.
        weights
            For each demonstration one number or one per sample (n_i,): how much it counts (8.4.2).
            Default None: all count alike.
        rng
            Random generator, only needed for the hyper-parameter start="kmeans".

        Returns
        -------
        DSGMR
            Self.
        """
        self._learn(attractors, frames, weights, rng)
        self._vias = ()
        return self

    def _to_arrays(self) -> Arrays:
        self._require_no_vias()
        return super()._to_arrays()

    @property
    def _n_outputs(self) -> int:
        return int(self._fitted.n_dims) - 1 - self.n_inputs

    def bic(
        self,
        attractors: Sequence[ArrayLike],
        frames: Sequence[Sequence[FrameCourse]],
        weights: Weights = None,
    ) -> float:
        """Bayesian information criterion for demonstrations, which are given as to `fit`: lower is
        better.
        """
        return self._fitted.bic(attractors, frames, weights)

    def product(self, frames: Sequence[Frame | None]) -> GaussianMixture:
        """(7.21): the mixture over [t, u, y] in the world, for P new frames; None for a missing
        one.
        """
        return self._fitted.product(frames)

    def retrieve(
        self,
        frames: Sequence[FrameCourse],
        time: ArrayLike,
        inputs: ArrayLike | None = None,
        *,
        covariance: bool = True,
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Mean (n, d) and covariance (n, d, d) of the attractor in new frames, by (3.4) and (3.5).

        Parameters
        ----------
        frames
            P task frames. A moving frame is a list with one frame for each stamp, a missing frame
            is None.
        time
            Stamps (n,) [s].
        inputs
            The further inputs u, (q,) or (n, q); default None: there are none.
        covariance
            Bool, default True. If False, None is returned in its place, which saves time.
        """
        mixture, queries = self._fitted, self._with_inputs(time, inputs)
        n_inputs = queries.shape[1]
        return mixture.regress(
            frames, queries, np.arange(n_inputs), np.arange(n_inputs, mixture.n_dims), covariance
        )

    def variations(
        self,
        frames: Sequence[FrameCourse],
        time: ArrayLike,
        n: int,
        rng: np.random.Generator,
        inputs: ArrayLike | None = None,
        *,
        smoothness: float | None = None,
    ) -> np.ndarray:
        """Attractors (n, T, d) that vary as the demonstrations did, and keep what these had in
        common (7.5.2).

        At each stamp they are distributed as `retrieve` says: normally, with its mean and its
        covariance. From stamp to stamp they vary smoothly: the deviations, in units of that
        covariance, are a Gaussian process with the kernel exp(-(t - t')^2 / (2 l^2)).

        Parameters
        ----------
        frames
            As in `retrieve`.
        time : (T,)
            As in `retrieve`.
        inputs
            As in `retrieve`.
        n
            How many.
        smoothness
            l [s], default None: the median standard deviation of the components in time.
        """
        time, n = as_stamps(time), as_count(n, "n")
        mean, covariance = self.retrieve(frames, time, inputs)
        assert covariance is not None
        length = self._time_scale if smoothness is None else as_number(smoothness, "smoothness")
        deviations = _smooth_normal(time, length, (n, mean.shape[1]), rng)
        return mean + np.einsum("tij,njt->nti", roots(covariance), deviations)

    @property
    def _time_scale(self) -> float:
        """Median standard deviation of the components in time, which all frames see alike [s]."""
        return float(np.median(np.sqrt(self._fitted.covariances_[0][:, 0, 0])))

    def reproduce(
        self,
        frames: Sequence[FrameCourse],
        time: ArrayLike,
        position0: ArrayLike,
        velocity0: ArrayLike,
        push: ArrayLike | None = None,
        *,
        inputs: ArrayLike | None = None,
        step: float | None = None,
        covariance: bool = True,
        end: ArrayLike | None = None,
    ) -> Reproduction:
        """Movement of a unit mass (7.19) in place of the robot, in new frames. It passes through
        the via points of `condition`, which are of its position.

        Parameters
        ----------
        frames, inputs, covariance
            As in `retrieve`.
        time
            Equally spaced stamps (n,) [s], n >= 2.
        position0, velocity0
            State (d,) at the first stamp.
        push
            Acceleration (n, d) from outside, in units of the movement per s^2, linear between the
            stamps; default None: none.
        step
            Float [s], default None: computed from the stamps. Give it if it is known exactly:
            stamps such as `start + step * arange(n)` are rounded, so that their differences are
            not exactly `step`.
        end
            Position (d,) that is met at the last stamp, a via point; default None: what was
            learned.

        Raises
        ------
        ValueError
            For a via point that is not after the first stamp and before the last one, or at it.
        """
        time = as_stamps(time, minimum=2)
        asked = self if end is None else self.condition(time[-1], end)
        led = partial(
            follow_attractor,
            step=step_of(time, step),
            position0=position0,
            velocity0=velocity0,
            stiffness=self.stiffness,
            damping=self.damping,
        )
        needed = covariance or bool(asked._vias)
        attractor, spread = self.retrieve(frames, time, inputs, covariance=needed)
        motion = led(self._pulled(attractor, push))
        if asked._vias:
            assert spread is not None  # it was asked for
            attractor, spread = asked._through(time, attractor, spread, motion.position)
            motion = led(self._pulled(attractor, push))
        return Reproduction(time, attractor, spread if covariance else None, *motion)

    def _through(
        self, time: np.ndarray, attractor: np.ndarray, spread: np.ndarray, position: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The attractor (n, d) and its covariance (n, d, d) that lead through the via points, where
        these lead along a position (n, d).

        The position is linear in the attractor, so a via point is a known weighted sum of it.
        """
        at, wanted, noise = arrays_of(self._vias)
        if at.min() <= time[0] or at.max() > time[-1]:
            raise ValueError(
                f"via points are from {at.min():g} to {at.max():g} s: each must be after"
                f" {time[0]:g} s, where the movement is at position0, and by {time[-1]:g} s"
            )
        stamps = interpolating(at, time)
        weights = np.einsum("mk,kti->mti", stamps, self._responses(time, attractor.shape[1]))
        misses = wanted - stamps @ position
        return conditioned(time, attractor, spread, weights, misses, noise, self._time_scale)

    def _responses(self, time: np.ndarray, d: int) -> np.ndarray:
        """Change of the position at each stamp by a change of the attractor at each (n, n, d)."""
        n, pulses = len(time), np.zeros((2, len(time), d))
        pulses[[0, 1], [0, 1]] = 1.0
        first, later = (
            follow_attractor(
                one, uniform_step(time), np.zeros(d), np.zeros(d), self.stiffness, self.damping
            ).position
            for one in pulses
        )
        ago = np.arange(n)[:, None] - np.arange(n)
        responses = np.where((ago >= 0)[..., None], later[np.clip(ago + 1, 0, n - 1)], 0.0)
        responses[:, 0] = first
        return responses

    def _pulled(self, attractor: np.ndarray, push: ArrayLike | None) -> np.ndarray:
        """The attractor (n, d) that has the effect of this one and the push together: the push
        shifts it by push / kp.
        """
        if push is None:
            return attractor
        push = as_samples(push, "push", attractor.shape[1])
        if len(push) != len(attractor):
            raise ValueError(
                f"push must have {len(attractor)} rows, one per stamp, got {len(push)}"
            )
        return attractor + push / self.stiffness


def _faultless(time: ArrayLike, positions: ArrayLike, faults: str) -> tuple[ArrayLike, ArrayLike]:
    """Stamps and samples without repeats if `faults` is "thin"; ValueError if repeats or jumps are
    left, or `faults` is not known.
    """
    if faults not in ("refuse", "thin"):
        raise ValueError(
            f"faults must be one of ('say', 'refuse', 'thin', 'keep'), got {faults!r}"
        )
    if faults == "thin":
        time, positions = without_repeats(time, positions)
    if found := _faults_of(time, positions):
        raise ValueError(found)
    return time, positions


def _faults_of(time: ArrayLike, positions: ArrayLike) -> str:
    """What makes samples unfit to be differentiated, in words; empty if nothing does. Quantisation
    is but noise of a known size.
    """
    found = replace(find_faults(time, positions), quantum=()).reasons
    return "the samples cannot be differentiated: " + "; ".join(found) if found else ""


def _smooth_normal(
    time: np.ndarray, length: float, shape: tuple[int, ...], rng: np.random.Generator
) -> np.ndarray:
    """Samples (*shape, T) of a Gaussian process of mean 0 and variance 1 at stamps (T,), with a
    squared-exponential kernel of a length.
    """
    kernel = np.exp(-0.5 * np.square((time[:, None] - time) / length))
    variance, axes = np.linalg.eigh(kernel)
    kept = variance > variance[-1] * len(time) * np.finfo(float).eps  # the rest is rounding
    root = axes[:, kept] * np.sqrt(variance[kept])
    root /= np.linalg.norm(root, axis=1, keepdims=True)
    return rng.standard_normal((*shape, root.shape[1])) @ root.T


def step_of(time: np.ndarray, given: float | None) -> float:
    """Step of equally spaced stamps (n,) [s]: the given one, if the stamps agree with it."""
    measured = uniform_step(time)
    if given is None:
        return measured
    step = as_number(given, "step")
    if abs(step - measured) > SAME_STEP * step:
        raise ValueError(
            f"step is {step:g} s, but the stamps are {measured:g} s apart; leave it out, or give"
            " such stamps"
        )
    return step
