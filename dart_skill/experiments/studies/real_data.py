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
from dart_skill.experiments.studies.peers import pbdlib_mixture
from dart_skill.experiments.studies.published_sets import (
    Demonstrated,
    helloworld_sets,
    lasa_shapes,
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
N_SAMPLES = 500
"""Samples of both paths that are compared, for handwriting."""
GRID = 5
"""Starts along either side of the grid."""
NEAR = 1.0
"""How near the goal a start must end [mm]."""
COMPONENTS = 8
WEIGHTS = 50
STEP = 0.01
PATIENCE = 8.0
"""Time that a start of the grid gets, in mean durations."""
STILL = [TaskFrame(np.eye(3), np.zeros(3))]
PATH_SAMPLES = 200
"""Samples of a path that is retimed."""
PEER = "movement_primitives"
PEER_REGULARISATION = 1e-8
"""Default of pbdlib, which it adds on the diagonal of its covariances."""
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
    work: list[tuple[str, str, list[Demonstrated]]] = []
    problems = []
    for kind, load in (
        ("handwriting", lasa_shapes),
        ("patterns", partial(lasa_shapes, several=True)),
        ("led", helloworld_sets),
        ("poses", robotasks_sets),
        ("frames", pbdlib_sets),
        ("frames", tpgmm_sets),
    ):
        try:
            work += [(kind, name, demonstrations) for name, demonstrations in load(folder).items()]
        except ValueError as error:
            problems.append(str(error))
    if not work or any("cannot be read" in problem for problem in problems):
        raise ValueError("; ".join(problems))
    unknown = set(shapes) - {name for _, name, _ in work}
    if unknown:
        raise ValueError(
            f"there is no {', '.join(sorted(unknown))} in {folder}; it holds"
            f" {', '.join(name for _, name, _ in work)}"
        )
    work = [one for one in work if not shapes or one[1] in shapes]
    if pbdlib is not None:
        pbdlib_mixture(pbdlib)  # a wrong folder is said before anything takes its time
    return all_of(partial(_scored, work, pbdlib), list(range(len(work))), jobs)


def _scored(
    work: Sequence[tuple[str, str, list[Demonstrated]]], pbdlib: Path | None, i: int
) -> list[Score]:
    kind, name, demonstrations = work[i]
    if kind == "frames":
        return left_out(name, demonstrations, pbdlib)
    return {"handwriting": handwriting, "patterns": several_patterns, "led": led, "poses": poses}[
        kind
    ](name, demonstrations)


def handwriting(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on one shape."""
    shown = demonstrations[:N_TRAIN]
    duration = float(np.mean([one.time[-1] - one.time[0] for one in shown]))
    clock = duration * np.linspace(0.0, 1.0, N_SAMPLES)
    paths = [resampled(one.position, N_SAMPLES) for one in demonstrations]
    policy = _driven_by_state(clock, paths[:N_TRAIN])
    methods: dict[str, Reproduce] = {
        "AutonomousDSGMR": partial(_until_rest, policy, duration),
        "DSGMR": _driven_by_clock(clock, paths[:N_TRAIN]),
        "DiscretePrimitive, nearest": _nearest_primitive(clock, paths[:N_TRAIN]),
    }
    if importlib.util.find_spec(PEER) is not None:
        methods[f"{PEER}, nearest"] = _nearest_peer(clock, paths[:N_TRAIN])
    arrived = {"AutonomousDSGMR": _arrived(policy, paths, duration)}
    scores = []
    for method, reproduce in methods.items():
        errors = [
            warped_distance(resampled(reproduce(path[0]), N_SAMPLES), path)[0] for path in paths
        ]
        train, test = float(np.mean(errors[:N_TRAIN])), float(np.mean(errors[N_TRAIN:]))
        scores.append(Score("handwriting", name, method, train, test, arrived.get(method, np.nan)))
    return scores


def several_patterns(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """Each demonstration left out once: what the others make of its start, as one pattern, and as
    those that are found.
    """
    paths = [resampled(one.position, N_SAMPLES) for one in demonstrations]
    errors = []
    for i, path in enumerate(paths):
        others = [j for j in range(len(paths)) if j != i]
        found = find_patterns([paths[j] for j in others])
        own = [others[k] for k in found.groups[found.beginning_at(path[0])]]
        errors.append(
            [
                _error_of(path, [paths[j] for j in used], [demonstrations[j] for j in used])
                for used in (others, own)
            ]
        )
    in_one, each = np.mean(errors, axis=0)
    words = f"{len(find_patterns(paths).groups)} patterns"
    return [
        Score("patterns", name, "AutonomousDSGMR, one pattern", np.nan, float(in_one)),
        Score("patterns", name, f"AutonomousDSGMR, {words}", np.nan, float(each)),
    ]


def _error_of(
    path: np.ndarray, shown: list[np.ndarray], demonstrations: Sequence[Demonstrated]
) -> float:
    """DTWD [mm] of a path from what these demonstrations make of its start, as driven by the
    state.
    """
    duration = float(np.mean([one.time[-1] - one.time[0] for one in demonstrations]))
    policy = _driven_by_state(duration * np.linspace(0.0, 1.0, N_SAMPLES), shown)
    return warped_distance(resampled(_until_rest(policy, duration, path[0]), N_SAMPLES), path)[0]


def _driven_by_state(clock: np.ndarray, paths: list[np.ndarray]) -> AutonomousPolicy:
    motions = [smooth_derivatives(clock, path) for path in paths]
    return (
        AutonomousDSGMR(COMPONENTS)
        .fit([clock] * len(paths), motions, [STILL] * len(paths))
        .policy(STILL)
    )


def _until_rest(policy: AutonomousPolicy, duration: float, start: np.ndarray) -> np.ndarray:
    """The path (n, d) from a start at rest until its end stays within NEAR of the goal."""
    run = policy.run(start, np.zeros_like(start), step=STEP, duration=PATIENCE * duration)
    away = np.flatnonzero(np.linalg.norm(run.position - policy.goal, axis=1) > NEAR)
    return run.position[: away[-1] + 2 if len(away) else 2]


def _arrived(policy: AutonomousPolicy, paths: list[np.ndarray], duration: float) -> float:
    every, goal = np.vstack(paths), np.mean([path[-1] for path in paths[:N_TRAIN]], axis=0)
    axes = [
        np.linspace(least, most, GRID)
        for least, most in zip(every.min(axis=0), every.max(axis=0), strict=True)
    ]
    starts = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    ends = [
        policy.run(
            start, np.zeros_like(start), step=2.0 * STEP, duration=PATIENCE * duration
        ).position[-1]
        for start in starts
    ]
    return float(np.mean(np.linalg.norm(np.array(ends) - goal, axis=1) < NEAR))


def _driven_by_clock(clock: np.ndarray, paths: list[np.ndarray]) -> Reproduce:
    """DS-GMR in two frames: one begins where the movement begins, the other stands at the goal.
    Time counts once in their product.
    """
    model = DSGMR(COMPONENTS, n_shared=1)
    model.fit(
        [model.encode(clock, path, faults="keep") for path in paths],
        [_from_start(path[0]) for path in paths],
    )
    return lambda start: (
        model.reproduce(
            _from_start(start), clock, start, np.zeros_like(start), covariance=False
        ).position
    )


def _from_start(start: np.ndarray) -> list[TaskFrame]:
    """Frames of [t, position]: at the start (d,), and that of the world."""
    axes = np.eye(1 + len(start))
    return [TaskFrame(axes, np.array([0.0, *start])), TaskFrame(axes, np.zeros(len(axes)))]


def _nearest(paths: list[np.ndarray], start: np.ndarray) -> int:
    """The path that begins nearest to a start; orientations, which come after the position, are
    not asked.
    """
    return int(np.argmin([np.linalg.norm(path[0, :3] - start[:3]) for path in paths]))


def _nearest_primitive(clock: np.ndarray, paths: list[np.ndarray]) -> Reproduce:
    return _nearest_of(
        [DiscretePrimitive(WEIGHTS).fit(clock, path) for path in paths],
        clock,
        paths,
        lambda made: made.position,
    )


def _nearest_pose(
    clock: np.ndarray, paths: list[np.ndarray], regression: str = "joint"
) -> Reproduce:
    primitives = [
        DiscretePosePrimitive(WEIGHTS, regression=regression).fit(clock, path) for path in paths
    ]
    return _nearest_of(primitives, clock, paths, lambda made: made.pose)


def _nearest_of(
    primitives: Sequence[Any],
    clock: np.ndarray,
    paths: list[np.ndarray],
    rows: Callable[[Any], np.ndarray],
) -> Reproduce:
    """By the primitive, of positions or of poses, of the path that begins nearest. rows: of what
    it made.
    """

    def reproduce(start: np.ndarray) -> np.ndarray:
        primitive = primitives[_nearest(paths, start)]
        return rows(primitive.open_loop(clock, primitive.begin(start)))

    return reproduce


def _nearest_peer(clock: np.ndarray, paths: list[np.ndarray]) -> Reproduce:
    peer_class = importlib.import_module(f"{PEER}.dmp").DMP

    def reproduce(start: np.ndarray) -> np.ndarray:
        path = paths[_nearest(paths, start)]
        peer = peer_class(
            n_dims=path.shape[1], execution_time=clock[-1], dt=clock[1], n_weights_per_dim=WEIGHTS
        )
        peer.imitate(clock, path)
        peer.configure(start_y=start, goal_y=path[-1])
        return peer.open_loop()[1]

    return reproduce


def led(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on positions of one set of a led arm."""
    clock, paths = _on_one_clock(demonstrations, [one.position for one in demonstrations])
    shown = paths[:N_TRAIN]
    methods: dict[str, Reproduce] = {
        "DSGMR": _driven_by_clock(clock, shown),
        "DiscretePrimitive, nearest": _nearest_primitive(clock, shown),
    }
    if importlib.util.find_spec(PEER) is not None:
        methods[f"{PEER}, nearest"] = _nearest_peer(clock, shown)
    scores = []
    for method, reproduce in methods.items():
        errors = [_mean_distance(reproduce(path[0]), path) for path in paths]
        scores.append(
            Score(
                "led",
                name,
                method,
                float(np.mean(errors[:N_TRAIN])),
                float(np.mean(errors[N_TRAIN:])),
            )
        )
    return scores


def poses(name: str, demonstrations: Sequence[Demonstrated]) -> list[Score]:
    """The methods on one set of a led arm with orientations: those on positions, and those on
    poses.
    """
    clock, paths = _on_one_clock(demonstrations, [_pose_rows(one) for one in demonstrations])
    paths = [
        np.hstack([path[:, :3], path[:, 3:] / np.linalg.norm(path[:, 3:], axis=1, keepdims=True)])
        for path in paths
    ]
    shown = paths[:N_TRAIN]
    methods: dict[str, Reproduce] = {
        "PoseDSGMR": _pose_ds_gmr(clock, shown),
        "DiscretePosePrimitive, nearest": _nearest_pose(clock, shown),
        "the same, by path": _nearest_pose(clock, shown, "path"),
    }
    if importlib.util.find_spec(PEER) is not None:
        methods["CartesianDMP, nearest"] = _nearest_pose_peer(clock, shown)
    scores = []
    for method, reproduce in methods.items():
        made = [reproduce(path[0]) for path in paths]
        errors = [
            _mean_distance(one[:, :3], path[:, :3]) for one, path in zip(made, paths, strict=True)
        ]
        angles = [
            _mean_angle(one[:, 3:], path[:, 3:]) for one, path in zip(made, paths, strict=True)
        ]
        worst = max(
            float(np.degrees(angles_between(one[:, 3:], path[:, 3:]).max()))
            for one, path in zip(made, shown, strict=False)
        )
        train, test = float(np.mean(errors[:N_TRAIN])), float(np.mean(errors[N_TRAIN:]))
        scores.append(
            Score(
                "poses",
                name,
                method,
                train,
                test,
                turned=float(np.mean(angles[N_TRAIN:])),
                worst=worst,
            )
        )
    return [*(replace(one, kind="poses") for one in led(name, demonstrations)), *scores]


def _on_one_clock(
    demonstrations: Sequence[Demonstrated], rows: Sequence[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """N_SAMPLES stamps over the mean duration, and the rows of each demonstration at them."""
    duration = float(np.mean([one.time[-1] - one.time[0] for one in demonstrations[:N_TRAIN]]))
    return duration * np.linspace(0.0, 1.0, N_SAMPLES), [resampled(one, N_SAMPLES) for one in rows]


def _pose_rows(one: Demonstrated) -> np.ndarray:
    assert one.orientation is not None
    return np.hstack([one.position, one.orientation])


def _mean_distance(made: np.ndarray, path: np.ndarray) -> float:
    total, steps = warped_distance(resampled(made, N_SAMPLES), path)
    return total / steps


def _mean_angle(made: np.ndarray, path: np.ndarray) -> float:
    """Mean angle [deg] of orientations (n, 4) along their best alignment: a chord of length c on
    S3 is an angle of 4 asin(c / 2).
    """
    chord = _mean_distance(make_continuous(made) * np.sign(made[0] @ path[0]), path)
    return float(np.degrees(4.0 * np.arcsin(0.5 * chord)))


def _pose_ds_gmr(clock: np.ndarray, paths: list[np.ndarray]) -> Reproduce:
    """As `_driven_by_clock`, on poses."""

    def frames(start: np.ndarray) -> list[PoseFrame]:
        return [PoseFrame(start[:3]), PoseFrame(np.zeros(3))]

    model = PoseDSGMR(COMPONENTS).fit(
        [PoseDSGMR(COMPONENTS).encode(clock, path) for path in paths],
        [frames(path[0]) for path in paths],
    )
    return lambda start: model.reproduce(frames(start), clock, start).pose


def _nearest_pose_peer(clock: np.ndarray, paths: list[np.ndarray]) -> Reproduce:
    """Its quaternions begin with w."""
    peer_class = importlib.import_module(f"{PEER}.dmp").CartesianDMP
    w_first, w_last = [0, 1, 2, 6, 3, 4, 5], [0, 1, 2, 4, 5, 6, 3]

    def reproduce(start: np.ndarray) -> np.ndarray:
        path = paths[_nearest(paths, start)]
        peer = peer_class(execution_time=clock[-1], dt=clock[1], n_weights_per_dim=WEIGHTS)
        peer.imitate(clock, path[:, w_first])
        peer.configure(start_y=start[w_first], goal_y=path[-1, w_first])
        return resampled(peer.open_loop()[1][:, w_last], N_SAMPLES)

    return reproduce


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
        "DSGMR, prior": _by_ds_gmr_with_prior,
        "GMR": _by_regression,
    }
    if pbdlib is not None:
        methods["pbdlib"] = partial(_by_pbdlib, pbdlib_mixture(pbdlib))
    duration = float(np.mean([one.time[-1] for one in demonstrations]))
    scaled = [
        Demonstrated(one.time * duration / one.time[-1], one.position, one.frames)
        for one in demonstrations
    ]
    prepared = {"": scaled}
    if any(_only_a_path(one) for one in demonstrations):
        prepared[", retimed"] = [
            Demonstrated(*retimed(one.position, duration, PATH_SAMPLES), one.frames)
            for one in demonstrations
        ]
    return [
        Score("frames", name, method + how, np.nan, *_left_out_by(generalise, learned, scaled))
        for how, learned in prepared.items()
        for method, generalise in methods.items()
    ]


def _only_a_path(one: Demonstrated) -> bool:
    """Whether the stamps say nothing of how the movement went."""
    faults = find_faults(one.time, one.position)
    return faults.uneven or bool(faults.jumps)


def _left_out_by(
    generalise: Generalise, learned: Sequence[Demonstrated], published: Sequence[Demonstrated]
) -> tuple[float, float, float]:
    """Error, nan for the share of starts that arrive, and error of the end [%], of what is learned
    without one, from that as published.
    """
    unit = (
        float(np.linalg.norm(np.ptp(np.vstack([one.position for one in published]), axis=0)))
        / 100.0
    )
    errors = []
    for i, unseen in enumerate(published):
        clock = np.linspace(0.0, unseen.time[-1], len(unseen.time))
        path = generalise(
            [*learned[:i], *learned[i + 1 :]], clock, unseen.frames, unseen.position[0]
        )
        total, steps = warped_distance(path, unseen.position)
        errors.append(
            [total / steps / unit, float(np.linalg.norm(path[-1] - unseen.position[-1])) / unit]
        )
    error, goal = np.mean(errors, axis=0)
    return float(error), np.nan, float(goal)


def _by_ds_gmr(
    shown: Sequence[Demonstrated],
    clock: np.ndarray,
    frames: Sequence[TaskFrame],
    start: np.ndarray,
    prior: float = 0.0,
) -> np.ndarray:
    model = DSGMR(COMPONENTS, covariance_prior=prior)
    model.fit(
        [model.encode(one.time, one.position, faults="keep") for one in shown],
        [one.frames for one in shown],
    )
    return model.reproduce(frames, clock, start, np.zeros_like(start), covariance=False).position


def _by_ds_gmr_with_prior(
    shown: Sequence[Demonstrated],
    clock: np.ndarray,
    frames: Sequence[TaskFrame],
    start: np.ndarray,
) -> np.ndarray:
    """The prior on the covariances counts as many samples as there are columns."""
    return _by_ds_gmr(shown, clock, frames, start, 1.0 + len(start))


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
    return model.regress(
        frames, clock[:, None], [0], np.arange(1, 1 + len(start)), covariance=False
    )[0]


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
    peer, apart = (
        peer_class(nb_states=COMPONENTS, nb_dim=2 * m),
        np.kron(np.eye(2), np.ones((m, m))),
    )
    peer.init_hmm_kbins(seen)
    peer.sigma = peer.sigma * apart
    peer.em(np.vstack(seen), reg=PEER_REGULARISATION * np.eye(2 * m), no_init=True, dep_mask=apart)
    one, other = (
        peer.marginal_model(slice(j * m, (j + 1) * m)).lintrans(frame.A, frame.b)
        for j, frame in enumerate(frames)
    )
    return (one * other).condition(clock[:, None], dim_in=slice(0, 1), dim_out=slice(1, m))[0]


def table(scores: Sequence[Score]) -> str:
    """The scores as a table: means over the shapes of handwriting, and each set of several
    patterns or frames.
    """
    lines = []
    for kind, head, rows_of in (
        (
            "handwriting",
            f"{'method':<32}{'shapes':>7}{'train [mm]':>12}{'test [mm]':>12}{'at the goal':>13}",
            _means,
        ),
        ("patterns", f"{'set, left out':<20}{'method':<30}{'error [mm]':>12}", _of_patterns),
        ("led", f"{'method':<32}{'sets':>7}{'train [cm]':>12}{'test [cm]':>12}", _means),
        (
            "poses",
            (
                f"{'task':<22}{'method':<32}{'train [cm]':>12}{'test [cm]':>12}{'test [deg]':>12}{'worst [deg]':>13}"
            ),
            _of_poses,
        ),
        (
            "frames",
            f"{'set, left out':<20}{'method':<24}{'error [%]':>12}{'goal [%]':>12}",
            _of_frames,
        ),
    ):
        if rows := [score for score in scores if score.kind == kind]:
            lines += [head, *rows_of(rows)]
    if importlib.util.find_spec(PEER) is None:
        lines.append(f"{PEER} is not installed, so there is no row of it")
    return "\n".join(lines)


def _of_patterns(rows: Sequence[Score]) -> list[str]:
    return [f"{row.name:<20}{row.method:<30}{row.test:>12.0f}" for row in rows]


def _of_poses(rows: Sequence[Score]) -> list[str]:
    return [
        f"{row.name:<22}{row.method:<32}{row.train:>12.2f}{row.test:>12.2f}"
        + ("" if np.isnan(row.turned) else f"{row.turned:>12.1f}{row.worst:>13.1f}")
        for row in rows
    ]


def _of_frames(rows: Sequence[Score]) -> list[str]:
    return [f"{row.name:<20}{row.method:<24}{row.test:>12.2f}{row.goal:>12.2f}" for row in rows]


def _means(rows: Sequence[Score]) -> list[str]:
    lines = []
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        train, test, arrived = (
            np.mean([getattr(row, field) for row in own]) for field in ("train", "test", "arrived")
        )
        if rows[0].kind == "led":
            lines.append(f"{method:<32}{len(own):>7}{train:>12.2f}{test:>12.2f}")
            continue
        share = "-" if np.isnan(arrived) else f"{100.0 * arrived:.0f} %"
        lines.append(f"{method:<32}{len(own):>7}{train:>12.0f}{test:>12.0f}{share:>13}")
    return lines
