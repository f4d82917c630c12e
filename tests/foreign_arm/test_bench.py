"""Part, holder, and the hand that holds the part do what physics and these files say. No ROS."""

import numpy as np
import pytest

pytest.importorskip(
    "mujoco",
    reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup",
)

from tests.foreign_arm import published  # noqa: E402
from tests.foreign_arm.arm import PERIOD, SHOULDER, NominalArm  # noqa: E402
from tests.foreign_arm.laboratory import Laboratory  # noqa: E402
from tests.foreign_arm.person import Way  # noqa: E402
from tests.foreign_arm.placing.person import OVER_THE_PART, Placer, arch, elbows  # noqa: E402
from tests.foreign_arm.placing.scene import BENCH, PLAY, SIZE, BenchScene  # noqa: E402
from tests.foreign_arm.plant import Plant  # noqa: E402

HOLDER = np.array([0.6, 0.1, BENCH["table"] + BENCH["floor"]]), published.about_z(0.4)
SEAT = HOLDER[0] + [0.0, 0.0, SIZE[2] / 2], HOLDER[1]


@pytest.fixture
def bench():
    """A plant as in the books, and who guides it."""
    plant = Plant(Laboratory.quiet(), OVER_THE_PART, BenchScene())
    plant.stand(*HOLDER)
    return plant, Placer(plant.laboratory, plant)


def guide(plant, person, *tasks, pushes=()):
    """Let the person do these; further pushes on the plant meanwhile."""
    nominal = NominalArm(Laboratory.quiet())
    person.begin(*tasks)
    while person.busy:
        held, carried = person.act()
        if person.tells:
            getattr(plant.hand, person.tells)(plant.time)
        nominal.take(plant.encoders.angles)
        plant.step(nominal.gravity(), (*held, *pushes), carried)


def lifted(plant, person):
    """The closed hand, with the part 10 cm above the table; the way on which it stays there."""
    place, rotation = plant.pose("hand")
    high = place + [0.0, 0.0, 0.1]
    first = [np.array([at, at]) for at in (place, rotation, elbows(place[None])[0])]
    guide(plant, person, person.follow(Way.along(*first), {0: "close"}, rest=0.3))
    places, rotations = arch((place, rotation), (high, rotation), 0.0, 1.0)
    up = Way.along(places, rotations, elbows(places))
    guide(plant, person, person.follow(up, rest=0.5))
    last = [np.array([at[-1], at[-1]]) for at in (up.hand, up.attitude, up.elbow)]
    return Way.along(*last)


def test_elbows_are_where_the_table_of_the_arm_says():
    rotations, origins = published.frames(OVER_THE_PART)
    assert rotations[7][:, 2] == pytest.approx([0.0, 0.0, -1.0], abs=1e-4)
    hand, elbow = origins[[7, 3]] + SHOULDER
    assert elbows(hand[None])[0] == pytest.approx(elbow, abs=1e-4)


def test_ten_newton_move_a_held_part_by_a_millimetre_and_a_half_newton_metre_turns_it_by_five_degrees(
    bench,
):
    plant, person = bench
    stays = lifted(plant, person)
    place, turn = plant.scene.seen_from("hand")
    pushed = [("part", np.array([10.0, 0.0, 0.0]), np.zeros(3))]
    guide(plant, person, person.follow(stays, rest=1.0), pushes=pushed)
    moved = np.linalg.norm(plant.scene.seen_from("hand")[0] - place)
    twisted = [("part", np.zeros(3), np.array([0.5, 0.0, 0.0]))]
    guide(plant, person, person.follow(stays, rest=1.0), pushes=twisted)
    turned = np.arccos((np.trace(plant.scene.seen_from("hand")[1].T @ turn) - 1.0) / 2.0)
    assert moved == pytest.approx(0.00123, abs=0.0002)
    assert np.rad2deg(turned) == pytest.approx(5.0, abs=0.7)


def test_the_hand_lets_go_when_it_is_told_to_open(bench):
    plant, person = bench
    stays = lifted(plant, person)
    assert plant.scene.holds
    guide(plant, person, person.follow(stays, {0: "open"}, rest=0.04))
    assert plant.scene.holds
    guide(plant, person, person.follow(stays, rest=0.5))
    assert not plant.scene.holds
    assert plant.pose("part")[0][2] == pytest.approx(BENCH["table"] + SIZE[2] / 2, abs=0.001)


def test_fingers_that_close_beside_the_part_hold_nothing(bench):
    plant, person = bench
    plant.put(plant.pose("part")[0] + [0.03, 0.0, 0.0])
    lifted(plant, person)
    assert not plant.scene.holds


@pytest.mark.parametrize(
    ("aside", "is_in"), [(0.0, True), (0.8 * PLAY, True), (2.0 * PLAY, False)]
)
def test_a_part_falls_into_the_holder_where_it_has_play(bench, aside, is_in):
    plant, person = bench
    plant.put(SEAT[0] + SEAT[1] @ [aside, 0.0, BENCH["depth"] + 0.005], rotation=SEAT[1])
    guide(plant, person, person.wait(1.0))
    assert plant.scene.is_placed() == is_in


def test_a_person_places_a_part_and_puts_it_back(bench):
    plant, person = bench
    guide(plant, person, person.place(SEAT))
    assert plant.scene.is_placed()
    guide(plant, person, person.lead_back(), person.bring_part())
    seen, turn = plant.scene.seen_from("hand")
    assert seen == pytest.approx(BENCH["grasp"], abs=0.003)
    assert -turn[2, 2] > np.cos(0.02)


def test_a_way_over_something_is_as_high_as_asked_and_ends_where_it_shall():
    first, last = (np.array([0.4, -0.3, 1.2]), np.eye(3)), SEAT
    places, rotations = arch(first, last, 1.35, 3.0)
    assert (places[0], places[-1]) == (pytest.approx(first[0]), pytest.approx(last[0]))
    assert rotations[-1] == pytest.approx(last[1])
    assert places[:, 2].max() == pytest.approx(1.35, abs=0.01)
    assert np.abs(np.diff(places, axis=0)).max() < 0.6 * PERIOD


def test_a_hand_that_is_led_back_from_the_farthest_holder_keeps_its_joints_within_their_ranges(
    bench,
):
    plant, person = bench
    farthest = np.array(
        [BENCH["reach"][1], 0.0, BENCH["table"] + BENCH["floor"] + BENCH["raised"]]
    )
    plant.stand(farthest)
    joints = []

    def watched(task):
        for moment in task:
            joints.append(plant.link_angles)
            yield moment

    seat = farthest + [0.0, 0.0, SIZE[2] / 2], np.eye(3)
    guide(plant, person, watched(person.place(seat)), watched(person.lead_back()))
    assert plant.scene.is_placed()
    assert np.all(np.min(joints, axis=0) > published.LOWER + 0.05)
    assert np.all(np.max(joints, axis=0) < published.UPPER - 0.05)
