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

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_learnable, as_samples, as_vector
from dart_skill.movement._frame_products import write_seen
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


def invert(matrices: np.ndarray) -> np.ndarray:
    """Inverses (s, d, m) of matrices (s, m, d), pseudo-inverses if d < m."""
    return (
        np.linalg.inv(matrices)
        if matrices.shape[1] == matrices.shape[2]
        else np.linalg.pinv(matrices)
    )


@dataclass(frozen=True, eq=False)
class Placement:
    """One task frame during all n samples.

    A (s, m, d) and b (s, m): its s different places.

    Parameters
    ----------
    place : (n,)
        Index of the place for each sample, -1 where the frame is missing.
    """

    A: np.ndarray
    b: np.ndarray
    place: np.ndarray

    @cached_property
    def inverses(self) -> np.ndarray:
        """(s, d, m)."""
        return invert(self.A)

    @property
    def n_dims(self) -> int:
        """Number of directions that the frame sees."""
        return self.A.shape[2]

    @property
    def seen(self) -> np.ndarray:
        """(n,) whether the frame is present in each sample."""
        return self.place >= 0

    def only(self, kept: np.ndarray) -> Placement:
        """The same for the samples of the mask kept (n,) only."""
        return replace(self, place=self.place[kept])

    def see(self, world: np.ndarray) -> np.ndarray:
        """World samples (n, m) as the frame sees them (n, d), nan where it is missing."""
        # By columns, as EM goes through them.
        columns = np.full((self.n_dims, len(world)), np.nan)
        write_seen(world, self.inverses, self.b, self.place, columns)
        return columns.T

    def see_variance(self, variance: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Variances (d,) in the frame from variances (m,) of independent columns in the world, the
        mean over samples with weights (n,).
        """
        # The first is of samples that the frame does not see.
        shares = np.bincount(self.place + 1, weights, 1 + len(self.A))[1:]
        return shares @ (np.square(self.inverses) @ variance) / shares.sum()


@dataclass(frozen=True, eq=False)
class FrameSituation:
    """P task frames at n moments.

    Parameters
    ----------
    A : (n, P, m, m)
    inverses : (n, P, m, m)
    b : (n, P, m)
    seen : (n, P)
        Whether the frame is present. Entries are zero for directions that a frame does not see,
        and for a missing frame.
    """

    A: np.ndarray
    inverses: np.ndarray
    b: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(
        cls, courses: Sequence[FrameCourse], n: int, n_features: int, n_dims: Sequence[int]
    ) -> FrameSituation:
        """The situation of P frames at n moments. Frame p must see n_dims[p] directions; at least
        one frame must be present.
        """
        _require_count(courses, len(n_dims), "the new situation")
        still = [course for course in courses if isinstance(course, TaskFrame)]
        if (
            n == 1
            and len(still) == len(courses)
            and {len(frame.b) for frame in still} | set(n_dims) == {n_features}
        ):
            return cls._at_rest(still)
        shape, m = (n, len(n_dims)), n_features
        situation = cls(
            np.zeros((*shape, m, m)),
            np.zeros((*shape, m, m)),
            np.zeros((*shape, m)),
            np.zeros(shape, dtype=bool),
        )
        for j, (course, d) in enumerate(zip(courses, n_dims, strict=True)):
            situation._put(j, _as_frames(course, n, f"task frame {j} of the new situation", m), d)
        there = situation.seen.any(1)
        if not there.all():
            raise ValueError(
                f"all task frames are missing at moment {int(there.argmin())} of the new"
                " situation; give one at least"
            )
        situation._invert(n_dims)
        return situation

    @classmethod
    def _at_rest(cls, frames: list[TaskFrame]) -> FrameSituation:
        """All frames are there, and see all directions: what is asked for most, in half the time."""
        A, b = np.array([[frame.A for frame in frames]]), np.array([[frame.b for frame in frames]])
        return cls(A, np.linalg.inv(A), b, np.ones((1, len(frames)), dtype=bool))

    def _put(self, j: int, course: list[Frame | None], n_dims: int) -> None:
        """Enter frame j, which is given once for all moments or once for each."""
        frames = [frame for frame in course if frame is not None]
        if not frames:
            return
        _require_dims(j, {frame.n_dims for frame in frames} | {n_dims})
        there = slice(None) if len(course) == 1 else [frame is not None for frame in course]
        self.A[there, j, :, :n_dims] = [frame.A for frame in frames]
        self.b[there, j] = [frame.b for frame in frames]
        self.seen[there, j] = True

    def _invert(self, n_dims: Sequence[int]) -> None:
        """Enter the inverses of all frames, at once where all see all directions."""
        if min(n_dims) == self.A.shape[-1] and self.seen.all():
            self.inverses[:] = np.linalg.inv(self.A)
            return
        for j, d in enumerate(n_dims):
            there = self.seen[:, j]
            self.inverses[there, j, :d] = invert(self.A[there, j, :, :d])


@dataclass(frozen=True, eq=False)
class TaskSamples:
    """Samples of all demonstrations in one array, with their task frames.

    Parameters
    ----------
    world : (n, m)
        The samples.
    placements
        Of each of the P frames.
    lengths
        Number of samples of each demonstration.
    """

    world: np.ndarray
    placements: list[Placement]
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
        lengths = [len(world) for world in worlds]
        placements = _as_placements(frames, lengths, worlds[0].shape[1], n_dims)
        unseen = ~np.any([placement.seen for placement in placements], axis=0)
        if unseen.any():
            i, row = _locate(int(unseen.argmax()), lengths)
            raise ValueError(
                f"sample {row} of demonstration {i} is seen by no task frame; leave it out or give"
                " a frame"
            )
        return cls(np.concatenate(worlds), placements, lengths)

    def only(self, kept: np.ndarray) -> TaskSamples:
        """The samples of the mask kept (n,); each frame must be present in some of them."""
        if kept.all() and all(placement.seen.any() for placement in self.placements):
            return self
        demonstrations = np.repeat(np.arange(len(self.lengths)), self.lengths)
        lengths = np.bincount(demonstrations[kept], minlength=len(self.lengths)).tolist()
        few = TaskSamples(self.world[kept], [one.only(kept) for one in self.placements], lengths)
        for j, placement in enumerate(few.placements):
            if not placement.seen.any():
                raise ValueError(
                    f"task frame {j} is missing from every sample with weight; leave it out of all"
                    " demonstrations"
                )
        return few

    @cached_property
    def blocks(self) -> list[np.ndarray]:
        """For each frame all samples as the frame sees them (n, d_p), nan where it is missing."""
        return [placement.see(self.world) for placement in self.placements]

    def per_demonstration(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (n, ...) of all samples as one array per demonstration."""
        return np.split(values, np.cumsum(self.lengths)[:-1])


def _locate(sample: int, lengths: list[int]) -> tuple[int, int]:
    """Index of the demonstration, and the row in it, of a sample in the array of all samples."""
    i = int(np.searchsorted(np.cumsum(lengths), sample, side="right"))
    return i, sample - sum(lengths[:i])


def _as_placements(
    frames: Frames, lengths: list[int], n_features: int, n_dims: Sequence[int] | None
) -> list[Placement]:
    """Placement of each of the P frames; lengths: number of samples of each demonstration."""
    n_frames = len(frames[0]) if n_dims is None else len(n_dims)
    for i, its_frames in enumerate(frames):
        _require_count(its_frames, n_frames, f"demonstration {i}")
    wanted: Sequence[int | None] = [None] * n_frames if n_dims is None else n_dims
    return [
        _as_placement(j, [its_frames[j] for its_frames in frames], lengths, n_features, wanted[j])
        for j in range(n_frames)
    ]


def _as_placement(
    j: int, courses: list[FrameCourse], lengths: list[int], n_features: int, n_dims: int | None
) -> Placement:
    frames: list[Frame] = []
    places: list[int] = []
    repeats: list[int] = []
    for i, (course, length) in enumerate(zip(courses, lengths, strict=True)):
        course = _as_frames(course, length, f"task frame {j} of demonstration {i}", n_features)
        repeats += [length] if len(course) == 1 else [1] * length
        for frame in course:
            if frame is None:
                places.append(-1)
            else:
                places.append(len(frames))
                frames.append(frame)
    found = {frame.n_dims for frame in frames} | ({n_dims} if n_dims else set()) or {n_features}
    _require_dims(j, found)
    matrices = np.reshape([frame.A for frame in frames], (len(frames), n_features, *found))
    offsets = np.reshape([frame.b for frame in frames], (len(frames), n_features))
    return Placement(matrices, offsets, np.repeat(places, repeats))


def _require_count(frames: Sequence[FrameCourse], n_frames: int, name: str) -> None:
    if len(frames) != n_frames or n_frames == 0:
        raise ValueError(
            f"{name} has {len(frames)} task frames, expected {n_frames or 'at least 1'}"
        )


def _require_dims(j: int, found: set[int]) -> None:
    if len(found) > 1:
        raise ValueError(
            f"task frame {j} must see as many directions everywhere, got {sorted(found)}"
        )


def _as_frames(course: FrameCourse, length: int, name: str, n_features: int) -> list[Frame | None]:
    """The frame as a list: one entry if it is given once for all samples, else `length` entries,
    one for each.
    """
    frames = list(course) if isinstance(course, Sequence) else [course]
    if isinstance(course, Sequence) and len(frames) != length:
        raise ValueError(f"{name} is given for {len(frames)} samples, there are {length}")
    for frame in frames:
        if frame is None:
            continue
        if not isinstance(frame, Frame):
            raise ValueError(
                f"{name} must be a TaskFrame, a PartialFrame or None, got {type(frame).__name__}"
            )
        if len(frame.b) != n_features:
            raise ValueError(
                f"{name} has {len(frame.b)} dimensions, the samples have {n_features}"
            )
    return frames
