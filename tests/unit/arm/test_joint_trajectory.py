"""A plan as a path of the joints: where it leads, that it begins and ends at rest, what is refused,
and what becomes of it on an arm whose controller takes positions.
"""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.arm import (
    ArmModel,
    ArmState,
    CommanderSettings,
    Grip,
    JointTrajectory,
    LimitedMotion,
    Mode,
    PlanRefused,
    Speed,
    TrajectoryCommander,
    TrajectoryLimits,
    held,
    planned_trajectory,
    still_plan,
    the_arm,
    way_to,
)
from dart_skill.simulation import ControllerSettings, SimulatedController, quintic

SETTINGS = CommanderSettings.configured(output="trajectory")
ARM = the_arm()
MS = 1_000_000
REST = np.array([0.0, -0.90, 0.0, -0.75, 0.0, -0.35, 0.0])


@pytest.fixture(scope="module")
def trajectory(plan):
    """Of a throw."""
    return planned_trajectory(plan, SETTINGS, ARM)


def polynomial(time):
    """Angle, speed and acceleration of 1 + 2 t - t^2 + 3 t^3 - t^4 + 0.5 t^5, for one joint."""
    t = np.asarray(time, dtype=float)
    position = 1 + 2 * t - t**2 + 3 * t**3 - t**4 + 0.5 * t**5
    velocity = 2 - 2 * t + 9 * t**2 - 4 * t**3 + 2.5 * t**4
    return position, velocity, -2 + 18 * t - 12 * t**2 + 10 * t**3


def test_between_two_instants_it_is_the_polynomial_of_fifth_order_as_the_controller_has_it():
    time = np.array([0.0, 0.3, 1.0])
    rows = [row[:, None] for row in polynomial(time)]
    course = JointTrajectory(time, *rows)
    for at in (0.0, 0.1, 0.3, 0.77, 1.0):
        position, velocity, _ = polynomial(at)
        assert course.at(at)[0] == pytest.approx(position, abs=1e-12)
        assert course.at(at)[1] == pytest.approx(velocity, abs=1e-11)
    assert quintic(course, 1, 0.47) == pytest.approx(polynomial(0.77)[0], abs=1e-12)


def test_a_way_to_a_posture_is_the_motion_of_least_jerk():
    course = way_to(np.zeros(7), np.ones(7), 2.0)
    for share in (0.1, 0.5, 0.83):
        wanted = share**3 * (10 - 15 * share + 6 * share**2)
        assert course.at(2.0 * share)[0] == pytest.approx(np.full(7, wanted), abs=1e-12)
    assert course.at(5.0)[0] == pytest.approx(np.ones(7)) and not course.at(5.0)[1].any()


def test_times_that_do_not_increase_are_refused():
    with pytest.raises(ValueError, match="increasing"):
        JointTrajectory(np.array([0.0, 0.0]), *(np.zeros((2, 7)) for _ in range(3)))


def test_the_ball_is_let_go_where_the_plan_lets_it_go_and_as_fast(plan, trajectory):
    model, k = ArmModel(ARM), int(np.abs(plan.path.time - plan.release).argmin())
    hand = model.hand_state(*trajectory.at(float(plan.path.time[k])))
    grip = ARM.hand.ball_centre
    there = held(hand.position, hand.rotation, hand.velocity, grip)
    pose = model.hand_state(*trajectory.at(plan.release))
    assert np.linalg.norm(pose.position - plan.path.position[k]) < 0.02
    arm = hand.rotation @ grip
    wanted = plan.path.velocity[k]
    speed = wanted[:3] + np.cross(wanted[3:], arm)
    assert np.linalg.norm(there[1] - speed) < 0.05, (there[1], speed)


def test_it_begins_and_ends_at_rest_and_goes_on_without_jumps(plan, trajectory):
    assert trajectory.position[0] == pytest.approx(plan.start_posture)
    for rows in (trajectory.velocity, trajectory.acceleration):
        assert not rows[-1].any()
    assert np.abs(trajectory.velocity[0]).max() < 1e-6
    fine = np.arange(0.0, trajectory.duration, 1e-3)
    angles, speeds = (np.array(part) for part in zip(*map(trajectory.at, fine), strict=True))
    assert np.abs(np.gradient(angles, fine, axis=0) - speeds)[1:-1].max() < 0.01
    assert np.abs(np.diff(speeds, axis=0)).max() < 1e-3 * 1.1 * 60.0


