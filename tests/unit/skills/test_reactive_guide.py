"""A reach into a cup that moves on a belt, on the simulated arm: the model is asked at every
state, with the cup where it is seen.
"""

import numpy as np
import pytest

from dart_skill.arm import ArmModel, Commander, Grip, GripEvent, Mode, Speed
from dart_skill.movement import (
    AutonomousDSGMR,
    MovingFrame,
    PhaseRule,
    TaskFrame,
    VelocityThreshold,
    attractor_from_motion,
    smooth_derivatives,
    start_frame,
)
from dart_skill.skills.execution import ReactiveGuide
from tests.unit.held_arm import Holder

POSTURE = np.array([0.0, 0.3, 0.0, 2.2, 0.0, 1.0, 0.0])
"""The hand is tilted by 0.4 rad: with the palm straight down (J6 at 0.6) the wrist is straight
above 2 of 20 cups, and J5 turns away.
"""
START = ArmModel().hand_pose(POSTURE)[0]
ABOVE = np.array([0.0, 0.0, 0.12])
STIFFNESS, CLOCK = 400.0, np.arange(0.0, 2.1, 0.01)
NOISE = 3e-4


def smooth(share):
    s = np.clip(share, 0.0, 1.0)[:, None]
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


class Belt:
    """Carries a cup. begin: where it stands at time 0; way: in the 2.4 s after that."""

    def __init__(self, rng):
        self.begin = np.array([0.62, 0.0, 1.10]) + rng.uniform(-1, 1, 3) * [0.08, 0.15, 0.05]
        self.way = rng.uniform(-1, 1, 3) * [0.05, 0.20, 0.0]

    def at(self, time):
        return self.begin + self.way * smooth(np.asarray(time) / 2.4)


def shown(belt, rng):
    """Hand and cup as (position, velocity, acceleration) of one demonstration on CLOCK, from noisy
    cameras.
    """
    time = np.arange(-0.5, 3.5, 0.01)
    inside = belt.at(time) + rng.normal(0.0, 0.003, 3)
    hand = (
        START + smooth(time / 1.2) * (inside + ABOVE - START) - smooth((time - 0.8) / 0.8) * ABOVE
    )
    seen = (
        hand + rng.normal(0.0, NOISE, hand.shape),
        belt.at(time) + rng.normal(0.0, NOISE, hand.shape),
    )
    begin = (
        VelocityThreshold(start=0.05, stop=0.02, min_duration=1.0)
        .segment(time, seen[0])[0]
        .motion_start
    )
    return [smooth_derivatives(time, path, at=begin + CLOCK) for path in seen]


def frame_of(position, velocity, attractor):
    return MovingFrame(TaskFrame(np.eye(4), [0.0, *position]), velocity, attractor)


def frames_now(bodies):
    cup = bodies["cup"]
    attractor = attractor_from_motion(
        cup.position[None], cup.velocity[None], cup.acceleration[None], STIFFNESS
    )[0]
    return [start_frame(START, n_angles=0), frame_of(cup.position, cup.velocity, attractor)]


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(0)
    motions = [shown(Belt(rng), rng) for _ in range(8)]
    frames = [
        [
            start_frame(START, n_angles=0),
            [
                frame_of(*row)
                for row in zip(*cup[:2], attractor_from_motion(*cup, STIFFNESS), strict=True)
            ],
        ]
        for _, cup in motions
    ]
    rule = PhaseRule(slowest=0.01, fastest=1.3, time_constant=0.02, ignored=0.01)
    return AutonomousDSGMR(8, STIFFNESS, rule=rule, partition="time").fit(
        [CLOCK] * 8, [hand for hand, _ in motions], frames
    )


