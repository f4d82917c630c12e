"""A replay of a run in three dimensions that needs no server: a viser scene with a timeline, as
one HTML text.

The arm's own movements follow one another; without any, the guided ones.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.recording import HAND
from dart_skill.report._run import Movement, Run
from dart_skill.skills.learning import component_ellipsoids

if TYPE_CHECKING:
    from dart_skill.view import Scene

FRAME = 0.04
"""Time of a picture of the replay [s]."""
PAUSE = 0.6
"""The last picture of a movement stands so long [s]."""
LONGEST = 12.0
"""Longest movement in the replay; of a longer one its end is shown [s]."""
MOST_MOVEMENTS = 60
"""More of them make the page large; 10 kB each."""
EYE = (1.9, -4.6, 2.0)
"""Where the page looks from at first, where there are baskets [m]."""
LOOK_AT = (1.1, 0.0, 1.15)
"""Where it looks to at first [m]."""
ABOVE_BASKETS = (0.0, 0.0, 2.45)
"""There it says which throw at a basket is shown [m]."""
ABOVE = (0.0, 0.0, 0.6)
"""There it says which movement is shown, from where the page looks to at first [m]."""
LIGHT_ONLY = "darkMode:false};"
"""What viser writes into a page that is light."""
DARK = "window.matchMedia('(prefers-color-scheme: dark)')"
"""Whether a browser wants a dark page, in its own words."""
ON_CHANGE = ".addEventListener('change',()=>location.reload());"
"""What the page does when that changes."""
LOST = 50_000_000
"""A sample further away than this from an instant does not stand for it [ns]."""


@dataclass(frozen=True)
class Replay:
    """A page of its own.

    Parameters
    ----------
    html
        Its text.
    starts
        When each movement begins on its timeline [s].
    seconds
        Its length.
    """

    html: str
    starts: list[tuple[Movement, float]]
    seconds: float

    def begun(self, number: int) -> str:
        """When a trial begins, in words; empty if it is not shown."""
        return next(
            (f"{at:.1f}" for one, at in self.starts if number and one.number == number), ""
        )


def in_replay(run: Run) -> list[Movement]:
    """The first of the arm's own movements; without any, of the guided ones."""
    return (run.own or run.guided)[:MOST_MOVEMENTS]


def replay_of(run: Run) -> Replay | None:
    """The replay of a run, None if there is no movement to show. ViewUnavailable without viser."""
    from dart_skill.view import Scene, open_server

    movements = in_replay(run)
    if not movements:
        return None
    server = open_server()
    try:
        if run.throws is None:
            scene = Scene(server, skill=run.skill)
            scene.show_ways([one.hand_position for one in run.shown], np.empty((0, 3)))
            above = scene.first_sight[1] + ABOVE
        else:
            scene, above = Scene(server), np.array(ABOVE_BASKETS)
            server.initial_camera.position, server.initial_camera.look_at = EYE, LOOK_AT
            scene.show_demonstrations(run.shown)
        label = server.scene.add_label("/movement", "", position=above, anchor="bottom-center")
        serializer = server.get_scene_serializer()
        starts, seconds = [], 0.0
        with server.atomic():  # or each change wakes a thread that has no client to send it to
            for movement in movements:
                starts.append((movement, seconds))
                tell = partial(setattr, label, "text")
                seconds += play(scene, serializer, run, movement, tell=tell)
        return Replay(follow_scheme(serializer.as_html()), starts, seconds)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):  # viser says that it stopped
            server.stop()


def follow_scheme(page: str) -> str:
    """A page of viser that is light or dark as the browser wants it, also when that changes.

    Raises
    ------
    ValueError
        For a page in which viser says it in another way.
    """
    if LIGHT_ONLY not in page:
        raise ValueError(f"viser's page has no '{LIGHT_ONLY}': this version of viser is not known")
    return page.replace(LIGHT_ONLY, f"darkMode:{DARK}.matches}};{DARK}{ON_CHANGE}", 1)


