"""Darts through the nodes: shown, learned, practised with aims that the coach chooses, the same as
in one process to the last bit.
"""

import re
from functools import partial

import numpy as np
import pytest
from dart_skill_msgs.action import Execute
from dart_skill_msgs.msg import Situation as SituationMsg
from dart_skill_msgs.srv import Plan, Reset
from geometry_msgs.msg import Pose
from rclpy.action import ActionClient
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from dart_skill.arm import same_plan
from dart_skill.cli import main
from dart_skill.darts import as_target, name_at
from dart_skill.experiments.studies import arm_darts
from dart_skill.session import learn_skill, play_leg
from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.verbs.trials import own_darts, throw_dart
from tests.integration.conftest import graphs
from tests.integration.plan_messages import throw_plan_msg
from tests.paths import CONFIG

SEED, SHOWN, UNKNOWN, THROWS = 0, 2, 4, 6
"""Of THROWS darts the first ones tell nothing of the spread yet."""
OWN = THROWS + 3
"""Darts that the graph throws by itself: practice, the one that a plain client asks for, and two
of a leg.
"""


@pytest.fixture(scope="module", autouse=True)
def _soon_known(tmp_path_factory):
    """The spread is estimated from a few darts on, not from ten: for nodes and process alike."""
    folder = tmp_path_factory.mktemp("config")
    (folder / "skills").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        settings = re.sub(
            r"(?m)^least: \d+", f"least: {UNKNOWN}", (CONFIG / "skills" / "darts.yaml").read_text()
        )
        (folder / "skills" / "darts.yaml").write_text(settings)
        patch.setenv("DART_SKILL_CONFIG", str(folder))
        yield


@pytest.fixture(scope="module")
def skill(_soon_known):
    one = load_skill("darts")
    assert one.settings.least == UNKNOWN
    return one


@pytest.fixture(scope="module")
def in_process(_soon_known):
    """The same lessons and throws without nodes."""
    return arm_darts.run(SEED, THROWS, SHOWN)


def taught(make, skill, layout):
    """A graph that was shown how to hit a board, and has learned it."""
    graph, client = make(layout, SEED, skill="darts")
    lessons = [
        client.show(conversions.situation_msg(one))
        for one in skill.draws(np.random.default_rng([SEED, 7]), SHOWN)
    ]
    assert all(lesson.success for lesson in lessons), [lesson.message for lesson in lessons]
    graph.client, graph.learned = client, client.learn()
    graph.first = plan_for(graph, skill, "T20")
    return graph


def plan_for(graph, skill, bed):
    """What the learner plans for a bed."""
    request = Plan.Request(
        header=Header(frame_id="world"),
        situation=conversions.situation_msg(skill.aimed(as_target(bed))),
    )
    return graph.client.call(
        graph.client.node.create_client(Plan, "/skill_learner/plan"), request
    ).plan


@pytest.fixture(scope="module")
def graph(ros, tmp_path_factory, skill):
    """Taught, with what came of a practice; its nodes go on. Throws at baskets and reaches tell
    that another layout does the same.
    """
    folder = tmp_path_factory.mktemp("darts")
    with graphs(folder) as make:
        made = taught(make, skill, "composed")
        made.result, made.darts, made.agent = own_darts(made.client, skill, THROWS)
        made.bag = folder / "bag_1"
        yield made


def test_nodes_throw_the_darts_that_one_process_throws_to_the_last_bit(graph, in_process):
    names = ("aim", "hit", "score", "covariance")
    found, expected = (
        [[getattr(dart, name) for name in names] for dart in darts]
        for darts in (graph.darts, in_process.darts)
    )
    assert found == expected
    np.testing.assert_array_equal(
        [dart.expected for dart in graph.darts], [dart.expected for dart in in_process.darts]
    )
    assert graph.result.learned == THROWS


def test_the_aim_follows_the_spread_and_the_coach_says_so_when_it_jumps(graph):
    darts = graph.darts
    assert [name_at(dart.aim) for dart in darts[:UNKNOWN]] == ["DB"] * UNKNOWN, (
        "nothing is known of the spread yet"
    )
    assert np.isfinite(darts[-1].expected) and darts[-1].covariance[0][0] > 0.0


def test_a_plan_says_which_skill_it_is_of(graph):
    assert graph.first.skill == "darts" and list(graph.first.situation.names) == ["right", "up"]


