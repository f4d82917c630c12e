"""Tables whose columns a mapping names: text in other forms, arrays of NumPy, MATLAB and Parquet."""

import numpy as np
import pandas as pd
import pytest
import scipy.io
from scipy.spatial.transform import Rotation

from dart_skill.recording.imports import parse_mapping, read_recording

N, START_NS = 30, 1_700_000_000_123_456_789
STAMPS = START_NS + 10_000_000 * np.arange(N)
TIMES = [f"{stamp // 10**9}.{stamp % 10**9:09d}" for stamp in STAMPS.tolist()]
POSITION = np.column_stack(
    [np.linspace(0.1, 0.9, N), np.sin(np.arange(N)), 1.0 + 0.01 * np.arange(N)]
).round(6)
QUATERNION = (
    Rotation.from_rotvec(np.linspace(0.0, 1.0, N)[:, None] * [0.0, 0.0, 1.0]).as_quat().round(9)
)
NAMES = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
COLUMNS = {"time": "t", "position": ["x", "y", "z"], "quaternion": ["qx", "qy", "qz", "qw"]}


def read(folder, file, columns=None, key="table", **more):
    mapping = {"ball": {"position": [0.0, 0.0, 0.0]}, "basket": {"position": [2.0, 0.3, 0.4]}}
    return read_recording(
        folder,
        parse_mapping({**mapping, "hand": {key: file, "columns": columns or COLUMNS, **more}}),
        mend=False,
    )


def assert_read(recording, stamps=STAMPS, kept=slice(None)):
    body = recording.bodies["hand"]
    np.testing.assert_array_equal(body.stamp_ns, stamps[kept])
    np.testing.assert_array_equal(body.position, POSITION[kept])
    np.testing.assert_array_equal(body.quaternion, QUATERNION[kept])


def rows(comma=False):
    numbers = [
        [time, *map(repr, map(float, [*p, *q]))]
        for time, p, q in zip(TIMES, POSITION, QUATERNION, strict=True)
    ]
    return [[cell.replace(".", ",") for cell in cells] for cells in numbers] if comma else numbers


def write(path, header, delimiter=",", comma=False, encoding="utf-8", numbers=None):
    lines = [delimiter.join(cells) for cells in (*header, *(numbers or rows(comma)))]
    path.write_bytes("\n".join(lines).encode(encoding))


TEXTS = {
    "commas": {},
    "semicolons": {"delimiter": ";"},
    "tabs": {"delimiter": "\t"},
    "spaces": {"delimiter": "  "},
    "semicolons and decimal commas": {"delimiter": ";", "comma": True},
    "tabs and decimal commas": {"delimiter": "\t", "comma": True},
    "UTF-16": {"encoding": "utf-16"},
    "a mark of UTF-8": {"encoding": "utf-8-sig"},
}


