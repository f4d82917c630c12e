"""A skill at the bench: shown, learned, carried out, judged by what the cameras saw."""

import re
from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import Command, Grip, Mode
from dart_skill.common.situation import Pose, Situation
from dart_skill.experiments.studies.pose_skills import (
    LostHand,
    Placed,
    Pressing,
    place_seed,
    place_table,
    teach_place,
)
from dart_skill.recording import Demonstration, Event, Track
from dart_skill.session import BenchSession
from dart_skill.simulation import PlantSettings, make_world
from dart_skill.skills.learning import LearnedSkill
from dart_skill.skills.place import Place


@pytest.fixture(scope="module")
def taught():
    """A session of a seed that nothing here was tuned on, and what was learned from three parts."""
    session = BenchSession(Place.configured(), seed=41)
    rng = np.random.default_rng(41)
    shown = teach_place(session, session.skill, rng, 3)
    yield session, LearnedSkill(session.skill, shown), shown, rng
    session.close()


def test_a_demonstration_holds_what_the_cameras_saw_and_what_the_fingers_were_told(taught):
    _, _, shown, _ = taught
    for one in shown:
        assert set(one.tracks) == {"hand", "part", "holder"} and [
            told.grip for told in one.events
        ] == [Grip.CLOSE, Grip.OPEN]
        assert 0.008 < np.median(np.diff(one.hand_time)) < 0.012 and len(one.joint_time) > 300


def test_parts_go_into_holders_that_stand_elsewhere(taught):
    session, learned, _, rng = taught
    trials = []
    for _ in range(2):
        holder = session.skill.draw(rng, wide=True).pose("holder")
        trials.append(session.execute(learned.plan(session.situation(holder))))
    assert all(trial.outcome.success and trial.outcome.error < 0.006 for trial in trials), [
        trial.outcome for trial in trials
    ]


def test_a_part_that_meets_the_rim_goes_in_and_presses_no_harder_than_it_may(taught):
    """The stiff hand of the ideal arm pressed with 45 N."""
    session, learned, _, rng = taught
    seen = session.situation(session.skill.draw(rng).pose("holder"))
    stands = seen.pose("holder")
    beside = Pose(stands.position + [0.003, -0.004, 0.0], stands.quaternion)
    pressing = Pressing(session.plant)
    trial = session.execute(learned.plan(seen.moved("holder", beside)), push=pressing.note)
    assert trial.outcome.success and not trial.message
    assert 5.0 < pressing.most() < session.commander.settings.limits.contact_force


class Gap:
    """A commander that hears no state from one instant to another [s]: the arm is braked."""

    def __init__(self, session, begin, end):
        self.session, self.commander, self.begin, self.end = session, session.commander, begin, end

    def __getattr__(self, name):
        return getattr(self.commander, name)

    def step(self, state):
        since = self.commander.time if self.commander.mode == Mode.EXECUTING else 0.0
        if self.begin is not None and since >= self.begin:
            self.end, self.begin = state.stamp_ns + round(1e9 * self.end), None
        if self.begin is None and state.stamp_ns < self.end:
            return self.session.plant.braking()
        return self.commander.step(state)


def test_a_part_that_is_not_where_the_hand_takes_it_is_not_planned_for(taught):
    """With the part in its holder already, an empty hand went through the motion, and the outcome
    was a success.
    """
    session, learned, _, rng = taught
    seen = session.situation(session.skill.draw(rng).pose("holder"))
    there = session.skill.goal(seen)
    with pytest.raises(ValueError, match=r"the part is 0\.\d+ m from where the hand takes it"):
        learned.plan(seen.moved("part", there))


@pytest.mark.parametrize("gap", [0.15, 0.38])
def test_a_short_gap_in_the_states_makes_a_careful_motion_wait(taught, gap):
    session, learned, _, rng = taught
    plan = learned.plan(session.situation(session.skill.draw(rng).pose("holder")))
    commander, times = session.commander, []
    for begin in (2.0, None):
        session.commander = Gap(session, begin, gap if begin else 0)
        try:
            trial = session.execute(plan)
        finally:
            session.commander = commander
        assert trial.outcome.success and not trial.message
        times.append(np.ptp(trial.seen.hand_time))
        if begin:
            plan = learned.plan(session.situation(plan_holder(trial)))
    assert times[0] - times[1] == pytest.approx(gap, abs=0.1)


