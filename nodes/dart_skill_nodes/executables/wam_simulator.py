"""The WAM simulator: publishes the state of step k, waits for the answer to it, integrates to step
k + 1.

Lockstep (the default): the commander always, and the teacher while it guides, answer every state
with a WamCommand that echoes its stamp. Nothing else moves time. A state that nobody answers is
published again, and /diagnostics says who is silent. Real time: steps follow the machine's clock,
the last command is held, and without a fresh one the arm is braked. A simulated person is a part
of the world, which waits for their hands.
"""

import time
from functools import partial

import numpy as np
from dart_skill_msgs.msg import BodyState, SimulationState, WamCommand
from dart_skill_msgs.srv import PlaceBody, Reset, Step
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rosgraph_msgs.msg import Clock as ClockMsg
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import (
    REST_SPEED,
    Command,
    HeldCommand,
    fixed_transforms,
    joint_transforms,
    wam_description,
    write_urdf,
)
from dart_skill.simulation import Board, PlantSettings, Stillness, make_world
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.arm_time import HELD
from dart_skill_nodes.comms.commands import ObeyedPublisher
from dart_skill_nodes.comms.fixed_layout import FixedLayout, LayoutReader
from dart_skill_nodes.comms.in_process import call_soon
from dart_skill_nodes.comms.names import CLOCK, COMMANDS, DESCRIPTION, GUIDING, JOINT_STATES
from dart_skill_nodes.comms.presence import LOOK, Presence, publishers
from dart_skill_nodes.comms.qos import CLOCK_QOS, COMPLETE, FRAMES, LOOP, NEWEST, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.tf_messages import LiveTransforms
from dart_skill_nodes.process.node_base import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Parameter,
    declare,
    run,
)
from dart_skill_nodes.process.parameters import LIMITS

