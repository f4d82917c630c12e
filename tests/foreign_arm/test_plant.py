"""The second plant, its cameras and its person do what physics, the published tables and this file
say. No ROS.
"""

import dataclasses

import numpy as np
import pytest

pytest.importorskip(
    "mujoco",
    reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup",
)

import mujoco  # noqa: E402

from tests.foreign_arm import published  # noqa: E402
from tests.foreign_arm.arm import PERIOD, SHOULDER, Encoders, Motors, NominalArm  # noqa: E402
from tests.foreign_arm.cameras import Cameras  # noqa: E402
from tests.foreign_arm.laboratory import Laboratory  # noqa: E402
from tests.foreign_arm.person import Way  # noqa: E402
from tests.foreign_arm.plant import Plant  # noqa: E402
from tests.foreign_arm.throwing.person import (  # noqa: E402
    COCKED,
    Aim,
    Thrower,
    ball_on,
    fall,
    swing_angles,
)
from tests.foreign_arm.throwing.scene import BallScene  # noqa: E402

AWAY = np.array([3.0, 0.0, published.BALL_RADIUS])
POSES = {
    "zero": ([0, 0, 0, 0, 0, 0, 0], [0.0, 0.0, 0.9109]),
    "home": ([0, -2.0, 0, 3.13, 0, 0, 0], [-0.211638, 0.0, 0.006718]),
    "zero calibration": ([0, -np.pi / 2, 0, np.pi / 2, 0, 0, 0], [-0.595, 0.0, 0.4059]),
    "ball in cup": ([0, 0.5876, 0, 1.36, 0, -0.321, -1.57], [0.69867, 0.0, 0.360865]),
    "elbow at a right angle": ([0, 0, 0, np.pi / 2, 0, 0, 0], [0.4059, 0.0, 0.595]),
}
"""Published postures (7,) [rad], and the tool plate from the shoulder's centre (3,) [m]."""


def with_ball(laboratory, posture=COCKED):
    """The arm with a ball in its hand."""
    return Plant(laboratory, posture, BallScene())


def hold(plant, nominal, duration, pushes=(), each=lambda: None):
    """Gravity compensation only, for a while [s]."""
    for _ in range(round(duration / PERIOD)):
        nominal.take(plant.encoders.angles)
        plant.step(nominal.gravity(), pushes)
        each()


@pytest.fixture
def nominal():
    return NominalArm(Laboratory.quiet())


@pytest.mark.parametrize(("angles", "place"), POSES.values(), ids=POSES)
def test_joint_signs_are_those_of_the_published_table(nominal, angles, place):
    nominal.take(angles)
    assert nominal.hand()[0] - SHOULDER == pytest.approx(place, abs=2e-6)
    assert published.frames(angles)[1][7] == pytest.approx(place, abs=2e-6)


def test_each_joint_turns_the_hand_as_the_table_says(nominal):
    random = np.random.default_rng(0)
    for angles in random.uniform(published.LOWER, published.UPPER, (20, 7)):
        nominal.take(angles)
        rotations, origins = published.frames(angles)
        axes = rotations[:7, :, 2].T
        levers = np.cross(rotations[:7, :, 2], origins[7] - origins[:7]).T
        assert nominal.jacobian() == pytest.approx(np.vstack([levers, axes]), abs=1e-9)


def test_gravity_compensation_is_the_torque_that_the_table_gives(nominal):
    random = np.random.default_rng(1)
    for angles in random.uniform(published.LOWER, published.UPPER, (20, 7)):
        nominal.take(angles)
        assert nominal.gravity() == pytest.approx(published.gravity_torque(angles), abs=1e-9)


def test_a_quiet_arm_stays_where_gravity_compensation_holds_it(nominal):
    """The ball has next to no mass: gravity compensation knows none."""
    plant = with_ball(dataclasses.replace(Laboratory.quiet(), ball_mass=0.002))
    hold(plant, nominal, 0.5)
    assert plant.link_angles[:6] == pytest.approx(COCKED[:6], abs=0.02)


def test_energy_is_conserved_without_friction():
    plant = with_ball(Laboratory.quiet(), [0.3, 0.8, 0.2, 0.9, 0.1, 0.3, 0.0])
    plant.put(AWAY)
    plant.scene.knuckle_torque = lambda now: 0.0
    for name in ("knuckle1", "knuckle2", "knuckle3"):
        address = plant.model.joint(name).dofadr[0]
        # fingers hardly move
        plant.model.dof_damping[address], plant.model.dof_armature[address] = (
            0.0,
            10.0,
        )
    before, energies, kinetic = None, [], []
    for _ in range(200):
        plant.step(np.zeros(7))
        mujoco.mj_forward(plant.model, plant.data)
        before = plant.data.energy.sum() if before is None else before
        energies.append(plant.data.energy.sum() - before)
        kinetic.append(plant.data.energy[1])
    assert max(kinetic) > 20.0
    assert np.abs(energies).max() < 0.02 * max(kinetic)


