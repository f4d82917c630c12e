"""Darts in one process, without ROS: shown, practised where the own spread scores most, and a leg
of 501. To the last bit as the graph.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dart_skill.darts import LegInPlay, ModelBasedAgent, place_of, solve_leg
from dart_skill.session._darts_run import (
    Dart,
    DartsRun,
    DartsSummary,
    LegSummary,
    after_the_throw,
    before_the_throw,
)
from dart_skill.session._demo import Job, Lessons, Say, practising
from dart_skill.session._in_process import Session
from dart_skill.session._session_bag import LAYOUT, SessionBag
from dart_skill.session._skill_summary import SkillResult, SkillSummary, in_words
from dart_skill.simulation import Board, Swing
from dart_skill.skills.darts import Darts
from dart_skill.skills.practice import PractisingSkill
from dart_skill.skills.protocol import TaskOutcome

MOST_DARTS = 120
"""A leg that takes more is given up."""


@dataclass(frozen=True)
class Hit:
    """Where a dart went.

    * place: (2,) [mm] on the board, None if nobody saw it or nothing was thrown.
    * note: what there is to say of it.
    * outcome: on the board or not, and how far from the aim [m].
    """

    place: np.ndarray | None
    note: str = ""
    outcome: TaskOutcome = TaskOutcome(False, float("nan"))


def darts_demo(job: Job, skill: Darts, say: Say) -> DartsSummary:
    """Darts at the board of config/world.yaml. ValueError says why the job cannot be done."""
    begun = time.monotonic()
    with SessionBag(job.bag, job.seed, skill) as bag:
        assert skill.cocked is not None
        board, swing = Board(skill.bull), Swing(skill.cocked)
        session = Session.on_arm(
            job.arm, job.seed, job.settings, board=board, swing=swing, bag=bag
        )
        try:
            lessons = _teach(session, bag, skill, job, say)
            learned, agent = practising(skill, lessons.kept, job.configuration, say), skill.agent()
            thrown, before = time.monotonic(), session.steps
            own = [
                _own_dart(session, learned, agent, skill, number, say)
                for number in range(1, job.throws + 1)
            ]
            leg = play_leg(agent, lambda aim: _thrown(session, learned, skill, aim), say)
            took, steps = time.monotonic() - thrown, session.steps - before
        finally:
            session.close()
    of = SkillSummary(
        skill=skill.name,
        seed=job.seed,
        bag=str(job.bag),
        demonstrations=job.demonstrations,
        attempts=lessons.attempts,
        trials=tuple(
            SkillResult(skill.aimed(np.array(dart.aim)), hit.outcome, dart.note)
            for dart, hit in own
        ),
        wall_seconds=time.monotonic() - begun,
        layout=LAYOUT,
        real_time_factor=steps * session.plant.settings.step / took,
    )
    return DartsSummary(
        of, DartsRun(job.seed, "in process", skill.bull, (), tuple(dart for dart, _ in own)), leg
    )


def throw_dart(session: Session, learned: PractisingSkill, skill: Darts, aim: np.ndarray) -> Hit:
    """A dart at a point (2,) [mm] of the board, which is learned from. ValueError says why there
    is no plan for it, or it was stopped.

    aim: the point.
    """
    plan = learned.plan(skill.target(skill.aimed(aim)))
    trial = session.throw(plan)
    if not trial.outcome.landing_seen:
        return Hit(None, "nobody saw where the dart went")
    told = learned.tell(plan, trial.demonstration)
    seen = trial.outcome
    outcome = TaskOutcome(bool(seen.in_basket), float(seen.landing_error))
    return Hit(skill.face.on_board(seen.landing), "" if told.kept else told.reason, outcome)


def _teach(session: Session, bag: SessionBag, skill: Darts, job: Job, say: Say) -> Lessons:
    lessons, rng = (
        Lessons(session, bag, job.demonstrations, say),
        np.random.default_rng([job.seed, 7]),
    )
    drawn = skill.draws(rng, job.demonstrations)
    for lesson in range(2 * job.demonstrations):
        situation = drawn[lesson] if lesson < job.demonstrations else skill.draw(rng)
        lessons.show(skill.target(situation), in_words(situation, units=skill.units))
        if len(lessons.kept) == job.demonstrations:
            return lessons
    raise lessons.too_few


def _own_dart(
    session: Session,
    learned: PractisingSkill,
    agent: ModelBasedAgent,
    skill: Darts,
    number: int,
    say: Say,
) -> tuple[Dart, Hit]:
    dart = before_the_throw(agent, learned.release_shift)
    try:
        hit = throw_dart(session, learned, skill, agent.aim)
    except ValueError as error:
        agent.cannot()
        hit = Hit(None, str(error))
    if hit.place is None:
        dart = replace(dart, note=hit.note)
    else:
        agent.tell(hit.place)
        dart = after_the_throw(dart, hit.place, hit.note)
    off = (
        "not seen"
        if hit.place is None
        else f"{np.linalg.norm(np.subtract(dart.hit, dart.aim)):.0f} mm off, {dart.score} points"
    )
    say(f"dart {number} at {place_of(np.array(dart.aim))}: {off} {hit.note}".rstrip())
    return dart, hit


def _thrown(session: Session, learned: PractisingSkill, skill: Darts, aim: np.ndarray) -> Hit:
    try:
        return throw_dart(session, learned, skill, aim)
    except ValueError as error:
        return Hit(None, str(error))


def play_leg(
    agent: ModelBasedAgent, throw: Callable[[np.ndarray], Hit], say: Say
) -> LegSummary | None:
    """501, double out, with as few darts as the spread that the agent knows allows; None before it
    knows one.

    throw: at a point (2,) [mm] of the board. The arm learns from these darts, too: a miss that
    repeats at one bed would repeat for ever. say: called with what goes on, in words.
    """
    if agent.spread is None:
        say("no leg of 501: the spread is not known yet; let more darts be thrown (--throws)")
        return None
    policy, leg = solve_leg(agent.spread, objective="darts"), LegInPlay()
    say(f"501, double out: {policy.expected[leg.remaining]:.1f} darts are expected")
    while not leg.is_over and len(leg.darts) < MOST_DARTS:
        aim = policy.best_aim(leg.remaining, leg.darts_left, leg.turn_start)
        hit = throw(aim)
        dart = leg.lost(hit.note) if hit.place is None else leg.hit(hit.place)
        bust = ", bust" if dart.bust else ""
        say(
            f"501, dart {len(leg.darts)}: {dart.before} left, at {place_of(aim)}: {dart.hit},"
            f" {dart.points} points{bust}"
        )
    return LegSummary(tuple(leg.darts), leg.is_over, float(policy.expected[501]))
