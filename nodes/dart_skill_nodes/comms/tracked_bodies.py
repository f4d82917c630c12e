"""Bodies as the motion capture sees them: a log of their poses, and up to which stamp everything
has arrived.
"""

import math
import time
from collections import deque
from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import PoseStamped

from dart_skill.common.checks import as_place
from dart_skill.common.constants import UNTURNED
from dart_skill.skills.observation import MEMORY_NS, RESET_NS, SensorLog, ThrowLog
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.fixed_layout import LayoutReader

FRAME_NS = 10_000_000
"""Between two frames of the cameras."""
SILENCE = 5.0
"""A sensor that is silent for longer sees nothing: what is lost on the way is repeated within 3 s
[s, wall clock].
"""
NO_TURN = np.array(UNTURNED)
LAG_NS = 250_000_000
"""A body that was not seen for so long may be hidden, or its poses are still on their way."""
REPAIRED = 4.0
"""By then poses that got lost on the way have come: Fast DDS repeats them within 3 s [s, wall
clock].
"""


class Arrivals:
    """Up to which stamp everything has come: as far as the sensor that is farthest behind, or as
    far as all were long enough ago.
    """

    def __init__(self):
        self._past: deque[tuple[float, int]] = deque()
        self._sure_ns = 0

    def until(self, newest_ns: list[int], now: float) -> int:
        """That stamp [ns], of the newest one of each sensor, at an instant of the wall clock [s]."""
        self._past.append((now, max(newest_ns) - FRAME_NS))
        while self._past[0][0] <= now - SILENCE:
            self._sure_ns = self._past.popleft()[1]
        return max(self._sure_ns, min(newest_ns))


def _sample(role: str, pose: np.ndarray, turned: bool) -> tuple[np.ndarray, np.ndarray]:
    """What is kept of a pose (7,): position (3,) and quaternion (4,); of a body whose turn does
    not count, any quaternion.
    """
    position = as_place(pose[:3], f"the {role}")
    return position, conversions.as_unit_quaternion(pose[3:], f"the {role}") if turned else NO_TURN


class TrackedBodies:
    """Keeps a log of the poses of tracked bodies.

    frame_id: poses in another frame are ignored, and `complain` is called with the reason, once.
    clock: of the wall [s]. log: that is kept, of a throw by default.
    """

    def __init__(
        self,
        frame_id: str,
        complain: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
        log: SensorLog | None = None,
    ):
        self._clock = clock
        self._readers: dict[str, LayoutReader] = {}  # by role
        # by role, since when poses of others come that are newer than its own by LAG_NS
        self._behind: dict[str, float] = {}
        self.log, self._newest_of, self._forgotten_ns = ThrowLog() if log is None else log, {}, 0
        # by role, up to where poses are waited for, and since when on the wall clock
        self._awaited: dict[str, tuple[int, float]] = {}
        self._frame_id, self._complain, self._wrong_frame = frame_id, complain, ""

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest pose, 0 without one."""
        return max(self._newest_of.values(), default=0)

    def clear(self) -> None:
        """Forget what was seen; a new recording begins."""
        self.log.clear()

    def has_frames_until(self, ns: int) -> bool:
        """Whether the frames up to a stamp have come: a pose of a later one has."""
        return self.newest_ns >= ns + FRAME_NS

    def is_late(self, role: str, ns: int) -> bool:
        """Whether poses of a body up to a stamp may still come.

        They may lag behind those of the others by seconds, where some were lost on the way: each
        body has a topic of its own. A body that lags behind them, or is waited for, for longer
        than REPAIRED is hidden, as a ball in its basket may be; one that was never seen is not
        late.
        """
        if role not in self._newest_of or self._newest_of[role] >= ns - LAG_NS:
            return False
        awaited, since = self._awaited.get(role, (0, 0.0))
        now = self._clock()
        if awaited != ns:
            self._awaited[role] = awaited, since = ns, now
        return now - min(since, self._behind.get(role, since)) <= REPAIRED

    def hidden(self, role: str) -> str:
        """What to say of a body that others were seen without for longer than a loss takes to be
        repaired; empty if it may be seen.
        """
        unseen = self._clock() - self._behind.get(role, math.inf)
        if unseen <= REPAIRED:
            return ""
        return (
            f"the cameras have seen others without the {role} for {unseen:.0f} s: is it hidden, or"
            " its marker off?"
        )

    @property
    def farthest_behind(self) -> tuple[str, int]:
        """Role of the body whose poses are farthest behind, and the stamp of its newest [ns]; no
        role without a pose.
        """
        return min(self._newest_of.items(), key=lambda one: one[1], default=("", 0))

    def take(self, role: str, data: bytes) -> None:
        """A pose of a body, serialised; ValueError, and nothing has changed, for what is no pose
        of this world.
        """
        like, ns, numbers = self._readers.setdefault(role, LayoutReader(PoseStamped)).read(data)
        if like.header.frame_id != self._frame_id:
            if not self._wrong_frame:
                self._complain(
                    f"{role} poses are in '{like.header.frame_id}', not '{self._frame_id}':"
                    " ignored"
                )
            self._wrong_frame = like.header.frame_id
            return
        sample = _sample(role, numbers, role in self.log.turned)
        newest = self._newest_of.get(role, 0)
        # the clock was set back: another simulator, or a bag that is played again
        if ns < newest - RESET_NS:
            self.log.clear()
            self._newest_of = {}
            self._behind = {}
            self._forgotten_ns = 0
            newest = 0
        self.log.take(role, ns, *sample)
        self._newest_of[role] = max(newest, ns)
        self._note_who_lags(role, ns)

    def _note_who_lags(self, role: str, ns: int) -> None:
        self._behind.pop(role, None)
        for other, newest in self._newest_of.items():
            if newest < ns - LAG_NS and other not in self._behind:
                self._behind[other] = self._clock()

    def forget_old(self) -> None:
        """Forget what is older than MEMORY_NS, unless a throw is being recorded."""
        if self.newest_ns - self._forgotten_ns > 2 * MEMORY_NS:
            self._forgotten_ns = self.newest_ns - MEMORY_NS
            self.log.forget_before(self._forgotten_ns)

    def remembers(self, ns: int) -> bool:
        """Whether what was seen at a stamp has not been forgotten."""
        return ns >= self._forgotten_ns
