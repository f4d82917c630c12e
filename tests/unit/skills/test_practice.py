"""The memory of practice: trials relabelled with where they landed, strange ones kept out, a full
memory that forgets.
"""

import re
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from dart_skill.session import Session
from dart_skill.simulation import Swing
from dart_skill.skills.learning import DEFAULT, learn_throwing, prepare
from dart_skill.skills.practice import PracticeSettings, TrialMemory
from tests.throw_demonstrations import changed_throw


def trial_like(demonstration, name, **changes):
    return changed_throw(demonstration, id=name, **changes)


def bulged(demonstration, name, size):
    """The same throw and flight, but hand and ball swerve sideways on the way to the release."""

    def moved(time, position):
        share = np.clip(
            (time - demonstration.motion_start)
            / (demonstration.opened - 0.15 - demonstration.motion_start),
            0.0,
            1.0,
        )
        return position + size * np.sin(np.pi * share)[:, None] ** 2 * np.array([0.0, 1.0, 0.0])

    hand = moved(demonstration.hand_time, demonstration.hand_position)
    ball = moved(demonstration.moved.time, demonstration.moved.position)
    nobody = {
        "joint_time": np.empty(0),
        "joint_position": np.empty((0, 7)),
        "joint_velocity": np.empty((0, 7)),
    }
    # joints would say that it did not
    return changed_throw(demonstration, id=name, hand_position=hand, ball_position=ball, **nobody)


def test_a_trial_is_a_demonstration_of_where_it_landed(demonstrations):
    """The basket stood elsewhere: with the place where the ball came down the trial is as good as
    any.
    """
    aimed_wrong = trial_like(
        demonstrations[0], "trial_1", target=demonstrations[0].target + [0.3, 0.2, 0.0]
    )
    practice = TrialMemory(demonstrations[1:])
    assert practice.add(aimed_wrong).kept
    skill, expected = practice.learn(), learn_throwing([*demonstrations[1:], demonstrations[0]])
    target = demonstrations[2].target
    np.testing.assert_array_equal(
        skill.plan(target).path.position, expected.plan(target).path.position
    )


def test_a_trial_like_the_others_is_kept(demonstrations):
    practice = TrialMemory(demonstrations[:-1])
    verdict = practice.add(trial_like(demonstrations[-1], "trial_1"))
    assert verdict.kept and not verdict.reason and not practice.kept_out
    assert [one.id for one in practice.demonstrations][-1] == "trial_1"


def test_a_trial_that_does_not_resemble_the_demonstrations_is_kept_out_and_reported(
    demonstrations,
):
    practice = TrialMemory(demonstrations)
    verdict = practice.add(bulged(demonstrations[3], "trial_1", 0.15))
    assert (
        not verdict.kept
        and "trial trial_1 does not resemble" in verdict.reason
        and "strays" in verdict.reason
    )
    assert practice.kept_out == {"trial_1": verdict.reason}
    assert len(practice.demonstrations) == len(demonstrations)
    assert practice.add(bulged(demonstrations[3], "trial_2", 0.003)).kept, (
        "a small swerve is no crime"
    )


@pytest.fixture(scope="module")
def from_below():
    """Three throws that begin lower than the teacher's usual ones, at other distances."""
    with closing(Session(1, swing=Swing(cocked=(-1.6, -0.75, -0.6)))) as session:
        shown = [
            session.teach(np.array([x, 0.2, 0.4]), attempts=1)[-1].demonstration
            for x in (1.6, 1.85, 2.2)
        ]
    return [replace(one, id=f"below_{k}") for k, one in enumerate(shown)]


def test_two_ways_of_throwing_are_said(demonstrations, from_below):
    assert (
        TrialMemory(demonstrations).patterns() == "" and TrialMemory(from_below).patterns() == ""
    )
    groups = "; ".join(", ".join(one.id for one in way) for way in (demonstrations, from_below))
    assert (
        TrialMemory([*demonstrations, *from_below]).patterns()
        == f"2 ways of throwing were shown, and learned as one: {groups}"
    )


