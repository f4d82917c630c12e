"""Where cameras and arm stand to each other is found from what both say of the hand, in any unit
and axes.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import fit_orientations, fit_positions, similarity, turn_angles

N = 60
PLACE = 0.4 * np.random.default_rng(0).standard_normal((N, 3))
TURN = Rotation.random(N, random_state=1).as_matrix()
WORLD, HAND = Rotation.random(2, random_state=2).as_matrix()
LEVER, SHIFT = np.array([0.02, -0.03, 0.1]), np.array([1.0, -2.0, 0.5])


@pytest.mark.parametrize("mirror", [1.0, -1.0])
@pytest.mark.parametrize("scale", [1.0, 1000.0, 1.0 / 0.0254])
def test_positions_tell_unit_axes_and_the_place_of_the_body(mirror, scale):
    world = WORLD @ np.diag([1.0, 1.0, mirror])
    seen = scale * ((PLACE + TURN @ LEVER) @ world.T + SHIFT)
    fit = fit_positions(seen, PLACE, TURN)
    assert fit.scale == pytest.approx(scale, rel=1e-3)
    np.testing.assert_allclose(fit.world, world, atol=1e-3)
    np.testing.assert_allclose(fit.shift, scale * SHIFT, atol=1e-3 * scale)
    np.testing.assert_allclose(fit.lever, LEVER, atol=1e-3)  # a prior draws it towards the hand
    assert fit.error < 1e-3


def test_a_world_that_must_not_be_mirrored_is_turned():
    fit = fit_positions(PLACE * [1.0, -1.0, 1.0], PLACE, TURN, may_mirror=False)
    assert np.linalg.det(fit.world) == pytest.approx(1.0)
    assert fit.error > 0.1


def test_one_of_many_sets_of_points_is_the_one_that_was_moved():
    sets = np.random.default_rng(3).standard_normal((5, N, 3))
    seen = 2.0 * sets[3] @ WORLD.T + SHIFT
    scale, world, shift = similarity(seen, sets)
    left = (
        seen[None] - scale[:, None, None] * np.einsum("mde,mne->mnd", world, sets) - shift[:, None]
    )
    misfit = np.linalg.norm(left, axis=(1, 2))
    assert np.argmin(misfit) == 3 and misfit[3] < 1e-12 < np.delete(misfit, 3).min()
    np.testing.assert_allclose(world[3], WORLD, atol=1e-12)


def test_orientations_tell_the_turns_of_world_and_body():
    fit = fit_orientations(WORLD @ TURN @ HAND, TURN)
    np.testing.assert_allclose(fit.world, WORLD, atol=1e-12)
    np.testing.assert_allclose(fit.hand, HAND, atol=1e-12)
    assert fit.error < 1e-12


def test_orientations_that_leap_do_not_spoil_the_others():
    seen, leapt = WORLD @ TURN @ HAND, np.arange(N) % 4 == 0
    seen[leapt] = seen[leapt] @ Rotation.from_rotvec([0.0, np.pi, 0.0]).as_matrix()
    fit = fit_orientations(seen, TURN, starts=9)
    np.testing.assert_allclose(fit.world, WORLD, atol=1e-9)
    np.testing.assert_allclose(fit.residual[leapt], np.pi, atol=1e-6)
    assert fit.residual[~leapt].max() < 1e-6


def test_angles_are_those_of_rotation_vectors():
    vectors = Rotation.random(20, random_state=4).as_rotvec()
    np.testing.assert_allclose(
        turn_angles(Rotation.from_rotvec(vectors).as_matrix()),
        np.linalg.norm(vectors, axis=1),
        atol=1e-12,
    )
