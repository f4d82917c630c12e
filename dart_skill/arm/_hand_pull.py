"""How the hand is made to do what a guide says: the law (7.19) on the arm, or on a model of it that
the joints follow.
"""

import numpy as np

from dart_skill.arm._command import ArmState
from dart_skill.arm._contact import Yielding
from dart_skill.arm._description import ArmDescription
from dart_skill.arm._drive import coasted, cut
from dart_skill.arm._guide import Guidance
from dart_skill.arm._impedance import Impedance, JointServo, PoseGains
from dart_skill.arm._model import ArmModel
from dart_skill.arm._plan_checks import CommanderSettings
from dart_skill.arm._range import held_in_range
from dart_skill.common.arm_choice import joint_count


class HandPull:
    """Wrenches and torques for the guidance of one motion after the other.

    Parameters
    ----------
    settings
        Gains, limits, and the law.
    description
        Of the arm.
    servo
        Of its joints.
    """

    def __init__(
        self, settings: CommanderSettings, description: ArmDescription, servo: JointServo
    ):
        self._settings, self._servo = settings, servo
        self._swinging = description.swinging
        self._arms = {
            carries: Impedance(
                ArmModel(description, ball_in_hand=carries), settings.friction_compensation
            )
            for carries in (False, True)
        }
        self._tracking = PoseGains.of(
            (settings.tracking_stiffness, settings.tracking_damping),
            (settings.tracking_stiffness_rotation, settings.tracking_damping_rotation),
        )
        self._second_pull = self._tracking if settings.tracking == "hand" else None
        self.begin(np.zeros(joint_count()))

    def begin(self, posture: np.ndarray) -> None:
        """Another motion begins.

        Parameters
        ----------
        posture
            Of the joints before it (n,) [rad].
        """
        self._posture = posture
        self._expected: tuple[np.ndarray, np.ndarray, np.ndarray, float] | None = None
        self._taken_out = np.zeros(joint_count())  # by the torques of a careful motion

    def at(
        self, state: ArmState, now: Guidance, time: float, careful: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and torque (n,) in a state.

        Parameters
        ----------
        now
            What the hand shall do.
        time
            Since the motion began [s].
        careful
            Whether what is left of the distance is taken out.
        """
        if self._settings.tracking == "joints":
            wrench, torque = self._follow(state, now, time, careful)
        else:
            arm, q, qd = self._arms[now.carries], state.position, state.velocity
            tracking = None if now.touches and now.carries else self._second_pull
            acceleration = arm.pulled(q, qd, now.reference, now.gains, tracking)
            wrench, torque = arm.act(q, qd, acceleration, self._aim(q, now))
        limits = self._settings.limits
        return cut(wrench, limits.strongest_force, limits.strongest_moment), torque

    def yielding(
        self, position: np.ndarray, gains: PoseGains, carries: bool, touches: bool = False
    ) -> Yielding:
        """How far the hand that is pulled to a place gives way to a force.

        Parameters
        ----------
        position
            Of the joints (n,) [rad].
        gains
            Of the law (7.19).
        carries
            Whether the hand holds something.
        touches
            As of `Guidance`.
        """
        model = self._arms[carries].model
        jacobian = model.jacobian(position)[:3]
        if self._settings.tracking == "joints":
            # their dampers pull little, and late speeds in what is wanted would make the arm swing
            return Yielding(jacobian / self._servo.gains.following_stiffness @ jacobian.T, 0.0)
        mobility = jacobian @ np.linalg.solve(model.mass_matrix(position), jacobian.T)
        stiffness, damping = _of_position(gains.stiffness), _of_position(gains.damping)
        if self._second_pull is not None and not touches:
            stiffness = stiffness + _of_position(self._second_pull.stiffness)
            damping = damping + _of_position(self._second_pull.damping)
        lead = float(np.trace(damping) / np.trace(stiffness))
        return Yielding(np.linalg.solve(stiffness, mobility), lead)

    def _aim(self, position: np.ndarray, now: Guidance) -> np.ndarray:
        """What the free motion of the arm aims at (n,): the posture of the start, or of the plan,
        but for the joints that swing.
        """
        posture = self._posture if now.posture is None else now.posture
        return np.where(self._swinging, position, posture)

    def _follow(
        self, state: ArmState, now: Guidance, time: float, careful: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wrench (6,) and torque (n,) of the motion that (7.19) makes of the plan on the model of
        the arm, and a pull of the joints to it.

        The law acts on the model, where nothing is late or noisy; of the arm's own sensors only
        the joints' servo lives.
        """
        then = time if self._expected is None else self._expected[3]
        wrench, torque, (q, qd, _) = self.expect(state.position, now, time)
        if careful and time != then:
            self._taken_out = self._servo.take_out(self._taken_out, state.position, q, time - then)
        pull = self._servo.follow(state.position, state.velocity, q, qd)
        return wrench, torque + self._taken_out + pull

    def expect(
        self, start: np.ndarray, now: Guidance, time: float
    ) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """The motion that (7.19) makes of the guidance on the model of the arm, from one instant to
        the next: wrench (6,), torque (n,), and angles, speeds and accelerations of the joints (n,).

        Parameters
        ----------
        start
            Where the motion begins at rest (n,) [rad].
        now, time
            As of `at`.
        """
        arm, q, qd, step = self._arms[now.carries], start.copy(), np.zeros(joint_count()), 0.0
        if self._expected is not None:
            q, qd, qdd, then = self._expected
            step = time - then
            q, qd = coasted(q, qd, qdd, step)
        acceleration = arm.pulled(q, qd, now.reference, now.gains, self._tracking)
        wrench, torque, qdd = arm.moved(q, qd, acceleration, self._aim(q, now))
        if step > 0.0 and (kept := held_in_range(arm.model, q, qd, qdd, step)) is not qdd:
            torque, qdd = torque + arm.model.mass_matrix(q) @ (kept - qdd), kept
        self._expected = q, qd, qdd, time
        return wrench, torque, (q, qd, qdd)


def _of_position(gains: np.ndarray) -> np.ndarray:
    """The part (3, 3) of gains (6,) or (6, 6) that is about positions."""
    return np.diag(gains[:3]) if gains.ndim == 1 else gains[:3, :3]
