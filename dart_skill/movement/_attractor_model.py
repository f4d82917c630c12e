"""What `DSGMR` and `AutonomousDSGMR` have in common: the gains of (7.19), further inputs of the
regression beside time, and a task-parameterised mixture that is fitted by EM or with one component
in each interval of time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_count, as_finite, as_number
from dart_skill.common.constants import PARTITIONS
from dart_skill.movement._attractor import as_gains, critical_damping
from dart_skill.movement._placement import Frames, Samples, Weights
from dart_skill.movement._saved import Arrays, MixtureModel
from dart_skill.movement._task_parameterised import TaskParameterisedMixture
from dart_skill.movement._time import as_stamps

OVERLAP = 0.7
"""Overlap of components at equal intervals of time."""


class AttractorModel(MixtureModel):
    """Base class of the models that learn attractors; `DSGMR` describes its parameters."""

    _MIXTURE = TaskParameterisedMixture
    mixture_: TaskParameterisedMixture

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
        self.stiffness = as_gains(stiffness, None, "stiffness", strict=True)
        self.damping = (
            critical_damping(self.stiffness)
            if damping is None
            else as_gains(damping, None, "damping", strict=False)
        )
        self._given_damping = damping
        self.n_inputs, self.partition = as_count(n_inputs, "n_inputs", 0), partition
        self.overlap = (
            None if overlap is None else as_number(overlap, "overlap", 1e-3, strict=False)
        )
        self._mixture = TaskParameterisedMixture(n_components, **mixture_options)
        self.n_components = self._mixture.n_components

    def _learn(
        self,
        samples: Samples,
        frames: Frames,
        weights: Weights,
        rng: np.random.Generator | None,
    ) -> None:
        """Fit the mixture to features (n_i, m) of each demonstration."""
        if self.partition == "time":
            fitted = self._mixture.fit_in_time(
                samples, frames, weights, OVERLAP if self.overlap is None else self.overlap
            )
        elif self.overlap is None:
            fitted = self._mixture.fit(samples, frames, weights, rng=rng)
        else:
            fitted = self._mixture.fit_and_around(samples, frames, weights, self.overlap, rng=rng)
        self.mixture_, self.n_demonstrations_ = self._with_outputs(fitted), len(samples)

    def _with_outputs(self, mixture: TaskParameterisedMixture) -> TaskParameterisedMixture:
        """The mixture; ValueError if it has no columns besides time and the further inputs."""
        if mixture.n_dims < self.n_inputs + 2:
            raise ValueError(
                f"{mixture.n_dims} columns are too few for time, {self.n_inputs} further inputs"
                " (n_inputs) and an attractor"
            )
        return mixture

    def _from_arrays(self, arrays: Arrays) -> None:
        mixture = TaskParameterisedMixture(
            self._mixture.n_components, n_shared=self._mixture.n_shared
        )
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
