"""`dart-skill bag play`: its options reach the node, its errors have a reason and a status."""

import json
import signal
import subprocess

import pytest
import rclpy
from std_msgs.msg import String

from tests.integration.conftest import wait_for
from tests.integration.test_bags import Listener, numbers
from tests.texts import write_texts


@pytest.fixture
def bag(tmp_path):
    """Fifty numbered texts, one each hundredth of a second, in a folder whose name needs quotes."""
    return write_texts(tmp_path / "a 'bag'", ("/said", "/heard"), 50)


@pytest.fixture
def play():
    """Starts the command; ends what is left."""
    started = []

    def start(*arguments):
        command = ["dart-skill", "bag", "play", *map(str, arguments)]
        started.append(
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        )
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_options_reach_the_player(bag, play, make_graph):
    _, client = make_graph(None)
    listener = Listener(client, ["/new", "/heard"])
    options = [
        "--topics",
        r"/s\w+",
        "--remap",
        "/said:=/new",
        "--start",
        "0.1",
        "--duration",
        "0.2",
        "--rate",
        "2",
        "--wait-for",
        "/new",
    ]
    player = play(bag, *options, "--clock", "0", "--json")
    wait_for(client, lambda: player.poll() is not None, what="the end of the bag")
    client.spin()
    said, progress = player.communicate()
    assert player.returncode == 0 and f"playing {bag}" in progress
    told = json.loads(said)
    assert (
        told["finished"]
        and told["bag"] == str(bag)
        and told["rate"] == 2.0
        and told["topics"] == [r"/s\w+"]
    )
    assert numbers(listener, "/new") == list(range(10, 31)) and listener.heard["/heard"] == []
    listener.close()


def test_a_loop_ends_with_ctrl_c(bag, play, make_graph):
    _, client = make_graph(None)
    listener = Listener(client, ["/said"])
    player = play(bag, "--loop", "--rate", "10", "--json")
    wait_for(client, lambda: listener.count > 120, what="two rounds")
    player.send_signal(signal.SIGINT)
    wait_for(client, lambda: player.poll() is not None, what="the end of the player")
    said, complaint = player.communicate()
    assert (
        player.returncode == 0
        and not json.loads(said)["finished"]
        and "Traceback" not in complaint
    )
    listener.close()


@pytest.fixture
def throw(tmp_path):
    """What stands for a recorded throw: the names are those of an arm."""
    return write_texts(tmp_path / "throw", ("/joint_states", "/wam/command", "/hand/commands"), 50)


def test_commands_are_played_where_they_are_asked_for_and_no_arm_is(throw, play, make_graph):
    _, client = make_graph(None)
    listener = Listener(client, ["/joint_states", "/wam/command", "/hand/commands", "/recorded"])
    for options, heard in (
        (
            ["--wait-for", "/recorded", "--remap", "/wam/command:=/recorded"],
            {"/joint_states", "/recorded"},
        ),
        (
            ["--wait-for", "/joint_states", ".*/commands?", "--commands"],
            {"/joint_states", "/wam/command", "/hand/commands"},
        ),
    ):
        for texts in listener.heard.values():
            texts.clear()
        player = play(throw, "--rate", "10", *options)
        wait_for(
            client, lambda player=player: player.poll() is not None, what="the end of the bag"
        )
        client.spin()
        assert (
            player.returncode == 0
            and {topic for topic, texts in listener.heard.items() if texts} == heard
        ), options
    listener.close()


@pytest.mark.parametrize(
    ("options", "has_states", "complaint"),
    [
        (
            [],
            True,
            (
                " publishes /joint_states: an arm is there. Play without these (--exclude"
                " /joint_states), or end it"
            ),
        ),
        (
            ["--commands", "--exclude", "/joint_states"],
            True,
            "an arm is there. Play without these (--exclude /wam/command /hand/commands)",
        ),
        (["--commands"], False, "driver hears /wam/command, and may move an arm"),
    ],
)
def test_nothing_that_an_arm_would_take_for_its_own_is_played_beside_one(
    throw, play, make_graph, options, has_states, complaint
):
    _, client = make_graph(None)
    driver = rclpy.create_node("driver")
    commands = []
    if has_states:
        driver.create_publisher(String, "/joint_states", 10)
    driver.create_subscription(String, "/wam/command", commands.append, 10)
    player = play(throw, "--loop", *options)
    offered = set()

    def has_ended():
        offered.update(
            one.node_name
            for topic in ("/joint_states", "/wam/command")
            for one in driver.get_publishers_info_by_topic(topic)
        )
        return player.poll() is not None

    wait_for(client, has_ended, what="the end of the player")
    _, told = player.communicate()
    rclpy.spin_once(driver, timeout_sec=0.1)
    driver.destroy_node()
    assert player.returncode == 1 and complaint in told and commands == [], told
    assert "bag_player" not in offered and "playing" not in told, (
        "an arm hears of the player before this has looked for it"
    )


def test_what_the_refusal_names_lets_the_rest_be_played(tmp_path, play, make_graph):
    _, client = make_graph(None)
    bag = write_texts(tmp_path / "bag", ("/joint_states", "/said"), 50)
    driver, listener = rclpy.create_node("driver"), Listener(client, ["/said"])
    driver.create_publisher(String, "/joint_states", 10)
    player = play(bag, "--wait-for", "/said", "--exclude", "/joint_states")
    wait_for(client, lambda: player.poll() is not None, what="the end of the bag")
    _, told = player.communicate()
    driver.destroy_node()
    assert (
        player.returncode == 0
        and f"playing {bag}" in told
        and numbers(listener, "/said") == list(range(50))
    )
    listener.close()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--start", "9"], "the bag is 0.490 s long"),
        (["--topics", "/nobody"], "nothing to play"),
        (["--topics", "("], "no regular expression"),
        (["--remap", "/nobody:=/x"], "to remap"),
        (["--wait-for", "/nobody"], "are not played"),
    ],
)
def test_what_cannot_be_played_is_said_in_one_line(bag, play, options, complaint):
    player = play(bag, *options)
    said, told = player.communicate(timeout=60)
    assert (
        (player.returncode, said) == (1, "")
        and complaint in told
        and told.startswith("dart-skill bag play: ")
        and told.count("\n") == 1
    )
