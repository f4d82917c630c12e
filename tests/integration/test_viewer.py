"""The live view over the real graph: what is clicked and dragged happens, and what happens is
seen, in a browser too.
"""

import re
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import rclpy
from dart_skill_msgs.msg import SimulationState
from geometry_msgs.msg import PoseStamped
from rclpy.serialization import serialize_message
from std_srvs.srv import SetBool
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.common import palette
from dart_skill.common.regions import targets_for
from dart_skill.common.world import ROLES
from dart_skill.view import EYE, LOOK_AT
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.for_viewers import ellipsoids
from dart_skill_nodes.comms.raw_batches import poses_of
from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.process.node_base import make_executor
from tests.integration.browser import SMALL, Page, needs_chromium, project
from tests.integration.conftest import teach_and_learn, wait_for
from tests.view_client import PageClient

RADIUS, DEPTH = 0.16, 0.35
"""Of the basket, outside [m]."""
BEHIND_ITS_NAME = 0.25
"""So high over the basket the words that tell where it stands hide what is behind them [m]."""


class Truth:
    """Where things really are, heard in a thread of its own so that nothing of a flight is missed."""

    def __init__(self):
        self.basket, self.hand, self.flight, self.episode = (
            np.full(3, np.nan),
            np.full(3, np.nan),
            [],
            -1,
        )
        self._node, self._executor, self._over = rclpy.create_node("truth"), make_executor(), False
        self._node.create_subscription(SimulationState, "/simulation/state", self._take, 500)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self):
        while not self._over:
            self._executor.spin_once(timeout_sec=0.1)

    def _take(self, message):
        if message.episode != self.episode:
            self.flight.clear()
        self.episode = message.episode
        hand, ball, basket = (
            conversions.vector(conversions.state_of(message.bodies, role).pose.position)
            for role in ROLES
        )
        self.basket, self.hand = basket, hand
        if message.held != "ball":
            self.flight.append(ball)

    def close(self):
        self._over = True
        self._thread.join()
        self._executor.remove_node(self._node)
        self._node.destroy_node()


def test_a_view_without_an_arm_says_who_is_missing(make_graph):
    """Before the arm of all the others is there."""
    graph, client = make_graph(layout=None)
    graph.start("viewer", {"port": 0})
    with PageClient(address_of(graph, client)) as page:
        page.click("Throw")
        page.wait_for(lambda: page.says("no basket is seen"), what="what is missing for a throw")
        page.click("Stop")
        page.wait_for(lambda: page.says("is the commander running?"), what="who cannot be stopped")
    assert graph.dead() == ""


def address_of(graph, client):
    """Of the page of a viewer that was started."""
    log = graph.logs / "viewer.log"
    wait_for(client, lambda: "live view is at" in log.read_text(), what="the address of the page")
    return re.search(r"http://\S+", log.read_text()).group()


@pytest.fixture(scope="module")
def live(make_shared_graph):
    """The graph with a viewer: the coach, the truth, and the address of the page. A browser needs
    the cores on which a world would run.
    """
    graph, client = make_shared_graph(extra={"composed": {"rest_after": 0.5}})
    truth = Truth()
    try:
        graph.start("viewer", {"port": 0})
        yield client, truth, address_of(graph, client)
    finally:
        truth.close()


@pytest.fixture
def taught(live):
    """The same from when it has learned on: from what was shown before, or from two lessons."""
    client, *_ = live
    client.set_parameters("/wam_simulator", {"friction_scale": 1.0})
    try:
        client.learn()
    except GraphFailure:
        teach_and_learn(client, targets_for(0, 2, 0)[0])
    return live


