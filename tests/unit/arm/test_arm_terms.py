"""What is kept of one state of the arm, beside what Pinocchio says of it when it is asked for each
thing by itself.
"""

import numpy as np
import pytest

from dart_skill.arm import ArmModel
from tests.interpreted import interpreted

NAMES = (
    "q qd position rotation jacobian velocity hand_speed elbow_speed gravity inertia coriolis"
    " drift".split()
)


def states(n=20, seed=0):
    rng = np.random.default_rng(seed)
    return zip(rng.uniform(-2.0, 2.0, (n, 7)), rng.normal(0.0, 2.0, (n, 7)), strict=True)


def all_of(terms):
    """Every number, by name, as copies."""
    terms.find_gravity()
    terms.find_inertia()
    terms.find_coriolis()
    return {name: np.array(getattr(terms, name)) for name in NAMES}


@pytest.mark.parametrize("ball_in_hand", [False, True])
def test_the_terms_are_those_that_pinocchio_says_one_by_one(ball_in_hand):
    model, other = ArmModel(ball_in_hand=ball_in_hand), ArmModel(ball_in_hand=ball_in_hand)
    for q, qd in states():
        found = all_of(model.at(q, qd))
        position, rotation = other.hand_pose(q)
        expected = {
            "q": q, "qd": qd, "position": position, "rotation": rotation, "jacobian": other.jacobian(q),
            "velocity": other.jacobian(q) @ qd, "hand_speed": np.linalg.norm((other.jacobian(q) @ qd)[:3]),
            "elbow_speed": np.linalg.norm(other.elbow(q)[1] @ qd), "gravity": other.gravity_torque(q), "inertia": other.mass_matrix(q),
            "coriolis": other.coriolis_torque(q, qd), "drift": other.jacobian_drift(q, qd),
        }  # fmt: skip
        for name in NAMES:
            np.testing.assert_allclose(
                found[name], expected[name], rtol=1e-11, atol=1e-12, err_msg=name
            )
        np.testing.assert_allclose(
            model.at(q, qd).inertial_torque(qd), other.mass_matrix(q) @ qd, rtol=1e-11, atol=1e-12
        )


def test_whatever_was_asked_before_the_terms_are_those_of_the_state():
    """Other speeds at the same angles, angles without speeds, and the questions in any order."""
    model, rng = ArmModel(), np.random.default_rng(1)
    (q, qd), (other, faster) = states(2, seed=2)
    expected = {
        (id(a), id(b)): all_of(ArmModel().at(a, b)) for a in (q, other) for b in (qd, faster)
    }
    for _ in range(200):
        a, b = (q, other)[rng.integers(2)], (qd, faster)[rng.integers(2)]
        if rng.random() < 0.3:
            model.at(a).find_gravity()
        terms = model.at(a, b)
        for question in rng.permutation(["find_gravity", "find_inertia", "find_coriolis"])[
            : rng.integers(4)
        ]:
            getattr(terms, question)()
        if rng.random() < 0.5:
            found = all_of(terms)
            for name in NAMES:
                np.testing.assert_array_equal(
                    found[name], expected[id(a), id(b)][name], err_msg=name
                )


def test_an_array_that_was_changed_in_place_is_another_state():
    model, q, qd = ArmModel(), np.full(7, 0.3), np.full(7, 0.1)
    before = model.hand_state(q, qd)
    q[1] += 0.2
    after = model.hand_state(q, qd)
    np.testing.assert_allclose(after.position, model.hand_pose(q)[0], atol=1e-12)
    assert np.linalg.norm(after.position - before.position) > 0.1, (
        "what was said of the first state stays"
    )


@pytest.mark.parametrize(("q", "qd"), [(6, 7), (7, 8), (0, 0), (8, None)])
def test_a_state_of_another_arm_is_refused(q, qd):
    with pytest.raises(ValueError, match="the arm has 7 joints"):
        ArmModel().at(np.zeros(q), None if qd is None else np.zeros(qd))


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_is_found(odd):
    model, still, strange = ArmModel(), np.zeros(7), np.where(np.arange(7) == 3, odd, 0.0)
    assert model.at(still, still).are_finite
    assert (
        not model.at(still, strange).are_finite
        and not model.at(strange, still).are_finite
        and not model.at(strange, strange).are_finite
    )


def test_compiled_and_interpreted_have_the_same_bits(monkeypatch):
    plain = interpreted("dart_skill.arm._arm_terms")
    compiled = ArmModel(ball_in_hand=True)
    said = [all_of(compiled.at(q, qd)) for q, qd in states()]
    monkeypatch.setattr("dart_skill.arm._model.ArmTerms", plain.ArmTerms)
    other = ArmModel(ball_in_hand=True)
    for (q, qd), ours in zip(states(), said, strict=True):
        theirs = other.at(q, qd)
        for name, value in all_of(theirs).items():
            np.testing.assert_array_equal(ours[name], value, err_msg=name)
