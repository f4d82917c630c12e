"""Our own programs, started for tests without importing everything anew: forked from a process
that has.

A test run starts hundreds of nodes and commands, and each of them would import rclpy, NumPy,
SciPy, Pinocchio and PyBullet for a second of processor time. `WarmPopen` is `subprocess.Popen` for
whoever starts one: the process has its own number, arguments, environment, working directory,
streams and exit status. Whatever else is started, and whatever depends on how Python itself
begins, is started as ever. Tests of starting say `COLD = True` in their module: how the programs
begin is theirs to find out. `starting_warm` is for what they start for another reason.
"""

import atexit
import contextlib
import gc
import importlib
import json
import os
import selectors
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest.mock
from pathlib import Path

from tests.paths import ROOT

IMPORTED = (
    "dart_skill.cli", "dart_skill.session", "dart_skill.skills", "dart_skill.report", "dart_skill.figures", "dart_skill.view",
    "dart_skill.darts", "dart_skill.recording", "dart_skill.recording.bags", "dart_skill.recording.imports", "dart_skill_msgs.action",
    "dart_skill_nodes.executables.composed", "dart_skill_nodes.executables.skill_learner", "dart_skill_nodes.executables.viewer",
    "dart_skill_nodes.executables.recorder", "dart_skill_nodes.executables.bag_player", "dart_skill_nodes.executables.effort_bridge",
    "dart_skill_nodes.verbs.on_graph", "dart_skill_nodes.client.graph_client", "dart_skill.cli._main", "dart_skill.cli.bag",
    "dart_skill.cli.darts", "dart_skill.cli.experiment", "dart_skill.cli.graph_verbs", "dart_skill.cli.learn",
    "rclpy.experimental.events_executor", "scipy.spatial.transform", "scipy.optimize", "scipy.stats",
)  # fmt: skip
NODE = "dart_skill_nodes.executables."
SHELL = set("&|;<>$`*?(){}~#\n")
"""What a shell does more with than to part words."""
OF_THE_INTERPRETER = ("PYTHON", "LD_", "AMENT_", "MPL", "HOME", "PATH")
"""Beginnings of the names of variables that are looked at when a module is imported, or before."""
STARTER = "DART_SKILL_ENDS_WITH"
PATIENCE = 5.0
"""For a node whose starter is gone to end by itself [s]."""
ADDRESS = "DART_SKILL_TESTS_WARM"
"""Variable: where the process that is forked listens."""


def _decisive(environment) -> dict[str, str]:
    decisive = {
        name: value for name, value in environment.items() if name.startswith(OF_THE_INTERPRETER)
    }
    if Path(environment.get("DART_SKILL_CONFIG") or os.devnull, "world.yaml").exists():
        # the other files are read when somebody asks for them
        decisive["DART_SKILL_CONFIG"] = environment["DART_SKILL_CONFIG"]
    return decisive


IMPORTED_WITH = _decisive(os.environ)
"""Such variables of the process that is forked: it has those of whoever first imports this, and
hands them on.
"""


def program(command) -> tuple[str, list[str]] | None:
    """Module whose `main` a command line comes to, and its sys.argv; None for what is none of
    ours, or needs a shell.
    """
    words = [os.fspath(word) for word in command]
    if words[:2] == ["bash", "-c"] and len(words) == 3 and not SHELL.intersection(words[2]):
        words = shlex.split(words[2].removeprefix("exec "))
    if Path(words[0]).name == "dart-skill":
        return "dart_skill.cli", words
    if words[:3] == ["ros2", "run", "dart_skill"]:
        return NODE + words[3], words[3:]
    if words[0] == sys.executable and words[1:2] == ["-m"] and words[2].startswith(NODE):
        return words[2], words[2:]
    return None


