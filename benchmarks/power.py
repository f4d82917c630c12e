#!/usr/bin/env python3
"""PoWER's ways to explore against CMA-ES (the package `cma`): returns asked until a target is met,
and what is left after a budget.

    python3 -m benchmarks.power [--seeds 20] [--parts] [--defaults] [--gradients]

All start in the same places, uniform in (-1.5, 1.5), with spread 0.5. --parts shows what each part
of the automatic exploration pays, --defaults how many trials the other modes should remember,
--gradients what REINFORCE and the episodic natural actor-critic need. The peer is optional: pip
install cma.
"""

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse  # noqa: E402
import time  # noqa: E402
import warnings  # noqa: E402
from contextlib import contextmanager  # noqa: E402
from functools import partial  # noqa: E402

import numpy as np  # noqa: E402

from dart_skill.experiments.studies.baselines import CrossEntropy  # noqa: E402
from dart_skill.experiments.studies.policy_gradients import (  # noqa: E402
    EpisodicNaturalActorCritic,
    Reinforce,
    natural_gradient,
    optimal_baseline,
    reinforce_gradient,
)
from dart_skill.policy_search import PathLength, PoWER, PrimitivePoWER  # noqa: E402

try:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about plots
        import cma
except ImportError:
    cma = None

SPREAD = 0.5
"""Standard deviation of the first trials."""
BUDGET = 6000
"""Largest number of trials."""
ROTATION = np.linalg.qr(np.random.default_rng(7).normal(size=(5, 5)))[0]


def sphere(x):
    return x @ x


def ellipsoid(x):
    return 10.0 ** np.linspace(0, 4, 5) @ (ROTATION @ x) ** 2


def rosenbrock(x):
    return np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)


# Function, dimensions, a target that exploration with a minimum can meet, and one that it cannot.
PROBLEMS = {
    "sphere 5": (sphere, 5, 1e-2, 1e-8),
    "sphere 20": (sphere, 20, 1e-1, 1e-8),
    "ellipsoid 5, rotated, 1e4": (ellipsoid, 5, 1.0, 1e-8),
    "Rosenbrock 5": (rosenbrock, 5, 1.0, 1e-8),
}


class Cma:
    """`cma` with its defaults, one trial at a time."""

    def __init__(self, start, spread, rng):
        options = {
            "seed": int(rng.integers(1, 2**31)),
            "verbose": -9,
            "tolflatfitness": 10**6,
            "tolstagnation": 10**6,
        }
        self._strategy = cma.CMAEvolutionStrategy(list(start), spread, options)
        self._asked, self._told = [], []

    @property
    def parameters(self):
        return np.array(self._strategy.mean)

    def ask(self):
        if not self._asked:
            self._asked, self._told = self._strategy.ask(), []
        return np.asarray(self._asked[len(self._told)])

    def tell(self, loss):
        self._told.append(loss)
        if len(self._told) == len(self._asked):
            self._strategy.tell(self._asked, self._told)
            self._asked = []


class Own:
    """PoWER, or another search of ours, in the same form."""

    def __init__(self, start, spread, rng, returns=np.negative, kind=PoWER, **options):
        self._search, self._returns = kind(start, spread, rng=rng, **options), returns

    @property
    def exploration_size(self):
        return self._search.exploration_size

    @property
    def parameters(self):
        return self._search.parameters

    def ask(self):
        self._trial = self._search.ask()
        return self._trial.parameters

    def tell(self, loss):
        self._search.tell(self._trial, self._returns(loss))


# The thesis's weights are the returns themselves; they must be positive, and here are 1 / (1 +
# loss).
METHODS = {
    "PoWER automatic": Own,
    "PoWER proportional": partial(Own, exploration="proportional"),
    "PoWER constant": partial(Own, exploration="constant"),
    "PoWER constant, r as weight": partial(
        Own, exploration="constant", weighting="returns", returns=lambda loss: 1 / (1 + loss)
    ),
    "PoWER fixed": partial(Own, exploration="fixed"),
}
if cma is not None:
    METHODS["cma"] = Cma


def evaluations(make, function, n_dims, targets, seed):
    """Evaluations until a trial meets each of the targets (infinite when the budget ends before),
    and seconds for one.
    """
    rng = np.random.default_rng(seed)
    search = make(rng.uniform(-1.5, 1.5, n_dims), SPREAD, rng)
    met, begin, count = np.full(len(targets), np.inf), time.perf_counter(), 0
    while count < BUDGET and np.isinf(met).any():
        x = search.ask()
        loss = function(x)
        search.tell(loss)
        count += 1
        met[np.isinf(met) & (loss < np.array(targets))] = count
    return met, (time.perf_counter() - begin) / count


