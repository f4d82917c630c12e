"""Learners beside each other: what each makes of movements whose truth is known, how a set is read,
and what the table says.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from dart_skill.cli import main
from dart_skill.experiments.studies.published_sets import Demonstrated, letter_sets, lpvds_sets
from dart_skill.experiments.studies.rivals import (
    METHODS,
    Asked,
    Prediction,
    Shown,
    ends_of,
    left_out,
    run,
    table,
    warped_mean,
)
from tests.paths import ROOT

PHASE = np.linspace(0.0, 1.0, 100)[:, None]
EASED = PHASE**3 * (10.0 - 15.0 * PHASE + 6.0 * PHASE**2)


def reach(start, end):
    """A straight reach with a bend that is always the same."""
    return start + EASED * (end - start) + np.sin(np.pi * EASED) * [0.0, 0.1]


@pytest.fixture(scope="module")
def paths():
    rng = np.random.default_rng(0)
    return [reach(rng.normal(0.0, 0.05, 2), rng.normal([0.6, 0.3], 0.05)) for _ in range(7)]


@pytest.fixture(scope="module")
def shown(paths):
    return Shown(2.0 * PHASE[:, 0], paths[1:], [ends_of(one) for one in paths[1:]])


@pytest.fixture(scope="module")
def asked(paths):
    return Asked(ends_of(paths[0]), paths[0][0], paths[0][-1])


FAST = ("mean path, warped", "PerStepGaussians()", "ProMP()")


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(m, marks=[pytest.mark.slow] if "(8)" in m or "same" in m else [])
        for m in METHODS
    ],
)
def test_every_method_makes_what_is_shown_without_fail(method, shown, asked, paths):
    made = METHODS[method](shown)(asked)
    off = np.linalg.norm(made - paths[0], axis=1)
    assert made.shape == (100, 2) and off.max() < 0.06, off.max()
    if method.endswith("end met") or method in ("PerStepGaussians()", "ProMP()", "KMP()"):
        assert off[-1] < 1e-6


def test_a_warped_mean_is_exact_where_only_the_ends_differ(shown, asked, paths):
    """Of straight movements with the same time law it shifts by phase, and they by ease."""
    made = warped_mean(shown)(asked)
    np.testing.assert_allclose(made[[0, -1]], paths[0][[0, -1]], atol=1e-12)
    mean = np.mean(shown.paths, axis=0)
    np.testing.assert_allclose(
        made[50] - mean[50],
        (1 - PHASE[50]) * (paths[0][0] - mean[0]) + PHASE[50] * (paths[0][-1] - mean[-1]),
    )


@pytest.fixture(scope="module")
def predictions(paths):
    demonstrations = [Demonstrated(2.0 * PHASE[:, 0], one) for one in paths[:4]]
    return left_out(("led arm", "reach", demonstrations, 2), methods=FAST)


def test_fewer_demonstrations_are_among_more_and_all_methods_get_the_same(predictions):
    assert {one.method for one in predictions} == set(FAST)
    assert {(one.left_out, one.shown, one.draw) for one in predictions} == {
        (i, 2, 0) for i in range(4)
    }
    exact = [one.end for one in predictions if one.method == "PerStepGaussians()"]
    assert max(exact) < 1e-6


def test_the_table_says_who_is_behind_and_by_how_much():
    """Paired: differences 1, 2 and 3 of mean 2 and standard error 1 / sqrt(3)."""
    one = Prediction("led arm", "reach", 5, 0, 0, "good", 4.0, 0.5, 1.0, 2.0)
    rows = [
        replace(one, left_out=i, method=method, error=4.0 + i + behind)
        for i in range(3)
        for method, behind in (("good", 0.0), ("bad", 1.0 + i))
    ]
    text = table(rows)
    good, bad = (
        next(line for line in text.splitlines() if line.startswith(m)) for m in ("good", "bad")
    )
    assert "0.00 +- 0.00" in good and "5.00" in good
    assert "2.00 +- 0.58" in bad and "7.00" in bad
    assert "led arm: 5 shown, 3 left out, 1 set" in text


def test_draws_of_one_demonstration_are_averaged_before_they_are_compared():
    one = Prediction("led arm", "reach", 5, 0, 0, "only", 4.0, 0.5, 1.0, 2.0)
    rows = [replace(one, left_out=i, draw=k, error=4.0 + k) for i in range(2) for k in range(3)]
    assert "5 shown, 2 left out" in table(rows) and "5.00" in table(rows)


@pytest.fixture
def folder(tmp_path, paths):
    """Files as those of lpvds and of robInfLib."""
    (tmp_path / "dataset" / "pc-gmm-data").mkdir(parents=True)
    (tmp_path / "2Dletters").mkdir()
    cells, letters = np.empty((5, 1), dtype=object), np.empty((1, 4), dtype=object)
    for i, one in enumerate(paths[:5]):
        rows = np.column_stack([one, 0.2 * PHASE])
        velocity = np.vstack([np.diff(rows, axis=0) / 0.02, np.zeros(3)])
        cells[i, 0] = np.hstack([rows, velocity]).T
    for i, one in enumerate(paths[:4]):
        letters[0, i] = {"pos": one.T, "vel": one.T, "acc": one.T}
    savemat(tmp_path / "dataset" / "pc-gmm-data" / "3D_reach.mat", {"data": cells})
    savemat(tmp_path / "dataset" / "pc-gmm-data" / "3D_timed.mat", {"data": cells, "dt": 0.01})
    savemat(tmp_path / "2Dletters" / "Z.mat", {"demos": letters})
    return tmp_path


def test_sets_of_an_arm_and_letters_are_read(folder, paths):
    sets = lpvds_sets(folder)
    assert list(sets) == ["3D_reach", "3D_timed"] and len(sets["3D_reach"]) == 5
    told, given = (sets[name][2].time for name in sets)
    assert np.diff(told) == pytest.approx(0.02) and np.diff(given) == pytest.approx(0.01)
    np.testing.assert_allclose(sets["3D_reach"][2].position[:, :2], paths[2])
    (letter,) = letter_sets(folder).values()
    np.testing.assert_allclose(letter[3].position, paths[3])


@pytest.mark.slow
def test_the_command_prints_a_table_of_what_is_there(folder, capsys):
    options = ["--data", str(folder), "--sets", "3D_reach", "--shown", "3"]
    assert main(["experiment", "rivals", *options]) == 0
    told = capsys.readouterr().out
    assert "led arm, lpvds: 3 shown, 5 left out, 1 set" in told and "PerStepGaussians()" in told


def test_demonstrations_of_a_bag_are_a_set():
    found = run(bags=[ROOT / "bags" / "demonstrations"], counts=[2], methods=FAST)
    assert {one.name for one in found} == {"demonstrations"} and len(found) == 13 * len(FAST)


def test_what_there_is_not_is_said(folder, tmp_path):
    for given, why in (
        ({}, "there is no set: give a folder, bags, or a number"),
        ({"folder": folder, "names": ["Q"]}, "there is no Q; there are 3D_reach, 3D_timed, Z"),
        ({"folder": folder, "methods": ["luck"]}, "there is no method luck"),
        ({"folder": tmp_path / "nowhere"}, "published at https://github.com/SunannnSun/lpvds"),
    ):
        with pytest.raises(ValueError, match=why):
            run(**given)
    (folder / "2Dletters" / "Z.mat").write_bytes(b"no MATLAB file")
    with pytest.raises(ValueError, match=r"Z.mat cannot be read"):
        run(folder)
