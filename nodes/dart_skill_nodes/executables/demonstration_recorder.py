"""The demonstration recorder: everything goes into an MCAP bag as it comes; between ~/start and
~/stop a movement is cut out of it.

Messages are received and written as raw CDR. Only what cutting needs is decoded: poses, one joint
state per pose, the hand's button.
"""

import json
import time
from collections import Counter
from datetime import datetime
from functools import partial
from pathlib import Path

from dart_skill_msgs.msg import Demonstration as DemonstrationMsg
from dart_skill_msgs.msg import DemonstrationMark
from dart_skill_msgs.srv import Judge, Look, StopDemonstration
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from dart_skill.arm import ArmState
from dart_skill.common.configuration import node_parameters
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import (
    DEMONSTRATION_TYPE,
    HAND,
    MARK_TYPE,
    Demonstration,
    LogTime,
    Marks,
    demonstration_message,
    encoded,
    types_for,
)
from dart_skill.skills.observation import ThrowFinder, watched_until
from dart_skill.skills.practice import Learner
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.bag_sink import BagKeeper, BagSink
from dart_skill_nodes.comms.joint_states import OfTheArm, StateReader
from dart_skill_nodes.comms.names import (
    COMMANDS,
    DEMONSTRATIONS,
    GUIDING,
    JOINT_STATES,
    MARKS,
    in_graph,
    pose_topic,
)
from dart_skill_nodes.comms.observing import Observer
from dart_skill_nodes.comms.presence import Cameras
from dart_skill_nodes.comms.qos import LATCHED, WALL
from dart_skill_nodes.comms.raw_batches import TAKE, RawBatches, RawMessage
from dart_skill_nodes.comms.refusals import NOT_RECORDED
from dart_skill_nodes.comms.tracked_bodies import FRAME_NS, Arrivals, TrackedBodies
from dart_skill_nodes.process.node_base import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Parameter,
    autostart,
    declare,
    declare_bodies,
    run,
    skill_of,
)

TABLE = [
    Parameter("frame_id", "frame of the poses"),
    Parameter("bag", "folder of the bag; empty: demonstrations_<date> in the working directory"),
    Parameter("seed", "of the run, written into the bag", 0, 2**31 - 1),
    Parameter("topics", "what is recorded"),
    Parameter("skill", "of which demonstrations are cut"),
    Parameter("start_threshold", "speed at which a motion begins [m/s]", 0.01, 5.0),
    Parameter("stop_threshold", "speed at which a motion ends [m/s]", 0.01, 5.0),
    Parameter("min_duration", "shorter motions are ignored [s]", 0.0, 10.0),
    Parameter("max_pause", "a shorter rest does not end a motion [s]", 0.0, 10.0),
    Parameter("run_up", "kept before the motion [s]", 0.0, 5.0),
    Parameter("settle", "kept after the motion [s]", 0.0, 5.0),
    Parameter("speed_window", "over which the speed is estimated [s]", 0.02, 1.0),
    Parameter("basket_radius", "free opening of the basket at its rim [m]", 0.05, 1.0),
    Parameter(
        "automatic", "cut every guided throw into the basket by itself, without ~/start and ~/stop"
    ),
]
STREAM = 25
"""Messages since ~/start that make a topic a stream, which is waited for."""


