"""Bags of the running graph: recorded whole, played again as they were recorded, and not lost with
the process that wrote them.
"""

import json
import random
import resource
import signal
import time

import numpy as np
import pytest
from dart_skill_msgs.srv import Plan, Step
from mcap_ros2.reader import read_ros2_messages
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import String
from std_srvs.srv import SetBool

from dart_skill.arm import same_plan
from dart_skill.recording import BagReader, read_demonstrations, type_hash, types_for
from dart_skill.recording.bags import recover
from dart_skill.session import learn_from_bag
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.raw_batches import RawBatches
from dart_skill_nodes.process.graph_processes import GraphFailure
from tests.integration.conftest import Diagnoses, graphs, plan_request, wait_for, wait_for_end
from tests.recorded_session import same
from tests.texts import TEXT, write_texts

TARGET = np.array([1.9, -0.1, 0.4])
POSES = [f"/vrpn_mocap/{body}/pose" for body in ("hand", "ball", "basket")]
STATES = 1000
"""That are recorded of each topic at least: two seconds."""
STEPPED = {
    "/joint_states": 2_000_000,
    "/wam/command": 2_000_000,
    "/wam/tool_pose": 2_000_000,
} | dict.fromkeys(POSES, 10_000_000)


class Listener:
    """Everything that comes on some topics, as bytes."""

    def __init__(self, client, topics):
        self._coach, self._spin, self.heard = client, client.spin, {topic: [] for topic in topics}
        self._ears = RawBatches(client.node)
        for topic in topics:
            self._ears.listen(topic)
        client.spin = self._take

    def _take(self):
        self._spin()
        for one in self._ears.take():
            self.heard[one.topic].append(one.data)

    @property
    def count(self):
        return sum(map(len, self.heard.values()))

    def close(self):
        self._coach.spin = self._spin
        self._ears.close()


@pytest.fixture(scope="module")
def recorded(ros, tmp_path_factory):
    """A bag of everything that a graph said for some thousand steps."""
    folder = tmp_path_factory.mktemp("recorded")
    with graphs(folder) as make:
        graph, client = make(None)
        graph.start(
            "composed", {"bag": str(folder / "shown"), "dropout_rate": 0.0, "rest_after": 0.0}
        )
        graph.start(
            "recorder", {"bag": str(folder / "bag"), "use_sim_time": True, "notes": "[seed=0]"}
        )
        diagnoses = Diagnoses(client)
        # Each topic is recorded from when it was discovered, the last one long after the first on
        # a busy machine.
        wanted = {
            topic: STATES * STEPPED["/joint_states"] // period for topic, period in STEPPED.items()
        }

        def are_there():
            counts = diagnoses.values.get("recorder", {})
            return all(int(counts.get(topic, 0)) > count for topic, count in wanted.items())

        wait_for(client, are_there, what=f"{STATES} recorded states")
        lost = {k: v for k, v in diagnoses.values["recorder"].items() if "lost" in k}
        assert set(lost) <= {"lost", "/clock lost"}, lost
    return folder / "bag"


def test_the_recorder_misses_nothing_and_says_so(recorded):
    with BagReader(recorded) as bag:
        assert set(json.loads(bag.custom_data["lost"])) <= {"/clock"}, "best effort may lose some"
        assert bag.custom_data["seed"] == "0"
        for topic, period in STEPPED.items():
            stamps = np.array(
                [conversions.leading_stamp_ns(m.data) for m in bag.messages([topic], decode=False)]
            )
            stamps = np.unique(stamps)  # a state that nobody answered yet is published again
            assert len(stamps) > STATES * 2_000_000 // period and set(np.diff(stamps)) == {
                period
            }, topic
        logged = [m.stamp_ns for m in bag.messages(decode=False)]
        assert logged == sorted(logged)


def test_log_times_are_those_of_the_simulation(recorded):
    with BagReader(recorded) as bag:
        behind = [
            m.stamp_ns - conversions.leading_stamp_ns(m.data)
            for m in bag.messages(["/joint_states"], decode=False)
        ]
    assert np.median(behind) == 0 and np.quantile(np.abs(behind), 0.9) <= 20_000_000


