"""Where the search for an aim begins, told from three throws of the model.

In frames that turn with the target, a throw depends on the azimuth of its aim only in that it is
turned, and where it comes down is a smooth function of the reach of its aim. Three throws, at the
least, the middle and the largest reach that was shown, tell this function as a parabola, for all
targets at once. So the first aim is within a millimetre where the target itself would be off by a
decimetre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_SPAN = 0.05
"""Reaches that were shown within less [m] tell nothing of farther ones: the search begins at the
target then, as without this.
"""


@dataclass(frozen=True, eq=False)
class FirstAim:
    """Parabolas in the reach of the landing, coefficients (3,) from the square on.

    Parameters
    ----------
    reach
        Of the aim.
    aside
        Azimuth of the landing less that of the aim.
    """

    reach: np.ndarray
    aside: np.ndarray

    @classmethod
    def of(cls, aims: np.ndarray, landings: np.ndarray) -> FirstAim | None:
        """From reach and azimuth (3, 2) of aims, in order, and of where their throws come down;
        None unless farther aims lead farther.
        """
        if not ((np.diff(aims[:, 0]) > 0.0).all() and (np.diff(landings[:, 0]) > 0.0).all()):
            return None
        powers = np.vander(landings[:, 0], 3)
        return cls(
            *np.linalg.solve(powers, np.stack([aims[:, 0], landings[:, 1] - aims[:, 1]], axis=1)).T
        )

    def at(self, target: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Aim (2,) for a target with reach and azimuth (2,), and how the landing changes with the
        aim (2, 2); None where the parabola bends back, far from what was shown.
        """
        reach = float(target[0])
        farther = 2.0 * self.reach[0] * reach + self.reach[1]
        if not farther > 0.0:
            return None
        turned = (2.0 * self.aside[0] * reach + self.aside[1]) / farther
        aim = np.array([np.polyval(self.reach, reach), target[1] - np.polyval(self.aside, reach)])
        return aim, np.array([[1.0 / farther, 0.0], [turned, 1.0]])
