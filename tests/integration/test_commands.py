"""Which of several publishers of commands is obeyed, on a graph that the test makes up."""

from types import SimpleNamespace

import pytest

from dart_skill_nodes.comms import commands
from dart_skill_nodes.comms.commands import ObeyedPublisher


class World:
    """A node that sees the publishers in `there` (identifier: name of the node), and those in
    `silent` as gone.
    """

    def __init__(self):
        self.there, self.silent = {}, set()

    def get_publishers_info_by_topic(self, topic):
        return [
            SimpleNamespace(endpoint_gid=list(gid.encode()), node_name=name)
            for gid, name in self.there.items()
        ]


class FakePresence:
    """Gone, and from then on for ever, when all those are silent that were there."""

    def __init__(self, world):
        self._world, self._known, self._gone = world, set(world.there), False

    @property
    def gone(self):
        self._gone = self._gone or not (self._known & set(self._world.there)) - self._world.silent
        return self._gone


@pytest.fixture
def world(monkeypatch):
    monkeypatch.setattr(commands, "publishers", lambda world, topic: FakePresence(world))
    return World()


@pytest.fixture
def obeyed(world):
    world.there = {"first": "commander"}
    one = ObeyedPublisher(world, "/wam/command")
    assert one.accepts(1) and one.others == []
    return one


def test_a_second_one_is_named_and_not_obeyed(world, obeyed):
    world.there["second"] = "stranger"
    assert not obeyed.accepts(2) and obeyed.accepts(1) and obeyed.others == ["stranger"]


def test_one_that_was_silent_and_speaks_again_is_obeyed(world, obeyed):
    """It was frozen, or the machine so busy that it seemed dead."""
    world.silent = {"first"}
    obeyed.look()
    world.silent = set()
    assert obeyed.accepts(1)
    obeyed.look()
    assert obeyed.accepts(1)


def test_another_one_of_its_name_takes_the_place_of_one_that_died_and_keeps_it(world, obeyed):
    world.there["second"] = "commander"
    assert not obeyed.accepts(2)
    world.silent = {"first"}
    assert obeyed.accepts(2) and not obeyed.accepts(1)
    del world.there["first"]
    assert obeyed.accepts(2) and obeyed.others == []


def test_one_of_another_name_takes_it_after_a_reset_only(world, obeyed):
    world.there = {"second": "stranger"}
    assert not obeyed.accepts(2) and obeyed.others == ["stranger"]
    obeyed.forget()
    assert obeyed.accepts(2) and obeyed.others == []


def test_a_reset_takes_nothing_from_one_that_lives(world, obeyed):
    obeyed.forget()
    world.there["second"] = "commander"
    assert not obeyed.accepts(2) and obeyed.accepts(1)


def test_commands_without_a_number_are_obeyed_only_where_nobody_else_commands(world):
    world.there = {"first": "commander"}
    obeyed = ObeyedPublisher(world, "/wam/command")
    assert obeyed.accepts(0)
    world.there["second"] = "commander"
    obeyed.look()
    assert not obeyed.accepts(0)


def test_one_that_went_since_the_last_look_is_forgotten_too(world, obeyed):
    world.there = {}
    obeyed.forget()
    world.there = {"second": "hands"}
    assert obeyed.accepts(2)
