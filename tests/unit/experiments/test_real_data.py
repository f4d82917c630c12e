"""Published demonstrations: their files are read, what is missing is named, and paths are compared
as dynamic time warping defines it.
"""

import numpy as np
import pytest
from scipy.io import savemat

from dart_skill.cli import main
from dart_skill.experiments.studies.published_sets import (
    helloworld_sets,
    lasa_shapes,
    pbdlib_mixture,
    pbdlib_sets,
    robotasks_sets,
    tpgmm_sets,
)
from dart_skill.experiments.studies.real_data import (
    handwriting,
    led,
    left_out,
    mean_angle,
    poses,
    run,
    several_patterns,
    table,
)

STARTS = np.random.default_rng(0).normal([-40.0, 20.0], 2.0, (7, 2))


@pytest.fixture
def lasa(tmp_path):
    """Files as those of LASA, with curves of our own in them: seven demonstrations [mm] to the
    origin, columns in time.

    Three of those of several patterns come from the other side.
    """
    (tmp_path / "DataSet").mkdir()
    for name in ("Bow", "Multi_Models_9"):
        demos = np.empty(7, dtype=object)
        for i, start in enumerate(STARTS):
            if name == "Multi_Models_9" and i >= 4:
                start = start * [-1.0, 1.0]
            time = np.linspace(0.0, 2.0 + 0.2 * i, 200)
            s = time / time[-1]
            s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            pos = np.outer(start, 1.0 - s) + np.outer([0.0, 15.0], np.sin(np.pi * s))
            demos[i] = {
                "pos": pos,
                "t": time[None],
                "vel": np.gradient(pos, time, axis=1),
                "dt": time[1],
            }
        savemat(tmp_path / "DataSet" / f"{name}.mat", {"demos": demos[None], "dt": 0.01})
    return tmp_path


@pytest.fixture
def planar(tmp_path):
    """Files as those of pbdlib: six reaches, as seen from the frame of the start and that of the
    goal, turned by 0.3 rad.
    """
    folder, rng = tmp_path / "pbdlib" / "data" / "TPGMM", np.random.default_rng(1)
    folder.mkdir(parents=True)
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    for i in range(6):
        ends = np.array([[0.0, 0.0], [100.0, 50.0]]) + rng.normal(0.0, 10.0, (2, 2))
        s = np.linspace(0.0, 1.0, 80 + 5 * i)[:, None]
        s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        path = ends[0] + s * (ends[1] - ends[0])
        np.save(folder / f"reach{i}.npy", np.hstack([(path - end) @ turn for end in ends]))
        for p, end in enumerate(ends):
            np.save(folder / f"reach_tp_{p}_d_{i}_A.npy", turn)
            np.save(folder / f"reach_tp_{p}_d_{i}_b.npy", end)
    return tmp_path


@pytest.fixture
def arm(tmp_path):
    """Files as those of clfd: six letters [cm] to the origin, and six tasks that turn the wrist by
    100 degrees, w first.
    """
    letters, tasks = (
        tmp_path / "clfd/datasets/robot_hello_world/processed_demos",
        tmp_path / "clfd/datasets/robottasks/pos_ori",
    )
    for folder in (letters, tasks):
        folder.mkdir(parents=True)
    starts = np.random.default_rng(3).normal([-20.0, 10.0, 30.0], 1.0, (6, 3))
    s = np.linspace(0.0, 1.0, 300)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    paths = starts[:, None] * (1.0 - s[:, None]) + np.outer(np.sin(np.pi * s), [0.0, 5.0, 0.0])
    half = np.radians(50.0) * s
    turned = np.column_stack([np.cos(half), 0.0 * s, np.sin(half), 0.0 * s])
    turned[150:] *= -1.0  # the same orientations
    np.save(
        letters / "h.npy", np.concatenate([paths[..., :2], np.zeros_like(paths[..., :2])], axis=-1)
    )
    np.save(
        tasks / "pour.npy", np.concatenate([paths, np.broadcast_to(turned, (6, 300, 4))], axis=-1)
    )
    return tmp_path


