"""Flight of a thrown ball with quadratic drag, forward, backward and fitted to samples.

    dv/dt = (0, 0, -g) - k |v| v,    k = rho Cd A / (2 m)

Everything takes any number of throws and instants. The equation is integrated with classical
Runge-Kutta steps in which drag takes no more than a hundredth of the speed, and of at most 100 ms:
for a tennis ball the result is exact to a micrometre after 1.2 s.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from dart_skill.common.checks import check_samples
from dart_skill.common.constants import AIR_DENSITY, GRAVITY
from dart_skill.common.world import the_world

UP = np.array([0.0, 0.0, 1.0])
MAX_STEP = 0.1
"""Longest step of the integration [s]."""
MAX_LOSS = 0.01
"""Largest share of the speed that drag takes in a step."""
PROBE = 1e-4
"""Difference of velocity with which the sensitivity of a flight is found [m/s]."""
MOST_CORRECTIONS = 12
"""Largest number of corrections of the instant of a crossing."""
CLOSE = 1e-12
"""Correction of the instant of a crossing below which it is the last [s]."""
CROSSED = 1e-6
"""Largest distance from the plane of a ball that crosses it [m]."""
MOST_REPETITIONS = 30
"""Largest number of repetitions of a fit."""


@dataclass(frozen=True)
class Ball:
    """A ball, and the air and gravity that it flies in.

    Parameters
    ----------
    mass
        [kg].
    diameter
        [m].
    drag_coefficient
        Of a sphere, without a unit.
    air_density
        [kg/m^3].
    gravity
        [m/s^2], downwards.
    """

    mass: float
    diameter: float
    drag_coefficient: float
    air_density: float = AIR_DENSITY
    gravity: float = GRAVITY

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            positive = field.name not in ("drag_coefficient", "air_density")
            if not np.isfinite(value) or value < 0.0 or (positive and value == 0.0):
                kind = "positive" if positive else "non-negative"
                raise ValueError(f"Ball.{field.name} = {value}: give a finite {kind} number")

    @property
    def radius(self) -> float:
        """[m]"""
        return 0.5 * self.diameter

    @cached_property
    def drag(self) -> float:
        """Deceleration by drag per speed squared, k = rho Cd A / (2 m) [1/m]."""
        area = np.pi * self.radius**2
        return 0.5 * self.air_density * self.drag_coefficient * area / self.mass


TENNIS_BALL = Ball(
    the_world().ball_mass, the_world().ball_diameter, the_world().ball_drag_coefficient
)
"""The ball of config/world.yaml."""
DART = Ball(mass=0.024, diameter=0.007, drag_coefficient=3.0)
"""A steel-tip dart, its attitude that of its velocity: a barrel of 7 mm and 24 g (rules allow 50
g; most weigh 20 to 26 g).

No measured drag was found in print. Laminar friction (Blasius) on four fins of 20 x 40 mm and 140
mm of body, and a blunt end, at 4 m/s make a drag area of 1.1 cm^2: 3 times the barrel's
cross-section. The drag of a dart, 0.05 m/s^2, is then a seventh of a tennis ball's.
"""


@dataclass(frozen=True)
class Landing:
    """Where and when balls cross a plane: a horizontal one going down, or a vertical one; nan
    where they never do.

    Parameters
    ----------
    position : (..., 3) [m]
    velocity : (..., 3) [m/s]
    time : (...) [s]
        After the start of the flight.
    """

    position: np.ndarray
    velocity: np.ndarray
    time: np.ndarray


@dataclass(frozen=True)
class FlightFit:
    """A flight fitted to samples.

    Parameters
    ----------
    time
        Of the state [s].
    position, velocity
        (3,), the state [m], [m/s].
    residuals
        (n,), distance of every sample [m].
    ball
        That flew.
    """

    time: float
    position: np.ndarray
    velocity: np.ndarray
    residuals: np.ndarray
    ball: Ball

    @property
    def residual(self) -> float:
        """Root mean square of the distances of the samples [m]."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (n, 3) at absolute times (n,), before or after `time`."""
        return flight(
            self.position, self.velocity, np.asarray(times, dtype=float) - self.time, self.ball
        )

    def state_at(self, time: float) -> np.ndarray:
        """Position and velocity (2, 3) at one absolute time [s].

        Raises
        ------
        ValueError
            For one that is not finite.
        """
        return np.concatenate(self.at(np.array([time])))


