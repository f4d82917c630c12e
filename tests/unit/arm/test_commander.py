"""The commander: its modes in order, its limits, what it does when something is wrong, and how
well a plan is followed on the plant.
"""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dart_skill.arm import (
    ArmModel,
    ArmState,
    Command,
    Commander,
    CommanderSettings,
    Gains,
    Grip,
    GripEvent,
    Guidance,
    HandPath,
    HeldCommand,
    Mode,
    MotionPlan,
    PlanRefused,
    PoseGains,
    Reference,
    Registration,
    Speed,
    same_plan,
    the_arm,
)
from dart_skill.common.configuration import node_parameters

REST = np.array([0.0, -0.90, 0.0, -0.75, 0.0, -0.35, 0.0])
MS = 1_000_000
PERIOD = 2 * MS
ORDER = [
    Mode.HOLDING,
    Mode.APPROACHING,
    Mode.SETTLING,
    Mode.EXECUTING,
    Mode.FOLLOWING_THROUGH,
    Mode.HOLDING,
]
MODEL = ArmModel()


def at(stamp_ns, position=REST, velocity=None):
    return ArmState(
        stamp_ns,
        np.array(position, dtype=float),
        np.zeros(7) if velocity is None else np.array(velocity, dtype=float),
    )


class Run:
    """A commander and a plant, stepped together; keeps what happened."""

    def __init__(self, plant, commander):
        self.plant, self.commander = plant, commander
        self.states, self.commands, self.modes, self.errors = [], [], [], []

    def step(self):
        state = self.plant.state
        command = self.commander.step(self.plant.arm_state)
        self.plant.step(command)
        self.states.append(state)
        self.commands.append(command)
        self.modes.append(self.commander.mode)
        self.errors.append(self.commander.tracking_error)

    def until(self, done, longest=3000):
        for _ in range(longest):
            self.step()
            if done():
                return self
        raise AssertionError(
            f"nothing came of it in {longest} steps: {self.commander.mode},"
            f" {self.commander.message}"
        )

    @property
    def sequence(self):
        return [mode for k, mode in enumerate(self.modes) if k == 0 or mode != self.modes[k - 1]]

    def during(self, mode, values):
        return [value for value, now in zip(values, self.modes, strict=True) if now == mode]


@pytest.fixture
def begin(make_plant):
    """A run that has begun a throw."""

    def start(plan, settings=None, **plant_settings):
        run = Run(make_plant(**plant_settings), Commander(settings))
        run.plant.reset(plan.thrown.target)
        run.step()
        run.commander.execute(plan)
        return run

    return start


def finish(run):
    return run.until(lambda: run.commander.mode == Mode.HOLDING and not run.commander.executing)


# answers


def test_every_state_is_answered_with_its_stamp_in_every_mode(begin, plan):
    run = finish(begin(plan))
    run.commander.move_to(REST, run.plant.arm_state)
    run.until(lambda: not run.commander.moving)
    run.commander.release_arm(True)
    run.step()
    run.commander.stop("enough")
    run.step()
    assert all(
        command.stamp_ns == state.stamp_ns
        for command, state in zip(run.commands, run.states, strict=True)
    )
    assert set(run.modes) == set(Mode) - {Mode.STOPPING}
    assert all(
        np.isfinite(command.wrench).all() and np.isfinite(command.joint_torque).all()
        for command in run.commands
    )


def test_the_arm_moves_to_a_posture_slowly_and_is_held_there(begin, plan):
    run = finish(begin(plan))
    way = np.abs(run.plant.arm_state.position - REST).max()
    takes = run.commander.move_to(REST, run.plant.arm_state)
    begun = len(run.states)
    run.until(lambda: not run.commander.moving)
    assert run.sequence[-2:] == [Mode.MOVING, Mode.HOLDING] and takes == pytest.approx(
        1.875 * way / run.commander.settings.approach_speed
    )
    assert len(run.states) - begun == pytest.approx(takes * 500, abs=2)
    assert (
        max(np.abs(state.velocity).max() for state in run.states[begun:])
        < 1.1 * run.commander.settings.approach_speed
    )
    for _ in range(250):
        run.step()
    assert run.plant.arm_state.position == pytest.approx(REST, abs=0.02)


