"""Another skill than throwing through the nodes: shown, learned, executed, judged, practised; by
our client, and by a plain one.
"""

import json
import os
import subprocess

import numpy as np
import pytest
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Demonstration, SimulationState, Situation
from dart_skill_msgs.srv import GetPlan, Judge, Learn, Look, ModelFile, Plan, Reset
from geometry_msgs.msg import Point, Pose
from rclpy.action import ActionClient
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from dart_skill.recording import BagReader, read_demonstrations
from dart_skill.skills.learning import LearnedSkill
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import LATCHED
from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.example import install_example
from tests.integration.conftest import graphs, wait_for

SHOWN, SEED = 3, 0
RESTING = 0.02


@pytest.fixture(scope="module")
def place():
    return load_skill("place")


@pytest.fixture(scope="module")
def graph(ros, tmp_path_factory, place):
    """A graph that has been shown how to place a part, and has learned it: graph, client, what was
    shown and said.
    """
    folder, rng = tmp_path_factory.mktemp("place"), np.random.default_rng([SEED, 7])
    with graphs(folder) as make:
        running, client = make("composed", SEED, skill="place")
        running.client, running.bag, running.rng, running.shown = client, folder / "bag_1", rng, []
        client.node.create_subscription(
            Demonstration, "/demonstrations", running.shown.append, LATCHED
        )
        running.lessons = [
            client.show(conversions.situation_msg(place.draw(rng))) for _ in range(SHOWN)
        ]
        running.learned = client.learn()
        yield running


def test_every_lesson_succeeds_and_is_a_demonstration_of_the_skill(graph):
    assert all(lesson.success for lesson in graph.lessons), [
        lesson.message for lesson in graph.lessons
    ]
    wait_for(graph.client, lambda: len(graph.shown) == SHOWN, what="demonstrations")
    for one, lesson in zip(graph.shown, graph.lessons, strict=True):
        assert one.skill == "place" and [track.body for track in one.tracks] == [
            "hand",
            "part",
            "holder",
        ]
        assert [event.name for event in one.events] == ["close", "open"]
        assert set(one.situation.bodies) == {"hand", "part", "holder"} and len(one.joints) > 100
        assert lesson.outcome.seen and lesson.outcome.error < 0.005
    assert (
        graph.learned.demonstrations == SHOWN
        and f"learned 'place' from {SHOWN} demonstrations" in graph.learned.message
    )


@pytest.mark.slow
def test_the_part_goes_into_a_holder_that_stands_elsewhere(graph, place):
    truth = []
    watching = graph.client.node.create_subscription(
        SimulationState, "/simulation/state", truth.append, 10
    )
    situation = place.draw(graph.rng)
    made = graph.client.execute(conversions.situation_msg(situation), look=True)
    assert (made.code, made.message) == (Execute.Goal.OUTCOME_EXECUTED, "executed")
    plan = graph.client.executed_plan(made)
    assert made.outcome.skill == plan.skill == "place"
    assert [event.name for event in plan.events] == ["close", "open"]
    assert set(plan.situation.bodies) == {"part", "holder"}
    seen = conversions.place_of(plan.situation, "holder")
    assert seen == pytest.approx(situation.pose("holder").position, abs=1e-3)
    assert made.outcome.seen and made.outcome.success == truth[-1].success, (
        "the cameras and the world say the same"
    )
    assert made.outcome.success, made.outcome.message
    graph.client.node.destroy_subscription(watching)


def test_a_result_is_read_at_a_glance_and_another_plan_is_refused_by_its_id(graph):
    made = graph.client.execute(Situation(), look=True)
    assert len(str(made).split()) < 300, "a terminal holds it"
    ask = graph.client.node.create_client(GetPlan, "/commander/get_plan")
    newest = graph.client.call(ask, GetPlan.Request())
    assert newest.plan_id == made.plan_id and newest.plan == graph.client.executed_plan(made)
    with pytest.raises(GraphFailure, match=f"no plan 'p7'; the newest .* {made.plan_id}"):
        graph.client.call(ask, GetPlan.Request(plan_id="p7"))


