"""A replay of throws in three dimensions that needs no server: a viser scene with a timeline, as
one HTML text.

Every throw begins with the arm at the start of its motion and ends when the ball has been watched;
the next one follows.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.recording import Demonstration
from dart_skill.recording.imports import PoseStream, ThrowRecording
from dart_skill.skills.observation import FoundThrow

if TYPE_CHECKING:
    from dart_skill.view import Scene

FRAME = 0.04
"""Time of a picture of the replay [s]."""
LEAD, FOLLOWED, PAUSE = 0.2, 0.9, 0.6
"""Shown before the motion starts and after the hand was told to open, and the time that the last
picture of a throw stands [s].
"""
MOST_THROWS = 60
"""More of them make the page large; 10 kB each."""
EYE, LOOK_AT, ABOVE = (1.9, -4.6, 2.0), (1.1, 0.0, 1.15), (0.0, 0.0, 2.45)
"""Where the page looks from and to at first, and where it says which throw is shown [m]."""
Ellipsoid = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Centre (3,), quaternion (4,) and diameters (3,), as `component_ellipsoids` gives them."""
LOST = 50_000_000
"""A sample further away than this from an instant does not stand for it [ns]."""


@dataclass(frozen=True)
class Replay:
    """html: a page of its own; starts: when each throw begins on its timeline [s], by index of the
    throw; seconds: its length.
    """

    html: str
    starts: dict[int, float]
    seconds: float


def make_replay(
    recording: ThrowRecording,
    throws: Sequence[FoundThrow],
    shown: Sequence[Demonstration],
    gaussians: Mapping[int, Sequence[Ellipsoid]] | None = None,
    names: Mapping[int, str] | None = None,
) -> Replay:
    """The first throws of a recording, the arm where it was recorded, with the demonstrations that
    taught it.

    names: what throws are called, by their index; "throw 1", "throw 2", ... by default. gaussians:
    those that are shown with throws, by their index. ViewUnavailable without viser.
    """
    from dart_skill.view import Scene, open_server

    server = open_server()
    try:
        scene = Scene(server)
        server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK_AT
        scene.show_demonstrations(shown)
        label = server.scene.add_label("/throw", "", position=ABOVE, anchor="bottom-center")
        serializer = server.get_scene_serializer()
        starts: dict[int, float] = {}
        seconds = 0.0
        with server.atomic():  # or each change wakes a thread that has nobody to send it to
            for number in in_replay(throws):
                throw = throws[number]
                starts[number] = seconds
                label.text = name = (names or {}).get(number, f"throw {number + 1}")
                _show_gaussians(scene, (gaussians or {}).get(number, ()))
                result = in_a_line(name, throw)
                seconds += play(
                    scene,
                    serializer,
                    recording,
                    throw,
                    when_down=partial(setattr, label, "text", result),
                )
        return Replay(serializer.as_html(), starts, seconds)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):  # viser says that it stopped
            server.stop()


def in_replay(throws: Sequence[FoundThrow]) -> list[int]:
    """Indices of the throws that are shown: the first of those that were cut."""
    return [number for number, throw in enumerate(throws) if throw.demonstration is not None][
        :MOST_THROWS
    ]


def _show_gaussians(scene: Scene, ellipsoids: Sequence[Ellipsoid]) -> None:
    """Instead of those that were shown."""
    if ellipsoids:
        scene.show_gaussians("gaussians", *map(np.array, zip(*ellipsoids, strict=True)))
    else:
        scene.hide_gaussians(scene.gaussian_colours)


def in_a_line(name: str, throw: FoundThrow) -> str:
    """Which throw it is and how it ended."""
    outcome = throw.outcome
    assert outcome is not None  # a throw that was cut was judged
    error = (
        f", {100 * outcome.landing_error:.1f} cm from the centre" if outcome.landing_seen else ""
    )
    return f"{name}: {'in' if outcome.in_basket else 'out'}{error}"


def play(
    scene: Scene,
    timeline: Any,
    recording: ThrowRecording,
    throw: FoundThrow,
    frame: float = FRAME,
    when_down: Callable[[], None] = lambda: None,
) -> float:
    """Show a throw that was cut out, picture after picture, `frame` apart [s]; how long it takes
    [s].

    timeline: its `insert_sleep` is called with the time [s] that each picture stands: of viser's
    serialiser, or of a camera. when_down: called once, before the first picture in which the ball
    is down; at the end of a throw whose landing nobody saw. recording: of the throw; scene: that
    shows it.
    """
    one = throw.demonstration
    assert one is not None  # only what was cut can be shown
    first = one.stamp_ns + round(1e9 * (one.motion_start - LEAD))
    frames = np.arange(first, throw.stamp_ns + round(1e9 * FOLLOWED), round(1e9 * frame))
    scene.move_basket(one.target)
    for path in ("ball", "hand"):
        scene.clear_path(path)
    hand, ball = recording.bodies["hand"], recording.bodies["ball"]
    where = {"hand": rows_at(hand.stamp_ns, frames), "ball": rows_at(ball.stamp_ns, frames)}
    joints = recording.joints
    at_joints = np.full(len(frames), -1) if joints is None else rows_at(joints.stamp_ns, frames)
    down = int(np.searchsorted(frames, _down_ns(throw, frames)))
    for k in range(len(frames)):
        if k == down:
            when_down()
        if joints is not None and at_joints[k] >= 0:
            scene.move_arm(joints.position[at_joints[k]])
        _move_bodies(
            scene,
            hand,
            ball,
            where["hand"][k],
            where["ball"][k],
            with_path=frames[k] >= throw.stamp_ns - 400_000_000,
        )
        timeline.insert_sleep(frame)
    if down >= len(frames):
        when_down()
    timeline.insert_sleep(PAUSE)
    return len(frames) * frame + PAUSE


def _down_ns(throw: FoundThrow, frames: np.ndarray) -> int:
    """When the ball came down, as a stamp [ns]; after the last of the frames (n,) [ns] if nobody
    saw it.
    """
    outcome = throw.outcome
    if outcome is None or not outcome.landing_seen:
        return int(frames[-1]) + 1
    return throw.stamp_ns + round(1e9 * outcome.landing_time)


def _move_bodies(
    scene: Scene, hand: PoseStream, ball: PoseStream, at_hand: int, at_ball: int, with_path: bool
) -> None:
    if at_hand >= 0:
        scene.move_hand(hand.position[at_hand], hand.quaternion[at_hand])
        if with_path:
            scene.extend_path("hand", hand.position[at_hand][None])
    if at_ball >= 0:
        scene.move_ball(ball.position[at_ball])
        if with_path:
            scene.extend_path("ball", ball.position[at_ball][None])


def rows_at(stamps: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Index (m,) of the last of stamps (n,) [ns] at each instant, -1 where that is long ago or
    there is none.
    """
    rows = np.searchsorted(stamps, instants, side="right") - 1
    return np.where((rows >= 0) & (instants - stamps[np.maximum(rows, 0)] < LOST), rows, -1)
