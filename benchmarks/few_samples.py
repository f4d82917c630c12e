#!/usr/bin/env python3
"""Mixtures of few samples: held-out log-likelihood of EM without and with a prior on the
covariances, and of scikit-learn.

Sets are drawn from random mixtures of three Gaussians; each model is fitted with three starts, and
scored by the mean log density of 1000 other samples. The table has medians over the sets, and the
share of sets in which a model is at least as good as scikit-learn's (reg_covar 1e-6, its default).
The peer is optional: pip install scikit-learn.
"""

import argparse
import warnings

import numpy as np

from dart_skill.mixture import GaussianMixture

CASES = ((15, 8), (30, 8), (60, 8), (200, 8), (1000, 8), (15, 2), (60, 2))
"""Samples and dimensions."""
COMPONENTS = 3
"""Number of components of the true mixture, and of the fitted ones."""
STARTS = 3
"""Number of starts of EM."""
HELD_OUT = 1000
"""Number of samples on which a mixture is judged."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", type=int, default=100, help="random sets of each case")
    options = parser.parse_args()
    print("samples x dims   true     scikit-learn   no prior        prior 2           prior d")
    for n, d in CASES:
        scores = np.array([scores_of(n, d, seed) for seed in range(options.sets)])
        median, share = np.median(scores, axis=0), (scores >= scores[:, 1:2]).mean(axis=0)
        ours = "   ".join(
            f"{m:10.5g} ({s:4.0%})" for m, s in zip(median[2:], share[2:], strict=True)
        )
        print(f"{n:5d} x {d}  {median[0]:10.4g}  {median[1]:12.5g}   {ours}", flush=True)


def scores_of(n: int, d: int, seed: int) -> list[float]:
    """Held-out scores of the truth, of scikit-learn, and of ours without a prior, and with the
    weights 2 and d.
    """
    rng = np.random.default_rng(seed)
    truth = random_mixture(rng, d)
    train, test = truth.sample(n, rng), truth.sample(HELD_OUT, rng)
    ours = [
        GaussianMixture(COMPONENTS, covariance_prior=weight, n_starts=STARTS).fit(
            train, rng=np.random.default_rng(seed)
        )
        for weight in (0.0, 2.0, float(d))
    ]
    return [
        float(np.mean(truth.log_density(test))),
        peer(train, test, seed),
        *(float(np.mean(one.log_density(test))) for one in ours),
    ]


def peer(train: np.ndarray, test: np.ndarray, seed: int) -> float:
    """Held-out score of scikit-learn, or nan without it."""
    try:
        from sklearn.mixture import GaussianMixture as Peer
    except ImportError:
        return float("nan")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return float(
            Peer(COMPONENTS, n_init=STARTS, max_iter=300, random_state=seed).fit(train).score(test)
        )


def random_mixture(rng: np.random.Generator, d: int) -> GaussianMixture:
    """Priors, means and covariances are drawn."""
    roots = rng.normal(size=(COMPONENTS, d, d))
    covariances = roots @ np.swapaxes(roots, 1, 2) + 0.2 * np.eye(d)
    return GaussianMixture.from_parameters(
        rng.dirichlet(np.full(COMPONENTS, 5.0)),
        2.0 * rng.normal(size=(COMPONENTS, d)),
        covariances,
    )


if __name__ == "__main__":
    main()
