"""What the environment says to rcl and DDS before rclpy starts: that the graph is found and heard on
this machine alone, on which ROS domain, and where logs are written; and how a process is told to
end: SIGINT, SIGTERM, or the end of the process that started it.
"""

import os
import signal
import socket
import tempfile
import time
from contextlib import closing
from pathlib import Path

from dart_skill.common.configuration import config_path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PEERS = "ROS_STATIC_PEERS"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Where Fast DDS finds its profiles, up to version 2 and from 3 on."""
OURS = ("loopback", "network")
"""Our profiles: config/fastdds_*.xml say what each is for."""

FIRST_LOCK_PORT = 7200
"""Domain d is taken by the process that holds UDP port 7200 + d; DDS uses ports from 7400 on."""
_TAKEN: list[socket.socket] = []


def stay_on_this_machine() -> None:
    """Limit discovery to this machine, unless the user chose otherwise. Call before rclpy starts."""
    os.environ.setdefault(RANGE, "LOCALHOST")
    choose_profile()
    find_log_folder()


def choose_profile() -> None:
    """Give Fast DDS the profile of this machine alone, with which its sockets listen on 127.0.0.1,
    where discovery is limited to it and no peers are named; else that of a network. With neither,
    sockets listen on every address, and readers may hear nothing. A profile of the user's stays.
    Call before rclpy starts.
    """
    loopback, network = (str(config_path(f"fastdds_{name}.xml")) for name in OURS)
    limited = os.environ.get(RANGE) == "LOCALHOST" and not os.environ.get(PEERS)
    # ours may be there, of a process that started this one, before the range was changed
    chosen = any(os.environ.get(name) not in (None, "", loopback, network) for name in PROFILES)
    for name in PROFILES:
        if not chosen:
            os.environ[name] = loopback if limited else network
        elif os.environ.get(name) in (loopback, network):
            del os.environ[name]


def choose_domain() -> None:
    """Set ROS to this machine alone, and to a domain that is not used, unless the user chose one.
    Call before rclpy starts.
    """
    stay_on_this_machine()
    if "ROS_DOMAIN_ID" in os.environ:
        return
    first = os.getpid() % 100
    for domain in (1 + (first + k) % 100 for k in range(100)):
        if _free(7400 + 250 * domain) and _take(FIRST_LOCK_PORT + domain):
            os.environ["ROS_DOMAIN_ID"] = str(domain)
            return
    raise RuntimeError("no free ROS domain between 1 and 100: set ROS_DOMAIN_ID")


def has_own_domain() -> bool:
    """Whether this process chose a domain of its own (`choose_domain`)."""
    return bool(_TAKEN)


def _take(port: int) -> bool:
    """Hold a port while this process lives: a domain whose nodes have not been started yet is
    taken all the same.
    """
    lock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        lock.bind(("127.0.0.1", port))
    except OSError:
        lock.close()
        return False
    _TAKEN.append(lock)
    return True


def _free(port: int) -> bool:
    """Whether no process listens on a domain's discovery port, or on the first ports of its
    participants.
    """
    for offset in (0, 10, 11):
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
            try:
                probe.bind(("127.0.0.1", port + offset))
            except OSError:
                return False
    return True


def find_log_folder() -> None:
    """Let rcl write logs to a new temporary folder where the usual one cannot be made, without
    which it starts nothing: no HOME, or one that this user may not write to. Call before rclpy
    starts.
    """
    if os.environ.get("ROS_LOG_DIR"):
        return
    if not _is_writable(_usual()):
        os.environ["ROS_LOG_DIR"] = tempfile.mkdtemp(prefix="ros_log_")


def _usual() -> Path | None:
    """As rcl has it; it looks at HOME alone, not at the list of users."""
    if named := os.environ.get("ROS_HOME"):
        return Path(named, "log")
    home = os.environ.get("HOME")
    return Path(home, ".ros", "log") if home else None


def _is_writable(folder: Path | None) -> bool:
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return folder is not None and os.access(folder, os.W_OK)


ENDS_WITH = "DART_SKILL_ENDS_WITH"
"""Environment variable: the process that started a node; the node ends when that is gone, however
it went.
"""


class Interrupts:
    """SIGINT and SIGTERM end the spin loop between two callbacks: rclpy's own handlers invalidate
    the context at once, in the middle of a callback that still publishes. A second one, when the
    first did not help, interrupts whatever is running.
    """

    PATIENCE = 5.0
    """In which one Ctrl-C may arrive twice: from the terminal, and forwarded by the process
    that started the node, late on a busy machine [s]. An interrupt while rclpy closes a node would abort the
    process.
    """

    def __init__(self):
        self._first: float | None = None
        self._starter = int(os.environ.get(ENDS_WITH, 0))
        for signal_number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signal_number, self._on_signal)

    def __bool__(self) -> bool:
        return self._first is not None or bool(self._starter and os.getppid() != self._starter)

    def _on_signal(self, *_) -> None:
        now = time.monotonic()
        if self._first is None:
            self._first = now
        elif now - self._first > self.PATIENCE:
            raise KeyboardInterrupt
