"""`stir`: pots that stand elsewhere than where it was shown, at frequencies that were not shown. How
near the spoon is to its circle, how exact the frequency, how smoothly it starts and stops; and the
same while the hand is held for a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import trapezoid

from dart_skill.arm import Command, Mode, PlanRefused
from dart_skill.common.fleet import of_nodes, skill_settings
from dart_skill.common.situation import Situation
from dart_skill.experiments.studies.pose_skills import NAN, shown
from dart_skill.experiments.studies.throws import arm_of
from dart_skill.session import BenchSession
from dart_skill.simulation import Holder
from dart_skill.skills.learning import LearnedSkill, Rhythmic
from dart_skill.skills.protocol import load_skill
from dart_skill.skills.stir import Stir

HELD = (1.5, 2.5)
"""The hand is held from then to then after the first turn began, by the plan [s]."""
NEAR = 0.15
"""About an instant at which it starts or stops, as far as jumps are looked for [s]."""
SETTLED = 0.5
"""After the hand was let go the path counts again after so long [s]."""


@dataclass(frozen=True)
class StirTrial:
    """One pot that was stirred.

    Parameters
    ----------
    seed, kind
        Of the person; "free" or "held".
    frequency
        That was asked for [1/s].
    success, reason
        As the skill judges it; of a hand that was held, whether the path is on its circle after
        that.
    error
        Of the tip from its circle, root mean square [m].
    off
        Of the frequency, as a share.
    starts, stops
        Largest change of the velocity that is commanded in one step of the arm, where the movement and
        the turns start, and where they stop [m/s].
    crept
        How far the phase went on while the hand was held, in turns.
    returned
        How long after that the tip was farther from its circle than it may be on the mean [s].
    """

    seed: int
    kind: str
    frequency: float
    success: bool
    reason: str = ""
    error: float = NAN
    off: float = NAN
    starts: float = NAN
    stops: float = NAN
    crept: float = NAN
    returned: float = NAN


class _Noted:
    """What was commanded, and where the tip was, at each step of a movement, while a person may hold
    the hand.
    """

    def __init__(self, session: BenchSession, pot: Situation, held: tuple[float, float]):
        self._session, self._situation, self._held = session, pot, held
        self._holder, self._begun_ns = Holder(session.seed), 0
        self.time = list[float]()
        self.velocity, self.tip = list[np.ndarray](), list[np.ndarray]()

    def push(self) -> Command | None:
        """What is done to the arm now."""
        session = self._session
        arm, reference = session.plant.arm_state, session.commander.reference
        if session.commander.mode != Mode.EXECUTING or reference is None:
            return self._holder.push(arm, False)
        self._begun_ns = self._begun_ns or arm.stamp_ns
        since = (arm.stamp_ns - self._begun_ns) * 1e-9
        self.time.append(since)
        self.velocity.append(reference.velocity[:3])
        self.tip.append(self._tip())
        return self._holder.push(arm, self._held[0] <= since < self._held[1])

    def _tip(self) -> np.ndarray:
        skill, (place, turn) = self._session.skill, self._session.plant.bodies["spoon"]
        assert isinstance(skill, Stir)
        return skill.tip_in(self._situation.pose("pot"), place, turn)

    def largest_change(self, instants: Sequence[float]) -> float:
        """Largest change of the commanded velocity in a step, near some instants [m/s]."""
        time, changes = np.array(self.time[1:]), np.diff(self.velocity, axis=0)
        near = np.any([np.abs(time - one) < NEAR for one in instants], axis=0)
        return float(np.linalg.norm(changes[near], axis=1).max())


def stir_seed(
    seed: int,
    demonstrations: int = 1,
    pots: int = 3,
    held: int = 1,
    arm: str = "ideal",
    settings: Sequence[str] = (),
) -> list[StirTrial]:
    """Show, learn, and stir in pots; the first few of them again with a hand that is held.

    An arm "fleet" is another one for every seed.

    Parameters
    ----------
    settings
        Parameters of nodes and settings of the skill that differ, each as NODE.PARAMETER=VALUE.
    """
    skill = load_skill(Stir.name, changes=skill_settings(settings))
    assert isinstance(skill, Stir)
    rng = np.random.default_rng([seed, 13])
    session = BenchSession(skill, seed, arm=arm_of(arm, seed), settings=of_nodes(settings))
    lessons = shown(lambda: session.show(skill.draw(rng)), demonstrations, "stirred in {} pots")
    learned = LearnedSkill(skill, lessons)
    asked = [skill.draw(rng, wide=True) for _ in range(pots)]
    tasks = [("free", one) for one in asked] + [("held", one) for one in asked[:held]]
    trials = [_stir(session, skill, learned, seed, kind, one) for kind, one in tasks]
    session.close()
    return trials


def _stir(
    session: BenchSession,
    skill: Stir,
    learned: LearnedSkill,
    seed: int,
    kind: str,
    asked: Situation,
) -> StirTrial:
    about = (seed, kind, asked.numbers["frequency"])
    seen = replace(session.situation(asked.pose("pot")), numbers=asked.numbers)
    assert isinstance(learned.encoded, Rhythmic)
    begin, end = learned.encoded.turns_between(seen)
    until = (begin + HELD[0], begin + HELD[1]) if kind == "held" else (0.0, 0.0)
    noted = _Noted(session, asked, until)
    try:
        plan = learned.plan(seen)
        trial = session.execute(plan, push=noted.push, numbers=asked.numbers)
    except (PlanRefused, ValueError) as error:
        return StirTrial(*about, False, str(error))
    if trial.message:
        return StirTrial(*about, False, trial.message)
    if kind == "held":
        return _after_held(StirTrial(*about, False), skill, noted, until)
    made = skill.stirred(trial.seen, seen)
    return StirTrial(
        *about,
        trial.outcome.success,
        trial.outcome.reason,
        made.error,
        abs(made.frequency / asked.numbers["frequency"] - 1.0),
        noted.largest_change((0.0, begin)),
        noted.largest_change((end, plan.end)),
    )


def _after_held(
    trial: StirTrial, skill: Stir, noted: _Noted, held: tuple[float, float]
) -> StirTrial:
    """What became of a hand that was held: while it was, and in the turn after that."""
    s, time, tip = skill.settings, np.array(noted.time), np.array(noted.tip)
    off = np.hypot(np.hypot(*tip[:, :2].T) - s.radius, tip[:, 2] - s.height)
    during = (time >= held[0]) & (time < held[1])
    way = trapezoid(np.linalg.norm(np.array(noted.velocity)[during], axis=1), time[during])
    after = (time >= held[1]) & (time < held[1] + 1.0 / trial.frequency)
    far = np.flatnonzero(off[after] > s.path_tolerance)
    counts = time[after] >= held[1] + SETTLED
    error = float(np.sqrt(np.mean(np.square(off[after][counts]))))
    return replace(
        trial,
        success=error < s.path_tolerance,
        reason="" if error < s.path_tolerance else "it did not come back to its circle",
        error=error,
        crept=float(way / (2.0 * np.pi * s.radius)),
        returned=float(time[after][far[-1]] - held[1]) if len(far) else 0.0,
    )


def stir_table(trials: Sequence[StirTrial]) -> str:
    """How many, medians and worst; then every failure with its reason.

    Parameters
    ----------
    trials
        Every pot.
    """
    lines = []
    free, held = ([one for one in trials if one.kind == kind] for kind in ("free", "held"))
    lines.append(f"{sum(one.success for one in free)} of {len(free)} pots are stirred as asked")
    lines.append(f"{_both([1e3 * one.error for one in free])} mm from the circle")
    lines.append(f"{_both([100.0 * one.off for one in free], 2)} % off the frequency")
    for what, name in (("where it starts", "starts"), ("where it stops", "stops")):
        changes = [1e3 * getattr(one, name) for one in free]
        lines.append(f"the commanded velocity changes by {_both(changes)} mm/s in a step, {what}")
    if held:
        lines.append(
            f"held for {HELD[1] - HELD[0]:.0f} s: {sum(one.success for one in held)} of"
            f" {len(held)} come back to the circle, {_both([1e3 * one.error for one in held])} mm"
            " from it in the turn after that"
        )
        lines.append(
            f"meanwhile the phase goes on by {_both([one.crept for one in held], 3)} turns"
        )
        lines.append(f"the spoon is back after {_both([one.returned for one in held], 2)} s")
    for one in trials:
        if not one.success:
            lines.append(f"seed {one.seed}, {one.kind}, {one.frequency:.2f} /s: {one.reason}")
    return "\n".join(lines)


def _both(values: Sequence[float], digits: int = 1) -> str:
    """Median and worst, in words."""
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return "-"
    return f"{np.median(known):.{digits}f} (at worst {max(known):.{digits}f})"
