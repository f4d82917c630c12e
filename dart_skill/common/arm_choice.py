"""The joints of the arm that this process is about, as its file in config/ names them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from dart_skill.common.configuration import arm_name, arm_path, config_path, read_yaml


def joint_names() -> tuple[str, ...]:
    """Names of the joints of the arm, from the base to the hand."""
    return _joint_names(arm_name())


def joint_count() -> int:
    """Number of the joints of the arm."""
    return len(joint_names())


def description_path() -> Path:
    """The file of config/ that describes the arm, and has these names."""
    path = arm_path(arm_name())
    table = str(read_yaml(path).get("urdf", ""))
    return config_path(table) if table.endswith(".yaml") else path


@lru_cache(maxsize=8)
def _joint_names(name: str) -> tuple[str, ...]:
    path = arm_path(name)
    content = read_yaml(path)
    table = str(content.get("urdf", ""))
    if table.endswith(".yaml"):  # the arm is described there, and its URDF written from it
        return tuple(joint["name"] for joint in read_yaml(config_path(table))["joints"])
    joints = content.get("joints")
    if not isinstance(joints, list) or not all(isinstance(one, str) for one in joints):
        raise ValueError(
            f"{path}: joints is {joints!r}; name the joints from the base to the hand, as"
            " `dart-skill arm import` does"
        )
    return tuple(joints)
