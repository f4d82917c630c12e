"""The joints of the plant, compiled and as Python runs them. What they do is tested in
test_plant.py and test_transmission.py.
"""

import numpy as np
import pytest

from dart_skill.arm import Command, Grip, SafetyLimits
from dart_skill.simulation import Plant, PlantSettings, _arm_in_world
from tests.interpreted import interpreted

STIFFNESS = (9000.0, 9000.0, 5000.0, 3000.0, 800.0, 800.0, 200.0)


def moved(settings):
    """What a plant says of its joints after 40 steps: driven, pushed, without the ball, braked."""
    plant, rng = Plant(settings), np.random.default_rng(0)
    for k in range(40):
        wrench, torque = (
            (10.0 * rng.normal(size=6), rng.normal(size=7))
            if k % 4
            else (np.zeros(6), np.zeros(7))
        )
        stamp = plant.state_stamp_ns
        command = (
            plant.braking()
            if k > 35
            else Command(stamp, wrench, torque, Grip.OPEN if k == 5 else Grip.UNSPECIFIED)
        )
        plant.step(command, Command(stamp, -wrench) if k % 3 == 0 else None)
    told = (
        plant.joint_position,
        plant.joint_velocity,
        plant.joint_effort,
        plant.arm_state.position,
        plant.state.position,
    )
    plant.close()
    return np.array(told)


@pytest.mark.parametrize(
    "settings",
    [
        PlantSettings(hand_delay=0.01),
        PlantSettings(
            joint_stiffness=STIFFNESS,
            joint_offset=(0.01,) * 7,
            encoder_step=1e-3,
            speed_filter=180.0,
        ),
        PlantSettings(limits=SafetyLimits.configured()),
    ],
    ids=["exact", "elastic", "watched"],
)
def test_compiled_and_interpreted_have_the_same_bits(settings, monkeypatch):
    compiled = moved(settings)
    monkeypatch.setattr(
        _arm_in_world, "Joints", interpreted("dart_skill.simulation._joints").Joints
    )
    np.testing.assert_array_equal(moved(settings), compiled)
