"""Figure 8.6: 13 demonstrations with gripper frames and targets, and the throw at a basket that
nobody demonstrated.

The thesis draws what its global model (two frames, three components) makes of a new target, and
says that it is as smooth as the demonstrations. Here the same stands beside what `default` makes
of it, with where each plan itself expects the ball to come down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import ball_pictures, ball_throws
from dart_skill.figures import house_style, letter_panels, save

TITLE = "Demonstrated throws of the ball, and the global model's at a new basket"
MODELS = {"thesis": "Global model of the thesis", "default": "Default of this package"}


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, basket = ball_throws.all_demonstrated(seed, "thesis"), ball_throws.new_baskets(seed)[0]
    plans = {name: ball_throws.skill(seed, name).plan(basket) for name in MODELS}
    with house_style():
        figure = Figure(figsize=(10.5, 6.6), layout="constrained")
        panels = ball_pictures.trajectory_panels(figure, 1 + len(MODELS))
        ball_pictures.draw_trajectories(panels[:, 0], shown, "demonstrated")
        panels[0, 0].set_title(f"Demonstrations, n = {len(shown)}")
        for column, (name, plan) in zip(panels.T[1:], plans.items(), strict=True):
            ball_pictures.draw_trajectories(column, [ball_throws.planned(plan)], name, new=True)
            miss = 100 * np.linalg.norm((plan.predicted_landing - basket)[:2])
            column[0].set_title(
                f"{MODELS[name]}, new target:\nexpected to miss it by {miss:.1f} cm"
            )
        letter_panels(*panels[0])
        ball_pictures.trajectory_legend(figure, 5)
        return save(figure, folder, "figure_8_6"), measured(seed)


def measured(seed: int) -> dict:
    """Where plans for new baskets expect the ball, and how rough they are beside the
    demonstrations.
    """
    shown, basket = ball_throws.all_demonstrated(seed, "thesis"), ball_throws.new_baskets(seed)[0]
    plans = {
        name: ball_throws.planned(ball_throws.skill(seed, name).plan(basket)) for name in MODELS
    }
    return {
        "demonstrations": len(shown),
        "thesis_says": (
            "the reproduced trajectory has the smoothness properties similar to the demonstrations"
        ),
        "speed_at_release_m_s": {
            "demonstrated": [
                round(quantile([one.speed for one in shown]), 2) for quantile in (min, max)
            ],
            **{name: round(one.speed, 2) for name, one in plans.items()},
        },
        "jerk_rms_m_s3": {
            "demonstrated": round(float(np.median([one.jerk for one in shown]))),
            **{name: round(one.jerk) for name, one in plans.items()},
        },
        "expected_miss_median_cm": {
            name: round(100 * float(np.nanmedian(ball_throws.predicted_misses(seed, name))), 1)
            for name in MODELS
        },
    }
