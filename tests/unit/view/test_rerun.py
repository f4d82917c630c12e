"""Bags in Rerun: where it is looked for, how it is called, and, where there is one, that it opens
our bags with the layout.

Without Rerun a stand-in plays its part: a `rerun` that writes down how it was called, beside a
`python3` that makes no real layout.
"""

import http.server
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from dart_skill.cli import main
from dart_skill.cli.view import run_to_the_end
from dart_skill.common.world import the_world
from dart_skill.recording import BagWriter, definition, qos_yaml, serialize, type_hash, typestore
from dart_skill.view.rerun import (
    VARIABLE,
    BagLayout,
    Ports,
    RerunPage,
    RerunUnavailable,
    command_line,
    describe,
    find_rerun,
    free_ports,
    install,
    interpreter_of,
    quiet_environment,
    url_of_page,
    with_durations,
    workspace,
    write_layouts,
)
from tests.integration.browser import SMALL, Page, needs_chromium
from tests.paths import BAGS, ROOT

POSE, TEXT = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String"


def script(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def test_rerun_is_put_beside_the_package_in_the_checkout():
    assert workspace() == ROOT


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """A `rerun` that writes its arguments, and what it was told of settings, into calls.txt, and
    converts nothing into empty files; its python3 writes what it is given.
    """
    calls = tmp_path / "calls.txt"
    rerun = script(
        tmp_path / "venv" / "bin" / "rerun",
        f'echo "$@" >> {calls}; echo "settings=$XDG_CONFIG_HOME path=$PYTHONPATH" >> {calls}; ['
        ' "$1" != mcap ] || : > "$9"',
    )
    script(rerun.with_name("python3"), 'printf "%s" "$4" > "$3"')
    monkeypatch.setenv(VARIABLE, str(rerun))
    monkeypatch.setenv("DISPLAY", ":77")
    monkeypatch.setenv("PYTHONPATH", "/ros/packages")
    return rerun, calls


def small_bag(path, topics, files=1, begins=0):
    """A bag with one message per topic and file: names and types, or names and contents of texts."""
    types = typestore()
    with BagWriter(path, max_duration_ns=500_000_000 if files > 1 else 0) as bag:
        for topic, (type_name, _) in topics.items():
            bag.add_topic(
                topic,
                type_name,
                definition(types, type_name),
                qos_yaml(),
                type_hash(types, type_name),
            )
        for k in range(files):
            for number, (topic, (type_name, content)) in enumerate(topics.items()):
                stamp = begins + 1_000_000_000 * (k + 1) + number
                bag.write(topic, stamp, stamp, serialize(types, type_name, content))
    return path


def pose(frame="world"):
    return POSE, {"header": {"frame_id": frame}}


# finding it


def test_the_variable_comes_first_then_the_path_then_the_workspace(tmp_path, monkeypatch):
    named, on_path = script(tmp_path / "a" / "rerun", ""), script(tmp_path / "b" / "rerun", "")
    own = script(tmp_path / "w" / ".venv-rerun" / "bin" / "rerun", "")
    monkeypatch.setenv("PATH", str(on_path.parent))
    monkeypatch.setenv(VARIABLE, str(named))
    assert find_rerun(tmp_path / "w") == named
    monkeypatch.delenv(VARIABLE)
    assert find_rerun(tmp_path / "w") == on_path
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_rerun(tmp_path / "w") == own
    own.unlink()
    with pytest.raises(
        RerunUnavailable, match="dart-skill view --install.*790 MB.*DART_SKILL_RERUN"
    ):
        find_rerun(tmp_path / "w")


@pytest.mark.parametrize("wrong", ["missing", "folder", "plain.txt"])
def test_a_variable_that_names_no_executable_is_an_error_and_not_passed_over(
    wrong, tmp_path, monkeypatch
):
    (tmp_path / "folder").mkdir()
    (tmp_path / "plain.txt").write_text("")
    monkeypatch.setenv(VARIABLE, str(tmp_path / wrong))
    with pytest.raises(RerunUnavailable, match=f"{wrong}.*is no executable file"):
        find_rerun(tmp_path)


def test_the_interpreter_is_that_of_the_first_line_or_lies_beside(tmp_path):
    rerun = script(tmp_path / "bin" / "rerun", "")
    assert interpreter_of(rerun) is None
    beside = script(tmp_path / "bin" / "python3", "")
    assert interpreter_of(rerun) == beside
    own = script(tmp_path / "other" / "python3.11", "")
    rerun.write_text(f"#!{own}\nimport rerun_cli\n")
    assert interpreter_of(rerun) == own
    rerun.write_bytes(b"\x7fELF\x00\xff")
    assert interpreter_of(rerun) == beside


def test_an_environment_that_is_there_is_kept_and_a_failed_one_removed(tmp_path, monkeypatch):
    own = script(tmp_path / "w" / ".venv-rerun" / "bin" / "rerun", "")
    assert install(tmp_path / "w") == own
    own.unlink()
    with pytest.raises(RerunUnavailable, match="has no bin/rerun: remove it"):
        install(tmp_path / "w")
    called = []

    def failing(command, **options):
        called.append(command)
        (tmp_path / "new" / ".venv-rerun").mkdir(parents=True, exist_ok=True)
        return subprocess.CompletedProcess(command, int("pip" in command))

    monkeypatch.setattr(subprocess, "run", failing)
    with pytest.raises(RerunUnavailable, match="rerun-sdk==0.41.0' failed.*removed again"):
        install(tmp_path / "new")
    assert [command[1:3] for command in called] == [["-m", "venv"], ["-m", "pip"]] and not (
        tmp_path / "new" / ".venv-rerun"
    ).exists()


# what is in a bag


def test_arm_ball_basket_and_joints_of_our_bag_are_found():
    shown = describe(BAGS / "throws")
    assert (shown.frame, shown.ball, shown.basket) == (
        "world",
        "/vrpn_mocap/ball/pose",
        "/vrpn_mocap/basket/pose",
    )
    assert (
        shown.joints == "/joint_states"
        and shown.effort
        and [file.name for file in shown.files] == ["throws_0.mcap"]
    )
    assert json.loads(shown.of(shown.files[0])) == {
        "application": "throws_0", "frame": "world", "ball": shown.ball, "basket": shown.basket, "joints": shown.joints, "effort": True,
        "names": [f"wam_j{k}" for k in range(1, 8)], "arm": "wam", "stands": 0.84,
        "ball_radius": 0.5 * the_world().ball_diameter, "basket_size": [the_world().basket_radius, the_world().basket_depth],
    }  # fmt: skip


def test_a_bag_without_arm_and_joints_has_what_it_has(tmp_path):
    shown = describe(
        small_bag(
            tmp_path / "bag", {"/natnet/Ball/pose": pose("lab"), "/said": (TEXT, {"data": "x"})}
        )
    )
    assert shown == BagLayout(shown.files, "lab", "/natnet/Ball/pose", None, None, dated=False)
    assert describe(small_bag(tmp_path / "texts", {"/said": (TEXT, {"data": "x"})})).frame is None


def test_the_root_of_the_arm_is_the_frame_where_nothing_was_tracked(tmp_path):
    urdf = (
        "<robot><link name='hand'/><link name='base'/><joint><parent link='base'/><child"
        " link='hand'/></joint></robot>"
    )
    topics = {
        "/robot_description": (TEXT, {"data": urdf}),
        "/tf": ("tf2_msgs/msg/TFMessage", {"transforms": []}),
    }
    assert describe(small_bag(tmp_path / "bag", topics)).frame == "base"
    topics["/robot_description"] = (TEXT, {"data": "no xml"})
    assert describe(small_bag(tmp_path / "broken", topics)).frame is None


def test_the_arm_stands_as_high_as_the_static_transform_to_its_root_says(tmp_path):
    def transform(parent, child, z):
        return {
            "header": {"frame_id": parent},
            "child_frame_id": child,
            "transform": {"translation": {"z": z}},
        }

    urdf = (
        "<robot name='r'><link name='hand'/><link name='base'/><joint><parent link='base'/><child"
        " link='hand'/></joint></robot>"
    )
    static = {"transforms": [transform("lab", "camera", 2.5), transform("lab", "base", 0.6)]}
    topics = {
        "/robot_description": (TEXT, {"data": urdf}),
        "/tf": ("tf2_msgs/msg/TFMessage", {"transforms": []}),
    }
    still = {"/tf_static": ("tf2_msgs/msg/TFMessage", static), "/ball/pose": pose("lab")}
    shown = describe(small_bag(tmp_path / "bag", topics | still))
    assert (shown.arm, shown.stands) == ("r", 0.6)
    assert (
        describe(
            small_bag(tmp_path / "elsewhere", topics | still | {"/ball/pose": pose("map")})
        ).stands
        == 0.0
    )
    assert describe(small_bag(tmp_path / "unknown", topics)).stands == 0.0


@pytest.mark.parametrize(("begins", "dated"), [(0, False), (1_700_000_000_000_000_000, True)])
def test_stamps_of_a_simulated_world_are_no_dates(begins, dated, stand_in, tmp_path):
    bag = small_bag(tmp_path / "bag", {"/said": (TEXT, {"data": "x"})}, begins=begins)
    shown = describe(bag)
    files = with_durations(stand_in[0], shown, tmp_path, dict(os.environ))
    assert shown.dated is dated and files == (
        [bag / "bag_0.mcap"] if dated else [tmp_path / "bag_0.rrd"]
    )
    script(stand_in[0], "echo no such command >&2; exit 2")
    if not dated:
        with pytest.raises(
            RerunUnavailable,
            match="did not convert .*bag_0.mcap .no such command.*rerun-sdk 0.41.0",
        ):
            with_durations(stand_in[0], shown, tmp_path, dict(os.environ))


# the call


def test_servers_are_for_this_machine_alone():
    plain = command_line(Path("rerun"), [Path("a.mcap")], [Path("l.rbl")])
    web = command_line(Path("rerun"), [Path("a.mcap")], [Path("l.rbl")], Ports(80, 1234, 5678))
    assert plain == ["rerun", "a.mcap", "l.rbl", "--bind", "127.0.0.1"]
    assert web == [*plain, "--serve-web", "--web-viewer-port", "1234", "--port", "5678"]
    assert (
        url_of_page(Ports(80, 1234, 5678))
        == "http://127.0.0.1:80/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A5678%2Fproxy"
    )


def test_a_port_that_is_taken_is_told():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(RerunUnavailable, match=f"port {other.getsockname()[1]} .*--port"):
            free_ports(other.getsockname()[1])
    with pytest.raises(RerunUnavailable, match="port 70000"):
        free_ports(70000)
    assert len({*free_ports(0), 0}) == 4


def test_every_file_of_a_split_bag_is_opened_with_a_layout_of_its_own(stand_in, tmp_path, capsys):
    _, calls = stand_in
    bag = small_bag(
        tmp_path / "split",
        {"/vrpn_mocap/ball/pose": pose(), "/said": (TEXT, {"data": "x" * 5000})},
        files=12,
    )
    files = sorted(bag.glob("*.mcap"), key=lambda file: int(file.stem.rsplit("_", 1)[1]))
    assert len(files) > 10 and describe(bag).files == tuple(files)
    assert main(["view", str(bag), "--json"]) == 0
    said, called = json.loads(capsys.readouterr().out), calls.read_text().splitlines()
    assert [Path(file).name for file in said["files"]] == [
        f"{file.stem}.rrd" for file in files
    ] and len(said["layouts"]) == len(files)
    assert called[0] == "analytics disable" and called[2].startswith(
        f"mcap convert {files[0]} --application-id split_0 "
    )
    assert (
        called[-2]
        == " ".join(said["command"][1:])
        == " ".join([*said["files"], *said["layouts"], "--bind", "127.0.0.1"])
    )
    assert re.fullmatch(r"settings=.*dart_skill_view_.*/settings path=", called[-1])
    assert not Path(said["layouts"][0]).exists(), "layouts are gone when the view is closed"


def test_web_prints_the_address_of_the_page(stand_in, tmp_path, capsys):
    _, calls = stand_in
    bag = small_bag(tmp_path / "bag", {"/vrpn_mocap/ball/pose": pose()})
    assert main(["view", str(bag), "--web", "--port", "0"]) == 0
    out = capsys.readouterr().out
    port = re.search(r"http://127.0.0.1:(\d+)/\?url=", out)[1]
    assert (
        "--serve-web --web-viewer-port" in calls.read_text()
        and f"--web-viewer-port {port}" not in calls.read_text()
    ), "not its own page"
    assert "next: dart-skill report" in out


def test_save_writes_the_layout_and_opens_nothing(stand_in, tmp_path, monkeypatch, capsys):
    _, calls = stand_in
    monkeypatch.delenv("DISPLAY")
    bag = small_bag(tmp_path / "bag", {"/vrpn_mocap/ball/pose": pose()})
    assert main(["view", str(bag), "--save", str(tmp_path / "new" / "layouts")]) == 0
    assert (
        json.loads((tmp_path / "new" / "layouts" / "layout_0.rbl").read_text())["ball"]
        == "/vrpn_mocap/ball/pose"
    )
    assert "--bind" not in calls.read_text() and "layout_0.rbl" in capsys.readouterr().out
    assert (tmp_path / "new" / "layouts" / "bag_0.rrd").exists(), (
        "what the call that was printed opens"
    )


def test_without_a_screen_web_is_named(stand_in, tmp_path, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform != "linux":
        pytest.skip("other systems have a screen without these variables")
    assert main(["view", str(small_bag(tmp_path / "bag", {"/said": (TEXT, {"data": "x"})}))]) == 1
    assert "--web" in capsys.readouterr().err and not stand_in[1].exists()


def test_without_an_interpreter_the_bag_opens_without_a_layout(stand_in, tmp_path, capsys):
    rerun, calls = stand_in
    rerun.with_name("python3").unlink()
    bag = small_bag(tmp_path / "bag", {"/said": (TEXT, {"data": "x"})})
    assert main(["view", str(bag)]) == 0
    assert (
        "without a layout" in capsys.readouterr().err and "/bag_0.rrd --bind" in calls.read_text()
    )


def test_a_viewer_that_fails_gives_status_1(stand_in, tmp_path):
    script(stand_in[0], "exit 3")
    assert main(["view", str(small_bag(tmp_path / "bag", {"/said": (TEXT, {"data": "x"})}))]) == 1


def test_what_cannot_be_read_is_told_before_rerun_is_asked(stand_in, tmp_path, capsys):
    assert main(["view", str(tmp_path / "missing")]) == 1
    assert "no such bag" in capsys.readouterr().err and not stand_in[1].exists()
    with pytest.raises(SystemExit) as end:
        main(["view"])
    assert end.value.code == 2 and "BAG" in capsys.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_the_viewer_with_everything_that_it_started(number, tmp_path):
    started = tmp_path / "started"
    viewer = script(
        tmp_path / "rerun",
        f"sleep 600 & echo $! > {started}.new; mv {started}.new {started}; wait",
    )
    code = (
        "import os, sys; from dart_skill.cli.view import run_to_the_end;"
        " sys.exit(run_to_the_end(sys.argv[1:], dict(os.environ)))"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(viewer)])
    try:
        until = time.monotonic() + 60
        while not started.exists():
            assert process.poll() is None and time.monotonic() < until
            time.sleep(0.02)
        child = int(started.read_text())
        process.send_signal(number)
        assert process.wait(30) == 0
        while _runs(child):
            assert time.monotonic() < until, f"process {child} is still there"
            time.sleep(0.02)
    finally:
        process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_the_viewer_starts_ends_it_too(number, monkeypatch):
    start, started = subprocess.Popen, []

    def start_late(*arguments, **options):
        started.append(start(*arguments, **options))
        os.kill(os.getpid(), number)
        return started[0]

    monkeypatch.setattr("dart_skill.cli.view.subprocess.Popen", start_late)
    before = signal.getsignal(number)
    assert run_to_the_end(["sleep", "600"], dict(os.environ)) == 0
    assert started[0].poll() is not None and signal.getsignal(number) is before


def _runs(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


# the page


PAGE = b"""<html><link rel="icon" href="favicon.ico"><link rel="preconnect" href="https://fonts.example" crossorigin />
<link
  href="https://fonts.example/css2?family=Inter" rel="stylesheet"
/><body>what is shown</body></html>"""
WASM = bytes(range(256)) * 5000


@pytest.fixture
def behind():
    """Port of a server that serves a page as Rerun does, and its program."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            known = {
                "/?url=data": ("text/html", PAGE),
                "/re_viewer_bg.wasm": ("application/wasm", WASM),
            }
            if self.path not in known:
                return self.send_error(404)
            kind, content = known[self.path]
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("rerun-final-length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1]
        server.shutdown()


def test_the_page_is_passed_on_without_links_to_other_sites_and_may_reach_nothing_else(behind):
    ports = free_ports(0)
    with RerunPage(ports.page, behind, ports.data):
        with urllib.request.urlopen(f"http://127.0.0.1:{ports.page}/?url=data") as answer:
            page, allowed = answer.read(), answer.headers["Content-Security-Policy"]
        with urllib.request.urlopen(f"http://127.0.0.1:{ports.page}/re_viewer_bg.wasm") as answer:
            assert answer.read() == WASM and answer.headers["Content-Type"] == "application/wasm"
            assert answer.headers["rerun-final-length"] == str(len(WASM)), (
                "of which the page tells how far it is"
            )
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"http://127.0.0.1:{ports.page}/other")
    assert b"fonts.example" not in page and b"favicon.ico" in page and b"what is shown" in page
    assert allowed.startswith("default-src 'none';")
    assert (
        set(re.findall(r"https?://\S+", allowed)) == {f"http://127.0.0.1:{ports.data}"}
        and "*" not in allowed
    )


def test_a_page_that_is_not_served_yet_can_be_asked_for_again():
    ports = free_ports(0)
    with RerunPage(*ports), pytest.raises(urllib.error.HTTPError, match="502.*reload"):
        urllib.request.urlopen(f"http://127.0.0.1:{ports.page}/")
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", ports.page))  # the port is free again


# with Rerun


@pytest.fixture(scope="module")
def rerun(tmp_path_factory):
    """A function that runs Rerun and gives what it says."""
    executable = os.environ.get("DART_SKILL_RERUN") or shutil.which("rerun")
    if executable is None or interpreter_of(Path(executable)) is None:
        pytest.skip(
            "no 'rerun' of a Python on the path, and DART_SKILL_RERUN names none: see 'A bag in"
            " Rerun' in docs/view.md"
        )
    environment = quiet_environment(tmp_path_factory.mktemp("settings"), Path(executable))

    def run(*arguments):
        done = subprocess.run(
            [executable, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=300,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    run.executable, run.environment = Path(executable), environment
    return run


def test_rerun_makes_a_layout_for_the_recording_that_it_makes_of_our_bag(rerun, tmp_path):
    shown = describe(BAGS / "throws")
    (layout,) = write_layouts(rerun.executable, shown, tmp_path)
    assert "verified without error" in rerun("rrd", "verify", layout)
    said = rerun("rrd", "print", "-vvv", layout)
    for part in (
        'StoreId(Blueprint, "throws_0"',
        "Arm, ball, basket",
        "Joint positions",
        "Joint efforts",
        "Height of the ball",
    ):
        assert part in said, part
    rerun(*shown.files, "--bind", "127.0.0.1", "--port", "auto", "--save", tmp_path / "bag.rrd")
    stored = rerun("rrd", "print", tmp_path / "bag.rrd")
    assert re.search(r'Recording,\s+"throws_0"', stored), (
        "the layout is meant for the recording of this name"
    )
    for entity in ("/vrpn_mocap/ball/pose", "/joint_states/effort", "/tf", "visual_geometries"):
        assert entity in stored, entity


def test_rerun_serves_our_bag_with_its_layout_on_this_machine_alone(rerun, tmp_path):
    shown, ports, log = describe(BAGS / "throws"), free_ports(0), tmp_path / "log.txt"
    layouts = write_layouts(rerun.executable, shown, tmp_path)
    files = with_durations(rerun.executable, shown, tmp_path, rerun.environment)
    command = command_line(rerun.executable, files, layouts, ports)
    with open(log, "w") as file:
        process = subprocess.Popen(
            command, stdout=file, stderr=file, env=rerun.environment, start_new_session=True
        )
    try:
        with RerunPage(*ports):
            page = _fetched(url_of_page(ports), process)
        said = log.read_text()
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
    assert "<html" in page
    assert "fonts.googleapis.com/css2" not in page, "nothing from elsewhere"
    assert (
        "throws_0.rrd" in said
        and "layout_0.rbl" in said
        and f":{ports.behind}" not in said
        and f"127.0.0.1:{ports.data}" in said
        and "0.0.0.0" not in said
    )
    assert "ERROR" not in said, said


def _fetched(url, process, patience=60.0):
    """A page, as soon as it is served."""
    until = time.monotonic() + patience
    while True:
        assert process.poll() is None and time.monotonic() < until
        try:
            with urllib.request.urlopen(url, timeout=10) as answer:
                return answer.read().decode("utf-8", "replace").lower()
        except OSError:
            time.sleep(0.05)


@pytest.mark.slow
@needs_chromium
def test_in_a_browser_the_page_gets_the_bag_and_asks_for_nothing_outside_this_machine(
    rerun, tmp_path
):
    shown, ports = describe(BAGS / "throws"), free_ports(0)
    files = with_durations(rerun.executable, shown, tmp_path, rerun.environment)
    command = command_line(
        rerun.executable, files, write_layouts(rerun.executable, shown, tmp_path), ports
    )
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=rerun.environment,
        start_new_session=True,
    )
    try:
        with RerunPage(*ports):
            _fetched(url_of_page(ports), process)
            with Page(tmp_path / "browser", url_of_page(ports), SMALL) as page:
                data = f"http://127.0.0.1:{ports.data}/"
                page._wait(
                    lambda: (
                        page.text() is not None
                        and any(one.startswith(data) for one in page.addresses)
                    ),
                    120.0,
                    "its data",
                )
                page.draw(5)
                own = (f"http://127.0.0.1:{ports.page}/", data, "data:", "blob:")
                assert [one for one in page.addresses if not one.startswith(own)] == []
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def test_rerun_makes_a_layout_without_an_arm_and_without_anything(rerun, tmp_path):
    for number, topics in enumerate(
        [{"/vrpn_mocap/ball/pose": pose()}, {"/said": (TEXT, {"data": "x"})}]
    ):
        shown = describe(small_bag(tmp_path / f"bag_{number}", topics))
        (tmp_path / str(number)).mkdir()
        (layout,) = write_layouts(rerun.executable, shown, tmp_path / str(number))
        assert "verified without error" in rerun("rrd", "verify", layout)


def test_an_interpreter_without_rerun_is_told(tmp_path):
    rerun = script(tmp_path / "bin" / "rerun", "")
    script(
        rerun.with_name("python3"),
        "echo \"ModuleNotFoundError: No module named 'rerun'\" >&2; exit 1",
    )
    shown = BagLayout((Path("bag_0.mcap"),), None, None, None, None, False)
    with pytest.raises(RerunUnavailable, match="No module named 'rerun'.*rerun-sdk 0.41.0"):
        write_layouts(rerun, shown, tmp_path)
