"""Files of motion capture programs: the same poses come out of every form of every program, and
what a file does not say is asked for.

The forms are made here anew. They follow OptiTrack's documentation of CSV exports, public parsers
of exports of Motive 1.0 to 3.1, of Nexus and of Tracker, QTM's TSV files in public data sets, and
the formats TRC, C3D and BVH.
"""

import sys
import warnings

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from dart_skill.common.extras import explained
from dart_skill.recording.imports import (
    MappingError,
    convert,
    mapping_text,
    parse_mapping,
    read_recording,
)

N, RATE = 40, 100
TIME = np.arange(N) / RATE
Y_UP = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
BODIES = ("Hand", "Ball")
ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
FORMATS = {"m": "Meters", "cm": "Centimeters", "mm": "Millimeters", "in": "Inches", "ft": "Feet"}
METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}


@pytest.fixture(scope="module")
def poses():
    """Positions (n, 3) [m] and turns of hand and ball in our axes."""
    wave = np.column_stack([np.sin(3.0 * TIME), np.cos(2.0 * TIME), 0.5 * TIME])
    turn = np.column_stack([0.4 + TIME, 0.3 - 0.5 * TIME, 0.2 + 2.0 * TIME])
    return {
        "Hand": (0.3 * wave + [0.2, 0.4, 1.1], Rotation.from_euler("XYZ", turn)),
        "Ball": (0.2 * wave + [1.2, -0.4, 0.9], Rotation.from_euler("XYZ", -turn)),
    }


def in_y_up(poses):
    return {
        name: (Y_UP.inv().apply(position), Y_UP.inv() * turn)
        for name, (position, turn) in poses.items()
    }


def read(folder, file="take.csv", hand=None, ball=None, key="capture", **axes):
    mapping = {"axes": axes, "basket": {"position": [2.0, 0.3, 0.4]}}
    mapping["hand"] = {key: file, "body": "Hand", **(hand or {})}
    mapping["ball"] = {key: file, "body": "Ball", **(ball or {})}
    for one in ("hand", "ball"):
        if "markers" in mapping[one]:
            del mapping[one]["body"]
    return read_recording(folder, parse_mapping(mapping), mend=False)


def assert_read(recording, poses, is_turned=True, atol=2e-6, start=0.0):
    for role, name in (("hand", "Hand"), ("ball", "Ball")):
        body, (position, turn) = recording.bodies[role], poses[name]
        np.testing.assert_array_equal(body.stamp_ns, np.rint(1e9 * (TIME + start)).astype(int))
        np.testing.assert_allclose(body.position, position, atol=atol, err_msg=role)
        if is_turned:
            apart = (Rotation.from_quat(body.quaternion) * turn.inv()).magnitude().max()
            assert apart < 1e-4, f"{role}: {apart} rad"


# --- Motive ---


WORDS = ("Rotation", "Position")


def motive_rows(
    poses,
    unit="m",
    rotation="Quaternion",
    kind="Rigid Body",
    time="Time (Seconds)",
    words=WORDS,
    extra="Error",
    prefix="",
):
    """Rows of cells below the first line."""
    axes = "XYZW" if rotation == "Quaternion" else "" if rotation == "None" else "XYZ"
    what, axis, types, names, ids = (
        ["", ""],
        ["Frame", time],
        ["", "Type"],
        ["", "Name"],
        ["", "ID"],
    )
    columns = []
    for k, (name, (position, turn)) in enumerate(poses.items(), 1):
        order = rotation if rotation in ORDERS else "XYZ"
        angles = turn.as_euler(order, degrees=True)[:, [order.index(one) for one in "XYZ"]]
        columns += [
            turn.as_quat() if axes == "XYZW" else angles[:, : len(axes)],
            position / METRES[unit],
            np.full((N, 1), 1e-4),
        ]
        width = len(axes) + 4
        types += [kind] * width
        names += [prefix + name] * width
        ids += [f"{k:032X}"] * width
        what += [words[0]] * len(axes) + [words[1]] * 3 + [extra]
        axis += [*axes, *"XYZ", ""]
    table = np.hstack(columns)
    numbers = [
        [str(k), f"{TIME[k]:.6f}", *(f"{value:.6f}" for value in table[k])] for k in range(N)
    ]
    return {"types": types, "names": names, "ids": ids, "what": what, "axis": axis}, numbers


def about(
    unit="Meters", rotation="Quaternion", space="Global", version="1.23", notes=("",), **more
):
    pairs = {
        "Format Version": version,
        "Take Name": "take",
        "Take Notes": notes,
        "Capture Frame Rate": "100.000000",
    }
    pairs |= {
        "Export Frame Rate": "100.000000",
        "Capture Start Time": "2019-09-18 04.30.02.695 PM",
        "Total Frames in Take": str(N),
    }
    pairs |= {
        "Total Exported Frames": str(N),
        "Rotation Type": rotation,
        "Length Units": unit,
        "Coordinate Space": space,
        **more,
    }
    cells = []
    for name, value in pairs.items():
        cells += [] if value is None else [name, *([value] if isinstance(value, str) else value)]
    return cells


def write(path, rows, delimiter=",", encoding="utf-8", end="\r\n", comma=False):
    text = (
        end.join(
            delimiter.join(cell.replace(".", ",") if comma else cell for cell in cells)
            for cells in rows
        )
        + end
    )
    path.write_bytes(text.encode(encoding))