def test_another_way_at_far_baskets_alone_may_be_for_the_distance(demonstrations, from_below):
    near = [one for one in demonstrations if np.linalg.norm(one.target[:2]) < 1.95]
    far = [one for one in from_below if np.linalg.norm(one.target[:2]) > 1.95]
    again = [trial_like(one, f"{one.id}_again") for one in (*near, *far)]
    assert TrialMemory([*near, *far, *again]).patterns() == ""


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda d: changed_throw(
                d, id="t", ball_time=d.moved.time[:5], ball_position=d.moved.position[:5]
            ),
            "no free flight|ball",
        ),
        (
            lambda d: changed_throw(d, id="t", hand_position=d.hand_position + [0.0, 0.0, 0.5]),
            "did not start in this hand",
        ),
        (lambda d: d, "already"),
    ],
)
def test_a_trial_that_cannot_be_read_is_kept_out_with_the_reason(demonstrations, spoil, message):
    practice = TrialMemory(demonstrations)
    verdict = practice.add(spoil(demonstrations[2]))
    assert not verdict.kept
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(verdict.reason)
    assert len(practice.demonstrations) == len(demonstrations)


def filled(demonstrations, trials=5, **settings):
    """Four shown, the rest tried one by one; practice and what each trial pushed out."""
    practice = TrialMemory(
        demonstrations[:4], DEFAULT, PracticeSettings(largest_deviation=1e3, **settings)
    )
    return practice, [
        practice.add(trial_like(demonstrations[k % 4], f"trial_{k}")).forgotten
        for k in range(trials)
    ]


def test_a_full_memory_forgets_the_oldest_trial_and_no_demonstration(demonstrations):
    practice, forgotten = filled(demonstrations, capacity=6)
    assert forgotten == [(), (), ("trial_0",), ("trial_1",), ("trial_2",)]
    assert [one.id for one in practice.demonstrations] == [
        *(one.id for one in demonstrations[:4]),
        "trial_3",
        "trial_4",
    ]


def test_a_memory_smaller_than_what_was_shown_forgets_it_in_the_end(demonstrations):
    practice, _ = filled(demonstrations, capacity=3)
    assert [one.id for one in practice.demonstrations] == [
        demonstrations[2].id,
        demonstrations[3].id,
        "trial_4",
    ]


def test_crowded_forgetting_keeps_the_region_covered(demonstrations):
    order = np.argsort([np.hypot(*one.target[:2]) for one in demonstrations])
    near, far = demonstrations[order[0]], demonstrations[order[-1]]
    practice = TrialMemory(
        demonstrations[:4],
        DEFAULT,
        PracticeSettings(capacity=7, forget="crowded", largest_deviation=1e3),
    )
    for name, one in (("far_1", far), ("near", near), ("far_2", far)):
        assert not practice.add(trial_like(one, name)).forgotten
    assert practice.add(trial_like(far, "far_3")).forgotten == ("far_1",), (
        "there were two more of its kind"
    )


def test_darts_that_meet_the_board_above_each_other_are_no_crowd(demonstrations, monkeypatch):
    """The place of a task has three coordinates: those of a board differ in the second and third."""
    heights = {"trial_0": 0.0, "trial_1": 0.5, "trial_2": 0.6}

    def prepared(one, configuration):
        return replace(
            prepare(one, configuration), task=np.array([2.37, 0.0, heights.get(one.id, 9.0)])
        )

    monkeypatch.setattr("dart_skill.skills.practice._memory.prepare", prepared)
    practice, forgotten = filled(demonstrations, capacity=6, forget="crowded", trials=3)
    assert forgotten == [(), (), ("trial_1",)]


def test_without_a_limit_nothing_is_forgotten(demonstrations):
    practice, forgotten = filled(demonstrations)
    assert forgotten == [()] * 5 and len(practice.demonstrations) == 9


def test_bad_settings_are_named():
    for settings, message in (
        ({"capacity": -1}, "capacity"),
        ({"forget": "all"}, "oldest, crowded"),
        ({"largest_deviation": 0.0}, "positive"),
    ):
        with pytest.raises(ValueError, match=message):
            PracticeSettings(**settings)


def test_a_trial_that_cannot_be_learned_from_is_taken_back_and_may_be_tried_again(demonstrations):
    practice = TrialMemory(demonstrations[:-1])
    trial = trial_like(demonstrations[-1], "trial_1")
    practice.add(trial)
    practice.withdraw("trial_1", "no covariance")
    assert practice.demonstrations == demonstrations[:-1] and practice.kept_out == {
        "trial_1": "no covariance"
    }
    assert practice.add(trial).kept


