"""Plans as messages: what comes out is what went in, and sizes that do not fit are named."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import GainsOverTime, Grip, GripEvent, Pace, same_plan
from dart_skill.common.pace import PhaseRule
from dart_skill_nodes.comms import conversions
from tests.integration.plan_messages import throw_plan_msg
from tests.unit.conftest import planned_swing

PLAN = planned_swing()
RNG = np.random.default_rng(0)
N = len(PLAN.path.time)
ROOT = RNG.normal(size=(N, 3, 3))
SOLID = ROOT @ ROOT.swapaxes(1, 2) + 100.0 * np.eye(3)
PACED = replace(
    PLAN,
    pace=Pace(
        RNG.normal(size=(N, 12)),
        PhaseRule(slowest=0.02, fastest=1.4, time_constant=0.03, ignored=0.004),
    ),
)
CHANGING = replace(PLAN, position_gains=GainsOverTime(SOLID, 0.1 * SOLID))


@pytest.mark.parametrize(
    "plan", [PLAN, PACED, CHANGING, replace(PACED, position_gains=CHANGING.position_gains)]
)
def test_a_plan_comes_out_as_it_went_in(plan):
    # a duration counts nanoseconds
    release, told = (round(time * 1e9) * 1e-9 for time in (plan.release, plan.open_hand))
    times = {"end": release, "events": (GripEvent(told, Grip.OPEN, release),)}
    back = conversions.throw_plan(throw_plan_msg(plan))
    path = replace(back.path, time=plan.path.time)
    assert np.abs(back.path.time - plan.path.time).max() < 1e-9
    assert same_plan(replace(back, path=path, **times), replace(plan, **times))


@pytest.mark.parametrize(
    ("plan", "field", "values", "why"),
    [
        (PLAN, "pace_gain", [1.0] * 13, "pace_gain has 13 numbers"),
        (PACED, "pace_gain", [1.0] * 24, f"plan.pace.gain has 2 entries, the path {N} instants"),
        (PACED, "pace_gain", [float("nan")] * 12 * N, "not finite"),
        (PACED, "pace_slowest", 2.0, "slowest 2.0"),
        (
            PLAN,
            "position_damping",
            [1.0] * 9,
            "position_stiffness and position_damping have 1 and 9 numbers",
        ),
        (
            CHANGING,
            "position_stiffness",
            [1.0] * (9 * N - 1),
            f"have {9 * N - 1} and {9 * N} numbers",
        ),
        (CHANGING, "position_damping", [1.0] * 9 * N, "eigenvalue"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(plan, field, values, why):
    message = throw_plan_msg(plan)
    setattr(message, field, values)
    with pytest.raises(ValueError, match=why):
        conversions.throw_plan(message)
