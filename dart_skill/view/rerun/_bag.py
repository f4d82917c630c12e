"""Bags in Rerun: finding it, a layout that fits the bag, and the call.

Rerun needs a newer numpy than ROS 2 Jazzy has, so it lives in an environment of its own.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote
from xml.etree import ElementTree

from dart_skill.common.world import pose_topic, the_world
from dart_skill.recording import BagReader

VERSION = "0.41.0"
"""Version of the package rerun-sdk that this was tried with."""
SIZE = "790 MB"
"""Size of its environment."""
VARIABLE = "DART_SKILL_RERUN"
ENVIRONMENT = ".venv-rerun"
LAYOUT = Path(__file__).with_name("_blueprint.py")
HOST = "127.0.0.1"
"""Address of the page."""
RERUN_PORT = 9090
"""Port of the page."""
QUIET_LOG = "info,re_sdk::web_viewer=warn"
"""What Rerun writes: not the address of its own web server, whose page is not kept from asking
elsewhere.
"""
DATED_NS = 10**18
"""Stamps from 2001-09-09 on are dates [ns]; a simulated world begins at zero."""
POSE = "geometry_msgs/msg/PoseStamped"
"""Type of the poses."""
STATE = "sensor_msgs/msg/JointState"
"""Type of the states of the joints."""


class RerunUnavailable(RuntimeError):
    """Rerun cannot be used here; the message says what to do."""


@dataclass(frozen=True)
class BagLayout:
    """What of a bag is shown where; see `_blueprint`.

    Parameters
    ----------
    files
        All files of the bag, in order.
    frame
        The frame that poses stand in; None without poses.
    ball, basket
        Names of their bodies; None if the bag has none.
    joints
        Topic of the joint states; None if there is none.
    names
        Of the joints.
    effort
        Whether joint states hold torques.
    arm
        Name of the robot that is described; None if none is.
    stands
        How high its base is above the ground [m].
    dated
        Whether the clock of the bag shows dates; else it began at zero, as that of a simulator
        does.
    """

    files: tuple[Path, ...]
    frame: str | None
    ball: str | None
    basket: str | None
    joints: str | None
    names: tuple[str, ...] = ()
    effort: bool = False
    arm: str | None = None
    stands: float = 0.0
    dated: bool = True

    def of(self, file: Path) -> str:
        """For the layout script, as JSON; a recording is called as its file is."""
        about = {
            name: value for name, value in asdict(self).items() if name not in ("files", "dated")
        }
        world = the_world()
        about |= {
            "ball_radius": 0.5 * world.ball_diameter,
            "basket_size": [world.basket_radius, world.basket_depth],
        }
        return json.dumps({"application": file.stem, **about}, sort_keys=True)


def workspace() -> Path:
    """The checkout that this package lies in, or the current folder if it was installed elsewhere."""
    checkout = Path(__file__).resolve().parents[3]
    return checkout if (checkout / "package.xml").is_file() else Path.cwd()


def find_rerun(folder: Path | None = None) -> Path:
    """The executable: named by $DART_SKILL_RERUN, on PATH, or in `.venv-rerun` of the workspace.

    Raises
    ------
    RerunUnavailable
        Names the remedy.
    """
    folder = folder or workspace()
    chosen = os.environ.get(VARIABLE)
    if chosen:
        if not os.access(chosen, os.X_OK) or Path(chosen).is_dir():
            raise RerunUnavailable(
                f"{VARIABLE} is '{chosen}', which is no executable file: name the executable"
                " 'rerun' itself, or unset it"
            )
        return Path(chosen)
    own = folder / ENVIRONMENT / "bin" / "rerun"
    found = shutil.which("rerun") or (own if os.access(own, os.X_OK) else None)
    if found is None:
        raise RerunUnavailable(
            f"there is no Rerun: 'dart-skill view --install' puts it into {folder / ENVIRONMENT}"
            f" ({SIZE}), or set {VARIABLE} to an executable 'rerun'"
        )
    return Path(found)


def install(folder: Path | None = None) -> Path:
    """Make an environment with Rerun in the workspace.

    Returns
    -------
    Path
        The executable.

    Raises
    ------
    RerunUnavailable
        If that fails.
    """
    target = (folder or workspace()) / ENVIRONMENT
    executable = target / "bin" / "rerun"
    if os.access(executable, os.X_OK):
        return executable
    if target.exists():
        raise RerunUnavailable(f"{target} is there, but has no bin/rerun: remove it and try again")
    pip = [
        str(target / "bin" / "python3"),
        "-m",
        "pip",
        "install",
        "--disable-pip-version-check",
        f"rerun-sdk=={VERSION}",
    ]
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("PYTHONPATH", "PYTHONHOME")
    }
    for command in ([sys.executable, "-m", "venv", str(target)], pip):
        if subprocess.run(command, env=environment, stdout=sys.stderr).returncode:
            shutil.rmtree(target, ignore_errors=True)
            raise RerunUnavailable(f"'{' '.join(command)}' failed; {target} was removed again")
    return executable


def interpreter_of(rerun: Path) -> Path | None:
    """The Python whose package a `rerun` is: named in its first line, or beside it; None if there
    is none.
    """
    with open(rerun, "rb") as file:
        first = file.readline(500)
    named = (
        Path(os.fsdecode(first[2:].strip().split(b" ")[0])) if first.startswith(b"#!") else None
    )
    beside = (rerun.parent / name for name in ("python3", "python"))
    for candidate in (named, *beside):
        if (
            candidate is not None
            and candidate.name.startswith("python")
            and os.access(candidate, os.X_OK)
        ):
            return candidate
    return None


def describe(bag: str | os.PathLike) -> BagLayout:
    """What there is to show in a bag; BagError if it cannot be read, RerunUnavailable if Rerun
    cannot read it.
    """
    with BagReader(bag) as reader:
        if any(file.path.suffix != ".mcap" for file in reader.files):
            raise RerunUnavailable(
                f"{bag}: Rerun opens MCAP files only: 'dart-skill bag convert' makes a bag of"
                " these"
            )
        ball, basket = (
            _pose_topic(reader, the_world().ball_body),
            _pose_topic(reader, the_world().basket_body),
        )
        joints = next(
            (
                name
                for name, topic in sorted(reader.topics.items())
                if topic.type_name == STATE and topic.count
            ),
            None,
        )
        state = None if joints is None else next(reader.messages([joints])).data
        frame = next(
            (
                next(reader.messages([topic])).data.header.frame_id
                for topic in (ball, basket)
                if topic
            ),
            None,
        )
        arm, root = _robot(reader)
        frame = frame or root
        return BagLayout(
            tuple(file.path for file in reader.files),
            frame,
            ball,
            basket,
            joints,
            names=() if state is None else tuple(state.name),
            effort=state is not None and len(state.effort) > 0,
            arm=arm,
            stands=_height_of(reader, root, frame),
            dated=reader.start_ns >= DATED_NS,
        )


def write_layouts(rerun: Path, shown: BagLayout, folder: Path) -> list[Path]:
    """A layout for each file of a bag, made by Rerun's own interpreter.

    Parameters
    ----------
    shown
        What to show of the bag.

    Raises
    ------
    RerunUnavailable
        If it has none, or that fails.
    """
    python = interpreter_of(rerun)
    if python is None:
        raise RerunUnavailable(f"{rerun} belongs to no Python, which could make a layout")
    written = []
    for number, file in enumerate(shown.files):
        output = folder / f"layout_{number}.rbl"
        last = _complaint([str(python), "-I", str(LAYOUT), str(output), shown.of(file)], output)
        if last:
            raise RerunUnavailable(
                f"{python} made no layout ({last}): is rerun-sdk {VERSION} installed there?"
            )
        written.append(output)
    return written


def with_durations(
    rerun: Path, shown: BagLayout, folder: Path, environment: Mapping[str, str]
) -> list[Path]:
    """The files of a bag that Rerun opens: those of a simulated world as recordings in the folder,
    whose time is no date of 1970.

    Parameters
    ----------
    shown
        What to show of the bag.
    environment
        As `quiet_environment` makes it.

    Raises
    ------
    RerunUnavailable
        If Rerun cannot convert them.
    """
    if shown.dated:
        return list(shown.files)
    written = []
    for file in shown.files:
        output = folder / f"{file.stem}.rrd"
        names = ["--application-id", file.stem, "--timeline-type", "duration", "-o", str(output)]
        last = _complaint([str(rerun), "mcap", "convert", str(file), *names], output, environment)
        if last:
            raise RerunUnavailable(
                f"{rerun} did not convert {file} ({last}): is it rerun-sdk {VERSION}?"
            )
        written.append(output)
    return written


def _complaint(
    command: Sequence[str], output: Path, environment: Mapping[str, str] | None = None
) -> str:
    """The last line that a command says if it does not write its output; else nothing."""
    made = subprocess.run(command, env=environment, capture_output=True, text=True)
    if made.returncode or not output.is_file():
        return (made.stderr.strip().splitlines() or ["no output"])[-1]
    return ""


class Ports(NamedTuple):
    """Ports of the page, of Rerun's own web server behind it, and of the server of its data."""

    page: int
    behind: int
    data: int


