"""Frames of a bag and the transforms between them over time, as /tf and /tf_static tell them (REP
105, tf2).

As in tf2 a transform is interpolated between two messages and known neither before the first nor
after the last. One that never changes holds at all times.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

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

    def moved(
        self, rows: np.ndarray, frame: str, target: str, instants: np.ndarray, by_log: bool = False
    ) -> np.ndarray | None:
        """Poses in another frame (n, 7), nan where a transform between them is not known; None
        where nothing connects the two.

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
        """
        reached = {frame: [frame]}
        for name in (waiting := [frame]):
            for neighbour in self._neighbours[name]:
                if neighbour not in reached:
                    reached[neighbour] = [*reached[name], neighbour]
                    waiting.append(neighbour)
        if target not in reached:
            return None
        position, quaternion = rows[:, :3], rows[:, 3:]
        for one, following in pairwise(reached[target]):
            is_up = (following, one) in self._transforms
            edge = (following, one) if is_up else (one, following)
            pose = self._transforms[edge].at(instants, by_log)
            turn = pose[:, 3:] if is_up else pose[:, 3:] * CONJUGATE
            position = (
                rotate(turn, position) + pose[:, :3]
                if is_up
                else rotate(turn, position - pose[:, :3])
            )
            quaternion = product(turn, quaternion)
        return np.hstack([position, quaternion])


def read_frame_tree(path: Path) -> FrameTree:
    """The frames of a bag, from every topic that is called tf or tf_static in whichever namespace;
    BagError. What is no rotation is left out.
    """
    told: defaultdict[tuple[str, str], list[tuple]] = defaultdict(list)
    with BagReader(path) as bag:
        topics = [
            name
            for name, one in bag.topics.items()
            if one.type_name.endswith("/TFMessage")
            and name.rsplit("/", 1)[-1] in ("tf", "tf_static")
        ]
        for message in bag.messages(topics, decode=False) if topics else ():
            for one in deserialize(bag.types, message.type_name, message.data).transforms:
                stamp = one.header.stamp.sec * NS_PER_S + one.header.stamp.nanosec
                frames = one.header.frame_id, one.child_frame_id
                p, q = one.transform.translation, one.transform.rotation
                row = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
                if np.isfinite(row).all() and any(row[3:]):
                    edge = frames[0].removeprefix("/"), frames[1].removeprefix("/")
                    told[edge].append((stamp, message.stamp_ns, row))
    found = {}
    for edge, of_this in told.items():
        stamps, log, several = zip(*of_this, strict=True)
        rows = np.array(several, dtype=float)
        rows[:, 3:] = unit(rows[:, 3:])
        found[edge] = FrameTransform(np.array(stamps), np.array(log), rows)
    return FrameTree(found)
