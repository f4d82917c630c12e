"""What a node does with a message that it cannot use: nothing, but it says so. The message is
counted by where it came from, and its reason stands in the log and on /diagnostics. One place for
all callbacks of all nodes: a `GuardedNode` survives whatever it is sent.
"""

import time
import traceback
from collections import Counter
from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node

from dart_skill_nodes.comms.qos import CALLS, WALL
from dart_skill_nodes.comms.this_machine import hold

SAID_AGAIN = 5.0
"""A place that goes on refusing is named in the log so often [s, wall clock]: a stream of bad
messages is no stream of lines.
"""
NOT_RECORDED = "recording has stopped"
"""Said of a bag that cannot be written to any more. No demonstration is made of what is in no bag:
it would be gone with the learner.
"""
NOT_CHANGED = {
    "on_configure": "not configured",
    "on_activate": "not activated",
    "on_deactivate": "not deactivated",
    "on_cleanup": "not cleaned up",
    "on_shutdown": "not shut down",
}
"""What is said of a change of state that fails, by its method."""
CONFIGURED = {"on_configure": True, "on_cleanup": False, "on_shutdown": False}
"""Whether a node is configured after a change of state; the others change nothing about it."""
SHOWN = 10.0
"""The last refusal is the node's status for so long [s, wall clock]; the counts stay."""


class Refusals:
    """What was refused, by place: a topic, a service, a timer. complain: called with a line for
    the log.

    counts: by place.
    """

    def __init__(self, complain: Callable[[str], None]):
        self.counts: Counter[str] = Counter()
        self._complain, self._said = complain, {}
        self._last, self._last_at = "", -SHOWN

    @property
    def recent(self) -> str:
        """The last refusal with its reason; empty when that is long ago."""
        return self._last if time.monotonic() - self._last_at < SHOWN else ""

    def add(self, place: str, error: Exception) -> str:
        """Count a refusal; the line that says what was refused, and why."""
        now = time.monotonic()
        self.counts[place] += 1
        self._last, self._last_at = f"refused on {place}: {in_a_line(error)}", now
        if now - self._said.get(place, -SAID_AGAIN) >= SAID_AGAIN:
            self._said[place] = now
            self._complain(f"{self._last} ({self.counts[place]} so far)")
        return self._last

    def accepts(self, place: str, function: Callable, *arguments) -> bool:
        """Call a function; False if it refuses its arguments, however it does."""
        try:
            function(*arguments)
        except ExternalShutdownException:
            raise
        except Exception as error:  # foreign bytes meet code that was written for good ones
            self.add(place, error)
            return False
        return True


def in_words(error: Exception) -> str:
    """What an error says; of one of the system without its number."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)


def in_a_line(error: Exception) -> str:
    """What an error says; of one that is no plain refusal also where it was raised, as that is a
    defect of ours.
    """
    text = " ".join(in_words(error).split())[:500]
    if isinstance(error, ValueError | OSError):
        return text
    frames = traceback.extract_tb(error.__traceback__)
    where = f" at {frames[-1].filename.rsplit('/', 1)[-1]}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__}{where}: {text}"


class _Guarded:
    """Before Node or LifecycleNode: no callback of a subscription, a service or a timer ends the
    node.

    ValueError where a node of this full name runs on this machine.
    """

    def __init__(self, name: str, **options):
        self.refusals = Refusals(lambda text: self.get_logger().error(text))
        self._wall = Clock(clock_type=WALL.clock_type)
        super().__init__(name, **options)
        self._held_name = hold(self.get_fully_qualified_name())

    def destroy_node(self) -> None:
        super().destroy_node()
        self._held_name.close()

    def create_subscription(self, msg_type, topic, callback, qos_profile, **options):
        place = self.resolve_topic_name(topic)

        def hear(message) -> None:
            self.refusals.accepts(place, callback, message)

        return super().create_subscription(msg_type, topic, hear, qos_profile, **options)

    def create_service(self, srv_type, srv_name, callback, **options):
        """See `Node`; a callback that returns nothing has done what it was asked to, and one that
        raises a ValueError or OSError refuses it with that reason.
        """

        def answer(request, response):
            try:
                if callback(request, response) is None:
                    response.success = True
                return response
            except (ValueError, OSError) as error:
                response.success, response.message = False, in_words(error)
            except Exception as error:  # a request may hold anything
                response = srv_type.Response()
                response.success, response.message = False, self.refusals.add(srv_name, error)
            return response

        return super().create_service(
            srv_type, srv_name, answer, **{"qos_profile": CALLS, **options}
        )

    def create_client(self, srv_type, srv_name, **options):
        return super().create_client(srv_type, srv_name, **{"qos_profile": CALLS, **options})

    def create_timer(self, timer_period_sec, callback, *arguments, clock=None, **options):
        """On `WALL` each node has a clock of its own: from eight timers on one clock rclpy's
        executor complains.
        """

        def tick() -> None:
            self.refusals.accepts(f"timer {getattr(callback, '__name__', '')}".strip(), callback)

        own = self._wall if clock is WALL else clock
        return super().create_timer(timer_period_sec, tick, *arguments, clock=own, **options)


class GuardedNode(_Guarded, Node):
    """A node that survives what it is sent."""


class GuardedLifecycleNode(_Guarded, LifecycleNode):
    """A managed node that survives what it is sent. A change of state that fails says why: rclpy
    keeps the exception to itself.

    fault: why the last change of state failed; empty if it did not. is_configured: whether it is,
    or was activated since.
    """

    def __init__(self, name: str, **options):
        self.fault, self.is_configured = "", False
        for change, what in NOT_CHANGED.items():  # rclpy takes them from the node when it is made
            setattr(
                self, change, self._saying(what, getattr(self, change), CONFIGURED.get(change))
            )
        super().__init__(name, **options)

    def _saying(
        self,
        what: str,
        callback: Callable[[LifecycleState], TransitionCallbackReturn],
        configured: bool | None,
    ) -> Callable:
        def change(state: LifecycleState) -> TransitionCallbackReturn:
            self.fault = ""
            try:
                done = callback(state)
                if configured is not None and done == TransitionCallbackReturn.SUCCESS:
                    self.is_configured = configured
                return done
            except Exception as error:  # of whatever a node needs and does not find
                self.fault = f"{what}: {in_a_line(error)}"
                self.get_logger().error(self.fault)
                return TransitionCallbackReturn.FAILURE

        return change
