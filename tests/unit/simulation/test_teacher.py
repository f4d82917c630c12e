"""The teacher: a person's pushes on a gravity-compensated arm, how good they are, and that they
are nothing but pushes.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import ArmModel, ArmState, Command, Grip
from dart_skill.common.configuration import node_parameters
from dart_skill.common.flight import landing
from dart_skill.simulation import Person, Phase, Plant, PlantSettings, Swing, Teacher

READY = np.array([0.0, -0.90, 0.0, -0.75, 0.0, -0.35, 0.0])
TARGET = np.array([1.9, 0.5, 0.4])
STEADY = Person(release_point=0.0, duration=0.0, speed=0.0, direction=0.0, timing=0.0, tremble=0.0)


def at(stamp_ns=0):
    return ArmState(stamp_ns, READY.copy(), np.zeros(7))


def guide(plant, teacher, target=TARGET, correction=False):
    """Landing point on the plane of the rim, and the states and pushes of one guided throw."""
    plant.reset(target)
    teacher.begin(target, plant.state.arm, correction)
    states, pushes, phases = [], [], []
    while (
        teacher.phase != Phase.WATCHING
        or plant.state.ball_position[2] > target[2]
        and not plant.state.ball_held
    ):
        states.append(plant.state)
        pushes.append(teacher.step(states[-1].arm))
        phases.append(teacher.phase)
        plant.step(Command(states[-1].stamp_ns), pushes[-1])
    freed = [s for s in states if not s.ball_held]
    landed = landing(freed[10].ball_position, freed[10].ball_velocity, target[2]).position
    return landed, states, pushes, phases


@pytest.fixture(scope="module")
def guided():
    plant = Plant(PlantSettings(start_posture=tuple(READY)), 2)
    yield guide(plant, Teacher(seed=2))
    plant.close()


def test_a_guided_throw_goes_roughly_to_the_basket(guided):
    landed, states, _, _ = guided
    assert np.linalg.norm(landed[:2] - TARGET[:2]) < 0.25, landed - TARGET
    assert max(np.linalg.norm(s.ball_velocity) for s in states) > 3.0


def test_a_steady_person_and_a_hand_without_spread_throw_close_to_the_basket(make_plant):
    landed, *_ = guide(make_plant(hand_spread=0.0), Teacher(person=STEADY))
    assert np.linalg.norm(landed[:2] - TARGET[:2]) < 0.15, landed - TARGET


def test_the_phases_come_in_order_and_the_pause_is_a_person_s(guided):
    _, states, _, phases = guided
    order = [phase for k, phase in enumerate(phases) if k == 0 or phase != phases[k - 1]]
    assert order == [Phase.TURNING, Phase.PAUSING, Phase.THROWING, Phase.WATCHING]
    shortest, longest = Person().pause
    assert shortest - 0.01 < phases.count(Phase.PAUSING) * 2e-3 < longest + 0.01


def test_pushes_stay_below_what_a_person_can_do(guided):
    """Force and moment at the hand; the other hand's force shows as joint torque of the elbow's
    Jacobian.
    """
    _, states, pushes, _ = guided
    person, model = Person(), ArmModel()
    force = np.array([np.linalg.norm(push.wrench[:3]) for push in pushes])
    twist = np.array([np.linalg.norm(push.wrench[3:]) for push in pushes])
    assert (
        force.max() < person.strongest_push + 6 * person.tremble
        and twist.max() <= person.strongest_twist + 1e-9
    )
    assert force.max() > 10.0, "the throw is pushed, not imagined"
    for state, push in zip(states[::20], pushes[::20], strict=True):
        jacobian = model.elbow(state.position)[1]
        elbow, *_ = np.linalg.lstsq(jacobian.T, push.joint_torque, rcond=None)
        np.testing.assert_allclose(
            jacobian.T @ elbow, push.joint_torque, atol=1e-9, err_msg="not a force at the elbow"
        )
        assert np.linalg.norm(elbow) <= person.strongest_push + 1e-6


def test_a_push_is_cut_when_the_arm_does_not_follow():
    teacher = Teacher(person=STEADY)
    teacher.begin(TARGET, at())
    for stamp in range(0, 2_000_000_000, 20_000_000):
        push = teacher.step(at(stamp))
        assert np.linalg.norm(push.wrench[:3]) <= STEADY.strongest_push + 1e-9
        assert np.linalg.norm(push.wrench[3:]) <= STEADY.strongest_twist + 1e-9
    assert np.linalg.norm(push.wrench[:3]) == pytest.approx(STEADY.strongest_push)


def test_the_arm_is_only_pushed_and_so_cannot_follow_if_it_is_held(make_plant):
    """With friction that nobody could overcome the joints stay where they are: nothing sets them."""
    plant, teacher = make_plant(friction_scale=1e3), Teacher()
    plant.reset(TARGET)
    teacher.begin(TARGET, plant.state.arm)
    for _ in range(700):
        plant.step(Command(plant.state_stamp_ns), teacher.step(plant.state.arm))
    np.testing.assert_allclose(plant.state.position, READY, atol=2e-3)


def test_the_button_is_pressed_once(guided):
    _, states, pushes, phases = guided
    pressed = [k for k, push in enumerate(pushes) if push.grip != Grip.UNSPECIFIED]
    assert (
        len(pressed) == 1
        and pushes[pressed[0]].grip == Grip.OPEN
        and phases[pressed[0]] == Phase.THROWING
    )


def test_the_elbow_stays_in_the_plane_of_the_throw(guided):
    """The other hand keeps it there: through the swing it is at most 12 cm from the vertical plane
    through basket and base.
    """
    _, states, _, phases = guided
    model, azimuth = ArmModel(), np.arctan2(TARGET[1], TARGET[0])
    across = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    swing = [s for s, phase in zip(states, phases, strict=True) if phase == Phase.THROWING]
    apart = np.abs([model.elbow(s.position)[0] @ across for s in swing])
    assert apart.max() < 0.12, apart.max()


def test_the_same_seed_gives_the_same_throw_and_another_seed_another(guided, make_plant):
    again, other = (guide(make_plant(seed=2), Teacher(seed=seed))[0] for seed in (2, 3))
    np.testing.assert_array_equal(guided[0], again)
    assert np.linalg.norm(guided[0] - other) > 1e-3


def test_correcting_reduces_a_miss(make_plant):
    """A person who misjudges the delay of the hand by 25 ms misses; after two corrections the miss
    is gone.
    """
    person = replace(STEADY, expected_hand_delay=0.005)
    plant, teacher = make_plant(hand_spread=0.0), Teacher(person=person)
    misses, landed = [], None
    for attempt in range(3):
        landed, *_ = guide(plant, teacher, correction=attempt > 0)
        misses.append(np.linalg.norm(landed[:2] - TARGET[:2]))
        teacher.learn_from(landed)
    assert misses[0] > 0.07 and misses[1] < 0.6 * misses[0] and misses[2] < 0.05, misses


def test_a_new_basket_forgets_the_correction():
    teacher, fresh = Teacher(), Teacher()
    teacher.begin(TARGET, at())
    teacher.learn_from(TARGET + [0.3, 0.2, 0.0])
    teacher.begin(TARGET, at())
    fresh.begin(TARGET, at())
    fresh.begin(TARGET, at())
    answers = [
        [one.step(at(stamp)).wrench for stamp in range(0, 2_000_000_000, 100_000_000)]
        for one in (teacher, fresh)
    ]
    np.testing.assert_array_equal(*answers)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (
            [8.0, 0.0, 0.4],
            (
                r"at 8\.00 m, 0\.40 m high, is out of the teacher's reach: place it between .* and"
                r" .* m"
            ),
        ),
        ([2.0, 0.0, 4.0], r"4\.00 m high, is out of the teacher's reach"),
        ([-2.0, 0.2, 0.4], "behind the arm"),
        ([np.nan, 0.0, 0.4], "not three finite numbers"),
        ([2.0, 0.0], "not three finite numbers"),
    ],
)
def test_a_basket_out_of_reach_is_refused_and_changes_nothing(target, message):
    teacher, twin = Teacher(seed=1), Teacher(seed=1)
    with pytest.raises(ValueError, match=message):
        teacher.begin(np.array(target), at())
    assert teacher.phase == Phase.IDLE
    teacher.begin(TARGET, at())
    twin.begin(TARGET, at())
    for stamp in range(0, 2_000_000_000, 100_000_000):
        np.testing.assert_array_equal(teacher.step(at(stamp)).wrench, twin.step(at(stamp)).wrench)


def test_a_teacher_without_a_throw_in_mind_says_so():
    with pytest.raises(ValueError, match="begin one"):
        Teacher().step(at())


def test_a_landing_that_nobody_saw_teaches_nothing():
    teacher = Teacher()
    teacher.begin(TARGET, at())
    with pytest.raises(ValueError, match="no landing of the ball was seen"):
        teacher.learn_from(np.full(3, np.nan))


def test_the_swing_in_mind_is_smooth_and_passes_the_release_at_its_speed():
    """What is wanted has no jumps in velocity: its positions are the integral of its rates."""
    teacher = Teacher(person=STEADY)
    teacher.begin(TARGET, at())
    time = np.arange(0.0, 3.0, 1e-3)
    wanted = [teacher._wanted(t) for t in time]
    q, qd = np.array([w[0] for w in wanted]), np.array([w[1] for w in wanted])
    integrated = q[0] + np.cumsum(0.5e-3 * (qd[:-1] + qd[1:]), axis=0)
    np.testing.assert_allclose(q[1:], integrated, atol=2e-4)
    assert np.abs(np.diff(qd, axis=0)).max() < 0.1
    peak = qd[:, 1].max() / Swing().rates[0]
    assert 0.4 < peak < 1.2


def test_a_person_comes_from_the_parameters_of_the_node():
    parameters = node_parameters("teacher.yaml", "teacher")
    assert Person.from_parameters(parameters) == Person(), "config and defaults agree"
    assert Person.from_parameters({**parameters, "tremble": 1.5}).tremble == 1.5


@pytest.mark.parametrize("target", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.1, 0.1, 0.4)])
def test_a_basket_on_the_base_of_the_arm_is_refused(target):
    """What a miss there says of the next aim is not a number."""
    with pytest.raises(ValueError, match="stands on the base of the arm"):
        Teacher().check(np.array(target))