def test_stiction_holds_the_arm_until_it_is_overcome():
    laboratory = dataclasses.replace(Laboratory.quiet(), coulomb=published.COULOMB, stiction=1.3)
    plant = with_ball(laboratory, np.zeros(7))
    plant.put(AWAY)
    moved = []
    for share in (1.1, 1.5):
        start = plant.link_angles[0]
        for _ in range(200):
            plant.step([share * published.COULOMB[0], 0, 0, 0, 0, 0, 0])
        moved.append(plant.link_angles[0] - start)
    assert abs(moved[0]) < 0.005 < 0.05 < moved[1]


def test_motors_give_less_torque_the_faster_they_turn_and_never_more_than_their_controllers_allow():
    motors = Motors()
    wanted = np.array([1000.0, 0, 0, 0, 0, 0, 0])
    assert motors.available(wanted, np.zeros(7))[0] == pytest.approx(published.PUCK_PEAK_JOINT[0])
    at_full_speed = published.NO_LOAD_SPEED[0] / 42.0
    assert motors.available(wanted, np.array([at_full_speed, 0, 0, 0, 0, 0, 0]))[
        0
    ] == pytest.approx(0.0, abs=1e-9)
    small = np.array([1.0, -2.0, 0.5, 1.0, 0.2, -0.1, 0.05])
    assert motors.available(small, np.zeros(7)) == pytest.approx(small)


def test_encoders_count_the_motors_turns_and_speeds_follow_as_a_low_pass():
    laboratory = dataclasses.replace(
        Laboratory.quiet(), encoder_counts=4096, joint_offset=np.full(7, 0.005)
    )
    encoders = Encoders(laboratory, np.zeros(7))
    times = PERIOD * np.arange(1, 101)
    for instant in times:
        encoders.read(np.full(7, instant))
    resolution = 2 * np.pi / 4096 / 9.7
    assert encoders.angles == pytest.approx(np.full(7, times[-1] + 0.005), abs=resolution)
    assert encoders.speeds == pytest.approx(np.ones(7), abs=0.2)
    assert np.ptp(encoders.angles - 0.005) > 0.0, "it counts"


def test_drives_give_way_under_load_and_encoders_do_not_see_it(nominal):
    laboratory = dataclasses.replace(
        Laboratory.quiet(), stiffness=Laboratory.drawn(3).stiffness, viscous=published.VISCOUS
    )
    plant = with_ball(laboratory)
    hold(plant, nominal, 0.3)
    sag = plant.link_angles - plant.motor_angles
    nominal.take(plant.motor_angles)
    assert sag[1] == pytest.approx(-nominal.gravity()[1] / laboratory.stiffness[1], rel=0.05)
    assert plant.encoders.angles == pytest.approx(plant.motor_angles)


@pytest.mark.parametrize("drag", [0.0, 0.55])
def test_a_free_ball_flies_on_a_parabola_with_drag(drag):
    plant = with_ball(dataclasses.replace(Laboratory.quiet(), drag_coefficient=drag))
    start, velocity = np.array([1.0, 0.0, 2.0]), np.array([2.5, 0.3, 2.0])
    plant.put(start, velocity)
    for _ in range(300):
        plant.step(np.zeros(7))
    place = plant.pose("ball")[0]
    resistance = Aim.resistance(plant.laboratory)
    assert fall(start, velocity, place[2], resistance) == pytest.approx(place, abs=0.003)
    if not drag:
        assert place == pytest.approx(
            start + 0.6 * velocity - [0.0, 0.0, 0.5 * published.GRAVITY * 0.36], abs=0.003
        )


def test_a_ball_falls_onto_the_floor_and_into_the_basket():
    plant = with_ball(Laboratory.quiet())
    for place, height in ((np.array([1.0, 0.5]), 0.0), (np.array([2.0, 0.0]), 0.05)):
        plant.put([*place, 0.8])
        for _ in range(500):
            plant.step(np.zeros(7))
        assert plant.pose("ball")[0][:2] == pytest.approx(place, abs=0.05)
        assert plant.pose("ball")[0][2] == pytest.approx(height + published.BALL_RADIUS, abs=0.005)


