"""Figure `synchronisation`: speed of the hand in all demonstrations before and after
synchronisation, as thesis figure 8.11.

Left, the recordings as they are, each on the clock since its first pose: the teacher turns the
arm, pauses, throws. Right, the motion between the velocity thresholds (8.4.3), all demonstrations
aligned on the release of the ball.

`HandRecording` is what was seen of one throw, guided or made by the arm itself, from one reset of
the world to the next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from dart_skill.arm import the_arm
from dart_skill.figures._style import (
    BLACK,
    FEW_LEVELS,
    GREY,
    colour_bar,
    house_style,
    legend_below,
    letter_panels,
    panels,
    quantity_colours,
)
from dart_skill.recording import Demonstration
from dart_skill.skills.observation import THRESHOLDS, fit_release

SAME_BASKET = 0.02
"""A recording belongs to a plan if its basket stood this near to the plan's target [m]."""


@dataclass(frozen=True, eq=False)
class HandRecording:
    """Everything as it was recorded, in the frame of the world. Stamps are integer nanoseconds and
    increase.

    Parameters
    ----------
    hand_stamps, hand_position
        (n,) [ns] and (n, 3) [m].
    ball_stamps, ball_position
        (m,) [ns] and (m, 3) [m].
    basket
        Centre of the rim (3,) [m], the median of what was seen, nan if it was not seen.
    command_stamps
        Of the controller's commands (k,) [ns].
    opened_ns
        Stamp of the one that told the hand to open [ns], None if none did.
    """

    hand_stamps: np.ndarray
    hand_position: np.ndarray
    ball_stamps: np.ndarray
    ball_position: np.ndarray
    basket: np.ndarray
    command_stamps: np.ndarray
    opened_ns: int | None

    @property
    def start_ns(self) -> int:
        """Stamp of the first pose of the hand."""
        return int(self.hand_stamps[0])

    @property
    def stop_ns(self) -> int:
        """Stamp of the last pose of the hand."""
        return int(self.hand_stamps[-1])


EVENTS = {
    "motion_start": ("o", "motion starts"),
    "release": ("D", "release"),
    "motion_stop": ("s", "motion stops"),
}


@dataclass(frozen=True, eq=False)
class DemonstratedMotion:
    """Speed of the hand in the recording of one demonstration.

    Parameters
    ----------
    name
        Of the demonstration.
    distance
        Of the basket from the base axis [m].
    time
        Since the first pose of the recording (n,) [s].
    speed
        (n,) [m/s].
    first, last
        Times between which the demonstration was cut out [s].
    motion_start, release, motion_stop
        On the same clock [s].
    """

    name: str
    distance: float
    time: np.ndarray
    speed: np.ndarray
    first: float
    last: float
    motion_start: float
    release: float
    motion_stop: float


def demonstrated_motions(
    recordings: Sequence[HandRecording], demonstrations: Sequence[Demonstration]
) -> list[DemonstratedMotion]:
    """The motion of each demonstration in the recording that it was cut from.

    Raises
    ------
    ValueError
        Names one that no recording holds.
    """
    return [_motion(recordings, demonstration) for demonstration in demonstrations]


@house_style()
def synchronisation_figure(motions: Sequence[DemonstratedMotion], narrow: bool = False) -> Figure:
    """The figure.

    Parameters
    ----------
    motions
        Of the demonstrations.
    narrow
        Its panels stand one below the other.

    Raises
    ------
    ValueError
        If there are none.
    """
    if not motions:
        raise ValueError("no demonstrations: the figure of the synchronisation needs at least one")
    distances = [motion.distance for motion in motions]
    shades = ScalarMappable(
        Normalize(min(distances) - 1e-6, max(distances) + 1e-6), quantity_colours(FEW_LEVELS)
    )
    figure, (before, after) = panels([(5.25, 4.4), (5.25, 4.4)], narrow, sharey=True)
    for number, motion in enumerate(motions, start=1):
        colour = shades.to_rgba(np.asarray(motion.distance))
        kept = (motion.time >= motion.first) & (motion.time <= motion.last)
        _curve(before, motion, np.ones(len(kept), dtype=bool), 0.0, f"before_{number}", colour)
        _curve(after, motion, kept, motion.release, f"after_{number}", colour)
    _describe(before, motions, False)
    _describe(after, motions, True)
    for axes in (before, after) if narrow else (before,):
        axes.set_ylabel("speed of the hand [m/s]")
    letter_panels(before, after)
    colour_bar(figure, shades, "distance of the basket [m]", narrow)
    handles, labels = before.get_legend_handles_labels()
    legend_below(figure, handles, labels, len(labels), narrow)
    return figure