@pytest.fixture
def aligned(tmp_path):
    """Files as those of TP-GMM: six reaches of a hand [m] between turned frames, aligned in time,
    so that they wait and jump.

    Two more have other stamps. Frames stand side by side, as often as there were samples before
    the alignment.
    """
    folder, rng = tmp_path / "TP-GMM" / "data", np.random.default_rng(2)
    folder.mkdir(parents=True)
    for i in range(8):
        start, goal = np.array([[0.3, 0.0, 0.5], [0.6, 0.2, 0.1]]) + rng.normal(0.0, 0.05, (2, 3))
        index = np.sort(
            np.concatenate([rng.integers(0, 300, 80), np.repeat(rng.integers(0, 300, 24), 5)])
        )
        index[[0, -1]] = 0, 299
        s = np.linspace(0.0, 1.0, 300)[index, None]
        path = start + s**3 * (10.0 - 15.0 * s + 6.0 * s**2) * (goal - start)
        stamps = np.arange(len(path)) + (0.0 if i < 6 else 40.0)
        np.savetxt(
            folder / f"Demon_{i}_sample_Data.txt",
            np.vstack([stamps, path.T]),
            fmt="%.5f",
            delimiter=",",
        )
        turn = np.eye(4)
        turn[1:3, 1:3] = [[0.0, -1.0], [1.0, 0.0]]
        for p, end in enumerate((start, goal), 1):
            np.savetxt(
                folder / f"Demon_{i}_sample_frame{p}_A.txt", np.hstack([turn] * 300), delimiter=","
            )
            np.savetxt(
                folder / f"Demon_{i}_sample_frame{p}_b.txt",
                np.repeat([[0.0], *end[:, None]], 300, axis=1),
                delimiter=",",
            )
    return tmp_path


def test_letters_and_poses_of_a_led_arm_are_read(arm):
    (letter,), (task,) = helloworld_sets(arm).values(), robotasks_sets(arm / "clfd").values()
    assert (
        len(letter) == len(task) == 6
        and letter[0].position.shape == (300, 2)
        and letter[0].orientation is None
    )
    assert task[0].time[60] == pytest.approx(1.0) and task[0].position.shape == (300, 3)
    half = np.radians(50.0)
    np.testing.assert_allclose(
        task[0].orientation[[0, -1]],
        [[0.0, 0.0, 0.0, 1.0], [0.0, np.sin(half), 0.0, np.cos(half)]],
        atol=1e-12,
    )


@pytest.mark.slow
def test_a_led_arm_is_followed_from_other_starts(arm):
    for score in led("h", helloworld_sets(arm)["h"]):
        assert score.train < 0.1 and score.test < 0.3, score
    scores = {score.method: score for score in poses("pour", robotasks_sets(arm)["pour"])}
    assert len(scores) >= 4 and np.isnan(scores["DSGMR"].worst)
    assert scores["PoseDSGMR"].test < 0.3 and scores["PoseDSGMR"].turned < 1.0, scores["PoseDSGMR"]
    assert scores["DiscretePosePrimitive, nearest"].worst < 0.1, scores[
        "DiscretePosePrimitive, nearest"
    ]
    assert "pour" in table(list(scores.values())) and "1  " in table(
        led("h", helloworld_sets(arm)["h"])
    )


def test_the_angle_along_an_alignment_is_that_between_orientations():
    """A turn about y by 20 degrees more, at any speed, and of either sign of the quaternion."""

    def turn(degrees):
        half = 0.5 * np.radians(degrees)
        return np.column_stack([np.sin(half), 0.0 * half, 0.0 * half, np.cos(half)])

    still = np.full(500, 30.0)
    assert mean_angle(-turn(still + 20.0), turn(still)) == pytest.approx(20.0)


def test_recordings_with_the_same_stamps_are_a_set(aligned):
    sets = tpgmm_sets(aligned)
    assert list(map(len, sets.values())) == [6, 2] and list(sets) == [
        "Demon_200",
        "Demon_200_from_Demon_6",
    ]
    for one in sum(sets.values(), []):
        assert (
            one.position.shape == (200, 3)
            and [frame.A.shape for frame in one.frames] == [(4, 4)] * 2
        )
        np.testing.assert_allclose(
            one.position[[0, -1]], [frame.b[1:] for frame in one.frames], atol=1e-5
        )


@pytest.mark.slow
def test_a_path_is_learned_where_an_alignment_has_spoilt_the_stamps(aligned):
    first = next(iter(tpgmm_sets(aligned).values()))
    as_published, _, _, path, _, positions = left_out("reach", first)
    assert (as_published.method, path.method, positions.method) == (
        "DSGMR",
        "DSGMR, retimed",
        "GMR, retimed",
    )
    assert path.goal < 0.5 < as_published.goal and path.test < as_published.test, (
        as_published,
        path,
    )


