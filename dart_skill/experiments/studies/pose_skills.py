"""Skills of poses in situations that were not shown.

`place`: parts put into holders that stand elsewhere than where it was shown, and turned: how many
go in, how near, and why the others do not.

`reach`: reaches into cups on belts: how many end in the cup, how near, and why the others do not.
Some are made a second time while the hand is held for a second, and once the cup goes into a
tunnel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import Command, Commander, Mode, PlanRefused
from dart_skill.common.constants import HAND
from dart_skill.common.fleet import of_nodes, skill_settings
from dart_skill.common.situation import Pose
from dart_skill.experiments.studies.throws import arm_of
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import Demonstration
from dart_skill.session import BeltSession, BenchSession, SkillTrial
from dart_skill.simulation import Belt, Holder, Workbench
from dart_skill.skills.execution import ReactiveGuide
from dart_skill.skills.learning import LearnedSkill, NoPlan
from dart_skill.skills.place import Place
from dart_skill.skills.protocol import Skill, TaskOutcome, load_skill
from dart_skill.skills.reach import Reach

ATTEMPTS = 3
"""Largest number of movements that a person shows for each that succeeds."""
PRESSED_FOR = 0.05
"""Forces are means over so long [s]: the engine's own of a step are no forces of a contact."""
NEAR = 0.1
"""Distance from the end of a plan at which cameras lose the hand [m]."""
NAN = float("nan")
"""What was not measured."""


PoseSkill = TypeVar("PoseSkill", Place, Reach)


def _skill(kind: type[PoseSkill], settings: Sequence[str]) -> PoseSkill:
    """The skill as it is configured, but for those settings of it."""
    skill = load_skill(kind.name, changes=skill_settings(settings))
    assert isinstance(skill, kind)
    return skill


def shown(show: Callable[[], SkillTrial], demonstrations: int, what: str) -> list[Demonstration]:
    """Demonstrations that succeeded; one that fails is shown again.

    Parameters
    ----------
    show
        A person shows one, of a new situation.
    demonstrations
        How many must succeed.
    what
        The person did with how many, in words, "reached {} cups".

    Raises
    ------
    ValueError
        Where most fail.
    """
    kept: list[Demonstration] = []
    for _ in range(ATTEMPTS * demonstrations):
        trial = show()
        kept += [trial.seen] if trial.outcome.success else []
        if len(kept) == demonstrations:
            return kept
    raise ValueError(
        f"the person {what.format(f'only {len(kept)} of {ATTEMPTS * demonstrations}')}; the last:"
        f" {trial.outcome.reason}"
    )


@dataclass(frozen=True)
class Placed:
    """One part, and what came of it.

    Parameters
    ----------
    seed
        Of the person who showed the skill.
    away, turn
        How far its holder was from where the skill was shown [m], and how far turned [rad].
    success, error, reason
        The outcome, error in [m].
    pressed
        Largest force of the part that is held on its holder, a mean of `PRESSED_FOR`, by the
        simulator's own word [N].
    """

    seed: int
    away: float
    turn: float
    success: bool
    error: float
    reason: str
    pressed: float = NAN


def teach_place(
    session: BenchSession, skill: Place, rng: np.random.Generator, demonstrations: int = 8
) -> list[Demonstration]:
    """Demonstrations of parts that a person put into holders; what jams is tried again with another
    holder.

    Raises
    ------
    ValueError
        Where most of it does.
    """
    return shown(
        lambda: session.teach(skill.draw(rng).pose("holder"), skill.seat),
        demonstrations,
        "put {} parts in",
    )


def place_seed(
    seed: int,
    demonstrations: int = 8,
    parts: int = 10,
    arm: str = "ideal",
    settings: Sequence[str] = (),
    own: int = 0,
    unseen: float = 0.0,
) -> list[Placed]:
    """Show, learn, and place parts, with what one seed draws. An arm "fleet" is another one for
    every seed.

    Parameters
    ----------
    settings
        Parameters of nodes and settings of the skill that differ, each as NODE.PARAMETER=VALUE.
    own
        Tries before those that count, from which the skill learns.
    unseen
        The cameras lose the hand for so long, once it is so near to where it ends (`NEAR`) [s].
    """
    skill, rng = _skill(Place, settings), np.random.default_rng([seed, 7])
    session = BenchSession(skill, seed, arm=arm_of(arm, seed), settings=of_nodes(settings))
    learned = LearnedSkill(skill, teach_place(session, skill, rng, demonstrations))
    placed = []
    for number in range(own + parts):
        holder = skill.draw(rng, wide=True).pose("holder")
        one, outcome = _place_once(session, learned, holder, skill.settings.shown_at, unseen)
        if number >= own:
            placed.append(one)
        elif outcome is not None:
            learned.tell(outcome)
    session.close()
    return placed