def write_motive(folder, poses, first=None, without=(), file="take.csv", written=None, **form):
    head, numbers = motive_rows(in_y_up(poses), **form)
    rows = [
        (
            first
            if first is not None
            else about(FORMATS[form.get("unit", "m")], form.get("rotation", "Quaternion"))
        ),
        [],
    ]
    rows += [cells for name, cells in head.items() if name not in without] + numbers
    write(folder / file, rows, **(written or {}))


@pytest.mark.parametrize("rotation", ["Quaternion", *ORDERS])
@pytest.mark.parametrize("kind", ["Rigid Body", "Bone"])
def test_bodies_and_bones_of_motive_are_read_with_every_rotation(tmp_path, poses, rotation, kind):
    write_motive(tmp_path, poses, rotation=rotation, kind=kind)
    assert_read(read(tmp_path, up="y"), poses)
    assert_read(read(tmp_path, up="y", key="motive"), poses)


@pytest.mark.parametrize("unit", FORMATS)
def test_every_unit_of_motive_becomes_metres(tmp_path, poses, unit):
    write_motive(tmp_path, poses, unit=unit)
    assert_read(read(tmp_path, up="y"), poses, atol=1e-5)


FORMS = {
    "semicolons": {"written": {"delimiter": ";"}},
    "tabs and decimal commas": {"written": {"delimiter": "\t", "comma": True}},
    "semicolons and decimal commas": {"written": {"delimiter": ";", "comma": True}},
    "a mark of UTF-8": {"written": {"encoding": "utf-8-sig"}},
    "UTF-16": {"written": {"encoding": "utf-16"}},
    "UTF-16 without a mark": {"written": {"encoding": "utf-16-le"}},
    "ends of lines of Unix": {"written": {"end": "\n"}},
    "time without its unit": {"time": "Time"},
    "time in German": {"time": "Zeit (Sekunden)"},
    "version 1.2": {"first": about(version="1.2", notes=None)},
    "version 1.25": {"first": about(version="1.25")},
    "commas in notes": {"first": about(notes=("third try", " good", "Hand, left"))},
    "commas in notes, in quotes": {"first": about(notes='"third try, ""good"""')},
    "words in Spanish": {"words": ("Rotación", "Posición"), "extra": "Error medio"},
    "words in Japanese": {"words": ("回転", "位置"), "extra": "誤差"},
    "a note of two lines": {"first": [*about(notes="first line\r\nsecond line")]},
    "a note of two lines in quotes": {"first": about(notes='"first line\r\nsecond, line"')},
    "types in German": {"kind": "Starrer Körper"},
    "cells that a spreadsheet adds": {"first": [*about(), "", "", ""]},
    "no line of numbers": {"without": ("ids",)},
    "no line of types": {"without": ("types",)},
    "mean marker error": {"extra": "Mean Marker Error"},
    "marker quality": {"extra": "Marker Quality"},
    "with the asset's name": {"prefix": "Skeleton 001:"},
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_other_forms_of_a_motive_export_are_read(tmp_path, poses, form):
    write_motive(tmp_path, poses, **form)
    assert_read(read(tmp_path, up="y"), poses)


def test_labels_of_the_header_may_be_in_any_language(tmp_path, poses):
    head, numbers = motive_rows(in_y_up(poses), kind="Starrer Körper")
    head["types"][1], head["names"][1], head["ids"][1] = "Typ", "Bezeichnung", "Kennung"
    for order in (("types", "names", "ids"), ("types", "ids", "names")):
        write(
            tmp_path / "take.csv",
            [about(), [], *(head[name] for name in (*order, "what", "axis")), *numbers],
        )
        assert_read(read(tmp_path, up="y"), poses)


def test_bodies_without_names_are_called_by_their_numbers(tmp_path, poses):
    write_motive(tmp_path, poses, without=("names",))
    assert_read(
        read(tmp_path, up="y", hand={"body": f"{1:032X}"}, ball={"body": f"{2:032X}"}), poses
    )
    write_motive(tmp_path, poses, without=("names", "ids"))
    assert_read(read(tmp_path, up="y", hand={"body": "1"}, ball={"body": "2"}), poses)


def test_without_times_they_follow_from_frames_and_rate(tmp_path, poses):
    head, numbers = motive_rows(in_y_up(poses))
    rows = [[cell for k, cell in enumerate(cells) if k != 1] for cells in numbers]
    head = [
        [cell for k, cell in enumerate(cells) if k != 1 or name != "axis"]
        for name, cells in head.items()
    ]
    for cells in head[:4]:
        del cells[0]
    head[0][0], head[1][0], head[2][0], head[3][0] = "", "", "", ""
    write(tmp_path / "take.csv", [about(), [], *head, *rows])
    assert_read(read(tmp_path, up="y"), poses)
    write(
        tmp_path / "take.csv",
        [about(**{"Capture Frame Rate": None, "Export Frame Rate": None}), [], *head, *rows],
    )
    with pytest.raises(
        ValueError, match="does not say its frame rate: add 'rate:' to the mapping"
    ):
        read(tmp_path, up="y")
    assert_read(read(tmp_path, up="y", hand={"rate": 100}, ball={"rate": 100}), poses)
    write(tmp_path / "take.csv", [about(), [], *head, *rows])
    with pytest.raises(
        ValueError, match="rate is 50 in the mapping, but the file itself says 100"
    ):
        read(tmp_path, up="y", hand={"rate": 50})


def test_empty_cells_are_frames_in_which_a_body_was_not_seen(tmp_path, poses):
    head, numbers = motive_rows(in_y_up(poses))
    numbers[5][2:10] = [""] * 8
    numbers[6] = numbers[6][:10]  # some programs leave empty cells at the end out
    write(tmp_path / "take.csv", [about(), [], *head.values(), *numbers])
    recording = read(tmp_path, up="y")
    assert len(recording.bodies["hand"]) == N - 1 and len(recording.bodies["ball"]) == N - 1


def marker_places(position, turn):
    """Three markers on a body, and their mean frame: x from the first to the second."""
    shape = np.array([[0.0, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, 0.09, 0.0]])
    shape -= shape.mean(axis=0)
    return [turn.apply(one) + position for one in shape]


def write_motive_markers(
    folder, poses, kind="Rigid Body Marker", name="{0}:Marker{1}", lost=(), space="Global"
):
    """Columns of three markers of each body, and of one alone."""
    rows = {
        "types": ["", "Type"],
        "names": ["", "Name"],
        "ids": ["", "ID"],
        "what": ["", ""],
        "axis": ["Frame", "Time (Seconds)"],
    }
    columns = []
    for body, (position, turn) in in_y_up(poses).items():
        places = [*marker_places(position, turn), position]
        names = [*(name.format(body, k) for k in (1, 2, 3)), f"Unlabeled {body}"]
        for at, called in zip(places, names, strict=True):
            rows["types"] += [kind if called in names[:3] else "Marker"] * 3
            rows["names"] += [called] * 3
            rows["ids"] += ["00:11"] * 3
            rows["what"] += ["Position"] * 3
            rows["axis"] += [*"XYZ"]
            columns.append(at)
    table = np.hstack(columns)
    numbers = [
        [str(k), f"{TIME[k]:.6f}", *(f"{value:.8f}" for value in table[k])] for k in range(N)
    ]
    for frame, column in lost:
        numbers[frame][2 + 3 * column : 5 + 3 * column] = [""] * 3
    write(folder / "take.csv", [about(rotation="None", space=space), [], *rows.values(), *numbers])


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("Rigid Body Marker", "{0}:Marker{1}"),
        ("Marker", "{0}:Marker{1}"),
        ("Rigid Body Marker", "{0}_{1}"),
    ],
)
def test_markers_of_motive_give_a_body(tmp_path, poses, kind, name):
    write_motive_markers(tmp_path, poses, kind, name)
    three = [{"markers": [name.format(body, k) for k in (1, 2, 3)]} for body in BODIES]
    assert_read(read(tmp_path, up="y", hand=three[0], ball=three[1]), poses)
    if ":" in name:
        assert_read(read(tmp_path, up="y"), poses)


