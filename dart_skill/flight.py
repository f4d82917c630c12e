"""Flight of a thrown ball with quadratic drag, forward, backward and fitted to samples.

    dv/dt = (0, 0, -g) - k |v| v,    k = rho Cd A / (2 m)

Everything is vectorised over throws and instants. The equation is integrated with classical Runge-Kutta steps in which drag
takes no more than a hundredth of the speed, and of at most 100 ms: for a tennis ball the result is exact to a micrometre after 1.2 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from dart_skill.checks import check_samples
from dart_skill.constants import AIR_DENSITY, GRAVITY
from dart_skill.world import the_world

MAX_STEP, MAX_LOSS = 0.1, 0.01  # of an integration step: its length [s], and the share of the speed that drag takes in it
PROBE = 1e-4  # difference of state with which the sensitivity of a flight is found [m, m/s]
PROBES = PROBE * np.eye(4, 3, -1)  # of the velocity: none, and one along each axis


@dataclass(frozen=True)
class Ball:
    """A ball, and the air and gravity that it flies in.

    * mass: [kg].
    * diameter: [m].
    * drag_coefficient: of a sphere, without a unit.
    * air_density: [kg/m^3].
    * gravity: [m/s^2], downwards.
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


TENNIS_BALL = Ball(the_world().ball_mass, the_world().ball_diameter, the_world().ball_drag_coefficient)
"""The ball of config/world.yaml."""
DART = Ball(mass=0.024, diameter=0.007, drag_coefficient=3.0)
"""A steel-tip dart, its attitude that of its velocity: a barrel of 7 mm and 24 g (rules allow 50 g; most weigh 20 to 26 g).

No measured drag was found in print. Laminar friction (Blasius) on four fins of 20 x 40 mm and 140 mm of body, and a blunt end, at 4 m/s
make a drag area of 1.1 cm^2: 3 times the barrel's cross-section. The drag of a dart, 0.05 m/s^2, is then a seventh of a tennis ball's.
"""


@dataclass(frozen=True)
class Landing:
    """Where and when balls cross a plane: a horizontal one going down, or a vertical one; nan where they never do.

    position (..., 3) [m], velocity (..., 3) [m/s], time (...) [s] after the start of the flight.
    """

    position: np.ndarray
    velocity: np.ndarray
    time: np.ndarray


@dataclass(frozen=True)
class FlightFit:
    """A flight fitted to samples.

    * time: of the state [s].
    * position, velocity: (3,), the state [m], [m/s].
    * residuals: (n,), distance of every sample [m].
    * ball: that flew.
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
        return flight(self.position, self.velocity, np.asarray(times, dtype=float) - self.time, self.ball)

    def state_at(self, time: float) -> np.ndarray:
        """Position and velocity (2, 3) at one absolute time [s]; ValueError for one that is not finite."""
        if time == self.time:
            return np.stack([self.position, self.velocity])
        if not math.isfinite(time):
            raise ValueError(f"time of a flight is {time}: it must be finite")
        return np.stack(_integrate(self.position, self.velocity, np.float64(time - self.time), self.ball))


def acceleration(velocity: np.ndarray, ball: Ball = TENNIS_BALL) -> np.ndarray:
    """Acceleration (..., 3) [m/s^2] of a ball that flies with `velocity` (..., 3)."""
    return _acceleration(np.asarray(velocity).T, ball.drag, ball.gravity).T


def flight(position: np.ndarray, velocity: np.ndarray, times: np.ndarray, ball: Ball = TENNIS_BALL) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (n_times, ..., 3) of balls at `times` (n_times,) [s], negative ones too.

    position, velocity: (..., 3) at time 0, world frame, Z up. ValueError for times that are not finite.
    """
    position, velocity = _states(position, velocity)
    times = np.asarray(times, dtype=float)
    if times.ndim != 1 or not np.isfinite(times).all():
        raise ValueError(f"times of a flight must be a finite (n,) array, got shape {times.shape}: {times}")
    duration = times.reshape(times.shape + (1,) * (position.ndim - 1))
    return _integrate(position[None], velocity[None], duration, ball)


