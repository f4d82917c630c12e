"""The demonstration recorder: everything goes into an MCAP bag as it comes; between ~/start and
~/stop a movement is cut out of it.

Messages are received and written as raw CDR. Only what cutting needs is decoded: poses, one joint
state per pose, the hand's button.
"""

import json
from datetime import datetime
from functools import partial
from pathlib import Path

from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import DemonstrationMark
from dart_skill_msgs.srv import Judge, Look, StopDemonstration
from rclpy.lifecycle import TransitionCallbackReturn
from std_srvs.srv import Trigger

from dart_skill.common.configuration import node_parameters
from dart_skill.recording import (
    DEMONSTRATION_TYPE,
    HAND,
    Demonstration,
    LogTime,
    Marks,
)
from dart_skill.skills.observation import watched_until
from dart_skill.skills.practice import Learner
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.bag_sink import BagKeeper, DemonstrationBag, free_folder
from dart_skill_nodes.comms.joint_states import OfTheArm
from dart_skill_nodes.comms.names import DEMONSTRATIONS, JOINT_STATES, MARKS, in_graph
from dart_skill_nodes.comms.observing import Observer
from dart_skill_nodes.comms.qos import LATCHED, WALL
from dart_skill_nodes.comms.raw_batches import TAKE, RawBatches, RawMessage
from dart_skill_nodes.comms.refusals import NOT_RECORDED
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, autostart, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, skill_of, values_of


