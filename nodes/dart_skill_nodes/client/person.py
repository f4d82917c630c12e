"""The person beside a real arm: asked for what a simulator's reset does, and waited for until the
cameras see it. What that is, the skill says (`standing`, `in_hand`, `started_by`, `in_the_way`,
`words`).

Bodies stand where the person puts them, the arm moves to where a trial begins, the person puts
what it needs into its hand and stands back. Nothing here moves the arm but `bring`, which a
commander refuses whose arm a person may hold.
"""

import time
from collections.abc import Callable

import numpy as np
from dart_skill_msgs.srv import MoveArm
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from dart_skill.arm import ArmState, Mode
from dart_skill.common.situation import Pose
from dart_skill.recording import HAND
from dart_skill.skills.practice import Poses, TrialBodies
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.client.service_calls import ServiceCalls
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import pause
from dart_skill_nodes.comms.joint_states import hear_joint_states
from dart_skill_nodes.comms.names import DIAGNOSTICS, in_graph, pose_topic
from dart_skill_nodes.comms.qos import MatchingSubscriptions
from dart_skill_nodes.comms.tracked_bodies import TrackedBodies
from dart_skill_nodes.process.graph_processes import GraphFailure

LOOK = 0.05
"""What the cameras see is looked at so often [s, wall clock]."""
HINT = 2.0
"""What is missing is said after so long [s, wall clock]: at first, it is no news."""
AT_REST, THERE = 0.05, 0.1
"""The arm is at rest below this joint speed [rad/s], and at a posture within this of each joint
[rad].
"""
COME_TO_REST = 20.0
"""An arm that is not at its posture so long after it should be is not waited for any more [s, wall
clock].
"""
HELD, MOVES, RELEASED = Mode.HOLDING.value, Mode.MOVING.value, Mode.FREE.value
"""What the commander says of an arm that it holds, of one on its way to a posture, and of one that
a person may guide.
"""
UNDER_WAY = tuple(mode.value for mode in Mode if mode not in (Mode.HOLDING, Mode.FREE))
"""What the commander says of an arm that comes to rest by itself."""