def test_a_plain_client_has_a_bed_aimed_at_in_a_world_that_runs(graph, skill):
    client = graph.client
    client.call(client.node.create_client(Reset, "/simulation/reset"), Reset.Request())
    client.call(
        client.node.create_client(SetBool, "/simulation/pause"), SetBool.Request(data=False)
    )
    action = ActionClient(client.node, Execute, "/execute")
    aim = 1e-3 * as_target("T20")
    goal = Execute.Goal(situation=SituationMsg(names=["right", "up"], numbers=aim.tolist()))
    handle = client.wait(action.send_goal_async(goal), "the answer")
    result = client.wait(handle.get_result_async(), "the dart").result
    assert result.code == Execute.Goal.OUTCOME_EXECUTED, result.message
    hit = skill.face.on_board(conversions.seen_at(result.outcome, conversions.LANDING))
    assert np.linalg.norm(hit - 1e3 * aim) < 60.0 and result.outcome.error == pytest.approx(
        1e-3 * np.linalg.norm(hit - 1e3 * aim)
    )
    assert result.outcome.skill == "darts" and result.outcome.success


@pytest.mark.parametrize(
    ("situation", "why"),
    [
        (
            SituationMsg(names=["rigth"], numbers=[0.1]),
            "names the number 'rigth', which 'darts' does not have: it has only right, up",
        ),
        (
            SituationMsg(bodies=["bucket"], poses=[Pose()]),
            "names the body 'bucket', which 'darts' does not have",
        ),
        (SituationMsg(names=["right"], numbers=[float("nan")]), "the number right is nan"),
        (
            SituationMsg(names=["up"], numbers=[103.0]),
            "103.000 m up from the bull: that is not on the board",
        ),
    ],
)
def test_an_aim_that_is_none_is_refused_with_the_reason(graph, situation, why):
    request = Plan.Request(header=Header(frame_id="world"), situation=situation)
    response = graph.client.call(
        graph.client.node.create_client(Plan, "/skill_learner/plan"), request, may_refuse=True
    )
    assert not response.success
    pytest.raises(ValueError, _raise, response.message).match(why)


def _raise(text):
    raise ValueError(text)


def test_a_board_stays_where_it_hangs(graph):
    reset = graph.client.node.create_client(Reset, "/simulation/reset")
    response = graph.client.call(
        reset,
        Reset.Request(situation=conversions.at_place([2.4, 0.0, 1.7], "board")),
        may_refuse=True,
    )
    assert not response.success and "the board hangs where it is" in response.message


def test_a_leg_is_played_with_the_spread_that_is_known(graph, skill, monkeypatch):
    monkeypatch.setattr("dart_skill.session._darts.MOST_DARTS", 2)
    leg = play_leg(graph.agent, partial(throw_dart, graph.client, skill), print)
    assert [dart.before for dart in leg.darts] == [
        501,
        501 - leg.darts[0].points,
    ] and not leg.finished
    assert 9.0 < leg.expected < 60.0 and "not finished after 2 darts" in leg.in_words


def test_the_bag_teaches_the_same_without_nodes(graph, skill, tmp_path, capsys):
    """Last: its nodes must have ended."""
    graph.stop()
    learner, lesson = learn_skill(graph.bag, skill)
    assert not lesson.left_out and len(lesson.learned_from) == SHOWN
    again = learner.plan(skill.aimed(as_target("T20"))).plan
    # a message has the aim as right and up from the bull, whose last bit is another one than that
    # of the point
    told = throw_plan_msg(again, skill)
    assert same_plan(
        conversions.throw_plan(told, skill), conversions.throw_plan(graph.first, skill)
    )
    assert main(["learn", str(graph.bag), "--output", str(tmp_path / "darts.npz")]) == 0
    assert f"learned 'darts' from {SHOWN} demonstrations; " in capsys.readouterr().out
    assert main(["report", str(graph.bag), "--output", str(tmp_path / "report.html")]) == 0
    assert (
        f"darts: {SHOWN} demonstrations, {OWN} movements of the arm's own"
        in capsys.readouterr().out
    )
    page = (tmp_path / "report.html").read_text()
    assert (
        all(one in page for one in lesson.learned_from)
        and "What became of trials is not in a bag" in page
    )