def test_a_way_to_a_posture_is_stopped_and_nothing_else_begins_on_it(begin, plan):
    run = finish(begin(plan))
    run.commander.move_to(REST, run.plant.arm_state)
    run.step()
    for other in (
        lambda: run.commander.execute(plan),
        lambda: run.commander.release_arm(True),
        lambda: run.commander.move_to(REST, at(0)),
    ):
        with pytest.raises(PlanRefused, match="under way"):
            other()
    run.commander.stop("enough")
    run.until(lambda: run.commander.mode == Mode.HOLDING)
    assert not run.commander.moving and run.commander.message == "enough"


@pytest.mark.parametrize(
    ("posture", "why"),
    [
        ([0.0, -2.3, 0, 0, 0, 0, 0], "j2 at -2.30 rad"),
        ([np.nan] * 7, "finite"),
        ([0.0] * 6, "7 finite joint angles"),
    ],
)
def test_a_posture_that_cannot_be_is_refused(posture, why):
    commander = Commander()
    commander.step(at(0))
    with pytest.raises(PlanRefused, match=why):
        commander.move_to(posture, at(0))
    assert not commander.moving


def test_a_released_arm_is_not_moved():
    commander = Commander()
    commander.release_arm(True)
    with pytest.raises(PlanRefused, match="a person may hold it"):
        commander.move_to(REST, at(0))


def test_an_arm_that_is_stopped_until_a_reset_does_nothing_before_it():
    commander = Commander()
    commander.step(at(0))
    commander.stop("stopped by hand", until_reset=True)
    with pytest.raises(PlanRefused, match="not come to rest"):
        commander.reset()
    commander.step(at(PERIOD))
    assert commander.mode == Mode.HOLDING
    for moving in (
        lambda: commander.move_to(REST, at(PERIOD)),
        lambda: commander.release_arm(True),
    ):
        with pytest.raises(PlanRefused, match="stopped by hand, and stays so until it is reset"):
            moving()
    commander.stop("another reason", until_reset=True)
    assert commander.stopped_by == "stopped by hand", "the first one is the cause"
    commander.step(at(2 * PERIOD))
    commander.reset()
    commander.move_to(REST, at(2 * PERIOD))


@pytest.mark.parametrize("how", ["started anew", "not free any more", "after a gap"])
def test_an_arm_that_is_found_moving_is_braked_before_it_is_held(how):
    commander, moving = Commander(), np.full(7, 2.0)
    if how != "started anew":
        commander.step(at(0))
    if how == "not free any more":
        commander.release_arm(True)
        commander.step(at(PERIOD, REST, moving))
        commander.release_arm(False)
    command = commander.step(at(10**9 if how == "after a gap" else 2 * PERIOD, REST, moving))
    assert commander.mode == Mode.STOPPING and (command.joint_torque * moving <= 0.0).all()
    commander.step(at(2 * 10**9, REST + 0.2))
    assert commander.mode == Mode.HOLDING


def test_a_free_arm_is_left_to_gravity_compensation():
    commander = Commander()
    commander.step(at(0))
    commander.release_arm(True)
    command = commander.step(at(PERIOD, REST + 0.1, np.ones(7)))
    assert commander.mode == Mode.FREE
    np.testing.assert_array_equal(command.wrench, 0.0)
    np.testing.assert_array_equal(command.joint_torque, 0.0)
    commander.release_arm(False)
    np.testing.assert_array_equal(commander.step(at(2 * PERIOD, REST + 0.2)).joint_torque, 0.0)
    assert (commander.step(at(3 * PERIOD, REST + 0.201)).joint_torque < 0).all(), (
        "held where it is now, not where it was before"
    )


# a throw


def test_a_throw_goes_through_its_modes_in_order(begin, plan):
    run = finish(begin(plan))
    assert run.sequence == ORDER
    assert run.commander.message == ""


@pytest.mark.parametrize("end", [0.58, 1.1])
def test_the_arm_follows_through_to_rest_soon_after_the_release(begin, make_plan, end):
    """`follow_time` after it, or where the path ends before that; the hand is in full swing then."""
    whole = make_plan()
    n = int(np.searchsorted(whole.path.time, end)) + 1
    cut = HandPath(*(getattr(whole.path, f.name)[:n] for f in fields(HandPath)))
    attractor = {
        name: getattr(whole, name)[:n] for name in ("attractor_position", "attractor_quaternion")
    }
    run = finish(begin(replace(whole, path=cut, **attractor)))
    assert run.sequence == ORDER
    thrown, through = (
        2e-3 * len(run.during(mode, run.states))
        for mode in (Mode.EXECUTING, Mode.FOLLOWING_THROUGH)
    )
    expected = min(cut.duration, whole.release + CommanderSettings.configured().follow_time)
    assert thrown == pytest.approx(expected, abs=5e-3)
    assert 0.05 < through < 0.8, through
    last = run.during(Mode.FOLLOWING_THROUGH, run.states)[-1]
    assert not last.ball_held and np.abs(last.velocity).max() < 0.1


