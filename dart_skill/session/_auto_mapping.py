"""A mapping that is found: roles by the names of topics, and what mends a disagreement of
joints and cameras.
"""

from __future__ import annotations

import os
from dataclasses import replace

from dart_skill.recording import BagError, BagReader
from dart_skill.recording.imports import (
    OWN,
    POSE_TYPES,
    PoseSource,
    RecordingMapping,
    SignalSource,
    filled_topics,
    read_recording,
    with_remedies,
)
from dart_skill.session._disagreement import Disagreement, disagreement


def auto_mapping(path: str | os.PathLike) -> tuple[RecordingMapping, Disagreement | None]:
    """The mapping by which a bag reads right, and what was mended; None where joints and cameras
    agree without it.

    Parameters
    ----------
    path
        Of the bag.

    Raises
    ------
    BagError
        For a bag whose topics do not tell what is what, ValueError for a disagreement that no
        mapping mends.
    """
    named = _by_names(path)
    named = with_remedies(
        named, (fault for fault in read_recording(path, named).faults if fault.is_of_time)
    )
    found = disagreement(path, named)
    if found is not None and found.mapping is None:
        raise ValueError(f"{path}: {found}")
    return (named if found is None or found.mapping is None else found.mapping), found


def _by_names(path: str | os.PathLike) -> RecordingMapping:
    """Our own topics where they are there; else for each role the only topic with poses that has
    its name in it.
    """
    with BagReader(path) as bag:
        topics = {name: topic for name, topic in bag.topics.items() if topic.count}
        posed, states = filled_topics(bag, *POSE_TYPES), filled_topics(bag, "JointState")
    bodies = {
        role: where if where.topic in topics else PoseSource(topic=_pose_topic(path, posed, role))
        for role, where in OWN.bodies.items()
    }
    joints = (
        "/joint_states"
        if "/joint_states" in states
        else max(states, key=lambda name: topics[name].count, default="")
    )
    signals = {name: where for name, where in OWN.signals.items() if where.topic in topics}
    return replace(
        OWN,
        bodies=bodies,
        joints=SignalSource(joints) if joints else None,
        teacher=signals.get("teacher"),
        command=signals.get("command"),
    )


def _pose_topic(path: str | os.PathLike, posed: list[str], role: str) -> str:
    named = [name for name in posed if role in name.lower()]
    if len(named) != 1:
        which = (
            f"several topics are called so: {', '.join(named)}"
            if named
            else f"no topic with poses is called so: {', '.join(posed) or 'none'}"
        )
        raise BagError(f"{path}: where is the {role}? {which}; name it in a mapping")
    return named[0]
