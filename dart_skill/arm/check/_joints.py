"""The joints: names, range, units, and whether speeds are those of the positions; and the different
postures that a person leads the arm through.
"""

from __future__ import annotations

import numpy as np

from dart_skill.arm import ArmDescription
from dart_skill.arm.check._heard import Grade, HeardJoints, Line, line
from dart_skill.common.world import joint_order

SLOW = 0.05
"""A joint that was never faster says nothing of its speeds [rad/s]."""
FASTEST = 100.0
"""Nor does one that jumped: time was lost there [rad/s]."""
SHARE = 0.25
"""So far the slope of speeds over differences of positions may be from one."""
WINDOW = 0.02
"""Over which positions are differenced [s]."""
NEAR_END = 0.05
"""A joint that was nearer to its end is warned of [rad]."""

REST = 0.05
"""Joint speed below which an arm rests [rad/s]."""
RESTING = 0.3
"""Time that it has to rest, to be in a posture [s]."""
NEW = 0.2
"""A posture is new if a joint is so far from where it was in all others [rad]."""


def joint_lines(stream: HeardJoints, description: ArmDescription, overrun: float) -> list[Line]:
    """Names, positions, velocities.

    Parameters
    ----------
    overrun
        So far beyond its end a joint may be [rad]: as far as the commander lets it be.
    """
    return [
        _names(stream, description),
        _positions(stream, description, overrun),
        _velocities(stream, description),
    ]


def _names(stream: HeardJoints, description: ArmDescription) -> Line:
    wanted = tuple(joint.name for joint in description.joints)
    asked = f"{wanted[0]} to {wanted[-1]}, each once"
    if not stream.orders:
        return line(
            "joint names",
            Grade.NO_GO,
            "no message",
            asked,
            "nothing comes: look at the arm's driver",
        )
    for names in stream.orders:
        try:
            joint_order(names)
        except ValueError as error:
            what, _, remedy = str(error).partition(": ")
            return line("joint names", Grade.NO_GO, what, asked, remedy)
    if stream.n_odd:
        measured = f"{stream.n_odd} messages with another number of joints"
        return line(
            "joint names",
            Grade.NO_GO,
            measured,
            asked,
            "the hand's joints go on a topic of their own, or always with the arm's",
        )
    return line("joint names", Grade.GO, ", ".join(stream.orders[0]), asked)


def _positions(stream: HeardJoints, description: ArmDescription, overrun: float) -> Line:
    lower, upper = description.ends
    asked = "within the joints' range, radians"
    q = stream.position
    if q.shape[1:] != (len(lower),) or not len(q):
        return line("joint positions", Grade.NO_GO, "not seven joints", asked, "see joint names")
    if not np.isfinite(q).all():
        return line(
            "joint positions",
            Grade.NO_GO,
            "numbers that are not finite",
            asked,
            "look at the driver",
        )
    beyond = np.maximum(q - upper, lower - q).max(axis=0)
    j = int(beyond.argmax())
    name = description.joints[j].name
    if beyond[j] <= overrun:
        near = (
            f"beyond its end: {name}, by {beyond[j]:.3f} rad"
            if beyond[j] > 0.0
            else f"nearest to an end: {name}, {-beyond[j]:.2f} rad"
        )
        tight = Grade.WARN if -beyond[j] < NEAR_END else Grade.GO
        return line(
            "joint positions",
            tight,
            near,
            asked,
            f"lead {name} away from its end: the commander stops throws there",
        )
    worst = q[np.maximum(q[:, j] - upper[j], lower[j] - q[:, j]).argmax(), j]
    measured = f"{name} at {worst:.2f}, range {lower[j]} to {upper[j]} rad"
    # Radians of an arm that is a little over its end are near it; degrees are not.
    if beyond[j] > 1.0 and np.abs(np.deg2rad(worst)) < np.pi:
        return line(
            "joint positions",
            Grade.NO_GO,
            measured,
            asked,
            "these look like degrees: the driver must give radians",
        )
    return line(
        "joint positions",
        Grade.NO_GO,
        measured,
        asked,
        "calibrate the arm's zero (all zero is straight up), or correct config/wam.yaml",
    )


