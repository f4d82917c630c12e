"""The law for arms with elastic cables, filtered speeds and delay: margins of its loop, and throws
on such an arm.
"""

import numpy as np
import pytest

from dart_skill.arm import (
    FILTER_TIME,
    TAKES_OUT,
    ArmModel,
    CommanderSettings,
    Impedance,
    JointServo,
    Mode,
    the_arm,
)
from dart_skill.common.configuration import load_yaml
from dart_skill.experiments.thesis.correction import (
    DAMPING_RATIO,
    LEAST_FRICTION,
    LINKS,
    OMEGA,
    PERIOD,
    SPEED_FILTER,
    all_joints,
    margin,
    step_left,
    step_of,
)
from tests.unit.arm.test_commander import begin, finish  # noqa: F401

REFLECTED = np.diag(the_arm().motors.reflected_inertia)
STIFFNESS = np.array(load_yaml("fleet.yaml")["fleet"]["wam_simulator"]["joint_stiffness"]["times"])
REAL = dict(
    joint_stiffness=tuple(STIFFNESS),
    speed_filter=SPEED_FILTER,
    encoder_step=9.6e-6,
    command_delay=1,
)
SLOW = dict(tracking="joints", friction_compensation=1.0)


def loop(joint, link, stiffness, stiffness_gain, damping_gain, delay):
    """Frequency response (n,) of the loop cut at the motor's torque: two masses and a spring,
    servo on the motor's side.
    """
    s = 1j * np.logspace(-1, 3.3, 4000)
    motor = REFLECTED[joint]
    spring = stiffness + 2.0 * DAMPING_RATIO * np.sqrt(stiffness * motor) * s
    both = (motor * s**2 + LEAST_FRICTION[joint] * s + spring) * (link * s**2 + spring) - spring**2
    servo = stiffness_gain + damping_gain * s * SPEED_FILTER / (s + SPEED_FILTER)
    return (link * s**2 + spring) / both * servo * np.exp(-s * (delay + 0.5) * PERIOD)


def encircles(response):
    """Whether -1 is encircled: the phase of 1 + L must rise from -90 degrees (friction, one
    integrator) to 0, and not less.
    """
    phase = np.unwrap(np.angle(1.0 + response))
    return abs((phase[-1] - phase[0]) / np.pi - 0.5) > 0.3


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("share", [0.5, 1.0, 2.0, 100.0])
@pytest.mark.parametrize("delay", [0, 1, 2])
def test_the_servo_of_a_motion_that_is_fed_forward_is_stable_with_margin(joint, share, delay):
    """A modulus margin of 0.25 up to a delay of one period, and stable with two."""
    gains = the_arm().servo
    for link in LINKS[joint]:
        response = loop(
            joint,
            link,
            share * STIFFNESS[joint],
            gains.following_stiffness[joint],
            gains.following_damping[joint],
            delay,
        )
        assert not encircles(response)
        assert np.abs(1.0 + response).min() > (0.25 if delay <= 1 else 0.0)


def test_a_real_arm_follows_quietly_what_makes_the_second_pull_swing(begin, plan):  # noqa: F811
    careful = finish(begin(plan, CommanderSettings.configured(**SLOW), **REAL))
    errors = careful.during(Mode.EXECUTING, careful.errors)
    assert not careful.commander.message and max(errors) < 0.03
    firm = finish(begin(plan, None, **REAL))
    shaken = [
        np.abs(np.diff([state.velocity[3] for state in run.states])).max()
        for run in (careful, firm)
    ]
    assert firm.commander.message or shaken[1] > 4 * shaken[0]


def test_fed_forward_on_an_exact_arm_the_ball_lands_where_the_plan_says(begin, plan):  # noqa: F811
    run = begin(plan, CommanderSettings.configured(**SLOW), hand_spread=0.0, gravity_error=0.0)
    run.until(
        lambda: (
            run.plant.state.ball_position[2] < plan.thrown.target[2]
            and not run.plant.state.ball_held
        )
    )
    miss = run.plant.state.ball_position - plan.thrown.landing
    assert np.linalg.norm(miss[:2]) < 0.05, miss