def command_line(
    rerun: Path, files: Sequence[Path], layouts: Sequence[Path], ports: Ports | None = None
) -> list[str]:
    """The call of Rerun; its servers are bound to this machine alone.

    Parameters
    ----------
    files
        Of the bag.
    layouts
        For them.
    ports
        Of a web page, which `RerunPage` passes on; None: a window.
    """
    command = [str(rerun), *map(str, files), *map(str, layouts), "--bind", HOST]
    return (
        command
        if ports is None
        else [
            *command,
            "--serve-web",
            "--web-viewer-port",
            str(ports.behind),
            "--port",
            str(ports.data),
        ]
    )


def url_of_page(ports: Ports) -> str:
    """Where a browser on this machine finds the bag.

    Parameters
    ----------
    ports
        Of the page and its data.
    """
    return f"http://{HOST}:{ports.page}/?url={quote(f'rerun+http://{HOST}:{ports.data}/proxy', safe='')}"


def free_ports(first: int = RERUN_PORT) -> Ports:
    """The given port for the page, and free ones for what is behind it.

    Raises
    ------
    RerunUnavailable
        If the first one is taken.
    """
    with socket.socket() as page, socket.socket() as behind, socket.socket() as data:
        try:
            page.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            page.bind((HOST, first))
            behind.bind((HOST, 0))
            data.bind((HOST, 0))
        except (OSError, OverflowError) as error:
            raise RerunUnavailable(
                f"port {first} on {HOST} cannot be served ({error}): choose another one with"
                " --port"
            ) from error
        return Ports(page.getsockname()[1], behind.getsockname()[1], data.getsockname()[1])


