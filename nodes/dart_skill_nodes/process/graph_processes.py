"""The node graph as processes: what runs, with which parameters, and how it is started, watched
and ended.

`layout` "composed" puts all nodes into one process but the learner, which works for seconds at a
time; "processes" gives every node its own.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from dart_skill.common.permissions import enclave_of
from dart_skill_nodes.comms.names import COMMANDS, GUIDING, JOINT_STATES, in_namespace, pose_topics
from dart_skill_nodes.process.environment import ENDS_WITH

LAYOUTS = {
    "composed": ("composed", "skill_learner"),
    "processes": (
        "wam_simulator",
        "mock_optitrack",
        "commander",
        "demonstration_recorder",
        "teacher",
        "coach",
        "skill_learner",
    ),
    "hardware": ("commander", "demonstration_recorder", "coach", "skill_learner"),
    "replay": ("skill_learner", "demonstration_recorder", "bag_player"),
}
"""Executables: the simulated graph in two processes or in seven; what a real arm and real cameras
need besides; what a recording needs.
"""
SIMULATED = ("composed", "processes")
NODES = LAYOUTS["processes"]
"""Names of all nodes; each is the name of its executable too."""
NODES_OF = {"composed": NODES[:-1]}
"""Nodes of an executable that has several."""
TAKING_TURNS = ("wam_simulator", "commander")
"""They wait for each other at every step: on one core they hand over faster than from core to core
(1.6 times, on two cores).
"""
OVERRIDE = "ROS_SECURITY_ENCLAVE_OVERRIDE"
"""Environment variable: the enclave of the process that starts the graph, not of the nodes."""
TOKEN = "DART_SKILL_VIEW_TOKEN"
"""Environment variable: what the address of the viewer's page must hold; each viewer makes one of
its own where it is not set.
"""
START = 180.0
"""For a graph to start: seven processes with all that they import, on a machine that has other
things to do [s, wall clock].
"""
OF_NO_SKILL = ("bag_player", "effort_bridge", "recorder")
"""Executables that do the same for every skill."""
SEEDED = (
    "composed",
    "wam_simulator",
    "mock_optitrack",
    "demonstration_recorder",
    "teacher",
    "coach",
)


class GraphFailure(RuntimeError):
    """The graph did not do its job: a node died, is missing, did not answer, or said no."""


def cut_out_of() -> str:
    """What demonstrations are cut out of, as a regular expression; a replay begins when all of it
    is heard that the bag has.
    """
    return f".*/({'|'.join([JOINT_STATES, COMMANDS, GUIDING, *pose_topics().values()])})"


def parameters_of(
    executable: str, layout: str, seed=0, bag="", played="", rate=1.0, registration="", skill=""
) -> dict:
    """What an executable is started with in a layout, by names of parameters; the values may be a
    launch file's substitutions.

    seed: of a simulated graph. bag: what the demonstration recorder writes. played, rate: the bag
    of a replay, and how fast. registration: file of `dart-skill check arm --write`. skill: its
    name; empty: that of config/world.yaml.
    """
    parameters = {"seed": seed} if executable in SEEDED and layout in SIMULATED else {}
    if skill != "" and executable not in OF_NO_SKILL:
        parameters["skill"] = skill
    if executable in ("composed", "demonstration_recorder"):
        parameters["bag"] = bag
    if registration != "" and executable in ("commander", "skill_learner"):
        parameters["registration_file"] = registration
    if layout == "hardware" and executable == "commander":
        # costs NumPy, which completion with TAB does without
        from dart_skill.common.fleet import arm_named

        parameters |= arm_named("unmeasured")["commander"]
    if layout == "hardware" and executable == "coach":
        parameters["simulated"] = False
    if layout == "replay" and executable == "demonstration_recorder":
        parameters["automatic"] = True
    if executable == "bag_player":
        parameters |= {
            "bag": played,
            "rate": rate,
            "graph": True,
            "exclude": ["/demonstrations"],
            "commands": True,
            "awaited": [cut_out_of()],
        }
    return parameters


def of_executables(layout: str, differs: dict[str, dict]) -> dict[str, dict]:
    """Parameters by node as those of a layout's executables; where one runs several nodes, with
    the node's name before each. Of nodes that do not run, none.
    """

    def of(executable: str) -> dict:
        if executable not in NODES_OF:
            return dict(differs.get(executable, {}))
        return {
            f"{node}:{name}": value
            for node in NODES_OF[executable]
            for name, value in differs.get(node, {}).items()
        }

    return {executable: of(executable) for executable in LAYOUTS[layout]}


def nodes_of(executables: Iterable[str]) -> list[str]:
    """Names of the nodes that executables run."""
    return [node for executable in executables for node in NODES_OF.get(executable, (executable,))]


@dataclass
class Graph:
    """Running nodes, each a process with its log in `logs`; a context manager that leaves no
    process behind.

    remappings: per executable, names of topics and what they are called instead. namespace: of all
    nodes, as "/arm1".
    """

    logs: Path
    remappings: dict[str, dict[str, str]] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen] = field(default_factory=dict)
    namespace: str = ""

    def start(self, executable: str, parameters: dict | None = None) -> None:
        """Start an executable of this package; parameters go on its command line, and so do the
        graph's remappings.
        """
        arguments = [
            ("-p", f"{name}:={_text(value)}") for name, value in (parameters or {}).items()
        ]
        arguments += [
            ("-r", f"{name}:={other}")
            for name, other in self.remappings.get(executable, {}).items()
        ]
        if os.environ.get("ROS_SECURITY_ENABLE") == "true":
            arguments.append(("--enclave", enclave_of(executable, self.namespace)))
        command = [sys.executable, "-m", f"dart_skill_nodes.executables.{executable}"]
        command += in_namespace(self.namespace)
        if arguments:
            command += ["--ros-args", *(part for argument in arguments for part in argument)]
        self.logs.mkdir(parents=True, exist_ok=True)
        with open(self.logs / f"{executable}.log", "ab") as log:
            environment = {
                name: value for name, value in os.environ.items() if name != OVERRIDE
            } | {ENDS_WITH: str(os.getpid())}
            process = subprocess.Popen(
                command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, env=environment
            )
        self.processes[executable] = process
        if not self.processes.keys().isdisjoint(TAKING_TURNS):
            _place(process, executable, self.namespace)

    def start_all(
        self,
        layout: str,
        seed: int,
        bag: Path,
        extra: dict[str, dict] | None = None,
        skill: str = "",
    ) -> None:
        """Start a whole layout with one seed, the bag to record to, and a skill."""
        for executable in LAYOUTS[layout]:
            self.start(
                executable,
                parameters_of(executable, layout, seed, str(bag), skill=skill)
                | (extra or {}).get(executable, {}),
            )

    def dead(self) -> str:
        """What to say about a process that has ended by itself, with the end of its log; empty if
        all run.
        """
        for name, process in self.processes.items():
            if process.poll() is not None:
                tail = (
                    (self.logs / f"{name}.log")
                    .read_text(encoding="utf-8", errors="replace")
                    .splitlines()[-8:]
                )
                return f"{name} ended with status {process.returncode}:\n  " + "\n  ".join(tail)
        return ""

    def stop(self, patience: float = 15.0) -> None:
        """End every process in order: SIGINT, so that bags are closed; SIGKILL for what does not
        listen.
        """
        for process in self.processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        until = time.monotonic() + patience
        for process in self.processes.values():
            try:
                process.wait(max(0.1, until - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.processes.clear()

    def __enter__(self) -> "Graph":
        return self

    def __exit__(self, *_) -> None:
        self.stop()


def _place(process: subprocess.Popen, executable: str, namespace: str) -> None:
    """Keep the nodes that take turns on a core of their own, another one for every ROS domain and
    namespace; the rest has the others.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    chosen = cores[
        (int(os.environ.get("ROS_DOMAIN_ID", "0")) + sum(namespace.encode())) % len(cores)
    ]
    others = set(cores) - {chosen}
    if others:
        os.sched_setaffinity(process.pid, {chosen} if executable in TAKING_TURNS else others)


def _text(value: object) -> str:
    """As the command line of a node takes it: YAML. A text that is YAML already stays so, but a
    mapping is quoted: nodes take it as text.
    """
    is_yaml = isinstance(value, str) and not value.startswith("{")
    return str(value) if is_yaml else json.dumps(value)
