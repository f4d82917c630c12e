"""What the hand is told at each instant: plans whose clock is time or the state of the arm, events
of the fingers, gains that change.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from dart_skill.arm import (
    CarefulGuide,
    Gains,
    GainsOverTime,
    Grip,
    GripEvent,
    HandPath,
    HandState,
    MotionPlan,
    Pace,
    PlanGuide,
    PoseGains,
    Reference,
    References,
    Registration,
    SeenOffset,
    Speed,
    Yielding,
    attractor_acceleration,
    shifted,
)
from dart_skill.common.pace import PhaseRule
from tests.interpreted import interpreted

SPEED, END, STEP = 0.5, 2.0, 0.01
TIME = np.arange(0.0, END + STEP, STEP)
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
HELD_BACK = 5.0
"""Time after which a motion that is held back is given up [s]."""
RULE = PhaseRule(slowest=0.01, fastest=1.5, time_constant=0.02, ignored=0.01)


def along_x(**changes):
    """A hand that goes along x with SPEED, and is closed at 0.5 s and opened at 1.5 s."""
    n = len(TIME)
    velocity = np.zeros((n, 6))
    velocity[:, 0] = SPEED
    position = np.column_stack([SPEED * TIME, np.zeros(n), np.ones(n)])
    quaternion = np.tile(UPRIGHT, (n, 1))
    path = HandPath(TIME - TIME[0], position, quaternion, velocity, np.zeros((n, 6)))
    plan = MotionPlan(
        path=path, attractor_position=position + 0.1, attractor_quaternion=quaternion, position_gains=Gains(400.0, 40.0),
        orientation_gains=Gains(300.0, 30.0), start_posture=np.zeros(7), end=1.9, what="test",
        events=(GripEvent(0.5, Grip.CLOSE, 0.6), GripEvent(1.5, Grip.OPEN, 1.55)),
    )  # fmt: skip
    return replace(plan, **changes)


def by_place(**rule):
    """A pace that tells from the place along x alone how far the hand is ahead."""
    gain = np.zeros((len(TIME), 12))
    gain[:, 0] = 1.0 / SPEED
    return Pace(gain, replace(RULE, **rule))


def hand_at(x, speed=SPEED, aside=0.0):
    return HandState(
        np.array([x, aside, 1.0]), np.eye(3), np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    )


def looks(guide, places, step=STEP):
    """What a guide says to a hand that is at these places, one step after the other."""
    return [guide.look(step * k, hand_at(x), 0) for k, x in enumerate(places)]


# events


@pytest.mark.parametrize("pace", [None, by_place()])
def test_the_fingers_are_told_again_and_again_and_what_they_hold_is_known_when_they_are_done(pace):
    said = looks(PlanGuide(along_x(pace=pace), 0.05), SPEED * TIME)
    for k, now in enumerate(said):
        time = STEP * k
        told = (
            Grip.UNSPECIFIED
            if time < 0.5 - 1e-6
            else Grip.CLOSE
            if time < 1.5 - 1e-6
            else Grip.OPEN
        )
        assert now.grip == told, time
        assert now.carries == (0.6 + 1e-6 < time < 1.55 + 1e-6), time


def test_a_hand_that_holds_something_at_first_has_lost_it_when_it_has_opened():
    plan = along_x(events=(GripEvent(0.5, Grip.OPEN, 0.7),), carries=True)
    said = looks(PlanGuide(plan, 0.0), SPEED * TIME)
    assert [now.carries for now in said] == [STEP * k <= 0.7 for k in range(len(said))]


# a clock that is time


def test_time_goes_on_whatever_the_hand_does_and_ends_a_little_after_the_end():
    guide = PlanGuide(along_x(), 0.05)
    said = looks(guide, np.zeros(len(TIME)))
    assert [now.time for now in said] == pytest.approx(STEP * np.arange(len(TIME)))
    assert [now.over for now in said] == [STEP * k > 1.95 + 1e-9 for k in range(len(TIME))]
    assert said[100].off == pytest.approx(0.5) and said[191].off == 0.0, (
        "after the end the hand may be anywhere"
    )


# a clock that the hand drives


def test_a_hand_that_does_what_is_planned_makes_the_clock_that_of_time():
    guide, plan = PlanGuide(along_x(pace=by_place()), 0.05), PlanGuide(along_x(), 0.05)
    for driven, timed in zip(looks(guide, SPEED * TIME), looks(plan, SPEED * TIME), strict=True):
        assert driven.time == pytest.approx(timed.time, abs=1e-9)
        np.testing.assert_allclose(driven.reference.velocity, timed.reference.velocity, atol=1e-9)


@pytest.mark.parametrize(
    ("late", "rate"), [(0.009, 1.0), (0.020, 0.5), (0.5, 0.01), (-0.012, 1.1), (-0.5, 1.5)]
)
def test_the_rate_is_that_of_the_rule(late, rate):
    """1 + (ahead less 0.01 s) / 0.02 s, between 0.01 and 1.5."""
    guide = PlanGuide(along_x(pace=by_place()), 0.05)
    looks(guide, SPEED * TIME[:31])
    before, now = (
        guide.look(0.30, hand_at(SPEED * 0.30), 0),
        guide.look(0.31, hand_at(SPEED * (0.30 - late)), 0),
    )
    assert now.time - before.time == pytest.approx(0.01 * rate)
    assert now.reference.velocity[0] == pytest.approx(SPEED * rate)


def test_a_hand_that_is_held_is_waited_for_and_goes_on_when_it_is_let_go():
    """For one second: the attractor stays, and the fingers do nothing, though time is far beyond
    the event.
    """
    guide = PlanGuide(along_x(pace=by_place()), 0.05)
    held = SPEED * 0.45
    places = np.concatenate(
        [SPEED * TIME[:46], np.full(100, held), np.linspace(held, SPEED * END, 180)]
    )
    said = looks(guide, places)
    waiting = said[50:146]
    assert all(now.grip == Grip.UNSPECIFIED for now in waiting)
    assert waiting[-1].time - waiting[0].time < 0.02
    attractors = np.array([now.reference.attractor_position for now in waiting])
    assert np.ptp(attractors[:, 0]) < SPEED * 0.02
    assert np.abs([now.reference.velocity for now in waiting[5:]]).max() < 0.02 * SPEED
    assert {now.grip for now in said[146:]} >= {Grip.CLOSE, Grip.OPEN} and said[-1].time > 1.9
    assert all(not now.fault for now in said)


def test_the_fingers_do_nothing_as_long_as_the_hand_is_held_before_an_event():
    """However slowly the clock creeps, it does not pass the event."""
    guide = PlanGuide(along_x(pace=by_place(slowest=0.2)), 0.05)
    said = looks(guide, np.concatenate([SPEED * TIME[:46], np.full(200, SPEED * 0.45)]))
    assert all(now.grip == Grip.UNSPECIFIED for now in said)
    assert said[-1].time == pytest.approx(0.5, abs=1e-6) and said[-1].time < 0.5


def test_a_hand_that_is_held_for_too_long_is_given_up():
    said = looks(
        PlanGuide(along_x(pace=by_place()), 0.05), np.full(round(1.1 * HELD_BACK / STEP), 0.1)
    )
    first = next(k for k, now in enumerate(said) if now.fault)
    assert (
        first * STEP == pytest.approx(HELD_BACK, abs=0.3)
        and said[first].fault == "the hand was held back for 5 s"
    )


def test_late_is_not_off_but_aside_is():
    for pace, off in ((None, 0.3), (by_place(), 0.0)):
        guide = PlanGuide(along_x(pace=pace), 0.05)
        looks(guide, SPEED * TIME[:61])
        assert guide.look(0.61, hand_at(SPEED * 0.61 - 0.3), 0).off == pytest.approx(off, abs=2e-3)
        assert guide.look(0.62, hand_at(SPEED * 0.61, aside=0.2), 0).off == pytest.approx(
            0.2, abs=5e-3
        )


# gains that change


def test_gains_over_time_are_matrices_between_those_of_the_instants():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(len(TIME), 3, 3))
    stiffness = root @ root.swapaxes(1, 2) + 100.0 * np.eye(3)
    references = References(along_x(position_gains=GainsOverTime(stiffness, 0.2 * stiffness)))
    gains = references.gains_at(0.305)
    np.testing.assert_allclose(gains.stiffness[:3, :3], 0.5 * (stiffness[30] + stiffness[31]))
    np.testing.assert_allclose(gains.damping[:3, :3], 0.1 * (stiffness[30] + stiffness[31]))
    np.testing.assert_allclose(gains.stiffness[3:, 3:], 300.0 * np.eye(3))
    assert not gains.stiffness[:3, 3:].any() and not gains.damping[3:, :3].any()
    np.testing.assert_allclose(references.gains_at(END + 1.0).stiffness[:3, :3], stiffness[-1])


def test_round_matrices_pull_as_numbers_do():
    numbers = PoseGains.of((400.0, 40.0), (300.0, 30.0))
    matrices = PoseGains(np.diag(numbers.stiffness), np.diag(numbers.damping))
    turned = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    reference = Reference(
        np.array([0.1, 0.2, 1.3]), turned, np.zeros(3), np.eye(3), np.zeros(6), np.zeros(6)
    )
    for_numbers, for_matrices = (
        attractor_acceleration(reference, hand_at(0.3), gains) for gains in (numbers, matrices)
    )
    np.testing.assert_allclose(for_matrices, for_numbers)


# plans that are none


SOLID = np.tile(100.0 * np.eye(3), (len(TIME), 1, 1))


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: GripEvent(0.5, Grip.UNSPECIFIED, 0.6), "UNSPECIFIED at 0.5 s"),
        (lambda: GripEvent(0.5, Grip.OPEN, 0.4), "in order"),
        (lambda: GripEvent(-0.1, Grip.OPEN, 0.4), "in order"),
        (lambda: GripEvent(0.1, Grip.OPEN, np.inf), "in order"),
        (
            lambda: along_x(
                events=(GripEvent(0.5, Grip.CLOSE, 0.6), GripEvent(0.4, Grip.OPEN, 0.6))
            ),
            r"at \[0.5, 0.4\] s",
        ),
        (lambda: along_x(events=(GripEvent(0.5, Grip.CLOSE, 9.0),)), "within the path"),
        (lambda: along_x(end=0.0), "plan.end is 0.0 s"),
        (lambda: along_x(end=9.0), "plan.end is 9.0 s"),
        (lambda: along_x(start_posture=np.zeros(6)), "plan.start_posture"),
        (lambda: along_x(attractor_quaternion=np.ones((len(TIME), 4))), "unit length"),
        (
            lambda: along_x(attractor_position=np.full((len(TIME), 3), np.nan)),
            "plan.attractor_position",
        ),
        (
            lambda: along_x(pace=Pace(np.zeros((5, 12)))),
            "plan.pace.gain has 5 entries, the path 201 instants",
        ),
        (lambda: Pace(np.zeros((5, 11))), r"must be \("),
        (lambda: Pace(np.full((5, 12), np.inf)), "not finite"),
        (
            lambda: along_x(position_gains=GainsOverTime(SOLID[:7], SOLID[:7])),
            "plan.position_gains has 7 entries",
        ),
        (
            lambda: along_x(orientation_gains=GainsOverTime(SOLID, SOLID[:7])),
            r"orientation_gains \(damping\) has 7 entries",
        ),
        (lambda: GainsOverTime(-SOLID, SOLID), "eigenvalue -100"),
        (
            lambda: GainsOverTime(SOLID + np.eye(3)[0] * np.ones((3, 1)) * 50, SOLID),
            "not symmetric",
        ),
        (lambda: GainsOverTime(SOLID[:, :2, :2], SOLID), r"must be \("),
        (lambda: PhaseRule(ignored=-0.1), "ignored"),
        (lambda: PhaseRule(tolerated=0.0), "tolerated"),
    ],
)
def test_what_cannot_be_is_refused_by_name(make, why):
    with pytest.raises(ValueError, match=why):
        make()


def test_a_motion_needs_the_careful_level_unless_it_says_otherwise(plan):
    assert along_x().speed == Speed.CAREFUL and plan.speed == Speed.THROW
    assert [(event.grip, event.time, event.done) for event in plan.events] == [
        (Grip.OPEN, plan.open_hand, plan.release)
    ]


# the posture that the hand leaves open


def test_the_posture_of_a_plan_is_linear_between_its_instants():
    posture = np.outer(TIME, np.arange(7.0))
    guide = PlanGuide(along_x(posture=posture), 0.05)
    assert guide.look(0.333, hand_at(SPEED * 0.333), 0).posture == pytest.approx(
        0.333 * np.arange(7.0)
    )
    assert PlanGuide(along_x(), 0.05).look(0.3, hand_at(0.15), 0).posture is None


def test_a_posture_for_other_instants_is_refused():
    with pytest.raises(ValueError, match=r"plan.posture has shape \(3, 7\)"):
        along_x(posture=np.zeros((3, 7)))


def test_a_plan_turns_its_hand_by_a_share_of_the_way_to_the_next_instant(plan):
    references, path = References(plan), plan.path
    turns = path.quaternion, plan.attractor_quaternion
    slerps = [Slerp(path.time, Rotation.from_quat(turn)) for turn in turns]
    for time in np.linspace(0.0, path.duration, 50):
        now = references.at(time)
        for found, slerp in zip((now.rotation, now.attractor_rotation), slerps, strict=True):
            np.testing.assert_allclose(found, slerp(time).as_matrix(), atol=1e-5)
        rows = np.hstack([path.position, path.velocity, path.acceleration])
        wanted = [np.interp(time, path.time, column) for column in rows.T]
        given = np.concatenate([now.position, now.velocity, now.acceleration])
        np.testing.assert_allclose(given, wanted, atol=1e-12)


def test_compiled_and_interpreted_have_the_same_bits(plan, monkeypatch):
    compiled = References(plan)
    plain = interpreted("dart_skill.arm._plan_rows").PlanRows
    monkeypatch.setattr("dart_skill.arm._guide.PlanRows", plain)
    for time in np.linspace(-0.2, 1.2 * plan.path.duration, 30):
        one, other = compiled.at(time), References(plan).at(time)
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, getattr(other, name), err_msg=name)


# careful motions


def careful(**changes):
    """A careful plan along x that carries something from the start."""
    changes = {"events": (), "carries": True, "speed": Speed.CAREFUL} | changes
    return along_x(**changes)


def seen_beside(guide, off, until, lost_from=np.inf):
    """What a guide says to a hand that comes along exactly, and is seen `off` (3,) [m] beside."""
    said = []
    for k in range(round(until / STEP)):
        hand = hand_at(SPEED * STEP * k)
        said.append(guide.look(STEP * k, hand, round(1e9 * STEP * k)))
        if 2 < k and STEP * k < lost_from:
            then = STEP * (k - 1)
            place = np.array([SPEED * then, 0.0, 1.0]) + off
            guide.see("hand", round(1e9 * then), place, UPRIGHT)
    return said


def test_a_careful_hand_is_led_to_where_cameras_shall_see_it():
    off = np.array([0.0, 0.005, -0.003])
    now = seen_beside(CarefulGuide(careful(), 0.05), off, 1.0)[-1]
    # (the rest that is taken out leads it farther, as this hand does not obey)
    plain = PlanGuide(careful(), 0.05).look(0.99, hand_at(SPEED * 0.99), 0)
    led = now.reference.position - plain.reference.position
    assert led[1] < -0.005 and led[2] > 0.003 and abs(led[0]) < 1e-9


def test_the_body_on_the_hand_is_seen_through_the_registration():
    registration = Registration(shift=(0.0, 0.5, 0.0))
    guide = CarefulGuide(careful(), 0.05, registration)
    now = seen_beside(guide, np.array([0.0, 0.5, 0.0]), 1.0)[-1]
    assert now.reference.position == pytest.approx([SPEED * 0.99, 0.0, 1.0])


def test_a_careful_motion_is_slower_while_its_hand_is_not_seen_and_goes_on():
    said = seen_beside(CarefulGuide(careful(), 0.05), np.zeros(3), 1.5, lost_from=1.0)
    rates = np.diff([now.time for now in said]) / STEP
    slows = int(np.argmax(rates < 0.99))
    eased = 0.5 + 0.5 * (1.0 - STEP / 0.1) ** np.arange(1, len(said) - slows + 1)
    assert 100 <= slows < 120 and rates[:slows] == pytest.approx(1.0)
    assert rates[slows:] == pytest.approx(eased[:-1])
    assert said[-1].reference.velocity[0] == pytest.approx(eased[-1] * SPEED)


def test_a_fast_hand_that_is_not_seen_any_more_is_not_jolted():
    """Halving its speed at once braked arm 2024 of the fleet so hard that it was stopped at the
    limit of speed.
    """
    said = seen_beside(CarefulGuide(careful(), 0.05), np.zeros(3), 1.5, lost_from=1.0)
    speeds = np.array([now.reference.velocity[0] for now in said])
    assert np.ptp(speeds) > 0.45 * SPEED, "it slows down"
    braked = np.diff(speeds) / STEP
    assert braked.min() > -0.51 * SPEED / 0.1, "no faster than it eases"
    meant = [now.reference.acceleration[0] for now in said[1:]]
    assert braked == pytest.approx(meant, abs=0.1 * SPEED / 0.1), "and the arm is told of it"


def test_without_cameras_a_careful_plan_is_carried_out_as_made():
    said = looks(CarefulGuide(careful(), 0.05), SPEED * TIME[:150])
    plain = looks(PlanGuide(careful(), 0.05), SPEED * TIME[:150])
    for one, other in zip(said, plain, strict=True):
        assert one.time == other.time and not one.touches
        assert one.reference.position == pytest.approx(other.reference.position)


FEELS = {"contact_force": 50.0, "pull": lambda *_: Yielding(1e-3 * np.eye(3), 0.0)}
"""Contact is felt 20 mm behind the plan, and the hand is aimed 12.5 mm ahead while it searches."""


def test_a_hand_that_is_held_back_and_seen_elsewhere_is_not_pressed_harder():
    """The correction by what is seen would lead it on by 3 cm more."""
    guide, said = CarefulGuide(careful(), 0.05, **FEELS), []
    for k in range(200):
        stamp, place = round(1e9 * STEP * k), min(SPEED * STEP * k, 0.2)
        guide.see("hand", stamp, np.array([place - 0.1, 0.0, 1.0]), UPRIGHT)
        said.append(guide.look(STEP * k, hand_at(place), stamp))
    assert said[-1].touches
    ahead = [now.reference.position[0] - 0.2 for now in said if now.touches]
    assert max(ahead) == pytest.approx(0.0125)


def test_a_careful_hand_that_is_held_back_waits_and_feels_around():
    guide, touched = CarefulGuide(careful(), 0.05, **FEELS), []
    for k in range(100):
        touched.append(guide.look(STEP * k, hand_at(min(SPEED * STEP * k, 0.2)), 0))
    assert not touched[40].touches and touched[-1].touches
    assert touched[-1].time == touched[-2].time
    assert not touched[-1].reference.velocity.any()
    assert touched[-1].reference.attractor_position[1:] != pytest.approx([0.1, 1.1])


def test_a_hand_that_comes_along_does_not_ask_how_far_forces_move_it():
    """The model was asked for its inertia at every state of every careful motion."""

    def refuse(gains, carries, touches):
        raise AssertionError("asked")

    looks(CarefulGuide(careful(), 0.05, None, 20.0, refuse), SPEED * TIME[:150])


def test_a_plan_with_a_pace_of_its_own_waits_by_that():
    guide = CarefulGuide(careful(pace=by_place()), 0.05, **FEELS)
    said = looks(guide, np.full(200, 0.2))
    assert not any(now.touches for now in said)


def test_contact_is_felt_where_the_pace_of_a_plan_does_not_wait():
    """The hand of `by_place` is held at 0.2 m, from where on its gain is nothing."""
    pace = by_place()
    pace.gain[TIME > 0.3] = 0.0
    guide = CarefulGuide(careful(pace=pace), 0.05, **FEELS)
    said = looks(guide, np.minimum(SPEED * TIME[:200], 0.2))
    assert said[-1].touches and said[-1].time == said[-2].time


def test_a_hand_that_is_held_is_not_pulled_on_by_a_plan_that_waits():
    guide = CarefulGuide(careful(pace=by_place()), 0.05)
    waits = looks(guide, np.minimum(SPEED * TIME[:100], 0.2))[-1].reference
    ahead = waits.attractor_position[0] - waits.position[0]
    assert ahead == pytest.approx(0.01 * 0.1, abs=1e-9), "by the share of the rate, `slowest`"


def test_the_hand_that_drives_a_clock_is_where_the_cameras_see_it():
    """By its encoders it is 20 mm behind: 40 ms, for which the clock would wait."""
    guide, said = CarefulGuide(careful(pace=by_place()), 0.05), []
    for k in range(150):
        place, stamp = SPEED * STEP * k - 0.02, round(1e9 * STEP * k)
        said.append(guide.look(STEP * k, hand_at(place), stamp))
        if k > 2:
            seen = np.array([SPEED * STEP * (k - 1), 0.0, 1.0])
            guide.see("hand", round(1e9 * STEP * (k - 1)), seen, UPRIGHT)
    rates = np.diff([now.time for now in said[100:]]) / STEP
    assert rates == pytest.approx(1.0, abs=0.05)
    blind = looks(CarefulGuide(careful(pace=by_place()), 0.05), SPEED * TIME[:150] - 0.02)
    assert blind[-1].time < said[-1].time


def test_what_is_wanted_is_shifted_so_that_the_hand_is_seen_there():
    """A hand that obeys is at R, p by the joints, and seen at exp(turn) R, p + shift."""
    rng = np.random.default_rng(0)
    turns = Rotation.random(2, random_state=0).as_matrix()
    wanted = Reference(
        *(rng.normal(size=3), turns[0]), *(rng.normal(size=3), turns[1]), *rng.normal(size=(2, 6))
    )
    off = SeenOffset(np.array([0.01, -0.02, 0.005]), np.array([0.03, 0.01, -0.05]))
    led = shifted(wanted, off)
    seen = Rotation.from_rotvec(off.turn).as_matrix()
    assert led.position + off.shift == pytest.approx(wanted.position)
    assert led.attractor_position + off.shift == pytest.approx(wanted.attractor_position)
    assert seen @ led.rotation == pytest.approx(wanted.rotation)
    assert seen @ led.attractor_rotation == pytest.approx(wanted.attractor_rotation)
    assert led.velocity is wanted.velocity


def test_stamps_of_cameras_that_are_late_by_the_registration_are_put_right():
    """A moving hand that is seen 5 mm beside is led aside, and neither forward nor back."""
    guide = CarefulGuide(careful(), 0.05, Registration(delay=0.05))
    for k in range(100):
        now = guide.look(STEP * k, hand_at(SPEED * STEP * k), round(1e9 * STEP * k))
        if k > 10:
            then = STEP * (k - 5)
            place = np.array([SPEED * then, 0.005, 1.0])
            guide.see("hand", round(1e9 * (then + 0.05)), place, UPRIGHT)
    assert now.reference.position[1] < -0.004
    assert now.reference.position[0] == pytest.approx(SPEED * 0.99, abs=1e-9)


def test_the_way_back_ends_where_the_plan_begins():
    """A hand that is held from the beginning, until its search is over and its motion given up."""
    guide, times = CarefulGuide(careful(), 0.05, **FEELS), []
    for k in range(1600):
        now = guide.look(STEP * k, hand_at(0.0), 0)
        times.append(now.time)
    assert now.fault and min(times) == 0.0 and now.carries
