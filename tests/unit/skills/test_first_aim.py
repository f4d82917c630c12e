"""Where the search for an aim begins: exact for what is a parabola, and near for throws that were
learned.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.skills.learning import (
    AIM_TOLERANCE,
    DEFAULT,
    FirstAim,
    ThrowingSkill,
    Unreachable,
    configuration,
    learn_throwing,
)
from tests.throw_demonstrations import changed_throw


def landing(aim):
    """Reach and azimuth at which throws come down, such that the aim's reach and azimuth are a
    parabola in them.
    """
    reach = np.sqrt(4.0 + (aim[0] - 1.0) / 0.1) - 2.0  # aim = 1 + 0.4 reach + 0.1 reach^2
    return np.array([reach, aim[1] + 0.02 - 0.01 * reach + 0.003 * reach**2])


def of_three(reaches=(1.2, 1.5, 1.9), azimuth=0.3):
    aims = np.array([[reach, azimuth] for reach in reaches])
    return FirstAim.of(aims, np.array([landing(aim) for aim in aims]))


@pytest.mark.parametrize("target", [(0.5, 0.1), (1.1, -0.4), (1.6, 0.0)])
def test_it_is_exact_where_the_throws_follow_parabolas(target):
    aim, slope = of_three().at(np.array(target))
    np.testing.assert_allclose(landing(aim), target, atol=1e-12)
    steps = 1e-6 * np.eye(2)
    numeric = np.stack(
        [(landing(aim + step) - landing(aim - step)) / 2e-6 for step in steps], axis=1
    )
    np.testing.assert_allclose(slope, numeric, atol=1e-8)


def test_there_is_none_where_a_farther_aim_does_not_lead_farther():
    aims = np.array([[1.2, 0.0], [1.5, 0.0], [1.9, 0.0]])
    assert FirstAim.of(aims, aims[[0, 2, 1]]) is None
    assert FirstAim.of(aims[[0, 0, 1]], aims) is None
    assert of_three().at(np.array([-2.5, 0.0])) is None  # beyond the vertex


@pytest.fixture
def throws_tried(monkeypatch):
    """Tasks of the throws that skills have worked out."""
    tried, work = [], ThrowingSkill.throw_for
    monkeypatch.setattr(
        ThrowingSkill,
        "throw_for",
        lambda self, task, *model: tried.append(task) or work(self, task, *model),
    )
    return tried


@pytest.mark.parametrize("name", ["default", "intervals"])
def test_after_the_first_plan_of_a_model_the_first_aim_nearly_always_hits(
    demonstrations, throws_tried, name
):
    skill, shown = (
        learn_throwing(demonstrations, configuration(name)),
        np.array([one.target for one in demonstrations]),
    )
    reaches = np.hypot(*shown[:, :2].T)
    for k, (reach, azimuth) in enumerate(
        zip(np.linspace(reaches.min(), reaches.max(), 7), np.linspace(-0.4, 0.4, 7), strict=True)
    ):
        before = len(throws_tried)
        plan = skill.plan(
            np.array([reach * np.cos(azimuth), reach * np.sin(azimuth), shown[0, 2]])
        )
        assert len(throws_tried) - before <= (3 if k == 0 else 0) + 2
        assert np.abs(np.hypot(*plan.thrown.landing[:2]) - reach) < AIM_TOLERANCE


def test_a_plan_does_not_depend_on_the_plans_before(demonstrations):
    """Not to the last bit: what three throws tell is of the model, and not of what was asked
    first.
    """
    skill, fresh = learn_throwing(demonstrations), learn_throwing(demonstrations)
    targets = [one.target for one in demonstrations[:3]]
    for target in targets:
        skill.plan(target)
    np.testing.assert_array_equal(
        skill.plan(targets[0]).thrown.aim, fresh.plan(targets[0]).thrown.aim
    )
    later = learn_throwing(demonstrations).releasing(0.004)
    np.testing.assert_array_equal(
        skill.releasing(0.004).plan(targets[1]).thrown.aim, later.plan(targets[1]).thrown.aim
    )


def test_without_it_the_search_begins_at_the_target(demonstrations, monkeypatch):
    """And comes to the same aim, but for the tolerance of both."""
    target = demonstrations[0].target
    known = learn_throwing(demonstrations).plan(target)
    monkeypatch.setattr(FirstAim, "of", lambda *_: None)
    np.testing.assert_allclose(
        learn_throwing(demonstrations).plan(target).thrown.aim,
        known.thrown.aim,
        atol=4 * AIM_TOLERANCE,
    )
    local = learn_throwing(demonstrations, replace(DEFAULT, width=0.25))
    assert local.refinement._first_aim(local, target) is None


def test_demonstrations_at_one_place_tell_no_first_aim(demonstrations, throws_tried):
    """And no throw is worked out for it."""
    one = demonstrations[0]
    skill = learn_throwing(
        [one, changed_throw(one, id="another", hand_position=one.hand_position + 1e-6)]
    )
    assert skill.refinement._first_aim(skill, one.target) is None and not throws_tried


def test_a_first_aim_that_has_no_throw_is_left_for_the_target(demonstrations, monkeypatch):
    skill = learn_throwing(demonstrations)
    skill.plan(demonstrations[0].target)  # which tells where to begin
    first, work, refused = [], ThrowingSkill.throw_for, []

    def throw_for(self, task, model=None):
        first.append(task)
        if len(first) == 1:
            refused.append(task)
            raise Unreachable("as if the ball never came down")
        return work(self, task, model)

    monkeypatch.setattr(ThrowingSkill, "throw_for", throw_for)
    target = demonstrations[0].target
    plan = skill.plan(target)
    np.testing.assert_allclose(first[1], target)
    assert refused and np.linalg.norm(plan.thrown.landing - target) < 2 * AIM_TOLERANCE
