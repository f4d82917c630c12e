"""The arm of this process: what config/world.yaml, or the environment, names."""

from functools import lru_cache

from dart_skill.arm._description import (
    ArmDescription,
    ArmSwing,
    parse_swing,
    read_description,
)
from dart_skill.common.configuration import arm_name, arm_path, description_path, read_yaml


def the_arm() -> ArmDescription:
    """The arm that this process drives, or simulates.

    Raises
    ------
    ValueError
        Names the file, the entry and the remedy, if it is not as it must be.
    """
    return _arm(arm_name())


@lru_cache(maxsize=8)
def _arm(name: str) -> ArmDescription:
    path = description_path(name)
    if path != arm_path(name):
        return read_description(path)
    from dart_skill.arm._described_arm import described  # with Pinocchio, which reads URDFs

    return described(name)


def the_swing() -> ArmSwing:
    """How a person throws with it: as its file says, or as is computed from its limits.

    Raises
    ------
    ValueError
        If it throws nowhere.
    """
    return _swing(arm_name())


@lru_cache(maxsize=8)
def _swing(name: str) -> ArmSwing:
    content = read_yaml(description_path(name))
    if "swing" in content:
        return parse_swing(content["swing"], the_arm().n_joints)
    from dart_skill.arm._throwing_bound import widest_swing  # with Pinocchio

    return widest_swing(name)
