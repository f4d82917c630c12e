"""Two arms in one ROS domain, each graph in a namespace of its own: they teach, learn, throw and record side by side."""

import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from dart_skill.recording import BagReader, GraphBag, read_demonstrations
from dart_skill.regions import targets_for
from dart_skill_nodes.client.graph_listener import GraphListener
from dart_skill_nodes.comms.qos import LATCHED

from .conftest import graphs, teach_and_learn

ARMS = ("/arm1", "/arm2")
SHOWN, (TARGET,) = targets_for(0, 3, 1)
GLOBAL = {"/diagnostics", "/parameter_events", "/rosout", "/tf", "/tf_static"}


@pytest.fixture(scope="module")
def arms(ros, tmp_path_factory):
    """By namespace a client, what was learned, and the bag; both graphs run."""
    folder = tmp_path_factory.mktemp("arms")
    with graphs(folder) as make:
        made = {space: make("composed", seed, namespace=space) for seed, space in enumerate(ARMS)}
        for number, (graph, client) in enumerate(made.values(), start=1):
            graph.client, graph.bag, graph.learned = client, folder / f"bag_{number}", teach_and_learn(client, SHOWN)
        yield {space: graph for space, (graph, _) in made.items()}


def test_both_throw_at_once(arms):
    under_way = [graph.client.start_throw(TARGET)[0] for graph in arms.values()]
    for graph, result in zip(arms.values(), under_way, strict=True):
        outcome = graph.client.wait(result, "the throw").result.outcome
        assert outcome.seen and outcome.success, f"{graph.namespace}: {outcome.error:.3f} m"


def test_no_name_is_outside_the_namespaces(arms):
    node: Node = arms[ARMS[0]].client.node
    topics, services = node.get_topic_names_and_types(), node.get_service_names_and_types()
    outside = {name for name, _ in (*topics, *services) if not name.startswith(ARMS) and "/_" not in name}
    assert {name for name in outside if not name.startswith("/coach_")} <= GLOBAL  # clients of the tests before this one


def test_each_hears_of_its_own_nodes_alone(arms):
    client = arms[ARMS[1]].client
    listener = GraphListener(client.node, client.spin)
    try:
        listener.listen(1.5)
        report = listener.report("test")
    finally:
        listener.close()
    assert report.problems == [] and report.namespace == ARMS[1]
    assert [node.name for node in report.nodes] == sorted({node.name for node in report.nodes})
    assert {topic.topic.rsplit("/", 1)[0].split("/")[1] for topic in report.topics} == {"arm2"}


def test_the_frames_of_both_hang_on_one_world(arms):
    node, heard = arms[ARMS[0]].client.node, {}

    def hear(message):
        heard.update({one.child_frame_id: one for one in message.transforms})

    qualities = {"/tf": 100, "/tf_static": LATCHED}
    subscriptions = [node.create_subscription(TFMessage, topic, hear, qos) for topic, qos in qualities.items()]
    wanted = {f"{space[1:]}/{name}" for space in ARMS for name in ("wam_base", "wam_link7", "ball")}
    for graph in arms.values():
        graph.client.start_throw(TARGET)
    while not wanted <= set(heard):
        for graph in arms.values():
            graph.client.spin()
    for subscription in subscriptions:
        node.destroy_subscription(subscription)
    parents = {child: one.header.frame_id for child, one in heard.items()}
    assert {parents[name] for name in wanted if name.endswith(("wam_base", "ball"))} == {"world"}
    assert all(parent == "world" or parent.split("/")[0] == child.split("/")[0] for child, parent in parents.items())


def test_a_second_graph_of_the_same_namespace_is_seen(arms, tmp_path):
    client = arms[ARMS[0]].client
    with pytest.raises(Exception, match=r"wam_simulator on ROS domain \d+ already"):
        client.wait_until_gone(["wam_simulator"], limit=0.5)


def test_a_bag_holds_one_arm_and_is_learned_from(arms):
    for number, (space, graph) in enumerate(arms.items(), start=1):
        graph.stop()  # closes the bag
        with BagReader(graph.bag) as bag, GraphBag(graph.bag) as graph_bag:
            assert all(name.startswith(f"{space}/") for name in bag.topics), f"arm {number}"
            assert set(graph_bag.topics) == {name.removeprefix(space) for name in bag.topics}
            assert graph_bag.namespace == space
        assert len(read_demonstrations(graph.bag)) == len(SHOWN)


def test_a_recording_of_one_arm_is_replayed_in_another_namespace(arms, ros, tmp_path):
    bag = arms[ARMS[0]].bag
    heard = []
    with graphs(tmp_path) as make:
        graph, client = make(None, namespace="/again")
        client.node.create_subscription(JointState, "joint_states", heard.append, 10)
        graph.start("bag_player", {"bag": str(bag), "rate": 0.0, "graph": True, "awaited": ["/again/joint_states"]})
        while not heard:
            client.spin()
    assert heard
