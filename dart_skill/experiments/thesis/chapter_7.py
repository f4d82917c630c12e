"""Figure 7.1: a fingertip that follows the surface of a ball is held for a while. What a clock
does then, and what the state does.

Left to a PD controller (7.3) that tracks a path over time, the target runs on; let go, the finger
takes the short way, through the ball, with the force of the whole error. The policy without a
clock (chapter 9, autonomous DS-GMR) waits and goes on where it was held. Both pull a unit mass
with the same stiffness and damping. The ball itself is not there to stop the finger: it shows
where it would have hit.

Figure 7.4: one movement seen from two task frames, and its reproduction where the frames stand
in new places. The task is that of the figure: leave frame 1 in its direction, enter frame 2 along
its axis, as a peg goes into a hole. Every reproduction is judged by how straight it enters and how
near it ends, and set against the demonstrations' own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from dart_skill.figures import (
    ATTRACTOR,
    BLACK,
    BLUE,
    DEMONSTRATION,
    GAUSSIAN,
    GREY,
    HAND,
    LIGHT,
    PALE,
    PURPLE,
    VERMILION,
    add_gaussians,
    legend_below,
    letter_panels,
)
from dart_skill.movement import (
    DSGMR,
    AutonomousDSGMR,
    Motion,
    Reproduction,
    TaskFrame,
    critical_damping,
    smooth_derivatives,
)

RADIUS = 0.1
"""Radius of the ball [m]."""
DURATION = 3.0
"""Duration of the movement over the ball [s]."""
STIFFNESS = 400.0
"""Stiffness of both controllers [1/s^2]."""
HELD = 0.8
"""Time from which the finger is held [s]."""
LET_GO = 2.2
"""Time at which it is let go [s]."""
STEP = 0.002
"""Step of the simulation [s]."""
NOISE = 0.0005
"""Standard deviation of measured positions, in both figures [m]."""

Push = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""Acceleration (2,) at a time, a position and a velocity (2,)."""


class HeldRun(NamedTuple):
    """Path (n, 2) [m] and pull (n,) [m/s^2], the size of the controller's acceleration, at time
    (n,) [s].
    """

    time: np.ndarray
    path: np.ndarray
    pull: np.ndarray

    @property
    def depth(self) -> float:
        """How far it went into the ball [m]."""
        return float(RADIUS - np.linalg.norm(self.path, axis=1).min())

    @property
    def greatest_pull(self) -> float:
        """Greatest acceleration asked for after it was let go [m/s^2]."""
        return float(self.pull[self.time >= LET_GO].max())