TABLE = [
    Parameter("skill", "in whose world the arm stands"),
    Parameter("seed", "everything random comes from it", 0, 2**31 - 1),
    Parameter("lockstep", "wait for the answer to every state; false: real time"),
    Parameter(
        "speed_factor",
        "simulated seconds per second at most; 0: no limit, and in real time 1",
        0.0,
        1000.0,
        read_only=False,
    ),
    Parameter(
        "rest_after",
        "lockstep: when nothing has moved for so long the world goes on slowly; 0: never [s]",
        0.0,
        1e6,
        read_only=False,
    ),
    Parameter("start_paused", "wait for ~/pause before the first step"),
    Parameter("answer_timeout", "say so when an answer takes longer [s, wall clock]", 0.1, 600.0),
    Parameter(
        "command_timeout",
        "real time: age of a command after which the arm is braked [s]",
        0.002,
        10.0,
    ),
    Parameter("frame_id", "frame of everything that is published"),
    Parameter("start_posture", "joint angles after a reset [rad]"),
    Parameter(
        "gravity_error", "share of gravity that compensation misses", -0.5, 0.5, read_only=False
    ),
    Parameter("friction_scale", "factor on the joint friction", 0.0, 10.0, read_only=False),
    Parameter(
        "stiction",
        "what static friction is more than Coulomb friction, as a share of it",
        0.0,
        5.0,
        read_only=False,
    ),
    Parameter("mass_scale", "factors on the masses of the links", read_only=False),
    Parameter(
        "joint_stiffness",
        "of the cables between motors and links [N m/rad]; all 0: rigid",
        read_only=False,
    ),
    Parameter("joint_offset", "what the encoders read too high [rad]", read_only=False),
    Parameter("encoder_step", "of an angle [rad], 0: none", 0.0, 0.1, read_only=False),
    Parameter(
        "speed_filter",
        "corner of the low-pass on the speeds [rad/s], 0: exact speeds",
        0.0,
        10000.0,
        read_only=False,
    ),
    Parameter("command_delay", "control periods until a command acts", 0, 20, read_only=False),
    Parameter("motor_scale", "factor on what the motors can do", 0.1, 10.0, read_only=False),
    Parameter(
        "base_turn",
        "of the arm's base about the vertical; the controller does not know of it [rad]",
        -1.0,
        1.0,
        read_only=False,
    ),
    Parameter(
        "hand_delay",
        "mean time from the command to the ball being free [s]",
        0.0,
        1.0,
        read_only=False,
    ),
    Parameter("hand_spread", "standard deviation of that time [s]", 0.0, 0.1, read_only=False),
    Parameter(
        "seat_spread",
        "standard deviation of a coordinate of where the ball sits in the hand [m]",
        0.0,
        0.03,
        read_only=False,
    ),
    Parameter(
        "release_turn",
        "scatter of the direction with which the ball leaves the hand [rad]",
        0.0,
        0.5,
        read_only=False,
    ),
    Parameter("release_speed", "scatter of its speed then, as a share", 0.0, 0.5, read_only=False),
    Parameter("ball_mass_scale", "factor on the mass of the ball", 0.1, 10.0, read_only=False),
    Parameter("ball_drag_scale", "factor on the drag of the ball", 0.0, 10.0, read_only=False),
    Parameter("basket_position", "centre of the rim at the start [m]"),
    Parameter("basket_radius", "free opening of the basket [m]", 0.05, 1.0),
    Parameter("basket_depth", "rim to floor of the basket [m]", 0.05, 1.0),
    Parameter("board_position", "of the bull of the board, where darts are thrown [m]"),
    Parameter("basket_restitution", "of the basket's walls and floor", 0.0, 1.0),
    *LIMITS,
    Parameter("ground_truth_period", "steps between messages on /simulation/state", 1, 1000),
]
CHANGEABLE = [
    row.name
    for row in TABLE
    if not row.read_only and row.name not in ("speed_factor", "rest_after")
]
"""What can change while the simulator runs, from the next reset on."""
RESTING = 0.05
"""Between two steps of a world that rests [s, wall clock]: a client sees that it lives, and it
costs nearly nothing.
"""
UNASKED = 0.5
"""So soon rests a world of which nobody has asked anything since the start: ball and basket have
settled by then [s].
"""
PUSHES = {"commander": COMMANDS, "teacher": GUIDING}
"""Who moves the arm, and where."""
MOST_STEPS = 100_000
"""Most steps of one call of ~/step: 200 s of simulated time."""
STILL = np.zeros(3)
LATEST = 0.05
"""Real time: steps that are late by more are not made any more, and the arm's time falls behind
[s, wall clock].
"""


