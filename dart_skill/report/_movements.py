"""What a report tells of any skill but throws at baskets, gathered from its bag and from what
became of its trials.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.world import pose_topic, the_world
from dart_skill.recording import (
    HAND,
    BagError,
    BagReader,
    GraphBag,
    arm_rows,
    pose_rows,
    read_demonstrations,
    stamp_ns,
)
from dart_skill.report._run import About, Movement, Run, Stamped
from dart_skill.session import DartsRun, TrialResult
from dart_skill.skills.observation import worlds
from dart_skill.skills.protocol import Skill

FRAME_NS = 20_000_000
"""The bag is looked at in steps of so long: a replay has 25 pictures a second."""
JOINTS = "/joint_states"
"""Topic of the arm's joints."""
GUIDING = "/wam/teacher_wrench"
"""Topic of the wrench of a person's hand."""
SHORTEST = 0.5
"""A world that was set anew again after less is none in which something was done [s]."""
STILL = 0.02
"""A hand that stays so near to one place is not moved [m]; cameras see it there with some noise.
"""


def read_movements(
    bag: Path, skill: Skill, about: About, trials: Sequence[TrialResult], darts: DartsRun | None
) -> Run:
    """Everything that a bag tells of a run of a skill.

    Parameters
    ----------
    about
        What is known besides.
    trials
        What became of them, as they were judged in the run.
    darts
        Aims and points of darts, and the leg that was played after them.

    Raises
    ------
    BagError
        Says what is wrong with it.
    """
    shown = tuple(read_demonstrations(bag, skill.name))
    with GraphBag(bag) as reader:
        poses = {
            role: _rows(reader, pose_topic(the_world().body(role)), _pose_rows)
            for role in (HAND, *skill.bodies)
        }
        joints = _rows(reader, JOINTS, lambda messages: arm_rows(messages, "position"))
        guided = _stamps(reader, GUIDING)
    if not len(poses[HAND][0]):
        raise BagError(f"{bag}: no poses of the hand: record {pose_topic(the_world().hand_body)}")
    leg = () if darts is None or darts.leg is None else darts.leg.darts
    then = [f"501, dart {number}" for number in range(1, 1 + len(leg))]
    ids = [(one.stamp_ns, one.id) for one in shown]
    movements, notes = movements_of(poses[HAND], guided, ids, trials, then)
    return Run(
        bag, about, skill, shown, poses, joints, movements, tuple(trials), notes, darts=darts
    )


def movements_of(
    hand: Stamped,
    guided: np.ndarray,
    shown: Sequence[tuple[int, str]],
    trials: Sequence[TrialResult],
    then: Sequence[str],
) -> tuple[tuple[Movement, ...], tuple[str, ...]]:
    """What was done in each world, and what there is to say of it.

    Parameters
    ----------
    hand
        Poses of the hand.
    guided
        Stamps at which a person pushed the arm (n,) [ns].
    shown
        Stamp [ns] and name of each demonstration.
    trials
        What became of them.
    then
        What the arm did after them, such as "501, dart 1".
    """
    done = []
    for since, until in worlds([hand[0]]):
        own = bool(np.searchsorted(guided, since) == np.searchsorted(guided, until, side="right"))
        # In a world in which nothing guides the arm, and it rests, nothing was asked for.
        if until - since >= SHORTEST * 1e9 and not (own and _is_still(hand, since, until)):
            done.append((since, until, own))
    n_own = sum(own for *_, own in done)
    matched = n_own == len(trials) + len(then)
    numbered: list[tuple[str, TrialResult | None, int]] = (
        [
            *((f"trial {number}", one, number) for number, one in enumerate(trials, start=1)),
            *((name, None, 0) for name in then),
        ]
        if matched
        else [(f"movement {number}", None, 0) for number in range(1, n_own + 1)]
    )
    names, found = iter(numbered), []
    for since, until, own in done:
        if own:
            found.append(Movement(since, until, False, *next(names)))
        else:
            ids = [name for stamp, name in shown if since <= stamp <= until]
            found.append(Movement(since, until, True, ids[0] if ids else "an attempt that failed"))
    differ = (
        f"the bag holds {n_own} movements of the arm's own, and {len(trials)} trials were"
        " judged: they are not matched"
    )
    return tuple(found), ((differ,) if trials and not matched else ())


def _is_still(hand: Stamped, since: int, until: int) -> bool:
    """Whether the hand stayed where it was between two stamps [ns]."""
    stamps, poses = hand
    places = poses[
        np.searchsorted(stamps, since) : np.searchsorted(stamps, until, side="right"), :3
    ]
    return bool(np.linalg.norm(places - np.median(places, axis=0), axis=1).max() < STILL)


def _rows(reader: BagReader, topic: str, rows_of: Callable[[list[Any]], np.ndarray]) -> Stamped:
    """Rows of the messages of a topic, thinned, in order of time, each stamp once, without what is
    not finite.
    """
    if topic not in reader.topics:
        return np.empty(0, dtype=np.int64), np.empty((0, 7))
    messages = [item.data for item in reader.messages([topic], every_ns=FRAME_NS)]
    stamps = np.array([stamp_ns(one.header.stamp) for one in messages], dtype=np.int64)
    rows = rows_of(messages) if messages else np.empty((0, 7))
    unique, first = np.unique(stamps, return_index=True)
    kept = np.isfinite(rows[first]).all(axis=1)
    return unique[kept], rows[first][kept]


def _pose_rows(messages: list[Any]) -> np.ndarray:
    return np.hstack(pose_rows(messages))


def _stamps(reader: BagReader, topic: str) -> np.ndarray:
    """Stamps of the messages of a topic, thinned (n,) [ns]."""
    if topic not in reader.topics:
        return np.empty(0, dtype=np.int64)
    return np.sort(
        [stamp_ns(item.data.header.stamp) for item in reader.messages([topic], every_ns=FRAME_NS)]
    )
