"""The main job many times over, in process: teach, learn, throw at new baskets, for several seeds
and configurations.

`dart-skill experiment throws` prints the table that README and docs/throwing.md quote.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from dart_skill.arm import PlanRefused
from dart_skill.common.fleet import FLEET, arm_with
from dart_skill.common.regions import REGION, targets_for
from dart_skill.common.world import the_world
from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.scatter_bound import best_share
from dart_skill.recording import Demonstration
from dart_skill.session import Session, Trial
from dart_skill.skills.learning import ThrowingSkill, configuration, learn_throwing
from dart_skill.skills.practice import TrialMemory


@dataclass(frozen=True)
class ThrowResult:
    """One throw at a new basket.

    Parameters
    ----------
    seed
        Of everything random.
    arm
        Of config/fleet.yaml.
    configuration
        Of the skill.
    target
        Centre of the rim (3,) [m].
    along, across
        Miss in the direction of the throw and to its left [m]; nan if it was not seen or not
        thrown.
    in_basket
        Whether the ball was in, by the simulator's own word.
    note
        Why it was not thrown, or what the commander said.
    let_go
        Where the plan lets the ball go (3,) [m]; nan without a plan.
    """

    seed: int
    arm: str
    configuration: str
    target: tuple[float, float, float]
    along: float
    across: float
    in_basket: bool
    note: str
    let_go: tuple[float, float, float] = (np.nan, np.nan, np.nan)


def run_seed(
    seed: int,
    names: tuple[str, ...],
    demonstrations: int = 13,
    throws: int = 10,
    arms: str = "ideal",
    settings: tuple[str, ...] = (),
) -> list[ThrowResult]:
    """All throws of one seed: one set of demonstrations, each configuration thrown at the same
    baskets.

    Parameters
    ----------
    arms
        Name of an arm, or "fleet": every seed draws its own.
    settings
        Parameters that differ, each as NODE.PARAMETER=VALUE.
    """
    arm = arm_of(arms, seed)
    session = Session.on_arm(arm, seed, settings)
    to_throw = targets_for(seed, demonstrations, throws)[1]
    kept = teach(session, seed, demonstrations)
    results = []
    for name in names:
        try:
            skill = TrialMemory(kept, configuration(name)).learn()
        except ValueError as error:
            results += [_not_thrown(seed, arm, name, target, str(error)) for target in to_throw]
            continue
        results += [_throw(session, seed, arm, name, skill, target) for target in to_throw]
    session.close()
    return results


def arm_of(arms: str, seed: int) -> str:
    """Name of the arm of a seed: `arms` itself, or the one that the seed draws from the fleet."""
    return f"{FLEET}:{seed}" if arms == FLEET else arms


def teach(session: Session, seed: int, wanted: int) -> list[Demonstration]:
    """As many demonstrations as wanted, each of a throw that went in; fewer if the person fails as
    often again.
    """
    rng, kept = np.random.default_rng([seed, 3]), []
    for target in [*targets_for(seed, wanted, 0)[0], *REGION.spread(wanted, rng)]:
        lesson = taught(session, target)
        if lesson is not None:
            kept.append(lesson.demonstration)
        if len(kept) == wanted:
            break
    return kept


def taught(session: Session, target: np.ndarray) -> Trial | None:
    """The guided throw that went in, or None: a person who does not get it in, or whom the
    recorder cannot follow, goes on elsewhere.

    Parameters
    ----------
    target
        The basket (3,) [m].
    """
    try:
        lesson = session.teach(target)[-1]
    except ValueError:
        return None
    return lesson if lesson.outcome.in_basket else None


def _not_thrown(seed: int, arm: str, name: str, target: np.ndarray, why: str) -> ThrowResult:
    x, y, z = (float(value) for value in target)
    return ThrowResult(seed, arm, name, (x, y, z), np.nan, np.nan, False, why)


def _throw(
    session: Session, seed: int, arm: str, name: str, skill: ThrowingSkill, target: np.ndarray
) -> ThrowResult:
    x, y, z = (float(value) for value in target)
    try:
        plan = skill.plan(target)
        trial = session.throw(plan)
    except (PlanRefused, ValueError) as error:
        return _not_thrown(seed, arm, name, target, str(error))
    direction = target[:2] / np.hypot(*target[:2])
    miss = trial.outcome.landing[:2] - target[:2]
    across = float(miss @ [-direction[1], direction[0]])
    here = plan.path.position[np.abs(plan.path.time - plan.release).argmin()]
    let_go = (float(here[0]), float(here[1]), float(here[2]))
    return ThrowResult(
        seed,
        arm,
        name,
        (x, y, z),
        float(miss @ direction),
        across,
        trial.ball_was_in,
        trial.message,
        let_go,
    )


def run(
    seeds: list[int],
    names: tuple[str, ...],
    jobs: int = 1,
    demonstrations: int = 13,
    throws: int = 10,
    arms: str = "ideal",
    settings: tuple[str, ...] = (),
    scheduler: str = "",
) -> list[ThrowResult]:
    """All seeds, `jobs` processes at a time; a progress bar on stderr when it is a terminal.

    Parameters
    ----------
    arms, settings
        As in `run_seed`.
    names
        Of the configurations.
    throws
        Of each.
    scheduler
        Address of a Dask scheduler, whose workers run them instead.
    """
    one = partial(
        run_seed,
        names=names,
        demonstrations=demonstrations,
        throws=throws,
        arms=arms,
        settings=settings,
    )
    return all_of(one, seeds, jobs, scheduler)


def summarise(results: list[ThrowResult]) -> list[dict]:
    """One row per configuration: throws, in the basket, median and 90 % of the error, bias and
    spread along and across [cm].
    """
    rows = []
    for name in dict.fromkeys(result.configuration for result in results):
        part = [result for result in results if result.configuration == name]
        miss = 100 * np.array([(r.along, r.across) for r in part])
        error = np.linalg.norm(miss, axis=1)
        seen = np.isfinite(error)
        rows.append(
            {
                "configuration": name,
                "throws": len(part),
                "in": sum(r.in_basket for r in part),
                "landing_seen": int(seen.sum()),
                "median_cm": float(np.median(error[seen])) if seen.any() else None,
                "p90_cm": float(np.percentile(error[seen], 90)) if seen.any() else None,
                "worst_cm": float(error[seen].max()) if seen.any() else None,
                "along_cm": (
                    [float(miss[seen, 0].mean()), float(miss[seen, 0].std())]
                    if seen.any()
                    else None
                ),
                "across_cm": (
                    [float(miss[seen, 1].mean()), float(miss[seen, 1].std())]
                    if seen.any()
                    else None
                ),
            }
        )
    return rows


def summary(results: list[ThrowResult]) -> dict:
    """Throws, those in the basket, and the median and 90 % of the error [m]; a throw that was not
    seen counts as farther than all.
    """
    error = np.array(
        [np.inf if np.isnan(one.along) else np.hypot(one.along, one.across) for one in results]
    )
    median, p90 = (
        np.quantile(error, [0.5, 0.9], method="higher").tolist()
        if len(error)
        else (np.inf, np.inf)
    )
    seen = {"median_error_m": median, "p90_error_m": p90}
    return {
        "thrown": len(results),
        "in": sum(one.in_basket for one in results),
        **{name: value if np.isfinite(value) else None for name, value in seen.items()},
    }


def best_possible(results: list[ThrowResult], settings: tuple[str, ...] = ()) -> float | None:
    """Share of these throws that would be in with the best of all plans, given how the arm's
    fingers scatter direction and speed.

    Parameters
    ----------
    settings
        Parameters with which they were thrown, as in `run_seed`. A ball counts as in whose centre
        comes down inside the rim by half a ball: of 180 throws of `scattering_hand` the farthest
        that fell in was 13.5 cm from the centre, the nearest that did not 13.3 cm. None if no
        throw was planned.
    """
    thrown = [one for one in results if np.isfinite(one.let_go[0])]
    radius = the_world().basket_radius - 0.25 * the_world().ball_diameter
    shares = []
    for one in thrown:
        scatter = arm_with(one.arm, settings).get("wam_simulator", {})
        turn, speed = (float(scatter.get(name, 0.0)) for name in ("release_turn", "release_speed"))
        shares.append(best_share(np.array(one.let_go), np.array(one.target), turn, speed, radius))
    return float(np.mean(shares)) if shares else None


def table(results: list[ThrowResult]) -> str:
    """The rows of `summarise` as text, with the reasons of misses below."""
    wide = max([15, *(len(result.configuration) for result in results)]) + 1
    head = (
        f"{'configuration':<{wide}}{'in':>10}{'median':>9}{'90 %':>8}{'worst':>8}{'along':>15}{'across':>15}"
        "   [cm]"
    )
    lines = [head]
    for row in summarise(results):
        share = f"{row['in']}/{row['throws']}"
        if row["median_cm"] is None:
            lines.append(f"{row['configuration']:<{wide}}{share:>10}   no landing was seen")
            continue
        spread = [f"{row[key][0]:+.1f} +- {row[key][1]:.1f}" for key in ("along_cm", "across_cm")]
        numbers = "".join(f"{row[key]:>8.1f}" for key in ("median_cm", "p90_cm", "worst_cm"))
        lines.append(
            f"{row['configuration']:<{wide}}{share:>10} {numbers}{spread[0]:>15}{spread[1]:>15}"
        )
    misses = [r for r in results if not r.in_basket]
    for r in misses[:20]:
        why = r.note or f"{100 * r.along:+.1f} cm along, {100 * r.across:+.1f} cm across"
        lines.append(
            f"  missed: {r.configuration}, {r.arm}, seed {r.seed}, basket at"
            f" {np.hypot(*r.target[:2]):.2f} m: {why}"
        )
    if len(misses) > 20:
        lines.append(f"  and {len(misses) - 20} more")
    return "\n".join(lines)


def repeatability(
    seed: int, distances: list[float], throws: int, demonstrations: int = 13, name: str = ""
) -> list[dict]:
    """One plan thrown again and again, straight ahead: what of the error is the hand's, not the
    plan's.

    Per distance: mean and standard deviation of the landing along and across [cm], and the median
    distance from the mean landing.

    Parameters
    ----------
    distances
        Of the basket [m].
    throws
        At each.
    name
        Of the configuration, "" for the default one.
    """
    session = Session(seed)
    lessons = [session.teach(target)[-1] for target in targets_for(seed, demonstrations, 0)[0]]
    skill = learn_throwing(
        [lesson.demonstration for lesson in lessons if lesson.outcome.in_basket],
        configuration(name),
    )
    rows = []
    for distance in distances:
        target = np.array([distance, 0.0, REGION.rim])
        plan = skill.plan(target)
        miss = 100 * np.array(
            [session.throw(plan).outcome.landing[:2] - target[:2] for _ in range(throws)]
        )
        floor = float(np.median(np.linalg.norm(miss - miss.mean(0), axis=1)))
        row = {
            "distance_m": distance,
            "throws": throws,
            "mean_cm": miss.mean(0).tolist(),
            "sd_cm": miss.std(0).tolist(),
            "floor_cm": floor,
        }
        rows.append(row)
    session.close()
    return rows


def repeatability_table(rows: list[dict]) -> str:
    """The rows of `repeatability` as text."""
    lines = [
        f"{'distance [m]':>12}{'throws':>8}{'along [cm]':>16}{'across [cm]':>16}{'floor [cm]':>12}"
    ]
    for row in rows:
        along, across = (
            f"{m:+.2f} +- {s:.2f}" for m, s in zip(row["mean_cm"], row["sd_cm"], strict=True)
        )
        lines.append(
            f"{row['distance_m']:>12.2f}{row['throws']:>8}{along:>16}{across:>16}{row['floor_cm']:>12.2f}"
        )
    return "\n".join(
        [*lines, "floor: median distance from the mean landing, which no better plan can reduce"]
    )
