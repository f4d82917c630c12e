"""The wheel, as somebody without ROS installs it: in an environment that has what the wheel
declares, and nothing else.

No network: the environment borrows the packages that the wheel declares from the one in which the
tests run, with all that those need.
"""

import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from dart_skill.common.extras import EXTRA_OF
from tests.paths import BAGS, CONFIG, ROOT
from tests.unit.repository.test_workspace import imported, workspace

BUILT_FROM = (
    "dart_skill",
    "config",
    "msg_schemas",
    "bags/five_demonstrations",
    "requirements",
    "setup.py",
    "setup.cfg",
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "MANIFEST.in",
)
CORE_ROOMS = ("mixture", "movement", "policy_search", "darts")
SMALL_DEMO = ("demo", "--layout", "in-process", "--demonstrations", "3", "--throws", "1")


@cache
def arguments_of_setup():
    """What setup.py hands to setuptools for the wheel, asked of one process for all extras."""
    script = "import json, runpy, setuptools, sys\nsys.argv = ['setup.py', 'dist_info']\n"
    script += (
        "setuptools.setup = lambda **arguments:"
        " print(json.dumps(arguments))\nrunpy.run_path('setup.py')"
    )
    return json.loads(subprocess.check_output([sys.executable, "-c", script], cwd=ROOT, text=True))


@cache
def declared(extra=""):
    """Requirements of the wheel, those of an extra, or of the core."""
    arguments = arguments_of_setup()
    texts = arguments["extras_require"][extra] if extra else arguments["install_requires"]
    return tuple(Requirement(text) for text in texts)


EXTRAS = ("sim", "plot", "view", "lerobot", "pandas", "foxglove", "c3d")


# --- what is declared ---


def test_every_import_of_the_library_is_declared():
    provided = {
        workspace.module_of(str(one)) for extra in ("", *EXTRAS) for one in declared(extra)
    } | {"pybullet_utils"}
    missing = {name: file for name, file in imported("dart_skill").items() if name not in provided}
    assert not missing


@pytest.mark.parametrize("room", CORE_ROOMS)
def test_the_learning_core_imports_numpy_and_scipy_only(room):
    assert set(imported(f"dart_skill/{room}")) <= {"numpy", "scipy"}


def test_what_is_not_in_an_extra_needs_the_core_only():
    core = {workspace.module_of(str(one)) for one in declared()}
    assert not set(imported("dart_skill")) - core - set(EXTRA_OF)


@pytest.mark.parametrize(("module", "extra"), EXTRA_OF.items())
def test_an_error_names_the_extra_that_brings_what_is_missing(module, extra):
    assert module.removesuffix("_utils") in {
        workspace.module_of(str(one)) for one in declared(extra)
    }


def test_the_wheel_and_the_workspace_want_the_same_versions():
    lines = [
        line
        for name in ("runtime", "test")
        for line in workspace.with_versions(ROOT / "requirements" / f"{name}.txt")
    ]
    wanted = {(one.name, str(one.specifier), str(one.marker)) for one in map(Requirement, lines)}
    own = {
        (one.name, str(one.specifier), str(one.marker))
        for extra in ("", *EXTRAS)
        for one in declared(extra)
    }
    assert own <= wanted


# --- the wheel ---


def newest(folder):
    """When the last file of a folder was written."""
    return max(path.stat().st_mtime for path in folder.rglob("*.c"))


