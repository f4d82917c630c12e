"""Elastic cables against an independent integration; encoders; and what a plant with faults does."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from dart_skill.arm import Actuation, ArmModel, Command, Grip, the_arm
from dart_skill.common.configuration import node_parameters
from dart_skill.simulation import Encoders, Plant, PlantSettings, Transmission
from tests.interpreted import interpreted

STEP = 0.002
DAMPING_RATIO = 0.05
"""Damping of a motor on its cable, in parts of the critical one."""
STIFFNESS = np.array([9000.0, 9000.0, 5000.0, 3000.0, 800.0, 800.0, 200.0])
REFLECTED = the_arm().motors.reflected_inertia
INERTIA = np.diag([2.0, 2.5, 0.6, 0.5, 0.03, 0.04, 0.01])
FRICTIONLESS = Actuation(the_arm(), friction_scale=0.0)
SETTINGS = PlantSettings.from_parameters(node_parameters("wam_simulator.yaml", "wam_simulator"))


@pytest.fixture
def plants():
    """Makes plants with changed settings; all are closed."""
    made = []

    def make(seed=0, **changes):
        made.append(Plant(replace(SETTINGS, **changes), seed))
        return made[-1]

    yield make
    for plant in made:
        plant.close()


def test_motor_and_link_swing_as_two_masses_with_a_spring():
    """A constant push on the links, integrated by a Runge-Kutta method of order 8."""
    transmission = Transmission(STIFFNESS, REFLECTED, FRICTIONLESS)
    push = np.array([4.0, -5.0, 2.0, 1.0, 0.2, -0.2, 0.1])
    damping = 2.0 * DAMPING_RATIO * np.sqrt(STIFFNESS * np.diag(REFLECTED))

    def rates(_, state):
        q, theta, v, w = state.reshape(4, 7)
        spring = STIFFNESS * (theta - q) + damping * (w - v)
        return np.concatenate(
            [v, w, np.linalg.solve(INERTIA, push + spring), np.linalg.solve(REFLECTED, -spring)]
        )

    q = v = np.zeros(7)
    for _ in range(100):
        acceleration = transmission.advance(q, v, INERTIA, np.zeros(7), push, STEP)
        v = v + STEP * acceleration
        q = q + STEP * v
    exact = (
        scipy.integrate.solve_ivp(
            rates, (0.0, 100 * STEP), np.zeros(28), method="DOP853", rtol=1e-9
        )
        .y[:, -1]
        .reshape(4, 7)
    )
    np.testing.assert_allclose(q, exact[0], rtol=0.03, atol=1e-4)
    np.testing.assert_allclose(v, exact[2], rtol=0.03, atol=2e-3)
    momentum = INERTIA @ v + REFLECTED @ transmission.velocity
    np.testing.assert_allclose(momentum, 100 * STEP * push, rtol=1e-9)


def test_motors_at_rest_carry_their_load():
    transmission, load = (
        Transmission(STIFFNESS, REFLECTED, FRICTIONLESS),
        np.linspace(-30.0, 30.0, 7),
    )
    q = np.full(7, 0.3)
    transmission.rest(q, load)
    np.testing.assert_allclose(
        transmission.advance(q, np.zeros(7), INERTIA, load, -load, STEP), 0.0, atol=1e-9
    )
    np.testing.assert_allclose(STIFFNESS * (transmission.position - q), load)


def test_a_part_of_a_step_is_an_implicit_euler_step_for_motors_and_links_at_once():
    """Without friction: the linear system of both, by NumPy."""
    rng = np.random.default_rng(0)
    transmission, parts = Transmission(STIFFNESS, REFLECTED, FRICTIONLESS), 5
    load, effort, push, q, v = rng.normal(size=(5, 7))
    transmission.rest(q, load)
    h, damping = (
        STEP / parts,
        np.diag(2.0 * DAMPING_RATIO * np.sqrt(STIFFNESS * np.diag(REFLECTED))),
    )
    between = h * (h * np.diag(STIFFNESS) + damping)
    system = np.block([[INERTIA + between, -between], [-between, REFLECTED + between]])
    links, motors, speeds = q, transmission.position, np.concatenate([v, np.zeros(7)])
    for _ in range(parts):
        spring = h * STIFFNESS * (motors - links)
        momentum = np.concatenate(
            [
                INERTIA @ speeds[:7] + spring + h * push,
                REFLECTED @ speeds[7:] - spring + h * effort,
            ]
        )
        speeds = np.linalg.solve(system, momentum)
        links, motors = links + h * speeds[:7], motors + h * speeds[7:]
    np.testing.assert_allclose(
        transmission.advance(q, v, INERTIA, effort, push, STEP), (speeds[:7] - v) / STEP, rtol=1e-8
    )
    np.testing.assert_allclose(transmission.position, motors, rtol=1e-12)
    np.testing.assert_allclose(transmission.velocity, speeds[7:], rtol=1e-10)


def test_an_elastic_arm_gives_way_by_torque_over_stiffness(plants):
    """Held by its motors, it hangs lower than its encoders say by what its weight stretches the
    cables.
    """
    plant = plants(joint_stiffness=tuple(STIFFNESS), gravity_error=0.0)
    for _ in range(300):
        plant.step(Command(plant.state_stamp_ns))
    weight = ArmModel(ball_in_hand=True).gravity_torque(plant.state.position)
    np.testing.assert_allclose(
        np.array(plant.joint_position) - plant.state.position, weight / STIFFNESS, atol=4e-4
    )


def test_static_friction_holds_more_than_coulomb_friction(plants):
    """Between the two a joint stays where it is, or slides."""
    torque = np.zeros(7)
    torque[0] = 1.25 * the_arm().of_joints("coulomb_friction")[0]
    moved = {}
    for stiction in (0.0, 0.5):
        plant = plants(stiction=stiction, gravity_error=0.0)
        start = plant.state.position[0]
        for _ in range(250):
            plant.step(Command(plant.state_stamp_ns, joint_torque=torque))
        moved[stiction] = plant.state.position[0] - start
    assert moved[0.0] > 0.01 and moved[0.5] < 0.2 * moved[0.0]


def test_encoders_step_and_shift_angles_and_filter_speeds():
    offset = np.linspace(-0.005, 0.005, 7)
    encoders, seen = Encoders(offset, 1e-3, 180.0, STEP), []
    for k in range(200):
        seen.append(encoders.read(np.full(7, 0.4 * STEP * k), np.full(7, 0.4)))
    angle, speed = seen[-1]
    np.testing.assert_allclose(angle, 0.4 * STEP * 199 + offset, atol=0.5e-3 + 1e-9)
    np.testing.assert_allclose(np.mean([one[1] for one in seen[-100:]], axis=0), 0.4, rtol=0.03)
    smooth = Encoders(np.zeros(7), 0.0, 180.0, STEP)
    speeds = [smooth.read(np.full(7, 0.4 * STEP * k), np.full(7, 0.4))[1][0] for k in range(10)]
    np.testing.assert_allclose(speeds[1:], 0.4 * (1.0 - np.exp(-180.0 * STEP * np.arange(1, 10))))


def test_exact_encoders_say_what_is_and_a_reset_begins_anew():
    position, velocity = np.full(7, 0.1), np.full(7, 0.2)
    seen = Encoders(np.zeros(7), 0.0, 0.0, STEP).read(position, velocity)
    assert seen[0] is position and seen[1] is velocity
    encoders = Encoders(np.zeros(7), 1e-3, 180.0, STEP)
    first = encoders.read(position, velocity)
    encoders.read(position + 0.05, velocity)
    encoders.reset()
    np.testing.assert_array_equal(encoders.read(position, velocity), first)
    assert not first[1].any(), "an arm at rest"


def test_compiled_and_interpreted_have_the_same_bits():
    plain, rng = interpreted("dart_skill.simulation._transmission"), np.random.default_rng(0)
    kinds, actuation = (Transmission, plain.Transmission), Actuation(the_arm())
    pair = [kind(STIFFNESS, REFLECTED, actuation) for kind in kinds]
    readers = [
        kind(0.01 * STIFFNESS / 9000.0, 1e-4, 180.0, STEP) for kind in (Encoders, plain.Encoders)
    ]
    for one in pair:
        one.rest(np.zeros(7), STIFFNESS * 1e-3)
    for _ in range(20):
        effort, push, q, v = rng.normal(size=(4, 7))
        np.testing.assert_array_equal(
            *(one.advance(q, v, INERTIA, effort, push, STEP) for one in pair)
        )
        np.testing.assert_array_equal(
            *(np.concatenate([one.position, one.velocity]) for one in pair)
        )
        np.testing.assert_array_equal(*(np.concatenate(one.read(q, v)) for one in readers))


def test_a_command_acts_as_many_periods_later(plants):
    torque = np.array([8.0, 0, 0, 0, 0, 0, 0])
    began = {}
    for delay in (0, 2):
        plant = plants(command_delay=delay, gravity_error=0.0)
        began[delay] = 0
        while abs(plant.joint_velocity[0]) < 1e-6:
            plant.step(Command(plant.state_stamp_ns, joint_torque=torque))
            began[delay] += 1
    assert began[2] - began[0] == 2


def test_masses_that_are_wrong_pull_on_an_arm_whose_compensation_does_not_know(plants):
    fell = []
    for scale in (1.0, 1.1):
        plant = plants(mass_scale=(scale,) * 7, gravity_error=0.0, friction_scale=0.0)
        for _ in range(50):
            plant.step(Command(plant.state_stamp_ns))
        fell.append(plant.state.position[1] - plant.settings.start_posture[1])
    weight = ArmModel().gravity_torque(np.array(SETTINGS.start_posture))[1]
    assert -np.sign(weight) * (fell[1] - fell[0]) > 1e-3


def released(plant):
    """Position of the ball in the hand before it is let go, and its velocity just before and
    after.
    """
    plant.reset()
    state = plant.state
    seat = np.array(state.ball_position) - state.hand_position
    push = np.array([6.0, 12.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    for _ in range(60):
        plant.step(Command(plant.state_stamp_ns, joint_torque=push))
    plant.step(Command(plant.state_stamp_ns, joint_torque=push, grip=Grip.OPEN))
    while plant.state.ball_held:
        before = plant.state.ball_velocity
        plant.step(Command(plant.state_stamp_ns, joint_torque=push))
    return seat, before, plant.state.ball_velocity


def test_seat_and_release_scatter_as_set_and_are_the_same_again(plants):
    plant = plants(
        seat_spread=0.004, release_turn=0.02, release_speed=0.01, hand_delay=0.004, hand_spread=0.0
    )
    thrown = [released(plant) for _ in range(40)]
    seats = np.array([seat for seat, _, _ in thrown])
    assert seats.std(axis=0) == pytest.approx([0.004] * 3, rel=0.4)
    before, after = (np.array([one[k] for one in thrown]) for k in (1, 2))
    share = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
    cosine = (
        np.einsum("ni,ni->n", before, after)
        / np.linalg.norm(before, axis=1)
        / np.linalg.norm(after, axis=1)
    )
    assert 0.006 < share.std() < 0.03
    assert np.sqrt(np.mean(np.arccos(np.clip(cosine, -1.0, 1.0)) ** 2)) == pytest.approx(
        0.02 * np.sqrt(2.0), rel=0.5
    )
    again = plants(
        seat_spread=0.004, release_turn=0.02, release_speed=0.01, hand_delay=0.004, hand_spread=0.0
    )
    np.testing.assert_array_equal(released(again)[2], after[0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_stiffness": (100.0,) * 6 + (0.0,)}, "positive for all joints, or 0 for all"),
        ({"mass_scale": (1.0,) * 6}, "not 7 finite numbers"),
        ({"mass_scale": (-1.0,) * 7}, "must be positive"),
        ({"mass_scale": (1e308,) * 7}, "10 at most"),
        ({"joint_stiffness": (1e308,) * 7}, "above 1e"),
        ({"joint_offset": (1e308,) * 7}, "more than half a turn"),
        ({"joint_offset": (np.nan,) * 7}, "not 7 finite numbers"),
    ],
)
def test_settings_that_no_arm_has_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(SETTINGS, **change)