def test_a_lone_marker_gives_a_position(tmp_path, poses):
    write_motive_markers(tmp_path, poses, lost=[(7, 3)])
    recording = read(
        tmp_path, up="y", hand={"body": "Unlabeled Hand"}, ball={"markers": ["Unlabeled Ball"]}
    )
    assert len(recording.bodies["hand"]) == N - 1
    np.testing.assert_allclose(recording.bodies["ball"].position, poses["Ball"][0], atol=1e-6)


def test_a_hidden_marker_of_three_is_a_body_that_was_not_seen_and_one_of_four_is_none(
    tmp_path, poses
):
    write_motive_markers(tmp_path, poses, lost=[(7, 1), (8, 4)])
    recording = read(tmp_path, up="y")
    assert [len(recording.bodies[role]) for role in ("hand", "ball")] == [N - 1, N - 1]
    four = [
        {"markers": [*(f"{body}:Marker{k}" for k in (1, 2, 3)), f"Unlabeled {body}"]}
        for body in BODIES
    ]
    assert_read(read(tmp_path, up="y", hand=four[0], ball=four[1]), poses)


def test_markers_on_a_line_are_refused(tmp_path, poses):
    _, turn = poses["Hand"]
    position = np.tile([0.3, 0.4, 1.0], (N, 1))
    head, numbers = motive_rows(
        {name: (position + [0.0, 0.1 * k, 0.0], turn) for k, name in enumerate("abc")},
        rotation="None",
    )
    write(tmp_path / "take.csv", [about(rotation="None"), [], *head.values(), *numbers])
    with pytest.raises(ValueError, match="first three markers lie on a line"):
        read(tmp_path, up="y", hand={"markers": ["a", "b", "c"]}, ball={"body": "a"})


