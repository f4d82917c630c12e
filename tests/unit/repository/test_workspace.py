"""The workspace holds together: package descriptions, set-up, the stand-in for `ros2`, domains of
tests.
"""

import ast
import importlib.metadata
import importlib.util
import json
import os
import re
import runpy
import shutil
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.paths import ROOT
from tests.unit.repository.import_lines import imports


def load(path):
    """Imports a script that belongs to no package."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


workspace = load(ROOT / "tools" / "setup_workspace.py")


def write_executable(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)
    return path


# --- package descriptions ---

KEYS = {  # rosdep's names of what is imported under another one
    "lz4": "mcap-ros2-support",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "numpy": "python3-numpy",
    "pybullet": "python3-pybullet-pip",
    "pybullet_utils": "python3-pybullet-pip",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
    "tqdm": "python3-tqdm",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
OWN = {"dart_skill", "dart_skill_nodes"}


def package(folder):
    return ElementTree.parse(folder / "package.xml").getroot()


def texts(element, *tags):
    return {found.text for tag in tags for found in element.iter(tag)}


@pytest.fixture(scope="module")
def setup_arguments():
    """What setup.py hands to setuptools, run as colcon runs it: in the folder of the package."""
    script = (
        "import json, runpy, setuptools\nsetuptools.setup = lambda **arguments:"
        " print(json.dumps(arguments))\nrunpy.run_path('setup.py')"
    )
    return json.loads(subprocess.check_output([sys.executable, "-c", script], cwd=ROOT, text=True))


@cache
def imports_of(file):
    """Top-level modules that a Python file imports."""
    found = set()
    for node in ast.walk(imports(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.split(".")[0])
    return frozenset(found)


def imported(*folders):
    """Top-level modules that the Python files below some folders import, with one file that does."""
    files = [file for folder in folders for file in (ROOT / folder).rglob("*.py")]
    found = {name: str(file.relative_to(ROOT)) for file in files for name in imports_of(file)}
    return {
        name: file for name, file in found.items() if name not in sys.stdlib_module_names | OWN
    }


@pytest.mark.parametrize(
    "folder", [ROOT, ROOT / "msg_schemas"], ids=["dart_skill", "dart_skill_msgs"]
)
def test_package_description_has_what_format_3_asks_for(folder):
    text = (folder / "package.xml").read_text()
    root = package(folder)
    assert re.search(r'<\?xml-model href="[^"]+package_format3\.xsd"', text)
    assert (root.tag, root.get("format")) == ("package", "3")
    for tag in ("name", "version", "description", "maintainer", "license"):
        assert root.findtext(tag), f"<{tag}> is missing or empty"
    assert root.find("maintainer").get("email")
    declared = [element.text for element in root if element.tag.endswith("depend")]
    assert sorted(set(declared)) == sorted(declared), "a dependency is declared twice"


def test_package_xml_and_setup_py_agree(setup_arguments):
    root = package(ROOT)
    assert root.findtext("name") == setup_arguments["name"]
    assert root.findtext("version") == setup_arguments["version"]
    assert root.findtext("license") == setup_arguments["license"]
    assert root.findtext("export/build_type") == "ament_python"
    assert setup_arguments["tests_require"] == ["pytest"]


def test_every_executable_has_a_module_with_a_main(setup_arguments):
    for line in setup_arguments["entry_points"]["console_scripts"]:
        name, module, function = re.fullmatch(r"(\S+) = ([\w.]+):(\w+)", line).groups()
        folder = ROOT / "nodes" if module.startswith("dart_skill_nodes") else ROOT
        path = folder / (module.replace(".", "/") + ".py")
        path = path if path.is_file() else path.with_suffix("") / "__init__.py"
        assert path.is_file(), f"{name}: {path.relative_to(ROOT)} does not exist"
        tree = ast.parse(path.read_text())
        defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        defined |= {
            alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        assert function in defined, f"{path.relative_to(ROOT)} has no {function}()"


def test_every_node_is_an_executable(setup_arguments):
    installed = {
        line.split(" = ")[0] for line in setup_arguments["entry_points"]["console_scripts"]
    }
    executables = {
        path.stem for path in (ROOT / "nodes" / "dart_skill_nodes" / "executables").glob("*.py")
    } - {"__init__"}
    assert executables == installed - {"dart-skill"}


def test_every_import_is_a_declared_dependency():
    declared = texts(package(ROOT), "depend", "exec_depend")
    missing = {
        f"{KEYS.get(name, name)} (imported in {file})"
        for name, file in imported("dart_skill", "nodes", "launch").items()
        if KEYS.get(name, name) not in declared
    }
    assert not missing, f"package.xml lacks {', '.join(sorted(missing))}"


def test_every_import_of_the_library_is_in_the_requirements():
    lines = (ROOT / "requirements" / "runtime.txt").read_text().splitlines()
    provided = {workspace.module_of(line) for line in lines if line and not line.startswith("#")}
    provided |= {"pybullet_utils"} if "pybullet" in provided else set()
    missing = {name: file for name, file in imported("dart_skill").items() if name not in provided}
    assert not missing


@pytest.mark.parametrize("python", ["3.10", "3.11", "3.12", "3.13"])
def test_what_is_locked_is_what_the_requirements_allow(python):
    here = {"python_version": python, "python_full_version": f"{python}.0"}
    locked = {}
    for line in workspace.LOCK.read_text().replace("\\\n", "").splitlines():
        text, *of_file = [part.strip() for part in line.split("--hash=sha256:")]
        if text and not text.startswith("#"):
            requirement = Requirement(text)
            assert of_file and all(re.fullmatch("[0-9a-f]{64}", one) for one in of_file), (
                f"{text} has no hash: make lock"
            )
            if requirement.marker is None or requirement.marker.evaluate(here):
                (locked[canonicalize_name(requirement.name)],) = requirement.specifier
    for file in ("build", "runtime", "test", "ros-pypi"):
        for line in workspace.with_versions(ROOT / "requirements" / f"{file}.txt"):
            wanted = Requirement(line)
            if wanted.marker is None or wanted.marker.evaluate(here):
                version = locked[canonicalize_name(wanted.name)].version
                assert wanted.specifier.contains(version), (
                    f"{line}: {version} is locked: make lock"
                )


@pytest.mark.skipif(
    "/opt/ros" in os.environ.get("AMENT_PREFIX_PATH", ""),
    reason="the lock is for the wheels of ROS",
)
def test_the_lock_holds_all_that_its_packages_need():
    """Set-up installs it without resolving: a newer release of what a package needs would stop
    pip, for want of a hash.
    """
    locked = [
        canonicalize_name(line.split("==")[0])
        for line in workspace.LOCK.read_text().splitlines()
        if line[:1].isalnum()
    ]
    installed = {canonicalize_name(one.name): one for one in importlib.metadata.distributions()}
    for distribution in (installed[name] for name in locked if name in installed):
        for text in distribution.requires or ():
            requirement = Requirement(text)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                name = canonicalize_name(requirement.name)
                assert name in locked, f"{distribution.name} needs {text}: make lock"
                assert requirement.specifier.contains(installed[name].version, prereleases=True), (
                    f"{distribution.name} needs {text}"
                )


@pytest.fixture
def installing(tmp_path, monkeypatch):
    """Carries out the installation of the lock without running anything; what would run, and what
    the files that are named there hold.
    """
    commands, fails = [], set()

    def note(some, environment):
        texts = [
            "".join(Path(name).read_text() for name in one if name.endswith(".txt"))
            for one in some
        ]
        commands.extend(zip(some, texts, [environment] * len(some), strict=True))
        if any(name in Path(one[0]).name for one in some for name in fails):
            raise workspace.SetupError("the package index cannot be reached")

    def install(settings="", failing=()):
        fails.update(failing)
        monkeypatch.setattr(subprocess, "check_output", lambda *_, **__: settings)
        work = workspace.Workspace(
            None, workspace.Interpreter(Path(sys.executable), sys.version_info[:2])
        )
        workspace.install_packages(work)
        return commands, workspace.modules_step(work)

    monkeypatch.setattr(workspace, "run_side_by_side", note)
    monkeypatch.setattr(workspace, "rewrite_include_paths", lambda _: None)
    monkeypatch.setattr(workspace, "write_prefix_scripts", lambda: None)
    monkeypatch.setattr(workspace, "forget_modules_without_types", lambda: None)
    monkeypatch.setattr(workspace, "stale_modules", list)
    monkeypatch.setattr(workspace, "INSTALL", tmp_path / "install")
    monkeypatch.setattr(workspace, "STAND_IN", tmp_path / "stand_in" / "ros2")
    return install


def test_locked_packages_are_not_resolved_anew_and_modules_are_compiled_meanwhile(installing):
    commands, modules = installing(
        settings="global.cert='/etc/certificates.crt'\nglobal.extra-index-url='file:///more'\n"
    )
    (_, first, _), (uv, locked, environment), (compiling, _, _) = commands
    assert {"--require-hashes", "--no-deps"} <= set(commands[0][0]) & set(uv)
    assert sorted(re.findall(r"(?m)^[\w-]+", first)) == [
        "cython",
        "setuptools",
        "setuptools",
        "uv",
    ], "one setuptools for each range of Pythons"
    assert first.count("--hash") > 10 and locked == workspace.LOCK.read_text()
    assert "build_ext" in compiling and modules.is_done()
    assert environment["SSL_CERT_FILE"] == os.environ.get("SSL_CERT_FILE", "/etc/certificates.crt")


def test_a_module_that_was_not_compiled_meanwhile_is_compiled_in_a_step_of_its_own(
    installing, monkeypatch
):
    monkeypatch.setattr(
        workspace,
        "stale_modules",
        lambda: [workspace.ROOT / "dart_skill" / "common" / "small_matrices.py"],
    )
    _, modules = installing()
    assert not modules.is_done()
    monkeypatch.setattr(workspace, "run", lambda *_: None)
    with pytest.raises(
        workspace.SetupError,
        match=r"dart_skill/common/small_matrices\.py was not compiled: .* says why",
    ):
        modules.work(
            workspace.Workspace(
                None, workspace.Interpreter(Path(sys.executable), sys.version_info[:2])
            )
        )


def test_what_was_compiled_before_a_change_is_stale(tmp_path, monkeypatch):
    folder = tmp_path / "dart_skill"
    folder.mkdir()
    for name, age in (("kept", 0), ("changed", 2), ("failed", None)):
        for suffix in (".py", ".pxd"):
            (folder / f"{name}{suffix}").touch()
        if age is not None:
            made = folder / f"{name}.cpython-311.so"
            made.touch()
            os.utime(made, (made.stat().st_atime, made.stat().st_mtime - age))
    monkeypatch.setattr(workspace, "ROOT", tmp_path)
    assert [path.name for path in workspace.stale_modules()] == ["changed.py", "failed.py"]


@pytest.mark.parametrize(
    "setting",
    ["global.index-url='https://here/simple'", ":env:.no-index='1'", "user.proxy='here:3128'"],
)
def test_an_index_or_proxy_of_pip_is_used_by_pip_alone(installing, setting):
    commands, modules = installing(settings=setting)
    assert [command[1:4] for command, _, _ in commands] == [["-m", "pip", "install"]]
    assert commands[0][1] == workspace.LOCK.read_text() and {
        "--require-hashes",
        "--no-deps",
    } <= set(commands[0][0])
    assert not modules.is_done()


def test_where_uv_fails_pip_tries(installing, capsys):
    commands, modules = installing(failing=["uv"])
    assert [Path(command[0]).name for command, _, _ in commands] == [
        "python3",
        "uv",
        "python3",
        "python3",
    ]
    assert commands[-1][1] == workspace.LOCK.read_text() and not modules.is_done()
    assert "cannot be reached; pip tries the same" in capsys.readouterr().out


def test_a_file_that_is_changed_is_not_changed_in_the_cache_that_holds_it_too(
    tmp_path, monkeypatch
):
    cached, file = tmp_path / "cached", tmp_path / "share/some.cmake"
    file.parent.mkdir()
    cached.write_text("/opt/python/cp311-cp311/include/python3.11")
    file.hardlink_to(cached)
    monkeypatch.setattr(workspace, "VENV", tmp_path)
    monkeypatch.setattr(workspace.Workspace, "ask", lambda *_: "/here/include\n/here/numpy\n")
    workspace.rewrite_include_paths(
        workspace.Workspace(None, workspace.Interpreter(Path(sys.executable), (3, 11)))
    )
    assert file.read_text() == "/here/include" and cached.read_text().startswith("/opt/python")


def test_what_was_compiled_of_a_module_without_types_is_taken_away(tmp_path, monkeypatch):
    folder = tmp_path / "dart_skill" / "robot"
    folder.mkdir(parents=True)
    for name in (
        "kept.pxd",
        "kept.cpython-311-x86_64-linux-gnu.so",
        "former.cpython-311-x86_64-linux-gnu.so",
        "_arrays.cpython-311.so",
    ):
        (folder / name).touch()
    monkeypatch.setattr(workspace, "ROOT", tmp_path)
    workspace.forget_modules_without_types()
    assert sorted(path.name.split(".")[0] for path in folder.glob("*.so")) == ["_arrays", "kept"]


def test_over_an_installed_ros_what_is_not_there_or_too_old_is_installed(tmp_path, monkeypatch):
    """Ubuntu 24.04 has Matplotlib 3.6, where figures ended with an error."""
    file = tmp_path / "runtime.txt"
    file.write_text(
        "numpy>=1.26\nscipy>=99  # newer\nno_such_package>=1\nno_such_other; python_version <"
        ' "3"\npyyaml>=6\n'
    )
    monkeypatch.setattr(workspace, "requirement_files", lambda _: [file])
    missing, numpy = workspace.missing_requirements(
        workspace.Workspace(None, workspace.probe(sys.executable))
    )
    assert missing == ["scipy>=99", "no_such_package>=1"] and numpy == importlib.metadata.version(
        "numpy"
    )


def test_of_commands_side_by_side_one_that_fails_ends_the_others(tmp_path, monkeypatch):
    in_the_log(tmp_path, monkeypatch, "")
    monkeypatch.setattr(workspace, "ROOT", tmp_path)
    with pytest.raises(workspace.SetupError, match="the disk is full"):
        workspace.run_side_by_side(
            [["sleep", "600"], ["sh", "-c", "echo No space left on device; exit 1"]],
            dict(os.environ),
        )
    workspace.run_side_by_side(
        [["true"], ["sh", "-c", f"touch {tmp_path}/done"]], dict(os.environ)
    )
    assert (tmp_path / "done").exists()


def test_everything_that_is_installed_exists(setup_arguments):
    files = {file for _, files in setup_arguments["data_files"] for file in files}
    assert {"package.xml", "resource/dart_skill"} <= files
    assert [file for file in files if not (ROOT / file).is_file()] == []
    assert setup_arguments["package_dir"] == {"dart_skill_nodes": "nodes/dart_skill_nodes"}
    # without it nobody's type checker looks at the hints
    library, (patterns,) = ROOT / "dart_skill", setup_arguments["package_data"].values()
    installed = {path for pattern in patterns for path in library.glob(pattern)}
    wanted = {path for kind in ("*.pxd", "*.pyi", "py.typed") for path in library.rglob(kind)}
    assert installed == wanted and library / "py.typed" in wanted
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "dart_skill").rglob("*.py")}
    folders |= {path.parent.relative_to(ROOT / "nodes") for path in (ROOT / "nodes").rglob("*.py")}
    missing = {str(folder).replace("/", ".") for folder in folders} - set(
        setup_arguments["packages"]
    )
    assert not missing, f"folders without __init__.py: {missing}"


def test_every_interface_is_generated():
    folder = ROOT / "msg_schemas"
    kinds = ("msg", "srv", "action")
    files = [str(path.relative_to(folder)) for kind in kinds for path in folder.glob(f"{kind}/*")]
    listed = re.findall(r'"((?:msg|srv|action)/[^"]+)"', (folder / "CMakeLists.txt").read_text())
    assert sorted(listed) == sorted(files)


def test_packages_of_all_field_types_are_dependencies_of_the_interfaces():
    folder = ROOT / "msg_schemas"
    lines = [line for path in folder.glob("*/*.*") for line in path.read_text().splitlines()]
    used = {match.group(1) for line in lines if (match := re.match(r"(\w+)/\w+", line))} - {
        "dart_skill_msgs"
    }
    assert used, "no field of another package was found: is the pattern right?"
    generated = (
        re.search(r"DEPENDENCIES ([\w ]+)", (folder / "CMakeLists.txt").read_text())
        .group(1)
        .split()
    )
    assert used <= texts(package(folder), "depend")
    assert used <= set(generated)
    assert "rosidl_interface_packages" in texts(package(folder), "member_of_group")


# --- the choice of ROS and Python ---


def fake_python(path, version, lacks=""):
    """A program that answers the set-up's question as an interpreter of some version would."""
    answer = json.dumps([str(path), list(version), lacks])
    return str(write_executable(path, f"#!/bin/sh\necho '{answer}'\n"))