def landing(position: np.ndarray, velocity: np.ndarray, plane_z: float | np.ndarray, ball: Ball = TENNIS_BALL) -> Landing:
    """Where balls with position, velocity (..., 3) cross the plane z = plane_z (...) going down.

    The time of the flight in vacuum starts a Newton iteration on the height. A crossing that lies in the
    past, or a plane above the highest point, gives nan.
    """
    position, velocity = _states(position, velocity)
    plane_z = np.asarray(plane_z, dtype=float)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(velocity[..., 2] ** 2 + 2.0 * ball.gravity * (position[..., 2] - plane_z))
    time = (velocity[..., 2] + root) / ball.gravity
    return _crossing(position, velocity, time, lambda point: point[..., 2] - plane_z, lambda speed: speed[..., 2], ball)


def crossing(position: np.ndarray, velocity: np.ndarray, normal: np.ndarray, offset: float, ball: Ball = TENNIS_BALL) -> Landing:
    """Where balls with position, velocity (..., 3) cross the vertical plane normal . p = offset in the direction of its normal.

    normal (3,): horizontal unit vector. A ball that is beyond the plane already, or flies away from it, gives nan. ValueError for another
    normal, or an offset that is not finite.
    """
    position, velocity = _states(position, velocity)
    normal = np.asarray(normal, dtype=float)
    if normal.shape != (3,) or normal[2] != 0.0 or not abs(normal @ normal - 1.0) < 1e-9 or not np.isfinite(offset):
        raise ValueError(f"normal {normal} of a vertical plane must be a horizontal unit vector (3,), and offset {offset} finite")
    approach = velocity @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.where(approach > 0.0, (offset - position @ normal) / approach, np.nan)
    return _crossing(position, velocity, time, lambda point: offset - point @ normal, lambda speed: -(speed @ normal), ball)


def _crossing(
    position: np.ndarray,
    velocity: np.ndarray,
    time: np.ndarray,
    before: Callable[[np.ndarray], np.ndarray],
    rate: Callable[[np.ndarray], np.ndarray],
    ball: Ball,
) -> Landing:
    """Newton's iteration on how far a ball is before a plane, which changes at a rate, from the time (...) of the flight in vacuum."""
    possible = time >= 0.0
    time = np.where(possible, time, 0.0)
    point, speed = _integrate(position, velocity, time, ball)
    missing, approach = before(point), rate(speed)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(12):
            step = np.where(approach < 0.0, missing / -approach, MAX_STEP)
            step = np.where(possible, np.minimum(np.maximum(step, -0.1), 0.1), 0.0)
            if (np.abs(step) < 1e-12).all():
                break
            point, speed = _steps(point, speed, step, 1, ball)
            missing, approach = before(point), rate(speed)
            time = time + step
    crossed = possible & (np.abs(missing) < 1e-6) & (approach < 0.0) & (time >= 0.0)
    if crossed.all():
        return Landing(point, speed, time)
    return Landing(
        np.where(crossed[..., None], point, np.nan),
        np.where(crossed[..., None], speed, np.nan),
        np.where(crossed, time, np.nan),
    )


def fit_flight(
    time: np.ndarray, position: np.ndarray, ball: Ball = TENNIS_BALL, at: float | None = None, near: FlightFit | None = None
) -> FlightFit:
    """Least-squares flight through samples with known drag and gravity.

    time (n,) [s], position (n, 3) [m], n >= 3; at: instant of the fitted state, by default the first sample; near: a flight that is
    like it, which saves time and changes the result by less than a micrometre. ValueError for an instant that is not finite.
    """
    time, position = check_samples("ball", time, position, least=3)
    origin = float(time[0] if at is None else at)
    if not np.isfinite(origin):
        raise ValueError(f"at = {origin}: the instant of the fitted state must be finite")
    first = None if near is None else near.state_at(origin)[None]
    start, velocity, residuals = fit_flights(time[None] - origin, position[None], ball, first)
    return FlightFit(origin, start[0], velocity[0], residuals[0], ball)


