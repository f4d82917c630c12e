"""The hardware layout beside an arm, cameras and a person that are not ours, driven as
docs/hardware.md says.
"""

import re
from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip(
    "mujoco",
    reason="the second arm needs MuJoCo: pip install -r requirements/test.txt, or make setup",
)

from dart_skill_msgs.action import Execute  # noqa: E402

from dart_skill.recording import read_dropped  # noqa: E402
from tests.foreign_arm import published  # noqa: E402
from tests.foreign_arm.outsider import running, teach  # noqa: E402
from tests.foreign_arm.session import session  # noqa: E402
from tests.foreign_arm.throwing.lessons import (  # noqa: E402
    LESSONS,
    TARGETS,
    THROW,
    basket_at,
    rim,
)

pytestmark = pytest.mark.slow
HAND_DELAY_MS = 45.0
TOO_FAR = rim(3.0, 0.2)


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """A laboratory in lockstep, in which six throws were guided and learned from."""
    with session(tmp_path_factory.mktemp("foreign"), THROW, seed=1, lockstep=True) as outsider:
        outsider.demonstrations = teach(outsider, LESSONS)
        outsider.pressed = list(outsider.driver.openings)  # those of misses, too
        outsider.hits = [opened_ns(one) for one in outsider.demonstrations]
        outsider.learned = outsider.call("/skill_learner/learn", at_least=len(LESSONS))
        assert outsider.learned.success, outsider.learned.message
        assert outsider.call("/commander/release_arm", data=False).success
        yield outsider


@pytest.fixture(scope="module")
def throws(lesson):
    """Target (3,), result of the action, and whether the ball lies in the basket, of throws at
    baskets that nobody demonstrated.
    """
    made = []
    for target in TARGETS[:2]:
        lesson.prepare(target)
        result = lesson.throw(target)
        lesson.driver.run(0.5)
        made.append((target, result, lesson.driver.person.in_basket(target)))
    return made


def opened_ns(demonstration):
    """When the hand was told to open, by the demonstration's only event [ns]."""
    (told,) = demonstration.events
    assert told.name == "open"
    stamps = (demonstration.header.stamp, told.time_from_start)
    return sum(one.sec * 10**9 + one.nanosec for one in stamps)


def test_every_state_of_the_arm_is_answered(lesson):
    """After the graph was there: what counts before is that nobody answers."""
    answered, unanswered = lesson.driver.answered, lesson.driver.unanswered
    lesson.driver.run(1.0)
    assert lesson.driver.answered == answered + 500
    assert lesson.driver.unanswered == unanswered


def test_a_demonstration_has_what_the_cameras_and_the_arm_said(lesson):
    assert set(lesson.hits) <= set(lesson.pressed) and lesson.hits == sorted(set(lesson.hits))
    for demonstration, place in zip(lesson.demonstrations, LESSONS, strict=True):
        assert demonstration.skill == "throw" and list(demonstration.situation.bodies) == [
            "basket"
        ]
        target = demonstration.situation.poses[0].position
        assert [target.x, target.y, target.z] == pytest.approx(place, abs=0.003)
        poses = {track.body: len(track.poses) for track in demonstration.tracks}
        assert len(demonstration.joints) > 50 and poses["hand"] > 50 and poses["ball"] > 100


def test_the_delay_of_the_hand_is_found(lesson):
    assert lesson.learned.demonstrations == len(LESSONS)
    told = float(lesson.learned.message.split("the hand opens ")[1].split(" ms")[0])
    assert told == pytest.approx(HAND_DELAY_MS, abs=6.0)


def test_the_arm_throws_into_baskets_that_nobody_demonstrated(throws):
    for target, result, lies_in in throws:
        assert result.code == Execute.Goal.OUTCOME_EXECUTED, f"{target}: {result.message}"
        assert result.outcome.seen and result.outcome.error < 0.12
        assert result.outcome.success == lies_in
    assert all(lies_in for _, _, lies_in in throws)


def test_nobody_stopped_the_arm_meanwhile(lesson, throws):
    assert lesson.driver.stops == 0


def test_the_hand_is_told_to_open_for_longer_than_one_command(lesson, throws):
    told = lesson.driver.openings[len(lesson.pressed) :]
    assert len(told) >= len(throws)
    assert any(later - earlier == 2_000_000 for earlier, later in pairwise(told))