class WarmPopen(subprocess.Popen):
    """`subprocess.Popen` that has our own programs forked from the process at `ADDRESS`.

    Only how a process is begun, and how its end is heard of, differs from the base class; there is
    no public way to say so.
    """

    _line: socket.socket | None = None

    def _execute_child(self, args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *others):
        environment = dict(os.environ if env is None else env)
        ours = (
            None
            if isinstance(args, (str, bytes)) or executable or preexec_fn or pass_fds
            else program(args)
        )
        # others: startupinfo, creationflags, shell; six ends of pipes; restore_signals; and what
        # only those give who care
        shell, pipes, begins_otherwise = (
            others[2],
            others[3:9],
            any(one not in (None, False, -1) for one in others[10:]),
        )
        if ours is None or shell or begins_otherwise or _decisive(environment) != IMPORTED_WITH:
            return super()._execute_child(
                args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *others
            )
        module, argv = ours
        stdin, _, _, stdout, _, stderr = pipes
        environment[ADDRESS] = _address()
        request = {
            "module": module,
            "argv": argv,
            "cwd": os.fspath(cwd or os.getcwd()),
            "environment": environment,
        }
        self._line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._line.connect(_address())
        body = json.dumps(request).encode()
        streams = [
            number if end == -1 else end for number, end in enumerate((stdin, stdout, stderr))
        ]
        socket.send_fds(self._line, [len(body).to_bytes(4, "big")], streams)
        self._line.sendall(body)
        self.pid = int.from_bytes(_exactly(self._line, 4), "big")
        self._child_created = True
        self._close_pipe_fds(*pipes)

    def _internal_poll(self, _deadstate=None, *others):
        if self._line is None:
            return super()._internal_poll(_deadstate, *others)
        if self.returncode is None and self._try_wait(os.WNOHANG)[0]:
            self._handle_exitstatus(self._status)
        return self.returncode

    def _try_wait(self, wait_flags):
        if self._line is None:
            return super()._try_wait(wait_flags)
        self._line.setblocking(wait_flags != os.WNOHANG)
        try:
            told = self._line.recv(4)
        except BlockingIOError:
            return 0, 0
        # who forked it is gone, and it with that
        self._status = int.from_bytes(told, "big") if told else signal.SIGKILL
        return self.pid, self._status


@contextlib.contextmanager
def starting_warm():
    """Our own programs start warm meanwhile, in a module that says `COLD = True`, too."""
    with unittest.mock.patch.object(subprocess, "Popen", WarmPopen):
        yield


def nodes_of(pid: int) -> dict[int, str]:
    """Names of the nodes that a process has started, and that have not ended, by the numbers of
    their processes: of forked ones and of those that were started as ever.
    """
    found, mark = {}, f"{STARTER}={pid}".encode()
    for file in Path(_address()).parent.glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            starter, module = file.read_text().split()
            if int(starter) == pid:
                found[int(file.name)] = module.removeprefix(NODE)
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if mark in (folder / "environ").read_bytes().split(b"\0"):
                words = (folder / "cmdline").read_bytes().decode().split("\0")
                names = [word.removeprefix(NODE) for word in words if word.startswith(NODE)]
                found[int(folder.name)] = names[0] if names else ""
    return found


def _exactly(line: socket.socket, n: int) -> bytes:
    body = b""
    while len(body) < n:
        part = line.recv(n - len(body))
        if not part:
            raise OSError("the process that is forked has ended")
        body += part
    return body


def _address() -> str:
    """Where the process that is forked listens; it is started when the first of ours is."""
    if ADDRESS not in os.environ:
        ours, its = socket.socketpair()
        command = [sys.executable, "-m", "tests.warm", str(its.fileno())]
        server = subprocess.Popen(
            command, cwd=ROOT, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL
        )
        its.close()
        os.environ[ADDRESS] = ours.recv(200).decode()
        atexit.register(_end, ours, server)
    return os.environ[ADDRESS]


def start_warm_process() -> None:
    """Starts the process that is forked, for this process and all that it starts from now on."""
    _address()


def _end(line: socket.socket, server: subprocess.Popen) -> None:
    line.close()
    server.wait()


