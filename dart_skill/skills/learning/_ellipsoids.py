"""Learned things as shapes, for viewers and figures."""

import numpy as np

from dart_skill.common.quaternions import of_matrices
from dart_skill.mixture import GaussianMixture


def component_ellipsoids(
    mixture: GaussianMixture, deviations: float = 2.0, angles: int = 2
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The components' positions as ellipsoids: centre (3,), orientation (4,) x, y, z, w, diameters
    (3,) [m].

    x, y, z are the last columns but for the angles, of a throw two: t, [distance,] x, y, z, alpha,
    beta.

    Parameters
    ----------
    mixture
        In the world.
    deviations
        Half the length of an axis, in standard deviations.
    """
    first = mixture.means_.shape[1] - 3 - angles
    xyz = slice(first, first + 3)
    shapes = []
    for mean, covariance in zip(
        mixture.means_[:, xyz], mixture.covariances_[:, xyz, xyz], strict=True
    ):
        values, vectors = np.linalg.eigh(covariance)
        vectors[:, 2] *= np.sign(np.linalg.det(vectors))
        size = 2 * deviations * np.sqrt(np.maximum(values, 0.0))
        shapes.append((mean, of_matrices(vectors[None])[0], size))
    return shapes
