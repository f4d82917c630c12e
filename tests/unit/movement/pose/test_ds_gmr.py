"""Attractors of poses and DS-GMR on them: against numerical integration, the Euclidean model, and
frames that turn.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import interp1d
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.movement import (
    DSGMR,
    TaskFrame,
    attractor_from_motion,
    smooth_derivatives,
)
from dart_skill.movement.pose import (
    PoseDSGMR,
    PoseFrame,
    PoseMotion,
    angles_between,
    exponential,
    follow_pose_attractor,
    logarithm,
    pose_attractor,
    pose_motion,
)
from tests.unit.movement.pose.random_poses import apart, blocks, flipped, orientations, turned

TIME = np.linspace(0.0, 1.0, 101)
BLEND = TIME**3 * (10.0 - 15.0 * TIME + 6.0 * TIME**2)


@pytest.fixture
def rng():
    return np.random.default_rng(2)


def tumbling(degrees, rng):
    """Poses (101, 7) that turn by so many degrees about an axis that leans, from an orientation at
    random.
    """
    axis = np.column_stack([0.3 * BLEND, 0.1 * np.sin(np.pi * TIME), np.ones(101)])
    path = Rotation.from_rotvec(np.radians(degrees) * BLEND[:, None] * axis) * Rotation.from_quat(
        orientations(1, rng)[0]
    )
    return np.column_stack([np.outer(BLEND, [0.4, 0.1, 0.2]) + [0.0, 0.0, 0.3], path.as_quat()])


# --- motion and attractor ---


def test_motion_of_a_constant_turn_is_exact():
    rate = np.array([0.0, -4.8, 3.6])
    poses = np.column_stack(
        [np.outer(TIME, [1.0, 2.0, 3.0]), Rotation.from_rotvec(TIME[:, None] * rate).as_quat()]
    )
    motion = pose_motion(TIME, poses, noise=[0.0, 0.0])
    np.testing.assert_allclose(
        motion.velocity, np.tile([1.0, 2.0, 3.0, *rate], (101, 1)), atol=1e-7
    )
    np.testing.assert_allclose(motion.acceleration, 0.0, atol=1e-5)


def test_noise_is_smoothed_and_signs_do_not_matter(rng):
    clean = tumbling(300.0, rng)
    noisy = clean.copy()
    noisy[:, 3:] = (
        Rotation.from_rotvec(rng.normal(0.0, 0.01, (101, 3))) * Rotation.from_quat(clean[:, 3:])
    ).as_quat()
    motion = pose_motion(TIME, flipped(noisy, rng))
    assert angles_between(motion.pose, clean).mean() < 0.5 * angles_between(noisy, clean).mean()
    exact = pose_motion(TIME, clean, noise=[0.0, 0.0])
    assert (
        np.abs(motion.velocity - exact.velocity)[5:-5].max() < 0.06 * np.abs(exact.velocity).max()
    )


def reference(attractor, pose0, velocity0, kp, kv, push=None):
    """The equations by scipy, with a slerp between the attractors."""
    turn, place = (
        Slerp(TIME, Rotation.from_quat(attractor[:, 3:])),
        interp1d(TIME, attractor[:, :3], axis=0),
    )
    force = interp1d(TIME, np.zeros((101, 6)) if push is None else push, axis=0)

    def slope(t, state):
        t = min(max(t, 0.0), 1.0)
        hand, rate = Rotation.from_quat(state[3:7]), state[10:]
        way = (turn(t) * hand.inv()).as_rotvec()
        spin = 0.5 * np.array([*np.cross(rate, state[3:6]) + rate * state[6], -rate @ state[3:6]])
        pull = np.concatenate(
            [kp[0] * (place(t) - state[:3]) - kv[0] * state[7:10], kp[1] * way - kv[1] * rate]
        )
        return np.concatenate([state[7:10], spin, pull + force(t)])

    # From stamp to stamp: between them the attractor is smooth.
    states = [np.concatenate([pose0, velocity0])]
    for span in zip(TIME[:-1], TIME[1:], strict=True):
        states.append(
            solve_ivp(slope, span, states[-1], rtol=1e-9, atol=1e-11, method="DOP853").y[:, -1]
        )
    return np.array(states)


@pytest.mark.parametrize("gains", [((200.0, 200.0), (28.0, 28.0)), ((50.0, 900.0), (10.0, 5.0))])
def test_following_is_numerical_integration(rng, gains):
    kp, kv = gains
    attractor = flipped(tumbling(250.0, rng)[::-1], rng)
    pose0 = np.array([0.1, 0.0, 0.2, *orientations(1, rng)[0]])
    velocity0, push = rng.normal(size=6), 20.0 * rng.normal(size=(101, 6))
    states = reference(attractor, pose0, velocity0, kp, kv, push)
    motion = follow_pose_attractor(attractor, 0.01, pose0, velocity0, kp, kv, push)
    assert apart(motion.pose, states[:, 3:7]) < 3e-6
    np.testing.assert_allclose(motion.pose[:, :3], states[:, :3], atol=1e-8)
    np.testing.assert_allclose(motion.velocity, states[:, 7:], atol=1e-4)


@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0, 360.0])
def test_the_attractor_of_a_motion_leads_along_it(rng, degrees):
    poses = tumbling(degrees, rng)
    motion = pose_motion(TIME, poses, noise=[0.0, 0.0])
    followed = follow_pose_attractor(pose_attractor(motion), 0.01, poses[0], motion.velocity[0])
    assert np.degrees(angles_between(followed.pose, poses).max()) < 0.02
    np.testing.assert_allclose(followed.pose[:, :3], poses[:, :3], atol=1e-4)


# --- DS-GMR ---


def scene(rng, angle):
    """Start and goal frames; the goal is turned by about `angle` [rad] against the start, and the
    whole at random.
    """
    start = PoseFrame(rng.normal(0.0, 0.3, 3), orientations(1, rng)[0])
    way = exponential(
        np.concatenate([start.position, start.orientation]),
        np.concatenate([rng.normal(0.4, 0.1, 3), rng.normal(0.0, angle, 3)]),
    )
    return [start, PoseFrame(way[:3], way[3:])]


def pour(frames, turn, rng, noise=0.003):
    """From the pose of the first frame to that of the second, while the wrist turns by `turn`
    [rad] and half of it back.
    """
    start, goal = (np.concatenate([frame.position, frame.orientation]) for frame in frames)
    path = exponential(start, BLEND[:, None] * logarithm(start, goal))
    wrist = Rotation.from_rotvec(turn * BLEND[:, None] * [0.0, 0.0, 1.0])
    path[:, 3:] = (
        Rotation.from_quat(path[:, 3:])
        * wrist
        * Rotation.from_rotvec(rng.normal(0.0, noise, (101, 3)))
    ).as_quat()
    path[:, :3] += rng.normal(0.0, 0.0005, (101, 3))
    return path


@pytest.mark.parametrize("turn", [np.pi, np.radians(260.0)])
def test_a_wrist_that_turns_through_half_a_turn_is_learned_for_frames_that_are_turned(rng, turn):
    situations = [scene(rng, 0.3) for _ in range(10)]
    model = PoseDSGMR(12)
    model.fit([model.encode(TIME, pour(frames, turn, rng)) for frames in situations], situations)
    worst = []
    for _ in range(6):
        frames = scene(rng, 0.3)
        wanted = pour(frames, turn, rng, 0.0)
        made = model.reproduce(frames, TIME, wanted[0])
        worst.append(np.degrees(angles_between(made.pose, wanted)[[50, 100]]))
        assert np.linalg.norm(made.pose[-1, :3] - wanted[-1, :3]) < 0.01
    assert np.max(worst, axis=0)[1] < 3.0, worst
    assert np.max(worst, axis=0)[0] < 10.0, worst


def test_turning_the_frames_turns_the_movement_and_signs_do_not_matter(rng):
    situations = [scene(rng, 0.3) for _ in range(10)]
    paths = [pour(frames, 3.5, rng) for frames in situations]
    model, other = PoseDSGMR(8), PoseDSGMR(8)
    model.fit([model.encode(TIME, path) for path in paths], situations)
    other.fit([other.encode(TIME, flipped(path, rng)) for path in paths], situations)
    rotation, shift, frames = Rotation.random(random_state=4), rng.normal(size=3), scene(rng, 0.3)
    start = pour(frames, 3.5, rng, 0.0)[0]
    made, again = (
        model.reproduce(frames, TIME, start),
        other.reproduce(frames, TIME, -1.0 * start * [-1, -1, -1, 1, 1, 1, 1]),
    )
    assert apart(made.pose, again.pose) < 1e-9
    rows = [
        turned(np.concatenate([frame.position, frame.orientation]), rotation, 0, shift)
        for frame in frames
    ]
    there = model.reproduce(
        [PoseFrame(row[:3], row[3:]) for row in rows], TIME, turned(start, rotation, 0, shift)
    )
    assert apart(there.pose, turned(made.pose, rotation, 0, shift)) < 1e-10
    np.testing.assert_allclose(
        there.pose[:, :3], turned(made.pose, rotation, 0, shift)[:, :3], atol=1e-10
    )
    np.testing.assert_allclose(
        there.covariance, blocks(rotation) @ made.covariance @ blocks(rotation).T, atol=1e-10
    )


def test_with_tiny_turns_it_is_the_euclidean_model(rng):
    """Poses near one point, as six coordinates; both cut time into the same intervals."""
    size, base = 1e-5, np.array([0.0, 0.0, 0.0, *orientations(1, rng)[0]])
    flat = [
        size
        * (
            np.outer(BLEND, rng.normal(size=6))
            + np.outer(np.sin(np.pi * TIME), rng.normal(size=6))
        )
        for _ in range(5)
    ]
    euclidean = DSGMR(6, partition="time")
    motions = [smooth_derivatives(TIME, one, noise=0.0) for one in flat]
    euclidean.fit(
        [euclidean.features(TIME, attractor_from_motion(*one, 200.0)) for one in motions],
        [[TaskFrame(np.eye(7), np.zeros(7))]] * 5,
    )
    curved = PoseDSGMR(6, partition="time", correlated=True)
    encoded = [
        curved.features(
            TIME, PoseMotion(exponential(base, one.position), one.velocity, one.acceleration)
        )
        for one in motions
    ]
    curved.fit(encoded, [[PoseFrame(np.zeros(3))]] * 5)
    wanted = euclidean.reproduce(
        [TaskFrame(np.eye(7), np.zeros(7))], TIME, np.zeros(6), np.zeros(6)
    )
    made = curved.reproduce([PoseFrame(np.zeros(3))], TIME, base)
    np.testing.assert_allclose(
        logarithm(base, made.pose) / size, wanted.position / size, atol=1e-3
    )
    np.testing.assert_allclose(made.covariance / size**2, wanted.covariance / size**2, atol=1e-3)


def test_a_further_input_is_interpolated(rng):
    """How far the wrist turns depends on a number beside time."""
    world, model = [PoseFrame(np.zeros(3))], PoseDSGMR(8, n_inputs=1, partition="time")

    def twist(degrees):
        path = Rotation.from_rotvec(np.radians(degrees) * BLEND[:, None] * [0.0, 0.6, 0.8])
        return np.column_stack([np.outer(BLEND, [0.3, 0.0, 0.0]), path.as_quat()])

    shown = [150.0, 180.0, 210.0, 240.0]
    model.fit(
        [model.encode(TIME, twist(angle), inputs=[angle / 180.0]) for angle in shown], [world] * 4
    )
    made = model.reproduce(world, TIME, twist(0.0)[0], inputs=[225.0 / 180.0])
    assert np.degrees(angles_between(made.pose, twist(225.0)).max()) < 2.5


def test_a_push_turns_the_hand_which_comes_back(rng):
    world, model = [PoseFrame(np.zeros(3))], PoseDSGMR(6)
    paths = [
        pour([PoseFrame(np.zeros(3)), PoseFrame([0.4, 0.0, 0.0])], 1.0, rng) for _ in range(3)
    ]
    model.fit([model.encode(TIME, path) for path in paths], [world] * 3)
    push = np.zeros((101, 6))
    push[20:30, 4] = 60.0
    free, pushed = (
        model.reproduce(world, TIME, paths[0][0]),
        model.reproduce(world, TIME, paths[0][0], push=push),
    )
    away = angles_between(free.pose, pushed.pose)
    assert 0.1 < away[30:40].max() and away[-1] < 0.05 * away.max()


FRAME = PoseFrame(np.zeros(3))
POSES = np.column_stack(
    [
        np.outer(BLEND, [0.3, 0.0, 0.0]),
        Rotation.from_rotvec(np.outer(BLEND, [1.0, 0.0, 0.0])).as_quat(),
    ]
)
FAST = np.column_stack(
    [np.zeros((101, 3)), Rotation.from_rotvec(np.outer(TIME, [0.0, 0.0, 30.0])).as_quat()]
)


def spoilt(row, column, value):
    poses = POSES.copy()
    poses[row, column] = value
    return poses


def fitted(**options):
    model = PoseDSGMR(3, **options)
    return model.fit([model.encode(TIME, POSES)], [[FRAME]])


WRONG = {
    r"poses holds nan at index \(7, 5\)": lambda: pose_motion(TIME, spoilt(7, 5, np.nan)),
    r"poses: the quaternion at index \(7,\) has length 0": lambda: pose_motion(
        TIME, spoilt(7, slice(3, 7), 0.0)
    ),
    "poses must have 7 columns": lambda: pose_motion(TIME, POSES[:, 1:]),
    "time must have length 101": lambda: PoseDSGMR(2).features(TIME[1:], pose_motion(TIME, POSES)),
    "noise must have length 2": lambda: pose_motion(TIME, POSES, noise=[0.1]),
    "degrees ahead, and a spring takes the shorter way; raise the stiffness": lambda: PoseDSGMR(
        2
    ).encode(TIME, FAST),
    "stiffness must be one number, or two": lambda: PoseDSGMR(2, [1.0, 2.0, 3.0]),
    "stiffness must be positive": lambda: PoseDSGMR(2, -1.0),
    "partition must be one of": lambda: PoseDSGMR(2, partition="space"),
    "samples have no number before the pose": lambda: PoseDSGMR(2).fit([POSES], [[FRAME]]),
    "holds no model yet": lambda: PoseDSGMR(2).retrieve([FRAME], TIME),
    "inputs beside time must have shape": lambda: fitted().retrieve([FRAME], TIME, [0.5]),
    "pose0 must have 7 columns": lambda: fitted().reproduce([FRAME], TIME, np.zeros(3)),
    "pose0: the quaternion has length 0": lambda: fitted().reproduce([FRAME], TIME, np.zeros(7)),
    r"push must have shape \(101, 6\)": lambda: fitted().reproduce(
        [FRAME], TIME, POSES[0], push=np.zeros((101, 3))
    ),
    "must be equally spaced": lambda: fitted().reproduce([FRAME], TIME**2, POSES[0]),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_wrong_is_named(message):
    with pytest.raises(ValueError, match=message):
        WRONG[message]()
