"""Figure 7.1: a fingertip that follows the surface of a ball is held for a while. What a clock
does then, and what the state does.

Left to a PD controller (7.3) that tracks a path over time, the target runs on; let go, the finger
takes the short way, through the ball, with the force of the whole error. The policy without a
clock (chapter 9, autonomous DS-GMR) waits and goes on where it was held. Both pull a unit mass
with the same stiffness and damping. The ball itself is not there to stop the finger: it shows
where it would have hit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from dart_skill.figures import (
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    PALE,
    VERMILION,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.movement import (
    AutonomousDSGMR,
    Motion,
    TaskFrame,
    critical_damping,
    smooth_derivatives,
)

TITLE_7_1 = "A finger on a ball is held: a clock and a state as what drives it"
RADIUS, DURATION = 0.1, 3.0
"""Radius of the ball [m] and duration of the movement [s]."""
STIFFNESS, N_COMPONENTS, N_DEMONSTRATIONS = 400.0, 12, 5
HELD = 0.8
"""Time from which the finger is held [s]."""
LET_GO = 2.2
"""Time at which it is let go [s]."""
STEP, AFTER = 0.002, 2.0
NOISE = 0.0005
"""Standard deviation of the measured demonstrations [m]."""

Push = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""Acceleration (2,) at a time, a position and a velocity (2,)."""


@dataclass(frozen=True, eq=False)
class Held:
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
    rate = -np.pi * 30.0 * s**2 * (1.0 - s) ** 2 / DURATION
    change = -np.pi * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / DURATION**2
    across, along = (
        np.stack([np.cos(angle), np.sin(angle)], axis=1),
        np.stack([-np.sin(angle), np.cos(angle)], axis=1),
    )
    rate, change = rate[:, None], change[:, None]
    return Motion(
        RADIUS * across, RADIUS * rate * along, RADIUS * (change * along - rate**2 * across)
    )


def by_the_clock() -> Held:
    """(7.3): x'' = Kx (xd(t) - x) + Kv (xd'(t) - x')."""
    damping = float(critical_damping(STIFFNESS))

    def pull(time: float, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        wanted = surface(np.array([time]))
        return STIFFNESS * (wanted.position[0] - position) + damping * (
            wanted.velocity[0] - velocity
        )

    return _hold(pull)


def by_the_state(seed: int = 0) -> Held:
    """Autonomous DS-GMR learned from demonstrations along the surface."""
    rng, time = np.random.default_rng(seed), 0.01 * np.arange(round(100 * DURATION) + 1)
    world = [[TaskFrame(np.eye(3), np.zeros(3))]] * N_DEMONSTRATIONS
    measured_7_1 = [
        surface(time).position + rng.normal(0.0, NOISE, (len(time), 2))
        for _ in range(N_DEMONSTRATIONS)
    ]
    motions = [smooth_derivatives(time, positions) for positions in measured_7_1]
    policy = (
        AutonomousDSGMR(N_COMPONENTS, STIFFNESS)
        .fit([time] * N_DEMONSTRATIONS, motions, world)
        .policy(world[0])
    )
    phase = [policy.phase[0]]

    def pull(_: float, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        phase.append(policy.advance(phase[-1], position, velocity, STEP))
        return policy.acceleration(phase[-1], position, velocity)

    return _hold(pull)


def _hold(pull: Push) -> Held:
    """A unit mass under pull(time, position, velocity) that is held still for a while."""
    time = STEP * np.arange(round((DURATION + LET_GO - HELD + AFTER) / STEP) + 1)
    position: np.ndarray = surface(time[:1]).position[0]
    velocity: np.ndarray = np.zeros(2)
    path, pulls = np.empty((len(time), 2)), np.empty(len(time))
    for k, now in enumerate(time):
        acceleration = pull(now, position, velocity)
        path[k], pulls[k] = position, np.linalg.norm(acceleration)
        velocity = np.zeros(2) if HELD <= now < LET_GO else velocity + STEP * acceleration
        position = position + STEP * velocity
    return Held(time, path, pulls)


def draw_7_1(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    clock, state = by_the_clock(), by_the_state(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 4.4), layout="constrained")
        plane, force = figure.subplots(1, 2)
        plane.add_patch(
            Circle(
                (0.0, 0.0),
                100 * RADIUS,
                facecolor=PALE,
                edgecolor=LIGHT,
                gid="ball",
                label="surface of the ball",
            )
        )
        wanted = 100 * surface(np.linspace(0.0, DURATION, 200)).position
        plane.plot(*wanted.T, color=BLACK, linestyle=":", label="path, demonstrated", zorder=4)
        runs = (
            ("clock", "PD controller and a clock (7.3)", clock, VERMILION),
            ("state", "autonomous DS-GMR", state, BLUE),
        )
        for gid, name, run, colour in runs:
            plane.plot(*(100 * run.path.T), color=colour, label=name, gid=f"path_{gid}")
            force.plot(run.time, run.pull, color=colour, label=name, gid=f"pull_{gid}")
        where = 100 * clock.path[round(0.5 * (HELD + LET_GO) / STEP)]
        plane.plot(
            *where,
            "o",
            color=GREY,
            markeredgecolor="black",
            label=f"held for {LET_GO - HELD:.1f} s",
            linestyle="none",
            zorder=3,
        )
        _describe(plane, force)
        handles, labels = plane.get_legend_handles_labels()
        letter_panels(plane, force)
        legend_below(figure, handles, labels, len(labels))
        return save(figure, folder, "figure_7_1"), measured_7_1(clock, state)


def measured_7_1(clock: Held, state: Held) -> dict:
    return {
        name: {
            "depth_in_ball_mm": round(1000 * run.depth, 2),
            "greatest_pull_m_s2": round(run.greatest_pull, 2),
        }
        for name, run in (("clock", clock), ("state", state))
    }


def _describe(plane: Axes, force: Axes) -> None:
    plane.set(
        aspect="equal",
        xlabel="x [cm]",
        ylabel="y [cm]",
        title="Way of the fingertip over the ball",
    )
    force.axvspan(HELD, LET_GO, color=LIGHT, alpha=0.4, linewidth=0)
    force.text(0.5 * (HELD + LET_GO), force.get_ylim()[1], "held", ha="center", va="top")
    force.set(
        xlabel="time [s]",
        ylabel="acceleration asked for [m/s²]",
        title="What each asks for, of a unit mass",
    )
