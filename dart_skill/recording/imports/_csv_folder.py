"""Recordings as CSV files, for every program that reads tables; those of throws with a mapping, by
which they are read again.

The header names each column, with its unit. Numbers have as many digits as it takes to be read as
the same number again.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dart_skill.common.constants import NS_PER_S
from dart_skill.common.world import joint_names, pose_topic, the_world
from dart_skill.recording.bags import BagError, GraphBag
from dart_skill.recording.imports.bag_topics import filled_topics, read_topics
from dart_skill.recording.imports.joint_streams import JOINTS, JointStream
from dart_skill.recording.imports.mapping import OWN, PoseSource, RecordingMapping, SignalSource
from dart_skill.recording.imports.pose_stream import PoseStream
from dart_skill.recording.imports.throw_recording import ThrowRecording, read_recording

MAPPING = "mapping.yaml"
TIME = "time [s]"
POSE = ("x [m]", "y [m]", "z [m]", "qx", "qy", "qz", "qw")
STATES = "/joint_states"


def throws_to_csv(
    source: str | os.PathLike, output: str | os.PathLike, mapping: RecordingMapping | None = None
) -> ThrowRecording:
    """Write a recording of throws as a folder of CSV files and the mapping that reads them.

    Parameters
    ----------
    source, mapping
        As for `read_recording`.
    output
        Folder, which must not exist.

    Returns
    -------
    ThrowRecording
        What was read.
    """
    recording = read_recording(source, mapping)
    folder = Path(output)
    folder.mkdir(parents=True)
    keys: dict[str, Any] = {"frame": recording.frame_id}
    for role, stream in recording.bodies.items():
        keys[role] = _write_poses(folder, role, stream)
    if recording.joints is not None:
        keys["joints"] = _write_joints(folder, recording.joints)
    for name, taught in (("teacher", True), ("command", False)):
        if stamps := [one.stamp_ns for one in recording.openings if one.taught == taught]:
            _write(folder / f"{name}.csv", [TIME], ([seconds(stamp)] for stamp in stamps))
            keys[name] = {"csv": f"{name}.csv", "columns": {"time": TIME}}
    text = yaml.safe_dump(keys, sort_keys=False, allow_unicode=True, width=140)
    (folder / MAPPING).write_text(
        f"# dart-skill learn FOLDER --mapping FOLDER/{MAPPING}\n{text}", encoding="utf-8"
    )
    return recording


def bodies_to_csv(
    source: str | os.PathLike, output: str | os.PathLike, roles: Sequence[str]
) -> dict[str, int]:
    """Write poses of tracked bodies and joint states of a bag of ours as CSV files; the number of
    rows by file.

    Parameters
    ----------
    roles
        Of the bodies.
    output
        Folder, which must not exist.
    source
        The bag.

    Raises
    ------
    BagError
        If there are none.
    """
    poses, joints = _read_topics(source, roles)
    if not poses:
        raise BagError(f"{source}: no poses of {', '.join(roles)}: were the cameras recorded?")
    folder = Path(output)
    folder.mkdir(parents=True)
    for role, stream in poses.items():
        _write_poses(folder, role, stream)
    if joints is not None:
        _write_joints(folder, joints)
    counts = {f"{role}.csv": len(stream) for role, stream in poses.items()}
    return counts if joints is None else {**counts, "joints.csv": len(joints.stamp_ns)}


def seconds(stamp_ns: int) -> str:
    """A stamp [ns] in seconds, with all its digits."""
    return f"{stamp_ns // NS_PER_S}.{stamp_ns % NS_PER_S:09d}"


def _write_poses(folder: Path, role: str, stream: PoseStream) -> dict[str, Any]:
    rows = zip(
        map(seconds, stream.stamp_ns.tolist()),
        np.hstack([stream.position, stream.quaternion]).tolist(),
        strict=True,
    )
    _write(folder / f"{role}.csv", [TIME, *POSE], ([time, *row] for time, row in rows))
    return {
        "csv": f"{role}.csv",
        "columns": {"time": TIME, "position": list(POSE[:3]), "quaternion": list(POSE[3:])},
    }


def _write_joints(folder: Path, joints: JointStream) -> dict[str, Any]:
    names = joints.names or joint_names()
    position, velocity = (
        [f"{name} position [rad]" for name in names],
        [f"{name} velocity [rad/s]" for name in names],
    )
    rows = zip(
        map(seconds, joints.stamp_ns.tolist()),
        np.hstack([joints.position, joints.velocity]).tolist(),
        strict=True,
    )
    _write(
        folder / "joints.csv", [TIME, *position, *velocity], ([time, *row] for time, row in rows)
    )
    columns = {"time": TIME, "position": position, "velocity": velocity}
    return {
        "csv": "joints.csv",
        "columns": columns,
        **({"names": list(joints.names)} if joints.names else {}),
    }


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _read_topics(
    source: str | os.PathLike, roles: Sequence[str]
) -> tuple[dict[str, PoseStream], JointStream | None]:
    topics = {role: pose_topic(the_world().body(role)) for role in roles}
    with GraphBag(source) as bag:
        posed, states = filled_topics(bag, "PoseStamped"), filled_topics(bag, "JointState")
    bodies = {role: PoseSource(topic=topic) for role, topic in topics.items() if topic in posed}
    joints = SignalSource(STATES) if STATES in states else None
    mapping = replace(OWN, bodies=bodies, joints=joints, teacher=None, command=None)
    (found,) = read_topics(Path(source), mapping, 0, in_graph=True)
    poses = {}
    for role in bodies:
        one = found[role]
        poses[role] = PoseStream(role, one.stamps, one.rows[:, :3], one.rows[:, 3:], one.frame)
    return poses, found.get(JOINTS)