def _keep_compiled(source):
    """What set-up compiled from the same sources with the same setup.py is newer than they are,
    and not compiled again.
    """
    # of `make setup`, and of a build by hand
    places = [
        ROOT / "build" / "dart_skill" / "build" / "cython",
        ROOT / "build" / "cython",
    ]
    if there := [place for place in places if place.is_dir()]:
        shutil.copytree(max(there, key=newest), source / "build" / "cython")
    built = source / "build" / f"lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}"
    for module in (ROOT / "dart_skill").rglob("*.so"):
        place = built / module.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(module, place)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy: setuptools leaves its work beside the sources."""
    pytest.importorskip(
        "wheel",
        reason=(
            "the wheel is built without a network: pip install -r requirements/test.txt, or make"
            " setup"
        ),
    )
    source, output = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in BUILT_FROM:
        if (ROOT / name).is_dir():
            shutil.copytree(
                ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__", "*.so")
            )
        else:
            # as old as it is: what is older than setup.py is compiled anew
            shutil.copy2(ROOT / name, source)
    _keep_compiled(source)
    pip = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--no-build-isolation",
    ]
    done = subprocess.run(
        [*pip, "--wheel-dir", str(output), str(source)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return next(output.glob("dart_skill-*.whl"))


def test_the_wheel_has_the_library_its_parameters_and_messages_and_one_command(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        commands = archive.read(
            next(name for name in names if name.endswith("entry_points.txt"))
        ).decode()
    config = {
        f"dart_skill/config/{path.relative_to(CONFIG)}"
        for path in CONFIG.rglob("*")
        if path.is_file()
    }
    messages = {
        f"dart_skill/{path.relative_to(ROOT)}" for path in (ROOT / "msg_schemas").glob("*/*.*")
    }
    assert (
        config | messages | {"dart_skill/py.typed", "dart_skill/msg_schemas/package.xml"} <= names
    )
    assert not [
        name
        for name in names
        if name.startswith(("dart_skill_nodes", "nodes", "tests")) or ".data/" in name
    ]
    typed = {
        path.relative_to(ROOT).with_suffix("").as_posix()
        for path in (ROOT / "dart_skill").rglob("*.pxd")
    }
    assert typed == {"dart_skill/_arrays"} ^ {
        name.split(".")[0] for name in names if name.endswith(tuple(EXTENSION_SUFFIXES))
    }
    assert re.findall(r"^([\w-]+) = ", commands, re.MULTILINE) == ["dart-skill"]


class Environment:
    """A virtual environment with the wheel, its core and some extras; nothing of ROS, and nothing
    else of the one of the tests.
    """

    def __init__(self, folder, wheel, *extras):
        subprocess.run(
            [sys.executable, "-m", "venv", "--without-pip", str(folder)],
            check=True,
            env=bare(folder),
        )
        self.folder, self.python = folder, folder / "bin" / "python3"
        site = (
            folder / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
        )
        for name in needed([one for extra in ("", *extras) for one in declared(extra)]):
            borrow(name, site)
        pip = [
            sys.executable,
            "-m",
            "pip",
            "--python",
            str(self.python),
            "install",
            "--quiet",
            "--no-deps",
            "--no-index",
            str(wheel),
        ]
        done = subprocess.run(
            [*pip, "--disable-pip-version-check"], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    def run(self, *command, status=0):
        """What a command says on stdout and stderr; it must end with this status."""
        words = [str(word) for word in command]
        done = subprocess.run(
            words,
            cwd=self.folder,
            env=bare(self.folder),
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == status, (
            f"{words}: status {done.returncode}\n{done.stdout}\n{done.stderr}"
        )
        return done.stdout, done.stderr

    def dart_skill(self, *words, status=0):
        """The same of a `dart-skill` command."""
        return self.run(self.folder / "bin" / "dart-skill", *words, status=status)


def bare(folder):
    """The variables of somebody who has sourced nothing."""
    return {
        "PATH": os.defpath,
        "HOME": str(folder),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def needed(requirements):
    """Names of the packages that are required, with all that they require."""
    found, waiting = set(), [(one, "") for one in requirements]
    while waiting:
        one, extra = waiting.pop()
        name = canonicalize_name(one.name)
        if name in found or (one.marker is not None and not one.marker.evaluate({"extra": extra})):
            continue
        found.add(name)
        for text in distribution(name).requires or ():
            waiting += [(Requirement(text), extra) for extra in one.extras or [""]]
    return found


def distribution(name):
    """An installed package; where it is not one that pip installed, the test is skipped."""
    try:
        found = importlib.metadata.distribution(name)
    except importlib.metadata.PackageNotFoundError:
        pytest.skip(f"{name} is not installed here, or not by pip")
    if found.files is None:
        pytest.skip(f"nobody knows which files are of {name}")
    return found


def borrow(name, site):
    """Link all that a package has in its folder of packages into another one."""
    one = distribution(name)
    for top in {file.parts[0] for file in one.files} - {"..", "__pycache__"}:
        if not (site / top).exists():
            (site / top).symlink_to(Path(one.locate_file(top)).resolve())


@pytest.fixture(scope="module")
def core(wheel, tmp_path_factory):
    return Environment(tmp_path_factory.mktemp("core"), wheel)


@pytest.fixture(scope="module")
def simulating(wheel, tmp_path_factory):
    return Environment(tmp_path_factory.mktemp("sim"), wheel, "sim")


# --- what works without ROS ---


def test_there_is_no_ros_and_no_checkout_in_reach(core):
    script = (
        "import importlib.util as u, dart_skill; print(dart_skill.__file__, *map(u.find_spec,"
        " ('rclpy', 'dart_skill_nodes', 'pinocchio')))"
    )
    out, _ = core.run(core.python, "-c", script)
    where, *others = out.split()
    assert Path(where).is_relative_to(core.folder) and others == ["None"] * 3


def test_it_says_its_version_in_three_ways(core):
    version = workspace_version()
    assert (
        core.dart_skill("--version")[0]
        == core.run(core.python, "-m", "dart_skill", "--version")[0]
        == f"dart-skill {version}\n"
    )
    assert (
        core.run(core.python, "-c", "import dart_skill; print(dart_skill.__version__)")[0]
        == f"{version}\n"
    )
    assert (
        importlib.metadata.PathDistribution(
            next(core.folder.rglob("dart_skill-*.dist-info"))
        ).version
        == version
    )


def workspace_version():
    return re.search(r"<version>(.+)</version>", (ROOT / "package.xml").read_text()).group(1)


def test_the_core_knows_where_to_aim_and_what_is_in_a_bag(core):
    assert (
        "sigma"
        in core.dart_skill(
            "darts",
            "estimate",
            "12",
            "16",
            "19",
            "3",
            "17",
            "1",
            "25",
            "19",
            "17",
            "50",
            "18",
            "1",
        )[0]
    )
    assert "/demonstrations" in core.dart_skill("bag", "info", BAGS / "demonstrations")[0]
    assert "nothing is wrong" in "".join(core.dart_skill("bag", "check", BAGS / "demonstrations"))


MISSING = {
    "sim": [
        ("learn", str(BAGS / "demonstrations")),
        SMALL_DEMO,
        ("experiment", "repeatability"),
        *((*SMALL_DEMO, "--skill", skill) for skill in ("darts", "place", "reach", "stir")),
    ],
    "plot": [
        ("report", str(BAGS / "throws")),
        ("darts", "heatmap", "--sigma", "20", "--output", "heat"),
        *(
            ("experiment", name)
            for name in (
                "throws",
                "basket",
                "practice",
                "darts",
                "search",
                "landscapes",
                "compliance",
            )
        ),
        *(("experiment", name) for name in ("place", "reach", "stir")),
        ("experiment", "figure", "7.1"),
    ],
}
IN_ONE_PROCESS = """
import contextlib, io, json, sys
from dart_skill.cli import main
told = []
for words in json.loads(sys.argv[1]):
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            status = main(words)
        except SystemExit as end:
            status = end.code
    told.append([status, said.getvalue()])
