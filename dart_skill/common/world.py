"""The world that nodes, judge and figures agree on: frame, tracked bodies, basket, region and
ball, from config/world.yaml.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from dart_skill.common.arm_choice import joint_names
from dart_skill.common.configuration import (
    arm_name,
    chosen_folder,
    description_path,
    world_parameters,
)

ROLES = ("hand", "ball", "basket")
"""What a tracked body is in a throw."""
THROW = "throw"
"""Name of the skill of throws at baskets."""
THROW_BODIES = ("ball", "basket")
"""Roles of what is thrown, and of what it is thrown at."""
DEMONSTRATION_TOPIC = "/demonstrations"
"""Topic of what was shown."""
MARK_TOPIC = "/demonstration_marks"
"""Topic of which of it is left out."""


@dataclass(frozen=True)
class World:
    """The entries of config/world.yaml.

    Parameters
    ----------
    arm
        Its name in config/arms/, or the path of its file.
    skill
        Its name.
    frame_id
        Frame of all poses.
    hand_body, ball_body, basket_body
        Names of the tracked bodies.
    watch_time
        How long a flight is watched at most [s].
    basket_radius
        Of its rim [m].
    basket_depth
        From the rim to the floor of the basket [m].
    board_position
        Of the bull of a dart board that faces the base axis (3,) [m].
    near, far, side
        The region that baskets stand in: distances straight ahead [m] and largest angle to a side
        [rad].
    rim
        Height of the rim [m].
    ball_mass
        [kg].
    ball_diameter
        [m].
    ball_restitution
        Share of its speed that is left after it bounced.
    ball_drag_coefficient
        Of a sphere, without a unit.
    ball_inertia
        About any axis through its centre [kg m^2].
    """

    arm: str
    skill: str
    frame_id: str
    hand_body: str
    ball_body: str
    basket_body: str
    watch_time: float
    basket_radius: float
    basket_depth: float
    board_position: tuple[float, float, float]
    near: float
    far: float
    side: float
    rim: float
    ball_mass: float
    ball_diameter: float
    ball_restitution: float
    ball_drag_coefficient: float
    ball_inertia: float

    @property
    def watch_ns(self) -> int:
        """`watch_time` [ns]."""
        return round(self.watch_time * 1e9)

    def body(self, role: str) -> str:
        """Name of the tracked body with a role in a skill; one that is not named here is called
        like its role.
        """
        return {"hand": self.hand_body, "ball": self.ball_body, "basket": self.basket_body}.get(
            role, role
        )

    def pose_topics(self) -> dict[str, str]:
        """Topic of the poses of each role."""
        return {role: pose_topic(self.body(role)) for role in ROLES}


def the_world() -> World:
    """The world of config/world.yaml, for the arm of this process.

    Raises
    ------
    ConfigurationError
        If an entry is missing, or one is not known.
    """
    return _world(arm_name(), chosen_folder())


@lru_cache(maxsize=4)
def _world(_arm: str, _folder: str) -> World:
    entries = world_parameters()
    return World(**{**entries, "board_position": tuple(entries["board_position"])})


def pose_topic(body: str) -> str:
    """Topic on which the driver of the motion capture, vrpn_mocap, publishes the poses of a body."""
    return f"/vrpn_mocap/{body}/pose"


@lru_cache(maxsize=64)
def joint_order(names: tuple[str, ...], wanted: tuple[str, ...] = ()) -> list[int] | slice:
    """Where the arm's joints are among the names of a joint state, which may have more: indices,
    or a slice if they are the first in order.

    Parameters
    ----------
    names
        Of the joint state.
    wanted
        Names of the arm's joints, default those of the arm of this process.

    Raises
    ------
    ValueError
        Names the first joint that is missing, or is named twice.
    """
    wanted = wanted or joint_names()
    if names[: len(wanted)] == wanted and not set(wanted) & set(names[len(wanted) :]):
        return slice(len(wanted))
    for name in wanted:
        if names.count(name) != 1:
            how = "is missing" if name not in names else "is named twice"
            file = "/".join(description_path(arm_name()).parts[-2:])
            remedy = (
                f"name the arm's joints {wanted[0]} to {wanted[-1]} in the driver, or put the"
                f" driver's names into {file}"
            )
            raise ValueError(
                f"joint {name} {how} among {', '.join(names) or 'no names'}: {remedy}"
            )
    return [names.index(name) for name in wanted]