def test_it_keeps_the_limits_of_the_joints(trajectory):
    assert TrajectoryLimits(SETTINGS, ARM).broken(trajectory) is None
    speeds = np.array([trajectory.at(t)[1] for t in np.arange(0.0, trajectory.duration, 2e-3)])
    assert (np.abs(speeds) <= ARM.of_joints("no_load_speed")).all()


def test_a_throw_keeps_the_speeds_of_slow_joints_and_still_lets_go_as_planned(plan):
    """The fourth joint, which swings fastest, has 5 % less than it would take."""
    free = planned_trajectory(plan, SETTINGS, ARM)
    most = np.abs(free.velocity).max(axis=0)
    slow = 0.95 * most[3]
    joints = list(ARM.joints)
    joints[3] = replace(joints[3], no_load_speed=float(slow))
    arm = replace(ARM, joints=tuple(joints))
    course = planned_trajectory(plan, SETTINGS, arm)
    assert np.abs(course.velocity[:, 3]).max() <= slow
    motion = LimitedMotion(plan, plan.end, arm)
    time = np.arange(0.0, plan.end, 2e-3)
    motion.found(np.array([free.at(t)[1] for t in time]), time)
    assert motion.missed[0] < 0.005 and motion.missed[1] < 0.05, motion.missed


def test_what_joints_cannot_do_is_refused_by_name_value_limit_and_remedy(plan):
    joints = [replace(joint, no_load_speed=0.4 * joint.no_load_speed) for joint in ARM.joints]
    joints[1] = replace(joints[1], no_load_speed=0.5)
    with pytest.raises(PlanRefused, match=r"wam_j\d .*rad/s; its limit is .* rad/s: choose"):
        planned_trajectory(plan, SETTINGS, replace(ARM, joints=tuple(joints)))


@pytest.mark.parametrize(
    ("field", "joint", "value", "why"),
    [
        ("position", 1, 2.5, "wam_j2 would be at 2.50 rad after 0.01 s, outside -1.98 to 1.98"),
        ("velocity", 6, 90.0, "wam_j7 would turn at 90.00 rad/s after 0.01 s; its limit is"),
        ("acceleration", 6, 61.0, "wam_j7 would gain 61.00 rad/s^2 after 0.01 s; its limit is 60"),
        ("acceleration", 1, 30.0, "would need"),
    ],
)
def test_each_limit_is_named(field, joint, value, why):
    course = way_to(REST, REST, 0.02)
    getattr(course, field)[1, joint] = value
    weak = replace(SETTINGS, limits=replace(SETTINGS.limits, torque_share=0.5))
    share, text = TrajectoryLimits(weak, ARM).broken(course)
    assert share > 1.0 and why in text, text


# on an arm


class Kinematic:
    """An arm whose joints are where its drives are, and a commander that sends it trajectories."""

    def __init__(self, rate=500.0, lag=0.0, settings=SETTINGS, **tolerances):
        self.controller = SimulatedController(REST, ControllerSettings(rate, lag, **tolerances))
        self.commander = TrajectoryCommander(settings, ARM, controller=self.controller)
        self.stamp_ns, self.every, self.held = MS, round(500 / rate), False
        self.opened_ns, self.course = None, []
        self.tell()

    def tell(self):
        """A state, and the answer to it."""
        arm = self.controller
        self.command = self.commander.step(ArmState(self.stamp_ns, arm.position, arm.velocity))
        assert not self.command.wrench.any() and not self.command.joint_torque.any()
        if arm.told == Grip.OPEN and self.opened_ns is None:
            self.opened_ns, self.opened_at = self.stamp_ns, arm.position.copy()

    def step(self, count=1):
        for _ in range(count):
            self.stamp_ns += 2 * MS
            if not self.held:
                self.controller.update(self.stamp_ns, self.controller.position)
            if self.stamp_ns // (2 * MS) % self.every == 0:
                self.tell()
            self.course.append(self.controller.position.copy())
        return self

    def until(self, done, longest=6000):
        for _ in range(longest):
            self.step()
            if done():
                return self
        raise AssertionError(f"{self.commander.mode}: {self.commander.message}")

    def rests(self):
        return self.commander.mode == Mode.HOLDING and not self.commander.executing


