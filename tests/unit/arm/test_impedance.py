"""The impedance law on an arm that is integrated with Pinocchio's model: the hand moves as (7.19)
says, in closed form.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    Actuation,
    ArmModel,
    HandState,
    Impedance,
    JointServo,
    PoseGains,
    Reference,
    attractor_acceleration,
    minimum_jerk,
    rotation_error,
    the_arm,
)
from tests.interpreted import interpreted

WAM = the_arm()
POSTURE = np.array([0.1, 0.6, 0.2, 0.9, 0.1, 0.5, 0.1])
GAINS = (200.0, 2 * np.sqrt(200.0))


def bent_postures(n=20, seed=0):
    """Postures away from singularities, and velocities."""
    rng = np.random.default_rng(seed)
    return POSTURE + rng.uniform(-0.25, 0.25, (n, 7)), rng.normal(0.0, 1.0, (n, 7))


def hand_acceleration(model, q, qd, wrench, torque):
    """Acceleration (6,) of the hand of an arm without friction, gravity compensated."""
    jacobian = model.jacobian(q)
    qdd = np.linalg.solve(
        model.mass_matrix(q), jacobian.T @ wrench + torque - model.coriolis_torque(q, qd)
    )
    return jacobian @ qdd + model.jacobian_drift(q, qd), qdd


@pytest.fixture(scope="module")
def model():
    return ArmModel(ball_in_hand=True)


def test_the_hand_accelerates_exactly_as_commanded(model):
    """Whatever the posture, the velocity and the pull of the posture in the null space."""
    impedance, rng = (
        Impedance(model, friction_compensation=0.0, least_mobility=1e-12),
        np.random.default_rng(1),
    )
    for q, qd in zip(*bent_postures(), strict=True):
        wanted = rng.normal(0.0, [5.0] * 3 + [10.0] * 3)
        wrench, torque = impedance.act(q, qd, wanted, posture=q + rng.normal(0.0, 0.5, 7))
        actual, _ = hand_acceleration(model, q, qd, wrench, torque)
        np.testing.assert_allclose(actual, wanted, atol=1e-8)


def hand_mobility(model, q):
    """Eigenvalues (6,) and directions (6, 6) of the hand's mobility [1/kg], a radian counting for
    0.18 m.
    """
    scaled = np.array([1.0, 1.0, 1.0, 0.18, 0.18, 0.18])[:, None] * model.jacobian(q)
    return np.linalg.eigh(scaled @ np.linalg.solve(model.mass_matrix(q), scaled.T))


@pytest.mark.parametrize("bend", [1e-3, 0.02, 0.05, 0.1])
def test_with_shoulder_and_wrist_straight_the_arm_is_not_driven_hard_whatever_is_asked_of_the_hand(
    model, bend
):
    """The throw passes through q2 = q6 = 0, where the axes of J1 and J3, J5 and J7 are in line:
    there the hand hardly moves in one direction. Driven all the same, the wrist span at 12 rad/s
    and the ball came down half a metre to the side.
    """
    q = np.array([0.1, bend, -0.05, -0.6, 0.1, bend, -0.05])
    mobility, directions = hand_mobility(model, q)
    wanted = 30.0 * directions[:, 0] / np.array([1.0, 1.0, 1.0, 0.18, 0.18, 0.18])

    def effort(least):
        """Root of qdd' M qdd, which is |a| share / sqrt(mobility) in a direction of the mobility."""
        wrench, torque = Impedance(model, friction_compensation=0.0, least_mobility=least).act(
            q, np.zeros(7), wanted, q
        )
        qdd = np.linalg.solve(model.mass_matrix(q), model.jacobian(q).T @ wrench + torque)
        return np.sqrt(qdd @ model.mass_matrix(q) @ qdd)

    assert effort(1e-12) == pytest.approx(30.0 / np.sqrt(mobility[0]), rel=1e-6)
    assert effort(0.08) == pytest.approx(
        30.0 / np.sqrt(mobility[0]) * min(mobility[0] / 0.08, 1.0) ** 2, rel=1e-6
    )
    assert effort(0.08) <= 30.0 / np.sqrt(0.08)