def test_cameras_lose_the_hand_near_the_end_of_a_plan_and_find_it_again():
    heard = []

    class Commander:
        def see(self, body, stamp_ns, position, quaternion):
            heard.append((body, stamp_ns))

    eyes = LostHand(Commander(), np.array([0.5, 0.0, 1.0]), 0.3)
    for stamp in range(0, 1_500_000_000, 10_000_000):
        away = 0.5 - 0.5e-9 * stamp
        for body in ("hand", "part"):
            eyes.see(body, stamp, np.array([0.5 - away, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0]))
    stamps = {body: [ns for one, ns in heard if one == body] for body in ("hand", "part")}
    lost = sorted(set(stamps["part"]) - set(stamps["hand"]))
    assert len(stamps["part"]) == 150 and len(lost) == 30
    assert lost[0] == pytest.approx(0.8e9, abs=1.1e7) and np.ptp(lost) == 290_000_000


def plan_holder(trial):
    track = trial.seen.track("holder")
    return Pose(track.position[0], track.quaternion[0])


def test_the_part_and_the_holder_on_the_bench_are_those_of_the_settings():
    """Their size stood in the settings, in the bench and in what viewers show: who changed one of
    them had another part.
    """
    skill = Place(
        replace(
            Place.configured().settings,
            size=(0.04, 0.04, 0.08),
            mass=0.2,
            depth=0.03,
            grasp=(0.0, 0.0, 0.13),
        )
    )
    session = BenchSession(skill)
    bench, world = (
        session.plant.bench,
        make_world(skill.world, PlantSettings(), own=skill.world_settings),
    )
    session.close()
    world.close()
    assert (bench.size, bench.mass, bench.depth, bench.grasp) == (
        (0.04, 0.04, 0.08),
        0.2,
        0.03,
        (0.0, 0.0, 0.13),
    )
    assert world.bench == bench
    floor, *walls = skill.solids("holder")
    assert (
        floor.lengths[0] == pytest.approx(bench.size[0] + 2.0 * (bench.clearance + bench.wall))
        and walls[0].lengths[2] == bench.depth
    )


@pytest.mark.parametrize("message", ["", "the fingers do not answer"])
def test_a_movement_that_takes_too_long_is_given_up_with_what_the_commander_says(
    taught, monkeypatch, message
):
    session, *_ = taught
    monkeypatch.setattr(session, "longest", 0.1)
    monkeypatch.setattr(session.commander, "message", message)
    monkeypatch.setattr(session.commander, "step", lambda state: Command(state.stamp_ns))
    with pytest.raises(ValueError, match=f"look is not over after 0 s: {message or 'holding'}"):
        session.situation(session.skill.draw(np.random.default_rng(0)).pose("holder"))


def test_a_world_without_what_a_skill_says_of_it_names_it():
    with pytest.raises(ValueError, match="world 'bench' has no colour"):
        make_world("bench", PlantSettings(), own={"colour": 1})
    with pytest.raises(ValueError, match="world 'belt' has no mass"):
        make_world("belt", PlantSettings(), own={"mass": 1.0})


@pytest.mark.slow
def test_a_holder_that_is_moved_after_planning_is_missed_and_said_so(taught):
    session, learned, _, rng = taught
    plan = learned.plan(session.situation(session.skill.draw(rng).pose("holder")))
    session.situation(session.skill.draw(rng).pose("holder"))
    trial = session.execute(plan)
    assert not trial.outcome.success and "the part is" in trial.outcome.reason


@pytest.mark.slow
def test_what_the_commander_stops_is_a_failure_with_its_reason(taught):
    session, learned, _, rng = taught
    plan = learned.plan(session.situation(session.skill.draw(rng).pose("holder")))
    # it pulls the hand away from where it is expected
    sinks = np.outer(np.linspace(0.0, 1.2, len(plan.path.time)), [0.0, 0.0, 1.0])
    away = replace(plan, attractor_position=plan.attractor_position + sinks)
    trial = session.execute(away)
    assert not trial.outcome.success and "from the plan" in trial.message
    assert (
        session.execute(
            learned.plan(session.situation(session.skill.draw(rng).pose("holder")))
        ).message
        == ""
    )