def test_quality_of_service_and_types_are_those_of_the_publishers(recorded):
    with BagReader(recorded) as bag:
        for name, type_name in {
            "/joint_states": "sensor_msgs/msg/JointState",
            "/wam/command": "dart_skill_msgs/msg/WamCommand",
        }.items():
            topic = bag.topics[name]
            assert (topic.type_name, topic.type_hash) == (
                type_name,
                type_hash(types_for(type_name), type_name),
            )
            assert topic.qos[0].reliability.name == "RELIABLE"
        assert bag.topics["/clock"].qos[0].reliability.name == "BEST_EFFORT"
        assert bag.topics["/robot_description"].qos[0].durability.name == "TRANSIENT_LOCAL"


def test_viewers_find_the_arm_its_description_and_its_transforms(recorded):
    """Read by somebody else's decoder, which knows none of our types but by the bag."""
    (file,) = recorded.glob("*.mcap")
    topics = ["/robot_description", "/tf", "/tf_static"]
    messages = {topic: [] for topic in topics}
    for message in read_ros2_messages(str(file), topics=topics):
        messages[message.channel.topic].append(message.ros_msg)
    assert "<robot" in messages["/robot_description"][0].data
    edges = {
        (t.header.frame_id, t.child_frame_id)
        for topic in ("/tf", "/tf_static")
        for m in messages[topic]
        for t in m.transforms
    }
    links = ["world", "wam_base", *(f"wam_link{k}" for k in range(1, 8)), "bhand_base"]
    assert set(zip(links, links[1:], strict=False)) <= edges
    assert {("world", body) for body in ("hand", "ball", "basket")} <= edges
    for name in links[1:]:
        assert f'<link name="{name}">' in messages["/robot_description"][0].data


def test_a_bag_plays_as_it_was_recorded(recorded, make_graph):
    graph, client = make_graph(None)
    listener = Listener(client, STEPPED)
    graph.start(
        "bag_player",
        {"bag": str(recorded), "rate": 4.0, "commands": True, "awaited": f"[{','.join(STEPPED)}]"},
    )
    player = wait_for_end(graph, client, "bag_player")
    client.spin()
    listener.close()
    assert player.returncode == 0
    with BagReader(recorded) as bag:
        for topic, heard in listener.heard.items():
            expected = [bytes(m.data) for m in bag.messages([topic], decode=False)]
            assert heard == expected, f"{topic}: {len(heard)} of {len(expected)}"


def test_topics_are_offered_as_they_were_recorded(recorded, make_graph):
    graph, client = make_graph(None)
    graph.start("bag_player", {"bag": str(recorded), "start_paused": True})
    wanted = {
        "/joint_states": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
        "/clock": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
        "/robot_description": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
    }
    for topic, policies in wanted.items():
        wait_for(
            client,
            lambda topic=topic: client.node.get_publishers_info_by_topic(topic),
            what=f"a publisher of {topic}",
        )
        (offer,) = (info.qos_profile for info in client.node.get_publishers_info_by_topic(topic))
        assert (offer.reliability, offer.durability) == policies, topic


def test_the_clock_of_a_bag_is_played_and_made_where_it_has_none(recorded, make_graph):
    for clock, period_ns in (("/clock", 2_000_000), ("nothing", 40_000_000)):
        graph, client = make_graph(None)
        listener = Listener(client, ["/clock"])
        wanted = {
            "topics": f"[/vrpn_mocap/.*,{clock}]",
            "duration": 2.0,
            "loop": True,
            "clock_rate": 25.0,
            "awaited": "[/clock]",
        }
        graph.start("bag_player", {"bag": str(recorded), **wanted})
        # The clock is best effort: nobody repeats what was said before the listener's side of the
        # discovery was over.
        wait_for(client, lambda listener=listener: listener.count >= 30, what="30 ticks")
        listener.close()
        graph.stop()
        steps = np.diff([conversions.leading_stamp_ns(data) for data in listener.heard["/clock"]])
        # a state that nobody answered yet was published again, and its time with it
        assert np.median(steps) == period_ns and (steps < 0).sum() <= 1, (
            "it goes back once in a round at most"
        )


