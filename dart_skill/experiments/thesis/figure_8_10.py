"""Figure 8.10: alpha and beta of the three demonstrations chosen for local regression, in both
frames.

The thesis calls them consistent: their targets differ little in azimuth, so that it does not
matter what the frames make of it.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from dart_skill.experiments.thesis import ball_pictures, ball_throws, figure_8_8
from dart_skill.experiments.thesis.ball_throws import FRAMES
from dart_skill.experiments.thesis.figure_8_7 import spreads
from dart_skill.figures import house_style, save

TITLE = "Angles of the hand in the chosen demonstrations, as two frames see them"


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    chosen = figure_8_8.compute(seed)[2]
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