def fake_ros(prefix, python="3.12"):
    marker = prefix / "share/ament_index/resource_index/packages/rclpy"
    marker.parent.mkdir(parents=True)
    marker.touch()
    (prefix / f"lib/python{python}/site-packages/rclpy").mkdir(parents=True)
    (prefix / "setup.bash").write_text(
        f"export AMENT_PREFIX_PATH={prefix}\nexport ROS_DISTRO=jazzy\n"
    )
    return prefix


def test_an_interpreter_that_does_not_start_is_passed_over(tmp_path):
    shim = write_executable(
        tmp_path / "python3.11", "#!/bin/sh\necho 'pyenv: not found' >&2\nexit 127\n"
    )
    good = fake_python(tmp_path / "python3.10", (3, 10))
    probed = map(workspace.probe, [str(shim), "/nowhere/python3.11", good])
    chosen = workspace.choose(probed, workspace.PREFERRED)
    assert chosen == workspace.Interpreter(Path(good), (3, 10))


def test_an_interpreter_that_lacks_something_is_named_when_there_is_no_other(tmp_path):
    lame = fake_python(tmp_path / "python3.11", (3, 11), "its headers (Python.h)")
    whole = fake_python(tmp_path / "python3.12", (3, 12))
    probed = [workspace.probe(lame), workspace.probe(whole)]
    assert workspace.choose(probed, workspace.PREFERRED).version == (3, 12)
    with pytest.raises(
        workspace.SetupError, match=r"python3\.11 lacks its headers.*apt-get install"
    ):
        workspace.choose(probed[:1], workspace.PREFERRED)
    with pytest.raises(
        workspace.SetupError, match=r"no usable Python 3\.10 or 3\.11 or .* was found$"
    ):
        workspace.choose([], workspace.PREFERRED)