class Reach:
    """A reach that was carried out. Rows of `log`: time, phase, hand as the cup sees it (3), grip,
    level of speed.
    """

    def __init__(self, plant, model, belt, holds=(0.0, 0.0), blind_from=np.inf, events=()):
        self.commander, holder, rng = Commander(), Holder(), np.random.default_rng(3)
        plant.step(self.commander.step(plant.arm_state))
        rotation = ArmModel().hand_pose(POSTURE)[1]
        self.guide = ReactiveGuide(
            model, frames_now, ["cup"], POSTURE, rotation, what="reach", events=events
        )
        self.commander.follow(self.guide)
        rows, begun = [], None
        while self.commander.executing:
            arm = plant.arm_state
            if begun is None and self.commander.mode == Mode.EXECUTING:
                begun = arm.stamp_ns
            time = 0.0 if begun is None else (arm.stamp_ns - begun) * 1e-9
            cup = belt.at([time])[0]
            if plant.step_count % 5 == 0 and time < blind_from:
                self.guide.see(
                    "cup",
                    arm.stamp_ns,
                    cup + rng.normal(0.0, NOISE, 3),
                    np.array([0.0, 0.0, 0.0, 1.0]),
                )
                # of no concern
                self.guide.see("basket", arm.stamp_ns, np.full(3, np.nan), np.zeros(4))
            command = self.commander.step(arm)
            plant.step(
                command, holder.push(arm, begun is not None and holds[0] <= time < sum(holds))
            )
            if begun is not None and self.commander.mode == Mode.EXECUTING:
                rows.append(
                    [
                        time,
                        self.guide.phase,
                        *(plant.hand_position - cup),
                        command.grip,
                        command.speed,
                    ]
                )
            assert time < 10.0
        self.log = np.reshape(rows, (-1, 7))
        self.speed = np.linalg.norm(np.diff(self.log[:, 2:5], axis=0), axis=1) / 2e-3

    @property
    def misses(self):
        """Distance from the axis of the cup when the hand comes down past its rim, and from its
        middle at the end [m].
        """
        hand = self.log[:, 2:5]
        return np.hypot(*hand[np.flatnonzero(hand[:, 2] > 0.06)[-1], :2]), np.linalg.norm(hand[-1])


@pytest.fixture
def reach(make_plant, model):
    def start(seed, **how):
        return Reach(
            make_plant(start_posture=tuple(POSTURE)),
            model,
            Belt(np.random.default_rng(seed)),
            **how,
        )

    return start


@pytest.mark.parametrize("seed", [10, pytest.param(11, marks=pytest.mark.slow)])
def test_the_hand_comes_down_into_a_cup_that_moves(reach, seed):
    done = reach(seed)
    rim, end = done.misses
    assert rim < 0.01 and end < 0.005 and not done.commander.message
    assert set(done.log[:, 6]) == {Speed.CAREFUL}
    assert done.log[-1, 0] == pytest.approx(CLOCK[-1], abs=0.5)


@pytest.mark.slow
def test_held_for_a_second_the_hand_waits_and_does_not_hurry_after_the_cup(reach):
    free, held = reach(10), reach(10, holds=(0.8, 1.0))
    phases = held.log[(held.log[:, 0] > 1.0) & (held.log[:, 0] < 1.8), 1]
    assert np.ptp(phases) < 0.25 * 0.8, (
        "the phase waits; it creeps on a little, as the cup moves away"
    )
    assert held.misses[1] < 0.005 and not held.commander.message
    assert held.speed[held.log[1:, 0] > 1.8].max() < 2.0 * free.speed.max()


def test_a_cup_that_is_not_seen_any_more_stops_the_motion_and_is_named(reach):
    blind = reach(10, blind_from=0.7)
    assert (
        blind.commander.message.startswith("the cup was last seen 0.1")
        and blind.commander.mode == Mode.STOPPING
    )
    assert blind.log[-1, 0] == pytest.approx(0.7 + 0.15, abs=0.02)


def test_a_cup_that_nobody_has_seen_stops_it_at_once(reach):
    assert reach(10, blind_from=-1.0).commander.message == "the cup has not been seen yet"


@pytest.mark.slow
def test_the_fingers_open_in_the_cup_and_not_while_the_hand_is_held(reach):
    opens = GripEvent(1.9, Grip.OPEN, 1.9)
    done = reach(10, events=(opens,), holds=(1.0, 0.8))
    opened = done.log[:, 5] == Grip.OPEN
    assert opened.any() and done.log[opened.argmax(), 1] == pytest.approx(1.9, abs=0.02)
    assert done.log[opened.argmax(), 0] > 2.4 and opened[opened.argmax() :].all()
