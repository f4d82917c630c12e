"""Demonstrations as episodes of a LeRobot dataset and back: the skill that they teach is that of
the recording.
"""

import importlib.util
import json
import shlex

import numpy as np
import pytest

from dart_skill.arm import Grip
from dart_skill.cli import main
from dart_skill.recording import HAND, Event, Track, read_demonstrations
from dart_skill.recording.lerobot import DatasetWriter, Feature, read_dataset
from dart_skill.session import (
    Shown,
    ShownSkill,
    demonstration_in_episode,
    features_of,
    frames_of,
    learn_from_bag,
    learn_skill,
    open_dataset,
    read_shown,
    skill_of_dataset,
    write_lerobot,
)
from dart_skill.skills.protocol import load_skill
from tests.recorded_session import THROWN_AT

PICTURES = "observation.images.scene"


@pytest.fixture(scope="module")
def bag(recorded_session):
    return recorded_session[0]


@pytest.fixture(scope="module")
def exported(bag, tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "dataset"
    return path, write_lerobot(bag, path)


@pytest.fixture(scope="module")
def dataset(exported):
    return open_dataset(exported[0])


def test_every_demonstration_is_an_episode_and_what_is_none_is_named(bag, exported, dataset):
    done = exported[1]
    shown = read_demonstrations(bag)
    assert (
        done.ids == tuple(one.id for one in shown) and done.has_commands and done.skill == "throw"
    )
    assert len(dataset.episodes) == 3 and done.n_frames == sum(
        len(episode.time) for episode in dataset.episodes
    )
    assert list(done.left_out.values()) == ["thrown by the arm itself"]
    assert {episode.task for episode in dataset.episodes} == {"throw the ball into the basket"}
    for episode, one in zip(dataset.episodes, shown, strict=True):
        assert episode.time[-1] == pytest.approx(one.moved.time[-1], abs=0.01), (
            "from the cut to the landing"
        )


def test_elements_have_the_values_that_were_recorded(bag, dataset):
    for episode, one in zip(dataset.episodes, read_demonstrations(bag), strict=True):
        within = (episode.time >= one.hand_time[0]) & (episode.time <= one.hand_time[-1])
        for k, axis in enumerate("xyz"):
            recorded = np.interp(episode.time, one.hand_time, one.hand_position[:, k])
            assert (
                np.abs(dataset.column(episode, f"hand.{axis} [m]") - recorded)[within].max() < 1e-3
            )
            assert np.allclose(
                dataset.column(episode, f"basket.{axis} [m]"), one.target[k], atol=3e-3
            )
        recorded = np.interp(episode.time, one.joint_time, one.joint_position[:, 3])
        assert (
            np.abs(dataset.column(episode, "wam_j4.position [rad]") - recorded)[within].max()
            < 2e-3
        )
        assert (
            dataset.column(episode, "hand.seen").min() >= 0.0
            and dataset.column(episode, "hand.seen").mean() > 0.8
        )


def test_the_arm_is_given_the_same_momentum_by_the_actions(bag, dataset):
    """The sum of force times time, of what the person and the controller told the arm."""
    shown = read_shown(bag)
    for episode, one in zip(dataset.episodes, shown.shown, strict=True):
        end_ns = one.stamp_ns + round(1e9 * (episode.time[-1] + 1.0 / dataset.fps))
        told = np.zeros(3)
        for stream in shown.commands:
            inside = (stream.stamp_ns >= one.stamp_ns) & (stream.stamp_ns < end_ns)
            told += stream.rows[inside, :3].sum(axis=0) * 0.002
        actions = np.column_stack([dataset.column(episode, f"force.{axis} [N]") for axis in "xyz"])
        assert np.allclose(
            actions.sum(axis=0) / dataset.fps, told, atol=0.05 + 0.01 * np.abs(told).max()
        )
        assert np.abs(told).max() > 1.0


@pytest.mark.parametrize(
    ("name", "fps", "apart", "late"),
    [("intervals", 100, 5e-4, 1e-3), ("intervals", 50, 3e-3, 2e-3), ("default", 100, 2e-3, 1e-3)],
)
def test_the_dataset_teaches_what_the_bag_teaches(bag, tmp_path, name, fps, apart, late):
    """EM of the default comes to another optimum by as little as the frames move its samples: the
    paths differ by up to 2 mm.
    """
    write_lerobot(bag, tmp_path / "dataset", fps=fps)
    there = open_dataset(tmp_path / "dataset")
    learner, lesson = learn_skill(there, load_skill("throw"), name)
    expected, told = learn_from_bag(bag, configuration=name)
    assert lesson.learned_from == ("episode_0", "episode_1", "episode_2")
    taken = learner.practice.practising.practice.demonstrations
    for one, other in zip(taken, told.learned_from, strict=True):
        since_start = [d.opened - d.motion_start for d in (one, other)]
        assert since_start[0] == pytest.approx(since_start[1], abs=late)
        assert np.allclose(one.target, other.target, atol=1e-4)
    plans = [skill.plan(THROWN_AT) for skill in (learner.practice.practising, expected)]
    instants = np.linspace(-0.2, 0.0, 9)
    ways = [
        np.column_stack(
            [np.interp(instants, p.path.time - p.release, c) for c in p.path.position.T]
        )
        for p in plans
    ]
    assert np.abs(ways[0] - ways[1]).max() < apart


def test_the_instant_at_which_the_hand_was_told_to_open_is_kept(bag, dataset):
    """To the microsecond, at 100 frames a second."""
    for episode, one in zip(dataset.episodes, read_demonstrations(bag), strict=True):
        cut = demonstration_in_episode(dataset, episode, load_skill("throw"))
        assert (cut.stamp_ns - 10**9) * 1e-9 + cut.opened == pytest.approx(one.opened, abs=1e-5)


def test_a_demonstration_is_left_out_and_without_a_word_the_release_is_found_in_the_flight(
    bag, dataset, tmp_path
):
    first = read_demonstrations(bag)[0].id
    done = write_lerobot(bag, tmp_path / "two", without=[first])
    assert len(done.ids) == 2 and done.left_out[first] == "as asked"
    with pytest.raises(ValueError, match="no demonstration 'nobody'"):
        write_lerobot(bag, tmp_path / "none", without=["nobody"])
    with pytest.raises(ValueError, match="no demonstration 'episode_7'"):
        learn_skill(dataset, load_skill("throw"), without=["episode_7"])
    _, lesson = learn_skill(dataset, load_skill("throw"), without=["episode_1"])
    assert lesson.left_out == {"episode_1": "as asked"}
    assert lesson.learned_from == ("episode_0", "episode_2")
    silent = open_dataset(dataset.path).episodes[0]
    silent.frames["action"][:, -1] = 0.0
    one = demonstration_in_episode(dataset, silent, load_skill("throw"))
    assert np.isnan(one.opened) and one.motion_stop > 0.5


def test_a_movement_of_another_skill_comes_back_as_it_was(tmp_path):
    """Bodies, joints and words of a placement, as functions of time that are known."""
    time = np.arange(0.0, 2.001, 0.01)
    unturned = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    way = np.column_stack([0.3 * time, 0.1 * time**2, 1.0 + 0.0 * time])
    tracks = {
        HAND: Track(time, way, unturned),
        "part": Track(time, way - [0.0, 0.0, 0.1], unturned),
    }
    tracks["holder"] = Track(time[:150], np.tile([0.6, 0.0, 1.1], (150, 1)), unturned[:150])
    told = (Event("close", 0.1234), Event("open", 1.7654))
    joints = np.arange(0.0, 2.0, 0.002)
    angles = np.outer(joints, np.arange(1.0, 8.0)) / 10.0
    one = Shown("a", 5 * 10**9, 2.0, tracks, joints, angles, np.ones_like(angles), told)
    shown = ShownSkill(load_skill("place"), (one,), {})
    features = features_of(shown)
    with DatasetWriter(tmp_path / "place", 50, "an_arm", features) as writer:
        writer.add(shown.skill.task, frames_of(one, shown, 50))
    dataset = read_dataset(tmp_path / "place")
    assert (
        skill_of_dataset(dataset).name == "place"
        and dataset.names["action"][0] == "wam_j1.position [rad]"
    ), "nobody recorded commands"
    back = demonstration_in_episode(dataset, dataset.episodes[0], shown.skill)
    assert [word.grip for word in back.events] == [Grip.CLOSE, Grip.OPEN]
    assert np.allclose([word.time for word in back.events], [0.1234, 1.7654], atol=1e-5)
    assert np.allclose(back.hand_position[:, 0], 0.3 * back.hand_time, atol=1e-6)
    assert back.track("holder").time[-1] == pytest.approx(1.5, abs=0.02), (
        "where it was not seen it has no samples"
    )
    assert np.allclose(
        back.joint_position[:, 6], 0.7 * np.minimum(back.joint_time, joints[-1]), atol=1e-5
    )
    action = dataset.episodes[0].frames["action"][:, :7]
    assert np.array_equal(action[:-1], dataset.episodes[0].frames["observation.state"][1:, :7])


def test_what_is_missing_in_a_dataset_of_somebody_else_is_named(dataset, tmp_path):
    shown_by = {key: values for key, values in dataset.episodes[0].frames.items()}
    features = [
        feature
        for feature in features_of_dataset(dataset)
        if feature.key != "observation.environment_state"
    ]
    with DatasetWriter(tmp_path / "less", 100, "an_arm", features) as writer:
        writer.add(
            "throw the ball into the basket",
            {key: shown_by[key] for key in ("observation.state", "action")},
        )
    with pytest.raises(
        ValueError,
        match=(
            r"no element is called 'ball\.x \[m\]' and 6 more, only observation.state: wam_j1.*;"
            r" action"
        ),
    ):
        learn_skill(open_dataset(tmp_path / "less"), load_skill("throw"))
    with DatasetWriter(tmp_path / "other", 100, "an_arm", features) as writer:
        writer.add(
            "fold the towel", {key: shown_by[key] for key in ("observation.state", "action")}
        )
    with pytest.raises(
        ValueError, match="its tasks are 'fold the towel': all episodes need the task of one skill"
    ):
        skill_of_dataset(open_dataset(tmp_path / "other"))


def features_of_dataset(dataset):
    return [Feature(key, names) for key, names in dataset.names.items()]


# commands


@pytest.fixture
def call(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(line):
        try:
            status = main(shlex.split(line))
        except SystemExit as left:
            status = left.code
        return status, *capsys.readouterr()

    return run


def test_the_commands_convert_and_learn(bag, call, tmp_path):
    status, said, _ = call(f"bag convert {bag} --to lerobot --fps 50")
    assert status == 0 and "3 episodes of 'throw'" in said and "frames at 50 per second" in said
    assert said.splitlines()[-1] == "next: dart-skill learn recorded_lerobot"
    status, said, _ = call("learn recorded_lerobot --json")
    assert status == 0 and json.loads(said)["learned_from"] == [
        "episode_0",
        "episode_1",
        "episode_2",
    ]
    assert (tmp_path / "recorded_lerobot_model.npz").is_file()
    status, _, complaint = call("learn recorded_lerobot --with-throws --output other.npz")
    assert status == 1 and "--with-throws is for bags" in complaint


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ("--fps 50", "--fps is for '--to lerobot'"),
        ("--to csv --video", "--video is for '--to lerobot'"),
        ("--to lerobot --fps 0", "fps is 0: give 5 to 1000"),
    ],
)
def test_what_does_not_go_together_is_refused(bag, call, tmp_path, options, complaint):
    status, said, told = call(f"bag convert {bag} {options}")
    assert (status, said) == (1, "") and complaint in told and len(told.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_pyarrow_the_remedy_is_named(bag, call, monkeypatch, tmp_path):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *rest: None if name == "pyarrow" else find(name, *rest),
    )
    status, _, complaint = call(f"bag convert {bag} --to lerobot")
    assert (
        status == 1
        and "pip install 'dart_skill[lerobot]'" in complaint
        and not (tmp_path / "recorded_lerobot").exists()
    )


