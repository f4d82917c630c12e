"""What may import what: the arrows between the rooms of the house (docs/development.md)."""

import ast
import importlib
import subprocess
import sys
from functools import cache

import pytest

from tests.paths import BAGS, ROOT
from tests.unit.repository.import_lines import imports

SOURCES = {
    "dart_skill": ROOT / "dart_skill",
    "dart_skill_nodes": ROOT / "nodes" / "dart_skill_nodes",
}
LAYERS = (
    {"__version__", "common"},
    {"mixture"},
    {"movement", "policy_search", "darts", "recording", "arm"},
    {"simulation", "skills.observation", "skills.execution"},
    {"skills.protocol"},
    {"skills.learning", "arm.check"},
    {"skills.practice"},
    {"skills.throw", "skills.table"},
    {"skills.darts", "skills.place", "skills.reach", "skills.stir"},
    {"session"},
    {"figures", "view"},
    {"report"},
    {"experiments"},
    {"cli"},
    {"__main__"},
)
"""Rooms of the library, from the ground up: a room imports from lower layers, and from nowhere
else.
"""
NODE_LAYERS = ({"comms"}, {"process"}, {"client"}, {"arm"}, {"executables"}, {"verbs"})
"""The same for the nodes."""
ROS = {
    "rclpy",
    "rcl_interfaces",
    "dart_skill_msgs",
    "dart_skill_nodes",
    "std_msgs",
    "std_srvs",
    "geometry_msgs",
    "sensor_msgs",
    "launch",
}


def sources(package):
    """Module name -> file of every module of a package."""
    folder = SOURCES[package]
    for path in folder.rglob("*.py"):
        parts = path.relative_to(folder.parent).with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


@cache
def modules(package):
    """Module name -> names that it imports, of every module of a package."""
    return {
        module: list(imported(imports(path.read_text(encoding="utf-8"))))
        for module, path in sources(package)
    }