ASKED = [
    (
        about(unit=None),
        {},
        {},
        r"does not say its length: add 'length:' to the mapping, one of m, cm, mm, in, ft",
    ),
    (about(unit="Klafter"), {}, {}, "add 'length:' to the mapping"),
    (["Formatversion", "1.23", "Längeneinheit", "Meter"], {}, {}, "add 'length:' to the mapping"),
    (
        about(),
        {"rotation": "XYZ"},
        {},
        r"how 'Hand' is turned: add 'rotation:' to the mapping, one of helical, XYZ",
    ),
    (about(rotation=None), {"rotation": "ZYX"}, {}, "add 'rotation:' to the mapping"),
    (
        about(space=None),
        {"kind": "Bone"},
        {},
        "does not say its Coordinate Space: add 'space: global' to the mapping",
    ),
    (
        about(space="Local"),
        {"kind": "Bone"},
        {},
        "relative to their parents: export it with world coordinates",
    ),
    (
        about(space="Local"),
        {"kind": "Bone"},
        {"space": "global"},
        "space is 'global' in the mapping, but the file itself says 'Local'",
    ),
    (about(), {}, {"length": "mm"}, "length is 'mm' in the mapping, but the file itself says 'm'"),
    (
        about(rotation="ZYX"),
        {"rotation": "ZYX"},
        {"rotation": "XYZ"},
        "rotation is 'XYZ' in the mapping, but the file itself says 'ZYX'",
    ),
    (
        about(rotation="ZYX"),
        {"rotation": "ZYX"},
        {"rotation": ["ZYX", "rad"]},
        "rotation is 'rad' in the mapping, but the file itself says 'deg'",
    ),
    (
        about(),
        {},
        {"rotation": "XYZ"},
        "rotation is 'XYZ' in the mapping, but 'Hand' has a quaternion in the file",
    ),
    (
        [*about(), "Length Units", "Feet"],
        {},
        {},
        "'Length Units' is told twice, as 'Meters' and as 'Feet'",
    ),
]


@pytest.mark.parametrize(("first", "form", "said", "message"), ASKED)
def test_what_an_export_does_not_say_is_asked_for_and_contradictions_are_errors(
    tmp_path, poses, first, form, said, message
):
    write_motive(tmp_path, poses, first=first, **form)
    with pytest.raises(ValueError, match=f"take.csv.*{message}"):
        read(tmp_path, up="y", hand=said)


ANSWERED = [
    (about(unit=None), {}, {"length": "m"}),
    (["Formatversion", "1.23", "Längeneinheit", "Meter"], {}, {"length": "m"}),
    (about(rotation=None), {"rotation": "ZYX"}, {"rotation": "ZYX"}),
    (about(space=None), {"kind": "Bone"}, {"space": "global"}),
    (about(space="Local"), {}, {}),
]


@pytest.mark.parametrize(("first", "form", "said"), ANSWERED)
def test_the_mapping_answers(tmp_path, poses, first, form, said):
    write_motive(tmp_path, poses, first=first, **form)
    assert_read(read(tmp_path, up="y", hand=said, ball=said), poses)


def test_axes_are_asked_for(tmp_path, poses):
    write_motive(tmp_path, poses)
    with pytest.raises(
        ValueError, match="does not say which axis points up: add 'up:' to the mapping"
    ):
        read(tmp_path)
    turned = ["x", "-z", "y"]
    assert_read(read(tmp_path, xyz=turned), poses)


def test_bodies_of_one_name_are_told_apart_by_their_numbers(tmp_path, poses):
    head, numbers = motive_rows(in_y_up(poses))
    head["names"] = [name.replace("Ball", "Hand") for name in head["names"]]
    write(tmp_path / "take.csv", [about(), [], *head.values(), *numbers])
    with pytest.raises(
        ValueError, match=rf"2 bodies are called 'Hand': name one of {1:032X}, {2:032X} instead"
    ):
        read(tmp_path, up="y")
    assert_read(
        read(tmp_path, up="y", hand={"body": f"{1:032X}"}, ball={"body": f"{2:032X}"}), poses
    )
    head["ids"] = ["", "ID", *["1"] * (len(head["ids"]) - 2)]
    write(tmp_path / "take.csv", [about(), [], *head.values(), *numbers])
    with pytest.raises(
        ValueError, match="2 bodies are called 'Hand': give them different names in the program"
    ):
        read(tmp_path, up="y")


def test_an_export_without_header_or_frames_is_told_what_is_missing(tmp_path, poses):
    head, numbers = motive_rows(in_y_up(poses))
    write(tmp_path / "take.csv", [about(), [], *head.values()])
    with pytest.raises(
        ValueError, match="line 7: there are no frames below the names of its columns"
    ):
        read(tmp_path, up="y")
    write(tmp_path / "take.csv", [about(), [], *numbers])
    with pytest.raises(ValueError, match="lines above the numbers name the columns"):
        read(tmp_path, up="y")
    write(tmp_path / "take.csv", numbers)
    with pytest.raises(
        ValueError,
        match=(
            "no export of a motion capture program that is known .*a table is read with 'table:'"
            " and columns"
        ),
    ):
        read(tmp_path, up="y")


