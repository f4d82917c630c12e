"""Figure 8.7: alpha and beta of the demonstrations in the thesis's two frames, and in axes that
turn with the target.

The thesis blames beta, which "was not consistent to fit a GMM in different frame of reference"
(8.4.4). As long as the hand points backwards, which it does beyond the release, its beta in world
axes has the sign opposite to the target's azimuth. Frame 2 takes the beta of the direction to the
target off it, which doubles what differs from throw to throw instead of removing it. In axes that
turn with the target, beta is small throughout.

Figure 8.10: alpha and beta of the three demonstrations chosen for local regression, in both
frames.

The thesis calls them consistent: their targets differ little in azimuth, so that it does not
matter what the frames make of it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.experiments.thesis import ball_pictures, ball_throws
from dart_skill.experiments.thesis.ball_throws import FRAMES, Angles
from dart_skill.experiments.thesis.nearest_baskets import compute_8_8
from dart_skill.figures import house_style, save

TITLE_8_7 = "Angles of the hand in all demonstrations, as two frames see them"


def draw_8_7(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    seen = {frame: ball_throws.angles_in(seed, frame) for frame in FRAMES}
    with house_style():
        figure = Figure(figsize=(10.5, 5.6), layout="constrained")
        ball_pictures.draw_angles(
            figure,
            {
                FRAMES[frame][0].upper() + FRAMES[frame][1:]: angles
                for frame, angles in seen.items()
            },
        )
        n = len(ball_throws.lessons(seed).demonstrations)
        figure.suptitle(
            f"Demonstrations, n = {n}; band: mean ± s.d.; diamond: release", x=0.01, ha="left"
        )
        return save(figure, folder, "figure_8_7"), {
            "thesis_says": (
                "the data of beta was not consistent to fit a GMM in different frame of reference"
            ),
            **{frame: spreads(angles) for frame, angles in seen.items()},
        }


def spreads(angles: Angles) -> dict:
    """Standard deviations from throw to throw, of the whole motion (rms over time) and at the
    release [degrees].
    """
    names = ("alpha_deg", "beta_deg")
    whole, at_release = (
        [round(float(x), 1) for x in np.rad2deg(pair)]
        for pair in (angles.spread, angles.spread_at_release)
    )
    return {
        "spread": dict(zip(names, whole, strict=True)),
        "spread_at_release": dict(zip(names, at_release, strict=True)),
    }


TITLE_8_10 = "Angles of the hand in the chosen demonstrations, as two frames see them"


def draw_8_10(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    chosen = compute_8_8(seed)[2]
    seen = {frame: ball_throws.angles_in(seed, frame, chosen) for frame in ("frame_1", "frame_2")}
    every = {frame: ball_throws.angles_in(seed, frame) for frame in seen}
    with house_style():
        figure = Figure(figsize=(8.6, 5.6), layout="constrained")
        ball_pictures.draw_angles(
            figure,
            {
                FRAMES[frame][0].upper() + FRAMES[frame][1:]: angles
                for frame, angles in seen.items()
            },
        )
        figure.suptitle(
            f"Chosen demonstrations, n = {len(chosen)}; band: mean ± s.d.; diamond: release",
            x=0.01,
            ha="left",
        )
        return save(figure, folder, "figure_8_10"), {
            "thesis_says": (
                "the orientation data is consistent in selected trajectories for fitting a GMM"
            ),
            **{
                frame: {"chosen": spreads(seen[frame]), "all": spreads(every[frame])}
                for frame in seen
            },
        }