@pytest.mark.parametrize(("speed", "settling"), [(0.0, 0.1), (0.019, 0.1), (0.05, 1.0)])
def test_a_throw_waits_until_the_arm_is_quiet_but_not_for_ever(plan, speed, settling):
    """settle_time at less than settle_speed; settle_limit if the arm does not come to rest."""
    commander, modes = Commander(), []
    commander.step(at(0, plan.start_posture))
    commander.execute(plan)
    for k in range(1, 1000):
        commander.step(at(k * PERIOD, plan.start_posture, np.full(7, speed)))
        modes.append(commander.mode)
    assert (
        modes.count(Mode.SETTLING) * 2e-3 == pytest.approx(settling, abs=3e-3)
        and Mode.EXECUTING in modes
    )


def test_a_feasible_plan_is_followed_to_three_millimetres_until_the_release(begin, plan):
    run = finish(begin(plan))
    time = 2e-3 * np.arange(len(run.during(Mode.EXECUTING, run.errors)))
    errors = np.array(run.during(Mode.EXECUTING, run.errors))[time <= plan.release]
    speed = np.linalg.norm([s.ball_velocity for s in run.states], axis=1).max()
    assert errors.max() < 3e-3 and speed > 3.0, (errors.max(), speed)


def test_the_ball_lands_where_the_plan_says(begin, plan):
    """The commander, the plant and the plan's own prediction agree to a few centimetres where the
    hand has no spread.
    """
    run = begin(plan, hand_spread=0.0)
    run.until(
        lambda: (
            run.plant.state.ball_position[2] < plan.thrown.target[2]
            and not run.plant.state.ball_held
        )
    )
    miss = run.plant.state.ball_position - plan.thrown.landing
    assert np.linalg.norm(miss) < 0.05, miss


def test_the_hand_is_told_to_open_in_time_and_until_the_arm_rests(begin, plan):
    """Who takes only the newest of several commands misses nothing."""
    run = finish(begin(plan))
    told = [k for k, command in enumerate(run.commands) if command.grip != Grip.UNSPECIFIED]
    assert all(run.commands[k].grip == Grip.OPEN for k in told)
    assert told == list(
        range(told[0], len(run.commands) - run.modes[::-1].index(Mode.FOLLOWING_THROUGH))
    )
    begun = run.modes.index(Mode.EXECUTING)
    assert (run.states[told[0]].stamp_ns - run.states[begun].stamp_ns) * 1e-9 == pytest.approx(
        plan.open_hand, abs=2.1e-3
    )
    assert run.commander.opened_ns == run.states[told[0]].stamp_ns


def test_the_wrench_is_cut_at_its_limits(begin, plan):
    weak = CommanderSettings.configured(
        strongest_force=20.0, strongest_moment=0.5, farthest_error=10.0
    )
    run = finish(begin(plan, weak))
    wrenches = np.array([command.wrench for command in run.commands])
    force, moment = (
        np.linalg.norm(wrenches[:, :3], axis=1),
        np.linalg.norm(wrenches[:, 3:], axis=1),
    )
    assert force.max() == pytest.approx(20.0) and moment.max() == pytest.approx(0.5)
    free = finish(begin(plan))
    assert max(np.linalg.norm(command.wrench[:3]) for command in free.commands) > 20.0, (
        "the limit mattered"
    )


# stopping


