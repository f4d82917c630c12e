"""Demonstrations of skills from formulas: the hand leaves a place, comes over a body, and down on
it with its axes.
"""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.arm import ArmModel
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import Demonstration, Track

POSTURE = np.array([-0.7, 0.6, 0.0, 1.9, 0.0, 0.6416, 0.0])
"""The hand points down, where every movement starts [rad]."""
_place, _rotation = ArmModel().hand_pose(POSTURE)
START = Pose(_place, Rotation.from_matrix(_rotation).as_quat())
GRIP = Pose(np.array([0.0, 0.0, 0.15]), np.array([0.0, 1.0, 0.0, 0.0]))
"""Of the hand at the end, in the frame of the body: it points down on it."""
OVER = 0.08
NOISE = 1e-4


def smooth(share):
    s = np.clip(share, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def body_at(x, y, turn, z=1.15):
    return Pose(np.array([x, y, z]), Rotation.from_rotvec([0.0, 0.0, turn]).as_quat())


def draw_body(rng, size=1.0):
    return body_at(
        0.6 + size * rng.uniform(-0.1, 0.1),
        0.1 + size * rng.uniform(-0.1, 0.1),
        size * rng.uniform(-0.5, 0.5),
    )


def show(rng, body, role="button", told=(), name="", way=None):
    """One demonstration (Demonstration); told: (instant after the start [s], grip) of the fingers."""
    way = 2.0 * rng.uniform(0.9, 1.1) if way is None else way
    time = np.arange(-1.0, way + 1.0, 0.01) + 5.0
    since = (time - 5.0) / way
    over, down = smooth(since / 0.6), smooth((since - 0.5) / 0.5)
    last = body.place(GRIP)
    position = START.position + over[:, None] * (last.position - START.position)
    position[:, 2] += over * (1.0 - down) * OVER
    turns = Slerp([0.0, 1.0], Rotation.from_quat([START.quaternion, last.quaternion]))(
        np.minimum(over, 1.0)
    )
    shaken = Rotation.from_rotvec(10.0 * NOISE * rng.standard_normal((len(time), 3))) * turns
    hand = Track(time, position + NOISE * rng.standard_normal(position.shape), shaken.as_quat())
    seen = Track(
        time,
        body.position + NOISE * rng.standard_normal(position.shape),
        np.tile(body.quaternion, (len(time), 1)),
    )
    rests = time[time <= 5.0]  # where the joints are known without inverse kinematics
    joints, tracks = np.tile(POSTURE, (len(rests), 1)), {"hand": hand, role: seen}
    return Demonstration(
        name or f"shown_{rng.integers(1e9)}",
        tracks,
        joint_time=rests,
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
        events=tuple(told),
    )


def situation_of(body, role="button"):
    return Situation({"hand": START, role: body})
