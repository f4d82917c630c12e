"""The practice experiment: changes are made, tests teach nothing, rows count what they say, and
one tiny run.
"""

import json
from dataclasses import asdict

import numpy as np
import pytest

from dart_skill.arm import same_plan
from dart_skill.cli import main
from dart_skill.experiments.studies import practice
from dart_skill.experiments.studies.practice import (
    practice_task,
    practise,
    summarise,
    table,
)
from dart_skill.session import Session
from dart_skill.simulation import CHANGES, PlantSettings, changed
from dart_skill.skills.practice import PractisingSkill

BASKET = np.array([1.9, 0.2, 0.40])
NAN = float("nan")


def made(seed=0, method="residual", scale=1.0, **task):
    """A run by hand with tests of three throws after 0 and 5 practised ones."""
    much = {"throws": 5, "tested_after": [0, 5], "tests": 3}
    return {
        "task": practice_task(seed, method=method, **much, **task),
        "errors": [0.1] * 5,
        "in_basket": [True] * 5,
        "test_errors": [
            [0.04 * scale, 0.01 * scale, 0.02 * scale],
            [0.01 * scale, NAN, 0.2 * scale],
        ],
        "test_in_basket": [[True, True, True], [True, False, False]],
        "notes": [],
        "spreads": [],
    }


def test_a_row_is_the_median_over_all_throws_of_all_runs():
    before, after = summarise([made(0), made(1, scale=2.0)])
    assert (
        before["after"],
        before["runs"],
        before["throws"],
        before["in"],
        before["without_error"],
    ) == (0, 2, 6, 1.0, 0)
    assert before["median_cm"] == pytest.approx(3.0) and before["p90_cm"] == pytest.approx(6.0)
    assert (after["after"], after["in"], after["without_error"]) == (5, pytest.approx(1 / 3), 2)
    assert after["median_cm"] == pytest.approx((2.0 + 20.0) / 2), (
        "of 1, 2, 20 and 40 cm: throws without an error do not count"
    )


def test_rows_of_methods_demonstrations_and_changes_are_kept_apart():
    runs = [made(), made(method="power"), made(demonstrations=3), made(change="friction")]
    kinds = [(row["method"], row["demonstrations"], row["change"]) for row in summarise(runs)[::2]]
    assert kinds == [
        ("residual", 13, "none"),
        ("power", 13, "none"),
        ("residual", 3, "none"),
        ("residual", 13, "friction"),
    ]
    lines = table(runs).splitlines()
    assert len(lines) == 2 + len(runs) and "after 5" in lines[0] and "2.00 3.6 100 %" in lines[1]


def test_throws_without_a_landing_give_a_row_without_a_median():
    nothing = made() | {"test_errors": [[NAN] * 3] * 2, "test_in_basket": [[False] * 3] * 2}
    row = summarise([nothing])[0]
    assert np.isnan(row["median_cm"]) and row["in"] == 0.0 and row["without_error"] == 3


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "hope"}, "no method 'hope': choose one of"),
        ({"change": "moon"}, "no change 'moon'"),
    ],
)
def test_an_unknown_method_or_change_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        practice_task(0, **wrong)


def test_tests_after_more_throws_than_there_are_do_not_take_place():
    assert practice_task(0, throws=10)["tested_after"] == [0, 1, 2, 5, 10]


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_changes_what_it_says_and_nothing_else(change):
    before = PlantSettings()
    after = changed(before, change)
    assert {
        name: value for name, value in asdict(after).items() if value != asdict(before)[name]
    } == CHANGES[change]


class Spied(Session):
    """A session that notes the friction of the plant in each throw."""

    frictions = []

    def throw(self, plan):
        trial = super().throw(plan)
        self.frictions.append(self.plant.settings.friction_scale)
        return trial


