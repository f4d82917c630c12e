"""Learners of few demonstrations beside the plainest rivals: each demonstration of a set is left out
once, some of the others are drawn and learned, and the one left out is drawn from what a robot
knows of it.

A path is 100 samples at equal phases, over the mean duration of what was shown. Known are the task
frames and where the movement starts. Sets without task frames have two, which stand at the start
and at the end and are not turned, so that start and end are known. Members without frames get the
end as the last frame saw it in the mean. Errors are root mean square distances at equal phase, and
distances of the ends, in % of the diagonal of all demonstrations of a set. Every method gets the
same draws, so differences are paired; their standard errors take the predictions as independent,
which those of one set are not quite.

`dart-skill experiment rivals` prints the table that docs/real_demonstrations.md quotes.
"""

from __future__ import annotations

import importlib
import importlib.util
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.experiments.parallel import all_of
from dart_skill.experiments.studies.published_sets import (
    Demonstrated,
    helloworld_sets,
    lasa_shapes,
    letter_sets,
    lpvds_sets,
    pbdlib_sets,
    robotasks_sets,
    tpgmm_sets,
)
from dart_skill.movement import (
    DSGMR,
    KMP,
    DiscretePrimitive,
    PerStepGaussians,
    ProMP,
    TaskFrame,
    TaskParameterisedMixture,
    find_faults,
    resampled,
    retimed,
)
from dart_skill.recording import HAND, read_demonstrations

N_SAMPLES = 100
"""Samples of a path."""
COUNTS = (2, 5, 10, 13)
"""How many demonstrations are learned from."""
COMPONENTS = 8
"""Number of components of a mixture."""
WEIGHTS = 50
"""Number of weights of a primitive for each dimension."""
ONE_WEIGHT = 1e6
"""Weight of a prior with which a frame has one weight at a step, for all directions; and with which
movement variables are learned apart."""
PEER = "movement_primitives"
"""A package that is compared, where it is installed."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What is learned from.

    Parameters
    ----------
    clock
        (n,) [s].
    paths
        (n, d) each.
    frames
        Task frames of [t, position] of each.
    """

    clock: np.ndarray
    paths: Sequence[np.ndarray]
    frames: Sequence[Sequence[TaskFrame]]

    @property
    def samples(self) -> list[np.ndarray]:
        """[t, position] (n, 1 + d) of each."""
        return [np.column_stack([self.clock, path]) for path in self.paths]


@dataclass(frozen=True, eq=False)
class Asked:
    """What is known of the movement to be made.

    Parameters
    ----------
    frames
        Its task frames.
    start, end
        (d,), the end as the last frame saw it in the mean.
    """

    frames: Sequence[TaskFrame]
    start: np.ndarray
    end: np.ndarray


Made = Callable[[Asked], np.ndarray]
"""What was learned: makes a path (n, d)."""
Method = Callable[[Shown], Made]


@dataclass(frozen=True)
class Prediction:
    """One method on one demonstration that was left out.

    Parameters
    ----------
    kind, name
        Of the set.
    shown
        How many others were learned from.
    left_out
        Its number in the set.
    draw
        Number of the draw of the others.
    method
        In the words of the table.
    error, end
        Root mean square distance at equal phase, and distance of the ends [%].
    fitting, asking
        Processor time to learn, and to make the path [ms].
    """

    kind: str
    name: str
    shown: int
    left_out: int
    draw: int
    method: str
    error: float
    end: float
    fitting: float
    asking: float


# the methods


def warped_mean(shown: Shown) -> Made:
    """The mean path, shifted linearly with phase so that it begins and ends where it is asked to."""
    mean = np.mean(shown.paths, axis=0)
    phase = np.linspace(0.0, 1.0, len(mean))[:, None]
    return lambda asked: (
        mean + (1.0 - phase) * (asked.start - mean[0]) + phase * (asked.end - mean[-1])
    )


def _nearest(shown: Shown, asked: Asked) -> int:
    """The demonstration whose start and end are nearest."""
    wanted = np.concatenate([asked.start, asked.end])
    return int(
        np.argmin([np.linalg.norm(np.hstack([one[0], one[-1]]) - wanted) for one in shown.paths])
    )


def nearest_primitive(shown: Shown) -> Made:
    """`DiscretePrimitive` of the demonstration with the nearest start and end."""
    primitives = [DiscretePrimitive(WEIGHTS).fit(shown.clock, path) for path in shown.paths]

    def make(asked: Asked) -> np.ndarray:
        primitive = primitives[_nearest(shown, asked)]
        begun = primitive.begin(asked.start, goal=asked.end)
        return primitive.open_loop(shown.clock, begun).position

    return make