@pytest.mark.parametrize("rate", [500.0, 125.0])
@pytest.mark.parametrize("lag", [0.0, 0.03])
def test_the_hand_is_told_when_the_arm_is_where_the_plan_tells_it(plan, rate, lag):
    """Within half a period of the states, and what the estimate of the lag is off."""
    arm = Kinematic(rate, lag)
    arm.commander.execute(plan)
    arm.until(arm.rests)
    assert not arm.commander.message and arm.opened_ns == arm.commander.opened_ns
    course = planned_trajectory(plan, SETTINGS, ARM)
    times = np.arange(0.0, course.duration, 1e-4)
    near = np.array([np.linalg.norm(course.at(t)[0] - arm.opened_at) for t in times])
    told = plan.events[0].time
    assert times[near.argmin()] == pytest.approx(told, abs=0.5 / rate + 1e-3)


def test_the_hand_is_told_earlier_by_its_lead_and_the_record_is_not(plan):
    lead = replace(SETTINGS, trajectory=replace(SETTINGS.trajectory, hand_lead=0.04))
    arm = Kinematic(settings=lead)
    arm.commander.execute(plan)
    arm.until(arm.rests)
    assert arm.commander.opened_ns - arm.opened_ns == pytest.approx(40 * MS, abs=3 * MS)


def test_a_still_plan_and_a_way_to_a_posture_are_carried_out():
    arm = Kinematic()
    posture = REST + np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.3])
    arm.commander.move_to(posture, ArmState(arm.stamp_ns, REST, np.zeros(7)))
    arm.until(lambda: not arm.commander.moving)
    assert arm.controller.position == pytest.approx(posture, abs=1e-6)
    assert arm.commander.mode == Mode.HOLDING and not arm.commander.message
    arm.commander.execute(still_plan(ARM, Speed.CAREFUL))
    arm.until(arm.rests)
    assert not arm.commander.message


def begun(plan, **options):
    """A throw whose arm moves."""
    arm = Kinematic(**options)
    arm.commander.execute(plan)
    arm.until(
        lambda: (
            arm.commander.mode == Mode.EXECUTING and np.abs(arm.controller.velocity).max() > 0.3
        )
    )
    return arm


def test_a_stop_cancels_the_trajectory(plan):
    arm = begun(plan)
    arm.commander.stop("enough")
    before = arm.controller.position.copy()
    arm.step(50)
    assert np.abs(arm.controller.position - before).max() < 0.05
    assert arm.commander.message == "enough" and arm.opened_ns is None
    arm.until(arm.rests)


def test_an_arm_that_is_held_is_stopped_with_the_name_of_its_joint(plan):
    arm = begun(plan)
    arm.held = True
    arm.until(lambda: not arm.commander.executing, 300)
    assert arm.commander.lag < 0.01, "the next motion must not be stopped for this one"
    assert "is the speed of its pendant at 100 %" in arm.commander.message or (
        "rad from its trajectory" in arm.commander.message
    )


def test_a_motion_that_the_controller_gives_up_is_stopped_and_the_reason_is_told(plan):
    arm = begun(plan, lag=0.03, path_tolerance=0.02)
    arm.until(lambda: not arm.commander.executing, 300)
    assert "gave the motion up" in arm.commander.message
    assert "path tolerance" in arm.commander.message


def test_a_controller_that_has_not_answered_in_time_is_not_waited_for(plan):
    arm = Kinematic()
    arm.controller.has_taken = False
    arm.commander.execute(plan)
    arm.until(lambda: bool(arm.commander.message), 300)
    assert "raise trajectory_lead, which is 0.2 s" in arm.commander.message


def test_states_that_go_back_in_time_cancel_the_trajectory(plan):
    arm = begun(plan)
    arm.stamp_ns -= 1000 * MS
    arm.tell()
    assert not arm.commander.executing and "went back" in arm.commander.message
    before = arm.controller.position.copy()
    arm.step(2)
    assert np.abs(arm.controller.position - before).max() < 0.05


def test_a_motion_that_is_decided_on_the_way_is_refused(plan):
    with pytest.raises(PlanRefused, match="needs an arm that takes torques"):
        Kinematic().commander.follow(type("Guide", (), {"what": "place"})())


def test_an_output_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="output is 'velocity': choose one of torque, trajectory"):
        CommanderSettings.configured(output="velocity")


def test_the_simulated_controller_refuses_what_its_documents_say():
    course = way_to(REST, REST + 0.1, 0.5)
    course.velocity[-1] = 0.2
    controller, said = SimulatedController(REST), []
    controller.follow(course, 0, said.append)
    assert said == ["refused: the velocity of the last trajectory point is not zero"]
    controller.update(5_000 * MS, REST)
    controller.follow(way_to(REST, REST + 0.1, 0.5), 0, said.append)
    assert "ends in the past" in said[1]
