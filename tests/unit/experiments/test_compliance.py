"""How hard the arm resists a person, and how well it keeps to its path, by the stiffness of its
plans.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import ArmModel, CommanderSettings, Impedance, References
from dart_skill.cli import main
from dart_skill.experiments.studies import compliance
from dart_skill.experiments.studies.compliance import (
    GRABBED,
    KINDS,
    GrabbedThrow,
    grabbed_throw,
    resistance,
    table,
)
from dart_skill.session import Session
from dart_skill.skills.learning import DEFAULT, learn_throwing


@pytest.fixture(scope="module")
def skills(demonstrations):
    return {
        kind: learn_throwing(demonstrations, replace(DEFAULT, **stiffness))
        for kind, stiffness in KINDS.items()
    }


@pytest.fixture(scope="module")
def plans(skills):
    return {kind: skill.plan(np.array([2.0, 0.2, 0.4])) for kind, skill in skills.items()}


POSTURE = np.array([0.0, 0.3, 0.0, 1.5, 0.0, 0.8, 0.0])
"""An arm that rests, bent."""


def force_of(plan, time, axis):
    gains = References(plan).gains_at(time)
    return resistance(Impedance(ArmModel(ball_in_hand=True)), gains, POSTURE, np.zeros(7), axis)


@pytest.mark.slow
def test_the_force_is_the_inertia_of_the_hand_times_stiffness_times_way(plans):
    """Khatib's inertia in task space, (J M^-1 J')^-1, computed here without the law's shares for
    directions that hardly move.
    """
    model = ArmModel(ball_in_hand=True)
    jacobian = model.jacobian(POSTURE)
    inertia = np.linalg.inv(jacobian @ np.linalg.solve(model.mass_matrix(POSTURE), jacobian.T))
    for axis in np.eye(3):
        expected = np.linalg.norm((inertia @ np.append(-GRABBED * 200.0 * axis, np.zeros(3)))[:3])
        assert force_of(plans["200"], 0.3, axis) == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_the_force_grows_with_the_stiffness_and_changes_with_it(plans):
    along = np.array([1.0, 0.0, 0.0])
    force = {kind: force_of(plan, 0.3, along) for kind, plan in plans.items()}
    assert force["800"] == pytest.approx(4.0 * force["200"]) and force["200"] == pytest.approx(
        4.0 * force["50"]
    )
    changing = [
        force_of(plans["50 to 800"], time, along)
        for time in np.arange(0.0, plans["200"].release, 0.02)
    ]
    assert (
        max(changing) > 1.5 * min(changing)
        and 0.9 * force["50"] < min(changing)
        and max(changing) < 1.1 * force["800"]
    )


def test_a_throw_is_measured_on_the_clock_of_its_plan(plans, skills):
    """Stiffer gains keep the hand nearer to the path, by factors that a wrong clock would hide."""
    session = Session(5, commander=CommanderSettings.configured(tracking="none"), keep_states=True)
    soft, stiff = (
        grabbed_throw(session, kind, skills[kind], plans[kind]) for kind in ("50", "800")
    )
    session.close()
    assert np.hypot(*stiff.off) < min(0.004, 0.25 * np.hypot(*soft.off))
    assert stiff.miss < 0.05
    assert "50 " in table([soft, stiff]) and "800" in table([soft, stiff])


def test_the_command_prints_the_table_or_every_throw(monkeypatch, capsys):
    swing = GrabbedThrow("50", (1.0, 2.0), (0.001, 0.002), 0.01)
    monkeypatch.setattr(compliance, "run_seed", lambda seed, **_: [swing])
    assert main(["experiment", "compliance", "--seeds", "1"]) == 0
    assert capsys.readouterr().out == table([swing]) + "\n"
    assert main(["experiment", "compliance", "--seeds", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["force"] == [1.0, 2.0]
