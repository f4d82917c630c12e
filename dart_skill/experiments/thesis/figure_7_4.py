"""Figure 7.4: one movement seen from two task frames, and its reproduction where the frames stand
in new places.

The task is that of the figure: leave frame 1 in its direction, enter frame 2 along its axis, as a
peg goes into a hole. Every reproduction is judged by how straight it enters and how near it ends,
and set against the demonstrations' own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.figures import (
    ATTRACTOR,
    BLUE,
    DEMONSTRATION,
    GAUSSIAN,
    HAND,
    PURPLE,
    gaussian_ellipse,
    house_style,
    legend_below,
    letter_panels,
    save,
)
from dart_skill.movement import DSGMR, Reproduction, TaskFrame

TITLE_7_4 = "Task-parameterised movement: two frames, and new places for them"
N_DEMONSTRATIONS, N_NEW, N_COMPONENTS, STIFFNESS = 8, 3, 6, 200.0
DURATION, RATE, NOISE = 1.5, 100.0, 0.0005
"""Duration of a demonstration [s], samples per second, standard deviation of the measurement [m].
"""
LEAVE, ENTER, SWAY = 0.12, 0.12, 0.03
"""Straight ways out of frame 1 and into frame 2, and how much demonstrations differ between them
[m].
"""
FRAMES = (BLUE, PURPLE)
LAST_PART = 0.05
"""Length of the end of the path whose direction is judged [m]."""


@dataclass(frozen=True, eq=False)
class Insertion:
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
        """Angle between the last part of the path and the axis of frame 2 [rad]."""
        near = np.linalg.norm(self.path - self.path[-1], axis=1) > LAST_PART
        direction = self.path[-1] - self.path[np.flatnonzero(near)[-1]]
        local = np.linalg.solve(self.frames[1].A[1:, 1:], direction)
        return float(abs(np.arctan2(local[0], -local[1])))


def situation(rng: np.random.Generator) -> tuple[TaskFrame, TaskFrame]:
    """Frame 1 on the left, frame 2 on the right with its opening upwards, each shifted and turned
    at random.
    """
    return (
        _frame(np.array([0.0, 0.0]) + rng.uniform(-0.05, 0.05, 2), rng.uniform(-0.6, 0.6)),
        _frame(np.array([0.5, 0.0]) + rng.uniform(-0.12, 0.12, 2), rng.uniform(-0.7, 0.7)),
    )


def _frame(origin: np.ndarray, angle: float) -> TaskFrame:
    matrix = np.eye(3)
    matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, np.concatenate([[0.0], origin]))


def demonstrate(frames: tuple[TaskFrame, TaskFrame], rng: np.random.Generator) -> Insertion:
    """A smooth path (Bezier curve of degree 5, from rest to rest) out of frame 1 along its y axis
    and into frame 2 along its own.
    """
    out, hole = ([one.b[1:], one.A[1:, 2]] for one in frames)
    sway = rng.normal(0.0, SWAY, (2, 2))
    points = [out[0], out[0] + LEAVE * out[1], out[0] + 2 * LEAVE * out[1] + sway[0]]
    points += [hole[0] + 2 * ENTER * hole[1] + sway[1], hole[0] + ENTER * hole[1], hole[0]]
    s = np.linspace(0.0, 1.0, round(DURATION * RATE) + 1)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    weights = (
        np.array([1, 5, 10, 10, 5, 1])
        * s[:, None] ** np.arange(6)
        * (1.0 - s[:, None]) ** np.arange(5, -1, -1)
    )
    return Insertion(frames, weights @ points + rng.normal(0.0, NOISE, (len(s), 2)))


def stamps() -> np.ndarray:
    return np.arange(round(DURATION * RATE) + 1) / RATE


def learn(demonstrations: list[Insertion]) -> DSGMR:
    """(7.20), (7.21): attractors from noisy positions, encoded in both frames."""
    model = DSGMR(N_COMPONENTS, STIFFNESS)
    return model.fit(
        [model.encode(stamps(), one.path) for one in demonstrations],
        [one.frames for one in demonstrations],
    )


def reproduce(model: DSGMR, frames: tuple[TaskFrame, TaskFrame]) -> Insertion:
    """The movement for new frames, from rest in frame 1."""
    movement = model.reproduce(frames, stamps(), frames[0].b[1:], np.zeros(2))
    return Insertion(frames, movement.position, movement)


def compute_7_4(seed: int = 0) -> tuple[list[Insertion], DSGMR, list[Insertion]]:
    """Demonstrations, what was learned from them, and reproductions in new situations."""
    rng = np.random.default_rng(seed)
    demonstrations = [demonstrate(situation(rng), rng) for _ in range(N_DEMONSTRATIONS)]
    model = learn(demonstrations)
    return demonstrations, model, [reproduce(model, situation(rng)) for _ in range(N_NEW)]


def draw_7_4(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    demonstrations, model, new = compute_7_4(seed)
    with house_style():
        figure = Figure(figsize=(10.5, 7.6), layout="constrained")
        shown, first, second, made = figure.subplots(2, 2).ravel()
        for number, one in enumerate(demonstrations, start=1):
            shown.plot(
                *one.path.T, color=DEMONSTRATION, linewidth=1.0, gid=f"demonstration_{number}"
            )
            _draw_frames(shown, one.frames)
        for j, axes in enumerate((first, second)):
            _draw_view(axes, demonstrations, model, j)
        for number, one in enumerate(new, start=1):
            _draw_reproduction(made, model, one, number)
        shown.set_title(f"Demonstrations, n = {len(demonstrations)}")
        first.set_title("As frame 1 sees them")
        second.set_title("As frame 2 sees them")
        made.set_title(f"New places, n = {len(new)}, with products (7.21)")
        letter_panels(shown, first, second, made)
        path, *brackets = shown.lines[:3]
        marks = [*brackets, path, first.lines[0], first.patches[0], made.lines[1]]
        names = [
            "frame 1",
            "frame 2",
            "path, demonstrated",
            "attractor (7.20)",
            "Gaussian, 2 standard deviations",
            "path, reproduced",
        ]
        legend_below(figure, marks, names, columns=6)
        for axes in (shown, first, second, made):
            axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
            axes.set_aspect("equal", adjustable="datalim")
        return save(figure, folder, "figure_7_4"), measured_7_4(demonstrations, new)


def measured_7_4(demonstrations: list[Insertion], new: list[Insertion]) -> dict:
    """Largest miss and tilt of both."""
    return {
        name: {
            "largest_miss_mm": round(1000 * max(one.miss for one in some), 2),
            "largest_tilt_deg": round(float(np.degrees(max(one.tilt for one in some))), 2),
        }
        for name, some in (("demonstrated", demonstrations), ("reproduced", new))
    }


def _draw_view(axes: Axes, demonstrations: list[Insertion], model: DSGMR, j: int) -> None:
    for one in demonstrations:
        attractor = model.encode(stamps(), one.path)
        axes.plot(*one.frames[j].to_frame(attractor)[:, 1:].T, color=ATTRACTOR, linewidth=0.9)
    mixture = model.mixture_
    for mean, covariance in zip(mixture.means_[j], mixture.covariances_[j], strict=True):
        look = {"facecolor": GAUSSIAN, "edgecolor": GAUSSIAN, "alpha": 0.35, "zorder": 1.5}
        axes.add_patch(gaussian_ellipse(mean[1:], covariance[1:, 1:], 2.0, **look))
    _draw_frame(axes, TaskFrame(np.eye(3), np.zeros(3)), FRAMES[j])


def _draw_reproduction(axes: Axes, model: DSGMR, one: Insertion, number: int) -> None:
    product = model.mixture_.product(one.frames)
    for mean, covariance in zip(product.means_, product.covariances_, strict=True):
        axes.add_patch(
            gaussian_ellipse(
                mean[1:],
                covariance[1:, 1:],
                2.0,
                facecolor=GAUSSIAN,
                edgecolor=GAUSSIAN,
                alpha=0.25,
                zorder=1.5,
            )
        )
    assert one.reproduction is not None
    axes.plot(
        *one.reproduction.attractor.T, color=ATTRACTOR, linewidth=0.9, gid=f"attractor_{number}"
    )
    axes.plot(*one.path.T, color=HAND, linewidth=1.3, gid=f"reproduction_{number}")
    _draw_frames(axes, one.frames)


def _draw_frames(axes: Axes, frames: tuple[TaskFrame, TaskFrame]) -> None:
    for frame, colour in zip(frames, FRAMES, strict=True):
        _draw_frame(axes, frame, colour)


def _draw_frame(axes: Axes, frame: TaskFrame, colour: str) -> None:
    """A bracket, open along the frame's y axis."""
    corners = np.array([[-0.025, 0.05], [-0.025, -0.01], [0.025, -0.01], [0.025, 0.05]])
    axes.plot(
        *frame.from_frame(np.column_stack([np.zeros(4), corners]))[:, 1:].T,
        color=colour,
        linewidth=2.0,
        zorder=3,
    )