def ds_gmr(shown: Shown, prior: bool = False, met: bool = False) -> Made:
    """`DSGMR` from rest.

    Parameters
    ----------
    prior
        With time once in the product, and a prior that counts as many samples as there are columns.
    met
        The end is a via point.
    """
    d = shown.paths[0].shape[1]
    model = DSGMR(COMPONENTS, n_shared=int(prior), covariance_prior=(1.0 + d) * prior)
    encoded = [model.encode(shown.clock, path, faults="keep") for path in shown.paths]
    model.fit(encoded, shown.frames)

    def make(asked: Asked) -> np.ndarray:
        end = asked.end if met else None
        still = np.zeros(d)
        return model.reproduce(
            asked.frames, shown.clock, asked.start, still, covariance=False, end=end
        ).position

    return make


def regression(shown: Shown) -> Made:
    """`TaskParameterisedMixture` of positions, with time once in the product."""
    model = TaskParameterisedMixture(COMPONENTS, n_shared=1).fit(shown.samples, shown.frames)
    columns, queries = np.arange(1, 1 + shown.paths[0].shape[1]), shown.clock[:, None]
    return lambda asked: model.regress(asked.frames, queries, [0], columns, covariance=False)[0]


def per_step(shown: Shown, prior: float | None = None) -> Made:
    """`PerStepGaussians`; prior: its weight, default its own."""
    options = {} if prior is None else {"covariance_prior": prior}
    model = PerStepGaussians(len(shown.clock), **options).fit(shown.samples, shown.frames)
    return lambda asked: model.between(asked.start, asked.end).retrieve(asked.frames)[0]


def without_frames(shown: Shown, kind: type[ProMP] | type[KMP], **options: Any) -> Made:
    """A member that only knows start and end."""
    model = kind(**options).fit(shown.samples)
    return lambda asked: model.between(asked.start, asked.end).retrieve(shown.clock)[0]


def peer_promp(shown: Shown) -> Made:
    """ProMP of `PEER` with as many weights as ours, and its own defaults."""
    peer_class = importlib.import_module(f"{PEER}.promp").ProMP
    phase, d = np.linspace(0.0, 1.0, len(shown.clock)), shown.paths[0].shape[1]
    peer = peer_class(d, n_weights_per_dim=ProMP().n_basis)
    peer.imitate([phase] * len(shown.paths), np.array(shown.paths))

    def make(asked: Asked) -> np.ndarray:
        led, exactly = peer, np.zeros((d, d))
        for at, place in ((0.0, asked.start), (1.0, asked.end)):
            led = led.condition_position(place, y_cov=exactly, t=at, t_max=1.0)
        return led.mean_trajectory(phase)

    return make


def peer_primitive(shown: Shown) -> Made:
    """DMP of `PEER` of the demonstration with the nearest start and end."""
    peer_class, clock = importlib.import_module(f"{PEER}.dmp").DMP, shown.clock
    peers = []
    for path in shown.paths:
        peer = peer_class(path.shape[1], clock[-1], clock[1], n_weights_per_dim=WEIGHTS)
        peer.imitate(clock, path)
        peers.append(peer)

    def make(asked: Asked) -> np.ndarray:
        peer = peers[_nearest(shown, asked)]
        peer.configure(start_y=asked.start, goal_y=asked.end)
        return resampled(peer.open_loop()[1], len(clock))

    return make


METHODS: dict[str, Method] = {
    "mean path, warped": warped_mean,
    "nearest, DiscretePrimitive(50)": nearest_primitive,
    "DSGMR(8)": ds_gmr,
    "DSGMR(8), end met": partial(ds_gmr, met=True),
    "DSGMR(8), time once, prior": partial(ds_gmr, prior=True),
    "the same, end met": partial(ds_gmr, prior=True, met=True),
    "TaskParameterisedMixture(8)": regression,
    "PerStepGaussians()": per_step,
    "the same, no prior": partial(per_step, prior=0.0),
    "the same, a weight a frame": partial(per_step, prior=ONE_WEIGHT),
    "ProMP()": partial(without_frames, kind=ProMP),
    "ProMP(), each axis alone": partial(without_frames, kind=ProMP, covariance_prior=ONE_WEIGHT),
    "KMP()": partial(without_frames, kind=KMP),
}
"""By name, in the order of the table."""
PEERS: dict[str, Method] = {
    f"{PEER}: ProMP": peer_promp,
    f"{PEER}: DMP, nearest": peer_primitive,
}
"""Those of `PEER`."""


def known_methods() -> dict[str, Method]:
    """All methods that can be used here."""
    return METHODS | (PEERS if importlib.util.find_spec(PEER) is not None else {})


# the sets


