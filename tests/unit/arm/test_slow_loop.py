"""The law for arms with elastic cables, filtered speeds and delay: margins of its loop, and throws
on such an arm.
"""

import numpy as np
import pytest

from dart_skill.arm import (
    FILTER_TIME,
    TAKES_OUT,
    CommanderSettings,
    JointServo,
    Mode,
    wam_description,
)
from dart_skill.common.configuration import load_yaml
from tests.unit.arm.test_commander import begin, finish  # noqa: F401

REFLECTED = np.diag(wam_description().motors.reflected_inertia)
STIFFNESS = np.array(load_yaml("fleet.yaml")["fleet"]["wam_simulator"]["joint_stiffness"]["times"])
LINKS = np.array(
    [[0.3, 3.5], [1.5, 4.0], [0.1, 1.0], [0.3, 0.9], [0.01, 0.08], [0.03, 0.08], [0.003, 0.01]]
)
"""Smallest and largest inertia of the link side that a joint has in throws [kg m^2]."""
LEAST_FRICTION = 0.7 * np.array([1.5, 0.9, 0.5, 0.25, 0.016, 0.1, 0.0027])
PERIOD, FILTER = 0.002, 180.0
DAMPING_RATIO = 0.05
"""Damping of a cable of the simulated transmission, in parts of the critical one."""
REAL = dict(
    joint_stiffness=tuple(STIFFNESS), speed_filter=FILTER, encoder_step=9.6e-6, command_delay=1
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
    servo = stiffness_gain + damping_gain * s * FILTER / (s + FILTER)
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
    gains = JointServo.FOLLOWING
    for link in LINKS[joint]:
        response = loop(
            joint,
            link,
            share * STIFFNESS[joint],
            gains.stiffness[joint],
            gains.damping[joint],
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
    gains, s = JointServo.FOLLOWING, 1j * np.logspace(-1, 3.3, 4000)
    for link in LINKS[joint]:
        stiffness, damping = gains.stiffness[joint], gains.damping[joint]
        plain = loop(joint, link, share * STIFFNESS[joint], stiffness, damping, delay)
        servo = stiffness + damping * s * FILTER / (s + FILTER)
        for rate in np.linspace(0.0, JointServo.TAKES_OUT, 6):
            assert np.abs(1.0 + plain * (servo + stiffness * rate / s) / servo).min() > 0.2


def test_the_rest_of_a_distance_is_taken_out_up_to_a_share_of_the_limits():
    """A joint that a constant torque pushes aside (gravity that is compensated for wrongly): by
    the servo alone it stays there.
    """
    servo, mass = JointServo(None), np.array([1.0, 1.0, 0.5, 0.5, 0.05, 0.05, 0.01])
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
    assert q == pytest.approx(push / servo.FOLLOWING.stiffness, rel=1e-2)
    q, taken = rest(True)
    assert np.abs(q).max() < 1e-4 and taken == pytest.approx(-push, rel=1e-2)
    far = servo.take_out(np.zeros(7), np.full(7, 3.0), wanted, 10.0)
    assert far == pytest.approx(-servo.SHARE * servo.LIMIT)


# the loop that is closed by what is seen

GIVES = 1300.0, 100.0
"""Stiffness [1/s^2] and damping [1/s] of attractor and second pull together: how a shift of what is
wanted becomes motion of the model.
"""


def seen_loop(joint, link, stiffness, takes_out, filter_time, latency, delay=1):
    """Frequency response (n,) from where the hand is aimed at to by how much it is corrected: the
    joints follow a model of the arm whose torques are fed forward; cameras see the link.
    """
    s = 1j * np.logspace(-1, 2.7, 3000)
    motor, late = REFLECTED[joint], np.exp(-s * (delay + 0.5) * PERIOD)
    spring = stiffness + 2.0 * DAMPING_RATIO * np.sqrt(stiffness * motor) * s
    gains, friction = JointServo.FOLLOWING, LEAST_FRICTION[joint] * s
    servo = (gains.stiffness[joint] + gains.damping[joint] * s * FILTER / (s + FILTER)) * late
    seen = spring / (link * s**2 + spring)  # of the link, by what the motor does
    fed = (motor + link) * s**2 * late + friction
    follows = (servo + fed) / (motor * s**2 + friction + spring * (1.0 - seen) + servo)
    model = GIVES[0] / (s**2 + GIVES[1] * s + GIVES[0])
    frame = 0.005  # half a frame of 100 Hz
    eyes = np.exp(-s * (latency + frame)) / (filter_time * s + 1.0)
    known = follows * (1.0 + (seen - 1.0) * eyes)
    return model * (takes_out / s * known + (seen - 1.0) * follows * eyes)


def margin(takes_out, filter_time):
    """Least modulus margin over joints, loads, cables and cameras that are up to 20 ms late."""
    return min(
        np.abs(
            1.0 + seen_loop(joint, link, share * STIFFNESS[joint], takes_out, filter_time, late)
        ).min()
        for joint in range(7)
        for link in LINKS[joint]
        for share in (0.5, 1.0, 2.0)
        for late in (0.0, 0.006, 0.012, 0.02)
    )


def test_the_loop_that_cameras_close_has_the_margins_that_its_constants_say():
    """Cables give to what the correction asks of them: a faster filter would make arms swing."""
    assert margin(0.0, FILTER_TIME) == pytest.approx(0.67, abs=0.01)
    assert margin(TAKES_OUT, FILTER_TIME) == pytest.approx(0.55, abs=0.01)
    assert margin(0.0, 0.5 * FILTER_TIME) == pytest.approx(0.36, abs=0.01)