class DemonstrationRecorder(BagKeeper):
    """A managed node: configuring opens the bag, cleaning up or shutting down closes it. It starts
    itself unless `autostart` is false.
    """

    def __init__(self):
        super().__init__("demonstration_recorder")
        self.p = declare(self, "demonstration_recorder.yaml", TABLE)
        self._skill = skill_of(self)
        self._name_of = declare_bodies(self, (HAND, *self._skill.bodies))
        self.declare_parameter("autostart", True)
        self._bag, self._recording = None, False
        self._count, self._time, self._up_to = 0, LogTime(), 0
        self._reader, self._of_the_arm = StateReader(), OfTheArm()
        # what is wrong with the arm's states, and the newest of them, serialised
        self._fault, self._joints = (
            "",
            b"",
        )
        self._marked = Marks()
        self._unwritten: list[DemonstrationMark] = []
        self._newest: dict[str, int] = {}
        self._heard: Counter[str] = Counter()
        self._demonstrations = self.create_publisher(DemonstrationMsg, DEMONSTRATIONS, LATCHED)
        self._marks = self.create_publisher(DemonstrationMark, MARKS, LATCHED)
        self.create_subscription(DemonstrationMark, MARKS, self._on_mark, LATCHED)
        self.create_service(Trigger, "~/start", self._on_start)
        self.create_service(StopDemonstration, "~/stop", self._on_stop)
        self.create_service(Judge, "~/judge", self._on_judge)
        self.create_service(Look, "~/look", self._on_look)
        self._diagnostics = Diagnostics(self, self._describe)
        if self.get_parameter("autostart").value:
            autostart(self)

    # life cycle

    def on_configure(self, state) -> TransitionCallbackReturn:
        self._thresholds = VelocityThreshold(
            start=self.p["start_threshold"], stop=self.p["stop_threshold"], window=self.p["speed_window"],
            **{name: self.p[name] for name in ("min_duration", "max_pause", "run_up", "settle")},
        )  # fmt: skip
        self._observer = self._make_observer()
        path = Path(self.p["bag"] or f"demonstrations_{datetime.now():%Y_%m_%d-%H_%M_%S}")
        self._bag = BagSink(self, path, {"seed": str(self.p["seed"])})
        self._tracked = TrackedBodies(
            self.p["frame_id"], self.get_logger().error, log=self._observer.log
        )
        self._role_of = {pose_topic(self._name_of[role]): role for role in self._observer.roles}
        self._cameras = [Cameras(self, topic) for topic in sorted(self._role_of)]
        self._topics = [in_graph(self, topic) or topic for topic in self.p["topics"]]
        self._recorded = {*self._topics, *self._role_of}
        self._needed = {JOINT_STATES, COMMANDS, GUIDING, *self._role_of}
        self._silent = {
            JOINT_STATES,
            COMMANDS,
            *(t for t, role in self._role_of.items() if role == "hand"),
        }
        self._finder, self._arrivals, self._has_marks = None, Arrivals(), False
        if self.p["automatic"]:
            self._finder = ThrowFinder(self._observer.log, self._thresholds)
        # the latter: names in full, by how the node calls them
        self._messages, self._full = (
            RawBatches(self),
            {},
        )
        for topic in [*self._topics, *sorted((self._needed | self._recorded) - set(self._topics))]:
            self._subscribe(topic)
        self._timer = self.create_timer(TAKE, self._take, clock=WALL)
        return TransitionCallbackReturn.SUCCESS

    def _make_observer(self) -> Observer:
        if self.p["automatic"] and not self._skill.cuts_itself:
            raise ValueError(
                f"automatic is for throws at baskets: the skill '{self._skill.name}' needs ~/start"
                " and ~/stop"
            )
        self._skill.take_world(self.p)
        learner = Learner(
            self._skill, lambda: node_parameters("skill_learner.yaml", "skill_learner")
        )
        return Observer(self._skill, learner, self._thresholds, self.p["frame_id"])

    def _close(self) -> None:
        if self._bag is not None:
            self._take()
            self.destroy_timer(self._timer)
            self._messages.close()
            self._bag.close({"lost": json.dumps(self._messages.lost)})
            self._bag, self._recording = None, False

    # recording

    def _subscribe(self, topic: str) -> None:
        if topic == DEMONSTRATIONS:
            self._bag.add_own(topic, DEMONSTRATION_TYPE, LATCHED)
            # its own publication is written where it is made: a node does not hear itself reliably
            # in order
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
            stamp_ns = self._bag.stamp_ns(message.topic, message.data)
            # else it is another's, as of a gripper
            usable = message.topic != JOINT_STATES or self._of_the_arm(message.data)
            usable = usable and (
                stamp_ns is None
                or self.refusals.accepts(
                    self._full[message.topic], self._time.take, message.topic, stamp_ns
                )
            )
            ns = self._time.now_ns if stamp_ns is None else stamp_ns
            if message.topic in self._recorded:  # whatever it is
                self.refusals.accepts(
                    self._full[message.topic],
                    self._bag.write,
                    message.topic,
                    self._time.now_ns,
                    ns,
                    message.data,
                )
            if usable and self.refusals.accepts(
                self._full[message.topic], self._look, message, ns
            ):
                self._newest[message.topic] = ns
                self._heard[message.topic] += 1
                self._silent.discard(message.topic)
        self._write_marks()
        if self._finder:
            self._find()
        elif not self._recording:
            self._tracked.forget_old()

    def _look(self, message: RawMessage, ns: int) -> None:
        if role := self._role_of.get(message.topic):
            self._tracked.take(role, message.data)
        elif message.topic == JOINT_STATES:
            self._joints = message.data
            if (self._recording or self._finder) and self._tracked.log.wants_joints(ns):
                self._look_at_joints(ns)
        elif message.topic in (COMMANDS, GUIDING):
            self._look_at_grip(message.topic, ns, message.data)

    def _look_at_joints(self, ns: int) -> None:
        if (state := self._arm_state()) is not None:
            self._tracked.log.add_joints(ns, state.position, state.velocity)

    def _arm_state(self) -> ArmState | None:
        """The newest state of the arm; None if it is not one, and what is wrong with it is kept."""
        try:
            state = self._reader.read(self._joints)
            self._fault = ""
            return state
        except ValueError as error:
            if str(error) != self._fault:
                self.get_logger().error(str(error))
            self._fault = str(error)
            return None

    def _look_at_grip(self, topic: str, ns: int, data: bytes) -> None:
        if self._finder:
            self._finder.add_command(data, guiding=topic == GUIDING)
        else:
            self._observer.hear_command(ns, data)

    def _find(self) -> None:
        sensors = [self._newest.get(topic, 0) for topic in (JOINT_STATES, *self._role_of)]
        for throw in self._finder.until(self._arrivals.until(sensors, time.monotonic())):
            if throw.shows:
                self._keep(
                    throw.demonstration,
                    conversions.demonstration_msg(throw.demonstration),
                    watched_until(throw.stamp_ns),
                )
            else:
                why = throw.reason or (
                    "it missed the basket" if throw.taught else "the arm threw by itself"
                )
                self.get_logger().info(
                    f"the throw at {throw.stamp_ns} ns is no demonstration: {why}"
                )

    # services

    def _on_start(self, request, response):
        if self._bag is None:
            response.success, response.message = False, "no bag is open: configure this node first"
            return response
        if self._bag.failure:
            response.success, response.message = False, f"{NOT_RECORDED}: {self._bag.failure}"
            return response
        if self._finder:
            response.success, response.message = (
                False,
                "throws are cut automatically here: ~/start needs 'automatic' to be false",
            )
            return response
        if self._cameras_gone:
            response.success, response.message = False, self._cameras_gone
            return response
        if silent := ", ".join(
            sorted(
                map(
                    self.resolve_topic_name,
                    self._silent | (set(self._role_of) & set(self._messages.missing)),
                )
            )
        ):
            others = self._of_the_arm.others if JOINT_STATES in self._silent else ""
            response.success, response.message = (
                False,
                f"nothing has come on {silent} yet: is the node running that publishes it?",
            )
            response.message += (
                f" {self.resolve_topic_name(JOINT_STATES)} {others}" if others else ""
            )
            return response
        self._take()
        state = self._arm_state()
        if fault := self._tracked.hidden("hand") or ("" if state is not None else self._fault):
            response.success, response.message = False, fault
            return response
        self._tracked.clear()
        # of this world, in case it is set anew at once
        self._tracked.log.add_joints(state.stamp_ns, state.position, state.velocity)
        self._newest.clear()
        self._heard.clear()
        self._recording, self._up_to = True, 0
        response.success, response.message = True, str(self._bag.writer.path)
        return response

    def _on_stop(self, request, response):
        if not self._recording:
            response.success, response.message = (
                False,
                "no demonstration is being recorded: call ~/start first",
            )
            return response
        self._take()
        until = conversions.stamp_ns(request.until)
        # who gives no stamp asks for what there is, and again for the same
        self._up_to = until or self._up_to or self._time.now_ns
        if not self._cameras_gone and (
            (until and self._streams_lag(until)) or any(map(self._body_lags, self._skill.awaited))
        ):
            response.pending, response.message = (
                True,
                f"{self._come} only, not {self._up_to} ns: call again",
            )
            return response
        return self._cut(request, response)

    def _streams_lag(self, until: int) -> bool:
        """Whether messages up to a stamp are still on their way: a stream that was heard since
        ~/start may lag behind the others. A button that was pressed is no stream.
        """
        streams = (
            topic
            for topic, heard in self._heard.items()
            if heard >= STREAM and topic in self._needed
        )
        steps = (self._newest[topic] for topic in streams if topic not in self._role_of)
        return min(steps, default=0) < until or not self._tracked.has_frames_until(until)

    @property
    def _cameras_gone(self) -> str:
        """What to say when poses have come, and nothing publishes any more; empty else."""
        gone = [one.missing for one in self._cameras]
        return gone[0] if self._tracked.newest_ns and all(gone) else ""

    def _body_lags(self, role: str) -> bool:
        return self._tracked.is_late(role, self._up_to)

    @property
    def _come(self) -> str:
        """In words, up to when poses have come, for a client that waits for more."""
        role, behind_ns = self._tracked.farthest_behind
        return (
            f"poses have come up to {self._tracked.newest_ns} ns, of the {role or 'hand'} up to"
            f" {behind_ns} ns"
        )

    def _on_judge(self, request, response):
        if self._bag is None:
            response.message = "not configured: nothing is watched"
            return response
        until = conversions.stamp_ns(request.until)
        self._take()
        try:
            come = self._tracked.has_frames_until(until) and not self._observer.late(
                self._tracked, request, until
            )
            if not come and not self._cameras_gone:
                response.pending, response.message = True, f"{self._come} only, not {until} ns"
                return response
            self._take()  # what was sent before the newest pose
            response.outcome = self._observer.judge(self._tracked, request, until)
        except ValueError as error:
            response.message = str(error)
            return response
        response.success = True
        return response

    def _on_look(self, request, response):
        if self._bag is None:
            response.message = "not configured: nothing is watched"
            return response
        self._take()
        until = conversions.stamp_ns(request.until) or self._tracked.newest_ns
        late = not self._tracked.has_frames_until(until - FRAME_NS) or any(
            map(partial(self._tracked.is_late, ns=until), self._observer.roles)
        )
        if late and not self._cameras_gone:
            response.pending, response.message = True, f"{self._come} only, not {until} ns"
            return response
        try:
            response.situation, response.stamp = (
                self._observer.look(until),
                conversions.time_msg(until),
            )
            response.success = True
        except ValueError as error:
            response.message = self._cameras_gone or str(error)
        return response

    def _cut(self, request, response):
        try:
            one = self._observer.cut(self._up_to)
            response.pending = (
                self._observer.lags(self._tracked, one, self._up_to) and not self._cameras_gone
            )
        except ValueError as error:
            response.pending = self._body_lags(self._skill.moves) and not self._cameras_gone
            response.message = (
                f"not seen: {self._cameras_gone}; {error}" if self._cameras_gone else str(error)
            )
        if response.pending:
            response.message = f"{self._come} only, not {self._up_to} ns: call again"
            return response
        self._recording, response.success = False, not response.message
        if not response.success:
            self.get_logger().error(f"no demonstration: {response.message}")
            return response
        response.demonstration = conversions.demonstration_msg(one)
        self._bag.flush()
        if self._bag.failure:
            response.success, response.message = False, f"{NOT_RECORDED}: {self._bag.failure}"
        elif request.keep:
            response.message = self._keep(one, response.demonstration, self._up_to)
            response.readable = not response.message
        return response

    def _keep(self, one: Demonstration, message: DemonstrationMsg, until: int) -> str:
        """Publish a demonstration that was watched up to a stamp, and put it into the bag; why it
        cannot be learned from, if so.
        """
        self._count += 1
        self._demonstrations.publish(message)
        if DEMONSTRATIONS in self._topics:
            # Not by serialize_message: Fast DDS's size estimate leaves stray bytes behind empty
            # sequences.
            types = types_for(DEMONSTRATION_TYPE)
            content = encoded(types, DEMONSTRATION_TYPE, demonstration_message(types, one))
            self._bag.write(DEMONSTRATIONS, self._time.now_ns, until, content)
        self._bag.flush()
        try:
            self._observer.check(one)
        except ValueError as error:
            self.get_logger().warning(f"kept, but it cannot be learned from: {error}")
            return f"kept, but it cannot be learned from: {error}; show it again"
        return ""

    def _on_mark(self, mark: DemonstrationMark) -> None:
        """A demonstration was dropped or restored: that goes into the bag, and a learner that is
        started again hears it from here.
        """
        if self._marked.take(mark):
            self._marks.publish(mark)
            self._unwritten.append(mark)

    def _write_marks(self) -> None:
        """Into the bag, as soon as its time has begun."""
        if not (self._unwritten and self._time.now_ns and DEMONSTRATIONS in self._topics):
            return
        if not self._has_marks:
            self._bag.add_own(MARKS, MARK_TYPE, LATCHED)
        self._has_marks = True
        for mark in self._unwritten:
            self._bag.write(MARKS, self._time.now_ns, self._time.now_ns, serialize_message(mark))
        self._unwritten.clear()
        self._bag.flush()

    def _describe(self):
        if self._bag is None:
            return WARN, "no bag is open", {}
        values = {
            "bag": self._bag.writer.path,
            "demonstrations": self._count,
            "rejected": self._tracked.log.rejected,
        }
        values["lost"] = sum(self._messages.lost.values())
        values |= self._bag.writer.counts
        if self._bag.failure:
            return ERROR, self._bag.failure, values
        if fault := self._fault or self._cameras_gone:
            return ERROR, fault, values
        return OK, "recording" if self._recording or self._finder else "waiting", values


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill demonstration_recorder`."""
    run(lambda: [DemonstrationRecorder()], args)


if __name__ == "__main__":
    main()
