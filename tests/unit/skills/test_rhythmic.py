"""The representation `rhythmic`: turns that were shown are made again about a pot that stands
elsewhere, at another frequency and amplitude, from rest to rest, and wait for a hand that is held.
"""

import numpy as np
import pytest

from dart_skill.arm import CarefulGuide, HandState
from dart_skill.common.quaternions import matrices
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import HAND, Demonstration, Track
from dart_skill.skills.learning import LearnedSkill, load_model, save_model
from dart_skill.skills.protocol import Skill, SkillSettings, TaskOutcome, load_skill
from tests.unit.skills.task_demonstrations import GRIP, NOISE, POSTURE, START, body_at, smooth

RADIUS, PERIOD, WAY, HIGH = 0.04, 1.4, 1.8, 0.10
"""Of the circle [m], of a turn [s], of the way there and back [s], of the hand beside the pot [m]."""


class Whisk(Skill):
    """The hand turns about a pot that stands somewhere."""

    name, bodies, numbers = "whisk", ("pot",), ("amplitude", "frequency", "turns")

    def cut(self, demonstration):
        return 5.0, demonstration.hand_time[-1] - 1.0

    def judge(self, seen, situation):
        return TaskOutcome(True, 0.0)


def whisk(**changes):
    settings = {"components": 25, "stiffness": 300.0, "representation": "rhythmic"}
    return Whisk(SkillSettings(**settings | changes))


def circle(phase, radius=RADIUS):
    """Of the hand in the frame of the pot (n, 3)."""
    angle = 2.0 * np.pi * np.asarray(phase)
    around = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    return GRIP.position + around


def show(pot, turns=3, begin=0.0, period=PERIOD, sense=1.0, name="shown_0", seed=0):
    """A demonstration: down to the circle, turns with a soft start and stop, and up again."""
    rng = np.random.default_rng(seed)
    ramp = 0.5 * period
    turning = turns * period + ramp
    time = np.arange(-1.0, 2.0 * WAY + turning + 1.0, 0.01)
    on = np.clip(time - WAY, 0.0, turning)
    early, late = np.clip(on / ramp, 0.0, 1.0), np.clip((turning - on) / ramp, 0.0, 1.0)
    gained = [2.5 * one**4 - 3.0 * one**5 + one**6 for one in (early, late)]
    clock = ramp * (gained[0] + 0.5 - gained[1]) + np.clip(on - ramp, 0.0, turning - 2.0 * ramp)
    local = circle(begin + sense * clock / period)
    there, away = smooth(time / WAY / 0.6), smooth((time - WAY - turning) / WAY)
    down = smooth((time / WAY - 0.4) / 0.6)
    local[:, 2] += HIGH * (there - down + away)
    first = pot.sees(START).position
    local += (1.0 - there)[:, None] * (first - circle([begin])[0])
    place = pot.position + local @ pot.rotation.T
    place += NOISE * rng.standard_normal(place.shape)
    stamps, turned = time + 5.0, pot.place(GRIP).quaternion
    hand = Track(stamps, place, np.tile(turned, (len(time), 1)))
    seen = Track(
        stamps, np.tile(pot.position, (len(time), 1)), np.tile(pot.quaternion, (len(time), 1))
    )
    rests = stamps[time <= 0.0]
    joints = np.tile(POSTURE, (len(rests), 1))
    return Demonstration(
        name,
        {HAND: hand, "pot": seen},
        skill="whisk",
        joint_time=rests,
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
    )


POT = body_at(0.6, 0.1, 0.2)
ELSEWHERE = body_at(0.52, -0.05, -0.4)


@pytest.fixture(scope="module")
def learned():
    return LearnedSkill(whisk(), [show(POT)])


def plan_of(learned, pot=ELSEWHERE, **numbers):
    return learned.plan(Situation({HAND: START, "pot": pot}, numbers))


def turned(learned, pot=ELSEWHERE, **numbers):
    """Instants [s] of a plan and places in the pot's frame (n, 3) from its first turn to its last."""
    path = plan_of(learned, pot, **numbers).path
    begin, end = learned.encoded.turns_between(Situation({HAND: START, "pot": pot}, numbers))
    on_it = (path.time >= begin) & (path.time < end)
    return path.time[on_it], (path.position[on_it] - pot.position) @ pot.rotation - GRIP.position


