"""The package, in two forms.

* `colcon build --symlink-install --base-paths . msg_schemas` builds the ament_python package: library, nodes, launch files. A node is an
  executable in lib/dart_skill, where `ros2 run` looks. What it depends on stands in package.xml.
* `pip install .` builds a wheel for machines without ROS: the library and its one command, with config/ and the definitions of messages in
  it. What it depends on stands here. Executables of nodes would be commands called `recorder` and `viewer` on everybody's PATH.
"""

import re
import sys
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "dart_skill"
NODES = (
    "wam_simulator",
    "mock_optitrack",
    "demonstration_recorder",
    "skill_learner",
    "commander",
    "effort_bridge",
    "teacher",
    "coach",
    "recorder",
    "bag_player",
    "viewer",
    "composed",
)
COMMAND = f"dart-skill = {PACKAGE}.cli:main"
IN_THE_WHEEL = {"config": ["**/*"], "msg_schemas": ["package.xml", "msg/*", "srv/*", "action/*"]}
"""Folders beside the library that the wheel takes into it, and which of their files."""

CORE = ["numpy>=1.26,<3", "scipy>=1.11,<2", "pyyaml>=6,<7", "mcap>=1.6,<2", "rosbags>=0.11,<0.12", "zstandard>=0.21,<1", "lz4>=4,<5"]
"""Learning, where to aim, and bags (docs/dependencies.md says why each)."""
EXTRAS = {
    # an arm: its kinematics and dynamics, and the world around it
    "sim": [
        "pin>=2.7,<5",
        'pybullet>=3.2.6,<3.3; python_version < "3.12"',
        'pybullet-arm64>=3.2.8,<3.3; python_version >= "3.12"',
        "tqdm>=4.64,<5",
    ],
    "plot": ["matplotlib>=3.7,<4", "tqdm>=4.64,<5"],
    "view": ["viser>=1.1,<1.2"],
    "lerobot": ["pyarrow>=14"],
}


def version() -> str:
    """That of the library."""
    text = Path(PACKAGE, "__init__.py").read_text(encoding="utf-8")
    return re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE).group(1)


def config_files() -> list[tuple[str, list[str]]]:
    """Installs the tree below config/ folder by folder."""
    folders: dict[Path, list[str]] = {}
    for path in sorted(Path("config").rglob("*")):
        if path.is_file():
            folders.setdefault(path.parent, []).append(str(path))
    return [(f"share/{PACKAGE}/{folder}", files) for folder, files in folders.items()]


def of_a_wheel() -> dict:
    """The library alone, and what it reads at run time."""
    return {
        "packages": [*find_packages(include=[PACKAGE, f"{PACKAGE}.*"]), *(f"{PACKAGE}.{folder}" for folder in IN_THE_WHEEL)],
        "package_dir": {f"{PACKAGE}.{folder}": folder for folder in IN_THE_WHEEL},
        "package_data": {PACKAGE: ["py.typed"], **{f"{PACKAGE}.{folder}": files for folder, files in IN_THE_WHEEL.items()}},
        "install_requires": CORE,
        "long_description": Path("README.md").read_text(encoding="utf-8"),
        "long_description_content_type": "text/markdown",
        "entry_points": {"console_scripts": [COMMAND]},
    }


def of_the_workspace() -> dict:
    """Library and nodes, as colcon and `ros2` want them."""
    return {
        "packages": [*find_packages(include=[PACKAGE, f"{PACKAGE}.*"]), *find_packages("nodes")],
        "package_dir": {f"{PACKAGE}_nodes": f"nodes/{PACKAGE}_nodes"},
        "package_data": {PACKAGE: ["py.typed"]},
        "data_files": [
            ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
            (f"share/{PACKAGE}", ["package.xml"]),
            (f"share/{PACKAGE}/launch", [str(path) for path in sorted(Path("launch").glob("*.launch.py"))]),
            *config_files(),
        ],
        "install_requires": ["setuptools"],
        "entry_points": {"console_scripts": [COMMAND, *(f"{node} = {PACKAGE}_nodes.executables.{node}:main" for node in NODES)]},
    }


MAKES_A_WHEEL = bool({"bdist_wheel", "dist_info", "editable_wheel"} & set(sys.argv))
"""What pip and build ask setuptools for; colcon asks for none of these."""

setup(
    name=PACKAGE,
    version=version(),
    description="A robot arm that learns to throw from demonstrations.",
    license="Apache-2.0",
    maintainer="dart_skill maintainers",
    maintainer_email="dart_skill@users.noreply.github.com",
    python_requires=">=3.10,<3.14",
    extras_require=EXTRAS,
    tests_require=["pytest"],
    zip_safe=False,
    **(of_a_wheel() if MAKES_A_WHEEL else of_the_workspace()),
)