def test_a_frame_that_moves_and_a_peer_that_is_not_there_are_said(aligned):
    file = aligned / "TP-GMM" / "data" / "Demon_0_sample_frame1_b.txt"
    offsets = np.loadtxt(file, delimiter=",")
    offsets[1, 5] += 0.1
    np.savetxt(file, offsets, delimiter=",")
    with pytest.raises(
        ValueError, match=r"Demon_0_sample_Data.txt cannot be read .*the frame moves"
    ):
        tpgmm_sets(aligned)
    with pytest.raises(ValueError, match=r"no pbdlib/gmm.py in .*nowhere"):
        pbdlib_mixture(aligned / "nowhere")


def test_shapes_are_read_with_time_first(lasa):
    shapes = lasa_shapes(lasa)
    assert list(shapes) == ["Bow"] and list(lasa_shapes(lasa / "DataSet", several=True)) == [
        "Multi_Models_9"
    ]
    assert [one.position.shape for one in shapes["Bow"]] == [(200, 2)] * 7
    np.testing.assert_allclose([one.position[0] for one in shapes["Bow"]], STARTS)
    np.testing.assert_allclose([one.time[-1] for one in shapes["Bow"]], 2.0 + 0.2 * np.arange(7))


def test_positions_of_a_planar_set_are_those_of_the_world(planar):
    for one in pbdlib_sets(planar)["reach"]:
        assert len(one.frames) == 2 and np.diff(one.time) == pytest.approx(0.01)
        np.testing.assert_allclose(
            one.position[[0, -1]], [frame.b[1:] for frame in one.frames], atol=1e-9
        )


@pytest.mark.slow
def test_a_shape_is_reproduced_and_every_start_comes_to_the_goal(lasa):
    scores = {score.method: score for score in handwriting("Bow", lasa_shapes(lasa)["Bow"])}
    print(table(list(scores.values())))
    assert scores["AutonomousDSGMR"].arrived == 1.0
    assert scores["DSGMR"].train < 500 * 1.0 and scores["DSGMR"].test < 500 * 2.0, (
        "the mean over 500 samples, 1 and 2 mm"
    )
    assert scores["DiscretePrimitive, nearest"].train < 500 * 0.2


@pytest.mark.slow
def test_patterns_are_drawn_one_by_one_and_not_as_their_mean(lasa):
    as_one, each = several_patterns(
        "Multi_Models_9", lasa_shapes(lasa, several=True)["Multi_Models_9"]
    )
    assert each.method == "AutonomousDSGMR, 2 patterns" and each.test < 500 * 2.0 < as_one.test
    assert "Multi_Models_9" in table([as_one, each])


@pytest.mark.slow
def test_what_is_left_out_is_reached_in_its_frames(planar):
    for score in left_out("reach", pbdlib_sets(planar)["reach"]):
        assert score.test < 3.0 and score.goal < (5.0 if "prior" in score.method else 1.5), score


@pytest.mark.slow
def test_the_command_prints_a_table_of_what_is_there(lasa, capsys):
    assert main(["experiment", "real_data", "--data", str(lasa), "--shapes", "Bow"]) == 0
    assert "AutonomousDSGMR" in capsys.readouterr().out


def test_what_is_missing_or_damaged_is_said_with_where_it_is_published(lasa, tmp_path):
    for load in (lasa_shapes, helloworld_sets, robotasks_sets, pbdlib_sets, tpgmm_sets, run):
        with pytest.raises(ValueError, match=r"nothing holds no .*published at https://"):
            load(tmp_path / "nothing")
    with pytest.raises(ValueError, match="there is no Angel in .*it holds Bow"):
        run(lasa, shapes=["Angel"])
    letters = tmp_path / "datasets" / "robot_hello_world" / "processed_demos"
    letters.mkdir(parents=True)
    np.save(letters / "h.npy", np.zeros((4, 2)))
    with pytest.raises(
        ValueError, match=r"h.npy cannot be read .*shape \(N, n, 2\), got \(4, 2\)"
    ):
        helloworld_sets(tmp_path)
    (lasa / "DataSet" / "Bow.mat").write_bytes(b"no MATLAB file at all")
    with pytest.raises(ValueError, match=r"Bow.mat cannot be read .*published at https://"):
        run(lasa)
