"""The motion of joints that are too slow for a plan, and keep what matters of it: where the hand is
at the events of the plan, and how fast.

The speeds of the joints are cubic B-splines, which stay between their control points; so a limit of
speed is a bound of each control point. Bounded least squares (`scipy.optimize.least_squares`) make
the hand follow its path, and be at the events where it is planned, as fast as it is planned, by the
place where it holds. How the hand turns on the way counts least.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from dart_skill.arm._description import ArmDescription
from dart_skill.arm._guide import References
from dart_skill.arm._impedance import rotation_error
from dart_skill.arm._model import ArmModel
from dart_skill.arm._motion_plan import MotionPlan

DEGREE = 3
"""Degree of the splines of the speeds."""
SPACING = 0.04
"""Time between two knots [s]."""
LOOKS = 0.02
"""Time between two instants at which the path counts [s]."""
AROUND = 0.008
"""The speed counts as much before and after an event, where late fingers may let go, too [s]."""
ON_THE_WAY = np.array([0.02, 0.02, 0.02, 0.2, 0.2, 0.2])
"""Deviations that count as much as one another: of the hand on the way [m], [rad];"""
AT_EVENTS, SPEED_AT_EVENTS, SPEED_AROUND = 5e-4, 2e-3, 2e-2
"""where it holds, at an event [m], its speed there, and around it [m/s];"""
GAINS = 100.0
"""and the acceleration of a joint [rad/s^2]."""
USED = 0.98
"""Share of the joints' speeds that is used."""
SMALL = 1e-5
"""Change of an angle or a speed by which slopes are found [rad], [rad/s]."""