def quiet_environment(folder: Path, rerun: Path) -> dict[str, str]:
    """Variables for a Rerun that reports nothing to its makers: with settings of its own in a
    folder, the user's stay as they are.
    """
    environment = {**os.environ, "XDG_CONFIG_HOME": str(folder), "TELEMETRY_ENABLED": "false"}
    for name in ("PYTHONPATH", "PYTHONHOME"):  # of ROS, whose numpy is not Rerun's
        environment.pop(name, None)
    environment.setdefault("RUST_LOG", QUIET_LOG)
    subprocess.run([str(rerun), "analytics", "disable"], env=environment, capture_output=True)
    return environment


def _pose_topic(reader: BagReader, body: str) -> str | None:
    """The topic of a body's poses that has messages; the names of vrpn_mocap come first."""
    named = [
        name
        for name, topic in sorted(reader.topics.items())
        if topic.type_name == POSE and topic.count and body in name.lower()
    ]
    usual = pose_topic(body)
    return usual if usual in named else next(iter(named), None)


def _robot(reader: BagReader) -> tuple[str | None, str | None]:
    """Name of the robot of /robot_description, and its link that hangs on no other; None without
    one, or if no transforms move it.
    """
    topics = reader.topics
    if not all(name in topics and topics[name].count for name in ("/robot_description", "/tf")):
        return None, None
    try:
        robot = ElementTree.fromstring(next(reader.messages(["/robot_description"])).data.data)
    except ElementTree.ParseError:
        return None, None
    children = {child.get("link") for child in robot.findall("joint/child")}
    return robot.get("name"), next(
        (name for link in robot.findall("link") if (name := link.get("name")) not in children),
        None,
    )


def _height_of(reader: BagReader, link: str | None, frame: str | None) -> float:
    """How high a link stands above the origin of a frame, by the bag's static transforms [m]; 0 if
    they do not say so.
    """
    if link is None or "/tf_static" not in reader.topics:
        return 0.0
    transforms = (
        one for message in reader.messages(["/tf_static"]) for one in message.data.transforms
    )
    heights = (
        one.transform.translation.z
        for one in transforms
        if (one.header.frame_id, one.child_frame_id) == (frame, link)
    )
    return float(next(heights, 0.0))
