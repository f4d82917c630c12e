"""Published demonstrations: their files are read, what is missing is named, and paths are compared as dynamic time warping defines it."""

import numpy as np
import pytest
from scipy.io import savemat

from dart_skill.cli import main
from dart_skill.experiments.published_sets import lasa_shapes, pbdlib_sets
from dart_skill.experiments.real_data import handwriting, left_out, run, several_patterns, table

STARTS = np.random.default_rng(0).normal([-40.0, 20.0], 2.0, (7, 2))


@pytest.fixture
def lasa(tmp_path):
    """Files as those of LASA, with curves of our own in them: seven demonstrations [mm] to the origin, columns in time.

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
            demos[i] = {"pos": pos, "t": time[None], "vel": np.gradient(pos, time, axis=1), "dt": time[1]}
        savemat(tmp_path / "DataSet" / f"{name}.mat", {"demos": demos[None], "dt": 0.01})
    return tmp_path


@pytest.fixture
def planar(tmp_path):
    """Files as those of pbdlib: six reaches, as seen from the frame of the start and that of the goal, turned by 0.3 rad."""
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


def test_shapes_are_read_with_time_first(lasa):
    shapes = lasa_shapes(lasa)
    assert list(shapes) == ["Bow"] and list(lasa_shapes(lasa / "DataSet", several=True)) == ["Multi_Models_9"]
    assert [one.position.shape for one in shapes["Bow"]] == [(200, 2)] * 7
    np.testing.assert_allclose([one.position[0] for one in shapes["Bow"]], STARTS)
    np.testing.assert_allclose([one.time[-1] for one in shapes["Bow"]], 2.0 + 0.2 * np.arange(7))


def test_positions_of_a_planar_set_are_those_of_the_world(planar):
    for one in pbdlib_sets(planar)["reach"]:
        assert len(one.frames) == 2 and np.diff(one.time) == pytest.approx(0.01)
        np.testing.assert_allclose(one.position[[0, -1]], [frame.b[1:] for frame in one.frames], atol=1e-9)


def test_a_shape_is_reproduced_and_every_start_comes_to_the_goal(lasa):
    scores = {score.method: score for score in handwriting("Bow", lasa_shapes(lasa)["Bow"])}
    print(table(list(scores.values())))
    assert scores["AutonomousDSGMR"].arrived == 1.0
    assert scores["DSGMR"].train < 500 * 1.0 and scores["DSGMR"].test < 500 * 2.0, "the mean over 500 samples, 1 and 2 mm"
    assert scores["DiscretePrimitive, nearest"].train < 500 * 0.2


def test_patterns_are_drawn_one_by_one_and_not_as_their_mean(lasa):
    as_one, each = several_patterns("Multi_Models_9", lasa_shapes(lasa, several=True)["Multi_Models_9"])
    assert each.method == "AutonomousDSGMR, 2 patterns" and each.test < 500 * 2.0 < as_one.test
    assert "Multi_Models_9" in table([as_one, each])


def test_what_is_left_out_is_reached_in_its_frames(planar):
    (score,) = left_out("reach", pbdlib_sets(planar)["reach"])
    assert score.test < 3.0 and score.goal < 1.5, score


def test_the_command_prints_a_table_of_what_is_there(lasa, capsys):
    assert main(["experiment", "real_data", "--data", str(lasa), "--shapes", "Bow"]) == 0
    assert "AutonomousDSGMR" in capsys.readouterr().out


def test_what_is_missing_or_damaged_is_said_with_where_it_is_published(lasa, tmp_path):
    for load in (lasa_shapes, pbdlib_sets, run):
        with pytest.raises(ValueError, match=r"nothing holds no .*published at https://"):
            load(tmp_path / "nothing")
    with pytest.raises(ValueError, match="there is no Angel in .*it holds Bow"):
        run(lasa, shapes=["Angel"])
    (lasa / "DataSet" / "Bow.mat").write_bytes(b"no MATLAB file at all")
    with pytest.raises(ValueError, match=r"Bow.mat cannot be read .*published at https://"):
        run(lasa)
