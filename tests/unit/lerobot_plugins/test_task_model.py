"""What the policy `dsgmr` learns from a dataset, without lerobot: kinds of elements, task frames,
the models of dart_skill, and what is saved.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.common.situation import Pose
from dart_skill.movement.pose import PoseDSGMR, PoseFrame
from tests.unit.lerobot_plugins.task_models import task_model

POSE = [f"hand.{one}" for one in ("x", "y", "z", "qx", "qy", "qz", "qw")]
CUP = [name.replace("hand", "cup") for name in POSE]
FPS = 50.0


def settings(**changes):
    given = {
        "n_components": 8,
        "n_steps": 60,
        "fps": FPS,
        "state_names": ["q [rad]", *POSE],
        "environment_names": CUP,
        "action_names": [*POSE, "hand.open"],
    }
    return task_model.LearnerSettings(**{**given, **changes})


def turned(degrees):
    return Rotation.from_euler("z", degrees, degrees=True)


def episode(seed, n=90):
    """A hand that goes to a cup, turns as it, and opens."""
    rng = np.random.default_rng(seed)
    cup, turn = rng.normal([0.5, 0.0, 0.2], 0.1), turned(rng.normal(0.0, 30.0))
    start = rng.normal(0.0, 0.01, 3)
    share = np.linspace(0.0, 1.0, n)
    share = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    arc = np.outer(np.sin(np.pi * share), [0.0, 0.0, 0.1])
    position = start + np.outer(share, cup - start) + arc
    quaternion = Slerp([0.0, 1.0], Rotation.concatenate([turned(0.0), turn]))(share).as_quat()
    hand = np.hstack([position, quaternion])
    cups = np.tile(np.concatenate([cup, turn.as_quat()]), (n, 1))
    action = np.column_stack([np.vstack([hand[1:], hand[-1:]]), share > 0.9])
    return task_model.Episode(np.column_stack([share, hand]), cups, action)


@pytest.fixture(scope="module")
def episodes():
    return [episode(seed, 80 + 5 * seed) for seed in range(6)]


def fitted(episodes, **changes):
    return task_model.TaskModel(settings(**changes)).fit(episodes)


def test_elements_are_learned_by_their_kind():
    model = task_model.TaskModel(
        settings(
            state_names=[*POSE, "arm [rad]"],
            action_names=["arm [rad]", *POSE, "hand.open", "force.x [N]", "force.y", "force.z"],
        )
    )
    assert [(part.kind, part.numbers) for part in model.parts] == [
        ("pose", [1, 2, 3, 4, 5, 6, 7]),
        ("coordinates", [0]),
        ("signals", [8, 9, 10, 11]),
    ]


@pytest.mark.parametrize(
    ("told", "names"),
    [
        (["hand.x [m]", "arm [rad]"], ["hand.x", "arm [rad]"]),
        ({"motors": ["a", "b"]}, ["a", "b"]),
        (None, ["0", "1"]),
        (["too few"], ["0", "1"]),
    ],
)
def test_names_are_those_of_the_dataset(told, names):
    features = {"action": {"shape": [2], "names": told}}
    assert task_model.names_of(features, "action") == names
    assert task_model.names_of(features, "observation.state") == []


def test_a_pose_is_learned_as_dart_skill_learns_it(episodes):
    model = fitted(episodes)
    own, shown, frames = PoseDSGMR(8, 400.0), [], []
    duration = np.mean([len(one.action) - 1 for one in episodes]) / FPS
    for one in episodes:
        time = np.linspace(0.0, duration, len(one.action))
        shown.append(own.encode(time, one.action[:, :7]))
        start, cup = one.state[0, 1:], one.environment[0]
        frames.append([PoseFrame(row[:3], row[3:]) for row in (start, cup)])
    own.fit(shown, frames)
    time = np.arange(round(duration * FPS) + 1) / FPS
    pose = own.reproduce(frames[2], time, episodes[2].state[0, 1:], step=1.0 / FPS).pose
    plan = model.plan(episodes[2].state[0], episodes[2].environment[0])
    assert np.array_equal(plan[:, :7], pose) and model.duration == pytest.approx(duration)


@pytest.mark.parametrize("model", task_model.MODELS)
def test_a_movement_ends_at_a_cup_that_stands_elsewhere(episodes, model):
    new = episode(77)
    plan = fitted(episodes, model=model).plan(new.state[0], new.environment[0])
    cup = Pose(new.environment[0, :3], new.environment[0, 3:])
    away, turn = cup.apart(Pose(plan[-1, :3], plan[-1, 3:7]))
    assert away < 0.01 and np.degrees(turn) < 3.0
    opens = np.argmax(plan[:, 7] > 0.5) / len(plan)
    assert opens == pytest.approx(np.argmax(new.action[:, 7]) / len(new.action), abs=0.02)


@pytest.mark.parametrize("model", task_model.MODELS)
def test_places_alone_are_learned_in_frames_too(episodes, model):
    names = POSE[:3]
    learned = fitted(episodes, model=model, action_names=[*names, *("a", "b", "c", "d"), "e"])
    new = episode(78)
    plan = learned.plan(new.state[0], new.environment[0])
    assert [part.kind for part in learned.parts] == ["place", "signals"]
    assert np.linalg.norm(plan[-1, :3] - new.environment[0, :3]) < 0.02


@pytest.mark.parametrize("model", task_model.MODELS)
def test_coordinates_begin_where_the_state_is(episodes, model):
    joints = [f"j{number}" for number in range(8)]
    shown = [task_model.Episode(one.action, one.environment, one.action) for one in episodes]
    learned = fitted(shown, model=model, state_names=joints, action_names=joints)
    start = shown[0].state[0] + 0.05
    plan = learned.plan(start, shown[0].environment[0])
    assert [part.kind for part in learned.parts] == ["coordinates"]
    assert np.abs(plan[0, :3] - start[:3]).max() < 0.02


@pytest.mark.parametrize("model", task_model.MODELS)
def test_what_was_learned_is_kept_to_the_last_bit(episodes, model):
    learned = fitted(episodes, model=model)
    again = task_model.TaskModel.from_bytes(learned.settings, learned.to_bytes())
    situation = episodes[1].state[0], episodes[1].environment[0]
    assert np.array_equal(learned.plan(*situation), again.plan(*situation))
    assert again.to_bytes() == learned.to_bytes()


def test_frames_have_names():
    start, cup = Pose(np.array([0.1, 0.0, 0.0])), Pose(np.array([0.0, 0.5, 0.2]))
    made = task_model.frames_of(
        ["start", "world", "cup", "azimuth:cup", "target:cup"], start, {"cup": cup}, ""
    )
    assert [one.position.tolist() for one in made] == [
        [0.1, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 0.5, 0.2],
        [0.0, 0.0, 0.0],
        [0.0, 0.5, 0.2],
    ]
    assert made[3].rotation[:, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert len(task_model.frames_of([], start, {"cup": cup}, "")) == 2
    with pytest.raises(ValueError, match="no frame 'bowl': there are start, world, cup"):
        task_model.frames_of(["bowl"], start, {"cup": cup}, "")


def test_a_body_in_the_hand_moves_the_frame_of_another_one():
    start, part = Pose(np.array([0.0, 0.0, 1.0])), Pose(np.array([0.01, 0.0, 0.9]))
    cup = Pose(np.array([0.5, 0.0, 0.2]), turned(90.0).as_quat())
    (frame,) = task_model.frames_of(["cup"], start, {"cup": cup, "part": part}, "part")
    # the part is in the cup where the hand is there
    assert frame.place(start.sees(part)).apart(cup)[0] < 1e-12