@pytest.mark.parametrize("instant", [0.1, 0.4, 0.53, 0.6])
def test_a_throw_that_is_cancelled_comes_to_rest_within_a_second(begin, plan, instant):
    run = begin(plan)
    run.until(lambda: run.commander.mode == Mode.EXECUTING and run.commander.time >= instant)
    run.commander.stop("cancelled")
    assert not run.commander.executing
    stopped = len(run.states)
    run.until(lambda: run.commander.mode == Mode.HOLDING)
    assert (
        run.sequence[-2:] == [Mode.STOPPING, Mode.HOLDING] and run.commander.message == "cancelled"
    )
    assert (len(run.states) - stopped) * 2e-3 < 1.0
    for _ in range(100):
        run.step()
    assert np.abs(run.states[-1].velocity).max() < 0.01
    energy = np.array(
        [
            0.5 * s.velocity @ MODEL.mass_matrix(s.position) @ s.velocity
            for s in run.states[stopped:]
        ]
    )
    assert energy.max() < 1.05 * energy[0], "a damped stop does not speed up"
    if instant < plan.open_hand:
        assert run.plant.state.ball_held


def test_an_arm_that_creeps_on_is_held_in_the_end():
    commander = Commander()
    commander.step(at(0))
    commander.stop("enough")
    stamps = PERIOD * np.arange(1, 1500)
    modes = [
        (commander.step(at(int(ns), velocity=np.full(7, 0.06))), commander.mode)[1]
        for ns in stamps
    ]
    assert modes[0] == Mode.STOPPING and modes[-1] == Mode.HOLDING


@pytest.mark.parametrize("mode", [Mode.APPROACHING, Mode.SETTLING])
def test_a_throw_can_be_stopped_before_it_begins(begin, plan, mode):
    run = begin(plan)
    run.until(lambda: run.commander.mode == mode)
    run.commander.stop("changed my mind")
    run.until(lambda: run.commander.mode == Mode.HOLDING)
    assert Mode.EXECUTING not in run.modes and all(
        command.grip == Grip.UNSPECIFIED for command in run.commands
    )


def test_an_arm_that_strays_from_the_plan_is_stopped_with_the_distance(begin, plan):
    run = begin(
        plan,
        CommanderSettings.configured(
            strongest_force=1.0, tracking_stiffness=0.0, tracking_damping=0.0
        ),
    )
    run.until(lambda: run.commander.mode == Mode.HOLDING and not run.commander.executing)
    assert run.sequence[-2:] == [Mode.STOPPING, Mode.HOLDING]
    assert "m from the plan, farther than the limit of 0.15 m" in run.commander.message, (
        run.commander.message
    )


def test_a_hand_that_is_too_fast_is_stopped_with_its_speed(plan):
    commander = Commander()
    stamp = throwing(commander, plan)
    command = commander.step(at(stamp + PERIOD, plan.start_posture, [0.0, 8.0, 0, 0, 0, 0, 0]))
    assert (
        commander.mode == Mode.STOPPING
        and "moves at" in commander.message
        and "the limit of a throw is" in commander.message
    )
    assert command.joint_torque[1] < 0


def test_an_arm_that_passed_a_limit_moves_no_more_until_it_is_reset(plan):
    """The same speed is right in a throw, and wrong on the way to a posture."""
    commander = Commander()
    fast = [0.0, 2.0, 0, 0, 0, 0, 0]
    commander.step(at(0, plan.start_posture, np.zeros(7)))
    commander.release_arm(True)
    assert (
        commander.step(at(PERIOD, plan.start_posture, fast)).speed is Speed.THROW
        and not commander.stopped_by
    )
    commander.release_arm(False)
    commander.step(at(2 * PERIOD, plan.start_posture, np.zeros(7)))
    commander.step(at(3 * PERIOD, plan.start_posture, fast))
    assert "the limit of an arm that does not throw is 1" in commander.stopped_by
    for step in range(4, 20):
        commander.step(at(step * PERIOD, plan.start_posture, np.zeros(7)))
    with pytest.raises(
        PlanRefused,
        match="the arm is stopped: the (hand|elbow) moves at .* and stays so until it is reset",
    ):
        commander.execute(plan)
    commander.reset()
    commander.execute(plan)


def test_an_answer_asks_no_joint_for_more_than_its_motor_has(plan):
    """With a pull towards a hand that is far away: the whole command is weakened, so that it pulls
    where it did.
    """
    limits = CommanderSettings.configured(torque_share=0.45, farthest_error=10.0)
    commander, model, peak = (
        Commander(limits),
        ArmModel(),
        the_arm().of_joints("peak_torque"),
    )
    stamp = throwing(commander, plan)
    position = plan.start_posture + 0.3
    commander.step(at(stamp + PERIOD, plan.start_posture + 0.15, np.zeros(7)))
    command = commander.step(at(stamp + 2 * PERIOD, position, np.zeros(7)))
    asked = command.joint_torque + model.jacobian(position).T @ command.wrench
    share = (np.abs(asked) + np.abs(model.gravity_torque(position))) / peak
    assert 0.44 < share.max() <= 0.45 + 1e-9


