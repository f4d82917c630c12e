"""Teach, record, learn, throw over DDS; the same in process, beside a busy machine, and from the
bag alone.
"""

import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest
from dart_skill_msgs.srv import AddTrial, Learn, ModelFile, Plan

from dart_skill.arm import same_plan
from dart_skill.common.permissions import policy
from dart_skill.common.regions import targets_for
from dart_skill.recording import BagReader, read_demonstrations
from dart_skill.session import Session
from dart_skill.skills.learning import learn_throwing
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.process.graph_processes import NODES, GraphFailure
from tests.integration.conftest import endpoints_of_processes, graphs, plan_request
from tests.policies import allowed, may
from tests.throw_demonstrations import changed_throw
from tests.warm import starting_warm

COLD = True

SEED, SHOWN = 0, 2
NEEDED_ELSEWHERE = {"rt/clock", "ros_discovery_info", "rt/simulation/delivered"}
"""The last one by skills that react."""
NEEDED_AT_TIMES = {"teacher": {"rt/joint_states"}}
"""A teacher that has nothing to do hears no states."""
TO_DEMONSTRATE, (TO_THROW, _) = targets_for(SEED, SHOWN, 2)
"""One throw: that a second one is made as in one process is told by practice, and by darts."""


@pytest.fixture(scope="module")
def in_process():
    """The job in one process without ROS: landing points of lessons and throw, and the plan of the
    throw.
    """
    session = Session(SEED)
    lessons = [session.teach(target) for target in TO_DEMONSTRATE]
    skill = learn_throwing([lesson[-1].demonstration for lesson in lessons])
    plan = skill.plan(TO_THROW)
    thrown = session.throw(plan).outcome
    session.close()
    return {
        "lessons": [lesson[-1].outcome.landing for lesson in lessons],
        "model_id": skill.model_id,
        "plan": plan,
        "landing": thrown.landing,
    }


@pytest.fixture(scope="module")
def over_dds(ros, tmp_path_factory):
    """The same job with every node a process of its own. They are forked: how a process begins is
    of account for the learners below.
    """
    folder = tmp_path_factory.mktemp("over_dds")
    with starting_warm(), graphs(folder) as make:
        _, client = make("processes", SEED)
        done = _job(client)
        # One that an earlier test left behind, and that is not forgotten yet, may have the same
        # names, all in one process.
        endpoints = endpoints_of_processes(client.node, alone=True)
    return {**done, "bag": folder / "bag_1", "endpoints": endpoints}


def test_every_process_does_what_its_policy_allows_and_needs_all_of_it(over_dds):
    assert {name for _, name in over_dds["endpoints"]} == set(NODES)
    for (_, name), done in over_dds["endpoints"].items():
        for what, allows in zip(done, allowed(policy())[f"/dart_skill/{name}"], strict=True):
            assert not [topic for topic in what if not may(allows, topic)], (
                f"{name} needs these: add them to config/permissions.yaml"
            )
            unused = {one for one in allows if "*" not in one} - what
            assert unused <= NEEDED_ELSEWHERE | NEEDED_AT_TIMES.get(name, set()), (
                f"{name} does without these: take them out of config/permissions.yaml"
            )


def _job(client):
    lessons = [client.teach(target) for target in TO_DEMONSTRATE]
    assert all(lesson.success for lesson in lessons), [lesson.message for lesson in lessons]
    learned = client.learn()
    thrown = client.throw(TO_THROW)
    plan = client.executed_plan(thrown)
    return {"lessons": lessons, "learned": learned, "thrown": thrown, "plan": plan}


def test_every_lesson_and_the_throw_succeed(over_dds):
    assert [lesson.success for lesson in over_dds["lessons"]] == [True] * SHOWN
    assert over_dds["learned"].demonstrations == SHOWN
    result = over_dds["thrown"]
    assert result.code == 1, result.message
    assert result.outcome.seen
    speed = np.linalg.norm(
        conversions.vector(conversions.state_of(result.outcome.observed, "release").twist.linear)
    )
    assert 1.5 < speed < 4.5, f"the ball left the hand at {speed:.2f} m/s"
    assert result.outcome.error < 0.03, f"{SHOWN} demonstrations: {result.outcome.error:.3f} m"


def test_the_graph_over_dds_is_the_session_in_process_bit_for_bit(over_dds, in_process):
    lessons = [conversions.seen_at(lesson.outcome, "landing") for lesson in over_dds["lessons"]]
    np.testing.assert_array_equal(lessons, in_process["lessons"])
    assert over_dds["learned"].model_id == in_process["model_id"]
    assert same_plan(conversions.throw_plan(over_dds["plan"]), in_process["plan"])
    np.testing.assert_array_equal(
        conversions.seen_at(over_dds["thrown"].outcome, "landing"), in_process["landing"]
    )


