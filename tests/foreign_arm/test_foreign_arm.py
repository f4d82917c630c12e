"""The hardware layout beside an arm, cameras and a person that are not ours, driven as docs/hardware.md says.

What does not come out as the documentation says yet is marked `xfail`, with what was expected and what happened.
"""

from itertools import pairwise

import pytest

pytest.importorskip("mujoco", reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup")

from dart_skill_msgs.action import Throw  # noqa: E402

from tests.foreign_arm.outsider import running  # noqa: E402
from tests.foreign_arm.session import LESSONS, TARGETS, session, teach  # noqa: E402

HAND_DELAY_MS = 45.0


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """A laboratory in lockstep, in which six throws were guided and learned from."""
    with session(tmp_path_factory.mktemp("foreign"), seed=1, lockstep=True) as outsider:
        outsider.demonstrations = teach(outsider, LESSONS)
        outsider.pressed = list(outsider.driver.openings)
        outsider.learned = outsider.call("/skill_learner/learn", at_least=len(LESSONS))
        assert outsider.learned.success, outsider.learned.message
        assert outsider.call("/commander/release_arm", data=False).success
        yield outsider


@pytest.fixture(scope="module")
def throws(lesson):
    """Target (3,), result of the action, and whether the ball lies in the basket, of throws at baskets that nobody demonstrated."""
    made = []
    for target in TARGETS:
        lesson.prepare(target)
        result = lesson.throw(target)
        lesson.driver.run(0.5)
        made.append((target, result, lesson.driver.person.in_basket(target)))
    return made


def test_every_state_of_the_arm_is_answered(lesson):
    """After the graph was there: what counts before is that nobody answers."""
    answered, unanswered = lesson.driver.answered, lesson.driver.unanswered
    lesson.driver.run(1.0)
    assert lesson.driver.answered == answered + 500
    assert lesson.driver.unanswered == unanswered


def test_a_demonstration_has_what_the_cameras_and_the_arm_said(lesson):
    opened = [demonstration.hand_opened for demonstration in lesson.demonstrations]
    assert [stamp.sec * 10**9 + stamp.nanosec for stamp in opened] == lesson.pressed
    for demonstration, place in zip(lesson.demonstrations, LESSONS, strict=True):
        target = demonstration.target
        assert [target.x, target.y, target.z] == pytest.approx(place, abs=0.003)
        assert len(demonstration.joints) > 50 and len(demonstration.hand) > 50 and len(demonstration.ball) > 100


def test_the_delay_of_the_hand_is_found(lesson):
    assert lesson.learned.demonstrations == len(LESSONS)
    told = float(lesson.learned.message.split("the hand opens ")[1].split(" ms")[0])
    assert told == pytest.approx(HAND_DELAY_MS, abs=6.0)


def test_the_arm_throws_into_baskets_that_nobody_demonstrated(throws):
    for target, result, lies_in in throws:
        assert result.code == Throw.Goal.OUTCOME_THROWN, f"{target}: {result.message}"
        assert result.outcome.landing_seen and result.outcome.landing_error < 0.12
        assert result.outcome.in_basket == lies_in
    assert all(lies_in for _, _, lies_in in throws)


def test_nobody_stopped_the_arm_meanwhile(lesson, throws):
    assert lesson.driver.stops == 0


def test_the_hand_is_told_to_open_for_longer_than_one_command(lesson, throws):
    told = lesson.driver.openings[len(lesson.pressed) :]
    assert len(told) >= len(throws)
    assert any(later - earlier == 2_000_000 for earlier, later in pairwise(told))


@pytest.mark.xfail(
    strict=True,
    raises=AssertionError,
    reason="docs/hardware.md: practice learns a base that was turned. The coach is not in the hardware layout; started by hand it throws "
    "nothing: 'practice ends: nobody serves /simulation/reset'",
)
def test_the_arm_practises_at_the_basket_that_the_cameras_see(lesson, throws, tmp_path):
    lesson.prepare(TARGETS[0])
    with running(["ros2", "run", "dart_skill", "coach"], tmp_path / "coach.log"):
        result = lesson.practise(throws=1)
    assert result.thrown == 1, result.message


def test_a_recording_ends_when_the_button_was_pressed_once(lesson, throws):
    assert lesson.call("/commander/release_arm", data=True).success
    lesson.driver.tells_button = False
    try:
        _, stopped = lesson.teach(LESSONS[2], keep=True)
        pending = stopped.pending
    finally:
        lesson.driver.tells_button = True
    if pending:
        lesson.driver.run(0.1)
        stopped = lesson.stop(keep=False)
    assert not pending


def test_a_landing_that_nobody_saw_costs_one_demonstration_and_not_all(lesson, throws):
    """Its demonstration is left out, and the answer says why."""
    assert lesson.call("/commander/release_arm", data=True).success
    cameras, plant = lesson.driver.cameras, lesson.driver.plant
    cameras.hidden = lambda body: body == "ball" and plant.hand.told_to_open and plant.pose("ball")[0][2] < 1.2
    try:
        _, stopped = lesson.teach(LESSONS[2], keep=True)
    finally:
        cameras.hidden = lambda body: False
    learned = lesson.call("/skill_learner/learn", at_least=len(LESSONS))
    assert not stopped.success or learned.success, learned.message
    assert "nobody saw where the ball landed" in stopped.message + learned.message
    assert lesson.call("/commander/release_arm", data=False).success


def test_an_arm_that_somebody_may_hold_is_not_thrown_with(lesson, throws):
    assert lesson.call("/commander/release_arm", data=True).success
    refused = lesson.throw(TARGETS[0])
    assert refused.code != Throw.Goal.OUTCOME_THROWN and "released" in refused.message, refused.message
    assert lesson.call("/commander/release_arm", data=False).success
