"""A skill from a recording alone: the demonstrations are those that were recorded, to the last
bit, wherever the poses come from.
"""

import argparse
import importlib.util
import json
import shlex
from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from dart_skill.arm import same_plan
from dart_skill.cli import main
from dart_skill.cli.learn import add_to, file_for
from dart_skill.recording import (
    MARK_TOPIC,
    MARK_TYPE,
    BagReader,
    BagWriter,
    Opening,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    types_for,
    typestore,
)
from dart_skill.recording.imports import mapping_text, with_remedies
from dart_skill.recording.imports.mapping import OWN, PoseSource, parse_mapping
from dart_skill.recording.imports.pose_stream import UP_AXES
from dart_skill.recording.imports.throw_recording import convert, read_recording
from dart_skill.session import (
    NothingLearned,
    ThrowMemory,
    find_throws,
    learn_from_bag,
    learn_skill,
)
from dart_skill.skills.learning import DEFAULT, load_model
from dart_skill.skills.observation import MEMORY_NS, ThrowFinder, ThrowLog
from dart_skill.skills.practice import PractisingSkill
from dart_skill.skills.protocol import load_skill
from tests.paths import ROOT
from tests.recorded_session import THROWN_AT, as_published, same
from tests.throw_demonstrations import changed_throw

BASKET = np.array([1.9, -0.1, 0.4])
ROLES = ("hand", "ball", "basket")


@pytest.fixture(scope="module")
def recording(recorded_session):
    return read_recording(recorded_session[0])


@pytest.fixture(scope="module")
def shown(recorded_session):
    """The demonstrations as they were recorded."""
    return [as_published(trial.demonstration) for trial in recorded_session[1]]


@pytest.fixture(scope="module")
def expected(shown):
    """The plan of the skill that the learner node would have learned."""
    return PractisingSkill(shown).plan(BASKET)


def apart(plan, other):
    """How far two plans' hands are apart at their releases, and their predicted landings [m]."""
    ways = []
    for one in (plan, other):
        since = one.path.time - one.release
        ways.append(
            np.array(
                [np.interp([-0.2, -0.1, 0.0], since, column) for column in one.path.position.T]
            )
        )
    return float(np.abs(ways[0] - ways[1]).max()), float(
        np.linalg.norm(plan.thrown.landing - other.thrown.landing)
    )


# finding throws


def test_every_throw_is_found_to_the_last_bit(recorded_session, recording, shown):
    _, taught, own = recorded_session
    throws = find_throws(recording)
    assert [throw.taught for throw in throws] == [True] * len(taught) + [False]
    for throw, trial in zip(throws, [*taught, own], strict=True):
        assert same(throw.demonstration, trial.demonstration) == ["id"]
        assert throw.outcome.in_basket == trial.outcome.in_basket
        assert throw.outcome.landing_error == pytest.approx(
            trial.outcome.landing_error, abs=1e-3
        ), "the basket as seen, not as ordered"
    for throw, one in zip(throws, shown, strict=False):
        assert same(throw.demonstration, one) == []
    assert throws[-1].demonstration.id == f"demonstration_{throws[-1].stamp_ns}"


def test_a_command_that_is_repeated_is_one_throw(recording):
    twice = tuple(
        one
        for opening in recording.openings
        for one in (opening, replace(opening, stamp_ns=opening.stamp_ns + 2_000_000))
    )
    throws = find_throws(replace(recording, openings=twice))
    for throw, one in zip(throws, find_throws(recording), strict=True):
        assert same(throw.demonstration, one.demonstration) == []


def test_an_opening_without_a_throw_says_why(recording):
    first = int(recording.bodies["hand"].stamp_ns[0])
    early = Opening(first + 100_000_000, True)
    throw, *rest = find_throws(replace(recording, openings=(early, *recording.openings)))
    assert throw.demonstration is None and (
        "no motion" in throw.reason
        or "nothing moved" in throw.reason
        or "never falls" in throw.reason
    )
    for one, other in zip(rest, find_throws(recording), strict=True):
        assert same(one.demonstration, other.demonstration) == []


