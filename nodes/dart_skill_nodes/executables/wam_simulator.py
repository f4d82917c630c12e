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
from dart_skill_msgs.srv import PlaceBody, Reset, Step
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from dart_skill.arm import REST_SPEED, Command, Grip
from dart_skill.simulation import Board, PlantSettings, make_world
from dart_skill_nodes.arm.answers import Answers
from dart_skill_nodes.arm.simulated_arm import StatePublisher, WorldPace, let_it_change
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import HELD
from dart_skill_nodes.comms.qos import NEWEST, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.this_machine import LOOK
from dart_skill_nodes.process.node_base import ERROR, OK, WARN, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, skill_of

RESTING = 0.05
"""Time between two steps of a world that rests [s, wall clock]: a client sees that it lives, and it
costs nearly nothing.
"""
MOST_STEPS = 100_000
"""Most steps of one call of ~/step: 200 s of simulated time."""


class WamSimulator(GuardedNode):
    """The plant behind topics and services. See the module's text for the handshake."""

    def __init__(self):
        super().__init__("wam_simulator")
        self.p = declare(self, "wam_simulator")
        board = Board(tuple(self.p["board_position"]))
        skill, settings = skill_of(self), PlantSettings.from_parameters(self.p)
        self._plant = make_world(
            skill.world, settings, self.p["seed"], board, skill.world_settings
        )
        self._budget, self._fault, self._steps_made = 0, "", 0
        self._left = ""  # why it is not guided any more, until it rests
        self._rate_mark = (time.monotonic(), 0)  # when _describe looked last, and the steps then
        self._mark = (time.monotonic(), 0)  # when a state was new, and its stamp
        self._state = StatePublisher(self, self._plant, self.p)
        self._pace = WorldPace(self, self._plant)
        self._held_out = self.create_publisher(Bool, HELD, NEWEST)
        self._hold(self.p["start_paused"])
        self._answers = Answers(self, self._plant, self.p, self._on_answer, self._complain)
        self.create_service(Reset, "simulation/reset", self._on_reset)
        self.create_service(SetBool, "simulation/pause", self._on_pause)
        self.create_service(Step, "simulation/step", self._on_step)
        self.create_service(PlaceBody, "simulation/place_body", self._on_place_body)
        self.create_service(Trigger, "bhand/open_grasp", self._on_open)
        self.create_service(Trigger, "bhand/close_grasp", self._on_close)
        self._take_changes = let_it_change(self, self._plant, self.p)
        self._diagnostics = Diagnostics(self, self._describe)
        self.create_timer(LOOK, self._watch_those_who_move, clock=WALL)
        self.create_timer(0.1, self._watch, clock=WALL)
        if self.p["lockstep"]:
            slowly = partial(self._advance, slowly=True)
            self.create_timer(RESTING, lambda: self._pace.rests and slowly(), clock=WALL)
        else:
            # twice as often as a step is due, so that those that are late are made up for
            self.create_timer(0.5 * self._plant.settings.step, self._real_time, clock=WALL)
        self._state.publish()

    # the handshake

    def _on_answer(self, who: str) -> None:
        if self.p["lockstep"]:
            self._advance()
        elif who == "teacher":
            self._real_time()

    def _advance(self, slowly: bool = False) -> None:
        """Make the next step if all who are engaged have answered and nothing holds time; slowly:
        of a world that rests, too.
        """
        if (self._paused and not self._budget) or self._answers.silent:
            return
        if self._pace.rests and not slowly:
            return  # a timer comes back to it
        if not self._step(*self._answers.take()):
            return
        self._budget = max(0, self._budget - 1)
        self._pace.hold_back()
        self._state.publish()

    def _go_on(self) -> None:
        """Go on at full speed, as a client has asked for something, with the step that waits."""
        self._pace.wake()
        if self.p["lockstep"]:
            self._advance()

    def _step(self, command: Command, push: Command | None) -> bool:
        try:
            self._plant.step(self._plant.braking() if self._left else command, push)
        except ValueError as error:
            self._complain(f"no step: {error}")
            return False
        self._steps_made += 1
        if self.p["lockstep"]:
            self._pace.look_for_rest(waits=bool(self._answers.guided or self._budget))
            self._fault = ""
        self._state.publish_safety()
        if self._left and np.abs(self._plant.joint_velocity).max() < REST_SPEED:
            self._left = ""
        return True

    def _real_time(self) -> None:
        """Make the step that is due."""
        if self._paused and not self._budget:
            self._pace.is_due(counts=False)
            return
        # Who guides the arm is one body with it: their damping, if it were held for a few steps,
        # would shake the wrist.
        patience = self.p["command_timeout"]
        waits = time.monotonic() - self._state.at < patience and self._answers.awaits_teacher()
        if waits or not self._pace.is_due():
            return
        self._budget = max(0, self._budget - 1)
        command, push, are_fresh = self._answers.newest()
        if are_fresh:
            self._fault = ""
        self._step(command, push)
        self._state.publish()

    # services

    def _on_reset(self, request, response):
        situation = conversions.situation(request.situation)
        self._take_changes()
        poses = {role: (pose.position, pose.quaternion) for role, pose in situation.poses.items()}
        state = self._plant.set_up(poses, situation.numbers)
        self._budget, self._left = 0, ""
        self._pace.watched = request.real_time
        self._pace.wake()
        self._hold(request.paused)
        self._state.publish_safety()
        self._answers.begin(request.guided)
        self._state.publish()
        response.episode, response.stamp = state.episode, conversions.time_msg(state.stamp_ns)

    def _hold(self, held: bool) -> None:
        self._paused = held
        self._held_out.publish(Bool(data=held))

    def _on_pause(self, request, response):
        self._hold(request.data)
        self._go_on()
        response.message = "paused" if request.data else "running"

    def _on_step(self, request, response):
        """Accepts the steps: a service callback cannot wait for them in this rclpy."""
        if not self._paused or self._budget or not 0 < request.steps <= MOST_STEPS:
            raise ValueError(
                f"steps are made while paused, 1 to {MOST_STEPS} at a time, one call after the"
                " other"
            )
        self._budget = int(request.steps)
        end_ns = self._plant.state_stamp_ns + self._budget * self._plant.settings.step_ns
        response.stamp = conversions.time_msg(end_ns)
        self._go_on()

    def _on_place_body(self, request, response):
        pose = conversions.body_pose(request.pose, f"the {request.body}")
        self._plant.put(request.body, pose.position, pose.quaternion)
        self._go_on()

    def _on_open(self, request, response):
        self._plant.obey(Grip.OPEN)
        self._go_on()

    def _on_close(self, request, response):
        if not self._plant.close_hand():
            raise ValueError(
                f"the {self._plant.loose_body} is not in the hand: ~/reset puts it back"
            )

    # saying what goes on

    def _watch_those_who_move(self) -> None:
        if gone := self._answers.look():
            self._left = gone
            self.get_logger().error(gone)
            if self.p["lockstep"]:
                self._advance()

    def _watch(self) -> None:
        """Publish an unanswered state again, for nodes that came late, or lost it."""
        stamp, now = self._plant.state_stamp_ns, time.monotonic()
        if stamp != self._mark[1]:
            self._mark = (now, stamp)
            return
        silent = self._answers.silent
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
        stopped = "stopped by the arm's safety module until a reset: "
        fault = (stopped + self._plant.fault if self._plant.fault else "") or self._fault
        fault = fault or self._left
        strangers = self._answers.strangers
        level = ERROR if fault else WARN if strangers else OK
        rests = f"resting: {1.0 / RESTING:.0f} states a second, until somebody asks for something"
        text = "paused" if self._paused else rests if self._pace.rests else "running"
        message = fault or text
        if strangers:
            message += f"; {', '.join(strangers)}: it is not obeyed, end it"
        values = {"real_time_factor": f"{factor:.2f}", "steps": steps}
        return level, message, {**values, "engaged": ", ".join(self._answers.engaged)}

    def destroy_node(self) -> None:
        self._plant.close()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill wam_simulator`."""
    run(lambda: [WamSimulator()], args)


if __name__ == "__main__":
    main()
