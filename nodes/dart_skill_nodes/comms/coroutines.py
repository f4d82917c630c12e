"""Coroutines for the nodes' actions that cost nothing while they wait.

rclpy's EventsExecutor steps a coroutine that awaits a future over and over until the future is
done: a whole core for the length of an action (measured with rclpy 7.1.6). A routine is resumed
once, when the promise that it waits for is kept.
"""

import heapq
import time
from collections.abc import Callable, Coroutine
from itertools import count
from threading import Thread
from weakref import WeakKeyDictionary

from rclpy.action import ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from dart_skill_nodes.comms.presence import Presence
from dart_skill_nodes.comms.qos import CALLS, WAITS
from dart_skill_nodes.comms.this_machine import LOOK

RESULT_KEPT = 60
"""The result of a goal is kept so long [s]. The 900 s that rclpy has for this let a graph that
practises grow by 300 MB.
"""

LOOKED_AFTER = 0.002
"""Whether a thread has ended, it is looked so often [s, wall clock]."""
NEVER = 1e8
"""Three years [s]."""


class Promise:
    """Something to await in a routine; the first value that is set counts."""

    def __init__(self):
        self._value, self._waiting = None, None
        self.kept = False

    def keep(self, value=None) -> None:
        """Resume the routine that waits, with a value."""
        if self.kept:
            return
        self._value, self.kept = value, True
        if self._waiting is not None:
            self._waiting()

    def when_kept(self, resume: Callable[[], None]) -> None:
        """Call `resume` as soon as the promise is kept."""
        if self.kept:
            resume()
        else:
            self._waiting = resume

    def __await__(self):
        if not self.kept:
            yield self
        return self._value


def start(
    node: Node, routine: Coroutine, ended: Callable[[object, Exception | None], None]
) -> None:
    """Run a coroutine that awaits promises only; `ended` gets its result, or the exception that it
    ended with.
    """

    def advance() -> None:
        try:
            promise = routine.send(None)
        except StopIteration as stop:
            ended(stop.value, None)
        except Exception as error:  # whatever it is, the caller of the routine gets it
            ended(None, error)
        else:
            promise.when_kept(lambda: node.executor.create_task(advance))

    advance()


async def within(node: Node, promise: Promise, limit: float, *needed: Presence):
    """Value of a promise, or None if it is not kept within the limit [s, wall clock], or as soon
    as one that is needed for it has gone.
    """
    until = time.monotonic() + limit
    while (
        not promise.kept
        and (left := until - time.monotonic()) > 0.0
        and not any(one.gone for one in needed)
    ):
        await _kept_or_over(node, promise, min(left, LOOK) if needed else left)
    return await promise if promise.kept else None


class Deadlines:
    """Whom a node has to resume when, by one timer. Timers that come and go make rclpy look
    through all that a process has, and it warns on the terminal of more than a few at once.

    by_hand: there is no timer, and `resume` is called after each turn of the executor: that of a
    node which has other things to do between two turns would call the timer more often each time.
    """

    def __init__(self, node: Node, by_hand: bool = False):
        self._waiting: list[tuple[float, int, Promise]] = []
        self._numbers = count()
        self._timer = None if by_hand else node.create_timer(NEVER, self.resume, clock=WAITS)
        _DEADLINES[node] = self

    def keep_after(self, seconds: float, promise: Promise) -> None:
        """Keep a promise when so much time has passed, unless it is kept by then."""
        heapq.heappush(self._waiting, (time.monotonic() + seconds, next(self._numbers), promise))
        self._set()

    @property
    def left(self) -> float:
        """Time until the next one [s]."""
        return self._waiting[0][0] - time.monotonic() if self._waiting else NEVER

    def resume(self) -> None:
        """Keep the promises whose time has come."""
        now = time.monotonic()
        while self._waiting and (self._waiting[0][0] <= now or self._waiting[0][2].kept):
            heapq.heappop(self._waiting)[2].keep()
        self._set()

    def _set(self) -> None:
        if self._timer is not None:
            self._timer.timer_period_ns = max(1, round(1e9 * self.left))
            self._timer.reset()


_DEADLINES: WeakKeyDictionary[Node, Deadlines] = WeakKeyDictionary()


async def _kept_or_over(node: Node, promise: Promise, seconds: float) -> None:
    deadlines, either = _DEADLINES.get(node) or Deadlines(node), Promise()
    promise.when_kept(either.keep)
    deadlines.keep_after(seconds, either)
    await either


async def pause(node: Node, seconds: float) -> None:
    """Wait [s, wall clock]."""
    await within(node, Promise(), seconds)


async def in_thread(node: Node, work: Callable, *arguments):
    """Value of a function that computes for longer than the node's loop may stand still, or the
    exception that it ends with.
    """
    value, error = [], []

    def compute() -> None:
        try:
            value.append(work(*arguments))
        except Exception as raised:  # whatever it is, who waits gets it
            error.append(raised)

    thread = Thread(target=compute, daemon=True)
    thread.start()
    while thread.is_alive():
        await pause(node, LOOKED_AFTER)
    if error:
        raise error[0]
    return value[0]


async def answer(node: Node, client, request, limit: float, *needed: Presence):
    """Response of a service; None if there is none within the limit [s, wall clock], or as soon as
    one that is needed for it has gone.
    """
    promise = Promise()
    client.call_async(request).add_done_callback(lambda done: promise.keep(done.result()))
    return await within(node, promise, limit, *needed)


def finish(goal_handle: ServerGoalHandle, succeeded: bool) -> None:
    """Set the final state of a goal: canceled if that was asked for, else by its success."""
    if goal_handle.is_cancel_requested:
        goal_handle.canceled()
    elif succeeded:
        goal_handle.succeed()
    else:
        goal_handle.abort()


def finish_by_success(goal_handle: ServerGoalHandle, result) -> None:
    """Finish a goal whose result says whether it is a success."""
    finish(goal_handle, result.success)


def say_why_it_ended(node: Node, goal_handle: ServerGoalHandle, text: str) -> None:
    """Log why a goal was not reached: an error, unless its client wanted that."""
    if goal_handle.is_cancel_requested:
        node.get_logger().info(text)
    else:
        node.get_logger().error(text)


class CoroutineActionServer(ActionServer):
    """An action server whose goals are executed as routines.

    routine: coroutine function of the goal handle, returns the action's result; finish: sets the
    goal's final state by it.
    """

    def __init__(self, node: Node, action_type, name: str, routine, finish, **options):
        services = ("goal_service", "cancel_service", "result_service")
        depths = {f"{service}_qos_profile": CALLS for service in services}
        super().__init__(
            node,
            action_type,
            name,
            self._not_used,
            result_timeout=RESULT_KEPT,
            **depths,
            **options,
        )
        self._own_node, self._routine, self._finish = node, routine, finish

    def notify_execute(self, goal_handle: ServerGoalHandle, execute_callback) -> None:
        """Called by rclpy when a goal begins to be executed."""

        def ended(result, error) -> None:
            def hand_over(handle):
                if error is not None:
                    raise error
                self._finish(handle, result)
                return result

            super(CoroutineActionServer, self).notify_execute(goal_handle, hand_over)

        start(self._own_node, self._routine(goal_handle), ended)

    def _not_used(self, goal_handle):
        raise NotImplementedError("goals run as routines")