def test_without_a_button_the_ball_tells_when_it_left_the_hand(recorded_session, recording):
    throws = find_throws(replace(recording, openings=(), has_button=False))
    trials = [*recorded_session[1], recorded_session[2]]
    assert len(throws) == len(trials)
    for throw, trial in zip(throws, trials, strict=True):
        one, known = throw.demonstration, trial.demonstration
        after = (throw.stamp_ns - known.stamp_ns) * 1e-9 - known.opened
        assert 0.015 < after < 0.05, f"{1e3 * after:.1f} ms after the command"
        assert np.isnan(one.opened)
        assert (
            same(
                one,
                known,
                ["stamp_ns", "hand_position", "hand_quaternion", "joint_position", "target"],
            )
            == []
        )
        np.testing.assert_array_equal(
            one.moved.position[: len(known.moved.time)], known.moved.position
        )


# learning


def test_the_skill_is_that_of_the_recorded_demonstrations(recorded_session, shown, expected):
    raw, report = learn_from_bag(recorded_session[0])
    told, lesson = learn_skill(recorded_session[0], load_skill("throw"))
    assert same_plan(raw.plan(BASKET), expected)
    assert same_plan(told.practice.practising.plan(BASKET), expected)
    assert raw.skill.model_id == lesson.model_id
    ids = tuple(one.id for one in report.learned_from)
    assert ids == lesson.learned_from == tuple(one.id for one in shown)
    assert [throw.reason for throw in report.throws] == ["", "", "", "thrown by the arm itself"]


def with_marks(source, folder, *marks):
    """A copy of a bag with marks of demonstrations: (date [s], id, whether it is dropped), as they
    were recorded.
    """
    types = types_for(MARK_TYPE)
    with BagReader(source) as bag, BagWriter(folder) as copy:
        messages = list(bag.messages(decode=False))
        for topic, about in bag.topics.items():
            copy.add_topic(
                topic, about.type_name, definition(typestore(), about.type_name), qos_yaml()
            )
        copy.add_topic(MARK_TOPIC, MARK_TYPE, definition(types, MARK_TYPE), qos_yaml())
        for one in messages:
            copy.write(one.topic, one.stamp_ns, one.stamp_ns, one.data)
        for date, name, dropped in marks:
            content = {
                "header": {"stamp": {"sec": date, "nanosec": 0}, "frame_id": ""},
                "id": name,
                "dropped": dropped,
            }
            copy.write(
                MARK_TOPIC,
                messages[-1].stamp_ns,
                messages[-1].stamp_ns,
                serialize(types, MARK_TYPE, content),
            )
    return folder


def test_a_demonstration_that_was_dropped_while_it_was_recorded_is_left_out(
    recorded_session, shown, tmp_path
):
    first, second, third = (one.id for one in shown)
    marked = with_marks(
        recorded_session[0],
        tmp_path / "bag",
        (2, second, False),
        (3, third, True),
        (1, second, True),
    )
    _, report = learn_from_bag(marked)
    assert [one.id for one in report.learned_from] == [
        first,
        second,
    ], "the newest mark counts, whatever the order"
    assert "dropped while it was recorded" in [throw.reason for throw in report.throws]
    _, lesson = learn_skill(marked, load_skill("throw"))
    assert lesson.learned_from == (first, second)
    assert lesson.left_out == {third: "dropped while it was recorded"}


@pytest.mark.parametrize("raw", [True, False], ids=["found", "published"])
@pytest.mark.parametrize("by_number", [True, False])
def test_a_demonstration_can_be_left_out_by_its_id_or_number(
    recorded_session, shown, tmp_path, capsys, raw, by_number
):
    way = [] if raw else ["--demonstrations-topic"]
    assert (
        run(
            [
                recorded_session[0],
                *way,
                "--without",
                "2" if by_number else shown[1].id,
                "--output",
                tmp_path / "model.npz",
            ]
        )
        == 0
    )
    (line,) = [one for one in capsys.readouterr().out.splitlines() if "left out: as asked" in one]
    assert shown[1].id in line and (not raw or line.split()[0] == "2")
    assert [one.id for one in load_model(tmp_path / "model.npz")[0]] == [shown[0].id, shown[2].id]
    with pytest.raises(
        ValueError, match=f"no demonstration 'demonstration_3': there are .*{shown[0].id}"
    ):
        run(
            [
                recorded_session[0],
                "--without",
                "demonstration_3",
                "--output",
                tmp_path / "other.npz",
            ]
        )


