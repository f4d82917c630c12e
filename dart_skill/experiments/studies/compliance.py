"""What stiffness from the demonstrations buys: how hard the arm resists a person where the
demonstrations varied, and how well it keeps to the path where they agreed.

The same demonstrations and baskets for each kind of gains. The hand follows the law (7.19) alone
(`tracking: none`). `dart-skill experiment compliance` prints the table that docs/throwing.md quotes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from dart_skill.arm import (
    ArmModel,
    CommanderSettings,
    Impedance,
    PlanRefused,
    PoseGains,
    Reference,
    References,
    ThrowPlan,
    attractor_acceleration,
)
from dart_skill.common.constants import N_JOINTS
from dart_skill.common.regions import targets_for
from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.throws import teach
from dart_skill.session import Session
from dart_skill.simulation import PlantState
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


def run(
    seeds: list[int], jobs: int = 1, demonstrations: int = 13, throws: int = 5, name: str = ""
) -> list[GrabbedThrow]:
    """All seeds, `jobs` processes at a time.

    Parameters
    ----------
    throws
        Of each seed and kind.
    name
        Of the configuration, "" for the default one.
    """
    one = partial(run_seed, demonstrations=demonstrations, throws=throws, name=name)
    return all_of(one, seeds, jobs)


def run_seed(
    seed: int, demonstrations: int = 13, throws: int = 5, name: str = ""
) -> list[GrabbedThrow]:
    """The throws of one seed, of each kind at the same baskets; a plan that is refused is left
    out.
    """
    session = Session(
        seed, commander=CommanderSettings.configured(tracking="none"), keep_states=True
    )
    kept, swings = teach(session, seed, demonstrations), []
    for kind, stiffness in KINDS.items():
        skill = learn_throwing(kept, replace(configuration(name), **stiffness))
        for target in targets_for(seed, demonstrations, throws)[1]:
            try:
                swings.append(_swing(session, kind, skill, skill.plan(target)))
            except PlanRefused:
                continue
    session.close()
    return swings


def _swing(session: Session, kind: str, skill: ThrowingSkill, plan: ThrowPlan) -> GrabbedThrow:
    trial = session.throw(plan)
    if session.commander.opened_ns is None:
        raise PlanRefused(trial.message)
    # each was answered by a command with its stamp
    stamps = np.array([one.stamp_ns for one in trial.states])
    clock = (stamps - plan.begin_ns(session.commander.opened_ns, stamps)) * 1e-9
    swing = (clock >= 0.0) & (clock <= plan.release)
    time, states = clock[swing], [trial.states[k] for k in np.flatnonzero(swing)]
    variance, axes = np.linalg.eigh(
        skill.covariance_along(plan)[
            np.searchsorted(plan.path.time, time).clip(max=len(plan.path.time) - 1)
        ]
    )
    expected = np.column_stack(
        [np.interp(time, plan.path.time, column) for column in plan.path.position.T]
    )
    error = np.array([one.hand_position for one in states]) - expected
    varied, agreed = int(variance[:, -1].argmax()), int(variance[:, 0].argmin())
    arm, references = Impedance(ArmModel(ball_in_hand=True)), References(plan.motion)

    def force(k: int, axis: int) -> float:
        return _resistance(arm, references.gains_at(time[k]), states[k], axes[k, :, axis])

    def off(axis: int) -> float:
        return float(np.sqrt(np.mean(np.einsum("ni,ni->n", error, axes[:, :, axis]) ** 2)))

    return GrabbedThrow(
        kind,
        (force(varied, -1), force(agreed, 0)),
        (off(-1), off(0)),
        float(trial.outcome.landing_error),
    )


def _resistance(arm: Impedance, gains: PoseGains, state: PlantState, axis: np.ndarray) -> float:
    """Force with which the law pulls a hand back [N] that is GRABBED off along an axis (3,)."""
    hand = arm.model.hand_state(state.position, np.zeros(N_JOINTS))
    where = replace(hand, position=hand.position + GRABBED * axis)
    reference = Reference(
        hand.position, hand.rotation, hand.position, hand.rotation, np.zeros(6), np.zeros(6)
    )
    pulls = np.zeros(6), attractor_acceleration(reference, where, gains)
    without, off = (
        arm.act(state.position, state.velocity, pull, state.position)[0] for pull in pulls
    )
    return float(np.linalg.norm((off - without)[:3]))


def table(swings: list[GrabbedThrow]) -> str:
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
        force, off = (
            np.median([one.force for one in part], axis=0),
            1e3 * np.median([one.off for one in part], axis=0),
        )
        miss = 100 * np.nanmedian([one.miss for one in part])
        forces, distances = f"{force[0]:.0f}, {force[1]:.0f}", f"{off[0]:.1f}, {off[1]:.1f}"
        lines.append(f"{kind:<12}{len(part):>8}{forces:>38}{distances:>26}{miss:>12.1f}")
    return "\n".join(lines)