def test_the_arm_practises_at_the_basket_that_the_cameras_see(lesson, throws):
    """A person puts the ball back when the coach asks for it; the arm goes back to where it
    starts, not where it came to rest.
    """
    lesson.driver.plant.stand(TARGETS[0])
    result, said = lesson.type("dart-skill", "practice", "--running", "--throws", "1")
    assert (result["thrown"], result["learned"]) == (1, 1), said
    assert result["throws"][0]["error_m"] is not None and result["throws"][0]["error_m"] < 0.15, (
        said
    )
    assert result["throws"][0]["target_m"] == pytest.approx(TARGETS[0], abs=0.003)
    assert "put the ball into the hand, then stand back" in lesson.asked
    assert all(text in said for text in lesson.asked), (
        "the command line says what the person should do"
    )
    executed = lesson.call("/commander/get_plan", plan_id=throws[0][1].plan_id)
    assert executed.success, executed.message
    assert lesson.driver.plant.encoders.angles == pytest.approx(
        np.array(executed.plan.start_posture), abs=0.1
    )


def test_the_coach_says_where_a_basket_shall_stand_and_waits_for_it(lesson, throws):
    x, y, z = (round(float(value), 2) for value in TARGETS[2])
    lesson.driver.plant.stand(TARGETS[1])
    result, said = lesson.type("dart-skill", "throw", "--at", str(x), str(y), str(z))
    assert (
        lesson.asked[0] == f"put the basket at x {x:.2f}, y {y:.2f}, with its rim at z {z:.2f} m"
    )
    assert result["throws"][0]["error_m"] < 0.12 and result["throws"][0]["in_basket"], said


def test_an_arm_that_was_stopped_does_not_go_on_by_itself(lesson, throws):
    handle = lesson.start_practice(trials=1, follow_bodies=True)
    lesson.until_asked("")
    assert lesson.call("/commander/stop").success
    result = lesson.result(handle)
    assert (result.success, result.message) == (False, "the arm was stopped with /commander/stop")
    refused = lesson.call("/commander/release_arm", data=True)
    assert not refused.success and "call /commander/reset" in refused.message
    assert lesson.call("/commander/reset").success


def test_a_person_teaches_with_the_enter_key(lesson, throws):
    driver, person, place = lesson.driver, lesson.driver.person, LESSONS[4]
    driver.plant.stand(place)
    acts = [
        lambda: lesson.do(person.cock(place), person.bring_ball(), person.wait(0.3)),
        lambda: lesson.do(person.throw(place), person.wait(0.3)),
    ]
    taught, said = lesson.type("dart-skill", "teach", "--count", "1", before_enter=acts)
    assert taught["shown"] == 1, said
    kept = re.search(r"(demonstration_\d+) is kept", said)[1]
    assert lesson.call("/skill_learner/drop_demonstration", id=kept).success


def test_where_no_plan_reaches_the_basket_it_is_asked_for_elsewhere(lesson, throws):
    lesson.driver.plant.stand(TOO_FAR)
    with lesson.practising(trials=1, follow_bodies=True):
        lesson.until_asked("put the basket elsewhere")
        assert "m from the base axis; the demonstrations reach" in lesson.asked[-1]
        lesson.driver.plant.stand(TARGETS[0])
        lesson.until_asked("the ball")


def test_a_basket_that_is_carried_on_is_noticed_before_the_ball_is_there(lesson, throws):
    lesson.driver.plant.stand(TARGETS[0])
    with lesson.practising(trials=1, follow_bodies=True):
        lesson.until_asked("the ball")
        lesson.driver.plant.stand(TOO_FAR)
        lesson.until_asked("put the basket elsewhere")


def test_a_target_without_a_plan_costs_one_throw_and_nobody_carries_a_basket_there(lesson, throws):
    targets = [basket_at(*place) for place in (TOO_FAR, TARGETS[0])]
    lesson.driver.plant.stand(TARGETS[1])
    with lesson.practising(situations=targets, only_execute=True) as practice:
        lesson.until_asked("")
        x, y, z = TARGETS[0]
        assert (
            lesson.asked[0]
            == f"put the basket at x {x:.2f}, y {y:.2f}, with its rim at z {z:.2f} m"
        )
    result = practice.result
    assert (result.executed, len(result.outcomes), result.outcomes[0].seen) == (0, 1, False)


