"""Markers as arrays, for viewers, and their colours."""

import numpy as np
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.common.palette import Colour, unit
from dart_skill_nodes.comms import conversions


def marker_colour(colour: Colour, opacity: float = 1.0) -> ColorRGBA:
    """A colour of the palette as markers have it; opacity: from 0 to 1."""
    red, green, blue = unit(colour)
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)


def ellipsoids(
    message: MarkerArray, frame_id: str
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Spheres in a frame by namespace: centres (K, 3), quaternions x, y, z, w (K, 4), diameters
    (K, 3). The rest is left out.

    ValueError for a sphere that is nowhere.
    """
    groups: dict[str, list[Marker]] = {}
    for marker in message.markers:
        if (
            marker.type == Marker.SPHERE
            and marker.action == Marker.ADD
            and marker.header.frame_id == frame_id
        ):
            groups.setdefault(marker.ns, []).append(marker)
    return {name: _arrays(markers) for name, markers in groups.items()}


def _arrays(markers: list[Marker]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    centres = [conversions.place(one.pose.position, f"marker {one.id}") for one in markers]
    quaternions = [
        conversions.unit_quaternion(one.pose.orientation, f"marker {one.id}") for one in markers
    ]
    scales = [conversions.place(one.scale, f"the end of marker {one.id}") for one in markers]
    return np.array(centres), np.array(quaternions), np.array(scales)
