"""The simulated dart thrower of thesis 8.1 and 8.2: a point mass drawn to a static attractor, then
free flight to a board.

Demonstrations draw their attractor at random from a region in front of the thrower. They become
attractors again by (7.20) and are encoded in the frames of (8.1), at the origin and at the place
that the dart hit. Practice (8.2) adds each throw, with the place that it really hit, to the
demonstrations.

The thesis gives no numbers; board and throwing line are those of the game, the arm is one that
lands on the board with a throw of 0.1 s.

Figure 8.1: throws demonstrated and reproduced at new aims, with the Gaussians of one of them.

Figure 8.2: practice. Every attempt, with the place that the dart really hit, becomes a
demonstration, and the model is learned again.

Figure 8.3: the error falls with experience. Many runs of practice from different demonstrations,
with median and quartiles. The thesis shows one run without saying at what it throws; here are runs
at aims all over the board, and at one aim again and again. With 4 demonstrations instead of 8, one
of the 20 runs at one aim never gets going: two frames see four points in three dimensions, and
their product is an extrapolation that throws backwards.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dart_skill.common.constants import BULL_DISTANCE, BULL_HEIGHT, GRAVITY
from dart_skill.darts import RADII
from dart_skill.figures import (
    BALL,
    BASKET,
    BLACK,
    BLUE,
    DEMONSTRATION,
    GAUSSIAN,
    GREY,
    HAND,
    LIGHT,
    VERMILION,
    add_gaussians,
    draw_board,
    legend_below,
    letter_panels,
)
from dart_skill.movement import (
    DSGMR,
    attractor_from_motion,
    base_frame,
    critical_damping,
    follow_attractor,
    target_frame,
)

BOARD_RADIUS = float(RADII[-1]) / 1000.0
"""Radius of the outside of the doubles [m]."""
SHOULDER = np.array([0.0, 0.0, 1.55])
"""Where the hand begins [m]."""
STIFFNESS = 400.0
"""Stiffness with which it is drawn to its attractor [1/s^2]."""
STEP = 0.002
"""Sampling of the movement [s]."""
STAMPS = STEP * np.arange(51)
"""Stamps of the movement, the release last [s]."""
REGION = np.array([[0.98, 1.10], [-0.075, 0.075], [0.225, 0.305]])
"""Where demonstrations draw their attractors, relative to the shoulder: forward, left, up (3, 2)
[m].
"""
N_SHOWN = 8
"""Number of demonstrations."""


class DartThrow(NamedTuple):
    """One throw: attractor, position and velocity (n, 3) of the hand at STAMPS.

    Parameters
    ----------
    hit : (3,)
        Where the dart met the plane of the board, nan where it does not fly towards it.
    aim : (3,)
        If it had one.
    """

    attractor: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    hit: np.ndarray
    aim: np.ndarray | None = None

    @property
    def arrived(self) -> bool:
        """Whether the dart met the plane of the board."""
        return bool(np.isfinite(self.hit).all())

    @property
    def error(self) -> float:
        """Distance from aim to hit [m], infinite for a dart that never arrives."""
        return float(np.linalg.norm(self.hit - self.aim)) if self.arrived else np.inf

    def flight(self, n: int = 60) -> np.ndarray:
        """Positions (n, 3) from the release to the board."""
        position, velocity = self.position[-1], self.velocity[-1]
        return ballistic(position, velocity, np.linspace(0.0, time_to_board(*self[1:3]), n))


def ballistic(position: np.ndarray, velocity: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Positions (n, 3) of a projectile at times (n,)."""
    time = np.asarray(time)[:, None]
    return position + velocity * time - 0.5 * GRAVITY * np.array([0.0, 0.0, 1.0]) * time**2


def time_to_board(position: np.ndarray, velocity: np.ndarray) -> float:
    """Time [s] from the release, last of (n, 3) each, until the plane of the board is reached; nan
    if the dart does not fly towards it.
    """
    speed = velocity[-1, 0]
    return float((BULL_DISTANCE - position[-1, 0]) / speed) if speed > 0.0 else np.nan


def thrown(attractor: np.ndarray, aim: np.ndarray | None = None) -> DartThrow:
    """The throw that an attractor (n, 3) at STAMPS makes."""
    motion = follow_attractor(attractor, STEP, SHOULDER, np.zeros(3), STIFFNESS)
    position, velocity = motion.position, motion.velocity
    arrival = np.array([time_to_board(position, velocity)])
    hit = ballistic(position[-1], velocity[-1], arrival)[0]
    recorded = attractor_from_motion(*motion, STIFFNESS, critical_damping(STIFFNESS))
    return DartThrow(recorded, position, velocity, hit, aim)


def demonstrate(n: int, rng: np.random.Generator) -> list[DartThrow]:
    """n throws at static attractors drawn from the region."""
    points = SHOULDER + rng.uniform(REGION[:, 0], REGION[:, 1], (n, 3))
    return [thrown(np.tile(point, (len(STAMPS), 1))) for point in points]