class LostHand:
    """Cameras that lose the hand for a while, once it is near to where a plan ends.

    Parameters
    ----------
    commander
        Whom they tell what they see.
    end
        Where the plan ends (3,) [m].
    unseen
        How long the hand is lost [s].
    near
        Distance from there at which it is lost [m], default `NEAR`.
    """

    def __init__(self, commander: Commander, end: np.ndarray, unseen: float, near: float = NEAR):
        self._commander, self._end, self._unseen, self._near = commander, end, unseen, near
        self._lost_ns: int | None = None

    def see(self, body: str, stamp_ns: int, position: np.ndarray, quaternion: np.ndarray) -> None:
        """See `Commander`."""
        if body == HAND:
            if self._lost_ns is None and np.linalg.norm(position - self._end) < self._near:
                self._lost_ns = stamp_ns
            if self._lost_ns is not None and stamp_ns - self._lost_ns < 1e9 * self._unseen:
                return
        self._commander.see(body, stamp_ns, position, quaternion)


class Pressing:
    """Notes how hard a part that is held presses against its holder.

    Parameters
    ----------
    plant
        The world.
    """

    def __init__(self, plant: Workbench):
        self._plant, self._forces = plant, list[float]()

    def note(self) -> None:
        """Note the force of now; nothing is done to the arm."""
        self._forces.append(float(np.linalg.norm(self._plant.pressing)))

    def most(self) -> float:
        """Largest mean over `PRESSED_FOR` [N]."""
        steps = round(PRESSED_FOR * 1e9 / self._plant.settings.step_ns)
        return float(np.convolve(self._forces, np.full(steps, 1.0 / steps), "valid").max())


def _place_once(
    session: BenchSession,
    learned: LearnedSkill,
    holder: Pose,
    shown_at: Sequence[float],
    unseen: float,
) -> tuple[Placed, TaskOutcome | None]:
    """One part, and what came of it; None without a plan."""
    away = float(np.hypot(*(holder.position[:2] - shown_at)))
    turn = float(Rotation.from_quat(holder.quaternion).as_rotvec()[2])
    try:
        plan = learned.plan(session.situation(holder))
        eyes = LostHand(session.commander, plan.path.position[-1], unseen)
        pressing = Pressing(session.plant)
        trial = session.execute(plan, eyes, pressing.note)
    except (NoPlan, PlanRefused) as refusal:
        return Placed(session.seed, away, turn, False, NAN, str(refusal)), None
    outcome = trial.outcome
    reason = trial.message or outcome.reason
    about = (session.seed, away, turn, outcome.success, outcome.error, reason)
    return Placed(*about, pressing.most()), outcome


def place_table(placed: Sequence[Placed]) -> str:
    """How many went in, how near, and every failure with its reason.

    Parameters
    ----------
    placed
        Every part.
    """
    errors = 1e3 * np.array([one.error for one in placed if one.success])
    lines = [f"{len(errors)} of {len(placed)} parts are in their holders"]
    if len(errors):
        median = f"{np.median(errors):.1f} mm from the seat in the median"
        lines.append(f"{median}, {errors.max():.1f} mm at worst")
    if len(forces := np.array([one.pressed for one in placed if np.isfinite(one.pressed)])):
        shares = np.percentile(forces, [50, 90])
        lines.append(
            f"pressed against the holder with {shares[0]:.0f} N in the median, {shares[1]:.0f} N in"
            f" nine of ten, {forces.max():.0f} N at most"
        )
    for one in placed:
        if not one.success:
            turned = f"turned by {np.degrees(one.turn):+.0f} degrees"
            lines.append(f"seed {one.seed}, {100 * one.away:.0f} cm away, {turned}: {one.reason}")
    return "\n".join(lines)


HELD = (0.7, 1.7)
"""The hand is held from then to then after it set off [s]."""
TUNNEL = 2.0
"""The cup that is lost is in a tunnel from then on, since the world was reset [s]."""
STOPPED = "the cup was last seen"
"""So begins the message of a motion that stops because its cup is lost."""