def gaussians_of(run: Run, movement: Movement) -> Sequence[tuple[np.ndarray, ...]]:
    """Gaussians of the learned throw for the basket of a movement; none for other skills, or where
    it knows nothing of the basket.
    """
    if run.throws is None or run.throws.learned is None or movement.result is None:
        return ()
    try:
        return component_ellipsoids(run.throws.learned.mixture(movement.result.target))
    except ValueError:
        return ()


def result_in_words(run: Run, movement: Movement) -> str:
    """Which movement it is and how it ended."""
    result, words = movement.result, run.skill.words
    if result is None:
        return movement.name
    unit, scale = words.unit
    off = (
        words.unseen
        if result.error_m is None
        else f"{scale * result.error_m:.1f} {unit} {words.off}"
    )
    return f"{movement.name}: {words.result[not result.success]}, {off}"


def play(
    scene: Scene,
    timeline: Any,
    run: Run,
    movement: Movement,
    frame: float = FRAME,
    tell: Callable[[str], None] = lambda text: None,
) -> float:
    """Show a movement, picture after picture, `frame` apart [s]; how long it takes [s].

    Parameters
    ----------
    scene
        That shows it.
    timeline
        Its `insert_sleep` is called with the time [s] that each picture stands: of viser's
        serialiser, or of a camera.
    run
        Of the movement.
    movement
        That is shown.
    tell
        Called with what the movement is, and with its result as soon as it is known; at the end
        where that comes later.
    """
    first = max(movement.since, movement.until - round(LONGEST * 1e9))
    frames = np.arange(first, movement.until, round(1e9 * frame))
    where = {role: rows_at(stamps, frames) for role, (stamps, _) in run.poses.items()}
    at_joints = rows_at(run.joints[0], frames)
    drawn = (run.skill.moves, HAND)
    for role in drawn:
        scene.clear_path(role)
    scene.show_course(course_of(run, movement, where, frames))
    if run.throws is not None and movement.result is not None:
        scene.move_basket(movement.result.target)
    if ellipsoids := gaussians_of(run, movement):
        scene.show_gaussians("gaussians", *map(np.array, zip(*ellipsoids, strict=True)))
    else:
        scene.hide_gaussians(scene.gaussian_colours)
    known = int(np.searchsorted(frames, movement.known))
    tell(movement.name)
    for k in range(len(frames)):
        if k == known:
            tell(result_in_words(run, movement))
        if at_joints[k] >= 0:
            scene.move_arm(run.joints[1][at_joints[k]])
        for role, rows in where.items():
            if rows[k] >= 0:
                pose = run.poses[role][1][rows[k]]
                _move(scene, run, role, pose)
                if role in drawn and frames[k] >= movement.drawn:
                    scene.extend_path(role, pose[None, :3])
        timeline.insert_sleep(frame)
    if known >= len(frames):
        tell(result_in_words(run, movement))
    timeline.insert_sleep(PAUSE)
    return len(frames) * frame + PAUSE


def course_of(run: Run, movement: Movement, where: dict, frames: np.ndarray) -> np.ndarray:
    """The whole way (n, 3) of what a movement moves, seen at frames (m,) [ns].

    Parameters
    ----------
    where
        Rows of its poses at the frames, by role; -1 where it was not seen.
    """
    if run.skill.moves == HAND:
        return np.empty((0, 3))
    rows = where[run.skill.moves][frames >= movement.drawn]
    return run.poses[run.skill.moves][1][rows[rows >= 0], :3]


def _move(scene: Scene, run: Run, role: str, pose: np.ndarray) -> None:
    if role == HAND:
        scene.move_hand(pose[:3], pose[3:])
    elif run.throws is None:
        scene.move_body(role, pose[:3], pose[3:])
    else:
        scene.move_ball(pose[:3])


def rows_at(stamps: np.ndarray, instants: np.ndarray) -> np.ndarray:
    """Index (m,) of the last of stamps (n,) [ns] at each instant, -1 where that is long ago or
    there is none.
    """
    if not len(stamps):
        return np.full(len(instants), -1)
    rows = np.searchsorted(stamps, instants, side="right") - 1
    return np.where((rows >= 0) & (instants - stamps[np.maximum(rows, 0)] < LOST), rows, -1)
