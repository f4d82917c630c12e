"""The first free flight in a series of samples of a ball.

A free flight is recognised by its dynamics (gravity and drag, `flight.py`), not by thresholds on
height or speed, so that the ball in the hand, bounces, outliers and gaps fall away by themselves.
All tolerances follow from the noise of the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dart_skill.common.flight import TENNIS_BALL, Ball, FlightFit, fit_flight, fit_flights, may_fly
from dart_skill.common.quantiles import quantile
from dart_skill.skills.observation._noise import position_noise

WINDOW = 10
"""Samples of the shortest window in which a flight is told from another motion."""
WINDOW_TIME = 0.09
"""Duration of that window [s]."""
MAX_WINDOW = 0.5
"""Longest duration of a window that is used [s]: in a longer one the ball was hidden."""
# what a marker centre moves about the centre of a turning ball, beside the noise of single samples
# [m]
SLACK = 5e-4
# a window is so long that a motion at constant velocity misses a free fall by so many tolerances
CLEARLY = 1.5
ROUGHLY = 1e-4  # of flights that are only asked whether they are flights: accuracy [m]
# rms misfit of a flight, in deviations of a sample, beyond which the ball may be another one than
# was expected,
ANOTHER_BALL = 4.0
BETTER = 0.7  # and is, if its own drag takes the misfit below this share
GROWTH = 20  # samples; so far beyond its own a flight is looked for at a time


@dataclass(frozen=True)
class FreeFlight:
    """The first free flight in a series of samples.

    Parameters
    ----------
    samples
        (m,) indices of those that belong to it.
    fit
        The flight through them, its state at the first of them.
    noise
        Standard deviation of a coordinate of a sample [m].
    """

    samples: np.ndarray
    fit: FlightFit
    noise: float


def find_flight(
    time: np.ndarray, position: np.ndarray, ball: Ball = TENNIS_BALL, noise: float | None = None
) -> FreeFlight | None:
    """The first free flight in samples (n,) [s], (n, 3) [m], or None.

    Every window of some samples is fitted, unless it is clearly no flight; runs of windows that
    fly freely are candidates. The first one that is at least half as long as the longest is
    refitted and grown over its neighbours, skipping up to two outliers. A flight that is not this
    ball's is fitted with a drag of its own: `fit.ball` says which.

    Parameters
    ----------
    noise
        Standard deviation of a coordinate [m]; default None: told from the samples.
    time, position
        The samples.
    """
    noise = position_noise(time, position) if noise is None else noise
    runs = _flying_runs(time, position, ball, noise)
    if not runs:
        return None
    longest = max(last - first for first, last, _ in runs)
    first, last, near = next(run for run in runs if run[1] - run[0] >= 0.5 * longest)
    samples = np.arange(first, last)
    fit = fit_about_the_middle(time[samples], position[samples], ball, near)
    if fit.residual > ANOTHER_BALL * noise:
        fit = _of_another_ball(time[samples], position[samples], fit)
    for _ in range(20):
        grown = _grown(time, position, samples, fit, noise)
        if np.array_equal(grown, samples):
            break
        samples = grown
        fit = fit_about_the_middle(time[samples], position[samples], fit.ball, fit)
    return FreeFlight(samples, followed(fit, float(time[samples[0]])), noise)


def tolerance(noise: float) -> float:
    """How far a sample of a flight may be from it [m]: five standard deviations, and what a
    turning ball moves its markers.
    """
    return SLACK + 5.0 * noise


def _grown(
    time: np.ndarray, position: np.ndarray, samples: np.ndarray, fit: FlightFit, noise: float
) -> np.ndarray:
    """Indices of the samples near a flight, in and about those that belong to it."""
    farthest = min(max(4.0 * fit.residual, tolerance(noise) - SLACK), 3.0 * tolerance(noise))
    within = slice(max(0, samples[0] - GROWTH), samples[-1] + 1 + GROWTH)
    close = np.zeros(len(time), dtype=bool)
    close[within] = np.linalg.norm(position[within] - fit.at(time[within])[0], axis=1) < farthest
    return grow(close, samples)


def fit_about_the_middle(
    time: np.ndarray, position: np.ndarray, ball: Ball, near: FlightFit | None
) -> FlightFit:
    """A fit whose state is that at the middle sample: half as far to go to either end."""
    return fit_flight(time, position, ball, at=float(time[len(time) // 2]), near=near)


def _of_another_ball(time: np.ndarray, position: np.ndarray, fit: FlightFit) -> FlightFit:
    """The flight with the drag that explains it best, up to four times the ball's, if it explains
    it much better: it may be another ball, which is not said.
    """
    from scipy.optimize import minimize_scalar  # a ball that was expected needs none

    ball = fit.ball

    def misfit(scale: float) -> float:
        return fit_flight(
            time, position, replace(ball, drag_coefficient=scale * ball.drag_coefficient)
        ).residual

    best = minimize_scalar(misfit, bounds=(0.0, 4.0), method="bounded", options={"xatol": 0.01})
    if best.fun > BETTER * fit.residual:
        return fit
    return fit_about_the_middle(
        time, position, replace(ball, drag_coefficient=float(best.x) * ball.drag_coefficient), fit
    )


def _window(time: np.ndarray, noise: float) -> int:
    """Samples over which a motion at constant velocity misses a free fall clearly.

    Over a time T the misfit of the best line to a parabola of curvature g is g T^2 / 12 at its
    ends.
    """
    needed = max(WINDOW_TIME, np.sqrt(12.0 * CLEARLY * tolerance(noise) / TENNIS_BALL.gravity))
    return max(WINDOW, int(np.ceil(needed / quantile(time[1:] - time[:-1], 0.5) - 1e-6)) + 1)


def _flying_runs(
    time: np.ndarray, position: np.ndarray, ball: Ball, noise: float
) -> list[tuple[int, int, FlightFit]]:
    """Index ranges [first, last) of consecutive windows whose samples are a free flight, with the
    fit of a window in the middle.
    """
    if len(time) < WINDOW:
        return []
    size = _window(time, noise)
    if len(time) < size:
        return []
    flying = time[size - 1 :] - time[: len(time) - size + 1] < MAX_WINDOW
    if not flying.any():
        return []
    windows = np.flatnonzero(flying)[:, None] + np.arange(size)
    since, points = time[windows] - time[windows[:, :1]], position[windows]
    kept, states = may_fly(since, points, tolerance(noise), ball)
    if not kept.any():
        return []
    flying[flying] = kept
    start, velocity, misfit = fit_flights(since[kept], points[kept], ball, states[kept], ROUGHLY)
    at = np.cumsum(flying) - 1  # of a window that was fitted, its place among these
    flying[flying] = np.max(misfit, axis=1) < tolerance(noise)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flying.astype(int), [0]])))

    def middle(first: int, last: int) -> FlightFit:
        window = (first + last) // 2
        return FlightFit(
            time[window], start[at[window]], velocity[at[window]], misfit[at[window]], ball
        )

    return [(first, last + size - 1, middle(first, last)) for first, last in edges.reshape(-1, 2)]


def grow(near: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Indices of the samples near the flight, contiguous but for gaps of at most two outliers."""
    inside = np.flatnonzero(near)
    if len(inside) < WINDOW:
        return samples
    pieces = np.split(inside, np.flatnonzero(inside[1:] - inside[:-1] > 3) + 1)
    middle = samples[len(samples) // 2]
    grown = min(
        pieces,
        key=lambda piece: 0 if piece[0] <= middle <= piece[-1] else abs(np.median(piece) - middle),
    )
    return grown if len(grown) >= WINDOW else samples


def followed(fit: FlightFit, time: float) -> FlightFit:
    """The same flight with its state at another instant."""
    position, velocity = fit.state_at(time)
    return FlightFit(time, position, velocity, fit.residuals, fit.ball)
