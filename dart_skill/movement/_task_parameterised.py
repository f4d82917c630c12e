"""Task-parameterised Gaussian mixture: thesis 7.5.2 and (7.21).

Every demonstration is seen from P frames at once. EM shares the responsibilities between the
frames (the density of a component is the product over frames, as in the tensor mixture of
Calinon), so component k means the same part of the motion in each of them. For new frames each
component is the product of its Gaussians mapped into the world.

A frame (A, b) sees a point x of the world at C (x - b) with C = A^-1. It may move from sample to
sample, be missing for a while or altogether, or see only some directions (`PartialFrame`); time,
the first feature, is part of what every frame sees. A frame that is missing is no factor of the
product, in learning as in (7.21).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import (
    as_count,
    as_covariances,
    as_finite,
    as_number,
    as_samples,
    as_weights,
)
from dart_skill.common.hyper_parameters import Arrays, SavableModel, array_of
from dart_skill.mixture import (
    DEAD_SHARE,
    EMEstimator,
    GaussianMixture,
    Parameters,
    Regression,
    checked_priors,
    cholesky,
    column_scales,
    expectation_at,
    in_units,
    kmeans_start,
    masses_of,
    maximisation,
    n_free_parameters,
    normalise_log,
    regress_each,
    sliced_start,
    symmetric,
    with_prior,
)
from dart_skill.movement._frames import TaskFrame
from dart_skill.movement._placement import (
    FrameCourse,
    Frames,
    FrameSituation,
    PartialFrame,
    Samples,
    TaskSamples,
    Weights,
    moments_of,
)

__all__ = ["PartialFrame", "TaskParameterisedMixture"]

STARTS = ("time", "kmeans")
"""Starts of EM."""
LEAST_SHARE = 1e-2
"""A column of a frame counts as no narrower than this share of what world deviations could put
there.
"""
LEAST_PIVOT = 1e-12
"""A direction of the world counts as seen when the frames tell it apart from the others by this
share at least.
"""


def as_sample_weights(weights: Weights, lengths: list[int]) -> np.ndarray:
    """Weights of all samples in a row, from None, one number per demonstration, or one array
    (n_i,) per demonstration.
    """
    if weights is None:
        return np.ones(sum(lengths))
    if len(weights) != len(lengths):
        raise ValueError(f"weights has {len(weights)} entries for {len(lengths)} demonstrations")
    full = [
        np.full(n, w) if np.ndim(w) == 0 else as_finite(w, f"weights of demonstration {i}", 1)
        for i, (w, n) in enumerate(zip(weights, lengths, strict=True))
    ]
    for i, (one, n) in enumerate(zip(full, lengths, strict=True)):
        if len(one) != n:
            raise ValueError(
                f"weights of demonstration {i} has length {len(one)}, its samples {n}"
            )
    return as_weights(np.concatenate(full), sum(lengths))


def least_scales(taught: TaskSamples, weights: np.ndarray) -> list[np.ndarray]:
    """Per frame (d_p,), least scales of the columns: a share of the deviations of the samples in
    the world, carried into the frame without regard to their direction.

    A floor that comes from these keeps a component usable that is flat in one frame (static
    attractors at the target): turned into the world, the floor must stand out from the rounding
    errors of the other columns.
    """
    share = weights / weights.sum()
    variance = share @ np.square(taught.world - share @ taught.world)
    return [LEAST_SHARE * np.sqrt(one) for one in taught.see_variance(variance, weights)]


def shared_time(blocks: list[np.ndarray]) -> np.ndarray:
    """(n,) time of all samples as the first frame that sees them has it."""
    time = blocks[0][:, 0].copy()
    for block in blocks[1:]:
        time = np.where(np.isnan(time), block[:, 0], time)
    return time


def windows_in_time(time: np.ndarray, n_components: int, overlap: float) -> np.ndarray:
    """Responsibilities (n, K) of Gaussian windows in the middle of K equal intervals of time (n,);
    overlap: their standard deviation in intervals.
    """
    interval = (time.max() - time.min()) / n_components
    if interval <= 0:
        raise ValueError(
            f"all samples have the time {time[0]:g}, there are no intervals; use partition='em' or"
            " fit, or give time in column 0"
        )
    centres = time.min() + interval * (0.5 + np.arange(n_components))
    return normalise_log(-0.5 * np.square((time[:, None] - centres) / (overlap * interval)))[0]


class TaskParameterisedMixture(EMEstimator, SavableModel):
    """Mixture of K components in P task frames over m features, of which column 0 is time.

    Fitted attributes: priors_ (K,), means_ (P, K, m), covariances_ (P, K, m, m), log_likelihood_
    (summed over samples and frames), n_iterations_, converged_. Where frames see different numbers
    of directions, means_ and covariances_ are lists of P arrays (K, d_p) and (K, d_p, d_p).

    Frames are given as P entries per demonstration: a TaskFrame or PartialFrame, a list of them
    with one for each sample, or None, in the list too, where the frame is missing.

    Parameters
    ----------
    n_components, covariance_floor, tolerance, max_iterations, n_starts
        As of `EMEstimator`.
    start
        "time" cuts the samples into K slices of equal weight along column 0 of the first frame
        that sees them, and needs no generator; "kmeans" clusters the samples as seen from all
        frames.
    n_shared
        Default 0. So many features, time and what else all frames pass through, count once in the
        product. With 0 it is (7.21) as it stands: P frames give P densities of the time, so a
        component is narrower in time by the root of P than it was learned, and what is retrieved
        changes abruptly from one to the next. Where they count once, the frames' regressions are
        multiplied, and responsibilities of components are those of one frame.
    covariance_prior
        Default 0, no prior. For few samples, as of `GaussianMixture`: in each frame each
        covariance is averaged with one that says that all columns vary alike and are not
        correlated, and this one counts as so many samples (inverse Wishart, Fraley and Raftery
        2007). The number of columns is a good weight where demonstrations are two or three.
    """

    def __init__(
        self,
        n_components: int,
        *,
        start: str = "time",
        covariance_floor: float = 1e-6,
        tolerance: float = 1e-6,
        max_iterations: int = 300,
        n_starts: int = 1,
        n_shared: int = 0,
        covariance_prior: float = 0.0,
    ):
        if start not in STARTS:
            raise ValueError(f"start must be one of {STARTS}, got {start!r}")
        if start == "time" and n_starts != 1:
            raise ValueError(
                f"start 'time' is always the same; n_starts {n_starts} needs start='kmeans'"
            )
        super().__init__(
            n_components,
            covariance_floor=covariance_floor,
            tolerance=tolerance,
            max_iterations=max_iterations,
            n_starts=n_starts,
        )
        self.start = start
        self.n_shared = as_count(n_shared, "n_shared", 0)
        self.covariance_prior = as_number(covariance_prior, "covariance_prior", strict=False)

    @classmethod
    def from_parameters(
        cls,
        priors: ArrayLike,
        means: Sequence[ArrayLike],
        covariances: Sequence[ArrayLike],
        n_shared: int = 0,
    ) -> TaskParameterisedMixture:
        """Mixture with priors (K,), and per frame means (K, d_p) and positive definite covariances
        (K, d_p, d_p). The features are as many as the largest d_p.

        Parameters
        ----------
        n_shared
            As of the class.

        Raises
        ------
        ValueError
            For other shapes or values.
        """
        priors, n_components = checked_priors(priors), len(priors)
        if len(means) == 0 or len(means) != len(covariances):
            raise ValueError(
                f"means and covariances must be given for each of P >= 1 frames, got {len(means)}"
                f" and {len(covariances)}"
            )
        centres = [as_samples(mean, f"means of frame {j}") for j, mean in enumerate(means)]
        for j, mean in enumerate(centres):
            if len(mean) != n_components:
                raise ValueError(
                    f"means of frame {j} must have shape ({n_components}, d), got {mean.shape}"
                )
        spreads = [
            as_covariances(one, f"covariances of frame {j}", (*mean.shape, mean.shape[1]))
            for j, (one, mean) in enumerate(zip(covariances, centres, strict=True))
        ]
        mixture = cls(n_components, n_shared=n_shared)
        mixture._set(Parameters(priors, centres, spreads), max(mean.shape[1] for mean in centres))
        return mixture

    def _set(self, parameters: Parameters, n_features: int) -> None:
        self.priors_, self._n_features = parameters.priors, n_features
        n_frames, n_components = len(parameters.means), len(parameters.priors)
        # Filled up with zeros where a frame sees fewer directions: an equation 0 = 0 says nothing.
        self._padded_means = np.zeros((n_frames, n_components, n_features))
        self._whiteners = np.zeros((n_frames, n_components, n_features, n_features))
        for j, (mean, covariance) in enumerate(
            zip(parameters.means, parameters.covariances, strict=True)
        ):
            d = mean.shape[1]
            self._padded_means[j, :, :d] = mean
            self._whiteners[j, :, :d, :d] = np.linalg.inv(
                cholesky(covariance, f"frame {j}: covariance of component")
            )
        alike = len({mean.shape[1] for mean in parameters.means}) == 1
        self.means_ = np.stack(parameters.means) if alike else parameters.means
        self.covariances_ = np.stack(parameters.covariances) if alike else parameters.covariances

    def _to_arrays(self) -> Arrays:
        self._require_fitted()
        arrays = {"priors": self.priors_, "n_features": np.array(self._n_features)}
        for j, (mean, covariance) in enumerate(zip(self.means_, self.covariances_, strict=True)):
            arrays |= {f"means.{j}": mean, f"covariances.{j}": covariance}
        return arrays

    def _from_arrays(self, arrays: Arrays) -> None:
        priors = array_of(arrays, "priors", (None,))
        n_frames = len(
            {name.split(".")[1] for name in arrays if name.startswith(("means.", "covariances."))}
        )
        checked_priors(priors)
        means = [array_of(arrays, f"means.{j}", (len(priors), None)) for j in range(n_frames)]
        covariances = [
            array_of(arrays, f"covariances.{j}", (*mean.shape, mean.shape[1]))
            for j, mean in enumerate(means)
        ]
        n_features = int(array_of(arrays, "n_features", ()))
        if not means or max(mean.shape[1] for mean in means) > n_features:
            raise ValueError(f"its {n_frames} frames do not fit {n_features} features")
        self._set(Parameters(priors, means, covariances), n_features)

    def _fitted_to(self) -> str:
        return (
            f"{len(self.priors_)} components in {self.n_frames} task frames"
            if hasattr(self, "priors_")
            else ""
        )

    @property
    def n_frames(self) -> int:
        self._require_fitted()
        return len(self.means_)

    @property
    def n_dims(self) -> int:
        """Number of features m in the world."""
        self._require_fitted()
        return self._n_features

    @property
    def _dims_of_frames(self) -> list[int]:
        self._require_fitted()
        return [mean.shape[1] for mean in self.means_]

    def fit(
        self,
        samples: Samples,
        frames: Frames,
        weights: Weights = None,
        *,
        rng: np.random.Generator | None = None,
        overlap: float | None = None,
    ) -> TaskParameterisedMixture:
        """EM on demonstrations (n_i, m) in the world with P frames each; weights per
        demonstration, per sample (a list of arrays), or None.

        Parameters
        ----------
        overlap
            If given, `fit_around` follows.

        Raises
        ------
        ValueError
            If rng is missing where centres are drawn.
        """
        if self.start == "kmeans" and rng is None:
            raise ValueError(
                "start='kmeans' draws random centres: pass rng=numpy.random.default_rng(seed)"
            )
        taught, weights = _with_weight(samples, frames, weights)
        fitted = self._run(
            taught.blocks,
            weights,
            self._starter(shared_time(taught.blocks), rng),
            least_scales(taught, weights),
        )
        self._set(fitted, taught.world.shape[1])
        return self if overlap is None else self._fit_around(taught, weights, overlap)

    def _starter(
        self, time: np.ndarray, rng: np.random.Generator | None
    ) -> Callable[[list[np.ndarray], np.ndarray], np.ndarray]:
        if self.start == "kmeans":
            assert rng is not None  # or `fit` would have complained
            return lambda blocks, weights: kmeans_start(
                np.nan_to_num(np.hstack(blocks)), weights, self.n_components, rng
            )
        return lambda blocks, weights: sliced_start(time, weights, self.n_components)

    def fit_in_time(
        self,
        samples: Samples,
        frames: Frames,
        weights: Weights = None,
        overlap: float = 0.7,
    ) -> TaskParameterisedMixture:
        """Components at equal intervals of time whose responsibilities depend on time alone: one
        weighted M step.

        No component can settle on a few demonstrations, as EM lets it when other inputs than time
        vary from one to the next, and there is no local optimum.

        Parameters
        ----------
        overlap
            Standard deviation of a component in units of the interval. A component in a gap of the
            stamps, which nothing belongs to, is dropped.
        samples
            (n_i, m) of each demonstration.
        """
        taught, weights = _with_weight(samples, frames, weights)
        overlap = as_number(overlap, "overlap", 1e-3, strict=False)
        time = shared_time(taught.blocks)
        return self._maximise(taught, weights, windows_in_time(time, self.n_components, overlap))

    def fit_around(
        self, samples: Samples, frames: Frames, weights: Weights = None, overlap: float = 0.7
    ) -> TaskParameterisedMixture:
        """Each component of a fitted mixture fitted anew to what lies around its time, in all
        demonstrations: one weighted M step.

        EM divides time as the movement asks for, but its components hardly overlap, so that what
        is retrieved changes abruptly from one to the next, and it may give one to a few
        demonstrations. Here responsibilities are those of Gaussians over time alone, at the times
        that EM found, and wider.

        Parameters
        ----------
        samples, frames, weights
            As in `fit`.
        overlap
            Standard deviation of a component in time, in units of the share of all time that EM
            gave to it, its prior. So components that shared a time are not wide each.
        """
        return self._fit_around(*_with_weight(samples, frames, weights), overlap)

    def _fit_around(
        self, taught: TaskSamples, weights: np.ndarray, overlap: float
    ) -> TaskParameterisedMixture:
        time = shared_time(taught.blocks)
        deviations = (
            as_number(overlap, "overlap", 1e-3, strict=False)
            * self.priors_
            * (time.max() - time.min())
        )
        off = (time[:, None] - self.means_[0][:, 0]) / deviations  # time is the same in all frames
        return self._maximise(
            taught, weights, normalise_log(-0.5 * np.square(off) - np.log(deviations))[0]
        )

    def _maximise(
        self, taught: TaskSamples, weights: np.ndarray, responsibilities: np.ndarray
    ) -> TaskParameterisedMixture:
        """One M step from responsibilities (n, K); components that nothing belongs to are dropped."""
        blocks, counts = taught.blocks, responsibilities * weights[:, None]
        counts = counts[:, counts.sum(0) > DEAD_SHARE * weights.mean()]
        scales = [
            column_scales(*one)
            for one in zip(
                blocks, [weights] * len(blocks), least_scales(taught, weights), strict=True
            )
        ]
        scaled = [
            (block - centre) / scale for block, (centre, scale) in zip(blocks, scales, strict=True)
        ]
        found = with_prior(
            maximisation(scaled, counts, self.covariance_floor),
            masses_of(scaled, counts),
            self.covariance_prior,
        )
        self._set(in_units(found, scales), taught.world.shape[1])
        return self

    def responsibilities(self, samples: Samples, frames: Frames) -> list[np.ndarray]:
        """Per demonstration, (n_i, K) posterior probability of each component.

        Parameters
        ----------
        samples
            (n_i, m) of each demonstration.
        frames
            For each demonstration its P task frames; one that moves is a list with a frame for
            each sample.
        """
        return self._per_demonstration(samples, frames, 0)

    def log_density(self, samples: Samples, frames: Frames) -> list[np.ndarray]:
        """Per demonstration, (n_i,) log of the mixture density, a product over the frames that see
        the sample.
        """
        return self._per_demonstration(samples, frames, 1)

    def _per_demonstration(self, samples: Samples, frames: Frames, which: int) -> list[np.ndarray]:
        seen = TaskSamples.of(samples, frames, self._dims_of_frames)
        parameters = Parameters(self.priors_, list(self.means_), list(self.covariances_))
        return seen.per_demonstration(expectation_at(seen.world, seen.blocks, parameters)[which])

    @property
    def n_parameters(self) -> int:
        """Free parameters, for model selection."""
        return (
            len(self.priors_)
            - 1
            + sum(n_free_parameters(len(self.priors_), d) for d in self._dims_of_frames)
        )

    def bic(
        self,
        samples: Samples,
        frames: Frames,
        weights: Weights = None,
    ) -> float:
        """Bayesian information criterion, lower is better; the sum of the weights counts as sample
        number.

        Parameters
        ----------
        samples, frames
            As of `responsibilities`.
        """
        log_density = self.log_density(samples, frames)
        weights = as_sample_weights(weights, [len(one) for one in log_density])
        return float(
            -2.0 * weights @ np.concatenate(log_density)
            + self.n_parameters * np.log(weights.sum())
        )

    def product(self, frames: Sequence[TaskFrame | PartialFrame | None]) -> GaussianMixture:
        """(7.21): the mixture in the world for new frames, P of them; None leaves a frame out of
        the product.
        """
        mean, covariance = self._products(self._situation(frames, 1))
        return GaussianMixture._made(self.priors_, mean[0], covariance[0])

    def regress(
        self,
        frames: Sequence[FrameCourse],
        inputs: ArrayLike,
        input_dims: ArrayLike,
        output_dims: ArrayLike,
        covariance: bool = True,
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Mean (n, o) and covariance (n, o, o) of the output features in new frames, given inputs
        (n, i) of the input features, as `mixture.regress`; a frame that moves is given by a list
        with one for each of the inputs. If covariance is False, None is returned in its place,
        which saves time.
        """
        still = [course for course in frames if not isinstance(course, Sequence)]
        if len(still) == len(frames):
            regression = Regression(self.product(still), input_dims, output_dims)
            return regression(inputs) if covariance else (regression.mean(inputs), None)
        inputs = as_samples(inputs, "inputs")
        products = self._products(self._situation(frames, len(inputs)))
        mean, spread = regress_each(self.priors_, *products, inputs, input_dims, output_dims)
        return mean, spread if covariance else None

    def _situation(self, frames: Sequence[FrameCourse], n: int) -> FrameSituation:
        name = "the new situation"
        rows = moments_of(frames, n, name, self.n_frames, (TaskFrame, PartialFrame))
        missing = [not any(row) for row in rows]
        if any(missing):
            raise ValueError(
                f"all task frames are missing at moment {missing.index(True)} of {name}; give one"
                " at least"
            )
        return FrameSituation.of(rows, self.n_dims, self._dims_of_frames)

    def _products(self, situation: FrameSituation) -> tuple[np.ndarray, np.ndarray]:
        """(7.21) at n moments: means (n, K, m) and covariances (n, K, m, m) in the world."""
        if self.n_shared:
            _require_shared(situation, self.n_shared)
        return frame_products(self._padded_means, self._whiteners, self.n_shared, situation)