def test_a_plain_client_says_nothing_and_the_arm_does_it_where_the_cameras_see_the_bodies(graph):
    """As `ros2 action send_goal /execute dart_skill_msgs/action/Execute {}` in a world that runs."""
    node, client = graph.client.node, graph.client
    reset, hold = (
        node.create_client(Reset, "/simulation/reset"),
        node.create_client(SetBool, "/simulation/pause"),
    )
    client.call(reset, Reset.Request())
    client.call(hold, SetBool.Request(data=False))
    action = ActionClient(node, Execute, "/execute")
    wait_for(client, action.server_is_ready, what="the commander")
    look = node.create_client(Look, "/demonstration_recorder/look")
    wait_for(
        client,
        lambda: client.call(look, Look.Request(), may_refuse=True).success,
        what="bodies that are seen",
    )
    handle = client.wait(action.send_goal_async(Execute.Goal()), "/execute")
    result = client.wait(handle.get_result_async(), "the result").result
    handle = client.wait(action.send_goal_async(Execute.Goal()), "/execute")
    refused = client.wait(handle.get_result_async(), "the result of an empty hand").result
    client.call(hold, SetBool.Request(data=True))
    assert refused.code == Execute.Goal.OUTCOME_REFUSED
    assert "from where the hand takes it" in refused.message
    assert result.code == Execute.Goal.OUTCOME_EXECUTED and result.outcome.success, (
        result.outcome.message or result.message
    )
    assert set(client.executed_plan(result).situation.bodies) == {"part", "holder"}
    action.destroy()


def test_practice_draws_situations_and_is_learned_from(graph):
    phases = []
    result = graph.client.practise(1, on_feedback=lambda feedback: phases.append(feedback.phase))
    assert result.success and (result.executed, result.learned) == (1, 1), result.message
    assert result.outcomes[0].success, result.outcomes[0].message
    assert phases == ["resetting", "executing", "learning", "done"]