class Server:
    """Listens for requests, forks, and says how each process ended. In a forked one `serve`
    returns what it shall become.
    """

    def __init__(self, starter: socket.socket, folder: str):
        self._starter, self._folder = starter, folder
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listening.bind(f"{folder}/start")
        self._listening.listen(64)
        self._told, told = os.pipe()
        for end in (self._told, told):
            os.set_blocking(end, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        # a Ctrl-C at the terminal is for the tests, and for what they started
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        self._lines: dict[int, socket.socket] = {}
        self._ends_with: set[int] = set()
        self._doomed: dict[int, float] = {}

    def serve(self) -> dict | None:
        """Until the starter is gone: None; or, in a process that was forked: the request."""
        with selectors.DefaultSelector() as ready:
            self._ready = ready
            for what in (self._starter, self._listening, self._told):
                ready.register(what, selectors.EVENT_READ)
            self._starter.sendall(f"{self._folder}/start".encode())
            while True:
                for key, _ in ready.select(PATIENCE if self._doomed else None):
                    if key.fileobj is self._starter:
                        self._end_all()
                        return None
                    if key.fileobj is self._told:
                        os.read(self._told, 4096)
                        self._reap()
                    elif key.fileobj is not self._listening:
                        self._left_alone(key.data)
                    elif (request := self._fork()) is not None:
                        return request
                self._kill_the_deaf()

    def _fork(self) -> dict | None:
        line, _ = self._listening.accept()
        length, streams, _, _ = socket.recv_fds(line, 4, 3)
        request = json.loads(_exactly(line, int.from_bytes(length, "big")))
        pid = os.fork()
        if pid == 0:
            self._become(request, streams)
            return request
        for stream in streams:
            os.close(stream)
        self._lines[pid] = line
        if STARTER in request["environment"]:
            self._ends_with.add(pid)
            Path(self._folder, str(pid)).write_text(
                f"{request['environment'][STARTER]} {request['module']}"
            )
        # its starter goes on now, and whoever hears of the process from it asks `nodes_of`
        line.sendall(pid.to_bytes(4, "big"))
        self._ready.register(line, selectors.EVENT_READ, pid)
        return None

    def _become(self, request: dict, streams: list[int]) -> None:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        for one in (self._starter, self._listening, *self._lines.values()):
            one.close()
        os.environ.clear()
        os.environ.update(request["environment"])
        if STARTER in os.environ:
            os.environ[STARTER] = str(os.getppid())
        os.chdir(request["cwd"])
        sys.argv = request["argv"]
        if sys.argv[0] == request["module"]:
            sys.argv[0] = str(sys.modules[request["module"]].__file__)  # as of `python -m`

    def _reap(self) -> None:
        while self._lines:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                return
            line = self._lines.pop(pid)
            self._ends_with.discard(pid)
            Path(self._folder, str(pid)).unlink(missing_ok=True)
            self._doomed.pop(pid, None)
            self._drop(line)
            try:
                line.sendall(status.to_bytes(4, "big"))
            except OSError:
                pass  # nobody waits for it any more
            line.close()

    def _drop(self, line: socket.socket) -> None:
        if line in self._ready.get_map():
            self._ready.unregister(line)

    def _left_alone(self, pid: int) -> None:
        """Who started a process is gone: nodes end with it."""
        if pid not in self._lines:
            return
        self._drop(self._lines[pid])
        if pid in self._ends_with:
            os.kill(pid, signal.SIGINT)
            self._doomed[pid] = time.monotonic() + PATIENCE

    def _kill_the_deaf(self) -> None:
        """A signal that comes before a process listens may be lost."""
        for pid in [pid for pid, until in self._doomed.items() if time.monotonic() > until]:
            del self._doomed[pid]
            os.kill(pid, signal.SIGKILL)

    def _end_all(self) -> None:
        for pid in list(self._lines):
            os.kill(pid, signal.SIGKILL)


def _main(number: int) -> None:
    starter = socket.socket(fileno=number)
    for name in IMPORTED:
        _import_whole(name)
    _load_type_supports()
    gc.collect()
    gc.freeze()
    folder = tempfile.mkdtemp()
    request = Server(starter, folder).serve()
    if request is None:
        shutil.rmtree(folder)
        return
    subprocess.Popen = WarmPopen
    _end_at_once(importlib.import_module(request["module"]).main)


def _end_at_once(main) -> None:
    """Ends the process as `sys.exit(main())` would, but for taking apart all modules: what they
    share with the others would be copied.
    """
    try:
        ended = main()
    except SystemExit as end:
        ended = end.code
    if isinstance(ended, str):
        print(ended, file=sys.stderr)
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(ended if isinstance(ended, int) else int(ended is not None))


def _import_whole(name: str) -> None:
    """A module with all that it offers: packages of ours import that when it is asked for."""
    module = importlib.import_module(name)
    for offered in getattr(module, "__all__", ()) if name.startswith("dart_skill.") else ():
        getattr(module, offered)


TYPES = {
    "msg": (
        "dart_skill_msgs geometry_msgs sensor_msgs std_msgs tf2_msgs diagnostic_msgs rosgraph_msgs"
        " rcl_interfaces nav_msgs visualization_msgs"
    ),
    "srv": "dart_skill_msgs std_srvs rcl_interfaces lifecycle_msgs type_description_interfaces",
    "action": "dart_skill_msgs",
}
"""Packages whose types our programs use, by what they are for."""


def _load_type_supports() -> None:
    """Libraries of messages, services and actions, which rclpy loads when one is first used; and
    the tables that bags are read with.
    """
    for kind, packages in TYPES.items():
        for package in packages.split():
            for one in vars(importlib.import_module(f"{package}.{kind}")).values():
                if isinstance(one, type) and hasattr(type(one), "__import_type_support__"):
                    type(one).__import_type_support__()
    importlib.import_module("dart_skill.recording").types_for("std_msgs/msg/Header")


if __name__ == "__main__":
    _main(int(sys.argv[1]))
