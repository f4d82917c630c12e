"""Who publishes what, how often, with which stamps, in which frame."""

from __future__ import annotations

import numpy as np

from dart_skill.arm.check._heard import (
    Grade,
    Heard,
    HeardPoses,
    HeardTopic,
    Line,
    graded,
    line,
    worst,
)

TOLERANCE = 0.05
"""Deviation of a rate that is good, as a share of it."""
BEARABLE = 0.25
"""Deviation of a rate above which nothing may move, as a share of it."""
OLD = 0.010
"""Age of a joint state at its receipt that is good [s]."""
TOO_OLD = 0.100
"""Age of a joint state above which nothing may move [s]."""
FUTURE = -0.005
"""Age below which the clocks of two machines disagree [s]."""
LATE = 0.030
"""Age of a pose at its receipt that is good: the cameras' software needs time [s]."""
TOO_LATE = 0.100
"""Age of a pose above which nothing may move [s]."""
AT_RECEIPT = 0.0003
"""Poses that are younger than this were stamped when they came, not when the cameras saw them [s].
"""
ONE_BASE = 0.2
"""Ages of joints and poses that differ by more are ages on two clocks [s]."""


def silent_line(stream: HeardTopic) -> Line:
    """Nothing came of a topic: all that is to be said of it."""
    names = ", ".join(one.node for one in stream.publishers)
    measured = f"no message, though {names} publishes it" if names else "nobody publishes it"
    if not isinstance(stream, HeardPoses):
        remedy = "look at the arm's driver" if names else "start the arm's driver"
    else:
        remedy = "is the body switched on and named as in config/world.yaml? are its markers seen?"
    if not names:
        others = ", or look at" if remedy.startswith("start") else " else look at"
        remedy += f"{others} ROS_DOMAIN_ID and the topic's name (--remap)"
    return line(stream.topic, Grade.NO_GO, measured, "messages", remedy)


def publisher_line(stream: HeardTopic) -> Line:
    """Exactly one publisher, of a topic that was heard."""
    names = [one.node for one in stream.publishers]
    remedy = (
        f"end all but one of {', '.join(names)}"
        if len(names) > 1
        else "its publisher has ended: look at its driver"
    )
    verdict = Grade.GO if len(names) == 1 else Grade.NO_GO
    return line(
        f"{stream.topic}: publisher", verdict, ", ".join(names) or "none", "exactly one", remedy
    )


def quality_line(stream: HeardTopic, better_reliable: bool) -> Line:
    """What the publishers offer; nodes hear either, but of a stream that has to be answered each
    message counts.
    """
    offered = sorted({one.reliability for one in stream.publishers})
    asked = "reliable" if better_reliable else "reliable or best_effort"
    remedy = (
        "publish it with reliable QoS: a state that is lost is answered by no command"
        if offered
        else "look at the driver"
    )
    worse = better_reliable and "best_effort" in offered
    verdict = Grade.NO_GO if not offered else Grade.WARN if worse else Grade.GO
    return line(
        f"{stream.topic}: QoS", verdict, ", ".join(offered) or "nothing offered", asked, remedy
    )


def rate_line(
    stream: HeardTopic, rate: float, longest_gap: float | None, lowest: float | None = None
) -> Line:
    """How often it comes, by its stamps, and the longest gap.

    Parameters
    ----------
    longest_gap
        None if a gap is no fault, as of a body that is hidden [s].
    lowest
        Rate that still worked [Hz]; None: one that is lower by BEARABLE.
    """
    asked = f"{rate:g} Hz" + (f", no gap of {longest_gap:g} s" if longest_gap else "")
    if len(stream) < 3:
        return line(
            f"{stream.topic}: rate",
            Grade.NO_GO,
            f"{len(stream)} messages",
            asked,
            "nothing comes: look at the driver",
        )
    steps = np.diff(stream.stamp_ns[stream.forward]) * 1e-9
    if not len(steps):
        return line(
            f"{stream.topic}: rate",
            Grade.NO_GO,
            "stamps stand still",
            asked,
            "stamp each message when it was measured",
        )
    found, gap = 1.0 / float(np.median(steps)), float(steps.max())
    lowest = (1.0 - BEARABLE) * rate if lowest is None else (1.0 - TOLERANCE) * lowest
    bearable = BEARABLE if found > rate else 1.0 - lowest / rate
    verdict = graded(abs(found / rate - 1.0), TOLERANCE, bearable)
    if longest_gap:
        verdict = worst(verdict, graded(gap, 0.5 * longest_gap, longest_gap))
    remedy = (
        "set the driver's rate; look for load on its machine and for lost packets on the network"
    )
    return line(
        f"{stream.topic}: rate",
        verdict,
        f"{found:.1f} Hz, longest gap {1e3 * gap:.0f} ms",
        asked,
        remedy,
    )