def test_nothing_is_thrown_while_the_ball_is_not_in_the_hand(lesson, throws):
    """Nor does the arm, until practice is cancelled."""
    openings = len(lesson.driver.openings)
    lesson.driver.plant.put(np.array([1.0, 1.0, published.BALL_RADIUS]))
    with lesson.practising(trials=1, follow_bodies=True) as practice:
        lesson.until_asked("from its place in the hand")
    assert (practice.result.executed, practice.result.message) == (0, "cancelled")
    assert len(lesson.driver.openings) == openings


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


def test_a_bad_demonstration_is_dropped_and_restored(lesson, throws):
    listed, _ = lesson.type("dart-skill", "demonstrations")
    rows = listed["demonstrations"]
    assert [row["id"] for row in rows][: len(LESSONS)] == [
        f"demonstration_{stamp}" for stamp in lesson.hits
    ]
    for row in rows[: len(LESSONS)]:
        assert row["readable"] and not row["dropped"] and 0.3 < row["duration"] < 3.0, row
    bad = rows[1]["id"]
    assert [row["number"] for row in rows] == [*range(1, len(rows) + 1)]
    dropped, _ = lesson.type("dart-skill", "demonstrations", "drop", "2")
    assert "learn again" in dropped["message"] and dropped["id"] == bad
    learned = lesson.call("/skill_learner/learn", at_least=len(rows))
    assert learned.success and f"dropped: {bad}" in learned.message, learned.message
    assert lesson.call("/skill_learner/drop_demonstration", id=bad, restore=True).success
    again = lesson.call("/skill_learner/learn", at_least=len(rows), without=[rows[0]["id"]])
    assert again.demonstrations == learned.demonstrations and bad not in again.message
    refused = lesson.call("/skill_learner/drop_demonstration", id="demonstration_1")
    assert not refused.success and "no demonstration 'demonstration_1'" in refused.message


@pytest.fixture(scope="module")
def unseen(lesson, throws, tmp_path_factory):
    """A guided throw whose landing nobody saw, recorded by a recorder that was started again after
    one was dropped: ids before, the dropped one, the recorder's answer, and its bag.
    """
    folder = tmp_path_factory.mktemp("again")
    before = [one.id for one in lesson.call("/skill_learner/demonstrations").demonstrations]
    assert lesson.call("/skill_learner/drop_demonstration", id=before[2]).success
    assert lesson.call("/commander/release_arm", data=True).success
    cameras, plant = lesson.driver.cameras, lesson.driver.plant
    cameras.hidden = lambda body: (
        body == "ball" and plant.hand.told_to_open and plant.pose("ball")[0][2] < 1.2
    )
    command = [
        "ros2",
        "run",
        "dart_skill",
        "demonstration_recorder",
        "--ros-args",
        "-r",
        "__node:=again",
        "-p",
        f"bag:={folder / 'bag'}",
    ]
    with running(command, folder / "again.log"):
        lesson.recorder = "/again"
        try:
            _, stopped = lesson.teach(LESSONS[2], keep=True)
        finally:
            lesson.recorder, cameras.hidden = "/demonstration_recorder", lambda body: False
    assert lesson.call("/commander/release_arm", data=False).success
    return before, before[2], stopped, folder / "bag"


def test_a_landing_that_nobody_saw_costs_one_demonstration_and_not_all(lesson, unseen):
    """Its demonstration is left out, and both the recorder and the learner say why."""
    before, _, stopped, _ = unseen
    learned = lesson.call("/skill_learner/learn", at_least=len(before) + 1)
    assert learned.success, learned.message
    assert stopped.success and not stopped.readable
    for message in (stopped.message, learned.message):
        assert "the cameras did not see where the ball landed" in message


def test_a_recorder_that_is_started_again_overwrites_no_demonstration(lesson, unseen):
    """And what was dropped before stands in its bag, too."""
    before, dropped, stopped, bag = unseen
    heard = lesson.call("/skill_learner/demonstrations").demonstrations
    assert [one.id for one in heard] == [*before, stopped.demonstration.id]
    assert dropped in read_dropped(bag) == {one.id for one in heard if one.dropped}


def test_an_arm_that_somebody_may_hold_is_not_thrown_with(lesson, throws):
    assert lesson.call("/commander/release_arm", data=True).success
    refused = lesson.throw(TARGETS[0])
    assert refused.code != Execute.Goal.OUTCOME_EXECUTED and "released" in refused.message, (
        refused.message
    )
    assert lesson.call("/commander/release_arm", data=False).success
