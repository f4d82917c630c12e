"""Parts put into holders that stand elsewhere than where it was shown, and turned: how many go in,
how near, and why the others do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import PlanRefused
from dart_skill.common.situation import Pose
from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.pose_skills import arm_of, configured, shown
from dart_skill.recording import Demonstration
from dart_skill.session import BenchSession
from dart_skill.skills.learning import LearnedSkill, NoPlan
from dart_skill.skills.place import Place


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
    """

    seed: int
    away: float
    turn: float
    success: bool
    error: float
    reason: str


def run(
    seeds: list[int],
    jobs: int = 1,
    demonstrations: int = 8,
    parts: int = 10,
    arm: str = "ideal",
    representation: str = "",
) -> list[Placed]:
    """All seeds, `jobs` processes at a time.

    Parameters
    ----------
    parts
        That each seed places.
    arm
        Of the fleet, or "fleet".
    representation
        As in `pose_skills.configured`.
    """
    one = partial(
        run_seed,
        demonstrations=demonstrations,
        parts=parts,
        arm=arm,
        representation=representation,
    )
    return all_of(one, seeds, jobs)


def run_seed(
    seed: int,
    demonstrations: int = 8,
    parts: int = 10,
    arm: str = "ideal",
    representation: str = "",
) -> list[Placed]:
    """Show, learn, and place parts, with what one seed draws. An arm "fleet" is another one for
    every seed.

    Parameters
    ----------
    representation
        As in `pose_skills.configured`.
    """
    skill, rng = configured(Place, representation), np.random.default_rng([seed, 7])
    session = BenchSession(skill, seed, arm=arm_of(arm, seed))
    learned = LearnedSkill(skill, teach(session, skill, rng, demonstrations))
    placed = [
        _place(session, skill, learned, seed, skill.draw(rng, wide=True).pose("holder"))
        for _ in range(parts)
    ]
    session.close()
    return placed


def teach(
    session: BenchSession, skill: Place, rng: np.random.Generator, demonstrations: int = 8
) -> list[Demonstration]:
    """Demonstrations of parts that a person put into holders.

    What jams is tried again with another holder.

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


def _place(
    session: BenchSession, skill: Place, learned: LearnedSkill, seed: int, holder: Pose
) -> Placed:
    away = float(np.hypot(*(holder.position[:2] - skill.settings.shown_at)))
    turn = float(Rotation.from_quat(holder.quaternion).as_rotvec()[2])
    try:
        trial = session.execute(learned.plan(session.situation(holder)))
    except (NoPlan, PlanRefused) as error:
        return Placed(seed, away, turn, False, float("nan"), str(error))
    learned.tell(trial.outcome)
    return Placed(
        seed,
        away,
        turn,
        trial.outcome.success,
        trial.outcome.error,
        trial.message or trial.outcome.reason,
    )


def table(placed: list[Placed]) -> str:
    """How many went in, how near, and every failure with its reason.

    Parameters
    ----------
    placed
        Every part.
    """
    errors = 1e3 * np.array([one.error for one in placed if one.success])
    lines = [f"{len(errors)} of {len(placed)} parts are in their holders"]
    if len(errors):
        lines.append(
            f"{np.median(errors):.1f} mm from the seat in the median, {errors.max():.1f} mm at"
            " worst"
        )
    for one in placed:
        if not one.success:
            lines.append(
                f"seed {one.seed}, {100 * one.away:.0f} cm away, turned by"
                f" {np.degrees(one.turn):+.0f} degrees: {one.reason}"
            )
    return "\n".join(lines)
