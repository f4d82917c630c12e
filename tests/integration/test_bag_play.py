"""`dart-skill bag play`: its options reach the node, its errors have a reason and a status."""

import json
import signal
import subprocess
import sys

import pytest

from tests.texts import write_texts

from .conftest import wait_for
from .test_bags import Listener, numbers


@pytest.fixture
def bag(tmp_path):
    """Fifty numbered texts, one each hundredth of a second, in a folder whose name needs quotes."""
    return write_texts(tmp_path / "a 'bag'", ("/said", "/heard"), 50)


@pytest.fixture
def play():
    """Starts the command; ends what is left."""
    started = []

    def start(*arguments):
        command = [sys.executable, "-m", "dart_skill.cli", "bag", "play", *map(str, arguments)]
        started.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_options_reach_the_player(bag, play, make_graph):
    _, client = make_graph(None)
    listener = Listener(client, ["/new", "/heard"])
    options = ["--topics", r"/s\w+", "--remap", "/said:=/new", "--start", "0.1", "--duration", "0.2", "--rate", "2", "--wait-for", "/new"]
    player = play(bag, *options, "--clock", "0", "--json")
    wait_for(client, lambda: player.poll() is not None, what="the end of the bag")
    client.spin()
    said, progress = player.communicate()
    assert player.returncode == 0 and f"playing {bag}" in progress
    told = json.loads(said)
    assert told["finished"] and told["bag"] == str(bag) and told["rate"] == 2.0 and told["topics"] == [r"/s\w+"]
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
    assert player.returncode == 0 and not json.loads(said)["finished"] and "Traceback" not in complaint
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
    assert (player.returncode, said) == (1, "") and complaint in told and told.startswith("dart-skill bag play: ") and told.count("\n") == 1
