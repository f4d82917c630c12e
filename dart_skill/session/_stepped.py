"""Worlds in one process whose arm does, frame by frame, what somebody else decides: where the hand
is in the next frame, and whether it opens. What is observed is laid out as in a LeRobot dataset
(`write_lerobot`), so that a policy which was trained elsewhere can be tried here.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dart_skill.arm import (
    Grip,
    Guidance,
    HandState,
    Mode,
    PoseGains,
    Reference,
    Speed,
)
from dart_skill.common.constants import UNTURNED
from dart_skill.common.quaternions import (
    CONJUGATE,
    from_vectors,
    matrices,
    of_matrices,
    product,
    to_vectors,
    unit,
)
from dart_skill.common.situation import Situation
from dart_skill.movement import critical_damping
from dart_skill.recording import HAND
from dart_skill.session._bench_and_belt import BenchSession
from dart_skill.session._in_process import Session
from dart_skill.session._step_loop import StepLoop, no_push
from dart_skill.skills.observation import Stream
from dart_skill.skills.protocol import Skill

STIFFNESS = 400.0
"""Stiffness of the pull of the hand per unit mass, critically damped [1/s^2]."""
CLOSED = 0.15
"""Fingers have closed so long after they were told [s]."""
LOOKED_NS = 500_000_000
"""The bodies are looked at for so long before the arm begins [ns]."""
SEEN_NS = 50_000_000
"""A body whose newest pose is older is not seen [ns]."""
AFTER = 1.5
"""What comes of a movement is seen so long after the hand was told to open [s]."""


class PoseGuide:
    """A `Guide` along poses that are told one after the other: the hand moves to each within a
    period.

    Parameters
    ----------
    start_posture
        Joint angles of now (n,) [rad].
    start
        Pose of the hand now (7,).
    period
        From one pose to the next [s].
    speed
        Level of speed that the movement needs.
    carries
        Whether the hand holds something at the start.
    """

    what = "policy"

    def __init__(
        self,
        start_posture: np.ndarray,
        start: np.ndarray,
        period: float,
        speed: Speed,
        carries: bool,
    ):
        self.start_posture, self.speed = start_posture, speed
        self._period = period
        self._from = self._to = start
        self._told_at = -period
        self._grip, self._grip_at = (Grip.CLOSE if carries else Grip.UNSPECIFIED), -CLOSED
        damping = float(critical_damping(STIFFNESS))
        self._lead = damping / STIFFNESS
        self._gains = PoseGains.of((STIFFNESS, damping), (STIFFNESS, damping))
        self._now = 0.0

    def tell(self, pose: np.ndarray, opens: bool) -> None:
        """Where the hand is a period from now (7,), and whether it opens."""
        self._from, self._to = self._to, np.concatenate([pose[:3], unit(pose[3:])])
        self._told_at = self._now
        grip = Grip.OPEN if opens else Grip.CLOSE
        if grip != self._grip:
            self._grip, self._grip_at = grip, self._now

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """See `Guide`: what is seen is the business of who tells the poses."""

    def look(self, time: float, hand: HandState, stamp_ns: int) -> Guidance:
        """See `Guide`."""
        self._now = time
        share = (time - self._told_at) / self._period
        turn = to_vectors(product(self._to[3:], CONJUGATE * self._from[3:]))
        way = np.concatenate([self._to[:3] - self._from[:3], turn])
        moves = share < 1.0
        share = min(share, 1.0)
        velocity = way / self._period if moves else np.zeros(6)
        position = self._from[:3] + share * way[:3]
        rotation = matrices(product(from_vectors(share * turn), self._from[3:]))
        ahead = self._lead * velocity
        return Guidance(
            time=time,
            reference=Reference(
                position + ahead[:3],
                matrices(from_vectors(ahead[3:])) @ rotation,
                position,
                rotation,
                velocity,
                np.zeros(6),
            ),
            gains=self._gains,
            grip=self._grip,
            carries=self._grip == Grip.CLOSE and time - self._grip_at >= CLOSED,
            off=math.dist(position, hand.position),
            over=False,
        )


class Stepped(StepLoop):
    """What worlds that are stepped frame by frame have in common; `begin` comes first.

    Attributes: done, whether the movement is over; message, why the arm was stopped, or empty.
    """

    roles: tuple[str, ...]
    speed = Speed.CAREFUL
    carries = False

    def put(self, situation: Situation) -> None:
        """The world is reset, with the bodies where a situation has them, and looked at."""
        raise NotImplementedError

    @property
    def succeeded(self) -> bool:
        """Whether the task is done, by the simulator."""
        raise NotImplementedError

    def begin(self, situation: Situation, fps: float) -> None:
        """The arm waits for the first action in a situation; so many follow per second."""
        self.put(situation)
        self._frame_states = round(1.0 / fps / self.plant.settings.step)
        arm = self.plant.arm_state
        hand = self.commander.model.hand_state(arm.position, arm.velocity)
        start = np.concatenate([hand.position, of_matrices(hand.rotation)])
        self._guide = PoseGuide(arm.position.copy(), start, 1.0 / fps, self.speed, self.carries)
        self._opened: float | None = None
        self._closed = self.carries
        self.commander.follow(self._guide)
        ready = Mode.EXECUTING
        self._step_until(
            no_push, lambda: self.commander.mode == ready, lambda: self.plant.state_stamp_ns
        )
        self._deliver()

    def act(self, action: np.ndarray) -> None:
        """Go on for a frame.

        Parameters
        ----------
        action
            Pose of the hand in the next frame, and 1 where it opens (8,).
        """
        opens = bool(action[-1] > 0.5)
        if opens and self._closed and self._opened is None:
            self._opened = self.commander.time
        self._closed = not opens
        self._guide.tell(np.asarray(action[:7], dtype=float), opens)
        for _ in range(self._frame_states):
            arm = self.plant.arm_state
            self._sense(arm)
            for answer in self._answer(arm, no_push):
                if answer is not None:
                    self._hear(answer)
            self.steps += 1
        self._deliver()

    @property
    def message(self) -> str:
        return "" if self.commander.mode == Mode.EXECUTING else self.commander.message or "stopped"

    @property
    def done(self) -> bool:
        late = self._opened is not None and self.commander.time > self._opened + AFTER
        return bool(self.message) or late

    def observed(self) -> tuple[np.ndarray, np.ndarray]:
        """State and environment of now, as `write_lerobot` lays them out."""
        arm = self.plant.arm_state
        oldest = arm.stamp_ns - SEEN_NS
        hand, *bodies = (_pose_row(self._log.bodies[role], oldest) for role in self.roles)
        return np.concatenate([arm.position, arm.velocity, hand]), np.concatenate(bodies)


def _pose_row(stream: Stream, oldest_ns: int) -> np.ndarray:
    """Newest pose of a body, and whether it was seen of late (8,)."""
    if not stream.stamps:
        return np.array([0.0, 0.0, 0.0, *UNTURNED, 0.0])
    pose = stream.rows[-1]
    turn = pose[3:] if len(pose) > 3 else UNTURNED
    return np.array([*pose[:3], *turn, float(stream.stamps[-1] > oldest_ns)])


class SteppedBench(Stepped, BenchSession):
    """A bench that is stepped frame by frame."""

    def __init__(self, skill: Skill, seed: int = 0):
        super().__init__(skill, seed)
        self.roles = (HAND, *skill.bodies)

    def put(self, situation: Situation) -> None:
        self.situation(situation.pose("holder"))

    @property
    def succeeded(self) -> bool:
        return self.plant.succeeded


class SteppedThrow(Stepped, Session):
    """A basket at which is thrown frame by frame."""

    speed = Speed.THROW
    carries = True

    def __init__(self, skill: Skill, seed: int = 0):
        super().__init__(seed)
        self.roles = (HAND, *skill.bodies)

    def put(self, situation: Situation) -> None:
        self._begin(situation.pose("basket").position, no_push)
        until = self.plant.state_stamp_ns + LOOKED_NS
        self._step_until(no_push, lambda: True, lambda: until)
        self._deliver()

    @property
    def succeeded(self) -> bool:
        return self.plant.state.ball_in_basket


STEPPED: dict[str, Callable[[Skill, int], Stepped]] = {
    "place": SteppedBench,
    "throw": SteppedThrow,
}
"""Worlds by the name of their skill."""


def stepped(skill: Skill, seed: int = 0) -> Stepped:
    """The world of a skill, to be stepped frame by frame.

    Parameters
    ----------
    seed
        Everything random comes from it.

    Raises
    ------
    ValueError
        For a skill that has none.
    """
    if skill.name not in STEPPED:
        raise ValueError(f"'{skill.name}' cannot be stepped: {', '.join(STEPPED)} can")
    return STEPPED[skill.name](skill, seed)
