"""A belt beside the simulated arm that carries a cup past it. The cup is a place that moves:
nothing touches it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ready_posture
from dart_skill.simulation._bullet import BulletClient
from dart_skill.simulation._guiding import smooth
from dart_skill.simulation._plant import LooseState, Plant, PlantState
from dart_skill.simulation._plant_settings import PlantSettings
from dart_skill.simulation._workbench import Pose

HAND_AT, HAND_TURN = (0.40, 0.0, 1.43), (0.0, -2.7832, 0.0)
"""Pose of a hand beside a belt, for arms without a posture `belt`: place [m] and rotation vector
[rad]. It is tilted by 0.36 rad.
"""
WAY = ("way_x", "way_y", "way_z")
"""Numbers of a situation that say how far the cup goes [m]."""
NUMBERS = (*WAY, "steady", "start", "duration", "tunnel")
"""Names of the numbers of a situation in the world of a belt: the fields of `Belt`, the way along
each axis.
"""
UPRIGHT = 0.01
"""Lean of a cup up to which it is upright [rad]."""
IN = 0.01
"""Distance from the middle of the cup up to which the hand is in it [m]."""
AROUND = 0.001
"""Time before and after an instant over which the speed of the cup is measured [s]."""


@dataclass(frozen=True)
class Belt:
    """How a belt carries a cup. Times are since the reset of the world [s].

    Parameters
    ----------
    begin
        Where the cup is at `start` (3,) [m].
    way
        From there in `duration` (3,) [m].
    turn
        Of the cup about the vertical [rad].
    steady
        It moves at constant speed, before and after, too; otherwise from rest to rest, by least
        jerk.
    start, duration
        Of the way [s].
    tunnel
        From then on no camera sees the cup [s].
    """

    begin: tuple[float, float, float] = (0.62, 0.0, 1.10)
    way: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: float = 0.0
    steady: bool = True
    start: float = 1.0
    duration: float = 2.4
    tunnel: float = np.inf

    def at(self, time: float) -> Pose:
        """Where the cup is then: the middle of its floor, its z axis up.

        Parameters
        ----------
        time
            Since the reset of the world [s].
        """
        return self.place(time), self._turned

    def place(self, time: float) -> np.ndarray:
        """The middle of its floor then (3,) [m].

        Parameters
        ----------
        time
            Since the reset of the world [s].
        """
        share = (time - self.start) / self.duration
        share = share if self.steady else smooth(share)
        return np.array(self.begin) + share * np.array(self.way)

    @cached_property
    def _turned(self) -> np.ndarray:
        quaternion = Rotation.from_rotvec([0.0, 0.0, self.turn]).as_quat()
        quaternion.flags.writeable = False
        return quaternion

    @classmethod
    def of(cls, cup: Pose | None, numbers: Mapping[str, float]) -> Belt:
        """The belt of a situation: where the cup is at `start`, and `NUMBERS`, as far as they
        differ from the defaults.

        Raises
        ------
        ValueError
            For a cup that leans, and for a way that takes no time.
        """
        own: dict[str, Any] = {
            name: float(value) for name, value in numbers.items() if name not in WAY
        }
        own["way"] = tuple(float(numbers.get(name, 0.0)) for name in WAY)
        own["steady"] = bool(own.get("steady", True))
        if cup is not None:
            turn = Rotation.from_quat(cup[1]).as_rotvec()
            if np.hypot(*turn[:2]) > UPRIGHT:
                raise ValueError(
                    f"the cup leans by {np.hypot(*turn[:2]):.2f} rad: on a belt it stands upright,"
                    " turned about z"
                )
            own |= {
                "begin": tuple(np.asarray(cup[0], dtype=float).tolist()),
                "turn": float(turn[2]),
            }
        if not own.get("duration", 1.0) > 0.0:
            raise ValueError(
                f"duration is {own['duration']} s: the way of the cup takes longer than nothing"
            )
        return cls(**own)


def _start() -> tuple[float, ...]:
    return ready_posture("belt", HAND_AT, HAND_TURN)


class Conveyor(Plant):
    """The arm beside a belt. `reset` begins a way of the cup, with an empty hand."""

    loose_body, movable_body, numbers = "cup", "cup", NUMBERS

    def __init__(self, settings: PlantSettings | None = None, seed: int = 0):
        self._belt = Belt()
        super().__init__(replace(settings or PlantSettings(), start_posture=_start()), seed)

    def change(self, settings: PlantSettings) -> None:
        """See `Plant`; the posture beside the belt stays."""
        super().change(replace(settings, start_posture=_start()))

    def set_up(
        self, poses: Mapping[str, Pose], numbers: Mapping[str, float] | None = None
    ) -> PlantState:
        """See `Plant`: the belt of `Belt.of`. Where nothing is said, it runs as before."""
        self._check_situation(poses, numbers or {})
        if poses or numbers:
            self._belt = Belt.of(poses.get("cup"), numbers or {})
        return self.reset()

    def put(self, role: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the cup somewhere at once: it stands there from now on.

        Parameters
        ----------
        position
            Of the cup (3,) [m].
        """
        self._check_situation([role])
        self._belt = Belt.of((position, quaternion), {})
        self._seen_loose = None

    @property
    def succeeded(self) -> bool:
        """Whether the hand is in the middle of the cup."""
        return float(np.linalg.norm(self.hand_position - self.cup[0])) < IN

    def run(self, belt: Belt) -> None:
        """From the next reset on the belt runs so."""
        self._belt = belt

    @property
    def time(self) -> float:
        """Since the reset [s]."""
        return self._step_count * self.settings.step

    @property
    def cup(self) -> Pose:
        """Where it is now."""
        return self._belt.at(self.time)

    @property
    def bodies(self) -> dict[str, Pose]:
        """True poses of what the cameras track; without a cup that is in a tunnel."""
        hand = {"hand": (self.hand_position, self.hand_quaternion)}
        return hand if self.time >= self._belt.tunnel else {**hand, "cup": self.cup}

    # what is different from an arm with a ball

    def _build_things(self, world: BulletClient) -> None:
        """The belt is beside what the arm can touch."""

    def _fill_hand(self) -> None:
        """The hand is empty."""
        self._held, self._free_at, self._just_freed, self._stuck = None, None, False, False

    def _look_at_loose(self) -> LooseState:
        """What the state says of a ball is said of the cup."""
        before, after = (self._belt.place(self.time + around) for around in (-AROUND, AROUND))
        return LooseState(
            *(tuple(part.tolist()) for part in (*self.cup, (after - before) / (2.0 * AROUND)))
        )

    def _act_on_ball(self) -> None:
        """Nothing acts on the cup but its belt."""