def swing(plant, nominal, rim, each=lambda: None):
    """A guided throw at a basket (3,); where it came down (3,) and the fastest hand [m/s]."""
    person = Thrower(plant.laboratory, plant)
    plant.stand(rim)
    person.begin(person.cock(rim, duration=0.5), person.throw(rim))
    fastest = 0.0
    while person.busy:
        pushes, carried = person.act()
        if person.tells:
            plant.hand.open(plant.time)
        nominal.take(plant.encoders.angles)
        plant.step(nominal.gravity(), pushes, carried)
        fastest = max(fastest, np.linalg.norm(plant.velocity("hand")[0]))
        each()
    return person, fastest


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_closed_fingers_hold_the_ball_through_a_swing_and_let_it_go_when_told(nominal, seed):
    laboratory = Laboratory.quiet() if seed is None else Laboratory.drawn(seed)
    plant, told, slips, left = with_ball(laboratory), [], [], []

    def note():
        if not plant.hand.told_to_open:
            slips.append(np.linalg.norm(plant.pose("ball")[0] - plant.grasp()))
        else:
            told.append(plant.time)
            left.extend([plant.time] if plant.scene.fingers_touch() else [])

    rim = np.array([1.8, 0.5, 0.4])
    person, fastest = swing(plant, nominal, rim, note)
    assert max(slips) < 0.004
    assert 0.025 < left[-1] - told[0] < 0.065
    assert 2.5 < fastest < 4.0
    assert np.linalg.norm(person.landing - rim) < 0.2


def test_the_hand_lets_go_after_45_ms_give_or_take_6(nominal):
    plant = with_ball(Laboratory.drawn(5))
    delays = []
    for _ in range(12):
        plant.hand.close(plant.time)
        for _ in range(100):
            plant.put(plant.grasp())
            hold(plant, nominal, PERIOD)
        plant.hand.open(plant.time)
        told = left = plant.time
        for _ in range(60):
            hold(plant, nominal, PERIOD)
            left = plant.time if plant.scene.fingers_touch() else left
        delays.append(left - told)
    assert np.mean(delays) == pytest.approx(0.045, abs=0.006)
    assert 0.002 < np.std(delays) < 0.012


def test_a_swing_keeps_within_speeds_of_the_joints_and_throws_up_at_three_to_four_metres_a_second():
    for distance in (1.5, 1.85, 2.2):
        _, duration = Aim(0.0).at(np.array([distance, 0.0, 0.4]))
        angles = swing_angles(0.0, duration)
        speeds = np.abs(np.gradient(angles, PERIOD, axis=0)).max(axis=0)
        assert np.all(speeds < 0.8 * np.array([2.386, 3.548, 5.960, 5.568, 19.83, 19.83, 38.11]))
        assert np.all((published.LOWER + 0.2 < angles) & (angles < published.UPPER - 0.2))
        _, velocity = ball_on(Way.through(angles), len(angles) // 2)
        assert 2.8 < np.linalg.norm(velocity) < 4.0
        assert 20.0 < np.rad2deg(np.arctan2(velocity[2], velocity[0])) < 45.0


def test_a_person_puts_the_ball_back_into_the_hand(nominal):
    plant = with_ball(Laboratory.drawn(4))
    plant.put([1.9, 0.2, 0.1])
    person = Thrower(plant.laboratory, plant)
    person.begin(person.bring_ball())
    while person.busy:
        pushes, carried = person.act()
        nominal.take(plant.encoders.angles)
        plant.step(nominal.gravity(), pushes, carried)
    assert plant.scene.fingers_touch() == 3
    assert plant.pose("ball")[0] == pytest.approx(plant.grasp(), abs=0.002)


def test_cameras_are_late_noisy_and_sometimes_blind():
    laboratory = Laboratory.drawn(6)
    plant = with_ball(laboratory)
    cameras = Cameras(laboratory, plant.tracked)
    nominal, seen = NominalArm(Laboratory.quiet()), []
    hold(
        plant,
        nominal,
        3.0,
        each=lambda: seen.extend((plant.steps, sighting) for sighting in cameras.look(plant)),
    )
    assert {step - sighting.step for step, sighting in seen} == {6}, "12 ms"
    balls = np.array([sighting.place for _, sighting in seen if sighting.body == "ball"])
    assert 0.97 < len(seen) / (3 * 300) < 1.0
    assert balls[-50:].std(axis=0) == pytest.approx(np.full(3, laboratory.camera_noise), rel=0.4)
    for body in plant.tracked:
        assert np.linalg.norm(cameras.shift[body]) == pytest.approx(0.001)


def test_the_same_seed_is_the_same_laboratory_and_another_is_not():
    one, again, other = (dataclasses.astuple(Laboratory.drawn(seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(left, right) for left, right in zip(one, again, strict=True))
    assert not all(np.array_equal(left, right) for left, right in zip(one, other, strict=True))
