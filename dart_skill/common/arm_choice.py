"""The joints of the arm that this process is about, as its file in config/ names them."""

from __future__ import annotations

from functools import lru_cache

from dart_skill.common.configuration import arm_name, arm_path, description_path, read_yaml
from dart_skill.common.entries import ANYTHING, ConfigurationError, Each, Rows


def joint_names() -> tuple[str, ...]:
    """Names of the joints of the arm, from the base to the hand."""
    return _joint_names(arm_name())


def joint_count() -> int:
    """Number of the joints of the arm."""
    return len(joint_names())


@lru_cache(maxsize=8)
def _joint_names(name: str) -> tuple[str, ...]:
    path = description_path(name)
    content = read_yaml(path)
    joints = content.get("joints")
    if path != arm_path(name):
        Rows(Each(ANYTHING)).check(joints, f"{path}: joints")
        joints = [joint.get("name") for joint in content["joints"]]
    if not isinstance(joints, list) or not all(isinstance(one, str) for one in joints):
        raise ConfigurationError(
            f"{path}: joints is {joints!r}; name the joints from the base to the hand, as"
            " `dart-skill arm import` does"
        )
    return tuple(joints)
