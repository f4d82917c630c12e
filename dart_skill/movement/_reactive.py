"""A model that is asked while the robot moves: at every step, with the state and the frames of now
(thesis chapter 9).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dart_skill.common.checks import as_number, as_vector
from dart_skill.common.pace import PhaseRule
from dart_skill.movement._autonomous import Moment, StateFrame


class PhaseModel(Protocol):
    """What the state may drive: `AutonomousDSGMR`, or `PrimitiveCourse`."""

    @property
    def n_inputs(self) -> int:
        """Number of further inputs."""

    @property
    def rule(self) -> PhaseRule:
        """How the state changes the phase."""

    @property
    def ends(self) -> tuple[float, float]:
        """First and last phase [s]."""

    @property
    def stiffness(self) -> ArrayLike:
        """Stiffness of (7.19) [1/s^2]."""

    @property
    def damping(self) -> ArrayLike:
        """Damping of (7.19) [1/s]."""

    def moment(
        self, frames: Sequence[StateFrame], phase: float, inputs: ArrayLike | None = None
    ) -> Moment:
        """What belongs to one phase [s], in frames as they are now."""


class Reaction(NamedTuple):
    """phase [s] and its rate, which is 1 at the pace that was shown.

    Parameters
    ----------
    along
        The rate that would be, were it for what the robot is ahead or behind alone.
    moment
        What belongs to the phase in the frames of now.
    """

    phase: float
    rate: float
    along: float
    moment: Moment


class ReactivePolicy:
    """Keeps the phase of one movement, from the start of what was shown to its end.

    Parameters
    ----------
    model
        That was fitted.
    inputs
        Its further inputs (q,), default None.
    """

    def __init__(self, model: PhaseModel, inputs: ArrayLike | None = None):
        self._model, self._inputs = model, inputs
        self.phase, self._end = model.ends

    @property
    def is_over(self) -> bool:
        """Whether the end of what was shown is reached: the attractor stays where it is, in its
        frames.
        """
        return self.phase >= self._end

    def react(
        self,
        frames: Sequence[StateFrame],
        position: ArrayLike,
        velocity: ArrayLike,
        step: float,
        pace: float = 1.0,
    ) -> Reaction:
        """The phase after a step [s], for a robot with this position and velocity (d,)

        Parameters
        ----------
        frames
            As they are now.
        pace
            Rate at which the robot was led until now: one that waits is not behind because it is
            slow.
        """
        moment, rule = self._model.moment(frames, self.phase, self._inputs), self._model.rule
        d = len(moment.attractor)
        away = as_vector(position, "position", d) - moment.state[:d]
        faster = as_vector(velocity, "velocity", d) - moment.paced(pace)[0]
        ahead = moment.gain @ np.concatenate([away, faster])
        rate = rule.rate(float(ahead), moment.aside(away))
        self.phase = min(self.phase + rate * as_number(step, "step", strict=False), self._end)
        return Reaction(self.phase, rate, rule.rate(float(ahead)), moment)
