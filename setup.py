"""The ament_python package: `colcon build --symlink-install --base-paths . msg_schemas` builds it."""

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


def config_files() -> list[tuple[str, list[str]]]:
    """Installs the tree below config/ folder by folder."""
    folders: dict[Path, list[str]] = {}
    for path in sorted(Path("config").rglob("*")):
        if path.is_file():
            folders.setdefault(path.parent, []).append(str(path))
    return [(f"share/{PACKAGE}/{folder}", files) for folder, files in folders.items()]


setup(
    name=PACKAGE,
    version="0.1.0",
    description="A robot arm that learns to throw from demonstrations.",
    license="Apache-2.0",
    maintainer="dart_skill maintainers",
    maintainer_email="dart_skill@users.noreply.github.com",
    python_requires=">=3.10,<3.14",
    packages=[*find_packages(include=[PACKAGE, f"{PACKAGE}.*"]), *find_packages("nodes")],
    package_data={PACKAGE: ["py.typed"]},
    package_dir={f"{PACKAGE}_nodes": f"nodes/{PACKAGE}_nodes"},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", [str(path) for path in sorted(Path("launch").glob("*.launch.py"))]),
        *config_files(),
    ],
    install_requires=["setuptools"],
    tests_require=["pytest"],
    zip_safe=True,
    entry_points={
        "console_scripts": [
            f"dart-skill = {PACKAGE}.cli:main",
            *(f"{node} = {PACKAGE}_nodes.executables.{node}:main" for node in NODES),
        ],
    },
)