def test_a_careful_arm_comes_to_rest(begin, plan):  # noqa: F811
    run = begin(plan, CommanderSettings.configured(**SLOW), **REAL)
    run.until(lambda: run.commander.mode == Mode.EXECUTING and run.commander.time > 0.5)
    run.commander.stop("enough")
    steps = len(run.states)
    finish(run)
    assert (len(run.states) - steps) * PERIOD < 1.5
    assert np.abs(run.states[-1].velocity).max() < 0.3


def test_a_law_that_does_not_exist_is_named():
    with pytest.raises(ValueError, match="tracking is 'feet': choose one of joints, hand, none"):
        CommanderSettings.configured(tracking="feet")


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("share", [0.5, 1.0, 2.0, 100.0])
@pytest.mark.parametrize("delay", [0, 1])
def test_what_takes_out_the_rest_costs_the_loop_little_of_its_margin(joint, share, delay):
    """A little integral action leaves the loop stable; none up to that of careful motions brings
    it near to -1, so it stays so.
    """
    gains, s = the_arm().servo, 1j * np.logspace(-1, 3.3, 4000)
    for link in LINKS[joint]:
        stiffness, damping = gains.following_stiffness[joint], gains.following_damping[joint]
        plain = loop(joint, link, share * STIFFNESS[joint], stiffness, damping, delay)
        servo = stiffness + damping * s * SPEED_FILTER / (s + SPEED_FILTER)
        for rate in np.linspace(0.0, JointServo.TAKES_OUT, 6):
            assert np.abs(1.0 + plain * (servo + stiffness * rate / s) / servo).min() > 0.2


def test_the_rest_of_a_distance_is_taken_out_up_to_a_share_of_the_limits():
    """A joint that a constant torque pushes aside (gravity that is compensated for wrongly): by
    the servo alone it stays there.
    """
    servo, mass = (
        JointServo(Impedance(ArmModel())),
        np.array([1.0, 1.0, 0.5, 0.5, 0.05, 0.05, 0.01]),
    )
    push = np.array([4.0, -4.0, 2.0, 1.0, 0.5, -0.5, 0.2])
    wanted = np.zeros(7)

    def rest(takes_out, seconds=20.0, step=0.002):
        q, qd, taken = np.zeros(7), np.zeros(7), np.zeros(7)
        for _ in range(round(seconds / step)):
            if takes_out:
                taken = servo.take_out(taken, q, wanted, step)
            qd = qd + step * (push + taken + servo.follow(q, qd, wanted, wanted)) / mass
            q = q + step * qd
        return q, taken

    q, _ = rest(False)
    assert q == pytest.approx(push / servo.gains.following_stiffness, rel=1e-2)
    q, taken = rest(True)
    assert np.abs(q).max() < 1e-4 and taken == pytest.approx(-push, rel=1e-2)
    far = servo.take_out(np.zeros(7), np.full(7, 3.0), wanted, 10.0)
    assert far == pytest.approx(-servo.SHARE * servo.gains.limit)


# the loop that is closed by what is seen


def test_the_loop_that_cameras_close_has_the_margins_that_its_constants_say():
    """Cables give to what the correction asks of them: a faster filter would make arms swing."""
    assert margin(0.0, FILTER_TIME) == pytest.approx(0.67, abs=0.01)
    assert margin(TAKES_OUT, FILTER_TIME) == pytest.approx(0.55, abs=0.01)
    assert margin(0.0, 0.5 * FILTER_TIME) == pytest.approx(0.36, abs=0.01)


def test_what_cameras_see_of_an_error_of_the_joints_dies_away():
    left = step_left(all_joints(), TAKES_OUT, FILTER_TIME, np.array([0.01, 0.2, 0.8, 3.0]))
    assert np.abs(left[:, 0] - 1.0).max() < 0.02 and left[:, 1].max() < 0.4
    assert np.abs(left[:, 2]).max() < 0.05 and np.abs(left[:, 3]).max() < 0.01


def test_the_response_to_a_step_is_the_integral_of_that_to_an_impulse():
    """s / (s + 5): exp(-5 t)."""
    times = np.array([0.05, 0.2, 1.0])
    (left,) = step_of((1j * OMEGA / (1j * OMEGA + 5.0))[None], times)
    assert left == pytest.approx(np.exp(-5.0 * times), abs=5e-3)
