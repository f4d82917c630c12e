"""From continuous sensor streams to one demonstration: the motion of the throw between velocity
thresholds, and the flight.

Thesis 8.4.3: recording goes on before and after the throw, and the arm may be moved about before
it; what counts is the motion during which the hand was opened, found on the magnitude of the
hand's velocity.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm import the_arm
from dart_skill.common.checks import to_the_nanosecond
from dart_skill.common.constants import Grip
from dart_skill.common.flight import TENNIS_BALL, Ball
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.surface import BASKETS, Game
from dart_skill.common.world import THROW_BODIES, the_world
from dart_skill.movement import VelocityThreshold, segment_containing
from dart_skill.recording import HAND, SKILL, Demonstration, Event, Track
from dart_skill.skills.observation._outcome import Outcome, Release, fit_release, judge_flight
from dart_skill.skills.observation._sensor_log import JOINTS, SensorLog, Stream

THRESHOLDS = VelocityThreshold(run_up=0.15, settle=0.1)
ARRIVAL_NS = 50_000_000
"""Samples of so long before the end of watching may still be on their way."""
LEAST_JOINTS = 0.5
"""Least share of a throw that the joints must be known for."""
LEAST_SAMPLES = 10
"""With fewer samples of a sensor there is no demonstration."""
LOOKED_NS = 1_000_000_000
"""A basket is where it was last seen within so long before [ns]."""
BEFORE_NS = 200_000_000
"""The release is looked for from so long before the hand was told to open."""


def watched_until(opened_ns: int) -> int:
    """The instant up to which a throw is watched and cut, in a graph and from a bag [ns]."""
    return opened_ns + the_world().watch_ns - ARRIVAL_NS


def judged(
    log: ThrowLog,
    target: np.ndarray,
    rim_radius: float,
    opened_ns: int,
    until_ns: int,
    game: Game = BASKETS,
) -> tuple[Outcome, Release | None]:
    """What became of a throw at the centre (3,) of a rim, or a point of a board, and how the ball
    or dart left the hand, of what was seen up to an instant.

    Raises
    ------
    ValueError
        For a target or radius that cannot be.
    """
    seen = log.ball_between(opened_ns, until_ns)
    outcome = judge_flight(*seen, target, rim_radius, game.projectile, surface=game.surface)
    return outcome, log.release_between(opened_ns - BEFORE_NS, until_ns, game.projectile)


def seen_down(
    log: ThrowLog, target: np.ndarray, opened_ns: int, until_ns: int, game: Game = BASKETS
) -> bool:
    """Whether the ball was seen to pass the surface of its target (3,), so that later poses change
    no landing.
    """
    _, position = log.ball_between(opened_ns, until_ns)
    return game.surface.passed(position, target)


class ThrowLog(SensorLog):
    """What the sensors saw since `clear`: pose of the hand, position of the ball, joint states,
    the hand's button.

    joint_period_ns thins the joint states to about the rate of the poses, counted from when the
    world was set anew.

    Parameters
    ----------
    skill
        Of throwing; it says what its bodies are called, which here are ball and basket in any
        case. `rejected` counts samples that were stale or not finite.
    """

    def __init__(
        self,
        joint_period_ns: int = 10_000_000,
        skill: str = SKILL,
        bodies: tuple[str, str] = THROW_BODIES,
    ):
        self.skill = skill
        self._thrown, self._aimed_at = bodies
        super().__init__((HAND, *bodies), joint_period_ns)
        self.turned = frozenset({HAND})

    def clear(self) -> None:
        """Forget everything."""
        super().clear()
        self.whole: dict[str, Stream] = {}  # of which this log is a part, by sensor
        self.opened_ns: int | None = None
        self.left_ns: int | None = None

    @property
    def hand(self) -> Stream:
        return self.bodies[HAND]

    @property
    def ball(self) -> Stream:
        return self.bodies[self._thrown]

    @property
    def basket(self) -> Stream:
        return self.bodies[self._aimed_at]

    def take(self, role: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A pose of a body; how ball and basket are turned is of no use."""
        if role == HAND:
            super().take(role, stamp_ns, position, quaternion)
        else:
            self._keep(role, stamp_ns, position)

    def add_told(self, stamp_ns: int, grip: Grip) -> None:
        super().add_told(stamp_ns, grip)
        if grip == Grip.OPEN:
            self.add_opening(stamp_ns)

    def situation_at(self, stamp_ns: int) -> Situation:
        """Where the basket was last seen before a stamp.

        Raises
        ------
        ValueError
            If it was not.
        """
        seen = self.basket.part(stamp_ns - LOOKED_NS, stamp_ns)
        if not seen.stamps:
            raise ValueError(f"the {self._aimed_at} was not seen: is it tracked and published?")
        return Situation({self._aimed_at: Pose(seen.rows[-1])})

    def add_opening(self, stamp_ns: int) -> None:
        """The hand was told to open; only the first time counts."""
        if self.opened_ns is None:
            self.opened_ns = stamp_ns

    def add_release(self, stamp_ns: int) -> None:
        """The ball was seen to leave the hand: where it is not known when the hand was told to open,
        this tells which motion is the throw.
        """
        if self.left_ns is None:
            self.left_ns = stamp_ns

    def part(self, since_ns: int, until_ns: int) -> ThrowLog:
        """A log of what was seen between two instants, the hand's button aside."""
        part = ThrowLog(self._joint_period_ns, self.skill, (self._thrown, self._aimed_at))
        part.bodies = {
            role: stream.part(since_ns, until_ns) for role, stream in self.bodies.items()
        }
        part.joints = self.joints.part(since_ns, until_ns)
        part.left_out, part.whole = self.left_out, {**self.bodies, JOINTS: self.joints}
        return part

    def _too_few(self, what: str, stream: Stream) -> str:
        """Why there are too few samples of a sensor: it is asked whether it is there only if
        nothing of it has come.
        """
        n, whole = len(stream.stamps), self.whole.get(what, stream).stamps
        if self.left_out[what] > len(whole):
            which = (
                "not numbers, or stamped no later than the one before, as where the stamps"
                " are not filled in"
            )
            return (
                f"only {n} samples of the {what}, and {self.left_out[what]} that do not count:"
                f" {which}"
            )
        if len(whole) > n + LEAST_SAMPLES:
            when = f"from {1e-9 * whole[0]:.3f} to {1e-9 * whole[-1]:.3f} s"
            return (
                f"only {n} samples of the {what} at that time, and {len(whole)} {when}: have all"
                " sensors one clock?"
            )
        return f"only {n} samples of the {what}: is it tracked and published?"

    def ball_between(self, since_ns: int, until_ns: int) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) [s] after the first instant and positions (n, 3) of the ball between two
        instants.
        """
        if not self.ball.stamps:
            return np.empty(0), np.empty((0, 3))
        return self.ball.between(since_ns, 0.0, (until_ns - since_ns) * 1e-9)

    def release_between(
        self, since_ns: int, until_ns: int, projectile: Ball = TENNIS_BALL
    ) -> Release | None:
        """How the ball left the hand between two instants; times after the first one. None if hand
        or flight was not seen.

        Parameters
        ----------
        projectile
            What is thrown.
        """
        if not (self.ball.stamps and self.hand.stamps):
            return None
        stop = (until_ns - since_ns) * 1e-9
        ball_time, ball = self.ball.between(since_ns, 0.0, stop)
        hand_time, hand = self.hand.between(since_ns, 0.0, stop)
        try:
            grip = the_arm().hand.ball_centre
            return fit_release(
                ball_time, ball, hand_time, hand[:, :3], hand[:, 3:], grip, projectile
            )
        except ValueError:
            return None

    def cut(
        self, name: str, until_ns: int, thresholds: VelocityThreshold = THRESHOLDS
    ) -> Demonstration:
        """The throw, up to an instant, as a demonstration.

        Raises
        ------
        ValueError
            Says what is missing: motion, button, ball, basket.
        """
        thrown_ns = self.left_ns if self.opened_ns is None else self.opened_ns
        if thrown_ns is None:
            raise ValueError("the hand was never told to open: nothing was thrown")
        for what, stream in (*self.bodies.items(), (JOINTS, self.joints)):
            if len(stream.stamps) < LEAST_SAMPLES:
                raise ValueError(self._too_few(what, stream))
        origin = self.world_begins_ns(thrown_ns)
        time, hand = self.hand.between(origin, 0.0, (until_ns - origin) * 1e-9)
        thrown = (thrown_ns - origin) * 1e-9
        segment = segment_containing(thresholds.segment(time, hand[:, :3], thrown), thrown)
        origin += round(segment.start * 1e9)
        stop = segment.stop - segment.start
        hand_time, hand = self.hand.between(origin, 0.0, stop)
        ball_time, ball = self.ball.between(origin, 0.0, (until_ns - origin) * 1e-9)
        joint_time, joints = self.joints.between(origin, -0.01, stop)
        if not len(joint_time) or np.ptp(joint_time) < LEAST_JOINTS * stop:
            told = (
                f"only {len(joint_time)} states of the joints during the throw, which takes"
                f" {stop:.2f} s"
            )
            raise ValueError(
                f"{told}, and {len(self.joints.stamps)} around it: have all sensors one clock?"
            )
        joint_position, joint_velocity = np.hsplit(joints, 2)
        return Demonstration(
            id=name,
            tracks={
                HAND: Track(hand_time, hand[:, :3], hand[:, 3:]),
                self._thrown: Track.unturned(ball_time, ball),
            },
            stamp_ns=origin,
            skill=self.skill,
            situation=Situation({self._aimed_at: Pose(self._basket_position(origin, stop))}),
            joint_time=joint_time,
            joint_position=joint_position,
            joint_velocity=joint_velocity,
            motion_start=to_the_nanosecond(segment.motion_start - segment.start),
            motion_stop=to_the_nanosecond(segment.motion_stop - segment.start),
            events=()
            if self.opened_ns is None
            else (Event("open", (self.opened_ns - origin) * 1e-9),),
        )

    def _basket_position(self, origin_ns: int, stop: float) -> np.ndarray:
        """Where the basket stood during the motion; if it was hidden then, where it was seen at
        other times (3,).
        """
        seen = self.basket.between(origin_ns, 0.0, stop)[1]
        return np.median(seen if len(seen) else self.basket.rows, axis=0)
