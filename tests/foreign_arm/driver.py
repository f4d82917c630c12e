"""The driver of the second arm, its cameras and its person as one rclpy node, which speaks the
topics of docs/hardware.md only.
"""

import time

import numpy as np
from builtin_interfaces.msg import Time
from dart_skill_msgs.msg import WamCommand
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState

from tests.foreign_arm import published
from tests.foreign_arm.arm import PERIOD, NominalArm
from tests.foreign_arm.cameras import FRAME_STEPS, Cameras
from tests.foreign_arm.laboratory import Laboratory

FRAME = "world"
WATCHDOG = 0.05  # age of a command at which the arm is stopped [s]
STOPPING = np.array([20.0, 30.0, 10.0, 8.0, 1.0, 1.0, 0.1])
"""Damping of the joints (7,) while it is stopped: about twice that of libbarrett's joint
controllers [N m s/rad].
"""
PATIENCE = 5.0  # lockstep: wall-clock time after which a state counts as not answered [s]
# real time: a step that is later than this puts the clock of the plant back, instead of hurrying
# after it [s]
LATEST = 0.01
STATES = QoSProfile(depth=1000)  # reliable: 2 s
GRIPS = {"open": WamCommand.GRIP_OPEN, "close": WamCommand.GRIP_CLOSE}
"""What a person tells the hand with a button."""
# of the joint states: a driver may have more, in an order of its own
NAMES = [
    "bhand_spread",
    *reversed(published.JOINTS),
]


def nanoseconds(stamp):
    """A stamp as an integer."""
    return stamp.sec * 1_000_000_000 + stamp.nanosec


