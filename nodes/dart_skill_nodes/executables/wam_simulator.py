"""The WAM simulator: publishes the state of step k, waits for the answer to it, integrates to step
k + 1.

Lockstep (the default): the commander always, and the teacher while it guides, answer every state
with a WamCommand that echoes its stamp. Nothing else moves time. A state that is not answered is
published again, and /diagnostics says who is silent. Real time: steps follow the machine's clock,
the last command is held, and without a fresh one the arm is braked. A simulated person is a part
of the world, which waits for their hands.
"""

import time
from functools import partial

import numpy as np
from dart_skill_msgs.msg import WamCommand
from dart_skill_msgs.srv import PlaceBody, Reset, Step
from rcl_interfaces.msg import SetParametersResult
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import (
    REST_SPEED,
    Grip,
)
from dart_skill.simulation import Board, PlantSettings, make_world
from dart_skill_nodes.arm.state_publisher import StatePublisher
from dart_skill_nodes.arm.world_pace import HeldAnswers, WorldPace
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.arm_time import HELD
from dart_skill_nodes.comms.commands import ObeyedPublisher
from dart_skill_nodes.comms.fixed_layout import LayoutReader
from dart_skill_nodes.comms.in_process import call_soon
from dart_skill_nodes.comms.names import COMMANDS, GUIDING
from dart_skill_nodes.comms.presence import LOOK, Presence, publishers
from dart_skill_nodes.comms.qos import LOOP, NEWEST, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import (
    ERROR,
    OK,
    WARN,
    Diagnostics,
    Parameter,
    declare,
    run,
    skill_of,
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
PUSHES = {"commander": COMMANDS, "teacher": GUIDING}
"""Who moves the arm, and where."""
MOST_STEPS = 100_000
"""Most steps of one call of ~/step: 200 s of simulated time."""
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
        skill, settings = skill_of(self), PlantSettings.from_parameters(self.p)
        self._plant = make_world(
            skill.world, settings, self.p["seed"], board, skill.world_settings
        )
        self._paused, self._guided, self._budget = self.p["start_paused"], False, 0
        self._answers, self._fault, self._steps_made = {}, "", 0
        # when _describe looked last, and the steps that were made by then
        self._rate_mark = (time.monotonic(), 0)
        self._guide: Presence | None = None  # who guides the arm
        self._left = ""  # why it is not guided any more, until it rests
        self._state = StatePublisher(self, self._plant, self.p)
        self._pace = WorldPace(self._plant)
        self._held_out = self.create_publisher(Bool, HELD, NEWEST)
        self._hold(self._paused)
        self._hold_no_command()
        self._obeyed = {who: ObeyedPublisher(self, topic) for who, topic in PUSHES.items()}
        for who, topic in PUSHES.items():
            reader = LayoutReader(WamCommand)
            self.create_subscription(
                WamCommand, topic, partial(self._on_answer, who, reader), LOOP, raw=True
            )
        self.create_service(Reset, "simulation/reset", self._on_reset)
        self.create_service(SetBool, "simulation/pause", self._on_pause)
        self.create_service(Step, "simulation/step", self._on_step)
        self.create_service(PlaceBody, "simulation/place_body", self._on_place_body)
        self.create_service(Trigger, "bhand/open_grasp", self._on_open)
        self.create_service(Trigger, "bhand/close_grasp", self._on_close)
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
        self._state.publish()

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
            self._held.take(who, command)
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
        if self._pace.rests and not slowly:
            return  # `_go_on_slowly` comes back to it
        answers = self._answers
        self._answers = {}
        if not self._step(answers["commander"], answers.get("teacher")):
            return
        self._budget = max(0, self._budget - 1)
        self._pace.hold_back()
        self._state.publish()

    def _go_on(self) -> None:
        """Go on at full speed, as a client has asked for something, with the step that waits: in a
        world that rests all have answered, and do not answer again.
        """
        self._pace.wake()
        if self.p["lockstep"]:
            self._advance()

    def _go_on_slowly(self) -> None:
        if self._pace.rests:
            self._advance(slowly=True)

    def _step(self, command, push) -> bool:
        try:
            self._plant.step(self._plant.braking() if self._left else command, push)
        except ValueError as error:
            self._complain(f"no step: {error}")
            return False
        self._steps_made += 1
        if self.p["lockstep"]:
            self._pace.look_for_rest(waits=bool(self._guided or self._budget))
            self._fault = ""
        self._state.publish_safety()
        if self._left and np.abs(self._plant.joint_velocity).max() < REST_SPEED:
            self._left = ""
        return True

    def _real_time(self) -> None:
        """Make the step that is due. A late one is made when everybody in this process has had a
        turn: it needs answers, too.
        """
        now = time.monotonic()
        if self._paused and not self._budget:
            self._wall_due = now
            return
        # Who guides the arm is one body with it: their damping, if it were held for a few steps,
        # would shake the wrist.
        awaited = self._guided and self._held.awaits("teacher")
        if now < self._wall_due or (awaited and now - self._state.at < self.p["command_timeout"]):
            return
        self._budget = max(0, self._budget - 1)
        period = self._plant.settings.step / (self._pace.speed_factor or 1.0)
        self._wall_due = max(self._wall_due + period, now - LATEST)
        command, push, are_fresh = self._held.now(self._engaged)
        if are_fresh:
            self._fault = ""
        self._step(command, push)
        self._state.publish()
        if self._wall_due <= time.monotonic():
            call_soon(self._real_time)

    def _hold_no_command(self) -> None:
        self._held = HeldAnswers(self._plant, PUSHES, self.p["command_timeout"], self._complain)

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
        self._guided, self._answers, self._budget = request.guided, {}, 0
        self._pace.watched = request.real_time
        self._hold_no_command()
        self._pace.wake()
        self._hold(request.paused)
        self._state.publish_safety()
        for one in self._obeyed.values():
            one.forget()
        self._guide, self._left = publishers(self, GUIDING) if request.guided else None, ""
        self._state.publish()
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
        self._pace.speed_factor, self._pace.rest_after = (
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
        self._hold(request.data)
        self._go_on()
        response.success, response.message = True, "paused" if request.data else "running"
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
        self._budget = int(request.steps)
        end_ns = self._plant.state_stamp_ns + self._budget * self._plant.settings.step_ns
        response.stamp = conversions.time_msg(end_ns)
        self._go_on()
        return response

    def _on_place_body(self, request, response):
        try:
            pose = conversions.body_pose(request.pose, f"the {request.body}")
            self._plant.put(request.body, pose.position, pose.quaternion)
            self._go_on()
            response.success = True
        except ValueError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_open(self, request, response):
        self._plant.obey(Grip.OPEN)
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

    # saying what goes on

    def _watch_those_who_move(self) -> None:
        """Who commands the arm, and whether it is still guided: a teacher that has gone is not
        waited for.
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
        """Publish an unanswered state again, for nodes that came late, or lost it."""
        stamp, now = self._plant.state_stamp_ns, time.monotonic()
        if stamp != self._mark[1]:
            self._mark = (now, stamp)
            return
        silent = [who for who in self._engaged if who not in self._answers]
        if not self.p["lockstep"] or not silent:
            return
        self._state.publish()
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
        message = fault or (
            "paused" if self._paused else "resting" if self._pace.rests else "running"
        )
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
