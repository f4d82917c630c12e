"""The package, in two forms.

* `colcon build` builds the ament_python package: library, nodes, launch files. A node is an
  executable in lib/dart_skill, where `ros2 run` looks. What it depends on stands in package.xml.
  colcon does not look for packages below a package, so the one of the messages, msg_schemas/, is
  built from here unless something else brings it (`build_messages`).
* `pip install .` builds a wheel for machines without ROS: the library and its one command, with
  config/ and the definitions of messages in it. What it depends on stands here. Executables of
  nodes would be commands called `recorder` and `viewer` on everybody's PATH.

Both compile the modules of the library that have a .pxd beside them (`compiled_modules`).
"""

import os
import re
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, find_packages, setup

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
LIBRARY_DATA = [
    "py.typed",
    *(f"{'*/' * depth}*{kind}" for depth in range(4) for kind in (".pxd", ".pyi")),
]
EXAMPLE = "bags/five_demonstrations"
IN_THE_WHEEL = {
    "config": ["**/*"],
    "msg_schemas": ["package.xml", "msg/*", "srv/*", "action/*"],
    "bags": ["five_demonstrations/*"],
}
"""Folders beside the library that the wheel takes into it, and which of their files."""


def required(*names: str) -> list[str]:
    """Requirements with the versions that requirements/versions.txt has, markers included."""
    file = Path(__file__).resolve().parent / "requirements" / "versions.txt"
    lines = file.read_text(encoding="utf-8").splitlines()
    return [line for name in names for line in lines if re.match(rf"{re.escape(name)}[<>=]", line)]


CORE = required("numpy", "scipy", "pyyaml", "mcap", "rosbags", "zstandard", "lz4")
"""Learning, where to aim, and bags (docs/dependencies.md says why each)."""
EXTRAS = {
    # an arm: its kinematics and dynamics, and the world around it
    "sim": required("pin", "pybullet", "pybullet-arm64", "tqdm"),
    "plot": required("matplotlib", "tqdm"),
    "view": required("viser"),
    # tools that others have: data sets, tables, another live view
    "lerobot": required("pyarrow", "av"),
    "pandas": required("pandas"),
    "foxglove": required("foxglove-sdk"),
    "c3d": required("c3d"),
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
        "packages": [
            *find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
            *(f"{PACKAGE}.{folder}" for folder in IN_THE_WHEEL),
        ],
        "package_dir": {f"{PACKAGE}.{folder}": folder for folder in IN_THE_WHEEL},
        "package_data": {
            PACKAGE: LIBRARY_DATA,
            **{f"{PACKAGE}.{folder}": files for folder, files in IN_THE_WHEEL.items()},
        },
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
        "package_data": {PACKAGE: LIBRARY_DATA},
        "data_files": [
            ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
            (f"share/{PACKAGE}", ["package.xml"]),
            (
                f"share/{PACKAGE}/launch",
                [str(path) for path in sorted(Path("launch").glob("*.launch.py"))],
            ),
            (f"share/{PACKAGE}/{EXAMPLE}", [str(one) for one in sorted(Path(EXAMPLE).iterdir())]),
            *config_files(),
        ],
        "install_requires": ["setuptools"],
        "entry_points": {
            "console_scripts": [
                COMMAND,
                *(f"{node} = {PACKAGE}_nodes.executables.{node}:main" for node in NODES),
            ]
        },
    }


# Python's rules for indices are given up, so a compiled module must not read beyond the ends of an
# array. Numbers keep their last bits: a product and a sum are not made one operation.
RULES = {
    "language_level": 3,
    "boundscheck": False,
    "wraparound": False,
    "cdivision": True,
    "initializedcheck": False,
}
RULES |= {"annotation_typing": False}
FLAGS = ["-O2", "-g0", "-ffp-contract=off", "-fno-math-errno"] if os.name == "posix" else []
# colcon runs this file through a link, in a folder of its own; what lies beside the sources is
# compiled once for it and for a call by hand
BUILT = Path(__file__).resolve().parent / "build"
CYTHONIZED = BUILT / "cython"
COMMANDS_THAT_COMPILE = {
    "build_ext",
    "build",
    "develop",
    "install",
    "bdist_wheel",
    "editable_wheel",
}


def compiled_modules() -> list:
    """The modules that have a .pxd with their types beside them. Where one cannot be compiled its
    .py does the same, more slowly.
    """
    if not COMMANDS_THAT_COMPILE & set(sys.argv) or "--uninstall" in sys.argv:
        return []
    try:
        from Cython.Build import cythonize
    except ImportError:
        print(
            f"{PACKAGE}: Cython is missing, so nothing is compiled: the arm and lessons take"
            " several times as long",
            file=sys.stderr,
        )
        return []
    sources = {
        ".".join(path.with_suffix("").parts): path.with_suffix(".py")
        for path in sorted(Path(PACKAGE).rglob("*.pxd"))
    }
    modules = [extension(name, path) for name, path in sources.items()]
    force = any(is_older(file) for file in CYTHONIZED.rglob("*.c"))
    options = {
        "build_dir": str(CYTHONIZED),
        "compiler_directives": RULES,
        "nthreads": os.cpu_count() or 1,
        "quiet": True,
        "force": force,
    }
    if shared := code_of_arrays():
        return [shared, *cythonize(modules, shared_utility_qualified_name=shared.name, **options)]
    return cythonize(modules, **options)


