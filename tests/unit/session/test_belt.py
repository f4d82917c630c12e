"""A skill that reacts beside a belt: shown, learned, carried out, judged by what the cameras saw."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import ArmModel, Mode
from dart_skill.common.situation import Situation
from dart_skill.experiments.studies.pose_skills import (
    Reached,
    belt_drawn,
    reach_seed,
    reach_table,
    teach_reach,
)
from dart_skill.recording import Demonstration, Track
from dart_skill.session import BeltSession, ReachingPerson
from dart_skill.simulation import Belt, Holder
from dart_skill.skills.execution import BodyMotion
from dart_skill.skills.learning import LearnedSkill, Policy, moving_frames
from dart_skill.skills.reach import Reach

BELT = Belt(begin=(0.6, -0.1, 1.1), way=(0.0, 0.2, 0.0))


@pytest.fixture(scope="module")
def taught():
    """A session of a seed that nothing here was tuned on, and what was learned from four reaches."""
    session = BeltSession(Reach.configured(), seed=41)
    shown = teach_reach(session, np.random.default_rng(41), 4)
    yield session, LearnedSkill(session.skill, shown), shown
    session.close()


def test_a_demonstration_is_cut_where_the_hand_rests_in_a_cup_that_goes_on(taught):
    session, learned, shown = taught
    for one in shown:
        start, stop = session.skill.cut(one)
        assert set(one.tracks) == {"hand", "cup"} and 1.2 < stop - start < 2.2
        assert 0.008 < np.median(np.diff(one.hand_time)) < 0.012
    assert 1.2 < learned.duration < 2.0


@pytest.mark.parametrize("steady", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_hand_reaches_into_cups_on_belts_that_were_not_shown(taught, steady):
    session, learned, _ = taught
    trial = session.execute(learned.policy.guide(), replace(BELT, steady=steady))
    rim, end = session.skill.distances(trial.seen)
    assert trial.outcome.success and not trial.message
    assert rim < 0.01 and end < 0.01 and trial.outcome.error == end


@pytest.mark.slow
def test_a_hand_that_is_held_waits_and_does_not_hurry_after_the_cup(taught):
    session, learned, _ = taught
    guide, holder, phases, speeds = learned.policy.guide(), Holder(), [], []

    def push():
        plant = session.plant
        held = 1.7 <= plant.time < 2.5
        (phases if held else speeds).append(
            guide.phase if held else np.linalg.norm(hand_velocity(plant))
        )
        return holder.push(plant.arm_state, held)

    trial = session.execute(guide, BELT, push)
    assert trial.outcome.success, trial.outcome.reason
    assert len(phases) == pytest.approx(400, abs=2) and np.ptp(phases) < 0.25 * 0.8
    assert max(speeds[-500:]) < 1.2 * max(speeds[:-500])


def hand_velocity(plant):
    return ArmModel().jacobian(np.array(plant.joint_position))[:3] @ plant.state.velocity


@pytest.mark.slow
def test_a_cup_whose_poses_stop_coming_stops_the_motion_and_is_named(taught):
    session, learned, _ = taught
    trial = session.execute(learned.policy.guide(), replace(BELT, tunnel=1.8))
    assert re.match(r"the cup was last seen 0\.1\d s ago: more than 0\.15 s", trial.message)
    assert not trial.outcome.success and session.commander.mode == Mode.HOLDING
    assert session.execute(learned.policy.guide(), BELT).message == "", (
        "and the next one is made as ever"
    )


@pytest.mark.slow
def test_poses_come_as_late_as_the_cameras_deliver_them(taught):
    session, learned, _ = taught
    guide, ages = learned.policy.guide(), []

    def look():
        newest = guide._bodies["cup"].newest_ns
        ages.append((session.plant.state_stamp_ns - newest) * 1e-9)

    session.execute(guide, BELT, look)
    assert min(ages) >= session.capture.config.latency and np.median(ages) < 0.02


@pytest.mark.slow
def test_three_demonstrations_are_enough(taught):
    """Without a prior all of them missed by centimetres: what three have in common by chance was
    taken for certain.
    """
    session, _, shown = taught
    learned = LearnedSkill(session.skill, shown[:3])
    outcomes = [
        session.execute(learned.policy.guide(), replace(BELT, way=way)).outcome
        for way in ((0.0, 0.2, 0.0), (0.05, -0.1, 0.0))
    ]
    assert all(one.success for one in outcomes), [one.reason for one in outcomes]


def test_a_person_who_sees_no_cup_shows_nothing(taught):
    with pytest.raises(ValueError, match="the cup was not seen"):
        ReachingPerson(0).begin(taught[0].plant.arm_state)


# a policy on its way to the commander


@pytest.mark.slow
def test_a_policy_arrives_as_it_was_sent_to_the_last_bit(taught):
    session, learned, _ = taught
    learned.remember(np.array([[0.001, 0.0, 0.002]]))
    policy = Policy.from_bytes(learned.policy.to_bytes(), Reach())
    learned.remember([])
    assert (
        policy.skill.settings == session.skill.settings and policy.events == learned.policy.events
    )
    assert policy.registration == learned.registration and policy.offset == pytest.approx(
        [0.0005, 0.0, 0.001]
    )
    moving = BodyMotion(*np.eye(3) * 0.3, np.array([0.0, 0.0, 0.0, 1.0]), 0.01)
    stiffness = session.skill.settings.stiffness
    at_start = Situation({"hand": learned.start})
    frames = moving_frames(session.skill, at_start, {"cup": moving}, stiffness)
    for phase in (0.0, 0.7, learned.duration):
        for here, there in zip(
            *(
                vars(model.moment(frames, phase)).values()
                for model in (learned.encoded.model, policy.model)
            ),
            strict=True,
        ):
            np.testing.assert_array_equal(here, there)
    assert (
        policy.model.ends == learned.encoded.model.ends
        and policy.start_posture == pytest.approx(learned.policy.start_posture, abs=0.0)
    )
    assert session.execute(policy.guide(), BELT).outcome.success


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "these 0 bytes are not the policy of a skill"),
        (b"PK\x03\x04 nonsense", "are not the policy of a skill"),
        (lambda policy: policy.to_bytes()[:-200], "are not the policy of a skill"),
        (
            lambda policy: replace(policy, skill=Other(policy.skill.settings)).to_bytes(),
            "it is of the skill 'other', not of 'reach'",
        ),
    ],
)
def test_bytes_that_are_no_policy_are_refused(taught, data, said):
    with pytest.raises(ValueError, match=said):
        Policy.from_bytes(data if isinstance(data, bytes) else data(taught[1].policy), Reach())


class Other(Reach):
    name = "other"


# judged by what was seen


def seen(path, turn=0.0, way=(0.0, 0.1, 0.0), until=5.0):
    """A hand that a cup sees along a path: rows of time [s] and place in the cup [m], linear in
    between, smoothed a little.
    """
    time = np.arange(0.0, until, 0.01)
    rows = np.array(path, dtype=float)
    local = np.column_stack([np.interp(time, rows[:, 0], column) for column in rows[:, 1:].T])
    cup = np.outer(time, way) + [0.6, 0.0, 1.1]
    rotation = Rotation.from_rotvec([0.0, 0.0, turn])
    quaternion = np.tile(rotation.as_quat(), (len(time), 1))
    tracks = {
        "hand": Track(time, cup + rotation.apply(local), quaternion),
        "cup": Track(time, cup, quaternion),
    }
    return Demonstration("one", tracks)


def into(x, y=0.0, end=(0.0, 0.0, 0.0)):
    """A path over the rim, past it at (x, y), and on to an end."""
    return [
        (0.0, -0.2, 0.1, 0.2),
        (1.0, -0.2, 0.1, 0.2),
        (2.0, x, y, 0.12),
        (2.5, x, y, 0.06),
        (3.0, *end),
        (9.0, *end),
    ]


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize(
    ("path", "said"),
    [
        (into(0.0), ""),
        (into(0.006, -0.004, (0.003, 0.0, 0.004)), ""),
        (into(0.03), "30 mm from the axis of the cup at its rim"),
        (into(0.0, end=(0.0, 0.015, -0.008)), "ended 17 mm from the middle"),
        (
            into(0.0)[:3] + [(9.0, 0.0, 0.0, 0.12)],
            "did not come into the cup: it was seen last 120 mm above its floor",
        ),
    ],
)
def test_a_reach_is_judged_at_the_rim_and_at_the_end_as_the_cup_sees_it(path, said, turn):
    outcome = Reach().judge(seen(path, turn), Situation({}))
    assert outcome.success == (not said) and bool(said) == bool(outcome.reason)
    assert re.search(said, outcome.reason)


def test_the_distances_are_those_of_the_path():
    rim, end = Reach().distances(seen(into(0.006, -0.008, (0.003, 0.0, 0.004)), 0.3))
    assert rim == pytest.approx(0.01, abs=1e-6) and end == pytest.approx(0.005, abs=1e-6)


def test_a_hand_that_does_not_come_to_rest_in_the_cup_has_not_reached_it():
    outcome = Reach().judge(seen([*into(0.0)[:4], (5.0, 0.2, 0.0, 0.0)]), Situation({}))
    assert (
        not outcome.success
        and np.isnan(outcome.error)
        and "did not come to rest in the cup" in outcome.reason
    )


def test_a_recording_in_which_nothing_moves_is_no_reach():
    still = seen([(0.0, 0.0, 0.0, 0.2), (9.0, 0.0, 0.0, 0.2)], way=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="the hand is never faster than 0.05 m/s"):
        Reach().cut(still)


def test_the_cut_is_from_the_first_movement_to_the_rest_in_the_cup():
    start, stop = Reach().cut(seen(into(0.0), way=(0.0, 0.02, 0.0)))
    assert start == pytest.approx(1.0, abs=0.05) and stop == pytest.approx(3.0, abs=0.05)


def test_a_hand_that_sinks_when_it_is_taken_has_not_begun_to_reach():
    taken = [(0.0, -0.2, 0.1, 0.21), (0.2, -0.2, 0.1, 0.21), (0.3, -0.2, 0.1, 0.2)]
    start, _ = Reach().cut(seen(taken + into(0.0)[1:], way=(0.0, 0.0, 0.0)))
    assert start == pytest.approx(1.0, abs=0.05)


# the experiment


def test_belts_are_drawn_where_the_arm_reaches_them():
    skill, rng = Reach.configured(), np.random.default_rng(0)
    belts = [belt_drawn(skill, rng, wide=True) for _ in range(200)]
    far = [
        np.hypot(*belt.at(belt.start + after)[0][:2])
        for belt in belts
        for after in (0.0, skill.settings.awhile)
    ]
    assert skill.settings.reach[0] < min(far) and max(far) < skill.settings.reach[1]
    assert {belt.steady for belt in belts} == {True, False}
    assert np.abs([belt.way for belt in belts]).max() > 0.22
    assert np.abs([belt_drawn(skill, rng).way for _ in range(50)]).max() < 0.2 + 1e-9, (
        "where it is shown, belts are slower"
    )


def test_how_the_belt_will_run_is_nothing_that_is_learned_from():
    skill = Reach.configured()
    assert skill.draw(np.random.default_rng(0)).numbers and not skill.inputs(
        skill.draw(np.random.default_rng(0))
    )


@pytest.mark.slow
def test_a_seed_is_the_same_each_time():
    first, second = (reach_seed(43, demonstrations=3, cups=1, held=0) for _ in range(2))
    assert repr(first) == repr(second) and len(first) == 1


def test_the_table_counts_and_names_each_failure():
    nan = float("nan")
    free = Reached(0, "free", True, 0.1, True, "", 0.002, 0.004, 0.4, nan)
    missed = replace(
        free,
        success=False,
        reason="the hand ended 12 mm from the middle of the cup",
        end=0.012,
        steady=False,
    )
    held = replace(free, kind="held", crept=0.1, fastest=0.5)
    lost = replace(
        free,
        kind="lost",
        success=False,
        reason="the cup was last seen 0.15 s ago: too long",
        rim=nan,
        end=nan,
    )
    text = reach_table([free, missed, held, lost])
    assert "1 of 2" in text and "8.0   12.0" in text and "goes on by 0.10 s" in text
    assert "1 of 1 stopped because of that" in text
    assert (
        "seed 0, free, a cup from rest to rest of 0.10 m/s: the hand ended 12 mm" in text
        and text.count("seed 0") == 1
    )
    assert "0 of 1" in reach_table([missed]) and "held" not in reach_table([missed])
