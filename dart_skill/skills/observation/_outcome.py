"""What became of a throw, from motion-capture samples alone: where the ball landed, and how it
left the hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import check_samples
from dart_skill.common.flight import TENNIS_BALL, Ball, FlightFit, fit_flight, landing
from dart_skill.common.surface import RIMS, BoardFace, Surface
from dart_skill.movement import rotate
from dart_skill.skills.observation._free_flight import (
    FreeFlight,
    find_flight,
    fit_about_the_middle,
    followed,
    tolerance,
)
from dart_skill.skills.observation._grip import grip_path, seen_grip
from dart_skill.skills.observation._noise import position_noise
from dart_skill.skills.observation._parting import parting, parting_instant

MARKED = 0.01  # what the markers of ball and hand may be off from where they are held [m]
TAIL = 6  # samples that tell how a ball moved when it was last seen
MAX_UNSEEN = 0.15  # longest time that a flight is extrapolated beyond its last sample [s]
SIDE = 4  # samples of the hand that are needed before the release, and after it
WIDEST_HAND_WINDOW = 0.15  # like HAND_WINDOW, when the hand was hidden in it
HAND_WINDOW = (
    0.08  # half the time over which the paths of hand and flight are compared at the release [s]
)
# of the polynomial for their difference; one of the next degree tells how far it is to be trusted
DEGREE = 4


@dataclass(frozen=True)
class Outcome:
    """Result of one throw.

    Parameters
    ----------
    landing_seen
        The ball was tracked up to, or at most 0.15 s before, the crossing of the rim's plane.
    landing
        (3,) where the ball's centre crosses the plane of the rim going down, on its first free
        flight; a ball that touches the rim counts where it would have crossed; a dart: where it
        meets the plane of the board [m]; nan if not seen.
    landing_time
        Of the crossing, on the clock of the samples [s]; nan if not seen.
    landing_error
        Distance of the landing from the centre of the rim, or from the target on the board, in
        that plane [m]; nan if not seen.
    in_basket
        Last seen inside the walls below the rim, or flying down through the rim and never seen
        again; a dart: it met the board.
    """

    landing_seen: bool
    landing: np.ndarray
    landing_time: float
    landing_error: float
    in_basket: bool


@dataclass(frozen=True)
class Release:
    """How the ball left the hand.

    Parameters
    ----------
    time
        Instant at which the ball stops moving with the hand, on the clock of the samples [s].
    time_uncertainty
        Its standard deviation [s]; large where the hand accelerates as a free ball would.
    position, velocity
        (3,) of the ball then, from the fit of the flight [m], [m/s].
    grip_distance
        Of the flight from the grip point then [m].
    grip
        (3,) centre of the held ball in the hand frame, as it was seen [m].
    flight
        The fit, its state at `time`.
    """

    time: float
    time_uncertainty: float
    position: np.ndarray
    velocity: np.ndarray
    grip_distance: float
    grip: np.ndarray
    flight: FlightFit


def judge_flight(
    ball_time: np.ndarray,
    ball_position: np.ndarray,
    rim: np.ndarray,
    rim_radius: float,
    ball: Ball = TENNIS_BALL,
    noise: float | None = None,
    *,
    free: FreeFlight | None = None,
    surface: Surface = RIMS,
) -> Outcome:
    """Outcome of a throw at the basket with centre of the rim `rim` (3,) and radius `rim_radius`
    [m], or at the point `rim` of a board.

    Parameters
    ----------
    ball_time : (n,) [s]
    ball_position : (n, 3) [m]
        World frame: every sample from the grip until the ball has come to rest or was lost for
        good. No samples, or none in flight, is an outcome too: not seen.
    noise
        Standard deviation of a coordinate of a sample [m], default None: told from the samples.
    free
        What `find_flight` says of these samples, if it was asked before.
    surface
        Where the flight ends.
    """
    ball_time, ball_position = check_samples("ball", ball_time, ball_position, least=0)
    rim = _check_rim(rim, rim_radius)
    if noise is None:
        noise = position_noise(ball_time, ball_position) if free is None else free.noise
    inside = surface is RIMS and _ends_in_basket(
        ball_time, ball_position, rim, rim_radius, ball, noise
    )
    free = free or find_flight(ball_time, ball_position, ball, noise)
    unseen = Outcome(False, np.full(3, np.nan), np.nan, np.nan, inside)
    if free is None:
        return unseen
    crossing = surface.crossing(free.fit.position, free.fit.velocity, rim, free.fit.ball)
    if not _tracked_to(free, ball_time, free.fit.time + float(crossing.time)):
        return unseen
    if isinstance(surface, BoardFace):
        inside = surface.holds(crossing.position)
    error = surface.apart(crossing.position, rim)
    return Outcome(True, crossing.position, float(free.fit.time + crossing.time), error, inside)


def fit_release(
    ball_time: np.ndarray,
    ball_position: np.ndarray,
    hand_time: np.ndarray,
    hand_position: np.ndarray,
    hand_quaternion: np.ndarray,
    grip_offset: np.ndarray,
    ball: Ball = TENNIS_BALL,
    noise: float | None = None,
    *,
    free: FreeFlight | None = None,
) -> Release:
    """Release of the ball, from its samples and the hand's, in one world frame and on one clock.

    Parameters
    ----------
    ball_time : (n,)
    ball_position : (n, 3)
    hand_time : (m,)
    hand_position : (m, 3)
    hand_quaternion : (m, 4)
    grip_offset
        (3,) centre of the held ball in the hand frame [m], where it should be; where it was seen
        before the release counts.
    noise
        As in `judge_flight`. The flight is fitted and followed back to where it meets the path of
        the grip point. There the ball moves exactly as the grip does, so that the difference of
        the two paths is stationary at the release: its derivative is linear in time and tells the
        instant far better than the distance, which is quadratic. Good to a few tenths of a
        millisecond where the hand's acceleration differs from a free ball's by 4 m/s^2 or more.
    free
        As in `judge_flight`.

    Raises
    ------
    ValueError
        If no flight or no hand is seen there.
    """
    ball_time, ball_position = check_samples("ball", ball_time, ball_position)
    hand_time, grip = grip_path(hand_time, hand_position, hand_quaternion, grip_offset)
    free = free or find_flight(ball_time, ball_position, ball, noise)
    ball = free.fit.ball if free else ball
    if free is None:
        raise ValueError(
            f"no free flight in {len(ball_time)} ball samples: was the ball thrown, and was it"
            " tracked?"
        )
    fit, kept = free.fit, free.samples
    near, apart = _nearest_approach(fit, hand_time, grip), max(ball.radius, MARKED)
    hand = (
        hand_time,
        np.asarray(hand_position, dtype=float),
        np.asarray(hand_quaternion, dtype=float),
    )
    seen = seen_grip(
        (ball_time, ball_position), hand, near, np.asarray(grip_offset, dtype=float), apart
    )
    grip = hand[1] + rotate(hand[2], seen[None])
    for last in (False, True):
        time, uncertainty, distance = _parting(fit, hand_time, grip, near, last)
        fitted, kept = kept, free.samples[ball_time[free.samples] >= time]
        if len(kept) < TAIL:
            raise ValueError(
                f"only {len(kept)} samples of the flight after the release at {time:.3f} s, need"
                f" {TAIL}"
            )
        if np.array_equal(kept, fitted):
            fit, near = followed(fit, time), time
        else:
            fit, near = (
                followed(
                    fit_about_the_middle(ball_time[kept], ball_position[kept], ball, fit), time
                ),
                time,
            )
    if distance > apart:
        raise ValueError(
            f"the flight passes the grip point at {1e3 * distance:.0f} mm: it did not start in"
            " this hand; check grip_offset and that hand and ball are given in one frame"
        )
    return Release(time, uncertainty, fit.position, fit.velocity, distance, seen, fit)


def _tracked_to(free: FreeFlight, time: np.ndarray, crossing: float) -> bool:
    """Whether samples of the flight lie on both sides of the crossing, or end shortly before it."""
    seen = time[free.samples]
    return bool(np.isfinite(crossing) and seen[-1] + MAX_UNSEEN >= crossing)


def _ends_in_basket(
    time: np.ndarray,
    position: np.ndarray,
    rim: np.ndarray,
    radius: float,
    ball: Ball,
    noise: float,
) -> bool:
    if len(time) == 0:
        return False
    if position[-1, 2] < rim[2]:
        return bool(np.linalg.norm(position[-1, :2] - rim[:2]) < radius)
    if len(time) < TAIL or time[-1] - time[-TAIL] > 2.0 * MAX_UNSEEN:
        return False
    tail, points = time[-TAIL:], position[-TAIL:]
    fit = fit_flight(tail, points, ball, at=tail[-1])
    if np.max(fit.residuals) > tolerance(noise):
        return False
    crossing = landing(fit.position, fit.velocity, rim[2], ball)
    return bool(
        crossing.time <= MAX_UNSEEN and np.linalg.norm(crossing.position[:2] - rim[:2]) < radius
    )


def _nearest_approach(fit: FlightFit, hand_time: np.ndarray, grip: np.ndarray) -> float:
    """Instant of the hand sample whose grip point is nearest to the flight, from 0.3 s before its
    start.
    """
    around = (hand_time > fit.time - 0.3) & (hand_time < fit.time + HAND_WINDOW)
    if not np.any(around):
        raise ValueError(
            f"no hand samples within 0.3 s before the flight at {fit.time:.3f} s: the hand was"
            " occluded"
        )
    path, _ = fit.at(hand_time[around])
    return float(hand_time[around][np.linalg.norm(path - grip[around], axis=1).argmin()])


def _parting(
    fit: FlightFit, hand_time: np.ndarray, grip: np.ndarray, near: float, judged: bool
) -> tuple[float, float, float]:
    """Instant at which flight and grip move alike; if it is judged, its deviation and their
    distance then, else nan.
    """
    window = _hand_window(hand_time - near)
    if not window <= WIDEST_HAND_WINDOW:
        few = f"fewer than {SIDE} samples on one side within {WIDEST_HAND_WINDOW} s"
        raise ValueError(f"the hand was hidden at the release at {near:.3f} s: {few}")
    around = np.abs(hand_time - near) <= window
    time = (hand_time[around] - near) / window  # in -1 to 1: keeps the powers of time comparable
    difference = fit.at(hand_time[around])[0] - grip[around]
    if not judged:
        return float(near + parting_instant(time, difference, DEGREE) * window), math.nan, math.nan
    best, deviation, distance = parting(time, difference, DEGREE)
    # A hand without its ball moves on with another acceleration; where both move alike, that
    # shifts the instant by milliseconds.
    other = parting_instant(time, difference, DEGREE + 1)
    return (
        float(near + best * window),
        float(window * math.hypot(deviation, other - best)),
        distance,
    )


def _hand_window(time: np.ndarray) -> float:
    """Half the length [s] of a window about time 0 that holds enough samples on either side: wider
    where the hand was hidden.
    """
    sides = (-time[time < 0.0][::-1], time[time > 0.0])
    return max([HAND_WINDOW, *(side[SIDE - 1] if len(side) >= SIDE else np.inf for side in sides)])


def _check_rim(rim: ArrayLike, radius: float) -> np.ndarray:
    rim = np.asarray(rim, dtype=float)
    if rim.shape != (3,) or not np.all(np.isfinite(rim)):
        raise ValueError(f"rim must be the finite (3,) centre of the rim, got {rim}")
    if not (np.isfinite(radius) and radius > 0.0):
        raise ValueError(f"rim_radius = {radius}: give the radius of the rim in metres")
    return rim
