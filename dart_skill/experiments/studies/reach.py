"""Reaches into cups on belts that were not shown: how many end in the cup, how near, and why the
others do not.

Some are made a second time while the hand is held for a second, and once the cup goes into
a tunnel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dart_skill.arm import Command, Mode, PlanRefused
from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.pose_skills import arm_of, configured, shown
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import Demonstration
from dart_skill.session import BeltSession, SkillTrial
from dart_skill.simulation import Belt, Holder
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.learning import LearnedSkill
from dart_skill.skills.protocol import Skill
from dart_skill.skills.reach import Reach

HELD = (0.7, 1.7)
"""The hand is held from then to then after it set off [s]."""
TUNNEL = 2.0
"""The cup that is lost is in a tunnel from then on, since the world was reset [s]."""
KINDS = ("free", "held", "lost")
STOPPED = "the cup was last seen"
"""So begins the message of a motion that stops because its cup is lost."""


@dataclass(frozen=True)
class Reached:
    """One reach.

    Parameters
    ----------
    seed, kind
        Of KINDS.
    steady
        The belt ran at constant speed.
    speed
        Of the cup at most [m/s].
    success, reason
        As the skill judges it, or why the motion was stopped.
    rim, end
        Distance from the axis at the rim, and from the middle at the end [m]; nan if the hand did
        not come so far.
    fastest
        Greatest speed of the hand, of a hand that was held after that [m/s].
    crept
        By how much the phase went on while the hand was held [s].
    """

    seed: int
    kind: str
    steady: bool
    speed: float
    success: bool
    reason: str
    rim: float
    end: float
    fastest: float
    crept: float


def run(
    seeds: list[int],
    jobs: int = 1,
    demonstrations: int = 8,
    cups: int = 10,
    held: int = 3,
    arm: str = "ideal",
    representation: str = "",
) -> list[Reached]:
    """All seeds, `jobs` processes at a time.

    Parameters
    ----------
    cups
        That each seed reaches into.
    held
        How many of them again with a hand that is held.
    arm
        Of the fleet, or "fleet".
    representation
        As in `pose_skills.configured`.
    """
    one = partial(
        run_seed,
        demonstrations=demonstrations,
        cups=cups,
        held=held,
        arm=arm,
        representation=representation,
    )
    return all_of(one, seeds, jobs)


def run_seed(
    seed: int,
    demonstrations: int = 8,
    cups: int = 10,
    held: int = 3,
    arm: str = "ideal",
    representation: str = "",
) -> list[Reached]:
    """Show, learn, and reach into cups; the first few of them again with a hand that is held, and
    the first with a cup that is lost.

    An arm "fleet" is another one for every seed.

    Parameters
    ----------
    representation
        As in `pose_skills.configured`.
    """
    skill, rng = configured(Reach, representation), np.random.default_rng([seed, 11])
    session = BeltSession(skill, seed, arm=arm_of(arm, seed))
    learned = LearnedSkill(skill, teach(session, rng, demonstrations))
    belts = [drawn(skill, rng, wide=True) for _ in range(cups)]
    tasks = [("free", belt) for belt in belts] + [("held", belt) for belt in belts[:held]]
    tasks += [("lost", replace(belt, tunnel=TUNNEL)) for belt in belts[: min(held, 1)]]
    reached = [
        _reach(session, skill, learned.policy.guide(), seed, kind, belt) for kind, belt in tasks
    ]
    session.close()
    return reached


def teach(
    session: BeltSession, rng: np.random.Generator, demonstrations: int = 8
) -> list[Demonstration]:
    """Reaches that a person showed; one that fails is shown again with another cup.

    Raises
    ------
    ValueError
        Where most fail.
    """
    return shown(
        lambda: session.teach(drawn(session.skill, rng)), demonstrations, "reached {} cups"
    )


def drawn(skill: Skill, rng: np.random.Generator, wide: bool = False) -> Belt:
    """The belt of a situation in which the skill is shown, or, wide, tried."""
    situation = skill.draw(rng, wide)
    cup = situation.pose("cup")
    return Belt.of((cup.position, cup.quaternion), situation.numbers)


class _Hands:
    """A person who holds the arm from HELD[0] to HELD[1] after it set off. phases: of the guide
    meanwhile [s].
    """

    def __init__(self, session: BeltSession, guide: ReactiveGuide, seed: int):
        self._session, self._guide, self._holder = session, guide, Holder(seed)
        self._begun: int | None = None
        self.phases: list[float] = []
        self.released = np.inf

    def push(self) -> Command | None:
        arm, commander = self._session.plant.arm_state, self._session.commander
        if self._begun is None and commander.mode == Mode.EXECUTING:
            self._begun = arm.stamp_ns
        since = -1.0 if self._begun is None else (arm.stamp_ns - self._begun) * 1e-9
        holds = HELD[0] <= since < HELD[1]
        if holds:
            self.phases.append(self._guide.phase)
            self.released = arm.stamp_ns * 1e-9
        return self._holder.push(arm, holds)


def _reach(
    session: BeltSession, skill: Reach, guide: ReactiveGuide, seed: int, kind: str, belt: Belt
) -> Reached:
    hands = _Hands(session, guide, seed)
    speed = float(np.linalg.norm(belt.way)) / belt.duration * (1.0 if belt.steady else 1.875)
    nothing = 4 * (float("nan"),)
    try:
        trial = session.execute(guide, belt, hands.push if kind == "held" else lambda: None)
    except PlanRefused as error:
        return Reached(seed, kind, belt.steady, speed, False, str(error), *nothing)
    rim, end = _distances(skill, trial)
    fastest = _fastest(trial.seen, hands.released if kind == "held" else 0.0)
    crept = float(np.ptp(hands.phases)) if hands.phases else float("nan")
    reason = trial.message or trial.outcome.reason
    return Reached(seed, kind, belt.steady, speed, not reason, reason, rim, end, fastest, crept)


def _distances(skill: Reach, trial: SkillTrial) -> tuple[float, float]:
    try:
        return skill.distances(trial.seen)
    except ValueError:
        return float("nan"), float("nan")


def _fastest(seen: Demonstration, since: float) -> float:
    """Greatest speed of the hand after an instant [s], as the cameras saw it [m/s]."""
    later = seen.hand_time > since
    return float(
        VelocityThreshold().speeds(seen.hand_time, seen.hand_position)[later].max(initial=0.0)
    )


def table(reached: list[Reached]) -> str:
    """How many, medians and worst of hands that were free and of those that were held; then every
    failure with its reason.

    Parameters
    ----------
    reached
        Every cup.
    """
    lines = [
        f"{'':<6}{'in the cup':>12}{'at the rim [mm]':>18}{'at the end [mm]':>18}{'fastest [m/s]':>18}"
    ]
    lines.append(f"{'':<18}" + 3 * f"{'median  worst':>18}")
    for kind in ("free", "held"):
        if part := [one for one in reached if one.kind == kind]:
            rim, end, fastest = (
                np.array([getattr(one, name) for one in part])
                for name in ("rim", "end", "fastest")
            )
            cells = (
                _middle_and_worst(1e3 * rim),
                _middle_and_worst(1e3 * end),
                _middle_and_worst(fastest, 2),
            )
            counted = f"{sum(one.success for one in part)} of {len(part)}"
            lines.append(f"{kind:<6}{counted:>12}" + "".join(f"{cell:>18}" for cell in cells))
    crept = [one.crept for one in reached if np.isfinite(one.crept)]
    if crept:
        lines.append(
            f"held for {HELD[1] - HELD[0]:.0f} s, the phase goes on by {np.median(crept):.2f} s in"
            f" the median, {max(crept):.2f} s at most"
        )
    lost = [one for one in reached if one.kind == "lost"]
    if lost:
        lines.append(
            f"a cup that is lost: {sum(STOPPED in one.reason for one in lost)} of {len(lost)}"
            " stopped because of that"
        )
    return "\n".join(
        lines + [_failure(one) for one in reached if not one.success and STOPPED not in one.reason]
    )


def _failure(one: Reached) -> str:
    way = "at constant speed" if one.steady else "from rest to rest"
    return f"seed {one.seed}, {one.kind}, a cup {way} of {one.speed:.2f} m/s: {one.reason}"


def _middle_and_worst(values: np.ndarray, digits: int = 1) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):.{digits}f} {known.max():6.{digits}f}" if len(known) else "-"
