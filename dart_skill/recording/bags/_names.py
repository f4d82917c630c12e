"""Names of message types, as others write them."""

from __future__ import annotations

import re

_DDS = re.compile(r"(\w+)::(msg|srv|action)::(?:dds_::)?(\w+?)_?")


def full_name(type_name: str) -> str:
    """A message type as package/msg/Name, which is also written in two parts, or as DDS does
    (package::msg::dds_::Name_).
    """
    if match := _DDS.fullmatch(type_name):
        return "/".join(match.groups())
    package, slash, name = type_name.partition("/")
    return f"{package}/msg/{name}" if slash and package and name and "/" not in name else type_name
