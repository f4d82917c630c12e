"""The basket experiment: what it counts, that its results can be continued, its maps, and one tiny
run.
"""

import json
from xml.etree import ElementTree

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.common.regions import REGION
from dart_skill.experiments.parallel import run_tasks
from dart_skill.experiments.studies import basket
from dart_skill.experiments.studies.basket import (
    ASKED,
    AZIMUTHS,
    DISTANCES,
    PLACES,
    ModelThrows,
    basket_task,
    cells_of,
    draw_map,
    place_of,
    summarise,
    table,
    throws_of,
)

NAN = float("nan")
SVG = "{http://www.w3.org/2000/svg}"


def at(distance, degrees):
    """A basket at a distance [m] and an azimuth."""
    azimuth = np.deg2rad(degrees)
    return [float(distance * np.cos(azimuth)), float(distance * np.sin(azimuth)), 0.4]


def made(seed=0, models=("default", "thesis"), demonstrations=13):
    """A run by hand: two baskets where demonstrated, one to the side, two beyond."""
    columns = {
        "along": {"default": [0.03, -0.01, 0.04, NAN, 0.0], "thesis": [0.3, NAN, NAN, NAN, -0.6]},
        "across": {"default": [0.04, 0.0, -0.03, NAN, 0.02], "thesis": [0.4, NAN, NAN, NAN, 0.0]},
        "in_basket": {"default": [True, True, True, False, True], "thesis": [False] * 5},
        "refused": {
            "default": [False, False, False, True, False],
            "thesis": [False, True, False, True, False],
        },
    }
    return {
        "task": basket_task(seed, models, demonstrations, 5),
        "targets": [at(2.0, 0), at(1.6, -44), at(2.0, 50), at(2.9, 0), at(1.3, 55)],
        **{name: [column[model] for model in models] for name, column in columns.items()},
        "shown": [at(2.0, 3.0 * k) for k in range(demonstrations)],
    }


def row_of(rows, model, place, demonstrations=13):
    kind = {"model": model, "place": place, "demonstrations": demonstrations}
    return next(row for row in rows if kind.items() <= row.items())


@pytest.mark.parametrize(
    ("target", "place"),
    [
        (at(2.0, 0), "as shown"),
        (at(REGION.near + 1e-9, 44.9), "as shown"),
        (at(2.49, -44.9), "as shown"),
        (at(2.0, 45.1), "to the side"),
        (at(1.6, -60), "to the side"),
        (at(2.6, 0), "beyond"),
        (at(1.4, 0), "beyond"),
        (at(2.6, 50), "beyond"),
    ],
)
def test_a_basket_belongs_to_one_place(target, place):
    assert PLACES[place_of(np.array([target]))[0]] == place


def test_baskets_are_asked_for_at_all_three_places():
    places = place_of(ASKED.spread(400, np.random.default_rng(0)))
    assert np.bincount(places, minlength=3).min() > 40


def test_rows_count_throws_hits_and_refusals_by_place():
    rows = summarise([made()])
    assert len(rows) == 2 * 3
    for model, place, expected in (
        ("default", "as shown", (2, 2, 0, 3.0, 4.6)),
        ("thesis", "as shown", (2, 0, 1, 50.0, 50.0)),
        ("thesis", "to the side", (1, 0, 0, None, None)),
        ("default", "beyond", (2, 1, 1, 2.0, 2.0)),
    ):
        row = row_of(rows, model, place)
        names = ("throws", "in", "refused", "median_cm", "p90_cm")
        assert tuple(row[name] for name in names) == pytest.approx(expected), row


def test_runs_with_other_models_and_numbers_of_demonstrations_are_not_mixed():
    """In the second run 'thesis' comes first."""
    runs = [made(0), made(1, ("thesis", "default")), made(0, demonstrations=5)]
    rows = summarise(runs)
    assert row_of(rows, "default", "as shown")["throws"] == 4
    assert row_of(rows, "default", "as shown", 5)["throws"] == 2
    throws = throws_of(runs, "default", 13)
    np.testing.assert_allclose(throws.error[:3], throws.error[5:8])
    assert throws.refused.sum() == 2 and throws.in_basket.sum() == 8
    with pytest.raises(ValueError, match="no run has the model 'weighted' after 13"):
        throws_of(runs, "weighted", 13)