def acceleration(velocity: np.ndarray, ball: Ball = TENNIS_BALL) -> np.ndarray:
    """Acceleration (..., 3) [m/s^2] of a ball that flies with `velocity` (..., 3)."""
    velocity = np.asarray(velocity, dtype=float)
    speed = np.sqrt(np.einsum("...i,...i->...", velocity, velocity))[..., None]
    return -ball.drag * speed * velocity - ball.gravity * UP


def flight(
    position: np.ndarray, velocity: np.ndarray, times: np.ndarray, ball: Ball = TENNIS_BALL
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n_times, ..., 3) of balls at `times` (n_times,) [s], negative ones
    too.

    Parameters
    ----------
    position, velocity
        (..., 3) at time 0, world frame, Z up.
    times
        (n_times,), of all balls.

    Raises
    ------
    ValueError
        For times that are not finite.
    """
    position, velocity = _states(position, velocity)
    times = np.asarray(times, dtype=float)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise ValueError(
            f"times of a flight must be a finite (n,) array, got shape {times.shape}: {times}"
        )
    return _fly(position, velocity, times.reshape(-1, *[1] * (position.ndim - 1)), ball)


def _fly(
    position: np.ndarray, velocity: np.ndarray, time: np.ndarray, ball: Ball
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (..., 3) of flights at times (...), with states (..., 3) at time 0;
    leading shapes are broadcast. All make as many equal steps as the longest flight needs.
    """
    shape = np.broadcast_shapes(position.shape, velocity.shape, (*time.shape, 3))
    position, velocity = np.broadcast_to(position, shape), np.broadcast_to(velocity, shape)
    fastest = np.linalg.norm(velocity, axis=-1).max(initial=0.0)
    longest_step = min(MAX_STEP, MAX_LOSS / max(ball.drag * fastest, 1e-12))
    n_steps = max(1, int(np.ceil(np.abs(time).max(initial=0.0) / longest_step)))
    for _ in range(n_steps):
        position, velocity = _moved_on(position, velocity, time / n_steps, ball)
    return position, velocity


def _moved_on(
    position: np.ndarray, velocity: np.ndarray, step: np.ndarray, ball: Ball
) -> tuple[np.ndarray, np.ndarray]:
    """States (..., 3) a step (...) [s] later, by the classical method of Runge and Kutta."""
    h = step[..., None]
    first = acceleration(velocity, ball)
    second = acceleration(velocity + 0.5 * h * first, ball)
    third = acceleration(velocity + 0.5 * h * second, ball)
    last = acceleration(velocity + h * third, ball)
    return (
        position + h * (velocity + h / 6.0 * (first + second + third)),
        velocity + h / 6.0 * (first + 2.0 * (second + third) + last),
    )


def landing(
    position: np.ndarray,
    velocity: np.ndarray,
    plane_z: float | np.ndarray,
    ball: Ball = TENNIS_BALL,
) -> Landing:
    """Where balls with position, velocity (..., 3) cross the plane z = plane_z (...) going down.

    The time of the flight in vacuum starts a Newton iteration on the height. A crossing that lies
    in the past, or a plane above the highest point, gives nan.
    """
    position, velocity = _states(position, velocity)
    plane_z = np.asarray(plane_z, dtype=float)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(velocity[..., 2] ** 2 + 2.0 * ball.gravity * (position[..., 2] - plane_z))
    time = (velocity[..., 2] + root) / ball.gravity
    return _crossing(position, velocity, time, UP, plane_z, ball)


