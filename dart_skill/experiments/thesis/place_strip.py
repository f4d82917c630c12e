"""`place_strip`: a part on its way into a holder, on an arm of the fleet: corrected, with cameras that
do not see the hand, and not corrected at all (docs/fleet.md). The thesis has no such figure.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from scipy.spatial.transform import Rotation

from dart_skill.arm import Mode, MotionPlan, Speed
from dart_skill.common.situation import Pose
from dart_skill.experiments.studies.pose_skills import LostHand, teach_place
from dart_skill.experiments.studies.throws import arm_of
from dart_skill.session import BenchSession
from dart_skill.simulation import Bench
from dart_skill.skills.learning import LearnedSkill
from dart_skill.skills.place import Place

PICTURES = 5
"""Number of pictures of a strip."""
SHOWN = 0.06
"""The strip begins when the part is so far from the holder's axis for the last time [m]."""
ROWS = {
    "corrected": (Speed.CAREFUL, 0.0),
    "hand not seen": (Speed.CAREFUL, np.inf),
    "not corrected": (Speed.THROW, 0.0),
}
"""Level of speed of the plan, of which only a careful one is corrected, and how long the cameras lose
the hand [s], by what a row is called.
"""


class Way(NamedTuple):
    """A part in the frame of its holder.

    Parameters
    ----------
    time
        Since the motion began (n,) [s].
    position, quaternion
        Of the part (n, 3) [m], (n, 4).
    ended
        What came of it, in words.
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    ended: str


def way_of(session: BenchSession, plan: MotionPlan, holder: Pose, unseen: float) -> Way:
    """The way of the part while a plan is carried out, by the simulator's own word.

    Parameters
    ----------
    unseen
        The cameras lose the hand for so long at its begin [s].
    """
    rows: list[tuple[float, np.ndarray, np.ndarray]] = []

    def note() -> None:
        if session.commander.mode is Mode.EXECUTING:
            rows.append((session.commander.time, *session.plant.bodies["part"]))

    near = np.inf if unseen else 0.0
    eyes = LostHand(session.commander, plan.path.position[-1], unseen, near)
    trial = session.execute(plan, eyes, note)
    time, position, quaternion = (np.array(column) for column in zip(*rows, strict=True))
    turn = Rotation.from_quat(holder.quaternion).inv()
    ended = (
        f"in its holder, {1e3 * trial.outcome.error:.1f} mm from the seat"
        if trial.outcome.success
        else trial.message or trial.outcome.reason
    )
    turned = (turn * Rotation.from_quat(quaternion)).as_quat()
    return Way(time, turn.apply(position - holder.position), turned, ended)


def draw_place_strip(seed: int = 0) -> tuple[Figure, dict]:
    """A row for each of `ROWS`: the holder from the side, in its own
    frame, with the part at equal instants, and the way of the part's lower end.

    Parameters
    ----------
    seed
        Of the arm, of the person who shows it, and of the holder: the first that is drawn.
    """
    skill, rng = Place.configured(), np.random.default_rng([seed, 7])
    figure = Figure(figsize=(9.6, 7.6), layout="constrained")
    session = BenchSession(skill, seed, arm=arm_of("fleet", seed))
    try:
        learned = LearnedSkill(skill, teach_place(session, skill, rng))
        holder, bench = skill.draw(rng, wide=True).pose("holder"), session.plant.bench
        ended = {}
        for row, (name, (speed, unseen)) in zip(
            figure.subplots(len(ROWS), PICTURES, sharex=True, sharey=True),
            ROWS.items(),
            strict=True,
        ):
            plan = replace(learned.plan(session.situation(holder)), speed=speed)
            way = way_of(session, plan, holder, unseen)
            _draw_row(row, way, bench)
            row[0].set_ylabel(f"{name}\nheight [mm]")
            ended[name] = way.ended
    finally:
        session.close()
    for axes in figure.axes[-PICTURES:]:
        axes.set_xlabel("across [mm]")
    return figure, {"arm": arm_of("fleet", seed), **ended}


def _draw_row(row: np.ndarray, way: Way, bench: Bench) -> None:
    """Pictures of one way."""
    up = Rotation.from_quat(way.quaternion).apply([0.0, 0.0, 0.5 * bench.size[2]])
    lower = way.position - up
    begin = int(np.flatnonzero(np.hypot(*lower[:, :2].T) > SHOWN)[-1])
    for axes, k in zip(row, np.linspace(begin, len(lower) - 1, PICTURES).astype(int), strict=True):
        _draw_holder(axes, bench)
        axes.plot(*(1e3 * lower[begin : k + 1, [0, 2]].T), lw=1.0)
        corners = 0.5 * np.array(bench.size)[[0, 2]] * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
        solid = np.insert(corners, 1, 0.0, axis=1)
        turned = way.position[k] + Rotation.from_quat(way.quaternion[k]).apply(solid)
        axes.add_patch(Polygon(1e3 * turned[:, [0, 2]], fill=False, lw=1.5))
        axes.set_title(f"{way.time[k]:.1f} s")
        axes.set(aspect="equal", xlim=(-60.0, 60.0), ylim=(-15.0, 190.0))


def _draw_holder(axes: Axes, bench: Bench) -> None:
    """Floor and walls of the holder, cut in the middle."""
    inner = 0.5 * bench.size[0] + bench.clearance
    wall, depth = bench.wall, bench.depth
    for left, low, width, height in (
        (-inner - wall, -wall, 2.0 * (inner + wall), wall),
        (-inner - wall, 0.0, wall, depth),
        (inner, 0.0, wall, depth),
    ):
        corner = 1e3 * np.array([left, low])
        axes.add_patch(Rectangle(tuple(corner), 1e3 * width, 1e3 * height, color="0.6", lw=0))