def imported(tree):
    """Every module that a syntax tree imports, in functions too; `from package import module` as
    package.module.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"a relative import of {node.module}"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def room(module):
    """The room of a module of the library or of the nodes."""
    package, *parts = module.split(".")
    has_rooms = package == "dart_skill" and (
        parts[:1] == ["skills"] or parts[:2] == ["arm", "check"]
    )
    return ".".join(parts[:2]) if has_rooms else ".".join(parts[:1])


def arrows(package):
    """(from room, to room, module, imported module) of all imports within a package that lead from
    room to room.
    """
    for module, names in modules(package).items():
        for name in names:
            if name.split(".")[0] == package and room(name) != room(module):
                yield room(module), room(name), module, name


def layer_of(name, layers):
    return next(number for number, layer in enumerate(layers) if name in layer)


@pytest.mark.parametrize(
    ("package", "layers"), [("dart_skill", LAYERS), ("dart_skill_nodes", NODE_LAYERS)]
)
def test_rooms_import_from_lower_layers_only(package, layers):
    wrong = [
        f"{module} imports {name}"
        for start, end, module, name in arrows(package)
        if start and layer_of(start, layers) <= layer_of(end, layers)
    ]
    assert not wrong, "\n".join(wrong)


def test_the_library_knows_no_ros():
    wrong = [
        f"{module} imports {name}"
        for module, names in modules("dart_skill").items()
        for name in names
        if name.split(".")[0] in ROS
    ]
    assert not wrong, "\n".join(wrong)


def test_only_the_command_of_experiments_imports_them():
    wrong = [
        f"{module} imports {name}"
        for package in SOURCES
        for module, names in modules(package).items()
        for name in names
        if name.startswith("dart_skill.experiments")
        and not module.startswith(("dart_skill.experiments", "dart_skill.cli.experiment"))
    ]
    assert not wrong, "\n".join(wrong)


def test_a_module_with_an_underscore_is_imported_by_its_own_package_only():
    wrong = [
        f"{module} imports {name}"
        for package in SOURCES
        for module, names in modules(package).items()
        for name in names
        for private in [part for part in name.split(".")[1:-1] if part.startswith("_")]
        if name.startswith("dart_skill")
        and not module.startswith(name[: name.index(f".{private}")])
    ]
    assert not wrong, "\n".join(wrong)


WITHOUT_A_FACE = ("dart_skill.common.", "dart_skill.experiments.", "dart_skill.cli.")
"""Each module of these is about one thing, and is imported by itself."""


def test_a_room_imports_from_the_face_of_another_package():
    """`from dart_skill.figures import draw_path`, not `from dart_skill.figures.board`."""
    inside = {
        name
        for name, path in sources("dart_skill")
        if path.name != "__init__.py" and name.count(".") > 1
    }
    wrong = [
        f"{module} imports {name}"
        for package in SOURCES
        for module, names in modules(package).items()
        for name in names
        if not {name, name.rpartition(".")[0]}.isdisjoint(inside)
        and not name.startswith(WITHOUT_A_FACE)
        and (package == "dart_skill_nodes" or room(name) != room(module))
    ]
    assert not wrong, "\n".join(wrong)


def test_the_packages_of_the_nodes_import_nothing_of_ours_by_themselves():
    """A process pays at its start for what it imports."""
    packages = {
        module for module, path in sources("dart_skill_nodes") if path.name == "__init__.py"
    }
    wrong = {
        module: [
            name for name in modules("dart_skill_nodes")[module] if name.startswith("dart_skill")
        ]
        for module in packages
    }
    assert not any(wrong.values()), wrong


LAZY = sorted(path for path in SOURCES["dart_skill"].rglob("__init__.pyi"))


@pytest.mark.parametrize("stub", LAZY, ids=lambda stub: stub.parent.name)
def test_a_package_has_all_that_it_imports_on_first_use(stub):
    package = ".".join(stub.parent.relative_to(ROOT).parts)
    module = importlib.import_module(package)
    names = {alias.name for line in ast.parse(stub.read_text()).body for alias in line.names}
    assert names == set(module.__all__) <= set(dir(module))
    assert all(hasattr(module, name) for name in names)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nonsense'"):
        _ = module.nonsense


@pytest.mark.parametrize(
    "module",
    [
        "dart_skill_nodes.client.graph_client",
        "dart_skill_nodes.executables.recorder",
        "dart_skill.session",
    ],
)
def test_who_neither_moves_an_arm_nor_learns_starts_without_what_that_takes(module):
    """Half of the time in which a script, a recorder or a command on a running graph starts was
    for packages that it never used.
    """
    heavy = (
        "pinocchio",
        "pybullet",
        "scipy.spatial",
        "scipy.optimize",
        "scipy.ndimage",
        "matplotlib",
        "dart_skill.mixture",
    )
    shown = f"import sys, {module}; print(*sorted(set(sys.modules) & set({heavy})))"
    assert (
        subprocess.run(
            [sys.executable, "-c", shown], capture_output=True, text=True, check=True
        ).stdout.split()
        == []
    )


@pytest.mark.parametrize("module", ["composed", "skill_learner"])
def test_the_graph_of_throws_starts_without_the_parts_of_scipy(module):
    """They took a third of a second of each process, before which nobody could give a lesson."""
    heavy = (
        "scipy.linalg",
        "scipy.spatial",
        "scipy.special",
        "scipy.optimize",
        "scipy.sparse",
        "numpy.ma",
        "dart_skill.session",
    )
    shown = (
        f"import sys, dart_skill_nodes.executables.{module}; print(*sorted(set(sys.modules) &"
        f" set({heavy})))"
    )
    assert (
        subprocess.run(
            [sys.executable, "-c", shown], capture_output=True, text=True, check=True
        ).stdout.split()
        == []
    )


def test_what_is_in_a_bag_is_told_without_what_reads_its_messages():
    """Half of the time of `dart-skill bag info` was for NumPy, and for the parsers of types of
    which it says nothing.
    """
    heavy = (
        "numpy",
        "scipy",
        "rosbags.typesys",
        "rosbags.rosbag2",
        "ruamel.yaml",
        "sqlite3",
        "zipfile",
        "dart_skill.cli.darts",
    )
    shown = (
        "import sys; from dart_skill.cli import main; main(['bag', 'info',"
        f" {str(BAGS / 'throws')!r}]); print(*sorted(set(sys.modules) & set({heavy})))"
    )
    done = subprocess.run(
        [sys.executable, "-c", shown], capture_output=True, text=True, check=True
    )
    assert "/joint_states" in done.stdout and done.stdout.splitlines()[-1] == ""
