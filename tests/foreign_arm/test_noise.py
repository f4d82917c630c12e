"""Guided throws on paper, seen by cameras of some noise, handed to `dart-skill learn` as tables of
another laboratory (docs/bags.md).
"""

import functools
import subprocess

import numpy as np
import pytest
import yaml

pytest.importorskip(
    "mujoco",
    reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup",
)

from tests.foreign_arm import published  # noqa: E402
from tests.foreign_arm.arm import PERIOD  # noqa: E402
from tests.foreign_arm.cameras import attitude  # noqa: E402
from tests.foreign_arm.person import Way, minimum_jerk  # noqa: E402
from tests.foreign_arm.throwing.person import Aim, ball_on, swing_angles  # noqa: E402

BASKET = np.array([1.8, 0.4, 0.40])
RESISTANCE = 0.02  # of the ball over its mass [1/m]
THROWS = 12
FLOOR = 0.10  # where the ball comes to rest in the basket [m]
COLUMNS = {
    "hand": "t x y z qx qy qz qw",
    "ball": "t x y z",
    "joints": "t q1 q2 q3 q4 q5 q6 q7",
    "teacher": "t",
}


def flight(place, velocity, count):
    """Places (count, 3) of a free ball that comes to rest in the basket, a row for each step."""
    places = [place]
    for _ in range(count - 1):
        if places[-1][2] > FLOOR:
            velocity = velocity - PERIOD * (
                RESISTANCE * np.linalg.norm(velocity) * velocity + [0.0, 0.0, published.GRAVITY]
            )
            places.append(places[-1] + PERIOD * velocity)
        else:
            places.append(places[-1])
    return np.array(places)


@functools.cache
def aim():
    """Azimuth [rad] and duration [steps] of the swing that brings the ball to the basket; found by
    trying, which takes most of a throw.
    """
    return Aim(RESISTANCE).at(BASKET)


def guided_throw(longer):
    """Joint angles (n, 7), ball (n, 3), and the step of the button, of a throw and the way back;
    its swing is `longer`.
    """
    azimuth, duration = aim()
    swing = swing_angles(azimuth, duration * longer, longer)
    back = swing[-1] + minimum_jerk(1000)[:, None] * (swing[0] - swing[-1])
    angles = np.vstack(
        [np.repeat(swing[:1], 500, axis=0), swing, np.repeat(swing[-1:], 700, axis=0), back]
    )
    way = Way.through(angles)
    free = 500 + len(swing) // 2
    held = way.hand + way.attitude @ published.BALL_CENTRE
    ball = held.copy()
    ball[free:-1000] = flight(*ball_on(way, free), len(angles) - free - 1000)
    ball[-1000:] = ball[-1001] + minimum_jerk(1000)[:, None] * (held[-1] - ball[-1001])
    return angles, ball, free - round(0.045 / PERIOD)


def write_table(folder, name, rows):
    """A CSV file with the columns of its name."""
    np.savetxt(
        folder / f"{name}.csv",
        rows,
        delimiter=",",
        header=COLUMNS[name].replace(" ", ","),
        comments="",
        fmt="%.9f",
    )


def record(folder, noise, seed):
    """The tables of all throws, and the mapping file that tells what is in them; cameras with a
    noise [m].
    """
    random = np.random.default_rng(seed)
    throws = [guided_throw(1.0 + 0.04 * random.standard_normal()) for _ in range(THROWS)]
    angles, ball = (
        np.vstack([throw[0] for throw in throws]),
        np.vstack([throw[1] for throw in throws]),
    )
    begins = np.cumsum([0] + [len(throw[0]) for throw in throws[:-1]])
    times = PERIOD * np.arange(len(angles))
    way, frames = Way.through(angles), slice(0, None, 5)
    quaternions = np.array([attitude(rotation) for rotation in way.attitude[frames]])
    seen = times[frames, None]
    hand, ball = way.hand[frames], ball[frames]
    write_table(
        folder,
        "hand",
        np.hstack([seen, hand + noise * random.standard_normal(hand.shape), quaternions]),
    )
    write_table(
        folder, "ball", np.hstack([seen, ball + noise * random.standard_normal(ball.shape)])
    )
    write_table(folder, "joints", np.hstack([times[:, None], angles]))
    write_table(folder, "teacher", times[begins + [throw[2] for throw in throws]][:, None])
    place = {"time": "t", "position": ["x", "y", "z"]}
    mapping = {
        "hand": {"csv": "hand.csv", "columns": {**place, "quaternion": ["qx", "qy", "qz", "qw"]}},
        "ball": {"csv": "ball.csv", "columns": place},
        "basket": {"position": BASKET.tolist()},
        "joints": {
            "csv": "joints.csv",
            "columns": {"time": "t", "position": [f"q{number}" for number in range(1, 8)]},
        },
        "teacher": {"csv": "teacher.csv", "columns": {"time": "t"}},
    }
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping), encoding="utf-8")


def refused(folder, noise, seed):
    """Lines of `dart-skill learn` about throws that it left out."""
    record(folder, noise, seed)
    command = [
        "dart-skill",
        "learn",
        str(folder),
        "--mapping",
        str(folder / "mapping.yaml"),
        "--output",
        str(folder / "model.npz"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "learned from" in done.stdout, done.stdout + done.stderr
    return [line for line in done.stdout.splitlines() if "left out" in line]


def test_every_throw_counts_that_good_cameras_saw(tmp_path):
    assert not refused(tmp_path, noise=0.0001, seed=0)


def test_every_throw_counts_that_noisier_cameras_saw(tmp_path):
    left_out = []
    for seed in range(3):
        (tmp_path / str(seed)).mkdir()
        left_out += refused(tmp_path / str(seed), noise=0.0003, seed=seed)
    assert not left_out
