"""Darts by the arm: it is taught to hit the board, sees where its darts go, aims where that scores most, and practises.

    dart-skill experiment darts --seed 0 --throws 300 --output figures

The two halves of the thesis in one loop: how to throw (chapters 7 and 8) and where to aim (chapter 6). Everything that the loop learns
from, the score included, is what the cameras saw of the darts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from dart_skill.configuration import node_parameters
from dart_skill.darts import ModelBasedAgent, name_at, score
from dart_skill.recording import Demonstration
from dart_skill.session import Session
from dart_skill.simulation import Board, PlantSettings, Swing
from dart_skill.skill.improve import CorrectionSettings, PractisingSkill
from dart_skill.skill.learn import DEFAULT, SkillConfiguration
from dart_skill.surface import BoardFace

BLOCK = 25
"""Throws of a row of the table, and between two looks at when to let go."""
UNSEEN = (float("nan"), float("nan"))
UNKNOWN = ((0.0, 0.0), (0.0, 0.0))
SHOWN = 0.12
"""Half the height and width of the part of the board that the teacher aims at [m]."""
SWING = Swing(cocked=(-1.00, -0.42, -0.60))
"""The teacher's swing, the elbow less bent at first than for baskets: at this speed the wind-up takes J4 farther back, to its end at -0.9.
"""
LEARNING = CorrectionSettings(offsets=(0.05,), lengths=(0.2,), turns=(0.1,), apart=(1e-6, 1e-6), farthest=0.15, memory=40)
"""A board is smaller than a region of baskets: wherever two surprises are, they are a change. A release that is moved makes old misses
worthless.
"""
PRACTICE = {"none": ("none", 0), "misses": ("residual", 0), "both": ("residual", BLOCK)}
"""What is practised: nothing; what repeats in the misses; that, and when to let go."""


@dataclass(frozen=True)
class Dart:
    """One throw.

    Parameters:

    * aim: (x, y) [mm] on the board.
    * hit: (x, y) [mm] on the board; nan if the cameras did not see it or nothing was thrown.
    * score: int, as seen; 0 if nothing was seen.
    * covariance: (2, 2) [mm^2], spread of the thrower as estimated before the throw; 0 before the first estimate.
    * expected: float [points], expected score of the aim for that spread; nan before the first estimate.
    * release_shift: float [s], by which the release was shifted before the throw.
    * note: str, default "". What went wrong.
    """

    aim: tuple[float, float]
    hit: tuple[float, float]
    score: int
    covariance: tuple[tuple[float, float], tuple[float, float]]
    expected: float
    release_shift: float
    note: str = ""


@dataclass(frozen=True)
class Run:
    """All throws of one arm.

    Parameters:

    * seed: int.
    * practice: one of PRACTICE.
    * board: (x, y, z) [m], position of the bull.
    * shown: (x, y) [mm] for each of the teacher's darts: hit minus aim.
    * darts: one Dart for each throw.
    """

    seed: int
    practice: str
    board: tuple[float, float, float]
    shown: tuple[tuple[float, float], ...]
    darts: tuple[Dart, ...]


def darts_session(seed: int, board: Board | None = None, **plant: Any) -> Session:
    """A session with a board instead of baskets; plant: settings of the plant that differ from the configured ones."""
    settings = PlantSettings.from_parameters(node_parameters("wam_simulator.yaml", "wam_simulator"))
    return Session(seed, replace(settings, board=board or Board(), **plant), swing=SWING)


def darts_configuration(board: Board) -> SkillConfiguration:
    """The default skill, for darts at this board; a plan with finer steps, since its release is moved by milliseconds."""
    return replace(DEFAULT, name="darts", board=board.position, step=0.002, release="shown")


def points_to_show(seed: int, n: int) -> np.ndarray:
    """Points (n, 2) [mm] of the board for the teacher to aim at: heights and sides in n strata, each used once."""
    rng = np.random.default_rng([seed, 7])
    strata = [(rng.permutation(n) + rng.random(n)) / n for _ in range(2)]
    return 1e3 * SHOWN * (2 * np.stack(strata, axis=1) - 1)


def teach(session: Session, points: np.ndarray, face: BoardFace) -> tuple[list[Demonstration], np.ndarray]:
    """A demonstration for each point (n, 2) [mm] at which the teacher hit the board; misses (m, 2) [mm] of all of the teacher's darts."""
    kept, misses = [], []
    for point in points:
        lessons = session.teach(face.in_world(point))
        misses += [face.on_board(lesson.outcome.landing) - point for lesson in lessons]
        if lessons[-1].outcome.in_basket:
            kept.append(lessons[-1].demonstration)
    return kept, np.array(misses)


