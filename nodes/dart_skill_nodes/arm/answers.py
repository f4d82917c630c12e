"""What a simulated arm is told: the commands of the commander, and of a teacher while it guides the
arm, of the publishers that are obeyed.
"""

from collections.abc import Callable
from functools import partial

from dart_skill_msgs.msg import WamCommand
from rclpy.node import Node

from dart_skill.arm import Command, HeldCommand
from dart_skill.simulation import Plant
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.commands import ObeyedPublisher
from dart_skill_nodes.comms.fixed_layout import LayoutReader
from dart_skill_nodes.comms.names import COMMANDS, GUIDING
from dart_skill_nodes.comms.presence import Presence, publishers
from dart_skill_nodes.comms.qos import LOOP

TOPICS = {"commander": COMMANDS, "teacher": GUIDING}
"""Topics of those who move the arm."""


class Answers:
    """The newest commands of commander and teacher.

    * parameters: of the node, in force: lockstep, frame_id, command_timeout.
    * came: called with the sender of a command that has been taken.
    * complain: called with what is wrong.

    Attribute: guided, whether a teacher takes part.
    """

    def __init__(
        self,
        node: Node,
        plant: Plant,
        parameters: dict,
        came: Callable[[str], None],
        complain: Callable[[str], None],
    ):
        self._node, self._plant, self._p = node, plant, parameters
        self._came, self._complain = came, complain
        self._obeyed = {who: ObeyedPublisher(node, topic) for who, topic in TOPICS.items()}
        self._guide: Presence | None = None  # those who guide the arm
        self.begin(guided=False)
        for who, topic in TOPICS.items():
            take = partial(self._take, who, LayoutReader(WamCommand))
            node.create_subscription(WamCommand, topic, take, LOOP, raw=True)

    def begin(self, guided: bool) -> None:
        """Hold no command: the world is set anew. A publisher that has gone may be replaced."""
        self.guided = guided
        self._answers: dict[str, Command] = {}
        self._held = {who: HeldCommand(self._p["command_timeout"]) for who in TOPICS}
        for one in self._obeyed.values():
            one.forget()
        self._guide = publishers(self._node, GUIDING) if guided else None

    @property
    def engaged(self) -> tuple[str, ...]:
        """Those who must answer each state."""
        return ("commander", "teacher") if self.guided else ("commander",)

    @property
    def silent(self) -> list[str]:
        """Those who have not answered the present state, where the world waits for them."""
        return [who for who in self.engaged if who not in self._answers]

    def _take(self, who: str, reader: LayoutReader, data: bytes) -> None:
        message, ns, numbers = reader.read(data)
        waits, now_ns = self._p["lockstep"], self._plant.state_stamp_ns
        if waits and (ns != now_ns or who not in self.silent):
            return
        if not self._obeyed[who].accepts(message.sender):
            return
        if ns > now_ns:
            raise ValueError(f"it is stamped {ns} ns, ahead of the arm, which is at {now_ns} ns")
        if message.header.frame_id != self._p["frame_id"]:
            self._complain(
                f"a command of the {who} is in frame '{message.header.frame_id}', not"
                f" '{self._p['frame_id']}': ignored"
            )
            return
        try:
            command = conversions.command_of_numbers(message, ns, numbers)
        except ValueError as error:
            self._complain(f"a command of the {who} is ignored: {error}")
            return
        if waits:
            self._answers[who] = command
        else:
            self._held[who].take(command)
        self._came(who)

    def take(self) -> tuple[Command, Command | None]:
        """Command and push as answers to the present state, once nobody is silent."""
        answers = self._answers
        self._answers = {}
        return answers["commander"], answers.get("teacher")

    def awaits_teacher(self) -> bool:
        """Whether a teacher that has sent commands has not answered the present state yet."""
        held = self._held["teacher"]
        return self.guided and held.has_come and not held.is_for(self._plant.state_stamp_ns)

    def newest(self) -> tuple[Command, Command | None, bool]:
        """Command and push as answers to the present state of a world that does not wait, and
        whether they are fresh; the command brakes the arm when one of them is too old.
        """
        ns = self._plant.state_stamp_ns
        answers = {who: self._held[who].answer_to(ns) for who in self.engaged}
        late = [who for who in self.engaged if answers[who] is None and self._held[who].has_come]
        if late:
            self._complain(
                f"no command of the {late[0]} for more than {self._p['command_timeout']} s: the"
                " arm is braked"
            )
        command = answers["commander"]
        if command is None or "teacher" in late:
            return self._plant.braking(), answers.get("teacher"), False
        return command, answers.get("teacher"), True

    def look(self) -> str:
        """See who commands the arm. What to say when those who guided it have just gone: they are
        not waited for any more.
        """
        for one in self._obeyed.values():
            one.look()
        if self._guide is None or not self._guide.gone:
            return ""
        gone = self._guide
        self.guided = False
        self._guide = None
        return f"{gone} has gone: guiding ends, the arm is braked"

    @property
    def strangers(self) -> list[str]:
        """What to say of those who command the arm, too, and are not obeyed."""
        return [
            f"{name} publishes {self._node.resolve_topic_name(TOPICS[who])}, too"
            for who, one in self._obeyed.items()
            for name in one.others
        ]
