"""Flights of balls with quadratic drag: steps of integration, where a plane is crossed, and the
flight that fits samples best.

    dv/dt = (0, 0, -g) - k |v| v

The equation is integrated with classical Runge-Kutta steps. Every function takes the drag k [1/m]
and the gravity g [m/s^2], and trusts its arguments: `dart_skill.common.flight` checks them. This
module is compiled (docs/development.md): flight_steps.pxd beside it has the types.
"""

import math

import numpy as np

MAX_STEP, MAX_LOSS = 0.1, 0.01
"""Limits of an integration step: its length [s], and the share of the speed that drag takes in it.
"""
PROBE = 1e-4
"""Difference of velocity with which the sensitivity of a flight is found [m/s]."""
MOST_CORRECTIONS, CLOSE, CROSSED = 12, 1e-12, 1e-6
"""Corrections of the instant of a crossing: most of them, the last one [s], and how near to the
plane a ball must be then [m].
"""
MOST_REPETITIONS = 30
"""Most repetitions of a fit."""


def fly(
    position: np.ndarray, velocity: np.ndarray, time: np.ndarray, drag: float, gravity: float
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (w, n, 3) of w flights at n times each: as many equal steps as the
    longest of all needs.

    Parameters
    ----------
    position, velocity
        (w, 3) at time 0 [m], [m/s].
    time
        (w, n) [s], negative ones too.
    drag, gravity
        [1/m], [m/s^2].
    """
    n_flights, n_times = time.shape[0], time.shape[1]
    points, speeds = np.empty((n_flights * n_times, 3)), np.empty((n_flights * n_times, 3))
    _predict(
        position, velocity, time, drag, gravity, points, speeds, np.empty(n_flights * n_times)
    )
    return points.reshape(n_flights, n_times, 3), speeds.reshape(n_flights, n_times, 3)


def cross(
    position: np.ndarray,
    velocity: np.ndarray,
    time: np.ndarray,
    normal: np.ndarray,
    offset: np.ndarray,
    drag: float,
    gravity: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where balls cross planes against their normal: positions and velocities (n, 3), times (n,);
    nan for balls that never do.

    Newton's iteration on the height above the plane, normal . p - offset.

    Parameters
    ----------
    position, velocity
        (n, 3) at time 0 [m], [m/s].
    time
        (n,) at which the iteration begins [s], negative or nan for balls that never cross.
    normal
        (3,) of all planes, a unit vector.
    offset
        (n,) of each plane [m].
    drag, gravity
        [1/m], [m/s^2].
    """
    n, never = position.shape[0], float("nan")
    points, speeds, crossing = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    place, speed, instant, begin, step = points, speeds, crossing, np.zeros((n, 1)), np.empty(n)
    for i in range(n):
        if time[i] >= 0.0:
            begin[i, 0] = time[i]
    _predict(position, velocity, begin, drag, gravity, place, speed, step)
    for i in range(n):
        instant[i] = begin[i, 0]
        if not (
            time[i] >= 0.0
            and _crosses(
                place[i : i + 1],
                speed[i : i + 1],
                instant[i : i + 1],
                normal,
                offset[i],
                drag,
                gravity,
            )
        ):
            instant[i] = never
            for k in range(3):
                place[i, k] = speed[i, k] = never
    return points, speeds, crossing


def fit(
    time: np.ndarray,
    position: np.ndarray,
    first: np.ndarray,
    drag: float,
    gravity: float,
    accuracy: float,
) -> tuple[np.ndarray, np.ndarray]:
    """State (2, 3) at time 0 of the flight that fits n samples best, and the distances (n,) of
    these [m].

    The method of Gauss and Newton with one sensitivity for all repetitions. A change of the state
    by c leaves an error of about k t c^2: where that is small enough, the flight moves as its
    sensitivity says.

    Parameters
    ----------
    time
        (n,), increasing [s].
    position
        (n, 3) [m].
    first
        Position and velocity (2, 3) to begin with.
    drag, gravity
        [1/m], [m/s^2].
    accuracy
        [m], a repetition that moves no sample by more is the last.
    """
    n = time.shape[0]
    found, distances, change = np.empty((2, 3)), np.empty(n), np.empty(6)
    state, away, left = found, distances, np.empty(3 * n)
    points, directions, triangle = np.empty((n, 3)), np.empty((6, 3 * n)), np.empty((6, 6))
    longest = max(abs(time[0]), abs(time[n - 1]))
    for k in range(6):
        state[k // 3, k % 3] = first[k // 3, k % 3]
    _sensitivity(state, time, drag, gravity, points, directions)
    _orthonormalise(directions, triangle)
    for _ in range(MOST_REPETITIONS):
        for i in range(n):
            for k in range(3):
                left[3 * i + k] = position[i, k] - points[i, k]
        _solve(directions, triangle, left, change)
        largest = 0.0
        for k in range(6):
            state[k // 3, k % 3] += change[k]
            largest = max(largest, change[k] * change[k])
        if drag * longest * largest < accuracy:
            break
        _follow(state[:1], state[1:], time, drag, gravity, points)
    for i in range(n):
        away[i] = math.sqrt(
            left[3 * i] * left[3 * i]
            + left[3 * i + 1] * left[3 * i + 1]
            + left[3 * i + 2] * left[3 * i + 2]
        )
    return found, distances


def lines(time: np.ndarray, position: np.ndarray, gravity: float) -> np.ndarray:
    """States (w, 2, 3) at time 0 of the w flights in vacuum that fit n samples each best: lines,
    but for gravity.

    Parameters
    ----------
    time
        (w, n) [s].
    position
        (w, n, 3) [m].
    gravity
        [m/s^2].
    """
    n_flights, n = time.shape[0], time.shape[1]
    states, lifted = np.empty((n_flights, 2, 3)), np.empty((n, 3))
    state = states
    for i in range(n_flights):
        for j in range(n):
            for k in range(3):
                lifted[j, k] = position[i, j, k]
            lifted[j, 2] += 0.5 * gravity * time[i, j] * time[i, j]
        _line(time[i], lifted, state[i])
    return states


def may_fly(
    time: np.ndarray,
    position: np.ndarray,
    states: np.ndarray,
    drag: float,
    gravity: float,
    tolerance: float,
) -> np.ndarray:
    """Whether (w,) n samples each may be within a tolerance of a flight, as far as the flights in
    vacuum that fit them best tell.

    Drag, k |v|^2, moves a ball off a flight in vacuum with the same ends by at most k |v|^2 T^2 /
    8. The flight in vacuum that fits best is off the samples by no more than that one, root mean
    square: by this and the tolerance. |v| is below the sum of the speeds at both ends.

    Parameters
    ----------
    time
        (w, n) [s], beginning with 0.
    position
        (w, n, 3) [m].
    states
        (w, 2, 3), as of `lines`.
    drag, gravity
        [1/m], [m/s^2].
    tolerance
        [m].
    """
    n_flights, n = time.shape[0], time.shape[1]
    found = np.zeros(n_flights, dtype=np.uint8)
    may = found
    for i in range(n_flights):
        last, squares = time[i, n - 1], 0.0
        for j in range(n):
            x = position[i, j, 0] - states[i, 0, 0] - states[i, 1, 0] * time[i, j]
            y = position[i, j, 1] - states[i, 0, 1] - states[i, 1, 1] * time[i, j]
            z = (
                position[i, j, 2]
                - states[i, 0, 2]
                - states[i, 1, 2] * time[i, j]
                + 0.5 * gravity * time[i, j] * time[i, j]
            )
            squares += x * x + y * y + z * z
        across = states[i, 1, 0] * states[i, 1, 0] + states[i, 1, 1] * states[i, 1, 1]
        rise, fall = states[i, 1, 2], states[i, 1, 2] - gravity * last
        fastest = math.sqrt(across + rise * rise) + math.sqrt(across + fall * fall)
        bound = tolerance + drag * fastest * fastest * last * last / 8.0
        may[i] = squares <= n * bound * bound
    return found.astype(bool)


def fit_together(
    time: np.ndarray,
    position: np.ndarray,
    first: np.ndarray,
    drag: float,
    gravity: float,
    accuracy: float,
) -> tuple[np.ndarray, np.ndarray]:
    """States (w, 2, 3) at time 0 of the w flights that fit n samples each best, and the distances
    (w, n) of these [m].

    Lines are fitted to what the last flights leave of the samples, until they are flat.

    Parameters
    ----------
    time
        (w, n) [s].
    position
        (w, n, 3) [m].
    first
        States (w, 2, 3) to begin with.
    drag, gravity
        [1/m], [m/s^2].
    accuracy
        [m], a repetition that moves no sample by more is the last.
    """
    n_flights, n = time.shape[0], time.shape[1]
    found, distances, change, left = (
        np.empty((n_flights, 2, 3)),
        np.empty((n_flights, n)),
        np.empty((2, 3)),
        np.empty((n_flights * n, 3)),
    )
    state, away, speeds, step = (
        found,
        distances,
        np.empty((n_flights * n, 3)),
        np.empty(n_flights * n),
    )
    longest = 0.0
    for i in range(n_flights):
        for k in range(3):
            state[i, 0, k], state[i, 1, k] = first[i, 0, k], first[i, 1, k]
        for j in range(n):
            longest = max(longest, abs(time[i, j]))
    for _ in range(MOST_REPETITIONS):
        _predict(state[:, 0], state[:, 1], time, drag, gravity, left, speeds, step)
        largest = 0.0
        for i in range(n_flights):
            for j in range(n):
                for k in range(3):
                    left[i * n + j, k] = position[i, j, k] - left[i * n + j, k]
            _line(time[i], left[i * n : (i + 1) * n], change)
            for k in range(3):
                state[i, 0, k] += change[0, k]
                state[i, 1, k] += change[1, k]
                largest = max(largest, abs(change[0, k]) + longest * abs(change[1, k]))
        if largest < accuracy:
            break
    for i in range(n_flights):
        for j in range(n):
            away[i, j] = _length(left, i * n + j)
    return found, distances


def _line(time: np.ndarray, samples: np.ndarray, line: np.ndarray) -> None:
    """Write value at 0 and slope (2, 3) of the lines that fit samples (n, 3) at times (n,) best."""
    n = time.shape[0]
    middle = spread = 0.0
    for j in range(n):
        middle += time[j] / n
    for j in range(n):
        spread += (time[j] - middle) * (time[j] - middle)
    for k in range(3):
        mean = slope = 0.0
        for j in range(n):
            mean += samples[j, k] / n
            slope += (time[j] - middle) * samples[j, k]
        line[1, k] = slope / spread
        line[0, k] = mean - middle * line[1, k]


def _length(vectors: np.ndarray, i: int) -> float:
    """Length of the vector i of (n, 3)."""
    return math.sqrt(
        vectors[i, 0] * vectors[i, 0]
        + vectors[i, 1] * vectors[i, 1]
        + vectors[i, 2] * vectors[i, 2]
    )


def _needed(velocity: np.ndarray, time: np.ndarray, drag: float) -> int:
    """How many steps flights with velocities (w, 3) need for times (w, n)."""
    longest = 0.0
    for i in range(time.shape[0]):
        for j in range(time.shape[1]):
            longest = max(longest, abs(time[i, j]))
    return max(1, int(math.ceil(longest / _longest_step(velocity, drag))))


def _longest_step(velocity: np.ndarray, drag: float) -> float:
    """Longest step [s] of flights with velocities (w, 3)."""
    fastest = 0.0
    for i in range(velocity.shape[0]):
        fastest = max(
            fastest,
            velocity[i, 0] * velocity[i, 0]
            + velocity[i, 1] * velocity[i, 1]
            + velocity[i, 2] * velocity[i, 2],
        )
    return min(MAX_STEP, MAX_LOSS / max(drag * math.sqrt(fastest), 1e-12))


def _predict(
    position: np.ndarray,
    velocity: np.ndarray,
    time: np.ndarray,
    drag: float,
    gravity: float,
    points: np.ndarray,
    speeds: np.ndarray,
    step: np.ndarray,
) -> None:
    """Write what `fly` returns, flight by flight (w n, 3), and the lengths of the steps (w n,)."""
    row, n_steps = 0, _needed(velocity, time, drag)
    for i in range(time.shape[0]):
        for j in range(time.shape[1]):
            step[row] = time[i, j] / n_steps
            for k in range(3):
                points[row, k] = position[i, k]
                speeds[row, k] = velocity[i, k]
            row += 1
    _advance(points, speeds, step, n_steps, drag, gravity)


def _follow(
    position: np.ndarray,
    velocity: np.ndarray,
    time: np.ndarray,
    drag: float,
    gravity: float,
    points: np.ndarray,
) -> None:
    """Write where w flights are at increasing times (n,), flight by flight (w n, 3): from each
    time to the next, from 0 on and back.
    """
    n_flights, n = position.shape[0], time.shape[0]
    place, speed, step = np.empty((n_flights, 3)), np.empty((n_flights, 3)), np.empty(n_flights)
    longest_step, first = _longest_step(velocity, drag), 0
    while first < n and time[first] < 0.0:
        first += 1
    for way in range(-1, 2, 2):
        for i in range(n_flights):
            for k in range(3):
                place[i, k] = position[i, k]
                speed[i, k] = velocity[i, k]
        now, j = 0.0, first if way > 0 else first - 1
        while 0 <= j < n:
            n_steps = max(1, int(math.ceil(abs(time[j] - now) / longest_step)))
            for i in range(n_flights):
                step[i] = (time[j] - now) / n_steps
            _advance(place, speed, step, n_steps, drag, gravity)
            for i in range(n_flights):
                for k in range(3):
                    points[i * n + j, k] = place[i, k]
            now = time[j]
            j += way


def _advance(
    points: np.ndarray,
    speeds: np.ndarray,
    step: np.ndarray,
    n_steps: int,
    drag: float,
    gravity: float,
) -> None:
    """Move states (n, 3) on by n_steps steps of Runge and Kutta with lengths (n,)."""
    for _ in range(n_steps):
        for i in range(points.shape[0]):
            h, half, sixth = step[i], 0.5 * step[i], step[i] / 6.0
            x, y, z = speeds[i, 0], speeds[i, 1], speeds[i, 2]
            braked = _braked(x, y, z, drag)
            x1, y1, z1 = braked * x, braked * y, braked * z - gravity
            u, v, w = half * x1 + x, half * y1 + y, half * z1 + z
            braked = _braked(u, v, w, drag)
            x2, y2, z2 = braked * u, braked * v, braked * w - gravity
            u, v, w = half * x2 + x, half * y2 + y, half * z2 + z
            braked = _braked(u, v, w, drag)
            x3, y3, z3 = braked * u, braked * v, braked * w - gravity
            u, v, w = h * x3 + x, h * y3 + y, h * z3 + z
            braked = _braked(u, v, w, drag)
            x4, y4, z4 = braked * u, braked * v, braked * w - gravity
            x2, y2, z2 = x2 + x3, y2 + y3, z2 + z3
            points[i, 0] += h * (sixth * (x1 + x2) + x)
            points[i, 1] += h * (sixth * (y1 + y2) + y)
            points[i, 2] += h * (sixth * (z1 + z2) + z)
            speeds[i, 0] = sixth * (2.0 * x2 + x1 + x4) + x
            speeds[i, 1] = sixth * (2.0 * y2 + y1 + y4) + y
            speeds[i, 2] = sixth * (2.0 * z2 + z1 + z4) + z


def _braked(x: float, y: float, z: float, drag: float) -> float:
    """Rate at which drag changes a velocity, as a share of it [1/s]."""
    return -drag * math.sqrt(x * x + y * y + z * z)


def _crosses(
    place: np.ndarray,
    speed: np.ndarray,
    instant: np.ndarray,
    normal: np.ndarray,
    offset: float,
    drag: float,
    gravity: float,
) -> bool:
    """Move a state (1, 3) at an instant (1,) to where it crosses a plane; returns whether it does."""
    step = np.empty(1)
    for _ in range(MOST_CORRECTIONS):
        height, rate = _along(normal, place) - offset, _along(normal, speed)
        step[0] = height / -rate if rate < 0.0 else MAX_STEP
        step[0] = min(max(step[0], -MAX_STEP), MAX_STEP)
        if abs(step[0]) < CLOSE:
            break
        _advance(place, speed, step, 1, drag, gravity)
        instant[0] += step[0]
    return (
        abs(_along(normal, place) - offset) < CROSSED
        and _along(normal, speed) < 0.0
        and instant[0] >= 0.0
    )


def _along(normal: np.ndarray, vector: np.ndarray) -> float:
    """The part of a vector (1, 3) along a normal (3,)."""
    return normal[0] * vector[0, 0] + normal[1] * vector[0, 1] + normal[2] * vector[0, 2]


def _sensitivity(
    state: np.ndarray,
    time: np.ndarray,
    drag: float,
    gravity: float,
    points: np.ndarray,
    directions: np.ndarray,
) -> None:
    """Write positions (n, 3) at increasing times (n,) of the flight with a state (2, 3), and their
    derivatives (6, 3 n) by the state.
    """
    n = time.shape[0]
    starts, velocities, probed = np.empty((4, 3)), np.empty((4, 3)), np.empty((4 * n, 3))
    for i in range(4):  # the flight itself, and one that is faster along each axis
        for k in range(3):
            starts[i, k] = state[0, k]
            velocities[i, k] = state[1, k] + (PROBE if i == k + 1 else 0.0)
    _follow(starts, velocities, time, drag, gravity, probed)
    for j in range(n):
        for k in range(3):
            points[j, k] = probed[j, k]
            for axis in range(3):
                # a flight that begins elsewhere is the same flight there
                directions[axis, 3 * j + k] = 1.0 if axis == k else 0.0
                directions[3 + axis, 3 * j + k] = (
                    probed[(axis + 1) * n + j, k] - probed[j, k]
                ) / PROBE


def _orthonormalise(directions: np.ndarray, triangle: np.ndarray) -> None:
    """Replace m directions (m, n) by orthonormal ones Q, and write R (m, m) of QR: the modified
    method of Gram and Schmidt.
    """
    m, n = directions.shape[0], directions.shape[1]
    for k in range(m):
        total = 0.0
        for i in range(n):
            total += directions[k, i] * directions[k, i]
        length = triangle[k, k] = math.sqrt(total)
        for i in range(n):
            directions[k, i] /= length
        for other in range(k + 1, m):
            triangle[k, other] = _taken(directions, k, directions[other])


def _solve(
    directions: np.ndarray, triangle: np.ndarray, left: np.ndarray, change: np.ndarray
) -> None:
    """Write the least-squares solution (m,) for a right side (n,), of which what is left remains."""
    m = directions.shape[0]
    for k in range(m):
        change[k] = _taken(directions, k, left)
    for k in range(m - 1, -1, -1):
        for other in range(k + 1, m):
            change[k] -= triangle[k, other] * change[other]
        change[k] /= triangle[k, k]


def _taken(directions: np.ndarray, k: int, vector: np.ndarray) -> float:
    """Take from a vector (n,) what it has along the direction k; returns how much that was."""
    share = 0.0
    for i in range(vector.shape[0]):
        share += directions[k, i] * vector[i]
    for i in range(vector.shape[0]):
        vector[i] -= share * directions[k, i]
    return share
