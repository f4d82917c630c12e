"""A skill shown by somebody in front of a screen: the hand is pulled, and what was shown is
learned and executed.
"""

import re

import numpy as np
import pytest
from dart_skill_msgs.action import Teach
from rclpy.action import ActionClient
from scipy.spatial.transform import Rotation

from dart_skill.common.situation import Situation
from dart_skill.skills.protocol import load_skill
from dart_skill.view import NEAR
from dart_skill_nodes.comms import conversions
from tests.integration.browser import SMALL, Page, needs_chromium
from tests.integration.conftest import catch_up, graphs, wait_for
from tests.screen_person import MouseHands, PageHands, ScreenPerson, begin_by_pointer
from tests.view_client import PageClient

SHOWN = 3
LONG = 180.0
"""Without a graphics card a page needs seconds for a picture [s]."""


@pytest.fixture(scope="module")
def graph(ros, tmp_path_factory):
    with graphs(tmp_path_factory.mktemp("pointer")) as make:
        running, client = make("composed", 0, skill="place")
        running.client, running.person = client, ScreenPerson(client, ("hand", "part", "holder"))
        running.teacher = ActionClient(client.node, Teach, "/teach")
        wait_for(client, running.teacher.server_is_ready, what="the teacher")
        yield running


@pytest.mark.slow
def test_what_any_client_shows_by_poses_on_a_topic_is_learned_and_executed(graph):
    skill, rng = load_skill("place"), np.random.default_rng(5)
    for _ in range(SHOWN):
        situation = skill.draw(rng)
        result = begin_by_pointer(graph.client, graph.teacher, situation)
        graph.person.place(skill.goal(situation))
        graph.person.hands.done()
        lesson = graph.client.wait(result, "the end of the lesson").result
        assert lesson.success and lesson.attempts == 1, lesson.message
        assert lesson.outcome.error < 0.004
    assert graph.client.learn().demonstrations == SHOWN
    listed = graph.client.demonstrations(compare=True).demonstrations
    assert [one.weight for one in listed] == [1.0] * SHOWN and all(
        0.0 < one.unlike < 0.2 for one in listed
    )
    made = graph.client.execute(conversions.situation_msg(skill.draw(rng)), look=True)
    assert made.message == "executed" and made.outcome.seen


@pytest.fixture(scope="module")
def url(graph):
    """Of the page of a viewer of the graph."""
    graph.start("viewer", {"port": 0, "skill": "place"})
    log = graph.logs / "viewer.log"
    wait_for(
        graph.client, lambda: "live view is at" in log.read_text(), what="the address of the page"
    )
    return re.search(r"http://\S+", log.read_text()).group()


@pytest.mark.slow
def test_on_the_page_it_is_shown_with_the_mouse_undone_learned_and_executed(graph, url):
    skill, client = load_skill("place"), graph.client
    with PageClient(url, origin=url) as page:

        def until(condition, what, limit=60.0):
            page.wait_for(condition, limit, what, meanwhile=lambda: catch_up(client))

        def take():
            until(lambda: not page.is_disabled("Take the hand"), "a hand that can be taken")
            page.click("Take the hand")
            until(lambda: not page.is_disabled("Done (Enter)"), "a hand that is held")

        before = len(client.demonstrations().demonstrations)
        person = ScreenPerson(
            client, ("hand", "part", "holder"), PageHands(page), meanwhile=page.listen
        )
        for number in range(before + 1, max(before + 2, SHOWN + 1) + 1):
            take()
            until(lambda: page.says("beside its place"), "how far it is still to go")
            person.look(until)
            person.place(skill.goal(Situation({"holder": person.seen["holder"]})))
            person.hands.done()
            until(lambda: page.says("kept: "), "the end of the lesson")
            until(lambda number=number: page.says(f"{number}: "), "a line for what was shown")
        take()
        page.click("Discard this one")
        until(
            lambda: not page.is_disabled("Take the hand"),
            "the end of a lesson that is thrown away",
        )
        page.click("Undo the last one")
        until(lambda: page.says("left out"), "what was undone")
        page.click("Learn")
        until(lambda: page.says(f"from {number - 1} demonstrations"), "a model")
        until(lambda: page.says("weight 1, "), "how demonstrations count")
        page.click("Execute")
        until(lambda: page.says("mm off"), "what came of it", 120.0)


@pytest.mark.slow
@needs_chromium
def test_in_a_browser_the_hand_is_pulled_with_the_mouse_and_told_with_keys(graph, url, tmp_path):
    """Up as the screen shows it, with Shift over the ground, and turned; the page looks at it from
    above, too.
    """
    client = graph.client
    with Page(tmp_path / "browser", url, SMALL) as page, PageClient(url, origin=url) as watch:

        def until(condition, what, limit=60.0):
            watch.wait_for(condition, limit, what, meanwhile=lambda: catch_up(client))

        until(lambda: page.button("Take the hand"), "the page", 90.0)
        page.settle(meanwhile=watch.listen)
        person = ScreenPerson(
            client,
            ("hand", "part", "holder"),
            MouseHands(page, watch, NEAR),
            meanwhile=watch.listen,
        )
        page.click("Take the hand")
        until(lambda: "beside its place" in page.text(), "a hand that is held")
        person.look(until)
        hand, part = person.seen["hand"], person.seen["part"]
        person.hands.grip(True)
        person.pull(hand.position + [0.0, 0.0, 0.08], hand.quaternion, LONG)
        turned = (
            Rotation.from_euler("z", 10.0, degrees=True) * Rotation.from_quat(hand.quaternion)
        ).as_quat()
        person.pull(hand.position + [0.1, 0.05, 0.08], turned, LONG)
        page.screenshot(tmp_path / "carried.png")
        person.look(until)
        carried = person.seen["part"]
        turn = (
            Rotation.from_quat(carried.quaternion) * Rotation.from_quat(part.quaternion).inv()
        ).as_rotvec()
        assert np.linalg.norm(carried.position - part.position) > 0.12 and 0.12 < turn[2] < 0.25, (
            "with the part in it"
        )
        looks = watch.looks
        page.key("v")
        until(lambda: watch.looks > looks, "a look from above")
        person.hands.done()
        until(
            lambda: "not kept: " in page.text(),
            "the end of a lesson in which the part was not brought to its holder",
        )
        assert page.exceptions == []
