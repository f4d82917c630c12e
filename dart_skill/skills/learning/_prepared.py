"""One demonstration as numbers to learn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dart_skill.arm import ArmModel, Grip, Sightings
from dart_skill.common.situation import Situation
from dart_skill.recording import HAND, Demonstration, Track
from dart_skill.skills.learning._pose_features import pose_features
from dart_skill.skills.observation import sightings
from dart_skill.skills.protocol import Skill

RATE = 100.0
"""Rate of the samples that are learned from [1/s]."""
BEFORE = 0.1
"""The hand is recorded for so long before a movement starts, at least [s]: derivatives there need
it.
"""


@dataclass(frozen=True, eq=False)
class PreparedMovement:
    """A movement, from when it starts to when it stops.

    Parameters
    ----------
    id
        Str, of the demonstration.
    situation
        For which it is right.
    time, poses, features
        Of the whole recording, (n,) [s] from the start of the movement on, positions and
        quaternions (n, 7), and what is learned of them (n, 9).
    duration
        From start to stop [s].
    told
        What the fingers were told, (instant from the start on [s], grip).
    joint_time, joint_position
        (k,) [s] from the start on, (k, 7) [rad]; k = 0 if they were not recorded.
    sightings
        The hand at some instants as cameras and arm say.
    bodies
        Tracks of the bodies that the skill reacts to, by role, on the clock of `time`; of other
        skills none.
    """

    id: str
    situation: Situation
    time: np.ndarray
    poses: np.ndarray
    features: np.ndarray
    duration: float
    told: tuple[tuple[float, Grip], ...]
    joint_time: np.ndarray
    joint_position: np.ndarray
    sightings: Sightings
    bodies: Mapping[str, Track]

    @property
    def after(self) -> float:
        """How long the recording goes on after the movement [s]."""
        return float(self.time[-1]) - self.duration

    @property
    def in_words(self) -> str:
        """What was found, in a line."""
        return (
            f"a movement of {self.duration:.1f} s, {len(self.told)} times the fingers were told"
            " something"
        )

    def postures(self, time: np.ndarray) -> np.ndarray:
        """Joints (n, 7) [rad] at instants (n,) from the start on [s]; those of the ends before and
        after.
        """
        return np.column_stack(
            [np.interp(time, self.joint_time, column) for column in self.joint_position.T]
        )


def prepare_movement(
    skill: Skill, demonstration: Demonstration, arm: ArmModel
) -> PreparedMovement:
    """ValueError names the demonstration and what is wrong with it. arm: model of the arm."""
    try:
        return _prepare(skill, demonstration, arm)
    except ValueError as error:
        raise ValueError(f"demonstration {demonstration.id}: {error}") from error


def _prepare(skill: Skill, demonstration: Demonstration, arm: ArmModel) -> PreparedMovement:
    d, hand = demonstration, demonstration.track(HAND)
    start, stop = skill.cut(d)
    if not hand.time[0] + BEFORE <= start < stop <= hand.time[-1]:
        recorded = f"from {hand.time[0]:.3f} to {hand.time[-1]:.3f} s"
        raise ValueError(
            f"the movement is from {start:.3f} to {stop:.3f} s, but the hand was recorded"
            f" {recorded}: record more before and after"
        )
    if stop - start < skill.settings.shortest:
        raise ValueError(
            f"the movement takes {stop - start:.2f} s; shorter ones than {skill.settings.shortest}"
            " s are none (shortest)"
        )
    first, last = start - 5 * BEFORE, stop + 2 * skill.settings.settle + BEFORE
    near = (hand.time >= first) & (hand.time <= last)
    return PreparedMovement(
        id=d.id,
        situation=skill.achieved(d, skill.situation(d, start)),
        time=hand.time[near] - start,
        poses=np.hstack([hand.position[near], hand.quaternion[near]]),
        features=pose_features(hand.position[near], hand.quaternion[near]),
        duration=stop - start,
        told=tuple((one.time - start, one.grip) for one in d.events if start <= one.time <= stop),
        joint_time=d.joint_time - start,
        joint_position=d.joint_position,
        sightings=sightings(d, arm),
        bodies={
            role: _since(role, d.track(role), start, first, last)
            for role in skill.bodies
            if skill.reacts
        },
    )


def _since(role: str, track: Track, start: float, first: float, last: float) -> Track:
    """What was seen of a body from the first to the last of two instants [s], on the clock of a
    movement that starts then [s].
    """
    near = (track.time >= first) & (track.time <= last)
    if not near.any():
        raise ValueError(
            f"the {role} was not seen from {first:.3f} to {last:.3f} s, and the movement reacts to"
            " it: record it all the time"
        )
    return Track(track.time[near] - start, track.position[near], track.quaternion[near])
