"""What a report tells of a run of any skill but throws at baskets, gathered from its bag and from
what became of its trials.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dart_skill.common.world import pose_topic, the_world
from dart_skill.recording import (
    BagError,
    BagReader,
    GraphBag,
    arm_rows,
    pose_rows,
    read_demonstrations,
    stamp_ns,
)
from dart_skill.report._run import About, describe
from dart_skill.session import SkillResult
from dart_skill.skills.observation import worlds
from dart_skill.skills.protocol import HAND, Demonstration, Skill

FRAME_NS = 20_000_000
"""The bag is looked at in steps of so long: a replay has 25 pictures a second."""
JOINTS, GUIDING = "/joint_states", "/wam/teacher_wrench"
SHORTEST = 0.5
"""A world that was set anew again after less is none in which something was done [s]."""
STILL = 0.02
"""A hand that stays so near to one place is not moved [m]; cameras see it there with some noise.
"""
Stamped = tuple[np.ndarray, np.ndarray]
"""Stamps (n,) [ns], and a row of numbers for each (n, d)."""


@dataclass(frozen=True)
class Movement:
    """What was done between two resets of the world.

    * since, until: first and last stamp [ns]; guided: by a person.
    * name: of the demonstration that it became, or of the arm's own "trial 1", "trial 2", ...,
      "movement 1", ... where nobody judged them.
    * result: what became of a trial, if that is known.
    """

    since: int
    until: int
    guided: bool
    name: str
    result: SkillResult | None = None


@dataclass(frozen=True, eq=False)
class SkillRun:
    """Everything that the page is made of.

    * bag: that was read; about: what is known of the run beyond it; skill: of the run.
    * shown: the demonstrations.
    * poses: of hand and bodies by role, position and quaternion (n, 7); joints: of the arm, angles
      (n, 7).
    * movements: in order of time.
    * trials: as they were judged in the run; empty where only the bag is known.
    * notes: what is missing, and why.
    """

    bag: Path
    about: About
    skill: Skill
    shown: tuple[Demonstration, ...]
    poses: dict[str, Stamped]
    joints: Stamped
    movements: tuple[Movement, ...]
    trials: tuple[SkillResult, ...]
    notes: tuple[str, ...] = ()


def read_skill_run(
    bag: str | os.PathLike,
    skill: Skill,
    about: About | None = None,
    trials: Sequence[SkillResult] = (),
    then: Sequence[str] = (),
) -> SkillRun:
    """Everything that a bag tells of a run of a skill; BagError says what is wrong with it.

    trials: what became of them, as they were judged in the run. then: what the arm did after them,
    such as "501, dart 1". about: what is known besides.
    """
    bag = Path(bag)
    described = describe(bag, about or About(f"{skill.name.capitalize()}: a bag"))
    shown = tuple(read_demonstrations(bag, skill.name))
    with GraphBag(bag) as reader:
        poses = {
            role: _poses(reader, pose_topic(the_world().body(role)))
            for role in (HAND, *skill.bodies)
        }
        joints, guided = _joints(reader), _stamps(reader, GUIDING)
    if not len(poses[HAND][0]):
        raise BagError(f"{bag}: no poses of the hand: record {pose_topic(the_world().hand_body)}")
    movements, notes = _movements(poses[HAND], guided, shown, trials, then)
    return SkillRun(bag, described, skill, shown, poses, joints, movements, tuple(trials), notes)


def _movements(
    hand: Stamped,
    guided: np.ndarray,
    shown: Sequence[Demonstration],
    trials: Sequence[SkillResult],
    then: Sequence[str],
) -> tuple[tuple[Movement, ...], tuple[str, ...]]:
    """What was done in each world, and what there is to say of it."""
    done = [
        since_until
        for since_until in worlds([hand[0]])
        if since_until[1] - since_until[0] >= SHORTEST * 1e9
    ]
    own = [
        bool(np.searchsorted(guided, since) == np.searchsorted(guided, until, side="right"))
        for since, until in done
    ]
    # In a world in which nobody guides the arm, and it rests, nobody asked for anything.
    kept = [k for k, world in enumerate(done) if not (own[k] and _is_still(hand, *world))]
    done, own = [done[k] for k in kept], [own[k] for k in kept]
    matched = sum(own) == len(trials) + len(then)
    numbered = [(f"trial {number}", one) for number, one in enumerate(trials, start=1)] + [
        (name, None) for name in then
    ]
    names = iter(
        numbered
        if matched
        else [(f"movement {number}", None) for number in range(1, sum(own) + 1)]
    )
    found = []
    for (since, until), is_own in zip(done, own, strict=True):
        if is_own:
            found.append(Movement(since, until, False, *next(names)))
        else:
            ids = [one.id for one in shown if since <= one.stamp_ns <= until]
            found.append(Movement(since, until, True, ids[0] if ids else "an attempt that failed"))
    differ = (
        f"the bag holds {sum(own)} movements of the arm's own, and {len(trials)} trials were"
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


def _poses(reader: BagReader, topic: str) -> Stamped:
    if topic not in reader.topics:
        return np.empty(0, dtype=np.int64), np.empty((0, 7))
    messages = [item.data for item in reader.messages([topic], every_ns=FRAME_NS)]
    return _ordered(
        [stamp_ns(one.header.stamp) for one in messages],
        np.hstack(pose_rows(messages)) if messages else np.empty((0, 7)),
    )


def _joints(reader: BagReader) -> Stamped:
    if JOINTS not in reader.topics:
        return np.empty(0, dtype=np.int64), np.empty((0, 7))
    messages = [item.data for item in reader.messages([JOINTS], every_ns=FRAME_NS)]
    return _ordered(
        [stamp_ns(one.header.stamp) for one in messages], arm_rows(messages, "position")
    )


def _stamps(reader: BagReader, topic: str) -> np.ndarray:
    """Stamps of the messages of a topic, thinned (n,) [ns]."""
    if topic not in reader.topics:
        return np.empty(0, dtype=np.int64)
    return np.sort(
        [stamp_ns(item.data.header.stamp) for item in reader.messages([topic], every_ns=FRAME_NS)]
    )


def _ordered(stamps: Sequence[int], rows: np.ndarray) -> Stamped:
    """In order of time, each stamp once, without what is not finite."""
    unique, first = np.unique(np.array(stamps, dtype=np.int64), return_index=True)
    kept = np.isfinite(rows[first]).all(axis=1)
    return unique[kept], rows[first][kept]