def test_the_posture_is_pulled_in_the_null_space_only(model):
    impedance, zero = (
        Impedance(model, friction_compensation=0.0, least_mobility=1e-12),
        np.zeros(7),
    )
    other = POSTURE + 0.3 * np.linalg.svd(model.jacobian(POSTURE))[2][-1]
    actual, qdd = hand_acceleration(
        model, POSTURE, zero, *impedance.act(POSTURE, zero, np.zeros(6), other)
    )
    np.testing.assert_allclose(actual, 0.0, atol=1e-8)
    assert qdd @ (other - POSTURE) > 0.5, "the arm moves towards the posture"


def integrate(model, law, q, qd, duration, h=5e-4):
    """Semi-implicit midpoint steps of the frictionless arm; states (n, 2, 7) from the start on."""
    path = [np.array([q, qd])]
    for _ in range(round(duration / h)):
        _, first = hand_acceleration(model, q, qd, *law(q, qd))
        half, half_rate = q + 0.5 * h * qd, qd + 0.5 * h * first
        _, middle = hand_acceleration(model, half, half_rate, *law(half, half_rate))
        q, qd = q + h * half_rate, qd + h * middle
        path.append(np.array([q, qd]))
    return np.array(path)


def still(position, rotation):
    return Reference(position, rotation, position, rotation, np.zeros(6), np.zeros(6))


def test_the_hand_is_drawn_to_the_attractor_as_a_critically_damped_mass(model):
    """(7.19) from a perturbed start, 5 cm away and moving: e = (e0 + (v0 + w e0) t) exp(-w t)."""
    impedance = Impedance(model, friction_compensation=0.0, least_mobility=1e-12)
    position, rotation = model.hand_pose(POSTURE)
    start = POSTURE + np.array([0.03, -0.04, 0.02, 0.03, -0.05, 0.03, 0.02])
    rate = np.array([0.1, -0.2, 0.1, 0.2, 0.0, 0.1, 0.3])
    reference = still(position, rotation)

    def law(q, qd):
        hand = model.hand_state(q, qd)
        return impedance.act(
            q, qd, attractor_acceleration(reference, hand, PoseGains.of(GAINS, GAINS)), POSTURE
        )

    h, duration, w = 5e-4, 0.4, np.sqrt(GAINS[0])
    path = integrate(model, law, start, rate, duration, h)
    hand = [model.hand_pose(q)[0] - position for q in path[:, 0]]
    time = h * np.arange(len(path))[:, None]
    first, speed = hand[0], model.jacobian(start)[:3] @ rate
    expected = (first + (speed + w * first) * time) * np.exp(-w * time)
    assert np.linalg.norm(first) > 0.02
    np.testing.assert_allclose(hand, expected, atol=1e-4)


def test_the_orientation_is_drawn_to_its_attractor(model):
    """A pure rotation about one axis at rest: the angle is critically damped, too, and the hand's
    origin stays.
    """
    impedance = Impedance(model, friction_compensation=0.0, least_mobility=1e-12)
    position, rotation = model.hand_pose(POSTURE)
    axis, angle, w, h = np.array([0.6, 0.0, 0.8]), 0.2, np.sqrt(GAINS[0]), 5e-4
    reference = still(position, Rotation.from_rotvec(angle * axis).as_matrix() @ rotation)

    def law(q, qd):
        hand = model.hand_state(q, qd)
        return impedance.act(
            q, qd, attractor_acceleration(reference, hand, PoseGains.of(GAINS, GAINS)), POSTURE
        )

    path = integrate(model, law, POSTURE, np.zeros(7), 0.3, h)
    turned = [
        Rotation.from_matrix(model.hand_pose(q)[1] @ rotation.T).as_rotvec() for q in path[::20, 0]
    ]
    time = 20 * h * np.arange(len(turned))
    np.testing.assert_allclose(
        turned, np.outer(angle - angle * (1 + w * time) * np.exp(-w * time), axis), atol=2e-4
    )
    np.testing.assert_allclose(
        [model.hand_pose(q)[0] for q in path[::20, 0]],
        np.tile(position, (len(turned), 1)),
        atol=1e-4,
    )


