"""A replay of a run of any skill, as `_replay` has that of throws."""

from __future__ import annotations

import contextlib
import io
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.report._replay import FRAME, MOST_THROWS, PAUSE, Replay, rows_at
from dart_skill.report._skill_run import Movement, SkillRun
from dart_skill.skills.protocol import HAND

if TYPE_CHECKING:
    from dart_skill.view import Scene

ABOVE = 0.6
"""What the page looks at: there it says which movement is shown [m]."""
LONGEST = 12.0
"""Longest movement in the replay; of a longer one its end is shown [s]."""


def replay_of(run: SkillRun) -> Replay:
    """The arm's own movements, or, without any, the guided ones; ViewUnavailable without viser."""
    from dart_skill.view import Scene, open_server

    server = open_server()
    try:
        scene = Scene(server, skill=run.skill)
        eye, looks_at = scene.first_sight
        scene.show_ways([one.hand_position for one in run.shown], np.empty((0, 3)))
        label = server.scene.add_label(
            "/movement", "", position=looks_at + [0.0, 0.0, ABOVE], anchor="bottom-center"
        )
        serializer = server.get_scene_serializer()
        starts: dict[int, float] = {}
        seconds = 0.0
        with server.atomic():  # as for throws
            for number, movement in enumerate(shown_in_replay(run)):
                starts[number] = seconds
                label.text = in_a_line(movement)
                seconds += _play(scene, serializer, run, movement)
        return Replay(serializer.as_html(), starts, seconds)
    finally:
        with contextlib.redirect_stdout(io.StringIO()):  # viser says that it stopped
            server.stop()


def shown_in_replay(run: SkillRun) -> list[Movement]:
    """The first of the arm's own movements; without any, of the guided ones."""
    own = [one for one in run.movements if not one.guided]
    return (own or list(run.movements))[:MOST_THROWS]


def in_a_line(movement: Movement) -> str:
    """Which movement it is, and what became of it."""
    result = movement.result
    if result is None:
        return movement.name
    error = "not seen" if result.error_m is None else f"{1e3 * result.error_m:.1f} mm"
    return f"{movement.name}: {'done' if result.outcome.success else 'failed'}, {error}"


def _play(scene: Scene, timeline: Any, run: SkillRun, movement: Movement) -> float:
    """Show a movement, picture after picture; how long it takes [s]."""
    first = max(movement.since, movement.until - round(LONGEST * 1e9))
    frames = np.arange(first, movement.until, round(1e9 * FRAME))
    where = {role: rows_at(stamps, frames) for role, (stamps, _) in run.poses.items()}
    at_joints = rows_at(run.joints[0], frames)
    for path in (*run.skill.bodies[:1], HAND):
        scene.clear_path(path)
    for k in range(len(frames)):
        if at_joints[k] >= 0:
            scene.move_arm(run.joints[1][at_joints[k]])
        _move(scene, run, {role: int(at[k]) for role, at in where.items()})
        timeline.insert_sleep(FRAME)
    timeline.insert_sleep(PAUSE)
    return len(frames) * FRAME + PAUSE


def _move(scene: Scene, run: SkillRun, at: dict[str, int]) -> None:
    """Bodies to where they were in a sample of each; -1: it was not seen."""
    for role, k in at.items():
        if k < 0:
            continue
        pose = run.poses[role][1][k]
        if role == HAND:
            scene.move_hand(pose[:3], pose[3:])
        else:
            scene.move_body(role, pose[:3], pose[3:])
        if role in (*run.skill.bodies[:1], HAND):
            scene.extend_path(role, pose[None, :3])
