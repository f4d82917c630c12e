"""Whether the ball lies in the hand, and where the basket stands, as noisy cameras see it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.constants import UNTURNED
from dart_skill.common.situation import Pose
from dart_skill.skills.observation import SensorLog, ThrowLog, at_rest, check_in_hand

SEAT = np.array([0.004, -0.003, 0.11])
HAND, TURN = np.array([-0.4, 0.2, 1.8]), Rotation.from_rotvec([0.4, -0.9, 0.3])
BASKET = np.array([1.9, 0.2, 0.4])
END_NS, FRAME_NS = 10_000_000_000, 10_000_000
TOLERANCE = 0.04


def seen(
    ball=lambda t: np.zeros(3),
    hand=lambda t: np.zeros(3),
    basket=lambda t: np.zeros(3),
    noise=0.001,
    without=(),
):
    """Two seconds before the end: how far each body is from where it should be at a time (3,) [m],
    the ball in the axes of the hand.
    """
    log, rng = ThrowLog(), np.random.default_rng(5)
    for stamp in range(END_NS - 2_000_000_000, END_NS + 1, FRAME_NS):
        t = 1e-9 * (stamp - END_NS)
        place = HAND + hand(t)
        if "hand" not in without:
            log.take("hand", stamp, place + noise * rng.standard_normal(3), TURN.as_quat())
        if "ball" not in without:
            log.take(
                "ball",
                stamp,
                place + TURN.apply(SEAT + ball(t)) + noise * rng.standard_normal(3),
                UNTURNED,
            )
        if "basket" not in without:
            log.take(
                "basket", stamp, BASKET + basket(t) + noise * rng.standard_normal(3), UNTURNED
            )
    return log


@pytest.mark.parametrize("noise", [0.0, 0.001, 0.005])
def test_a_ball_in_the_hand_is_seen_there_by_cameras_as_noisy_as_they_may_be(noise):
    check_in_hand(seen(noise=noise), "ball", END_NS, Pose(SEAT), TOLERANCE)
    basket = at_rest(seen(noise=noise), "basket", END_NS)
    assert basket.position == pytest.approx(BASKET, abs=0.005)


@pytest.mark.parametrize(
    ("log", "why"),
    [
        (seen(ball=lambda t: [0.0, 0.0, 0.08]), "the ball is 0.08 m from its place in the hand"),
        (seen(ball=lambda t: [0.0, 0.0, 0.1 * t]), "the ball moves"),
        (seen(hand=lambda t: [0.1 * t, 0.0, 0.0]), "the hand moves"),
        (seen(without=["ball"]), "the ball is not seen"),
        (seen(without=["hand"]), "the hand is not seen"),
    ],
)
def test_what_is_missing_is_said(log, why):
    with pytest.raises(ValueError, match=why):
        check_in_hand(log, "ball", END_NS, Pose(SEAT), TOLERANCE)


def test_a_ball_that_was_seen_longer_ago_is_not_seen():
    with pytest.raises(ValueError, match="the ball is not seen"):
        at_rest(seen(), "ball", END_NS + 1_000_000_000)


def test_a_basket_that_is_carried_about_has_no_place_yet():
    with pytest.raises(ValueError, match="the basket moves"):
        at_rest(seen(basket=lambda t: [0.0, 0.2 * t, 0.0]), "basket", END_NS)


def test_how_a_body_is_turned_counts_where_it_is_seen():
    """A quaternion and its negative are one orientation, and cameras give either."""
    log, turned = SensorLog(("hand", "part")), Rotation.from_rotvec([0.0, 0.0, 0.2])
    for k, stamp in enumerate(range(END_NS - 1_000_000_000, END_NS + 1, FRAME_NS)):
        log.take("hand", stamp, HAND, TURN.as_quat())
        quaternion = (-1) ** k * (TURN * turned).as_quat()
        log.take("part", stamp, HAND + TURN.apply(SEAT), quaternion)
    part = at_rest(log, "part", END_NS)
    assert part.apart(Pose(HAND + TURN.apply(SEAT), (TURN * turned).as_quat())) == pytest.approx(
        (0.0, 0.0), abs=1e-6
    )
    check_in_hand(log, "part", END_NS, Pose(SEAT), TOLERANCE)
    quarter = Rotation.from_rotvec([0.0, 0.0, 0.2 - np.pi / 2]).as_quat()
    with pytest.raises(ValueError, match="the part is turned by 90 degrees from how it was"):
        check_in_hand(log, "part", END_NS, Pose(SEAT, quarter), TOLERANCE)
