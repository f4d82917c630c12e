"""The live view without a browser and without ROS: what is in the scene, what the controls ask
for, who may connect.
"""

import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from viser import _messages
from websockets.exceptions import ConnectionClosed, InvalidStatus

from dart_skill import view
from dart_skill.arm import ArmModel, fixed_transforms, joint_transforms, the_arm
from dart_skill.common.regions import Region
from dart_skill.mixture import GaussianMixture
from dart_skill.simulation import ArmGeometry, Camera
from dart_skill.skills.learning import component_ellipsoids
from dart_skill.skills.protocol import load_skill, skill_names
from dart_skill.view import shapes
from dart_skill.view.arm_shapes import fingers, housings
from dart_skill.view.geometry import (
    STRIPE,
    Trail,
    nearest_in,
    on_plane,
    outline,
    segments,
    stripes,
)
from tests.integration.browser import project
from tests.throw_demonstrations import throw_demonstration
from tests.view_client import PageClient

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def server():
    server = view.open_server()
    yield server
    server.stop()


@pytest.fixture
def scene(server):
    server.scene.reset()
    return view.Scene(server)


@pytest.fixture
def asked(server, scene):
    """The requests of a panel, in the order in which they came."""
    server.gui.reset()
    requests = []
    scene.panel = view.Panel(server, scene, requests.append)
    return requests


@pytest.fixture
def page(server, asked):
    with PageClient(view.url_of(server), origin=view.url_of(server)) as client:
        yield client


def node(scene, name):
    return scene._scene.get_handle_by_name(name)


def pose_in_world(scene, path):
    """Position and rotation of a node of the scene, from those of its ancestors."""
    position, rotation = np.zeros(3), Rotation.identity()
    parts = path.split("/")[1:]
    for depth in range(1, len(parts) + 1):
        handle = node(scene, "/" + "/".join(parts[:depth]))
        position = position + rotation.apply(handle.position)
        rotation = rotation * Rotation.from_quat(np.roll(handle.wxyz, -1))
    return position, rotation.as_matrix()


def path_of_link(name):
    """Path of a link in the scene, behind those that it hangs on."""
    arm = the_arm()
    base, hand = fixed_transforms(arm)
    parents = {one.child: one.parent for one in (base, *joint_transforms(arm, arm.home), hand)}
    return "/arm" if name == "world" else f"{path_of_link(parents[name])}/{name}"


# --- shapes ---


