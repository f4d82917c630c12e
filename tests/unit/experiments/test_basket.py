"""The basket experiment: what it counts, that its results can be continued, and one tiny run."""

import json

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.common.regions import REGION
from dart_skill.experiments.parallel import run_tasks
from dart_skill.experiments.studies import basket
from dart_skill.experiments.studies.basket import (
    ASKED,
    PLACES,
    BasketRun,
    BasketTask,
    place_of,
    summarise,
    table,
    throws_of,
)

NAN = float("nan")


def at(distance, degrees):
    """A basket at a distance [m] and an azimuth."""
    return (
        float(distance * np.cos(np.deg2rad(degrees))),
        float(distance * np.sin(np.deg2rad(degrees))),
        0.4,
    )


def made(seed=0, models=("default", "thesis"), demonstrations=13):
    """A run by hand: two baskets where demonstrated, one to the side, two beyond."""
    targets = (at(2.0, 0), at(1.6, -44), at(2.0, 50), at(2.9, 0), at(1.3, 55))
    along = {"default": (0.03, -0.01, 0.04, NAN, 0.0), "thesis": (0.3, NAN, NAN, NAN, -0.6)}
    across = {"default": (0.04, 0.0, -0.03, NAN, 0.02), "thesis": (0.4, NAN, NAN, NAN, 0.0)}
    refused = {
        "default": (False, False, False, True, False),
        "thesis": (False, True, False, True, False),
    }
    inside = {"default": (True, True, True, False, True), "thesis": (False,) * 5}
    columns = [tuple(part[model] for model in models) for part in (along, across, inside, refused)]
    return BasketRun(
        BasketTask(seed, models, demonstrations, 5),
        targets,
        *columns,
        tuple(at(2.0, 3.0 * k) for k in range(demonstrations)),
    )


def row_of(rows, model, place, demonstrations=13):
    return next(
        row
        for row in rows
        if (row["model"], row["place"], row["demonstrations"]) == (model, place, demonstrations)
    )


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
    counts = np.bincount(places, minlength=3)
    assert counts.min() > 40 and counts.sum() == 400, counts


def test_rows_count_throws_hits_and_refusals_by_place():
    rows = summarise([made()])
    assert len(rows) == 2 * 3
    default, thesis = row_of(rows, "default", "as shown"), row_of(rows, "thesis", "as shown")
    assert (default["throws"], default["in"], default["refused"]) == (2, 2, 0)
    assert default["median_cm"] == pytest.approx((5.0 + 1.0) / 2) and default[
        "p90_cm"
    ] == pytest.approx(1.0 + 0.9 * 4.0)
    assert (thesis["throws"], thesis["in"], thesis["refused"], thesis["median_cm"]) == (
        2,
        0,
        1,
        50.0,
    ), "only one landing was seen"
    side = row_of(rows, "thesis", "to the side")
    assert side["median_cm"] is None and side["p90_cm"] is None and side["refused"] == 0, (
        "a throw whose landing nobody saw has no error"
    )
    beyond = row_of(rows, "default", "beyond")
    assert (beyond["throws"], beyond["in"], beyond["refused"], beyond["median_cm"]) == (
        2,
        1,
        1,
        2.0,
    )


def test_runs_with_other_numbers_of_demonstrations_are_not_mixed():
    rows = summarise([made(0), made(1), made(0, demonstrations=5)])
    assert row_of(rows, "default", "as shown")["throws"] == 4
    assert row_of(rows, "default", "as shown", 5)["throws"] == 2


def test_models_of_different_runs_are_told_apart():
    """In the second run 'thesis' comes first."""
    throws = throws_of([made(0), made(1, ("thesis", "default"))], "default", 13)
    np.testing.assert_allclose(throws.error[:3], throws.error[5:8])
    assert throws.refused.sum() == 2 and throws.in_basket.sum() == 8


def test_a_model_that_nobody_ran_is_an_error():
    with pytest.raises(
        ValueError, match="no run has the model 'weighted' after 13 demonstrations"
    ):
        throws_of([made()], "weighted", 13)


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
        BasketTask(0, **wrong)


def test_results_come_back_with_their_nan_and_are_not_run_again(tmp_path, monkeypatch):
    monkeypatch.setattr(basket, "run", lambda task: made(task.seed))
    file, tasks = tmp_path / "basket.jsonl", [made(seed).task for seed in range(2)]
    first = run_tasks(basket.run, tasks, basket.BasketRun, file, jobs=1)
    monkeypatch.setattr(basket, "run", lambda task: pytest.fail(f"{task} was run again"))
    again = run_tasks(basket.run, tasks, basket.BasketRun, file, jobs=1)
    assert repr(again) == repr(first), "nan is not equal to itself, but looks the same"
    assert np.isnan(again[0].along[0][3]) and summarise(again) == summarise(first)


@pytest.mark.slow
def test_the_command_prints_the_table_and_draws_maps_and_the_curve(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        basket, "run", lambda task: made(task.seed, task.models, task.demonstrations)
    )
    options = [
        "--models",
        "default",
        "--demonstrations",
        "5,13",
        "--seeds",
        "2",
        "--throws",
        "5",
        "--jobs",
        "1",
    ]
    assert main(["experiment", "basket", *options, "--figure", str(tmp_path), "--json"]) == 0
    printed = capsys.readouterr()
    rows = json.loads(printed.out)
    assert {(row["model"], row["demonstrations"]) for row in rows} == {
        ("default", 5),
        ("default", 13),
    }
    names = {"map_default_5", "map_default_13", "curve"}
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{name}.{kind}" for name in names for kind in ("svg", "png")
    }
    assert str(tmp_path / "curve.svg") in printed.err
    assert main(["experiment", "basket", "--models", "nonsense"]) == 1
    assert "no configuration 'nonsense'" in capsys.readouterr().err


@pytest.mark.slow
def test_a_tiny_run_throws_every_model_at_the_same_baskets():
    one = basket.run(BasketTask(0, ("default", "thesis"), 4, 3))
    assert np.shape(one.targets) == (3, 3) and np.shape(one.along) == np.shape(one.in_basket) == (
        2,
        3,
    )
    shown = np.array(one.shown)
    assert shown.shape == (4, 3) and (place_of(shown) == 0).all(), (
        f"demonstrated where nobody should: {shown}"
    )
    default, thesis = (throws_of([one], model, 4) for model in ("default", "thesis"))
    for throws in (default, thesis):
        assert (np.isnan(throws.error) | (throws.in_basket == (throws.error < 0.15))).all(), throws
        assert (
            np.isnan(throws.error[throws.refused]).all()
            and not throws.in_basket[throws.refused].any()
        )
    assert np.nanmedian(default.error) < 0.1, f"default after 4 demonstrations: {default.error}"
