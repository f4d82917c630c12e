"""Figure 5.3: as much exploration noise as in figure 5.2, shared out as the eigenvalues are, which
keeps the shape of the covariance.
"""

from __future__ import annotations

from pathlib import Path

from dart_skill.experiments.thesis.figure_5_2 import draw_noise
from dart_skill.policy_search import with_proportional_noise

TITLE = "Exploration noise, proportional to the eigenvalues: the covariance keeps its shape"


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    return draw_noise(
        folder, "figure_5_3", with_proportional_noise, "eigenvalues increased in proportion"
    )