def random_aims(n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, 3) points that are spread evenly over the board."""
    radius, angle = BOARD_RADIUS * np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    left, up = radius * np.cos(angle), BULL_HEIGHT + radius * np.sin(angle)
    return np.column_stack([np.full(n, BULL_DISTANCE), left, up])


def frames_for(aim: np.ndarray) -> list:
    """(8.1): at the origin, which is the shoulder here, and at the aim, first axis towards it."""
    return [base_frame(0), target_frame(aim, (), SHOULDER)]


def learn(throws: list[DartThrow]) -> DSGMR:
    """DS-GMR from throws, each with the place that it hit as its target."""
    samples = [np.column_stack([STAMPS, throw.attractor]) for throw in throws]
    return DSGMR(2, STIFFNESS).fit(samples, [frames_for(throw.hit) for throw in throws])


def throw_at(model: DSGMR, aim: np.ndarray) -> DartThrow:
    """The throw that a model makes for an aim (3,) on the board."""
    return thrown(model.retrieve(frames_for(aim), STAMPS)[0], aim)


def practise(throws: list[DartThrow], aims: np.ndarray) -> list[DartThrow]:
    """(8.2): one attempt per aim (n, 3); after each the model is learned again with all that hit
    the board's plane. The attempts.
    """
    known, attempts = list(throws), []
    for aim in aims:
        attempts.append(throw_at(learn(known), aim))
        known += [attempts[-1]] if attempts[-1].arrived else []
    return attempts


def draw_8_1(seed: int = 0) -> tuple[Figure, dict]:
    rng = np.random.default_rng(seed)
    shown = demonstrate(N_SHOWN, rng)
    model = learn(shown)
    made = [throw_at(model, aim) for aim in random_aims(12, rng)]
    figure = Figure(figsize=(11.6, 5.0), layout="constrained")
    mosaic: list[Any] = [["demonstrated", "board"], ["reproduced", "board"]]
    panels = figure.subplot_mosaic(mosaic, width_ratios=(1.5, 1.0))
    demonstrated, reproduced, board = (
        panels[name] for name in ("demonstrated", "reproduced", "board")
    )
    title = f"Demonstrations from the side, n = {len(shown)}"
    _draw_side(demonstrated, shown, DEMONSTRATION, title)
    _draw_side(reproduced, made, HAND, f"Reproductions at new aims, n = {len(made)}")
    assert made[0].aim is not None  # a reproduction has one
    product = model.mixture_.product(frames_for(made[0].aim))
    side = np.array([1, 3])
    means, covariances = product.means_[:, side], product.covariances_[:, side][:, :, side]
    look = {"facecolor": GAUSSIAN, "edgecolor": GAUSSIAN, "alpha": 0.6, "zorder": 3}
    add_gaussians(reproduced, means, covariances, 2.0, **look)
    cross: dict[str, Any] = {"color": GAUSSIAN, "markersize": 9, "linestyle": "none"}
    reproduced.plot(*means.T, "+", label="Gaussian of the attractor (7.21), one throw", **cross)
    _draw_hits(board, made, "On the board, as the thrower sees it")
    letter_panels(demonstrated, reproduced, board)
    _shared_legend(figure, (demonstrated, reproduced, board), 4)
    errors = [1000 * throw.error for throw in made]
    return figure, {
        "median_error_mm": round(float(np.median(errors)), 2),
        "largest_error_mm": round(max(errors), 2),
    }


def draw_8_2(seed: int = 0, n_aims: int = 6, n_rounds: int = 3) -> tuple[Figure, dict]:
    """Measured: mean error of each round of attempts at the same aims [mm]."""
    rng = np.random.default_rng(seed)
    shown, aims = demonstrate(N_SHOWN, rng), random_aims(n_aims, rng)
    attempts = practise(shown, np.tile(aims, (n_rounds, 1)))
    rounds = [attempts[n * n_aims : (n + 1) * n_aims] for n in range(n_rounds)]
    errors = [float(np.mean([1000 * throw.error for throw in some])) for some in rounds]
    figure = Figure(figsize=(10.2, 7.0), layout="constrained")
    mosaic: list[Any] = [["side", "side"], ["first", "last"]]
    panels = figure.subplot_mosaic(mosaic, height_ratios=(1.0, 1.8))
    side, first, last = (panels[name] for name in ("side", "first", "last"))
    _draw_side(side, shown, DEMONSTRATION, f"Demonstrations, n = {len(shown)}")
    _draw_hits(first, rounds[0], f"First attempts, n = {n_aims}: {errors[0]:.1f} mm off")
    before = n_aims * (n_rounds - 1)
    later = f"The same aims after {before} attempts: {errors[-1]:.1f} mm off"
    _draw_hits(last, rounds[-1], later)
    letter_panels(side, first, last)
    _shared_legend(figure, (side, first), 5)
    return figure, {"mean_error_mm": [round(error, 2) for error in errors]}


def errors_of_run(seed: int, one_aim: bool, n_attempts: int = 30) -> np.ndarray:
    """Error (n_attempts,) [m] of the attempts of one run."""
    rng = np.random.default_rng(seed)
    shown = demonstrate(N_SHOWN, rng)
    aims = random_aims(1 if one_aim else n_attempts, rng)
    attempts = practise(shown, np.broadcast_to(aims, (n_attempts, 3)))
    return np.array([throw.error for throw in attempts])


def draw_8_3(seed: int = 0, n_seeds: int = 20, n_attempts: int = 30) -> tuple[Figure, dict]:
    """Measured: median error [mm] of the first and the last five attempts."""
    figure = Figure(figsize=(10.5, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    measured = {}
    for axes, one_aim, colour in zip(panels, (False, True), (BLUE, VERMILION), strict=True):
        runs = [errors_of_run(seed + n, one_aim, n_attempts) for n in range(n_seeds)]
        error, attempt = 1000 * np.array(runs), 1 + np.arange(n_attempts)
        low, middle, high = np.percentile(error, [25, 50, 75], axis=0)
        axes.plot(attempt, error.T, color=LIGHT, linewidth=0.5)
        band: dict[str, Any] = {"color": colour, "alpha": 0.25, "linewidth": 0}
        axes.fill_between(attempt, low, high, label="quartiles", **band)
        axes.plot(attempt, middle, color=colour, linewidth=2.0, label="median")
        what = "the same aim each time" if one_aim else "a new aim each time"
        axes.set_title(f"{what}, {N_SHOWN} demonstrations before, n = {n_seeds} runs")
        axes.set(xlabel="attempt", yscale="log")
        measured["one aim" if one_aim else "new aims"] = {
            "first_five": round(float(np.median(error[:, :5])), 3),
            "last_five": round(float(np.median(error[:, -5:])), 3),
        }
    panels[0].set_ylabel("distance from aim to hit [mm]")
    panels[0].legend(loc="upper right")
    return figure, measured


def _draw_side(axes: Axes, throws: list[DartThrow], colour: str, title: str) -> None:
    """Movements of the hand, in a colour, and flights, forward and up."""
    name = "hand, demonstrated" if colour == DEMONSTRATION else "hand, reproduced"
    for throw in throws:
        axes.plot(*throw.position[:, [0, 2]].T, color=colour, linewidth=1.4, label=name)
        flight = throw.flight()[:, [0, 2]]
        axes.plot(*flight.T, color=BALL, linewidth=0.7, label="dart in flight")
    ends = [BULL_HEIGHT - BOARD_RADIUS, BULL_HEIGHT + BOARD_RADIUS]
    look: dict[str, Any] = {"color": BLACK, "linewidth": 3.0, "solid_capstyle": "butt"}
    axes.plot([BULL_DISTANCE] * 2, ends, label="board", **look)
    axes.set(xlabel="forward [m]", ylabel="up [m]", title=title, aspect="equal", ylim=(1.45, 2.05))


def _draw_hits(axes: Axes, throws: list[DartThrow], title: str) -> None:
    """Aims and hits in the plane of the board [mm], and, larger, where each hit lies from its aim."""
    draw_board(axes, LIGHT)
    points = np.array([(throw.aim, throw.hit) for throw in throws])
    on_board = 1000.0 * np.stack([-points[..., 1], points[..., 2] - BULL_HEIGHT], axis=-1)
    (aims, hits), dots = np.swapaxes(on_board, 0, 1), dict[str, Any](linestyle="none")
    axes.plot(*aims.T, "o", color=BASKET, markersize=5.0, label="aim", **dots)
    axes.plot(*hits.T, "o", color=BALL, markersize=3.0, label="hit", **dots)
    axes.set_title(title)
    limits, ticks = (-8, 8), (-8, 0, 8)
    inset = axes.inset_axes((1.03, 0.0, 0.25, 0.25), xlim=limits, ylim=limits, aspect="equal")
    inset.axhline(0.0, color=LIGHT, linewidth=0.8)
    inset.axvline(0.0, color=LIGHT, linewidth=0.8)
    inset.plot(0.0, 0.0, "o", color=BASKET, markersize=5.0)
    inset.plot(*(hits - aims).T, "o", color=BALL, markersize=3.0, clip_on=False, **dots)
    inset.set(xticks=ticks, yticks=ticks)
    inset.tick_params(labelsize=7.5, length=2)
    inset.set_title("hit from aim [mm]", fontsize=8.0, color=GREY, loc="center")


def _shared_legend(figure: Figure, panels: tuple[Axes, ...], columns: int) -> None:
    """A legend of all panels, in which every label stands once."""
    entries: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    legend_below(figure, [*entries.values()], [*entries], columns)
