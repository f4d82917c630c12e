"""Published demonstrations of people: what the learning core reproduces, and what it makes of
starts and frames that it has not seen.

* Handwriting (LASA): trained on demonstrations 1 to 4, from the starts of all seven. The error is
  the dynamic time warping distance (DTWD, Sakoe and Chiba 1978) [mm]: the sum of the distances
  along the best alignment of two paths of 500 samples each. It is the mean of 1 to 4 (train) and 5
  to 7 (test). For what is driven by the state: the share of a grid of starts, over the rectangle
  of all demonstrations, that ends within 1 mm of the mean end of the training demonstrations.
* Handwriting of several patterns in one set (LASA's `Multi_Models`): each demonstration is left
  out once, and the others are learned, as one pattern and as those that `find_patterns` finds. The
  start says which of them is drawn. Error: DTWD of the demonstration left out.
* Letters and tasks with a led arm (HelloWorld, RoboTasks): as handwriting, trained on 1 to 4, from
  the starts of all. Error: the mean distance along the best alignment [cm]; of orientations, the
  mean angle along theirs [deg], and the worst at the same stamp of 1 to 4.
* Task-parameterised sets (pbdlib, TP-GMM): each demonstration is left out once. Error and goal:
  the mean distance along the best alignment, and that of the ends, in % of the diagonal of all
  demonstrations. Where samples of a set jump, or repeat for uneven times, each method also gets
  the paths alone, from rest to rest (`retimed`). Errors are those from the samples as published,
  in either case.

The demonstrations of a shape last differently long; their stamps are scaled to the mean duration.
Peers are used where they are installed. `dart-skill experiment real_data` prints the table that
docs/real_demonstrations.md quotes.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.published_sets import (
    Demonstrated,
    helloworld_sets,
    lasa_shapes,
    pbdlib_mixture,
    pbdlib_sets,
    robotasks_sets,
    tpgmm_sets,
)
from dart_skill.movement import (
    DSGMR,
    AutonomousDSGMR,
    AutonomousPolicy,
    DiscretePrimitive,
    TaskFrame,
    TaskParameterisedMixture,
    find_faults,
    find_patterns,
    make_continuous,
    resampled,
    retimed,
    smooth_derivatives,
    warped_distance,
)
from dart_skill.movement.pose import DiscretePosePrimitive, PoseDSGMR, PoseFrame, angles_between

N_TRAIN = 4
"""Number of demonstrations that are learned from."""
N_SAMPLES = 500
"""Samples of both paths that are compared, for handwriting and a led arm."""
NEAR = 1.0
"""How near the goal a start must end [mm]."""
COMPONENTS = 8
"""Components of a mixture."""
WEIGHTS = 50
"""Weights of a primitive for each dimension."""
PATIENCE = 8.0
"""Time that a start of the grid gets, in mean durations."""
STILL = [TaskFrame(np.eye(3), np.zeros(3))]
"""The frame of the world, of [t, x, y]."""
PEER = "movement_primitives"
"""A package that is compared, where it is installed."""
Reproduce = Callable[[np.ndarray], np.ndarray]
"""From a start (d,) to a path (n, d)."""
Generalise = Callable[
    [Sequence[Demonstrated], np.ndarray, Sequence[TaskFrame], np.ndarray], np.ndarray
]
"""From demonstrations, stamps (n,), new frames, and a start (d,) to a path (n, d)."""


@dataclass(frozen=True)
class Score:
    """One method on one set.

    Parameters
    ----------
    kind
        Of the set, "handwriting", "patterns", "led", "poses" or "frames".
    name
        Of the set.
    method
        In the words of the table.
    train, test
        DTWD [mm] for handwriting; mean distance [cm] for a led arm; for several patterns and for a
        task-parameterised set test is the error of what was left out ([mm] and [%]), and train
        nan.
    arrived
        Share of the grid that ends at the goal, nan for what has a clock.
    goal
        Of a task-parameterised set, the error of the ends [%].
    turned
        Of poses, the mean angle from what was not shown [deg].
    worst
        Of poses, the largest angle from what was shown, at the same stamp [deg].
    """

    kind: str
    name: str
    method: str
    train: float
    test: float
    arrived: float = np.nan
    goal: float = np.nan
    turned: float = np.nan
    worst: float = np.nan


def run(
    folder: Path, jobs: int = 1, shapes: Sequence[str] = (), pbdlib: Path | None = None
) -> list[Score]:
    """All that the folder holds of these sets.

    Parameters
    ----------
    folder
        With the files of one set or several.
    jobs
        Processes at a time.
    shapes
        Only these.
    pbdlib
        Checkout of pbdlib-python for Python 3, a peer in frames; None: without it.

    Raises
    ------
    ValueError
        It holds none, or not a shape that is named.
    """
    work: list[tuple[Callable, str, list[Demonstrated]]] = []
    problems = []
    for score, load in (
        (handwriting, lasa_shapes),
        (several_patterns, partial(lasa_shapes, several=True)),
        (led, helloworld_sets),
        (poses, robotasks_sets),
        (partial(left_out, pbdlib=pbdlib), pbdlib_sets),
        (partial(left_out, pbdlib=pbdlib), tpgmm_sets),
    ):
        try:
            work += [(score, *named) for named in load(folder).items()]
        except ValueError as error:
            problems.append(str(error))
    if not work or any("cannot be read" in problem for problem in problems):
        raise ValueError("; ".join(problems))
    names = [name for _, name, _ in work]
    if unknown := set(shapes) - set(names):
        raise ValueError(
            f"there is no {', '.join(sorted(unknown))} in {folder}; it holds {', '.join(names)}"
        )
    if pbdlib is not None:
        pbdlib_mixture(pbdlib)  # a wrong folder is said before anything takes its time
    return all_of(_scored, [one for one in work if not shapes or one[1] in shapes], jobs)


def _scored(work: tuple[Callable, str, list[Demonstrated]]) -> list[Score]:
    score, name, demonstrations = work
    return score(name, demonstrations)


def _scores(
    kind: str,
    name: str,
    methods: dict[str, Reproduce],
    paths: list[np.ndarray],
    distance: Callable[[np.ndarray, np.ndarray], float],
) -> list[Score]:
    """Mean distances of what methods make of the starts of paths from these paths."""
    scores = []
    for method, reproduce in methods.items():
        errors = [distance(reproduce(path[0]), path) for path in paths]
        train, test = float(np.mean(errors[:N_TRAIN])), float(np.mean(errors[N_TRAIN:]))
        scores.append(Score(kind, name, method, train, test))
    return scores


def _on_one_clock(
    demonstrations: Sequence[Demonstrated], rows: Sequence[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """N_SAMPLES stamps over the mean duration, and the rows of each demonstration at them."""
    duration = float(np.mean([one.time[-1] - one.time[0] for one in demonstrations]))
    return duration * np.linspace(0.0, 1.0, N_SAMPLES), [resampled(one, N_SAMPLES) for one in rows]


def handwriting(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on one shape."""
    positions = [one.position for one in demonstrations]
    clock, paths = _on_one_clock(demonstrations[:N_TRAIN], positions)
    policy = _driven_by_state(clock, paths[:N_TRAIN])
    own: dict[str, Reproduce] = {"AutonomousDSGMR": partial(_until_rest, policy, clock[-1])}
    methods = own | _driven_by_time(clock, paths[:N_TRAIN])
    first, *others = _scores("handwriting", name, methods, paths, _warped)
    return [replace(first, arrived=_arrived(policy, paths, clock[-1])), *others]


