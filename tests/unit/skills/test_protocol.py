"""What a skill says of itself, its settings, and where skills of other packages are found."""

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from dart_skill.common.configuration import config_path
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import Event, Track
from dart_skill.simulation import PlantSettings, make_world
from dart_skill.skills.place import PlaceSettings
from dart_skill.skills.protocol import (
    Skill,
    SkillSettings,
    TaskOutcome,
    load_skill,
    settings_file,
    skill_names,
    skill_type,
)
from dart_skill.skills.reach import ReachSettings
from tests.example import EXAMPLE, install_example
from tests.unit.skills.task_demonstrations import body_at, show


@pytest.fixture
def rng():
    return np.random.default_rng(5)


class Touch(Skill):
    """As it comes: nothing but a name and a body."""

    name, bodies = "touch", ("button",)


def random_pose(rng):
    return Pose(
        rng.standard_normal(3), Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat()
    )


def test_what_is_placed_in_a_frame_is_seen_from_there(rng):
    for _ in range(20):
        frame, local = random_pose(rng), random_pose(rng)
        seen = frame.sees(frame.place(local))
        assert seen.position == pytest.approx(local.position) and abs(
            seen.quaternion @ local.quaternion
        ) == pytest.approx(1.0)
        world = frame.position + frame.rotation @ local.position
        assert frame.place(local).position == pytest.approx(world)
        assert frame.place(local).rotation == pytest.approx(frame.rotation @ local.rotation)


@pytest.mark.parametrize(
    ("pose", "said"),
    [((np.zeros(2),), "position"), ((np.zeros(3), np.zeros(4)), "no orientation")],
)
def test_a_pose_that_is_none_is_refused(pose, said):
    with pytest.raises(ValueError, match=said):
        Pose(*pose)


def test_a_body_that_nobody_knows_of_is_named():
    with pytest.raises(ValueError, match="where is the holder.*only where hand is"):
        Situation({"hand": Pose(np.zeros(3))}).pose("holder")


def test_a_body_is_where_it_was_just_before_an_instant(rng):
    demonstration = show(rng, body_at(0.6, 0.1, 0.3))
    pose = demonstration.track("button").pose_at(5.0)
    assert pose.position == pytest.approx([0.6, 0.1, 1.15], abs=2e-4)
    assert Rotation.from_quat(pose.quaternion).as_rotvec() == pytest.approx([0.0, 0.0, 0.3])
    with pytest.raises(ValueError, match="the lid was never seen; tracked were button, hand"):
        demonstration.track("lid")


def test_a_movement_lies_between_thresholds_where_the_fingers_were_told_nothing(rng):
    start, stop = Touch().cut(show(rng, body_at(0.6, 0.1, 0.3), way=2.0))
    assert 5.0 < start < 5.3 and 6.7 < stop < 7.0


def test_a_movement_lies_between_what_the_fingers_were_told(rng):
    told = (Event("close", 4.9), Event("open", 7.2))
    assert Touch().cut(show(rng, body_at(0.6, 0.1, 0.3), told=told)) == (4.9, 7.2)


def test_a_skill_that_does_not_judge_says_so(rng):
    with pytest.raises(NotImplementedError, match="write Touch.judge"):
        Touch().judge(show(rng, body_at(0.6, 0.1, 0.0)), Situation({}))


def test_the_defaults_are_a_frame_for_the_hand_and_each_body(rng):
    skill = Touch()
    situation = skill.situation(show(rng, body_at(0.6, 0.1, 0.3)), 5.0)
    assert [pose.position.round(2).tolist() for pose in skill.frames(situation)][1] == [
        0.6,
        0.1,
        1.15,
    ]
    assert skill.achieved(None, situation) is situation and list(skill.inputs(situation)) == []
    assert list(skill.inputs(Situation({}, {"weight": 2.0, "depth": 1.0}))) == [1.0, 2.0]
    assert TaskOutcome(True, 0.0).reason == ""


def test_what_is_corrected_moves_in_its_own_axes():
    class Corrected(Touch):
        corrects = "button"

    turned = body_at(0.6, 0.1, np.pi / 2)
    moved = (
        Corrected()
        .corrected(Situation({"button": turned}), np.array([0.01, 0.0, 0.0]))
        .pose("button")
    )
    assert moved.position == pytest.approx([0.6, 0.09, 1.15])
    assert Touch().corrected(situation := Situation({"button": turned}), np.ones(3)) is situation


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("stifness: 3.0", "stifness is no setting; there are representation"),
        ("components: 3.5", "components is 3.5; it must be of type int"),
        ("components: true", "components is True"),
        ("stiffness: -1.0", "stiffness is -1.0; it must be finite and not negative"),
        ("stiffness: .nan", "stiffness is nan"),
        ("components: 0", "components is 0; it must be positive"),
        ("- 1", "holds no mapping"),
        ("a: [", "is no YAML"),
    ],
)
def test_settings_are_strict(tmp_path, content, said):
    path = tmp_path / "skill.yaml"
    path.write_text(content)
    with pytest.raises(ValueError, match=said) as caught:
        SkillSettings.from_file(path)
    assert "skill.yaml" in str(caught.value)