class DemonstrationRecorder(BagKeeper):
    """A managed node: configuring opens the bag, cleaning up or shutting down closes it. It starts
    itself unless `autostart` is false.
    """

    def __init__(self):
        super().__init__("demonstration_recorder")
        self.p = declare(self, "demonstration_recorder")
        self._skill = skill_of(self)
        self._name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        self._bag, self.observer = None, None
        self._count, self._time, self._of_the_arm = 0, LogTime(), OfTheArm()
        self._marked, self._unwritten = Marks(), []
        self._demonstrations = self.create_publisher(DemonstrationMsg, DEMONSTRATIONS, LATCHED)
        self._marks = self.create_publisher(DemonstrationMark, MARKS, LATCHED)
        self.create_subscription(DemonstrationMark, MARKS, self._on_mark, LATCHED)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(StopDemonstration, "~/stop", self._on_stop)
        self.create_service(Judge, "~/judge", self._on_judge)
        self.create_service(Look, "~/look", self._on_look)
        self._diagnostics = Diagnostics(self, self._describe)
        if self.p["autostart"]:
            autostart(self)

    # life cycle

    def on_configure(self, state) -> TransitionCallbackReturn:
        self.p = values_of(self, self.p)
        if self.p["automatic"] and not self._skill.cuts_itself:
            raise ValueError(
                f"automatic is for throws at baskets: the skill '{self._skill.name}' needs ~/start"
                " and ~/stop"
            )
        self._skill.take_world(self.p)
        self._learner = Learner(
            self._skill, lambda: node_parameters("skill_learner.yaml", "skill_learner")
        )
        self.observer = observer = Observer(self, self._skill, self._name_of, self.p, self._take)
        named = self.p["bag"] or f"demonstrations_{datetime.now():%Y_%m_%d-%H_%M_%S}"
        notes = {"seed": str(self.p["seed"])}
        self._bag = DemonstrationBag(self, free_folder(Path(named)), notes)
        topics = [in_graph(self, topic) or topic for topic in self.p["topics"]]
        self._recorded = {*topics, *observer.role_of}
        self._messages, self._full = RawBatches(self), {}  # names in full, by how they are called
        for topic in dict.fromkeys([*topics, *sorted(observer.needed)]):
            self._subscribe(topic)
        self._timer = self.create_timer(TAKE, self._take, clock=WALL)
        return TransitionCallbackReturn.SUCCESS

    def _close(self) -> None:
        if self._bag is not None:
            self._take()
            self.destroy_timer(self._timer)
            self._messages.close()
            self._bag.close({"lost": json.dumps(self._messages.lost)})
            self._bag, self.observer.recording = None, False

    # recording

    def _subscribe(self, topic: str) -> None:
        if topic == DEMONSTRATIONS:
            # its own publication is written where it is made: a node does not hear itself reliably
            # in order
            self._bag.add_own(topic, DEMONSTRATION_TYPE, LATCHED)
            return
        self._full[topic] = self.resolve_topic_name(topic)
        if topic in self._recorded:
            self._messages.listen(topic, partial(self._bag.add_offered, topic))
        else:
            self._messages.listen(topic)

    def _take(self) -> None:
        if self._bag is None:
            return  # a last tick of the timer, when all is closed
        for message in self._messages.take():
            self._take_one(message, self._full[message.topic])
        if self._unwritten and self._time.now_ns and DEMONSTRATIONS in self._recorded:
            self._bag.mark(self._unwritten, self._time.now_ns)
            self._unwritten.clear()
        for throw in self.observer.found():
            if throw.shows:
                said = conversions.demonstration_msg(throw.demonstration)
                self._keep(throw.demonstration, said, watched_until(throw.stamp_ns))
            else:
                why = "it missed the basket" if throw.taught else "the arm threw by itself"
                self.get_logger().info(
                    f"the throw at {throw.stamp_ns} ns is no demonstration: {throw.reason or why}"
                )

    def _take_one(self, message: RawMessage, place: str) -> None:
        """place: full name of its topic."""
        topic, data = message.topic, message.data
        stamp_ns = self._bag.stamp_ns(topic, data)
        # else it is another's, as of a gripper
        usable = topic != JOINT_STATES or self._of_the_arm(data)
        if usable and stamp_ns is not None:
            usable = self.refusals.accepts(place, self._time.take, topic, stamp_ns)
        now_ns = self._time.now_ns
        ns = now_ns if stamp_ns is None else stamp_ns
        if topic in self._recorded:  # whatever it is
            self.refusals.accepts(place, self._bag.write, topic, now_ns, ns, data)
        if usable:
            self.refusals.accepts(place, self.observer.take, topic, ns, data)

    # services

    def _on_start(self, request, response):
        if self._bag is None:
            raise ValueError("no bag is open: configure this node first")
        if self._bag.failure:
            raise ValueError(f"{NOT_RECORDED}: {self._bag.failure}")
        self.observer.check_heard(self._messages.missing, self._of_the_arm.others)
        self._take()
        self.observer.begin()
        response.message = str(self._bag.writer.path)

    def _on_stop(self, request, response):
        if self._bag is None or not self.observer.recording:
            raise ValueError("no demonstration is being recorded: call ~/start first")
        self._take()
        try:
            one = self.observer.cut(conversions.stamp_ns(request.until), self._time.now_ns)
        except ValueError as error:
            self.get_logger().error(f"no demonstration: {error}")
            raise
        if one is None:
            response.pending = True
            response.message = f"{self.observer.come(self.observer.up_to_ns)}: call again"
            return response
        response.demonstration = conversions.demonstration_msg(one)
        self._bag.flush()
        if self._bag.failure:
            raise ValueError(f"{NOT_RECORDED}: {self._bag.failure}")
        if request.keep:
            up_to_ns = self.observer.up_to_ns
            why = self._keep(one, response.demonstration, up_to_ns)
            response.readable, response.message = not why, why or self._strain(one)

    def _on_judge(self, request, response):
        self._check_configured()
        self.observer.judge(request, response)
        response.success = not response.pending
        return response

    def _on_look(self, request, response):
        self._check_configured()
        self.observer.look(conversions.stamp_ns(request.until), response)
        response.success = not response.pending
        return response

    def _check_configured(self) -> None:
        if self._bag is None:
            raise ValueError("not configured: nothing is watched")
        self._take()

    def _keep(self, one: Demonstration, message: DemonstrationMsg, until_ns: int) -> str:
        """Publish a demonstration that was watched up to a stamp, and put it into the bag; why it
        cannot be learned from, if so.
        """
        self._count += 1
        self._demonstrations.publish(message)
        if DEMONSTRATIONS in self._recorded:
            self._bag.keep(one, self._time.now_ns, until_ns)
        self._bag.flush()
        try:
            self._learner.finding(one)
        except ValueError as error:
            self.get_logger().warning(f"kept, but it cannot be learned from: {error}")
            return f"kept, but it cannot be learned from: {error}; show it again"
        return ""

    def _strain(self, one: Demonstration) -> str:
        """What is to be said of a demonstration that came to a limit of the arm."""
        strain = self._learner.strain(one)
        return f"kept, but {strain}; better drop {one.id}, and show it again" if strain else ""

    def _on_mark(self, mark: DemonstrationMark) -> None:
        """A demonstration was dropped or restored: that goes into the bag, and a learner that is
        started again hears it from here.
        """
        if self._marked.take(mark):
            self._marks.publish(mark)
            self._unwritten.append(mark)

    def _describe(self):
        if self._bag is None:
            return WARN, "no bag is open", {}
        observer, values = self.observer, {"bag": self._bag.writer.path}
        values |= {"demonstrations": self._count, "rejected": observer.log.rejected}
        values |= {"lost": sum(self._messages.lost.values()), **self._bag.writer.counts}
        if fault := self._bag.failure or observer.fault or observer.cameras_gone:
            return ERROR, fault, values
        works = observer.recording or self.p["automatic"]
        return OK, "recording" if works else "waiting", values


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill demonstration_recorder`."""
    run(lambda: [DemonstrationRecorder()], args)


if __name__ == "__main__":
    main()
