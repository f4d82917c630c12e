"""Whether those are there without whom the arm must not move, by the clock of the wall and by what
DDS says of them.
"""

from rclpy.node import Node

from dart_skill.arm import ArmState
from dart_skill_nodes.comms.joint_states import JointStates, Rivals, TimeOfTheArm
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES, full_name
from dart_skill_nodes.comms.presence import Cameras, Presence, others, publishers

QUIET = 0.5
"""No state for so long: time stands still, or none are published [s, wall clock]."""
SIMULATED = "simulation/state"
"""Only a simulator publishes it."""


NOT_FOR_AN_ARM = (
    "tracking is 'hand', which makes an arm with motors and cables oscillate, and no simulator"
    " runs: start the commander with tracking:=joints and friction_compensation:=1.0, as the"
    " layout hardware does"
)
"""What is said of a commander that starts with the parameters of a simulated arm beside a real one."""


class ArmWatch:
    """The arm's driver, its cameras, and who else commands it. Call `look` every LOOK.

    * states: the subscription of the arm's states.
    * camera_topic: of the poses without which it is not seen what the arm does.

    Attributes:

    * time: of the arm.
    * rivals: why it is not known which arm's states come; empty if it is.
    * strangers: names of the nodes that command the arm, too.
    * unseen: why a trial would not be seen; empty if the cameras are there.
    """

    def __init__(self, node: Node, states: JointStates, camera_topic: str):
        self._node, self._states, self._cameras = node, states, Cameras(node, camera_topic)
        self.states_name = full_name(node, JOINT_STATES)
        self.time = TimeOfTheArm(node)
        self.rivals = self.unseen = ""
        self.strangers: list[str] = []
        self._leaps: Rivals | None = None  # where several publish states
        self._driver: Presence | None = None
        self._guide: Presence | None = None  # of an arm that was released to a simulated person

    def look(self) -> None:
        """See who is there now."""
        self.time.look()
        self.look_for_rivals()
        self.unseen = self._cameras.missing
        self.strangers = others(self._node, COMMANDS)

    def look_for_rivals(self) -> None:
        """Two who publish states of the arm are two arms, of which none may be commanded: it
        is not known whose state a command answers. A publisher of states of other joints, as of a
        gripper, is no rival, unless the arm's leap to and fro.
        """
        drivers = others(self._node, JOINT_STATES)
        self._leaps = (self._leaps or Rivals()) if len(drivers) > 1 else None
        leap = self._leaps is not None and self._leaps.are_there
        self.rivals = ""
        if leap or len(drivers) - self._states.of_the_arm.voices > 1:
            self.rivals = (
                f"{' and '.join(drivers)} publish {self.states_name}: end one of them, nothing is"
                " commanded until then"
            )

    def leaps(self, state: ArmState) -> bool:
        """Whether the states of several publishers leap to and fro. state: the next one."""
        return self._leaps is not None and self._leaps.see(state)

    @property
    def is_simulated(self) -> bool:
        """Whether a simulator is there."""
        return bool(self._node.count_publishers(SIMULATED))

    def states_ended(self, moves: bool, patience: float) -> str:
        """Why no states come any more; empty while they may. A simulator that is there may hold
        time as long as it likes.

        * moves: whether the arm moves. patience: for the states of a real arm that moves [s].
        """
        if self._driver is None:
            self._driver = publishers(self._node, JOINT_STATES)
        silence = self.time.silence
        reason = ""
        if self._driver.gone and silence > QUIET:
            reason = f"{self._driver} has gone: no {self.states_name} any more"
        elif moves and silence > patience and not self.is_simulated:
            reason = f"no {self.states_name} for {silence:.1f} s: is the arm's driver running?"
        if reason:
            self._driver = None
        return reason

    def release(self, free: bool) -> None:
        """The arm was released, or is held again: from now on a simulated person may guide it."""
        self._guide = publishers(self._node, GUIDING) if free and self.is_simulated else None

    @property
    def guide_gone(self) -> str:
        """What to say if the person has gone who guided the arm; empty otherwise."""
        if self._guide is None or not self._guide.gone:
            return ""
        return f"{self._guide} has gone while it guided the arm: the arm is braked and held"

    def missing(self, outcome: str, fault: str) -> str:
        """What speaks against a trial; empty if nothing. outcome: that would not be seen; fault: why
        the arm's own safety module has stopped it.
        """
        if self.rivals:
            return self.rivals
        if self.strangers:
            return (
                f"{', '.join(self.strangers)} publishes /wam/command, too: end it, one commands"
                " an arm"
            )
        if fault:
            return (
                f"the arm's safety module has stopped it ({fault}): look at the arm, and reset it"
            )
        return f"{self.unseen}; nobody would see {outcome}" if self.unseen else ""