def test_interpreters_are_looked_for_in_the_system_on_the_path_and_in_pyenv_best_version_first(
    tmp_path, monkeypatch
):
    on_path = [
        fake_python(tmp_path / "bin" / f"python3.{minor}", (3, minor)) for minor in (97, 98)
    ]
    in_pyenv = fake_python(tmp_path / "root/versions/3.98.4/bin/python3.98", (3, 98))
    write_executable(tmp_path / "bin/pyenv", f"#!/bin/sh\necho {tmp_path}/root\n")
    of_system = fake_python(tmp_path / "system/python3.98", (3, 98))
    monkeypatch.setenv("PATH", f"{tmp_path}/bin")
    monkeypatch.setattr(workspace, "SYSTEM", tmp_path / "system")
    assert list(workspace.interpreter_paths([(3, 98), (3, 97)])) == [
        of_system,
        on_path[1],
        in_pyenv,
        on_path[0],
    ]


def test_a_named_interpreter_must_have_a_version_that_is_supported(tmp_path):
    named = fake_python(tmp_path / "python3.14", (3, 14))
    with pytest.raises(
        workspace.SetupError, match=r"is Python 3\.14; needed is 3\.10 or 3\.11 or"
    ):
        workspace.choose_interpreter(None, named)
    with pytest.raises(workspace.SetupError, match="nowhere does not run"):
        workspace.choose_interpreter(None, "/nowhere")