def throwing(commander, plan):
    """Brings a commander to THROWING with an arm that stands in the start posture; the last stamp."""
    commander.step(at(0, plan.start_posture))
    commander.execute(plan)
    stamp = 0
    while commander.mode != Mode.EXECUTING:
        stamp += PERIOD
        commander.step(at(stamp, plan.start_posture))
    return stamp


def test_a_state_to_which_the_arm_cannot_have_come_is_refused_and_changes_nothing(plan):
    commander = Commander()
    before = commander.step(at(PERIOD))
    for wrong in (REST[::-1], REST + 0.3, REST + 1e300):
        with pytest.raises(
            ValueError,
            match=(
                r"jumped by \S+ rad within 0.002 s: that is another arm, or the message is damaged"
            ),
        ):
            commander.step(at(2 * PERIOD, wrong))
    after = commander.step(at(2 * PERIOD, REST + 0.03))
    assert (
        commander.mode == Mode.HOLDING
        and np.abs(after.joint_torque - before.joint_torque).max() > 0.0
    )
    commander.step(at(2 * PERIOD + 1000 * MS, REST[::-1]))  # after a gap it may be anywhere


@pytest.mark.parametrize(
    "gap_ns, said",
    [
        (101 * MS, "no state of the arm for 0.10 s"),
        (1000 * MS, "no state of the arm for 1.00 s"),
        (-PERIOD, "the states of the arm went back in time by 0.002 s"),
    ],
)
def test_after_a_gap_the_arm_is_held_where_it_is_found(plan, gap_ns, said):
    commander = Commander()
    stamp = throwing(commander, plan) + gap_ns
    command = commander.step(at(stamp, REST + 0.2))
    assert commander.mode == Mode.HOLDING and not commander.executing
    assert said in commander.message
    np.testing.assert_array_equal(command.wrench, 0.0)
    assert (commander.step(at(stamp + PERIOD, REST + 0.201)).joint_torque < 0).all()


@pytest.mark.parametrize(("gap_ns", "ends"), [(390 * MS, False), (410 * MS, True)])
def test_a_motion_to_a_posture_waits_during_a_short_gap(gap_ns, ends):
    commander, stamp = Commander(), 0
    seconds = commander.move_to(REST + 0.4, at(0))
    for stamp in range(0, 300 * MS, PERIOD):
        commander.step(at(stamp))
    commander.step(at(stamp + gap_ns))
    assert (commander.mode == Mode.HOLDING) == ends == ("no state of the arm" in commander.message)
    if not ends:
        assert (
            commander.time == pytest.approx((stamp + 20 * MS) * 1e-9) and commander.time < seconds
        )


def test_an_arm_that_is_held_is_held_where_it_is_found_after_a_short_gap():
    commander = Commander()
    commander.step(at(0))
    asked = commander.step(at(200 * MS, REST + 0.05)).joint_torque
    assert commander.mode == Mode.HOLDING and not asked.any()


def test_an_arm_that_was_moved_far_during_a_gap_is_held_where_it_is_found():
    commander, stamp = Commander(), 0
    commander.move_to(REST + 0.4, at(0))
    for stamp in range(0, 300 * MS, PERIOD):
        commander.step(at(stamp))
    commander.step(at(stamp + 390 * MS, REST + 0.31))
    assert commander.mode == Mode.HOLDING and "no state of the arm" in commander.message


@pytest.mark.parametrize("field", ["position", "velocity"])
def test_a_state_that_is_not_finite_is_refused_and_changes_nothing(plan, field):
    commander, twin = Commander(), Commander()
    stamp = throwing(commander, plan)
    throwing(twin, plan)
    bad = replace(at(stamp + PERIOD), **{field: np.array([0, 0, np.nan, 0, 0, 0, 0.0])})
    with pytest.raises(ValueError, match=f"{stamp + PERIOD} ns is not finite.*nan"):
        commander.step(bad)
    state = at(stamp + PERIOD, plan.start_posture)
    answers = [one.step(state) for one in (commander, twin)]
    np.testing.assert_array_equal(answers[0].wrench, answers[1].wrench)
    np.testing.assert_array_equal(answers[0].joint_torque, answers[1].joint_torque)
    assert commander.mode == twin.mode == Mode.EXECUTING


