"""Where the files of config/ are: in a checkout, in a wheel and in an installed ROS package alike;
and their values, checked.
"""

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from dart_skill.common.entries import (
    ANYTHING,
    ConfigurationError,
    Each,
    EitherOf,
    Entries,
    Flag,
    Kind,
    Number,
    OneOf,
    Rows,
    Text,
    wrong,
)

ARM_VARIABLE = "DART_SKILL_ARM"
"""Environment variable that names the arm, in place of config/world.yaml."""
MOST_NESTED = 30
"""Depth of a YAML file at most: PyYAML's parser in C ends the process with a deep one."""
MOST_ENTRIES = 100_000
"""Entries of a YAML file at most, those that aliases repeat included."""
DISTANCE = 10.0
"""Coordinate of a camera at most [m]."""
ANY_NUMBER = Number(-1e10, 1e10)
PLACE = Rows(Number(-DISTANCE, DISTANCE), (3,))
BESIDE: dict[str, dict[str, Kind]] = {
    "mock_optitrack": {"cameras": Each(Entries({"position": PLACE, "look_at": PLACE}))}
}
"""What the file of a node has beside parameters that parameters.yaml describes."""
KINDS: dict[str, Kind] = {
    "name": Text(filled=True),
    "text": Text(),
    "flag": Flag(),
    "texts": Rows(Text()),
}
"""What a parameter may be that is no number, by its `kind` in parameters.yaml."""
SECTION = Entries({"ros__parameters": Each(ANYTHING)})
"""A section of a file of parameters."""
SHARED = ("world", "limits")
"""Sections of parameters.yaml whose values stand in files of their own, for all nodes."""
PARAMETER = Entries(
    {"about": Text(filled=True)},
    {
        "range": Rows(ANY_NUMBER, (2,)),
        "each": Rows(ANY_NUMBER, (2,)),
        "count": Number(1, 100, whole=True),
        "kind": OneOf(tuple(KINDS)),
        "changes": EitherOf((Flag(), OneOf(("unconfigured",))), "true or unconfigured"),
    },
)
"""A row of parameters.yaml."""


