"""Parts of a skill that its settings choose by name: found, refused with a reason, and of use to
skills that are not throws, darts, place or reach.
"""

import re
from dataclasses import replace
from importlib import metadata

import numpy as np
import pytest

from dart_skill.arm import the_arm, unfollowable
from dart_skill.common.fleet import arm_with, of_nodes, skill_settings
from dart_skill.recording import HAND
from dart_skill.skills.learning import (
    EqualIntervals,
    LearnedSkill,
    NoPlan,
    OnManifold,
    learn,
    save_model,
)
from dart_skill.skills.practice import BootstrapPractice, Learner, Practice, PracticeSettings
from dart_skill.skills.protocol import (
    Part,
    Skill,
    SkillSettings,
    TaskOutcome,
    general_part,
    load_skill,
    part_names,
    part_of,
)
from dart_skill.skills.throw import Throw
from tests.unit.skills.task_demonstrations import GRIP, body_at, draw_body, show, situation_of


class Touch(Skill):
    """The hand ends over a button that stands somewhere."""

    name, bodies, corrects = "touch", ("button",), "button"

    def judge(self, seen, situation):
        local = situation.pose("button").rotation.T @ (
            seen.hand_position[-1] - situation.pose("button").position
        )
        off = float(np.linalg.norm(local - GRIP.position))
        return TaskOutcome(off < 0.01, off, "" if off < 0.01 else "too far", local - GRIP.position)


def touch(kind=Touch, **changes):
    return kind(SkillSettings(**{"components": 6, "stiffness": 300.0} | changes))


@pytest.fixture(scope="module")
def shown():
    rng = np.random.default_rng(0)
    drawn = [show(rng, draw_body(rng), name=f"shown_{k}") for k in range(6)]
    return [replace(one, skill="touch") for one in drawn]


def end_error(plan, situation):
    """How far from the button the hand ends, beside where it was shown to [m]."""
    wanted = situation.pose("button").place(GRIP).position
    return np.linalg.norm(plan.path.position[-1] - wanted)


# by name


@pytest.mark.parametrize("name", ["throw", "darts", "place", "reach", "stir"])
@pytest.mark.parametrize("kind", ["representation", "refinement", "practice", "targets"])
def test_every_part_that_is_offered_can_be_chosen(name, kind):
    skill = load_skill(name)
    names = part_names(kind, skill)
    assert getattr(skill.settings, kind) in names
    for one in names:
        chosen = load_skill(name, changes={kind: one})
        assert issubclass(part_of(chosen, kind), Part)


