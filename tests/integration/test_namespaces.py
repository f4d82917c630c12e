"""Arms in one ROS domain, each graph in a namespace of its own: they teach, learn, throw, record
and are seen side by side.

There are two, which do all that four do: of a step, four graphs need twice the processor time that
two need. Four are tried with the slow tests.
"""

import re
import signal
import subprocess

import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from dart_skill.common.permissions import policy
from dart_skill.common.regions import targets_for
from dart_skill.recording import BagReader, GraphBag, read_demonstrations
from dart_skill_nodes.client.graph_listener import GraphListener
from dart_skill_nodes.comms.qos import LATCHED
from dart_skill_nodes.process.graph_processes import NODES, NODES_OF
from tests.integration.conftest import (
    endpoints_of_processes,
    graphs,
    start_throw,
    teach_and_learn,
    wait_for,
)
from tests.integration.test_viewer import address_of
from tests.paths import ROOT
from tests.policies import allowed, may
from tests.view_client import PageClient

ARMS = ("/arm1", "/arm2", "/arm3", "/arm4")
TAUGHT, SEEN = ARMS[0], ARMS[:2]
"""The one that learns from what it was shown, the others from a recording; and those that a viewer
shows.
"""
SHOWN, TARGETS = targets_for(0, 2, len(ARMS))
RESTS = {"composed": {"rest_after": 0.5}}
"""Worlds that run on while nobody looks take all cores."""
RECORDED = ROOT / "bags" / "demonstrations"
GLOBAL = {"/diagnostics", "/parameter_events", "/rosout", "/tf", "/tf_static"}


class Frames:
    """The parent of each frame that was told, by the child's name."""

    def __init__(self, node):
        self._node, self.parents = node, {}
        qualities = {"/tf": 1000, "/tf_static": LATCHED}
        self._heard = [
            node.create_subscription(TFMessage, topic, self._take, qos)
            for topic, qos in qualities.items()
        ]

    def _take(self, message):
        self.parents.update(
            {one.child_frame_id: one.header.frame_id for one in message.transforms}
        )

    def close(self):
        for subscription in self._heard:
            self._node.destroy_subscription(subscription)


def frames_of(arms):
    """Names of some frames of each arm."""
    return {f"{space[1:]}/{name}" for space in arms for name in ("wam_base", "wam_link7", "ball")}


@pytest.fixture(
    scope="module",
    params=[2, pytest.param(len(ARMS), marks=pytest.mark.slow)],
    ids=["two", "four"],
)
def arms(ros, tmp_path_factory, request):
    """By namespace a client, what was learned, the bag, and how many throws it was shown; all
    graphs run.
    """
    folder, made = tmp_path_factory.mktemp("arms"), {}
    with graphs(folder) as make:
        for number, space in enumerate(ARMS[: request.param]):
            made[space], client = make(None, namespace=space)
            made[space].client, made[space].bag = client, folder / f"bag_{number}"
            made[space].start_all("composed", number, made[space].bag, RESTS)
        made[ARMS[0]].frames = Frames(made[ARMS[0]].client.node)
        for space, graph in made.items():
            graph.client.wait_until_ready()
            graph.shown = len(SHOWN) if space == TAUGHT else 0
            graph.learned = (
                teach_and_learn(graph.client, SHOWN)
                if graph.shown
                else graph.client.learn(bag=str(RECORDED))
            )
        yield made


@pytest.fixture(scope="module")
def thrown(arms):
    """What came of a throw of each arm, all at once."""
    under_way = [
        start_throw(graph.client, target)[0]
        for graph, target in zip(arms.values(), TARGETS, strict=False)
    ]
    outcomes = [
        graph.client.wait(result, "the throw").result.outcome
        for graph, result in zip(arms.values(), under_way, strict=True)
    ]
    first, frames = arms[ARMS[0]].client, arms[ARMS[0]].frames
    wanted = frames_of(arms)
    wait_for(
        first,
        lambda: wanted <= set(frames.parents),
        what=lambda: f"a word of the frames {sorted(wanted - set(frames.parents))}",
    )
    frames.close()
    return outcomes


def test_all_throw_at_once(arms, thrown):
    for space, outcome in zip(arms, thrown, strict=True):
        assert outcome.seen and outcome.success, f"{space}: {outcome.error:.3f} m"


def test_each_viewer_shows_its_own_arm(arms, thrown):
    """By the basket, which stands elsewhere for each since their throws, and by whom the panel
    tells of.
    """
    for space in SEEN:
        arms[space].start("viewer", {"port": 0})
    try:
        for space, target in zip(SEEN, TARGETS, strict=False):
            graph = arms[space]
            with PageClient(address_of(graph, graph.client)) as page:
                page.wait_for(
                    lambda: "/basket" in page.places,
                    60.0,
                    f"the basket of {space}",
                    graph.client.spin,
                )
                assert np.linalg.norm(page.places["/basket"] - target) < 0.02, (
                    f"{space}: {page.places['/basket']}, not {target}"
                )
                page.wait_for(
                    lambda: page.says("wam_simulator"),
                    60.0,
                    f"the nodes of {space}",
                    graph.client.spin,
                )
                page.wait_for(
                    lambda: "/cameras/all" in page.nodes,
                    60.0,
                    f"the cameras of {space}",
                    graph.client.spin,
                )
                assert not any(page.says(other[1:]) for other in arms if other != space), (
                    f"the page of {space} tells of another arm"
                )
                if space != TAUGHT:
                    page.wait_for(
                        lambda: not page.is_disabled("Teach"),
                        60.0,
                        "the buttons",
                        graph.client.spin,
                    )
                    page.set("Lessons", 1)
                    page.click("Teach")
                    page.wait_for(
                        lambda: page.says("1 of 1 demonstrations shown"),
                        120.0,
                        "a lesson from the page",
                        graph.client.spin,
                    )
                    graph.shown += 1
        assert {("viewer", space) for space in SEEN} <= set(nodes_of(arms)) and not outside(arms)
    finally:
        for space in SEEN:
            viewer = arms[space].processes.pop("viewer")
            viewer.send_signal(signal.SIGINT)
            viewer.wait(30.0)