def frequency_of(time, local):
    """Mean turns in a second between the first and the last half turn."""
    angle = np.unwrap(np.arctan2(local[:, 1], local[:, 0])) / (2.0 * np.pi)
    inner = (angle > angle[0] + 0.5) & (angle < angle[-1] - 0.5)
    return np.polyfit(time[inner], angle[inner], 1)[0]


def test_the_circle_that_was_shown_is_made_again_about_another_pot(learned):
    time, local = turned(learned)
    assert np.abs(np.hypot(*local[:, :2].T) - RADIUS).max() < 0.0015
    assert frequency_of(time, local) == pytest.approx(1.0 / PERIOD, rel=0.01)


@pytest.mark.parametrize(
    ("numbers", "frequency", "radius", "turns"),
    [
        ({"frequency": 2.0 / PERIOD * 0.99}, 1.98 / PERIOD, RADIUS, 3),
        ({"amplitude": 0.5}, 1.0 / PERIOD, 0.5 * RADIUS, 3),
        ({"turns": 7.0, "frequency": 1.0}, 1.0, RADIUS, 7),
    ],
)
def test_frequency_amplitude_and_turns_are_those_that_are_asked_for(
    learned, numbers, frequency, radius, turns
):
    time, local = turned(learned, **numbers)
    angle = np.unwrap(np.arctan2(local[:, 1], local[:, 0])) / (2.0 * np.pi)
    assert np.abs(np.hypot(*local[:, :2].T) - radius).max() < 0.0015
    assert frequency_of(time, local) == pytest.approx(frequency, rel=0.01)
    assert np.ptp(angle) == pytest.approx(turns, abs=0.02)


def test_it_starts_and_stops_without_a_jump(learned):
    """Position, velocity and acceleration begin and end each part at rest."""
    path = plan_of(learned, frequency=1.2, turns=5.0).path
    step = path.time[1] - path.time[0]
    speed, growth = path.velocity[:, :3], path.acceleration[:, :3]
    assert np.linalg.norm(np.diff(path.position, axis=0), axis=1).max() < 0.7 * step
    assert speed[1:-1] == pytest.approx(
        (path.position[2:] - path.position[:-2]) / (2.0 * step), abs=2e-3
    )
    assert np.linalg.norm(np.diff(speed, axis=0), axis=1).max() < 5.0 * step
    assert np.linalg.norm(np.diff(growth, axis=0), axis=1).max() < 0.6
    for rows in (speed, growth):
        assert np.linalg.norm(rows[[0, -1]], axis=1).max() < 0.02


def test_it_begins_where_the_hand_is_and_ends_where_it_was_shown_to(learned):
    path = plan_of(learned).path
    assert path.position[0] == pytest.approx(START.position, abs=1e-9)
    above = circle([0.0])[0] + [0.0, 0.0, HIGH]
    last = ELSEWHERE.sees(Pose(path.position[-1])).position
    assert np.abs(last - above).max() < 0.012


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"frequency": 5.0}, r"frequency is 5: 0\.71 /s were shown; ask for 0\.18 to 1\.4"),
        ({"frequency": 0.0}, "frequency is 0"),
        ({"amplitude": 2.5}, r"amplitude is 2\.5: 1 was shown; ask for 0\.25 to 2"),
        ({"turns": 2.5}, "turns is 2.5: ask for a whole number"),
        ({"turns": 0.0}, "turns is 0"),
        ({"turns": 1e6}, "from 1 to 200"),
    ],
)
def test_numbers_out_of_their_bounds_are_refused_by_name(learned, numbers, said):
    with pytest.raises(ValueError, match=said):
        plan_of(learned, **numbers)


def test_what_is_faster_than_the_hand_may_be_is_refused_with_the_limit():
    wide = LearnedSkill(whisk(), [show(POT, period=0.5)])
    with pytest.raises(ValueError, match=r"frequency 3\.92 /s with amplitude 1\.9 moves the hand"):
        plan_of(wide, frequency=2.0 / 0.51, amplitude=1.9)


