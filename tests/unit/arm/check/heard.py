"""An arm that somebody leads through postures, and cameras that see it, without ROS: what was
heard of them, right in all lines.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, Registration
from dart_skill.arm.check import Endpoint, Heard, HeardJoints, HeardPoses, check_arm

MODEL = ArmModel()
NAMES = tuple(f"wam_j{k}" for k in range(1, 8))
MIDDLE = np.array([0.0, -0.9, 0.0, 0.8, 0.0, -0.35, 0.0])
BEGIN_NS = 1_700_000_000 * 10**9
QUIET = {
    "strongest_force": 60.0,
    "fastest_hand": 1.0,
    "farthest_error": 0.1,
    "joint_margin": 0.02,
    "joint_overrun": 0.05,
    "longest_gap": 0.1,
}
"""Limits for first throws."""


def led(time):
    """Joint angles (n, 7) of an arm that is led about, all joints at speeds of their own."""
    return MIDDLE + 0.5 * np.sin(
        np.outer(time, [0.9, 0.7, 1.1, 0.8, 1.3, 1.0, 1.2]) + np.arange(7)
    )


def heard(truth=None, duration=12.0, noise=1e-4, seed=0):
    """Everything as it shall be; truth: the registration with which the cameras see the hand."""
    rng, truth = np.random.default_rng(seed), truth or Registration()
    time, frames = np.arange(0.0, duration, 0.002), np.arange(0.0, duration, 0.01)
    q = led(time)
    stamps = BEGIN_NS + np.round(1e9 * time).astype(np.int64)
    joints = HeardJoints(
        "/joint_states", (Endpoint("wam_driver"),), stamps + 1_000_000, stamps, ("",),
        orders=(NAMES,), position=q, velocity=np.gradient(q, time, axis=0),
    )  # fmt: skip
    hands = [MODEL.hand_pose(row) for row in led(frames)]
    base, hand = (
        Rotation.from_quat(truth.turn),
        Rotation.from_matrix(np.array([rotation for _, rotation in hands])),
    )
    place = (
        base.apply(np.array([position for position, _ in hands]) + hand.apply(truth.hand_shift))
        + truth.shift
    )
    turned = (base * hand * Rotation.from_quat(truth.hand_turn)).as_quat()
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(frames), 1))
    bodies = {
        "hand": (place, turned),
        "ball": (place + [0.0, 0.0, 0.1], still),
        "basket": (np.tile([2.0, 0.0, 0.4], (len(frames), 1)), still),
    }
    seen = BEGIN_NS + np.round(1e9 * frames).astype(np.int64)
    poses = {
        role: HeardPoses(
            f"/vrpn_mocap/{role}/pose", (Endpoint("vrpn_mocap", "best_effort"),), seen + 6_000_000, seen, ("world",),
            position=position + noise * rng.standard_normal(position.shape), quaternion=quaternion,
        )
        for role, (position, quaternion) in bodies.items()
    }  # fmt: skip
    return Heard(False, joints, poses, (Endpoint("commander"),), (Endpoint("wam_driver"),))


def with_joints(whole, **change):
    """The same with something of the joint states changed."""
    return replace(whole, joints=replace(whole.joints, **change))


def with_pose(whole, role="hand", **change):
    """The same with something of a body's poses changed."""
    return replace(whole, poses={**whole.poses, role: replace(whole.poses[role], **change)})


def kept(stream, mask):
    """A stream of poses with some of its messages only."""
    return replace(
        stream,
        **{
            name: getattr(stream, name)[mask]
            for name in ("received_ns", "stamp_ns", "position", "quaternion")
        },
    )


def table(whole, limits=QUIET):
    """The lines of a check by name, and the report."""
    report = check_arm(whole, limits, MODEL)
    return {one.check: one for one in report.lines}, report
