"""Figure 6.6: where to aim, for every precision: the path of the best aim over sigma and the sigma
at which it jumps.

The thesis gives 16.4 mm for the jump from treble 20 to treble 19, from a map on a grid of
millimetres; the value here does not depend on a grid.
"""

from __future__ import annotations

from pathlib import Path

from dart_skill.darts import OptimumPath, optimum_path
from dart_skill.figures import draw_path

TITLE = "The best aim over the thrower's standard deviation"
LOWEST, HIGHEST = 1.0, 100.0


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    """The same for every seed: there is nothing random in it."""
    path = optimum_path(LOWEST, HIGHEST)
    return draw_path(path, folder, "figure_6_6"), measured(path)


def measured(path: OptimumPath) -> dict:
    """Jumps [mm], and best aims [mm] at both ends of the range."""
    return {
        "jumps": [
            {"sigma_mm": round(jump.sigma, 3), "below": jump.below.bed, "above": jump.above.bed}
            for jump in path.jumps
        ],
        "aim_at_lowest_mm": path.aims[0].round(1).tolist(),
        "aim_at_highest_mm": path.aims[-1].round(1).tolist(),
    }