def test_this_interpreter_is_understood():
    assert workspace.probe(sys.executable).version == sys.version_info[:2]


def test_a_sourced_ros_comes_before_an_installed_one_and_decides_the_python(tmp_path):
    sourced, installed = fake_ros(tmp_path / "sourced"), fake_ros(tmp_path / "installed", "3.10")
    environment = {"AMENT_PREFIX_PATH": f"/nowhere:{sourced}", "ROS_DISTRO": "jazzy"}
    found = workspace.find_system_ros(environment, installed)
    assert found == workspace.SystemRos(sourced, is_sourced=True)
    assert found.python_version == (3, 12)
    beside = fake_python(sourced / "bin/python3.12", (3, 12))
    assert workspace.choose_interpreter(found, "").path == Path(beside)
    assert workspace.find_system_ros({}, installed) == workspace.SystemRos(
        installed, is_sourced=False
    )
    assert workspace.find_system_ros({}, tmp_path / "nowhere") is None


def test_an_installed_ros_is_sourced_for_the_build(tmp_path):
    ros = workspace.SystemRos(fake_ros(tmp_path / "ros"), is_sourced=False)
    assert ros.environment["AMENT_PREFIX_PATH"] == str(ros.prefix)


def test_the_wheels_of_a_workspace_are_no_installed_ros(tmp_path):
    wheels = fake_ros(tmp_path / "wheels")
    (wheels / "pyvenv.cfg").touch()
    assert (
        workspace.find_system_ros({"AMENT_PREFIX_PATH": str(wheels)}, tmp_path / "nowhere") is None
    )