def some_hand(seed=0):
    rng = np.random.default_rng(seed)
    return HandState(
        rng.normal(size=3), Rotation.random(random_state=seed).as_matrix(), rng.normal(size=6)
    )


def test_attractor_acceleration_is_the_spring_and_the_damper():
    hand, turn = some_hand(), Rotation.from_rotvec([0.1, -0.2, 0.3])
    pull = hand.position + [1.0, 2.0, 3.0], turn.as_matrix() @ hand.rotation
    reference = Reference(*pull, hand.position * 7, np.eye(3), np.ones(6), np.ones(6))
    result = attractor_acceleration(reference, hand, PoseGains.of((10.0, 2.0), (30.0, 4.0)))
    np.testing.assert_allclose(result[:3], 10.0 * np.array([1.0, 2.0, 3.0]) - 2.0 * hand.linear)
    np.testing.assert_allclose(result[3:], 30.0 * np.array([0.1, -0.2, 0.3]) - 4.0 * hand.angular)


def test_a_second_pull_is_to_the_motion_that_is_expected():
    impedance, gains = Impedance(ArmModel()), PoseGains.of(GAINS, GAINS)
    q, qd = np.linspace(-0.4, 0.5, 7), np.linspace(0.3, -0.2, 7)
    hand = impedance.model.hand_state(q, qd)
    for way, faster, wanted in (
        ([0.0, 0.0, 0.0], np.zeros(6), np.zeros(6)),
        ([0.0, 0.1, 0.0], [1.0, 0, 0, 0, 0, 2.0], [2.0, 1.0, 0, 0, 0, 8.0]),
    ):
        expected = Reference(
            np.zeros(3),
            np.eye(3),
            hand.position + way,
            hand.rotation,
            hand.velocity + faster,
            np.zeros(6),
        )
        alone, both = (
            impedance.pulled(q, qd, expected, gains, tracking)
            for tracking in (None, PoseGains.of((10.0, 2.0), (30.0, 4.0)))
        )
        np.testing.assert_allclose(both - alone, wanted, atol=1e-9)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_a_turn_is_not_taken_for_none(axis):
    error = rotation_error(Rotation.from_rotvec(np.pi * axis).as_matrix().round(), np.eye(3))
    np.testing.assert_allclose(np.abs(error), np.pi * axis)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 1.5, 3.0, 3.14159])