@pytest.fixture(scope="module")
def without_nodes(recorded_session):
    """What the recorded session teaches without ROS, and what that was learned from."""
    return learn_from_bag(recorded_session[0])


@pytest.mark.parametrize("rate", [pytest.param(5.0, marks=pytest.mark.slow), 0.0])
def test_a_bag_teaches_through_the_nodes_what_it_teaches_without(
    make_graph, recorded_session, without_nodes, tmp_path, rate
):
    """From raw poses to a model, at any rate: to the last bit."""
    (bag, taught, _), (expected, report) = recorded_session, without_nodes
    graph, client = make_graph(None)
    graph.start("skill_learner")
    graph.start("demonstration_recorder", {"bag": str(tmp_path / "again"), "automatic": True})
    inputs = ["/joint_states", "/wam/command", "/wam/teacher_wrench", *POSES]
    played = {
        "topics": f"[{','.join(inputs)}]",
        "awaited": f"[{','.join(inputs)}]",
        "clock_rate": 0.0,
    }
    graph.start("bag_player", {"bag": str(bag), "rate": rate, "commands": True, **played})
    wait_for_end(graph, client, "bag_player")
    learned = client.learn(at_least=len(taught))
    assert (learned.demonstrations, learned.model_id) == (len(taught), expected.skill.model_id)
    ask = client.node.create_client(Plan, "/skill_learner/plan")
    plan = client.call(ask, plan_request(TARGET)).plan
    assert same_plan(conversions.throw_plan(plan), expected.plan(TARGET))
    graph.stop()
    for one, other in zip(
        read_demonstrations(tmp_path / "again"), report.learned_from, strict=True
    ):
        assert same(one, other) == []


@pytest.fixture
def texts(tmp_path):
    """A bag of a hundred numbered texts, one each hundredth of a second."""
    return write_texts(tmp_path / "texts")


def numbers(listener, topic="/said"):
    return [
        int(types_for(TEXT).deserialize_cdr(data, TEXT).data) for data in listener.heard[topic]
    ]


def test_a_paused_bag_is_stepped_and_goes_on_at_another_rate(texts, make_graph):
    graph, client = make_graph(None)
    listener = Listener(client, ["/said"])
    graph.start(
        "bag_player",
        {"bag": str(texts), "start_paused": True, "awaited": "[/said]", "clock_rate": 0.0},
    )
    step = client.node.create_client(Step, "/bag_player/step")
    pause = client.node.create_client(SetBool, "/bag_player/pause")
    for steps in (1, 3):
        client.call(step, Step.Request(steps=steps))
    wait_for(client, lambda: listener.count >= 4, what="four steps")
    client.set_parameters("/bag_player", {"rate": 3.0})
    assert numbers(listener) == [0, 1, 2, 3]
    player = graph.processes.pop("bag_player")
    client.call(pause, SetBool.Request(data=False))
    wait_for(client, lambda: player.poll() is not None, what="the end of the bag")
    assert numbers(listener) == list(range(100))
    listener.close()


def test_playing_begins_when_every_awaited_topic_is_heard(tmp_path, make_graph):
    bag = write_texts(tmp_path / "two", ("/said", "/sung"))
    graph, client = make_graph(None)
    diagnoses, first = Diagnoses(client), Listener(client, ["/said"])
    graph.start(
        "bag_player",
        {"bag": str(bag), "rate": 0.0, "awaited": "['/s.*g', '/said']", "clock_rate": 0.0},
    )
    waits = "waiting for a subscriber of /sung"
    wait_for(
        client,
        lambda: diagnoses.of.get("bag_player") == waits,
        what="the player waits for the other topic",
    )
    assert first.count == 0
    second = Listener(client, ["/sung"])
    wait_for_end(graph, client, "bag_player")
    second.close()
    first.close()
    assert numbers(first) == numbers(second, "/sung") == list(range(100))