def test_a_video_has_a_picture_of_each_frame(bag, call, tmp_path):
    av = pytest.importorskip("av")
    pytest.importorskip("pybullet")
    drop = " ".join(f"--without {one.id}" for one in read_demonstrations(bag)[1:])
    status, _, complaint = call(
        f"bag convert {bag} --to lerobot --fps 10 --video --output filmed {drop}"
    )
    assert status == 0, complaint
    info = json.loads((tmp_path / "filmed" / "meta" / "info.json").read_text())
    feature = info["features"][PICTURES]
    assert (
        feature["dtype"] == "video"
        and feature["shape"] == [240, 320, 3]
        and feature["info"]["video.codec"] == "h264"
    )
    with av.open(
        str(
            tmp_path
            / "filmed"
            / info["video_path"].format(video_key=PICTURES, chunk_index=0, file_index=0)
        )
    ) as film:
        pictures = [
            (float(frame.pts * frame.time_base), frame.to_ndarray(format="rgb24"))
            for frame in film.decode(video=0)
        ]
    assert np.allclose(
        [instant for instant, _ in pictures], np.arange(info["total_frames"]) / 10, atol=1e-6
    )
    reds = [
        int(((p[:, :, 0] > 150) & (p[:, :, 1] < 130) & (p[:, :, 2] < 80)).sum())
        for _, p in pictures
    ]
    assert max(reds) > 10, "the ball is in the pictures"
    stats = json.loads((tmp_path / "filmed" / "meta" / "stats.json").read_text())[PICTURES]
    mean = np.mean([picture for _, picture in pictures], axis=(0, 1, 2)) / 255.0
    assert np.shape(stats["mean"]) == (3, 1, 1) and np.allclose(
        np.ravel(stats["mean"]), mean, atol=0.02
    )