def fit_flights(
    time: np.ndarray, position: np.ndarray, ball: Ball = TENNIS_BALL, first: np.ndarray | None = None, accuracy: float = 1e-8
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fits w flights to n samples each: positions and velocities (w, 3) at time 0, misfits (w, n) [m].

    time (w, n) [s], position (w, n, 3) [m], trusted to be valid; first (w, 2, 3): positions and velocities to begin with;
    accuracy [m]: a repetition that moves no sample by more is the last.

    In vacuum the fit is linear in the state. Drag moves the samples of a known flight by a known amount, so
    that the linear fit is repeated on samples from which the drag of the last flight is taken away; each
    repetition shrinks the error by about k |v| t (a tenth). A single flight, which may be long, is fitted with its
    sensitivity to the state instead, drag included: one or two repetitions.
    """
    if first is None or len(time) > 1:
        solve = _lines(time)
        fall = np.zeros_like(position)
        fall[..., 2] = -0.5 * ball.gravity * time**2
    state = solve @ (position - fall) if first is None else first  # (w, 2, 3)
    if len(time) == 1:
        state, misfit = _fit_with_sensitivity(state, time, position, ball, accuracy)
        return state[:, 0], state[:, 1], misfit
    for _ in range(30):
        misfit = position - _predicted(state, time, ball)
        change = solve @ misfit
        state = state + change
        if np.max(np.abs(change[:, 0]) + np.max(np.abs(time)) * np.abs(change[:, 1])) < accuracy:
            break
    return state[:, 0], state[:, 1], np.linalg.norm(misfit, axis=-1)


def _fit_with_sensitivity(
    state: np.ndarray, time: np.ndarray, position: np.ndarray, ball: Ball, accuracy: float
) -> tuple[np.ndarray, np.ndarray]:
    """State (1, 2, 3) and misfits (1, n) of a single flight: the method of Gauss and Newton with one sensitivity for all repetitions.

    A change of the state by c leaves an error of about k t c^2: where that is small enough, the flight moves as its sensitivity says.
    """
    predicted, sensitivity = _sensitivity(state[0], time[0], ball)
    orthonormal, triangle = np.linalg.qr(sensitivity)
    bent = ball.drag * np.max(np.abs(time))
    for _ in range(30):
        misfit = (position - predicted).ravel()
        change = np.linalg.solve(triangle, orthonormal.T @ misfit)
        state = state + change.reshape(1, 2, 3)
        if bent * np.max(change**2) < accuracy:
            break
        predicted = _predicted(state, time, ball)
    left = misfit - sensitivity @ change
    return state, np.linalg.norm(left.reshape(position.shape), axis=-1)


def _lines(time: np.ndarray) -> np.ndarray:
    """What makes of n samples at times (w, n) the value at 0 and the slope of the line that fits them best (w, 2, n)."""
    mean = time.mean(axis=1, keepdims=True)
    slope = (time - mean) / np.square(time - mean).sum(axis=1, keepdims=True)
    return np.stack([1.0 / time.shape[1] - mean * slope, slope], axis=1)


def _predicted(state: np.ndarray, time: np.ndarray, ball: Ball) -> np.ndarray:
    """Positions (w, n, 3) of flights with states (w, 2, 3) at times (w, n)."""
    return _integrate(state[:, None, 0], state[:, None, 1], time, ball)[0]


def _sensitivity(state: np.ndarray, time: np.ndarray, ball: Ball) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) at times (n,) of the flight with the state (2, 3), and their derivative (3 n, 6) by the state."""
    probes = np.repeat(state[None], 4, axis=0)
    probes[:, 1] += PROBES
    positions = _predicted(probes, time[None], ball)
    derivative = np.empty((len(time), 3, 6))
    derivative[:, :, :3] = np.eye(3)  # a flight that begins elsewhere is the same flight there
    derivative[:, :, 3:] = np.moveaxis((positions[1:] - positions[0]) / PROBE, 0, 2)
    return positions[0], derivative.reshape(-1, 6)


def _states(position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    position, velocity = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    for name, value in (("position", position), ("velocity", velocity)):
        if value.shape[-1:] != (3,):
            raise ValueError(f"{name} of a ball must have shape (..., 3), got {value.shape}")
        if not np.isfinite(value).all():
            raise ValueError(f"{name} of a ball must be finite, got {value}")
    if position.shape != velocity.shape:
        raise ValueError(f"position {position.shape} and velocity {velocity.shape} of a ball differ in shape")
    return position, velocity


def _integrate(position: np.ndarray, velocity: np.ndarray, time: np.ndarray, ball: Ball) -> tuple[np.ndarray, np.ndarray]:
    """States (..., 3) over times (...), broadcast against each other: as many equal steps as the longest of them needs."""
    fastest = math.hypot(*velocity.ravel().tolist()) if velocity.size == 3 else math.sqrt(_squared(velocity).max(initial=0.0))
    longest_step = min(MAX_STEP, MAX_LOSS / max(ball.drag * fastest, 1e-12))
    n_steps = max(1, math.ceil(np.abs(time).max(initial=0.0) / longest_step))
    return _steps(position, velocity, time / n_steps, n_steps, ball)


def _squared(vectors: np.ndarray) -> np.ndarray:
    """Squares (...) of the lengths of vectors (..., 3)."""
    return np.einsum("...i,...i->...", vectors, vectors)


def _steps(position: np.ndarray, velocity: np.ndarray, step: np.ndarray, n_steps: int, ball: Ball) -> tuple[np.ndarray, np.ndarray]:
    """States (..., 3) after n_steps steps of lengths (...), broadcast against each other.

    In between, the axes are reversed: numpy is twice as fast on three long rows as on many rows of three.
    """
    if velocity.size == 3 and step.size == 1:
        return _steps_of_one(position, velocity, step, n_steps, ball)
    position, velocity, step = np.ascontiguousarray(position.T), np.ascontiguousarray(velocity.T), step.T
    if step.ndim > 1:  # in full, as an inner loop over a few numbers is slow
        step = np.ascontiguousarray(np.broadcast_to(step, np.broadcast_shapes(step.shape, velocity.shape[1:])))
    half, sixth = 0.5 * step, step / 6.0
    for _ in range(n_steps):
        position, velocity = _runge_kutta(position, velocity, step, half, sixth, ball.drag, ball.gravity)
    return np.ascontiguousarray(position.T), np.ascontiguousarray(velocity.T)


def _runge_kutta(
    position: np.ndarray, velocity: np.ndarray, step: np.ndarray, half: np.ndarray, sixth: np.ndarray, drag: float, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """One step (...), given with its half and sixth, of states (3, ...)."""
    a1 = _acceleration(velocity, drag, gravity)
    a2 = _acceleration(_moved(velocity, half, a1), drag, gravity)
    a3 = _acceleration(_moved(velocity, half, a2), drag, gravity)
    a4 = _acceleration(_moved(velocity, step, a3), drag, gravity)
    a2 += a3
    position = _moved(position, step, _moved(velocity, sixth, a1 + a2))
    a2 *= 2.0
    a2 += a1
    a2 += a4
    return position, _moved(velocity, sixth, a2)


def _moved(start: np.ndarray, step: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Where a start (3, ...) comes to at a rate (3, ...) in steps (...)."""
    moved = step * rate
    return np.add(moved, start, out=moved)


def _acceleration(velocity: np.ndarray, drag: float, gravity: float) -> np.ndarray:
    """Of a velocity (3, ...)."""
    result = velocity * velocity
    speed = result[0] + result[1]
    speed += result[2]
    speed = np.sqrt(speed)
    speed *= -drag
    np.multiply(speed, velocity, out=result)
    result[2] -= gravity
    return result


def _steps_of_one(position: np.ndarray, velocity: np.ndarray, step: np.ndarray, n_steps: int, ball: Ball) -> tuple[np.ndarray, np.ndarray]:
    """The same, to the last bit, of one ball in plain numbers: a tenth of the time, since each call of NumPy takes as long as a step."""
    shape = (*(1,) * max(velocity.ndim - 1, step.ndim), 3)
    p, v, h, drag, gravity = position.ravel().tolist(), velocity.ravel().tolist(), step.item(), -ball.drag, ball.gravity
    half, sixth = 0.5 * h, h / 6.0

    def pulled(x: float, y: float, z: float) -> tuple[float, float, float]:
        braked = math.sqrt(x * x + y * y + z * z) * drag
        return braked * x, braked * y, braked * z - gravity

    for _ in range(n_steps):
        a1 = pulled(*v)
        a2 = pulled(*[u + half * a for u, a in zip(v, a1, strict=True)])
        a3 = pulled(*[u + half * a for u, a in zip(v, a2, strict=True)])
        a4 = pulled(*[u + h * a for u, a in zip(v, a3, strict=True)])
        middle = [b + c for b, c in zip(a2, a3, strict=True)]
        p = [x + h * (u + sixth * (a + m)) for x, u, a, m in zip(p, v, a1, middle, strict=True)]
        v = [u + sixth * (a + 2.0 * m + b) for u, a, m, b in zip(v, a1, middle, a4, strict=True)]
    return np.array(p).reshape(shape), np.array(v).reshape(shape)
