"""Flight of a thrown ball with quadratic drag, forward, backward and fitted to samples.

    dv/dt = (0, 0, -g) - k |v| v,    k = rho Cd A / (2 m)

Everything takes any number of throws and instants. The equation is integrated with classical
Runge-Kutta steps in which drag takes no more than a hundredth of the speed, and of at most 100 ms:
for a tennis ball the result is exact to a micrometre after 1.2 s. The loops over flights are in
`flight_steps`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from dart_skill.common.checks import check_samples
from dart_skill.common.constants import AIR_DENSITY, GRAVITY
from dart_skill.common.flight_steps import cross, fit, fit_together, fly, lines
from dart_skill.common.flight_steps import may_fly as steps_may_fly
from dart_skill.common.world import the_world

UP = np.array([0.0, 0.0, 1.0])


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
        if time == self.time:
            return np.stack([self.position, self.velocity])
        if not math.isfinite(time):
            raise ValueError(f"time of a flight is {time}: it must be finite")
        states = fly(
            self.position[None],
            self.velocity[None],
            np.array([[time - self.time]]),
            self.ball.drag,
            self.ball.gravity,
        )
        return np.concatenate(states)[:, 0]


def acceleration(velocity: np.ndarray, ball: Ball = TENNIS_BALL) -> np.ndarray:
    """Acceleration (..., 3) [m/s^2] of a ball that flies with `velocity` (..., 3)."""
    velocity = np.asarray(velocity, dtype=float)
    return (
        -ball.drag * np.linalg.norm(velocity, axis=-1, keepdims=True) * velocity
        - ball.gravity * UP
    )


def flight(
    position: np.ndarray, velocity: np.ndarray, times: np.ndarray, ball: Ball = TENNIS_BALL
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n_times, ..., 3) of balls at `times` (n_times,) [s], negative ones
    too.

    Parameters
    ----------
    position, velocity
        (..., 3) at time 0, world frame, Z up.

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
    starts, speeds = position.reshape(-1, 3), velocity.reshape(-1, 3)
    each = times[None] if len(starts) == 1 else np.broadcast_to(times, (len(starts), len(times)))
    points, rates = fly(starts, speeds, each, ball.drag, ball.gravity)
    shape = times.shape + position.shape
    return points.swapaxes(0, 1).reshape(shape), rates.swapaxes(0, 1).reshape(shape)


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
    is that of the flight in vacuum.
    """
    shape = time.shape
    if position.shape[:-1] != shape:
        position, velocity = (
            np.broadcast_to(position, (*shape, 3)),
            np.broadcast_to(velocity, (*shape, 3)),
        )
    if offset.shape != shape:
        offset = np.broadcast_to(offset, shape)
    starts, speeds = position.reshape(-1, 3), velocity.reshape(-1, 3)
    points, rates, times = cross(
        starts, speeds, time.reshape(-1), normal, offset.reshape(-1), ball.drag, ball.gravity
    )
    return Landing(points.reshape(*shape, 3), rates.reshape(*shape, 3), times.reshape(shape))


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

    In vacuum the fit is linear in the state. Drag moves the samples of a known flight by a known
    amount, so that the linear fit is repeated on samples from which the drag of the last flight is
    taken away; each repetition shrinks the error by about k |v| t (a tenth). A single flight,
    which may be long, is fitted with its sensitivity to the state instead, drag included: one or
    two repetitions.

    Parameters
    ----------
    time : (w, n) [s]
    position : (w, n, 3) [m]
        Trusted to be valid.
    first : (w, 2, 3)
        Positions and velocities to begin with.
    accuracy : [m]
        A repetition that moves no sample by more is the last.
    """
    state = lines(time, position, ball.gravity) if first is None else first
    if len(time) == 1:
        found, distances = fit(time[0], position[0], state[0], ball.drag, ball.gravity, accuracy)
        return found[:1], found[1:], distances[None]
    found, distances = fit_together(time, position, state, ball.drag, ball.gravity, accuracy)
    return found[:, 0], found[:, 1], distances


def may_fly(
    time: np.ndarray, position: np.ndarray, tolerance: float, ball: Ball = TENNIS_BALL
) -> tuple[np.ndarray, np.ndarray]:
    """Whether w series of n samples each may be within a tolerance [m] of flights, (w,), and the
    flights in vacuum that fit them best, (w, 2, 3): for all but those that cannot be,
    `fit_flights` may begin with these, as it does by itself.

    Parameters
    ----------
    time : (w, n) [s]
    position : (w, n, 3) [m]
        Trusted to be valid, the first time of each is 0.
    """
    states = lines(time, position, ball.gravity)
    return steps_may_fly(time, position, states, ball.drag, ball.gravity, tolerance), states


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
