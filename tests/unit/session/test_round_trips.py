"""Any recording in another form, and in another one, and back, teaches the same model."""

import shutil
from itertools import chain, count

import numpy as np
import pytest
from hypothesis import assume, given, note, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dart_skill.common.constants import Grip
from dart_skill.common.world import ROLES
from dart_skill.recording import BagReader, definition, read_command
from dart_skill.recording.imports import (
    MAPPING,
    convert,
    load_mapping,
    parse_mapping,
    read_recording,
    throws_to_csv,
)
from dart_skill.recording.imports.mapping import LENGTH_UNITS, TIME_UNITS
from dart_skill.session import (
    NothingLearned,
    learn_from_bag,
    learn_skill,
    open_dataset,
    write_lerobot,
)
from dart_skill.skills.learning import Unreachable
from dart_skill.skills.protocol import load_skill
from tests.paths import ROOT
from tests.unit.recording.bag_files import TYPES, mcap_file, mcap_ways

POSES = {f"/vrpn_mocap/{role}/pose": role for role in ROLES}
TOPICS = (*POSES, "/joint_states", "/wam/command", "/wam/teacher_wrench")
BEFORE_NS, AFTER_NS = 2_500_000_000, 2_500_000_000
"""What belongs to a throw, around the instant at which the hand is told to open."""
SIGNED_AXES = [
    (*"xyz",),
    (*"yzx",),
    (*"zxy",),
    ("-y", "x", "z"),
    ("x", "-z", "y"),
    ("-x", "-y", "z"),
    ("y", "x", "z"),
    ("x", "z", "y"),
]
few = settings(max_examples=max(4, settings.default.max_examples // 25))

recordings = st.fixed_dictionaries(
    {
        "throws": st.sets(st.integers(0, 12), min_size=2, max_size=3),
        "since_ns": st.one_of(st.just(0), st.integers(0, 2 * 10**18)),
        "noise": st.sampled_from([0.0, 1e-5, 3e-4]),
        "digits": st.sampled_from([None, 4, 6]),
        "every": st.sampled_from([1, 1, 2]),
        "of_arm": st.sampled_from([5, 5, 10]),
        "lost": st.sampled_from([0.0, 0.0, 0.03]),
        "twice": st.sampled_from([0.0, 0.0, 0.02]),
        "seed": st.integers(0, 1000),
        "way": mcap_ways,
    }
)
layouts = st.fixed_dictionaries(
    {
        "delimiter": st.sampled_from([",", ";", "\t"]),
        "header_lines": st.integers(0, 2),
        "time": st.sampled_from(list(TIME_UNITS)),
        "order": st.sampled_from(["xyzw", "wxyz"]),
    }
)
lab_axes = st.fixed_dictionaries(
    {
        "xyz": st.sampled_from(SIGNED_AXES),
        "length": st.sampled_from(list(LENGTH_UNITS)),
        "inverse": st.booleans(),
    }
)


@pytest.fixture(scope="module")
def shown():
    """Types by topic, and the messages of each throw of a bag that is kept here."""
    path = ROOT / "bags/demonstrations"
    instants = [one.stamp_ns for one in read_recording(path).openings]
    with BagReader(path) as bag:
        windows = [
            bag.messages(TOPICS, at - BEFORE_NS, at + AFTER_NS, decode=False) for at in instants
        ]
        return {name: bag.topics[name].type_name for name in TOPICS}, [
            list(one) for one in windows
        ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("forms")


def recorded(shown, folder, drawn):
    """The file of a recording as it was drawn, in an empty folder."""
    shutil.rmtree(folder)
    folder.mkdir()
    types, throws = shown
    rng, number = np.random.default_rng(drawn["seed"]), {topic: count() for topic in TOPICS}
    messages = []
    for one in (one for k in sorted(drawn["throws"]) for one in throws[k]):
        of_body, left_out = (
            one.topic in POSES,
            next(number[one.topic]) % drawn["every" if one.topic in POSES else "of_arm"],
        )
        if (of_body and rng.random() < drawn["lost"]) or (left_out and not is_opening(one)):
            continue
        data = bytearray(one.data)
        stamp = np.frombuffer(data, np.uint32, 2, 4)
        stamp[:] = divmod(int(stamp[0]) * 10**9 + int(stamp[1]) + drawn["since_ns"], 10**9)
        if of_body:
            numbers = np.frombuffer(data, float, 3, len(data) - 56)
            numbers += drawn["noise"] * rng.standard_normal(3)
            numbers[:] = numbers if drawn["digits"] is None else np.round(numbers, drawn["digits"])
        told = (TOPICS.index(one.topic), one.stamp_ns + drawn["since_ns"], bytes(data))
        messages += [told] * (1 + (of_body and rng.random() < drawn["twice"]))
    texts = {name: {"text": definition(TYPES, name)} for name in types.values()}
    return mcap_file(
        folder / "drawn.mcap",
        [(topic, name, texts[name]) for topic, name in types.items()],
        messages,
        **drawn["way"],
    )


def is_opening(message):
    """Whether a message tells the hand to open."""
    return message.type_name.endswith("WamCommand") and read_command(message.data)[2] == Grip.OPEN


def as_mcap(path, mapping, output, layout):
    convert(path, output, mapping, storage="mcap")
    return output, None


def as_sqlite(path, mapping, output, layout):
    convert(path, output, mapping, storage="sqlite3")
    return output, None


def as_csv(path, mapping, output, layout):
    throws_to_csv(path, output, mapping)
    return output, load_mapping(output / MAPPING)


def as_frames(path, mapping, output, layout):
    """Topics as data frames of pandas, saved as Parquet, which a mapping reads."""
    pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    bag, keys = output.with_name(f"{output.name}_bag"), {}
    openings = convert(path, bag, mapping).openings
    output.mkdir()
    with BagReader(bag) as reader:
        for topic, role in POSES.items():
            reader.to_pandas(topic).to_parquet(output / f"{role}.parquet")
            columns = {
                "time": "header.stamp",
                "position": [f"pose.position.{axis}" for axis in "xyz"],
            }
            columns["quaternion"] = [f"pose.orientation.{axis}" for axis in "xyzw"]
            keys[role] = {"table": f"{role}.parquet", "time": "ns", "columns": columns}
        reader.to_pandas("/joint_states").to_parquet(output / "joints.parquet")
    columns = {name: [f"{name}[{k}]" for k in range(7)] for name in ("position", "velocity")}
    keys["joints"] = {
        "table": "joints.parquet",
        "time": "ns",
        "columns": {"time": "header.stamp", **columns},
    }
    keys["teacher"] = instants(output, openings, {"time": "ns", "header_lines": 1})
    return output, parse_mapping(keys)


def as_tables(path, mapping, output, layout, axes=None):
    """Tables as another laboratory writes them: as they are laid out, and in its axes and units."""
    recording, keys = read_recording(path, mapping), {}
    output.mkdir()
    for role, body in recording.bodies.items():
        position, quaternion = (
            (body.position, body.quaternion) if axes is None else in_axes(body, **axes)
        )
        quaternion = np.roll(quaternion, int(layout["order"] == "wxyz"), axis=1)
        columns = written(
            output / f"{role}.csv", layout, body.stamp_ns, position=position, quaternion=quaternion
        )
        keys[role] = {"table": f"{role}.csv", "columns": columns, **layout}
    joints, common = (
        recording.joints,
        {name: layout[name] for name in ("delimiter", "header_lines", "time")},
    )
    columns = written(
        output / "joints.csv",
        layout,
        joints.stamp_ns,
        position=joints.position,
        velocity=joints.velocity,
    )
    keys["joints"] = {"table": "joints.csv", "columns": columns, **common}
    keys["teacher"] = instants(output, recording.openings, common)
    shared = {} if axes is None else {"axes": {**axes, "xyz": list(axes["xyz"])}}
    return output, parse_mapping({**shared, **keys})


def in_axes(body, xyz, length, inverse):
    """Positions and quaternions of a body in other axes and units; in left-handed ones its z axis
    is mirrored.
    """
    matrix = np.array(
        [[(-1.0 if one[0] == "-" else 1.0) * (one[-1] == axis) for axis in "xyz"] for one in xyz]
    )
    mirror = np.diag([1.0, 1.0, np.linalg.det(matrix)])
    turned = Rotation.from_matrix(
        matrix.T @ Rotation.from_quat(body.quaternion).as_matrix() @ mirror
    )
    return (
        body.position @ matrix / LENGTH_UNITS[length],
        (turned.inv() if inverse else turned).as_quat(),
    )


def written(file, layout, stamps, **arrays):
    """Write a table; its columns by their names, or by their numbers where there is no header."""
    between, unit = layout.get("delimiter", ","), round(TIME_UNITS[layout["time"]])
    digits = len(str(unit)) - 1
    times = [
        f"{stamp // unit}.{stamp % unit:0{digits}d}" if digits else str(stamp)
        for stamp in stamps.tolist()
    ]
    names = {name: [f"{name} {k}" for k in range(rows.shape[1])] for name, rows in arrays.items()}
    rows = np.hstack([np.empty((len(stamps), 0)), *arrays.values()]).tolist()
    lines = ["a comment"] * (layout["header_lines"] - 1)
    lines += [between.join(["t", *chain(*names.values())])] * min(1, layout["header_lines"])
    lines += [between.join([time, *map(repr, row)]) for time, row in zip(times, rows, strict=True)]
    file.write_text("\n".join(lines) + "\n")
    if layout["header_lines"]:
        return {"time": "t", **names}
    numbers = count(2)
    return {
        "time": 1,
        **{name: [next(numbers) for _ in several] for name, several in names.items()},
    }


def instants(output, openings, layout):
    """Write when a guiding person told the hand to open."""
    stamps = np.array([one.stamp_ns for one in openings if one.taught], dtype=np.int64)
    return {
        "table": "teacher.csv",
        "columns": written(output / "teacher.csv", layout, stamps),
        **layout,
    }


def learned(path, configuration="default"):
    """The skill; nothing to be asked where too little is left of what was drawn."""
    try:
        return learn_from_bag(path, configuration=configuration)
    except NothingLearned:
        assume(False)


@few
@given(
    drawn=recordings,
    forms=st.lists(
        st.sampled_from([as_mcap, as_sqlite, as_csv, as_frames, as_tables]), min_size=1, max_size=3
    ),
    layout=layouts,
)
def test_numbers_that_every_form_keeps_teach_the_same_model(shown, folder, drawn, forms, layout):
    path, mapping = recorded(shown, folder, drawn), None
    model = learned(path)[0].skill.model_id
    for number, form in enumerate(forms):
        path, mapping = form(path, mapping, folder / f"form_{number}", layout)
        note(
            f"{form.__name__}:"
            f" {[fault.message for fault in read_recording(path, mapping).faults if not fault.is_information]}"
        )
    assert learn_from_bag(path, mapping)[0].skill.model_id == model


def apart(one, other):
    """How far the hands of two skills are apart before they let go, at most [m]; both learned from
    as many throws.
    """
    (skill, report), (again, second) = one, other
    assert len(report.learned_from) == len(second.learned_from)
    target = np.mean([shown.target for shown in report.learned_from], axis=0)
    try:
        first = skill.plan(target)
    except Unreachable:
        assume(False)
    ways = []
    for plan in (first, again.plan(target)):
        before = plan.path.time - plan.release
        ways.append(
            np.array(
                [
                    np.interp(np.linspace(-0.3, 0.0, 31), before, column)
                    for column in plan.path.position.T
                ]
            )
        )
    return np.abs(ways[0] - ways[1]).max()


@few
@given(drawn=recordings, layout=layouts, axes=lab_axes)
def test_tables_in_the_axes_and_units_of_another_laboratory_teach_the_same_but_for_rounding(
    shown, folder, drawn, layout, axes
):
    path = recorded(shown, folder, drawn)
    assert (
        apart(
            learned(path), learn_from_bag(*as_tables(path, None, folder / "tables", layout, axes))
        )
        < 1e-6
    )


@few
@given(drawn=recordings, fps=st.sampled_from([100, 120, 200]))
def test_a_dataset_of_lerobot_teaches_nearly_the_same(shown, folder, drawn, fps):
    """Its frames are not the instants of the recording. Without EM, which comes to another optimum
    by as little.
    """
    pytest.importorskip("pyarrow")
    path = recorded(shown, folder, drawn)
    first = learned(path, "intervals")
    write_lerobot(path, folder / "dataset", fps=fps)
    dataset = open_dataset(folder / "dataset")
    learner, lesson = learn_skill(dataset, load_skill("throw"), "intervals")
    assert len(lesson.learned_from) == len(first[1].learned_from)
    assert apart(first, (learner.practice.practising, first[1])) < 1e-2
