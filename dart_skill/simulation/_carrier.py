"""A person who guides the arm's hand through space: takes a part, carries it over a holder, puts
it in, and lets go; or leads it over the rim of a cup that moves, and down into it, and stays
there.

The person has a path of the part in mind (`Guiding`). How well they aim is said here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.arm import ArmState, Grip, HandState
from dart_skill.common.constants import HAND
from dart_skill.simulation._guiding import SLOW_HAND, SLOW_WRIST, Guiding, smooth
from dart_skill.simulation._teacher import Person
from dart_skill.simulation._workbench import Pose

BLOCK = 100
"""Steps whose path is worked out at once: SciPy turns that many in the time of a few."""


@dataclass(frozen=True)
class Carrying:
    """How a person carries a part. Spreads are standard deviations.

    Parameters
    ----------
    wait
        Before the fingers are told to close, and before the part moves after that [s].
    duration, duration_spread
        Of the way [s], and as a share.
    lift, above
        Height over the place where the part stood, and over the holder [m].
    height_spread
        Of both [m].
    aim_spread, turn_spread
        Of where the part is put in [m], and how it is turned [rad]: what a person cannot see.
    rest
        At the end, before the fingers open [s].
    follows
        How fast what is left of the distance to the path is taken out [1/s]: a person sees it.
    firm_hand, firm_wrist
        As of `Guiding`.
    """

    wait: float = 0.4
    duration: float = 4.0
    duration_spread: float = 0.05
    lift: float = 0.10
    above: float = 0.07
    height_spread: float = 0.01
    aim_spread: float = 0.0007
    turn_spread: float = 0.01
    rest: float = 0.3
    follows: float = 6.0
    firm_hand: tuple[float, float] = SLOW_HAND
    firm_wrist: tuple[float, float] = SLOW_WRIST


class Carrier(Guiding):
    """Guides one movement at a time: `begin`, then `step` once per state until `done`.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    carrying, person
        How they do it; the defaults where none is given.
    step
        Control period [s].
    part
        Role of what they carry, and look at.
    """

    def __init__(
        self,
        seed: int = 0,
        carrying: Carrying | None = None,
        person: Person | None = None,
        step: float = 0.002,
        part: str = "part",
    ):
        self.carrying = carrying or Carrying()
        super().__init__(
            seed,
            person,
            self.carrying.follows,
            self.carrying.firm_hand,
            self.carrying.firm_wrist,
            step,
            looks_at=part,
        )

    def begin(self, state: ArmState, part: Pose, goal: Pose) -> None:
        """Take the part where it stands and bring it to a goal; both as the person sees them."""
        self._begin_guiding(state)
        c = self.carrying
        rng = self._rng
        self._told = 0
        self._way = c.duration * (1.0 + c.duration_spread * rng.standard_normal())
        self._lift, self._above = np.array(
            [c.lift, c.above]
        ) + c.height_spread * rng.standard_normal(2)
        aside = np.append(c.aim_spread * rng.standard_normal(2), 0.0)
        turn = Rotation.from_rotvec([0.0, 0.0, c.turn_spread * rng.standard_normal()])
        self._first, self._last = part[0], goal[0] + aside
        self._turns = Slerp(
            [0.0, 1.0],
            Rotation.concatenate(
                [Rotation.from_quat(part[1]), turn * Rotation.from_quat(goal[1])]
            ),
        )
        hand = self._model.hand_state(state.position, state.velocity)
        back = Rotation.from_quat(part[1]).inv()
        self._grip = (
            back.apply(hand.position - part[0]),
            back * Rotation.from_matrix(hand.rotation),
        )
        self._in_mind: dict[float, tuple[np.ndarray, np.ndarray]] = {}

    def _body_in_hand(self, hand: HandState) -> tuple[np.ndarray, np.ndarray]:
        """The part, held as it was met."""
        offset, held = self._grip
        turned = hand.rotation @ held.inv().as_matrix()
        return hand.position - turned @ offset, turned

    @property
    def duration(self) -> float:
        """From the beginning to the end [s]."""
        c = self.carrying
        return 2.0 * c.wait + self._way + 2.0 * c.rest + 0.3

    def done(self, state: ArmState) -> bool:
        """Whether the part was let go, and all is at rest."""
        return self._time(state) >= self.duration

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Where the hand shall be (3,), and how turned (3, 3)."""
        if time not in self._in_mind:
            step_ns = round(1e9 * self._step)
            steps = (round(1e9 * time) + step_ns * np.arange(BLOCK)) * 1e-9
            times = np.concatenate([[time], steps, steps + self._step])
            self._in_mind = dict(
                zip(times.tolist(), zip(*self._path(times), strict=True), strict=True)
            )
        return self._in_mind[time]

    def _path(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 3) and rotations (n, 3, 3) of the hand at times (n,)."""
        place, over = self._places(times)
        turn, (offset, held) = self._turns(over), self._grip
        return place + turn.as_matrix() @ offset, (turn * held).as_matrix()

    def _places(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the part (n, 3), and how much of its turn it has made (n,), at times (n,)."""
        share = (times - 2.0 * self.carrying.wait) / self._way
        up, over, down = (
            np.array([*map(smooth, part.tolist())])
            for part in (share / 0.3, (share - 0.15) / 0.45, (share - 0.62) / 0.38)
        )
        place = self._first + over[:, None] * (self._last - self._first)
        place[:, 2] += (1.0 - over) * up * self._lift + over * (1.0 - down) * self._above
        # While both are under way, neither of the two heights is reached: over the edge of the
        # holder the part is high all the same.
        return place, over

    def _button(self, time: float) -> Grip:
        c = self.carrying
        for number, (instant, grip) in enumerate(
            ((c.wait, Grip.CLOSE), (2.0 * c.wait + self._way + c.rest, Grip.OPEN))
        ):
            if self._told == number and time >= instant:
                self._told += 1
                return grip
        return Grip.UNSPECIFIED


