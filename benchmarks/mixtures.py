#!/usr/bin/env python3
"""Gaussian mixtures against scikit-learn (EM) and gmr (regression), on demonstrations of 200 steps.

    python3 benchmarks/mixtures.py

One thread, medians of interleaved repeats in the same process; a repeat of what takes less than a few milliseconds is the
mean of as many calls in a row as fill them. Both sides start EM from the same parameters and do all iterations; the report
says how far their results differ. The peers are optional: pip install scikit-learn gmr.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import statistics  # noqa: E402
import time  # noqa: E402
import tracemalloc  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Callable  # noqa: E402
from dataclasses import dataclass  # noqa: E402

import numpy as np  # noqa: E402

from dart_skill.mixture import GaussianMixture, regress  # noqa: E402
from dart_skill.movement import TaskFrame, TaskParameterisedMixture  # noqa: E402

try:
    import gmr
except ImportError:
    gmr = None
try:
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture as Peer

    # All iterations are wanted: no tolerance is ever reached.
    warnings.simplefilter("ignore", ConvergenceWarning)
except ImportError:
    Peer = None

N_STEPS, BLOCK_SECONDS, LARGEST_DIFFERENCE = 200, 5e-3, 1e-6


@dataclass(frozen=True)
class Work:
    """One row: the work of both sides, and the least ratio or the most milliseconds; difference: of both results."""

    name: str
    own: Callable
    peer: Callable | None = None
    least_ratio: float | None = None
    most_ms: float | None = None
    difference: Callable[[], float] | None = None


# data


def demonstrations(n: int, rng: np.random.Generator) -> np.ndarray:
    """(200 n, 6) time and five smooth movement variables, each demonstration a little different."""
    stamps, phases, rates = np.linspace(0.0, 1.0, N_STEPS)[:, None], rng.uniform(0.0, 6.0, 5), rng.uniform(2.0, 7.0, 5)
    shifts, slopes = rng.normal(0.0, 0.2, (n, 5)), rng.normal(0.0, 0.1, (n, 5))
    motions = [np.sin(rates * stamps + phases + shift) + slope * stamps for shift, slope in zip(shifts, slopes, strict=True)]
    noisy = np.array(motions) + rng.normal(0.0, 0.01, (n, N_STEPS, 5))
    return np.concatenate([np.hstack([stamps, one]) for one in noisy])


def planar_frame(angle: float, place: np.ndarray) -> TaskFrame:
    matrix = np.eye(3)
    matrix[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return TaskFrame(matrix, np.concatenate([[0.0], place]))


def reach(rng: np.random.Generator) -> tuple[np.ndarray, list[TaskFrame]]:
    """Time and two attractor variables (200, 3) that leave a start frame and enter a goal frame along their x axes; the frames."""
    start, goal = (
        planar_frame(rng.uniform(-0.5, 0.5), rng.uniform(-0.2, 0.2, 2)),
        planar_frame(rng.uniform(-1, 1), rng.uniform(0.8, 1.5, 2)),
    )
    points = np.vstack([start.from_frame([[0, 0, 0], [0, 0.3, 0]]), goal.from_frame([[0, -0.3, 0], [0, 0, 0]])])[:, 1:]
    u = np.linspace(0.0, 1.0, N_STEPS)[:, None]
    path = np.hstack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3]) @ points
    return np.hstack([u, path + rng.normal(0.0, 0.01, path.shape)]), [start, goal]


# work


def peer_from(start: GaussianMixture, n_iterations: int):
    """The peer at the same start, without its constant on the diagonal."""
    precisions = np.linalg.inv(start.covariances_)
    options = dict(weights_init=start.priors_, means_init=start.means_, precisions_init=precisions)
    return Peer(start.n_components, max_iter=n_iterations, tol=0.0, reg_covar=0.0, **options)


def em_work(name: str, samples: np.ndarray, n_components: int, n_iterations: int, least_ratio: float) -> Work:
    start = GaussianMixture(n_components, max_iterations=2).fit(samples, rng=np.random.default_rng(0))

    def own():
        mixture = GaussianMixture(n_components, tolerance=0.0, max_iterations=n_iterations).fit(samples, start=start)
        require_iterations(mixture.n_iterations_, n_iterations)
        return mixture.log_likelihood_ / len(samples)

    def peer():
        mixture = peer_from(start, n_iterations).fit(samples)
        require_iterations(mixture.n_iter_, n_iterations)
        return mixture

    return Work(name, own, peer, least_ratio, difference=lambda: abs(own() - peer().score(samples)))


def require_iterations(done: int, wanted: int) -> None:
    if done != wanted:
        raise SystemExit(f"the comparison is void: {done} iterations were done instead of {wanted}")


def gmr_work(n_queries: int, n_components: int, samples: np.ndarray, means_only: bool) -> Work:
    """All of the covariance against the peer's, one query after the other, or against its means only."""
    mixture = GaussianMixture(n_components).fit(samples, rng=np.random.default_rng(n_components))
    queries, inputs = np.linspace(0.0, 1.0, n_queries)[:, None], np.array([0])
    other = gmr and gmr.GMM(n_components, mixture.priors_, mixture.means_, mixture.covariances_)

    def own():
        return regress(mixture, queries, [0], [1, 2, 3, 4, 5])

    def peer_means():
        return (other.predict(inputs, queries),)

    def peer_all():
        conditionals = [other.condition(inputs, query).to_mvn() for query in queries]
        return np.stack([one.mean for one in conditionals]), np.stack([one.covariance for one in conditionals])

    peer = peer_means if means_only else peer_all
    name = f"GMR, {n_queries} queries, K = {n_components}{', peer: means only' if means_only else ''}"
    return Work(name, own, peer, 1.0 if means_only else 300.0, difference=lambda: largest_difference(own(), peer()))


