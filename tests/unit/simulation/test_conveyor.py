"""The belt: a cup that moves beside the arm, the person who guides the hand into it, and the one
who holds the hand.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import Command
from dart_skill.simulation import (
    Belt,
    Conveyor,
    Holder,
    Person,
    PlantSettings,
    Reacher,
    Reaching,
    make_world,
)

EXACT = Reaching(wait_spread=0.0, duration_spread=0.0, height_spread=0.0, aim_spread=0.0)
STEADY = Person(tremble=0.0)


@pytest.fixture
def conveyor():
    made = []

    def make(belt=None, seed=0, **settings):
        plant = Conveyor(PlantSettings(**settings), seed)
        plant.run(belt or Belt())
        plant.reset()
        made.append(plant)
        return plant

    yield make
    for plant in made:
        plant.close()


def test_a_steady_belt_has_the_same_speed_before_its_way_and_after_it():
    belt = Belt(begin=(0.6, 0.1, 1.1), way=(0.0, 0.24, 0.0), start=1.0, duration=2.4)
    for time in (-1.0, 0.0, 1.0, 2.0, 5.0):
        assert belt.at(time)[0] == pytest.approx([0.6, 0.1 + 0.1 * (time - 1.0), 1.1])


def test_another_belt_goes_from_rest_to_rest():
    belt = Belt(begin=(0.6, 0.1, 1.1), way=(0.05, 0.24, 0.0), steady=False)
    assert belt.at(0.0)[0] == pytest.approx(belt.begin) and belt.at(1.0)[0] == pytest.approx(
        belt.begin
    )
    assert belt.at(3.4)[0] == pytest.approx([0.65, 0.34, 1.1]) and belt.at(9.0)[
        0
    ] == pytest.approx([0.65, 0.34, 1.1])
    middle = (belt.at(2.201)[0] - belt.at(2.199)[0]) / 0.002
    assert middle == pytest.approx(1.875 * np.array(belt.way) / 2.4, rel=1e-4)


def test_a_cup_is_turned_about_the_vertical():
    assert Rotation.from_quat(Belt(turn=0.4).at(0.0)[1]).as_rotvec() == pytest.approx(
        [0.0, 0.0, 0.4]
    )


def test_the_cup_moves_with_the_clock_of_the_world_and_begins_anew_with_a_reset(conveyor):
    plant = conveyor(Belt(way=(0.0, 0.24, 0.0)))
    first = plant.bodies["cup"][0]
    for _ in range(50):
        plant.step(plant.braking())
    assert plant.time == pytest.approx(0.1)
    assert plant.bodies["cup"][0] - first == pytest.approx([0.0, 0.01, 0.0])
    assert plant.state.ball_position == pytest.approx(plant.cup[0]) and not plant.state.ball_held
    plant.reset()
    assert plant.bodies["cup"][0] == pytest.approx(first)


def test_no_camera_sees_a_cup_in_a_tunnel(conveyor):
    plant = conveyor(Belt(tunnel=0.02))
    assert set(plant.bodies) == {"hand", "cup"}
    for _ in range(10):
        plant.step(plant.braking())
    assert set(plant.bodies) == {"hand"}


def test_a_situation_says_where_the_cup_goes(conveyor):
    plant = conveyor()
    upright = Rotation.from_rotvec([0.0, 0.0, 0.3]).as_quat()
    way = {"way_x": 0.02, "way_y": 0.24, "duration": 2.0, "steady": 0.0}
    assert plant.set_up({"cup": (np.array([0.6, -0.1, 1.0]), upright)}, way).episode == 3
    for time in (0.0, 1.0, 2.0, 3.0):
        place, turn = plant._belt.at(time)
        assert place == pytest.approx(
            Belt((0.6, -0.1, 1.0), (0.02, 0.24, 0.0), 0.3, steady=False, duration=2.0).at(time)[0]
        )
        assert turn == pytest.approx(upright)
    plant.set_up({})
    assert plant._belt.way == (0.02, 0.24, 0.0), "where nothing is said, it runs as before"
    plant.put("cup", np.array([0.5, 0.1, 1.0]), upright)
    assert plant.cup[0] == pytest.approx(
        [0.5, 0.1, 1.0]
    ) and plant.state.ball_position == pytest.approx([0.5, 0.1, 1.0])
    assert plant.state.ball_velocity == pytest.approx(np.zeros(3))


def test_the_velocity_of_the_cup_is_that_of_the_belt(conveyor):
    plant = conveyor(Belt(way=(0.06, 0.24, 0.0)))
    assert plant.state.ball_velocity == pytest.approx([0.025, 0.1, 0.0])


@pytest.mark.parametrize(
    ("bodies", "numbers", "said"),
    [
        (["basket"], {}, "this world can put the cup somewhere, not 'basket'"),
        (
            [],
            {"speed": 0.1},
            "this world knows no number 'speed'; it knows way_x, way_y, way_z, steady",
        ),
        ([], {"duration": 0.0}, "duration is 0.0 s"),
        (["cup"], {}, "the cup leans by 0.50 rad"),
    ],
)
def test_a_situation_that_no_belt_has_is_refused(conveyor, bodies, numbers, said):
    plant = conveyor()
    leaning = np.array([0.6, 0.0, 1.0]), Rotation.from_rotvec([0.5, 0.0, 0.0]).as_quat()
    with pytest.raises(ValueError, match=said):
        plant.set_up(dict.fromkeys(bodies, leaning), numbers)
    assert plant.state.episode == 2, "nothing was reset"


def test_the_world_says_when_the_hand_is_in_the_cup(conveyor):
    plant = conveyor()
    assert not plant.succeeded
    plant.put("cup", plant.hand_position, np.array([0.0, 0.0, 0.0, 1.0]))
    assert plant.succeeded and plant.held_body == ""


def test_worlds_are_found_by_name():
    world = make_world("belt", PlantSettings())
    assert set(world.bodies) == {"hand", "cup"}
    world.close()
    with pytest.raises(
        ValueError, match="no world 'moon': choose one of basket, board, bench, belt"
    ):
        make_world("moon", PlantSettings())


def guided(plant, reacher):
    """The hand as the cup sees it, at each step (n, 3)."""
    reacher.begin(plant.arm_state)
    rows = []
    while not reacher.done(plant.arm_state):
        reacher.watch(plant.arm_state, plant.cup[0], np.array(plant.state.ball_velocity))
        plant.step(Command(plant.state_stamp_ns), reacher.step(plant.arm_state))
        rows.append(plant.hand_position - plant.cup[0])
    return np.array(rows)


@pytest.mark.parametrize("steady", [True, False])
def test_a_person_comes_over_the_rim_and_stays_in_a_cup_that_moves(conveyor, steady):
    local = guided(
        conveyor(Belt(begin=(0.6, -0.1, 1.1), way=(0.0, 0.2, 0.0), steady=steady)),
        Reacher(1, EXACT, STEADY),
    )
    rim = local[np.flatnonzero(local[:, 2] > 0.06)[-1]]
    assert np.hypot(*rim[:2]) < 0.005 and np.linalg.norm(local[-100:], axis=1).max() < 0.004
    over = local[np.hypot(local[:, 0], local[:, 1]) > 0.05]
    assert over[:, 2].min() > 0.06, "it comes from above"


def test_a_person_ends_beside_the_middle_by_what_they_aim_beside(conveyor):
    plant, ends = conveyor(), []
    reacher = Reacher(4, Reaching(aim_spread=0.02), STEADY)
    for _ in range(3):
        plant.reset()
        ends.append(guided(plant, reacher)[-1])
        assert ends[-1] == pytest.approx(reacher._aside, abs=0.004)
    assert np.ptp(ends, axis=0).max() > 0.01


def test_who_holds_the_hand_keeps_it_where_it_was_met(conveyor):
    plant, holder = conveyor(gravity_error=0.0), Holder(person=STEADY)
    lift = np.array([0.0, 0.0, 40.0, 0.0, 0.0, 0.0])
    met = plant.hand_position
    assert holder.push(plant.arm_state, False) is None
    for _ in range(300):
        plant.step(Command(plant.state_stamp_ns, lift), holder.push(plant.arm_state, True))
    assert np.linalg.norm(plant.hand_position - met) == pytest.approx(
        40.0 / STEADY.firm_hand[0], abs=0.003
    )
    for _ in range(150):
        plant.step(Command(plant.state_stamp_ns, lift), holder.push(plant.arm_state, False))
    assert plant.hand_position[2] - met[2] > 0.03
