"""The person beside a real arm: asked for what a simulator's reset does, and waited for until the
cameras see it.

The arm moves to where a throw begins, the person puts the ball into its hand and stands back.
Where targets are given, the person puts the basket there. Nothing here moves the arm but `bring`,
which a commander refuses whose arm a person may hold.
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
from dart_skill.common.world import ROLES
from dart_skill.skills.observation import basket_at_rest, check_ball_in_hand
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
HELD, MOVES = Mode.HOLDING.value, Mode.MOVING.value
"""What the commander says of an arm that it holds, and of one on its way to a posture."""


class PersonAtTheArm:
    """What `node` asks of the person, as coroutines; each raises GraphFailure when it takes too
    long, or when `withdrawn` gives a reason.

    bodies: names of the tracked bodies by role. parameters: of the node, in force: frame_id,
    longest_wait, stand_back, seat_tolerance, basket_tolerance. ask: called with what the person
    should do now.
    """

    def __init__(
        self,
        node: Node,
        calls: ServiceCalls,
        bodies: dict[str, str],
        parameters: dict,
    ):
        self._node, self._calls, self._p = node, calls, parameters
        self._tracked = TrackedBodies(parameters["frame_id"], node.get_logger().error)
        self._cameras = MatchingSubscriptions(node)
        for role in ROLES:
            self._cameras.subscribe(
                pose_topic(bodies[role]), self._taker(role), PoseStamped, raw=True
            )
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

    async def basket(self, target: np.ndarray | None) -> np.ndarray:
        """Where the basket stands still (3,): anywhere, or within the tolerance of a target (3,)."""
        if target is None:
            return await self._until("put the basket where the cameras see it", self._where_basket)
        x, y, z = target
        text = f"put the basket at x {x:.2f}, y {y:.2f}, with its rim at z {z:.2f} m"
        return await self._until(text, lambda: self._basket_at(target))

    async def another_basket(self, place: np.ndarray, why: str) -> None:
        """Wait until the basket is seen elsewhere than at a place (3,) for which there is no plan,
        and why.
        """

        def moved() -> bool:
            if self._rests_at(place) is not False:
                raise ValueError("")
            return True

        await self._until(f"put the basket elsewhere: {why}", moved)

    async def bring(self, posture: np.ndarray, since_ns: int = 0) -> None:
        """Move the arm to a posture (7,) and wait until it rests there.

        since_ns: the arm may have moved up to this stamp; states before it, which come late on a
        busy machine, do not say where it is.
        """
        if since_ns:
            await self._until("", lambda: self._check_heard(since_ns), COME_TO_REST)
        if self._is_at(posture):
            return
        self.ask("stand back: the arm moves to where the throw begins")
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
                    "the arm stopped on its way to where the throw begins:"
                    f" {self._last or 'the commander says no reason'}"
                )
            return self._check_at(posture)

        try:
            await self._until("", arrived, conversions.seconds(begun.duration) + COME_TO_REST)
        except GraphFailure:
            await self._calls.call(self._stop, Trigger.Request())
            raise

    async def ball(self, seat: np.ndarray, basket: np.ndarray) -> bool:
        """Wait until the ball rests at its seat (3,) in the hand of a held arm, and has rested
        there while the person stood back.

        False as soon as the basket rests elsewhere than at a place (3,): what was planned for it
        is not thrown.
        """
        seconds = self._p["stand_back"]
        text = "put the ball into the hand, then stand back"
        if not await self._until(
            text, lambda: self._rests_at(basket) is not False and self._check_ball(seat)
        ):
            return False
        begun_ns = self._tracked.newest_ns
        self.ask(f"stand back: the arm throws in {seconds:.0f} s")

        def stood_back() -> bool:
            nonlocal begun_ns
            if self._rests_at(basket) is False:
                return False
            try:
                self._check_ball(seat)
            except ValueError as error:
                begun_ns = self._tracked.newest_ns
                raise ValueError(f"{error}: {text}") from error
            if self._tracked.newest_ns - begun_ns < seconds * 1e9:
                raise ValueError("")
            return True

        return await self._until("", stood_back) and self._rests_at(basket) is True

    def _rests_at(self, place: np.ndarray) -> bool | None:
        """Whether the basket rests at a place (3,); None where it is not seen at rest: somebody
        who stands before it has not carried it.
        """
        try:
            return self._is_near(place, self._where_basket())
        except ValueError:
            return None

    def _is_near(self, place: np.ndarray, seen: np.ndarray) -> bool:
        return float(np.linalg.norm(place - seen)) <= self._p["basket_tolerance"]

    # conditions: each returns what was waited for, or raises ValueError with what is missing

    def _where_basket(self) -> np.ndarray:
        return basket_at_rest(self._tracked.log, self._tracked.newest_ns)

    def _basket_at(self, target: np.ndarray) -> np.ndarray:
        seen = self._where_basket()
        x, y, z = target - seen
        if not self._is_near(target, seen):
            raise ValueError(
                f"the basket is seen elsewhere: move it by x {x:+.2f}, y {y:+.2f}, z {z:+.2f} m"
            )
        return seen

    def _check_ball(self, seat: np.ndarray) -> bool:
        self._check_held()
        check_ball_in_hand(
            self._tracked.log, self._tracked.newest_ns, seat, self._p["seat_tolerance"]
        )
        return True

    def _check_heard(self, since_ns: int) -> bool:
        if not self._has_heard(since_ns):
            raise ValueError(
                "no state of the arm has come on /joint_states since it was thrown with: is its"
                " driver running?"
            )
        return True

    def _check_held(self) -> None:
        if not self._heard:
            raise ValueError("nothing has come on /joint_states: is the arm's driver running?")
        state = self._state()
        if self._mode != HELD:
            said = f"'{self._mode}'" if self._mode else "nothing yet"
            raise ValueError(
                f"the arm is not held, the commander says {said}: hold it (/commander/release_arm"
                " with data: false)"
            )
        if np.abs(state.velocity).max() > AT_REST:
            raise ValueError("the arm still moves")

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
            raise ValueError("the arm is not where the throw begins: was it stopped?")
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