def test_the_table_has_a_line_per_model_and_says_what_was_refused():
    lines = table([made()]).splitlines()
    assert lines[1].startswith("default") and lines[2].startswith("thesis")
    assert "100.0 % of 2, 3.0, 4.6" in lines[1] and "50.0 % of 2, 2.0, 2.0, 1 refused" in lines[1]
    assert "0.0 % of 1" in lines[2] and "None" not in lines[2]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"models": ("nonsense",)}, "nonsense"),
        ({"demonstrations": 1}, "at least 2"),
        ({"throws": 0}, "at least 2 and 1"),
    ],
)
def test_a_task_that_cannot_be_run_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        basket_task(0, **wrong)


def test_results_come_back_with_their_nan_and_are_not_run_again(tmp_path):
    file, tasks = tmp_path / "basket.jsonl", [made(seed)["task"] for seed in range(2)]
    first = run_tasks(lambda task: made(task["seed"]), tasks, file, jobs=1)
    again = run_tasks(lambda task: pytest.fail(f"{task} was run again"), tasks, file, jobs=1)
    assert repr(again) == repr(first), "nan is not equal to itself, but looks the same"
    assert np.isnan(again[0]["along"][0][3]) and summarise(again) == summarise(first)


# maps


def test_the_borders_of_what_is_demonstrated_are_borders_of_cells():
    for borders, values in (
        (AZIMUTHS, (-REGION.side, REGION.side, -ASKED.side, ASKED.side)),
        (DISTANCES, (REGION.near, REGION.far, ASKED.near, ASKED.far)),
    ):
        assert np.abs(np.subtract.outer(values, borders)).min(axis=1).max() < 1e-12


def test_every_throw_is_in_one_cell():
    throws = throws_of([made(seed) for seed in range(3)], "thesis", 13)
    counts, share, median = cells_of(throws)
    assert counts.sum() == 15 and np.nansum(share * counts) == throws.in_basket.sum()
    assert (np.isnan(share) == (counts == 0)).all() and (counts[np.isfinite(median)] == 3).all()
    corner = at(ASKED.far, np.rad2deg(ASKED.side))  # far to the left: the last cell
    one = ModelThrows(np.array([corner]), np.array([0.05]), np.array([True]), np.array([False]))
    assert cells_of(one)[:, -1, -1].tolist() == [1.0, 1.0, 0.05]


def test_a_map_says_how_many_and_has_the_left_of_the_arm_on_its_left(tmp_path):
    paths = draw_map([made()], "default", 13, tmp_path)
    assert [path.name for path in paths] == ["map_default_13.svg", "map_default_13.png"]
    root = ElementTree.parse(paths[0]).getroot()
    texts = {"".join(one.itertext()): one for one in root.iter(f"{SVG}text")}
    said = " ".join(texts)
    for part in ("80.0 % of 5 throws", "1 refused", "Model 'default'", "[%]", "[cm]", "[m]"):
        assert part in said, part

    def x(text):
        place = texts[text].get("x") or texts[text].get("transform").partition("translate(")[2]
        return float(place.split()[0])

    assert x("2.0") < x("1.0"), "throws at 55 degrees to the left and at 44 to the right"


@pytest.mark.slow
def test_the_command_prints_the_table_and_draws_maps(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        basket, "run", lambda task: made(task["seed"], task["models"], task["demonstrations"])
    )
    options = "--models default --demonstrations 5,13 --seeds 2 --throws 5 --jobs 1 --json"
    assert main(["experiment", "basket", *options.split(), "--figure", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    kinds = {(row["model"], row["demonstrations"]) for row in json.loads(printed.out)}
    assert kinds == {("default", 5), ("default", 13)}
    assert {path.stem for path in tmp_path.iterdir()} == {"map_default_5", "map_default_13"}
    assert str(tmp_path / "map_default_13.svg") in printed.err
    assert main(["experiment", "basket", "--models", "nonsense"]) == 1
    assert "no configuration 'nonsense'" in capsys.readouterr().err


@pytest.mark.slow
def test_a_tiny_run_throws_every_model_at_the_same_baskets():
    one = basket.run(basket_task(0, ("default", "thesis"), 4, 3))
    assert np.shape(one["targets"]) == (3, 3)
    assert np.shape(one["along"]) == np.shape(one["in_basket"]) == (2, 3)
    shown = np.array(one["shown"])
    assert shown.shape == (4, 3) and (place_of(shown) == 0).all(), shown
    default, thesis = (throws_of([one], model, 4) for model in ("default", "thesis"))
    for throws in (default, thesis):
        assert (np.isnan(throws.error) | (throws.in_basket == (throws.error < 0.15))).all(), throws
        assert np.isnan(throws.error[throws.refused]).all()
        assert not throws.in_basket[throws.refused].any()
    assert np.nanmedian(default.error) < 0.1, f"default after 4 demonstrations: {default.error}"