@pytest.mark.slow
def test_verbs_practise_and_list_what_the_graph_has_learned(graph):
    """The graph's own domain is in the environment."""

    def told(*words):
        done = subprocess.run(
            ["dart-skill", *words, "--json"], capture_output=True, text=True, timeout=180
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    practised = told("practice", "--running", "--throws", "1")
    assert (practised["executed"], practised["learned"], len(practised["trials"])) == (1, 1, 1)
    listed = told("demonstrations")["demonstrations"]
    assert len(listed) == SHOWN and all(
        "holder" in one["situation"] and one["readable"] for one in listed
    )
    refused = subprocess.run(["dart-skill", "throw"], capture_output=True, text=True, timeout=60)
    assert (
        refused.returncode == 1
        and "has learned 'place', not to throw: dart-skill execute" in refused.stderr
    )


def test_the_model_is_saved_and_loaded_to_the_last_bit(graph, tmp_path):
    def ask(name, kind, request):
        return graph.client.call(
            graph.client.node.create_client(kind, f"/skill_learner/{name}"), request
        )

    situation = graph.shown[0].situation
    wanted = Plan.Request(header=Header(frame_id="world"), situation=situation)
    before = ask("plan", Plan, wanted).plan
    path = str(tmp_path / "place.npz")
    assert ask("save", ModelFile, ModelFile.Request(path=path)).model_id == graph.learned.model_id
    ask("learn", Learn, Learn.Request())  # what was practised is forgotten
    assert ask("plan", Plan, wanted).plan != before
    assert ask("load", ModelFile, ModelFile.Request(path=path)).model_id == graph.learned.model_id
    assert ask("plan", Plan, wanted).plan == before


@pytest.mark.parametrize(
    ("bodies", "frame", "said"),
    [
        (["part"], "", "where is the holder"),
        (
            ["basket"],
            "",
            "names the body 'basket', which 'place' does not have: it has only hand, part, holder",
        ),
        (["part", "part"], "", "part stands there twice"),
        (["part"], "camera", "the situation is in frame 'camera', not 'world'"),
    ],
)
def test_a_situation_that_is_none_has_no_plan(graph, bodies, frame, said):
    request = Plan.Request(header=Header(frame_id=frame or "world"))
    request.situation.bodies, request.situation.poses = (
        bodies,
        [Pose(position=Point(x=0.6, y=0.1, z=1.2)) for _ in bodies],
    )
    planner = graph.client.node.create_client(Plan, "/skill_learner/plan")
    response = graph.client.call(planner, request, may_refuse=True)
    assert not response.success and said in response.message, response.message


def test_a_number_that_the_skill_does_not_have_is_not_executed(graph):
    """The cameras see the bodies of which the goal says nothing, so it could be: but not as it was
    asked for.
    """
    client, action = graph.client, ActionClient(graph.client.node, Execute, "/execute")
    wait_for(client, action.server_is_ready, what="the commander")
    goal = Execute.Goal()
    goal.situation.names, goal.situation.numbers = ["mass"], [0.2]
    handle = client.wait(action.send_goal_async(goal), "/execute")
    result = client.wait(handle.get_result_async(), "the result").result
    action.destroy()
    assert result.code == Execute.Goal.OUTCOME_REFUSED
    assert "names the number 'mass', which 'place' does not have: it has none" in result.message, (
        result.message
    )


def test_an_empty_goal_right_after_a_reset_is_for_where_the_bodies_are_now(graph):
    """It was for where the cameras had seen them before: a part in its holder, not in the hand."""
    client, action = graph.client, ActionClient(graph.client.node, Execute, "/execute")
    wait_for(client, action.server_is_ready, what="the commander")
    reset = client.node.create_client(Reset, "/simulation/reset")
    for _ in range(2):
        client.call(reset, Reset.Request())
        handle = client.wait(action.send_goal_async(Execute.Goal()), "/execute")
        made = client.wait(handle.get_result_async(), "the result").result
        assert made.code == Execute.Goal.OUTCOME_EXECUTED, made.message
        assert made.outcome.seen
    client.call(reset, Reset.Request())
    action.destroy()


def test_a_body_that_this_world_does_not_have_is_not_put_anywhere(graph):
    with pytest.raises(
        GraphFailure, match="this world can put the holder somewhere, not 'basket'"
    ):
        reset = graph.client.node.create_client(Reset, "/simulation/reset")
        graph.client.call(reset, Reset.Request(situation=conversions.at_place([2.0, 0.0, 0.4])))


def test_what_is_too_long_ago_is_not_judged(graph):
    judge = graph.client.node.create_client(Judge, "/demonstration_recorder/judge")
    response = graph.client.call(judge, Judge.Request(), may_refuse=True)
    assert not response.success and not response.pending and "never began" in response.message


def test_the_bag_teaches_the_same_without_nodes(graph, place):
    told = graph.client.demonstrations().demonstrations
    graph.stop()  # closes the bag; the last test that needs the nodes
    shown = read_demonstrations(graph.bag, place.name)
    begun = [one.stamp_ns + round(1e9 * one.motion_start) for one in shown]
    assert [conversions.stamp_ns(one.header.stamp) for one in told] == begun
    assert all(list(one.situation.bodies) == ["hand", "part", "holder"] for one in told)
    assert LearnedSkill(place, shown).model_id == graph.learned.model_id
    with BagReader(graph.bag) as bag:
        assert {"/vrpn_mocap/part/pose", "/vrpn_mocap/holder/pose", "/joint_states"} <= set(
            bag.topics
        )
        assert "/vrpn_mocap/ball/pose" not in bag.topics


@pytest.mark.slow
def test_a_skill_of_another_package_runs_through_all_nodes_and_the_command(tmp_path):
    """Nothing of this repository knows it: the package that has it is on the path."""
    folder = install_example(tmp_path / "package")
    environment = {
        **os.environ,
        "PYTHONPATH": f"{folder}{os.pathsep}{os.environ.get('PYTHONPATH', '')}",
    }
    command = [
        "dart-skill",
        "demo",
        "--skill",
        "beside",
        "--demonstrations",
        "3",
        "--trials",
        "2",
        "--output",
        str(tmp_path / "out"),
    ]
    done = subprocess.run(
        [*command, "--json"], capture_output=True, text=True, timeout=300, env=environment
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["skill"], summary["tried"], summary["demonstrations"]) == ("beside", 2, 3)
    assert "are not matched" not in (tmp_path / "out" / "report.html").read_text(), (
        "the replay tells no trial's result"
    )
    assert summary["succeeded"] == 2 and summary["median_error_m"] < 0.008, summary["trials"]
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == summary


@pytest.mark.parametrize("verb", ["demo", "up"])
def test_a_skill_that_there_is_not_is_refused_before_anything_starts(tmp_path, verb):
    command = ["dart-skill", verb, "--skill", "plaec", "--output", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "no skill 'plaec': choose one of darts, place" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_lesson_is_judged_where_the_cameras_see_the_bodies(make_graph, place):
    """They may see a world that is turned and shifted: by more than a part may be beside its seat."""
    turned = {"composed": {"registration_shift": 0.01, "registration_turn": 0.01}}
    _, client = make_graph("composed", SEED, turned, skill="place")
    situation = conversions.situation_msg(place.draw(np.random.default_rng(SEED)))
    lesson = client.show(situation)
    assert lesson.success and lesson.attempts == 1, lesson.message
    seen = conversions.place_of(lesson.outcome.situation, "holder")
    asked = conversions.place_of(situation, "holder")
    assert np.linalg.norm(seen - asked) > 0.004
