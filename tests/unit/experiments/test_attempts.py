"""Attempts at one basket, of several ways to practise."""

import json

import numpy as np
import pytest

from dart_skill.cli import main
from dart_skill.experiments.studies.attempts import attempts_task, summarise, table

NAN = float("nan")


def results():
    task = attempts_task(0, methods=["newton", "none"], attempts=3, baskets=2)
    errors = {"newton": [[0.1, 0.02, 0.04], [0.2, 0.05, NAN]], "none": [[0.1, 0.1, 0.1]] * 2}
    return [{"task": task, "errors": errors}]


def test_medians_and_shares_of_each_attempt():
    newton, none = summarise(results(), 0.03)
    assert newton["median_cm"] == [15.0, 3.5, 4.0] and newton["near"] == [0.0, 0.5, 0.0]
    assert newton["near_until_then"] == [0.0, 0.5, 0.5], "near enough once is near enough"
    assert none["near"] == [0.0] * 3 and none["baskets"] == 2
    assert "newton         15.0, 0 %    3.5, 50 %     4.0, 0 %" in table(results(), 0.03)


def test_an_unknown_method_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="no method 'secant': choose among residual, newton"):
        attempts_task(0, methods=["secant"])


def test_no_throw_came_about():
    (never,) = results()
    never["errors"] = {"newton": [[NAN] * 3], "none": [[NAN] * 3]}
    assert summarise([never], 0.03)[0]["median_cm"] == [None] * 3
    assert "none, 0 %" in table([never], 0.03)


def test_the_command_throws_at_each_basket_with_each_method(capsys):
    arguments = ["--methods", "newton,none", "--seeds", "1", "--baskets", "1", "--attempts", "2"]
    assert main(["experiment", "attempts", *arguments, "--demonstrations", "4", "--json"]) == 0
    newton, none = json.loads(capsys.readouterr().out)
    assert (newton["method"], none["method"]) == ("newton", "none")
    errors = np.array([newton["median_cm"], none["median_cm"]])
    assert errors.shape == (2, 2) and np.all(errors < 10.0), "of an arm without faults"
