"""Keeps the ROS graphs of test runs apart: from the network, and from every other run on this
machine; and what all tests share.
"""

import contextlib
import gc
import importlib
import itertools
import os
import signal
import socket
from pathlib import Path

import pytest
from hypothesis import settings

from tests.paths import ROOT
from tests.warm import start_warm_process, starting_warm

# The same examples in every run; HYPOTHESIS_PROFILE=explore looks for new ones, and
# HYPOTHESIS_PROFILE=long for many of them.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("explore", derandomize=False, deadline=None)
settings.register_profile("long", derandomize=False, deadline=None, max_examples=5000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

# A script starts what it leaves in the background with SIGINT ignored, and so would be every
# process that a test starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

FIRST_LOCK_PORT = (
    7200  # domain d is taken by whoever holds UDP port 7200 + d; DDS uses ports from 7400 on
)
DOMAINS = range(1, 101)
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))


def is_free(port: int) -> bool:
    """Whether no process on this machine has the UDP port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def take_domain(start: int) -> tuple[int, socket.socket]:
    """Takes a ROS domain that nobody uses; it is held until the socket is closed.

    A domain's participants have the UDP ports from 7400 + 250 d on, whichever program they belong
    to. The nodes of a graph that take turns share the core that its domain names: workers side by
    side prefer domains of different cores.
    """
    from_start = [DOMAINS[(start + offset) % len(DOMAINS)] for offset in range(len(DOMAINS))]
    for domain in sorted(
        from_start, key=lambda domain: (domain - WORKER) % (os.cpu_count() or 1) != 0
    ):
        lock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            lock.bind(("127.0.0.1", FIRST_LOCK_PORT + domain))
        except OSError:
            lock.close()
            continue
        if all(is_free(7400 + 250 * domain + port) for port in (0, 10, 11)):
            return domain, lock
        lock.close()
    raise RuntimeError(
        f"none of the ROS domains {DOMAINS[0]} to {DOMAINS[-1]} is free on this machine"
    )


# Before rclpy is imported anywhere. Each worker of pytest-xdist imports this file and takes its
# own domain.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
ROS_DOMAIN, _domain_lock = take_domain(os.getpid())
os.environ["ROS_DOMAIN_ID"] = str(ROS_DOMAIN)


def pytest_configure(config):
    """One process from which all workers have our programs forked, where there are workers."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        start_warm_process()


@pytest.hookimpl(hookwrapper=True)
def pytest_collection(session):
    """What is imported and collected stays: to look for garbage among it again and again took a
    third of the time of collecting.
    """
    gc.disable()
    if hasattr(session.config, "workerinput"):
        _import_in_turns(session.config)
    yield
    gc.freeze()
    # a seventh of the time of tests that make many objects went there
    gc.set_threshold(10_000, 10, 5)
    gc.enable()


def _import_in_turns(config):
    """Import the modules of tests, each worker from another one on: what one of them has compiled
    the others find.
    """
    places = [ROOT / argument.split("::")[0] for argument in config.args]
    files = [
        file
        for place in places
        for file in (sorted(place.rglob("test_*.py")) if place.is_dir() else [place])
    ]
    first = len(files) * WORKER // config.workerinput["workercount"]
    for file in files[first:] + files[:first]:
        # collecting tells what is wrong with a module
        with contextlib.suppress(Exception, pytest.skip.Exception):
            importlib.import_module(
                ".".join(Path(os.path.relpath(file, ROOT)).with_suffix("").parts)
            )


BETWEEN = 3
"""Files of unit tests between two of other tests."""
LONG = (
    "skill/test_reactive_guide.py",
    "skill/test_reactive_skill.py",
    "view/test_page.py",
    "view/test_rerun.py",
)
"""Files of unit tests that would come last, and take long: one worker would work on when the
others have ended.
"""


LONGEST, LONGEST_SLOW = 300, 1800
"""A test that takes longer [s] has failed, and its worker is ended: two clients of one process
once waited for each other in Fast DDS.
"""


def pytest_collection_modifyitems(config, items):
    """No test takes for ever. Workers get files that compute between those that wait for nodes, so
    that no core waits; the last ones are short.
    """
    if config.pluginmanager.hasplugin("timeout"):
        for item in items:
            longest = LONGEST_SLOW if item.get_closest_marker("slow") else LONGEST
            item.add_marker(pytest.mark.timeout(longest, method="thread"))
    if not hasattr(config, "workerinput"):
        return
    files: dict[str, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.nodeid.split("::")[0], []).append(item)
    unit = [file for file in files if file.startswith("tests/unit/")]
    computing = iter(
        [files[file] for file in sorted(unit, key=lambda file: not file.endswith(LONG))]
    )
    waiting = [tests for file, tests in files.items() if not file.startswith("tests/unit/")]
    mixed = [one for tests in waiting for one in (tests, *itertools.islice(computing, BETWEEN))]
    items[:] = [item for tests in (*mixed, *computing) for item in tests]


@pytest.fixture(scope="module", autouse=True)
def _starts_warm(request):
    """Our own programs start without importing everything anew, but for the tests of a module that
    says `COLD = True`.
    """
    if getattr(request.module, "COLD", False):
        yield
        return
    with starting_warm():
        yield


@pytest.fixture(scope="session")
def recorded_session(tmp_path_factory):
    """A bag with three guided throws and one of the arm's own: its path, the guided trials, the
    own trial.
    """
    from tests.recorded_session import record  # costs imports that most tests do without

    return record(tmp_path_factory.mktemp("recorded_session"))