def test_an_action_may_be_where_the_hand_is_in_the_next_frame(bag, exported, tmp_path):
    done = write_lerobot(bag, tmp_path / "poses", action="pose")
    poses, commands = open_dataset(tmp_path / "poses"), open_dataset(exported[0])
    assert done.action == "pose" and done.n_frames == exported[1].n_frames
    names = poses.names["observation.state"]
    hand = [names.index(name) for name in poses.names["action"][:7]]
    for one, other in zip(poses.episodes, commands.episodes, strict=True):
        state, action = one.frames["observation.state"], one.frames["action"]
        assert np.array_equal(action[:-1, :7], state[1:, hand])
        assert np.array_equal(action[-1, :7], state[-1, hand])
        assert np.array_equal(state, other.frames["observation.state"])
        assert np.array_equal(action[:, -1], other.frames["action"][:, -1])
    with pytest.raises(ValueError, match="action is 'speed': give commands or pose"):
        write_lerobot(bag, tmp_path / "speed", action="speed")


def test_a_dataset_of_poses_teaches_the_same_throws(bag, exported, tmp_path, capsys):
    arguments = ["bag", "convert", str(bag), "--to", "lerobot", "--action", "pose"]
    assert main([*arguments, "--output", str(tmp_path / "poses")]) == 0
    skill = load_skill("throw")
    shown = [
        demonstration_in_episode(dataset, dataset.episodes[0], skill)
        for dataset in (open_dataset(tmp_path / "poses"), open_dataset(exported[0]))
    ]
    assert np.array_equal(*(one.tracks[HAND].position for one in shown))
    assert shown[0].events == shown[1].events
