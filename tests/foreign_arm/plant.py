"""The plant: the arm with a scene in MuJoCo, stepped at 500 Hz. A scene is what the hand holds, how
it holds it, and where that shall go.
"""

import mujoco
import numpy as np

from tests.foreign_arm.arm import PERIOD, SUBSTEPS, Encoders, Motors, describe, quaternion
from tests.foreign_arm.hand import Hand


class Scene:
    """What differs from one task to the next.

    Attributes
    ----------
    loose
        The free body, which the hand may hold.
    movable
        The body that a person may put anywhere.
    grasp
        Of the loose body in the frame of the hand that holds it (3,) [m].
    """

    loose = movable = ""
    grasp = np.zeros(3)

    def describe(self, root, hand, laboratory):
        """Add the hand's own parts, and what stands in the world, to an MJCF."""
        raise NotImplementedError

    def begin(self, plant):
        """The plant has been made: put things to their places."""

    def act(self, plant):
        """What hand and air do in the next step."""
        raise NotImplementedError


class Plant:
    """The world at 500 Hz: `step` takes joint torques, the person's pushes, and where a person
    carries the loose body.

    Parameters
    ----------
    laboratory
        The nuisances.
    posture
        At the beginning (7,) [rad].
    scene
        What there is beside the arm.
    """

    def __init__(self, laboratory, posture, scene):
        self.laboratory, self.scene = laboratory, scene
        self.model = mujoco.MjModel.from_xml_string(describe(laboratory, scene))
        self.data = mujoco.MjData(self.model)
        names = [self.model.joint(index).name for index in range(self.model.njnt)]
        address = {name: self.model.joint(name).dofadr[0] for name in names}
        self._motor = np.array([address[f"motor{number}"] for number in range(1, 8)])
        self._drive = np.array(
            [address[f"drive{number}"] for number in range(1, 8) if f"drive{number}" in address],
            int,
        )
        self._loose_position = self.model.joint(scene.loose).qposadr[0]
        self._loose_speed = address[scene.loose]
        self.tracked = ("hand", scene.loose, scene.movable)
        self._bodies = {name: self.model.body(name).id for name in (*self.tracked, "link4")}
        self._motors = Motors()
        self.hand = Hand(laboratory, np.random.default_rng([laboratory.seed, 72]))
        self.steps = 0
        self.torque = np.zeros(7)
        self.data.qpos[self._motor] = posture
        mujoco.mj_forward(self.model, self.data)
        scene.begin(self)
        mujoco.mj_forward(self.model, self.data)
        self.encoders = Encoders(laboratory, self.data.qpos[self._motor])

    @property
    def time(self):
        """Since the start [s]."""
        return self.steps * PERIOD

    @property
    def motor_angles(self):
        """True angles of the motors at the joints (7,)."""
        return self.data.qpos[self._motor].copy()

    @property
    def link_angles(self):
        """True angles of the links (7,): with the drives' deflection."""
        angles = self.data.qpos[self._motor].copy()
        if len(self._drive):
            angles += self.data.qpos[self._drive]
        return angles

    def pose(self, body):
        """Position (3,) and rotation (3, 3) of a tracked body or link4 (its origin is the elbow) in
        the world.
        """
        index = self._bodies[body]
        return self.data.xpos[index].copy(), self.data.xmat[index].reshape(3, 3).copy()

    def velocity(self, body):
        """Linear (3,) and angular (3,) velocity of the origin of a body in world axes."""
        both = np.zeros(6)
        mujoco.mj_objectVelocity(
            self.model, self.data, mujoco.mjtObj.mjOBJ_XBODY, self._bodies[body], both, 0
        )
        return both[3:], both[:3]

    def grasp(self):
        """Where the loose body is in a hand that holds it (3,)."""
        place, turn = self.pose("hand")
        return place + turn @ self.scene.grasp

    def put(self, place, velocity=(0.0, 0.0, 0.0), rotation=None):
        """The loose body is there (3,), moves so (3,), and is turned so (3, 3)."""
        turned = quaternion(np.eye(3) if rotation is None else rotation)
        self.data.qpos[self._loose_position : self._loose_position + 7] = [*place, *turned]
        self.data.qvel[self._loose_speed : self._loose_speed + 6] = [*velocity, 0.0, 0.0, 0.0]

    def stand(self, place, rotation=None):
        """The movable body stands there (3,), turned so (3, 3)."""
        self.data.mocap_pos[0] = place
        self.data.mocap_quat[0] = quaternion(np.eye(3) if rotation is None else rotation)

    @property
    def loose_velocity(self):
        """Of the loose body (3,) [m/s]."""
        return self.data.qvel[self._loose_speed : self._loose_speed + 3].copy()

    def _rub(self):
        """Coulomb friction with stiction that fades with speed, at the motors (Stribeck)."""
        laboratory = self.laboratory
        fade = np.exp(-((self.data.qvel[self._motor] / laboratory.stribeck_speed) ** 2))
        self.model.dof_frictionloss[self._motor] = laboratory.coulomb * (
            1.0 + (laboratory.stiction - 1.0) * fade
        )

    def push(self, body, force, moment=(0.0, 0.0, 0.0)):
        """A wrench at the origin of a body for this step, world axes."""
        index = self._bodies[body]
        lever = self.data.xpos[index] - self.data.xipos[index]
        self.data.xfrc_applied[index, :3] = force
        about_centre = np.zeros(3)
        mujoco.mju_cross(about_centre, lever, force)
        self.data.xfrc_applied[index, 3:] = about_centre + moment

    def step(self, torque, pushes=(), carried=None):
        """Advance by 2 ms: joint torques (7,), pushes (body, force (3,), moment (3,)), the pose
        (3,), (3, 3) of a carried loose body.
        """
        self.torque = np.asarray(torque, float)
        if self.laboratory.real_motors:
            self.torque = self._motors.available(self.torque, self.data.qvel[self._motor])
        self.data.xfrc_applied[:] = 0.0
        for body, force, moment in pushes:
            self.push(body, force, moment)
        self.data.qfrc_applied[self._motor] = self.torque
        self.scene.act(self)
        self._rub()
        if carried is not None:
            self.put(carried[0], self.velocity("hand")[0], carried[1])
        mujoco.mj_step(self.model, self.data, SUBSTEPS)
        mujoco.mj_kinematics(self.model, self.data)
        self.steps += 1
        self.encoders.read(self.data.qpos[self._motor])