def test_what_is_remembered_of_a_long_recording_covers_its_region(
    recorded_session, shown, tmp_path, capsys
):
    """Of three only two: of the two that are nearest to each other the older one goes, and the
    model is that of the others.
    """
    tasks = [one.target for one in shown]
    pairs = [(np.linalg.norm(tasks[i] - tasks[k]), i) for i in range(3) for k in range(i + 1, 3)]
    gone = min(pairs)[1]
    output = tmp_path / "model.npz"
    assert run([recorded_session[0], "--remember", "2", "--output", output, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["learned_from"] == [one.id for k, one in enumerate(shown) if k != gone]
    assert [one["id"] for one in told["throws"]][:3] == [one.id for one in shown], (
        "nothing is lost of what was found"
    )
    forgotten = told["throws"][gone]
    np.testing.assert_allclose(forgotten["target"], tasks[gone])
    assert (
        forgotten["left_out"]
        == "forgotten, as the older of the two nearest to each other of more than 2 (--remember)"
    )
    others = PractisingSkill([one for k, one in enumerate(shown) if k != gone])
    assert told["model_id"] == others.skill.model_id
    assert (
        run(
            [
                recorded_session[0],
                "--remember",
                "0",
                "--output",
                tmp_path / "all.npz",
                "--json",
            ]
        )
        == 0
    )
    assert len(json.loads(capsys.readouterr().out)["learned_from"]) == 3


def test_throws_of_the_arm_itself_are_forgotten_before_those_that_were_shown(
    recorded_session, shown
):
    _, report = learn_from_bag(recorded_session[0], with_throws=True, remember=3)
    assert len(report.learned_from) == 3 and [
        throw.taught for throw in report.throws if throw.reason
    ] == [True]
    own = [throw for throw in report.throws if not throw.taught]
    memory = ThrowMemory(2, DEFAULT)
    memory.take(
        [
            *own,
            replace(own[0], stamp_ns=own[0].stamp_ns + 1),
            *[throw for throw in report.throws if throw.demonstration][:1],
        ]
    )
    assert [bool(throw.reason) for throw in memory.throws] == [True, False, False]
    with pytest.raises(
        ValueError,
        match="-1 demonstrations cannot be remembered: give a positive number, or 0 for all",
    ):
        learn_from_bag(recorded_session[0], remember=-1)


def test_the_arms_own_throws_are_learned_from_if_asked(recorded_session):
    skill, report = learn_from_bag(recorded_session[0], with_throws=True)
    assert len(report.learned_from) == 4 and len(skill.practice.demonstrations) == 4
    np.testing.assert_allclose(report.learned_from[-1].target, THROWN_AT, atol=1e-3)


def test_misses_are_left_out_unless_asked_for(recorded_session, shown, expected):
    """With the basket said to stand elsewhere each throw is a miss; where the balls came down is
    the same, and so is what is learned.
    """
    elsewhere = changed_throw(
        OWN, bodies={**OWN.bodies, "basket": PoseSource(fixed=(2.0, 1.0, 0.4))}
    )
    with pytest.raises(
        ValueError,
        match=(
            "0 demonstrations among 4 throws are too few: at least 2 are needed; missed the basket"
        ),
    ):
        learn_from_bag(recorded_session[0], elsewhere)
    skill, report = learn_from_bag(recorded_session[0], elsewhere, with_throws=True)
    names = [one.id for one in shown]
    assert [one.id for one in report.learned_from][:3] == names, (
        "by another name, what had been dropped was learned from again"
    )


def test_a_recording_without_joints_says_what_is_missing(recorded_session):
    with pytest.raises(
        ValueError,
        match="the arm's joint angles were not recorded: a mapping may name them under 'joints'",
    ):
        learn_from_bag(recorded_session[0], replace(OWN, joints=None))


def test_bodies_with_exchanged_names_teach_the_same(recorded_session, expected):
    hand, ball = OWN.bodies["hand"], OWN.bodies["ball"]
    exchanged = changed_throw(OWN, bodies={**OWN.bodies, "hand": ball, "ball": hand})
    skill, report = learn_from_bag(recorded_session[0], exchanged)
    swaps = [fault for fault in report.faults if fault.kind == "swap"]
    assert (
        swaps
        and all(fault.repaired for fault in swaps)
        and not [f for f in report.faults if f.kind not in ("swap", "gap")]
    )
    assert apart(skill.plan(BASKET), expected) < (1e-3, 1e-3)


def test_axes_that_are_wrong_say_where_to_look(recorded_session):
    flat = replace(
        OWN,
        bodies={role: replace(where, axes=UP_AXES["y"]) for role, where in OWN.bodies.items()},
        teacher=None,
        command=None,
    )
    with pytest.raises(
        ValueError,
        match="though 0 of 0 throws could be: .* told in our own axes .mapping: axes: {up: z}",
    ):
        learn_from_bag(recorded_session[0], flat)


# from another laboratory


def write_laboratory(folder, recording, rng, jitter_ns=0):
    """The recording as CSV files of a laboratory with y up and millimetres; 120 digits of nothing
    else than what it saw.
    """
    up = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    for role in ROLES:
        body = recording.bodies[role]
        position, turned = (
            1e3 * up.inv().apply(body.position),
            (up.inv() * Rotation.from_quat(body.quaternion)).as_quat(),
        )
        late = rng.exponential(jitter_ns, len(body)) if jitter_ns else np.zeros(len(body))
        rows = zip(
            (body.stamp_ns + late.astype(int)).tolist(),
            position.tolist(),
            turned[:, [3, 0, 1, 2]].tolist(),
            strict=True,
        )
        lines = ["t;x;y;z;qw;qx;qy;qz"] + [
            ";".join([str(t), *map(repr, p), *map(repr, q)]) for t, p, q in rows
        ]
        (folder / f"{role}.csv").write_text("\n".join(lines) + "\n")
    joints = recording.joints
    rows = zip(
        joints.stamp_ns.tolist(),
        np.hstack([joints.position, joints.velocity]).tolist(),
        strict=True,
    )
    (folder / "joints.csv").write_text(
        "\n".join(",".join([str(t), *map(repr, row)]) for t, row in rows)
    )
    columns = {"time": "t", "position": ["x", "y", "z"], "quaternion": ["qw", "qx", "qy", "qz"]}
    poses = {
        role: {
            "csv": f"{role}.csv",
            "delimiter": ";",
            "time": "ns",
            "order": "wxyz",
            "columns": columns,
        }
        for role in ROLES
    }
    numbers = {"time": 1, "position": list(range(2, 9)), "velocity": list(range(9, 16))}
    arm = {"csv": "joints.csv", "header_lines": 0, "time": "ns", "columns": numbers}
    mapping = {"axes": {"up": "y", "length": "mm"}, **poses, "joints": arm}
    (folder / "mapping.yaml").write_text(yaml.safe_dump(mapping))
    return mapping


def test_a_laboratory_with_other_axes_units_and_no_button_teaches_the_same(
    tmp_path, recording, recorded_session, expected
):
    guided = replace(recording, bodies={role: body for role, body in recording.bodies.items()})
    mapping = write_laboratory(tmp_path, guided, np.random.default_rng(0))
    skill, report = learn_from_bag(tmp_path, parse_mapping(mapping))
    assert len(report.learned_from) == 4, "nobody knows who threw, so that all are shown"
    same_throws, _ = learn_from_bag(recorded_session[0], with_throws=True)
    assert apart(skill.plan(BASKET), same_throws.plan(BASKET)) < (1e-5, 1e-5)


def test_stamps_of_receipt_teach_the_same_to_millimetres(tmp_path, recording, recorded_session):
    mapping = write_laboratory(tmp_path, recording, np.random.default_rng(0), jitter_ns=500_000)
    skill, report = learn_from_bag(tmp_path, parse_mapping(mapping))
    jitter = [fault for fault in report.faults if fault.kind == "jitter"]
    assert {fault.body for fault in jitter} == set(ROLES) and all(
        fault.repaired for fault in jitter
    )
    same_throws, _ = learn_from_bag(recorded_session[0], with_throws=True)
    assert max(apart(skill.plan(BASKET), same_throws.plan(BASKET))) < 5e-3


def test_a_converted_recording_teaches_what_the_recording_does(
    tmp_path, recorded_session, expected
):
    convert(recorded_session[0], tmp_path / "ours")
    skill, report = learn_from_bag(tmp_path / "ours")
    assert len(report.learned_from) == 3
    np.testing.assert_allclose(
        skill.plan(BASKET).attractor_position, expected.attractor_position, atol=1e-9
    )


# the command


def run(arguments):
    parser = argparse.ArgumentParser()
    add_to(parser.add_subparsers())
    options = parser.parse_args(["learn", *map(str, arguments)])
    return options.run(options)


def test_the_command_says_what_was_found_and_where_the_model_is(
    tmp_path, recorded_session, shown, expected, capsys
):
    model = tmp_path / "model.npz"
    assert run([recorded_session[0], "--output", model]) == 0
    said = capsys.readouterr().out
    assert (
        said.count(": guided, basket at (") == 3
        and shown[2].id in said
        and "own, basket at" in said
    )
    assert (
        "left out: thrown by the arm itself" in said
        and "learned from 3 of 4 throws with 'default'; the hand opens" in said
    )
    if importlib.util.find_spec("rclpy") is not None:
        following = [line.removeprefix("next: ") for line in said.splitlines()[-2:]]
        assert [shlex.split(line) for line in following] == [
            ["dart-skill", verb, "--model", str(model)] for verb in ("up", "demo")
        ], "a real arm throws with 'up', not with a demo"
    demonstrations, configuration, *_ = load_model(model)
    assert same_plan(PractisingSkill(demonstrations, configuration).plan(BASKET), expected)


def test_the_command_says_it_as_json(tmp_path, recorded_session, capsys):
    assert (
        run([recorded_session[0], "--json", "--with-throws", "--output", tmp_path / "model.npz"])
        == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert len(said["learned_from"]) == 4 and said["configuration"] == "default"
    assert [throw["taught"] for throw in said["throws"]] == [True, True, True, False]
    assert all(
        throw["in_basket"] and throw["landing_error"] < 0.15 for throw in said["throws"][:3]
    )
    assert {fault["kind"] for fault in said["faults"]} <= {"gap"}


def test_the_command_takes_the_topic_of_demonstrations(tmp_path, recorded_session, capsys):
    assert (
        run([recorded_session[0], "--demonstrations-topic", "--output", tmp_path / "one.npz"]) == 0
    )
    assert "learned 'throw' from 3 demonstrations" in capsys.readouterr().out
    with pytest.raises(ValueError, match="leave out --mapping and --with-throws"):
        run(
            [
                recorded_session[0],
                "--demonstrations-topic",
                "--with-throws",
                "--output",
                tmp_path / "two.npz",
            ]
        )
    with pytest.raises(
        ValueError, match="--at-least waits for demonstrations on a graph that runs"
    ):
        run([recorded_session[0], "--at-least", "13", "--output", tmp_path / "two.npz"])


def test_the_command_reads_a_laboratory_and_its_faults(tmp_path, recording, capsys):
    hand = recording.bodies["hand"]
    stale = replace(hand, position=hand.position.copy(), quaternion=hand.quaternion.copy())
    stale.position[40:44], stale.quaternion[40:44] = stale.position[39], stale.quaternion[39]
    write_laboratory(
        tmp_path,
        changed_throw(recording, bodies={**recording.bodies, "hand": stale}),
        np.random.default_rng(0),
    )
    assert (
        run([tmp_path, "--mapping", tmp_path / "mapping.yaml", "--output", tmp_path / "model.npz"])
        == 0
    )
    said = capsys.readouterr().out
    assert (
        "hand: the same pose again, 4 times with new stamps (a lost body): left out" in said
        and "NOT REPAIRED" not in said
    )
    assert "hand was not seen" in said and "learned from 4 of 4 throws with 'default'\n" in said


def test_the_command_overwrites_nothing(tmp_path, recorded_session):
    model = tmp_path / "model.npz"
    model.write_text("precious")
    with pytest.raises(ValueError, match="exists already: name another file with --output"):
        run([recorded_session[0], "--output", model])
    assert model.read_text() == "precious"


@pytest.mark.parametrize(("bag", "file"), [
    ("monday", "monday_model.npz"), ("monday/monday_0.mcap", "monday_0_model.npz"), ("demo_7/bag", "demo_7_model.npz"),
])  # fmt: skip
def test_models_of_two_demos_have_two_names(bag, file, tmp_path):
    """The bag of each demo is called `bag`, and the second model was refused."""
    assert str(file_for(tmp_path / bag)) == file


# finding throws while they are made


@pytest.mark.parametrize("forgets_ns", [MEMORY_NS, 12_000_000_000])
def test_throws_are_found_while_they_are_made(
    recorded_session, recording, forgets_ns, monkeypatch
):
    monkeypatch.setattr("dart_skill.skills.observation._throw_finder.MEMORY_NS", forgets_ns)
    log = ThrowLog()
    finder, found = ThrowFinder(log), []
    with BagReader(recorded_session[0]) as raw, BagReader(recorded_session[0]) as bag:
        for message, serialised in zip(bag.messages(), raw.messages(decode=False), strict=True):
            topic, content = message.topic, message.data
            if topic in ("/wam/command", "/wam/teacher_wrench"):
                finder.add_command(serialised.data, guiding=topic == "/wam/teacher_wrench")
            elif topic == "/joint_states":
                log.add_joints(stamp_of(content), content.position, content.velocity)
            elif topic.startswith("/vrpn_mocap"):
                p, q = content.pose.position, content.pose.orientation
                log.take(
                    topic.split("/")[2], stamp_of(content), [p.x, p.y, p.z], [q.x, q.y, q.z, q.w]
                )
                found += finder.until(stamp_of(content) - 10_000_000)
    offline = find_throws(recording)
    assert [throw.shows for throw in found] == [throw.shows for throw in offline]
    for throw, one in zip(found, offline, strict=True):
        assert same(throw.demonstration, one.demonstration) == []
    assert max(map(len, log.stamps())) * 10_000_000 < forgets_ns + 2_000_000_000


def stamp_of(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def test_a_bag_of_the_arms_own_throws_says_with_which_option_it_teaches(tmp_path, capsys):
    assert main(["learn", str(ROOT / "bags/throws"), "--output", str(tmp_path / "model.npz")]) == 1
    assert "thrown by the arm itself; with --with-throws" in capsys.readouterr().err


def without_stamps(source, folder, topics):
    """A copy of a bag in which nobody filled in the stamps of some topics."""
    with BagReader(source) as bag, BagWriter(folder) as copy:
        for name, topic in bag.topics.items():
            copy.add_topic(
                name,
                topic.type_name,
                definition(bag.types, topic.type_name),
                qos_yaml(),
                type_hash(bag.types, topic.type_name),
            )
        for message in bag.messages(decode=False):
            data = bytes(message.data)
            data = data[:4] + bytes(8) + data[12:] if message.topic in topics else data
            copy.write(message.topic, message.stamp_ns, message.stamp_ns, data)
    return folder


@pytest.mark.parametrize(
    ("role", "topics"),
    [
        ("hand", [f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")]),
        ("joints", ["/joint_states"]),
    ],
)
def test_stamps_that_nobody_filled_in_are_told_first_and_the_log_time_teaches_the_same(
    recorded_session, tmp_path, capsys, role, topics
):
    """What was found is said also where nothing can be learned; nobody is asked whether a body was
    tracked of which poses were recorded.
    """
    bag = without_stamps(recorded_session[0], tmp_path / "bag", topics)
    with pytest.raises(
        NothingLearned,
        match=rf"{role}: nobody filled in the stamps of \d+ messages.*{role}: \{{time: log\}}",
    ) as error:
        run([bag, "--output", tmp_path / "model.npz"])
    assert "is it tracked" not in str(error.value)
    assert f"{role}: nobody filled in the stamps" in capsys.readouterr().err
    mapping = with_remedies(OWN, error.value.report.faults)
    (tmp_path / "mapping.yaml").write_text(mapping_text(mapping))
    assert (
        run(
            [
                bag,
                "--mapping",
                tmp_path / "mapping.yaml",
                "--json",
                "--output",
                tmp_path / "model.npz",
            ]
        )
        == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert len(said["learned_from"]) == 3 and said["clocks"][role] == {"time": ["log"]}
    assert load_model(tmp_path / "model.npz").origin == {"clocks": said["clocks"]}