def run(
    folder: Path | None = None,
    bags: Sequence[Path] = (),
    *,
    simulated: int = 0,
    counts: Sequence[int] = COUNTS,
    draws: int = 1,
    names: Sequence[str] = (),
    methods: Sequence[str] = (),
    jobs: int = 1,
    seed: int = 0,
) -> list[Prediction]:
    """All methods on all sets.

    Parameters
    ----------
    folder
        With the files of published sets, as `published_sets` reads them; None: without.
    bags
        Each a set: the paths of the hand in its demonstrations.
    simulated
        So many demonstrations of `place` are made and are a set, with its frames.
    counts
        How many demonstrations are learned from. A set has results for those of which it has
        enough.
    draws
        How often they are drawn for each that is left out.
    names
        Only these sets; empty: all.
    methods
        Only these, by name; empty: all that there are.
    jobs
        Processes at a time.
    seed
        Of the draws, and of the simulated person.

    Raises
    ------
    ValueError
        Where there is no such set or method.
    """
    sets = [*_sets_of(folder), *map(_of_bag, bags), *_simulated(simulated, seed)]
    if not sets:
        raise ValueError("there is no set: give a folder, bags, or a number of simulated ones")
    there = [name for _, name, _ in sets]
    if unknown := sorted(set(names) - set(there)):
        raise ValueError(f"there is no {', '.join(unknown)}; there are {', '.join(there)}")
    if unknown := sorted(set(methods) - set(known_methods())):
        raise ValueError(f"there is no method {'; '.join(unknown)}")
    work = [
        (kind, name, shown, count)
        for kind, name, shown in sets
        for count in counts
        if count < len(shown) and (not names or name in names)
    ]
    return all_of(left_out, work, jobs, draws=draws, methods=tuple(methods), seed=seed)


Set = tuple[str, str, list[Demonstrated]]
"""Kind, name and demonstrations."""


def _sets_of(folder: Path | None) -> Iterable[Set]:
    """The published sets in a folder."""
    if folder is None:
        return
    loaders: dict[Callable[[Path], dict[str, list[Demonstrated]]], str] = {
        lpvds_sets: "led arm, lpvds",
        robotasks_sets: "led arm, RoboTasks",
        helloworld_sets: "led arm, letters",
        letter_sets: "handwriting, letters",
        lasa_shapes: "handwriting, LASA",
        pbdlib_sets: "task frames, pbdlib",
        tpgmm_sets: "task frames, TP-GMM",
    }
    problems, found = [], False
    for load, kind in loaders.items():
        try:
            loaded = load(folder)
        except ValueError as error:
            problems.append(str(error))
            continue
        found = True
        clean = _retimed if load is tpgmm_sets else list
        yield from ((kind, name, clean(one)) for name, one in loaded.items())
    if not found or any("cannot be read" in problem for problem in problems):
        raise ValueError("; ".join(problems))


def _retimed(demonstrations: list[Demonstrated]) -> list[Demonstrated]:
    """The same; from rest to rest along their paths where an alignment has spoilt the stamps."""
    faults = [find_faults(one.time, one.position) for one in demonstrations]
    if not any(one.uneven or one.jumps for one in faults):
        return demonstrations
    return [
        Demonstrated(*retimed(one.position, float(one.time[-1]), len(one.time)), one.frames)
        for one in demonstrations
    ]


def _of_bag(bag: Path) -> Set:
    tracks = [one.track(HAND) for one in read_demonstrations(bag)]
    shown = [Demonstrated(one.time - one.time[0], one.position) for one in tracks]
    return "own, in a bag", bag.name, shown


def _simulated(n: int, seed: int) -> Iterable[Set]:
    """Movements of `place` that a simulated person showed, in the frames of hand and holder."""
    if n == 0:
        return
    # PyBullet and the arm are not needed for anything else here
    from dart_skill.arm import ArmModel
    from dart_skill.experiments.studies.pose_skills import teach_place
    from dart_skill.session import BenchSession
    from dart_skill.skills.learning import frame_of, prepare_movement
    from dart_skill.skills.place import Place

    skill, rng, arm = Place.configured(), np.random.default_rng([seed, 7]), ArmModel()
    session = BenchSession(skill, seed)
    shown = []
    for one in teach_place(session, skill, rng, n):
        movement = prepare_movement(skill, one, arm)
        during = (movement.time >= 0.0) & (movement.time <= movement.duration)
        frames = [frame_of(pose, "position") for pose in skill.chosen_frames(movement.situation)]
        shown.append(
            Demonstrated(movement.time[during], movement.poses[during, :3], tuple(frames))
        )
    session.close()
    yield "own, simulated", "place", shown


# the measurement


