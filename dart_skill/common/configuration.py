"""Where the files of config/ are: in a checkout, in a wheel and in an installed ROS package alike;
and their values, checked.
"""

import os
from functools import lru_cache
from pathlib import Path
from typing import Any

ARM_VARIABLE = "DART_SKILL_ARM"
"""Environment variable that names the arm, in place of config/world.yaml."""
MOST_NESTED = 30
"""Depth of a YAML file at most: PyYAML's parser in C ends the process with a deep one."""


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
    return read_yaml(config_path(name))


def read_yaml(path: Path) -> dict:
    """A YAML file as nested dictionaries.

    Raises
    ------
    ValueError
        Names the file, the place and the remedy, if it is none.
    """
    try:
        content = _parsed(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is no YAML: {error}") from error
    if not isinstance(content, dict):
        raise ValueError(f"{path} holds no mapping: write one 'name: value' in a line")
    return content


def _parsed(text: str) -> Any:
    """What a YAML text holds; ValueError says in a line where it is none."""
    import yaml  # completion with TAB imports this module and reads nothing

    # The parser in C takes a seventh of the time; a PyYAML that was built without it has the other
    # one only.
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    depth = 0
    try:
        for event in yaml.parse(text, Loader=loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MOST_NESTED:
                line = event.start_mark.line + 1
                raise ValueError(f"line {line} is nested more than {MOST_NESTED} deep")
        return yaml.load(text, Loader=loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ValueError(f"{place}{error.problem or error.context}") from error
    except yaml.reader.ReaderError as error:
        raise ValueError(f"character {error.position + 1}: {error.reason}") from error


def arm_name() -> str:
    """Name of the arm, or path of its file, from the environment or from config/world.yaml."""
    return os.environ.get(ARM_VARIABLE) or _configured_arm(chosen_folder())


def chosen_folder() -> str:
    """The folder that counts instead of config/; empty if none was chosen."""
    return os.environ.get("DART_SKILL_CONFIG", "")


@lru_cache(maxsize=4)
def _configured_arm(_folder: str) -> str:
    """The arm of world.yaml in a folder: it is asked for at every step of an arm."""
    return str(_section("world.yaml", "/**")["arm"])


def arm_names() -> list[str]:
    """Names of the arms in config/arms/."""
    return sorted(path.stem for path in config_path("arms/wam.yaml").parent.glob("*.yaml"))


def arm_path(name: str) -> Path:
    """The file of an arm of config/arms/, or of a path that ends in .yaml.

    Raises
    ------
    ValueError
        If there is none.
    """
    if not name.endswith(".yaml") and name not in arm_names():
        raise ValueError(
            f"no arm '{name}' in config/arms/: there are {', '.join(arm_names())}; give one of"
            " them, or a file that `dart-skill arm import` wrote"
        )
    return Path(name) if name.endswith(".yaml") else config_path(f"arms/{name}.yaml")


def description_path(name: str) -> Path:
    """The file of config/ that describes an arm: its own, or the table that it names in the place of
    a URDF, which is written from that.
    """
    path = arm_path(name)
    table = str(read_yaml(path).get("urdf", ""))
    return config_path(table) if table.endswith(".yaml") else path


def of_the_arm(what: str, name: str) -> dict:
    """What the file of the arm sets in place of the files of config/.

    Parameters
    ----------
    what
        "parameters" of nodes, or settings of "skills".
    name
        Of the file of config/, or of the skill.

    Raises
    ------
    ValueError
        Names the file if it is not as it must be.
    """
    path = arm_path(arm_name())
    content = _read_once(path, path.stat().st_mtime_ns).get(what) or {}
    if not (isinstance(content, dict) and all(isinstance(one, dict) for one in content.values())):
        raise ValueError(f"{path}: {what} is {content!r}; give names and values by file, or skill")
    return content.get(Path(name).stem, {})


def world_parameters() -> dict:
    """The entries of config/world.yaml by name, which are parameters of every node."""
    return _parameters("world.yaml", "/**")


def limit_parameters() -> dict:
    """The entries of config/limits.yaml by name, which are parameters of every node that moves the
    arm.
    """
    return _parameters("limits.yaml", "/**", "limits")


def _parameters(name: str, section: str, described: str = "") -> dict:
    """The ros__parameters of a section of a file, by name.

    Parameters
    ----------
    described
        Section of parameters.yaml that says which of them are numbers, and in which range.

    Raises
    ------
    KeyError
        If the file has no such section.
    ValueError
        Names the file, the entry and what it must be, for one that is out of its range.
    """
    path, values = config_path(name), {**_section(name, section), **of_the_arm("parameters", name)}
    rows = described_parameters().get(described) or {}
    for key, row in rows.items():
        if key in values and "range" in row:
            check_number(values[key], f"{path}: {key}", *row["range"])
    return values


def _section(name: str, section: str) -> dict:
    """The ros__parameters of a section as the file of config/ has them."""
    path = config_path(name)
    content = read_yaml(path)
    if section not in content:
        raise KeyError(f"{name} has no section '{section}', only {sorted(map(str, content))}")
    told = content[section]
    values = told.get("ros__parameters") if isinstance(told, dict) else None
    if not isinstance(values, dict):
        raise ValueError(
            f"{path}: '{section}' has no mapping 'ros__parameters' of names and values"
        )
    return dict(values)


def described_parameters() -> dict:
    """What each parameter of the nodes is, by section and name, from config/parameters.yaml."""
    path = config_path("parameters.yaml")
    return _read_once(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read_once(path: Path, _changed_ns: int) -> dict:
    """A YAML file as it was when it changed last."""
    return read_yaml(path)


def check_number(value: Any, name: str, low: float, high: float) -> None:
    """Check that a value is a number, or a list of numbers, in a range.

    Parameters
    ----------
    name
        What it is called in an error.
    low, high
        The range.

    Raises
    ------
    ValueError
        Names the value, and what it must be.
    """
    for one in value if isinstance(value, list) and value else [value]:
        number = isinstance(one, int | float) and not isinstance(one, bool)
        if not (number and low <= one <= high):
            raise ValueError(f"{name} is {value!r}; it must be a number from {low:g} to {high:g}")


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
    ValueError
        If a value is out of its range.
    """
    return {**world_parameters(), **limit_parameters(), **_parameters(name, node, node)}


def shared_folders(name: str, package: str, below: str = "") -> list[Path]:
    """Where a folder of the project may be, the likeliest first.

    In the library of a wheel, beside the library in a checkout, or in `share/<package>` of an
    installed ROS package, there `below` it.
    """
    library = Path(__file__).resolve().parents[1]
    checkout = [library.parent / name] if (library.parent / "package.xml").is_file() else []
    return [
        library / name,
        *checkout,
        *(prefix / "share" / package / below for prefix in ros_prefixes()),
    ]


def ros_prefixes() -> list[Path]:
    """Where packages of ROS are installed, the first that counts first."""
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [Path(prefix) for prefix in prefixes if prefix]


def _folders() -> list[Path]:
    chosen = chosen_folder()
    return ([Path(chosen)] if chosen else []) + shared_folders("config", "dart_skill", "config")