def test_everything_is_taught_learned_thrown_and_practised_from_the_page(live):
    client, truth, url = live
    with PageClient(url, origin=url) as page:

        def until(condition, what, limit=60.0):
            page.wait_for(condition, limit, what, meanwhile=client.spin)

        until(
            lambda: page.says("skill_learner") and page.says("wam_simulator"),
            "the status of the nodes",
        )
        until(lambda: "/cameras/all" in page.nodes, "the cameras")
        until(lambda: "/basket" in page.places, "the basket")
        page.click("Throw")
        until(
            lambda: page.says("nothing is learned yet: press Teach, then Learn"),
            "why there is no throw, and what to press",
        )
        until(
            lambda: not page.says("title='warning'"), "nodes that only wait, which are not orange"
        )
        until(lambda: not page.is_disabled("Teach"), "the buttons")

        page.set("Lessons", 2)
        page.click("Teach")
        until(lambda: page.says("lesson 2 of 2"), "how far it is", 180.0)
        until(
            lambda: page.says("2 of 2 demonstrations shown. Next: press Learn"),
            "two demonstrations",
            180.0,
        )
        page.click("Learn")
        until(lambda: page.says("from 2 demonstrations"), "a model")
        until(lambda: "/gaussians/components" in page.nodes, "the Gaussians")

        seen, episode = page.places["/basket"], truth.episode
        wanted = seen * [0.97, 0.97, 1.0]
        page.drag("/basket", seen, wanted)
        until(lambda: np.allclose(truth.basket, wanted, atol=2e-3), f"the basket at {wanted}")
        page.click("Throw")
        until(lambda: page.says("from the middle"), "the result of a throw", 120.0)
        assert truth.episode > episode and truth.flight
        np.testing.assert_allclose(truth.basket, wanted, atol=2e-3)

        page.set("Own throws", 1)
        page.set("Only here", True)
        page.click("Practise")
        until(lambda: page.says("1 of 1 throws made"), "an own throw", 120.0)

        page.set("friction scale", 2.0)
        until(lambda: page.says("friction_scale = 2"), "another friction")
        page.click("Teach")
        until(lambda: page.is_disabled("Teach"), "a lesson that has begun")
        page.click("Stop")
        until(
            lambda: not page.is_disabled("Teach") and page.says("stopped"),
            "the end of the lesson",
            120.0,
        )
        page.click("Throw")
        # Stop says it, too
        until(
            lambda: page.says("no throw") and page.says("press Reset after a stop"),
            "an arm that stays stopped",
        )
        page.click("Reset after a stop")
        until(lambda: page.says("the arm may move again"), "the reset")


def test_a_taken_port_is_told_in_one_line(tmp_path):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        # one of the graph has the name
        arguments = [
            "--ros-args",
            "-p",
            f"port:={port}",
            "-r",
            "__node:=another",
        ]
        command = [sys.executable, "-m", "dart_skill_nodes.executables.viewer", *arguments]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert (
        f"viewer: 127.0.0.1:{port} cannot be served" in done.stderr
        and "Traceback" not in done.stderr
    )


@pytest.mark.parametrize("frame", ["world", "a", "optitrack_base_frame"])
def test_poses_are_read_out_of_serialised_messages(frame):
    messages, wanted = [], np.random.default_rng(0).normal(size=(3, 7))
    for row in wanted:
        message = PoseStamped()
        message.header.frame_id = frame
        conversions.set_pose(message.pose, row[:3], row[3:])
        messages.append(serialize_message(message))
    np.testing.assert_array_equal(poses_of(messages, frame), wanted)
    assert poses_of([], frame).shape == (0, 7)
    with pytest.raises(ValueError, match=f"in frame '{frame}', not 'map'"):
        poses_of(messages, "map")