def left(make, function, n_dims, budgets, noise, seed):
    """Loss at the policy's mean after each budget, every loss told with noise."""
    rng = np.random.default_rng(seed)
    search = make(rng.uniform(-1.5, 1.5, n_dims), SPREAD, rng)
    losses = []
    for count in range(1, max(budgets) + 1):
        search.tell(function(search.ask()) + noise * rng.normal())
        if count in budgets:
            losses.append(function(search.parameters))
    return losses


def quartiles(values, form="{:.0f}"):
    """Median and quartiles; infinities are trials out of budget."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75], method="inverted_cdf")
    text = [form.format(value) if np.isfinite(value) else "-" for value in (middle, low, high)]
    return f"{text[0]:>7} {'(' + text[1] + ', ' + text[2] + ')':<16}"


def table_of_targets(methods, n_seeds, problems=PROBLEMS):
    for name, (function, n_dims, *targets) in problems.items():
        print(
            f"\n{name}: evaluations to {targets[0]:g} and to {targets[1]:g}, median (quartiles),"
            f" of {BUDGET}"
        )
        for label, make in methods.items():
            runs = [evaluations(make, function, n_dims, targets, seed) for seed in range(n_seeds)]
            met = np.array([run[0] for run in runs])
            reached = f"{np.isfinite(met[:, 1]).sum():>3} of {n_seeds} end"
            seconds = np.median([run[1] for run in runs])
            print(
                f"  {label:<30}{quartiles(met[:, 0])}{quartiles(met[:, 1])}{reached}{1e6 * seconds:>7.0f}"
                " us each"
            )


def table_of_noise(methods, n_seeds, budgets=(300, 1000), noise=0.1):
    print(
        f"\nsphere 5 with noise of {noise:g}: loss at the mean after {budgets[0]} and {budgets[1]}"
        " evaluations, median (quartiles)"
    )
    for label, make in methods.items():
        losses = np.array([left(make, sphere, 5, budgets, noise, seed) for seed in range(n_seeds)])
        print(f"  {label:<30}" + "  ".join(quartiles(column, "{:.2g}") for column in losses.T))


# --- movement primitives
# -----------------------------------------------------------------------------------------

N_STEPS = 100
"""Number of steps of the movement."""
N_BASIS = 10
"""Number of basis functions."""
PROGRESS = np.linspace(0, 1, N_STEPS)
KERNELS = np.exp(-0.5 * ((PROGRESS[:, None] - np.linspace(0, 1, N_BASIS)) * N_BASIS / 0.6) ** 2)
ACTIVATIONS = KERNELS / KERNELS.sum(axis=1, keepdims=True)
CIRCLE = np.column_stack([np.sin(2 * np.pi * PROGRESS), np.cos(2 * np.pi * PROGRESS)])


def via_points(output):
    rewards = np.zeros(N_STEPS)
    rewards[25], rewards[75] = -np.sum(
        (output[[25, 75]] - [[0.5, -0.3], [-0.4, 0.6]]) ** 2, axis=1
    )
    return rewards


def tracking(output):
    return -np.sum((output - CIRCLE) ** 2, axis=1) / N_STEPS


def primitive_loss(rewards_of, budget, seed, told="rewards", **options):
    """Loss of the policy's mean after a budget; told rewards over time or their sum."""
    search = PrimitivePoWER(
        np.zeros((N_BASIS, 2)), ACTIVATIONS, 0.3, rng=np.random.default_rng(seed), **options
    )
    search.maximise(
        rewards_of if told == "rewards" else lambda output: rewards_of(output).sum(), budget
    )
    return -rewards_of(ACTIVATIONS @ search.weights).sum()


def vector_loss(rewards_of, budget, seed, make):
    def loss(weights):
        return -rewards_of(ACTIVATIONS @ weights.reshape(N_BASIS, 2)).sum()

    search = make(np.zeros(2 * N_BASIS), 0.3, np.random.default_rng(seed))
    for _ in range(budget):
        search.tell(loss(search.ask()))
    return loss(search.parameters)


PRIMITIVE_METHODS = {
    "automatic, rewards": primitive_loss,
    "automatic, credit uniform": partial(primitive_loss, credit="uniform"),
    "automatic, sum of rewards": partial(primitive_loss, told="sum"),
    "proportional, rewards": partial(primitive_loss, exploration="proportional"),
    "constant, rewards": partial(primitive_loss, exploration="constant"),
    "constant, credit uniform": partial(primitive_loss, exploration="constant", credit="uniform"),
    "constant, sum of rewards": partial(primitive_loss, exploration="constant", told="sum"),
    "automatic, new noise each step": partial(primitive_loss, hold=1),
    "PoWER on the vector": partial(vector_loss, make=Own),
}
if cma is not None:
    PRIMITIVE_METHODS["cma on the vector"] = partial(vector_loss, make=Cma)