def surface(time: np.ndarray) -> Motion:
    """The motion (n, 2) that is asked for: over the ball from left to right, from rest to rest."""
    s = np.clip(np.asarray(time) / DURATION, 0.0, 1.0)
    angle = np.pi * (1.0 - s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
    rate = (-np.pi * 30.0 * s**2 * (1.0 - s) ** 2 / DURATION)[:, None]
    change = (-np.pi * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / DURATION**2)[:, None]
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    return Motion(
        RADIUS * across, RADIUS * rate * along, RADIUS * (change * along - rate**2 * across)
    )


def by_the_clock(step: float = STEP) -> HeldRun:
    """(7.3): x'' = Kx (xd(t) - x) + Kv (xd'(t) - x')."""
    damping = float(critical_damping(STIFFNESS))

    def pull(time: float, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        wanted = surface(np.array([time]))
        spring = STIFFNESS * (wanted.position[0] - position)
        return spring + damping * (wanted.velocity[0] - velocity)

    return _hold(pull, step)


def by_the_state(seed: int = 0, step: float = STEP) -> HeldRun:
    """Autonomous DS-GMR learned from five demonstrations along the surface."""
    rng, n = np.random.default_rng(seed), 5
    time = 0.01 * np.arange(round(100 * DURATION) + 1)
    path, world = surface(time).position, [TaskFrame(np.eye(3), np.zeros(3))]
    motions = [
        smooth_derivatives(time, path + rng.normal(0.0, NOISE, path.shape)) for _ in range(n)
    ]
    model = AutonomousDSGMR(12, STIFFNESS).fit([time] * n, motions, [world] * n)
    policy = model.policy(world)
    phase = policy.phase[0]

    def pull(_: float, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        nonlocal phase
        phase = policy.advance(phase, position, velocity, step)
        return policy.acceleration(phase, position, velocity)

    return _hold(pull, step)


def _hold(pull: Push, step: float) -> HeldRun:
    """A unit mass under pull(time, position, velocity) that is held still for a while."""
    time = step * np.arange(round((DURATION + LET_GO - HELD + 2.0) / step) + 1)
    position: np.ndarray = surface(time[:1]).position[0]
    velocity: np.ndarray = np.zeros(2)
    path, pulls = np.empty((len(time), 2)), np.empty(len(time))
    for k, now in enumerate(time):
        acceleration = pull(now, position, velocity)
        path[k], pulls[k] = position, np.linalg.norm(acceleration)
        velocity = np.zeros(2) if HELD <= now < LET_GO else velocity + step * acceleration
        position = position + step * velocity
    return HeldRun(time, path, pulls)


def draw_7_1(seed: int = 0, step: float = STEP) -> tuple[Figure, dict]:
    clock, state = by_the_clock(step), by_the_state(seed, step)
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    plane, force = figure.subplots(1, 2)
    ball = {"facecolor": PALE, "edgecolor": LIGHT, "label": "surface of the ball"}
    plane.add_patch(Circle((0.0, 0.0), 100 * RADIUS, **ball))
    wanted = 100 * surface(np.linspace(0.0, DURATION, 200)).position
    plane.plot(*wanted.T, color=BLACK, linestyle=":", label="path, demonstrated", zorder=4)
    for name, run, colour in (
        ("PD controller and a clock (7.3)", clock, VERMILION),
        ("autonomous DS-GMR", state, BLUE),
    ):
        plane.plot(*(100 * run.path.T), color=colour, label=name)
        force.plot(run.time, run.pull, color=colour, label=name)
    middle = 0.5 * (HELD + LET_GO)
    where, label = 100 * clock.path[round(middle / step)], f"held for {LET_GO - HELD:.1f} s"
    dot: dict[str, Any] = {"color": GREY, "markeredgecolor": "black", "linestyle": "none"}
    plane.plot(*where, "o", label=label, zorder=3, **dot)
    plane.set(aspect="equal", xlabel="x [cm]", ylabel="y [cm]")
    plane.set_title("Way of the fingertip over the ball")
    force.axvspan(HELD, LET_GO, color=LIGHT, alpha=0.4, linewidth=0)
    force.text(middle, force.get_ylim()[1], "held", ha="center", va="top")
    force.set(xlabel="time [s]", ylabel="acceleration asked for [m/s²]")
    force.set_title("What each asks for, of a unit mass")
    letter_panels(plane, force)
    handles, labels = plane.get_legend_handles_labels()
    legend_below(figure, handles, labels, 5)
    return figure, {
        name: {
            "depth_in_ball_mm": round(1000 * run.depth, 2),
            "greatest_pull_m_s2": round(run.greatest_pull, 2),
        }
        for name, run in (("clock", clock), ("state", state))
    }


STAMPS = np.arange(151) / 100.0
"""Stamps of a movement of figure 7.4 [s]."""
STRAIGHT = 0.12
"""Straight ways out of frame 1 and into frame 2 [m]."""
COLOURS = (BLUE, PURPLE)
"""Colours of the two frames."""


class Insertion(NamedTuple):
    """Frames of a situation and the path (n, 2) [m] through it."""

    frames: tuple[TaskFrame, TaskFrame]
    path: np.ndarray
    reproduction: Reproduction | None = None

    @property
    def miss(self) -> float:
        """Distance of the end from the origin of frame 2 [m]."""
        return float(np.linalg.norm(self.path[-1] - self.frames[1].b[1:]))

    @property
    def tilt(self) -> float:
        """Angle between the last 5 cm of the path and the axis of frame 2 [rad]."""
        far = np.linalg.norm(self.path - self.path[-1], axis=1) > 0.05
        direction = self.path[-1] - self.path[np.flatnonzero(far)[-1]]
        local = np.linalg.solve(self.frames[1].A[1:, 1:], direction)
        return float(abs(np.arctan2(local[0], -local[1])))


def situation(rng: np.random.Generator) -> tuple[TaskFrame, TaskFrame]:
    """Frame 1 on the left, frame 2 on the right with its opening upwards, each shifted and turned
    at random.
    """
    frames = []
    for origin, shift, turn in (([0.0, 0.0], 0.05, 0.6), ([0.5, 0.0], 0.12, 0.7)):
        place, angle = origin + rng.uniform(-shift, shift, 2), rng.uniform(-turn, turn)
        matrix = np.eye(3)
        matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        frames.append(TaskFrame(matrix, np.concatenate([[0.0], place])))
    return frames[0], frames[1]


def demonstrate(frames: tuple[TaskFrame, TaskFrame], rng: np.random.Generator) -> Insertion:
    """A smooth path (Bezier curve of degree 5, from rest to rest) out of frame 1 along its y axis
    and into frame 2 along its own; between them demonstrations differ by 3 cm.
    """
    (out, away), (hole, above) = ((one.b[1:], STRAIGHT * one.A[1:, 2]) for one in frames)
    sway = rng.normal(0.0, 0.03, (2, 2))
    points = [out, out + away, out + 2 * away + sway[0]]
    points += [hole + 2 * above + sway[1], hole + above, hole]
    s = np.linspace(0.0, 1.0, len(STAMPS))
    s = (s**3 * (10.0 - 15.0 * s + 6.0 * s**2))[:, None]
    weights = (
        np.array([1, 5, 10, 10, 5, 1]) * s ** np.arange(6) * (1.0 - s) ** np.arange(5, -1, -1)
    )
    return Insertion(frames, weights @ points + rng.normal(0.0, NOISE, (len(s), 2)))


def insertions(seed: int = 0) -> tuple[list[Insertion], DSGMR, list[Insertion]]:
    """Eight demonstrations, what was learned from them, (7.20), (7.21): attractors from noisy
    positions, encoded in both frames; and reproductions in three new situations, from rest in
    frame 1.
    """
    rng = np.random.default_rng(seed)
    shown = [demonstrate(situation(rng), rng) for _ in range(8)]
    model = DSGMR(6, 200.0)
    encoded = [model.encode(STAMPS, one.path) for one in shown]
    model.fit(encoded, [one.frames for one in shown])
    new = []
    for _ in range(3):
        frames = situation(rng)
        movement = model.reproduce(frames, STAMPS, frames[0].b[1:], np.zeros(2))
        new.append(Insertion(frames, movement.position, movement))
    return shown, model, new


def draw_7_4(seed: int = 0) -> tuple[Figure, dict]:
    """Measured: largest miss and tilt of demonstrations and reproductions."""
    demonstrations, model, new = insertions(seed)
    figure = Figure(figsize=(10.5, 7.6), layout="constrained")
    panels = shown, first, second, made = figure.subplots(2, 2).ravel()
    for one in demonstrations:
        shown.plot(*one.path.T, color=DEMONSTRATION, linewidth=1.0)
        _draw_frames(shown, one.frames)
    for j, axes in enumerate((first, second)):
        for one in demonstrations:
            attractor = one.frames[j].to_frame(model.encode(STAMPS, one.path))
            axes.plot(*attractor[:, 1:].T, color=ATTRACTOR, linewidth=0.9)
        means, covariances = model.mixture_.means_[j], model.mixture_.covariances_[j]
        _draw_components(axes, means, covariances, 0.35)
        _draw_frames(axes, (TaskFrame(np.eye(3), np.zeros(3)),), COLOURS[j:])
    for one in new:
        product = model.mixture_.product(one.frames)
        _draw_components(made, product.means_, product.covariances_, 0.25)
        assert one.reproduction is not None
        made.plot(*one.reproduction.attractor.T, color=ATTRACTOR, linewidth=0.9)
        made.plot(*one.path.T, color=HAND, linewidth=1.3)
        _draw_frames(made, one.frames)
    shown.set_title(f"Demonstrations, n = {len(demonstrations)}")
    first.set_title("As frame 1 sees them")
    second.set_title("As frame 2 sees them")
    made.set_title(f"New places, n = {len(new)}, with products (7.21)")
    letter_panels(*panels)
    path, *brackets = shown.lines[:3]
    entries = {
        "frame 1": brackets[0],
        "frame 2": brackets[1],
        "path, demonstrated": path,
        "attractor (7.20)": first.lines[0],
        "Gaussian, 2 standard deviations": first.patches[0],
        "path, reproduced": made.lines[1],
    }
    legend_below(figure, [*entries.values()], [*entries], columns=6)
    for axes in panels:
        axes.set(xlabel="x [m]", ylabel="y [m]")
        axes.set_aspect("equal", adjustable="datalim")
    return figure, {
        name: {
            "largest_miss_mm": round(1000 * max(one.miss for one in some), 2),
            "largest_tilt_deg": round(float(np.degrees(max(one.tilt for one in some))), 2),
        }
        for name, some in (("demonstrated", demonstrations), ("reproduced", new))
    }


def _draw_components(axes: Axes, means: np.ndarray, covariances: np.ndarray, alpha: float) -> None:
    look = {"facecolor": GAUSSIAN, "edgecolor": GAUSSIAN, "alpha": alpha, "zorder": 1.5}
    add_gaussians(axes, means[:, 1:], covariances[:, 1:, 1:], 2.0, **look)


def _draw_frames(
    axes: Axes, frames: tuple[TaskFrame, ...], colours: tuple[str, ...] = COLOURS
) -> None:
    """Brackets, open along the y axes of the frames."""
    x, y = [-0.025, -0.025, 0.025, 0.025], [0.05, -0.01, -0.01, 0.05]
    for frame, colour in zip(frames, colours, strict=False):
        corners = frame.from_frame(np.column_stack([np.zeros(4), x, y]))
        axes.plot(*corners[:, 1:].T, color=colour, linewidth=2.0, zorder=3)