class LimitedMotion:
    """Looks for the motion of a plan, as the arm has it, with joints that are slow.

    Attribute: missed, how far what the hand holds is off at the events of the motion that was
    found [m], and how much faster or slower [m/s].

    Parameters
    ----------
    plan
        Of the hand.
    duration
        Until then the path is followed [s].
    description
        Of the arm.
    """

    def __init__(self, plan: MotionPlan, duration: float, description: ArmDescription):
        self.missed = 0.0, 0.0
        self._start, self._most = (
            plan.start_posture,
            USED * description.of_joints("no_load_speed"),
        )
        self._model, self._grip = ArmModel(description), description.hand.ball_centre
        inner = np.linspace(0.0, duration, max(2, round(duration / SPACING) + 1))
        knots = np.concatenate([[0.0] * DEGREE, inner, [duration] * DEGREE])
        self._speeds = BSpline(knots, np.eye(len(inner) + DEGREE - 1), DEGREE)
        self._angles, self._gains = self._speeds.antiderivative(), self._speeds.derivative()
        references = References(plan)
        way = np.arange(LOOKS, duration, LOOKS)
        done = np.array([event.done for event in plan.events if event.done <= duration])
        events = (done[:, None] + [-AROUND, 0.0, AROUND]).ravel().clip(0.0, duration)
        self._times = np.concatenate([way, events])
        self._wanted = [references.at(time) for time in self._times]
        self._on_the_way = len(way)
        self._rates = self._speeds(self._times)
        self._at, self._rated = self._angles(self._times)[:, 2:], self._rates[:, 2:]
        self._gained = self._gains(way)[:, 2:]

    def found(
        self, speeds: np.ndarray, time: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, speeds and accelerations (n, joints) of the motion at instants.

        Parameters
        ----------
        speeds
            Of the motion without limits at these instants (n, joints) [rad/s].
        time
            The instants (n,) [s].
        """
        rates = self._speeds(time)[:, 2:]
        guess = np.linalg.lstsq(rates, speeds.clip(-self._most, self._most), rcond=None)[0]
        bound = np.tile(self._most, (len(guess), 1))
        inside = guess.clip(-0.99 * bound, 0.99 * bound)
        solution = least_squares(
            self._deviations,
            inside.ravel(),
            self._slopes,
            bounds=(-bound.ravel(), bound.ravel()),
            max_nfev=60,
        )
        control = solution.x.reshape(guess.shape)
        self.missed = self._missed(control)
        angles, gains = self._angles(time)[:, 2:], self._gains(time)[:, 2:]
        return self._start + angles @ control, rates @ control, gains @ control

    def _missed(self, control: np.ndarray) -> tuple[float, float]:
        """Largest distance of what the hand holds from its place at an event [m], and the largest
        difference of its speed [m/s]; 0 without an event.
        """
        q, qd = self._start + self._at @ control, self._rated @ control
        off = [
            self._held(q[k], qd[k]) - self._there(k)
            for k in range(self._on_the_way + 1, len(self._wanted), 3)
        ]
        away, slower = (
            max((float(np.linalg.norm(row[part])) for row in off), default=0.0)
            for part in (slice(3), slice(3, 6))
        )
        return away, slower

    def _there(self, k: int) -> np.ndarray:
        """Place and speed (6,) that what the hand holds shall have."""
        wanted = self._wanted[k]
        return np.concatenate(held(wanted.position, wanted.rotation, wanted.velocity, self._grip))

    def _deviations(self, control: np.ndarray) -> np.ndarray:
        """What is minimised, as a row of numbers: each in parts of what counts as much as others."""
        control = control.reshape(-1, len(self._start))
        q, qd = self._start + self._at @ control, self._rated @ control
        result = [(self._gained @ control).ravel() / GAINS]
        for k, wanted in enumerate(self._wanted):
            position, rotation = self._model.hand_pose(q[k])
            off = np.append(position - wanted.position, rotation_error(rotation, wanted.rotation))
            result.append(off / ON_THE_WAY)
            if k >= self._on_the_way:
                result.append((self._held(q[k], qd[k]) - self._there(k)) / self._counts(k))
        return np.concatenate(result)

    def _slopes(self, control: np.ndarray) -> np.ndarray:
        """Changes of the deviations with the control points. Those of how the hand is turned are
        exact where it is turned as planned.
        """
        control = control.reshape(-1, len(self._start))
        q, qd = self._start + self._at @ control, self._rated @ control
        each = np.eye(len(self._start))
        result = [np.kron(self._gained, each) / GAINS]
        for k in range(len(self._wanted)):
            moves = self._model.jacobian(q[k]) / ON_THE_WAY[:, None]
            result.append(np.kron(self._at[k], moves))
            if k >= self._on_the_way:
                by_angles, by_speeds = self._slopes_held(q[k], qd[k])
                slopes = np.kron(self._at[k], by_angles) + np.kron(self._rated[k], by_speeds)
                result.append(slopes / self._counts(k)[:, None])
        return np.vstack(result)

    def _counts(self, k: int) -> np.ndarray:
        """Deviations of place and speed (6,) that count as one, at an event or around it."""
        if (k - self._on_the_way) % 3 == 1:
            return np.repeat([AT_EVENTS, SPEED_AT_EVENTS], 3)
        return np.repeat([ON_THE_WAY[0], SPEED_AROUND], 3)

    def _held(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Place and speed (6,) of what the hand holds."""
        hand = self._model.hand_state(q, qd)
        return np.concatenate(held(hand.position, hand.rotation, hand.velocity, self._grip))

    def _slopes_held(self, q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes (6, joints) of that with the angles, and with the speeds."""
        steps = SMALL * np.eye(len(q))
        by_angles = [self._held(q + step, qd) - self._held(q - step, qd) for step in steps]
        by_speeds = [self._held(q, qd + step) - self._held(q, qd - step) for step in steps]
        return np.array(by_angles).T / (2.0 * SMALL), np.array(by_speeds).T / (2.0 * SMALL)


def held(
    position: np.ndarray, rotation: np.ndarray, velocity: np.ndarray, grip: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Place and speed (3,) of what a hand holds.

    Parameters
    ----------
    position, rotation, velocity
        Of the hand (3,), (3, 3), (6,).
    grip
        Where it holds, in its frame (3,) [m].
    """
    arm = rotation @ grip
    return position + arm, velocity[:3] + np.cross(velocity[3:], arm)
