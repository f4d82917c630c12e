"""Bodies of skills as they are drawn: the solids of a skill, a board with its beds, and a scene of
them.
"""

import numpy as np
import pytest

pytest.importorskip("viser")

from dart_skill import view
from dart_skill.darts import as_target
from dart_skill.skills.protocol import Skill, Solid, load_skill
from dart_skill.view.shapes import BLACK, CREAM, GREEN, RED, parts_of


@pytest.fixture(scope="module")
def server():
    server = view.open_server()
    yield server
    server.stop()


def inside(point, mesh):
    """Whether a point (2,) is in a triangle of a flat mesh, as it is seen along x: y to the left,
    z up.
    """
    corners = mesh.vertices[mesh.faces][..., 1:]
    first, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    proper = np.abs(area) > 1e-12
    away = point - first[proper]
    u = (away[:, 0] * edges[proper, 1, 1] - away[:, 1] * edges[proper, 1, 0]) / area[proper]
    v = (edges[proper, 0, 0] * away[:, 1] - edges[proper, 0, 1] * away[:, 0]) / area[proper]
    return bool(((u > 1e-6) & (v > 1e-6) & (u + v < 1.0 - 1e-6)).any())


@pytest.mark.parametrize(
    ("bed", "colour"),
    [
        ("DB", RED),
        ("S20", BLACK),
        ("T20", RED),
        ("D20", RED),
        ("S1", CREAM),
        ("T1", GREEN),
        ("D1", GREEN),
        ("S6", CREAM),
        ("S18", BLACK),
    ],
)
def test_a_board_has_its_beds_where_the_thrower_sees_them(bed, colour):
    assert colour_at(as_target(bed) + [0.4, 0.3]) == [colour]
    assert colour_at(np.array([10.0, 3.0])) == [GREEN], "about the bull"


def colour_at(point):
    """Colours of the board at a point (2,) [mm] beside the edges of triangles."""
    seen = 1e-3 * point * [-1.0, 1.0]  # y is to the left
    return [part.colour for part in parts_of([Solid("board")])[1:] if inside(seen, part.mesh)]


def test_the_face_of_a_board_is_turned_to_the_thrower():
    for part in parts_of([Solid("board")])[1:]:
        corners = part.mesh.vertices[part.mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (normals[np.linalg.norm(normals, axis=1) > 1e-9][:, 0] < 0.0).all()


def test_a_body_of_which_nothing_is_known_is_a_small_box():
    (part,) = parts_of(())
    np.testing.assert_allclose(np.ptp(part.mesh.vertices, axis=0), 0.04)


def test_a_cup_stands_on_its_origin():
    (part,) = parts_of([Solid("cup", (0.05, 0.06, 0.003))])
    assert part.mesh.vertices[:, 2].min() == pytest.approx(-0.003) and part.mesh.vertices[
        :, 2
    ].max() == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("kind", "lengths", "why"),
    [
        ("cone", (1.0,), "choose one of box"),
        ("box", (1.0,), "3 positive lengths"),
        ("sphere", (0.0,), "1 positive lengths"),
    ],
)
def test_a_solid_that_is_none_is_refused(kind, lengths, why):
    with pytest.raises(ValueError, match=why):
        Solid(kind, lengths)


@pytest.mark.parametrize("name", ["darts", "place", "reach", "stir"])
def test_a_scene_shows_the_bodies_of_its_skill(server, name):
    server.scene.reset()
    skill = load_skill(name)
    scene = view.Scene(server, skill=skill)
    turned = np.array([0.0, 0.0, np.sin(0.2), np.cos(0.2)])
    for role in skill.bodies:
        scene.move_body(role, np.array([0.6, 0.1, 1.2]), turned)
        node = server.scene.get_handle_by_name(f"/{role}")
        np.testing.assert_allclose(node.position, [0.6, 0.1, 1.2])
        np.testing.assert_allclose(node.wxyz, turned[[3, 0, 1, 2]])
    scene.extend_path(skill.bodies[0], np.array([[0.6, 0.1, 1.2], [0.7, 0.1, 1.2]]))
    assert set(skill.bodies) <= {"hand", *scene.bodies}
    with pytest.raises(ValueError, match="there is no basket in this scene: choose one of"):
        scene.move_body("basket", np.zeros(3), turned)


def test_a_foreign_skill_needs_no_solids(server):
    class Press(Skill):
        name, bodies = "press", ("button",)

    server.scene.reset()
    scene = view.Scene(server, skill=Press())
    scene.move_body("button", np.ones(3), np.array([0.0, 0.0, 0.0, 1.0]))


def test_controls_have_the_words_of_their_skill():
    place, darts, throw = (load_skill(name) for name in ("place", "darts", "throw"))
    assert (place.words.do, place.words.trials, place.words.unit) == (
        "Execute",
        "trials",
        ("mm", 1000.0),
    )
    assert place.by_pointer and not place.configurations
    assert (
        darts.words.do == throw.words.do == "Throw"
        and not darts.by_pointer
        and darts.configurations
    )
    assert (darts.words.done, throw.words.done) == ("in the board", "in the basket")