def test_the_first_versions_of_motive_have_a_line_for_each_frame(tmp_path, poses):
    rows = [
        ["comment", "Units"],
        ["righthanded"],
        ["info", "version", "1.1"],
        ["info", "rigidbodycount", "2"],
    ]
    rows += [["rigidbody", "Hand", "1", "0"], ["rigidbody", "Ball", "7", "0"]]
    for k in range(N):
        seen = [("7", in_y_up(poses)["Ball"]), ("1", in_y_up(poses)["Hand"])][: 1 if k == 3 else 2]
        cells = [
            [number, *(f"{x:.8f}" for x in (*p[k], *q.as_quat()[k])), "0", "0", "0"]
            for number, (p, q) in seen
        ]
        rows.append(
            [
                "frame",
                str(k),
                f"{TIME[k]:.6f}",
                str(len(seen)),
                *(cell for one in cells for cell in one),
                "0",
            ]
        )
        rows.append(["rigidbody", str(k), f"{TIME[k]:.6f}", "Hand", "1"])
    write(tmp_path / "take.csv", rows)
    with pytest.raises(ValueError, match="add 'length:'"):
        read(tmp_path, up="y")
    recording = read(tmp_path, up="y", length="m")
    assert len(recording.bodies["hand"]) == N - 1
    np.testing.assert_allclose(recording.bodies["ball"].position, poses["Ball"][0], atol=1e-6)
    assert (
        Rotation.from_quat(recording.bodies["ball"].quaternion) * poses["Ball"][1].inv()
    ).magnitude().max() < 1e-5


# --- Vicon ---


def write_vicon(
    folder,
    poses,
    title="Objects",
    turn="quaternion",
    angle="deg",
    blank=0,
    before=(),
    rate="100",
    units=True,
    zeros=(),
):
    names, columns, unit = ["", ""], ["Frame", "Sub Frame"], ["", ""]
    numbers = []
    for name, (position, turned) in poses.items():
        values = {
            "quaternion": turned.as_quat(),
            "helical": turned.as_rotvec(),
            "XYZ": turned.as_euler("XYZ"),
            "": np.empty((N, 0)),
        }[turn]
        width = values.shape[1]
        values = np.degrees(values) if width == 3 and angle == "deg" else values
        numbers.append(np.hstack([values, 1e3 * position]))
        names += [f"{name}:{name}" if width else name, *[""] * (width + 2)]
        columns += [*("RX", "RY", "RZ", "RW")[:width], *("TX", "TY", "TZ")] if width else [*"XYZ"]
        unit += [*[angle if width == 3 else ""] * width, *["mm"] * 3]
    table = np.hstack(numbers)
    for frame, first, last in zeros:
        table[frame, first:last] = 0.0
    rows = (
        [[""]] * blank
        + list(before)
        + [[title], [rate], names, columns, *([unit] if units else [])]
    )
    rows += [[str(k), "0", *(f"{value:.6f}" for value in table[k])] for k in range(N)]
    write(folder / "take.csv", [*rows, []])


@pytest.mark.parametrize("title", ["Objects", "Segments"])
@pytest.mark.parametrize("blank", [0, 2])
def test_quaternions_of_vicon_need_no_mapping(tmp_path, poses, title, blank):
    write_vicon(tmp_path, poses, title, blank=blank)
    assert_read(read(tmp_path), poses)


def test_semicolons_and_decimal_commas_of_vicon(tmp_path, poses):
    write_vicon(tmp_path, poses)
    text = (tmp_path / "take.csv").read_text()
    (tmp_path / "take.csv").write_text(text.replace(",", ";").replace(".", ","))
    assert_read(read(tmp_path), poses)


@pytest.mark.parametrize("turn", ["helical", "XYZ"])
@pytest.mark.parametrize("angle", ["deg", "rad"])
def test_three_numbers_of_an_orientation_of_vicon_are_asked_for(tmp_path, poses, turn, angle):
    write_vicon(tmp_path, poses, turn=turn, angle=angle)
    with pytest.raises(
        ValueError,
        match="how 'Hand:Hand' is turned: add 'rotation:' to the mapping, one of helical, XYZ",
    ):
        read(tmp_path)
    assert_read(read(tmp_path, hand={"rotation": turn}, ball={"rotation": turn}), poses, atol=1e-5)


def test_units_that_vicon_does_not_tell_are_asked_for(tmp_path, poses):
    write_vicon(tmp_path, poses, turn="helical", units=False)
    with pytest.raises(ValueError, match="add 'length:'"):
        read(tmp_path)
    with pytest.raises(ValueError, match="one of helical, .*, and rad or deg"):
        read(tmp_path, length="mm")
    said = {"length": "mm", "rotation": ["helical", "deg"]}
    assert_read(read(tmp_path, hand=said, ball=said), poses, atol=1e-5)


def test_marker_trajectories_of_nexus_stand_behind_other_blocks(tmp_path, poses):
    devices = [
        ["Devices"],
        ["1000"],
        ["", "", "Force"],
        ["Frame", "Sub Frame", "Fx", "Fy", "Fz"],
        ["", "", "N", "N", "N"],
    ]
    devices += [[str(k), str(s), "1", "2", "3"] for k in range(3) for s in range(10)] + [[]]
    angles = [
        ["Model Outputs"],
        ["100"],
        ["", "", "Hand:Wrist", "", ""],
        ["Frame", "Sub Frame", "X", "Y", "Z"],
        ["", "", "deg", "deg", "deg"],
    ]
    angles += [["1", "0", "1", "2", "3"], []]
    markers = {}
    for name, (position, turn) in poses.items():
        markers |= {
            f"{name}:m{k}": (at, turn) for k, at in enumerate(marker_places(position, turn), 1)
        }
    write_vicon(
        tmp_path, markers, "Trajectories", turn="", before=[*devices, *angles], zeros=[(4, 0, 3)]
    )
    recording = read(tmp_path)
    assert len(recording.bodies["hand"]) == N - 1, "zeros are a marker that was not seen"
    np.testing.assert_allclose(recording.bodies["ball"].position, poses["Ball"][0], atol=1e-6)
    lone = read(tmp_path, hand={"body": "Hand:m2"}, ball={"body": "Ball:m1"})
    np.testing.assert_allclose(lone.bodies["hand"].position, markers["Hand:m2"][0], atol=1e-6)


