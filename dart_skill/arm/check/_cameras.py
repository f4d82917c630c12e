"""What the cameras reach, and how noisy they are."""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmModel
from dart_skill.arm.check._heard import Grade, Heard, HeardPoses, Line, graded, line
from dart_skill.skills.observation import position_noise

RATE = 100.0
"""Frame rate of the cameras [Hz]."""
SEEN = 0.95
"""Share of the frames in which a body should be seen."""
TOO_FEW = 0.80
"""Share of the frames below which nothing may move."""
NOISE = 0.001
"""Standard deviation of a coordinate that is good [m]."""
TOO_NOISY = 0.005
"""Standard deviation of a coordinate above which nothing may move [m]."""
CELL = 0.25
"""Edge of the cells into which the swept volume is divided [m]."""
FEW = 20
"""Frames that a part needs to be named."""
DISCOVERY_NS = 200_000_000
"""Time at the ends of the listening in which frames may be missing: publishers are discovered
late.
"""
JUMP_NS = 600_000_000_000
"""Step of the stamps from which on it is another time base, and no gap."""
SILENT_NS = 100_000_000
"""Joint states that are farther apart than this were not heard in between, as where a simulation
was reset.
"""


def camera_lines(heard: Heard, model: ArmModel, joints_are_right: bool) -> list[Line]:
    """Reach and noise for each body."""
    lines = []
    for role, stream in heard.poses.items():
        if not len(stream):
            continue  # it is told that nothing came
        lines += [
            _reach(role, stream, heard, model if joints_are_right else None),
            _noise(role, stream),
        ]
    return lines


def _reach(role: str, stream: HeardPoses, heard: Heard, model: ArmModel | None) -> Line:
    asked, check = f"in {100 * SEEN:.0f} % of the frames", f"{role}: seen"
    stamps, states = stream.stamp_ns[stream.forward], heard.joints.stamp_ns[heard.joints.forward]
    if len(stamps) < 3:
        return line(
            check,
            Grade.NO_GO,
            "never",
            asked,
            "is it switched on and named as in config/world.yaml? are its markers seen?",
        )
    others = [one.stamp_ns for one in heard.poses.values() if len(one)]
    first, last = (states[0], states[-1]) if len(states) else (stamps[0], stamps[-1])
    # cameras may be discovered later than the arm
    first = max(first, min(int(one.min()) for one in others))
    if heard.simulated:
        # and simulated ones may be behind it when the listening ends
        last = max(int(one.max()) for one in others)
    lost = _lost(stamps, first, last)
    if len(states) > 1:  # what was lost while the arm was silent, too, is no fault of the cameras
        after = np.clip(np.searchsorted(states, lost), 1, len(states) - 1)
        lost = lost[states[after] - states[after - 1] < SILENT_NS]
    share = len(stamps) / max(1, len(stamps) + len(lost))
    where = (
        ""
        if model is None or not len(lost) or len(states) < 2
        else _lost_where(stamps, lost, heard, model)
    )
    remedy = (
        "turn or add cameras"
        + (f": {where}" if where else "")
        + (f"; put the {role} into the hand" if role == heard.in_hand else "")
    )
    return line(
        check,
        graded(1.0 - share, 1.0 - SEEN, 1.0 - TOO_FEW),
        f"in {100 * share:.1f} % of the frames",
        asked,
        remedy,
    )


def _lost(stamps: np.ndarray, first: int, last: int) -> np.ndarray:
    """Stamps of frames in which a body was not seen, between the first and the last instant [ns];
    frames of the discovery do not count.
    """
    period = round(1e9 / RATE)
    edges = [stamps]
    if DISCOVERY_NS < stamps[0] - first < JUMP_NS:
        edges.insert(0, np.array([first]))
    if DISCOVERY_NS < last - stamps[-1] < JUMP_NS:
        edges.append(np.array([last]))
    stamps = np.concatenate(edges)
    steps = np.diff(stamps)
    gaps = np.flatnonzero((steps > 1.5 * period) & (steps < JUMP_NS))
    missing = [np.arange(stamps[k] + period, stamps[k + 1] - period // 2, period) for k in gaps]
    return np.concatenate(missing) if missing else np.empty(0, dtype=np.int64)


def _lost_where(stamps: np.ndarray, lost: np.ndarray, heard: Heard, model: ArmModel) -> str:
    """In which part of the swept volume most frames were lost, in words: by where the hand was."""
    cells: dict[tuple[int, ...], list[int]] = {}
    for k, instants in enumerate((lost, stamps[:: max(1, len(stamps) // 1000)])):
        weight = 1 if k == 0 else max(1, len(stamps) // 1000)
        for place in _hands(instants, heard, model):
            count = cells.setdefault(tuple(np.floor(place / CELL).astype(int)), [0, 0])
            count[k] += weight
    cell, (gone, there) = max(cells.items(), key=lambda item: item[1][0])
    if gone < FEW:
        return ""
    x, y, z = CELL * (np.array(cell) + 0.5)
    return (
        f"lost in {100 * gone / (gone + there):.0f} % of the frames with the hand about ({x:.1f},"
        f" {y:.1f}, {z:.1f}) m"
    )


def _hands(stamps: np.ndarray, heard: Heard, model: ArmModel) -> np.ndarray:
    """Where the hand was (n, 3), by the joints."""
    joints = heard.joints
    forward = joints.forward
    q = np.column_stack(
        [
            np.interp(stamps, joints.stamp_ns[forward], column)
            for column in joints.position[forward].T
        ]
    )
    return np.array([model.hand_pose(row)[0] for row in q]).reshape(-1, 3)


def _noise(role: str, stream: HeardPoses) -> Line:
    forward = stream.forward & np.isfinite(stream.position).all(axis=1)
    asked = f"at most {1e3 * NOISE:.0f} mm"
    if np.count_nonzero(forward) < FEW:
        return line(
            f"{role}: noise", Grade.NO_GO, "too few frames", asked, "let the cameras see it"
        )
    time = (stream.stamp_ns[forward] - stream.stamp_ns[forward][0]) * 1e-9
    noise = position_noise(time, stream.position[forward])
    remedy = (
        "calibrate the cameras again; more markers, farther from each other; look for reflections"
    )
    return line(
        f"{role}: noise", graded(noise, NOISE, TOO_NOISY), f"{1e3 * noise:.2f} mm", asked, remedy
    )