def volume(mesh):
    """By Gauss's theorem: positive if the surface is closed and faces outwards."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


@pytest.mark.parametrize(
    ("mesh", "wanted", "tolerance"),
    [
        (shapes.box(np.array([1.0, 2.0, 3.0])), 6.0, 1e-12),
        (shapes.sphere(0.5, 96), np.pi / 6.0, 3e-3),
        # a prism
        (
            shapes.cylinder(0.5, 2.0),
            0.25 * shapes.SIDES * np.sin(2 * np.pi / shapes.SIDES),
            1e-12,
        ),
        (shapes.pyramid((np.pi / 4, np.arctan(0.5)), 3.0), 6.0 * 3.0 * 3.0 / 3.0, 1e-12),
        (shapes.bucket(0.15, 0.35, 0.01), np.pi * (0.16**2 * 0.36 - 0.15**2 * 0.35), 1e-2),
        (
            shapes.joined(
                [shapes.box(np.ones(3)), shapes.box(np.ones(3)).moved(np.array([5.0, 0.0, 0.0]))]
            ),
            2.0,
            1e-12,
        ),
    ],
    ids=["box", "sphere", "cylinder", "pyramid", "bucket", "joined"],
)
def test_shapes_enclose_their_volume_and_face_outwards(mesh, wanted, tolerance):
    assert volume(mesh) == pytest.approx(wanted, rel=tolerance)
    assert mesh.faces.min() == 0 and mesh.faces.max() == len(mesh.vertices) - 1


def test_a_mesh_is_turned_and_then_shifted():
    turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    moved = shapes.Mesh(np.array([[1.0, 0.0, 0.0]]), np.zeros((0, 3), int)).moved(
        np.array([0.0, 0.0, 2.0]), turn
    )
    np.testing.assert_allclose(moved.vertices, [[0.0, 1.0, 2.0]], atol=1e-15)


# --- the arm ---


def test_the_arm_stands_where_the_kinematics_say(scene):
    rng, model = np.random.default_rng(0), ArmModel()
    for _ in range(5):
        q = rng.uniform(the_arm().of_joints("lower"), the_arm().of_joints("upper"))
        scene.move_arm(q + 0.01)  # so that every joint moves by what is worth sending
        scene.move_arm(q)
        position, rotation = pose_in_world(scene, path_of_link("bhand_base"))
        expected = model.hand_pose(q)
        np.testing.assert_allclose(position, expected[0], atol=1e-9)
        np.testing.assert_allclose(rotation, expected[1], atol=1e-9)


def test_the_shapes_of_the_arm_are_its_capsules(scene):
    q = np.array([0.4, -1.0, 0.3, 1.2, -0.5, 0.6, 0.1])
    scene.move_arm(q)
    ends, radii = ArmGeometry().capsules(q)
    drawn = []
    for link in {capsule.link for capsule in the_arm().capsules}:
        position, rotation = pose_in_world(scene, path_of_link(link))
        drawn.append(node(scene, f"{path_of_link(link)}/shape").vertices @ rotation.T + position)
    drawn = np.concatenate(drawn)
    axes = ends[:, 1] - ends[:, 0]
    along = np.clip(
        np.einsum("nci,ci->nc", drawn[:, None] - ends[:, 0], axes) / np.sum(axes**2, axis=1),
        0.0,
        1.0,
    )
    outside = np.linalg.norm(drawn[:, None] - ends[:, 0] - along[..., None] * axes, axis=2) - radii
    assert outside.min(axis=1).max() < 1e-6, "no corner sticks out of the arm"
    for k, axis in enumerate(axes / np.linalg.norm(axes, axis=1, keepdims=True)):
        on_it = drawn[np.abs(outside[:, k]) < 1e-6] @ axis
        assert on_it.min() < ends[k, 0] @ axis and on_it.max() > ends[k, 1] @ axis, (
            "both round ends are there"
        )


def test_the_fingers_open_when_the_ball_has_left_the_hand(scene):
    hand = path_of_link("bhand_base")
    closed, opened = (node(scene, f"{hand}/{state}") for state in ("closed", "open"))
    scene.move_ball(np.array([0.9, 0.0, 1.6]))
    assert (closed.visible, opened.visible) == (True, False), "nobody has seen the hand"
    scene.move_hand(np.array([0.8, 0.0, 1.6]), np.array([0.0, 0.0, 0.0, 1.0]))
    assert (closed.visible, opened.visible) == (True, False)
    scene.move_ball(np.array([1.2, 0.0, 1.9]))
    assert (closed.visible, opened.visible) == (False, True)


def test_housings_stand_at_the_joints_and_fingers_reach_around_what_is_held():
    arm = the_arm()
    for joint, mesh in zip(arm.joints, housings(arm).values(), strict=True):
        assert np.abs(mesh.vertices.mean(axis=0)).max() < 1e-12, joint.child
        assert np.linalg.norm(mesh.vertices[:, :2], axis=1).max() < 0.1
    held = arm.hand.ball_centre[2]
    for is_open in (False, True):
        assert fingers(arm, is_open).vertices[:, 2].max() > held
    wide, narrow = (np.ptp(fingers(arm, state).vertices[:, 0]) for state in (True, False))
    assert wide > 1.5 * narrow


def test_only_joints_that_moved_are_sent(scene, monkeypatch):
    q = np.zeros(7)
    scene.move_arm(q)
    sent = []
    monkeypatch.setattr(scene._server.scene._websock_interface, "queue_message", sent.append)
    scene.move_arm(q + 1e-3)
    assert sent == [], "less than a pixel"
    for step in range(1, 5):
        scene.move_arm(np.full(7, 1e-3 * step))
    assert len(sent) == 7, "what is slow arrives all the same"
    scene.move_arm(q)
    sent.clear()
    q[3] = 0.5
    scene.move_arm(q)
    assert [message.name.split("/")[-1] for message in sent] == ["wam_link4"]


@pytest.mark.parametrize("q", [np.zeros(6), np.full(7, np.nan), [[0.0] * 7]])
def test_joint_angles_that_are_none_are_refused_and_move_nothing(scene, q):
    scene.move_arm(np.full(7, 0.1))
    before = node(scene, path_of_link("wam_link4")).wxyz.copy()
    with pytest.raises(ValueError, match="7 finite joint angles"):
        scene.move_arm(q)
    np.testing.assert_array_equal(node(scene, path_of_link("wam_link4")).wxyz, before)


# --- hand, ball, basket, cameras ---


def test_what_was_not_seen_is_not_shown(scene):
    names = ("/hand", "/ball", "/basket", "/basket_label", "/paths/attractor_now")
    assert [name for name in names if node(scene, name).visible] == []
    scene.move_ball([1.0, 2.0, 3.0])
    scene.move_hand([0.0, 1.0, 1.0], IDENTITY)
    scene.move_basket([2.0, 0.0, 0.4])
    scene.move_attractor([0.5, 0.0, 1.0])
    assert [name for name in names if not node(scene, name).visible] == []
    np.testing.assert_array_equal(node(scene, "/ball").position, [1.0, 2.0, 3.0])
    assert node(scene, "/basket_label").text == "2.00 m, +0°"


def test_the_noise_of_the_cameras_moves_nothing(scene):
    scene.move_basket([2.0, 0.0, 0.4])
    scene.move_basket([2.0002, 0.0, 0.4])
    np.testing.assert_array_equal(node(scene, "/basket").position, [2.0, 0.0, 0.4])
    scene.move_basket([2.0, 0.5, 0.4])
    np.testing.assert_array_equal(node(scene, "/basket").position, [2.0, 0.5, 0.4])


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda s: s.move_ball([1.0, 2.0]), r"ball: give an array \(3,\)"),
        (lambda s: s.move_ball([1.0, 2.0, np.nan]), "ball: .* not finite"),
        (lambda s: s.move_hand(np.zeros(3), np.zeros(4)), "hand: quaternion 0 has norm 0"),
        (lambda s: s.move_basket(np.zeros((1, 3))), r"basket: give an array \(3,\)"),
        (
            lambda s: s.extend_path("ball", np.zeros(3)),
            r"path of the ball: give an array \(n, 3\)",
        ),
        (
            lambda s: s.extend_path("foot", np.zeros((1, 3))),
            "no path of a 'foot': choose one of ball, hand, attractor",
        ),
        (lambda s: s.show("moon", True), "no group 'moon'"),
        (
            lambda s: s.show_gaussians(
                "a", np.zeros((2, 3)), np.tile(IDENTITY, (2, 1)), np.ones((1, 3))
            ),
            "2 centres need as many",
        ),
        (
            lambda s: s.show_gaussians("a", np.zeros((1, 3)), IDENTITY[None], -np.ones((1, 3))),
            "none of them negative",
        ),
        (
            lambda s: s.show_gaussians("a", np.zeros((1, 3)), np.ones((1, 4)), np.ones((1, 3))),
            "quaternion 0 has norm 2",
        ),
    ],
)
def test_what_cannot_be_shown_is_refused_with_its_name(scene, call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call(scene)


def test_cameras_look_where_they_look(scene):
    cameras = [
        Camera([4.0, 2.5, 2.8], [0.9, -0.2, 1.2]),
        Camera([-1.8, -0.8, 2.8], [1.2, 0.1, 1.1]),
    ]
    scene.show_cameras(cameras)
    handle = node(scene, "/cameras/all")
    np.testing.assert_allclose(
        handle.batched_positions, [[4.0, 2.5, 2.8], [-1.8, -0.8, 2.8]], atol=1e-6
    )
    forward = Rotation.from_quat(np.roll(handle.batched_wxyzs, -1, axis=1)).apply([0.0, 0.0, 1.0])
    wanted = np.array([camera.look_at - camera.position for camera in cameras])
    np.testing.assert_allclose(
        forward, wanted / np.linalg.norm(wanted, axis=1, keepdims=True), atol=1e-6
    )
    scene.show_cameras(cameras[:1])
    assert len(node(scene, "/cameras/all").batched_positions) == 1
    scene.show_cameras([])
    assert node(scene, "/cameras/all") is None


def test_groups_are_switched_off(scene):
    scene.show("cameras", False)
    assert not node(scene, "/cameras").visible
    scene.show("cameras", True)
    assert node(scene, "/cameras").visible


# --- what is learned ---


def some_mixture(n=5, seed=0):
    """Over t, x, y, z, alpha, beta."""
    rng = np.random.default_rng(seed)
    factors = rng.normal(size=(n, 6, 6)) * 0.1
    return GaussianMixture.from_parameters(
        np.full(n, 1 / n),
        rng.normal(size=(n, 6)),
        factors @ factors.transpose(0, 2, 1) + 1e-4 * np.eye(6),
    )


def test_ellipsoids_have_the_eigenvalues_and_axes_of_the_covariances(scene):
    mixture = some_mixture()
    scene.show_gaussians(
        "components",
        *(np.array(part) for part in zip(*component_ellipsoids(mixture, 2.0), strict=True)),
    )
    handle = node(scene, "/gaussians/components")
    assert len(handle.batched_positions) == 5
    np.testing.assert_allclose(handle.batched_positions, mixture.means_[:, 1:4], atol=1e-6)
    covariances = mixture.covariances_[:, 1:4, 1:4]
    eigenvalues = np.linalg.eigvalsh(covariances)
    np.testing.assert_allclose(
        np.sort(handle.batched_scales, axis=1), 4.0 * np.sqrt(eigenvalues), rtol=1e-5
    )
    turns = Rotation.from_quat(np.roll(handle.batched_wxyzs, -1, axis=1)).as_matrix()
    shapes_ = turns @ (
        np.square(handle.batched_scales / 4.0)[:, :, None] * turns.transpose(0, 2, 1)
    )
    np.testing.assert_allclose(shapes_, covariances, atol=1e-6)
    reach = np.linalg.norm(handle.vertices, axis=1)
    np.testing.assert_allclose(reach, 0.5, atol=1e-6)  # scales are diameters


def test_each_group_of_gaussians_keeps_its_colour_and_is_replaced_as_a_whole(scene):
    centres, turns = np.zeros((3, 3)), np.tile(IDENTITY, (3, 1))
    scene.show_gaussians("frame_1", centres, turns, np.ones((3, 3)))
    scene.show_gaussians("frame_2", centres, turns, np.ones((3, 3)))
    first, second = (node(scene, f"/gaussians/frame_{k}").batched_colors.tolist() for k in (1, 2))
    assert first != second
    scene.show_gaussians("frame_1", centres[:2], turns[:2], np.ones((2, 3)))
    assert len(node(scene, "/gaussians/frame_1").batched_positions) == 2
    assert node(scene, "/gaussians/frame_1").batched_colors.tolist() == first
    scene.show_gaussians("frame_1", centres[:0], turns[:0], np.ones((0, 3)))
    assert (
        node(scene, "/gaussians/frame_1") is None and node(scene, "/gaussians/frame_2") is not None
    )


def test_demonstrations_are_curves_that_are_not_joined(scene):
    def one(name, n, target):
        time = np.arange(n) * 0.01
        way = np.column_stack([time, np.zeros(n), np.ones(n)])
        return throw_demonstration(
            id=name,
            target=target,
            hand_time=time,
            hand_position=way,
            hand_quaternion=np.tile(IDENTITY, (n, 1)),
        )

    scene.show_demonstrations([one("a", 11, [2.0, 0.0, 0.4]), one("b", 6, [1.5, 0.5, 0.4])])
    lines = node(scene, "/demonstrations/hand").points
    assert lines.shape == (15, 2, 3)
    np.testing.assert_allclose(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1), 0.01, atol=1e-6)
    np.testing.assert_allclose(
        node(scene, "/demonstrations/targets").points,
        [[2.0, 0.0, 0.4], [1.5, 0.5, 0.4]],
        atol=1e-3,
    )
    scene.show_demonstrations([])
    assert node(scene, "/demonstrations/hand").points.shape == (0, 2, 3)


def test_a_path_is_thinned_and_begins_anew_at_a_jump(scene):
    scene.extend_path(
        "ball", np.column_stack([np.linspace(0.0, 1.0, 1001), np.zeros(1001), np.ones(1001)])
    )
    lines = node(scene, "/paths/ball").points
    assert 90 <= len(lines) <= 101
    np.testing.assert_allclose(lines[1:, 0], lines[:-1, 1])
    scene.extend_path("ball", np.array([[5.0, 0.0, 0.0], [5.1, 0.0, 0.0]]))
    np.testing.assert_allclose(
        node(scene, "/paths/ball").points, [[[5.0, 0.0, 0.0], [5.1, 0.0, 0.0]]], atol=1e-6
    )
    scene.clear_path("ball")
    assert len(node(scene, "/paths/ball").points) == 0


def test_a_trail_keeps_its_newest_points():
    trail = Trail(step=0.5, jump=10.0, capacity=4)
    assert trail.extend(np.arange(18.0).reshape(6, 3))
    assert not trail.extend(np.array([[15.0, 16.0, 17.1]]))
    np.testing.assert_array_equal(trail.segments, segments(np.arange(6.0, 18.0).reshape(4, 3)))


# --- the basket ---


def test_stripes_share_a_path_by_turns():
    x = np.arange(301) * STRIPE / 100.0 + 1e-9
    pieces = segments(np.column_stack([x, np.zeros((301, 2))]))
    first, second = stripes(pieces)
    assert len(first) + len(second) == 300
    np.testing.assert_allclose(second[[0, -1], 0, 0], [STRIPE, 1.99 * STRIPE], atol=0.02 * STRIPE)
    assert [len(one) for one in stripes(np.empty((0, 2, 3)))] == [0, 0]


def test_the_nearest_place_of_the_region_is_the_nearest_of_many():
    region, rng = Region(1.5, 2.5, 0.6, 0.4), np.random.default_rng(1)
    distances, azimuths = np.meshgrid(np.linspace(1.5, 2.5, 401), np.linspace(-0.6, 0.6, 401))
    many = np.column_stack(
        [(distances * np.cos(azimuths)).ravel(), (distances * np.sin(azimuths)).ravel()]
    )
    for point in rng.uniform(-4.0, 4.0, (60, 2)):
        place = nearest_in(region, point)
        least = np.linalg.norm(many - point, axis=1).min()
        assert np.linalg.norm(place[:2] - point) == pytest.approx(least, abs=5e-3), point
        assert place[2] == 0.4
        np.testing.assert_allclose(nearest_in(region, place), place, atol=1e-12)
    with pytest.raises(ValueError, match="finite coordinates"):
        nearest_in(region, [np.nan, 0.0])
    edge = outline(region)
    np.testing.assert_array_equal(edge[0], edge[-1])
    np.testing.assert_allclose(np.hypot(edge[:, 0], edge[:, 1])[[0, -2]], [1.5, 2.5])


def test_the_pointer_is_followed_on_the_plane_where_the_basket_was_taken():
    eye = np.array([0.0, -5.0, 2.0])
    point = on_plane(eye, np.array([0.5, -2.5, 1.2]), 0.4)
    np.testing.assert_allclose(point, [1.0, 0.0, 0.4])
    assert on_plane(eye, np.array([0.0, 0.0, 2.0]), 0.4) is None, "along the plane"
    assert on_plane(eye, np.array([0.0, 0.0, 3.0]), 0.4) is None, "into the sky"
    assert on_plane(eye, np.full(3, np.nan), 0.4) is None


def test_a_dragged_basket_is_asked_for_inside_the_region(page, asked, scene):
    scene.move_basket([2.0, 0.0, 0.4])
    taken = np.array([2.0, -0.16, 0.2])  # at its wall
    page.drag("/basket", taken, taken + [0.1, 0.2, 0.0], let_go=False)
    page.wait_for(lambda: len(asked) == 2, what="a place")
    assert asked[-1].what == "place_basket" and not asked[-1].values["done"]
    np.testing.assert_allclose(asked[-1].values["place"], [2.1, 0.2, 0.4], atol=1e-9)
    assert node(scene, "/basket_wanted").visible
    scene.move_basket([1.8, 0.0, 0.4])
    np.testing.assert_allclose(node(scene, "/basket_wanted").position, [2.1, 0.2, 0.4], atol=1e-9)
    scene.move_basket([2.0, 0.0, 0.4])
    page.drag("/basket", taken, [9.0, -0.16, 0.2])
    page.wait_for(lambda: asked[-1].values["done"], what="the end of the drag")
    np.testing.assert_allclose(asked[-1].values["place"], [2.5, 0.0, 0.4], atol=1e-9)
    assert not node(scene, "/basket_wanted").visible


def test_a_pointer_in_the_sky_leaves_the_basket_where_it_was_dragged_to(page, asked, scene):
    scene.move_basket([2.0, 0.0, 0.4])
    page.drag("/basket", [2.0, 0.0, 0.4], [2.2, 0.0, 0.4], [2.2, 0.0, 5.0])
    page.wait_for(lambda: asked and asked[-1].values["done"], what="the end of the drag")
    np.testing.assert_allclose(asked[-1].values["place"], [2.2, 0.0, 0.4], atol=1e-9)


# --- the controls ---


@pytest.mark.parametrize(
    ("label", "what", "values"),
    [
        ("Teach", "teach", {"demonstrations": 13}),
        ("Learn", "learn", {"configuration": "default"}),
        ("Throw", "throw", {}),
        ("Practise", "practice", {"throws": 10, "follow_basket": False}),
        ("Stop", "stop", {}),
        ("Reset after a stop", "reset", {}),
    ],
)
def test_a_click_asks_for_what_the_button_says(page, asked, label, what, values):
    page.click(label)
    page.wait_for(lambda: asked, what="the request")
    assert asked == [view.Request(what, values)]


def test_a_click_takes_the_sliders_with_it_and_cuts_what_no_slider_says(page, asked):
    page.set("Lessons", 5)
    page.set("Model", "two_frames")
    page.set("Own throws", 7)
    page.set("Only here", True)
    for label in ("Teach", "Learn", "Practise"):
        page.click(label)
    page.wait_for(lambda: len(asked) == 3, what="three requests")
    by_kind = {request.what: request.values for request in asked}
    assert by_kind["teach"] == {"demonstrations": 5}
    assert by_kind["learn"] == {"configuration": "two_frames"}
    assert by_kind["practice"] == {"throws": 7, "follow_basket": True}
    page.set("Lessons", 10**9)
    page.click("Teach")
    page.wait_for(lambda: len(asked) == 4, what="the fourth request")
    assert asked[-1].values == {"demonstrations": 30}


def test_only_stopping_is_possible_while_something_is_under_way(page, scene):
    starting = ("Teach", "Learn", "Throw", "Practise")
    scene.panel.count_shown(2)
    scene.panel.welcome_a_model()
    scene.panel.set_busy(True)
    page.wait_for(
        lambda: all(page.is_disabled(label) for label in starting), what="disabled buttons"
    )
    assert not page.is_disabled("Stop")
    scene.panel.set_busy(False)
    page.wait_for(
        lambda: not any(page.is_disabled(label) for label in starting), what="enabled buttons"
    )


def test_buttons_are_off_until_they_can_work(page, scene):
    def off():
        labels = ("Teach", "Learn", "Throw", "Practise", "Reset after a stop")
        return [label for label in labels if page.is_disabled(label)]

    page.wait_for(
        lambda: off() == ["Learn", "Throw", "Practise", "Reset after a stop"], what="off"
    )
    scene.panel.count_shown(2)
    page.wait_for(lambda: off() == ["Throw", "Practise", "Reset after a stop"], what="Learn")
    scene.panel.welcome_a_model()
    page.wait_for(lambda: off() == ["Reset after a stop"], what="Throw and Practise")
    stopped = view.NodeStatus("commander", 1, "holding, stopped: call /commander/reset")
    scene.panel.show_nodes([stopped])
    page.wait_for(lambda: off() == [], what="Reset")
    scene.panel.show_nodes([view.NodeStatus("commander", 0, "holding")])
    page.wait_for(lambda: off() == ["Reset after a stop"], what="no Reset")


def test_what_a_page_cannot_have_sent_costs_its_connection_and_a_line(page, caplog):
    """It wrote a traceback, as if something of ours had failed."""
    page.send_bytes(bytes([0, 255, 19]))
    with pytest.raises(ConnectionClosed):
        page.wait_for(lambda: False, limit=20.0)
    assert "a connection to the page was closed: DecodeError: MessagePack" in caplog.text
    assert "Traceback" not in caplog.text


def test_knobs_are_numbers_of_a_node_and_a_change_is_asked_for(page, asked, scene):
    knob = view.Knob("friction_scale", "factor on the joint friction", 0.0, 10.0, 1.0)
    scene.panel.add_knobs("/wam_simulator", [knob])
    page.set("friction scale", 2.0)
    page.wait_for(lambda: asked, what="the request")
    assert asked == [
        view.Request("set", {"node": "/wam_simulator", "name": "friction_scale", "value": 2.0})
    ]
    scene.panel.add_knobs("/wam_simulator", [view.Knob("friction_scale", "", 0.0, 10.0, 3.0)])
    page.wait_for(
        lambda: page.controls[page._uuid("friction scale")].get("value") == 3.0,
        what="the new value",
    )
    assert len(asked) == 1, "what a node says is no request"


def test_a_knob_has_its_unit_and_all_of_them_go_back_to_what_they_were(page, asked, scene):
    turn = view.Knob("base_turn", "of the arm's base about the vertical [rad]", -1.0, 1.0, 0.1)
    scene.panel.add_knobs(
        "/wam_simulator",
        [turn, view.Knob("friction_scale", "factor on the joint friction", 0.0, 10.0, 1.0)],
    )
    page.set("base turn [rad]", 0.3)
    page.wait_for(lambda: asked, what="the request")
    page.click("As they were at first")
    page.wait_for(
        lambda: len(asked) == 2, what="the request for what was changed, and for nothing else"
    )
    assert asked[1] == view.Request(
        "set", {"node": "/wam_simulator", "name": "base_turn", "value": 0.1}
    )


def test_a_visitor_is_told_what_to_press_and_there_is_room_for_it(page, scene):
    page.wait_for(
        lambda: page.says("Press Teach") and page.says("Then press Learn, then Throw"),
        what="the first words",
    )
    assert page.says("Drag the basket to put it elsewhere.")
    (style,) = (text for text in page.texts.values() if "<style>" in text)
    assert re.search(r"\.ds-says {\s*height: ", style), (
        "of a fixed height: what wraps moves nothing"
    )
    labels = [
        one["label"]
        for one in sorted(page.controls.values(), key=lambda one: one.get("order", 0.0))
    ]
    assert labels[:2] == ["Stop", "Reset after a stop"], "above whatever may change"


def test_a_page_of_a_learned_skill_does_not_ask_for_lessons_first(page, scene):
    """A graph that was started with a model said "Press Teach"; what goes on is not written over."""
    page.wait_for(lambda: page.says("Press Teach"), what="the first words")
    scene.panel.welcome_a_model()
    page.wait_for(
        lambda: page.says("A model is there: press Throw, or Teach"), what="that it is learned"
    )
    scene.panel.say("a throw is under way")
    scene.panel.welcome_a_model()
    page.wait_for(lambda: page.says("a throw is under way"), what="what goes on")
    assert not page.says("A model is there")


def test_the_panel_follows_the_choice_of_dark_and_fits_a_telephone(page):
    page.wait_for(lambda: page.says("Press Teach"), what="the panel")
    assert page.says("@media (prefers-color-scheme: dark)") and page.says(
        "@media (max-width: 40rem)"
    )


def test_no_word_is_of_a_mouse_alone_where_a_finger_does_it_too():
    for name in skill_names():
        assert "mouse" not in load_skill(name).words.welcome


@pytest.mark.parametrize(
    ("width", "height"), [(390, 844), (360, 740), (390, 380), (800, 1200), (800, 900), (1280, 900)]
)
def test_all_that_is_seen_at_first_fits_into_the_window(scene, width, height):
    """The hand was beyond the edge of a telephone, whose page is told to be as high as the screen,
    and gives the panel a part of it.
    """
    eye, looked_at = scene.first_sight
    camera = SimpleNamespace(aspect=width / height, position=eye, look_at=looked_at)
    scene._step_back(SimpleNamespace(camera=camera))
    height = 0.45 * height if width < 500 < height else height
    seen = np.vstack([outline(scene.region), [-0.8, 0.0, 1.4], [0.0, 0.0, 2.1]])
    pixels = project(seen, camera.position, camera.look_at, (width, height))
    assert (pixels > 0).all() and (pixels < [width, height]).all(), pixels
    assert (camera.position is eye) == (width == 1280), "a wide window is looked into as ever"


def test_nodes_and_words_are_shown_as_text(page, scene):
    scene.panel.show_nodes(
        [
            view.NodeStatus("coach", 0, "waiting"),
            view.NodeStatus("arm", 1, "<script>alert(1)</script>"),
        ]
    )
    scene.panel.say("a < b", is_error=True)
    page.wait_for(lambda: page.says("waiting") and page.says("a &lt; b"), what="status and words")
    assert page.says("warning: &lt;script&gt;") and not page.says("<script>")


def test_the_legend_names_every_group_of_gaussians(page, scene):
    for group in ("frame_1", "frame_2"):
        scene.show_gaussians(group, np.zeros((1, 3)), IDENTITY[None], np.ones((1, 3)))
    scene.panel.show_legend()
    page.wait_for(
        lambda: page.says("Gaussians: frame_1") and page.says("Gaussians: frame_2"),
        what="the legend",
    )
    assert len(set(scene.gaussian_colours.values())) == 2
    page.set("frame_2", False)
    page.wait_for(
        lambda: not node(scene, "/gaussians/frame_2").visible, what="one group switched off"
    )
    scene.show_gaussians("frame_2", np.zeros((2, 3)), np.tile(IDENTITY, (2, 1)), np.ones((2, 3)))
    assert not node(scene, "/gaussians/frame_2").visible, (
        "it stays off when the model is learned again"
    )
    assert node(scene, "/gaussians/frame_1").visible


def test_beside_the_product_the_gaussians_of_its_frames_are_hidden_until_they_are_switched_on(
    page, scene
):
    for group in ("components", "frame_1", "frame_2"):
        scene.show_gaussians(group, np.zeros((1, 3)), IDENTITY[None], np.ones((1, 3)))
    scene.panel.show_legend()
    assert [
        node(scene, f"/gaussians/{group}").visible
        for group in ("components", "frame_1", "frame_2")
    ] == [True, False, False]
    page.set("frame_2", True)
    page.wait_for(lambda: page.says("Gaussians: frame_2"), what="the legend")
    assert node(scene, "/gaussians/frame_2").visible and not page.says("Gaussians: frame_1")


def test_the_curve_has_a_point_for_each_throw_in_one_of_its_two_colours(scene, asked):
    scene.panel.add_throw(0.01, True)
    scene.panel.add_throw(0.20, False)
    scene.panel.add_throw(np.nan, False)
    numbers, inside, missed = scene.panel._curve.data
    np.testing.assert_array_equal(numbers, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(inside, [1.0, np.nan, np.nan])
    np.testing.assert_allclose(missed, [np.nan, 20.0, np.nan])
    assert scene.panel._curve.visible and scene.panel._curve.scales["y"]["max"] == pytest.approx(
        22.0
    )


# --- the server ---


@pytest.mark.parametrize(
    ("headers", "own"),
    [
        ({"Host": "127.0.0.1:8080"}, True),
        ({"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:8080"}, True),
        ({"Host": "localhost:9000", "Origin": "http://localhost:9000"}, True),  # forwarded by ssh
        ({"Host": "[::1]:8080", "Origin": "http://[::1]:8080"}, True),
        ({"Host": "127.0.0.1:8080", "Origin": "http://example.org"}, False),
        ({"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:9999"}, False),
        ({"Host": "127.0.0.1:8080", "Origin": "null"}, False),
        # a name that was given to this machine
        (
            {"Host": "example.org:8080", "Origin": "http://example.org:8080"},
            False,
        ),
        ({"Origin": "http://example.org"}, False),
    ],
)
def test_only_pages_of_this_server_may_open_its_websocket(headers, own):
    assert view.is_own_page(headers) is own


def test_a_page_of_another_origin_is_turned_away_before_it_can_click(server, asked):
    with pytest.raises(InvalidStatus) as refused:
        PageClient(view.url_of(server), origin="http://example.org")
    assert refused.value.response.status_code == 403
    assert b"pages of other origins" in refused.value.response.body
    with PageClient(view.url_of(server)) as program:
        program.click("Stop")
        program.wait_for(lambda: asked, what="the request of a program")


def test_only_who_has_the_token_is_let_in():
    server, asked = view.open_server(token="xyzzy"), []
    try:
        url = view.url_of(server)
        view.Panel(server, view.Scene(server), asked.append)
        for wrong in (url, view.with_token(url, "xyzz"), view.with_token(url, "xyzzy/more")):
            with pytest.raises(InvalidStatus) as refused:
                PageClient(wrong)
            assert refused.value.response.status_code == 403 and not asked
            assert b"dart-skill status" in refused.value.response.body
        with PageClient(view.with_token(url, "xyzzy"), origin=url) as page:
            page.click("Stop")
            page.wait_for(lambda: asked, what="the request of the page")
    finally:
        server.stop()


def _fetched(url):
    """Status and text of a page."""
    try:
        with urllib.request.urlopen(url, timeout=30) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def test_the_tab_has_the_title_of_the_page(server):
    status, text = _fetched(view.url_of(server))
    assert status == 200 and "<title>dart_skill</title>" in text and "Viser</title>" not in text
    assert len(text) > 100_000, "not the page of viser"


def test_a_page_without_its_token_says_what_is_missing():
    server = view.open_server(token="xyzzy", title="arm <1>")
    try:
        url = view.url_of(server)
        for wrong, missing in (
            (url, "This address lacks the token"),
            (view.with_token(url, "xyzz"), "The token in this address is not that of the page"),
        ):
            status, text = _fetched(wrong)
            assert status == 403 and missing in text and "dart-skill status" in text
            assert "<title>arm &lt;1&gt;</title>" in text
            assert "xyzz" not in text
        status, text = _fetched(view.with_token(url, "xyzzy"))
        assert status == 200 and "<title>arm &lt;1&gt;</title>" in text
        assert _fetched(f"{url}/nothing")[0] == 404
    finally:
        server.stop()


@pytest.mark.parametrize("path", ["a" * 7000, "a" * 300, "a/" * 3000, "%00"])
def test_a_path_that_can_be_no_file_is_not_found(server, path):
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(f"{view.url_of(server)}/{path}", timeout=20)
    assert refused.value.code == 404


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        ({"value": "text"}, "could not convert string to float: 'text'"),
        ({"nothing": 1}, "a message of a page is ignored: AssertionError"),
    ],
)
def test_a_message_that_cannot_be_used_is_said_in_a_line(server, caplog, sent, said):
    slider = server.gui.add_slider("pace", min=0.0, max=1.0, step=0.1, initial_value=0.5)
    with PageClient(view.url_of(server)) as page:
        page.send(_messages.GuiUpdateMessage(slider._impl.uuid, sent))
        page.wait_for(lambda: said in caplog.text, what="a line in the log")
    assert "Traceback" not in caplog.text and slider.value == 0.5


def test_there_is_no_public_address(server):
    assert server.request_share_url() is None


def test_it_listens_on_this_machine_alone_and_on_no_port_but_the_wanted_one(server):
    assert view.url_of(server) == f"http://127.0.0.1:{server.get_port()}"
    with pytest.raises(
        view.ViewUnavailable, match=f"127.0.0.1:{server.get_port()} cannot be served"
    ):
        view.open_server(port=server.get_port())
    with pytest.raises(view.ViewUnavailable, match="port = 70000"):
        view.open_server(port=70000)


def test_without_viser_the_package_to_install_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(view.ViewUnavailable, match=r"pip install 'dart_skill\[view\]"):
        view.open_server()


def test_importing_the_view_needs_neither_viser_nor_ros():
    program = (
        "import sys, dart_skill.view; print([name for name in ('viser', 'rclpy', 'matplotlib') if"
        " name in sys.modules])"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )


def test_a_stopped_server_gives_its_port_back():
    server = view.open_server()
    port = server.get_port()
    server.stop()
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
                return
            except OSError:
                time.sleep(0.05)
    pytest.fail(f"port {port} is still taken")
