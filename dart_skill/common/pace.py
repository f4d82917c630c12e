"""How the state of a robot drives a movement in place of a clock (thesis chapter 9): the rate of
the phase.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dart_skill.common.checks import as_number


@dataclass(frozen=True)
class PhaseRule:
    """How the state changes the phase: s' = clip(c (1 + d / T), slowest, fastest), where d [s] is
    how far the state is ahead of the phase, and c = min(1, (tolerated / m)^2) for a state that is
    m standard deviations beside its way.

    Parameters
    ----------
    slowest
        Float in (0, 1), default 0.05. Least rate s' of the phase; 1 is the demonstrated pace.
    fastest
        Float above 1, default 4. Largest rate of the phase.
    time_constant
        Float, default 0.05 [s]. T of the correction.
    deviation
        Float, default 0.05 [s]. w, standard deviation of the phase in the correction.
    ignored
        Float, default 0 [s]. |d| is less by so much, and at least 0: what an arm lags or leads by
        without a disturbance.
    tolerated
        Float, default None: any. Standard deviations that the state may be beside its way, neither
        ahead nor behind, before the phase slows: what was shown precisely waits for it.
    """

    slowest: float = 0.05
    fastest: float = 4.0
    time_constant: float = 0.05
    deviation: float = 0.05
    ignored: float = 0.0
    tolerated: float | None = None

    def __post_init__(self) -> None:
        for name in ("slowest", "fastest", "time_constant", "deviation"):
            as_number(getattr(self, name), name)
        as_number(self.ignored, "ignored", strict=False)
        if self.tolerated is not None:
            as_number(self.tolerated, "tolerated")
        if not self.slowest < 1.0 < self.fastest:
            raise ValueError(
                f"slowest {self.slowest} and fastest {self.fastest} must lie on either side of 1,"
                " the demonstrated pace"
            )

    def rate(self, ahead: float, aside: float = 0.0) -> float:
        """s' for a state that is so far ahead of the phase [s], and so many standard deviations
        beside its way.
        """
        heeded = math.copysign(max(abs(ahead) - self.ignored, 0.0), ahead)
        rate = 1.0 + heeded / self.time_constant
        if self.tolerated is not None and aside > self.tolerated:
            rate *= (self.tolerated / aside) ** 2
        return min(max(rate, self.slowest), self.fastest)