def left_out(
    work: tuple[str, str, list[Demonstrated], int],
    draws: int = 1,
    methods: Sequence[str] = (),
    seed: int = 0,
) -> list[Prediction]:
    """All methods on one set, each demonstration left out once.

    Parameters
    ----------
    work
        Kind, name and demonstrations of the set, and how many are learned from.
    draws
        How often they are drawn.
    methods
        As of `run`.
    seed
        Of the draws. With the same seed fewer are among more.
    """
    kind, name, demonstrations, count = work
    paths = [resampled(one.position, N_SAMPLES) for one in demonstrations]
    frames = [one.frames or ends_of(path) for one, path in zip(demonstrations, paths, strict=True)]
    unit = float(np.linalg.norm(np.ptp(np.vstack(paths), axis=0))) / 100.0
    found, known = [], known_methods()
    for i, path in enumerate(paths):
        for draw in range(draws):
            order = np.random.default_rng([seed, draw, i]).permutation(len(paths))
            drawn = [int(j) for j in order if j != i][:count]
            length = float(np.mean([np.ptp(demonstrations[j].time) for j in drawn]))
            clock = np.linspace(0.0, length, N_SAMPLES)
            shown = Shown(clock, [paths[j] for j in drawn], [frames[j] for j in drawn])
            asked = Asked(frames[i], path[0], _end(shown, frames[i]))
            for method in methods or known:
                made, fitting, asking = _timed(known[method], shown, asked)
                error = float(np.sqrt(np.mean(np.sum(np.square(made - path), axis=1))))
                end = float(np.linalg.norm(made[-1] - path[-1]))
                about = (kind, name, count, i, draw, method, error / unit, end / unit)
                found.append(Prediction(*about, fitting, asking))
    return found


def ends_of(path: np.ndarray) -> tuple[TaskFrame, TaskFrame]:
    """Frames of [t, position] that stand at the start and at the end of a path (n, d)."""
    axes = np.eye(1 + path.shape[1])
    return TaskFrame(axes, np.append(0.0, path[0])), TaskFrame(axes, np.append(0.0, path[-1]))


def _end(shown: Shown, frames: Sequence[TaskFrame]) -> np.ndarray:
    """Where the last frame sees the mean of the ends (d,)."""
    seen = [
        ours[-1].to_frame(one[-1:])[0]
        for one, ours in zip(shown.samples, shown.frames, strict=True)
    ]
    return frames[-1].from_frame(np.mean(seen, axis=0)[None])[0, 1:]


def _timed(learn: Method, shown: Shown, asked: Asked) -> tuple[np.ndarray, float, float]:
    """The path that a method makes, and the processor time to learn and to make it [ms]."""
    begun = time.process_time()
    made = learn(shown)
    learned = time.process_time()
    path = made(asked)
    return path, 1e3 * (learned - begun), 1e3 * (time.process_time() - learned)


# the table


def table(predictions: Sequence[Prediction]) -> str:
    """For each kind of set and number of demonstrations, each method: mean errors, how far it is
    behind the best one (paired, with the standard error of the mean), and median processor times.
    """
    lines = []
    for kind in dict.fromkeys(one.kind for one in predictions):
        for shown in sorted({one.shown for one in predictions if one.kind == kind}):
            rows = [one for one in predictions if one.kind == kind and one.shown == shown]
            lines += _part(kind, shown, rows)
    if importlib.util.find_spec(PEER) is None:
        lines.append(f"{PEER} is not installed, so there is no row of it")
    return "\n".join(lines)


def _part(kind: str, shown: int, rows: Sequence[Prediction]) -> list[str]:
    by_method: dict[str, list[Prediction]] = {}
    for one in rows:
        by_method.setdefault(one.method, []).append(one)
    # draws of one demonstration are no independent predictions
    errors = {method: _means(own) for method, own in by_method.items()}
    best = min(errors.values(), key=lambda one: float(one.mean()))
    sets, n = len({one.name for one in rows}), len(best)
    head = f"{kind}: {shown} shown, {n} left out, {sets} {'sets' if sets > 1 else 'set'}"
    words = f"{'error':>8}{'end':>7}{'behind the best':>18}{'fit [ms]':>10}{'ask [ms]':>10}"
    lines = ["", head, f"{'':<34}{words}"]
    for method, own in by_method.items():
        behind = errors[method] - best
        deviation = behind.std(ddof=1) / np.sqrt(n) if n > 1 else np.nan
        end, fitting, asking = (
            np.mean([one.end for one in own]),
            np.median([one.fitting for one in own]),
            np.median([one.asking for one in own]),
        )
        away = f"{behind.mean():.2f} +- {deviation:.2f}"
        lines.append(
            f"{method:<34}{errors[method].mean():>8.2f}{end:>7.2f}{away:>18}"
            f"{fitting:>10.1f}{asking:>10.1f}"
        )
    return lines


def _means(rows: Sequence[Prediction]) -> np.ndarray:
    """Mean error of the draws of each demonstration that was left out."""
    found: dict[tuple[str, int], list[float]] = {}
    for one in rows:
        found.setdefault((one.name, one.left_out), []).append(one.error)
    return np.array([np.mean(one) for one in found.values()])