@pytest.mark.parametrize("joints", [0, 6, 8])
def test_a_state_of_an_arm_with_other_joints_is_refused(joints):
    with pytest.raises(ValueError, match="the arm has 7 joints"):
        Commander().step(ArmState(0, np.zeros(joints), np.zeros(joints)))


# refusals


def refused(plan, pattern, settings=None):
    commander = Commander(settings)
    commander.step(at(0))
    with pytest.raises(PlanRefused, match=pattern):
        commander.execute(plan)
    assert not commander.executing
    commander.step(at(PERIOD))
    assert commander.mode == Mode.HOLDING


def test_a_plan_that_starts_outside_the_joint_limits_is_refused(plan):
    refused(
        replace(plan, start_posture=np.array([0.0, -2.3, 0, 0, 0, 0, 0])),
        r"j2 at -2\.30 rad, outside -2\.00 to 2\.00",
    )


def test_a_plan_that_is_too_fast_is_refused(plan):
    speed = np.linalg.norm(plan.path.velocity[:, :3], axis=1).max()
    refused(
        plan,
        rf"{speed:.2f} m/s; the limit of a throw is 2\.0 m/s",
        CommanderSettings.configured(fastest_hand=2.0),
    )


def test_a_plan_whose_path_does_not_begin_at_the_start_posture_is_refused(plan):
    refused(
        replace(plan, start_posture=plan.start_posture + [0.2, 0, 0, 0, 0, 0, 0]),
        r"holds the hand 0\.\d+ m and 0\.20 rad from",
    )
    twisted = plan.start_posture + [0, 0, 0, 0, 0, 0, 0.5]
    refused(
        replace(plan, start_posture=twisted),
        r"holds the hand 0\.000 m and 0\.50 rad from where the path begins",
    )


def test_a_plan_beyond_the_reach_of_the_arm_is_refused(plan):
    """The path leaves the arm's sphere before the release; afterwards nobody has to follow it so
    exactly.
    """
    outwards = np.sin(np.pi * plan.path.time / plan.path.duration)[:, None] ** 2 * [0.0, 0.0, 0.5]
    far = replace(plan.path, position=plan.path.position + outwards)
    refused(
        replace(plan, path=far), r"takes the hand 1\.\d+ m from the shoulder; the arm .* 0\.9\d+ m"
    )


def test_a_joint_that_comes_to_the_end_of_its_range_stops_the_throw(plan):
    commander = Commander()
    stamp = throwing(commander, plan)
    at_its_end = plan.start_posture.copy()
    at_its_end[3] = -0.89
    commander.step(at(stamp + PERIOD, at_its_end, np.full(7, 0.2)))
    assert (
        commander.mode == Mode.STOPPING
        and "j4 is at -0.890 rad, closer than 0.02 rad" in commander.message
    )


def test_only_one_throw_at_a_time(begin, plan):
    run = begin(plan)
    for _ in range(2):  # requested, and under way
        with pytest.raises(PlanRefused, match="a throw is under way"):
            run.commander.execute(plan)
        with pytest.raises(PlanRefused, match="a throw is under way"):
            run.commander.release_arm(True)
        run.step()
    finish(run)
    run.commander.execute(plan)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("end", np.nan, "plan.end is nan"),
        ("end", 5.0, "plan.end is 5.0 s, outside"),
        ("start_posture", np.zeros(6), r"plan.start_posture has shape \(6,\)"),
        ("attractor_position", np.zeros((3, 3)), r"plan.attractor_position has shape \(3, 3\)"),
    ],
)
def test_a_plan_that_makes_no_sense_cannot_be_made(plan, field, value, message):
    with pytest.raises(ValueError, match=message):
        replace(plan, **{field: value})


def test_a_throw_that_makes_no_sense_cannot_be_made(plan):
    for told in (np.nan, -0.1, plan.release + 0.1):
        with pytest.raises(ValueError, match=f"the hand is told OPEN at {told}"):
            GripEvent(told, Grip.OPEN, plan.release)
    with pytest.raises(ValueError, match="plan.target"):
        replace(plan.throw, target=np.array([1.0, np.nan, 0.4]))
    assert plan.opening_at(-0.1).open_hand == 0.0 and plan.opening_at(0.1).open_hand == 0.1
    with pytest.raises(ValueError, match="throws nothing"):
        _ = replace(plan, throw=None).thrown


