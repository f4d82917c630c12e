"""What a registration leaves of sightings: by SciPy's rotations, its derivatives by differences."""

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import Sightings
from dart_skill.arm._registration_fit import linearised

RNG = np.random.default_rng(0)
N = 12
ARM = Rotation.from_rotvec(RNG.standard_normal((N, 3)))
SEEN = Rotation.from_rotvec(0.1 * RNG.standard_normal((N, 3))) * ARM
SIGHTINGS = (
    RNG.standard_normal((N, 3)),
    SEEN.as_quat(),
    RNG.standard_normal((N, 3)),
    ARM.as_quat(),
    RNG.standard_normal((N, 6)),
)
UNKNOWN = 0.05 * RNG.standard_normal(13)


def left_by_scipy(unknown):
    """Of positions and rotations, (n, 3) each: R = X A Y, p = X (a + A s) + t, with A and a a
    delay later.
    """
    position, quaternion, arm_position, arm_quaternion, velocity = SIGHTINGS
    base, hand = Rotation.from_rotvec(unknown[:3]), Rotation.from_rotvec(unknown[6:9])
    arm = Rotation.from_rotvec(-unknown[12] * velocity[:, 3:]) * Rotation.from_quat(arm_quaternion)
    expected = (
        base.apply(arm_position - unknown[12] * velocity[:, :3] + arm.apply(unknown[9:12]))
        + unknown[3:6]
    )
    return (
        position - expected,
        (Rotation.from_quat(quaternion) * (base * arm * hand).inv()).as_rotvec(),
    )


def test_what_is_left_is_that_of_scipys_rotations():
    off, twist, _, _ = linearised(Sightings(*SIGHTINGS), UNKNOWN)
    expected_off, expected_twist = left_by_scipy(UNKNOWN)
    np.testing.assert_allclose(off, expected_off, atol=1e-13)
    np.testing.assert_allclose(twist, expected_twist, atol=1e-13)


def test_near_none_the_derivatives_are_those_of_differences():
    """To first order: of rotations where what is left is small."""
    seen = Sightings(*SIGHTINGS[:1], SIGHTINGS[3], *SIGHTINGS[2:])
    _, _, rows, turned = linearised(seen, np.zeros(13))
    for k in range(13):
        ahead, behind = (linearised(seen, step * np.eye(13)[k])[:2] for step in (1e-6, -1e-6))
        for found, more, less in zip((rows, turned), ahead, behind, strict=True):
            np.testing.assert_allclose(-found[:, :, k], (more - less) / 2e-6, atol=1e-7)