def crossing(
    position: np.ndarray,
    velocity: np.ndarray,
    normal: np.ndarray,
    offset: float,
    ball: Ball = TENNIS_BALL,
) -> Landing:
    """Where balls with position, velocity (..., 3) cross the vertical plane normal . p = offset in
    the direction of its normal.

    Parameters
    ----------
    normal : (3,)
        Horizontal unit vector. A ball that is beyond the plane already, or flies away from it,
        gives nan.

    Raises
    ------
    ValueError
        For another normal, or an offset that is not finite.
    """
    position, velocity = _states(position, velocity)
    normal = np.asarray(normal, dtype=float)
    if (
        normal.shape != (3,)
        or normal[2] != 0.0
        or not abs(normal @ normal - 1.0) < 1e-9
        or not np.isfinite(offset)
    ):
        raise ValueError(
            f"normal {normal} of a vertical plane must be a horizontal unit vector (3,), and"
            f" offset {offset} finite"
        )
    approach = velocity @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(approach > 0.0, (offset - position @ normal) / approach, np.nan)
    return _crossing(position, velocity, time, -normal, np.asarray(-offset), ball)


def _crossing(
    position: np.ndarray,
    velocity: np.ndarray,
    time: np.ndarray,
    normal: np.ndarray,
    offset: np.ndarray,
    ball: Ball,
) -> Landing:
    """Where balls (..., 3) cross planes normal . p = offset (...) against their normal; time (...)
    is that of the flight in vacuum, from which Newton's iteration on the height begins.
    """
    instant = np.where(time >= 0.0, time, 0.0)
    place, speed = _fly(position, velocity, instant, ball)
    for _ in range(MOST_CORRECTIONS):
        rate = speed @ normal
        step = (offset - place @ normal) / np.where(rate < 0.0, rate, np.nan)
        step = np.clip(np.where(rate < 0.0, step, MAX_STEP), -MAX_STEP, MAX_STEP)
        if np.abs(step).max(initial=0.0) < CLOSE:
            break
        place, speed = _moved_on(place, speed, step, ball)
        instant = instant + step
    crosses = (
        (time >= 0.0)
        & (np.abs(place @ normal - offset) < CROSSED)
        & (speed @ normal < 0.0)
        & (instant >= 0.0)
    )
    place, speed = (np.where(crosses[..., None], part, np.nan) for part in (place, speed))
    return Landing(place, speed, np.where(crosses, instant, np.nan))


def fit_flight(
    time: np.ndarray,
    position: np.ndarray,
    ball: Ball = TENNIS_BALL,
    at: float | None = None,
    near: FlightFit | None = None,
) -> FlightFit:
    """Least-squares flight through samples with known drag and gravity.

    Parameters
    ----------
    time : (n,) [s]
    position : (n, 3) [m]
        n >= 3.
    at
        Instant of the fitted state, by default the first sample.
    near
        A flight that is like it, which saves time and changes the result by less than a
        micrometre.

    Raises
    ------
    ValueError
        For an instant that is not finite.
    """
    time, position = check_samples("ball", time, position, least=3)
    origin = float(time[0] if at is None else at)
    if not np.isfinite(origin):
        raise ValueError(f"at = {origin}: the instant of the fitted state must be finite")
    first = None if near is None else near.state_at(origin)[None]
    start, velocity, residuals = fit_flights(time[None] - origin, position[None], ball, first)
    return FlightFit(origin, start[0], velocity[0], residuals[0], ball)


