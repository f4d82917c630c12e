"""`rhythmic`: a movement that repeats (thesis 7.2, 7.3), learned from turns that a person showed about
the last task frame, one demonstration or several.

A demonstration has three parts (`find_turns`): the way to where it turns, the turns, and the way
from there. The turns make a limit cycle (7.8)-(7.11) in the last task frame, over the position and
two axes of the hand; phases of several demonstrations are brought together. The two ways are
discrete primitives. A plan goes there, turns as often as is asked for, and goes away. Each part
begins and ends at rest (`SoftClock`), always on its path.

A situation may say, in numbers, how the movement turns: its `frequency` [1/s], its `amplitude` as a
share of that which was shown, and the number of `turns`; without them it turns as was shown.

The arm acts on the clock (7.6): C of (7.5) is how far the hand is ahead along its way, or behind. A
hand that is held makes the phase wait, and it goes on from there.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dart_skill.arm import HandPath, Pace, SafetyLimits, Speed
from dart_skill.common import quaternions
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.situation import Pose, Situation
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import (
    STARTS,
    DiscretePrimitive,
    HarmonicCycle,
    PrimitiveState,
    RhythmicPrimitive,
    SeenMovement,
    SoftClock,
    Turns,
    ahead_gain,
    choose_goal_window,
    find_turns,
    shift_between,
)
from dart_skill.movement.pose import PoseMotion, pose_attractor, pose_motion
from dart_skill.recording import HAND
from dart_skill.skills.learning._pose_features import VECTORS, pose_features
from dart_skill.skills.learning._prepared import RATE, PreparedMovement
from dart_skill.skills.learning._primitive import ALIKE, gaussians, placed, row
from dart_skill.skills.learning._representation import ClockedRepresentation, path_of_axes
from dart_skill.skills.protocol import Skill, SkillSettings

if TYPE_CHECKING:
    from dart_skill.skills.learning._learned import LearnedSkill

FREQUENCY, AMPLITUDE, TURNS = "frequency", "amplitude", "turns"
"""Names of the numbers of a situation that say how a movement turns."""
FASTER = (0.25, 2.0)
"""Frequencies that may be asked for, in units of the one that was shown: what is faster takes more
than four times the acceleration.
"""
LARGER = (0.25, 2.0)
"""Amplitudes that may be asked for, in units of the one that was shown."""
MOST_TURNS = 200
"""Largest number of turns of a plan, which has all of them."""
SETS_OFF = 0.3
"""A way sets off, and stops, within so long [s]."""
SHORTEST_WAY = 0.2
"""The hand is on its way to the turns, and from them, for so long at least [s]."""
SAMPLES = 200
"""Number of samples of a period, by which phases of demonstrations are compared."""

Moved = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Features, their velocities and accelerations (n, d)."""


class _Turning(NamedTuple):
    """How a movement turns: frequency [1/s], amplitude as a share, number of turns."""

    frequency: float
    amplitude: float
    turns: int

    @property
    def clock(self) -> SoftClock:
        """From the first turn to the last [s]."""
        return SoftClock(self.turns / self.frequency, STARTS / self.frequency)


