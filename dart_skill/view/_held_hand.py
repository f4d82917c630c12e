"""The hand of the arm, pulled with the mouse: a ball that can be dragged, the spring between both,
and where a body shall go.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dart_skill.common import palette
from dart_skill.view.geometry import on_plane
from dart_skill.view.shapes import ColouredMesh, sphere

RADIUS = 0.055
"""Radius of the ball that is dragged [m]: larger than the hand, so that the mouse meets it."""
ARM_SPAN = 1.2
"""The ball stays so near to the axis of the base [m]; a plane that is seen from its edge leads
anywhere.
"""
ABOVE = np.array([-0.03, 0.0, 1.1])
"""From the hand to the eye that looks at it from above [m]."""
BESIDE = 1.5
"""Distance from the hand of the eye that looks from the side, at the height of the hand [m]."""
PLUMB = 0.6
"""Length of the line that hangs down from the hand [m]."""


class HeldHand:
    """What is seen of a lesson by pointer. Callbacks run in the server's threads.

    Parameters
    ----------
    server
        A viser.ViserServer.
    parts
        Of the body that is brought somewhere, as they are drawn.
    """

    def __init__(self, server: Any, parts: list[ColouredMesh]):
        self._server, self._grip, self._hand = server, np.zeros(3), np.zeros(3)
        scene, ball = server.scene, sphere(RADIUS)
        self._ball = scene.add_mesh_simple(
            "/pointer",
            ball.vertices.astype(np.float32),
            ball.faces.astype(np.uint32),
            color=palette.ATTRACTOR,
            opacity=0.45,
            visible=False,
            cast_shadow=False,
            receive_shadow=False,
        )
        self._lines = {
            name: scene.add_line_segments(
                f"/pointer_{name}",
                np.empty((0, 2, 3)),
                colour,
                thickness=width,
                thickness_units="screen",
                visible=False,
            )
            for name, colour, width in (
                ("spring", palette.ATTRACTOR, 4.0),
                ("plumb", palette.GREY, 1.5),
            )
        }
        self._goal = scene.add_frame("/goal", show_axes=False, visible=False)
        for number, part in enumerate(parts):
            scene.add_mesh_simple(
                f"/goal/{number}",
                part.mesh.vertices.astype(np.float32),
                part.mesh.faces.astype(np.uint32),
                color=palette.GREEN,
                wireframe=True,
                cast_shadow=False,
                receive_shadow=False,
            )

    @property
    def held(self) -> bool:
        """Whether a person has hold of the hand."""
        return bool(self._ball.visible)

    @property
    def pointer(self) -> np.ndarray:
        """Where the ball is (3,)."""
        return np.array(self._ball.position)

    def take(self, hand: np.ndarray) -> None:
        """Begin at the hand (3,) as it is seen."""
        self._hand = np.array(hand)
        self._ball.position, self._ball.visible = self._hand, True
        for line in self._lines.values():
            line.visible = True
        self._draw()

    def let_go(self) -> None:
        """The lesson has ended."""
        self._goal.visible = self._ball.visible = False
        for line in self._lines.values():
            line.visible = False

    def follow(self, hand: np.ndarray) -> None:
        """The hand is seen at (3,) now."""
        if self.held and np.abs(hand - self._hand).max() > 5e-4:
            self._hand = np.array(hand)
            self._draw()

    def show_goal(self, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Where the body shall go: (3,), (4,)."""
        self._goal.position, self._goal.wxyz, self._goal.visible = (
            position,
            quaternion[[3, 0, 1, 2]],
            True,
        )

    def on_drag(self, callback: Callable[[np.ndarray], None]) -> None:
        """Call with where the ball is dragged to (3,): in the plane that faces the eye; with Shift
        over the ground, at its height.

        Parameters
        ----------
        callback
            Takes the place.
        """

        async def dragged(event: Any) -> None:
            if event.phase == "start":
                self._grip = np.array(event.start_position) - self.pointer
            wanted = self._wanted(
                np.array(event.client.camera.position),
                np.array(event.end_position),
                event.modifier == "shift",
            )
            if wanted is not None and self.held:
                self._ball.position = within_reach(wanted)
                self._draw()
                callback(self.pointer)

        for modifier in (None, "shift"):
            self._ball.on_drag("left", modifier=modifier)(dragged)

    def look(self, from_above: bool) -> None:
        """Turn all pages to the hand: from above, where the mouse moves it over the ground, or
        from the side.
        """
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = (
                eye_of(self.pointer, from_above),
                self.pointer,
            )

    def _wanted(
        self, eye: np.ndarray, pointer: np.ndarray, over_ground: bool
    ) -> np.ndarray | None:
        if not over_ground:
            return pointer - self._grip if np.isfinite(pointer).all() else None
        under = on_plane(eye, pointer, float(self.pointer[2] + self._grip[2]))
        return None if under is None else under - self._grip

    def _draw(self) -> None:
        self._lines["spring"].points = np.array([[self._hand, self.pointer]], dtype=np.float32)
        self._lines["plumb"].points = np.array(
            [[self._hand, self._hand - [0.0, 0.0, PLUMB]]], dtype=np.float32
        )


def eye_of(pointer: np.ndarray, from_above: bool) -> np.ndarray:
    """Where a look at the hand comes from (3,): from above, or level from the side, at a right
    angle to the arm.
    """
    across = np.array([pointer[1], -pointer[0], 0.0]) / max(
        float(np.hypot(pointer[0], pointer[1])), 1e-6
    )
    return pointer + (ABOVE if from_above else BESIDE * across)


def within_reach(place: np.ndarray) -> np.ndarray:
    """The place (3,) itself, or the nearest to it that an arm could reach."""
    span = float(np.hypot(place[0], place[1]))
    return np.append(place[:2] * min(1.0, ARM_SPAN / max(span, 1e-9)), np.clip(place[2], 0.0, 2.5))


def turned(quaternion: np.ndarray, degrees: float) -> np.ndarray:
    """A hand's quaternion (4,) turned about the vertical.

    Parameters
    ----------
    degrees
        To the left, seen from above.
    """
    from scipy.spatial.transform import Rotation  # a report holds no hand, and does without

    return (
        Rotation.from_euler("z", degrees, degrees=True) * Rotation.from_quat(quaternion)
    ).as_quat()


def how_far(lies: np.ndarray, turn: np.ndarray) -> str:
    """How far a body is from where it shall be, as seen from there: (3,) [m] and (3, 3), whose z
    axis points up.

    Parameters
    ----------
    lies, turn
        Place and rotation of the body in the wanted frame.
    """
    from scipy.spatial.transform import Rotation

    degrees = float(np.rad2deg(Rotation.from_matrix(turn).as_rotvec()[2]))
    way = "to the left" if degrees > 0.0 else "to the right"
    height = f"{1e3 * abs(lies[2]):.0f} mm {'above' if lies[2] >= 0.0 else 'below'} it"
    return (
        f"{1e3 * np.hypot(lies[0], lies[1]):.0f} mm beside its place, {height}, turned by"
        f" {abs(degrees):.0f}° {way}"
    )
