"""What stiffness from the demonstrations buys: how hard the arm resists a person where the
demonstrations varied, and how well it keeps to the path where they agreed.

The same demonstrations and baskets for each kind of gains. The hand follows the law (7.19) alone
(`tracking: none`). `dart-skill experiment compliance` prints the table that docs/throwing.md quotes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dart_skill.arm import (
    ArmModel,
    CommanderSettings,
    Impedance,
    MotionPlan,
    PlanRefused,
    PoseGains,
    Reference,
    References,
    attractor_acceleration,
)
from dart_skill.common.arm_choice import joint_count
from dart_skill.common.regions import targets_for
from dart_skill.experiments.studies.throws import teach
from dart_skill.session import Session
from dart_skill.skills.learning import ThrowingSkill, configuration, learn_throwing

GRABBED = 0.05
"""A person pulls the hand so far aside [m]."""
KINDS: dict[str, dict[str, Any]] = {
    "50": {"stiffness": 50.0},
    "200": {"stiffness": 200.0},
    "800": {"stiffness": 800.0},
    "50 to 800": {"stiffness_range": (50.0, 800.0)},
}
"""Stiffness of the position [1/s^2], as a configuration has it, by what it is called."""


@dataclass(frozen=True)
class GrabbedThrow:
    """One throw. `varied` and `agreed` are the instants and axes in which the demonstrations
    varied most, and least.

    Parameters
    ----------
    kind
        Of KINDS.
    force
        What the arm pulls back with where its hand is GRABBED off, (varied, agreed) [N].
    off
        Root mean square distance from the path until the release along these axes, (varied,
        agreed) [m].
    miss
        Of the ball, nan if it was not seen [m].
    """

    kind: str
    force: tuple[float, float]
    off: tuple[float, float]
    miss: float


def run_seed(
    seed: int, demonstrations: int = 13, throws: int = 5, name: str = ""
) -> list[GrabbedThrow]:
    """The throws of one seed, of each kind at the same baskets; a plan that is refused is left
    out.

    Parameters
    ----------
    throws
        Of each kind.
    name
        Of the configuration, "" for the default one.
    """
    settings = CommanderSettings.configured(tracking="none")
    session = Session(seed, commander=settings, keep_states=True)
    kept, swings = teach(session, seed, demonstrations), []
    for kind, stiffness in KINDS.items():
        skill = learn_throwing(kept, replace(configuration(name), **stiffness))
        for target in targets_for(seed, demonstrations, throws)[1]:
            try:
                swings.append(grabbed_throw(session, kind, skill, skill.plan(target)))
            except PlanRefused:
                continue
    session.close()
    return swings


def grabbed_throw(
    session: Session, kind: str, skill: ThrowingSkill, plan: MotionPlan
) -> GrabbedThrow:
    """Throw with gains of a kind, and ask how hard the arm would have resisted."""
    trial = session.throw(plan)
    if session.commander.opened_ns is None:
        raise PlanRefused(trial.message)
    # each was answered by a command with its stamp
    stamps = np.array([one.stamp_ns for one in trial.states])
    clock = (stamps - plan.begin_ns(session.commander.opened_ns, stamps)) * 1e-9
    swing = (clock >= 0.0) & (clock <= plan.release)
    time, path = clock[swing], plan.path
    states = [state for state, within in zip(trial.states, swing, strict=True) if within]
    steps = np.searchsorted(path.time, time).clip(max=len(path.time) - 1)
    variance, axes = np.linalg.eigh(skill.covariance_along(plan)[steps])
    expected = np.column_stack([np.interp(time, path.time, one) for one in path.position.T])
    error = np.array([one.hand_position for one in states]) - expected
    arm, references = Impedance(ArmModel(ball_in_hand=True)), References(plan)
    force, off = [], []
    for axis, k in ((-1, int(variance[:, -1].argmax())), (0, int(variance[:, 0].argmin()))):
        gains, state = references.gains_at(time[k]), states[k]
        where = (state.position, state.velocity)
        force.append(resistance(arm, gains, *where, axes[k, :, axis]))
        along = np.einsum("ni,ni->n", error, axes[:, :, axis])
        off.append(float(np.sqrt(np.mean(along**2))))
    miss = float(trial.outcome.landing_error)
    return GrabbedThrow(kind, (force[0], force[1]), (off[0], off[1]), miss)


def resistance(
    arm: Impedance, gains: PoseGains, position: np.ndarray, velocity: np.ndarray, axis: np.ndarray
) -> float:
    """Force with which the law pulls a hand back [N] that is GRABBED off along an axis (3,), of an
    arm with joints at a position (7,) [rad] and a velocity (7,) [rad/s].
    """
    hand = arm.model.hand_state(position, np.zeros(joint_count()))
    where = replace(hand, position=hand.position + GRABBED * axis)
    at_rest = 2 * (hand.position, hand.rotation) + 2 * (np.zeros(6),)
    pulls = np.zeros(6), attractor_acceleration(Reference(*at_rest), where, gains)
    without, off = (arm.act(position, velocity, pull, position)[0] for pull in pulls)
    return float(np.linalg.norm((off - without)[:3]))


def table(swings: Sequence[GrabbedThrow]) -> str:
    """A row for each kind: medians over its throws.

    Parameters
    ----------
    swings
        Every throw.
    """
    lines = [
        f"{'stiffness':<12}{'throws':>8}{'force where they varied, agreed [N]':>38}{'off the path there [mm]':>26}{'miss [cm]':>12}"
    ]
    for kind in dict.fromkeys(one.kind for one in swings):
        part = [one for one in swings if one.kind == kind]
        force = "{:.0f}, {:.0f}".format(*np.median([one.force for one in part], axis=0))
        off = "{:.1f}, {:.1f}".format(*(1e3 * np.median([one.off for one in part], axis=0)))
        miss = 100 * np.nanmedian([one.miss for one in part])
        lines.append(f"{kind:<12}{len(part):>8}{force:>38}{off:>26}{miss:>12.1f}")
    return "\n".join(lines)
