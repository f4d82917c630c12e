"""Movement primitives as representations: from where the hand is to a goal in the last task frame,
on a clock that waits for a hand that is held.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import CarefulGuide, Grip, HandState, same_plan
from dart_skill.common.situation import Pose
from dart_skill.recording import HAND, Event
from dart_skill.skills.learning import (
    LearnedSkill,
    Policy,
    VectorPrimitive,
    choose_components,
    load_model,
    save_model,
)
from dart_skill.skills.protocol import Skill, SkillSettings, TaskOutcome, load_skill, part_names
from tests.unit.skills.task_demonstrations import GRIP, START, draw_body, show, situation_of
from tests.unit.skills.test_reactive_skill import Follow, Truck, carry_out
from tests.unit.skills.test_reactive_skill import show as show_truck

BOTH = ("dmp", "pose_dmp")
TURNED = Pose(
    START.position + [0.02, -0.03, 0.01],
    (Rotation.from_rotvec([0.05, -0.02, 0.2]) * Rotation.from_quat(START.quaternion)).as_quat(),
)


class Touch(Skill):
    """The hand ends over a button that stands somewhere."""

    name, bodies, corrects = "touch", ("button",), "button"

    def judge(self, seen, situation):
        return TaskOutcome(True, 0.0)


def touch(name, **changes):
    settings = {"components": 16, "stiffness": 300.0, "representation": name}
    return Touch(SkillSettings(**settings | changes))


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(0)
    drawn = [show(rng, draw_body(rng), name=f"shown_{k}") for k in range(6)]
    return [replace(one, skill="touch") for one in drawn]


@pytest.fixture(scope="module", params=BOTH)
def learned(request, shown):
    return LearnedSkill(touch(request.param), shown)


def apart(one, other):
    """Distance [m] and angle [rad] between a pose of a path and another one."""
    return Pose(*one).apart(other)


def ends(plan):
    return [(plan.path.position[k], plan.path.quaternion[k]) for k in (0, -1)]


# plans


def test_a_plan_leads_from_the_hand_to_the_goal_that_was_shown_in_its_frame(learned):
    rng = np.random.default_rng(21)
    for size in (1.0, 3.0):
        for start in (START, TURNED):
            body = draw_body(rng, size)
            plan = learned.plan(situation_of(body).moved(HAND, start))
            first, last = ends(plan)
            assert max(apart(first, start)) < 1e-9
            distance, angle = apart(last, body.place(GRIP))
            assert distance < 2e-4 and angle < 2e-3
            assert np.abs(plan.path.velocity[0]).max() < 1e-3, "from rest"


def test_where_it_ends_in_its_frame_is_the_same_in_every_situation(learned):
    """(7.8) is linear, so what is left of the error is that of the demonstrations."""
    rng, places = np.random.default_rng(4), []
    for _ in range(4):
        body = draw_body(rng, 3.0)
        plan = learned.plan(situation_of(body))
        places.append(body.sees(Pose(*ends(plan)[1])))
    for one in places[1:]:
        distance, angle = one.apart(places[0])
        assert distance < 2e-5 and angle < 1e-4


def test_velocities_belong_to_the_path(learned):
    path = learned.plan(situation_of(draw_body(np.random.default_rng(3)))).path
    step = path.time[1]
    assert path.velocity[1:-1, :3] == pytest.approx(
        (path.position[2:] - path.position[:-2]) / (2.0 * step), abs=2e-3
    )
    turns = Rotation.from_quat(path.quaternion)
    rates = (turns[2:] * turns[:-2].inv()).as_rotvec() / (2.0 * step)
    assert path.velocity[1:-1, 3:] == pytest.approx(rates, abs=5e-3)


@pytest.mark.parametrize("name", BOTH)
def test_one_demonstration_is_enough_and_is_made_again(name, shown):
    learned = LearnedSkill(touch(name, least_demonstrations=3), shown[:1])
    assert learned.left_out_error() != learned.left_out_error(), "nothing can be left out"
    movement = learned.movements[0]
    path = learned.plan(movement.situation).path
    seen = np.column_stack(
        [np.interp(path.time, movement.time, one) for one in movement.poses[:, :3].T]
    )
    assert np.linalg.norm(path.position - seen, axis=1).max() < 0.004
    body = draw_body(np.random.default_rng(8))
    assert apart(ends(learned.plan(situation_of(body)))[1], body.place(GRIP))[0] < 1e-3


@pytest.mark.parametrize("name", BOTH)
def test_a_model_that_was_saved_makes_the_same_plans_to_the_last_bit(name, shown, tmp_path):
    learned = LearnedSkill(touch(name), shown[:2])
    save_model(tmp_path / "touch.npz", shown[:2], learned.skill.settings)
    saved = load_model(tmp_path / "touch.npz", learned.skill)
    again = LearnedSkill(Touch(saved.configuration), saved.demonstrations)
    situation = situation_of(draw_body(np.random.default_rng(2)))
    assert again.model_id == learned.model_id
    assert same_plan(again.plan(situation), learned.plan(situation))


def test_there_is_a_gaussian_for_each_kernel_along_the_plan(learned):
    situation = situation_of(draw_body(np.random.default_rng(5))).moved(HAND, START)
    mixture, path = learned.mixture(situation), learned.plan(situation).path
    assert mixture.means_.shape == (16, 4)
    for mean, covariance in zip(mixture.means_, mixture.covariances_, strict=True):
        here = [np.interp(mean[0], path.time, one) for one in path.position.T]
        assert np.linalg.norm(mean[1:] - here) < 0.03
        assert np.linalg.eigvalsh(covariance).min() > 0.0


@pytest.mark.parametrize("way", ["bic", "cross_validation"])
def test_the_number_of_kernels_is_chosen(way, shown):
    """Thesis 7.3: too few smooth the movement, which both tell."""
    few, chosen = touch("dmp", components=4), choose_components(touch("dmp"), shown[:4], way)
    assert chosen.settings.components > 4
    assert LearnedSkill(few, shown[:4]).bic() > LearnedSkill(chosen, shown[:4]).bic()


def test_a_spread_of_the_attractor_is_not_known(shown):
    with pytest.raises(ValueError, match="'dmp' knows no covariance"):
        LearnedSkill(touch("dmp", stiffness_range=(50.0, 800.0)), shown)


def test_numbers_of_a_situation_are_refused(shown):
    class Weighed(Touch):
        def inputs(self, situation):
            return [1.0]

    with pytest.raises(ValueError, match="a primitive has no further inputs"):
        LearnedSkill(Weighed(touch("pose_dmp").settings), shown)


def test_throws_are_refused_and_poses_and_bodies_that_move_are_not():
    for name in ("throw", "darts"):
        with pytest.raises(ValueError, match="over the position and two angles of the hand"):
            load_skill(name, changes={"representation": "dmp"})
    for name in ("place", "reach"):
        assert set(BOTH) < set(part_names("representation", load_skill(name)))
    assert not load_skill("place", changes={"representation": "dmp"}).reacts
    assert load_skill("reach", changes={"representation": "pose_dmp"}).reacts


# the arm


def looked(guide, plan, held=(np.inf, np.inf), carries_on=3.0, step=0.004):
    """Times on the clock of a guide, and what it says, for a hand that is where it was wanted one
    step before, and from held[0] to held[1] [s] where it was.
    """
    hand, said = plan.path.position[0], []
    for k in range(round((plan.end + carries_on) / step)):
        moves = not held[0] <= k * step < held[1]
        velocity = said[-1].reference.velocity if said and moves else np.zeros(6)
        rotation = Rotation.from_quat(plan.path.quaternion[0]).as_matrix()
        now = guide.look(k * step, HandState(hand, rotation, velocity), round(1e9 * k * step))
        said.append(now)
        hand = now.reference.position if moves else hand
    return said


@pytest.mark.parametrize("told", [(), (Event("close", 5.0), Event("open", 6.9))])
def test_a_hand_that_is_held_makes_the_plan_wait(told):
    rng = np.random.default_rng(0)
    drawn = [show(rng, draw_body(rng), told=told, name=f"shown_{k}", way=2.0) for k in range(3)]
    learned = LearnedSkill(touch("dmp"), [replace(one, skill="touch") for one in drawn])
    plan = learned.plan(situation_of(draw_body(rng)))
    free, held = (
        looked(CarefulGuide(plan, 0.05), plan, until) for until in ((9.0, 9.0), (0.6, 1.6))
    )
    times = np.array([[now.time for now in said] for said in (free, held)])
    assert times[0, 375] == pytest.approx(1.5, abs=0.01), "a free hand goes as was shown"
    assert np.ptp(times[1, 150:400]) < 0.15, "a second that it is held for"
    waited = held[390].reference
    assert np.linalg.norm(waited.attractor_position - waited.position) < 0.002, "and not pulled on"
    assert held[-1].time >= plan.end and not any(now.fault for now in held)
    assert [now.grip for now in held if now.grip != Grip.UNSPECIFIED][:1] == [
        one.grip for one in plan.events
    ][:1]


def test_what_a_hand_carries_into_its_goal_may_be_felt_there(shown):
    learned = LearnedSkill(touch("dmp"), shown)
    path = learned.plan(situation_of(draw_body(np.random.default_rng(1)))).path
    near = np.linalg.norm(path.position - path.position[-1], axis=1) < 0.1
    fast = np.linalg.norm(path.velocity[:, :3], axis=1) > 0.01
    for held in (False, True):
        pace = learned.encoded.pace(path, np.full(len(path.time), held))
        waits = pace.gain.any(1)
        assert waits[fast & ~near].all() and waits[fast & near].all() != held


# bodies that move


class Chase(Follow):
    """The same body, which drives."""

    bodies_move = True


@pytest.fixture(scope="module", params=BOTH)
def chasing(request):
    rng = np.random.default_rng(0)
    drawn = [
        show_truck(rng, Truck(rng), told=(Event("open", 6.8),), name=f"shown_{k}")
        for k in range(4)
    ]
    settings = SkillSettings(representation=request.param, components=16, settle=0.3)
    return LearnedSkill(Chase(settings), drawn)


def beside(truck, time, hand):
    return np.linalg.norm(hand[-1] - truck.at(time[-1]) - [0.0, 0.0, 0.05])


def test_the_hand_comes_to_a_body_that_moves(chasing):
    truck = Truck(np.random.default_rng(10), size=1.5)
    time, hand, _, told = carry_out(chasing.policy.guide(), truck)
    assert told[-1].over and beside(truck, time, hand) < 0.004


def test_the_movement_waits_for_a_hand_that_is_held_while_the_body_goes_on(chasing):
    truck = Truck(np.random.default_rng(10))
    free = carry_out(chasing.policy.guide(), truck)
    time, hand, _, told = carry_out(chasing.policy.guide(), truck, held=(0.8, 1.8))
    assert time[-1] - free[0][-1] == pytest.approx(1.0, abs=0.3)
    assert told[-1].over and beside(truck, time, hand) < 0.004


def test_the_model_goes_to_the_commander_as_bytes_to_the_last_bit(chasing):
    data = chasing.policy.to_bytes()
    policy = Policy.from_bytes(data, Chase())
    assert policy.skill.settings == chasing.skill.settings and len(data) < 200_000
    truck = Truck(np.random.default_rng(10))
    here, there = (carry_out(one.guide(), truck) for one in (chasing.policy, policy))
    for one, other in zip(here[:3], there[:3], strict=True):
        assert np.array_equal(one, other)


def test_the_hand_that_must_turn_needs_the_primitive_of_poses():
    class Turns(Chase):
        turns_hand = True

    settings = SkillSettings(components=16)
    assert "pose_dmp" in part_names("representation", Turns(settings))
    assert "dmp" not in part_names("representation", Turns(settings))
    assert "keep the orientation" in VectorPrimitive.refusal(Turns(settings))