def _velocities(stream: HeardJoints, description: ArmDescription) -> Line:
    asked = "those of the positions, rad/s"
    if stream.position.shape[1:] != (len(description.joints),):
        return line("joint velocities", Grade.NO_GO, "not seven joints", asked, "see joint names")
    if not len(stream) or stream.velocity.shape != stream.position.shape:
        return line(
            "joint velocities",
            Grade.NO_GO,
            "none",
            asked,
            "the commander needs them: let the driver give them",
        )
    if not np.isfinite(stream.velocity).all():
        return line(
            "joint velocities",
            Grade.NO_GO,
            "numbers that are not finite",
            asked,
            "look at the driver",
        )
    slopes, still = _slopes(stream)
    wrong = [
        j for j, slope in enumerate(slopes) if np.isfinite(slope) and abs(slope - 1.0) > SHARE
    ]
    if wrong:
        told = ", ".join(f"{description.joints[j].name} {slopes[j]:.2f} times" for j in wrong)
        return line(
            "joint velocities", Grade.NO_GO, told, asked, _cause([slopes[j] for j in wrong])
        )
    if still:
        told = ", ".join(description.joints[j].name for j in still)
        return line(
            "joint velocities",
            Grade.WARN,
            f"right, but {told} never moved",
            asked,
            f"move {told} by hand, and check again",
        )
    return line(
        "joint velocities",
        Grade.GO,
        f"{min(slopes):.2f} to {max(slopes):.2f} times the differences",
        asked,
    )


def _slopes(stream: HeardJoints) -> tuple[list[float], list[int]]:
    """Speeds over differences of positions for each joint, nan for one that hardly moved; and
    which did.
    """
    forward = stream.forward
    time, q, qd = (
        values[forward]
        for values in (
            (stream.stamp_ns - stream.stamp_ns[0]) * 1e-9,
            stream.position,
            stream.velocity,
        )
    )
    slopes, still = [], []
    for j in range(q.shape[1]):
        moved = speeds_of(time, q[:, j : j + 1], time)[:, 0]
        fast = (np.abs(moved) > SLOW) & (np.abs(moved) < FASTEST)
        if np.count_nonzero(fast) < 20:
            slopes.append(float("nan"))
            still.append(j)
        else:
            slopes.append(float(moved[fast] @ qd[fast, j] / (moved[fast] @ moved[fast])))
    return slopes, still


def speeds_of(time: np.ndarray, q: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Speeds (m, k) at instants (m,) by differences of positions (n, k) at times (n,) [s]."""
    after, before = (
        np.column_stack([np.interp(at + half, time, column) for column in q.T])
        for half in (WINDOW / 2, -WINDOW / 2)
    )
    return (after - before) / WINDOW


def _cause(slopes: list[float]) -> str:
    """What makes speeds so many times too large."""
    if all(abs(slope + 1.0) < SHARE for slope in slopes):
        return "their sign is turned: a joint and its speed count in the same direction"
    if all(abs(slope / np.rad2deg(1.0) - 1.0) < SHARE for slope in slopes):
        return "these look like degrees per second: the driver must give rad/s"
    if all(abs(slope * np.rad2deg(1.0) - 1.0) < SHARE for slope in slopes):
        return "positions look like degrees, velocities like rad/s: the driver must give radians"
    return "speeds are not those of the positions: look at units, order and filter of the driver"


class PostureCounter:
    """Counts the different postures in which an arm rested."""

    def __init__(self) -> None:
        self._found: list[np.ndarray] = []
        self._last: tuple[float, np.ndarray] | None = None
        self._since: float | None = None

    def __len__(self) -> int:
        return len(self._found)

    def add(self, time: float, position: np.ndarray) -> bool:
        """Take the joints (n,) [rad] at an instant [s].

        Returns
        -------
        bool
            Whether that makes a new posture.
        """
        last = self._last
        self._last = (time, position)
        if last is None or not time > last[0]:
            self._since = time
            return False
        if np.abs(position - last[1]).max() > REST * (time - last[0]):
            self._since = time
        if (
            self._since is None
            or time - self._since < RESTING
            or any(np.abs(position - one).max() < NEW for one in self._found)
        ):
            return False
        self._found.append(position.copy())
        return True