def test_a_whole_number_is_a_length_too(tmp_path):
    path = tmp_path / "skill.yaml"
    path.write_text("stiffness: 300\nseat: [0, 0, 0.1]\n")
    settings = PlaceSettings.from_file(path)
    assert settings.stiffness == 300 and settings.seat == (0, 0, 0.1)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"slowest": 0.0}, "slowest is 0.0; it must be positive"),
        ({"fastest": 0.9}, "either side of 1, the pace that was shown"),
        ({"catch_up": 0.0}, "catch_up is 0.0"),
    ],
)
def test_settings_of_a_reaction_are_checked(changes, said):
    with pytest.raises(ValueError, match=said):
        ReachSettings(**changes)


def test_a_track_is_linear_between_its_samples():
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 0.2]]).as_quat() * [[1.0], [-1.0]]
    track = Track(np.array([1.0, 2.0]), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), turns)
    there = track.resampled(np.array([0.0, 1.5, 9.0]))
    assert there.position == pytest.approx(
        np.array([[0.0, 0.0, 0.0], [0.5, 1.0, 1.5], [1.0, 2.0, 3.0]])
    )
    assert Rotation.from_quat(there.quaternion).as_rotvec()[:, 2] == pytest.approx([0.0, 0.1, 0.2])


@pytest.mark.parametrize(
    "name", [name for name in skill_names() if settings_file(skill_type(name))]
)
def test_every_key_of_a_file_of_settings_is_there_and_explained(name):
    path, kind = config_path(f"skills/{name}.yaml"), skill_type(name)
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    own = yaml.safe_load(path.read_text())
    assert set(own) == set(kind.settings_type.names())
    explained = [line for line in lines if "#" in line or line.startswith("least_demonstrations")]
    assert len(explained) == len(lines)
    assert load_skill(name).settings == kind(kind.settings_type.from_file(path)).settings


def test_a_skill_that_nobody_has_is_named_with_those_there_are():
    with pytest.raises(ValueError, match="no skill 'plaec': choose one of darts, place"):
        load_skill("plaec")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The example package with its metadata, as a development install makes them."""
    return install_example(tmp_path_factory.mktemp("site") / "package")


def test_a_skill_in_somebody_elses_package_works_by_its_name(installed, monkeypatch):
    monkeypatch.syspath_prepend(str(installed))
    assert {"beside", "press", "place", "throw"} <= set(skill_names())
    skill = load_skill("press")
    assert (skill.name, skill.settings.components, skill.settings.stiffness) == ("press", 8, 300.0)
    assert skill.settings.orientation_stiffness == SkillSettings().orientation_stiffness


def test_the_smallest_skill_is_short():
    assert len((EXAMPLE / "somebody_elses_skills" / "press.py").read_text().splitlines()) < 60


def test_a_skill_of_ours_is_found_without_a_look_at_what_is_installed(monkeypatch):
    """Six looks, one for each node, took a sixth of the time in which a graph started."""
    monkeypatch.setattr(
        "dart_skill.skills.protocol._registry.metadata.entry_points",
        lambda **_: pytest.fail("it looked"),
    )
    assert [skill_type(name).name for name in ("darts", "place", "reach", "stir", "throw")] == [
        "darts",
        "place",
        "reach",
        "stir",
        "throw",
    ]


@pytest.mark.parametrize(
    ("module", "said"),
    [
        ("raise RuntimeError('broken')", "cannot be imported: RuntimeError: broken"),
        ("class Thing: ...", "no class derived from dart_skill.skills.protocol.Skill"),
        (
            (
                "from dart_skill.skills.protocol import Skill\nclass Thing(Skill):\n    name ="
                " 'other'"
            ),
            "calls itself 'other'",
        ),
    ],
)
def test_a_skill_that_cannot_be_used_is_refused_with_the_reason(
    tmp_path, monkeypatch, module, said
):
    name = f"broken_{abs(hash(module))}"
    (tmp_path / f"{name}.py").write_text(module)
    (tmp_path / f"{name}-1.0.dist-info").mkdir()
    (tmp_path / f"{name}-1.0.dist-info" / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n"
    )
    (tmp_path / f"{name}-1.0.dist-info" / "entry_points.txt").write_text(
        f"[dart_skill.skills]\nthing = {name}:Thing\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(ValueError, match=said):
        load_skill("thing")


@pytest.mark.parametrize("name", ["throw", "darts", "place", "reach", "stir"])
def test_a_skill_has_the_numbers_of_its_world(name):
    """Else a trial in a situation that it draws itself would be refused."""
    skill = load_skill(name)
    assert set(make_world(skill.world, PlantSettings(), own=skill.world_settings).numbers) <= set(
        skill.numbers
    )


def test_what_a_skill_does_not_have_is_refused():
    reach = load_skill("reach")
    with pytest.raises(ValueError, match="the body 'cups', .* only hand, cup"):
        reach.check_known(["cups"], [])
    with pytest.raises(ValueError, match="the number 'mass', .* only way_x"):
        reach.check_known(["cup"], ["mass"])
    reach.check_known(["cup"], ["mass"], shown=["mass"])