def frame_products(
    means: np.ndarray, whiteners: np.ndarray, n_shared: int, situation: FrameSituation
) -> tuple[np.ndarray, np.ndarray]:
    """Products of the Gaussians that P frames see, mapped into the world (7.21): means (n, K, m)
    and covariances (n, K, m, m).

    A frame (A, b) whose Gaussian has the mean mu and the covariance L L' says of a point x of the
    world that L^-1 A^-1 (x - b) has the mean L^-1 mu and the covariance one. What all frames say
    is one least-squares problem in x - about, where `about` is the middle of the mapped means. It
    is solved by QR, so that no condition number is squared.

    Parameters
    ----------
    means : (P, K, m)
        As the frames see them; zero in directions that a frame does not see.
    whiteners : (P, K, m, m)
        L^-1, lower triangles; zero in such directions.
    n_shared
        So many features, the first, are asked of one frame only, and the others from all frames
        given these.

    Raises
    ------
    ValueError
        If the frames that are there do not tell a feature.
    """
    n, (_, k, m) = len(situation.seen), means.shape
    n_others = m - n_shared
    order = [*range(n_shared, m), *range(n_shared)]  # shared features are the last unknowns
    seen = situation.seen[:, :, None, None]
    mapped = means @ np.swapaxes(situation.A, -1, -2) + situation.b[:, :, None]
    about = (seen * mapped).sum(axis=1) / seen.sum(axis=1)
    rows = seen[..., None] * (whiteners @ situation.inverses[:, :, None])
    offsets = situation.b[:, :, None] - about[:, None]
    right = seen * (whiteners @ means[..., None])[..., 0] + (rows @ offsets[..., None])[..., 0]
    equations = np.concatenate([rows[..., order], right[..., None]], axis=-1)
    # Whiteners are lower triangles: the first rows of a frame are of the shared features alone,
    # and the others say what the rest is given them.
    others = np.moveaxis(equations[..., n_shared:, :], 1, 2).reshape(n, k, -1, m + 1)
    triangle = np.asarray(np.linalg.qr(others, mode="r"))[..., :n_others, :]
    first = equations[np.arange(n), situation.seen.argmax(axis=1)][..., :n_shared, :]
    triangle = np.concatenate([triangle, first], axis=-2)
    pivots = np.abs(np.diagonal(triangle, axis1=-2, axis2=-1))[..., :n_others]
    sizes = np.linalg.norm(triangle[..., :n_others, :n_others], axis=-2)
    told = (pivots > LEAST_PIVOT * sizes).all(axis=(0, 1))
    if not told.all():
        raise ValueError(
            f"the task frames that are there do not tell feature {order[int(told.argmin())]} of"
            " the world; give a frame that sees it"
        )
    root = np.empty((n, k, m, m))
    root[..., order, :] = np.linalg.inv(triangle[..., :m])
    mean = about + (root @ triangle[..., m:])[..., 0]
    return mean, symmetric(root @ np.swapaxes(root, -1, -2))


def _with_weight(
    samples: Samples, frames: Frames, weights: Weights
) -> tuple[TaskSamples, np.ndarray]:
    """The samples that have weight, and their weights."""
    taught = TaskSamples.of(samples, frames)
    weights = as_sample_weights(weights, taught.lengths)
    return taught.only(weights > 0), weights[weights > 0]


def _require_shared(situation: FrameSituation, n_shared: int) -> None:
    """ValueError unless all frames that are there pass the first features through, and leave them
    out of the others.
    """
    m = situation.A.shape[-1]
    if n_shared >= m:
        raise ValueError(
            f"n_shared is {n_shared}: of {m} features at least one must be left that frames see"
            " differently"
        )
    A, b = situation.A[situation.seen], situation.b[situation.seen]
    if (
        (A[:, :n_shared] != np.eye(m)[:n_shared]).any()
        or A[:, n_shared:, :n_shared].any()
        or b[:, :n_shared].any()
    ):
        raise ValueError(
            f"a task frame changes one of the first {n_shared} features, which all shall pass"
            " through; take a smaller n_shared"
        )
