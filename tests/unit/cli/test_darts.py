"""`dart-skill darts`: what it prints, as text and as JSON, what it writes, and how it ends."""

import argparse
import contextlib
import io
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dart_skill.cli import main
from dart_skill.cli.darts import add_to
from dart_skill.darts import estimate_from_scores, local_optima, match_chance, solve_match

FIFTY = """12 16 19 3 17 1 25 19 17 50 18 1 3 17 2 2 13 18 16 2 25 5 5 1 5
4 17 25 25 50 3 7 17 17 3 3 3 7 11 10 25 1 19 15 4 1 5 12 17 16""".split()


@pytest.fixture
def run(capsys):
    """Runs `darts` with arguments; returns the exit status and what was printed, JSON parsed."""

    def call(*arguments):
        parser = argparse.ArgumentParser(prog="dart-skill")
        add_to(parser.add_subparsers(required=True))
        options = parser.parse_args(["darts", *map(str, arguments)])
        status = options.run(options)
        printed = capsys.readouterr().out
        return status, json.loads(printed) if options.json else printed

    return call


def test_aim_gives_the_best_aim_and_all_local_optima(run):
    status, result = run("aim", "--sigma", 16, "--json")
    optima = local_optima(16.0)
    keys = ("x_mm", "y_mm", "expected_score")
    assert status == 0
    assert [result[key] for key in keys] == [result["local_optima"][0][key] for key in keys]
    assert [aim["expected_score"] for aim in result["local_optima"]] == pytest.approx(
        [aim.expected_score for aim in optima]
    )
    assert (result["x_mm"], result["y_mm"]) == pytest.approx((-1.80, 105.85), abs=0.05)


@pytest.mark.parametrize("sigma", [20, 28.3, 7.07])
def test_sigma_comes_back_as_it_was_given(run, sigma):
    assert run("aim", "--sigma", sigma, "--json")[1]["sigma_mm"] == sigma


def test_aim_over_a_range_gives_the_jumps(run, tmp_path):
    status, result = run("aim", "--from", 16, "--to", 18, "--json", "--output", tmp_path)
    assert status == 0
    assert (
        [jump["sigma_mm"] for jump in result["jumps"]]
        == result["sigma_mm"]
        == pytest.approx([16.9069], abs=1e-3)
    )
    assert (
        result["jumps"][0]["below"]["bed"] == "T20" and result["jumps"][0]["above"]["bed"] == "T19"
    )
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".png", ".svg"]


def test_a_range_without_jumps_says_so(run):
    assert "does not jump" in run("aim", "--from", 20, "--to", 22)[1]


def test_fifty_scores_tell_where_to_aim(run, tmp_path):
    status, result = run("estimate", *FIFTY, "--json", "--output", tmp_path)
    estimate = estimate_from_scores(FIFTY)
    assert status == 0
    assert result["sigma_mm"] == pytest.approx(estimate.sigma)
    assert result["ci95_mm"] == pytest.approx(list(estimate.confidence_interval()))
    assert result["ci95_mm"][0] < result["sigma_mm"] < result["ci95_mm"][1]
    assert result["best_aim"]["bed"] == "T19"
    assert all(
        tmp_path.joinpath(name).stat().st_size > 10_000
        for name in ("estimate.svg", "estimate.png")
    )


def test_an_estimate_reads_well_as_text(run):
    _, text = run("estimate", *FIFTY)
    assert "sigma = 28.3 mm, 95 % interval 20.6 to 40.4 mm, from 50 darts" in text
    assert "--model general" in text and "best aim: T19 at x = " in text


def test_scores_come_from_standard_input_too_and_the_model_can_be_chosen(run, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(", ".join(FIFTY) + "\nx"))
    _, result = run("estimate", "-", "--model", "general", "--with-bias", "--json")
    assert result["n_throws"] == 50 and result["bounced_out"] == 1
    assert result["bias_mm"] != [0.0, 0.0] and result["covariance_mm2"][0][1] != 0.0


@pytest.mark.slow
def test_an_open_interval_is_null(run):
    _, result = run("estimate", *"0 0 0 0 0 0 5 0 0 0 0".split(), "--json")
    assert result["ci95_mm"][1] is None and result["ci95_mm"][0] > 20.0


def test_what_was_aimed_at_can_be_a_bed_or_a_point(run):
    by_name, by_point = (
        run("estimate", *"20 60 5 20 1 20 12 20 18 7 20".split(), "--aim", aim, "--json")[1]
        for aim in ("T20", "0,103")
    )
    assert by_name["sigma_mm"] == pytest.approx(by_point["sigma_mm"])


