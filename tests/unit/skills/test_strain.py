"""What was shown at a limit of the arm is said when it was shown, listed, and named by lessons and
refusals.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import ArmModel, the_arm
from dart_skill.common.configuration import load_yaml
from dart_skill.recording import read_demonstrations
from dart_skill.skills.learning import NoPlan, strain
from dart_skill.skills.practice import Learner
from dart_skill.skills.protocol import load_skill
from tests.paths import BAGS

THROW = load_skill("throw")
FASTEST = the_arm().of_joints("no_load_speed")


@pytest.fixture(scope="module")
def shown():
    return read_demonstrations(BAGS / "demonstrations")


def at_release(one, joint, angle=None, speed=None):
    """The same with one joint elsewhere, or faster, for the last 50 ms before the hand opens."""
    q, qd = one.joint_position.copy(), one.joint_velocity.copy()
    last = (one.joint_time > one.opened - 0.05) & (one.joint_time <= one.opened)
    if angle is not None:
        q[last, joint] = angle
    if speed is not None:
        qd[last, joint] = speed
    return replace(one, joint_position=q, joint_velocity=qd)


def reach(angle):
    """Distance of the hand from the shoulder with the elbow at an angle [m]."""
    d = the_arm()
    hand = ArmModel().hand_pose(np.array([0.0, 0.0, 0.0, angle, 0.0, 0.0, 0.0]))[0]
    return np.linalg.norm(hand - [0.0, 0.0, d.mount_height + d.shoulder_height])


STRETCHED = max(np.linspace(-0.3, 0.3, 601), key=reach)
"""Angle of the elbow of the stretched arm [rad]."""


def test_what_was_shown_well_came_to_no_limit(shown):
    assert [strain(THROW, one) for one in shown] == [""] * len(shown)
    blind = replace(
        shown[0],
        joint_time=np.empty(0),
        joint_position=np.empty((0, 7)),
        joint_velocity=np.empty((0, 7)),
    )
    assert strain(THROW, blind) == ""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"joint": 3, "angle": STRETCHED}, "the arm was stretched, 0.0 cm from its full reach"),
        ({"joint": 1, "angle": 1.97}, "wam_j2 was 0.03 rad from its end"),
        ({"joint": 3, "speed": -0.95 * FASTEST[3]}, "wam_j4 was at 95 % of its motor's highest"),
    ],
)
def test_each_limit_is_told_with_what_to_do(shown, change, said):
    told = strain(THROW, at_release(shown[0], **change))
    assert said in told and ": " in told, told


def test_after_the_ball_has_gone_an_arm_may_stretch(shown):
    one = shown[0]
    q = one.joint_position.copy()
    q[one.joint_time > one.opened + 0.1, 3] = STRETCHED
    assert strain(THROW, replace(one, joint_position=q)) == ""


@pytest.fixture
def lesson(shown, monkeypatch):
    """A learner, and what it said of four throws of which two were shown with a straight elbow."""
    parameters = load_yaml("skill_learner.yaml")["skill_learner"]["ros__parameters"]
    bad = {shown[1].id, shown[2].id}

    def of(skill, one):
        return "the arm was stretched" if one.id in bad else ""

    for place in ("practice._learner", "learning._strain"):
        monkeypatch.setattr(f"dart_skill.skills.{place}.strain", of)
    learner = Learner(THROW, lambda: parameters)
    return learner, learner.learn(shown[:4])


def test_lists_mark_what_was_shown_at_a_limit_and_lessons_name_it(shown, lesson):
    """Four of four were accepted with a straight elbow: 'learned from 4', and nothing else."""
    learner, told = lesson
    assert learner.finding(shown[1]).endswith("; the arm was stretched")
    assert "stretched" not in learner.finding(shown[0])
    (fact,) = [one for one in told.facts if "at a limit of the arm" in one]
    assert f"{shown[1].id} (the arm was stretched), {shown[2].id} (the arm was stretched)" in fact
    assert len(told.learned_from) == 4, "they are learned from nevertheless"


def test_a_refusal_names_the_demonstrations_to_drop(shown, lesson, monkeypatch):
    """'Choose a nearer target' did not help at 1.54 m."""
    learner, _ = lesson
    target = THROW.at(np.array([1.9, 0.1, 0.4]))
    learner.plan(target)
    monkeypatch.setattr("dart_skill.arm._plan_checks.STRETCHED", 0.4)
    with pytest.raises(NoPlan) as refusal:
        learner.plan(target)
    assert "m from the shoulder" in str(refusal.value) and "nearer" not in str(refusal.value)
    assert f"({shown[1].id}, {shown[2].id})" in str(refusal.value)
    learner.learn([shown[0], *shown[3:6]])
    learner.plan(target)  # nothing to name: the commander refuses it