def test_rotation_error_is_the_rotation_vector_between_two_rotations(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    for seed in range(5):
        rotation = Rotation.random(random_state=seed)
        target = Rotation.from_rotvec(angle * axis) * rotation
        np.testing.assert_allclose(
            rotation_error(target.as_matrix(), rotation.as_matrix()), angle * axis, atol=1e-8
        )


def test_a_share_of_the_identified_friction_is_compensated(model):
    impedance = Impedance(model, friction_compensation=0.8)
    fast = np.array([1.0, -1.0, 2.0, -2.0, 3.0, 1.0, -1.0])
    friction = (
        WAM.of_joints("coulomb_friction") * np.sign(fast)
        + WAM.of_joints("viscous_friction") * fast
    )
    np.testing.assert_allclose(impedance.friction_torque(fast), 0.8 * friction, rtol=1e-9)
    np.testing.assert_array_equal(impedance.friction_torque(np.zeros(7)), 0.0)
    slow = impedance.friction_torque(np.full(7, 1e-4))
    assert (slow < 0.01 * WAM.of_joints("coulomb_friction")).all(), (
        "smooth through zero: no chatter"
    )


@pytest.mark.parametrize("share", [0.0, 0.8])
def test_a_joint_that_stands_still_is_helped_where_it_is_driven_and_never_beyond_its_friction(
    model, share
):
    impedance, still = Impedance(model, friction_compensation=share), np.zeros(7)
    coulomb = WAM.of_joints("coulomb_friction")
    drives = np.linspace(-3.0, 3.0, 13)[:, None] * coulomb
    helped = np.array([impedance.friction_torque(still, drive) for drive in drives])
    np.testing.assert_allclose(helped[6], 0.0)
    np.testing.assert_allclose(helped, -helped[::-1])
    np.testing.assert_allclose(helped[[0, -1]], share * np.array([-coulomb, coulomb]), rtol=1e-6)
    fast = np.full(7, 0.5)
    np.testing.assert_allclose(
        impedance.friction_torque(fast, -drives[-1] / 10),
        impedance.friction_torque(fast),
        rtol=1e-6,
    )


@pytest.mark.parametrize(("roll", "offset"), [(2, 0.01), (4, 0.03)])
def test_a_roll_that_friction_holds_in_spite_of_compensation_by_its_speed_follows_with_the_help_of_its_drive(
    model, roll, offset
):
    left = []
    for settings in ({"weak_drive": np.inf}, {}):
        impedance, actuation = Impedance(model, **settings), Actuation(WAM)
        q, qd = POSTURE.copy(), np.zeros(7)
        wanted = POSTURE + offset * np.eye(7)[roll]
        for _ in range(300):
            jacobian = model.jacobian(q)
            wrench, torque = impedance.act(
                q, qd, jacobian @ (400.0 * (wanted - q) - 40.0 * qd), wanted
            )
            net = jacobian.T @ wrench + torque - model.coriolis_torque(q, qd)
            qd = qd + 0.002 * actuation.acceleration(model.mass_matrix(q), net, qd, 0.002)
            q = q + 0.002 * qd
        left.append(wanted[roll] - q[roll])
    held, helped = left
    assert held > 0.9 * offset and abs(helped) < 0.7 * offset


def test_the_joint_servo_pulls_towards_the_wanted_motion_within_its_limits(model):
    servo, zero = JointServo(Impedance(model, friction_compensation=0.0)), np.zeros(7)
    near = servo.torque(POSTURE, zero, POSTURE + 1e-3, zero, zero)
    np.testing.assert_allclose(near, the_arm().servo.stiffness * 1e-3)
    np.testing.assert_allclose(
        servo.torque(POSTURE, zero, POSTURE - 1.0, zero, zero), -the_arm().servo.limit
    )
    acceleration = np.array([1.0, -2.0, 0.5, 1.0, 0.0, 3.0, -1.0])
    inertia = model.mass_matrix(POSTURE)
    np.testing.assert_allclose(
        servo.torque(POSTURE, zero, POSTURE, zero, acceleration), inertia @ acceleration, atol=1e-9
    )


def test_the_damped_stop_only_brakes(model):
    servo, rng = JointServo(Impedance(model)), np.random.default_rng(3)
    for qd in rng.normal(0.0, 3.0, (20, 7)):
        torque = servo.damp(POSTURE, qd)
        assert (torque * qd <= 0).all() and (np.abs(torque) <= 2 * the_arm().servo.limit).all()


@pytest.mark.parametrize("duration", [0.3, 2.0])
def test_minimum_jerk_begins_and_ends_at_rest_and_is_its_own_derivative(duration):
    start, end, h = np.array([0.1, -0.3]), np.array([1.0, 0.4]), 1e-5 * duration
    for time, expected in ((0.0, start), (duration, end), (-1.0, start), (2 * duration, end)):
        position, velocity, acceleration = minimum_jerk(start, end, duration, time)
        np.testing.assert_allclose(position, expected, atol=1e-12)
        np.testing.assert_allclose([velocity, acceleration], 0.0, atol=1e-9)
    for time in np.linspace(0.1, 0.9, 5) * duration:
        position, velocity, acceleration = minimum_jerk(start, end, duration, time)
        before, after = (minimum_jerk(start, end, duration, t)[0] for t in (time - h, time + h))
        np.testing.assert_allclose(velocity, (after - before) / (2 * h), rtol=1e-6)
        np.testing.assert_allclose(
            acceleration, (after - 2 * position + before) / h**2, rtol=1e-3, atol=1e-3
        )
    np.testing.assert_allclose(
        minimum_jerk(start, end, duration, duration / 2)[1], 1.875 * (end - start) / duration
    )


@pytest.mark.parametrize("time", [0.0, 0.05, 0.5])
def test_a_braked_motion_dies_away_with_a_time_constant_that_the_torques_allow(model, time):
    servo, limit, rng = (
        JointServo(Impedance(model)),
        the_arm().servo.limit,
        np.random.default_rng(3),
    )
    middle = 0.5 * (the_arm().of_joints("lower") + the_arm().of_joints("upper"))
    for scale in (0.01, 1.5):
        q, qd, start, speed = (
            rng.normal(0.0, 1.0, (4, 7)) * np.array([0.01, 1.0, 0.01, scale])[:, None]
        )
        q, start = middle + q, middle + start
        needed = model.mass_matrix(q) @ speed
        longest = max(0.12, (np.abs(needed) / (2 * limit)).max())
        left = np.exp(-time / longest)
        pull = servo.follow(q, qd, start + longest * (1 - left) * speed, left * speed)
        expected = np.clip(pull - needed * left / longest, -2 * limit, 2 * limit)
        np.testing.assert_allclose(servo.brake(q, qd, start, speed, time), expected, atol=1e-9)


@pytest.mark.parametrize("side", ["lower", "upper"])
@pytest.mark.parametrize("joint", range(7))
def test_a_braked_joint_comes_to_rest_before_the_end_of_its_range(model, joint, side):
    """Exact motors, no friction: the model itself is braked."""
    servo, end = JointServo(Impedance(model)), the_arm().of_joints(side)[joint]
    q, qd, step = the_arm().home.copy(), np.zeros(7), 0.002
    sign = 1.0 if side == "upper" else -1.0
    q[joint], qd[joint] = end - 0.3 * sign, 2.0 * sign
    start, speed, most = q, qd, 0.0
    for k in range(300):
        torque = servo.brake(q, qd, start, speed, k * step)
        terms = model.at(q, qd)
        qdd = np.linalg.solve(model.mass_matrix(q), torque - terms.coriolis)
        q, qd = q + step * qd + 0.5 * step**2 * qdd, qd + step * qdd
        most = max(most, sign * q[joint])
    assert most < sign * end, f"j{joint + 1} came to {sign * most:.3f} rad"
    assert abs(qd[joint]) < 0.1


def answers(q, qd, posture, wanted, seed):
    """All that the compiled part of the law says of a state."""
    impedance, rng = Impedance(ArmModel()), np.random.default_rng(seed)
    servo, gains = JointServo(impedance), PoseGains(*rng.uniform(1.0, 400.0, (2, 6)))
    turns = Rotation.random(2, random_state=seed).as_matrix()
    aim = Reference(rng.normal(size=3), turns[0], rng.normal(size=3), turns[1], wanted, wanted)
    return [
        impedance.pulled(q, qd, aim, gains, gains),
        *impedance.act(q, qd, wanted, posture),
        *impedance.moved(q, qd, wanted, posture),
        impedance.friction_torque(qd, q),
        servo.follow(q, qd, posture, q),
        servo.damp(q, qd),
    ]


def test_compiled_and_interpreted_have_the_same_bits(monkeypatch):
    plain = interpreted("dart_skill.arm._drive")
    rng, said = np.random.default_rng(5), []
    states = [
        (*rng.normal(0.0, 1.0, (3, 7)), rng.normal(0.0, 10.0, 6), seed) for seed in range(10)
    ]
    for name in ("", "Drive", "JointSpring", "turn"):
        if name:
            monkeypatch.setattr(f"dart_skill.arm._impedance.{name}", getattr(plain, name))
        said.append([answers(*state) for state in states])
    for compiled, interpreted_ones in zip(said[0], said[-1], strict=True):
        for one, other in zip(compiled, interpreted_ones, strict=True):
            np.testing.assert_array_equal(one, other)