def test_spheres_of_markers_are_grouped_by_namespace_and_the_rest_is_left_out():
    def marker(namespace, number, kind=Marker.SPHERE, frame="world"):
        one = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
        one.header.frame_id = frame
        conversions.set_pose(
            one.pose, np.array([number, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 1.0])
        )
        conversions.set_vector(one.scale, np.array([1.0, 2.0, 3.0]))
        return one

    spheres = [marker("frame_1", 0), marker("frame_1", 1), marker("frame_2", 2)]
    others = [marker("targets", 0, Marker.SPHERE_LIST), marker("frame_1", 3, frame="map")]
    groups = ellipsoids(MarkerArray(markers=[*spheres, *others]), "world")
    assert set(groups) == {"frame_1", "frame_2"}
    centres, quaternions, diameters = groups["frame_1"]
    np.testing.assert_array_equal(centres, [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    np.testing.assert_array_equal(quaternions, [[0.0, 0.0, 0.0, 1.0]] * 2)
    np.testing.assert_array_equal(diameters, [[1.0, 2.0, 3.0]] * 2)


# --- in a browser ---


def share_of(picture, points, like, reach=4):
    """Share of points of the world (n, 3) within `reach` pixels of which the picture has a colour
    for which `like` holds.
    """
    found = []
    for column, row in np.round(project(points, EYE, LOOK_AT, SMALL)).astype(int):
        window = picture[
            max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1
        ].reshape(-1, 3)
        found.append(bool(np.any(like(window.astype(int)))))
    return float(np.mean(found))


def hue_of(colour):
    """Whether pixels (n, 3) have the tint of a colour, in light and shade."""
    wanted = np.array(colour) / np.linalg.norm(colour)

    def like(pixels):
        size = np.linalg.norm(pixels, axis=1) + 1e-9
        return (pixels @ wanted / size > 0.97) & (size > 60.0)

    return like


def front_of(basket):
    """Points of the basket's wall that face the eye (n, 3)."""
    towards = (EYE - basket)[:2] / np.linalg.norm((EYE - basket)[:2])
    heights = np.linspace(-0.2 * DEPTH, -0.8 * DEPTH, 7)
    return basket + np.column_stack([np.tile(RADIUS * towards, (7, 1)), heights])


@needs_chromium
def test_in_a_browser_the_basket_is_dragged_and_a_click_throws(taught, tmp_path):
    client, truth, url = taught
    with Page(tmp_path / "browser", url, SMALL) as page:
        wait_for(client, lambda: page.button("Throw"), 90.0, "the page")
        begin = truth.basket.copy()
        pause = client.node.create_client(SetBool, "/simulation/pause")
        # somebody drags for seconds: the world need not hurry meanwhile
        client.set_parameters("/wam_simulator", {"speed_factor": 0.2})
        # in a world that is held the cameras see nothing new
        client.call(pause, SetBool.Request(data=False))

        def look(condition, what, limit=60.0):
            """Take pictures until one fulfils the condition."""
            pictures = []

            def taken():
                pictures[:] = [page.screenshot(tmp_path / "page.png")]
                return condition(pictures[0])

            wait_for(client, taken, limit, what)
            return pictures[0]

        blue = hue_of(palette.BASKET)
        look(
            lambda picture: share_of(picture, front_of(begin), blue) == 1.0,
            "the basket where it stands",
        )
        wanted = begin * [1.1, 1.1, 1.0]
        # a page that is late on a busy machine lets go too early: whoever drags does it again
        for _ in range(5):
            now, grip = truth.basket.copy(), front_of(truth.basket)[3]
            page.drag(*project(np.array([grip, grip + wanted - now]), EYE, LOOK_AT, SMALL))
            if _comes(client, lambda: np.linalg.norm(truth.basket - wanted) < 0.02):
                break
        assert np.linalg.norm(truth.basket - wanted) < 0.02, (
            f"a basket dragged from {begin} to {wanted} is at {truth.basket}"
        )
        look(
            lambda picture: share_of(picture, front_of(truth.basket), blue) == 1.0,
            "the basket where it was dragged to",
        )

        client.set_parameters("/wam_simulator", {"speed_factor": 0.0})
        episode = truth.episode
        page.click("Throw")
        wait_for(
            client,
            lambda: truth.episode > episode and "from the middle" in page.text(),
            120.0,
            "the result of the throw",
        )
        flight = np.array(
            [point for point in truth.flight if point[2] > truth.basket[2] + BEHIND_ITS_NAME]
        )
        assert len(flight) > 20
        vermilion = hue_of(palette.BALL)
        # what one page hides is hidden on all: Gaussians may stand before path and hand
        with PageClient(url, origin=url) as other:
            other.wait_for(
                lambda: other.says("Gaussians"),
                meanwhile=client.spin,
                what="the switch of the Gaussians",
            )
            other.set("Gaussians", False)
        picture = look(
            lambda picture: share_of(picture, flight, vermilion) > 0.95, "the path of the ball"
        )
        assert (
            share_of(picture, truth.hand[None], lambda pixels: pixels.max(axis=1) < 130) == 1.0
        ), "the hand"
        assert share_of(picture, flight + [0.0, 0.0, 0.5], vermilion) < 0.2, "only there"
        assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 500
        _stop_stays_in_sight(page)
        assert page.exceptions == []
        assert [
            address
            for address in page.addresses
            if not address.startswith((url.partition("?")[0], "data:", "blob:"))
        ] == [], "nothing from outside"


NOT_DARK = """(() => {
  const light = colour => {
    const [red, green, blue, alpha = 1] = colour.match(/[0-9.]+/g).map(Number);
    return alpha > 0.5 && Math.min(red, green, blue) > 200;
  };
  const dim = colour => Math.max(...colour.match(/[0-9.]+/g).slice(0, 3).map(Number)) < 90;
  const written = part => [...part.childNodes].some(one => one.nodeType === 3 && one.data.trim());
  const edge = style => parseFloat(style.borderTopWidth) > 0 && style.borderTopStyle !== 'none';
  const found = [];
  const panels = '.mantine-Paper-root:has(.ds-says), .mantine-Notification-root';
  for (const panel of document.querySelectorAll(panels))
    for (const part of [panel, ...panel.querySelectorAll('*')])
      for (const of of ['', '::before']) {
        const style = getComputedStyle(part, of);
        if (part.getBoundingClientRect().width === 0 || (of && style.content === 'none')) continue;
        if (light(style.backgroundColor) || (edge(style) && light(style.borderTopColor)))
          found.push(part.className + of + ' ' + style.backgroundColor + ' ' + style.borderTopColor);
        if (!of && written(part) && part.tagName !== 'STYLE' && dim(style.color))
          found.push(part.innerText + ' is written in ' + style.color);
      }
  return found;
})()"""
"""What a page has in its panel and its notes that is for light: light areas and frames, dark words."""


@needs_chromium
@pytest.mark.parametrize("size", [SMALL, (390, 844)])
def test_in_the_dark_scene_and_panel_are_dark(live, tmp_path, size):
    client, _, url = live
    with Page(tmp_path / "browser", url, size) as page:
        wait_for(client, lambda: page.button("Stop"), 90.0, "the page")
        assert page.run(NOT_DARK), "a page is light unless something else is wanted"
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        page.call("Emulation.setEmulatedMedia", features=dark)
        wait_for(client, lambda: page.run(NOT_DARK) == [], 60.0, "a dark panel")
        wait_for(
            client,
            lambda: np.median(page.screenshot(tmp_path / "page.png")[:200, : size[0] // 2]) < 50,
            60.0,
            "a dark scene",
        )


def _comes(client, condition, limit=20.0):
    """Whether the condition comes true in time."""
    until = time.monotonic() + limit
    while not condition() and time.monotonic() < until:
        client.spin()
    return condition()


def _stop_stays_in_sight(page):
    """However far the panel is scrolled, on a telephone too."""
    # viser's note that the browser has no graphics card would lie over a narrow page for as long
    # as it stays.
    seen = (
        "(() => {document.querySelectorAll('.mantine-Notification-closeButton').forEach(button =>"
        " button.click());document.querySelectorAll('.mantine-ScrollArea-viewport').forEach(part"
        " => part.scrollTop = 1000);const b = [...document.querySelectorAll('button')].find(b =>"
        " b.innerText.trim() === 'Stop'); if (!b) return 'no such button';const r ="
        " b.getBoundingClientRect(); const top = document.elementFromPoint(r.x + r.width / 2, r.y"
        " + r.height / 2);if (r.right > innerWidth) return 'it ends at ' + r.right; if"
        " (b.contains(top)) return '';return 'at ' + r.x + ', ' + r.y + ' there is ' + (top ?"
        " top.outerHTML.slice(0, 500) : 'nothing')})()"
    )
    for width, height in ((1280, 500), (360, 740)):
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 500,
        )
        there = ["not looked at"]

        def in_sight(there=there):
            there[0] = page.run(seen)
            return not there[0]

        try:
            page._wait(in_sight, 30.0, f"Stop in a window {width} pixels wide")
        except AssertionError as error:
            raise AssertionError(f"{error}: {there[0]}") from error
