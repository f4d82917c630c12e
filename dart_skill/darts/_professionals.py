"""Spreads of sixteen professionals (M. Haugh and C. Wang, "Play like the pros?", INFORMS Journal
on Computing, 2022).

There is a covariance for each target, without bias. The table is the published fit, rounded to 0.1
mm^2: xx, xy and yy at treble 20, 19, 18 and 17, double bull and doubles.
"""

from __future__ import annotations

import numpy as np

from dart_skill.darts._board import as_target
from dart_skill.darts._spread import Spread, SpreadByTarget

TARGETS = ("T20", "T19", "T18", "T17", "DB", "doubles")
_TABLE = """
Anderson 97.8 19.7 39.8 102.3 4.6 34.9 79.4 -28.0 90.4 55.2 18.9 70.7 69.2 -30.5 58.8 106.6 -5.3 49.2
Aspinall 82.5 20.3 44.0 63.9 -17.9 53.0 56.3 -9.1 75.5 62.6 8.7 75.0 60.0 -15.5 54.6 51.4 -7.2 102.4
Chisnall 96.7 25.5 37.9 85.8 -23.5 45.5 72.3 -34.2 95.2 112.5 -41.8 73.7 82.7 -42.4 88.1 74.2 -12.7 64.4
Clayton 97.5 30.4 54.5 83.9 -14.6 55.6 70.4 11.1 119.5 61.9 -24.3 21.0 86.4 -13.6 69.7 108.1 -13.9 105.5
Cross 74.8 15.2 43.4 86.9 7.0 34.9 58.0 -31.2 85.1 94.0 -45.7 84.1 70.5 4.3 82.5 64.6 -42.4 120.3
Cullen 94.0 23.9 51.3 81.6 1.2 39.7 63.9 -26.9 91.0 85.6 -37.7 50.4 39.3 -23.8 102.8 92.1 -40.0 70.3
Gurney 77.9 23.8 47.7 64.4 -19.3 66.5 63.3 -21.2 80.2 88.1 -20.0 76.8 70.8 -0.7 114.5 68.0 -17.8 104.2
Lewis 100.9 -15.5 48.9 88.2 -9.2 54.2 68.9 -24.2 105.3 64.5 -9.0 234.4 89.7 -13.9 37.0 81.7 -6.8 68.0
Price 93.5 17.1 37.9 88.1 5.8 36.8 50.5 -15.5 81.8 69.3 -4.4 42.4 88.6 -0.4 39.4 83.0 33.0 61.5
Smith 80.4 25.9 45.1 55.1 -24.4 64.7 76.0 -7.2 50.6 62.3 -1.9 71.4 49.5 -1.1 67.1 74.4 -2.4 84.0
Suljovic 80.2 29.3 50.0 53.5 -21.9 77.6 57.0 -3.8 89.8 97.4 -23.1 41.0 48.8 4.8 112.9 60.2 14.3 84.2
Van_Gerwen 77.1 19.2 36.7 59.3 -12.8 44.2 57.6 -15.8 57.9 59.5 9.9 102.1 48.8 7.3 77.2 49.6 -0.5 69.2
Wade 76.8 20.4 56.0 77.6 10.5 55.4 74.6 1.1 92.8 78.2 5.9 50.3 57.4 0.2 40.2 68.8 36.4 70.4
White 94.3 26.1 42.8 76.7 -26.3 53.2 64.5 -31.6 103.3 76.1 -25.4 73.0 95.7 -36.3 102.6 86.9 -18.5 80.5
Whitlock 87.9 21.8 58.1 65.8 -31.9 80.8 53.6 -20.5 115.5 68.5 -19.3 95.1 74.0 -27.1 38.3 51.2 0.3 112.8
Wright 94.2 18.9 43.6 103.1 -0.0 35.7 65.5 -27.3 88.6 69.4 0.2 65.2 79.1 2.7 68.5 80.7 -16.1 59.4
"""
_COVARIANCES = {
    name: np.array(row, dtype=float).reshape(6, 3)
    for name, *row in (line.split() for line in _TABLE.split("\n") if line)
}
PROFESSIONALS = tuple(name.replace("_", " ") for name in _COVARIANCES)


def professional(name: str | None = None) -> SpreadByTarget:
    """Spread of a professional, by surname; None: a typical one.

    The typical one has, for each target, the shape of the mean covariance and the mean of (det
    covariance)^(1/4).

    Raises
    ------
    ValueError
        For a name that is not known.
    """
    if name is None:
        spreads = [_typical(index) for index in range(len(TARGETS))]
    else:
        known = {key.lower(): rows for key, rows in _COVARIANCES.items()}
        key = str(name).strip().lower().replace(" ", "_")
        if key not in known:
            raise ValueError(
                f"no professional is called {name!r} here; choose one of"
                f" {', '.join(PROFESSIONALS)}"
            )
        spreads = [_spread(row) for row in known[key]]
    return SpreadByTarget(
        np.array([as_target(target) for target in TARGETS[:-1]]), tuple(spreads[:-1]), spreads[-1]
    )


def _typical(index: int) -> Spread:
    spreads = [_spread(rows[index]) for rows in _COVARIANCES.values()]
    mean = Spread(np.mean([spread.covariance for spread in spreads], axis=0))
    return mean.scaled_to(float(np.mean([spread.sigma for spread in spreads])))


def _spread(row: np.ndarray) -> Spread:
    xx, xy, yy = row
    return Spread(np.array([[xx, xy], [xy, yy]]))
