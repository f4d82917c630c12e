"""Every mapping that docs/recordings.md shows reads files that are made here, and every command
that it shows runs.
"""

import re

import numpy as np
import pytest
import scipy.io
import yaml
from scipy.spatial.transform import Rotation

from dart_skill.cli import main
from dart_skill.recording.imports import parse_mapping, read_recording
from tests.paths import DOCS
from tests.unit.recording.test_motion_capture import (
    TIME,
    N,
    in_y_up,
    marker_places,
    write_c3d,
    write_motive,
    write_trc,
    write_vicon,
)

PAGE = (DOCS / "recordings.md").read_text(encoding="utf-8")
BLOCKS = [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)]
OF_FILES = [block for block in BLOCKS if "topic" not in block["hand"]]
BVH = """HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
JOINT RightHand
{
OFFSET 0 0 0
CHANNELS 3 Zrotation Xrotation Yrotation
}
}
MOTION
Frames: 40
Frame Time: 0.01
"""


@pytest.fixture(scope="module")
def poses():
    turn = Rotation.from_rotvec(np.linspace(0.1, 1.0, N)[:, None] * [0.2, 0.5, -0.4])
    at = np.column_stack([0.4 + 0.3 * np.sin(4.0 * TIME), 0.1 + TIME, 1.0 + 0.2 * TIME])
    return {"Hand": (at, turn), "Ball": (at + [1.0, 0.2, 0.1], turn)}


@pytest.fixture
def folder(tmp_path, poses):
    """A folder with every file that the page names."""
    path = tmp_path / "thursday"
    path.mkdir()
    at, turn = poses["Hand"]
    table = np.column_stack([1e3 * TIME, 1e3 * at, turn.as_quat()[:, [3, 0, 1, 2]]])
    rows = [";".join(map(repr, row)) for row in table.tolist()]
    (path / "hand.csv").write_text("\n".join(["t;x;y;z;qw;qx;qy;qz", *rows]).replace(".", ","))
    joints = ["\t".join(["t", *(f"q{k}" for k in range(1, 8))])]
    joints += [
        "\t".join(map(repr, map(float, [t, *np.degrees(0.1 * np.arange(7) + t)])))
        for t in TIME.tolist()
    ]
    (path / "joints.tsv").write_text("\n".join(joints))
    np.savez(path / "hand.npz", t=TIME, p=at, q=turn.as_quat())
    scipy.io.savemat(
        path / "hand.mat", {"t": TIME, "hand": {"position": at, "quaternion": turn.as_quat()}}
    )
    write_vicon(path, poses, "Objects", "helical", "rad")
    (path / "take.csv").rename(path / "tracker.csv")
    write_vicon(path, poses, "Segments", "XYZ", "deg")
    (path / "take.csv").rename(path / "nexus.csv")
    carried = {
        f"Hand{k}": (place, turn) for k, place in enumerate([*marker_places(at, turn), at], 1)
    }
    write_vicon(path, {**carried, "Ball1": poses["Ball"]}, "Trajectories", "")
    (path / "take.csv").rename(path / "trajectories.csv")
    write_motive(path, {**poses, "RHand": poses["Hand"]})
    write_trc(path / "throw.trc", in_y_up(carried))
    numbers = np.hstack(
        [
            1e2 * in_y_up(poses)["Hand"][0],
            in_y_up(poses)["Hand"][1].as_euler("ZXY", degrees=True),
            np.zeros((N, 3)),
        ]
    )
    (path / "person.bvh").write_text(
        BVH + "\n".join(" ".join(f"{x:.6f}" for x in row) for row in numbers)
    )
    return path


def whole(block):
    """A mapping of a block: what it leaves out stands somewhere, or is as in the page's first one."""
    axes = (
        {}
        if {"up", "length"} & set(block["hand"]) or "take.csv" not in block["hand"].values()
        else {"axes": {"up": "y"}}
    )
    return {
        **axes,
        "ball": {"position": [0.0, 0.0, 1.0]},
        "basket": {"position": [2.0, 0.3, 0.4]},
        **block,
    }


@pytest.mark.parametrize(
    "block", OF_FILES, ids=[str(next(iter(block["hand"].values()))) for block in OF_FILES]
)
def test_a_mapping_of_the_page_reads_the_file_that_it_names(folder, poses, block):
    if "throw.c3d" in block["hand"].values():
        pytest.importorskip("c3d")
        write_c3d(folder / "throw.c3d", poses)
    recording = read_recording(folder, parse_mapping(whole(block)), mend=False)
    at, turn = poses["Hand"]
    hand = recording.bodies["hand"]
    np.testing.assert_allclose(hand.position, at, atol=2e-5)
    assert (Rotation.from_quat(hand.quaternion) * turn.inv()).magnitude().max() < 1e-3
    assert len(hand) == N and recording.bodies["basket"].position[0].tolist() == [2.0, 0.3, 0.4]
    if "joints" in block:
        np.testing.assert_allclose(
            recording.joints.position, 0.1 * np.arange(7) + TIME[:, None], atol=1e-12
        )


def test_the_first_command_makes_a_bag(folder, poses, monkeypatch, capsys):
    monkeypatch.chdir(folder.parent)
    (folder.parent / "thursday.yaml").write_text(
        yaml.safe_dump(next(block for block in OF_FILES if "axes" in block))
    )
    assert "dart-skill bag convert thursday --mapping thursday.yaml --output thursday_ours" in PAGE
    assert main("bag convert thursday --mapping thursday.yaml --output thursday_ours".split()) == 0
    assert f"{N} poses of the hand, {N} poses of the ball" in capsys.readouterr().out
    np.testing.assert_allclose(
        read_recording("thursday_ours", mend=False).bodies["hand"].position,
        poses["Hand"][0],
        atol=2e-6,
    )


def test_a_bag_of_ros1_is_named_itself(tmp_path, recorded_session, monkeypatch, capsys):
    """Throws that our own recorder wrote, as ROS 1 would have recorded them."""
    from tests.unit.recording.test_ros1 import as_ros1

    monkeypatch.chdir(tmp_path)
    as_ros1(recorded_session[0], tmp_path / "lab.bag")
    (block,) = [block for block in BLOCKS if "topic" in block["hand"]]
    block["hand"]["topic"] = "/vrpn_mocap/hand/pose"
    block["ball"] = {"topic": "/vrpn_mocap/ball/pose"}
    block["basket"] = {"topic": "/vrpn_mocap/basket/pose"}
    (tmp_path / "thursday.yaml").write_text(yaml.safe_dump(block))
    assert (
        "dart-skill bag info lab.bag" in PAGE
        and "dart-skill learn lab.bag --mapping thursday.yaml" in PAGE
    )
    assert main("bag info lab.bag".split()) == 0
    assert "geometry_msgs/msg/PoseStamped" in capsys.readouterr().out
    assert main("learn lab.bag --mapping thursday.yaml".split()) == 0
    assert "learned from" in capsys.readouterr().out
