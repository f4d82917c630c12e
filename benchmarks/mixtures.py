#!/usr/bin/env python3
"""Gaussian mixtures against scikit-learn (EM), pbdlib-python (EM in task frames, products,
regression) and gmr (regression), on demonstrations of 200 steps.

    python3 -m benchmarks.mixtures [--pbdlib FOLDER]

One thread, medians of the processor time of interleaved repeats in the same process; a repeat of
what takes less than a few milliseconds is the mean of as many calls in a row as fill them. Both
sides start EM from the same parameters and do all iterations. The report says how far their
results differ, and the script fails where they do. The peers are optional: pip install
scikit-learn gmr. pbdlib-python is no package: FOLDER is its checkout for Python 3, in which
pbdlib/gmm.py is.
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

from benchmarks.rows import tell  # noqa: E402
from dart_skill.experiments.studies.published_sets import pbdlib_mixture  # noqa: E402
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

N_STEPS = 200
"""Number of samples of a movement."""
BLOCK_SECONDS = 5e-3
"""Duration of a block of repetitions, about [s]."""
LARGEST_DIFFERENCE = 1e-6
"""Largest difference of two results that count as the same."""
MOST_MEGABYTES = 40.0
"""Largest memory of the large EM [MB]."""


@dataclass(frozen=True)
class Work:
    """One row: the work of both sides, the ratio that is asked, and the difference of both
    results.
    """

    name: str
    library: str
    own: Callable
    peer: Callable
    least_ratio: float
    difference: Callable[[], float]


# data


def demonstrations(n: int, rng: np.random.Generator) -> np.ndarray:
    """(200 n, 6) time and five smooth movement variables, each demonstration a little different."""
    stamps, phases, rates = (
        np.linspace(0.0, 1.0, N_STEPS)[:, None],
        rng.uniform(0.0, 6.0, 5),
        rng.uniform(2.0, 7.0, 5),
    )
    shifts, slopes = rng.normal(0.0, 0.2, (n, 5)), rng.normal(0.0, 0.1, (n, 5))
    motions = [
        np.sin(rates * stamps + phases + shift) + slope * stamps
        for shift, slope in zip(shifts, slopes, strict=True)
    ]
    noisy = np.array(motions) + rng.normal(0.0, 0.01, (n, N_STEPS, 5))
    return np.concatenate([np.hstack([stamps, one]) for one in noisy])


def frame(rng: np.random.Generator) -> TaskFrame:
    """A frame over time and five variables, of which the first three are turned."""
    matrix = np.eye(6)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix[1:4, 1:4] = turn * np.sign(np.linalg.det(turn))
    return TaskFrame(matrix, np.concatenate([[0.0], rng.normal(size=5)]))


# work


def peer_from(start: GaussianMixture, n_iterations: int):
    """The peer at the same start, without its constant on the diagonal."""
    precisions = np.linalg.inv(start.covariances_)
    options = dict(weights_init=start.priors_, means_init=start.means_, precisions_init=precisions)
    return Peer(start.n_components, max_iter=n_iterations, tol=0.0, reg_covar=0.0, **options)


def em_work(
    name: str, samples: np.ndarray, n_components: int, n_iterations: int, least_ratio: float
) -> Work:
    start = GaussianMixture(n_components, max_iterations=2).fit(
        samples, rng=np.random.default_rng(0)
    )

    def own():
        mixture = GaussianMixture(n_components, tolerance=0.0, max_iterations=n_iterations).fit(
            samples, start=start
        )
        require_iterations(mixture.n_iterations_, n_iterations)
        return mixture.log_likelihood_ / len(samples)

    def peer():
        mixture = peer_from(start, n_iterations).fit(samples)
        require_iterations(mixture.n_iter_, n_iterations)
        return mixture

    return Work(
        name, "scikit-learn", own, peer, least_ratio, lambda: abs(own() - peer().score(samples))
    )


def require_iterations(done: int, wanted: int) -> None:
    if done != wanted:
        raise SystemExit(
            f"the comparison is void: {done} iterations were done instead of {wanted}"
        )


def gmr_works(
    n_queries: int,
    n_components: int,
    samples: np.ndarray,
    pbdlib: type | None,
    least_ratio: float | None,
) -> list[Work]:
    """Mean and covariance against pbdlib's, all queries at once, and gmr's: few queries one after
    the other, or means only of many.
    """
    mixture = GaussianMixture(n_components).fit(samples, rng=np.random.default_rng(n_components))
    queries, inputs = np.linspace(0.0, 1.0, n_queries)[:, None], np.array([0])
    name, works = f"GMR, {n_queries} queries, K = {n_components}", []

    def own():
        return regress(mixture, queries, [0], [1, 2, 3, 4, 5])

    if pbdlib and least_ratio:
        other = pbdlib(mu=mixture.means_, sigma=mixture.covariances_, priors=mixture.priors_)

        def peer():
            return other.condition(queries, dim_in=slice(0, 1), dim_out=slice(1, 6))

        works.append(
            Work(name, "pbdlib", own, peer, least_ratio, lambda: largest_difference(own(), peer()))
        )
    if gmr:
        another = gmr.GMM(n_components, mixture.priors_, mixture.means_, mixture.covariances_)

        def means():
            return (another.predict(inputs, queries),)

        def each():
            conditionals = [another.condition(inputs, query).to_mvn() for query in queries]
            return np.stack([one.mean for one in conditionals]), np.stack(
                [one.covariance for one in conditionals]
            )

        many = n_queries > 1000
        label, slow, asked = ("gmr, means", means, 1.0) if many else ("gmr", each, 300.0)
        works.append(
            Work(name, label, own, slow, asked, lambda: largest_difference(own(), slow()))
        )
    return works


def largest_difference(one: tuple, other: tuple) -> float:
    return max(float(np.abs(left - right).max()) for left, right in zip(one, other, strict=False))


def task_works(samples: np.ndarray, rng: np.random.Generator, pbdlib: type) -> list[Work]:
    """Learning in two task frames, and the answer for a new situation.

    The peer's mixture is over what both frames see, side by side, with covariances that are zero
    between them.
    """
    demonstrations, frames = (
        samples.reshape(-1, N_STEPS, 6),
        [[frame(rng), frame(rng)] for _ in range(len(samples) // N_STEPS)],
    )
    blocks = [
        np.concatenate(
            [its[j].to_frame(one) for one, its in zip(demonstrations, frames, strict=True)]
        )
        for j in range(2)
    ]
    start = TaskParameterisedMixture(3, max_iterations=1).fit(demonstrations, frames)

    def fit(n_iterations: int = 50):
        mixture = TaskParameterisedMixture(3, tolerance=0.0, max_iterations=n_iterations).fit(
            demonstrations, frames
        )
        require_iterations(mixture.n_iterations_, n_iterations)
        return mixture

    def peer():
        other, apart = pbdlib(nb_states=3, nb_dim=12), np.kron(np.eye(2), np.ones((6, 6)))
        other.mu, other.priors = np.hstack(list(start.means_)), start.priors_.copy()
        other.sigma = np.zeros((3, 12, 12))
        other.sigma[:, :6, :6], other.sigma[:, 6:, 6:] = start.covariances_
        other.em(
            np.hstack(blocks),
            reg=0.0,
            maxiter=50,
            minstepsize=-np.inf,
            no_init=True,
            dep_mask=apart,
        )
        return other

    mixture, situation, stamps = (
        fit(),
        [frame(rng), frame(rng)],
        np.linspace(0.0, 1.0, N_STEPS)[:, None],
    )

    def own_answer():
        return regress(mixture.product(situation), stamps, [0], [1, 2, 3, 4, 5])

    def peer_answer():
        parts = zip(mixture.means_, mixture.covariances_, situation, strict=True)
        one, other = (
            pbdlib(mu=mu, sigma=sigma, priors=mixture.priors_).lintrans(its.A, its.b)
            for mu, sigma, its in parts
        )
        return (one * other).condition(stamps, dim_in=slice(0, 1), dim_out=slice(1, 6))

    def difference_of_fits() -> float:
        # Ours begins one step earlier, with the slices from which the start was made.
        return float(np.abs(peer().mu - np.hstack(list(fit(51).means_))).max())

    difference_of_answers = lambda: largest_difference(own_answer(), peer_answer())  # noqa: E731
    return [
        Work(
            "TP-GMM fit, 13 x 200, P = 2, K = 3, 50 it.",
            "pbdlib",
            fit,
            peer,
            10.0,
            difference_of_fits,
        ),
        Work(
            "TP-GMM product and GMR, 200 steps",
            "pbdlib",
            own_answer,
            peer_answer,
            2.0,
            difference_of_answers,
        ),
    ]


# measurement


def calls_per_repeat(task: Callable) -> int:
    """How many calls fill a block; the first call only warms up."""
    task()
    begin = time.process_time()
    task()
    return max(1, int(BLOCK_SECONDS / max(time.process_time() - begin, 1e-6)))


def medians(tasks: dict, repeats: int) -> dict:
    """Median processor seconds per call of each task, the tasks taking turns so that a disturbance
    meets all of them.
    """
    numbers, seconds = (
        {name: calls_per_repeat(task) for name, task in tasks.items()},
        {name: [] for name in tasks},
    )
    for _ in range(repeats):
        for name, task in tasks.items():
            begin = time.process_time()
            for _ in range(numbers[name]):
                task()
            seconds[name].append((time.process_time() - begin) / numbers[name])
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
    print(f"{'work':<44}{'dart_skill':>13}{'peer':>26}{'ratio':>9}   asked")
    for row, work in enumerate(works):
        own, peer = 1e3 * seconds[row, "own"], 1e3 * seconds[row, "peer"]
        missed = "" if peer / own >= work.least_ratio else ", missed"
        print(
            f"{work.name:<44}{own:>10.3f} ms{work.library:>14}{peer:>9.2f} ms{peer / own:>9.2f}  "
            f" {work.least_ratio:g}{missed}"
        )
        tell(
            work.name,
            f"{own:.3f} ms",
            f"{work.library} {peer:.3f} ms",
            peer / own,
            f"{work.least_ratio:g}",
            not missed,
        )


def report_differences(works: list[Work]) -> None:
    for work in works:
        difference = work.difference()
        print(f"{work.name:<44}{work.library:<14} results differ by {difference:.1e}")
        if not difference < LARGEST_DIFFERENCE:
            raise SystemExit("the comparison is void: both sides must have the same result")


def report_memory(large: Work) -> None:
    own, peer = peak_megabytes(large.own), peak_megabytes(large.peer)
    missed = "" if own <= MOST_MEGABYTES else ", missed"
    print(
        f"memory of the large EM: {own:.0f} MB, peer {peer:.0f} MB; asked {MOST_MEGABYTES:g} MB at"
        f" most{missed}"
    )
    tell(
        "memory of the large EM",
        f"{own:.0f} MB",
        f"scikit-learn {peer:.0f} MB",
        peer / own,
        f"{MOST_MEGABYTES:g} MB",
        not missed,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=20, help="repeats per task (default 20)")
    parser.add_argument(
        "--pbdlib",
        metavar="FOLDER",
        default=os.environ.get("PBDLIB"),
        help="checkout of pbdlib-python (default $PBDLIB)",
    )
    options, rng = parser.parse_args(), np.random.default_rng(0)
    pbdlib = pbdlib_mixture(options.pbdlib) if options.pbdlib else None
    small, works = demonstrations(13, rng), []
    for name, peer in (("scikit-learn", Peer), ("gmr", gmr), ("pbdlib-python", pbdlib)):
        if peer is None:
            print(
                f"skipped the comparison with {name}: it is not here, see the beginning of this"
                " file"
            )
    print(
        f"one thread; median processor time of {options.repeats} repeats; numpy {np.__version__}"
    )
    if Peer:
        large = em_work(
            "EM, 100,000 x 6, K = 8, 20 iterations", demonstrations(500, rng), 8, 20, 10.0
        )
        works += [em_work("EM, 2600 x 6, K = 3, 50 iterations", small, 3, 50, 8.0), large]
    for n_queries, n_components, least_ratio in (
        (200, 3, 2.0),
        (200, 10, 4.0),
        (10_000, 3, 4.0),
        (10_000, 10, None),
    ):
        works += gmr_works(n_queries, n_components, small, pbdlib, least_ratio)
    if pbdlib:
        works += task_works(small, rng, pbdlib)
    sides = {
        (row, side): getattr(work, side)
        for row, work in enumerate(works)
        for side in ("own", "peer")
    }
    report(works, medians(sides, options.repeats))
    if Peer:
        report_memory(large)
    report_differences(works)


if __name__ == "__main__":
    main()