def test_another_distribution_is_refused_by_name(tmp_path):
    environment = {"AMENT_PREFIX_PATH": str(fake_ros(tmp_path)), "ROS_DISTRO": "humble"}
    with pytest.raises(workspace.SetupError, match="ROS 2 humble is sourced"):
        workspace.find_system_ros(environment)


def test_a_build_does_not_see_the_former_one():
    own, guard = f"{workspace.INSTALL}/dart_skill", workspace.BOOTSTRAP_GUARD
    environment = {
        "AMENT_PREFIX_PATH": f"{own}:/opt/other",
        "PYTHONPATH": own,
        guard: "1",
        "HOME": "/h",
    }
    assert workspace.without_workspace(environment) == {
        "AMENT_PREFIX_PATH": "/opt/other",
        "HOME": "/h",
    }
    assert workspace.without_ros(environment) == {"HOME": "/h"}


# --- checks, steps and messages of the set-up ---


def test_a_missing_compiler_gets_one_line(tmp_path, monkeypatch):
    for variable in ("CC", "CXX", "MAKE"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    for program, complaint in (
        ("cc", "a C compiler"),
        ("g++", "a C++ compiler"),
        ("make", "make"),
    ):
        with pytest.raises(workspace.SetupError, match=f"^{re.escape(complaint)} is missing"):
            workspace.check_machine(needs_wheels=False)
        write_executable(tmp_path / program, "#!/bin/sh\n")
    workspace.check_machine(needs_wheels=False)


def test_a_full_disk_gets_one_line(monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(9e9, 8e9, 1e9))
    with pytest.raises(workspace.SetupError, match=r"1\.0 GB are free .* needs 4\.0 GB"):
        workspace.check_machine(needs_wheels=False)


@pytest.mark.parametrize(
    ("folder", "named"), [("my darts", "contains a space"), ("würfe", "contains ü, which")]
)
def test_a_folder_whose_path_the_build_does_not_bear_is_refused_before_anything_is_downloaded(
    folder, named, tmp_path, monkeypatch
):
    monkeypatch.setattr(workspace, "ROOT", tmp_path / folder)
    with pytest.raises(workspace.SetupError, match=f"the folder's path {named}.*{folder}"):
        workspace.check_machine(needs_wheels=False)


def test_a_machine_without_wheels_is_told_so(monkeypatch):
    monkeypatch.setattr(workspace.platform, "machine", lambda: "riscv64")
    with pytest.raises(workspace.SetupError, match="need Linux on x86-64.*this is .*riscv64"):
        workspace.check_wheels_exist()


@pytest.mark.parametrize(
    ("output", "line"),
    [
        (
            "Temporary failure in name resolution\nERROR: No matching distribution found for a",
            "network",
        ),
        (
            "ERROR: No matching distribution found for pin<5,>=2.7",
            "index has no fitting pin<5,>=2.7",
        ),
        ("OSError: [Errno 28] No space left on device", "the disk is full"),
        (
            "x.c:1:10: fatal error: Python.h: No such file or directory",
            "Python's headers are missing",
        ),
        (
            "warning: this\na.cpp:3: error: expected ';'\nninja: build stopped",
            "a.cpp:3: error: expected ';'",
        ),
        ("one\ntwo\n", "two"),
        ("", "said nothing"),
    ],
)
def test_the_cause_of_a_failure_is_found_in_its_log(output, line):
    assert line in workspace.explain(output)
    assert "\n" not in workspace.explain(output)


def test_a_step_is_done_again_only_when_what_it_depends_on_has_changed(tmp_path, capsys):
    done = []
    for wanted in ("a", "a", "b"):
        step = workspace.Step("stone", tmp_path / "stamp", wanted, done.append)
        step.bring_up_to_date(wanted)
    assert done == ["a", "b"]
    assert capsys.readouterr().out.count("set-up: stone") == 2


def test_a_step_that_failed_is_done_again(tmp_path):
    def fail(_):
        raise workspace.SetupError("no")

    stamp = tmp_path / "stamp"
    stamp.write_text("old")
    step = workspace.Step("stone", stamp, "new", fail)
    with pytest.raises(workspace.SetupError):
        step.bring_up_to_date(None)
    assert not stamp.exists()


def test_the_digest_sees_names_and_content(tmp_path, monkeypatch):
    monkeypatch.setattr(workspace, "ROOT", tmp_path)
    file = tmp_path / "folder" / "a"
    file.parent.mkdir()
    digests = []
    for name, content in (("a", "1"), ("a", "2"), ("b", "2")):
        file.unlink(missing_ok=True)
        file = file.with_name(name)
        file.write_text(content)
        digests.append(workspace.digest("text", tmp_path / "folder"))
    assert len(set(digests)) == 3
    assert workspace.digest("text", tmp_path / "folder") == digests[-1]


def in_the_log(tmp_path, monkeypatch, text):
    monkeypatch.setattr(workspace, "LOG", tmp_path / "setup.log")
    workspace.LOG.write_text(text)


@pytest.mark.parametrize(
    ("log", "said"),
    [
        ("", "at work"),
        (
            "  Downloading numpy-2.1-cp311.whl (18.3 MB)\n  Using cached x_y-1.0-py3.whl (3 kB)\n",
            r"x_y (3 kB), 2 packages so far",
        ),
        (
            "  Downloading a-1.whl (1 MB)\nInstalling collected packages: a\n",
            "installing what was downloaded",
        ),
        (
            "  Building wheel for pybullet (setup.py): started\n",
            "compiling pybullet, which takes minutes",
        ),
        ("[12/480] Building C object x.o\n", "step 12 of 480"),
        ("[ 37%] Building C object x.o\n", "37 % are compiled"),
    ],
)
def test_what_a_command_is_doing_is_read_from_its_log(log, said, tmp_path, monkeypatch):
    in_the_log(tmp_path, monkeypatch, f"of another command: [1/9]\n{log}")
    assert workspace.doing(len("of another command: [1/9]\n")) == said


def test_a_command_that_takes_long_is_told_of_where_no_terminal_is(tmp_path, monkeypatch, capsys):
    in_the_log(tmp_path, monkeypatch, "[1/2] x\n")
    monkeypatch.setattr(workspace, "TOLD_EVERY", 0.0)
    assert workspace.watch([subprocess.Popen(["sh", "-c", "sleep 1.3; exit 3"])], 0) == 3
    assert re.fullmatch(r"(\n  \d s: step 1 of 2)+\n ", capsys.readouterr().out)


def test_the_command_of_the_workspace_is_called_by_its_path_without_sourcing_anything():
    command = ROOT / ".venv" / "bin" / "dart-skill"
    if not command.is_file():
        pytest.skip("the workspace is not built here")
    bare = {"PATH": os.defpath, "HOME": os.environ.get("HOME", "/")}
    done = subprocess.run(
        [command, "status", "--help"], env=bare, cwd="/", capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "--json" in done.stdout, "the nodes are not found: the options of 'status' are theirs"


def test_sourcing_the_environment_before_the_set_up_says_what_to_do(tmp_path):
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools/env.sh", tmp_path / "tools")
    command = ["bash", "-c", f". {tmp_path}/tools/env.sh"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "run 'make setup'" in done.stderr


# --- the stand-in for ros2 ---


@pytest.fixture
def ros2(tmp_path):
    """Calls the stand-in with a prefix of its own; executables are added with `ros2.add`."""
    prefix = tmp_path / "prefix"
    environment = {**os.environ, "AMENT_PREFIX_PATH": f"{tmp_path}/empty:{prefix}"}

    def start(*arguments):
        command = [sys.executable, str(ROOT / "tools/ros2_stand_in.py"), *arguments]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env=environment, stdout=pipe, stderr=pipe, text=True)

    def call(*arguments):
        process = start(*arguments)
        out, err = process.communicate(timeout=30)
        return process.returncode, out, err

    def add(package_name, executable, text):
        marker = prefix / "share/ament_index/resource_index/packages" / package_name
        marker.parent.mkdir(parents=True, exist_ok=True)
        marker.touch()
        return write_executable(prefix / "lib" / package_name / executable, text)

    call.start, call.add = start, add
    return call


def test_run_passes_arguments_and_exit_status(ros2):
    ros2.add("pack", "tell", '#!/bin/sh\nprintf "<%s>" "$@"\nexit 7\n')
    arguments = ["--ros-args", "-p", "seed:=3", "--help", "two words"]
    status, out, err = ros2("run", "pack", "tell", *arguments)
    assert (status, err) == (7, "")
    assert out == "".join(f"<{argument}>" for argument in arguments)


def test_run_puts_a_command_in_front(ros2):
    path = ros2.add("pack", "tell", "#!/bin/sh\n")
    assert (
        ros2("run", "--prefix", "echo in front", "pack", "tell", "x")[1] == f"in front {path} x\n"
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_reach_the_executable(ros2, number):
    ros2.add(
        "pack",
        "wait",
        f"#!{sys.executable}\n"
        "import signal, sys\n"
        "for number in (signal.SIGINT, signal.SIGTERM):\n"
        "    signal.signal(number, lambda got, _: sys.exit(100 + got))\n"
        "print('ready', flush=True)\n"
        "signal.pause()\n",
    )
    process = ros2.start("run", "pack", "wait")
    assert process.stdout.readline() == "ready\n"
    process.send_signal(number)
    process.communicate(timeout=30)
    assert process.returncode == 100 + number


def test_an_unknown_package_or_executable_is_refused_in_one_line(ros2):
    ros2.add("pack", "tell", "#!/bin/sh\n")
    (ros2.add("pack", "notes.txt", "")).chmod(0o644)
    status, out, err = ros2("run", "nothing", "tell")
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "there is no package 'nothing'" in err
    status, out, err = ros2("run", "pack", "notes.txt")
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "package 'pack' has no executable 'notes.txt'; it has: tell" in err


def test_an_executable_that_cannot_start_is_told_in_one_line(ros2):
    ros2.add("pack", "stale", "#!/nowhere/python3\n")
    status, _, err = ros2("run", "pack", "stale")
    assert status == 1
    assert err.count("\n") == 1 and "stale does not start: No such file" in err


def test_packages_and_executables_are_listed(ros2):
    for name, executable in (("zoo", "b"), ("pack", "tell"), ("zoo", "a")):
        ros2.add(name, executable, "#!/bin/sh\n")
    assert ros2("pkg", "list") == (0, "pack\nzoo\n", "")
    assert ros2("pkg", "executables") == (0, "pack tell\nzoo a\nzoo b\n", "")
    assert ros2("pkg", "executables", "zoo") == (0, "zoo a\nzoo b\n", "")
    assert ros2("pkg", "executables", "nothing")[0] == 1


def test_it_says_what_it_is_and_refuses_the_rest(ros2):
    status, out, _ = ros2("--help")
    assert status == 0
    assert "stand-in" in out and "no launch" in out
    status, out, err = ros2("launch", "dart_skill", "x.launch.py")
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert "'launch' needs an installed ROS 2; dart-skill up starts the graph" in err


def test_what_it_recommends_are_commands():
    from dart_skill.cli._completion import commands_of
    from dart_skill.cli._main import _parser

    known = {command.prog for command in commands_of(_parser())}
    instead = runpy.run_path(str(ROOT / "tools" / "ros2_stand_in.py"))["INSTEAD"]
    named = [
        found[0] for text in instead.values() for found in re.finditer(r"dart-skill \w+", text)
    ]
    assert named and set(named) <= known


# --- domains of test runs ---


def test_runs_side_by_side_get_domains_of_their_own(request):
    conftest = request.config.pluginmanager.getplugin(str(ROOT / "tests" / "conftest.py"))
    assert os.environ["ROS_DOMAIN_ID"] == str(conftest.ROS_DOMAIN)
    assert os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    first, lock = conftest.take_domain(conftest.ROS_DOMAIN - 1)
    second, other = conftest.take_domain(conftest.ROS_DOMAIN - 1)
    lock.close(), other.close()
    assert len({conftest.ROS_DOMAIN, first, second}) == 3
    assert all(1 <= domain <= 100 for domain in (first, second))


# --- what an import costs ---

HEAVY = (
    "scipy.linalg",
    "scipy.sparse",
    "scipy.spatial",
    "scipy.optimize",
    "scipy.interpolate",
    "matplotlib",
    "pybullet",
    "numba",
)


@pytest.mark.parametrize(
    "package", ["dart_skill.mixture", "dart_skill.movement", "dart_skill.policy_search"]
)
def test_importing_the_core_loads_only_what_it_needs_at_once(package):
    program = f"import sys, {package}; print([name for name in {HEAVY} if name in sys.modules])"
    assert (
        subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        ).stdout.strip()
        == "[]"
    )


@pytest.mark.skipif(
    not (ROOT / ".git").exists(), reason="a checkout by git says what git leaves out of sight"
)
@pytest.mark.parametrize(
    "left",
    (
        "output/demo/summary.json",
        "figures/heat_map.png",
        "demonstrations_2026_11_25-15_57_35/metadata.yaml",
        "recording_2026_11_25-16_43_10/metadata.yaml",
        "demonstrations_model.npz",
        "bags/throws_report.html",
        *(f"throws_{ending}/file" for ending in ("converted", "csv", "lerobot", "recovered")),
        ".venv-rerun/bin/rerun",
    ),
)
def test_what_the_commands_of_the_documentation_leave_is_no_change(left):
    """Bags of nodes that were given no name for theirs stand where the node was started."""
    seen = subprocess.run(["git", "check-ignore", "-q", left], cwd=ROOT, check=False)
    assert seen.returncode == 0, f"git status would show {left}"
