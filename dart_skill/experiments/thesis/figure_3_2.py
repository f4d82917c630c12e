"""Section 3.2: a gesture is recognised by the mixture under which its log-likelihood (3.1) is
largest.

The thesis says so in a sentence and has no figure of it. Here three gestures begin in the same
direction, the wave faster. Each is shown a few times and encoded in one mixture over time and
place; new ones are recognised after more and more of them has been seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from dart_skill.figures import (
    BLACK,
    BLUE,
    GREEN,
    LIGHT,
    VERMILION,
    house_style,
    letter_panels,
    plot_mixture,
    save,
)
from dart_skill.mixture import GaussianMixture

TITLE = "Gestures recognised by the likelihood of the mixtures of demonstrated ones"
GESTURES = {"arch": BLUE, "wave": VERMILION, "loop": GREEN}
N_DEMONSTRATIONS, N_NEW, N_SAMPLES, N_COMPONENTS = 6, 100, 60, 6
SEEN = np.arange(0.1, 1.01, 0.1)
"""Shares of a gesture after which it is recognised."""
OFFSET, SCALE, NOISE = 0.06, 0.12, 0.02
"""Standard deviations from gesture to gesture, and of a sample, in units of a gesture's width; of
its size, relative.
"""


@dataclass(frozen=True, eq=False)
class Recognition:
    """demonstrations: of each gesture (N_DEMONSTRATIONS, n, 3), [t, x, y]; its mixture; counts
    (shares, 3, 3): how many new gestures of each kind (rows) were taken for which (columns) after
    each share of `SEEN`.
    """

    demonstrations: list[np.ndarray]
    mixtures: list[GaussianMixture]
    counts: np.ndarray


def gestures(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """(n, N_SAMPLES, 3) [t, x, y], each of another size, at another place, and with noise."""
    t = np.linspace(0.0, 1.0, N_SAMPLES)
    up = np.sin(np.pi * t)
    shapes = {
        "arch": np.column_stack([t, up]),
        "wave": np.column_stack(
            [t, np.where(t < 0.5, np.sin(2.0 * np.pi * t), 0.6 * np.sin(2.0 * np.pi * t))]
        ),
        "loop": np.column_stack(
            [
                t - 0.25 * np.sin(4.0 * np.pi * t) * (t > 0.25),
                up * (1.0 + 0.2 * np.sin(3.0 * np.pi * t)),
            ]
        ),
    }
    size = np.exp(rng.normal(0.0, SCALE, (n, 1, 1)))
    moved = (
        size * shapes[kind]
        + rng.normal(0.0, OFFSET, (n, 1, 2))
        + rng.normal(0.0, NOISE, (n, N_SAMPLES, 2))
    )
    return np.concatenate([np.broadcast_to(t[:, None], (n, N_SAMPLES, 1)), moved], axis=2)


def compute(seed: int = 0) -> Recognition:
    rng = np.random.default_rng(seed)
    shown = [gestures(kind, N_DEMONSTRATIONS, rng) for kind in GESTURES]
    mixtures = [
        GaussianMixture(N_COMPONENTS, n_starts=3).fit(one.reshape(-1, 3), rng=rng) for one in shown
    ]
    counts = np.zeros((len(SEEN), len(GESTURES), len(GESTURES)), dtype=int)
    for row, kind in enumerate(GESTURES):
        new = gestures(kind, N_NEW, rng)
        densities = np.array(
            [one.log_density(new.reshape(-1, 3)).reshape(N_NEW, N_SAMPLES) for one in mixtures]
        )
        for k, share in enumerate(SEEN):
            likelihoods = densities[:, :, : round(share * N_SAMPLES)].sum(axis=2)  # (3.1)
            counts[k, row] = np.bincount(likelihoods.argmax(axis=0), minlength=len(GESTURES))
    return Recognition(shown, mixtures, counts)


def draw(folder: str | Path, seed: int = 0) -> tuple[list[Path], dict]:
    found = compute(seed)
    with house_style():
        figure = Figure(figsize=(9.6, 4.4), layout="constrained")
        places, shares = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
        for (kind, colour), shown, mixture in zip(
            GESTURES.items(), found.demonstrations, found.mixtures, strict=True
        ):
            for one in shown:
                places.plot(one[:, 1], one[:, 2], color=LIGHT, linewidth=0.7, zorder=1)
            plot_mixture(places, mixture, dims=(1, 2), colour=colour, label=kind)
        places.set(
            xlabel="x",
            ylabel="y",
            aspect="equal",
            title=f"{N_DEMONSTRATIONS} demonstrations each, mixtures, 2 s.d.",
        )
        places.legend(loc="lower left")
        for row, (kind, colour) in enumerate(GESTURES.items()):
            shares.plot(
                100 * SEEN, 100 * found.counts[:, row, row] / N_NEW, ".-", color=colour, label=kind
            )
        shares.axhline(
            100 / len(GESTURES), color=BLACK, linestyle=":", linewidth=1.0, label="by chance"
        )
        shares.set(
            xlabel="seen of the gesture [%]",
            ylabel="recognised [%]",
            ylim=(0, 103),
            title=f"{N_NEW} new gestures of each kind",
        )
        shares.legend(loc="lower right")
        letter_panels(places, shares)
        return save(figure, folder, "figure_3_2"), measured(found)


def measured(found: Recognition) -> dict:
    """Share of new gestures that are recognised after a tenth, a half and all of them [%], and
    what the whole ones were taken for.
    """
    right = 100.0 * np.einsum("kii->k", found.counts) / found.counts[0].sum()
    return {
        "recognised_percent": {
            f"{100 * share:.0f} % seen": round(float(right[k]), 1)
            for k, share in enumerate(SEEN)
            if k in (0, 4, 9)
        },
        "taken_for": {
            kind: dict(zip(GESTURES, found.counts[-1, row].tolist(), strict=True))
            for row, kind in enumerate(GESTURES)
        },
    }
