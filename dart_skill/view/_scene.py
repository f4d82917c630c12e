"""What is seen: arm, hand, ball, basket, cameras, demonstrations, Gaussians, attractor and paths,
in a viser scene.

Positions are in metres in the world, whose origin is on the floor below the arm's base;
quaternions are x, y, z, w. Methods take arrays, from wherever they come: a running graph, a bag, a
test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.arm import ArmDescription, fixed_transforms, joint_transforms, the_arm
from dart_skill.common import palette
from dart_skill.common.checks import check_unit_quaternions
from dart_skill.common.regions import REGION, Region
from dart_skill.recording import Demonstration
from dart_skill.simulation import Basket
from dart_skill.skills.protocol import Skill
from dart_skill.view._held_hand import HeldHand
from dart_skill.view._page_style import SCENE_SHARE
from dart_skill.view.arm_shapes import fingers, housings
from dart_skill.view.geometry import Trail, nearest_in, on_plane, outline, segments, stripes
from dart_skill.view.shapes import (
    Mesh,
    bucket,
    capsule,
    circle,
    joined,
    parts_of,
    pyramid,
    sphere,
)

if TYPE_CHECKING:
    from dart_skill.simulation import Camera

EYE = np.array([1.9, -5.4, 2.5])
"""Position from which the page looks at first [m]."""
LOOK_AT = np.array([1.9, 0.0, 1.1])
"""Point to which the page looks at first [m]."""
FIELD_OF_VIEW = float(np.deg2rad(50.0))
"""Vertical angle of view of the page [rad]."""
FITS = 1.3
"""What is seen at first fits into a window of this width divided by its height."""
TELEPHONE = 0.6
"""A window that is so narrow for its height is one of a telephone, where the panel takes the lower
part (`_page_style`).
"""
NEAR = np.array([1.75, -1.7, 2.0]), np.array([0.5, 0.0, 1.2])
"""Camera for skills whose bodies are within reach of the arm."""
BEHIND = np.array([-1.0, -1.9, 2.3]), np.array([1.5, 0.0, 1.55])
"""Camera for darts: as the thrower sees the board."""
CAMERA_SIZE = 0.18
"""Length of the pyramid that stands for a camera [m]."""
IN_HAND = 0.2
"""The hand is drawn open while what it moves is farther than this from its tracked body [m]."""
STILL_ANGLE = 2e-3
"""Change of a joint angle below which nothing is sent to the page: less than a pixel [rad]."""
STILL = 2e-3
"""Change of a position below which nothing is sent [m]."""
STILL_TURN = 1e-2
"""Change of a component of a quaternion below which nothing is sent."""
PRODUCT = "components"
"""Gaussians of the product of all task frames. Beside it those of the frames are hidden at first:
of one frame alone they are wide.
"""
GROUPS = {
    "gaussians": "Gaussians",
    "demonstrations": "demonstrations",
    "cameras": "cameras",
    "paths": "paths",
}
"""What can be switched off: the node of the scene, and what a reader calls it."""


class Scene:
    """The things of one arm in a viser scene. What has not been seen yet is not shown.

    Parameters
    ----------
    server
        A viser.ViserServer, see `open_server`.
    description
        Of the arm, default that of config/wam.yaml.
    region
        Where the basket may be put, default that of config/world.yaml.
    basket
        Its shape, default that of config/world.yaml.
    skill
        Whose bodies are shown instead of ball and basket (`Skill.solids`); None: these two.
    """

    _angles: np.ndarray  # of the joints, as they are drawn
    _cameras: Any
    _moved: dict[str, Any]  # nodes of the skill's bodies, by role

    def __init__(
        self,
        server: Any,
        description: ArmDescription | None = None,
        region: Region = REGION,
        basket: Basket | None = None,
        skill: Skill | None = None,
    ):
        self._server, self._scene = server, server.scene
        self._description, self.region, self._basket_shape = (
            description or the_arm(),
            region,
            basket or Basket(),
        )
        self._links: dict[str, Any] = {}
        self._gaussians: dict[str, Any] = {}
        self.bodies = ("ball", "basket") if skill is None else skill.bodies
        self._skill, self._moved = skill, {}
        self._trails = {name: Trail() for name in (*self.bodies[:1], "hand", "attractor")}
        self._grip = np.zeros(3)
        self._light()
        self._add_ground()
        self._add_arm()
        self._add_bodies()
        self._add_paths()
        by_pointer = skill is not None and skill.by_pointer
        self.held_hand = (
            HeldHand(server, parts_of(skill.solids(skill.moves)))
            if skill is not None and by_pointer
            else None
        )

    @property
    def first_sight(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the page looks from and to at first (3,) [m]."""
        if self._skill is None:
            return EYE, LOOK_AT
        return BEHIND if self._skill.world == "board" else NEAR

    # what moves

    def move_arm(self, position: np.ndarray) -> None:
        """Joint angles (7,) [rad]."""
        transforms = joint_transforms(self._description, position)
        angles = np.asarray(position, dtype=float)
        moved = np.abs(angles - self._angles) > STILL_ANGLE
        self._angles = np.where(moved, angles, self._angles)
        for transform, has_moved in zip(transforms, moved, strict=True):
            if has_moved:
                self._links[transform.child].wxyz = _wxyz(transform.quaternion)

    def move_hand(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """The hand as it is tracked: position (3,) and quaternion (4,)."""
        _set_pose("hand", self._hand, position, quaternion)
        self._open_hand()
        if self.held_hand is not None:
            self.held_hand.follow(np.asarray(position, dtype=float))

    def move_body(self, role: str, position: np.ndarray, quaternion: np.ndarray) -> None:
        """A body of the skill as it is tracked: position (3,) and quaternion (4,).

        Raises
        ------
        ValueError
            For a role that the scene does not have.
        """
        if role not in self._moved:
            raise ValueError(
                f"there is no {role} in this scene: choose one of"
                f" {', '.join(self._moved) or 'none'}"
            )
        _set_pose(role, self._moved[role], position, quaternion)
        self._open_hand()

    def move_ball(self, position: np.ndarray) -> None:
        """Its centre (3,)."""
        _place(self._ball, _array("ball", position, 3))
        self._open_hand()

    def _open_hand(self) -> None:
        """Open the fingers, or close them around what is moved, by where both are seen."""
        moved = self._ball if self._skill is None else self._moved.get(self._skill.moves)
        if moved is None or not (moved.visible and self._hand.visible):
            return
        is_open = bool(np.linalg.norm(moved.position - self._hand.position) > IN_HAND)
        for state, mesh in self._fingers.items():
            if mesh.visible != (state == is_open):
                mesh.visible = state == is_open

    def move_basket(self, position: np.ndarray) -> None:
        """The centre of its rim (3,) as it is seen."""
        position = _array("basket", position, 3)
        if not _place(self._basket, position):
            return
        self._label.position, self._label.visible = position + [0.0, 0.0, 0.12], True
        self._label.text = in_words(position)
        if not self._wanted.visible:
            self._wanted.position = position

    def move_attractor(self, position: np.ndarray) -> None:
        """Where the spring pulls the hand (3,)."""
        _place(self._attractor, _array("attractor", position, 3))

    def extend_path(self, name: str, points: np.ndarray) -> None:
        """Add points (n, 3) to the path of the first body, "hand" or "attractor". A jump, as of a
        world that is reset, begins it anew.
        """
        if self._trail(name).extend(_array(f"path of the {name}", points, -1, 3)):
            self._draw_path(name)

    def clear_path(self, name: str) -> None:
        """Forget the path of the first body, "hand" or "attractor"."""
        self._trail(name).clear()
        self._draw_path(name)

    def show_course(self, points: np.ndarray) -> None:
        """The whole way (n, 3) of the first body as a thin line, before it goes there; it replaces
        the one that was shown.
        """
        self._course.points = segments(_array("course", points, -1, 3))

    def _draw_path(self, name: str) -> None:
        lines = self._trails[name].segments
        if name != "hand":
            self._paths[name].points = lines
            return
        on_light, on_dark = stripes(lines)
        self._paths[name].points, self._hand_stripe.points = on_light, on_dark

    # what is learned

    def show_gaussians(
        self, group: str, centres: np.ndarray, quaternions: np.ndarray, diameters: np.ndarray
    ) -> None:
        """Ellipsoids: centres (K, 3), quaternions (K, 4) of their axes, diameters (K, 3) along
        these; they replace those of the group.

        Parameters
        ----------
        group
            Of which task frame they are, or of their product; each has a colour of its own, in the
            order of their first coming.

        Raises
        ------
        ValueError
            If these are not equally many.
        """
        centres, diameters = _array(group, centres, -1, 3), _array(group, diameters, -1, 3)
        if len(diameters) != len(centres) or np.any(diameters < 0.0):
            raise ValueError(
                f"{group}: {len(centres)} centres need as many diameters, none of them negative"
            )
        quaternions = check_unit_quaternions(group, quaternions, len(centres))
        if group in self._gaussians:
            self._gaussians.pop(group).remove()
        if not len(centres):
            return
        if group not in self._numbers and group != PRODUCT and PRODUCT in self._numbers:
            self._hidden.add(group)
        number = self._numbers.setdefault(group, len(self._numbers))
        self._gaussians[group] = self._scene.add_batched_meshes_simple(
            f"/gaussians/{group}", *_parts(self._ellipsoid), _wxyz(quaternions), centres, batched_scales=diameters.astype(np.float32),
            batched_colors=palette.GAUSSIANS[number % len(palette.GAUSSIANS)], opacity=0.35, lod="off", cast_shadow=False,
            receive_shadow=False, visible=group not in self._hidden,
        )  # fmt: skip

    def hide_gaussians(self, groups: Iterable[str]) -> None:
        """Groups that are no more."""
        for group in groups:
            self._gaussians.pop(group).remove()

    @property
    def hidden_gaussians(self) -> frozenset[str]:
        """Groups that are switched off."""
        return frozenset(self._hidden)

    @property
    def gaussian_colours(self) -> dict[str, tuple[int, int, int]]:
        """Colours of the groups that there are."""
        return {
            group: palette.GAUSSIANS[self._numbers[group] % len(palette.GAUSSIANS)]
            for group in self._gaussians
        }

    def show_demonstrations(self, demonstrations: Sequence[Demonstration]) -> None:
        """The hand's way in each, and where each ball was aimed; they replace those that were
        shown.
        """
        self.show_ways(
            [one.hand_position for one in demonstrations],
            np.array([one.target for one in demonstrations]),
        )

    def show_ways(self, ways: Sequence[np.ndarray], places: np.ndarray) -> None:
        """Ways of the hand (n, 3) that were shown, and places (m, 3) for which they were; they
        replace those that were shown.
        """
        self._curves.points = np.concatenate([np.empty((0, 2, 3)), *map(segments, ways)])
        self._targets.points = np.asarray(places, dtype=float).reshape(-1, 3).astype(np.float32)

    def show_cameras(self, cameras: Sequence[Camera]) -> None:
        """Where the cameras of the motion capture stand and look; they replace those that were
        shown.
        """
        if self._cameras is not None:
            self._cameras.remove()
            self._cameras = None
        if not cameras:
            return
        from scipy.spatial.transform import Rotation  # a report shows no cameras, and does without

        axes = np.array([camera.axes.T for camera in cameras])
        self._cameras = self._scene.add_batched_meshes_simple(
            "/cameras/all", *_parts(pyramid(cameras[0].half_angles, CAMERA_SIZE)), _wxyz(Rotation.from_matrix(axes).as_quat()),
            np.array([camera.position for camera in cameras]), batched_colors=palette.CAMERA, opacity=0.5, flat_shading=True,
            lod="off", side="double", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    # what the mouse does

    def on_basket_dragged(self, callback: Callable[[np.ndarray, bool], None]) -> None:
        """Call with the place (3,) in the region that is nearest to where the mouse drags the
        basket, and whether it was let go there.

        The callback runs in the server's thread: hand over to your own.
        """

        async def dragged(event: Any) -> None:
            if event.phase == "start":
                self._grip = np.array(event.start_position) - self._basket.position
            eye, pointer = np.array(event.client.camera.position), np.array(event.end_position)
            under_pointer = on_plane(eye, pointer, self._basket.position[2] + self._grip[2])
            if under_pointer is not None:
                self._wanted.position = nearest_in(self.region, under_pointer - self._grip)
            self._wanted.visible = event.phase != "end"
            callback(self._wanted.position.copy(), event.phase == "end")

        self._basket.on_drag(dragged)

    def show(self, group: str, visible: bool) -> None:
        """Switch one of `GROUPS`, or a group of Gaussians that has been shown, on or off.

        Parameters
        ----------
        visible
            On or off.

        Raises
        ------
        ValueError
            For a group that there is not.
        """
        if group in GROUPS:
            self._groups[group].visible = visible
        elif group in self._numbers:
            if visible:
                self._hidden.discard(group)
            else:
                self._hidden.add(group)
            if group in self._gaussians:
                self._gaussians[group].visible = visible
        else:
            raise ValueError(
                f"there is no group '{group}' to show: choose one of"
                f" {', '.join([*GROUPS, *self._numbers])}"
            )

    # what is in the scene

    def _light(self) -> None:
        # Without image-based light and shadows a machine without a graphics card draws ten times
        # as many pictures a second.
        self._scene.configure_environment_map(None)
        self._scene.configure_default_lights(enabled=False, cast_shadow=False)
        self._scene.add_light_hemisphere(
            "/light/sky", sky_color=(255, 255, 255), ground_color=(150, 150, 150), intensity=1.6
        )
        self._scene.add_light_directional(
            "/light/lamp", intensity=1.6, cast_shadow=False, position=(1.0, -3.0, 4.0)
        )
        camera = self._server.initial_camera
        camera.position, camera.look_at = self.first_sight
        camera.fov = FIELD_OF_VIEW
        self._server.on_client_connect(self._step_back)

    def _step_back(self, client: Any) -> None:
        """On a window that is too narrow for all that is seen at first, look from farther away."""
        aspect = client.camera.aspect
        if 0.0 < aspect < TELEPHONE:
            aspect /= SCENE_SHARE  # the page comes before its style
        if 0.0 < aspect < FITS:
            eye, looked_at = map(np.asarray, self.first_sight)
            # where it looks is set after it, as viser moves that along
            client.camera.position, client.camera.look_at = (
                looked_at + FITS / aspect * (eye - looked_at),
                looked_at,
            )

    def _add_ground(self) -> None:
        self._groups = {
            name: self._scene.add_frame(f"/{name}", show_axes=False) for name in GROUPS
        }
        self._scene.add_grid(
            "/ground/floor", 8.0, 6.0, cell_size=0.5, position=(1.0, 0.0, 0.0), cell_color=palette.FLOOR, section_color=palette.FLOOR,
            cell_thickness=0.3, section_thickness=0.6, shadow_opacity=0.0,
        )  # fmt: skip
        if self._skill is None:
            edge = segments(outline(self.region)) + [0.0, 0.0, 0.005]
            self._scene.add_line_segments(
                "/ground/region", edge, palette.REGION, thickness=2.0, thickness_units="screen"
            )

    def _add_arm(self) -> None:
        # so that every joint moves at first
        self._angles = np.full(len(self._description.joints), np.inf)
        self._scene.add_frame("/arm", show_axes=False)
        paths, capsules = {"world": "/arm"}, self._description.capsules
        base, hand = fixed_transforms(self._description)
        joints = housings(self._description)
        at_zero = joint_transforms(self._description, np.zeros(len(self._description.joints)))
        for one in (base, *at_zero, hand):
            path = paths[one.child] = f"{paths[one.parent]}/{one.child}"
            self._links[one.child] = self._scene.add_frame(
                path, show_axes=False, position=one.translation, wxyz=_wxyz(one.quaternion)
            )
            if shapes := [
                capsule(c.start, c.end, c.radius) for c in capsules if c.link == one.child
            ]:
                colour = palette.FINGERS if one.child == hand.child else palette.ARM
                self._add_mesh(f"{path}/shape", joined(shapes), colour)
            if one.child in joints:
                self._add_mesh(f"{path}/joint", joints[one.child], palette.JOINT)
        self._fingers = {
            is_open: self._add_mesh(
                f"{paths[hand.child]}/{'open' if is_open else 'closed'}",
                fingers(self._description, is_open),
                palette.FINGERS,
                visible=not is_open,
            )
            for is_open in (False, True)
        }
        height = self._description.mount_height
        self._scene.add_cylinder(
            "/ground/mount",
            0.12,
            height,
            color=palette.LIGHT,
            position=(0.0, 0.0, height / 2),
            cast_shadow=False,
        )

    def _add_bodies(self) -> None:
        radius, shape = self._description.ball.radius, self._basket_shape
        self._hand = self._scene.add_frame(
            "/hand", axes_length=0.12, axes_radius=0.006, origin_radius=0.0, visible=False
        )
        self._ball = self._add_mesh("/ball", sphere(radius), palette.BALL, visible=False)
        self._basket = self._add_mesh(
            "/basket",
            bucket(shape.radius, shape.depth, shape.wall),
            palette.BASKET,
            visible=False,
            side="double",
            opacity=0.85,
        )
        self._label = self._scene.add_label(
            "/basket_label", "", visible=False, anchor="bottom-center"
        )
        self._wanted = self._scene.add_line_segments(
            "/basket_wanted",
            segments(circle(shape.radius + shape.wall)),
            palette.BASKET,
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )
        for number, solid in enumerate(
            self._skill.surroundings() if self._skill is not None else ()
        ):
            self._add_mesh(
                f"/surroundings/{number}",
                parts_of([solid])[0].mesh,
                palette.LIGHT,
                flat_shading=True,
            )
        for number, role in enumerate(self.bodies if self._skill is not None else ()):
            self._moved[role] = self._add_solids(
                role, palette.BALL if number == 0 else palette.BASKET
            )
        self._attractor = self._add_mesh(
            "/paths/attractor_now", sphere(0.025), palette.ATTRACTOR, visible=False
        )
        self._ellipsoid = sphere(0.5, 16)
        self._numbers: dict[str, int] = {}
        self._hidden: set[str] = set()
        self._cameras = None

    def _add_paths(self) -> None:
        of_path = dict(
            zip(
                self._trails,
                (*[palette.BALL][: len(self.bodies)], palette.HAND, palette.ATTRACTOR),
                strict=True,
            )
        )
        self._paths = {
            name: self._add_lines(f"/paths/{name}", colour, 3.0)
            for name, colour in of_path.items()
        }
        self._hand_stripe = self._add_lines("/paths/hand_stripe", palette.HAND_STRIPE, 3.0)
        self._course = self._add_lines("/paths/course", palette.BALL, 1.0)
        self._curves = self._add_lines("/demonstrations/hand", palette.DEMONSTRATION, 1.5)
        self._targets = self._scene.add_point_cloud(
            "/demonstrations/targets",
            np.empty((0, 3)),
            palette.DEMONSTRATION,
            point_size=0.04,
            point_shape="diamond",
        )

    def _add_solids(self, role: str, colour: tuple[int, int, int]) -> Any:
        """The solids of a body, hung on a frame that moves."""
        assert self._skill is not None
        frame = self._scene.add_frame(f"/{role}", show_axes=False, visible=False)
        for number, part in enumerate(parts_of(self._skill.solids(role))):
            self._add_mesh(
                f"/{role}/{number}",
                part.mesh,
                part.colour or colour,
                side="double",
                flat_shading=True,
            )
        return frame

    def _add_lines(self, name: str, colour: tuple[int, int, int], thickness: float) -> Any:
        return self._scene.add_line_segments(
            name, np.empty((0, 2, 3)), colour, thickness=thickness, thickness_units="screen"
        )

    def _add_mesh(
        self, name: str, mesh: Mesh, colour: tuple[int, int, int], **options: Any
    ) -> Any:
        return self._scene.add_mesh_simple(
            name, *_parts(mesh), color=colour, cast_shadow=False, receive_shadow=False, **options
        )

    def _trail(self, name: str) -> Trail:
        if name not in self._trails:
            raise ValueError(
                f"there is no path of a '{name}': choose one of {', '.join(self._trails)}"
            )
        return self._trails[name]


def in_words(place: np.ndarray) -> str:
    """Where a basket (3,) stands."""
    return (
        f"{np.hypot(place[0], place[1]):.2f} m, {np.rad2deg(np.arctan2(place[1], place[0])):+.0f}°"
    )


def _array(what: str, values: np.ndarray, *shape: int) -> np.ndarray:
    """Finite numbers of a shape, in which -1 stands for any length; ValueError says what they are
    instead.
    """
    values = np.asarray(values, dtype=float)
    fits = values.ndim == len(shape) and all(
        wanted in (-1, n) for wanted, n in zip(shape, values.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if n < 0 else str(n) for n in shape)
        raise ValueError(
            f"{what}: give an array ({wanted}{',' if len(shape) == 1 else ''}) in metres, got"
            f" {values.shape}"
        )
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{what}: {values} is not finite: leave out what was not seen")
    return values


def _place(node: Any, position: np.ndarray) -> bool:
    """Show a node at a position (3,); whether that changes anything that is worth sending."""
    if node.visible and np.abs(position - node.position).max() < STILL:
        return False
    node.position = position
    if not node.visible:
        node.visible = True
    return True


def _set_pose(what: str, node: Any, position: np.ndarray, quaternion: np.ndarray) -> None:
    """Show a node at a position (3,) with a quaternion (4,), if that is worth sending."""
    position = _array(what, position, 3)
    wxyz = _wxyz(check_unit_quaternions(what, np.asarray(quaternion, dtype=float)[None], 1)[0])
    if _place(node, position) or np.abs(wxyz - node.wxyz).max() > STILL_TURN:
        node.wxyz = wxyz


def _wxyz(quaternion: np.ndarray) -> np.ndarray:
    """Quaternions (..., 4) x, y, z, w in viser's order."""
    return quaternion[..., [3, 0, 1, 2]]


def _parts(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)