@dataclass(frozen=True)
class Reached:
    """One reach.

    Parameters
    ----------
    kind
        "free", "held" or "lost".
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
    rim: float = NAN
    end: float = NAN
    fastest: float = NAN
    crept: float = NAN


def teach_reach(
    session: BeltSession, rng: np.random.Generator, demonstrations: int = 8
) -> list[Demonstration]:
    """Reaches that a person showed; one that fails is shown again with another cup.

    Raises
    ------
    ValueError
        Where most fail.
    """
    skill, what = session.skill, "reached {} cups"
    return shown(lambda: session.teach(belt_drawn(skill, rng)), demonstrations, what)


def belt_drawn(skill: Skill, rng: np.random.Generator, wide: bool = False) -> Belt:
    """The belt of a situation in which the skill is shown, or, wide, tried."""
    situation = skill.draw(rng, wide)
    cup = situation.pose("cup")
    return Belt.of((cup.position, cup.quaternion), situation.numbers)


def reach_seed(
    seed: int,
    demonstrations: int = 8,
    cups: int = 10,
    held: int = 3,
    arm: str = "ideal",
    settings: Sequence[str] = (),
) -> list[Reached]:
    """Show, learn, and reach into cups; the first few of them again with a hand that is held, and
    the first with a cup that is lost.

    An arm "fleet" is another one for every seed.

    Parameters
    ----------
    settings
        Parameters of nodes and settings of the skill that differ, each as NODE.PARAMETER=VALUE.
    """
    skill, rng = _skill(Reach, settings), np.random.default_rng([seed, 11])
    session = BeltSession(skill, seed, arm=arm_of(arm, seed), settings=of_nodes(settings))
    learned = LearnedSkill(skill, teach_reach(session, rng, demonstrations))
    belts = [belt_drawn(skill, rng, wide=True) for _ in range(cups)]
    tasks = [("free", belt) for belt in belts] + [("held", belt) for belt in belts[:held]]
    tasks += [("lost", replace(belt, tunnel=TUNNEL)) for belt in belts[: min(held, 1)]]
    reached = [
        _reach(session, skill, learned.policy.guide(), seed, kind, belt) for kind, belt in tasks
    ]
    session.close()
    return reached


def _reach(
    session: BeltSession, skill: Reach, guide: ReactiveGuide, seed: int, kind: str, belt: Belt
) -> Reached:
    holder, begun_ns = Holder(seed), None
    released = np.inf if kind == "held" else 0.0
    phases: list[float] = []

    def push() -> Command | None:
        """A person holds the arm from HELD[0] to HELD[1] after it set off."""
        nonlocal begun_ns, released
        arm = session.plant.arm_state
        if begun_ns is None and session.commander.mode == Mode.EXECUTING:
            begun_ns = arm.stamp_ns
        since = -1.0 if begun_ns is None else (arm.stamp_ns - begun_ns) * 1e-9
        holds = HELD[0] <= since < HELD[1]
        if holds:
            phases.append(guide.phase)
            released = arm.stamp_ns * 1e-9
        return holder.push(arm, holds)

    speed = float(np.linalg.norm(belt.way)) / belt.duration * (1.0 if belt.steady else 1.875)
    about = (seed, kind, belt.steady, speed)
    try:
        trial = session.execute(guide, belt, push if kind == "held" else lambda: None)
    except PlanRefused as error:
        return Reached(*about, False, str(error))
    try:
        rim, end = skill.distances(trial.seen)
    except ValueError:
        rim, end = NAN, NAN
    seen = trial.seen
    speeds = VelocityThreshold().speeds(seen.hand_time, seen.hand_position)
    fastest = float(speeds[seen.hand_time > released].max(initial=0.0))
    crept = float(np.ptp(phases)) if phases else NAN
    reason = trial.message or trial.outcome.reason
    return Reached(*about, not reason, reason, rim, end, fastest, crept)


def reach_table(reached: Sequence[Reached]) -> str:
    """How many, medians and worst of hands that were free and of those that were held; then every
    failure with its reason.

    Parameters
    ----------
    reached
        Every cup.
    """
    lines = [
        f"{'':<6}{'in the cup':>12}{'at the rim [mm]':>18}{'at the end [mm]':>18}{'fastest [m/s]':>18}",
        f"{'':<18}" + 3 * f"{'median  worst':>18}",
    ]
    for kind in ("free", "held"):
        if part := [one for one in reached if one.kind == kind]:
            counted = f"{sum(one.success for one in part)} of {len(part)}"
            cells = (
                _middle_and_worst([1e3 * one.rim for one in part]),
                _middle_and_worst([1e3 * one.end for one in part]),
                _middle_and_worst([one.fastest for one in part], 2),
            )
            lines.append(f"{kind:<6}{counted:>12}" + "".join(f"{cell:>18}" for cell in cells))
    if crept := [one.crept for one in reached if np.isfinite(one.crept)]:
        lines.append(
            f"held for {HELD[1] - HELD[0]:.0f} s, the phase goes on by {np.median(crept):.2f} s in"
            f" the median, {max(crept):.2f} s at most"
        )
    if lost := [one for one in reached if one.kind == "lost"]:
        stopped = sum(STOPPED in one.reason for one in lost)
        lines.append(f"a cup that is lost: {stopped} of {len(lost)} stopped because of that")
    for one in reached:
        if not one.success and STOPPED not in one.reason:
            way = "at constant speed" if one.steady else "from rest to rest"
            where = f"seed {one.seed}, {one.kind}, a cup {way} of {one.speed:.2f} m/s"
            lines.append(f"{where}: {one.reason}")
    return "\n".join(lines)


def _middle_and_worst(values: Sequence[float], digits: int = 1) -> str:
    known = [value for value in values if np.isfinite(value)]
    return f"{np.median(known):.{digits}f} {max(known):6.{digits}f}" if known else "-"