# --- Qualisys ---


def write_qualisys(path, poses, kind="6D", named=True, timed=True, matrix=True, end="", null=()):
    key = "BODY_NAMES" if kind == "6D" else "MARKER_NAMES"
    rows = [
        ["NO_OF_FRAMES", str(N)],
        ["NO_OF_CAMERAS", "8"],
        ["FREQUENCY", "100"],
        ["DESCRIPTION", "--"],
    ]
    rows += [
        ["TIME_STAMP", "2020-01-22, 17:47:17", "22107.9"],
        ["DATA_INCLUDED", kind],
        [key, *poses],
    ]
    columns = ["Frame", "Time"] if timed else []
    parts = []
    for name, (position, turn) in poses.items():
        parts.append(1e3 * position)
        columns += (
            [f"{name} X", "Y", "Z"] if kind == "6D" else [f"{name} X", f"{name} Y", f"{name} Z"]
        )
        if kind == "6D":
            columns += [
                "Roll",
                "Pitch",
                "Yaw",
                "Residual",
                *([f"Rot[{k}]" for k in range(9)] if matrix else []),
            ]
            parts += [turn.as_euler("XYZ", degrees=True), np.ones((N, 1))]
            parts += [turn.as_matrix().transpose(0, 2, 1).reshape(N, 9)] if matrix else []
    rows += [["EVENT", "Start", "1", "0.0"]]
    rows += (
        [columns]
        if named
        else [["TRAJECTORY_TYPES", *["Measured"] * len(poses)]]
        if kind == "3D"
        else []
    )
    table = np.hstack(parts)
    for k in range(N):
        cells = [f"{value:.6f}" for value in table[k]]
        cells = ["NULL"] * len(cells) if k in null else cells
        rows.append(
            [*([str(k + 1), f"{TIME[k]:.5f}"] if timed else []), *cells, *([""] if end else [])]
        )
    write(path, rows, "\t")


def test_bodies_of_qtm_are_read_by_their_matrices(tmp_path, poses):
    write_qualisys(tmp_path / "take.tsv", poses)
    assert_read(read(tmp_path, "take.tsv"), poses)


def test_the_columns_of_the_matrix_are_those_of_a_published_file(tmp_path):
    """A line of a public recording (shiplab/dt_cv): roll -0.6563 degrees, and Rot[5] is -0.01145."""
    columns = [
        "PSVH X",
        "Y",
        "Z",
        "Roll",
        "Pitch",
        "Yaw",
        "Residual",
        *(f"Rot[{k}]" for k in range(9)),
    ]
    line = "-194.91974 2.24150 0.99661 -0.65630 0.09391 0.05772 4.98536"
    line += " 1.00000 0.00099 -0.00165 -0.00101 0.99993 -0.01145 0.00164 0.01145 0.99993"
    rows = [
        ["NO_OF_FRAMES", "1"],
        ["FREQUENCY", "100"],
        ["BODY_NAMES", "PSVH"],
        ["Frame", "Time", *columns],
        ["1", "0.00000", *line.split()],
    ]
    write(tmp_path / "take.tsv", rows, "\t")
    body = read(tmp_path, "take.tsv", hand={"body": "PSVH"}, ball={"body": "PSVH"}).bodies["hand"]
    expected = Rotation.from_euler("XYZ", [-0.65630, 0.09391, 0.05772], degrees=True)
    assert (Rotation.from_quat(body.quaternion[0]) * expected.inv()).magnitude() < 1e-3


def test_angles_of_qtm_are_asked_for(tmp_path, poses):
    write_qualisys(tmp_path / "take.tsv", poses, matrix=False)
    with pytest.raises(ValueError, match="how 'Hand' is turned: add 'rotation:'"):
        read(tmp_path, "take.tsv")
    assert_read(
        read(tmp_path, "take.tsv", hand={"rotation": "XYZ"}, ball={"rotation": "XYZ"}), poses
    )


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("timed", [True, False])
@pytest.mark.parametrize("end", ["", "\t"])
def test_markers_of_qtm_are_read_in_every_form(tmp_path, poses, named, timed, end):
    write_qualisys(tmp_path / "take.tsv", poses, "3D", named, timed, end=end, null=(3,))
    recording = read(tmp_path, "take.tsv")
    assert len(recording.bodies["hand"]) == N - 1
    np.testing.assert_allclose(
        recording.bodies["ball"].position, np.delete(poses["Ball"][0], 3, axis=0), atol=1e-6
    )


# --- markers of any program ---


def write_trc(path, poses, unit="mm", spaced=False):
    names = list(poses)
    rows = [["PathFileType", "4", "(X/Y/Z)", "take.trc"]]
    rows.append(
        [
            "DataRate",
            "CameraRate",
            "NumFrames",
            "NumMarkers",
            "Units",
            "OrigDataRate",
            "OrigDataStartFrame",
            "OrigNumFrames",
        ]
    )
    rows.append(["100", "100", str(N), str(len(names)), unit, "100", "1", str(N)])
    rows.append(["Frame#", "Time", *(cell for name in names for cell in (name, "", ""))])
    rows.append(["", "", *(f"{axis}{k}" for k in range(1, len(names) + 1) for axis in "XYZ")])
    table = np.hstack([position / METRES.get(unit, 1.0) for position, _ in poses.values()])
    rows += [[]] + [
        [str(k + 1), f"{TIME[k]:.6f}", *(f"{value:.8f}" for value in table[k])] for k in range(N)
    ]
    write(
        path,
        [[cell for cell in cells if cell] for cells in rows] if spaced else rows,
        " " if spaced else "\t",
    )