def test_quaternions_of_a_plan_are_of_unit_length(plan):
    with pytest.raises(ValueError, match="plan.attractor_quaternion"):
        replace(plan, attractor_quaternion=0.0 * plan.attractor_quaternion)
    with pytest.raises(ValueError, match="path.quaternion"):
        replace(plan.path, quaternion=2.0 * plan.path.quaternion)


@pytest.mark.parametrize(
    "time",
    [
        lambda t: t[::-1],
        lambda t: t * 0,
        lambda t: np.where(t > 0.5, np.nan, t),
        lambda t: t + 1.0,
    ],
    ids=["falls", "stands", "nan", "late"],
)
def test_the_clock_of_a_path_starts_at_zero_and_runs(plan, time):
    with pytest.raises(ValueError, match="path.time"):
        replace(plan.path, time=time(plan.path.time))


@pytest.mark.parametrize("gains", [(0.0, 1.0), (1.0, -1.0), (np.nan, 1.0), (np.inf, 1.0)])
def test_gains_are_positive(gains):
    with pytest.raises(ValueError, match="must be finite and positive"):
        Gains(*gains)


def test_same_plan_sees_the_last_bit(plan):
    assert same_plan(plan, replace(plan, model_id="another name"))
    moved = plan.attractor_position.copy()
    moved[17, 1] = np.nextafter(moved[17, 1], 1.0)
    assert not same_plan(plan, replace(plan, attractor_position=moved))
    late = replace(plan.path, position=plan.path.position + 1e-15)
    assert not same_plan(plan, replace(plan, path=late))
    assert not same_plan(plan, replace(plan, end=np.nextafter(plan.end, 1.0)))


def test_settings_come_from_the_parameters_of_the_node():
    parameters = node_parameters("commander.yaml", "commander")
    assert CommanderSettings.from_parameters(parameters) == CommanderSettings.configured()
    with pytest.raises(KeyError, match="fastest_foot"):
        CommanderSettings.configured(fastest_foot=1.0)
    assert (
        CommanderSettings.from_parameters({**parameters, "fastest_hand": 2.0}).limits.fastest_hand
        == 2.0
    )


def test_a_held_command_does_not_open_the_hand_again():
    command = Command(5, np.arange(6.0), np.arange(7.0), Grip.OPEN)
    held = command.answering(7)
    assert held.stamp_ns == 7 and held.grip == Grip.UNSPECIFIED
    np.testing.assert_array_equal(held.wrench, command.wrench)


def test_what_the_hand_is_told_acts_once_also_where_a_newer_command_overtakes_it():
    """In real time the hand never opened: each command was held, and a held one does not tell the
    hand anything.
    """
    held = HeldCommand(0.05)
    assert held.answer_to(0) is None and not held.has_come
    held.take(Command(2, np.arange(6.0), grip=Grip.OPEN))
    held.take(Command(4, np.ones(6)))
    first, second = held.answer_to(6), held.answer_to(8)
    assert (first.grip, second.grip) == (Grip.OPEN, Grip.UNSPECIFIED) and (
        first.stamp_ns,
        second.stamp_ns,
    ) == (6, 8)
    np.testing.assert_array_equal([first.wrench, second.wrench], np.ones((2, 6)))


def test_a_command_that_is_too_old_or_out_of_order_is_not_held():
    held = HeldCommand(0.05)
    held.take(Command(10_000_000, grip=Grip.OPEN))
    with pytest.raises(
        ValueError, match="before the one of 10000000 ns that is obeyed: out of order"
    ):
        held.take(Command(8_000_000))
    assert held.answer_to(60_000_001) is None
    assert held.answer_to(60_000_000).grip == Grip.UNSPECIFIED, (
        "what came too late for its state does not open the hand later"
    )


