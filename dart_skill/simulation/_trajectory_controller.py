"""An arm that is driven to positions: a controller of trajectories as joint_trajectory_controller of
ros2_control is documented, and the drives below it.

The controller samples its trajectory at its own rate, by the polynomial of fifth order between two
points, and of the first degree before the first one. The drives go from each of its positions to
the next within its period, and are late by a low-pass of first order. What they idealise: no jitter
of the period, no limits of the drives, no speed scaling, no protective stop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dart_skill.arm import ArmModel, ArmState, Command, Grip, JointTrajectory

STIFFNESS, DAMPING = 6400.0, 160.0
"""Gains of the drives per unit of inertia [1/s^2], [1/s]: 80 rad/s, critically damped."""
CREEPS = 0.02
"""Speed from which its direction tells that of the friction [rad/s]."""
LONGEST_STEP = 0.1
"""After a longer time the controller begins anew, where the arm is [s]."""


@dataclass(frozen=True)
class ControllerSettings:
    """What a controller does.

    Parameters
    ----------
    rate
        How often it sends a position [1/s].
    lag
        Time constant with which the drives follow [s].
    path_tolerance, goal_tolerance
        Distance of a joint from its trajectory, and from its end, at which the motion is given up,
        and before which it is not over [rad]. Those of UR's driver.
    """

    rate: float = 500.0
    lag: float = 0.0
    path_tolerance: float = 0.2
    goal_tolerance: float = 0.1


class SimulatedController:
    """A `TrajectoryController` of a simulated arm.

    Attributes: position, velocity (joints,), where the drives are [rad], [rad/s].

    Parameters
    ----------
    position
        Where the arm rests (joints,) [rad].
    settings
        Of the controller.
    """

    def __init__(self, position: np.ndarray, settings: ControllerSettings | None = None):
        self.settings, self.has_taken = settings or ControllerSettings(), True
        self._period_ns = round(1e9 / self.settings.rate)
        self.told = Grip.UNSPECIFIED
        self._now_ns: int | None = None
        self.hold(position)

    def hold(self, position: np.ndarray) -> None:
        """Rest somewhere (joints,) [rad]."""
        self.position, self.velocity = position.copy(), np.zeros(len(position))
        self._last = self._next = position.copy()
        self._trajectory: JointTrajectory | None = None
        self._ended: Callable[[str], None] = lambda _: None
        self._sampled_ns: int | None = None

    def follow(
        self, trajectory: JointTrajectory, start_ns: int, ended: Callable[[str], None]
    ) -> None:
        """See `TrajectoryController`."""
        if refused := self.why_refused(trajectory, start_ns):
            ended(f"refused: {refused}")
            return
        self._trajectory, self._start_ns, self._ended = trajectory, start_ns, ended
        self._before, self._before_ns = self._next.copy(), self._now_ns or start_ns

    def why_refused(self, trajectory: JointTrajectory, start_ns: int) -> str:
        """What speaks against a trajectory before it begins; empty if nothing."""
        if np.abs(trajectory.velocity[-1]).max() > 1e-6:
            return "the velocity of the last trajectory point is not zero"
        if self._now_ns is not None and start_ns + 1e9 * trajectory.duration < self._now_ns:
            return "the trajectory ends in the past"
        return ""

    def cancel(self) -> None:
        """See `TrajectoryController`."""
        self._trajectory = None
        self._next = self.position.copy()

    def tell_hand(self, grip: Grip) -> None:
        """See `TrajectoryController`."""
        self.told = grip

    def update(self, now_ns: int, position: np.ndarray) -> None:
        """The drives go on to a time.

        Parameters
        ----------
        now_ns
            Stamp of the state of the arm [ns].
        position
            Of the joints, as measured (joints,) [rad].
        """
        step = 0.0 if self._now_ns is None else (now_ns - self._now_ns) * 1e-9
        self._now_ns = now_ns
        if not 0.0 <= step <= LONGEST_STEP:
            self.hold(position)
        if self._sampled_ns is None or now_ns >= self._sampled_ns + self._period_ns:
            self._sample(now_ns, position)
        share = (now_ns - (self._sampled_ns or 0)) / self._period_ns
        wanted = self._last + min(share, 1.0) * (self._next - self._last)
        follows = 1.0 if self.settings.lag <= 0.0 else -np.expm1(-step / self.settings.lag)
        before = self.position
        self.position = before + follows * (wanted - before)
        self.velocity = (self.position - before) / step if step > 0.0 else np.zeros(len(before))

    def _sample(self, now_ns: int, position: np.ndarray) -> None:
        self._sampled_ns, self._last = now_ns, self._next
        if self._trajectory is None:
            return
        time = (now_ns - self._start_ns) * 1e-9
        self._next = self._at(self._trajectory, time)
        off, over = self._next - position, time > self._trajectory.duration
        if not over and np.abs(off).max() > self.settings.path_tolerance:
            self._end(f"joint {int(np.abs(off).argmax()) + 1} violates the path tolerance")
            self._next = self.position.copy()
        elif over and np.abs(off).max() <= self.settings.goal_tolerance:
            self._end("")

    def _end(self, error: str) -> None:
        self._trajectory = None
        self._ended(error)

    def _at(self, trajectory: JointTrajectory, time: float) -> np.ndarray:
        """Position (joints,) at a time [s], as the controller is documented."""
        if time < 0.0:
            since = (self._now_ns or 0) - self._before_ns
            share = since / max(self._start_ns - self._before_ns, 1)
            return self._before + share * (trajectory.position[0] - self._before)
        k = int(np.searchsorted(trajectory.time, time, side="right")) - 1
        if k >= len(trajectory.time) - 1:
            return trajectory.position[-1].copy()
        return quintic(trajectory, k, time - trajectory.time[k])

    def command(self, arm: ArmState, model: ArmModel) -> Command:
        """What the drives do in a state of a simulated arm that takes torques. They know their friction:
        where that of a URDF is estimated, wrists of little inertia would stick else.

        Parameters
        ----------
        model
            Of the arm, by which the drives know its inertia.
        """
        off, slower = self.position - arm.position, self.velocity - arm.velocity
        inertia = model.mass_matrix(arm.position)
        torque = inertia @ (STIFFNESS * off + DAMPING * slower)
        torque += model.coriolis_torque(arm.position, arm.velocity)
        coulomb, viscous = (
            model.description.of_joints(f"{kind}_friction") for kind in ("coulomb", "viscous")
        )
        torque += coulomb * np.tanh(self.velocity / CREEPS) + viscous * self.velocity
        return Command(arm.stamp_ns, joint_torque=torque)


def quintic(trajectory: JointTrajectory, k: int, time: float) -> np.ndarray:
    """Position (joints,) so long after the point k [s], on the polynomial of fifth order to the next
    one, by its coefficients as in the source of joint_trajectory_controller.
    """
    length = trajectory.time[k + 1] - trajectory.time[k]
    (p, q), (v, w), (a, b) = (
        rows[k : k + 2]
        for rows in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    third = (-20 * p + 20 * q - 3 * a * length**2 + b * length**2 - 12 * v * length
             - 8 * w * length) / (2 * length**3)  # fmt: skip
    fourth = (30 * p - 30 * q + 3 * a * length**2 - 2 * b * length**2 + 16 * v * length
              + 14 * w * length) / (2 * length**4)  # fmt: skip
    fifth = (-12 * p + 12 * q - a * length**2 + b * length**2 - 6 * v * length
             - 6 * w * length) / (2 * length**5)  # fmt: skip
    return p + v * time + a / 2 * time**2 + third * time**3 + fourth * time**4 + fifth * time**5
