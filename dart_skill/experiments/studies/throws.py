"""The main job many times over, in process: teach, learn, throw at new baskets, for several seeds
and configurations.

`dart-skill experiment throws` prints the table that README and docs/throwing.md quote.

`best_share` says how many throws the best of all plans would get in, if the fingers gave the ball
another direction and speed each time. No plan can foresee this scatter. But a plan chooses how
steeply the ball flies, and where it aims: a flat throw is more sensitive to the direction, a steep
one to the speed. The bound tries all of them from the place where the ball was let go, whatever
the arm can do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from dart_skill.common.fleet import FLEET, arm_with
from dart_skill.common.flight import TENNIS_BALL, Ball, landing
from dart_skill.common.regions import REGION, targets_for
from dart_skill.common.world import the_world
from dart_skill.movement import azimuth_of
from dart_skill.recording import Demonstration
from dart_skill.session import Session, Trial
from dart_skill.simulation import ControllerSettings
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
    target: tuple[float, ...]
    along: float = np.nan
    across: float = np.nan
    in_basket: bool = False
    note: str = ""
    let_go: tuple[float, ...] = (np.nan, np.nan, np.nan)


def arm_of(arms: str, seed: int) -> str:
    """Name of the arm of a seed: `arms` itself, or the one that the seed draws from the fleet."""
    return f"{FLEET}:{seed}" if arms == FLEET else arms


def run_seed(
    seed: int,
    names: tuple[str, ...],
    demonstrations: int = 13,
    throws: int = 10,
    arms: str = "ideal",
    settings: tuple[str, ...] = (),
    controller: ControllerSettings | None = None,
) -> list[ThrowResult]:
    """All throws of one seed: one set of demonstrations, each configuration thrown at the same
    baskets.

    Parameters
    ----------
    arms
        Name of an arm, or "fleet": every seed draws its own.
    settings
        Parameters that differ, each as NODE.PARAMETER=VALUE.
    controller
        Of an arm that is driven to positions; default None, the arm takes torques.
    """
    arm = arm_of(arms, seed)
    session = Session.on_arm(arm, seed, settings, controller=controller)
    to_throw = targets_for(seed, demonstrations, throws)[1]
    kept = teach(session, seed, demonstrations)
    learned = cache(lambda name: TrialMemory(kept, configuration(name)).learn())
    results = []
    for name in names:
        for target in to_throw:
            try:
                thrown = _thrown(session, learned(name), target)
            except ValueError as error:
                thrown = {"note": str(error)}
            results.append(ThrowResult(seed, arm, name, tuple(target.tolist()), **thrown))
    session.close()
    return results


def _thrown(session: Session, skill: ThrowingSkill, target: np.ndarray) -> dict:
    plan = skill.plan(target)
    trial = session.throw(plan)
    along, across = along_and_across(trial.outcome.landing, target)
    let_go = plan.path.position[np.abs(plan.path.time - plan.release).argmin()]
    inside, note = trial.ball_was_in, trial.message
    where = {"along": along, "across": across, "let_go": tuple(let_go.tolist())}
    return {**where, "in_basket": inside, "note": note}


def along_and_across(landing: np.ndarray, target: np.ndarray) -> tuple[float, float]:
    """How far a landing (>= 2,) is from a target (>= 2,): in the direction of the throw, and to
    its left [m].
    """
    miss, ahead = landing[:2] - target[:2], target[:2] / np.hypot(*target[:2])
    return float(miss @ ahead), float(miss @ [-ahead[1], ahead[0]])


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


def summarise(results: Sequence[ThrowResult]) -> list[dict]:
    """One row per configuration: throws, in the basket, median and 90 % of the error, bias and
    spread along and across [cm].
    """
    rows = []
    for name in dict.fromkeys(result.configuration for result in results):
        part = [result for result in results if result.configuration == name]
        miss = 100 * np.array([(r.along, r.across) for r in part])
        miss = miss[np.isfinite(miss).all(axis=1)]
        error, spreads = np.linalg.norm(miss, axis=1), [miss.mean(axis=0), miss.std(axis=0)]
        numbers = {
            "median_cm": float(np.median(error)),
            "p90_cm": float(np.percentile(error, 90)),
            "worst_cm": float(error.max()),
            "along_cm": [float(value[0]) for value in spreads],
            "across_cm": [float(value[1]) for value in spreads],
        } if len(error) else dict.fromkeys(ERRORS)  # fmt: skip
        counts = {"throws": len(part), "in": sum(r.in_basket for r in part)}
        rows.append({"configuration": name, **counts, "landing_seen": len(error), **numbers})
    return rows


ERRORS = ("median_cm", "p90_cm", "worst_cm", "along_cm", "across_cm")
"""What is said of the errors, where a landing was seen."""


def summary(results: Sequence[ThrowResult]) -> dict:
    """Throws, those in the basket, and the median and 90 % of the error [m]; a throw that was not
    seen counts as farther than all.
    """
    error = np.nan_to_num([np.hypot(one.along, one.across) for one in results], nan=np.inf)
    shares = {"median_error_m": 0.5, "p90_error_m": 0.9}
    found = {
        name: float(np.quantile(error, share, method="higher")) if len(error) else np.inf
        for name, share in shares.items()
    }
    return {
        "thrown": len(results),
        "in": sum(one.in_basket for one in results),
        **{name: value if np.isfinite(value) else None for name, value in found.items()},
    }


def best_possible(results: Sequence[ThrowResult], settings: tuple[str, ...] = ()) -> float | None:
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
    radius = the_world().basket_radius - 0.25 * the_world().ball_diameter
    shares = []
    for one in results:
        if np.isfinite(one.let_go[0]):
            scatter = arm_with(one.arm, settings).get("wam_simulator", {})
            turn, speed = (
                float(scatter.get(f"release_{name}", 0.0)) for name in ("turn", "speed")
            )
            places = np.array(one.let_go), np.array(one.target)
            shares.append(best_share(*places, turn, speed, radius))
    return float(np.mean(shares)) if shares else None


FASTEST = 12.0
"""Faster than any WAM [m/s]: the bound shall not be one of the arm."""
SAMPLES = 4000
"""Number of directions and speeds with which each throw is tried."""


def best_share(
    position: np.ndarray,
    target: np.ndarray,
    turn: float,
    speed: float,
    radius: float,
    elevations: np.ndarray = np.arange(-20.0, 61.0, 5.0),  # noqa: B008
    faster: np.ndarray = np.linspace(-0.04, 0.04, 9),  # noqa: B008
) -> float:
    """Largest share of throws that come down within `radius` [m] of the target, over all
    directions and speeds.

    Parameters
    ----------
    position, target
        (3,) [m], where the ball leaves the hand, and the centre of the rim.
    turn
        Standard deviation of the direction on each of three axes [rad].
    speed
        Of the speed, as a share. Each direction and speed is tried with the same 4000 samples.
    elevations
        That are tried [degrees].
    faster
        Shares by which a throw is faster than the one that hits the centre: with a curved spread
        the best aim is beside it.

    Raises
    ------
    ValueError
        If no speed reaches the target.
    """
    rng = np.random.default_rng(0)
    turns = Rotation.from_rotvec(turn * rng.standard_normal((SAMPLES, 3)))
    speeds = 1.0 + speed * rng.standard_normal(SAMPLES)[:, None]
    positions = np.broadcast_to(position, (SAMPLES, 3))
    shares = []
    for elevation in np.radians(elevations):
        velocity = velocity_to(position, target, elevation)
        for more in faster if velocity is not None else ():
            scattered = speeds * turns.apply((1.0 + more) * velocity)
            away = landing(positions, scattered, target[2]).position - target
            shares.append(np.mean(np.hypot(away[:, 0], away[:, 1]) < radius))
    if not shares:
        raise ValueError(f"no throw from {position} m reaches {target} m at up to {FASTEST} m/s")
    return float(max(shares))


def velocity_to(
    position: np.ndarray, target: np.ndarray, elevation: float, ball: Ball = TENNIS_BALL
) -> np.ndarray | None:
    """The velocity (3,) [m/s] at an elevation [rad] with which a ball hits the target; None if no
    speed does.
    """
    away = target - position
    azimuth, flat = azimuth_of(away), np.cos(elevation)
    direction = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])

    def beyond(speed: float) -> float:
        hit = landing(position, speed * direction, target[2], ball).position
        return float(np.hypot(*(hit - position)[:2]) - np.hypot(*away[:2]))

    if not beyond(0.1) < 0.0 < beyond(FASTEST):
        return None
    return brentq(beyond, 0.1, FASTEST, xtol=1e-4) * direction


def table(results: Sequence[ThrowResult]) -> str:
    """The rows of `summarise` as text, with the reasons of misses below."""
    wide = max([15, *(len(result.configuration) for result in results)]) + 1
    lines = [
        f"{'configuration':<{wide}}{'in':>10}{'median':>9}{'90 %':>8}{'worst':>8}{'along':>15}{'across':>15}   [cm]"
    ]
    for row in summarise(results):
        share = f"{row['in']}/{row['throws']}"
        about = f"{row['configuration']:<{wide}}{share:>10}"
        if row["median_cm"] is None:
            lines.append(f"{about}   no landing was seen")
            continue
        numbers = "".join(f"{row[key]:>8.1f}" for key in ERRORS[:3])
        spread = [f"{row[key][0]:+.1f} +- {row[key][1]:.1f}" for key in ERRORS[3:]]
        lines.append(f"{about} {numbers}{spread[0]:>15}{spread[1]:>15}")
    misses = [r for r in results if not r.in_basket]
    for r in misses[:20]:
        why = r.note or f"{100 * r.along:+.1f} cm along, {100 * r.across:+.1f} cm across"
        lines.append(
            f"  missed: {r.configuration}, {r.arm}, seed {r.seed}, basket at"
            f" {np.hypot(r.target[0], r.target[1]):.2f} m: {why}"
        )
    lines += [f"  and {len(misses) - 20} more"] if len(misses) > 20 else []
    return "\n".join(lines)


def repeatability(
    seed: int, distances: Sequence[float], throws: int, demonstrations: int = 13, name: str = ""
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
    shown = [lesson.demonstration for lesson in lessons if lesson.outcome.in_basket]
    skill, rows = learn_throwing(shown, configuration(name)), []
    for distance in distances:
        target = np.array([distance, 0.0, REGION.rim])
        plan = skill.plan(target)
        landings = [session.throw(plan).outcome.landing[:2] for _ in range(throws)]
        miss = 100 * (np.array(landings) - target[:2])
        scatter = {"mean_cm": miss.mean(0).tolist(), "sd_cm": miss.std(0).tolist()}
        floor = float(np.median(np.linalg.norm(miss - miss.mean(0), axis=1)))
        rows.append({"distance_m": distance, "throws": throws, **scatter, "floor_cm": floor})
    session.close()
    return rows


def repeatability_table(rows: list[dict]) -> str:
    """The rows of `repeatability` as text."""
    lines = [
        f"{'distance [m]':>12}{'throws':>8}{'along [cm]':>16}{'across [cm]':>16}{'floor [cm]':>12}"
    ]
    for row in rows:
        pairs = zip(row["mean_cm"], row["sd_cm"], strict=True)
        along, across = (f"{m:+.2f} +- {s:.2f}" for m, s in pairs)
        lines.append(
            f"{row['distance_m']:>12.2f}{row['throws']:>8}{along:>16}{across:>16}{row['floor_cm']:>12.2f}"
        )
    said = "floor: median distance from the mean landing, which no better plan can reduce"
    return "\n".join([*lines, said])
