"""Starts of EM: each sample is assigned to one component, as responsibilities (n, K) of zeros and
ones.

There are two ways. k-means++ (D. Arthur and S. Vassilvitskii 2007) is refined by Lloyd's
iteration: a new centre is drawn with a probability proportional to the weighted squared distance
to the *nearest* centre so far, and the best of a few candidates is kept. Or the samples are
divided into equal shares along one column.
"""

import numpy as np


def squared_distances(samples: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """(n, K) squared distances of samples (n, d) to centres (K, d)."""
    steps = (samples - centre for centre in centres)
    return np.stack([np.einsum("ni,ni->n", step, step) for step in steps], axis=1)


def nearest_centre(samples: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Labels (n,) of samples (n, d); the first of equally near centres."""
    # The squared norm of the sample is the same for all centres.
    scores = np.square(centres).sum(1)[:, None] - 2.0 * centres @ samples.T
    labels, least = np.zeros(len(samples), dtype=int), scores[0]
    for k, score in enumerate(scores[1:], start=1):
        labels[score < least] = k
        least = np.minimum(least, score)
    return labels


def draw(shares: np.ndarray, uniform: np.ndarray) -> np.ndarray:
    """Indices drawn with probabilities proportional to shares (n,): their cumulative sum is
    inverted at `uniform` in [0, 1).
    """
    cumulative = np.cumsum(shares)
    indices = np.searchsorted(cumulative, uniform * cumulative[-1], side="right")
    return np.minimum(indices, np.flatnonzero(shares)[-1])


def plus_plus_centres(
    samples: np.ndarray, weights: np.ndarray, n_centres: int, rng: np.random.Generator
) -> np.ndarray:
    """Centres (n_centres, d) by greedy k-means++; several samples may be equal."""
    n_candidates = 2 + int(np.log(n_centres))
    centres = samples[draw(weights, rng.random(1))]
    nearest = squared_distances(samples, centres)[:, 0]
    while len(centres) < n_centres:
        shares = weights * nearest
        candidates = draw(shares if shares.sum() > 0 else weights, rng.random(n_candidates))
        remaining = np.minimum(nearest[:, None], squared_distances(samples, samples[candidates]))
        best = int((weights @ remaining).argmin())
        centres = np.vstack([centres, samples[candidates[best]]])
        nearest = remaining[:, best]
    return centres


def refine_centres(
    samples: np.ndarray, weights: np.ndarray, centres: np.ndarray, max_iterations: int = 30
) -> np.ndarray:
    """Labels (n,) after Lloyd's iteration; a centre that loses all samples stays where it is."""
    labels, weighted = (
        nearest_centre(samples, centres),
        np.ascontiguousarray((samples * weights[:, None]).T),
    )
    for _ in range(max_iterations):
        mass = np.bincount(labels, weights, len(centres))
        sums = np.stack([np.bincount(labels, column, len(centres)) for column in weighted], axis=1)
        centres = np.where(
            mass[:, None] > 0, sums / np.where(mass > 0, mass, 1.0)[:, None], centres
        )
        previous, labels = labels, nearest_centre(samples, centres)
        if (labels == previous).all():
            break
    return labels


def one_hot(labels: np.ndarray, n_components: int) -> np.ndarray:
    """Responsibilities (n, n_components) of hard labels (n,)."""
    return (labels[:, None] == np.arange(n_components)).astype(float)


def kmeans_start(
    samples: np.ndarray, weights: np.ndarray, n_components: int, rng: np.random.Generator
) -> np.ndarray:
    """Responsibilities (n, K) from weighted k-means with a k-means++ start.

    Parameters
    ----------
    samples
        (n, d).
    n_components
        K, at most n.
    """
    centres = plus_plus_centres(samples, weights, n_components, rng)
    return one_hot(refine_centres(samples, weights, centres), n_components)


def sliced_start(column: np.ndarray, weights: np.ndarray, n_components: int) -> np.ndarray:
    """Responsibilities (n, K) from K slices of equal weight along one column (n,), usually time.

    Samples with equal values go into the same slice, so that the order of the samples does not
    matter.

    Parameters
    ----------
    n_components
        K.
    """
    # With an index NumPy sorts by merging, which takes a quarter of the time where each
    # demonstration is in order already.
    values, _, place = np.unique(column, return_index=True, return_inverse=True)
    mass = np.bincount(place.ravel(), weights=weights, minlength=len(values))
    middle = (np.cumsum(mass) - 0.5 * mass) / mass.sum()
    labels = np.minimum(n_components * middle, n_components - 1).astype(int)
    return one_hot(labels[place.ravel()], n_components)
