"""The bags in bags/: whole, readable by others, small, and teaching what they were recorded to
teach.
"""

from functools import lru_cache

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from dart_skill.recording import BagReader, example_bag, read_demonstrations, type_hash, types_for
from dart_skill.recording.bags import check_bag
from dart_skill.recording.imports.throw_recording import read_recording
from dart_skill.session import find_throws, learn_from_bag, learn_skill
from dart_skill.skills.protocol import load_skill
from tests.paths import BAGS
from tests.recorded_session import same


@lru_cache
def throws_of(name):
    return find_throws(read_recording(BAGS / name))


@pytest.mark.parametrize(
    "name", [pytest.param("demonstrations", marks=pytest.mark.slow), "throws"]
)
def test_nothing_is_wrong_with_a_bag_and_others_read_it(name):
    assert check_bag(BAGS / name) == []
    with BagReader(BAGS / name) as bag, Reader(BAGS / name) as reader:
        assert sum(topic.count for topic in bag.topics.values()) == sum(
            1 for _ in reader.messages()
        )
        assert (
            "/tf" in bag.topics
            and "/robot_description" in bag.topics
            and "/simulation/state" not in bag.topics
        )


@pytest.mark.parametrize("name", ["demonstrations", "throws"])
def test_bags_that_are_shipped_are_of_today(name):
    with BagReader(BAGS / name) as bag:
        ours = {
            topic: info
            for topic, info in bag.topics.items()
            if info.type_name.startswith("dart_skill_msgs/")
        }
        assert {"/demonstrations", "/wam/command"} <= set(ours)
        for topic, info in ours.items():
            assert info.type_hash == type_hash(types_for(info.type_name), info.type_name), (
                f"{topic}: make the bags again (bags/README.md)"
            )


def test_the_bag_of_the_library_has_the_first_five_demonstrations():
    with BagReader(example_bag()) as few, BagReader(BAGS / "demonstrations") as all_of_them:
        for topic in ("/vrpn_mocap/hand/pose", "/vrpn_mocap/ball/pose"):
            ours, theirs = (_positions(bag, topic) for bag in (few, all_of_them))
            assert len(ours) > 1000
            np.testing.assert_array_equal(ours, theirs[: len(ours)])
    assert check_bag(example_bag()) == []
    skill, report = learn_from_bag(example_bag())
    assert len(report.learned_from) == 5
    landing = skill.plan(np.array([1.9, 0.7, 0.4])).thrown.landing
    assert np.linalg.norm(landing[:2] - [1.9, 0.7]) < 0.01


def _positions(bag, topic):
    places = (one.data.pose.position for one in bag.messages([topic]))
    return np.array([(place.x, place.y, place.z) for place in places])


def test_together_they_are_small():
    assert sum(file.stat().st_size for file in BAGS.rglob("*") if file.is_file()) < 20e6


def test_thirteen_demonstrations_are_found_as_the_recorder_cut_them():
    found = [throw.demonstration for throw in throws_of("demonstrations") if throw.shows]
    told = list(read_demonstrations(BAGS / "demonstrations"))
    assert len(found) == len(told) == 13
    differing = [set(same(one, other)) for one, other in zip(found, told, strict=True)]
    assert differing == [set()] * 13


def test_twenty_throws_are_found_and_land_where_the_skill_meant_them_to():
    throws = throws_of("throws")
    assert len(throws) == 20 and not any(throw.taught for throw in throws)
    assert np.median([throw.outcome.landing_error for throw in throws]) < 0.025
    assert sum(throw.outcome.in_basket for throw in throws) >= 19


def test_they_teach_a_skill_and_throws_add_to_it():
    learner, lesson = learn_skill(BAGS / "demonstrations", load_skill("throw"))
    assert len(lesson.learned_from) == 13
    target = np.array([2.0, 0.2, 0.4])
    assert np.linalg.norm(learner.practice.model.plan(target).thrown.landing - target) < 0.01
    _, more = learn_from_bag(BAGS / "throws", with_throws=True)
    assert len(more.learned_from) >= 19