def test_heatmap_writes_a_picture_and_its_numbers(run, tmp_path):
    status, result = run(
        "heatmap",
        "--covariance",
        400,
        -60,
        200,
        "--bias",
        -3,
        2,
        "--spacing",
        5,
        "--csv",
        tmp_path / "map.csv",
        "--output",
        tmp_path,
        "--json",
    )
    rows = np.loadtxt(tmp_path / "map.csv", delimiter=",", skiprows=1)
    assert status == 0 and rows.shape == (69**2, 3)
    assert rows[:, 2].max() == pytest.approx(result["expected_score"], abs=0.3)
    assert all((tmp_path / f"heat_map.{kind}").exists() for kind in ("svg", "png"))
    assert result["bias_mm"] == [-3.0, 2.0]


def test_a_leg_as_a_table_and_a_picture(run, tmp_path):
    status, text = run("501", "--professional", "Wade", "--start", 41, "--output", tmp_path)
    assert status == 0 and "turns on average from 41" in text
    assert any(line.split()[:3] == ["40", "3", "D20"] for line in text.splitlines()), text
    assert (tmp_path / "leg.png").exists()


def test_one_state_of_a_leg(run):
    _, result = run(
        "501",
        "--sigma",
        20,
        "--start",
        45,
        "--remaining",
        40,
        "--darts",
        1,
        "--turn-start",
        45,
        "--json",
    )
    (row,) = result["aims"]
    assert (row["remaining"], row["darts_left"], row["turn_start"], row["bed"]) == (
        40,
        1,
        45,
        "D20",
    )
    assert 0.1 < row["best_chance_to_finish"] < 0.15


@pytest.fixture(scope="module")
def match_from_11():
    return solve_match(12.0, 15.0, 11)


@pytest.mark.slow
def test_a_match_is_that_of_the_library(run, match_from_11):
    status, result = run(
        "match",
        "--sigma",
        12,
        "--against",
        15,
        "--start",
        11,
        "--legs",
        5,
        "--first",
        "them",
        "--json",
    )
    leg = {"first": match_from_11.me.first[11, 11], "second": match_from_11.me.second[11, 11]}
    assert status == 0 and result["leg"] == pytest.approx(leg)
    assert result["match"] == {
        "legs": 5,
        "first": "them",
        "chance": pytest.approx(match_chance(*leg.values(), 5, "them")),
    }
    assert result["aim"]["bed"] == match_from_11.me.target(11, 11)
    assert result["leg_against_fewest_turns"]["first"] >= result["leg_both_fewest_turns"]["first"]


def test_a_match_reads_well_as_text(run, match_from_11):
    _, text = run("match", "--sigma", 12, "--against", 15, "--start", 11, "--legs", 3)
    first, second = 100 * match_from_11.me.first[11, 11], 100 * match_from_11.me.second[11, 11]
    assert (
        f"leg from 11, both play to win: you win {first:.2f} % if you begin, {second:.2f} % if"
        " they begin" in text
    )
    assert "best of 3, you begin the first leg: you win " in text and "first dart: " in text
    assert "no aim of a first dart depends on what they have left" in text or "left: " in text


def test_a_match_says_how_far_it_is(capsys):
    assert main(["darts", "match", "--sigma", "12", "--against", "15", "--start", "8"]) == 0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3 and all(f"({n} of 3)" in line for n, line in enumerate(said, 1))


def test_a_quick_match_is_that_of_the_fewest_turns(run, match_from_11):
    quick = ("match", "--sigma", 12, "--against", 15, "--start", 11, "--legs", 3, "--quick")
    policy = solve_match(12.0, 15.0, 11, ("turns", "turns"))
    status, result = run(*quick, "--json")
    leg = {"first": policy.me.first[11, 11], "second": policy.me.second[11, 11]}
    assert status == 0 and result["leg_both_fewest_turns"] == pytest.approx(leg)
    assert "leg" not in result and "example" not in result
    assert result["match"]["chance"] == pytest.approx(match_chance(*leg.values(), 3))
    _, text = run(*quick)
    assert f"both play for the fewest turns: you win {100 * leg['first']:.2f} %" in text
    # what is left out for it is worth little
    assert leg["first"] == pytest.approx(match_from_11.me.first[11, 11], abs=0.02)


