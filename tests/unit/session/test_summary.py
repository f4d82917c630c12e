"""The summary of a run: its numbers, its JSON, its table."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.common.situation import Pose, Situation
from dart_skill.session import (
    RunSummary,
    TrialResult,
    error_quantile,
    throws_in_a_line,
    write_summary,
)
from dart_skill.skills.protocol import TaskOutcome, load_skill

TARGET = (2.0, 0.0, 0.4)
NAN = float("nan")
HOLDER = Pose(
    np.array([0.6, 0.1, 1.2]), Rotation.from_rotvec([0.0, 0.0, np.deg2rad(30.0)]).as_quat()
)
THERE = Situation({"holder": HOLDER}, {"weight": 0.3})
TRIALS = (
    TrialResult(THERE, TaskOutcome(True, 0.001)),
    TrialResult(THERE, TaskOutcome(False, 0.03, "it jammed")),
    TrialResult(THERE, TaskOutcome(False, np.nan, "not seen"), "stopped by ~/stop"),
)
ALL_RUNS = {"skill", "seed", "bag", "tried", "succeeded", "median_error_m", "wall_seconds"}


def throw(error, inside=True, target=TARGET, message=""):
    """A throw that lands `error` metres beyond its target, or whose landing was not seen for None."""
    if error is None:
        return TrialResult.of_throw(target, None, None, inside, message)
    direction = np.array(target[:2]) / np.hypot(*target[:2])
    x, y = np.array(target[:2]) + error * direction
    return TrialResult.of_throw(target, (x, y, target[2]), error, inside, message)


def summary(*trials, skill="throw", **changes):
    return RunSummary(**{"skill": load_skill(skill), "seed": 4, "bag": "run/bag", "demonstrations": 13, "attempts": 15,
                         "trials": trials, "wall_seconds": 61.5, "real_time_factor": 4.25, "trial_real_time_factor": 2.5,
                         "layout": "composed", **changes})  # fmt: skip


def strict(value):
    """Through JSON and back; NaN and infinity are errors both ways."""

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(json.dumps(value, allow_nan=False), parse_constant=refuse)


def test_json_of_throws_holds_what_was_promised():
    run = strict(summary(throw(0.01), throw(0.03), throw(0.20, inside=False)).to_json())
    promised = {"skill": "throw", "seed": 4, "bag": "run/bag", "layout": "composed", "demonstrations": 13, "attempts": 15,
                "tried": 3, "succeeded": 2, "landings_seen": 3, "thrown": 3, "in": 2, "wall_seconds": 61.5,
                "real_time_factor": 4.25, "throw_real_time_factor": 2.5}  # fmt: skip
    assert {key: run[key] for key in promised} == promised
    assert run["median_error_m"] == pytest.approx(0.03)
    assert run["p90_error_m"] == pytest.approx(0.03 + 0.8 * 0.17), (
        "linear between the 2nd and the 3rd of 3 errors"
    )
    first, _, third = run["throws"]
    missed = {"target": [2.0, 0.0, 0.4], "landing": [2.2, 0.0, 0.4], "error_m": 0.2, "in": False}
    assert third == {**missed, "message": ""}
    trial = run["trials"][0]
    assert trial["situation"]["basket"]["position"] == first["target"] and trial["success"]


def test_json_of_another_skill_has_the_same_entries_and_none_of_throws():
    told = strict(summary(*TRIALS, skill="place").to_json())
    assert set(told) >= ALL_RUNS and not {"thrown", "in", "throws"} & set(told)
    assert (told["skill"], told["tried"], told["succeeded"]) == ("place", 3, 1)
    assert told["median_error_m"] == pytest.approx(0.0155) and told["real_time_factor"] == 2.5
    first, second, third = told["trials"]
    assert first["situation"]["holder"]["position"] == [0.6, 0.1, 1.2]
    assert first["situation"]["weight"] == 0.3 and first["message"] == ""
    assert (second["success"], second["message"]) == (False, "it jammed")
    assert (third["error_m"], third["message"]) == (None, "stopped by ~/stop")


@pytest.mark.parametrize("unseen", [((NAN,) * 3, NAN), (None, None)])
def test_a_landing_that_was_not_seen_is_null_and_has_no_part_in_the_median(unseen):
    lost = TrialResult.of_throw(TARGET, *unseen, True)
    run = strict(summary(throw(0.02), lost).to_json())
    assert run["throws"][1]["landing"] is None and run["throws"][1]["error_m"] is None
    assert (run["in"], run["thrown"], run["landings_seen"]) == (2, 2, 1), "seen in the basket"
    assert run["median_error_m"] == pytest.approx(0.02)


@pytest.mark.parametrize("throws", [(), (throw(None, inside=False),)], ids=["none", "not seen"])
def test_without_a_landing_there_is_no_median(throws):
    run = strict(summary(*throws).to_json())
    assert run["median_error_m"] is None and run["p90_error_m"] is None and run["in"] == 0
    assert "median" not in summary(*throws).table()


def test_times_that_are_not_finite_become_null():
    run = strict(summary(wall_seconds=NAN, real_time_factor=float("inf"), trial_real_time_factor=None).to_json())  # fmt: skip
    times = ("wall_seconds", "real_time_factor", "throw_real_time_factor")
    assert [run[name] for name in times] == [None] * 3


def test_numbers_of_numpy_become_plain_ones_in_the_file(tmp_path):
    target, landing = np.array([1.5, 0.5, 0.4]), np.array([1.5, 0.52, 0.4])
    result = TrialResult.of_throw(target, landing, np.float64(0.02), np.bool_(True))
    run = summary(result, seed=np.int64(3), wall_seconds=np.float32(2.5), bag=tmp_path)
    path = write_summary(run.to_json(), tmp_path / "new")
    assert path == tmp_path / "new" / "summary.json"
    assert strict(json.loads(path.read_text()))["throws"][0]["target"] == [1.5, 0.5, 0.4]


def test_quantiles_are_those_of_the_errors():
    errors = np.random.default_rng(0).uniform(0.0, 0.3, 37)
    throws = [throw(error) for error in errors]
    assert error_quantile(throws, 0.9) == pytest.approx(np.percentile(errors, 90))


def test_the_table_of_throws_has_a_line_for_each_and_ends_with_the_result():
    missed = throw(0.2, inside=False, message="ball\nslipped")
    lines = summary(throw(0.011), throw(0.02, target=(1.5, 1.5, 0.4)), missed).table().splitlines()
    assert len(lines) == 5
    assert lines[1].split() == "1 2.000 0.000 0.400 +0.0 2.00 2.011 0.000 1.1 in".split()
    assert lines[2].split()[4:6] == ["+45.0", "2.12"]
    assert lines[3].endswith("20.0     out  ball slipped") and lines[0].endswith("note")
    assert lines[-1] == "in 2/3, median 2.0 cm, 90 % 16.4 cm"


def test_columns_of_the_table_are_aligned():
    shown = summary(throw(0.01), throw(None, inside=False), throw(0.5, target=(1.0, -1.0, 0.4)))
    lines = shown.table().splitlines()[:-1]
    ends = [
        line.rstrip().rindex(word) + len(word)
        for line, word in zip(lines, ("result", "in", "out", "in"), strict=True)
    ]
    assert len(set(ends)) == 1, lines


def test_the_table_of_another_skill_says_every_trial_and_all_of_them():
    lines = summary(*TRIALS, skill="place").table().splitlines()
    assert lines[1].split() == ["1", "1.0", "done"] and lines[2].endswith("failed  it jammed")
    assert lines[3].split()[:3] == ["3", "-", "failed"] and lines[3].endswith("by ~/stop")
    assert lines[-1] == "place 1/3, median 15.5 mm"
    assert summary(skill="place").table().splitlines()[-1] == "place 0/0"


@pytest.mark.parametrize(
    ("throws", "said"),
    [
        (
            [throw(0.01), throw(None, False)],
            "in 1/2, median 1.0 cm, 90 % 1.0 cm, landing seen 1/2",
        ),
        ([throw(None, inside=False)], "in 0/1, landing seen 0/1"),
        ([], "no throws"),
    ],
)
def test_throws_in_a_line_say_how_many_landings_were_seen(throws, said):
    assert throws_in_a_line(throws) == said


@pytest.mark.parametrize(
    ("skill", "result", "said"),
    [
        ("throw", throw(0.012), "in, 1.2 cm"),
        ("throw", throw(None, False, message="stopped"), "out, stopped"),
        ("place", TRIALS[0], "done, 1.0 mm"),
        ("place", TRIALS[1], "failed, 30.0 mm it jammed"),
        ("place", TRIALS[2], "failed, stopped by ~/stop"),
    ],
)
def test_a_trial_is_told_in_the_words_of_its_skill(skill, result, said):
    assert result.in_words(load_skill(skill).words) == said


def test_situations_are_said_in_words():
    assert THERE.in_words() == "holder at 0.60, 0.10, 1.20 m, turned by +30 degrees; weight 0.3"
    both = Situation({"hand": HOLDER, "ball": Pose(np.zeros(3))})
    assert both.in_words(["ball"]) == "ball at 0.00, 0.00, 0.00 m"
    numbers = Situation({}, {"way": -0.00234932, "other": -0.0})
    assert numbers.in_words(units={"way": "m"}) == "way -0.00235 m; other 0"
    assert Situation({}).in_words() == "nothing is said of it"
    throwing = load_skill("throw")
    assert throwing.in_words(throwing.at(np.array([0.0, -2.0, 0.4]))) == "basket at 2.00 m, -90 degrees"  # fmt: skip