def stamps_line(stream: HeardTopic, simulated: bool) -> Line:
    """Whether stamps are there, increase, and are of the clock that the nodes use."""
    clock = "/clock" if simulated else "wall clock"
    old, too_old = (LATE, TOO_LATE) if isinstance(stream, HeardPoses) else (OLD, TOO_OLD)
    check, asked = (
        f"{stream.topic}: stamps",
        f"increasing; at most {1e3 * old:.0f} ms old by the {clock}",
    )
    if not len(stream):
        return line(check, Grade.NO_GO, "no message", asked, "nothing comes: look at the driver")
    n_zero, n_back = int(np.sum(stream.stamp_ns == 0)), int(np.sum(~stream.forward))
    # a simulator that waits for an answer says its state again, and one that is reset may begin
    # anew
    if simulated:
        n_back = 0
    if n_zero:
        return line(
            check,
            Grade.NO_GO,
            f"{n_zero} of {len(stream)} are zero",
            asked,
            "the driver must stamp what it publishes",
        )
    middle, late = float(np.median(stream.age)), float(np.quantile(stream.age, 0.95))
    measured = f"{1e3 * middle:.1f} ms old, 95 % below {1e3 * late:.1f} ms"
    if abs(middle) > 1.0:
        measured = f"{middle:.1f} s {'old' if middle > 0 else 'ahead'}"
    if n_back:
        return line(
            check,
            Grade.NO_GO,
            f"{n_back} of {len(stream)} do not increase",
            asked,
            "stamp each message once, when it was measured",
        )
    verdict = graded(late, old, too_old)
    if simulated and verdict is Grade.NO_GO:
        # in a simulation that runs as fast as it can, ages tell how busy the machine is
        verdict = Grade.WARN
    remedy = (
        f"the driver's clock and the {clock} of this machine differ, or messages wait: chrony on"
        " all machines (docs/machines.md)"
    )
    if middle < FUTURE:
        verdict = Grade.WARN if simulated else Grade.NO_GO
    elif (
        isinstance(stream, HeardPoses)
        and not simulated
        and abs(middle) < AT_RECEIPT
        and verdict is Grade.GO
    ):
        verdict = Grade.WARN
        remedy = (
            "they look like stamps of the receipt: set use_vrpn_timestamps, a release is judged to"
            " milliseconds"
        )
    return line(check, verdict, measured, asked, remedy)


def time_base_line(heard: Heard) -> Line:
    """Joints and cameras stamp on one time base."""
    asked = f"ages of joints and poses within {1e3 * ONE_BASE:.0f} ms"
    streams = [stream for stream in heard.poses.values() if len(stream)]
    if not len(heard.joints) or not streams:
        return line("time base", Grade.NO_GO, "joints or cameras are silent", asked, "start both")
    joints = float(np.median(heard.joints.age))
    apart = max((float(np.median(stream.age)) - joints for stream in streams), key=abs)
    remedy = (
        "one of the two machines has another time: chrony on both; with vrpn_mocap look at"
        " use_vrpn_timestamps"
    )
    measured = f"{1e3 * apart:.1f} ms apart" if abs(apart) < 1.0 else f"{apart:.1f} s apart"
    verdict = graded(abs(apart), ONE_BASE, ONE_BASE)
    return line(
        "time base",
        Grade.WARN if heard.simulated and verdict is Grade.NO_GO else verdict,
        measured,
        asked,
        remedy,
    )


def frame_line(stream: HeardPoses, frame: str) -> Line:
    """Poses are in the frame of the world, and are poses."""
    check, asked = f"{stream.topic}: frame", f"'{frame}', metres, unit quaternions"
    if not len(stream):
        return line(
            check,
            Grade.NO_GO,
            "no message",
            asked,
            "nothing comes: look at the cameras' software",
        )
    if stream.frames != (frame,):
        named = ", ".join(f"'{one}'" for one in stream.frames)
        return line(
            check,
            Grade.NO_GO,
            named,
            asked,
            f"set the driver's frame_id, or frame_id of config/world.yaml, to '{frame}'",
        )
    finite = np.isfinite(stream.position).all() and np.isfinite(stream.quaternion).all()
    far = float(np.abs(stream.position).max()) if finite else float("nan")
    if not finite or far > 50.0:
        measured = f"{far:.0f} m from the origin" if finite else "numbers that are not finite"
        return line(
            check,
            Grade.NO_GO,
            measured,
            asked,
            "the driver must give metres (Motive: millimetres are a setting of the stream)",
        )
    off = float(np.abs(np.linalg.norm(stream.quaternion, axis=1) - 1.0).max())
    measured = f"'{frame}', norms of quaternions off by {off:.3f}"
    return line(
        check,
        graded(off, 1e-3, 1e-2),
        measured,
        asked,
        "the order of a quaternion is x, y, z, w, its norm 1: look at the driver",
    )


def command_line(heard: Heard) -> Line:
    """One commander at most, and a driver that carries its commands out."""
    commanders, drivers = (
        [one.node for one in side] for side in (heard.commanders, heard.drivers)
    )
    measured = f"from {', '.join(commanders) or 'none'} to {', '.join(drivers) or 'none'}"
    remedy = f"end all but one of {', '.join(commanders)}"
    verdict = Grade.NO_GO if len(commanders) > 1 else Grade.GO
    if len(commanders) <= 1 and not (commanders and drivers):
        verdict, remedy = (
            Grade.WARN,
            (
                "start the layout hardware (dart-skill up --layout hardware) and the arm's driver"
                " or bridge"
            ),
        )
    return line(
        "/wam/command", verdict, measured, "one commander, and a driver that listens", remedy
    )
