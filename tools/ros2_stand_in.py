#!/usr/bin/env python3
"""A stand-in for `ros2`, for machines that have ROS 2 as PyPI wheels, which do not bring the
command along.

It finds packages through the ament index (AMENT_PREFIX_PATH) as the real one does. `ros2 run`
becomes the executable: that has this process's id, so every signal reaches it, and its exit status
is the command's.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path
from typing import NoReturn

DESCRIPTION = """\
This is a stand-in for the ros2 command, which the PyPI wheels of ROS 2 do not bring along. It can do
  ros2 run [--prefix COMMAND] <package> <executable> [arguments ...]
  ros2 pkg list
  ros2 pkg executables [<package>]
and nothing else: no launch, bag, topic, service, action, param or doctor. Those come with an installed ROS 2
Jazzy; where there is one, its own ros2 is used."""


STATUS = "dart-skill status shows nodes, topics, rates and publishers"
CLIENTS = (
    "dart-skill teach, learn, throw, execute and practice do what ours offer; rclpy calls any"
)
INSTEAD = {
    "topic": STATUS,
    "node": STATUS,
    "doctor": STATUS,
    "lifecycle": STATUS,
    "service": CLIENTS,
    "action": CLIENTS,
    "param": "dart-skill up --set NODE.PARAMETER=VALUE starts with others",
    "launch": "dart-skill up starts the graph",
    "bag": "dart-skill bag info, check and play, and ros2 run dart_skill recorder",
    "interface": "docs/reference.md lists all types",
    "security": "dart-skill security writes the policy",
}
"""What does the same here, by the verbs that people type first."""


class StandInError(Exception):
    """What cannot be done, in one line."""


def prefixes() -> list[Path]:
    return [
        Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry
    ]


def packages() -> dict[str, Path]:
    """Packages of the ament index with their prefixes; the first prefix wins."""
    found: dict[str, Path] = {}
    for prefix in prefixes():
        index = prefix / "share/ament_index/resource_index/packages"
        if index.is_dir():
            for marker in index.iterdir():
                found.setdefault(marker.name, prefix)
    return dict(sorted(found.items()))


def executables(package: str, prefix: Path) -> list[Path]:
    folder = prefix / "lib" / package
    if not folder.is_dir():
        return []
    return sorted(path for path in folder.iterdir() if path.is_file() and os.access(path, os.X_OK))


def prefix_of(package: str) -> Path:
    """The prefix that a package is installed in."""
    known = packages()
    if package not in known:
        where = os.environ.get("AMENT_PREFIX_PATH") or "nothing; source tools/env.sh first"
        raise StandInError(f"there is no package '{package}' (AMENT_PREFIX_PATH is {where})")
    return known[package]


def run(package: str, executable: str, arguments: list[str], command_prefix: str = "") -> NoReturn:
    """Replaces this process by an executable of a package."""
    candidates = executables(package, prefix_of(package))
    for path in candidates:
        if path.name == executable:
            command = [*shlex.split(command_prefix), str(path), *arguments]
            try:
                os.execvp(command[0], command)
            except OSError as error:
                raise StandInError(f"{command[0]} does not start: {error.strerror}") from error
    names = ", ".join(path.name for path in candidates) or "none"
    raise StandInError(f"package '{package}' has no executable '{executable}'; it has: {names}")


def list_executables(package: str | None, full_path: bool) -> None:
    """Prints them as the real command does, one a line."""
    chosen = packages() if package is None else {package: prefix_of(package)}
    for name, prefix in chosen.items():
        for path in executables(name, prefix):
            print(path if full_path else f"{name} {path.name}")


def parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    top = argparse.ArgumentParser(prog="ros2", description=DESCRIPTION, formatter_class=raw)
    verbs = top.add_subparsers(dest="verb", metavar="run | pkg")
    runner = verbs.add_parser("run", help="run an executable of a package")
    runner.add_argument(
        "--prefix", default="", help="goes in front of the executable, such as 'gdb --args'"
    )
    runner.add_argument("package")
    runner.add_argument("executable")
    runner.add_argument("arguments", nargs=argparse.REMAINDER)
    looker = verbs.add_parser("pkg", help="look packages up")
    pkg = looker.add_subparsers(dest="what", required=True, metavar="list | executables")
    pkg.add_parser("list", help="names of all packages")
    lister = pkg.add_parser("executables", help="executables of one package or of all")
    lister.add_argument("--full-path", action="store_true")
    lister.add_argument("package", nargs="?")
    return top


def main(arguments: list[str]) -> int:
    """Does what was asked, or says in one line why it cannot."""
    if arguments and not arguments[0].startswith("-") and arguments[0] not in ("run", "pkg"):
        instead = INSTEAD.get(arguments[0], "see ros2 --help")
        print(
            f"ros2 (stand-in): '{arguments[0]}' needs an installed ROS 2; {instead}",
            file=sys.stderr,
        )
        return 1
    asked = parser().parse_args(arguments)
    try:
        if asked.verb == "run":
            run(asked.package, asked.executable, asked.arguments, asked.prefix)
        elif asked.verb == "pkg" and asked.what == "list":
            print("\n".join(packages()))
        elif asked.verb == "pkg":
            list_executables(asked.package, asked.full_path)
        else:
            parser().print_help()
    except StandInError as error:
        print(f"ros2 (stand-in): {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
