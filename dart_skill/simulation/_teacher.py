"""A person who guides the arm through throws: pushes the hand and the elbow of a
gravity-compensated arm, and never sets a joint.

The person has a swing in mind: turn the arm to the basket, pause, swing it over the top in about
0.7 s, let go, follow through. How fast the swing has to be comes from the flight of the ball; how
well a person does it, from docs/throwing.md: release point 1.5 cm, duration 4 %, speed 0.8
%, a trembling hand. A throw that misses is tried again, corrected by what was seen.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import cache, cached_property
from typing import Any

import numpy as np

from dart_skill.arm import (
    ArmModel,
    ArmState,
    Command,
    Grip,
    HandState,
    minimum_jerk,
    rotation_error,
    the_swing,
)
from dart_skill.common.surface import BASKETS, RIMS, Game
from dart_skill.common.vectors import at_most

NO_MOMENT = np.zeros(3)
"""Moment of a trembling hand [N m]."""
NEAREST = 0.3
"""A basket nearer to the axis of the base stands on the base plate, which is 0.36 m long
(docs/sources.md) [m].
"""


def of_swing(what: str) -> tuple[float, ...]:
    """What a person does with the arm of this process: a field of `ArmSwing`."""
    return tuple(getattr(the_swing(), what).tolist())


@dataclass(frozen=True)
class Swing:
    """The throw that the teacher has in mind, as angles of the joints that swing; defaults are
    those of the arm (`ArmSwing`).

    Parameters
    ----------
    cocked
        Angles before the swing (m,) [rad].
    release
        Angles at the release (m,) [rad].
    rates
        At the release, for a speed of 1 (m,) [rad/s].
    duration
        From the start to the release [s].
    follow_through
        From the release to rest [s].
    """

    cocked: tuple[float, ...] = field(default_factory=lambda: of_swing("cocked"))
    release: tuple[float, ...] = field(default_factory=lambda: of_swing("release"))
    rates: tuple[float, ...] = field(default_factory=lambda: of_swing("rates"))
    duration: float = field(default_factory=lambda: the_swing().duration)
    follow_through: float = 0.45


@dataclass(frozen=True)
class Person:
    """How a person differs from the swing in mind, and how firmly they hold the arm. Each is a
    parameter of the node teacher.

    Parameters
    ----------
    release_point
        Standard deviation of the release point [m].
    duration, speed
        Standard deviations of the duration and the speed of the swing, as shares.
    direction
        Standard deviation of its direction [rad].
    timing
        Standard deviation of the instant at which the button is pressed [s].
    expected_hand_delay
        The person presses so long before the release [s].
    tremble, tremble_rate
        Force of the trembling hand [N], and its corner frequency [Hz].
    pause
        Shortest and longest wait before the swing [s].
    firm_hand
        Stiffness and damping of the hold of the hand [N/m, N s/m].
    firm_wrist
        The same for turning [N m/rad, N m s/rad].
    firm_elbow
        Stiffness and damping of the other hand, at the elbow [N/m, N s/m].
    strongest_push
        Of either hand [N].
    strongest_twist
        Of the wrist [N m].
    """

    release_point: float = 0.015
    duration: float = 0.04
    speed: float = 0.008
    direction: float = 0.006
    timing: float = 0.005
    expected_hand_delay: float = 0.030
    tremble: float = 0.5
    tremble_rate: float = 9.0
    pause: tuple[float, float] = (0.2, 0.6)
    firm_hand: tuple[float, float] = (5000.0, 300.0)
    firm_wrist: tuple[float, float] = (25.0, 0.5)
    firm_elbow: tuple[float, float] = (2000.0, 80.0)
    strongest_push: float = 150.0
    strongest_twist: float = 12.0

    @classmethod
    def from_parameters(cls, parameters: Mapping) -> "Person":
        """A person from the parameters of the teacher node."""
        values: dict[str, Any] = {f.name: parameters[f.name] for f in fields(cls)}
        for name, value in values.items():
            values[name] = tuple(value) if isinstance(value, list | tuple) else value
        return cls(**values)


class Phase(Enum):
    """What the teacher is doing."""

    IDLE = "idle"
    TURNING = "turning"
    PAUSING = "pausing"
    THROWING = "throwing"
    WATCHING = "watching"


@dataclass
class _Motion:
    """A swing worked out in joint angles, with the instants of its phases since the beginning of
    the guidance [s].
    """

    initial: np.ndarray
    cocked: np.ndarray
    release: np.ndarray
    rates: np.ndarray
    turn: float
    start: float
    to_release: float
    follow_through: float
    open_at: float
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def angles(self) -> Any:
        """Angles (n,) from the cocked posture through the release to rest, as quintics without
        acceleration at the ends of both, a function of the time since the start [s].
        """
        from scipy.interpolate import BPoly  # only a throw that is shown needs it

        rest = np.zeros(len(self.cocked))
        end = self.release + 0.5 * self.follow_through * self.rates
        ends = [(self.cocked, rest, rest), (self.release, self.rates, rest), (end, rest, rest)]
        instants = np.cumsum([0.0, self.to_release, self.follow_through])
        return BPoly.from_derivatives(instants, np.array(ends))

    @cached_property
    def speeds(self) -> Any:
        """Interpolation of their rates (n,) [rad/s]."""
        return self.angles.derivative()


class Teacher:
    """Guides one throw at a time: `begin` with a target, then `step` once per state until the
    phase is WATCHING.

    `learn_from(landing)` corrects the next throw at the same target, as a person does who saw
    where the ball went.

    Parameters
    ----------
    seed
        Everything random comes from it.
    swing
        How the person throws.
    person
        How the person guides.
    step
        Between two states [s].
    game
        What is thrown at what.
    """

    _motion: _Motion  # from the first throw on

    def __init__(
        self,
        seed: int = 0,
        swing: Swing | None = None,
        person: Person | None = None,
        step: float = 0.002,
        game: Game = BASKETS,
    ):
        self.swing, self.person, self._step, self._game = (
            swing or Swing(),
            person or Person(),
            step,
            game,
        )
        self._model = ArmModel(ball_in_hand=True)
        self._seed, self._throws = seed, 0
        self._phase = Phase.IDLE
        self._correction: np.ndarray = np.zeros(2)

    @property
    def phase(self) -> Phase:
        return self._phase

    def begin(self, target: np.ndarray, state: ArmState, correction: bool = False) -> None:
        """Prepare a throw at `target` (3,); correction=False forgets what was learned at it
        before.

        Raises
        ------
        ValueError
            And nothing has changed, for a target out of reach.
        """
        target, learned = self.check(target, correction)
        self._throws += 1
        self._rng = np.random.default_rng([self._seed, self._throws])
        self._correction, self._target = learned, target
        self._started_ns = state.stamp_ns
        self._motion = self._prepare(state)
        self._tremble, self._opened = np.zeros(3), False
        self._phase = Phase.TURNING

    def check(self, target: np.ndarray, correction: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """The target (3,), and what was learned at it (2,)

        Parameters
        ----------
        correction
            Whether what was learned before counts.

        Raises
        ------
        ValueError
            For one out of reach.
        """
        target, learned = self._checked(target), self._correction if correction else np.zeros(2)
        self._speed_for(self._reach(target) + learned[0], target)
        return target, learned

    def learn_from(self, landed: np.ndarray) -> None:
        """Aim the next throw against the miss: landed (3,) is where the ball was seen to come
        down.

        Raises
        ------
        ValueError
            If that was not seen.
        """
        if not np.isfinite(landed[:2]).all():
            raise ValueError(
                f"no landing of the ball was seen ({landed}): there is nothing to learn from it"
            )
        along, across = self._game.surface.miss(landed - self._target, self._target)
        self._correction = self._correction - 0.8 * np.array(
            [along, across / np.hypot(*self._target[:2])]
        )

    def step(self, state: ArmState) -> Command:
        """The push that answers one state: a wrench at the hand, a force at the elbow as joint
        torque, and the hand's button.

        Raises
        ------
        ValueError
            Before `begin`.
        """
        if self._phase is Phase.IDLE:
            raise ValueError("the teacher has no throw in mind: begin one")
        time = (state.stamp_ns - self._started_ns) * 1e-9
        self._phase = self._phase_at(time)
        q, qd = self._wanted(time)
        # one after the other, as the model keeps one state
        hand, elbow = (
            self._model.hand_state(q, qd),
            self._model.at(q).elbow(),
        )
        wrench = self._push_hand(state, hand) + self._tremor()
        return Command(
            state.stamp_ns, wrench, self._push_elbow(state, elbow, float(q[0])), self._button(time)
        )

    # the swing in mind

    def _checked(self, target: np.ndarray) -> np.ndarray:
        target = np.array(target, dtype=float)
        if target.shape != (3,) or not np.isfinite(target).all():
            raise ValueError(
                f"target {target} is not three finite numbers: give the centre of the rim in"
                " metres"
            )
        if np.hypot(*target[:2]) < NEAREST:
            what, where = self._game.surface.what, np.round(target, 3).tolist()
            raise ValueError(
                f"a {what} at {where} stands on the base of the arm: place it at least {NEAREST} m"
                " from its axis"
            )
        base, azimuth = self._model.description.joints[0], float(np.arctan2(target[1], target[0]))
        if not base.lower < azimuth < base.upper:
            what = self._game.surface.what
            raise ValueError(
                f"a {what} at {azimuth:.2f} rad is behind the arm: place it between {base.lower}"
                f" and {base.upper} rad"
            )
        return target

    def _prepare(self, state: ArmState) -> _Motion:
        person, swing, rng = self.person, self.swing, self._rng
        azimuth = np.arctan2(self._target[1], self._target[0]) + self._correction[1]
        azimuth += person.direction * rng.standard_normal()
        speed = self._speed_for(self._reach(self._target) + self._correction[0], self._target)
        speed *= 1.0 + person.speed * rng.standard_normal()
        duration = swing.duration * (1.0 + person.duration * rng.standard_normal())
        turn = max(0.6, 1.6 * abs(azimuth - state.position[0]))
        start = turn + rng.uniform(*person.pause)
        release = start + duration
        open_at = release - person.expected_hand_delay + person.timing * rng.standard_normal()
        return _Motion(
            initial=state.position.copy(),
            cocked=self._posture(azimuth, swing.cocked),
            release=self._posture(azimuth, swing.release),
            rates=self._rates(speed * np.array(swing.rates)),
            turn=turn,
            start=start,
            to_release=duration,
            follow_through=swing.follow_through,
            open_at=open_at,
            offset=person.release_point * rng.standard_normal(3),
        )

    def _reach(self, target: np.ndarray) -> float:
        return float(self._game.surface.coordinates(target)[0])

    def _speed_for(self, reach: float, target: np.ndarray) -> float:
        """Share of the joints' no-load speed whose ball gets to `reach` [m] on the surface of the
        target (3,).
        """
        surface = self._game.surface

        def miss(speed: float) -> float:
            position, velocity = self._ball_at_release(speed)
            reached = surface.reached(position, velocity, target, self._game.projectile)
            # too slow to rise above the rim
            return reached - reach if np.isfinite(reached) else -reach

        low, high = 0.05, 1.0
        where = (
            f"{reach:.2f} m, {target[2]:.2f} m high," if surface is RIMS else surface.far(reach)
        )
        out_of_reach = f"a {surface.what} at {where} is out of the teacher's reach"
        if miss(low) > 0 or miss(high) < 0:
            nearest, farthest = miss(low) + reach, miss(high) + reach
            raise ValueError(
                f"{out_of_reach}: place it between {max(nearest, 0.0):.2f} and {surface.far(farthest)}"
            )
        from scipy.optimize import brentq  # 0.1 s, which only a throw that is shown needs

        speed = brentq(miss, low, high, xtol=1e-4)
        if abs(miss(speed)) > 0.05:
            raise ValueError(f"{out_of_reach}: place it lower or farther away")
        return speed

    def _ball_at_release(self, speed: float) -> tuple[np.ndarray, np.ndarray]:
        q, rates = self._posture(0.0, self.swing.release), speed * np.array(self.swing.rates)
        hand = self._model.hand_state(q, self._rates(rates))
        arm = hand.rotation @ self._model.description.hand.ball_centre
        return hand.position + arm, hand.linear + np.cross(hand.angular, arm)

    def _posture(self, azimuth: float, swing: tuple | np.ndarray) -> np.ndarray:
        """Angles of all joints (n,) for those that swing."""
        q = the_swing().rest.copy()
        q[0] += azimuth
        q[the_swing().joints] = swing
        return q

    def _rates(self, swing: np.ndarray) -> np.ndarray:
        """Rates of all joints (n,) for those of the ones that swing."""
        rates = np.zeros(self._model.description.n_joints)
        rates[the_swing().joints] = swing
        return rates

    def _phase_at(self, time: float) -> Phase:
        motion = self._motion
        if time < motion.turn:
            return Phase.TURNING
        if time < motion.start:
            return Phase.PAUSING
        if time < motion.start + motion.to_release + motion.follow_through:
            return Phase.THROWING
        return Phase.WATCHING

    def _wanted(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Joint angles and velocities of the swing in mind, whose hand path the person follows."""
        motion = self._motion
        if time < motion.start:
            return minimum_jerk(motion.initial, motion.cocked, motion.turn, time)[:2]
        since = min(time - motion.start, motion.to_release + motion.follow_through)
        return motion.angles(since), motion.speeds(since)

    # the hands

    def _push_hand(self, state: ArmState, wanted: HandState) -> np.ndarray:
        """Force and moment (6,) of a spring and a damper between the hand in mind and the hand as
        it is, as strong as the person is.
        """
        actual, person = self._model.hand_state(state.position, state.velocity), self.person
        off = np.concatenate(
            [
                wanted.position + self._wander(state.stamp_ns) - actual.position,
                rotation_error(wanted.rotation, actual.rotation),
            ]
        )
        stiffness, damping = np.repeat([person.firm_hand, person.firm_wrist], 3, axis=0).T
        wrench = stiffness * off + damping * (wanted.velocity - actual.velocity)
        return np.concatenate(
            [
                at_most(wrench[:3], person.strongest_push),
                at_most(wrench[3:], person.strongest_twist),
            ]
        )

    def _wander(self, stamp_ns: int) -> np.ndarray:
        """How far the hand strays from the path in mind: grows smoothly through the swing, the
        most around the release (3,) [m].
        """
        motion = self._motion
        since = (stamp_ns - self._started_ns) * 1e-9 - motion.start
        come = min(max(since / motion.to_release, 0.0), 1.0)
        share = come - min(max((since - motion.to_release) / motion.follow_through, 0.0), 1.0)
        return motion.offset * share**2 * (3 - 2 * share)

    def _push_elbow(self, state: ArmState, wanted: np.ndarray, azimuth: float) -> np.ndarray:
        """The other hand keeps the elbow in the plane of the throw: force at the elbow as joint
        torque (n,).
        """
        k, d = self.person.firm_elbow
        actual, jacobian = self._model.elbow(state.position)
        force = k * (wanted - actual) - d * (jacobian @ state.velocity)
        across = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
        return jacobian.T @ (at_most(force @ across * across, self.person.strongest_push))

    def _tremor(self) -> np.ndarray:
        """Band-limited noise of a trembling hand (6,): force only."""
        self._tremble = tremor(self._tremble, self.person, self._rng, self._step)
        return np.concatenate([self._tremble, NO_MOMENT])

    def _button(self, time: float) -> Grip:
        if self._opened or time < self._motion.open_at:
            return Grip.UNSPECIFIED
        self._opened = True
        return Grip.OPEN


def tremor(
    before: np.ndarray, person: Person, rng: np.random.Generator, step: float
) -> np.ndarray:
    """Force of a trembling hand (3,) [N] a step [s] after another one: band-limited noise."""
    kept, added = _shares(person.tremble_rate, step)
    return kept * before + added * person.tremble * rng.standard_normal(3)


@cache
def _shares(rate: float, step: float) -> tuple[float, float]:
    """Shares of a first-order low-pass with a corner [Hz] a step [s] later: what is left of the
    noise, and what is new.
    """
    kept = np.exp(-2 * np.pi * rate * step)
    return float(kept), float(np.sqrt(1 - kept**2))