class _Shown(NamedTuple):
    """A demonstration in the last task frame: instants (n,) [s] from the start on, features (n, d),
    where it turns, and by what share of a period it is behind the first.
    """

    time: np.ndarray
    features: np.ndarray
    turns: Turns
    behind: float = 0.0

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of its duration after which it begins and ends to turn."""
        return self.turns.begin / self.time[-1], self.turns.end / self.time[-1]

    @property
    def _turns_at(self) -> np.ndarray:
        return (self.time >= self.turns.begin) & (self.time <= self.turns.end)

    @property
    def turning_at(self) -> np.ndarray:
        """Instants (m,) [s] while it turns."""
        return self.time[self._turns_at]

    @property
    def phases(self) -> np.ndarray:
        """Phases (m,) in periods while it turns, as if it turned evenly."""
        since = self.turning_at - self.turns.begin
        return since / self.turns.period - self.behind

    @property
    def rows(self) -> np.ndarray:
        """Features (m, d) while it turns."""
        return self.features[self._turns_at]

    def way(self, there: bool) -> tuple[np.ndarray, np.ndarray]:
        """Instants (m,) [s] and features (m, d) of the way to the turns, or else from them."""
        turns = self.turns
        seen = self.time <= turns.begin if there else self.time >= turns.end
        return self.time[seen] - self.time[seen][0], self.features[seen]


def _cycle_of(shown: list[_Shown]) -> HarmonicCycle:
    return HarmonicCycle([one.phases for one in shown], [one.rows for one in shown])


class _Way(NamedTuple):
    """The way to the turns, or from them: the primitive, and its clock."""

    primitive: DiscretePrimitive
    clock: SoftClock

    @classmethod
    def fit(cls, shown: list[tuple[np.ndarray, np.ndarray]], kernels: int) -> _Way:
        """From instants (m,) [s] and features (m, d) of demonstrations."""
        duration = float(np.mean([time[-1] for time, _ in shown]))
        clock = np.linspace(0.0, duration, max(round(duration * RATE), SAMPLES))
        rows = [_resampled(clock * time[-1] / duration, time, one) for time, one in shown]
        places = [one[:, VECTORS["position"]] for one in rows]
        rests = [SeenMovement(one, np.zeros_like(one)) for one in places]
        window = choose_goal_window(clock / duration, rests)
        primitive = DiscretePrimitive(kernels, goal_window=window)
        primitive.fit([clock] * len(rows), rows)
        return cls(primitive, SoftClock(duration, min(SETS_OFF, duration)))

    @property
    def gone(self) -> np.ndarray:
        """From where it begins to where it ends (d,), as was shown."""
        return np.asarray(self.primitive.goal_ - self.primitive.start_)

    def at(self, time: np.ndarray, start: np.ndarray, goal: np.ndarray) -> Moved:
        """At instants (n,) [s], from features (d,) to others, at rest at both ends."""
        rest = np.zeros_like(start)
        state = self.primitive.begin(start, goal=goal, velocity=rest)
        return _on_clock(self.primitive, state, self.clock, time)


class Rhythmic(ClockedRepresentation):
    """See the module.

    Attributes
    ----------
    cycle
        The primitive of the turns, over what `pose_features` makes of poses in the last task frame.
    """

    tells_covariance = False

    @classmethod
    def refusal(cls, skill: Skill) -> str:
        if skill.bodies_move:
            return "it turns about a body that rests, and those of this skill move"
        return super().refusal(skill)

    @classmethod
    def least(cls, settings: SkillSettings) -> int:
        return 1

    def __init__(self, shown: LearnedSkill):
        super().__init__(shown)
        first, *others = (self._shown_in(one) for one in shown.movements)
        self._movements = [first, *self._in_phase(first, others)]
        self._cycle = _cycle_of(self._movements)
        self._period = self._mean_period()
        self.cycle = self._fit_cycle()
        self._there, self._away = (
            _Way.fit([one.way(there) for one in self._movements], self._kernels)
            for there in (True, False)
        )
        left = self._left[:, VECTORS["position"]]
        self._spread = float(np.sqrt(np.square(left).mean() + ALIKE**2))

    # demonstrations

    @property
    def _kernels(self) -> int:
        return self.settings.components

    def _frame(self, situation: Situation) -> Pose:
        return self.shown.skill.chosen_frames(situation)[-1]

    def _shown_in(self, movement: PreparedMovement) -> _Shown:
        """ValueError names a demonstration that does not turn."""
        time = np.arange(0.0, movement.duration, 1.0 / RATE)
        frame = self._frame(movement.situation)
        try:
            poses = pose_motion(movement.time, movement.poses, at=time).pose
            local = _seen_from(frame, poses)
            turns = find_turns(time, local[:, VECTORS["position"]])
        except ValueError as error:
            raise ValueError(f"demonstration {movement.id}: {error}") from error
        if min(turns.begin, time[-1] - turns.end) < SHORTEST_WAY:
            raise ValueError(
                f"demonstration {movement.id} turns from {turns.begin:.1f} to {turns.end:.1f} of"
                f" {time[-1]:.1f} s: show also how the hand comes there, and goes away"
            )
        return _Shown(time, local, turns)

    def _in_phase(self, first: _Shown, others: list[_Shown]) -> list[_Shown]:
        """The others with what they are behind the first; ValueError names one that turns otherwise."""
        phases = np.arange(SAMPLES) / SAMPLES
        like, found = _cycle_of([first]).at(phases)[0], []
        for movement, one in zip(self.shown.movements[1:], others, strict=True):
            try:
                other = _cycle_of([one]).at(phases)[0]
                found.append(one._replace(behind=shift_between(like[:, :3], other[:, :3])))
            except ValueError as error:
                raise ValueError(f"demonstration {movement.id}: {error}") from error
        return found

    def _mean_period(self) -> float:
        """Mean period of the turns between the first and the last half one, in which a person sets
        off and stops [s].
        """
        periods = []
        for one, phases in zip(self._movements, self._cycle.phases, strict=True):
            inner = np.interp([phases[0] + 0.5, phases[-1] - 0.5], phases, one.turning_at)
            periods.append(np.ptp(inner) / (np.ptp(phases) - 1.0))
        return float(np.mean(periods))

    def _fit_cycle(self) -> RhythmicPrimitive:
        """The primitive that makes the cycle."""
        phases = np.arange(2 * SAMPLES + 1) / SAMPLES
        made, slope, curvature = self._cycle.at(phases)
        period = self._period
        return RhythmicPrimitive(self._kernels).fit(
            period * phases, made, slope / period, curvature / period**2, period=period
        )

    @cached_property
    def _left(self) -> np.ndarray:
        """What the cycle leaves of the turns that were shown (m, d), wherever they are on it."""
        left = []
        for one, phases in zip(self._movements, self._cycle.phases, strict=True):
            begin = self.cycle.begin(period=1.0, phase=float(phases[0]))
            left.append(one.rows - self.cycle.open_loop(phases - phases[0], begin).position)
        return np.concatenate(left)

    # what it says

    @property
    def frequency(self) -> float:
        """That was shown [1/s]."""
        return 1.0 / self._period

    def bic(self) -> float:
        """See `Primitives.bic`; of the turns."""
        n, d = self._left.shape
        squares = np.maximum(np.square(self._left).mean(0), 1e-12)
        likelihood = n * np.log(2.0 * np.pi * np.e * squares).sum()
        return float(likelihood + self._kernels * d * np.log(n))

    def mixture(self, situation: Situation) -> GaussianMixture:
        """See `Representation`: a Gaussian for each kernel (7.11), of the first turn."""
        frame, position = self._frame(situation), VECTORS["position"]
        phases = np.arange(SAMPLES) / SAMPLES
        turning = self._asked(situation)
        cycle = self.cycle.open_loop(phases / turning.frequency, self._begin(turning))
        places = frame.position + cycle.position[:, position] @ frame.rotation.T
        time = self._there.clock.duration + phases / turning.frequency
        return gaussians(np.column_stack([time, places]), self.cycle.activations(phases))

    # plans

    def _asked(self, situation: Situation) -> _Turning:
        """ValueError names a number that is out of its bounds."""
        numbers = situation.numbers
        shown = max(round(float(np.mean([one.turns.number for one in self._movements]))), 1)
        frequency = float(numbers.get(FREQUENCY, self.frequency))
        amplitude, turns = float(numbers.get(AMPLITUDE, 1.0)), float(numbers.get(TURNS, shown))
        low, high = (share * self.frequency for share in FASTER)
        _check(FREQUENCY, frequency, (low, high), f"{self.frequency:.2f} /s were shown")
        _check(AMPLITUDE, amplitude, LARGER, "1 was shown")
        if not (1.0 <= turns <= MOST_TURNS and turns == round(turns)):
            raise ValueError(
                f"{TURNS} is {turns:g}: ask for a whole number of turns, from 1 to {MOST_TURNS}"
            )
        return _Turning(frequency, amplitude, int(turns))

    def _begin(self, turning: _Turning) -> PrimitiveState:
        """On the cycle, at phase zero; the axes of the hand turn as was shown."""
        size = np.ones(self.cycle.n_dims)
        size[VECTORS["position"]] = turning.amplitude
        return self.cycle.begin(period=1.0 / turning.frequency, amplitude=size)

    def _ends(self, turning: _Turning) -> np.ndarray:
        """Instants [s] at which a plan begins, has come to the turns, leaves them, and ends (4,)."""
        parts = (self._there.clock, turning.clock, self._away.clock)
        return np.cumsum([0.0, *(one.duration for one in parts)])

    def movement(self, situation: Situation) -> tuple[HandPath, np.ndarray, np.ndarray]:
        turning, frame = self._asked(situation), self._frame(situation)
        start = _seen_from(frame, row(situation.pose(HAND)))[0]
        path = placed(self._path(turning, start), frame)
        self._check_speed(path, turning)
        motion = PoseMotion(
            np.hstack([path.position, path.quaternion]), path.velocity, path.acceleration
        )
        s = self.settings
        pulled = pose_attractor(motion, (s.stiffness, s.rotational_stiffness))
        return path, pulled[:, :3], pulled[:, 3:]

    def _path(self, turning: _Turning, start: np.ndarray) -> HandPath:
        """The movement from features of the start (d,), in the last task frame."""
        state, ends = self._begin(turning), self._ends(turning)
        clock = to_the_nanosecond(np.arange(0.0, ends[-1], self.settings.step))
        part = np.searchsorted(ends[1:-1], clock, side="right")
        there, turns, away = (clock[part == k] - ends[k] for k in range(3))
        parts = (
            self._there.at(there, start, state.position),
            _on_clock(self.cycle, state, turning.clock, turns),
            self._away.at(away, state.position, state.position + self._away.gone),
        )
        moved, speed, growth = (np.concatenate(one) for one in zip(*parts, strict=True))
        place = VECTORS["position"]
        axes = moved[:, place.stop :]
        return path_of_axes(clock, moved[:, place], speed[:, place], growth[:, place], axes)

    def _check_speed(self, path: HandPath, turning: _Turning) -> None:
        """ValueError for a movement that is faster than the arm may be."""
        fastest = float(np.linalg.norm(path.velocity[:, :3], axis=1).max())
        name = "careful_hand" if self.shown.skill.speed == Speed.CAREFUL else "fastest_hand"
        most = getattr(SafetyLimits.configured(), name)
        if fastest > most:
            raise ValueError(
                f"{FREQUENCY} {turning.frequency:.2f} /s with {AMPLITUDE} {turning.amplitude:g} moves"
                f" the hand at {fastest:.2f} m/s, and the limit ({name}) is {most} m/s: ask for"
                " less of one of them"
            )

    def pace(self, path: HandPath, held: np.ndarray) -> Pace | None:
        """The clock waits for a hand that is held, wherever it is."""
        gain = np.zeros((len(path.time), 12))
        gain[:, :3] = ahead_gain(path.velocity[:, :3], np.full(len(path.time), self._spread))
        return Pace(gain)

    def turns_between(self, situation: Situation) -> tuple[float, float]:
        """Instants [s] of a plan for a situation at which it has come to the turns, and leaves them."""
        _, begin, end, _ = self._ends(self._asked(situation))
        return float(begin), float(end)

    @property
    def _shown_ends(self) -> np.ndarray:
        """Those instants of the mean movement [s] (4,), as `_ends`."""
        begin, end = np.mean([one.shares for one in self._movements], axis=0)
        return self.shown.duration * np.array([0.0, begin, end, 1.0])

    def shown_at(self, situation: Situation, time: np.ndarray) -> np.ndarray:
        """See `ClockedRepresentation`; part by part."""
        return np.interp(time, self._ends(self._asked(situation)), self._shown_ends)

    def way(self, movement: PreparedMovement, clock: np.ndarray) -> np.ndarray:
        ends = self._ends(self._asked(movement.situation))
        return super().way(movement, np.interp(clock, self._shown_ends, ends))


def _on_clock(
    primitive: DiscretePrimitive | RhythmicPrimitive,
    state: PrimitiveState,
    clock: SoftClock,
    time: np.ndarray,
) -> Moved:
    """What a primitive makes from a state on at instants (n,) [s], where a clock says how far it
    has come.
    """
    shows, rate, change = clock.at(time)
    instants, back = np.unique(np.append(0.0, shows), return_inverse=True)
    made = primitive.open_loop(instants, state)
    moved, speed, growth = (
        one[back[1:]] for one in (made.position, made.velocity, made.acceleration)
    )
    rate, change = rate[:, None], change[:, None]
    return moved, rate * speed, rate**2 * growth + change * speed


def _seen_from(frame: Pose, poses: np.ndarray) -> np.ndarray:
    """Features (n, d) in a frame of poses in the world (n, 7)."""
    back = quaternions.CONJUGATE * frame.quaternion
    places = quaternions.rotate(back, poses[:, :3] - frame.position)
    return pose_features(places, quaternions.product(back, poses[:, 3:]))


def _resampled(at: np.ndarray, time: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows (n, d) at other instants (m,)."""
    return np.column_stack([np.interp(at, time, one) for one in rows.T])


def _check(name: str, value: float, bounds: tuple[float, float], shown: str) -> None:
    """ValueError for a number out of its bounds, with others that are within."""
    low, high = bounds
    if not low <= value <= high:
        least, most = math.ceil(1e2 * low) / 1e2, math.floor(1e2 * high) / 1e2
        raise ValueError(f"{name} is {value:g}: {shown}; ask for {least:.2f} to {most:.2f}")