def test_a_loop_goes_on_until_it_is_ended(texts, make_graph):
    graph, client = make_graph(None)
    listener = Listener(client, ["/heard"])
    wanted = {
        "remap": "[/said=/heard]",
        "start": 0.5,
        "duration": 0.1,
        "loop": True,
        "awaited": "[/heard]",
    }
    graph.start("bag_player", {"bag": str(texts), **wanted})
    wait_for(client, lambda: listener.count >= 33, what="three rounds")
    assert numbers(listener, "/heard")[:33] == [*range(50, 61)] * 3
    graph.stop()
    listener.close()


def test_bags_of_others_and_bags_without_metadata_play(texts, tmp_path, make_graph):
    (texts / "metadata.yaml").unlink()
    foreign = tmp_path / "foreign"
    types = types_for(TEXT)
    with Writer(foreign, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/said", TEXT, typestore=types)
        for k in range(100):
            writer.write(
                connection, 10_000_000 * k, types.serialize_cdr(types.types[TEXT](str(k)), TEXT)
            )
    for bag in (texts, foreign):
        graph, client = make_graph(None)
        listener = Listener(client, ["/said"])
        graph.start("bag_player", {"bag": str(bag), "rate": 10.0, "awaited": "[/said]"})
        wait_for_end(graph, client, "bag_player")
        assert numbers(listener) == list(range(100)), bag
        listener.close()


def test_a_bag_that_is_not_there_ends_the_player_with_a_reason(make_graph):
    """What else cannot be played: test_bag_play.py, through the command."""
    graph, client = make_graph(None)
    graph.start("bag_player", {"bag": "nowhere"})
    player = wait_for_end(graph, client, "bag_player")
    assert player.returncode == 1
    log = (graph.logs / "bag_player.log").read_text()
    assert "nowhere: no such bag" in log and "Traceback" not in log


@pytest.mark.slow
def test_a_recorder_that_is_killed_loses_at_most_the_last_second(make_graph, tmp_path):
    graph, client = make_graph(None)
    graph.start("composed", {"bag": str(tmp_path / "throws"), "rest_after": 0.0})
    graph.start("recorder", {"bag": str(tmp_path / "bag"), "use_sim_time": False})
    diagnoses = Diagnoses(client)
    wait_for(
        client,
        lambda: int(diagnoses.values.get("recorder", {}).get("/joint_states", 0)) > 2000,
        what="2000 recorded states",
    )
    recorder = graph.processes.pop("recorder")
    recorder.kill()
    recorder.wait()
    # What diagnostics had counted by then was said up to a second before the end, and is flushed
    # every second.
    before = int(diagnoses.values["recorder"]["/joint_states"])
    rescued = recover(tmp_path / "bag", tmp_path / "rescued")
    with BagReader(tmp_path / "rescued") as bag:
        assert bag.topics["/joint_states"].count == rescued.messages["/joint_states"]
        times = [m.stamp_ns for m in bag.messages(["/joint_states"], decode=False)]
    assert len(times) > 0 and before - len(times) < np.sum(
        np.array(times) > times[-1] - 2_000_000_000
    )


def test_what_a_recorder_that_is_held_up_never_got_is_counted(make_graph, tmp_path):
    """Its publisher repeats the last five messages only, and the shared memory has no room for so
    many.
    """
    (graph, client), ballast = make_graph(None), 20_000 * " "
    said, total = client.node.create_publisher(String, "/said", 5), 0
    graph.start("recorder", {"bag": str(tmp_path / "bag"), "topics": "[/said]"})
    diagnoses = Diagnoses(client)

    def say(condition, what):
        nonlocal total
        until = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < until, what
            said.publish(String(data=f"{total}{ballast}"))
            total += 1
            client.spin()

    def recorded():
        return int(diagnoses.values.get("recorder", {}).get("/said", 0))

    say(lambda: recorded() > 0, "no message was recorded")
    recorder = graph.processes["recorder"]
    recorder.send_signal(signal.SIGSTOP)
    for _ in range(500):
        said.publish(String(data=f"{total}{ballast}"))
        total += 1
    recorder.send_signal(signal.SIGCONT)
    before = recorded()
    say(lambda: recorded() > before + 20, "no message was recorded afterwards")
    assert said.wait_for_all_acked(Duration(seconds=20))
    graph.stop()
    with BagReader(tmp_path / "bag") as bag:
        heard = [
            int(types_for(TEXT).deserialize_cdr(m.data, TEXT).data)
            for m in bag.messages(["/said"], decode=False)
        ]
        lost = json.loads(bag.custom_data["lost"])["/said"]
    assert heard == sorted(heard) and heard[-1] == total - 1
    assert lost == heard[-1] - heard[0] + 1 - len(heard) and 0 < lost <= 500


@pytest.mark.parametrize("limit", [{"max_megabytes": 1.0}, {"max_minutes": 0.01}])
def test_a_recording_goes_on_in_another_file(make_graph, tmp_path, limit):
    graph, client = make_graph(None)
    said, texts, draw = client.node.create_publisher(String, "/said", 50), [], random.Random(0)
    graph.start("recorder", {"bag": str(tmp_path / "bag"), "topics": "[/said]", **limit})
    while len(files := list((tmp_path / "bag").glob("*.mcap"))) < 3:
        assert len(texts) < 3000, f"{len(files)} files after {len(texts)} messages"
        texts.append(draw.randbytes(50_000).hex())
        said.publish(String(data=texts[-1]))
        client.spin()
    assert said.wait_for_all_acked(Duration(seconds=20))
    graph.stop()
    with BagReader(tmp_path / "bag") as bag:
        heard = [
            types_for(TEXT).deserialize_cdr(m.data, TEXT).data
            for m in bag.messages(["/said"], decode=False)
        ]
    assert heard and heard == texts[-len(heard) :]


def test_a_full_disk_stops_the_recording_not_the_graph(make_graph, tmp_path):
    graph, client = make_graph(None)
    said, draw = client.node.create_publisher(String, "/said", 50), random.Random(0)
    graph.start("recorder", {"bag": str(tmp_path / "bag"), "topics": "[/said]"})
    diagnoses = Diagnoses(client)

    def goes_on(condition):
        for _ in range(40):
            said.publish(String(data=draw.randbytes(1000).hex()))
        return condition()

    def recorded():
        return int(diagnoses.values.get("recorder", {}).get("/said", 0))

    wait_for(client, lambda: goes_on(lambda: recorded() > 500), what="500 recorded messages")
    recorder = graph.processes["recorder"]
    written = (tmp_path / "bag" / "bag_0.mcap").stat().st_size
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (written + 300_000,) * 2)
    told = lambda: "bag_0.mcap" in diagnoses.of.get("recorder", "")  # noqa: E731
    wait_for(client, lambda: goes_on(told), what="the recorder says that it cannot write")
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(20) == 0
    graph.processes.pop("recorder")
    rescued = recover(tmp_path / "bag", tmp_path / "rescued")
    assert rescued.messages["/said"] > 500


def test_a_recorder_that_cannot_start_says_why(make_graph, tmp_path):
    graph, client = make_graph(None)
    graph.start("recorder", {"bag": str(tmp_path), "topics": "['(']"})
    wait_for_end(graph, client, "recorder")
    assert (
        "not configured: topics: '(' is no regular expression: missing )"
        in (graph.logs / "recorder.log").read_text()
    )


def test_a_rate_below_zero_is_refused_while_a_bag_plays(texts, make_graph):
    graph, client = make_graph(None)
    graph.start("bag_player", {"bag": str(texts), "start_paused": True})
    with pytest.raises(GraphFailure, match="does not take rate = -1.0"):
        client.set_parameters("/bag_player", {"rate": -1.0})
