"""Figure 8.11: speed of the hand before and after synchronisation by velocity thresholds (8.4.3),
for all demonstrations.

The thesis shows one; what synchronisation is for is seen only when there are several. Before: each
recording on its own clock, with the teacher's pause in it. After: cut between the thresholds, and
set to the release of the ball, which is what this package does.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from dart_skill.experiments.thesis import ball_throws
from dart_skill.figures import demonstrated_motions, draw_synchronisation

TITLE = "Speed of the hand before and after synchronisation"


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
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
