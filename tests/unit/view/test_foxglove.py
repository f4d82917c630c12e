"""The live server for Foxglove: a plain WebSocket client gets its channels and messages. The
client is no part of foxglove-sdk.
"""

import json
import os
import signal
import subprocess
import sys
import threading

import pytest

from dart_skill.cli import main
from dart_skill.recording import BagReader, deserialize, typestore
from tests.foxglove_client import FoxgloveClient
from tests.paths import BAGS, ROOT

pytest.importorskip("foxglove")

from dart_skill.view import FoxgloveServer, serve_bag  # noqa: E402

POSE = "geometry_msgs/msg/PoseStamped"


@pytest.fixture
def server():
    with FoxgloveServer(0) as running:
        yield running


def test_a_client_gets_the_channels_of_a_bag_and_its_messages(server):
    with BagReader(BAGS / "throws") as bag, FoxgloveClient(server.url) as client:
        there = {name for name, topic in bag.topics.items()}
        first = next(bag.messages(["/vrpn_mocap/ball/pose"], decode=False))
        ended = threading.Event()
        playing = threading.Thread(target=serve_bag, args=(bag, server, 1.0, ended.is_set))
        playing.start()
        try:
            client.hear_until(lambda: there <= set(client.channels))
            assert client.info["name"] == "dart_skill" and client.info["capabilities"] == [], (
                "clients can send nothing"
            )
            channel = client.channels["/vrpn_mocap/ball/pose"]
            assert (channel["schemaName"], channel["encoding"], channel["schemaEncoding"]) == (
                POSE,
                "cdr",
                "ros2msg",
            )
            assert "geometry_msgs/Pose" in channel["schema"]
            client.ask_for("/vrpn_mocap/ball/pose")
            client.hear_until(lambda: len(client.messages) >= 3)
        finally:
            ended.set()
            playing.join()
        pose = deserialize(typestore(), POSE, client.messages[0][1])
        assert pose.header.frame_id == "world" and len(client.messages[0][1]) == len(first.data)


def test_what_was_published_once_comes_to_who_is_late(server):
    text = "string data\n"
    server.add_topic("/robot_description", "std_msgs/msg/String", text, lasting=True)
    server.add_topic("/other", "std_msgs/msg/String", text)
    for topic in ("/robot_description", "/other"):
        server.publish(topic, b"\0\1\0\0" + topic.encode(), 5)
    with FoxgloveClient(server.url) as client:
        client.hear_until(lambda: len(client.channels) == 2)
        client.ask_for("/other")
        client.ask_for("/robot_description")
        client.hear_until(lambda: client.messages)
    assert client.messages == [("/robot_description", b"\0\1\0\0/robot_description")]


def test_it_is_served_on_this_machine_alone(server):
    assert server.url == f"ws://127.0.0.1:{server.port}"
    with pytest.raises(
        OSError,
        match=(
            f"port {server.port} on 127.0.0.1 cannot be served .*: choose another one with --port"
        ),
    ):
        FoxgloveServer(server.port)


def test_the_command_serves_a_bag_until_ctrl_c():
    command = [
        sys.executable,
        "-m",
        "dart_skill",
        "view",
        str(BAGS / "throws"),
        "--foxglove",
        "--port",
        "0",
        "--json",
    ]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        told = json.loads(process.stdout.readline())
        with FoxgloveClient(told["url"]) as client:
            client.hear_until(lambda: "/joint_states" in client.channels)
            client.ask_for("/joint_states")
            client.hear_until(lambda: client.messages)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--web"], "--web is for Rerun"),
        (["--rate", "0"], "--rate is 0"),
        (["--save", "there"], "--save is for Rerun"),
    ],
)
def test_what_does_not_go_together_is_refused(capsys, options, complaint):
    with pytest.raises(SystemExit) as left:
        main(["view", str(BAGS / "throws"), "--foxglove", *options])
    assert left.value.code == 2 and complaint in capsys.readouterr().err


def test_without_the_sdk_the_remedy_is_named(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)  # as if it were not there
    assert main(["view", str(BAGS / "throws"), "--foxglove"]) == 1
    assert "pip install 'dart_skill[foxglove]'" in capsys.readouterr().err
