"""
PoWER against CMA-ES
====================

Two searches for parameters with a high return, on a landscape that is ten thousand times steeper
in one direction than in another, and turned. PoWER (thesis 5.1, 5.2) weights what was tried with
what it was worth. CMA-ES is that of the package ``cma``. Both see nothing but returns.
"""

import matplotlib.pyplot as plt
import numpy as np

from dart_skill.experiments.studies.baselines import CMAES
from dart_skill.policy_search import PoWER

N_DIMS, N_TRIALS = 4, 1000
turn = np.linalg.qr(np.random.default_rng(7).standard_normal((N_DIMS, N_DIMS)))[0]
steepness = 10.0 ** np.linspace(0.0, 4.0, N_DIMS)


def loss(parameters):
    """Zero at the best parameters, which are zero."""
    return float(steepness @ (turn @ parameters) ** 2)


def run(search):
    """The lowest loss so far, after each trial."""
    losses = []
    for trial in search.trials(N_TRIALS):
        losses.append(loss(trial.parameters))
        search.tell(trial, -losses[-1])
    return np.minimum.accumulate(losses)


# %%
# Three runs of each
# ------------------
# Both begin at the same distance from the best, and neither is told how the landscape is turned.

start = np.full(N_DIMS, 1.0)
curves = {
    "PoWER": [run(PoWER(start, 0.5, rng=np.random.default_rng(seed))) for seed in range(3)],
    "CMA-ES": [run(CMAES(start, 0.5, rng=np.random.default_rng(seed))) for seed in range(3)],
}
ends = {name: np.median([curve[-1] for curve in runs]) for name, runs in curves.items()}
print(", ".join(f"{name}: {end:.1e}" for name, end in ends.items()))

# %%

figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
for (name, runs), colour in zip(curves.items(), ("tab:blue", "tab:orange"), strict=True):
    for curve in runs:
        axes.semilogy(curve, color=colour, linewidth=0.6, alpha=0.5)
    axes.semilogy(np.median(runs, axis=0), color=colour, label=name)
axes.set(
    xlabel="trial", ylabel="lowest loss so far", title="thin: three runs, thick: their median"
)
axes.legend()
plt.show()

assert max(ends.values()) < 1e-4