print(json.dumps(told))
"""


def in_one_process(environment, commands):
    """Status, and what is said on stderr, of each command, without a process of its own."""
    return json.loads(
        environment.run(environment.python, "-c", IN_ONE_PROCESS, json.dumps(commands))[0]
    )


def test_a_verb_that_needs_more_names_the_extra_in_a_line(core):
    cases = [(extra, words) for extra, verbs in MISSING.items() for words in verbs]
    for (extra, words), (status, said) in zip(
        cases, in_one_process(core, [words for _, words in cases]), strict=True
    ):
        last = said.splitlines()[-1]
        assert (
            status == 1
            and f"pip install 'dart_skill[{extra}]'" in last
            and "Traceback" not in said
        ), f"{words}: {status}\n{said}"


def test_a_verb_of_the_nodes_says_what_it_needs_in_a_line(core):
    verbs = ["up", "status", "practice", "teach", "throw", "demonstrations", "demo", "learn"]
    told = in_one_process(core, [[verb] for verb in verbs])
    for verb, (status, said) in zip(verbs, told, strict=True):
        assert status == 1 and said.count("\n") == 1, verb
        assert "needs the ROS 2 workspace: 'make setup', then 'source tools/env.sh'" in said, verb
        assert ("dart-skill demo --layout in-process" in said) == (verb == "demo")
    assert core.dart_skill("up", status=1)[1] == told[0][1], "as a process of its own"


@pytest.mark.slow
def test_a_bag_teaches_without_ros(simulating):
    out, _ = simulating.dart_skill("learn", BAGS / "demonstrations", "--output", "model.npz")
    assert "learned from 13 of 13 throws" in out and (simulating.folder / "model.npz").is_file()


@pytest.mark.slow
def test_the_main_job_runs_without_ros_and_says_what_it_leaves_out(simulating):
    _, said = simulating.dart_skill(*SMALL_DEMO, "--output", "run")
    summary = json.loads((simulating.folder / "run" / "summary.json").read_text())
    assert (summary["layout"], summary["in"], summary["thrown"]) == ("in-process", 1, 1)
    assert "no nodes run, so there are no logs" in said
    assert (
        "no report and no pictures" in said
        and "pip install 'dart_skill[plot]', then dart-skill report" in said
    )
    assert (
        "learned from 3 of 4 throws"
        in simulating.dart_skill("learn", "run/bag", "--output", "again.npz")[0]
    )


@pytest.mark.slow
def test_the_bag_of_the_wheel_teaches(simulating):
    script = (
        "from dart_skill.session import learn_from_bag;"
        " from dart_skill.recording import example_bag;"
        " print(len(learn_from_bag(example_bag())[1].learned_from))"
    )
    assert simulating.run(simulating.python, "-c", script)[0].strip() == "5"


def test_pictures_and_the_live_view_need_what_their_extras_bring(wheel, tmp_path):
    one = Environment(tmp_path / "one", wheel, "plot", "view")
    script = (
        "import dart_skill.report, dart_skill.figures; from dart_skill.view import open_server;"
        " open_server(port=0).stop()"
    )
    one.run(one.python, "-c", script)
    assert "pip install 'dart_skill[sim]'" in one.dart_skill("experiment", "throws", status=1)[1]