@pytest.mark.parametrize(
    ("name", "changes", "why"),
    [
        ("place", {"representation": "autonomous"}, "'autonomous' is not for the skill 'place'"),
        ("throw", {"representation": "pose"}, "over the position and two angles"),
        ("darts", {"representation": "dmp"}, "over the position and two angles"),
        ("place", {"refinement": "flight"}, "nothing of it is thrown"),
        ("darts", {"practice": "power"}, "those of baskets"),
        ("reach", {"practice": "power"}, "choose one of bootstrap, none, residual"),
        ("throw", {"targets": "best_aim"}, "choose one of drawn, informative"),
        (
            "place",
            {"representation": "splines"},
            "choose one of autonomous, dmp, dsgmr, intervals",
        ),
        ("place", {"compnents": 8}, "settings of 'place': compnents is no setting"),
        ("place", {"components": "many"}, "components is 'many'; it must be of type int"),
        ("throw", {"prior": 3.0}, "prior is no setting"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_reason(name, changes, why):
    with pytest.raises(ValueError, match=why):
        load_skill(name, changes=changes)


class Splines(EqualIntervals):
    """What another package might register."""


def test_another_package_registers_a_part(shown, monkeypatch):
    point = metadata.EntryPoint("splines", f"{__name__}:Splines", "dart_skill.representations")
    found = metadata.entry_points
    monkeypatch.setattr(
        metadata,
        "entry_points",
        lambda group: [point] if group == point.group else found(group=group),
    )
    skill = touch(representation="splines")
    assert "splines" in part_names("representation", skill)
    assert isinstance(learn(skill, shown).encoded, Splines)
    assert general_part("representation", "splines") is Splines


def test_a_skill_brings_parts_of_its_own(shown):
    class Own(Touch):
        parts = {"representation": {"own": f"{__name__}:Splines"}}

    skill = touch(Own, representation="own")
    assert isinstance(LearnedSkill(skill, shown).encoded, Splines)
    with pytest.raises(ValueError, match="no representation 'own' for the skill 'touch'"):
        part_of(touch(representation="own"), "representation")


def test_a_part_that_cannot_be_imported_is_named():
    class Odd(Touch):
        parts = {"practice": {"odd": "nowhere.at_all:Thing"}}

    with pytest.raises(ValueError, match="practice 'odd' .nowhere.at_all:Thing. cannot be imp"):
        part_of(touch(Odd, practice="odd"), "practice")


def test_settings_of_the_skill_are_told_apart_from_parameters_of_nodes():
    given = ["skill.representation=pose", "mock_optitrack.noise=0.001", "skill.reach=[0.4, 0.7]"]
    assert skill_settings(given) == {"representation": "pose", "reach": [0.4, 0.7]}
    assert of_nodes(given) == ("mock_optitrack.noise=0.001",)
    told = arm_with("ideal", given)
    assert told["mock_optitrack"]["noise"] == 0.001
    assert told["skill_learner"]["skill_settings"] == told["coach"]["skill_settings"] != ""
    with pytest.raises(ValueError, match=r"--set skill.pace: give skill.NAME=VALUE"):
        skill_settings(["skill.pace"])


# representations


@pytest.mark.parametrize("name", ["intervals", "dsgmr", "per_step", "pose"])
def test_each_representation_carries_out_what_was_shown_elsewhere(shown, name):
    learned = LearnedSkill(touch(representation=name), shown)
    rng = np.random.default_rng(21)
    for _ in range(3):
        situation = situation_of(draw_body(rng))
        assert end_error(learned.plan(situation), situation) < 0.01
        mixture = learned.mixture(situation.moved(HAND, learned.start))
        assert mixture.means_.shape == (6, 4) and np.isfinite(learned.bic())
    assert learned.left_out_error() < 0.02


def test_representations_differ_and_are_part_of_the_name_of_a_model(shown):
    models = [LearnedSkill(touch(representation=name), shown) for name in ("intervals", "pose")]
    assert isinstance(models[1].encoded, OnManifold) and models[0].model_id != models[1].model_id
    situation = situation_of(draw_body(np.random.default_rng(3)))
    one, other = (model.plan(situation).path.quaternion for model in models)
    angle = 2.0 * np.arccos(np.minimum(np.abs(np.einsum("ni,ni->n", one, other)), 1.0))
    assert 0.0 < angle.max() < np.deg2rad(3.0)


def test_gains_over_time_come_from_the_manifold_too(shown):
    skill = touch(representation="pose", stiffness_range=(50.0, 800.0))
    plan = LearnedSkill(skill, shown).plan(situation_of(draw_body(np.random.default_rng(3))))
    eigenvalues = np.linalg.eigvalsh(plan.position_gains.stiffness)
    assert eigenvalues.min() > 49.0 and eigenvalues.max() < 801.0
    assert np.ptp(eigenvalues) > 50.0


def test_the_orientation_has_a_stiffness_of_its_own_on_the_manifold_too(shown):
    """(7.20): the softer the spring, the farther its attractor is ahead of the hand."""
    situation, leads = situation_of(draw_body(np.random.default_rng(3))), []
    for stiffness in (100.0, 900.0):
        skill = touch(representation="pose", orientation_stiffness=stiffness)
        plan = LearnedSkill(skill, shown).plan(situation)
        assert plan.orientation_gains.stiffness == stiffness
        dots = np.einsum("ni,ni->n", plan.attractor_quaternion, plan.path.quaternion)
        leads.append(2.0 * np.arccos(np.minimum(np.abs(dots), 1.0)).max())
    assert leads[0] > 1.5 * leads[1] > 0.0


# practice


def parameters(**given):
    none = dict.fromkeys(
        ("components", "stiffness", "orientation_stiffness", "start_speed", "stop_speed"), 0
    )
    rest = {"least_stiffness": 0.0, "most_stiffness": 0.0, "practice_capacity": 0}
    texts = dict.fromkeys(("frames", "configuration", "choose_components", "practice_method"), "")
    return none | rest | texts | {"practice_forget": "oldest"} | given


def test_a_trial_that_succeeded_is_one_more_demonstration(shown, tmp_path):
    skill = touch(practice="bootstrap")
    learner = Learner(skill, parameters)
    learner.learn(shown[:3])
    before = learner.practice.model.model_id
    told = learner.tell(shown[3])
    assert told.kept and told.demonstrations == 4
    after = learner.practice.model.model_id
    assert after == LearnedSkill(learner.skill, shown[:4]).model_id != before
    assert learner.save(tmp_path / "touch.npz") == after
    again = BootstrapPractice.load(tmp_path / "touch.npz", skill)
    assert again.model.model_id == after and again.values()["practised"] == 1


def test_a_full_memory_forgets_the_oldest_trial_and_keeps_what_was_shown(shown):
    practice = BootstrapPractice(touch(), shown[:2], PracticeSettings(capacity=3))
    assert practice.tell(shown[2]).kept and practice.tell(shown[3]).kept
    assert practice.model.ids == tuple(one.id for one in (*shown[:2], shown[3]))


def test_a_memory_that_forgets_by_crowding_is_refused(shown):
    with pytest.raises(ValueError, match="'crowded' is for throws: the skill 'touch' forgets the"):
        BootstrapPractice(touch(), shown[:2], PracticeSettings(forget="crowded"))


def test_a_file_whose_practice_is_damaged_is_refused(shown, tmp_path):
    practice = BootstrapPractice(touch(practice="bootstrap"), shown[:2])
    settings = practice.skill.settings
    save_model(tmp_path / "odd.npz", shown[:2], settings, practice.model.misses, {"n_shown": 7})
    with pytest.raises(ValueError, match="n_shown is 7 of 2 demonstrations"):
        BootstrapPractice.load(tmp_path / "odd.npz", practice.skill)


def test_a_trial_that_failed_shows_nothing_unless_the_skill_says_for_what_it_is_right(shown):
    class Failing(Touch):
        def judge(self, seen, situation):
            return replace(super().judge(seen, situation), success=False, reason="too far")

    practice = BootstrapPractice(touch(Failing), shown[:3])
    told = practice.tell(shown[3])
    assert not told.kept and "does not say for what it is right: too far" in told.message

    class Relabelling(Failing):
        def achieved(self, demonstration, situation):
            return replace(situation)

    practice = BootstrapPractice(touch(Relabelling), shown[:3])
    assert practice.tell(shown[3]).kept


def test_without_practice_trials_change_nothing(shown):
    practice = Practice(touch(practice="none"), shown[:3])
    before = practice.model.model_id
    told = practice.tell(shown[3])
    assert not told.kept and "change nothing" in told.message
    assert practice.model.model_id == before and not practice.model.offset.any()


def test_a_parameter_chooses_the_practice_in_place_of_the_settings(shown):
    learner = Learner(touch(), lambda: parameters(practice_method="bootstrap"))
    learner.learn(shown[:3])
    assert isinstance(learner.practice, BootstrapPractice)
    with pytest.raises(ValueError, match="no practice 'luck' for the skill 'touch'"):
        Learner(touch(), lambda: parameters(practice_method="luck"))


class Coarse(EqualIntervals):
    """A representation that a skill which throws brings along."""

    @classmethod
    def of_throws(cls, settings):
        return super().of_throws(replace(settings, components=5))


@pytest.mark.parametrize(
    "learned", [learn, lambda *given: part_of(given[0], "practice")(*given).model]
)
def test_a_throw_brings_a_representation_of_its_own(demonstrations, learned):
    class Lob(Throw):
        parts = {**Throw.parts, "representation": {"coarse": f"{__name__}:Coarse"}}

    usual = Lob.configured()
    assert "coarse" in part_names("representation", usual)
    skill = usual.with_settings(replace(usual.settings, representation="coarse"))
    model = learned(skill, demonstrations)
    assert model.representation is Coarse
    target = demonstrations[0].target
    assert model.mixture(target).means_.shape[0] == 5
    assert np.linalg.norm(model.plan(target).thrown.landing - target) < 0.01


def test_a_plan_that_the_joints_cannot_follow_is_none(shown):
    """The wrist ran to the end of its range, at more than its motor can."""
    ranges, motors = "ranges do not let the hand follow", r"turns \w+ at .* its motor makes"
    learner = Learner(touch(), parameters)
    learner.learn(shown[:4])
    plan = learner.plan(situation_of(body_at(0.6, 0.1, 0.0))).plan
    with pytest.raises(NoPlan, match=f"({ranges}|{motors}).*: choose a situation nearer to what"):
        learner.plan(situation_of(body_at(0.6, 0.6, 0.0)))
    hasty = replace(plan, path=replace(plan.path, time=0.1 * plan.path.time), end=0.1 * plan.end)
    assert re.search(motors, unfollowable(hasty, the_arm()))
