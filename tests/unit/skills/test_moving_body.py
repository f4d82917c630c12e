"""How a body moves now, from noisy poses that come late."""

import numpy as np
import pytest

from dart_skill.skills.execution import FEWEST_POSES, POSE_WINDOW, MovingBody

NS = 1_000_000_000
TURN = np.array([0.0, 0.0, 0.6, 0.8])


def seen(motion, until, rate=100.0, noise=0.0, seed=0):
    """A body that moves by motion(time) was seen until then [s]."""
    rng, body = np.random.default_rng(seed), MovingBody("cup")
    for k in range(round(until * rate) + 1):
        body.see(round(k / rate * NS), motion(k / rate) + noise * rng.normal(size=3), TURN)
    return body


def thrown_up(time):
    return (
        np.array([0.1, 0.2, 0.3])
        + np.array([0.5, -0.2, 1.0]) * time
        + np.array([0.0, 0.0, -4.0]) * time**2
    )


@pytest.mark.parametrize("late", [0.0, 0.01, 0.05])
def test_a_parabola_is_known_exactly_also_a_little_later(late):
    body = seen(thrown_up, 1.0)
    now = body.at(round((1.0 + late) * NS))
    assert now.position == pytest.approx(thrown_up(1.0 + late))
    assert now.velocity == pytest.approx([0.5, -0.2, 1.0 - 8.0 * (1.0 + late)])
    assert now.acceleration == pytest.approx([0.0, 0.0, -8.0], abs=1e-6)
    assert now.age == pytest.approx(late) and now.quaternion.tolist() == TURN.tolist()


def test_noise_moves_speed_as_least_squares_say():
    """Standard deviation of the slope at the end of a parabola through n samples over T: about 14
    noise / (T sqrt(n)).
    """
    n = round(POSE_WINDOW * 100) + 1
    speeds = [
        seen(thrown_up, 0.5, noise=3e-4, seed=seed).at(NS // 2).velocity[0] for seed in range(300)
    ]
    assert np.mean(speeds) == pytest.approx(0.5, abs=2e-3)
    assert np.std(speeds) == pytest.approx(13.9 * 3e-4 / (POSE_WINDOW * np.sqrt(n)), rel=0.15)


def test_what_was_seen_long_ago_does_not_count():
    body = seen(lambda time: np.array([min(time, 1.0), 0.0, 0.0]), 1.0 + 1.1 * POSE_WINDOW)
    assert body.at(round(1.3 * NS)).velocity == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_few_poses_tell_a_place_and_no_speed():
    body = seen(thrown_up, (FEWEST_POSES - 2) / 100.0)
    now = body.at(NS // 10)
    assert (
        now.position == pytest.approx(thrown_up((FEWEST_POSES - 2) / 100.0))
        and not now.velocity.any()
        and not now.acceleration.any()
    )


def test_poses_that_come_again_or_late_change_nothing():
    body, twin = seen(thrown_up, 1.0), seen(thrown_up, 1.0)
    for stamp in (NS, NS // 2):
        body.see(stamp, np.full(3, 9.0), TURN)
    assert body.newest_ns == NS and body.at(NS).position.tolist() == twin.at(NS).position.tolist()


def test_before_it_was_seen_nothing_is_known():
    body = MovingBody("cup")
    assert body.newest_ns is None
    with pytest.raises(ValueError, match="the cup has not been seen yet"):
        body.at(0)
