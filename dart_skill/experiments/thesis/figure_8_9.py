"""Figure 8.9: the three demonstrations chosen for local regression, and the throw that is
generated from them at a new basket.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import ball_pictures, ball_throws, figure_8_8
from dart_skill.figures import house_style, save

TITLE = "Local regression: chosen trajectories and the generated one"
MODELS = ("thesis_local", "thesis", "default")


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    _, basket, chosen = figure_8_8.compute(seed)
    shown = [ball_throws.all_demonstrated(seed, "thesis")[k] for k in chosen]
    plan = ball_throws.skill(seed, "thesis_local").plan(basket)
    made = ball_throws.planned(plan)
    miss = float(np.linalg.norm((plan.predicted_landing - basket)[:2]))
    with house_style():
        figure = Figure(figsize=(8.2, 7.1), layout="constrained")
        panels = ball_pictures.trajectory_panels(figure, 2)
        ball_pictures.draw_trajectories(panels[:, 0], shown, "chosen")
        ball_pictures.draw_trajectories(panels[:, 1], [made], "generated", new=True)
        panels[0, 0].set_title(
            f"Chosen for local regression, n = {len(shown)}:\n{_range(shown)} m/s at the release"
        )
        panels[0, 1].set_title(
            f"Generated, {made.speed:.2f} m/s at the release:\nexpected to miss the new target by"
            f" {100 * miss:.1f} cm"
        )
        ball_pictures.trajectory_legend(figure, 4)
        return save(figure, folder, "figure_8_9"), measured(seed, shown, made, miss)


def measured(
    seed: int, shown: list[ball_throws.Trajectory], made: ball_throws.Trajectory, miss: float
) -> dict:
    """The generated throw, and where plans for ten new baskets expect the ball, local model and
    global ones.
    """
    misses = {name: 100 * ball_throws.predicted_misses(seed, name) for name in MODELS}
    return {
        "thesis_says": "producing accurate results in the close vicinity of the selected points",
        "speed_at_release_m_s": {
            "chosen": [round(one.speed, 2) for one in shown],
            "generated": round(made.speed, 2),
        },
        "expected_miss_cm": round(100 * miss, 1),
        "expected_miss_median_cm": {
            name: round(float(np.nanmedian(values)), 1) for name, values in misses.items()
        },
        "new_baskets": ball_throws.N_NEW,
    }


def _range(shown: list[ball_throws.Trajectory]) -> str:
    speeds = [one.speed for one in shown]
    return f"{min(speeds):.2f} to {max(speeds):.2f}"