@pytest.mark.slow
def test_a_busy_machine_changes_no_bit(make_graph, in_process):
    busy = subprocess.Popen([sys.executable, "-c", "while True: sum(range(10**6))"])
    try:
        _, client = make_graph("composed", SEED)
        done = _job(client)
    finally:
        busy.kill()
        busy.wait()
    lessons = [conversions.seen_at(lesson.outcome, "landing") for lesson in done["lessons"]]
    np.testing.assert_array_equal(lessons, in_process["lessons"])
    assert done["learned"].model_id == in_process["model_id"]
    np.testing.assert_array_equal(
        conversions.seen_at(done["thrown"].outcome, "landing"), in_process["landing"]
    )


@contextmanager
def fresh_learner(folder):
    """A learner in a fresh process: its graph, and a function that calls a service of its by name."""
    kinds = {
        "learn": Learn,
        "plan": Plan,
        "save": ModelFile,
        "load": ModelFile,
        "add_trial": AddTrial,
    }
    with graphs(folder) as make:
        graph, client = make(None)
        graph.start("skill_learner")
        clients = {
            name: client.node.create_client(kind, f"/skill_learner/{name}")
            for name, kind in kinds.items()
        }
        yield graph, lambda service, request: client.call(clients[service], request)


def add_to(ask, one):
    """A demonstration is added to what a learner has learned."""
    return ask("add_trial", AddTrial.Request(trial=conversions.demonstration_msg(one)))


def planned_by(ask):
    """What a learner plans for the basket."""
    return ask("plan", plan_request(TO_THROW)).plan


@pytest.fixture(scope="module")
def learner(over_dds, tmp_path_factory):
    """A fresh learner that has learned from the bag alone: its graph, how to ask it, what it
    learned, and the file of its model.
    """
    folder = tmp_path_factory.mktemp("learner")
    with fresh_learner(folder) as (graph, ask):
        learned = ask("learn", Learn.Request(bag=str(over_dds["bag"])))
        ask("save", ModelFile.Request(path=str(folder / "model.npz")))
        yield graph, ask, learned, folder / "model.npz"


def test_the_bag_alone_gives_the_same_plan_in_a_fresh_process(over_dds, learner):
    _, ask, learned, _ = learner
    assert learned.model_id == over_dds["learned"].model_id
    assert planned_by(ask) == over_dds["plan"]


def test_a_trial_is_added_to_what_is_learned_and_a_strange_one_is_kept_out(over_dds, learner):
    shown, (_, ask, *_) = read_demonstrations(over_dds["bag"]), learner

    def add(one):
        return add_to(ask, one)

    def plan():
        return planned_by(ask)

    before = plan()
    with pytest.raises(GraphFailure, match="already"):
        add(shown[0])
    with pytest.raises(GraphFailure, match="did not start in this hand"):
        add(
            changed_throw(
                shown[0], id="elsewhere", hand_position=shown[0].hand_position + [0.0, 0.0, 0.5]
            )
        )
    assert plan() == before, "what is kept out changes nothing"
    assert add(replace(shown[0], id="trial_1")).demonstrations == SHOWN + 1
    assert plan().model_id != before.model_id


def test_a_fresh_process_knows_nothing_until_it_loads_the_model_and_plans_the_same(
    over_dds, learner, tmp_path
):
    """The learner that saved it ends before: two would have one name."""
    shown, (first, *_, model) = read_demonstrations(over_dds["bag"]), learner
    first.stop()
    with fresh_learner(tmp_path) as (_, ask):
        with pytest.raises(GraphFailure, match="nothing is learned yet"):
            add_to(ask, shown[0])
        ask("load", ModelFile.Request(path=str(model)))
        assert planned_by(ask) == over_dds["plan"]


def test_the_bag_holds_what_the_sensors_saw_and_opens_without_ros(over_dds):
    assert len(read_demonstrations(over_dds["bag"])) == SHOWN
    with BagReader(over_dds["bag"]) as bag:
        topics = bag.topics
        assert topics["/vrpn_mocap/hand/pose"].type_name == "geometry_msgs/msg/PoseStamped"
        states = [m.data.header.stamp for m in bag.messages(["/joint_states"])]
    stamps = np.array([s.sec * 10**9 + s.nanosec for s in states])
    gaps = np.diff(stamps[stamps > 0])
    assert (gaps >= 0).all(), "joint states are recorded in order"
    resets = (gaps > 500_000_000).sum()
    assert resets >= SHOWN, f"{resets} resets in the bag"
    assert np.isin(gaps, [0, 2_000_000]).sum() + resets == len(gaps), (
        "a joint state was lost on the way to the bag"
    )


def test_the_bag_names_its_seed(over_dds):
    with BagReader(over_dds["bag"]) as bag:
        assert bag.custom_data["seed"] == str(SEED)
