"""Where the task frames are during the samples: one place for a demonstration or one for each
sample; a frame may be missing.

A frame (A, b) sees a point x of the world at A^-1 (x - b) (thesis 7.5.2). If A (m, d) has fewer
columns than rows, the frame sees d of the m directions, and the pseudo-inverse takes the place of
the inverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_learnable, as_samples, as_vector
from dart_skill.movement._frames import TaskFrame


@dataclass(frozen=True, eq=False)
class PartialFrame:
    """Task frame that sees only d directions of the m features. It says nothing about the other
    directions.

    Parameters
    ----------
    A : (m, d)
        Independent columns, the directions that it sees. The first feature is time here, too.
    b : (m,)
        Origin of the frame in the world.
    """

    A: np.ndarray
    b: np.ndarray

    def __post_init__(self) -> None:
        matrix = as_samples(self.A, "A")
        lengths = np.linalg.norm(matrix, axis=0)
        if lengths.min() == 0 or np.linalg.matrix_rank(matrix / lengths) < matrix.shape[1]:
            raise ValueError(
                "A must have independent columns, as many as it has rows at most, got"
                f" {matrix.tolist()}"
            )
        object.__setattr__(self, "A", matrix)
        object.__setattr__(self, "b", as_vector(self.b, "b", len(matrix)))

    @property
    def n_dims(self) -> int:
        """Number of directions that it sees."""
        return self.A.shape[1]


Frame = TaskFrame | PartialFrame
FrameCourse = Frame | Sequence[Frame | None] | None
"""A frame during a demonstration: one for the whole of it, or one for each sample; None where it
is missing.
"""
Samples = Sequence[ArrayLike]
"""(n_i, m) of each demonstration."""
Frames = Sequence[Sequence[FrameCourse]]
"""P frames for each demonstration."""
Weights = Sequence[ArrayLike] | np.ndarray | None
"""One number for each demonstration, or one array (n_i,) for each; None if all samples count
alike.
"""


def moments_of(
    courses: Sequence[Any], n: int, name: str, n_frames: int | None, kinds: Sequence[type]
) -> list[tuple]:
    """P frames at each of n moments, None where one is missing; at a single moment if none moves.

    Parameters
    ----------
    courses
        Frames of these kinds: one for all moments, or a list with one for each.
    name
        For messages.
    n_frames
        P, None for any number.

    Raises
    ------
    ValueError
        For other frames, or another number of them.
    """
    if len(courses) == 0 or len(courses) != (n_frames or len(courses)):
        raise ValueError(
            f"{name} has {len(courses)} task frames, expected {n_frames or 'at least 1'}"
        )
    columns = [list(one) if isinstance(one, Sequence) else [one] for one in courses]
    for j, (course, column) in enumerate(zip(courses, columns, strict=True)):
        if isinstance(course, Sequence) and len(column) != n:
            raise ValueError(
                f"task frame {j} of {name} is given for {len(column)} samples, there are {n}"
            )
        for frame in column:
            if frame is not None and not isinstance(frame, tuple(kinds)):
                known = ", a ".join(kind.__name__ for kind in kinds)
                raise ValueError(
                    f"task frame {j} of {name} must be a {known} or None, got"
                    f" {type(frame).__name__}"
                )
    n_moments = max(len(column) for column in columns)
    return list(zip(*(column * (n_moments // len(column)) for column in columns), strict=True))


@dataclass(frozen=True, eq=False)
class FrameSituation:
    """P task frames at n moments. Entries are zero for directions that a frame does not see, and
    for a missing frame.

    Parameters
    ----------
    A : (n, P, m, m)
    b : (n, P, m)
    seen : (n, P)
        Whether the frame is present.
    n_dims
        Number of directions that each frame sees.
    """

    A: np.ndarray
    b: np.ndarray
    seen: np.ndarray
    n_dims: list[int]

    @classmethod
    def of(
        cls,
        moments: Sequence[Sequence[Frame | None]],
        n_features: int,
        n_dims: Sequence[int] | None = None,
    ) -> FrameSituation:
        """From P frames at each moment, as of `moments_of`; frame p must see n_dims[p] directions
        if that is given, and as many at all moments in any case.
        """
        n, m = len(moments), n_features
        A, b = np.zeros((n, len(moments[0]), m, m)), np.zeros((n, len(moments[0]), m))
        seen, dims = np.array([[frame is not None for frame in row] for row in moments]), []
        for j, column in enumerate(zip(*moments, strict=True)):
            frames = [frame for frame in column if frame is not None]
            for frame in frames:
                if len(frame.b) != m:
                    raise ValueError(
                        f"task frame {j} has {len(frame.b)} dimensions, the samples have {m}"
                    )
            found = {frame.n_dims for frame in frames} | ({n_dims[j]} if n_dims else set())
            if len(found) > 1:
                raise ValueError(
                    f"task frame {j} must see as many directions everywhere, got {sorted(found)}"
                )
            dims.append(min(found, default=m))
            if frames:
                A[seen[:, j], j, :, : dims[j]] = [frame.A for frame in frames]
                b[seen[:, j], j] = [frame.b for frame in frames]
        return cls(A, b, seen, dims)

    @cached_property
    def inverses(self) -> np.ndarray:
        """(n, P, m, m), pseudo-inverses where a frame sees less than all directions."""
        whole = self.seen.all() and min(self.n_dims) == self.b.shape[-1]
        return np.linalg.inv(self.A) if whole else np.linalg.pinv(self.A)


@dataclass(frozen=True, eq=False)
class TaskSamples:
    """Samples of all demonstrations in one array, with their task frames.

    Parameters
    ----------
    world : (n, m)
        The samples.
    frames
        Of all moments that differ.
    moment : (n,)
        At which of these each sample is.
    lengths
        Number of samples of each demonstration.
    """

    world: np.ndarray
    frames: FrameSituation
    moment: np.ndarray
    lengths: list[int]

    @classmethod
    def of(
        cls, samples: Samples, frames: Frames, n_dims: Sequence[int] | None = None
    ) -> TaskSamples:
        """From samples (n_i, m) and P frames for each demonstration, checked.

        Parameters
        ----------
        n_dims : (P,)
            Number of directions of each frame.
        """
        if len(samples) == 0 or len(samples) != len(frames):
            raise ValueError(
                f"one list of frames per demonstration is needed, got {len(frames)} for"
                f" {len(samples)}"
            )
        worlds = [
            as_learnable(one, f"samples of demonstration {i}") for i, one in enumerate(samples)
        ]
        for i, world in enumerate(worlds):
            if world.shape[1] != worlds[0].shape[1]:
                raise ValueError(
                    f"demonstration {i} has {world.shape[1]} columns, the first has"
                    f" {worlds[0].shape[1]}"
                )
        rows: list = []
        moment: list = []
        n_frames = len(frames[0]) if n_dims is None else len(n_dims)
        for i, (courses, world) in enumerate(zip(frames, worlds, strict=True)):
            own = moments_of(
                courses, len(world), f"demonstration {i}", n_frames, (TaskFrame, PartialFrame)
            )
            moment.append(len(rows) + np.arange(len(world)) * (len(own) > 1))
            rows += own
            unseen = [not any(row) for row in own]
            if any(unseen):
                raise ValueError(
                    f"sample {unseen.index(True)} of demonstration {i} is seen by no task frame;"
                    " leave it out or give a frame"
                )
        situation = FrameSituation.of(rows, worlds[0].shape[1], n_dims)
        lengths = [len(world) for world in worlds]
        return cls(np.concatenate(worlds), situation, np.concatenate(moment), lengths)

    def only(self, kept: np.ndarray) -> TaskSamples:
        """The samples of the mask kept (n,); each frame must be present in some of them."""
        demonstrations = np.repeat(np.arange(len(self.lengths)), self.lengths)
        lengths = np.bincount(demonstrations[kept], minlength=len(self.lengths)).tolist()
        few = replace(self, world=self.world[kept], moment=self.moment[kept], lengths=lengths)
        missing = ~self.frames.seen[few.moment].any(axis=0)
        if missing.any():
            raise ValueError(
                f"task frame {int(missing.argmax())} is missing from every sample with weight;"
                " leave it out of all demonstrations"
            )
        return few

    @cached_property
    def blocks(self) -> list[np.ndarray]:
        """For each frame all samples as the frame sees them (n, d_p), nan where it is missing."""
        blocks = []
        for j, d in enumerate(self.frames.n_dims):
            inverses = self.frames.inverses[:, j, :d][self.moment]
            local = np.einsum("nij,nj->ni", inverses, self.world - self.frames.b[self.moment, j])
            blocks.append(np.where(self.frames.seen[self.moment, j, None], local, np.nan))
        return blocks

    def see_variance(self, variance: np.ndarray, weights: np.ndarray) -> list[np.ndarray]:
        """Variances (d_p,) in each frame from variances (m,) of independent columns in the world,
        the mean over samples with weights (n,).
        """
        shares = np.bincount(self.moment, weights, len(self.frames.seen))[:, None]
        shares = shares * self.frames.seen
        seen = np.einsum("np,npij,j->pi", shares, np.square(self.frames.inverses), variance)
        return [
            one[:d] / share.sum()
            for one, share, d in zip(seen, shares.T, self.frames.n_dims, strict=True)
        ]

    def per_demonstration(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (n, ...) of all samples as one array per demonstration."""
        return np.split(values, np.cumsum(self.lengths)[:-1])