def test_the_plant_changes_after_so_many_practised_throws_and_not_before(
    demonstrations, monkeypatch
):
    monkeypatch.setattr(practice, "Session", Spied)
    monkeypatch.setattr(practice, "teach", lambda session, seed, wanted: demonstrations)
    Spied.frictions.clear()
    one = practice.run(
        practice_task(
            0,
            method="residual",
            demonstrations=4,
            throws=2,
            change="friction",
            change_after=1,
            tested_after=[0, 2],
            tests=1,
        )
    )
    assert Spied.frictions == [1.0, 1.0, 2.0, 2.0], "test, practice, change, practice, test"
    assert len(one["errors"]) == 2 and np.shape(one["test_errors"]) == (2, 1)
    assert np.shape(one["test_in_basket"]) == (2, 1)


def practised(demonstrations, method):
    return PractisingSkill(demonstrations, method=method, rng=np.random.default_rng(1))


@pytest.mark.parametrize("method", ["residual", "bootstrap", "both", "power", "none"])
def test_a_test_teaches_nothing(demonstrations, method):
    """A skill that was tested goes on to the very plans of one that was not, also those with which
    PoWER explores.
    """
    tested, untested = practised(demonstrations, method), practised(demonstrations, method)
    session = Session(4)
    error, inside, miss, note = practise(session, tested, BASKET, learn=False)[:4]
    assert error == miss and np.isfinite(error) and inside == (error < 0.15) and not note
    for explore in (False, True):
        assert same_plan(tested.plan(BASKET, explore), untested.plan(BASKET, explore)), method
    session.close()


@pytest.mark.parametrize("method", ["residual", "bootstrap", "both"])
def test_a_practised_throw_teaches(demonstrations, method):
    """So that the test above could fail."""
    skill = practised(demonstrations, method)
    before, session = skill.plan(BASKET), Session(4)
    practise(session, skill, BASKET)
    assert not same_plan(skill.plan(BASKET), before), method
    session.close()


def test_a_basket_out_of_reach_is_a_throw_without_an_error(demonstrations):
    skill = practised(demonstrations, "residual")
    error, inside, miss, note = practise(None, skill, np.array([9.0, 0.0, 0.4]))[:4]
    assert np.isnan(error) and np.isnan(miss) and not inside and "9.00 m" in note


def test_the_command_prints_the_table(monkeypatch, capsys):
    monkeypatch.setattr(
        practice,
        "run",
        lambda task: made(
            task["seed"],
            task["method"],
            change=task["change"],
            demonstrations=task["demonstrations"],
        ),
    )
    options = "--methods residual,none --changes none,friction --demonstrations 3 --throws 5"
    more = "--tested-after 0,5 --seeds 2 --tests 3 --jobs 1 --json"
    assert main(["experiment", "practice", *options.split(), *more.split()]) == 0
    kinds = {(row["method"], row["change"]) for row in json.loads(capsys.readouterr().out)}
    assert kinds == {(m, c) for m in ("residual", "none") for c in ("none", "friction")}


@pytest.fixture(scope="module")
def tiny():
    return practice.run(
        practice_task(
            0, method="residual", demonstrations=3, throws=2, tested_after=[0, 2], tests=2
        )
    )


@pytest.mark.slow
def test_a_tiny_run_practises_and_is_tested(tiny):
    assert len(tiny["errors"]) == len(tiny["in_basket"]) == 2
    assert np.shape(tiny["test_errors"]) == (2, 2)
    assert np.nanmedian(np.concatenate(tiny["test_errors"])) < 0.1, tiny


@pytest.mark.slow
def test_the_floor_is_what_one_plan_scatters_and_is_measured_when_all_else_is_done(tiny):
    plain, floored = tiny, practice.run(tiny["task"] | {"again": 4})
    assert plain["spreads"] == []
    assert repr(floored | {"task": tiny["task"], "spreads": []}) == repr(plain), "the same run"
    assert np.shape(floored["spreads"]) == (2, 4) and 0.0 < np.median(floored["spreads"]) < 0.01
    before, after = summarise([floored])
    assert before["floor_cm"] is None and after["floor_cm"] == pytest.approx(
        100 * np.median(floored["spreads"]), abs=1e-3
    )
    assert "floor: median distance" in table([floored]) and "floor" not in table([plain])


def test_a_floor_of_a_single_throw_is_refused(capsys):
    assert main(["experiment", "practice", "--again", "1"]) == 1
    assert "--again is 1: a scatter takes 2 throws" in capsys.readouterr().err