def nodes_of(arms):
    """Name and namespace of each node of the arms."""
    return [
        (name, space)
        for name, space in arms[ARMS[0]].client.node.get_node_names_and_namespaces()
        if space in arms
    ]


def outside(arms):
    """Names of topics and services of the arms' nodes that are in no namespace, but for those that
    all graphs share.
    """
    node: Node = arms[ARMS[0]].client.node
    offered = (
        node.get_publisher_names_and_types_by_node,
        node.get_subscriber_names_and_types_by_node,
        node.get_service_names_and_types_by_node,
        node.get_client_names_and_types_by_node,
    )
    names = {name for one in nodes_of(arms) for of in offered for name, _ in of(*one)}
    return {
        name for name in names if not name.startswith(tuple(f"{space}/" for space in arms))
    } - GLOBAL


def test_no_name_is_outside_the_namespaces(arms):
    ours = nodes_of(arms)
    assert {space for _, space in ours} == set(arms) and len(ours) >= len(arms) * len(NODES)
    assert not outside(arms)


def test_every_process_does_what_the_policy_of_its_namespace_allows(arms):
    seen = endpoints_of_processes(arms[ARMS[0]].client.node)
    for space in arms:
        allows = allowed(policy(space))
        for process in ("composed", "skill_learner"):
            node = NODES_OF.get(process, (process,))[0]
            for what, may_do in zip(
                seen[space, node], allows[f"/dart_skill{space}/{process}"], strict=True
            ):
                assert not [topic for topic in what if not may(may_do, topic)], (
                    f"{space}/{process}"
                )


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


def test_the_frames_of_all_hang_on_one_world(arms, thrown):
    """As they were told while all threw: a world that rests tells none."""
    parents, ours = arms[ARMS[0]].frames.parents, frames_of(arms)
    assert set(parents) >= ours
    assert {parents[name] for name in ours if name.endswith(("wam_base", "ball"))} == {"world"}
    assert all(
        parent == "world" or parent.split("/")[0] == child.split("/")[0]
        for child, parent in parents.items()
    )


def test_a_second_graph_of_the_same_namespace_is_seen(arms, tmp_path):
    client = arms[ARMS[0]].client
    with pytest.raises(Exception, match=r"wam_simulator on ROS domain \d+ already"):
        client.wait_until_gone(["wam_simulator"], limit=0.5)


def _typed(*words):
    done = subprocess.run(["dart-skill", *words], capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.slow
def test_what_one_types_concerns_one_arm(arms):
    _typed("teach", "--namespace", ARMS[0], "--count", "1")
    arms[ARMS[0]].shown += 1
    for space, graph in arms.items():
        assert _typed("demonstrations", "--namespace", space).count("taught") == graph.shown, space
    status = _typed("status", "--namespace", ARMS[1])
    assert "/arm2/joint_states" in status and "arm1" not in status


def test_a_bag_holds_one_arm_and_is_learned_from(arms):
    for number, (space, graph) in enumerate(arms.items(), start=1):
        graph.stop()  # closes the bag
        with BagReader(graph.bag) as bag, GraphBag(graph.bag) as graph_bag:
            assert all(name.startswith(f"{space}/") for name in bag.topics), f"arm {number}"
            assert set(graph_bag.topics) == {name.removeprefix(space) for name in bag.topics}
            assert graph_bag.namespace == space
        assert len(read_demonstrations(graph.bag)) == graph.shown


@pytest.mark.parametrize("form", ["csv", "lerobot"])
def test_the_bag_of_one_arm_is_converted(arms, form, tmp_path):
    bag, made = str(arms[ARMS[0]].bag), str(tmp_path / form)
    _typed("bag", "convert", bag, "--to", form, "--output", made)
    how = ["--mapping", f"{made}/mapping.yaml"] if form == "csv" else []
    said = _typed("learn", made, *how, "--output", f"{made}.npz")
    assert re.search(f"learned .*from {arms[ARMS[0]].shown} (of|demonstrations)", said)


def test_a_recording_of_one_arm_is_replayed_in_another_namespace(arms, ros, tmp_path):
    bag = arms[ARMS[0]].bag
    heard = []
    with graphs(tmp_path) as make:
        graph, client = make(None, namespace="/again")
        client.node.create_subscription(JointState, "joint_states", heard.append, 10)
        played = subprocess.Popen(
            [
                "dart-skill",
                "bag",
                "play",
                "--namespace",
                "/again",
                str(bag),
                "--rate",
                "0",
                "--wait-for",
                "/again/joint_states",
            ]
        )
        try:
            wait_for(client, lambda: heard, what="a state of the recording")
        finally:
            played.send_signal(signal.SIGINT)
            assert played.wait(60.0) == 0
    assert heard