@pytest.mark.parametrize("unit", ["mm", "m", "cm"])
@pytest.mark.parametrize("spaced", [False, True])
def test_trc_files_are_read(tmp_path, poses, unit, spaced):
    write_trc(tmp_path / "take.trc", in_y_up(poses), unit, spaced)
    assert_read(read(tmp_path, "take.trc", up="y"), poses, is_turned=False)


def test_a_trc_file_without_a_unit_is_asked_for_it(tmp_path, poses):
    write_trc(tmp_path / "take.trc", poses, "?")
    with pytest.raises(ValueError, match="add 'length:'"):
        read(tmp_path, "take.trc", up="z")
    assert_read(read(tmp_path, "take.trc", up="z", length="m"), poses, is_turned=False)


def write_c3d(path, poses, unit="mm", rate=100.0, upright="+Z", lost=()):
    """Markers of both bodies, by the package itself, which warns that nothing analog is in it."""
    import c3d

    writer = c3d.Writer(point_rate=rate, point_units=unit)
    for k in range(N):
        places = [
            1e3 * place[k]
            for position, turn in poses.values()
            for place in marker_places(position, turn)
        ]
        points = np.hstack([places, np.zeros((len(places), 2))])
        for _, marker in (one for one in lost if one[0] == k):
            points[marker, 3] = -1.0
        writer.add_frames([(points, np.empty((0, 0)))])
    writer.set_point_labels([f"{name}{k}" for name in poses for k in (1, 2, 3)])
    if upright:
        writer.set_screen_axis(X="+X", Y=upright)
    with open(path, "wb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer.write(stream)


THREE = [{"markers": [f"{body}{k}" for k in (1, 2, 3)]} for body in BODIES]


def test_c3d_files_are_read_with_their_units_and_axes(tmp_path, poses):
    pytest.importorskip("c3d")
    write_c3d(tmp_path / "take.c3d", poses)
    first = read(tmp_path, "take.c3d", hand=THREE[0], ball=THREE[1])
    assert_read(first, poses, atol=1e-5, start=0.01)
    write_c3d(tmp_path / "take.c3d", in_y_up(poses), upright="+Y", lost=[(3, 1)])
    recording = read(tmp_path, "take.c3d", hand=THREE[0], ball=THREE[1])
    assert len(recording.bodies["hand"]) == N - 1
    np.testing.assert_allclose(recording.bodies["ball"].position, poses["Ball"][0], atol=1e-5)
    (tmp_path / "take.c3d").write_bytes((tmp_path / "take.c3d").read_bytes()[:700])
    with pytest.raises(ValueError, match="no C3D file, or a damaged one|no markers"):
        read(tmp_path, "take.c3d", hand=THREE[0], ball=THREE[1])


def test_without_the_package_for_c3d_the_remedy_is_named(tmp_path, monkeypatch):
    (tmp_path / "take.c3d").write_bytes(b"\x02P" + bytes(510))
    monkeypatch.setitem(sys.modules, "c3d", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ModuleNotFoundError) as complaint:
        read(tmp_path, "take.c3d", up="z")
    assert "pip install 'dart_skill[c3d]'" in explained(complaint.value)


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0.0 0.0 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Arm
  {
    OFFSET 10.0 5.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Hand
    {
      OFFSET 0.0 30.0 0.0
      CHANNELS 3 Yrotation Xrotation Zrotation
      End Site
      {
        OFFSET 0.0 5.0 0.0
      }
    }
  }
  JOINT Ball
  {
    OFFSET -10.0 5.0 2.0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0.0 5.0 0.0
    }
  }
}
MOTION
Frames: 40
Frame Time: 0.01
"""


@pytest.mark.parametrize("indent", ["  ", "\t"])
def test_joints_of_a_skeleton_are_where_its_angles_put_them(tmp_path, indent):
    rng = np.random.default_rng(5)
    values = rng.uniform(-60.0, 60.0, (N, 18))
    lines = "\n".join(" ".join(f"{x:.6f}" for x in row) for row in values)
    (tmp_path / "take.bvh").write_text(BVH.replace("  ", indent) + lines + "\n")
    with pytest.raises(ValueError, match="add 'length:'"):
        read(tmp_path, "take.bvh", up="y")
    recording = read(tmp_path, "take.bvh", length="cm", up="y")
    for k in (0, 17):
        hips, ball = (
            Rotation.from_euler(order, values[k, at], degrees=True)
            for order, at in (("ZXY", [3, 4, 5]), ("ZYX", [15, 16, 17]))
        )
        arm = hips * Rotation.from_euler("ZXY", values[k, 6:9], degrees=True)
        hand = arm * Rotation.from_euler("YXZ", values[k, 9:12], degrees=True)
        place = values[k, :3] + hips.apply([10.0, 5.0, 0.0]) + arm.apply([0.0, 30.0, 0.0])
        np.testing.assert_allclose(
            recording.bodies["hand"].position[k], Y_UP.apply(1e-2 * place), atol=1e-6
        )
        turned = Rotation.from_quat(recording.bodies["hand"].quaternion[k])
        assert (turned * (Y_UP * hand).inv()).magnitude() < 1e-6
        place = values[k, :3] + hips.apply(values[k, 12:15])
        np.testing.assert_allclose(
            recording.bodies["ball"].position[k], Y_UP.apply(1e-2 * place), atol=1e-6
        )
        assert (
            Rotation.from_quat(recording.bodies["ball"].quaternion[k]) * (Y_UP * hips * ball).inv()
        ).magnitude() < 1e-6
    assert recording.bodies["hand"].stamp_ns[-1] == (N - 1) * 10_000_000


# --- what is no such file ---


def test_what_a_file_does_not_hold_is_named_with_what_it_does(tmp_path, poses):
    write_motive(tmp_path, poses)
    with pytest.raises(ValueError, match="nothing is called 'Glove' in it, only Hand, .*Ball"):
        read(tmp_path, up="y", hand={"body": "Glove"})


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("take.tak", "a file of Motive: open it there, and export CSV"),
        ("bodies.ttp", "a file of Motive"),
        ("trial.x2d", "a file of Vicon: open it in Nexus or Tracker, and export C3D or ASCII"),
        ("hand.vsk", "a file of Vicon"),
        ("throws.qtm", "a file of QTM: open it there, and export TSV"),
        ("person.mvnx", "a file of Xsens: open it in MVN, and export BVH or C3D"),
        ("person.fbx", "not read: export BVH of a skeleton, C3D or TRC of markers"),
    ],
)
def test_files_that_only_their_program_reads_say_what_to_export(tmp_path, file, message):
    for content in (
        b"\0\1\2\3" * 100,
        b'<?xml version="1.0"?>\n<bones rotation="" position="" bone=""/>\n',
    ):
        (tmp_path / file).write_bytes(content)
        with pytest.raises(ValueError, match=f"{file}: {message}"):
            read(tmp_path, file, up="y")


def test_the_content_counts_before_the_ending(tmp_path, poses):
    write_motive(tmp_path, poses, file="export.tak")
    assert_read(read(tmp_path, "export.tak", up="y"), poses)
    write_trc(tmp_path / "take.csv", in_y_up(poses))
    assert_read(read(tmp_path, up="y"), poses, is_turned=False)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"\1\0\0\0" * 99, "no text file: export it as text"),
        (b"PK\3\4" + bytes(99), "no text file: a workbook"),
    ],
)
def test_what_holds_no_text_is_refused(tmp_path, content, message):
    (tmp_path / "take.csv").write_bytes(content)
    with pytest.raises(ValueError, match=f"take.csv: {message}"):
        read(tmp_path, up="y")
    with pytest.raises(ValueError, match="nothing.csv: No such file"):
        read(tmp_path, "nothing.csv", up="y")


WRONG = [
    ({"body": "a", "markers": ["b"]}, "hand: give body or markers, not both"),
    ({"markers": ["b", "b"]}, "markers is .*; give a list of different names"),
    ({"rotation": "abc"}, "rotation is 'abc'; give one or two of helical, XYZ, .*rad, deg"),
    ({"rate": 0}, "rate is 0; give the frames per second"),
    ({"space": "local"}, "space is 'local'; give one of global"),
]


@pytest.mark.parametrize(("said", "message"), WRONG)
def test_a_wrong_mapping_of_a_file_is_an_error(said, message):
    with pytest.raises(MappingError, match=message):
        parse_mapping(
            {
                "hand": {"capture": "take.csv", **said},
                "ball": {"topic": "/b"},
                "basket": {"position": [1, 0, 0]},
            }
        )


def test_a_file_becomes_a_bag(tmp_path, poses):
    write_motive(tmp_path, poses)
    mapping = {"axes": {"up": "y"}, "basket": {"position": [2.0, 0.3, 0.4]}}
    mapping |= {
        role: {"capture": "take.csv", "body": name}
        for role, name in (("hand", "Hand"), ("ball", "Ball"))
    }
    convert(tmp_path, tmp_path / "bag", parse_mapping(mapping))
    assert_read(read_recording(tmp_path / "bag", mend=False), poses)


def test_a_mapping_with_files_is_written_as_it_is_read():
    hand = {
        "capture": "take.csv",
        "markers": ["a", "b", "c"],
        "up": "z",
        "length": "m",
        "rotation": ["XYZ", "deg"],
        "rate": 100.0,
    }
    ball = {"capture": "take.csv", "body": "Ball", "space": "global", "xyz": ["x", "-z", "y"]}
    mapping = parse_mapping({"hand": hand, "ball": ball, "basket": {"position": [2.0, 0.3, 0.4]}})
    written = parse_mapping(yaml.safe_load(mapping_text(mapping)))
    for role in ("hand", "ball"):
        assert written.bodies[role].capture == mapping.bodies[role].capture
        assert (
            written.bodies[role].axes == mapping.bodies[role].axes
            and written.bodies[role].length == "m"
        )
    assert "length" in written.bodies["hand"].told and "length" not in written.bodies["ball"].told
