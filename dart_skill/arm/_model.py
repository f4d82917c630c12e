"""The controller's model of the arm: kinematics and dynamics by Pinocchio.

That of the WAM is built from its DH table: it shares numbers with the URDF but no code and no
frames, and a mistake in either shows up as a tracking error. Other arms have a URDF only. Frames:
joint i's frame is the URDF's link frame; `hand` is the frame of the hand; positions are in the
world, whose origin is on the floor below the base axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dart_skill.arm._arm_terms import ArmTerms
from dart_skill.arm._description import ArmDescription, Inertial, rotation_of
from dart_skill.arm._the_arm import the_arm
from dart_skill.common.extras import Absent

try:
    import pinocchio as pin
except ModuleNotFoundError as error:  # not needed by a program that makes no model of the arm
    pin = Absent(error)


@dataclass(frozen=True)
class HandState:
    """Pose and velocity of the hand frame in world axes: position (3,), rotation (3, 3), velocity
    (6,) linear over angular.
    """

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray

    @property
    def linear(self) -> np.ndarray:
        """Linear velocity (3,) [m/s]."""
        return self.velocity[:3]

    @property
    def angular(self) -> np.ndarray:
        """Angular velocity (3,) [rad/s]."""
        return self.velocity[3:]


class ArmModel:
    """Kinematics and dynamics of the arm with its hand, loaded with the ball or not.

    All methods take joint angles (n,) [rad] and velocities (n,) [rad/s].
    """

    def __init__(self, description: ArmDescription | None = None, ball_in_hand: bool = False):
        self.description = description or the_arm()
        self._model, self._hand = _build(self.description, ball_in_hand)
        self._data = self._model.createData()
        self._reflected = self.description.motors.reflected_inertia
        self._terms: ArmTerms | None = None

    def at(self, q: np.ndarray, qd: np.ndarray | None = None) -> ArmTerms:
        """What the model says of a state, for who asks much of it; the numbers are those of the
        next state once that is asked for.

        Without velocities, what depends on them is left out.
        """
        if self._terms is None:
            hand, elbow = self._model.frames[self._hand].placement, self.description.elbow
            self._terms = ArmTerms(pin, self._model, hand, self._reflected, elbow)
        self._terms.take(q, qd)
        return self._terms

    def hand_pose(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) and rotation (3, 3) of the hand frame in the world."""
        pin.framesForwardKinematics(self._model, self._data, q)
        placement = self._data.oMf[self._hand]
        return placement.translation.copy(), placement.rotation.copy()

    def hand_state(self, q: np.ndarray, qd: np.ndarray) -> HandState:
        """Pose and velocity of the hand frame in world axes."""
        return HandState(*self.at(q, qd).hand())

    def hand_states(
        self, q: np.ndarray, qd: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position (k, 3), rotation (k, 3, 3) and velocity (k, 6) of the hand at angles q and
        speeds qd (k, n), as of `hand_state`.
        """
        position, rotation, velocity = (
            np.empty((len(q), 3)),
            np.empty((len(q), 3, 3)),
            np.empty((len(q), 6)),
        )
        for k in range(len(q)):
            position[k], rotation[k], velocity[k] = self.at(q[k], qd[k]).hand()
        return position, rotation, velocity

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Linear over angular velocity of the hand frame in world axes (6, n)."""
        return pin.computeFrameJacobian(
            self._model, self._data, q, self._hand, pin.LOCAL_WORLD_ALIGNED
        )

    def jacobian_drift(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Acceleration of the hand frame at zero joint acceleration, dJ/dt qd (6,)."""
        pin.forwardKinematics(self._model, self._data, q, qd, np.zeros(len(q)))
        return pin.getFrameClassicalAcceleration(
            self._model, self._data, self._hand, pin.LOCAL_WORLD_ALIGNED
        ).vector

    def elbow(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) of the elbow in the world and its linear Jacobian (3, n)."""
        terms = self.at(q)
        return terms.elbow(), terms.elbow_jacobian()

    def speeds(self, q: np.ndarray, qd: np.ndarray) -> tuple[list[float], float, float]:
        """Position (3,) of the hand in the world [m], and the speeds of hand and elbow [m/s]."""
        terms = self.at(q, qd)
        return [float(at) for at in terms.position], terms.hand_speed, terms.elbow_speed

    def mass_matrix(self, q: np.ndarray, rotors: bool = True) -> np.ndarray:
        """Joint-space inertia (n, n) [kg m^2], with the rotors' reflected inertia unless told
        otherwise.
        """
        upper = pin.crba(self._model, self._data, q)
        # Pinocchio fills the upper triangle only
        inertia = np.where(np.tri(len(upper), k=-1, dtype=bool), upper.T, upper)
        return inertia + self._reflected if rotors else inertia

    def gravity_torque(self, q: np.ndarray) -> np.ndarray:
        """Torque that holds the arm against gravity (n,) [N m]."""
        return pin.computeGeneralizedGravity(self._model, self._data, q).copy()

    def coriolis_torque(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Coriolis and centrifugal torque (n,) [N m]."""
        still = np.zeros(len(q))
        return pin.rnea(self._model, self._data, q, qd, still) - self.gravity_torque(q)


def _build(description: ArmDescription, ball_in_hand: bool) -> tuple[pin.Model, int]:
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -description.gravity])
    parent = 0
    for joint, (before, inertial, at) in zip(
        description.joints, _segments(description), strict=True
    ):
        parent = model.addJoint(parent, pin.JointModelRZ(), before, joint.name)
        body = pin.Inertia(inertial.mass, inertial.centre, inertial.inertia)
        model.appendBodyToJoint(parent, body, at)
    placement = _hand(description)
    hand = description.hand.inertial
    model.appendBodyToJoint(parent, pin.Inertia(hand.mass, hand.centre, hand.inertia), placement)
    if ball_in_hand:
        ball = description.ball
        body = pin.Inertia(ball.mass, description.hand.ball_centre, ball.inertia * np.eye(3))
        model.appendBodyToJoint(parent, body, placement)
    # With a parent frame, the universe: pin 2.7, the newest wheel for numpy 1.26, knows no other
    # way.
    return model, model.addFrame(pin.Frame("hand", parent, 0, placement, pin.FrameType.OP_FRAME))


def _segments(description: ArmDescription) -> list[tuple[pin.SE3, Inertial, pin.SE3]]:
    """For each joint its frame in that of the joint before, its link, and the frame of that in the
    frame of the joint.
    """
    if description.dh is None:
        below = pin.SE3(np.eye(3), np.array([0.0, 0.0, description.mount_height]))
        frames = [pin.SE3(joint.rotation, joint.xyz) for joint in description.joints]
        frames[0] = below * frames[0]
        return [
            (frame, inertial, pin.SE3.Identity())
            for frame, inertial in zip(frames, description.links_urdf, strict=True)
        ]
    distal = [_distal(*row) for row in description.dh]
    frames = [pin.SE3(np.eye(3), description.shoulder), *distal[:-1]]
    return list(zip(frames, description.links_dh, distal, strict=True))


def _hand(description: ArmDescription) -> pin.SE3:
    """The frame of the hand in that of the last joint."""
    if description.dh is None:
        return pin.SE3(rotation_of(description.tool_rpy), description.tool_plate)
    return _distal(*description.dh[-1])


def _distal(alpha: float, a: float, d: float) -> pin.SE3:
    """From a joint's frame to its DH frame: Trans_z(d) Trans_x(a) Rot_x(alpha)."""
    cosine, sine = round(np.cos(alpha), 15), round(np.sin(alpha), 15)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    return pin.SE3(rotation, np.array([a, 0.0, d]))