@pytest.mark.parametrize(
    "law", [{"tracking": "hand"}, {"tracking": "joints", "friction_compensation": 1.0}]
)
def test_the_arm_does_what_cameras_of_another_world_shall_see(begin, plan, law):
    """Seen 2 cm too high and turned by 1 degree, the hand goes where the plan says it is seen, and
    not where it says it is.
    """
    turn = Rotation.from_euler("z", 1.0, degrees=True)
    seen = Registration(turn=turn.as_quat(), shift=(0.0, 0.0, 0.02))
    run = finish(
        begin(
            replace(plan, registration=seen),
            CommanderSettings.configured(**law),
            gravity_error=0.0,
        )
    )
    begun = run.modes.index(Mode.EXECUTING)
    k = begun + round(plan.release * 1e9) // PERIOD
    released = MODEL.hand_pose(run.states[k].position)[0]
    path, when = plan.path, (run.states[k].stamp_ns - run.states[begun].stamp_ns) * 1e-9
    planned = np.array([np.interp(when, path.time, axis) for axis in path.position.T])
    np.testing.assert_allclose(turn.apply(released) + [0.0, 0.0, 0.02], planned, atol=0.012)
    assert np.linalg.norm(released - planned) > 0.018


@pytest.mark.parametrize(("speed", "grows"), [(Speed.CAREFUL, -0.36), (Speed.THROW, 0.0)])
def test_only_a_careful_motion_takes_out_what_is_left_of_its_distance(speed, grows):
    """At 0.5 of the servo's 360 N m/rad per second, for 0.2 s, of 0.01 rad at J1; and more where the
    hand is aimed beyond where it shall be."""
    position, rotation = MODEL.hand_pose(REST)
    places, turns = (
        np.tile(position, (3, 1)),
        np.tile(Rotation.from_matrix(rotation).as_quat(), (3, 1)),
    )
    path = HandPath(np.arange(3.0), places, turns, np.zeros((3, 6)), np.zeros((3, 6)))
    gains = Gains.critical(200.0)
    commander, stamp = Commander(CommanderSettings.configured(tracking="joints")), 0
    commander.step(at(stamp))
    commander.execute(MotionPlan(path, places, turns, gains, gains, REST, 2.0, speed=speed))
    while commander.mode != Mode.EXECUTING:
        stamp += PERIOD
        commander.step(at(stamp))
    aside = REST + 0.01 * (np.arange(7) == 0)
    torques = [
        commander.step(at(stamp + k * PERIOD, aside)).joint_torque[0] for k in range(1, 102)
    ]
    grown = torques[-1] - torques[0]
    assert grown < grows if speed == Speed.CAREFUL else grown == pytest.approx(grows, abs=0.02)


class Still:
    """A guide of a careful hand that stays where it began, and keeps what it was shown."""

    what, start_posture, speed = "stay", REST, Speed.CAREFUL

    def __init__(self, touches=False):
        self.touches, self.seen = touches, []

    def see(self, *pose):
        self.seen.append(pose)

    def look(self, time, hand, stamp_ns):
        place, turn = MODEL.hand_pose(REST)
        gains = PoseGains.of((200.0, 28.0), (200.0, 28.0))
        here = Reference(place, turn, place, turn, np.zeros(6), np.zeros(6))
        return Guidance(
            time, here, gains, Grip.UNSPECIFIED, False, 0.0, False, touches=self.touches
        )


@pytest.mark.parametrize(("touches", "grows"), [(False, -0.36), (True, 0.0)])
def test_an_arm_that_touches_something_presses_no_harder_with_time(touches, grows):
    """J1 is held 0.01 rad aside for 0.2 s, as of a careful motion above."""
    commander, stamp = Commander(CommanderSettings.configured(tracking="joints")), 0
    commander.step(at(stamp))
    commander.follow(Still(touches))
    while commander.mode != Mode.EXECUTING:
        stamp += PERIOD
        commander.step(at(stamp))
    aside = REST + 0.01 * (np.arange(7) == 0)
    torques = [
        commander.step(at(stamp + k * PERIOD, aside)).joint_torque[0] for k in range(1, 102)
    ]
    assert torques[-1] - torques[0] == pytest.approx(grows, abs=0.02)


def test_what_cameras_see_reaches_the_guide_of_the_motion_under_way_alone():
    commander, guide = Commander(), Still()
    pose = "hand", 5, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    commander.step(at(0))
    commander.see(*pose)
    commander.follow(guide)
    commander.see(*pose)
    commander.step(at(PERIOD))
    commander.see(*pose)
    assert len(guide.seen) == 2 and guide.seen[0] == pose
    commander.stop("enough")
    commander.see(*pose)
    assert len(guide.seen) == 2
