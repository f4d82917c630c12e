"""What a run of any skill amounts to."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.session import (
    DemoSummary,
    SkillResult,
    SkillSummary,
    ThrowResult,
    in_words,
    skill_table,
    write_summary,
)
from dart_skill.skills.protocol import Pose, Situation, TaskOutcome

HOLDER = Pose(
    np.array([0.6, 0.1, 1.2]), Rotation.from_rotvec([0.0, 0.0, np.deg2rad(30.0)]).as_quat()
)
THERE = Situation({"holder": HOLDER}, {"weight": 0.3})
TRIALS = (
    SkillResult(THERE, TaskOutcome(True, 0.001)),
    SkillResult(THERE, TaskOutcome(False, 0.03, "it jammed")),
    SkillResult(THERE, TaskOutcome(False, np.nan, "not seen"), "stopped by ~/stop"),
)
ALL_RUNS = {
    "skill",
    "seed",
    "bag",
    "tried",
    "succeeded",
    "median_error_m",
    "wall_seconds",
    "trials",
}


def summary(trials=TRIALS):
    return SkillSummary("place", 3, "out/bag", 8, 9, trials, 42.0, "composed", 2.5)


def test_a_summary_is_strict_json(tmp_path):
    path = write_summary(summary(), tmp_path / "out")
    told = json.loads(path.read_text())
    assert ALL_RUNS <= set(told)
    assert (told["skill"], told["seed"], told["tried"], told["succeeded"]) == ("place", 3, 3, 1)
    assert told["median_error_m"] == pytest.approx(0.0155)
    first, second, third = told["trials"]
    assert (
        first["situation"]["holder"]["position"] == [0.6, 0.1, 1.2]
        and first["situation"]["weight"] == 0.3
    )
    assert (second["success"], second["message"]) == (False, "it jammed")
    assert third["error_m"] is None and third["message"] == "stopped by ~/stop"


def test_a_summary_of_throws_has_the_same_entries():
    throw = ThrowResult((2.0, 0.0, 0.4), (2.01, 0.0, 0.4), 0.01, True)
    told = DemoSummary(0, "out/bag", 13, (throw,), 30.0, 3.0).to_json()
    assert ALL_RUNS | {"thrown", "in", "throws"} <= set(told)
    assert (told["skill"], told["tried"], told["succeeded"], told["thrown"], told["in"]) == (
        "throw",
        1,
        1,
        1,
        1,
    )
    assert (
        told["trials"][0]["situation"]["basket"]["position"] == [2.0, 0.0, 0.4]
        and told["trials"][0]["success"]
    )


def test_the_table_says_every_trial_and_all_of_them():
    lines = skill_table(summary()).splitlines()
    assert lines[1].split() == ["1", "1.0", "done"] and lines[2].endswith("failed  it jammed")
    assert (
        lines[3].split()[:3] == ["3", "-", "failed"] and lines[-1] == "place 1/3, median 15.5 mm"
    )
    assert skill_table(summary(())).splitlines()[-1] == "place 0/0"


def test_situations_are_said_in_words():
    assert in_words(THERE) == "holder at 0.60, 0.10, 1.20 m, turned by +30 degrees; weight 0.3"
    assert (
        in_words(Situation({"hand": HOLDER, "ball": Pose(np.zeros(3))}), ["ball"])
        == "ball at 0.00, 0.00, 0.00 m"
    )
    assert (
        in_words(Situation({}, {"way": -0.00234932, "other": -0.0}), ()) == "way -0.00235; other 0"
    )
    assert (
        in_words(Situation({}, {"way": 0.5, "other": 1.0}), units={"way": "m"})
        == "way 0.5 m; other 1"
    )
    assert in_words(Situation({})) == "nothing is said of it"