@pytest.mark.parametrize("form", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("key", ["table", "csv"])
def test_delimiters_and_decimal_commas_need_not_be_told(tmp_path, form, key):
    write(tmp_path / "hand.csv", [NAMES], **form)
    assert_read(read(tmp_path, "hand.csv", key=key))


def test_headers_may_be_in_quotes_and_in_two_lines(tmp_path):
    write(tmp_path / "hand.csv", [[f'"{name}"' for name in NAMES]])
    assert_read(read(tmp_path, "hand.csv"))
    write(
        tmp_path / "hand.csv",
        [["", "hand", "", "", "hand rot", "", "", ""], ["t", *"xyz", *"xyzw"]],
    )
    columns = {
        "time": "t",
        "position": [f"hand {one}" for one in "xyz"],
        "quaternion": [f"hand rot {one}" for one in "xyzw"],
    }
    assert_read(read(tmp_path, "hand.csv", columns, header_lines=2))
    with pytest.raises(
        ValueError,
        match=(
            "several columns are called 'x'; the columns are t, hand x, hand y, hand z, hand rot x"
        ),
    ):
        read(tmp_path, "hand.csv", {**columns, "position": ["x", "y", "z"]}, header_lines=2)
    write(tmp_path / "hand.csv", [NAMES, ["s", "m", "m", "m", "", "", "", ""]])
    assert_read(read(tmp_path, "hand.csv", header_lines=2))


@pytest.mark.parametrize(
    ("header", "said", "message"),
    [
        (
            [["t", "x [mm]", "y", "z", *NAMES[4:]]],
            {},
            r"column 'x \[mm\]' is in mm, but length is 'm' in the mapping: give 'length: mm'",
        ),
        (
            [["t (ms)", *NAMES[1:]]],
            {},
            r"column 't \(ms\)' is in ms, but time is 's' in the mapping: give 'time: ms'",
        ),
        (
            [NAMES, ["s", "cm", "cm", "cm", "", "", "", ""]],
            {"header_lines": 2},
            "column 'cm' is in cm, but length is 'm'",
        ),
    ],
)
def test_units_in_a_header_that_the_mapping_contradicts_are_errors(
    tmp_path, header, said, message
):
    write(tmp_path / "hand.csv", header)
    columns = {"time": 1, "position": [2, 3, 4], "quaternion": [5, 6, 7, 8]}
    with pytest.raises(ValueError, match=f"hand.csv.*{message}"):
        read(tmp_path, "hand.csv", columns, **said)


def test_commas_that_could_mean_two_things_are_refused(tmp_path):
    numbers = rows()
    numbers[3][1] = "1,234"
    write(tmp_path / "hand.csv", [NAMES], ";", numbers=numbers)
    with pytest.raises(
        ValueError,
        match=(
            "line 5: '1,234' has a comma and other numbers have a point: export it without commas"
            " for thousands"
        ),
    ):
        read(tmp_path, "hand.csv")
    write(tmp_path / "hand.csv", [NAMES], ",", numbers=rows(comma=True))
    with pytest.raises(
        ValueError, match="line 2: 16 cells for 8 columns: are these decimal commas"
    ):
        read(tmp_path, "hand.csv")


@pytest.mark.parametrize("word", ["", "NaN", "nan", "NULL", "N/A", "-", "-nan(ind)", " "])
def test_words_for_nothing_are_nothing(tmp_path, word):
    numbers = rows()
    numbers[3] = [numbers[3][0], *[word] * 7]
    write(tmp_path / "hand.csv", [NAMES], numbers=numbers)
    assert_read(read(tmp_path, "hand.csv"), kept=np.arange(N) != 3)


def test_dates_are_times(tmp_path):
    numbers = [
        [str(np.datetime64(stamp, "ns")), *cells[1:]]
        for stamp, cells in zip(STAMPS.tolist(), rows(), strict=True)
    ]
    write(tmp_path / "hand.csv", [NAMES], numbers=numbers)
    assert_read(read(tmp_path, "hand.csv"))


def test_pandas_tables_are_read_as_they_are_written(tmp_path):
    frame = pd.DataFrame(
        np.hstack([POSITION, QUATERNION]),
        columns=list(NAMES[1:]),
        index=pd.Index(STAMPS, name="t"),
    )
    frame.to_csv(tmp_path / "hand.csv")
    assert_read(read(tmp_path, "hand.csv", time="ns"))
    frame.reset_index().to_parquet(tmp_path / "hand.parquet")
    assert_read(read(tmp_path, "hand.parquet", time="ns"))
    frame = frame.reset_index().astype({"x": "Float64"})
    frame.loc[3, list(NAMES[1:])] = pd.NA
    frame.to_parquet(tmp_path / "hand.parquet")
    assert_read(read(tmp_path, "hand.parquet", time="ns"), kept=np.arange(N) != 3)
    frame.assign(t=pd.to_datetime(frame.t)).to_parquet(tmp_path / "dates.parquet")
    assert_read(read(tmp_path, "dates.parquet"), kept=np.arange(N) != 3)


# --- arrays ---


def test_arrays_of_numpy_are_read(tmp_path):
    whole = {"time": "stamps", "position": "p", "quaternion": "q"}
    np.savez(tmp_path / "hand.npz", stamps=STAMPS, p=POSITION, q=QUATERNION, other=np.arange(3))
    assert_read(read(tmp_path, "hand.npz", whole, time="ns"))
    np.savez(tmp_path / "hand.npz", stamps=STAMPS[:, None], p=POSITION.T, q=QUATERNION.T)
    assert_read(read(tmp_path, "hand.npz", whole, time="ns"))
    np.savez(
        tmp_path / "hand.npz",
        t=STAMPS,
        **dict(zip(NAMES[1:], np.hstack([POSITION, QUATERNION]).T, strict=True)),
    )
    assert_read(read(tmp_path, "hand.npz", time="ns"))
    fields = np.zeros(N, dtype=[("t", "i8"), ("p", "f8", 3), ("q", "f8", 4)])
    fields["t"], fields["p"], fields["q"] = STAMPS, POSITION, QUATERNION
    np.save(tmp_path / "fields.npy", fields)
    assert_read(read(tmp_path, "fields.npy", {**whole, "time": "t"}, time="ns"))
    seconds = 0.25 * np.arange(N)
    np.save(tmp_path / "plain.npy", np.hstack([seconds[:, None], POSITION, QUATERNION]))
    numbers = {"time": 1, "position": [2, 3, 4], "quaternion": [5, 6, 7, 8]}
    assert_read(read(tmp_path, "plain.npy", numbers), stamps=250_000_000 * np.arange(N))
    np.savez(
        tmp_path / "dates.npz", stamps=STAMPS.astype("datetime64[ns]"), p=POSITION, q=QUATERNION
    )
    assert_read(read(tmp_path, "dates.npz", whole))


def test_variables_of_matlab_are_read(tmp_path):
    content = {"t": 0.25 * np.arange(N), "hand": {"pos": POSITION, "rot": {"q": QUATERNION.T}}}
    scipy.io.savemat(tmp_path / "hand.mat", content)
    columns = {"time": "t", "position": "hand.pos", "quaternion": "hand.rot.q"}
    assert_read(read(tmp_path, "hand.mat", columns), stamps=250_000_000 * np.arange(N))


def test_joints_may_be_one_array(tmp_path):
    np.savez(
        tmp_path / "arm.npz", t=STAMPS, q=np.arange(7.0 * N).reshape(N, 7), six=np.zeros((N, 6))
    )
    np.savez(tmp_path / "hand.npz", t=STAMPS, p=POSITION)
    mapping = {
        role: {"table": "hand.npz", "time": "ns", "columns": {"time": "t", "position": "p"}}
        for role in ("hand", "ball", "basket")
    }
    mapping["joints"] = {
        "table": "arm.npz",
        "time": "ns",
        "columns": {"time": "t", "position": "q"},
    }
    recording = read_recording(tmp_path, parse_mapping(mapping), mend=False)
    np.testing.assert_array_equal(recording.joints.position, np.arange(7.0 * N).reshape(N, 7))
    mapping["joints"]["columns"]["position"] = "six"
    with pytest.raises(ValueError, match="arm.npz: 6 columns of positions of 7 joints"):
        read_recording(tmp_path, parse_mapping(mapping), mend=False)


class Harmful:
    """What a pickle would run."""

    def __reduce__(self):
        raise AssertionError("nothing may be run")


def save_objects(path):
    np.save(path, np.array([{"x": 1}], dtype=object), allow_pickle=True)


def save_version_73(path):
    """As MATLAB writes it: a text of 128 bytes before HDF5."""
    path.write_bytes(
        b"MATLAB 7.3 MAT-file".ljust(124)
        + b"\x00\x02IM"
        + bytes(384)
        + b"\x89HDF\r\n\x1a\n"
        + bytes(512)
    )


REFUSED = [
    (
        "a.npy",
        save_objects,
        (
            "it holds Python objects; Python objects are not read, as they may run anything: save"
            " arrays of numbers"
        ),
    ),
    (
        "a.npy",
        lambda path: np.save(path, np.zeros((2, 3, 4))),
        r"an array of shape \(2, 3, 4\): save rows of columns",
    ),
    ("a.npy", lambda path: path.write_bytes(b"no array"), "a.npy: "),
    (
        "a.npz",
        lambda path: np.savez(path, other=STAMPS),
        "nothing is called 't' in it, only other",
    ),
    (
        "a.npz",
        lambda path: np.savez(path, t=STAMPS, p=np.zeros((5, 3))),
        r"position has the shape \(5, 3\), of which no side has the 30",
    ),
    (
        "a.npz",
        lambda path: np.savez(path, t=STAMPS, p=np.array([["a"] * 3] * N)),
        "position holds no numbers",
    ),
    (
        "a.npz",
        lambda path: np.savez(path, t=1e30 * np.ones(N), p=POSITION),
        "a time is not finite, or too large: is 's' its unit",
    ),
    (
        "a.npz",
        lambda path: np.savez(path, t=STAMPS, p=np.zeros((N, 2))),
        "position has 2 columns instead of 3",
    ),
    (
        "a.mat",
        save_version_73,
        r"written by MATLAB as version 7.3: save it with save\('a.mat', '-v7'\)",
    ),
    ("a.mat", lambda path: path.write_bytes(b"no file"), "no file of MATLAB"),
    ("a.parquet", lambda path: path.write_bytes(b"no file"), "no Parquet file"),
]


@pytest.mark.parametrize(("file", "save", "message"), REFUSED)
def test_what_cannot_be_read_is_refused_with_the_reason(tmp_path, file, save, message):
    save(tmp_path / file)
    with pytest.raises(ValueError, match=message):
        read(tmp_path, file, {"time": "t", "position": "p"})
    with pytest.raises(ValueError, match="nothing.npy: No such file"):
        read(tmp_path, "nothing.npy")