def lies_at(local, opened=3.0, until=4.0, drop=0.12):
    """A part that came down along the axis of a holder at the origin to lie at a pose there."""
    time = np.arange(0.0, until, 0.01)
    height = np.interp(time, [0.0, 1.0, 2.0], [drop, drop, 0.0])
    path = local.position + np.outer(height, [0.0, 0.0, 1.0])
    part = Track(time, path, np.tile(local.quaternion, (len(time), 1)))
    still = Track(time, np.zeros((len(time), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)))
    told = (Event("close", 0.5), Event("open", opened))
    seen = Demonstration(
        "one",
        {"hand": still, "part": part, "holder": still},
        events=told,
    )
    return Place().judge(seen, Situation({"holder": Pose(np.zeros(3))}))


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ((0.0, 0.0, 0.05), ""),
        ((0.003, -0.002, 0.051), ""),
        ((0.0, 0.0, 0.09), r"\+40 mm from its seat along the axis"),
        ((0.0, 0.0, -0.4), r"-450 mm from its seat"),
        ((0.02, 0.0, 0.05), "20 mm beside its seat"),
    ],
)
def test_a_part_is_in_where_it_lies_in_its_seat(place, said):
    outcome = lies_at(Pose(np.array(place)))
    assert outcome.success == (not said) and bool(said) == bool(outcome.reason)
    assert outcome.error == pytest.approx(np.linalg.norm(np.array(place) - [0.0, 0.0, 0.05]))
    if said:
        assert re.search(said, outcome.reason)


def test_a_part_that_leans_is_not_in():
    assert (
        "leans by 17 degrees"
        in lies_at(Pose(np.array([0.0, 0.0, 0.05]), np.array([0.0, 0.15, 0.0, 0.9887]))).reason
    )


def test_a_part_that_nobody_sees_afterwards_is_not_in():
    outcome = lies_at(Pose(np.array([0.0, 0.0, 0.05])), opened=3.9)
    assert (
        not outcome.success
        and np.isnan(outcome.error)
        and "not seen after the hand had opened" in outcome.reason
    )


def test_the_miss_is_where_the_part_came_down_and_not_where_it_fell():
    assert lies_at(Pose(np.array([0.004, -0.003, 0.05]))).miss == pytest.approx(
        [0.004, -0.003, 0.0]
    )
    assert np.isnan(lies_at(Pose(np.array([0.2, 0.0, 0.05]))).miss).all()


def test_holders_are_drawn_where_the_arm_reaches_them():
    rng, skill = np.random.default_rng(0), Place.configured()
    (near, far), middle = skill.settings.reach, np.array(skill.settings.shown_at)
    for wide, most in ((False, skill.settings.shown_within), (True, skill.settings.asked_within)):
        places = np.array([skill.draw(rng, wide).pose("holder").position for _ in range(200)])
        away, reach = (
            np.linalg.norm(places[:, :2] - middle, axis=1),
            np.linalg.norm(places[:, :2], axis=1),
        )
        assert 0.8 * most < away.max() < most and near < reach.min() and reach.max() < far
    assert places[:, 2].min() > 1.16 and places[:, 2].max() < 1.2103


@pytest.mark.slow
def test_a_seed_is_the_same_each_time_and_its_table_counts():
    first, second = (place_seed(43, demonstrations=3, parts=1) for _ in range(2))
    assert first == second and len(first) == 1
    placed = [Placed(0, 0.1, 0.5, True, 0.001, ""), Placed(0, 0.2, -0.5, False, 0.04, "it jammed")]
    assert "1 of 2 parts" in place_table(
        placed
    ) and "20 cm away, turned by -29 degrees: it jammed" in place_table(placed)
    assert "0 of 1 parts" in place_table(placed[1:])


@pytest.mark.slow
def test_a_lesson_does_not_make_an_arm_swing_whose_cables_give():
    """The person's wrist is firm, and knows the hand from encoders on the motors' side: it made the
    last joint of this arm swing by a degree, at 24 Hz.
    """
    session = BenchSession(Place.configured(), seed=3000, arm="fleet:3000")
    rng = np.random.default_rng([3000, 7])
    for _ in range(2):
        shown = session.teach(session.skill.draw(rng).pose("holder")).seen
        begins = shown.joint_time < shown.hand_time[0] + 0.8
        shaken = np.diff(shown.joint_position[begins], n=2, axis=0)
        assert np.rad2deg(shaken.std(axis=0)).max() < 0.1
    session.close()
