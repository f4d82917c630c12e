"""Checks of the numbers of a state, beside the same in NumPy."""

import numpy as np
import pytest

from dart_skill.arm import ArmModel, _joint_checks
from tests.interpreted import interpreted

MODULES = [_joint_checks, interpreted("dart_skill.arm._joint_checks")]
STRONGEST, END = np.linspace(70.0, 6.0, 7), np.linspace(2.6, 1.5, 7)
CORNER = np.full(3, 3.0)


@pytest.mark.parametrize("module", MODULES)
def test_distances_and_ranges_are_those_of_numpy(module):
    rng = np.random.default_rng(0)
    for first, second in rng.normal(size=(20, 2, 7)):
        assert module.largest(first) == np.abs(first).max()
        assert module.farthest(first, second) == np.abs(first - second).max()
        assert module.distance(first[:3], second[:3]) == pytest.approx(
            np.linalg.norm(first[:3] - second[:3]), rel=1e-14
        )
        for margin in (0.0, 0.5):
            inside = ((first >= margin - END) & (first <= END - margin)).all()
            assert module.JointRange(-END, END).holds(first, margin) == inside


@pytest.mark.parametrize("module", MODULES)
def test_what_is_no_number_is_in_no_range(module):
    odd = np.where(np.arange(7) == 4, np.nan, 0.0)
    assert not module.JointRange(-END, END).holds(odd, 0.1)


@pytest.mark.parametrize("module", MODULES)
def test_a_level_that_is_passed_is_noticed_each_by_itself(module):
    levels = module.Levels(STRONGEST, -END, END, -CORNER, CORNER)
    q, still = np.full(7, 0.2), np.zeros(7)
    terms = ArmModel().at(q, np.ones(7))
    hand, elbow = terms.hand_speed, terms.elbow_speed

    def are_far(torque=still, elbow=1.01 * elbow, hand=1.01 * hand, share=1.0, levels=levels):
        return levels.are_far(terms, torque, elbow, hand, share)

    assert are_far()
    assert (
        not are_far(elbow=0.99 * elbow)
        and not are_far(hand=0.99 * hand)
        and not are_far(share=0.98)
    )
    for joint in range(7):
        for sign in (-1.0, 1.0):
            one = sign * (np.arange(7) == joint)
            assert are_far(torque=0.99 * STRONGEST * one) and not are_far(
                torque=1.01 * STRONGEST * one
            )
            for far in (True, False):
                beside = q + (0.01 if far else -0.01)
                ends = (
                    (-END, np.where(one, beside, END))
                    if sign > 0.0
                    else (np.where(one, -beside, -END), END)
                )
                mirrored = terms if sign > 0.0 else ArmModel().at(-q, np.zeros(7))
                assert (
                    module.Levels(STRONGEST, *ends, -CORNER, CORNER).are_far(
                        mirrored, still, 9.0, 9.0, 1.0
                    )
                    == far
                )
        assert not are_far(torque=np.where(np.arange(7) == joint, np.nan, 0.0))
    for axis in range(3):
        beside = np.where(np.arange(3) == axis, np.array(terms.position) + 0.01, -CORNER)
        assert not are_far(levels=module.Levels(STRONGEST, -END, END, beside, CORNER + 1.0))


@pytest.mark.parametrize("module", MODULES)
def test_the_share_of_a_command_is_what_gravity_leaves(module):
    levels, model, rng = (
        module.Levels(STRONGEST, -END, END, -CORNER, CORNER),
        ArmModel(),
        np.random.default_rng(1),
    )
    for q in rng.uniform(-1.5, 1.5, (20, 7)):
        wrench, torque = rng.normal(0.0, 40.0, 6), rng.normal(0.0, 5.0, 7)
        room = np.maximum(0.0, STRONGEST - np.abs(model.gravity_torque(q)))
        expected = min(1.0, (room / np.abs(torque + model.jacobian(q).T @ wrench)).min())
        assert levels.share(model.at(q), wrench, torque) == pytest.approx(expected, rel=1e-11)
    assert levels.share(model.at(np.zeros(7)), np.zeros(6), np.zeros(7)) == 1.0


@pytest.mark.parametrize("module", MODULES)
def test_arrays_of_other_shapes_are_refused(module):
    levels, terms = (
        module.Levels(STRONGEST, -END, END, -CORNER, CORNER),
        ArmModel().at(np.zeros(7), np.zeros(7)),
    )
    with pytest.raises(ValueError, match="the torque has shape"):
        levels.are_far(terms, np.zeros(6), 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="the wrench has shape"):
        levels.share(terms, np.zeros(7), np.zeros(7))
    with pytest.raises(ValueError, match="give two points"):
        module.distance(np.zeros(3), np.zeros(2))
    with pytest.raises(ValueError, match="are compared with"):
        module.farthest(np.zeros(7), np.zeros(6))


def test_compiled_and_interpreted_have_the_same_bits():
    rng, model = np.random.default_rng(2), ArmModel()
    pair = [module.Levels(STRONGEST, -END, END, -CORNER, CORNER) for module in MODULES]
    for q in rng.uniform(-1.5, 1.5, (20, 7)):
        wrench, torque = rng.normal(0.0, 40.0, 6), rng.normal(0.0, 5.0, 7)
        first, second = (levels.share(model.at(q), wrench, torque) for levels in pair)
        assert first == second
        first, second = (module.distance(q[:3], torque[:3]) for module in MODULES)
        assert first == second
