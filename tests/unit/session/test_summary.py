"""The summary of a run: its numbers, its JSON, its table."""

import json

import numpy as np
import pytest

from dart_skill.session import DemoSummary, ThrowResult, footer, table, write_summary
from dart_skill.session._summary import error_quantile

TARGET = (2.0, 0.0, 0.4)
NAN = float("nan")


def throw(error, inside=True, target=TARGET, message=""):
    """A throw that lands `error` metres beyond its target, or that nobody saw for None."""
    if error is None:
        return ThrowResult(target, None, None, inside, message)
    direction = np.array(target[:2]) / np.hypot(*target[:2])
    x, y = np.array(target[:2]) + error * direction
    return ThrowResult(target, (x, y, target[2]), error, inside, message)


def summary(*throws, **changes):
    return DemoSummary(**{"seed": 4, "bag": "run/bag", "demonstrations": 13, "throws": throws, "wall_seconds": 61.5,
                          "real_time_factor": 4.25, **changes})  # fmt: skip


def strict(value):
    """Through JSON and back; NaN and infinity are errors both ways."""

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(json.dumps(value, allow_nan=False), parse_constant=refuse)


def test_json_holds_what_was_promised():
    run = strict(summary(throw(0.01), throw(0.03), throw(0.20, inside=False)).to_json())
    assert {key: run[key] for key in ("seed", "bag", "demonstrations", "thrown", "in", "wall_seconds", "real_time_factor")} == {
        "seed": 4, "bag": "run/bag", "demonstrations": 13, "thrown": 3, "in": 2, "wall_seconds": 61.5, "real_time_factor": 4.25,
    }  # fmt: skip
    assert run["median_error_m"] == pytest.approx(0.03)
    assert run["p90_error_m"] == pytest.approx(0.03 + 0.8 * 0.17), (
        "linear between the 2nd and the 3rd of 3 errors"
    )
    assert run["throws"][2] == {
        "target": [2.0, 0.0, 0.4],
        "landing": [2.2, 0.0, 0.4],
        "error_m": 0.2,
        "in": False,
        "message": "",
    }


def test_a_landing_that_nobody_saw_is_null_and_has_no_part_in_the_median():
    unseen = ThrowResult(TARGET, (NAN, NAN, NAN), NAN, False)
    run = strict(summary(throw(0.02), unseen).to_json())
    assert run["throws"][1]["landing"] is None and run["throws"][1]["error_m"] is None
    assert (run["in"], run["thrown"], run["landings_seen"]) == (1, 2, 1)
    assert run["median_error_m"] == pytest.approx(0.02)


def test_a_ball_seen_in_the_basket_counts_even_if_its_landing_was_not_seen():
    assert summary(throw(None, inside=True), throw(None, inside=False)).n_in == 1


@pytest.mark.parametrize(
    "throws", [(), (throw(None, inside=False),)], ids=["no throws", "nobody saw a landing"]
)
def test_without_a_landing_there_is_no_median(throws):
    run = strict(summary(*throws).to_json())
    assert run["median_error_m"] is None and run["p90_error_m"] is None and run["in"] == 0
    assert "median" not in table(summary(*throws))


def test_times_that_are_not_finite_become_null():
    run = strict(summary(wall_seconds=NAN, real_time_factor=float("inf")).to_json())
    assert (
        run["wall_seconds"] is None
        and run["real_time_factor"] is None
        and run["throw_real_time_factor"] is None
    )
    assert strict(summary(throw_real_time_factor=2.5).to_json())["throw_real_time_factor"] == 2.5


def test_numbers_of_numpy_become_plain_ones(tmp_path):
    target, landing = np.array([1.5, 0.5, 0.4]), np.array([1.5, 0.52, 0.4])
    result = ThrowResult(target, landing, np.float64(0.02), np.bool_(True))
    path = write_summary(
        summary(result, seed=np.int64(3), wall_seconds=np.float32(2.5), bag=tmp_path),
        tmp_path / "new",
    )
    assert path == tmp_path / "new" / "summary.json"
    assert strict(json.loads(path.read_text()))["throws"][0]["target"] == [1.5, 0.5, 0.4]


def test_quantiles_are_those_of_the_errors():
    errors = np.random.default_rng(0).uniform(0.0, 0.3, 37)
    throws = [throw(error) for error in errors]
    assert error_quantile(throws, 0.9) == pytest.approx(np.percentile(errors, 90))


def test_the_table_has_a_line_for_every_throw_and_ends_with_the_result():
    missed = throw(0.2, inside=False, message="ball\nslipped")
    lines = table(summary(throw(0.011), throw(0.02, target=(1.5, 1.5, 0.4)), missed)).splitlines()
    assert len(lines) == 5
    assert lines[1].split() == [
        "1",
        "2.000",
        "0.000",
        "0.400",
        "+0.0",
        "2.00",
        "2.011",
        "0.000",
        "1.1",
        "in",
    ]
    assert lines[2].split()[4:6] == ["+45.0", "2.12"]
    assert lines[3].endswith("20.0     out  ball slipped") and lines[0].endswith("note")
    assert lines[-1] == "in 2/3, median 2.0 cm, 90 % 16.4 cm"


def test_columns_of_the_table_are_aligned():
    lines = table(
        summary(throw(0.01), throw(None, inside=False), throw(0.5, target=(1.0, -1.0, 0.4)))
    ).splitlines()[:-1]
    ends = [
        line.rstrip().rindex(word) + len(word)
        for line, word in zip(lines, ("result", "in", "out", "in"), strict=True)
    ]
    assert len(set(ends)) == 1, lines


def test_the_footer_says_how_many_landings_were_seen():
    assert (
        footer([throw(0.01), throw(None, inside=False)])
        == "in 1/2, median 1.0 cm, 90 % 1.0 cm, landing seen 1/2"
    )
    assert footer([throw(None, inside=False)]) == "in 0/1, landing seen 0/1"
    assert footer([]) == "no throws"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target": (NAN, 0.0, 0.4)}, "target .* not finite"),
        ({"target": (2.0, 0.0)}, r"target has shape \(2,\)"),
        ({"landing": None}, "give both"),
        ({"error_m": NAN}, "give both"),
        ({"error_m": 0.07}, "0.0200 m from the target"),
    ],
)
def test_a_throw_that_contradicts_itself_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        ThrowResult(
            **{
                "target": TARGET,
                "landing": (2.02, 0.0, 0.4),
                "error_m": 0.02,
                "in_basket": True,
                **change,
            }
        )