def code_of_arrays() -> Extension | None:
    """What all compiled modules need of arrays, which takes longer to compile than most of them;
    Cython before 3.1 has it in each.
    """
    import Cython

    if tuple(int(part) for part in Cython.__version__.split(".")[:2]) < (3, 1):
        return None
    source = CYTHONIZED / "_arrays.c"
    if not source.is_file() or is_older(source):
        source.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, "-m", "cython", f"--generate-shared={source}"], check=True)
    return extension(f"{PACKAGE}._arrays", source)


def how_to_compile() -> dict:
    """Options of the command build_ext."""
    options = {"parallel": os.cpu_count() or 1}
    if {"develop", "--inplace"} & set(sys.argv):
        options |= {"build_lib": str(BUILT / "compiled"), "build_temp": str(BUILT / "objects")}
    return options


def is_older(file: Path) -> bool:
    """Whether a file was made before the last change of this one."""
    return file.stat().st_mtime < Path(__file__).stat().st_mtime


def extension(name: str, source: Path) -> Extension:
    return Extension(
        name, [str(source)], extra_compile_args=FLAGS, optional=True, depends=["setup.py"]
    )


MESSAGES = "dart_skill_msgs"
COLCON = [sys.executable, "-c", "from colcon_core.command import main; raise SystemExit(main())"]


def build_messages() -> None:
    """Builds the package of the messages beside this one, where colcon builds this one and does
    not know that one.

    colcon knows it where it was told where it lies (`--base-paths src/dart_skill
    src/dart_skill/msg_schemas`), or where another workspace has it. What was built from here
    before is brought up to date. SystemExit says in a line what to type, where it does not work.
    """
    source = Path(__file__).resolve().parent / "msg_schemas"
    prefix, build = Path(sys.prefix), _build_base()
    # colcon's own mark, with the prefix to install into: nobody else installs nodes
    if build is None or not hasattr(sys, "real_prefix"):
        return
    merged = (prefix / ".colcon_install_layout").is_file()
    here = prefix if merged else prefix.parent / MESSAGES
    ours = build / "by_dart_skill"
    found = [
        folder
        for folder in _paths("AMENT_PREFIX_PATH")
        if (folder / "share" / MESSAGES / "package.xml").is_file()
    ]
    if found and (
        not ours.is_file() or here.resolve() not in [folder.resolve() for folder in found]
    ):
        return
    print(f"building {MESSAGES}, which takes minutes the first time", flush=True)
    options = [
        "--build-base",
        str(build.parent),
        "--install-base",
        str(here if merged else here.parent),
        *["--merge-install"] * merged,
    ]
    command = [
        *COLCON,
        "--log-base",
        str(build / "log"),
        "build",
        "--base-paths",
        str(source),
        *options,
    ]
    if subprocess.run(
        command, env=_outside(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ).returncode:
        log = build / "log" / "latest_build" / MESSAGES / "stdout_stderr.log"
        shown = (
            f"colcon build --base-paths {os.path.relpath(source, build.parents[1])}"
            " --event-handlers console_direct+"
        )
        raise SystemExit(
            f"dart_skill: its messages were not built ({log} says why: is ROS 2 sourced?); to see"
            f" it: {shown}"
        )
    ours.touch()


def _paths(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]


def _build_base() -> Path | None:
    """Where colcon builds the messages: beside the folder in which it builds this package; None
    where nothing is built, as when colcon asks for the options of a command.
    """
    option = "--build-directory" if "develop" in sys.argv else "--build-base"
    if (
        option not in sys.argv
        or not {"develop", "install"} & set(sys.argv)
        or "--uninstall" in sys.argv
    ):
        return None
    return Path(sys.argv[sys.argv.index(option) + 1]).parent.with_name(MESSAGES)


def _outside() -> dict[str, str]:
    """The environment without what colcon puts on the path of modules for one call of setup.py: it
    would move the prefix of Python.
    """
    ours = [
        str(path)
        for path in _paths("PYTHONPATH")
        if path.name not in ("prefix_override", "colcon_distutils_commands")
    ]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(ours)}


MAKES_A_WHEEL = bool({"bdist_wheel", "dist_info", "editable_wheel"} & set(sys.argv))
"""What pip and build ask setuptools for; colcon asks for none of these."""

if not MAKES_A_WHEEL:
    build_messages()

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
    ext_modules=compiled_modules(),
    options={"build_ext": how_to_compile()},
    **(of_a_wheel() if MAKES_A_WHEEL else of_the_workspace()),
)
