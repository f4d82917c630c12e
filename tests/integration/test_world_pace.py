"""The commands that a simulated world holds which does not wait for them, and when it is held back."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from dart_skill.arm import Command
from dart_skill_nodes.arm import answers, simulated_arm
from dart_skill_nodes.arm.answers import TOPICS, Answers
from dart_skill_nodes.arm.simulated_arm import BEHIND, WorldPace
from dart_skill_nodes.comms.commands import CommandWriter

MS = 1_000_000


@pytest.fixture
def plant():
    """One whose time the test makes up."""
    settings = SimpleNamespace(step=0.002)
    return SimpleNamespace(state_stamp_ns=0, settings=settings, braking=lambda: "brakes")


class Node:
    """Has parameters of time, and hands on commands; everyone is obeyed."""

    def __init__(self, monkeypatch, factor=0.0):
        obeyed = SimpleNamespace(accepts=lambda sender: True, forget=lambda: None, others=[])
        monkeypatch.setattr(answers, "ObeyedPublisher", lambda node, topic: obeyed)
        monkeypatch.setattr(answers, "publishers", lambda node, topic: None)
        self.values, self.callbacks = {"speed_factor": factor, "rest_after": 0.0}, {}

    def create_subscription(self, kind, topic, callback, qos, **_):
        self.callbacks[topic] = callback

    def get_parameter(self, name):
        return SimpleNamespace(value=self.values[name])

    def add_post_set_parameters_callback(self, callback):
        pass

    def say(self, who, stamp_ns):
        """A command of commander or teacher comes."""
        writer = CommandWriter(1, "world")
        self.callbacks[TOPICS[who]](writer.write(Command(stamp_ns)))


@pytest.fixture
def held(plant, monkeypatch):
    """Answers in real time, what came, and complaints."""
    complaints, came, node = [], [], Node(monkeypatch)
    parameters = {"lockstep": False, "frame_id": "world", "command_timeout": 0.010}
    made = Answers(node, plant, parameters, came.append, complaints.append)
    return made, node, came, complaints


def test_a_command_holds_until_it_is_too_old_and_then_the_arm_is_braked(plant, held):
    made, node, came, complaints = held
    assert made.newest() == ("brakes", None, False) and not complaints
    node.say("commander", 0)
    plant.state_stamp_ns = 10 * MS
    command, push, are_fresh = made.newest()
    assert command.stamp_ns == 10 * MS and push is None and are_fresh and came == ["commander"]
    plant.state_stamp_ns = 12 * MS
    assert made.newest() == ("brakes", None, False)
    assert complaints == ["no command of the commander for more than 0.01 s: the arm is braked"]


def test_a_teacher_who_is_late_brakes_the_arm_and_one_who_has_pushed_is_awaited(plant, held):
    made, node, *_ = held
    made.begin(guided=True)
    assert not made.awaits_teacher(), "who has not pushed yet"
    node.say("teacher", 0)
    assert not made.awaits_teacher(), "the push for this state is there"
    plant.state_stamp_ns = 12 * MS
    assert made.awaits_teacher()
    node.say("commander", 12 * MS)
    assert made.newest()[0] == "brakes"
    made.guided = False
    assert made.newest()[2], "nobody guides the arm any more"


def test_a_command_in_another_frame_is_complained_of_and_not_taken(held):
    made, node, came, complaints = held
    node.callbacks[TOPICS["commander"]](CommandWriter(1, "moon").write(Command(0)))
    assert complaints == ["a command of the commander is in frame 'moon', not 'world': ignored"]
    assert not came and made.newest()[0] == "brakes"


@pytest.mark.parametrize(
    ("factor", "watched", "least"), [(0.0, False, 0.0), (0.1, False, 0.035), (0.0, True, 0.003)]
)
def test_steps_are_held_back_to_the_factor_and_to_real_time_for_who_watches(
    plant, monkeypatch, factor, watched, least
):
    pace = WorldPace(Node(monkeypatch, factor), plant)
    pace.watched = watched
    begun = time.monotonic()
    for _ in range(2):
        pace.hold_back()
    assert time.monotonic() - begun >= least


def test_lost_time_is_made_up_for_by_little(plant, monkeypatch):
    clock, slept = [100.0], []
    monkeypatch.setattr(simulated_arm.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(simulated_arm.time, "sleep", slept.append)
    pace = WorldPace(Node(monkeypatch, factor=1.0), plant)
    clock[0] += 10.0  # the machine was asleep
    for _ in range(50):
        pace.hold_back()
    assert len(slept) == 50 - round(BEHIND / plant.settings.step)


def test_a_world_rests_when_nothing_moves_and_nobody_waits_for_steps(plant, monkeypatch):
    node = Node(monkeypatch)
    node.values["rest_after"] = 1.0
    plant.joint_velocity, plant.bodies = np.zeros(7), {}
    pace = WorldPace(node, plant)
    pace.wake()
    for seconds, waits, rests in ((0.9, False, False), (2.0, True, False), (2.1, False, True)):
        plant.state_stamp_ns = round(1e9 * seconds)
        pace.look_for_rest(waits)
        assert pace.rests == rests, seconds
    pace.wake()
    assert not pace.rests
