"""Frames of a bag and the transforms between them over time, as /tf and /tf_static tell them (REP
105, tf2).

As in tf2 a transform is interpolated between two messages and known neither before the first nor
after the last. One that never changes holds at all times.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.constants import NS_PER_S
from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    product,
    rotate,
    to_vectors,
    unit,
)
from dart_skill.recording.bags import BagReader, deserialize

LONGEST_GAP_NS = NS_PER_S
"""Longest time between two messages that a transform is interpolated over [ns]."""
SAME = 1e-9
"""Largest difference between transforms that are the same [m] and [1]."""


@dataclass(frozen=True, eq=False)
class FrameTransform:
    """Poses of a frame in its parent over time.

    Parameters
    ----------
    stamp_ns, log_ns
        When they are said to be and when they were recorded (n,) [ns].
    rows
        x, y, z, qx, qy, qz, qw of each (n, 7) [m].
    """

    stamp_ns: np.ndarray
    log_ns: np.ndarray
    rows: np.ndarray

    def at(self, instants: np.ndarray, by_log: bool) -> np.ndarray:
        """The pose (n, 7) at instants (n,) [ns], nan where it is not known.

        Parameters
        ----------
        by_log
            Whether they are log times instead of stamps.
        """
        if np.ptp(self.rows, axis=0).max() < SAME:
            return np.repeat(self.rows[:1], len(instants), axis=0)
        time, first = np.unique(self.log_ns if by_log else self.stamp_ns, return_index=True)
        rows = self.rows[first]
        after = np.clip(np.searchsorted(time, instants), 1, len(time) - 1)
        gap = time[after] - time[after - 1]
        share = ((instants - time[after - 1]) / gap)[:, None]
        before, later = rows[after - 1], rows[after]
        turn = to_vectors(product(later[:, 3:], before[:, 3:] * CONJUGATE))
        found = np.hstack(
            [
                (1.0 - share) * before[:, :3] + share * later[:, :3],
                product(from_vectors(share * turn), before[:, 3:]),
            ]
        )
        known = (instants >= time[0]) & (instants <= time[-1]) & (gap <= LONGEST_GAP_NS)
        return np.where(known[:, None], found, np.nan)


class FrameTree:
    """The frames of a bag.

    Parameters
    ----------
    transforms
        By names of parent and child.
    """

    def __init__(self, transforms: dict[tuple[str, str], FrameTransform]):
        self._transforms = transforms
        self._neighbours: defaultdict[str, list[str]] = defaultdict(list)
        for parent, child in transforms:
            self._neighbours[parent].append(child)
            self._neighbours[child].append(parent)

    def connects(self, frame: str, target: str) -> bool:
        """Whether transforms lead from one frame to another."""
        return bool(self._path(frame, target))

    def moved(
        self, rows: np.ndarray, frame: str, target: str, instants: np.ndarray, by_log: bool = False
    ) -> np.ndarray:
        """Poses in another frame (n, 7), nan where a transform between them is not known.

        Parameters
        ----------
        rows
            x, y, z, qx, qy, qz, qw of each pose (n, 7) in `frame` [m].
        frame, target
            Names of the two.
        instants
            Of the poses (n,) [ns].
        by_log
            Whether these are log times instead of stamps.

        Raises
        ------
        ValueError
            If nothing connects them.
        """
        path = self._path(frame, target)
        if not path:
            raise ValueError(f"no transform leads from '{frame}' to '{target}'")
        position, quaternion = rows[:, :3], rows[:, 3:]
        for one, following in pairwise(path):
            if (following, one) in self._transforms:
                pose = self._transforms[following, one].at(instants, by_log)
                position, quaternion = (
                    rotate(pose[:, 3:], position) + pose[:, :3],
                    product(pose[:, 3:], quaternion),
                )
            else:
                pose = self._transforms[one, following].at(instants, by_log)
                back = pose[:, 3:] * CONJUGATE
                position, quaternion = (
                    rotate(back, position - pose[:, :3]),
                    product(back, quaternion),
                )
        return np.hstack([position, quaternion])

    def _path(self, frame: str, target: str) -> list[str]:
        """Names of the frames from one to the other, both included; empty if nothing connects
        them.
        """
        reached = {frame: [frame]}
        for name in (waiting := [frame]):
            for neighbour in self._neighbours[name]:
                if neighbour not in reached:
                    reached[neighbour] = [*reached[name], neighbour]
                    waiting.append(neighbour)
        return reached.get(target, [])


def read_frame_tree(path: Path) -> FrameTree:
    """The frames of a bag, from every topic that is called tf or tf_static in whichever namespace;
    BagError.
    """
    told: defaultdict[tuple[str, str], list[tuple[int, int, Any]]] = defaultdict(list)
    with BagReader(path) as bag:
        topics = [
            name
            for name, one in bag.topics.items()
            if one.type_name.endswith("/TFMessage") and _is_tf(name)
        ]
        for message in bag.messages(topics, decode=False) if topics else ():
            for one in deserialize(bag.types, message.type_name, message.data).transforms:
                stamp = one.header.stamp.sec * NS_PER_S + one.header.stamp.nanosec
                edge = (
                    one.header.frame_id.removeprefix("/"),
                    one.child_frame_id.removeprefix("/"),
                )
                told[edge].append((stamp, message.stamp_ns, one.transform))
    found = {edge: _transform(of_this) for edge, of_this in told.items()}
    return FrameTree({edge: one for edge, one in found.items() if len(one.rows)})


def _is_tf(topic: str) -> bool:
    return topic.rsplit("/", 1)[-1] in ("tf", "tf_static")


def _transform(told: Iterable[tuple[int, int, Any]]) -> FrameTransform:
    """What was told of one transform, without what is no rotation."""
    stamps, log, contents = zip(*told, strict=True)
    parts = [(one.translation, one.rotation) for one in contents]
    rows = np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in parts])
    known = np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 3:]).max(axis=1) > 0.0)
    rows = rows[known]
    rows[:, 3:] = unit(rows[:, 3:])
    return FrameTransform(
        np.array(stamps, dtype=np.int64)[known], np.array(log, dtype=np.int64)[known], rows
    )