class Driver(Node):
    """Steps a plant: in lockstep with the commands that answer its states, or with the wall clock.

    Nothing runs by itself: `tick` makes one step of 2 ms and spins the executor meanwhile, in
    which other nodes may be, too.

    Joint states and poses are best effort in real time. In lockstep they are reliable, as poses of
    vrpn_mocap without `sensor_data_qos`: nobody waits for the recorder, and where the machine
    starves it, it would lose frames of a world that runs ahead.
    """

    def __init__(self, executor, plant, person, lockstep=True):
        super().__init__("foreign_wam_driver")
        executor.add_node(self)
        self._executor, self._lockstep = executor, lockstep
        self.plant, self.person = plant, person
        self.cameras = Cameras(plant.laboratory, plant.tracked)
        self._nominal = NominalArm(Laboratory.quiet())
        self._command, self._command_step = None, 0
        self.answered, self.unanswered, self.late = 0, 0, 0
        # steps between the state that the newest command answers and the one in which it acts
        self.lags = []
        self.stops, self._stopped = 0, True
        self.tells_button = (
            True  # say with every frame of the cameras that no button is pressed, too
        )
        self.openings = []  # stamps of commands that open the hand, and of its button [ns]
        sensors = STATES if lockstep else qos_profile_sensor_data
        self._state_publisher = self.create_publisher(JointState, "/joint_states", sensors)
        self._button_publisher = self.create_publisher(WamCommand, "/wam/teacher_wrench", STATES)
        self._pose_publishers = {
            body: self.create_publisher(PoseStamped, f"/vrpn_mocap/{body}/pose", sensors)
            for body in plant.tracked
        }
        self.create_subscription(WamCommand, "/wam/command", self._take, STATES)
        self._begin = time.time_ns()
        self._pace = 1.0
        self._wall_begin = time.monotonic()

    def _take(self, message):
        if message.header.frame_id != FRAME:
            self.get_logger().error(
                f"a command in frame {message.header.frame_id!r} is not carried out", once=True
            )
            return
        self._command, self._command_step = message, self.plant.steps
        self._tell_hand(message.grip, nanoseconds(message.header.stamp))

    def _tell_hand(self, grip, stamp_ns):
        if grip == WamCommand.GRIP_OPEN:
            self.openings.append(stamp_ns)
            self.plant.hand.open(self.plant.time)
        elif grip == WamCommand.GRIP_CLOSE:
            self.plant.hand.close(self.plant.time)

    def stamp(self, step):
        """The stamp of a step of the plant."""
        since = self._begin + round(step * PERIOD * 1e9)
        return Time(sec=since // 1_000_000_000, nanosec=since % 1_000_000_000)

    def _publish_state(self):
        message = JointState(name=NAMES)
        message.header.stamp = self.stamp(self.plant.steps)
        message.position = [0.0, *self.plant.encoders.angles[::-1].tolist()]
        message.velocity = [0.0, *self.plant.encoders.speeds[::-1].tolist()]
        message.effort = [0.0, *self.plant.torque[::-1].tolist()]
        self._state_publisher.publish(message)

    def _publish_pose(self, sighting):
        message = PoseStamped()
        message.header.stamp, message.header.frame_id = self.stamp(sighting.step), FRAME
        place, attitude = message.pose.position, message.pose.orientation
        place.x, place.y, place.z = sighting.place.tolist()
        attitude.x, attitude.y, attitude.z, attitude.w = sighting.attitude.tolist()
        self._pose_publishers[sighting.body].publish(message)

    def _publish_button(self, grip):
        message = WamCommand(joint_torque=[0.0] * 7, grip=grip)
        message.header.stamp, message.header.frame_id = self.stamp(self.plant.steps), FRAME
        self._button_publisher.publish(message)

    def _is_answered(self):
        return self._command is not None and nanoseconds(
            self._command.header.stamp
        ) >= nanoseconds(self.stamp(self.plant.steps))

    def _wait_for_answer(self):
        """Lockstep: spin until the command for this state has come, or patience ends."""
        patience = PATIENCE if self.count_subscribers("/joint_states") else 0.01
        until = time.monotonic() + patience
        while not self._is_answered() and time.monotonic() < until:
            self._executor.spin_once(timeout_sec=min(0.1, patience))
        if self._is_answered():
            self.answered += 1
        else:
            self.unanswered += 1

    def _wait_for_clock(self):
        """Real time: spin until the next step is due."""
        due = self._wall_begin + (self.plant.steps + 1) * PERIOD * self._pace
        if time.monotonic() > due + LATEST:
            self.late += 1
            self._wall_begin += time.monotonic() - due
            due = time.monotonic() + PERIOD * self._pace
        self._executor.spin_once(timeout_sec=0.0)
        while (left := due - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def slow_down(self, pace):
        """From now on a second of the plant takes `pace` seconds of the wall clock. Nobody waits
        for anybody all the same.
        """
        self._pace, self._wall_begin = pace, time.monotonic() - self.plant.steps * PERIOD * pace

    def _torque(self):
        """What the newest command asks for, on top of gravity compensation (7,) [N m]."""
        encoders = self.plant.encoders
        self._nominal.take(encoders.angles)
        stopped = (
            self._command is None or (self.plant.steps - self._command_step) * PERIOD > WATCHDOG
        )
        self.stops += stopped and not self._stopped
        self._stopped = stopped
        if self._command is not None:
            answered = round(
                (nanoseconds(self._command.header.stamp) - self._begin) * 1e-9 / PERIOD
            )
            self.lags.append(self.plant.steps - answered)
        if stopped:
            return self._nominal.gravity() - STOPPING * encoders.speeds
        force, moment = self._command.wrench.force, self._command.wrench.torque
        wrench = np.array([force.x, force.y, force.z, moment.x, moment.y, moment.z])
        return (
            self._nominal.gravity()
            + self._nominal.jacobian().T @ wrench
            + self._command.joint_torque
        )

    def tick(self):
        """One step: publish, wait, act."""
        self._publish_state()
        for sighting in self.cameras.look(self.plant):
            self._publish_pose(sighting)
        if self._lockstep:
            self._wait_for_answer()
        else:
            self._wait_for_clock()
        pushes, carried = self.person.act()
        if self.person.tells:
            grip = GRIPS[self.person.tells]
            self._publish_button(grip)
            self._tell_hand(grip, nanoseconds(self.stamp(self.plant.steps)))
        elif self.tells_button and self.plant.steps % FRAME_STEPS == 0:
            self._publish_button(WamCommand.GRIP_UNSPECIFIED)
        self.plant.step(self._torque(), pushes, carried)

    def run(self, duration):
        """Go on for so long [s]."""
        for _ in range(round(duration / PERIOD)):
            self.tick()

    def run_until(self, condition, limit):
        """Go on until it holds; the wall clock must not pass `limit` [s]."""
        until = time.monotonic() + limit
        while not condition():
            if time.monotonic() > until:
                raise TimeoutError(f"nothing came of it in {limit:.0f} s")
            self.tick()
