"""A skill that reacts: demonstrations among bodies that move in, a guide that is asked with the
newest poses out.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import Grip, HandState, Registration
from dart_skill.common.situation import Pose, Situation
from dart_skill.movement import attractor_from_motion
from dart_skill.recording import Demonstration, Event, Track
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning import LearnedSkill, moving_frames
from dart_skill.skills.protocol import Skill, SkillSettings, load_skill
from tests.unit.skills.task_demonstrations import NOISE, POSTURE, START, smooth

SETTINGS = SkillSettings(representation="autonomous", components=12, settle=0.3)
STEP = 0.004
NS = 1_000_000_000


class Follow(Skill):
    """The hand comes over a body that moves, and stays there, 5 cm above it."""

    name, bodies, turns_hand = "follow", ("truck",), False

    def cut(self, demonstration):
        return 5.0, 7.0


class Truck:
    """Drives at constant speed; turned by 0.3 rad, which the frames follow."""

    def __init__(self, rng, size=1.0):
        self.begin = np.array([0.6, 0.1, 1.1]) + size * rng.uniform(-1, 1, 3) * [0.1, 0.15, 0.05]
        self.speed = size * rng.uniform(-1, 1, 3) * [0.03, 0.1, 0.0]

    def at(self, since):
        return self.begin + np.multiply.outer(since, self.speed)


TURN = Rotation.from_rotvec([0.0, 0.0, 0.3])
OVER = np.array([0.0, 0.0, 0.05])


def show(rng, truck, told=(), name="", until=8.5):
    """One demonstration: from 5 s on the hand goes to where the truck is then, in 1.8 s."""
    time = np.arange(4.0, until, 0.01)
    place, over = truck.at(time - 5.0), smooth((time - 5.0) / 1.8)[:, None]
    hand = START.position + over * (place + OVER - START.position)

    def noisy(path):
        return path + NOISE * rng.standard_normal(path.shape)

    n = len(time)
    tracks = {
        "hand": Track(time, noisy(hand), np.tile(START.quaternion, (n, 1))),
        "truck": Track(time, noisy(place), np.tile(TURN.as_quat(), (n, 1))),
    }
    rests = time[time <= 5.0]
    joints = np.tile(POSTURE, (len(rests), 1))
    return Demonstration(
        name or f"shown_{rng.integers(1e9)}",
        tracks,
        joint_time=rests,
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
        events=tuple(told),
    )


@pytest.fixture(scope="module")
def demonstrations():
    rng = np.random.default_rng(0)
    return [show(rng, Truck(rng), told=(Event("open", 6.8),), name=f"shown_{k}") for k in range(8)]


@pytest.fixture(scope="module")
def learned(demonstrations):
    return LearnedSkill(Follow(SETTINGS), demonstrations)


def carry_out(
    guide,
    truck,
    held=(9.0, 9.0),
    world=None,
    blind_from=np.inf,
    reads=(0.0, 0.0, 0.0),
    looks=False,
):
    """A point mass that follows the attractors: times (n,), hand (n, 3), velocity (n, 3) and what
    the guide said.

    held: nothing moves the hand from then to then [s]; world: what the cameras see of the arm's
    world (Registration); reads: what the arm takes the hand to be elsewhere (3,) [m]; looks: the
    cameras see the hand, too.
    """
    x, v, rows, told = START.position.copy(), np.zeros(3), [], []
    shift = np.zeros(3) if world is None else np.array(world.shift)
    turn = Rotation.identity() if world is None else Rotation.from_quat(world.turn)
    for k in range(-60, 2000):
        stamp = 10 * NS + round(k * STEP * NS)
        if k % 3 == 0 and k * STEP < blind_from:
            guide.see(
                "truck", stamp, turn.apply(truck.at(k * STEP)) + shift, (turn * TURN).as_quat()
            )
        if k < 0:
            continue
        if looks and k % 3 == 1:
            guide.see("hand", stamp - round(STEP * NS), rows[-1][1:4], START.quaternion)
        now = guide.look(
            k * STEP, HandState(x + np.array(reads), np.eye(3), np.append(v, np.zeros(3))), stamp
        )
        told.append(now)
        if now.over or now.fault:
            break
        rows.append(np.array([k * STEP, *x, *v]))
        pull = (
            now.gains.stiffness[:3] * (now.reference.attractor_position - x - np.array(reads))
            - now.gains.damping[:3] * v
        )
        v = np.zeros(3) if held[0] <= k * STEP < held[1] else v + STEP * pull
        x = x + STEP * v
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1:4], rows[:, 4:], told


def test_frames_of_a_body_stand_on_the_attractor_of_its_own_motion():
    skill, rng = Follow(SETTINGS), np.random.default_rng(1)
    place, speed, growth = rng.standard_normal((3, 3))
    body = BodyMotion(place, speed, growth, TURN.as_quat(), 0.0)
    start, truck = moving_frames(skill, Situation({"hand": START}), {"truck": body}, 300.0)
    assert start.frame.b[1:] == pytest.approx(START.position) and start.attractor == pytest.approx(
        START.position
    )
    assert start.velocity == pytest.approx(np.zeros(3))
    assert truck.frame.b == pytest.approx([0.0, *place]) and truck.frame.A[
        1:, 1:
    ] == pytest.approx(TURN.as_matrix())
    assert truck.velocity == pytest.approx(speed)
    assert truck.attractor == pytest.approx(
        attractor_from_motion(place[None], speed[None], growth[None], 300.0)[0]
    )


def test_a_frame_beside_a_body_moves_as_the_skill_places_it():
    """Half-way between the hand and the truck: half as fast."""

    class Between(Follow):
        def frames(self, situation):
            return [
                Pose(0.5 * (situation.pose("hand").position + situation.pose("truck").position))
            ]

    body = BodyMotion(
        np.array([1.0, 0.0, 0.0]), np.array([0.0, 2.0, 0.0]), np.zeros(3), TURN.as_quat(), 0.0
    )
    (frame,) = moving_frames(
        Between(SETTINGS), Situation({"hand": Pose(np.zeros(3))}), {"truck": body}, 400.0
    )
    assert frame.frame.b == pytest.approx(
        [0.0, 0.5, 0.0, 0.0]
    ) and frame.velocity == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    "seed", [10, *(pytest.param(one, marks=pytest.mark.slow) for one in (11, 12))]
)
def test_the_hand_comes_over_a_body_that_moves_as_nobody_showed(learned, seed):
    truck = Truck(np.random.default_rng(seed), size=1.5)
    time, hand, _, told = carry_out(learned.policy.guide(), truck)
    assert not told[-1].fault and time[-1] == pytest.approx(
        learned.duration + SETTINGS.settle + SETTINGS.follow_on, abs=0.4
    )
    assert np.linalg.norm(hand[-1] - truck.at(time[-1]) - OVER) < 0.006


@pytest.mark.slow
def test_held_it_waits_and_afterwards_it_catches_up_no_faster_than_it_may(learned):
    truck = Truck(np.random.default_rng(10))
    free = carry_out(learned.policy.guide(), truck)
    time, hand, velocity, told = carry_out(learned.policy.guide(), truck, held=(0.8, 1.8))
    phases = np.array([now.time for now in told])[:-1]
    waiting = (time > 0.9) & (time < 1.8)
    assert np.ptp(phases[waiting]) < 0.25 and time[-1] - free[0][-1] == pytest.approx(
        1.0, abs=0.25
    )
    assert np.linalg.norm(hand[-1] - truck.at(time[-1]) - OVER) < 0.006
    fastest = np.linalg.norm(free[2], axis=1).max()
    assert np.linalg.norm(velocity, axis=1).max() < fastest + SETTINGS.catch_up


def test_who_holds_the_hand_is_not_pulled_harder_and_harder(learned):
    time, hand, _, told = carry_out(
        learned.policy.guide(), Truck(np.random.default_rng(10)), held=(0.8, 1.8)
    )
    held = np.flatnonzero((time > 1.0) & (time < 1.8))
    assert all(told[k].touches for k in held) and not any(told[k].touches for k in range(100))
    most = SETTINGS.catch_up * 2.0 / np.sqrt(SETTINGS.stiffness)
    assert max(np.linalg.norm(told[k].reference.position - hand[k]) for k in held) < most + 0.005


def test_a_hand_that_friction_holds_is_pulled_until_it_moves(learned):
    """A hand that stands still, a few millimetres from where the movement begins."""
    guide, truck = learned.policy.guide(), Truck(np.random.default_rng(10))
    begin = learned.start.position + [0.0, 0.004, 0.0]
    still = HandState(begin, np.eye(3), np.zeros(6))
    for k in range(-60, 2000):
        stamp = 10 * NS + round(k * STEP * NS)
        guide.see("truck", stamp, truck.at(k * STEP), TURN.as_quat())
        if k >= 0:
            now = guide.look(k * STEP, still, stamp)
            if np.linalg.norm(now.reference.position - begin) > 0.012:
                return
    raise AssertionError("it was left to friction")


@pytest.mark.slow
def test_without_that_limit_it_hurries_when_it_is_let_go(demonstrations, learned):
    eager = LearnedSkill(Follow(replace(SETTINGS, catch_up=100.0)), demonstrations)
    speeds = []
    for one in (learned, eager):
        truck = Truck(np.random.default_rng(10))
        truck.speed = np.array([0.0, 0.25, 0.0])
        time, _, velocity, _ = carry_out(one.policy.guide(), truck, held=(0.8, 1.8))
        speeds.append(np.linalg.norm(velocity[(time > 1.8) & (time < 2.0)], axis=1).max())
    assert speeds[0] < 0.25 + 0.1 < 0.6 < speeds[1]


@pytest.mark.slow
def test_what_the_fingers_do_stands_on_the_phase(learned):
    truck = Truck(np.random.default_rng(10))
    for held in ((9.0, 9.0), (1.0, 2.0)):
        time, _, _, told = carry_out(learned.policy.guide(), truck, held=held)
        opened = [now.grip == Grip.OPEN for now in told]
        assert told[opened.index(True)].time == pytest.approx(
            1.8 * learned.duration / 2.0, abs=0.02
        )
        assert (time[opened.index(True)] > 2.4) == (held[0] < 9.0)


def test_cameras_that_stand_askew_change_nothing_in_the_world_of_the_arm(learned):
    world = Registration(
        turn=tuple(Rotation.from_rotvec([0.0, 0.0, 0.1]).as_quat()), shift=(0.02, -0.01, 0.03)
    )
    turn, truck = Rotation.from_quat(world.turn), Truck(np.random.default_rng(10))
    start = Pose(
        turn.apply(learned.start.position) + world.shift,
        (turn * Rotation.from_quat(learned.start.quaternion)).as_quat(),
    )
    plain, there = learned.registration, carry_out(learned.policy.guide(), truck)[1]
    learned.registration = world
    try:
        askew = carry_out(learned.policy.guide(Situation({"hand": start})), truck, world=world)[1]
    finally:
        learned.registration = plain
    n = min(len(there), len(askew))
    assert askew[:n] == pytest.approx(there[:n], abs=2e-3)


def test_an_arm_that_reads_wrong_is_led_by_where_the_hand_is_seen(learned):
    truck, ends = Truck(np.random.default_rng(10)), []
    for looks in (False, True):
        time, hand, _, _ = carry_out(
            learned.policy.guide(), truck, reads=(0.008, -0.006, 0.0), looks=looks
        )
        ends.append(hand[-1] - truck.at(time[-1]) - OVER)
    assert ends[0] - ends[1] == pytest.approx([-0.008, 0.006, 0.0], abs=1e-3)
    assert np.linalg.norm(ends[1]) < 0.006


def test_a_body_that_is_lost_is_named(learned):
    truck = Truck(np.random.default_rng(10))
    *_, told = carry_out(learned.policy.guide(), truck, blind_from=1.0)
    assert told[-1].fault.startswith("the truck was last seen 0.15 s ago: more than 0.15 s")


def test_equal_demonstrations_make_an_equal_model(demonstrations, learned):
    assert LearnedSkill(Follow(SETTINGS), demonstrations).model_id == learned.model_id
    assert LearnedSkill(Follow(SETTINGS), demonstrations[1:]).model_id != learned.model_id


def test_a_skill_that_turns_the_hand_is_refused(demonstrations):
    class Turning(Follow):
        turns_hand = True

    with pytest.raises(ValueError, match="'follow': the hand would keep the orientation"):
        LearnedSkill(Turning(SETTINGS), demonstrations)


def test_a_skill_without_bodies_has_nothing_to_react_to(demonstrations):
    class Alone(Follow):
        bodies = ()

    with pytest.raises(ValueError, match="'follow': it names no body that it reacts to"):
        LearnedSkill(Alone(SETTINGS), demonstrations)


def without(one, **changes):
    return replace(one, id="odd", **changes)


def test_what_cannot_be_learned_from_is_named(demonstrations):
    one = demonstrations[0]
    truck = one.tracks["truck"]
    early = {
        **one.tracks,
        "truck": Track(truck.time[:30], truck.position[:30], truck.quaternion[:30]),
    }
    short = {
        **one.tracks,
        "truck": Track(truck.time[:200], truck.position[:200], truck.quaternion[:200]),
    }
    cases = [
        ([one], "only 1 demonstration of 'follow'"),
        (
            [one, without(one, tracks={"hand": one.tracks["hand"]})],
            "demonstration odd: the truck was never seen",
        ),
        (
            [one, without(one, tracks=early)],
            "demonstration odd: the truck was not seen from 4.500 to 7.700 s",
        ),
        ([one, without(one, tracks=short)], "demonstration odd: at spans"),
        ([one, without(one, events=())], "demonstration odd tells the fingers nothing"),
    ]
    for shown, said in cases:
        with pytest.raises(ValueError, match=said):
            LearnedSkill(Follow(SETTINGS), shown)


def test_a_situation_says_how_the_cup_moves_in_words():
    skill = load_skill("reach")
    cup = {"cup": Pose(np.array([0.6, -0.1, 1.1]))}
    moving = Situation(cup, {"way_x": -0.05, "way_y": 0.13, "way_z": -0.0, "steady": 0.0})
    at = "cup at 0.60, -0.10, 1.10 m"
    assert skill.in_words(moving) == f"{at}; it moves by -0.05, +0.13, +0.00 m and rests"
    assert skill.in_words(Situation(cup)) == at
    assert skill.in_words(Situation(cup, {"tunnel": 1.2})) == f"{at}; tunnel 1.2 s"