@dataclass(frozen=True)
class Reaching:
    """How a person reaches. Spreads are standard deviations.

    Parameters
    ----------
    wait, wait_spread
        Before the hand moves [s].
    duration, duration_spread
        Of the way [s], and as a share.
    above, height_spread
        Height over the cup's floor from which the hand comes down [m].
    aim_spread
        Of where the hand ends in the cup, along each axis [m].
    rest
        The hand stays in the cup for so long [s].
    follows, firm_wrist
        As of `Guiding`.
    """

    wait: float = 1.0
    wait_spread: float = 0.1
    duration: float = 1.8
    duration_spread: float = 0.06
    above: float = 0.12
    height_spread: float = 0.008
    aim_spread: float = 0.003
    rest: float = 1.0
    follows: float = 6.0
    firm_wrist: tuple[float, float] = SLOW_WRIST


class Reacher(Guiding):
    """Guides one movement at a time: `begin`, then `watch` and `step` once per state until `done`.

    Parameters
    ----------
    seed
        Of what differs from one time to the next.
    reaching, person
        How they do it; the defaults where none is given.
    step
        Control period [s].
    hand
        Role of what they look at beside the cup.
    """

    def __init__(
        self,
        seed: int = 0,
        reaching: Reaching | None = None,
        person: Person | None = None,
        step: float = 0.002,
        hand: str = HAND,
    ):
        self.reaching = reaching or Reaching()
        super().__init__(
            seed,
            person,
            self.reaching.follows,
            None,  # the cup moves on: a soft push would lag behind
            self.reaching.firm_wrist,
            step,
            looks_at=hand,
        )

    def begin(self, state: ArmState) -> None:
        """Begin where the hand is now."""
        self._begin_guiding(state)
        r, rng = self.reaching, self._rng
        self._wait = r.wait + r.wait_spread * rng.standard_normal()
        self._way = r.duration * (1.0 + r.duration_spread * rng.standard_normal())
        self._above = np.array([0.0, 0.0, r.above + r.height_spread * rng.standard_normal()])
        self._aside = r.aim_spread * rng.standard_normal(3)
        hand = self._model.hand_state(state.position, state.velocity)
        self._first, self._rotation = hand.position, hand.rotation
        self._cup, self._seen, self._speed = np.zeros(3), 0.0, np.zeros(3)

    def watch(self, state: ArmState, cup: np.ndarray, speed: np.ndarray) -> None:
        """What the person sees now: the cup (3,) [m] and how it moves (3,) [m/s]."""
        self._cup, self._speed, self._seen = cup, speed, self._time(state)

    def done(self, state: ArmState) -> bool:
        """Whether the hand has been in the cup for long enough."""
        return self._time(state) >= self._wait + self._way + self.reaching.rest

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        share = (time - self._wait) / self._way
        over, down = smooth(share / 0.75), smooth((share - 0.5) / 0.5)
        inside = self._cup + (time - self._seen) * self._speed + self._aside
        return self._first + over * (
            inside + self._above - self._first
        ) - down * self._above, self._rotation