def fit_flights(
    time: np.ndarray,
    position: np.ndarray,
    ball: Ball = TENNIS_BALL,
    first: np.ndarray | None = None,
    accuracy: float = 1e-8,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fits w flights to n samples each: positions and velocities (w, 3) at time 0, misfits (w, n)
    [m].

    The method of Gauss and Newton, with one sensitivity of the flights for all repetitions: drag
    changes it little.

    Parameters
    ----------
    time : (w, n) [s]
    position : (w, n, 3) [m]
        Trusted to be valid.
    first : (w, 2, 3)
        Positions and velocities to begin with, default those of the flights in vacuum that fit
        best.
    accuracy : [m]
        A repetition that moves no sample by more is the last.
    """
    state = _lines(time, position, ball) if first is None else first
    w, n = time.shape
    probes = state[:, 1, None] + np.concatenate([np.zeros((1, 3)), PROBE * np.eye(3)])
    probed = _fly(state[:, 0, None, None], probes[:, :, None], time[:, None], ball)[0]
    slopes = np.empty((w, 6, n, 3))  # a flight that begins elsewhere is the same flight there
    slopes[:, :3] = np.eye(3)[:, None]
    slopes[:, 3:] = (probed[:, 1:] - probed[:, :1]) / PROBE
    flat = slopes.reshape(w, 6, 3 * n)
    solve = np.linalg.solve(flat @ flat.swapaxes(1, 2), flat)
    left = position - probed[:, 0]
    for _ in range(MOST_REPETITIONS):
        change = (solve @ left.reshape(w, 3 * n, 1)).reshape(w, 2, 3)
        state = state + change
        left = position - _fly(state[:, 0, None], state[:, 1, None], time, ball)[0]
        moves = np.abs(change[:, 0]).max() + np.abs(time).max() * np.abs(change[:, 1]).max()
        if moves < accuracy:
            break
    return state[:, 0], state[:, 1], np.linalg.norm(left, axis=-1)


def _lines(time: np.ndarray, position: np.ndarray, ball: Ball) -> np.ndarray:
    """States (w, 2, 3) at time 0 of the flights in vacuum that fit samples (w, n, 3) at times
    (w, n) best: lines, but for gravity.
    """
    lifted = position + 0.5 * ball.gravity * np.square(time)[..., None] * UP
    middle = time.mean(axis=1, keepdims=True)
    since = time - middle
    slope = np.einsum("wn,wnd->wd", since, lifted) / np.square(since).sum(axis=1, keepdims=True)
    return np.stack([lifted.mean(axis=1) - middle * slope, slope], axis=1)


def may_fly(
    time: np.ndarray, position: np.ndarray, tolerance: float, ball: Ball = TENNIS_BALL
) -> tuple[np.ndarray, np.ndarray]:
    """Whether w series of n samples each may be within a tolerance [m] of flights, (w,), and the
    flights in vacuum that fit them best, (w, 2, 3), with which `fit_flights` may begin.

    Drag, k |v|^2, moves a ball off a flight in vacuum with the same ends by at most k |v|^2 T^2 /
    8. The flight in vacuum that fits best is off the samples by no more than that one, root mean
    square: by this and the tolerance. |v| is below the sum of the speeds at both ends.

    Parameters
    ----------
    time : (w, n) [s]
    position : (w, n, 3) [m]
        Trusted to be valid, the first time of each is 0.
    """
    states, last = _lines(time, position, ball), time[:, -1]
    start, velocity = states[:, 0, None], states[:, 1, None]
    off = position - start - velocity * time[..., None]
    off = off + 0.5 * ball.gravity * np.square(time)[..., None] * UP
    fastest = np.linalg.norm(states[:, 1], axis=1) + np.linalg.norm(
        states[:, 1] - ball.gravity * last[:, None] * UP, axis=1
    )
    bound = tolerance + ball.drag * np.square(fastest * last) / 8.0
    return np.square(off).sum(axis=(1, 2)) <= time.shape[1] * np.square(bound), states


def _states(position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, velocity = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    for name, value in (("position", position), ("velocity", velocity)):
        if value.shape[-1:] != (3,):
            raise ValueError(f"{name} of a ball must have shape (..., 3), got {value.shape}")
        if not np.isfinite(value).all():
            raise ValueError(f"{name} of a ball must be finite, got {value}")
    if position.shape != velocity.shape:
        raise ValueError(
            f"position {position.shape} and velocity {velocity.shape} of a ball differ in shape"
        )
    return position, velocity
