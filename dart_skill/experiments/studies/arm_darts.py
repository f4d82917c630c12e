"""Darts by the arm: it is taught to hit the board, sees where its darts go, aims where that scores
most, and practises.

    dart-skill experiment darts --seed 0 --throws 300 --output figures
    dart-skill experiment darts --arm fleet --first-seed 2000 --seeds 40 --throws 100 --again 30

The two halves of the thesis in one loop: how to throw (chapters 7 and 8) and where to aim (chapter
6). Everything that the loop learns from, the score included, is what the cameras saw of the darts.
`dart-skill demo --skill darts` does the same with nodes, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from dart_skill.common.situation import Situation
from dart_skill.common.surface import BOARD_DIAMETER
from dart_skill.darts import best_aim, estimate_from_points
from dart_skill.experiments.studies.throws import arm_of
from dart_skill.recording import Demonstration
from dart_skill.session import BLOCK, Dart, DartsRun, Session, own_dart
from dart_skill.simulation import Board, Swing
from dart_skill.skills.darts import Darts
from dart_skill.skills.practice import PractisingSkill

PRACTICE = {"none": ("none", False), "misses": ("residual", False), "both": ("residual", True)}
"""What is practised: nothing; what repeats in the misses; that, and when to let go."""
FEWEST_AGAIN = 6
"""Least number of darts of one plan: more than the five numbers of a covariance and a mean."""


def darts_session(seed: int, board: Board | None = None, arm: str = "ideal") -> Session:
    """A session with a board instead of baskets.

    Parameters
    ----------
    arm
        Of config/fleet.yaml; "fleet": the one that the seed draws.
    """
    board = board or Board()
    swing = Swing(Darts.at_board(board.position).cocked)
    return Session.on_arm(arm_of(arm, seed), seed, board=board, swing=swing)


def teach(
    session: Session, skill: Darts, situations: Iterable[Situation]
) -> tuple[list[Demonstration], np.ndarray]:
    """A demonstration for each aim with which the teacher hit the board; misses (m, 2) [mm] of all
    of the teacher's darts.

    Parameters
    ----------
    situations
        With the aims.
    """
    kept, misses = [], []
    for situation in situations:
        lessons = session.teach(skill.target(situation))
        hits = [skill.face.on_board(lesson.outcome.landing) for lesson in lessons]
        misses += [hit - skill.aim(situation) for hit in hits]
        if lessons[-1].outcome.in_basket:
            kept.append(lessons[-1].demonstration)
    return kept, np.array(misses)


def run(
    seed: int,
    throws: int = 300,
    demonstrations: int = 8,
    practice: str = "both",
    board: Board | None = None,
    each: Callable[[int, Dart], object] = lambda n, dart: None,
    name: str = "",
    arm: str = "ideal",
    again: int = 0,
) -> DartsRun:
    """One arm from its first lesson on.

    Parameters
    ----------
    seed
        Int, of everything that is random.
    throws
        Int, default 300.
    demonstrations
        Int, default 8. Number of darts that the teacher aims, at least 2.
    practice
        One of PRACTICE, default "both".
    board
        Board, default None: one of regulation height and distance.
    each
        Function that is called after each throw with its number, from 0, and its Dart.
    name
        Of the skill's configuration, default "": the default one.
    arm
        As in `darts_session`.
    again
        Int, default 0. Darts of one plan for the bull, before the own throws and after them, from
        which nothing is learned: what their scatter allows (`allowed_score`) is told.

    Raises
    ------
    ValueError
        For too few throws or demonstrations, or a practice that there is not.
    """
    if practice not in PRACTICE:
        raise ValueError(f"there is no practice '{practice}': choose one of {', '.join(PRACTICE)}")
    if throws < 1 or demonstrations < 2:
        raise ValueError(
            f"{throws} throws after {demonstrations} demonstrations: give at least 1 and 2"
        )
    if again and again < FEWEST_AGAIN:
        raise ValueError(f"again is {again}: give 0, or at least {FEWEST_AGAIN} darts")
    board = board or Board()
    game, session = Darts.at_board(board.position), darts_session(seed, board, arm)
    try:
        situations = game.draws(np.random.default_rng([seed, 7]), demonstrations)
        shown, misses = teach(session, game, situations)
        method, steadies = PRACTICE[practice]
        skill = PractisingSkill(
            shown,
            game.named(name).settings,
            method,
            settings=game.correction,
            steady_every=game.steady_every if steadies else 0,
        )
        agent, darts = game.agent(), []
        allowed = [allowed_score(session, skill, game, again)] if again else []
        for n in range(throws):
            darts.append(own_dart(session, skill, game, agent)[0])
            each(n, darts[-1])
        allowed += [allowed_score(session, skill, game, again)] if again else []
    finally:
        session.close()
    taught = tuple((float(x), float(y)) for x, y in misses)
    return DartsRun(seed, practice, board.position, taught, tuple(darts), allowed=tuple(allowed))


def allowed_score(session: Session, skill: PractisingSkill, game: Darts, darts: int) -> float:
    """The most that a dart of this arm can score on average, where its plans have no error: the
    best aim of a Gaussian thrower (6.1) who scatters as the darts of one plan do about their mean.

    Parameters
    ----------
    darts
        How many are thrown at the bull with one plan.

    Returns
    -------
    float
        [points]; nan where the plan is refused, or too few darts were seen.
    """
    try:
        plan = skill.plan(game.target(game.aimed(np.zeros(2))))
        seen = [session.throw(plan).outcome for _ in range(darts)]
    except ValueError:
        return float("nan")
    hits = np.array([game.face.on_board(one.landing) for one in seen if one.landing_seen])
    if len(hits) < FEWEST_AGAIN:
        return float("nan")
    spread = estimate_from_points(hits, np.zeros(2), model="general", bias=True).spread
    return best_aim(spread).expected_score


def run_seed(seed: int, **options: Any) -> list[DartsRun]:
    """The run of one seed in a list, as `parallel.all_of` has it."""
    return [run(seed, **options)]


def table_of_seeds(runs: Sequence[DartsRun]) -> str:
    """Table of each seed: mean score of a dart in the first and the last block of throws, and the
    median distance from the aim in the last.

    Parameters
    ----------
    runs
        One for each seed.
    """
    lines = [
        f"{BLOCK} darts in a block",
        f"{'seed':>6}{'score, first':>15}{'score, last':>14}{'off, last [mm]':>17}{'on the board':>15}"
        + (f"{'allowed':>15}" if runs[0].allowed else ""),
    ]
    rows, boarded = [], 0
    for one in runs:
        first, last = one.darts[:BLOCK], one.darts[-BLOCK:]
        off = np.linalg.norm([np.subtract(dart.hit, dart.aim) for dart in last], axis=1)
        means = (np.mean([dart.score for dart in block]) for block in (first, last))
        rows.append([*means, np.nanmedian(off)])
        # what was not seen is nan, and not on it
        on = sum(np.hypot(*dart.hit) <= 500.0 * BOARD_DIAMETER for dart in one.darts)
        boarded += on
        share = f"{on} of {len(one.darts)}"
        lines.append(f"{one.seed:>6}{_columns(rows[-1])}{share:>15}{_allowed(one.allowed)}")
    darts = sum(len(one.darts) for one in runs)
    for name, middle in (("median", np.median), ("mean", np.mean)):
        lines.append(f"{name:>6}{_columns(middle(rows, axis=0))}")
    lines[-1] += f"{f'{boarded} of {darts}':>15}"
    if runs[0].allowed:
        lines[-1] += _allowed(tuple(np.nanmean([one.allowed for one in runs], axis=0)))
        lines.append(
            "allowed: the score with the best aim for the scatter of one plan, first and last"
        )
    return "\n".join(lines)


def _allowed(scores: Sequence[float]) -> str:
    return f"{' '.join(f'{score:.1f}' for score in scores):>15}" if scores else ""


def _columns(row: Sequence[float]) -> str:
    return f"{row[0]:>15.1f}{row[1]:>14.1f}{row[2]:>17.1f}"