def run(
    seed: int,
    throws: int = 300,
    demonstrations: int = 8,
    practice: str = "both",
    board: Board | None = None,
    each: Callable[[int, Dart], object] | None = None,
) -> Run:
    """One arm from its first lesson on.

    Parameters:

    * seed: int, of everything that is random.
    * throws: int, default 300.
    * demonstrations: int, default 8. Number of darts that the teacher aims, at least 2.
    * practice: one of PRACTICE, default "both".
    * board: Board, default None: one of regulation height and distance.
    * each: function that is called after each throw with its number, from 0, and its Dart; default None.
    """
    if practice not in PRACTICE:
        raise ValueError(f"there is no practice '{practice}': choose one of {', '.join(PRACTICE)}")
    if throws < 1 or demonstrations < 2:
        raise ValueError(f"{throws} throws after {demonstrations} demonstrations: give at least 1 and 2")
    board = board or Board()
    session = darts_session(seed, board)
    try:
        shown, misses = teach(session, points_to_show(seed, demonstrations), board.face)
        method, steady_every = PRACTICE[practice]
        skill = PractisingSkill(shown, darts_configuration(board), method, settings=LEARNING, steady_every=steady_every)
        agent, darts = ModelBasedAgent(learns_from="hits"), []
        for n in range(throws):
            darts.append(_throw(session, skill, agent, board.face))
            if each is not None:
                each(n, darts[-1])
    finally:
        session.close()
    return Run(seed, practice, board.position, tuple(_pair(miss) for miss in misses), tuple(darts))


def _throw(session: Session, skill: PractisingSkill, agent: ModelBasedAgent, face: BoardFace) -> Dart:
    """Throw one dart where the agent aims; the agent and the skill learn from it."""
    dart = _before(skill, agent)
    try:
        plan = skill.plan(face.in_world(agent.aim))
        trial = session.throw(plan)
    except ValueError as error:
        agent.cannot()
        return replace(dart, note=str(error))
    if not trial.outcome.landing_seen:
        return replace(dart, note="nobody saw where the dart went")
    hit = face.on_board(trial.outcome.landing)
    agent.tell(hit)
    told = skill.tell(plan, trial.demonstration)
    return replace(dart, hit=_pair(hit), score=int(score(hit)), note="" if told.kept else told.reason)


def _before(skill: PractisingSkill, agent: ModelBasedAgent) -> Dart:
    """What is known of a dart before it is thrown."""
    covariance = UNKNOWN
    if agent.spread is not None:
        across, up = agent.spread.covariance
        covariance = (_pair(across), _pair(up))
    return Dart(_pair(agent.aim), UNSEEN, 0, covariance, agent.expected_score, skill.release_shift)


def _pair(values: np.ndarray) -> tuple[float, float]:
    """Two numbers (2,) as a tuple."""
    return float(values[0]), float(values[1])


def summarise(run: Run, block: int = BLOCK) -> list[dict]:
    """One row per block of throws: standard deviation and mean of the misses across and up [mm], beds aimed at, mean and expected score."""
    return [_row(start + 1, run.darts[start : start + block]) for start in range(0, len(run.darts), block)]


def _row(first: int, darts: tuple[Dart, ...]) -> dict:
    """The row of a block of darts; first: number of its first dart, from 1."""
    miss = np.array([np.subtract(dart.hit, dart.aim) for dart in darts])
    seen = np.isfinite(miss).all(axis=1)
    beds = [name_at(dart.aim) for dart in darts]
    expected = np.array([dart.expected for dart in darts])
    return {
        "first": first,
        "last": first + len(darts) - 1,
        "sd_across_mm": float(miss[seen, 0].std()) if seen.any() else None,
        "sd_up_mm": float(miss[seen, 1].std()) if seen.any() else None,
        "bias_across_mm": float(miss[seen, 0].mean()) if seen.any() else None,
        "bias_up_mm": float(miss[seen, 1].mean()) if seen.any() else None,
        "aims": list(dict.fromkeys(beds)),
        "mean_score": float(np.mean([dart.score for dart in darts])),
        "expected_score": float(np.nanmean(expected)) if np.isfinite(expected).any() else None,
        "release_shift_ms": 1e3 * darts[-1].release_shift,
        "unseen": int((~seen).sum()),
    }


def table(run: Run) -> str:
    """The rows of `summarise` as text."""
    head = f"{'throws':>9}{'across [mm]':>16}{'up [mm]':>16}{'score':>8}{'expected':>10}{'release':>10}  aims"
    x, _, height = run.board
    lines = [f"seed {run.seed}, practice {run.practice}, bull {x:.2f} m from the base axis, {height:.2f} m high", head]
    for row in summarise(run):
        columns = [
            f"{_or_dash(row[f'bias_{axis}_mm'], '+.1f')} +- {_or_dash(row[f'sd_{axis}_mm'], '.1f')}".rjust(16) for axis in ("across", "up")
        ]
        numbers = f"{row['mean_score']:>8.1f}{_or_dash(row['expected_score'], '.1f'):>10}{row['release_shift_ms']:>+7.0f} ms"
        aims = f"{row['aims'][0]} to {row['aims'][-1]}" if len(row["aims"]) > 1 else row["aims"][0]
        lines.append(f"{row['first']:>4}-{row['last']:<4}{''.join(columns)}{numbers}  {aims}")
    notes = [f"  throw {n}: {dart.note}" for n, dart in enumerate(run.darts, start=1) if dart.note]
    return "\n".join([*lines, *notes[:10]])


def as_json(run: Run) -> dict:
    """Everything, with None for what is not known."""
    darts = [{key: _plain(value) for key, value in asdict(dart).items()} for dart in run.darts]
    return {"seed": run.seed, "practice": run.practice, "board": run.board, "shown": run.shown, "blocks": summarise(run), "darts": darts}


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
