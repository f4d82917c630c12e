"""Darts by the arm: it is taught to hit the board, sees where its darts go, aims where that scores most, and practises.

    dart-skill experiment darts --seed 0 --throws 300 --output figures

The two halves of the thesis in one loop: how to throw (chapters 7 and 8) and where to aim (chapter 6). Everything that the loop learns
from, the score included, is what the cameras saw of the darts.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from dart_skill.configuration import node_parameters
from dart_skill.darts import Aim, Spread, best_aim, estimate_from_points, expected_score, local_optima, name_at, score
from dart_skill.recording import Demonstration
from dart_skill.session.in_process import Session
from dart_skill.simulation.board import Board
from dart_skill.simulation.plant import PlantSettings
from dart_skill.simulation.teacher import Swing
from dart_skill.skill.improve.correction import CorrectionSettings
from dart_skill.skill.improve.practising import PractisingSkill
from dart_skill.skill.learn.configuration import DEFAULT, SkillConfiguration
from dart_skill.surface import BoardFace

BLOCK = 25
"""Throws of a row of the table, and between two looks at when to let go."""
WINDOW, LEAST, EVERY = 50, 10, 5
"""The spread is estimated from so many last throws, from at least so many, and anew after so many; until then the bull is aimed at."""
SHOWN = 0.12
"""Half the height and width of the part of the board that the teacher aims at [m]."""
SWING = Swing(cocked=(-1.00, -0.42, -0.60))
"""The teacher's swing, the elbow less bent at first than for baskets: at this speed the wind-up takes J4 farther back, to its end at -0.9.
"""
LEARNING = CorrectionSettings(offset=0.05, lengths=(0.2,), turns=(0.1,), apart=(1e-6, 1e-6), farthest=0.15, memory=40)
"""A board is smaller than a region of baskets: wherever two surprises are, they are a change. A release that is moved makes old misses
worthless.
"""
PRACTICE = {"none": ("none", 0), "misses": ("residual", 0), "both": ("residual", BLOCK)}
"""What is practised: nothing; what repeats in the misses; that, and when to let go."""


@dataclass(frozen=True)
class Dart:
    """One throw: aim and hit on the board [mm], nan if nobody saw it or nothing was thrown, score as seen; spread of the thrower as
    estimated before the throw (covariance [mm^2], 0 if it was not), what it lets one expect from the aim, and the shift of the release [s].
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
    """All throws of one arm; shown: how far the teacher's darts were from where the teacher aimed [mm]."""

    seed: int
    practice: str
    board: tuple[float, float, float]
    shown: tuple[tuple[float, float], ...]
    darts: tuple[Dart, ...]


def darts_session(seed: int, board: Board | None = None, **plant) -> Session:
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


def run(seed: int, throws: int = 300, demonstrations: int = 8, practice: str = "both", board: Board | None = None, each=None) -> Run:
    """One arm from its first lesson on; each(n, dart), if given, is called after every throw."""
    if practice not in PRACTICE:
        raise ValueError(f"there is no practice '{practice}': choose one of {', '.join(PRACTICE)}")
    if throws < 1 or demonstrations < 2:
        raise ValueError(f"{throws} throws after {demonstrations} demonstrations: give at least 1 and 2")
    board = board or Board()
    session = darts_session(seed, board)
    try:
        shown, misses = teach(session, points_to_show(seed, demonstrations), board.face)
        method, steady = PRACTICE[practice]
        skill = PractisingSkill(shown, darts_configuration(board), method, settings=LEARNING, steady_every=steady)
        darts, agent = [], Aimer()
        for n in range(throws):
            darts.append(_throw(session, skill, agent, board.face))
            if each is not None:
                each(n, darts[-1])
    finally:
        session.close()
    return Run(seed, practice, board.position, tuple(map(tuple, misses.tolist())), tuple(darts))


class Aimer:
    """Where to aim, from where one's own darts went: the spread about the aim of the last ones, bias included, and the best aim for it.

    A bed that the arm cannot throw at, because the throw was refused or stopped, is not aimed at any more; the bull always is.
    """

    def __init__(self):
        self.aim, self.spread = Aim(np.zeros(2), float("nan")), None
        self._aims, self._hits, self._beyond = [], [], set()

    def tell(self, hit: np.ndarray) -> None:
        """Where a dart (2,) [mm] went that was thrown at the present aim."""
        self._aims.append(self.aim.point)
        self._hits.append(hit)
        if len(self._hits) >= LEAST and len(self._hits) % EVERY == 0:
            self.spread = spread_of(np.array(self._hits[-WINDOW:]), np.array(self._aims[-WINDOW:]))
            self._choose()

    def cannot(self) -> None:
        """No throw came about at the present aim."""
        self._beyond.add(self.aim.bed)
        if self.spread is not None:
            self._choose()

    def _choose(self) -> None:
        best = best_aim(self.spread)
        if best.bed in self._beyond:
            others = (aim for aim in local_optima(self.spread) if aim.bed not in self._beyond)
            best = next(others, Aim(np.zeros(2), float(expected_score(np.zeros(2), self.spread))))
        self.aim = best


def spread_of(hits: np.ndarray, aims: np.ndarray) -> Spread:
    """The most likely spread about their aims (n, 2) [mm] of hits (n, 2) [mm]; a bias counts as spread, since practice removes it."""
    return estimate_from_points(hits, aims, model="general").spread


def _throw(session: Session, skill: PractisingSkill, agent: Aimer, face: BoardFace) -> Dart:
    aim, spread, expected = agent.aim.point, agent.spread, agent.aim.expected_score
    covariance = np.zeros((2, 2)) if spread is None else spread.covariance
    known = (tuple(map(tuple, covariance.tolist())), expected, skill.release_shift)
    try:
        plan = skill.plan(face.in_world(aim))
        trial = session.throw(plan)
    except ValueError as error:
        agent.cannot()
        return Dart(tuple(aim.tolist()), (np.nan, np.nan), 0, *known, str(error))
    if not trial.outcome.landing_seen:
        return Dart(tuple(aim.tolist()), (np.nan, np.nan), 0, *known, "nobody saw where the dart went")
    hit = face.on_board(trial.outcome.landing)
    agent.tell(hit)
    told = skill.tell(plan, trial.demonstration)
    return Dart(tuple(aim.tolist()), tuple(hit.tolist()), int(score(hit)), *known, "" if told.kept else told.reason)


def summarise(run: Run, block: int = BLOCK) -> list[dict]:
    """One row per block of throws: standard deviation and mean of the misses across and up [mm], beds aimed at, mean and expected score."""
    rows = []
    for start in range(0, len(run.darts), block):
        darts = run.darts[start : start + block]
        miss = np.array([np.subtract(dart.hit, dart.aim) for dart in darts])
        seen = np.isfinite(miss).all(axis=1)
        beds = [name_at(dart.aim) for dart in darts]
        expected = np.array([dart.expected for dart in darts])
        rows.append(
            {
                "first": start + 1,
                "last": start + len(darts),
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
        )
    return rows


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


def _plain(value):
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
