"""Practice with a person beside an arm that no simulator of the graph moves: they are told what to do,
and what is wrong until it is right.
"""

from dataclasses import replace

import numpy as np
import pytest
from std_srvs.srv import SetBool, Trigger

from dart_skill.session import BeltSession, BenchSession
from dart_skill.simulation import Belt, Conveyor
from dart_skill.skills.practice import Learner
from dart_skill.skills.protocol import load_skill
from tests.integration.conftest import graphs
from tests.integration.real_arm import RealArm, Table

SEED, SHOWN = 0, 3
SETTINGS = {
    "coach": {"stand_back": 1.0, "longest_wait": 60.0},
    "commander": {"states_timeout": 20.0},
}
HOLD = "hold it (/commander/release_arm with data: false)"
STAND = "put the holder where the cameras see it"
LOAD = "put the part between the fingers as it was shown, then stand back"
CLEAR = "away from the hand, see that nothing is in its way, then stand back"
START = "start the belt: the arm reaches as soon as the cup moves"
NEVER = 1e9
"""A belt that sets off then stands still [s]."""


def beside(folder, session, plant):
    """The hardware layout beside an arm, with what was shown in process: client and arm."""
    learner, rng = Learner(session.skill), np.random.default_rng([SEED, 7])
    shown = [session.show(session.skill.draw(rng)) for _ in range(SHOWN)]
    assert all(one.outcome.success for one in shown)
    learner.learn([session.skill.described(one.seen) for one in shown])
    learner.save(folder / "model.npz")
    session.close()
    with graphs(folder) as make:
        graph, client = make(None)
        arm = RealArm(client, plant)
        graph.start_all("hardware", SEED, folder / "bag", SETTINGS, session.skill.name)
        client.load(folder / "model.npz")
        yield client, arm
        plant.close()


@pytest.fixture(scope="module")
def bench(ros, tmp_path_factory):
    session = BenchSession(load_skill("place"), SEED)
    yield from beside(tmp_path_factory.mktemp("bench"), session, Table())


@pytest.fixture
def belt(ros, tmp_path):
    """Its test comes first: the graph beside the bench has the same nodes, and stays until the end."""
    session = BeltSession(load_skill("reach"), SEED)
    yield from beside(tmp_path, session, Conveyor())


class Helper:
    """A person who does one thing after the other, each when they are told so in these words.

    Attributes: said, all that they were told; does, what they have not been asked for yet.
    """

    def __init__(self, *does):
        self.said, self.does = [], list(does)

    def hear(self, feedback):
        if feedback.phase == "waiting":
            self.said.append(feedback.message)
            if self.does and self.does[0][0] in feedback.message:
                self.does.pop(0)[1]()


def stand_holder(arm, x, y, turn=0.0):
    """A person stands the holder on the table, turned [rad], and its floor is 1 cm thick."""
    upright = np.array([0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2)])
    arm.plant.put("holder", np.array([x, y, arm.plant.table + 0.01]), upright)


@pytest.mark.slow
def test_a_person_starts_the_belt_and_the_arm_reaches_into_the_cup(belt):
    client, arm = belt
    runs = Belt((0.62, -0.05, 1.10), (0.02, 0.15, 0.0), steady=False, start=NEVER)
    arm.plant.run(runs)
    person = Helper(
        (START, lambda: arm.plant.run(replace(runs, start=arm.plant.time))),
        (f"take the cup {CLEAR}", lambda: arm.plant.run(replace(runs, begin=(0.9, 0.6, 1.10)))),
    )
    result = client.practise(1, follow_basket=True, on_feedback=person.hear)
    assert result.success and not person.does, (result.message, person.said)
    assert (result.executed, result.learned) == (1, 1), result.message
    assert result.outcomes[0].success, result.outcomes[0].message
    assert "stand back: the belt may start in 1 s" in person.said


def test_a_person_lets_place_be_practised_and_is_told_what_is_missing(bench):
    """At first the arm is released and the part lies elsewhere; the second time nobody sees the
    holder.
    """
    client, arm = bench
    release = client.node.create_client(SetBool, "/commander/release_arm")
    stand_holder(arm, 0.60, 0.15)
    arm.plant.lay_aside()
    client.call(release, SetBool.Request(data=True))

    def take_away():
        arm.plant.lay_aside()
        stand_holder(arm, 0.62, 0.05, 0.3)
        arm.hidden.add("holder")

    person = Helper(
        (HOLD, lambda: release.call_async(SetBool.Request(data=False))),
        (f"{LOAD}: the part is ", arm.plant.put_between_the_fingers),
        (f"take the part {CLEAR}", take_away),
        (f"{STAND}: the holder is not seen", arm.hidden.clear),
        (LOAD, arm.plant.put_between_the_fingers),
        (f"take the part {CLEAR}", arm.plant.lay_aside),
    )
    result = client.practise(2, follow_basket=True, on_feedback=person.hear)
    assert result.success and not person.does, (result.message, person.said)
    assert (result.executed, result.learned) == (2, 2), result.message
    for outcome in result.outcomes:
        assert outcome.success and outcome.error < 0.005, outcome.message
    assert "stand back: the arm places it in 1 s" in person.said
    assert "stand back: the arm moves to where the trial begins" in person.said


def test_an_arm_that_is_stopped_beside_a_person_does_not_move(bench):
    client, arm = bench
    stop = client.node.create_client(Trigger, "/commander/stop")
    arm.plant.lay_aside()
    before = np.array(arm.plant.joint_position)
    person = Helper((LOAD, lambda: stop.call_async(Trigger.Request())))
    result = client.practise(1, follow_basket=True, on_feedback=person.hear)
    assert (result.success, result.executed) == (False, 0)
    assert result.message == "the arm was stopped with /commander/stop"
    assert arm.plant.joint_position == pytest.approx(before, abs=0.01)
    client.ask(Trigger, "/commander/reset", Trigger.Request())