class NoSection(ConfigurationError):
    """A file has no section of a node."""


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
        if (folder / name).exists():
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
    ConfigurationError
        Names the file, the place and the remedy, if it is none.
    FileNotFoundError
        If there is none.
    """
    try:
        content = _parsed(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ConfigurationError(f"{path} is no YAML: {error}") from error
    if not isinstance(content, dict):
        raise ConfigurationError(f"{path} holds no mapping: write one 'name: value' in a line")
    return content


def _parsed(text: str) -> Any:
    """What a YAML text holds; ValueError says in a line where it is none."""
    import yaml  # completion with TAB imports this module and reads nothing

    # The parser in C takes a seventh of the time; a PyYAML that was built without it has the other
    # one only.
    kind = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    depth = 0
    try:
        for event in yaml.parse(text, Loader=kind):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MOST_NESTED:
                raise _nested(event)
        loader = kind(text)
        node = loader.get_single_node()
        if node is None:
            return None
        _count(node, 0, {})
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        raise ValueError(f"{place}{error.problem or error.context}") from error
    except yaml.reader.ReaderError as error:
        raise ValueError(f"character {error.position + 1}: {error.reason}") from error


def _nested(place: Any) -> ValueError:
    line = place.start_mark.line + 1
    return ValueError(f"line {line} is nested more than {MOST_NESTED} deep")


def _count(node: Any, depth: int, counted: dict[int, int]) -> int:
    """Entries of a node of YAML and below it, with those that aliases repeat; ValueError for more
    than a file may have, and for a name that stands twice.
    """
    if isinstance(node.value, str):
        return 1
    if depth > MOST_NESTED:
        raise _nested(node)
    if id(node) not in counted:
        parts = node.value
        if parts and isinstance(parts[0], tuple):
            _check_unique([key for key, _ in parts])
            parts = [value for _, value in parts]
        counted[id(node)] = 1 + sum(_count(part, depth + 1, counted) for part in parts)
    if counted[id(node)] > MOST_ENTRIES:
        line = node.start_mark.line + 1
        raise ValueError(f"line {line} has more than {MOST_ENTRIES} entries, with its aliases")
    return counted[id(node)]


def _check_unique(names: list) -> None:
    seen: dict[Any, int] = {}
    for name in names:
        line = name.start_mark.line + 1
        if not isinstance(name.value, str):
            continue
        if name.value in seen:
            raise ValueError(
                f"line {line}: {name.value} stands in line {seen[name.value]} already; keep one"
            )
        seen[name.value] = line


def arm_name() -> str:
    """Name of the arm, or path of its file, from the environment or from config/world.yaml."""
    return os.environ.get(ARM_VARIABLE) or _configured_arm(chosen_folder())


def chosen_folder() -> str:
    """The folder that counts instead of config/; empty if none was chosen."""
    return os.environ.get("DART_SKILL_CONFIG", "")


@lru_cache(maxsize=4)
def _configured_arm(_folder: str) -> str:
    """The arm of world.yaml in a folder: it is asked for at every step of an arm."""
    arm = _section("world.yaml", "/**").get("arm")
    Text(filled=True).check(arm, f"{config_path('world.yaml')}: /**.ros__parameters.arm")
    return str(arm)


def arm_names() -> list[str]:
    """Names of the arms in config/arms/."""
    return sorted(path.stem for path in config_path("arms/wam.yaml").parent.glob("*.yaml"))


def arm_path(name: str) -> Path:
    """The file of an arm of config/arms/, or of a path that ends in .yaml.

    Raises
    ------
    ConfigurationError
        If there is none.
    """
    if not name.endswith(".yaml") and name not in arm_names():
        raise ConfigurationError(
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
        raise wrong(content, f"{path}: {what}", "names and values by file, or skill")
    return content.get(Path(name).stem, {})


def world_parameters() -> dict:
    """The entries of config/world.yaml by name, which are parameters of every node."""
    return _parameters("world.yaml", "/**", "world")


def limit_parameters() -> dict:
    """The entries of config/limits.yaml by name, which are parameters of every node that moves the
    arm.
    """
    return _parameters("limits.yaml", "/**", "limits")


def _parameters(name: str, section: str, described: str) -> dict:
    """The ros__parameters of a section of a file by name, those of the arm's file in their place.

    Parameters
    ----------
    described
        Section of parameters.yaml that says what each of them is.

    Raises
    ------
    NoSection
        If the file has no such section.
    ConfigurationError
        Names the file, the entry and what it must be.
    """
    told, of_arm = _section(name, section), of_the_arm("parameters", name)
    rows = described_parameters().get(described, {})
    kinds = Entries(
        {}, {**{key: kind_of(row) for key, row in rows.items()}, **BESIDE.get(described, {})}
    )
    kinds.check(told, f"{config_path(name)}: {section}.ros__parameters")
    if of_arm:
        kinds.check(of_arm, f"{arm_path(arm_name())}: parameters.{Path(name).stem}")
    of_all = {key for one in SHARED for key in described_parameters().get(one, {})}
    shared = set() if described in SHARED else of_all
    given = {**told, **of_arm}
    if missing := [key for key in rows if key not in given and key not in shared]:
        raise ConfigurationError(f"{config_path(name)} lacks {', '.join(missing)}: add it")
    return {key: _as_described(value, rows.get(key, {})) for key, value in given.items()}


def kind_of(row: Mapping[str, Any]) -> Kind:
    """What a parameter may be.

    Parameters
    ----------
    row
        Of parameters.yaml.
    """
    if "kind" in row:
        return KINDS[row["kind"]]
    low, high = row["range"] if "range" in row else row["each"]
    number = Number(low, high, whole=isinstance(low, int) and isinstance(high, int))
    if "range" in row:
        return number
    return Rows(number, (row["count"],) if "count" in row else ())


def _as_described(value: Any, row: Mapping[str, Any]) -> Any:
    """A value; an integer as a float where the range is one of floats, so that ROS takes floats."""
    if "range" in row and isinstance(row["range"][0], float):
        return float(value)
    if "each" in row and isinstance(row["each"][0], float):
        return [float(one) for one in value]
    return value


def _section(name: str, section: str) -> dict:
    """The ros__parameters of a section as the file of config/ has them."""
    path = config_path(name)
    content = read_yaml(path)
    if section not in content:
        raise NoSection(f"{path} has no section '{section}', only {sorted(map(str, content))}")
    Each(SECTION).check(content, str(path))
    values = content[section]["ros__parameters"]
    return dict(values)


def described_parameters() -> dict:
    """What each parameter of the nodes is, by section and name, from config/parameters.yaml.

    Raises
    ------
    ConfigurationError
        Names the file and the entry that is not as it must be.
    """
    path = config_path("parameters.yaml")
    return _described(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _described(path: Path, changed_ns: int) -> dict:
    content = _read_once(path, changed_ns)
    Each(Each(PARAMETER)).check(content, str(path))
    for section, rows in content.items():
        for name, row in rows.items():
            if len({"range", "each", "kind"} & set(row)) != 1:
                raise ConfigurationError(
                    f"{path}: {section}.{name} has none of range, each, kind, or several: give one"
                )
    return content


@lru_cache(maxsize=4)
def _read_once(path: Path, _changed_ns: int) -> dict:
    """A YAML file as it was when it changed last."""
    return read_yaml(path)


def node_file(node: str) -> str:
    """Name of the file of config/ with the parameters of a node."""
    return "optitrack.yaml" if node == "mock_optitrack" else f"{node}.yaml"


def node_parameters(name: str, node: str, described: str = "") -> dict:
    """Parameters of one node from a ROS parameter file of config/, without ROS; those of world and
    limits that it does not set, too.

    Parameters
    ----------
    described
        Name of the node in parameters.yaml, if it was given another one.

    Raises
    ------
    NoSection
        If the file has no section of the node.
    ConfigurationError
        Names the file, the entry and what it must be.
    """
    own = _parameters(name, node, described or node)
    return {**world_parameters(), **limit_parameters(), **own}


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