def _warped(made: np.ndarray, path: np.ndarray) -> float:
    return warped_distance(resampled(made, N_SAMPLES), path)[0]


def several_patterns(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """Each demonstration left out once: what the others make of its start, as driven by the state,
    as one pattern, and as those that are found.
    """
    paths = [resampled(one.position, N_SAMPLES) for one in demonstrations]
    errors = []
    for i, path in enumerate(paths):
        others = [j for j in range(len(paths)) if j != i]
        found = find_patterns([paths[j] for j in others])
        own = [others[k] for k in found.groups[found.beginning_at(path[0])]]
        for used in (others, own):
            shown = [demonstrations[j] for j in used]
            clock, learned = _on_one_clock(shown, [one.position for one in shown])
            policy = _driven_by_state(clock, learned)
            errors.append(_warped(_until_rest(policy, clock[-1], path[0]), path))
    in_one, each = np.reshape(errors, (-1, 2)).mean(axis=0)
    words = f"{len(find_patterns(paths).groups)} patterns"
    return [
        Score("patterns", name, f"AutonomousDSGMR, {how}", np.nan, float(error))
        for how, error in (("one pattern", in_one), (words, each))
    ]


def _driven_by_state(clock: np.ndarray, paths: list[np.ndarray]) -> AutonomousPolicy:
    motions = [smooth_derivatives(clock, path) for path in paths]
    n = len(paths)
    return AutonomousDSGMR(COMPONENTS).fit([clock] * n, motions, [STILL] * n).policy(STILL)


def _until_rest(policy: AutonomousPolicy, duration: float, start: np.ndarray) -> np.ndarray:
    """The path (n, d) from a start at rest until its end stays within NEAR of the goal."""
    run = policy.run(start, np.zeros_like(start), step=0.01, duration=PATIENCE * duration)
    away = np.flatnonzero(np.linalg.norm(run.position - policy.goal, axis=1) > NEAR)
    return run.position[: away[-1] + 2 if len(away) else 2]


def _arrived(policy: AutonomousPolicy, paths: list[np.ndarray], duration: float) -> float:
    """Share of a grid of 5 x 5 starts that end at the goal."""
    every, goal = np.vstack(paths), np.mean([path[-1] for path in paths[:N_TRAIN]], axis=0)
    axes = np.linspace(every.min(axis=0), every.max(axis=0), 5).T
    starts = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    still, last = np.zeros(len(axes)), PATIENCE * duration
    runs = [policy.run(start, still, step=0.02, duration=last) for start in starts]
    ends = np.array([run.position[-1] for run in runs])
    return float(np.mean(np.linalg.norm(ends - goal, axis=1) < NEAR))


def _driven_by_time(clock: np.ndarray, paths: list[np.ndarray]) -> dict[str, Reproduce]:
    """Methods with a clock. DS-GMR in two frames: one begins where the movement begins, the other
    stands at the goal; time counts once in their product.
    """
    model = DSGMR(COMPONENTS, n_shared=1)
    encoded = [model.encode(clock, path, faults="keep") for path in paths]
    model.fit(encoded, [_from_start(path[0]) for path in paths])
    options: dict[str, Any] = {"covariance": False}

    def by_ds_gmr(start: np.ndarray) -> np.ndarray:
        still = np.zeros_like(start)
        return model.reproduce(_from_start(start), clock, start, still, **options).position

    primitives = [DiscretePrimitive(WEIGHTS).fit(clock, path) for path in paths]
    methods: dict[str, Reproduce] = {"DSGMR": by_ds_gmr}
    methods["DiscretePrimitive, nearest"] = _nearest_of(primitives, clock, paths, "position")
    if importlib.util.find_spec(PEER) is not None:
        methods[f"{PEER}, nearest"] = _nearest_peer("DMP", clock, paths, range(paths[0].shape[1]))
    return methods


def _from_start(start: np.ndarray) -> list[TaskFrame]:
    """Frames of [t, position]: at the start (d,), and that of the world."""
    axes = np.eye(1 + len(start))
    return [TaskFrame(axes, np.array([0.0, *start])), TaskFrame(axes, np.zeros(len(axes)))]


def _nearest(paths: list[np.ndarray], start: np.ndarray) -> int:
    """The path that begins nearest to a start; orientations, which come after the position, are
    not asked.
    """
    return int(np.argmin([np.linalg.norm(path[0, :3] - start[:3]) for path in paths]))


def _nearest_of(
    primitives: Sequence[Any], clock: np.ndarray, paths: list[np.ndarray], rows: str
) -> Reproduce:
    """By the primitive of the path that begins nearest. rows: "position", or "pose"."""

    def reproduce(start: np.ndarray) -> np.ndarray:
        primitive = primitives[_nearest(paths, start)]
        return getattr(primitive.open_loop(clock, primitive.begin(start)), rows)

    return reproduce


def _nearest_peer(
    kind: str, clock: np.ndarray, paths: list[np.ndarray], order: Sequence[int]
) -> Reproduce:
    """By a primitive of the peer. order: of its columns, whose quaternions begin with w."""
    peer_class, columns = getattr(importlib.import_module(f"{PEER}.dmp"), kind), list(order)
    options = {"n_dims": len(columns)} if kind == "DMP" else {}

    def reproduce(start: np.ndarray) -> np.ndarray:
        path = paths[_nearest(paths, start)][:, columns]
        peer = peer_class(
            execution_time=clock[-1], dt=clock[1], n_weights_per_dim=WEIGHTS, **options
        )
        peer.imitate(clock, path)
        peer.configure(start_y=start[columns], goal_y=path[-1])
        return resampled(peer.open_loop()[1][:, np.argsort(columns)], N_SAMPLES)

    return reproduce


def led(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on positions of one set of a led arm."""
    positions = [one.position for one in demonstrations]
    clock, paths = _on_one_clock(demonstrations[:N_TRAIN], positions)
    return _scores("led", name, _driven_by_time(clock, paths[:N_TRAIN]), paths, _mean_distance)


def poses(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on one set of a led arm with orientations: those on positions, and those on
    poses.
    """
    rows = [np.column_stack([one.position, np.array(one.orientation)]) for one in demonstrations]
    clock, paths = _on_one_clock(demonstrations[:N_TRAIN], rows)
    for path in paths:
        path[:, 3:] /= np.linalg.norm(path[:, 3:], axis=1, keepdims=True)
    shown = paths[:N_TRAIN]

    def frames(start: np.ndarray) -> list[PoseFrame]:
        return [PoseFrame(start[:3]), PoseFrame(np.zeros(3))]

    model = PoseDSGMR(COMPONENTS)
    encoded = [model.encode(clock, path) for path in shown]
    model.fit(encoded, [frames(path[0]) for path in shown])
    methods: dict[str, Reproduce] = {
        "PoseDSGMR": lambda start: model.reproduce(frames(start), clock, start).pose
    }
    for words, how in (("DiscretePosePrimitive, nearest", "joint"), ("the same, by path", "path")):
        made = [DiscretePosePrimitive(WEIGHTS, regression=how).fit(clock, path) for path in shown]
        methods[words] = _nearest_of(made, clock, shown, "pose")
    if importlib.util.find_spec(PEER) is not None:
        w_first = [0, 1, 2, 6, 3, 4, 5]
        methods["CartesianDMP, nearest"] = _nearest_peer("CartesianDMP", clock, shown, w_first)
    scores = [replace(one, kind="poses") for one in led(name, demonstrations)]
    for one in _scores("poses", name, methods, paths, _position_distance):
        pairs = [(methods[one.method](path[0])[:, 3:], path[:, 3:]) for path in paths]
        turned = float(np.mean([mean_angle(*pair) for pair in pairs[N_TRAIN:]]))
        worst = max(angles_between(*pair).max() for pair in pairs[:N_TRAIN])
        scores.append(replace(one, turned=turned, worst=float(np.degrees(worst))))
    return scores


def _position_distance(made: np.ndarray, path: np.ndarray) -> float:
    return _mean_distance(made[:, :3], path[:, :3])


def _mean_distance(made: np.ndarray, path: np.ndarray) -> float:
    total, steps = warped_distance(resampled(made, N_SAMPLES), path)
    return total / steps


def mean_angle(made: np.ndarray, path: np.ndarray) -> float:
    """Mean angle [deg] of orientations (n, 4) along their best alignment: a chord of length c on
    S3 is an angle of 4 asin(c / 2).
    """
    chord = _mean_distance(make_continuous(made) * np.sign(made[0] @ path[0]), path)
    return float(np.degrees(4.0 * np.arcsin(0.5 * chord)))


def left_out(
    name: str, demonstrations: Sequence[Demonstrated], pbdlib: Path | None = None
) -> list[Score]:
    """The methods on one task-parameterised set, each demonstration left out once; its stamps are
    scaled to the mean duration.

    Parameters
    ----------
    pbdlib
        As in `run`. Where samples jump or repeat for uneven times, all methods also learn from the
        paths alone.
    """
    methods: dict[str, Generalise] = {
        "DSGMR": _by_ds_gmr,
        "DSGMR, prior": partial(_by_ds_gmr, with_prior=True),
        "GMR": _by_regression,
    }
    if pbdlib is not None:
        methods["pbdlib"] = partial(_by_pbdlib, pbdlib_mixture(pbdlib))
    duration = float(np.mean([one.time[-1] for one in demonstrations]))
    scaled = [replace(one, time=one.time * duration / one.time[-1]) for one in demonstrations]
    prepared = {"": scaled}
    faults = [find_faults(one.time, one.position) for one in demonstrations]
    if any(one.uneven or one.jumps for one in faults):  # stamps that say nothing of the movement
        prepared[", retimed"] = [
            Demonstrated(*retimed(one.position, duration, 200), one.frames)
            for one in demonstrations
        ]
    scores = []
    for how, learned in prepared.items():
        for method, generalise in methods.items():
            error, goal = _left_out_by(generalise, learned, scaled)
            scores.append(Score("frames", name, method + how, np.nan, error, goal=goal))
    return scores


def _left_out_by(
    generalise: Generalise, learned: Sequence[Demonstrated], published: Sequence[Demonstrated]
) -> tuple[float, float]:
    """Error, and error of the end [%], of what is learned without one, from that as published."""
    everything = np.vstack([one.position for one in published])
    unit = float(np.linalg.norm(np.ptp(everything, axis=0))) / 100.0
    errors = []
    for i, unseen in enumerate(published):
        clock, path = np.linspace(0.0, unseen.time[-1], len(unseen.time)), unseen.position
        others = [*learned[:i], *learned[i + 1 :]]
        made = generalise(others, clock, unseen.frames, path[0])
        total, steps = warped_distance(made, path)
        errors.append([total / steps / unit, float(np.linalg.norm(made[-1] - path[-1])) / unit])
    error, goal = np.mean(errors, axis=0)
    return float(error), float(goal)


def _by_ds_gmr(
    shown: Sequence[Demonstrated],
    clock: np.ndarray,
    frames: Sequence[TaskFrame],
    start: np.ndarray,
    with_prior: bool = False,
) -> np.ndarray:
    """The prior on the covariances counts as many samples as there are columns."""
    model = DSGMR(COMPONENTS, covariance_prior=(1.0 + len(start)) * with_prior)
    encoded = [model.encode(one.time, one.position, faults="keep") for one in shown]
    model.fit(encoded, [one.frames for one in shown])
    return model.reproduce(frames, clock, start, np.zeros_like(start), covariance=False).position


def _by_regression(
    shown: Sequence[Demonstrated],
    clock: np.ndarray,
    frames: Sequence[TaskFrame],
    start: np.ndarray,
) -> np.ndarray:
    """The mixture of time and positions, without attractors: nothing is differentiated, and the
    start is not asked for.
    """
    samples = [np.column_stack([one.time, one.position]) for one in shown]
    model = TaskParameterisedMixture(COMPONENTS).fit(samples, [one.frames for one in shown])
    columns = np.arange(1, 1 + len(start))
    return model.regress(frames, clock[:, None], [0], columns, covariance=False)[0]


def _by_pbdlib(
    peer_class: Any,
    shown: Sequence[Demonstrated],
    clock: np.ndarray,
    frames: Sequence[TaskFrame],
    _: np.ndarray,
) -> np.ndarray:
    """Its mixture of time and positions as seen from two frames side by side, from its slices of
    time, with its own regularisation.
    """
    samples = [np.column_stack([one.time, one.position]) for one in shown]
    seen = [
        np.hstack([frame.to_frame(rows) for frame in one.frames])
        for one, rows in zip(shown, samples, strict=True)
    ]
    m = samples[0].shape[1]
    peer = peer_class(nb_states=COMPONENTS, nb_dim=2 * m)
    apart = np.kron(np.eye(2), np.ones((m, m)))
    peer.init_hmm_kbins(seen)
    peer.sigma = peer.sigma * apart
    peer.em(np.vstack(seen), reg=1e-8 * np.eye(2 * m), no_init=True, dep_mask=apart)
    one, other = (
        peer.marginal_model(slice(j * m, (j + 1) * m)).lintrans(frame.A, frame.b)
        for j, frame in enumerate(frames)
    )
    return (one * other).condition(clock[:, None], dim_in=slice(0, 1), dim_out=slice(1, m))[0]


def table(scores: Sequence[Score]) -> str:
    """The scores as a table: means over the shapes of handwriting and the sets of letters, and
    each set of several patterns, poses or frames.
    """
    lines = []
    for kind, head in HEADS.items():
        rows = [score for score in scores if score.kind == kind]
        if rows and kind in ("handwriting", "led"):
            rows = [_mean_of(rows, method) for method in dict.fromkeys(r.method for r in rows)]
        lines += [head, *map(_line, rows)] if rows else []
    if importlib.util.find_spec(PEER) is None:
        lines.append(f"{PEER} is not installed, so there is no row of it")
    return "\n".join(lines)


HEADS = {
    "handwriting": f"{'method':<32}{'shapes':>7}{'train [mm]':>12}{'test [mm]':>12}{'at the goal':>13}",
    "patterns": f"{'set, left out':<20}{'method':<30}{'error [mm]':>12}",
    "led": f"{'method':<32}{'sets':>7}{'train [cm]':>12}{'test [cm]':>12}",
    "poses": f"{'task':<22}{'method':<32}{'train [cm]':>12}{'test [cm]':>12}{'test [deg]':>12}{'worst [deg]':>13}",
    "frames": f"{'set, left out':<20}{'method':<24}{'error [%]':>12}{'goal [%]':>12}",
}
"""Head of the table of each kind."""


def _mean_of(rows: Sequence[Score], method: str) -> Score:
    """Means over the sets of a method, with their number as the name."""
    own = [row for row in rows if row.method == method]
    train, test, arrived = np.mean([(row.train, row.test, row.arrived) for row in own], axis=0)
    return Score(own[0].kind, str(len(own)), method, train, test, arrived)


def _line(row: Score) -> str:
    if row.kind == "patterns":
        return f"{row.name:<20}{row.method:<30}{row.test:>12.0f}"
    if row.kind == "frames":
        return f"{row.name:<20}{row.method:<24}{row.test:>12.2f}{row.goal:>12.2f}"
    if row.kind == "poses":
        angles = "" if np.isnan(row.turned) else f"{row.turned:>12.1f}{row.worst:>13.1f}"
        return f"{row.name:<22}{row.method:<32}{row.train:>12.2f}{row.test:>12.2f}{angles}"
    about = f"{row.method:<32}{row.name:>7}"
    if row.kind == "led":
        return f"{about}{row.train:>12.2f}{row.test:>12.2f}"
    share = "-" if np.isnan(row.arrived) else f"{100.0 * row.arrived:.0f} %"
    return f"{about}{row.train:>12.0f}{row.test:>12.0f}{share:>13}"