def table_of_primitives(n_seeds, budgets=(100, 300)):
    for rewards_of in (via_points, tracking):
        loss = -rewards_of(np.zeros((N_STEPS, 2))).sum()
        print(
            f"\nprimitive, {N_BASIS} x 2 weights, {rewards_of.__name__}: loss after {budgets}"
            f" trials, {loss:.2g} at the start"
        )
        for label, method in PRIMITIVE_METHODS.items():
            columns = [
                [method(rewards_of, budget, seed) for seed in range(n_seeds)] for budget in budgets
            ]
            print(f"  {label:<32}" + "  ".join(quartiles(column, "{:.2g}") for column in columns))


# --- choices
# -----------------------------------------------------------------------------------------------------


@contextmanager
def rates(change):
    """Learning rates of the shape (along the path, of the trials) as `change` makes them."""
    original = PathLength.shape_rates
    PathLength.shape_rates = lambda path, effective: change(*original(path, effective))
    try:
        yield
    finally:
        PathLength.shape_rates = original


def table_of_parts(n_seeds):
    changes = {
        "all parts": lambda along_path, of_trials: (along_path, of_trials),
        "shape from the trials only": lambda _, of_trials: (0.0, of_trials),
        "shape from the path only": lambda along_path, _: (along_path, 0.0),
        "size only": lambda *_: (0.0, 0.0),
    }
    for label, change in changes.items():
        print(f"\n--- automatic exploration, {label}", end="")
        with rates(change):
            table_of_targets({label: Own}, n_seeds)


def table_of_defaults(n_seeds):
    counts = [
        (7, 28, 1),
        (7, 28, 7),
        (7, 28, 14),
        (7, 28, 28),
        (14, 28, 14),
        (7, 14, 7),
        (7, 14, 14),
        (14, 56, 28),
    ]
    for exploration in ("constant", "proportional"):
        methods = {
            f"{exploration} M {best} S {latest} batch {batch}": partial(
                Own, exploration=exploration, best=best, latest=latest, batch=batch
            )
            for best, latest, batch in counts
        }
        table_of_noise(methods, n_seeds)
        print("\nthe same without noise on the rotated ellipsoid")
        for label, make in methods.items():
            losses = np.array(
                [left(make, ellipsoid, 5, (300, 1000), 0.0, seed) for seed in range(n_seeds)]
            )
            print(f"  {label:<36}" + "  ".join(quartiles(column, "{:.2g}") for column in losses.T))


# --- policy gradients
# --------------------------------------------------------------------------------------------

KINDS = {"REINFORCE": Reinforce, "natural actor-critic": EpisodicNaturalActorCritic}
GRADIENTS = {name: partial(Own, kind=kind) for name, kind in KINDS.items()}
BESIDE = {
    **GRADIENTS,
    "PoWER automatic": Own,
    "cross-entropy method": partial(Own, kind=CrossEntropy),
}
if cma is not None:
    BESIDE["cma"] = Cma


def reached(make, function, n_dims, target, seed):
    """Evaluations until a trial meets the target; infinite when the budget ends before, or the
    search leaves all numbers.
    """
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return evaluations(make, function, n_dims, [target], seed)[0][0]
    except ValueError:
        return np.inf


def table_of_rates(n_seeds, target=1e-2):
    print(
        f"\nsphere 5: evaluations to {target:g} by learning rate, median (quartiles), of {BUDGET};"
        " and how many runs get there"
    )
    steps = [("normalised", 1.0, rate) for rate in (0.03, 0.1, 0.3, 1.0, 3.0)]
    steps += [("plain", size, rate) for size in (1.0, 100.0) for rate in (0.001, 0.01, 0.1, 1.0)]
    for name, kind in KINDS.items():
        for step, size, rate in steps:
            make = partial(
                Own,
                kind=kind,
                step=step,
                learning_rate=rate,
                returns=lambda loss, size=size: -size * loss,
            )
            counts = np.array([reached(make, sphere, 5, target, seed) for seed in range(n_seeds)])
            label = f"{name}, {step} {rate:g}" + (
                f", returns x {size:g}" if step == "plain" else ""
            )
            print(f"  {label:<50}{quartiles(counts)}{np.isfinite(counts).sum():>3} of {n_seeds}")


def table_of_dimensions(n_seeds, target=1e-2):
    print(
        f"\nsphere: evaluations to {target:g} in 2, 5, 10 and 20 dimensions, median (quartiles),"
        f" of {BUDGET}"
    )
    for label, make in BESIDE.items():
        columns = [
            [reached(make, sphere, d, target, seed) for seed in range(n_seeds)]
            for d in (2, 5, 10, 20)
        ]
        print(f"  {label:<30}" + "".join(quartiles(column) for column in columns))


