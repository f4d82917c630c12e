"""The bench: a part that stands, is taken, carried and let go, with a holder that it touches; and
the person who does it.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, ArmState, Command, Grip
from dart_skill.simulation import (
    Bench,
    Carrier,
    Carrying,
    Person,
    PlantSettings,
    Workbench,
    make_world,
)
from dart_skill.skills.protocol import load_skill

HOLDER = np.array([0.6, 0.1, 1.18]), np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture
def bench():
    made = []

    def make(seed=0, settings=None, **changes):
        plant = Workbench(Bench(**changes), settings or PlantSettings(gravity_error=0.0), seed)
        plant.stand(HOLDER)
        plant.reset()
        made.append(plant)
        return plant

    yield make
    for plant in made:
        plant.close()


def hold(plant, steps, grip=Grip.UNSPECIFIED, to=None):
    """The arm held at its start, or at joint angles (7,)."""
    target = np.array(plant.bench.start_posture) if to is None else to
    for _ in range(steps):
        torque = (
            900.0 * np.clip(target - plant.arm_state.position, -0.05, 0.05)
            - 40.0 * plant.arm_state.velocity
        )
        torque[4:] *= 0.05
        plant.step(Command(plant.state_stamp_ns, joint_torque=torque, grip=grip))


def lift(plant, steps=600):
    """The hand goes up by 11 cm."""
    start = np.array(plant.bench.start_posture)
    for share in np.linspace(0.0, 1.0, steps):
        hold(plant, 1, to=start + share * np.array([0.0, -0.2, 0.0, -0.05, 0.0, 0.25, 0.0]))


def test_the_part_stands_on_the_table_under_an_open_hand(bench):
    plant = bench()
    position, quaternion = plant.bodies["part"]
    hold(plant, 250)
    assert plant.bodies["part"][0] == pytest.approx(position, abs=5e-4)
    assert Rotation.from_quat(plant.bodies["part"][1]).as_matrix()[2, 2] == pytest.approx(
        1.0, abs=1e-4
    )
    assert position[2] == pytest.approx(plant.table + 0.05, abs=1e-9) and not plant.holds
    assert Rotation.from_quat(quaternion).as_matrix()[2, 2] == pytest.approx(1.0)


def test_a_hand_that_closes_around_the_part_lifts_it_as_it_found_it(bench):
    plant = bench(part_spread=0.005)
    hold(plant, 5, Grip.CLOSE)
    assert plant.holds
    before = seen_from_hand(plant)
    lift(plant)
    assert plant.bodies["part"][0][2] > plant.table + 0.05 + 0.05
    assert seen_from_hand(plant)[0] == pytest.approx(before[0], abs=2e-4)
    assert (seen_from_hand(plant)[1] * before[1].inv()).magnitude() < 2e-3


def seen_from_hand(plant):
    hand, part = plant.bodies["hand"], plant.bodies["part"]
    back = Rotation.from_quat(hand[1]).inv()
    return back.apply(part[0] - hand[0]), back * Rotation.from_quat(part[1])


def test_a_hand_that_closes_elsewhere_holds_nothing(bench):
    plant = bench(part_spread=0.0)
    lift(plant)
    plant.close_hand()
    hold(plant, 5, Grip.CLOSE)
    assert not plant.holds


def test_a_part_that_is_let_go_falls_onto_the_table(bench):
    plant = bench()
    hold(plant, 5, Grip.CLOSE)
    lift(plant)
    high = plant.bodies["part"][0][2]
    lifted = plant.arm_state.position
    hold(plant, 300, Grip.OPEN, to=lifted)
    assert not plant.holds and high - 0.04 > plant.bodies["part"][0][2] > plant.table


def test_the_load_is_what_the_hand_carries(bench):
    """A description whose ball is the part: gravity of an arm with it is that of the arm and of a
    mass at the grasp.
    """
    b = Bench()
    plant = bench(part_spread=0.0)
    q = np.array(b.start_posture)
    with_part, without = (
        ArmModel(plant.description, ball_in_hand=one).gravity_torque(q) for one in (True, False)
    )
    model = ArmModel(plant.description)
    lever = (
        model.jacobian(q)[:3]
        + np.cross(model.jacobian(q)[3:].T, model.hand_pose(q)[1] @ b.grasp).T
    )
    assert with_part - without == pytest.approx(lever.T @ [0.0, 0.0, b.mass * 9.81], abs=1e-6)


def test_the_walls_leave_the_clearance_on_each_side():
    plant = Workbench(Bench(clearance=0.003, wall=0.01, depth=0.04))
    sizes, centres, turns = (np.array(part) for part in plant._walls())
    assert np.array_equal(turns, [[0.0, 0.0, 0.0, 1.0]] * 5)
    inner = np.abs(centres[1:]).max(axis=1)[:4]
    sides = [abs(centres[1, 0]) - sizes[1, 0], abs(centres[3, 1]) - sizes[3, 1]]
    assert sides == pytest.approx([0.028, 0.028]) and len(inner) == 4
    assert centres[1:, 2] + sizes[1:, 2] == pytest.approx(np.full(4, 0.04))
    assert centres[0, 2] + sizes[0, 2] == pytest.approx(0.0)
    plant.close()


def test_an_episode_depends_on_seed_and_number_alone(bench):
    first, second, other = bench(seed=3), bench(seed=3), bench(seed=4)
    hold(first, 40)
    first.reset()
    second.reset()
    assert np.array_equal(first.bodies["part"][0], second.bodies["part"][0])
    assert not np.array_equal(other.bodies["part"][0], second.bodies["part"][0])


def test_a_person_puts_the_part_in(bench):
    plant = bench(seed=1, settings=PlantSettings())
    carrier = Carrier(1)
    seat = HOLDER[0] + [0.0, 0.0, 0.05], HOLDER[1]
    carrier.begin(plant.arm_state, plant.bodies["part"], seat)
    told = []
    while not carrier.done(plant.arm_state):
        push = carrier.step(plant.arm_state)
        told += [push.grip] if push.grip != Grip.UNSPECIFIED else []
        plant.step(Command(plant.state_stamp_ns), push)
    assert told == [Grip.CLOSE, Grip.OPEN]
    assert plant.bodies["part"][0] == pytest.approx(seat[0], abs=0.0035)


def test_one_who_sees_badly_jams_it(bench):
    """2 cm beside: the part stays on the wall, or falls off it."""
    plant = bench(seed=1, settings=PlantSettings())
    carrier = Carrier(1, Carrying(aim_spread=0.0))
    carrier.begin(
        plant.arm_state, plant.bodies["part"], (HOLDER[0] + [0.02, 0.0, 0.05], HOLDER[1])
    )
    while not carrier.done(plant.arm_state):
        plant.step(Command(plant.state_stamp_ns), carrier.step(plant.arm_state))
    assert np.linalg.norm(plant.bodies["part"][0] - HOLDER[0] - [0.0, 0.0, 0.05]) > 0.008


def test_bodies_are_put_where_somebody_says_and_others_are_refused_by_name(bench):
    plant = bench()
    there = np.array([0.55, -0.1, 1.2]), Rotation.from_rotvec([0.0, 0.0, 0.5]).as_quat()
    plant.put("holder", *there)
    assert plant.bodies["holder"][0] == pytest.approx(there[0]) and plant.bodies["holder"][
        1
    ] == pytest.approx(there[1])
    plant.set_up({"holder": (HOLDER[0], HOLDER[1])})
    assert plant.bodies["holder"][0] == pytest.approx(HOLDER[0])
    for refuse in (lambda: plant.put("basket", *there), lambda: plant.set_up({"part": there})):
        with pytest.raises(ValueError, match="this world can put the holder somewhere, not"):
            refuse()


def test_a_holder_that_nobody_has_put_anywhere_stands_on_the_table():
    """It stood below, where each placing failed."""
    own = load_skill("place").world_settings
    for bench in (Bench(), Bench(**own)):
        plant = Workbench(bench, PlantSettings())
        plant.set_up({})
        standing = plant.bodies["holder"][0][2] - plant.bench.wall - plant.table
        plant.close()
        assert abs(standing) < 1e-3


def test_the_world_knows_what_is_held_and_whether_the_part_is_in(bench):
    plant = bench()
    assert plant.held_body == "" and not plant.succeeded
    hold(plant, 5, Grip.CLOSE)
    assert plant.held_body == "part"
    stands = plant.bodies["part"][0] - [0.0, 0.0, 0.05]
    plant.stand((stands, HOLDER[1]))
    assert not plant.succeeded, "the hand holds it"
    hold(plant, 30, Grip.OPEN)
    assert plant.held_body == "" and plant.succeeded


@pytest.mark.parametrize(
    ("name", "bodies"),
    [("basket", ["hand", "ball", "basket"]), ("bench", ["hand", "part", "holder"])],
)
def test_worlds_are_made_by_name(name, bodies):
    world = make_world(name, PlantSettings())
    assert list(world.bodies) == bodies and {world.loose_body, world.movable_body} == set(
        bodies[1:]
    )
    world.change(PlantSettings(friction_scale=2.0))
    posture = world.arm_state.position
    assert world.set_up({}).episode == 2 and world.settings.friction_scale == 2.0
    assert world.arm_state.position == pytest.approx(posture), (
        "another arm stands as the one before"
    )
    world.close()


def test_a_world_that_nobody_has_is_named_with_those_there_are():
    with pytest.raises(ValueError, match="no world 'moon': choose one of basket, board, bench"):
        make_world("moon", PlantSettings())


def test_a_part_that_is_seen_turned_about_the_hand_does_not_move_the_hand(bench):
    """Only the turn of the hand is off then: the person pushes with a moment, and no force."""
    plant = bench()
    carrier = Carrier(0, person=Person(tremble=0.0))
    part = plant.bodies["part"]
    state = plant.arm_state
    carrier.begin(state, part, part)
    place, turned = ArmModel().hand_pose(state.position)
    swing = Rotation.from_rotvec([0.02, 0.0, 0.0])
    seen = place + swing.apply(part[0] - place), (swing * Rotation.from_quat(part[1])).as_quat()
    for k in range(300):
        now = ArmState(state.stamp_ns + k * 2_000_000, state.position, np.zeros(7))
        push = carrier.step(now)
        if k > 5:
            carrier.see("part", now.stamp_ns, *seen)
    assert np.linalg.norm(push.wrench[:3]) < 1.0 and np.linalg.norm(push.wrench[3:]) > 0.5


def test_a_person_believes_their_eyes_however_far_the_arm_is_from_what_they_see(bench):
    """Nobody registered a person's eyes: 6 cm are no fault of theirs."""
    plant, off = bench(), np.array([0.06, 0.0, 0.0])
    carrier, part, state = Carrier(0), plant.bodies["part"], plant.arm_state
    carrier.begin(state, part, part)
    for k in range(1000):
        now = ArmState(state.stamp_ns + k * 2_000_000, state.position, np.zeros(7))
        hand, seen_at, _ = carrier.look(now)
        if k > 5:
            carrier.see("part", now.stamp_ns, part[0] + off, part[1])
    assert seen_at - hand.position == pytest.approx(off, abs=1e-6)
