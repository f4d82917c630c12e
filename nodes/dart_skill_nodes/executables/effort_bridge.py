"""The effort bridge: WamCommand to the effort controller of an arm under ros2_control, with the
watchdog of a driver.

A Float64MultiArray answers every command, and every state while there are none. What is wrong with
commands or states damps the joints until `~/reset`.
"""

import time

from dart_skill_msgs.msg import WamCommand
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray
from std_srvs.srv import Trigger

from dart_skill.arm import BridgePhase, BridgeSettings, EffortBridge
from dart_skill.common.world import joint_names
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import hear_joint_states
from dart_skill_nodes.comms.names import COMMANDS
from dart_skill_nodes.comms.qos import LOOP, NEWEST, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, run
from dart_skill_nodes.process.parameters import declare

WATCH = 0.01
"""Silence is looked for so often [s, wall clock]."""
EFFORTS = QoSProfile(depth=1)
"""As effort controllers subscribe: reliable; only the newest counts."""


class EffortBridgeNode(GuardedNode):
    """Efforts for the controller, the opening of the hand on ~/hand_open, and the service ~/reset."""

    def __init__(self):
        super().__init__("effort_bridge")
        self.p = declare(self, "effort_bridge")
        self._order = conversions.order_of(
            joint_names(), self.p["controller_joints"], "controller_joints"
        )
        self._bridge = EffortBridge(BridgeSettings.from_parameters(self.p))
        self._told, self._message = self._bridge.phase, Float64MultiArray()
        self._efforts = self.create_publisher(Float64MultiArray, self.p["command_topic"], EFFORTS)
        self._hand = self.create_publisher(Bool, "~/hand_open", NEWEST)
        self._commands = self.create_subscription(WamCommand, COMMANDS, self._on_command, LOOP)
        self._states = hear_joint_states(self, self._on_state)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_timer(WATCH, self._watch, clock=WALL)

    def _on_command(self, message: WamCommand) -> None:
        try:
            command = conversions.command(message)
        except ValueError as error:
            self._bridge.stop(f"a command says what nobody knows: {error}")
        else:
            opens = self._bridge.on_command(command, message.header.frame_id, time.monotonic())
            if opens is not None:
                self._hand.publish(Bool(data=opens))
        if self._bridge.phase is BridgePhase.ACTIVE:
            self._publish(self._bridge.efforts())
        self._tell()

    def _on_state(self, message: JointState) -> None:
        try:
            state = conversions.arm_state(message)
        except ValueError as error:
            self._bridge.stop(str(error))
            self._tell()
            return
        efforts = self._bridge.on_state(state, time.monotonic())
        if self._bridge.phase is not BridgePhase.ACTIVE:
            self._publish(efforts)  # else the command for this state is on its way

    def _watch(self) -> None:
        self._bridge.on_publishers(self._commands.get_publisher_count())
        efforts = self._bridge.tick(time.monotonic())
        if efforts is not None:
            self._publish(efforts)
        self._tell()

    def _publish(self, efforts) -> None:
        self._message.data = efforts[self._order].tolist()
        self._efforts.publish(self._message)

    def _on_reset(self, request, response):
        response.message = self._bridge.reset(time.monotonic())
        response.success = not response.message
        self._tell()
        return response

    def _tell(self) -> None:
        """What changes in the log and on /diagnostics, at once."""
        if self._bridge.phase is self._told:
            return
        self._told = self._bridge.phase
        if self._told is BridgePhase.STOPPED:
            self.get_logger().error(f"the arm is damped until ~/reset: {self._bridge.message}")
        self._diagnostics.publish()

    def _describe(self):
        bridge = self._bridge
        level = {BridgePhase.ACTIVE: OK, BridgePhase.WAITING: WARN, BridgePhase.STOPPED: ERROR}[
            bridge.phase
        ]
        text = f"{bridge.phase.value}: {bridge.message}" if bridge.message else bridge.phase.value
        return (
            level,
            text,
            {
                "phase": bridge.phase.value,
                "clipped": bridge.clipped,
                "publishers": self._commands.get_publisher_count(),
            },
        )


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill effort_bridge`."""
    run(lambda: [EffortBridgeNode()], args)


if __name__ == "__main__":
    main()
