"""Figure 8.6: 13 demonstrations with gripper frames and targets, and the throw at a basket that
was not demonstrated.

The thesis draws what its global model (two frames, three components) makes of a new target, and
says that it is as smooth as the demonstrations. Here the same stands beside what `default` makes
of it, with where each plan itself expects the ball to come down.

Figure 8.9: the three demonstrations chosen for local regression, and the throw that is
generated from them at a new basket.

Figure 8.11: speed of the hand before and after synchronisation by velocity thresholds (8.4.3),
for all demonstrations.

The thesis shows one; what synchronisation is for is seen only when there are several. Before: each
recording on its own clock, with the teacher's pause in it. After: cut between the thresholds, and
set to the release of the ball, which is what this package does.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import ball_pictures, ball_throws
from dart_skill.experiments.thesis.nearest_baskets import compute_8_8
from dart_skill.figures import (
    demonstrated_motions,
    draw_synchronisation,
    house_style,
    letter_panels,
    save,
)

TITLE_8_6 = "Demonstrated throws of the ball, and the global model's at a new basket"
MODELS_8_6 = {"thesis": "Global model of the thesis", "default": "Default of this package"}


def draw_8_6(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    shown, basket = ball_throws.all_demonstrated(seed, "thesis"), ball_throws.new_baskets(seed)[0]
    plans = {name: ball_throws.skill(seed, name).plan(basket) for name in MODELS_8_6}
    with house_style():
        figure = Figure(figsize=(10.5, 6.6), layout="constrained")
        panels = ball_pictures.trajectory_panels(figure, 1 + len(MODELS_8_6))
        ball_pictures.draw_trajectories(panels[:, 0], shown, "demonstrated")
        panels[0, 0].set_title(f"Demonstrations, n = {len(shown)}")
        for column, (name, plan) in zip(panels.T[1:], plans.items(), strict=True):
            ball_pictures.draw_trajectories(column, [ball_throws.planned(plan)], name, new=True)
            miss = 100 * np.linalg.norm((plan.predicted_landing - basket)[:2])
            column[0].set_title(
                f"{MODELS_8_6[name]}, new target:\nexpected to miss it by {miss:.1f} cm"
            )
        letter_panels(*panels[0])
        ball_pictures.trajectory_legend(figure, 5)
        return save(figure, folder, "figure_8_6"), measured_8_6(seed)


def measured_8_6(seed: int) -> dict:
    """Where plans for new baskets expect the ball, and how rough they are beside the
    demonstrations.
    """
    shown, basket = ball_throws.all_demonstrated(seed, "thesis"), ball_throws.new_baskets(seed)[0]
    plans = {
        name: ball_throws.planned(ball_throws.skill(seed, name).plan(basket))
        for name in MODELS_8_6
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
            for name in MODELS_8_6
        },
    }


TITLE_8_9 = "Local regression: chosen trajectories and the generated one"
MODELS_8_9 = ("thesis_local", "thesis", "default")


def draw_8_9(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    _, basket, chosen = compute_8_8(seed)
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
        return save(figure, folder, "figure_8_9"), measured_8_9(seed, shown, made, miss)


def measured_8_9(
    seed: int, shown: list[ball_throws.DrawnThrow], made: ball_throws.DrawnThrow, miss: float
) -> dict:
    """The generated throw, and where plans for ten new baskets expect the ball, local model and
    global ones.
    """
    misses = {name: 100 * ball_throws.predicted_misses(seed, name) for name in MODELS_8_9}
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


def _range(shown: list[ball_throws.DrawnThrow]) -> str:
    speeds = [one.speed for one in shown]
    return f"{min(speeds):.2f} to {max(speeds):.2f}"


TITLE_8_11 = "Speed of the hand before and after synchronisation"


def draw_8_11(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    taught = ball_throws.lessons(seed)
    motions = demonstrated_motions(taught.recordings, taught.demonstrations)
    starts, releases, stops = (
        np.array([getattr(one, name) for one in motions])
        for name in ("motion_start", "release", "motion_stop")
    )
    return draw_synchronisation(motions, folder, name="figure_8_11"), {
        "demonstrations": len(motions),
        "release_spread_ms": {
            "as_recorded": _spread_ms(releases),
            "from_the_start_of_the_motion": _spread_ms(releases - starts),
            "from_the_release": 0.0,
        },
        "motion_start_spread_ms": {
            "as_recorded": _spread_ms(starts),
            "from_the_release": _spread_ms(starts - releases),
        },
        "recording_s": [
            round(float(bound), 2) for bound in _ends([one.time[-1] for one in motions])
        ],
        "motion_s": [round(float(bound), 2) for bound in _ends(stops - starts)],
    }


def _spread_ms(times: np.ndarray) -> float:
    return round(1000 * float(times.std(ddof=1)), 1)


def _ends(values: Iterable[float]) -> tuple[float, float]:
    return min(values), max(values)
