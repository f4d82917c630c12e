"""Poses of the hand as features of a movement: its position, and two of its axes.

Axes turn with a task frame as positions do, so a frame is one linear map for all of them, (7.21)
holds for any turn, and nothing jumps: no angle that comes round, no quaternion of another sign
(Zhou, Barnes, Lu, Yang and Li, 2019: representations in five and six dimensions are continuous, in
three and four none is). What the model makes of two axes is not quite orthonormal; `orientations`
takes the nearest rotation.
"""

from __future__ import annotations

import numpy as np

from dart_skill.common.situation import Pose
from dart_skill.movement import TaskFrame, TaskParameterisedMixture

VECTORS = {"position": slice(0, 3), "x axis": slice(3, 6), "z axis": slice(6, 9)}
"""Columns of the features, each learned by a model of its own: a handful of demonstrations cannot
tell how the one depends on the other. In one model of all nine columns what eight demonstrations
had in common by chance outweighed the frame that knew better (docs/skills.md).
"""
SHORTEST = 0.2
"""Axes of a hand that the model makes shorter than this say no orientation any more."""


def pose_features(position: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Position [m], x axis and z axis of hands (n, 9), from positions (n, 3) and quaternions (n,
    4).
    """
    from scipy.spatial.transform import Rotation  # throws do without

    axes = Rotation.from_quat(quaternion).as_matrix()
    return np.hstack([position, axes[:, :, 0], axes[:, :, 2]])


def orientations(axes: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) nearest to the x and z axes (n, 6) of features.

    Raises
    ------
    ValueError
        Where they say none.
    """
    x, z = axes[:, :3], axes[:, 3:]
    y = np.cross(z, x)
    if (shortest := float(np.linalg.norm(y, axis=1).min())) < SHORTEST:
        raise ValueError(
            "the demonstrations turn the hand so differently that their mean says no orientation"
            f" ({shortest:.2f} of an axis is left): teach more of them in frames that resemble one"
            " another, or give the model more components"
        )
    left, _, right = np.linalg.svd(
        np.stack([x, y / np.linalg.norm(y, axis=1, keepdims=True), z], axis=2)
    )
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right


def with_free_length(mixture: TaskParameterisedMixture) -> TaskParameterisedMixture:
    """The mixture of an axis (its last three columns), which no longer says how long the axis is.

    Axes end on a sphere. A frame that saw them turn to and fro has seen an arc, and is as sure of
    the middle of its chord as the arc is flat: what turns further than shown would be held back by
    it. Gaussians on a sphere live in its tangent planes (Zeestraten et al., 2017); here the
    variance along the mean axis becomes that of the two directions across.
    """
    means, covariances = np.array(mixture.means_), np.array(mixture.covariances_)
    along = means[..., -3:] / np.linalg.norm(means[..., -3:], axis=-1, keepdims=True)
    spread = covariances[..., -3:, -3:]
    across = np.trace(spread, axis1=-2, axis2=-1) - np.einsum(
        "...i,...ij,...j->...", along, spread, along
    )
    covariances[..., -3:, -3:] += (across[..., None] * along)[..., None] * along[..., None, :]
    return TaskParameterisedMixture.from_parameters(
        mixture.priors_, list(means), list(covariances)
    )


def with_prior(
    mixture: TaskParameterisedMixture, demonstrations: int, strength: float, vectors: int = 1
) -> TaskParameterisedMixture:
    """The mixture of `vectors` (its last columns, three for each) that does not believe what few
    demonstrations have in common by chance: with the covariances of `shrunk`.
    """
    covariances = shrunk(np.array(mixture.covariances_), demonstrations, strength, vectors)
    return TaskParameterisedMixture.from_parameters(
        mixture.priors_, list(np.array(mixture.means_)), list(covariances)
    )


def shrunk(
    covariances: np.ndarray, demonstrations: int, strength: float, vectors: int
) -> np.ndarray:
    """Covariances (..., d, d) of time, further inputs and `vectors`, three rows for each, that do
    not believe what few demonstrations have in common by chance.

    Three demonstrations span a plane: across it their variance is nothing, in every frame, and the
    product (7.21) obeys it. What is left of the covariance when time and inputs are known is
    therefore taken as the mean of an inverse Wishart distribution whose prior says that all
    directions vary alike, and two vectors together in all directions alike, with the weight of so
    many demonstrations (`strength`).
    """
    covariances, n = np.array(covariances), 3 * vectors
    given, across = covariances[..., :-n, :-n], covariances[..., -n:, :-n]
    explained = across @ np.linalg.solve(given, np.swapaxes(across, -1, -2))
    left = covariances[..., -n:, -n:] - explained
    blocks = left.reshape(*left.shape[:-2], vectors, 3, vectors, 3)
    alike = np.einsum("...aibi,jk->...ajbk", blocks, np.eye(3)).reshape(left.shape) / 3.0
    covariances[..., -n:, -n:] = explained + (demonstrations * left + strength * alike) / (
        demonstrations + strength
    )
    return covariances


def frame_of(pose: Pose, vector: str, n_inputs: int = 0) -> TaskFrame:
    """Task frame at a pose, over time, further inputs and one of `VECTORS`: time and inputs pass
    through, the vector turns with the pose.

    An axis has no place: only positions are measured from where the pose is.
    """
    passed = 1 + n_inputs
    A, b = np.eye(passed + 3), np.zeros(passed + 3)
    A[passed:, passed:] = pose.rotation
    if vector == "position":
        b[passed:] = pose.position
    return TaskFrame(A, b)