class PersonAtTheArm:
    """What `node` asks of the person who lets a skill be practised, as coroutines; each raises
    GraphFailure when it takes too long, or when `withdrawn` gives a reason.

    bodies: names of the tracked bodies by role. parameters: of the node, in force: frame_id,
    longest_wait, stand_back, seat_tolerance, body_tolerance. ask: called with what the person
    should do now.
    """

    def __init__(
        self,
        node: Node,
        skill: Skill,
        calls: ServiceCalls,
        bodies: dict[str, str],
        parameters: dict,
    ):
        self._node, self._skill, self._calls, self._p = node, skill, calls, parameters
        complain = node.get_logger().error
        self._tracked = TrackedBodies(parameters["frame_id"], complain, log=skill.sensor_log())
        tolerances = parameters["seat_tolerance"], parameters["body_tolerance"]
        self._bodies = TrialBodies(skill, self._tracked.log, *tolerances)
        self._cameras = MatchingSubscriptions(node)
        for role in (HAND, *skill.bodies):
            self._cameras.subscribe(
                pose_topic(bodies[role]), self._taker(role), PoseStamped, raw=True
            )
        self._begin = f"where the {skill.words.trial} begins"
        self._heard, self._mode, self._last, self._moved = b"", "", "", False
        self._mode_ns = 0  # stamp of the state in which the commander said its mode
        self._states = hear_joint_states(node, self._on_state, raw=True)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 10)
        self._move = node.create_client(MoveArm, "commander/move_to")
        self._stop = node.create_client(Trigger, "commander/stop")
        self.ask: Callable[[str], None] = lambda text: None
        self.withdrawn: Callable[[], str] = lambda: ""

    # what is heard

    def _taker(self, role: str) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            self._tracked.take(role, data)
            self._tracked.forget_old()

        return take

    def _on_state(self, data: bytes) -> None:
        self._heard = data  # 500 of them come in a second, and 20 are looked at

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if in_graph(self._node, status.name) == "commander":
                values = {pair.key: pair.value for pair in status.values}
                self._mode, self._last = values.get("mode", ""), values.get("last", "")
                self._mode_ns = int(values.get("newest_state_ns", 0))
                self._moved = self._moved or self._mode == MOVES

    # what is asked and waited for

    async def stand(self, asked: Poses) -> Poses:
        """Where the bodies stand still that are not in the hand: anywhere, or within the tolerance
        of the poses that are asked for.
        """
        wanted = {role: pose for role, pose in asked.items() if role in self._skill.standing}
        places = [self._skill.where_to_put(role, pose) for role, pose in wanted.items()]
        text = "; ".join(places) or self._skill.words.stand
        return await self._until(
            text, lambda: self._bodies.standing(self._tracked.newest_ns, wanted)
        )

    async def stand_elsewhere(self, places: Poses, why: str) -> None:
        """Wait until a body is seen elsewhere than at poses for which there is no plan, and why;
        GraphFailure if a plan depends on none.
        """
        roles = [role for role in places if role in self._skill.situated]
        if not roles:
            raise GraphFailure(why)

        def moved() -> bool:
            if self._bodies.stay(self._tracked.newest_ns, places) is not False:
                raise ValueError("")
            return True

        await self._until(f"put the {' or the '.join(roles)} elsewhere: {why}", moved)

    async def bring(self, posture: np.ndarray, since_ns: int = 0) -> None:
        """Move the arm to a posture (7,) and wait until it rests there.

        since_ns: the arm may have moved up to this stamp; states before it, which come late on a
        busy machine, do not say where it is.
        """
        if since_ns:
            await self._until("", lambda: self._check_heard(since_ns), COME_TO_REST)
        if self._is_at(posture):
            return
        if self._mode == RELEASED:
            await self._stand_back("", self._check_held, f"the arm moves to {self._begin}")
        try:
            self._bodies.check_clear()
        except ValueError:
            await self._stand_back(self._skill.words.clear, self._check_clear, "the arm goes back")
        self.ask(f"stand back: the arm moves to {self._begin}")
        self._moved = False
        begun = await self._calls.call(self._move, MoveArm.Request(posture=posture))

        def arrived() -> bool:
            # a state from before the arm was held again, which comes late on a busy machine, does
            # not say where it stopped
            if (
                self._moved
                and self._mode == HELD
                and self._has_heard(self._mode_ns)
                and not self._is_at(posture)
            ):
                raise GraphFailure(
                    f"the arm stopped on its way to {self._begin}:"
                    f" {self._last or 'the commander says no reason'}"
                )
            return self._check_at(posture)

        try:
            await self._until("", arrived, conversions.seconds(begun.duration) + COME_TO_REST)
        except GraphFailure:
            await self._calls.call(self._stop, Trigger.Request())
            raise

    async def ready(self, seat: Pose | None, places: Poses) -> Poses | None:
        """Wait until a body rests at its seat in the hand of a held arm, and has rested there while
        the person stood back; for a skill that begins with the motion of a body, until that has
        set off. Where the other bodies stand then.

        None as soon as one of them rests elsewhere than at its place: what was planned for it is
        not executed.
        """
        words, now = self._skill.words, self._tracked

        def is_ready() -> bool:
            if self._bodies.stay(now.newest_ns, places) is False:
                return False
            self._check_held()
            self._bodies.check_in_hand(now.newest_ns, seat)
            return True

        stood_back = await self._stand_back(words.load, is_ready, words.then)
        if not stood_back or not self._bodies.stay(now.newest_ns, places):
            return None
        if self._skill.started_by:
            await self._until(words.start, lambda: self._check_set_off(places))
            return places
        return await self._until("", lambda: self._bodies.standing(now.newest_ns, {}))

    async def _stand_back(self, text: str, condition: Callable[[], bool], then: str) -> bool:
        """Wait until a condition holds, and has held for so long as the person needs to stand back
        before what is said to happen `then`; False as soon as it returns that.
        """
        seconds = self._p["stand_back"]
        if not await self._until(text, condition):
            return False
        begun_ns = self._tracked.newest_ns
        self.ask(f"stand back: {then} in {seconds:.0f} s")

        def stood_back() -> bool:
            nonlocal begun_ns
            try:
                holds = condition()
            except ValueError as error:
                begun_ns = self._tracked.newest_ns
                raise ValueError(f"{error}: {text}" if text else str(error)) from error
            if holds and self._tracked.newest_ns - begun_ns < seconds * 1e9:
                raise ValueError("")
            return holds

        return await self._until("", stood_back)

    # conditions: each returns what was waited for, or raises ValueError with what is missing

    def _check_clear(self) -> bool:
        self._bodies.check_clear()
        return True

    def _check_set_off(self, places: Poses) -> bool:
        self._check_held()
        self._bodies.check_set_off(places)
        return True

    def _check_heard(self, since_ns: int) -> bool:
        if not self._has_heard(since_ns):
            raise ValueError(
                "no state of the arm has come on /joint_states since the last"
                f" {self._skill.words.trial}: is its driver running?"
            )
        return True

    def _check_held(self) -> bool:
        if not self._heard:
            raise ValueError("nothing has come on /joint_states: is the arm's driver running?")
        state = self._state()
        if self._mode in UNDER_WAY:
            raise ValueError(
                f"the arm is still on its way, the commander says '{self._mode}': wait until it"
                " rests"
            )
        if self._mode != HELD:
            said = f"'{self._mode}'" if self._mode else "nothing yet"
            raise ValueError(
                f"the arm is not held, the commander says {said}: hold it (/commander/release_arm"
                " with data: false)"
            )
        if np.abs(state.velocity).max() > AT_REST:
            raise ValueError("the arm still moves")
        return True

    def _has_heard(self, since_ns: int) -> bool:
        """Whether a state of the arm has come that is not older than a stamp [ns]."""
        return bool(self._heard) and self._state().stamp_ns >= since_ns

    def _is_at(self, posture: np.ndarray) -> bool:
        return bool(self._heard) and float(np.abs(self._state().position - posture).max()) < THERE

    def _state(self) -> ArmState:
        """The newest state of the arm; ValueError for one that is not of its joints."""
        return conversions.arm_state(conversions.decoded(self._heard, JointState))

    def _check_at(self, posture: np.ndarray) -> bool:
        self._check_held()
        if not self._is_at(posture):
            raise ValueError(f"the arm is not {self._begin}: was it stopped?")
        return True

    async def _until(self, text: str, condition: Callable, limit: float | None = None):
        """What a condition returns, once it raises no ValueError for what has come since now; says
        `text`, and what is missing.
        """
        if text:
            self.ask(text)
        limit = self._p["longest_wait"] if limit is None else limit
        since_ns, begun, told = self._tracked.newest_ns, time.monotonic(), ""
        while True:
            await pause(self._node, LOOK)
            if reason := self.withdrawn():
                raise GraphFailure(reason)
            try:
                result = condition()
                if self._tracked.newest_ns > since_ns:
                    return result
                why = "the cameras see nothing: are they running, and is a body tracked?"
            except ValueError as error:
                why = str(error)
            waited = time.monotonic() - begun
            if waited > limit:
                raise GraphFailure(f"gave up after {waited:.0f} s: {why or text}")
            if why and why != told and waited > HINT:
                told = why
                self.ask(f"{text}: {why}" if text else why)