class WamSimulator(GuardedNode):
    """The plant behind topics and services. See the module's text for the handshake."""

    def __init__(self):
        super().__init__("wam_simulator")
        self.p = declare(self, "wam_simulator.yaml", TABLE)
        board = Board(tuple(self.p["board_position"]))
        skill, settings = load_skill(self.p["skill"]), PlantSettings.from_parameters(self.p)
        self._plant = make_world(
            skill.world, settings, self.p["seed"], board, skill.world_settings
        )
        self._paused, self._guided, self._budget, self._watched = (
            self.p["start_paused"],
            False,
            0,
            False,
        )
        self._answers, self._fault, self._steps_made = {}, "", 0
        self._next = time.monotonic()  # when the next step is due, where time is held back
        self._rate_mark = (
            time.monotonic(),
            0,
        )  # when _describe looked last, and the steps that were made by then
        self._hold_no_command()
        self._stillness, self._rests = (
            Stillness(),
            False,
        )  # the latter: nothing has moved for long, and nobody waits for steps
        self._asked = False  # whether anybody has asked for anything
        self._guide: Presence | None = None  # who guides the arm
        self._left = ""  # why nobody guides it any more, until it rests
        self._make_topics()
        self._make_services()
        self.add_on_set_parameters_callback(self._refuse_no_arm)
        self._read_pace()
        self.add_post_set_parameters_callback(self._read_pace)
        self._diagnostics = Diagnostics(self, self._describe)
        self._mark = (time.monotonic(), 0)
        self.create_timer(LOOK, self._watch_those_who_move, clock=WALL)
        self.create_timer(0.1, self._watch, clock=WALL)
        if self.p["lockstep"]:
            self.create_timer(RESTING, self._go_on_slowly, clock=WALL)
        else:
            self._wall_due = time.monotonic()
            self.create_timer(self._plant.settings.step, self._real_time, clock=WALL)
        self._publish()

    def _make_topics(self) -> None:
        self._joint_states = self.create_publisher(JointState, JOINT_STATES, COMPLETE)
        self._tool_pose = self.create_publisher(PoseStamped, "wam/tool_pose", COMPLETE)
        self._clock_out = self.create_publisher(ClockMsg, CLOCK, CLOCK_QOS)
        self._truth = self.create_publisher(SimulationState, "simulation/state", FRAMES)
        self._description = self.create_publisher(String, DESCRIPTION, NEWEST)
        self._description.publish(String(data=write_urdf(wam_description())))
        frame = self.p["frame_id"]
        self._transforms = LiveTransforms(self, frame, fixed_transforms(wam_description(), frame))
        joints = JointState(name=[joint.name for joint in wam_description().joints])
        joints.position = joints.velocity = joints.effort = [0.0] * len(joints.name)
        self._tool_msg = PoseStamped()
        for message in (joints, self._tool_msg):
            message.header.frame_id = frame
        self._truth_layouts: dict[
            tuple, FixedLayout
        ] = {}  # by what the messages say beside numbers
        self._joint_layout = FixedLayout(joints)
        self._safety = self.create_publisher(DiagnosticStatus, "wam/safety", NEWEST)
        self._said_of_safety = None
        self._held_out = self.create_publisher(Bool, HELD, NEWEST)
        self._hold(self._paused)
        self._obeyed = {who: ObeyedPublisher(self, topic) for who, topic in PUSHES.items()}
        for who, topic in PUSHES.items():
            self.create_subscription(
                WamCommand,
                topic,
                partial(self._on_answer, who, LayoutReader(WamCommand)),
                LOOP,
                raw=True,
            )

    def _make_services(self) -> None:
        self.create_service(Reset, "simulation/reset", self._on_reset)
        self.create_service(SetBool, "simulation/pause", self._on_pause)
        self.create_service(Step, "simulation/step", self._on_step)
        self.create_service(PlaceBody, "simulation/place_body", self._on_place_body)
        self.create_service(Trigger, "bhand/open_grasp", self._on_open)
        self.create_service(Trigger, "bhand/close_grasp", self._on_close)

    # the handshake

    @property
    def _engaged(self) -> tuple[str, ...]:
        return ("commander", "teacher") if self._guided else ("commander",)

    def _on_answer(self, who: str, reader: LayoutReader, data: bytes) -> None:
        message, ns, numbers = reader.read(data)
        if self.p["lockstep"] and (
            ns != self._plant.state_stamp_ns or who not in self._engaged or who in self._answers
        ):
            return
        if not self._obeyed[who].accepts(message.sender):
            return
        if ns > self._plant.state_stamp_ns:
            raise ValueError(
                f"it is stamped {ns} ns, ahead of the arm, which is at"
                f" {self._plant.state_stamp_ns} ns"
            )
        if message.header.frame_id != self.p["frame_id"]:
            self._complain(
                f"a command of the {who} is in frame '{message.header.frame_id}', not"
                f" '{self.p['frame_id']}': ignored"
            )
            return
        try:
            command = conversions.command_of_numbers(message, ns, numbers)
        except ValueError as error:
            self._complain(f"a command of the {who} is ignored: {error}")
            return
        if self.p["lockstep"]:
            self._answers[who] = command
            self._advance()
        else:
            self._held[who].take(command)
            if who == "teacher":
                self._real_time()

    def _advance(self, slowly: bool = False) -> None:
        """Make the next step if everybody who is engaged has answered and nothing holds time;
        slowly: of a world that rests, too.
        """
        if (self._paused and not self._budget) or any(
            who not in self._answers for who in self._engaged
        ):
            return
        if self._rests and not slowly:
            return  # `_go_on_slowly` comes back to it
        answers = self._answers
        self._answers = {}
        if not self._step(answers["commander"], answers.get("teacher")):
            return
        self._budget = max(0, self._budget - 1)
        self._pace()
        self._publish()

    def _wake(self) -> None:
        """Somebody asked for something: go on at full speed."""
        self._stillness.wake(self._plant.state_stamp_ns)
        self._asked, self._rests = True, False

    def _go_on(self) -> None:
        """Make the step that waits: in a world that rests all have answered, and nobody answers
        again.
        """
        if self.p["lockstep"]:
            self._advance()

    def _go_on_slowly(self) -> None:
        if self._rests:
            self._advance(slowly=True)

    def _step(self, command, push) -> bool:
        try:
            self._plant.step(self._plant.braking() if self._left else command, push)
        except ValueError as error:
            self._complain(f"no step: {error}")
            return False
        self._steps_made += 1
        if self.p["lockstep"]:
            self._look_for_rest()
        self._tell_of_safety()
        if self._left and np.abs(self._plant.joint_velocity).max() < REST_SPEED:
            self._left = ""
        if self.p["lockstep"]:
            self._fault = ""
        return True

    def _look_for_rest(self) -> None:
        """See whether something moves: now and then, and at each step of a world that rests."""
        ns = self._plant.state_stamp_ns
        if not (self._rests or self._stillness.is_due(ns)):
            return
        self._stillness.look(ns, self._plant.joint_velocity, self._plant.bodies)
        waits = self._guided or self._budget
        still_for = (ns - self._stillness.since_ns) * 1e-9
        rest_after = self._rest_after if self._asked else min(self._rest_after, UNASKED)
        self._rests = not waits and 0.0 < rest_after < still_for

    def _tell_of_safety(self) -> None:
        """On /wam/safety, when it changes: all is well, something is near its limit, or the motors
        are shorted until a reset.
        """
        fault, warning = self._plant.fault, self._plant.warning
        said = ERROR if fault else WARN if warning else OK
        if said != self._said_of_safety:
            self._said_of_safety = said
            self._safety.publish(
                DiagnosticStatus(
                    level=said, name="wam safety", message=fault or warning, hardware_id="wam"
                )
            )

    def _pace(self) -> None:
        """Hold simulated time back to speed_factor times the machine's, and to the machine's own
        while somebody watches.
        """
        factor = self._speed_factor
        if self._watched:
            factor = min(factor or 1.0, 1.0)
        if factor <= 0.0:
            return
        now = time.monotonic()
        self._next = max(self._next, now - 0.05) + self._plant.settings.step / factor
        if self._next > now:
            time.sleep(self._next - now)

    def _real_time(self) -> None:
        """Make the step that is due. A late one is made when everybody in this process has had a
        turn: it needs answers, too.
        """
        now = time.monotonic()
        if self._paused and not self._budget:
            self._wall_due = now
            return
        if now < self._wall_due or self._waits_for_a_person(now):
            return
        self._budget = max(0, self._budget - 1)
        period = self._plant.settings.step / (self._speed_factor or 1.0)
        self._wall_due = max(self._wall_due + period, now - LATEST)
        self._step(*self._held_answers())
        self._publish()
        if self._wall_due <= time.monotonic():
            call_soon(self._real_time)

    def _waits_for_a_person(self, now: float) -> bool:
        """Who guides the arm is one body with it: their damping, if it were held for a few steps,
        would shake the wrist.
        """
        push = self._held["teacher"]
        awaited = self._guided and push.has_come and not push.is_for(self._plant.state_stamp_ns)
        return awaited and now - self._published < self.p["command_timeout"]

    def _hold_no_command(self) -> None:
        self._held = {who: HeldCommand(self.p["command_timeout"]) for who in PUSHES}

    def _held_answers(self) -> tuple[Command, Command | None]:
        """Command and push as answers to the present state; the arm is braked when one of them is
        too old.
        """
        answers = {
            who: self._held[who].answer_to(self._plant.state_stamp_ns) for who in self._engaged
        }
        late = [
            who for who, answer in answers.items() if answer is None and self._held[who].has_come
        ]
        if late:
            self._complain(
                f"no command of the {late[0]} for more than {self.p['command_timeout']} s: the arm"
                " is braked"
            )
        elif answers["commander"] is not None:
            self._fault = ""
        brakes = answers["commander"] is None or "teacher" in late
        return self._plant.braking() if brakes else answers["commander"], answers.get("teacher")

    # services

    def _on_reset(self, request, response):
        try:
            situation = conversions.situation(request.situation)
            self._take_changes()
            poses = {
                role: (pose.position, pose.quaternion) for role, pose in situation.poses.items()
            }
            state = self._plant.set_up(poses, situation.numbers)
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        self._guided, self._answers, self._budget, self._watched = (
            request.guided,
            {},
            0,
            request.real_time,
        )
        self._hold_no_command()
        self._wake()
        self._hold(request.paused)
        self._tell_of_safety()
        for one in self._obeyed.values():
            one.forget()
        self._guide, self._left = publishers(self, GUIDING) if request.guided else None, ""
        self._publish()
        response.success, response.episode = True, state.episode
        response.stamp = conversions.time_msg(state.stamp_ns)
        return response

    def _take_changes(self) -> None:
        now = {name: self.get_parameter(name).value for name in CHANGEABLE}
        if any(self.p[name] != value for name, value in now.items()):
            self.p.update(now)
            self._plant.change(PlantSettings.from_parameters(self.p))

    def _read_pace(self, _=()) -> None:
        """Take what says how fast time goes, whenever it was changed: reading a parameter takes as
        long as a message.
        """
        self._speed_factor, self._rest_after = (
            self.get_parameter(name).value for name in ("speed_factor", "rest_after")
        )

    def _refuse_no_arm(self, parameters) -> SetParametersResult:
        """A change that makes settings which no arm has is refused when it is asked for, not at
        the next reset.
        """
        try:
            PlantSettings.from_parameters(
                {**self.p, **{one.name: one.value for one in parameters}}
            )
        except (TypeError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _hold(self, held: bool) -> None:
        self._paused = held
        self._held_out.publish(Bool(data=held))

    def _on_pause(self, request, response):
        self._wake()
        self._hold(request.data)
        response.success, response.message = True, "paused" if request.data else "running"
        self._go_on()
        return response

    def _on_step(self, request, response):
        """Accepts the steps; they are made as answers come, or in real time (a service callback
        cannot wait for them in this rclpy).
        """
        response.success = self._paused and 0 < request.steps <= MOST_STEPS and not self._budget
        if not response.success:
            response.message = (
                f"steps are made while paused, 1 to {MOST_STEPS} at a time, one call after the"
                " other"
            )
            return response
        self._wake()
        self._budget = int(request.steps)
        end_ns = self._plant.state_stamp_ns + self._budget * self._plant.settings.step_ns
        response.stamp = conversions.time_msg(end_ns)
        self._go_on()
        return response

    def _on_place_body(self, request, response):
        try:
            pose = conversions.body_pose(request.pose, f"the {request.body}")
            self._plant.put(request.body, pose.position, pose.quaternion)
            self._wake()
            self._go_on()
            response.success = True
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_open(self, request, response):
        self._plant.open_hand()
        self._wake()
        self._go_on()
        response.success = True
        return response

    def _on_close(self, request, response):
        response.success = self._plant.close_hand()
        response.message = (
            ""
            if response.success
            else f"the {self._plant.loose_body} is not in the hand: ~/reset puts it back"
        )
        return response

    # what is published

    def _publish(self) -> None:
        """The present state. The clock comes first: nothing is stamped later than it shows. Then
        the joint states: in other processes the answer to them is worked out while the rest is
        sent.
        """
        plant, ns = self._plant, self._plant.state_stamp_ns
        if self._clock_out.get_subscription_count():
            self._clock_out.publish(conversions.leading_stamp_bytes(ns))
        self._published = time.monotonic()
        numbers = np.array(
            [*plant.joint_position, *plant.joint_velocity, *plant.joint_effort.tolist()]
        )
        self._joint_states.publish(self._joint_layout.pack(ns, numbers))
        if plant.step_count % self.p["ground_truth_period"] == 0:
            self._publish_truth()
        if self._tool_pose.get_subscription_count():
            conversions.set_stamp(self._tool_msg.header.stamp, ns)
            conversions.set_pose(self._tool_msg.pose, plant.hand_position, plant.hand_quaternion)
            self._tool_pose.publish(self._tool_msg)
        if self._transforms.is_due("arm", ns):
            self._transforms.publish(joint_transforms(wam_description(), plant.joint_position), ns)

    def _publish_truth(self) -> None:
        state, there = self._plant.state, self._plant.bodies
        numbers = [state.position, state.velocity, state.effort]
        for name, (position, quaternion) in there.items():
            numbers += [
                position,
                quaternion,
                state.ball_velocity if name == self._plant.loose_body else STILL,
                STILL,
            ]
        said = tuple(there), self._plant.held_body, self._plant.succeeded
        layout = self._truth_layouts.get(said) or self._truth_layouts.setdefault(
            said, self._truth_layout(*said)
        )
        self._truth.publish(
            layout.pack(
                state.stamp_ns,
                np.concatenate([*numbers, [self.p["base_turn"]]]),
                state.episode,
                state.step,
            )
        )

    def _truth_layout(self, bodies: tuple[str, ...], held: str, success: bool) -> FixedLayout:
        message = SimulationState(
            bodies=[BodyState(name=name) for name in bodies], held=held, success=success
        )
        message.header.frame_id = self.p["frame_id"]
        return FixedLayout(message, conversions.EPISODE_AND_STEP)

    # saying what goes on

    def _watch_those_who_move(self) -> None:
        """Who commands the arm, and whether somebody guides it still: nobody waits for a teacher
        that has gone.
        """
        for one in self._obeyed.values():
            one.look()
        if self._guide is not None and self._guide.gone:
            self._left = f"{self._guide} has gone: guiding ends, the arm is braked"
            self.get_logger().error(self._left)
            self._guided, self._guide = False, None
            if self.p["lockstep"]:
                self._advance()

    def _watch(self) -> None:
        """Publish an unanswered state again: whoever came late, or lost it, gets it now."""
        stamp, now = self._plant.state_stamp_ns, time.monotonic()
        if stamp != self._mark[1]:
            self._mark = (now, stamp)
            return
        silent = [who for who in self._engaged if who not in self._answers]
        if not self.p["lockstep"] or not silent:
            return
        self._publish()
        if now - self._mark[0] > self.p["answer_timeout"] and not self._paused and not self._fault:
            self._complain(
                f"waiting for the answer of {' and '.join(silent)} to the state of {stamp} ns: is"
                " it running?"
            )

    def _complain(self, text: str) -> None:
        if text != self._fault:
            self.get_logger().error(text)
        self._fault = text

    def _describe(self):
        now, steps = time.monotonic(), self._steps_made
        before, last = self._rate_mark
        self._rate_mark = (now, steps)
        factor = (steps - last) * self._plant.settings.step / max(1e-6, now - before)
        stopped = (
            f"stopped by the arm's safety module until a reset: {self._plant.fault}"
            if self._plant.fault
            else ""
        )
        fault = stopped or self._fault or self._left
        strangers = [
            f"{name} publishes {self.resolve_topic_name(PUSHES[who])}, too"
            for who, one in self._obeyed.items()
            for name in one.others
        ]
        level = ERROR if fault else (WARN if strangers else OK)
        message = fault or ("paused" if self._paused else "resting" if self._rests else "running")
        if strangers:
            message += f"; {', '.join(strangers)}: it is not obeyed, end it"
        return (
            level,
            message,
            {
                "real_time_factor": f"{factor:.2f}",
                "steps": steps,
                "engaged": ", ".join(self._engaged),
            },
        )

    def destroy_node(self) -> None:
        self._plant.close()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill wam_simulator`."""
    run(lambda: [WamSimulator()], args)


if __name__ == "__main__":
    main()