def table_of_vanishing(n_seeds, budget=6000):
    print(
        f"\nrotated ellipsoid 5, condition 1e4: loss at the mean and exploration after {budget}"
        " evaluations, median (quartiles)"
    )
    for label, make in GRADIENTS.items():
        for rate in (0.1, 0.3, 1.0):
            losses, sizes = [], []
            for seed in range(n_seeds):
                rng = np.random.default_rng(seed)
                search = make(rng.uniform(-1.5, 1.5, 5), SPREAD, rng, learning_rate=rate)
                for _ in range(budget):
                    search.tell(ellipsoid(search.ask()))
                losses.append(ellipsoid(search.parameters))
                sizes.append(search.exploration_size)
            print(
                f"  {f'{label}, normalised {rate:g}':<40}{quartiles(losses, '{:.2g}')}{quartiles(sizes, '{:.2g}')}"
            )


ESTIMATES = {
    "no baseline": lambda scores, returns, fisher: (
        np.mean(scores * returns[:, None], axis=0) / fisher
    ),
    "mean return as baseline": lambda scores, returns, fisher: (
        np.mean(scores * (returns - returns.mean())[:, None], axis=0) / fisher
    ),
    "optimal baseline, all trials": lambda scores, returns, fisher: (
        np.mean(scores * (returns[:, None] - optimal_baseline(scores, returns)), axis=0) / fisher
    ),
    "optimal baseline, own trial left out": lambda scores, returns, fisher: (
        reinforce_gradient(scores, returns) / fisher
    ),
    "regression": lambda scores, returns, fisher: natural_gradient(
        scores, returns, np.diag(fisher), 0.01
    )[0],
}


def gradient_error(estimate, d, n, seed):
    """Relative error, in the Fisher metric, of a natural gradient from n trials about (1, ..., 1)
    on a rotated bowl of condition 10.
    """
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.standard_normal((d, d)))[0]
    bowl = rotation.T @ np.diag(np.geomspace(0.1, 1.0, d)) @ rotation
    noise = rng.standard_normal((n, d))
    returns = -np.einsum("ni,ij,nj->n", 1 + noise, bowl, 1 + noise)
    fisher = np.repeat([1.0, 2.0], d)
    true = np.concatenate([-2 * bowl.sum(axis=1), -np.diagonal(bowl)])
    error = estimate(np.hstack([noise, noise**2 - 1]), returns, fisher) - true
    return np.sqrt(fisher @ error**2 / (fisher @ true**2))


def table_of_variance(n_seeds, n=100):
    print(
        f"\nrelative error of a gradient from {n} trials in 2, 5, 10 and 20 dimensions, median"
        " (quartiles)"
    )
    for label, estimate in ESTIMATES.items():
        columns = [
            [gradient_error(estimate, d, n, seed) for seed in range(n_seeds)]
            for d in (2, 5, 10, 20)
        ]
        print(f"  {label:<40}" + "".join(quartiles(column, "{:.2f}") for column in columns))


def table_of_vectors(n_seeds, budgets=(100, 300, 3000)):
    for rewards_of in (via_points, tracking):
        print(
            f"\nprimitive as a vector of {2 * N_BASIS} weights, {rewards_of.__name__}: loss after"
            f" {budgets} trials, median (quartiles)"
        )
        for label, make in BESIDE.items():
            columns = [
                [vector_loss(rewards_of, budget, seed, make) for seed in range(n_seeds)]
                for budget in budgets
            ]
            print(f"  {label:<30}" + "  ".join(quartiles(column, "{:.2g}") for column in columns))


def table_of_gradients(n_seeds):
    for table in (
        table_of_rates,
        table_of_dimensions,
        table_of_vanishing,
        table_of_variance,
        table_of_vectors,
    ):
        table(n_seeds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--seeds", type=int, default=20, help="searches per method and function (default 20)"
    )
    parser.add_argument(
        "--parts",
        action="store_true",
        help="what each part of the automatic exploration pays, instead",
    )
    parser.add_argument(
        "--defaults", action="store_true", help="how many trials to remember, instead"
    )
    parser.add_argument(
        "--gradients",
        action="store_true",
        help="REINFORCE and the episodic natural actor-critic, instead",
    )
    options = parser.parse_args()
    print(
        f"{options.seeds} seeds; one thread; numpy {np.__version__}; cma"
        f" {'not installed' if cma is None else cma.__version__}"
    )
    if options.parts:
        table_of_parts(options.seeds)
    elif options.defaults:
        table_of_defaults(options.seeds)
    elif options.gradients:
        table_of_gradients(options.seeds)
    else:
        if cma is None:
            print("skipped the comparison: cma is not installed (pip install cma)")
        table_of_targets(METHODS, options.seeds)
        table_of_noise(METHODS, options.seeds)
        table_of_primitives(options.seeds)


if __name__ == "__main__":
    main()
