"""What tools of ROS read of this repository can be read by them: with catkin_pkg, which colcon,
rosdep and bloom read it with.
"""

import re

import pytest

from tests.paths import ROOT

pytest.importorskip("catkin_pkg")
from catkin_pkg.package import parse_package  # noqa: E402

LAUNCHED = ROOT / "nodes/dart_skill_nodes/process/launch_description.py"
PACKAGES = {"dart_skill": ROOT, "dart_skill_msgs": ROOT / "msg_schemas"}


@pytest.mark.parametrize("name", PACKAGES)
def test_the_manifest_is_one_and_warns_of_nothing(name):
    warnings = []
    package = parse_package(str(PACKAGES[name]), warnings=warnings)
    assert (package.name, package.package_format) == (name, 3)
    assert not warnings


def test_launch_files_and_bags_name_what_they_need():
    needed = {dependency.name for dependency in parse_package(str(ROOT)).exec_depends}
    launched = set(re.findall(r'package="(\w+)"', LAUNCHED.read_text(encoding="utf-8"))) - {
        "dart_skill"
    }
    assert launched >= {"robot_state_publisher", "rviz2"}, (
        "what launch files start is not found any more"
    )
    assert launched | {"tf2_msgs", "launch_ros", "dart_skill_msgs"} <= needed
