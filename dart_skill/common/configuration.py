"""Where the files of config/ are: in a checkout, in a wheel and in an installed ROS package alike."""

import os
from pathlib import Path


def config_path(name: str) -> Path:
    """Path of a file of config/: in $DART_SKILL_CONFIG, in a wheel, beside the library in a
    checkout, or in a package's share folder.

    Raises
    ------
    FileNotFoundError
        If it is nowhere.
    """
    folders = _folders()
    for folder in folders:
        if (folder / name).is_file():
            return folder / name
    raise FileNotFoundError(
        f"no {name} in {', '.join(map(str, folders))}; set DART_SKILL_CONFIG to the folder that"
        " holds it"
    )


def load_yaml(name: str) -> dict:
    """A YAML file of config/ as nested dictionaries."""
    import yaml  # completion with TAB imports this module and reads nothing

    # The parser in C takes a seventh of the time; a PyYAML that was built without it has the other
    # one only.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    return yaml.load(config_path(name).read_text(encoding="utf-8"), Loader=loader)


def world_parameters() -> dict:
    """The entries of config/world.yaml by name, which are parameters of every node."""
    return dict(load_yaml("world.yaml")["/**"]["ros__parameters"])


def limit_parameters() -> dict:
    """The entries of config/limits.yaml by name, which are parameters of every node that moves the
    arm.
    """
    return dict(load_yaml("limits.yaml")["/**"]["ros__parameters"])


def node_file(node: str) -> str:
    """Name of the file of config/ with the parameters of a node."""
    return "optitrack.yaml" if node == "mock_optitrack" else f"{node}.yaml"


def node_parameters(name: str, node: str) -> dict:
    """Parameters of one node from a ROS parameter file of config/, without ROS; those of world and
    limits that it does not set, too.

    Raises
    ------
    KeyError
        If the file has no section of the node.
    """
    content = load_yaml(name)
    if node not in content:
        raise KeyError(f"{name} has no section '{node}', only {sorted(content)}")
    return {**world_parameters(), **limit_parameters(), **content[node]["ros__parameters"]}


def shared_folders(name: str, package: str, below: str = "") -> list[Path]:
    """Where a folder of the project may be, the likeliest first.

    In the library of a wheel, beside the library in a checkout, or in `share/<package>` of an
    installed ROS package, there `below` it.
    """
    library = Path(__file__).resolve().parents[1]
    prefixes = [
        Path(prefix)
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        if prefix
    ]
    checkout = [library.parent / name] if (library.parent / "package.xml").is_file() else []
    return [
        library / name,
        *checkout,
        *(prefix / "share" / package / below for prefix in prefixes),
    ]


def _folders() -> list[Path]:
    chosen = os.environ.get("DART_SKILL_CONFIG")
    return ([Path(chosen)] if chosen else []) + shared_folders("config", "dart_skill", "config")
