"""A number of the world is changed in one place, config/world.yaml, and changes for all: nodes,
judge, bag and library.
"""

import shutil

import numpy as np
import pytest
import yaml
from dart_skill_msgs.msg import SimulationState
from dart_skill_msgs.srv import Judge
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import GetParameters

from dart_skill.common.regions import targets_for
from dart_skill.common.world import pose_topic
from dart_skill.recording import BagReader, read_demonstrations
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.qos import FRAMES
from tests.integration.conftest import graphs, teach_and_learn
from tests.paths import CONFIG

RADIUS, BODY = 0.25, "bucket"
SHOWN, (TARGET,) = targets_for(0, 2, 1)
WITH_A_BASKET = ("wam_simulator", "mock_optitrack", "demonstration_recorder")


@pytest.fixture(scope="module")
def graph(ros, tmp_path_factory):
    """The graph in a world whose basket is wider and is called a bucket."""
    folder = tmp_path_factory.mktemp("one_world")
    config = shutil.copytree(CONFIG, folder / "config")
    world = yaml.safe_load((config / "world.yaml").read_text())
    world["/**"]["ros__parameters"] |= {"basket_radius": RADIUS, "basket_body": BODY}
    (config / "world.yaml").write_text(yaml.safe_dump(world))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DART_SKILL_CONFIG", str(config))
        with graphs(folder) as make:
            graph, client = make("composed")
            graph.client, graph.bag, graph.learned = (
                client,
                folder / "bag_1",
                teach_and_learn(client, SHOWN),
            )
            yield graph


def test_every_node_has_the_new_numbers(graph):
    for node in WITH_A_BASKET:
        client = graph.client.node.create_client(GetParameters, f"/{node}/get_parameters")
        graph.client.reach(client)
        asked = client.call_async(GetParameters.Request(names=["basket_radius"]))
        assert graph.client.wait(asked, node).values[0].double_value == RADIUS, node


@pytest.fixture(scope="module")
def throw(graph):
    """What a throw came to, the states of the simulator, and the poses of the ball."""
    states, poses = [], []
    graph.client.node.create_subscription(SimulationState, "/simulation/state", states.append, 500)
    graph.client.node.create_subscription(PoseStamped, pose_topic("ball"), poses.append, FRAMES)
    return graph.client.throw(TARGET), states, poses


def test_the_arm_learns_and_throws_in_it(throw):
    thrown, states, _ = throw
    assert thrown.code == 1, thrown.message
    assert thrown.outcome.seen and thrown.outcome.success and states[-1].success


def test_the_one_that_judges_takes_the_new_radius(graph, throw):
    """A ball that was last seen 0.2 m from the middle is in this basket, and would not be in the
    usual one.
    """
    thrown, _, poses = throw
    judge = graph.client.node.create_client(Judge, "/demonstration_recorder/judge")
    graph.client.reach(judge)
    last = conversions.vector(poses[-1].pose.position) * [1.0, 1.0, 0.0] + [0.0, 0.0, TARGET[2]]
    for aside, inside in ((0.20, True), (0.30, False)):
        beside = Judge.Request(
            situation=conversions.at_place(last + [0.0, aside, 0.0]),
            told=thrown.outcome.header.stamp,
        )
        assert graph.client.call(judge, beside).outcome.success == inside


def test_topics_and_bag_have_the_new_name(graph):
    names = {name for name, _ in graph.client.node.get_topic_names_and_types()}
    assert f"/vrpn_mocap/{BODY}/pose" in names and "/vrpn_mocap/basket/pose" not in names
    graph.stop()  # closes the bag
    with BagReader(graph.bag) as bag:
        assert (
            bag.topics[f"/vrpn_mocap/{BODY}/pose"].count
            and "/vrpn_mocap/basket/pose" not in bag.topics
        )
    assert np.shape([one.target for one in read_demonstrations(graph.bag)]) == (len(SHOWN), 3)
    assert graph.learned.demonstrations == len(SHOWN)
