"""What drives the arm, number by number, beside the same formulas in NumPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, _drive
from dart_skill.arm._drive import Drive, JointSpring
from dart_skill.arm._impedance import JointServo
from tests.interpreted import interpreted

LENGTHS = np.array([1.0, 1.0, 1.0, 0.18, 0.18, 0.18])
COULOMB, VISCOUS = np.linspace(2.0, 0.2, 7), np.linspace(1.0, 0.1, 7)
SETTINGS = {"slow": 0.02, "null_stiffness": 60.0, "null_damping": 12.0, "least_mobility": 0.08}


def make(module=_drive):
    return module.Drive(LENGTHS, COULOMB, VISCOUS, 0.1 * COULOMB, **SETTINGS)


def cases(n=20, seed=0):
    """Angles, speeds and postures (7,), and accelerations (6,); every other arm has J2 and J6
    nearly straight.
    """
    rng = np.random.default_rng(seed)
    for k in range(n):
        q = rng.uniform(-1.5, 1.5, 7)
        q[[1, 5]] *= 1e-3 if k % 2 else 1.0
        yield q, rng.normal(0.0, 1.0, 7), q + rng.normal(0.0, 0.3, 7), rng.normal(0.0, 10.0, 6)


def by_numpy(model, q, qd, posture, acceleration):
    """Wrench (6,), torque in the null space (7,) and the sum of both as torques of the joints
    (7,).
    """
    jacobian, inertia = model.jacobian(q), model.mass_matrix(q)
    scaled = LENGTHS[:, None] * jacobian
    mobility, directions = np.linalg.eigh(scaled @ np.linalg.solve(inertia, scaled.T))
    free = SETTINGS["null_stiffness"] * (posture - q) - SETTINGS["null_damping"] * qd
    share = np.minimum(mobility / SETTINGS["least_mobility"], 1.0) ** 2
    shaped = LENGTHS[:, None] * (directions * (share / mobility)) @ directions.T * LENGTHS
    wrench, disturbing = (
        shaped @ (acceleration - model.jacobian_drift(q, qd)),
        shaped @ (jacobian @ free),
    )
    null = inertia @ free - jacobian.T @ disturbing
    return wrench, null, jacobian.T @ wrench + null


def test_wrench_and_torques_are_those_of_numpy():
    drive, model, other = make(), ArmModel(ball_in_hand=True), ArmModel(ball_in_hand=True)
    for q, qd, posture, acceleration in cases():
        wrench, null, total = by_numpy(other, q, qd, posture, acceleration)
        coriolis = other.coriolis_torque(q, qd)
        helped = COULOMB * np.tanh(qd / 0.02 + total / (0.1 * COULOMB)) + VISCOUS * qd
        for found, expected in zip(
            drive.act(model.at(q, qd), acceleration, posture),
            (wrench, coriolis + helped + null),
            strict=True,
        ):
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)
        moving = coriolis + COULOMB * np.tanh(qd / 0.02) + VISCOUS * qd + null
        accelerated = np.linalg.solve(other.mass_matrix(q), total)
        for found, expected in zip(
            drive.moved(model.at(q, qd), acceleration, posture),
            (wrench, moving, accelerated),
            strict=True,
        ):
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)


def test_a_hand_that_cannot_move_in_some_directions_at_all_has_a_wrench():
    """The stretched arm: by division through its mobility of 0 there would be none."""
    wrench, torque = make().act(
        ArmModel().at(np.zeros(7), np.zeros(7)), np.full(6, 10.0), np.zeros(7)
    )
    assert np.isfinite(wrench).all() and np.isfinite(torque).all() and np.abs(wrench).max() < 1e4


def test_a_spring_of_the_joints_is_cut_at_its_limits():
    rng, limit = np.random.default_rng(2), JointServo.LIMIT
    spring = JointSpring(JointServo.STIFFNESS, JointServo.DAMPING, limit)
    for q, qd, there, then in rng.normal(0.0, 0.05, (20, 4, 7)):
        expected = np.clip(
            JointServo.STIFFNESS * (there - q) + JointServo.DAMPING * (then - qd), -limit, limit
        )
        np.testing.assert_allclose(spring.torque(q, qd, there, then), expected, atol=1e-12)
        np.testing.assert_allclose(
            spring.damp(20 * qd),
            np.clip(-40 * JointServo.DAMPING * qd, -2 * limit, 2 * limit),
            atol=1e-12,
        )


@pytest.mark.parametrize("time", [0.0, 0.05, 0.5])
def test_a_braked_motion_dies_away_with_a_time_constant_that_the_torques_allow(time):
    rng, limit = np.random.default_rng(3), JointServo.LIMIT
    spring = JointSpring(JointServo.STIFFNESS, JointServo.DAMPING, limit)
    for scale in (0.1, 10.0):
        q, qd, start, speed, needed = (
            rng.normal(0.0, 1.0, (5, 7)) * np.array([0.01, 1.0, 0.01, 1.0, scale])[:, None]
        )
        longest = max(0.12, (np.abs(needed) / (2 * limit)).max())
        left = np.exp(-time / longest)
        pull = spring.torque(q, qd, start + longest * (1 - left) * speed, left * speed)
        expected = np.clip(pull - needed * left / longest, -2 * limit, 2 * limit)
        np.testing.assert_allclose(
            spring.brake(q, qd, start, speed, needed, time, 0.12), expected, atol=1e-12
        )


def test_a_coasting_arm_is_a_parabola_and_the_swing_keeps_its_joints():
    q, qd, qdd = np.random.default_rng(4).normal(size=(3, 7))
    later, faster = _drive.coasted(q, qd, qdd, 0.1)
    np.testing.assert_allclose(later, q + 0.1 * qd + 0.005 * qdd)
    np.testing.assert_allclose(faster, qd + 0.1 * qdd)
    np.testing.assert_array_equal(
        _drive.with_swing(q, qd), [q[0], qd[1], q[2], qd[3], q[4], qd[5], q[6]]
    )


def test_force_and_moment_of_a_wrench_are_cut_each_by_itself():
    wrench = np.array([3.0, 0.0, 4.0, 0.0, 6.0, 8.0])
    np.testing.assert_allclose(_drive.cut(wrench, 5.0, 10.0), wrench)
    np.testing.assert_allclose(
        _drive.cut(wrench, 2.5, 10.0), np.append(0.5 * wrench[:3], wrench[3:])
    )
    np.testing.assert_allclose(
        _drive.cut(wrench, 9.0, 1.0), np.append(wrench[:3], 0.1 * wrench[3:])
    )
    np.testing.assert_array_equal(_drive.cut(np.zeros(6), 1.0, 1.0), 0.0)


POSE = np.zeros(3), np.eye(3), np.zeros(6)


@pytest.mark.parametrize(
    ("ask", "why"),
    [
        (lambda: _drive.turn(np.eye(4), np.eye(3)), r"\(4, 4\)"),
        (
            lambda: _drive.pull(np.zeros(2), *POSE[1:], *POSE, np.ones(6), np.ones(6)),
            "the pose has shapes",
        ),
        (lambda: _drive.pull(*POSE, *POSE, np.ones(3), np.ones(6)), "stiffness has shape"),
        (lambda: _drive.with_swing(np.zeros(6), np.zeros(7)), "a posture of shape"),
        (lambda: _drive.least_jerk(np.zeros(6), np.zeros(7), 1.0, 0.0), "is none"),
        (
            lambda: make().act(ArmModel().at(np.zeros(7), np.zeros(7)), np.zeros(6), np.zeros(6)),
            "acceleration has shape",
        ),
    ],
)
def test_arrays_of_other_shapes_are_refused(ask, why):
    with pytest.raises(ValueError, match=why):
        ask()


def pulled_by(drive, *pull):
    acceleration = np.ones(6)
    drive.add_pull(*pull, acceleration)
    return acceleration - 1.0


def test_the_hand_of_the_arm_is_pulled_as_any_hand():
    rng, terms = (
        np.random.default_rng(6),
        ArmModel().at(*np.random.default_rng(7).normal(size=(2, 7))),
    )
    target, gains = (
        (rng.normal(size=3), Rotation.random(random_state=1).as_matrix(), rng.normal(size=6)),
        rng.uniform(1.0, 400.0, (2, 6)),
    )
    position, rotation, velocity = terms.hand()
    turn = (Rotation.from_matrix(target[1]) * Rotation.from_matrix(rotation).inv()).as_rotvec()
    expected = gains[0] * np.append(target[0] - position, turn) + gains[1] * (target[2] - velocity)
    np.testing.assert_allclose(
        _drive.pull(*target, position, rotation, velocity, *gains), expected, rtol=1e-12
    )
    np.testing.assert_allclose(pulled_by(make(), terms, *target, *gains), expected, rtol=1e-11)


def test_compiled_and_interpreted_have_the_same_bits():
    plain, rng, model = interpreted("dart_skill.arm._drive"), np.random.default_rng(5), ArmModel()
    half_turn = np.diag([1.0, -1.0, -1.0])
    pair = make(), make(plain)
    springs = [
        module.JointSpring(JointServo.STIFFNESS, JointServo.DAMPING, JointServo.LIMIT)
        for module in (_drive, plain)
    ]
    for q, qd, posture, acceleration in cases():
        terms, gains = model.at(q, qd), rng.uniform(1.0, 400.0, (2, 6))
        target = (
            rng.normal(size=3),
            Rotation.random(random_state=rng.integers(99)).as_matrix(),
            rng.normal(size=6),
        )
        answers = [
            [
                *drive.act(terms, acceleration, posture), *drive.moved(terms, acceleration, posture), drive.friction(qd, q),
                spring.torque(q, qd, posture, q), spring.brake(q, qd, posture, q, qd, 0.1, 0.12), spring.damp(qd),
                pulled_by(drive, terms, *target, *gains), module.pull(*target, *terms.hand(), *gains),
                module.turn(target[1], half_turn @ target[1]),
                *module.coasted(q, qd, posture, 0.002), module.with_swing(posture, q), module.cut(acceleration, 5.0, 5.0),
                *module.least_jerk(q, posture, 0.7, 0.3),
            ]
            for module, drive, spring in zip((_drive, plain), pair, springs, strict=True)
        ]  # fmt: skip
        for ours, theirs in zip(*answers, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    assert isinstance(pair[0], Drive)