@pytest.mark.slow
def test_each_player_of_a_match_has_a_spread_of_any_kind(run):
    mine, theirs = (
        ["--covariance", 400, -60, 200, "--bias", -3, 2],
        ["--against-professional", "Wade"],
    )
    against = run("match", *mine, *theirs, "--start", 10, "--json")[1]["leg"]
    swapped = [
        "--against-covariance",
        400,
        -60,
        200,
        "--against-bias",
        -3,
        2,
        "--professional",
        "Wade",
    ]
    assert run("match", *swapped, "--start", 10, "--json")[1]["leg"]["first"] == pytest.approx(
        1.0 - against["second"], abs=1e-6
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["aim"],
        ["aim", "--sigma", "16", "--from", "5", "--to", "9"],
        ["aim", "--from", "5"],
        ["aim", "--sigma", "wide"],
        ["estimate"],
        ["heatmap"],
        ["501"],
        ["501", "--sigma", "9", "--professional"],
        ["match", "--sigma", "9"],
        ["match", "--against", "9"],
        ["match", "--sigma", "9", "--against", "9", "--against-professional"],
        ["match", "--sigma", "9", "--against", "9", "--first", "you"],
        ["throw"],
        [],
    ],
)
def test_wrong_usage_ends_with_status_two(run, arguments, capsys):
    with pytest.raises(SystemExit) as end:
        run(*arguments)
    assert end.value.code == 2
    assert "usage:" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["aim", "--sigma", "-3"], "sigma must lie between .* got -3"),
        (["aim", "--sigma", "nan"], "sigma must lie between .* got nan"),
        (["aim", "--from", "30", "--to", "20"], "lowest sigma must be below"),
        (["estimate", "20", "23"], "throw 2: score 23 cannot be thrown"),
        (["estimate", "20", "-5"], "score -5 cannot be thrown"),
        (["estimate", "20", "5", "1", "--aim", "a,b"], "neither a bed"),
        (["heatmap", "--covariance", "1", "5", "1"], "variances"),
        (["501", "--sigma", "20", "--start", "4", "--remaining", "5"], "between 2 and 4"),
        (["501", "--professional", "Nobody"], "no professional is called"),
        (["match", "--sigma", "0", "--against", "9"], "you: sigma must lie between .* got 0"),
        (
            ["match", "--sigma", "9", "--against", "nan"],
            "opponent: sigma must lie between .* got nan",
        ),
        (
            ["match", "--sigma", "9", "--against-professional", "Nobody"],
            "opponent: no professional is called",
        ),
        (
            ["match", "--sigma", "9", "--against", "9", "--legs", "4"],
            "legs must be an odd number .* such as 5, got 4",
        ),
        (
            ["match", "--sigma", "9", "--against", "9", "--start", "1"],
            "start must be an integer of at least 2, got 1",
        ),
    ],
)
def test_bad_values_are_named(run, arguments, words):
    """The command line turns a ValueError into its message and status 1."""
    with pytest.raises(ValueError, match=words):
        run(*arguments)


@pytest.mark.parametrize("spacing", [1e308, 1e-308, 171.0])
def test_a_grid_that_cannot_be_is_refused(run, spacing):
    with pytest.raises(ValueError, match="choose a (smaller|larger) spacing"):
        run("heatmap", "--sigma", 20, "--spacing", spacing)


NUMBERS = st.sampled_from(
    ["0", "-1", "1e-308", "1e308", "-1e308", "nan", "inf", "1e12", "20", "x", ""]
)
OPTIONS = {
    "heatmap": (["--spacing"], ["--covariance", 3], ["--bias", 2]),
    "aim": (["--sigma"], ["--covariance", 3], ["--bias", 2]),
    "501": (["--start"], ["--remaining"], ["--turn-start"]),
}


@pytest.mark.slow
@given(st.sampled_from(sorted(OPTIONS)), st.data())
@settings(
    max_examples=max(20, settings.default.max_examples // 4),
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_whatever_numbers_are_given_the_answer_is_one_line_or_a_result(tmp_path, verb, data):
    """With a spread of 20 mm where that is not what is tried, so that nothing here takes long."""
    option, *count = data.draw(st.sampled_from(OPTIONS[verb]))
    values = [data.draw(NUMBERS) for _ in range(*count or [1])]
    spread = [] if option in ("--sigma", "--covariance") else ["--sigma", "20"]
    out, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
        try:
            status = main(
                ["darts", verb, *spread, option, *values, "--output", str(tmp_path / "out")]
            )
        except SystemExit as usage:
            status = usage.code
    assert status in (0, 1, 2)
    assert status != 1 or len(said.getvalue().splitlines()) == 1