def _motion(recordings: Sequence[HandRecording], d: Demonstration) -> DemonstratedMotion:
    own = (one for one in recordings if one.start_ns <= d.stamp_ns <= one.stop_ns)
    recording = next(own, None)
    if recording is None:
        raise ValueError(
            f"demonstration {d.id} starts at {d.stamp_ns} ns, where the bag holds no poses of the"
            " hand"
        )
    time = (recording.hand_stamps - recording.start_ns) * 1e-9
    origin = (d.stamp_ns - recording.start_ns) * 1e-9
    release = fit_release(
        d.moved.time,
        d.moved.position,
        d.hand_time,
        d.hand_position,
        d.hand_quaternion,
        the_arm().hand.ball_centre,
    )
    return DemonstratedMotion(
        name=d.id,
        distance=float(np.hypot(d.target[0], d.target[1])),
        time=time,
        speed=THRESHOLDS.speeds(time, recording.hand_position),
        first=origin + float(d.hand_time[0]),
        last=origin + float(d.hand_time[-1]),
        motion_start=origin + d.motion_start,
        release=origin + release.time,
        motion_stop=origin + d.motion_stop,
    )


def _curve(
    axes: Axes, motion: DemonstratedMotion, kept: np.ndarray, origin: float, gid: str, colour: Any
) -> None:
    axes.plot(
        motion.time[kept] - origin,
        motion.speed[kept],
        color=colour,
        linewidth=1.1,
        gid=f"{gid}_curve",
    )
    for event, (marker, _) in EVENTS.items():
        instant = getattr(motion, event)
        place = (instant - origin, np.interp(instant, motion.time, motion.speed))
        axes.plot(
            *place,
            marker,
            color=colour,
            markeredgecolor=BLACK,
            markersize=5,
            markeredgewidth=0.7,
            gid=f"{gid}_{event}",
        )


def _describe(axes: Axes, motions: Sequence[DemonstratedMotion], aligned: bool) -> None:
    for marker, name in EVENTS.values():
        axes.plot([], [], marker, color="white", markeredgecolor=BLACK, markersize=5.5, label=name)
    axes.axhline(
        THRESHOLDS.start,
        color=BLACK,
        linestyle="--",
        linewidth=1.0,
        label=f"start threshold, {THRESHOLDS.start:g} m/s",
    )
    axes.axhline(
        THRESHOLDS.stop,
        color=GREY,
        linestyle=":",
        linewidth=1.3,
        label=f"stop threshold, {THRESHOLDS.stop:g} m/s",
    )
    starts = np.array(
        [motion.motion_start - (motion.release if aligned else 0.0) for motion in motions]
    )
    spread = f" ± {starts.std(ddof=1):.3f} s (mean ± s.d.)" if len(starts) > 1 else " s"
    mean = f"{starts.mean():.3f}".replace("-", "\N{MINUS SIGN}")
    axes.set(
        title=(
            f"{'After' if aligned else 'Before'} synchronisation, n = {len(motions)}\n"
            f"motion starts at {mean}{spread}"
        ),
        xlabel=f"time since the {'release' if aligned else 'start of the recording'} [s]",
        ylim=(0.0, None),
    )