def test_phases_of_several_demonstrations_are_brought_together():
    """Without that, circles that begin on opposite sides would be averaged to a point."""
    begins = (0.0, 0.5, 0.2)
    shown = [
        show(body_at(0.6, 0.05 * k, 0.1 * k), 4, begin, PERIOD * (1.0 + 0.03 * k), 1.0, f"s{k}", k)
        for k, begin in enumerate(begins)
    ]
    time, local = turned(LearnedSkill(whisk(), shown))
    assert np.abs(np.hypot(*local[:, :2].T) - RADIUS).max() < 0.003
    assert frequency_of(time, local) == pytest.approx(1.0 / (1.03 * PERIOD), rel=0.02)


def test_demonstrations_that_turn_otherwise_are_refused_by_name():
    other = show(POT, sense=-1.0, name="backwards", seed=1)
    with pytest.raises(ValueError, match="demonstration backwards: its turns are others"):
        LearnedSkill(whisk(), [show(POT), other])


def test_a_demonstration_that_does_not_turn_is_refused_by_name():
    with pytest.raises(
        ValueError, match=r"demonstration shown_0: the movement repeats .* at least 2"
    ):
        LearnedSkill(whisk(), [show(POT, turns=1)])


def guided(plan, held, released):
    """The clock of a plan at each 2 ms, with a hand on its path that is held between two instants."""
    guide, step = CarefulGuide(plan, 0.1), 0.002
    shown, stays = [], None
    reference = guide.look(0.0, _hand(plan, 0.0), 0)
    for k in range(1, round((plan.path.duration + 2.0) / step)):
        now = k * step
        if held <= now < released:
            stays = reference if stays is None else stays
            hand = HandState(stays.reference.position, stays.reference.rotation, np.zeros(6))
        else:
            stays, hand = None, _follows(reference)
        reference = guide.look(now, hand, round(1e9 * now))
        shown.append(reference.time)
    return np.array(shown)


def _hand(plan, time):
    k = int(np.searchsorted(plan.path.time, time))
    return HandState(plan.path.position[k], matrices(plan.path.quaternion[k]), np.zeros(6))


def _follows(guidance):
    reference = guidance.reference
    return HandState(reference.position, reference.rotation, reference.velocity)


def test_the_phase_waits_while_the_hand_is_held_and_goes_on_from_there(learned):
    plan = plan_of(learned, turns=5.0)
    free, held = guided(plan, 90.0, 91.0), guided(plan, 4.0, 5.0)
    before, after = round(3.99 / 0.002), round(5.4 / 0.002)
    assert held[before] == pytest.approx(free[before], abs=1e-9)
    waited = (free[after:] - held[after:])[: round(1.0 / 0.002)]
    assert np.all((waited > 0.85) & (waited < 1.05)), waited
    assert np.ptp(waited) < 0.02, "it does not catch up"


def test_a_model_that_was_saved_makes_the_same_plan(learned, tmp_path):
    save_model(tmp_path / "whisk.npz", learned.demonstrations, learned.skill.settings)
    saved = load_model(tmp_path / "whisk.npz", learned.skill)
    again = LearnedSkill(Whisk(saved.configuration), saved.demonstrations)
    assert np.array_equal(plan_of(again).path.position, plan_of(learned).path.position)


def test_there_is_a_gaussian_for_each_kernel_about_the_circle(learned):
    mixture = learned.mixture(Situation({HAND: START, "pot": ELSEWHERE}))
    local = (mixture.means_[:, 1:] - ELSEWHERE.position) @ ELSEWHERE.rotation - GRIP.position
    assert len(local) == 25 and np.abs(np.hypot(*local[:, :2].T) - RADIUS).max() < 0.004


def test_one_that_is_unlike_the_others_is_known():
    shown = [show(body_at(0.6, 0.04 * k, 0.0), name=f"s{k}", seed=k) for k in range(3)]
    learned = LearnedSkill(whisk(), shown)
    assert learned.left_out_error() < 0.01 and np.isfinite(learned.bic())


def test_bodies_that_move_are_refused():
    with pytest.raises(ValueError, match="turns about a body that rests"):
        load_skill("reach", changes={"representation": "rhythmic"})