def test_demonstrations_that_cannot_be_read_are_left_out_by_name_and_the_rest_are_learned(
    demonstrations,
):
    blind = changed_throw(
        demonstrations[1], id="blind", ball_time=np.empty(0), ball_position=np.empty((0, 3))
    )
    elsewhere = changed_throw(
        demonstrations[2],
        id="elsewhere",
        hand_position=demonstrations[2].hand_position + [0.0, 0.0, 0.5],
    )
    practice = TrialMemory([demonstrations[0], blind, elsewhere, *demonstrations[3:]])
    assert (
        practice.learn().model_id
        == learn_throwing([demonstrations[0], *demonstrations[3:]]).model_id
    )
    assert set(practice.kept_out) == {"blind", "elsewhere"}
    assert (
        "blind" in practice.kept_out["blind"]
        and "did not start in this hand" in practice.kept_out["elsewhere"]
    )


def test_where_too_few_can_be_read_all_reasons_are_told(demonstrations):
    broken = [
        changed_throw(one, id=f"broken_{k}", hand_position=one.hand_position + [0.0, 0.0, 0.5])
        for k, one in enumerate(demonstrations[:3])
    ]
    with pytest.raises(ValueError, match="only 1 demonstration.*broken_0.*broken_1"):
        TrialMemory([demonstrations[3], *broken[:2]]).learn()


def test_a_delay_that_no_hand_can_have_is_none(demonstrations):
    """Clocks that disagree, or a button pressed seconds before: such a number never reaches a
    plan.
    """
    one = demonstrations[0]
    for off in (-0.2, 0.1, 1.0):
        odd = changed_throw(one, hand_opened=one.opened - off)
        seen = prepare(odd, DEFAULT).hand_delay
        assert (0.0 <= seen <= 0.3) if off == 0.1 else np.isnan(seen)
    skill = learn_throwing(
        [changed_throw(one, hand_opened=one.opened + 0.2) for one in demonstrations]
    )
    plan = skill.plan(demonstrations[2].target)
    assert skill.hand_delay == 0.0 and plan.open_hand == pytest.approx(plan.release)


POISON = {
    "joints in reverse order": (
        lambda d: {"joint_position": d.joint_position[:, ::-1]},
        "by its joints the hand moved otherwise",
    ),
    "joints that never moved": (
        lambda d: {"joint_position": 0.0 * d.joint_position},
        "by its joints the hand moved otherwise",
    ),
    "motion nobody knows of": (
        lambda d: {"motion_start": np.nan, "motion_stop": np.nan},
        "its motion is from nan",
    ),
    "motion before it was recorded": (
        lambda d: {"motion_start": -100.0},
        "its motion is from -100",
    ),
    "a ball that stayed for minutes": (
        lambda d: {"ball_time": d.moved.time + 100.0},
        "occluded|no hand samples",
    ),
}


@pytest.mark.parametrize("kind", POISON)
def test_a_poisoned_demonstration_is_named_and_the_others_are_learned_from(demonstrations, kind):
    spoil, reason = POISON[kind]
    bad = changed_throw(demonstrations[0], id="bad", **spoil(demonstrations[0]))
    practice = TrialMemory([*demonstrations, bad])
    assert list(practice.kept_out) == ["bad"] and re.search(reason, practice.kept_out["bad"])
    assert practice.learn().model_id == learn_throwing(demonstrations).model_id


def test_a_demonstration_without_joints_takes_no_posture_away(demonstrations):
    nobody = {
        "joint_time": np.empty(0),
        "joint_position": np.empty((0, 7)),
        "joint_velocity": np.empty((0, 7)),
    }
    skill = learn_throwing(
        [*demonstrations, changed_throw(demonstrations[0], id="unseen", **nobody)]
    )
    assert np.isfinite(skill.plan(demonstrations[2].target).start_posture).all()


def test_the_posture_has_a_name_of_its_own(demonstrations):
    """The name of a model leaves out what does not change the movement: from where it starts."""
    moved = [
        replace(one, joint_position=one.joint_position + [0, 0, 0, 0, 0, 0, 0.01])
        for one in demonstrations
    ]
    first, second = learn_throwing(demonstrations), learn_throwing(moved)
    assert first.model_id == second.model_id and first.posture_id != second.posture_id
    assert first.posture_id == learn_throwing(demonstrations).posture_id
