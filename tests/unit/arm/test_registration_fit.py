"""Cameras and arm are registered from postures that somebody leads the arm through: what comes
back, and what postures do not tell.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    ArmModel,
    Commander,
    GainsOverTime,
    KnownRegistration,
    PlanRefused,
    Registration,
    Sightings,
    fit_registration,
    load_registration,
    measure_registration,
    save_registration,
)

MODEL = ArmModel()
MIDDLE = np.array([0.0, -0.9, 0.0, 0.8, 0.0, -0.35, 0.0])
NEAR = ((0.01, -0.008, 0.02), (0.006, -0.004, 0.012), (-0.015, 0.01, 0.02), (0.003, -0.006, 0.004))
FAR = ((0.2, -0.3, 2.0), (1.5, -0.4, 0.3), (-1.2, 2.0, 0.4), (0.03, -0.06, 0.02))
"""Rotation vector and shift of the base, and of the body on the hand [rad], [m]."""


def registration(turn, shift, hand_turn, hand_shift, delay=0.0):
    quaternions = [tuple(Rotation.from_rotvec(vector).as_quat()) for vector in (turn, hand_turn)]
    return Registration(quaternions[0], shift, quaternions[1], hand_shift, delay)


def shown(truth, n=12, moving=1.0, noise=0.0, speed=0.0, seed=0):
    """Sightings of n postures about the middle one; joints move by shares `moving` (7,), cameras
    have noise [m], joints speed [rad/s].
    """
    rng = np.random.default_rng(seed)
    joints = MIDDLE + 0.6 * moving * rng.uniform(-1.0, 1.0, (n, 7))
    speeds = speed * rng.standard_normal((n, 7))
    when_seen = Sightings.of_joints(
        MODEL,
        joints - truth.delay * speeds,
        speeds,
        np.zeros((n, 3)),
        np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
    )
    base, hand = Rotation.from_quat(truth.turn), Rotation.from_quat(when_seen.arm_quaternion)
    position = (
        base.apply(when_seen.arm_position + hand.apply(truth.hand_shift))
        + truth.shift
        + noise * rng.standard_normal((n, 3))
    )
    tilt = Rotation.from_rotvec(10.0 * noise * rng.standard_normal((n, 3)))
    return Sightings.of_joints(
        MODEL,
        joints,
        speeds,
        position,
        (tilt * base * hand * Rotation.from_quat(truth.hand_turn)).as_quat(),
    )


def apart(one, other):
    """Largest differences of turns [rad] and of shifts [m] between two registrations."""
    turns = [
        (
            Rotation.from_quat(getattr(one, name)).inv() * Rotation.from_quat(getattr(other, name))
        ).magnitude()
        for name in ("turn", "hand_turn")
    ]
    return max(turns), max(
        np.linalg.norm(np.subtract(getattr(one, name), getattr(other, name)))
        for name in ("shift", "hand_shift")
    )


@pytest.mark.parametrize("parts", [NEAR, FAR], ids=["near", "far"])
def test_exact_sightings_give_the_truth_back(parts):
    truth = registration(*parts)
    fit = measure_registration(shown(truth))
    turn, shift = apart(fit.registration, truth)
    assert turn < 1e-6 and shift < 1e-6
    assert fit.position_error < 1e-6 and fit.worst_angle < 1e-6 and fit.n_sightings == 12
    assert fit.condition < 100.0


@pytest.mark.parametrize("parts", [NEAR, FAR], ids=["near", "far"])
@pytest.mark.parametrize("seed", range(4))
def test_with_noise_the_truth_lies_within_what_the_fit_says_of_itself(parts, seed):
    truth = registration(*parts)
    fit = measure_registration(shown(truth, n=20, noise=5e-4, seed=seed))
    turn, shift = apart(fit.registration, truth)
    assert (
        turn < 5.0 * fit.spread[[0, 1, 2, 6, 7, 8]].max()
        and shift < 5.0 * fit.spread[[3, 4, 5, 9, 10, 11]].max()
    )
    assert turn < 0.01 and shift < 0.015
    assert 2e-4 < fit.position_error < 2e-3


def test_a_delay_is_told_of_an_arm_that_moves_and_not_of_one_that_rests():
    truth = registration(*NEAR, delay=0.006)
    moved = measure_registration(shown(truth, n=40, speed=0.5, noise=1e-4))
    assert moved.registration.delay == pytest.approx(0.006, abs=1e-3) and moved.spread[12] < 1e-3
    assert measure_registration(shown(registration(*NEAR))).spread[12] == pytest.approx(
        0.01, rel=0.01
    )


@pytest.mark.parametrize(
    ("moving", "open_ones"),
    [
        ((1, 0, 0, 0, 0, 0, 0), [5, 11]),
        ((0, 1, 0, 1, 0, 1, 0), [4, 10]),
        ((0.03,) * 7, [0, 1, 2, 3, 4, 5]),
    ],
    ids=["about one axis", "in one plane", "hardly"],
)
def test_postures_that_do_not_suffice_show_in_the_spread(moving, open_ones):
    """About J1 alone, height and length of the hand are one; in the plane of a swing, what is
    across is.
    """
    enough = measure_registration(shown(registration(*NEAR), noise=2e-4))
    few = measure_registration(shown(registration(*NEAR), moving=np.array(moving), noise=2e-4))
    assert (few.spread[open_ones] > 10.0 * enough.spread[open_ones]).all(), few.spread
    assert few.condition > 10.0 * enough.condition
    assert np.isfinite(few.spread).all() and few.position_error < 2e-3


def test_an_arm_whose_zeros_are_wrong_leaves_something_over():
    good = shown(registration(*NEAR), n=20)
    bent = Sightings.of_joints(MODEL, MIDDLE + 0.6 * np.random.default_rng(0).uniform(-1.0, 1.0, (20, 7)) + [0, 0, 0, 0.1, 0, 0, 0],
                               np.zeros((20, 7)), good.position, good.quaternion)  # fmt: skip
    assert measure_registration(bent).position_error > 5e-3


@pytest.mark.parametrize(
    "change", [{"position": np.full((12, 3), np.nan)}, {"quaternion": np.ones((12, 4))}]
)
def test_what_cannot_be_fitted_is_refused(change):
    with pytest.raises(ValueError, match="sightings"):
        measure_registration(replace(shown(registration(*NEAR)), **change))
    with pytest.raises(ValueError, match="2 postures are too few"):
        measure_registration(shown(registration(*NEAR), n=2))


# what is known beforehand


def test_what_throws_do_not_tell_comes_from_what_was_measured():
    """Swings in one plane say nothing of what is across; a measured registration says it, the
    usual prior does not.
    """
    truth = registration((0.01, 0.0, 0.02), (0.0, 0.04, 0.0), (0.0, 0.01, 0.0), (0.0, -0.03, 0.0))
    known = measure_registration(shown(truth, n=20, noise=2e-4)).known
    swings = shown(truth, n=60, moving=np.array([0, 1, 0, 1, 0, 1, 0]), noise=2e-4, seed=1)
    assert apart(fit_registration([swings], known), truth)[1] < 0.003
    assert apart(fit_registration([swings]), truth)[1] > 0.01


def test_far_from_usual_a_known_registration_is_refined_all_the_same():
    truth, expected = (
        registration(*FAR),
        registration(
            (0.203, -0.3, 2.004), (1.504, -0.4, 0.3), (-1.2, 2.003, 0.4), (0.03, -0.062, 0.02)
        ),
    )
    known = KnownRegistration(
        expected, tuple(np.repeat([0.01, 0.01, 0.01, 0.01, 0.01], [3, 3, 3, 3, 1]))
    )
    turn, shift = apart(fit_registration([shown(truth, n=100)], known), truth)
    assert turn < 5e-4 and shift < 1e-3
    nothing = Sightings.of_joints(MODEL, *np.empty((2, 0, 7)), np.empty((0, 3)), np.empty((0, 4)))
    assert (
        fit_registration([nothing], known) == expected
        and fit_registration([nothing]) == Registration()
    )


def test_a_measured_registration_is_the_same_after_it_was_a_file(tmp_path):
    fit = measure_registration(shown(registration(*FAR), n=20, noise=5e-4))
    save_registration(tmp_path / "registration.yaml", fit)
    known = load_registration(tmp_path / "registration.yaml")
    turn, shift = apart(known.registration, fit.registration)
    assert turn < 1e-8 and shift < 1e-8
    np.testing.assert_allclose(known.spread, fit.known.spread, rtol=1e-4)
    with pytest.raises(FileExistsError):
        save_registration(tmp_path / "registration.yaml", fit)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("registration: [1, 2", "registration.yaml is no registration file"),
        ("hello", "file: holds no mapping"),
        ("registration: {turn: [0, 0, 0, 1]}", "must have turn, shift"),
        (None, "there is no registration file"),
    ],
)
def test_a_file_that_is_none_is_named_and_what_makes_one(tmp_path, text, said):
    path = tmp_path / "registration.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=said) as refusal:
        load_registration(path)
    assert "dart-skill check arm --write" in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 2.0]"), ("delay: 0.01", "delay: -0.01")],
)
def test_numbers_of_a_file_that_cannot_be_are_refused(tmp_path, old, new):
    path = tmp_path / "registration.yaml"
    save_registration(path, measure_registration(shown(Registration())))
    text = path.read_text()
    path.write_text(
        text.replace(old, new) if old in text else text.replace("turn: [", "turn: [7.0, ")
    )
    with pytest.raises(ValueError, match="is no registration file"):
        load_registration(path)


# the commander


def test_a_plan_without_a_registration_takes_the_measured_one(plan):
    measured = registration(*NEAR)
    seen = replace(plan, path=seen_path(plan, measured))
    commander = Commander(measured=measured)
    commander.execute(seen)
    np.testing.assert_allclose(
        commander._requested.plan.path.position, plan.path.position, atol=1e-9
    )


def test_a_plan_that_contradicts_the_measured_registration_is_refused(plan):
    Commander(measured=registration(*NEAR)).execute(
        replace(plan, registration=registration((0.0, 0.0, 0.021), *NEAR[1:]))
    )
    with pytest.raises(PlanRefused, match="moved since it was measured"):
        Commander(measured=registration(*FAR)).execute(
            replace(plan, registration=registration(*NEAR))
        )


def seen_path(plan, truth):
    """The path of a plan as cameras with a registration see it; its velocities stay as they are."""
    base, hand = Rotation.from_quat(truth.turn), Rotation.from_quat(plan.path.quaternion)
    position = base.apply(plan.path.position + hand.apply(truth.hand_shift)) + truth.shift
    return replace(
        plan.path,
        position=position,
        quaternion=(base * hand * Rotation.from_quat(truth.hand_turn)).as_quat(),
    )


def test_gains_over_time_turn_with_the_arm(plan):
    """A pull that the cameras see along one of their axes is along the same direction of the arm."""
    n = len(plan.path.time)
    stiff_along_x = GainsOverTime(
        np.tile(np.diag([500.0, 100.0, 100.0]), (n, 1, 1)),
        np.tile(np.diag([40.0, 20.0, 20.0]), (n, 1, 1)),
    )
    turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    seen = replace(
        plan, position_gains=stiff_along_x, registration=Registration(turn=tuple(turn.as_quat()))
    )
    gains = seen.as_the_arm_has_it().position_gains
    np.testing.assert_allclose(gains.stiffness[0], np.diag([100.0, 500.0, 100.0]), atol=1e-9)
    np.testing.assert_allclose(gains.damping[0], np.diag([20.0, 40.0, 20.0]), atol=1e-9)