def largest_difference(one: tuple, other: tuple) -> float:
    return max(float(np.abs(left - right).max()) for left, right in zip(one, other, strict=False))


def task_works(rng: np.random.Generator) -> list[Work]:
    """Learning in two task frames against the peer in each frame by itself, and the answer for a new situation."""
    samples, frames = zip(*[reach(rng) for _ in range(13)], strict=True)
    blocks = [np.concatenate([its_frames[j].to_frame(one) for one, its_frames in zip(samples, frames, strict=True)]) for j in range(2)]
    starts = [GaussianMixture(3, max_iterations=2).fit(block, rng=np.random.default_rng(0)) for block in blocks]

    def fit():
        mixture = TaskParameterisedMixture(3, tolerance=0.0, max_iterations=50).fit(samples, frames)
        require_iterations(mixture.n_iterations_, 50)
        return mixture

    def peer():
        for start, block in zip(starts, blocks, strict=True):
            require_iterations(peer_from(start, 50).fit(block).n_iter_, 50)

    mixture, situation, stamps = fit(), reach(rng)[1], np.linspace(0.0, 1.0, N_STEPS)[:, None]
    return [
        Work("TP-GMM fit, 13 x 200, P = 2, K = 3, 50 it.", fit, peer, 4.0),
        Work("TP-GMM product and GMR, 200 steps", lambda: regress(mixture.product(situation), stamps, [0], [1, 2]), most_ms=0.3),
    ]


# measurement


def calls_per_repeat(task: Callable) -> int:
    """How many calls fill a block; the first call only warms up."""
    task()
    begin = time.perf_counter()
    task()
    return max(1, int(BLOCK_SECONDS / (time.perf_counter() - begin)))


def medians(tasks: dict, repeats: int) -> dict:
    """Median seconds per call of each task, the tasks taking turns so that a disturbance meets all of them."""
    numbers, seconds = {name: calls_per_repeat(task) for name, task in tasks.items()}, {name: [] for name in tasks}
    for _ in range(repeats):
        for name, task in tasks.items():
            begin = time.perf_counter()
            for _ in range(numbers[name]):
                task()
            seconds[name].append((time.perf_counter() - begin) / numbers[name])
    return {name: statistics.median(values) for name, values in seconds.items()}


def peak_megabytes(task: Callable) -> float:
    """Most memory that a call holds at a time, beyond what was there before."""
    tracemalloc.start()
    try:
        task()
        return tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def report(works: list[Work], seconds: dict) -> None:
    print(f"{'work':<48}{'dart_skill':>13}{'peer':>13}{'ratio':>8}   target")
    for work in works:
        own, peer = 1e3 * seconds[work.name, "own"], 1e3 * seconds.get((work.name, "peer"), np.nan)
        print(f"{work.name:<48}{own:>10.3f} ms", end="")
        print(f"{peer:>10.2f} ms{peer / own:>8.1f}" if peer == peer else " " * 21, end="   ")
        if work.most_ms is not None:
            print(f"under {work.most_ms:g} ms{'' if own < work.most_ms else ', missed'}")
        else:
            print(f"{work.least_ratio:g}{', missed' if peer / own < work.least_ratio else ''}")


def report_differences(works: list[Work]) -> None:
    for work in works:
        difference = work.difference()
        print(f"{work.name:<48}results differ by {difference:.1e}")
        if not difference < LARGEST_DIFFERENCE:
            raise SystemExit("the comparison is void: both sides must have the same result")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20, help="repeats per task (default 20)")
    options, rng = parser.parse_args(), np.random.default_rng(0)
    small = demonstrations(13, rng)
    large = em_work("EM, 100,000 x 6, K = 8, 20 iterations", demonstrations(500, rng), 8, 20, 4.0)
    em = [em_work("EM, 2600 x 6, K = 3, 50 iterations", small, 3, 50, 5.0), large]
    regression = [gmr_work(n, k, small, means_only=n > 1000) for n in (200, 10_000) for k in (3, 10)]
    tasks = task_works(rng)
    with_peer = (em + tasks[:1] if Peer else []) + (regression if gmr else [])
    for name, peer in (("scikit-learn", Peer), ("gmr", gmr)):
        if peer is None:
            print(f"skipped the comparison with {name}: it is not installed (pip install {name})")
    print(f"one thread; median of {options.repeats} repeats; numpy {np.__version__}")
    works = em + regression + tasks
    sides = {(work.name, "own"): work.own for work in works} | {(work.name, "peer"): work.peer for work in with_peer}
    report(works, medians(sides, options.repeats))
    memory = f"memory of the large EM: {peak_megabytes(large.own):.0f} MB"
    print(f"{memory}, peer {peak_megabytes(large.peer):.0f} MB" if Peer else memory)
    report_differences([work for work in with_peer if work.difference])


if __name__ == "__main__":
    main()
