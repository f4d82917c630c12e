"""The effort bridge: what becomes of a command, how it begins, and what stops it."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import (
    ArmModel,
    ArmState,
    BridgePhase,
    BridgeSettings,
    Command,
    EffortBridge,
    Grip,
)
from dart_skill.common.configuration import node_parameters

SETTINGS = BridgeSettings.from_parameters(node_parameters("effort_bridge.yaml", "effort_bridge"))
Q = np.array([0.1, -0.9, 0.2, 0.8, -0.1, -0.35, 0.3])
MODEL = ArmModel()
MS = 1_000_000
PERIOD = 2 * MS


class Arm:
    """A bridge with states every 2 ms, and a clock that goes with them."""

    def __init__(self, **settings):
        self.bridge = EffortBridge(replace(SETTINGS, **settings))
        self.ns, self.now, self.efforts = 10**9, 50.0, []

    def state(self, q=Q, qd=None):
        self.ns += PERIOD
        self.now += 0.002
        qd = np.zeros(7) if qd is None else np.array(qd, dtype=float)
        self.efforts.append(
            self.bridge.on_state(ArmState(self.ns, np.array(q, dtype=float), qd), self.now)
        )
        return self.efforts[-1]

    def command(self, frame="world", age_ns=0, **fields):
        said = self.bridge.on_command(Command(self.ns - age_ns, **fields), frame, self.now)
        if self.efforts:
            self.efforts[-1] = self.bridge.efforts()
        return said

    def rest(self, n=200, **fields):
        """States, each of which is answered."""
        for _ in range(n):
            self.state()
            self.command(**fields)
        return self.efforts[-1]

    @property
    def phase(self):
        return self.bridge.phase


@pytest.fixture
def arm():
    return Arm()


@pytest.fixture
def active(arm):
    arm.rest()
    assert arm.phase is BridgePhase.ACTIVE
    return arm


def test_efforts_are_wrench_joint_torque_and_gravity():
    wrench, torque = (
        np.array([5.0, -3.0, 4.0, 0.3, 0.2, -0.1]),
        np.array([1.0, 2.0, -1.0, 0.5, 0.2, -0.2, 0.05]),
    )
    for gravity in (True, False):
        efforts = Arm(gravity_compensation=gravity).rest(wrench=wrench, joint_torque=torque)
        expected = MODEL.jacobian(Q).T @ wrench + torque + gravity * MODEL.gravity_torque(Q)
        np.testing.assert_allclose(efforts, expected, atol=1e-9)


def test_efforts_are_cut_to_the_limits_of_the_joints_and_it_is_counted(arm):
    efforts = arm.rest(joint_torque=np.array([500.0, -500.0, 0.0, 0.0, 0.0, 0.0, 500.0]))
    np.testing.assert_allclose(
        efforts[[0, 1, 6]], SETTINGS.torque_limit[[0, 1, 6]] * [1.0, -1.0, 1.0]
    )
    assert arm.bridge.clipped > 100


def test_nothing_begins_with_a_jump(arm):
    """Neither the first state, nor the first command, nor a stop."""
    np.testing.assert_array_equal(arm.state(), np.zeros(7))
    arm.rest(50, joint_torque=np.array([30.0, 50.0, 20.0, 10.0, 5.0, 5.0, 1.0]))
    arm.command(joint_torque=np.full(7, np.nan))
    for _ in range(50):
        arm.state(qd=np.full(7, 2.0))
    assert (np.abs(np.diff(arm.efforts, axis=0)) <= SETTINGS.torque_rate * 0.002 + 1e-9).all()


def test_before_the_first_state_no_command_is_taken(arm):
    arm.command(joint_torque=np.full(7, 1.0))
    assert arm.phase is BridgePhase.WAITING and "no state of the arm" in arm.bridge.message
    assert arm.bridge.tick(arm.now) is None
    arm.state()
    assert arm.phase is BridgePhase.WAITING and "is the commander running" in arm.bridge.message
    arm.command()
    assert arm.phase is BridgePhase.ACTIVE and not arm.bridge.message


def test_while_it_waits_the_joints_are_damped_and_held_against_gravity(arm):
    for _ in range(200):
        efforts = arm.state(qd=[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        efforts, MODEL.gravity_torque(Q) - [10.0, 0, 0, 0, 0, 0, 0], atol=1e-9
    )


FAULTS = {
    "not finite": (lambda arm: arm.command(joint_torque=np.full(7, np.nan)), "is not finite"),
    "an infinite wrench": (lambda arm: arm.command(wrench=np.full(6, np.inf)), "is not finite"),
    "another frame": (lambda arm: arm.command(frame="tool"), "in frame 'tool', not 'world'"),
    "no frame": (lambda arm: arm.command(frame=""), "in frame ''"),
    "stale": (lambda arm: arm.command(age_ns=60 * MS), "0.060 s ago"),
    "of the future": (lambda arm: arm.command(age_ns=-60 * MS), "-0.060 s ago"),
    "a second publisher": (lambda arm: arm.bridge.on_publishers(2), "2 nodes publish"),
    "states that are not finite": (lambda arm: arm.state(qd=np.full(7, np.nan)), "not seven finite"),
    "no command by the stamps": (lambda arm: [arm.state() for _ in range(30)], "no command for 0.05"),
    "no command by the clock": (lambda arm: wait(arm, 0.06), "no state of the arm for 0.06"),
    "states after a gap": (lambda arm: gap(arm, 60 * MS), "no state of the arm for 0.06"),
    "a hand that is too fast": (lambda arm: arm.state(qd=[0, 2.5, 0, 0, 0, 0, 0]), "the limit of an arm that does not throw"),
    "a joint beyond its range": (lambda arm: arm.state(q=[*Q[:3], 3.2, *Q[4:]]), "j4 is at 3.200 rad"),
    "stamps that jump back": (lambda arm: gap(arm, -500 * MS), "jumped back by 0.498 s"),
}  # fmt: skip


def wait(arm, seconds):
    arm.now += seconds
    arm.bridge.tick(arm.now)


def gap(arm, ns):
    arm.ns += ns
    arm.state()


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_damps_the_joints_says_why_and_stays_until_it_is_reset(active, fault):
    cause, reason = FAULTS[fault]
    cause(active)
    assert active.phase is BridgePhase.STOPPED and reason in active.bridge.message, (
        active.bridge.message
    )
    told = active.bridge.message
    active.bridge.on_publishers(1)
    for _ in range(100):
        efforts = active.state(qd=[0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
        active.command(joint_torque=np.full(7, 2.0))
    np.testing.assert_allclose(
        efforts, MODEL.gravity_torque(Q) - [0.0, 20.0, 0, 0, 0, 0, 0], atol=1e-9
    )
    assert active.phase is BridgePhase.STOPPED and active.bridge.message == told, (
        "good commands do not start the arm again"
    )
    assert active.bridge.reset(active.now) == "" and active.phase is BridgePhase.WAITING
    active.state()
    active.command()
    assert active.phase is BridgePhase.ACTIVE


def test_a_commander_that_is_silent_while_the_states_come_late_is_told_by_the_clock(active):
    for _ in range(4):  # stamps say 8 ms, the clock says 64 ms
        active.now += 0.014
        active.state()
    assert active.phase is BridgePhase.STOPPED and "no command for 0.0" in active.bridge.message


def test_damping_has_a_limit(active):
    active.bridge.stop("a test")
    for _ in range(200):
        efforts = active.state(qd=np.full(7, 100.0))
    expected = np.clip(
        MODEL.gravity_torque(Q) - SETTINGS.damping_limit,
        -SETTINGS.torque_limit,
        SETTINGS.torque_limit,
    )
    np.testing.assert_allclose(efforts, expected, atol=1e-9)


def test_when_the_states_are_silent_the_arm_is_held_against_gravity_only(active):
    active.rest(50, joint_torque=np.full(7, 2.0))
    assert active.bridge.tick(active.now + 0.04) is None
    for k in range(30):
        efforts = active.bridge.tick(active.now + 0.06 + 0.01 * k)
    np.testing.assert_allclose(efforts, MODEL.gravity_torque(Q), atol=1e-9)
    bare = Arm(gravity_compensation=False)
    bare.rest(50, joint_torque=np.full(7, 2.0))
    for k in range(30):
        efforts = bare.bridge.tick(bare.now + 0.06 + 0.01 * k)
    np.testing.assert_allclose(efforts, np.zeros(7), atol=1e-9)


def test_a_reset_that_would_not_help_says_why(active):
    active.bridge.on_publishers(2)
    assert "2 nodes publish" in active.bridge.reset(active.now)
    active.bridge.on_publishers(1)
    assert "no states" in active.bridge.reset(active.now + 1.0)
    assert active.phase is BridgePhase.STOPPED
    assert "no states" in Arm().bridge.reset(0.0)


def test_two_publishers_never_get_it_started(arm):
    arm.bridge.on_publishers(2)
    arm.rest(10)
    assert arm.phase is BridgePhase.WAITING and "2 nodes publish" in arm.bridge.message


def test_the_hand_is_told_once_to_open_and_again_in_the_next_throw(active):
    said = [
        active.command(grip=grip)
        for grip in (
            Grip.UNSPECIFIED,
            Grip.OPEN,
            Grip.OPEN,
            Grip.UNSPECIFIED,
            Grip.OPEN,
            Grip.CLOSE,
        )
    ]
    assert said == [None, True, None, None, True, False]
    active.bridge.stop("a test")
    assert active.command(grip=Grip.OPEN) is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"torque_limit": [1.0] * 6}, "torque_limit"),
        ({"damping": [0.0] * 7}, "damping"),
        ({"command_timeout": 0.0}, "command_timeout"),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(change, said):
    with pytest.raises(ValueError, match=said):
        replace(SETTINGS, **change)


def test_a_throw_is_the_same_through_the_bridge_as_without(make_plant, plan):
    """Limits and rates of config/ leave a throw as it is, but for its first instants and those of
    the braking.
    """
    from dart_skill.arm import Commander, CommanderSettings, Mode

    commander, plant = (
        Commander(CommanderSettings.configured(tracking="joints", friction_compensation=1.0)),
        make_plant(),
    )
    commander.execute(plan)
    bridge, worst = EffortBridge(SETTINGS), 0.0
    for step in range(900):
        state, now = plant.arm_state, 0.002 * step
        command = commander.step(state)
        bridge.on_state(state, now)
        wanted = (
            MODEL.jacobian(state.position).T @ command.wrench
            + command.joint_torque
            + MODEL.gravity_torque(state.position)
        )
        bridge.on_command(command, "world", now)
        efforts = bridge.efforts()
        if commander.mode is Mode.EXECUTING and commander.time > 0.02:
            worst = max(worst, float(np.abs(efforts - wanted).max()))
        plant.step(command)
    assert bridge.phase is BridgePhase.ACTIVE and bridge.clipped == 0 and not commander.message
    assert worst < 1e-9
