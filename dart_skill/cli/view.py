"""`dart-skill view`: a bag in Rerun, with a layout that fits it; a bag, or the graph that runs,
live for Foxglove.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli import graph_verbs
from dart_skill.common.configuration import config_path

if TYPE_CHECKING:
    from dart_skill.view.rerun import BagLayout


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `view` to the commands of `dart-skill`."""
    parser = commands.add_parser(
        "view",
        help=(
            "a bag in Rerun: the arm, the ball, and plots over time; a bag or the graph live in"
            " Foxglove"
        ),
    )
    parser.add_argument(
        "bag", metavar="BAG", type=Path, nargs="?", help="rosbag2 folder or .mcap file"
    )
    parser.add_argument(
        "--web",
        action="store_true",
        help="serve the view on 127.0.0.1 for a browser, until Ctrl-C; no window",
    )
    parser.add_argument(
        "--foxglove",
        action="store_true",
        help="serve BAG, again and again, or the graph that runs, live for Foxglove",
    )
    parser.add_argument(
        "--rate",
        type=float,
        default=1.0,
        help="of BAG, with --foxglove; 2: twice as fast (default 1)",
    )
    parser.add_argument(
        "--port",
        type=int,
        help=(
            "of the page, with --web (default 9090), or for Foxglove (default 8765); 0: any"
            " free one"
        ),
    )
    parser.add_argument(
        "--save", metavar="FOLDER", type=Path, help="write the layout there and open nothing"
    )
    parser.add_argument(
        "--install",
        action="store_true",
        help="first put Rerun into .venv-rerun of the workspace (790 MB)",
    )
    parser.add_argument(
        "--json", action="store_true", help="files, layouts and the call of Rerun as JSON"
    )
    parser.set_defaults(
        run=_view, usage_error=parser.error, run_on_graph=graph_verbs.runner("foxglove", parser)
    )


def _view(options: argparse.Namespace) -> int:
    from dart_skill.view.rerun import RerunUnavailable

    if options.foxglove:
        return _foxglove(options)
    if options.bag is None and not options.install:
        options.usage_error("name a BAG, or --install, or --foxglove for the graph that runs")
    try:
        return _installed(options) if options.bag is None else _shown(options)
    except RerunUnavailable as error:
        raise ValueError(str(error)) from error


def _foxglove(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C, which is no error."""
    from dart_skill.recording import BagReader
    from dart_skill.view import FOXGLOVE_PORT, FoxgloveServer, serve_bag

    if wrong := next(
        (name for name in ("web", "save", "install") if getattr(options, name)), None
    ):
        options.usage_error(f"--{wrong} is for Rerun: leave it out, or --foxglove")
    if not 0.0 < options.rate < float("inf"):
        options.usage_error(f"--rate is {options.rate:g}: give a number above 0")
    port = FOXGLOVE_PORT if options.port is None else options.port
    options.foxglove_port, options.say = port, lambda server: _say_served(options, server.url)
    if options.bag is None:
        return options.run_on_graph(options)
    with BagReader(options.bag) as bag, FoxgloveServer(port) as server:
        options.say(server)
        try:
            while serve_bag(bag, server, options.rate):
                pass
        except KeyboardInterrupt:
            return 0
    raise ValueError(f"{options.bag}: no message of a type that it defines")


def _say_served(options: argparse.Namespace, url: str) -> None:
    what = options.bag or "the graph that runs"
    if options.json:
        print(json.dumps({"bag": options.bag and os.fspath(options.bag), "url": url}), flush=True)
    else:
        layout = config_path("viewers/foxglove.json")
        print(
            f"{what}: {url}, until Ctrl-C\nnext: in Foxglove, Open connection, this address; then"
            f" import the layout {layout}",
            flush=True,
        )


def _installed(options: argparse.Namespace) -> int:
    program = _install()
    print(
        json.dumps({"rerun": os.fspath(program)})
        if options.json
        else f"{program}\nnext: dart-skill view BAG"
    )
    return 0


def _install() -> Path:
    from dart_skill.view import rerun

    where = rerun.workspace() / rerun.ENVIRONMENT
    print(f"rerun-sdk {rerun.VERSION} takes {rerun.SIZE} in {where}", file=sys.stderr, flush=True)
    return rerun.install()


def _shown(options: argparse.Namespace) -> int:
    from dart_skill.view import rerun

    shown = rerun.describe(options.bag)
    program = _install() if options.install else rerun.find_rerun()
    if not (options.web or options.save or has_screen()):
        raise rerun.RerunUnavailable(
            "there is no screen here (DISPLAY and WAYLAND_DISPLAY are not set): try --web"
        )
    ports = (
        rerun.free_ports(rerun.RERUN_PORT if options.port is None else options.port)
        if options.web
        else None
    )
    with tempfile.TemporaryDirectory(prefix="dart_skill_view_") as scratch:
        folder = options.save or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        environment = rerun.quiet_environment(Path(scratch) / "settings", program)
        files, layouts = _prepared(options, program, shown, folder, environment)
        command = rerun.command_line(program, files, layouts, ports)
        _say(options, files, layouts, command, None if ports is None else rerun.url_of_page(ports))
        if options.save:
            return 0
        with contextlib.nullcontext() if ports is None else rerun.RerunPage(*ports):
            return run_to_the_end(command, environment)


def _prepared(
    options: argparse.Namespace,
    program: Path,
    shown: BagLayout,
    folder: Path,
    environment: Mapping[str, str],
) -> tuple[list[Path], list[Path]]:
    """The files that Rerun opens, and a layout for each; without what it cannot make, unless that
    was asked for.
    """
    from dart_skill.view import rerun

    files, layouts = list(shown.files), []
    try:
        files = rerun.with_durations(program, shown, folder, environment)
        layouts = rerun.write_layouts(program, shown, folder)
    except rerun.RerunUnavailable as error:
        if options.save:
            raise
        print(f"without a layout: {error}", file=sys.stderr)
    return files, layouts


def _say(
    options: argparse.Namespace,
    files: Sequence[Path],
    layouts: Sequence[Path],
    command: Sequence[str],
    url: str | None,
) -> None:
    if options.json:
        lists = {
            "files": list(map(str, files)),
            "layouts": list(map(str, layouts)),
            "command": list(command),
        }
        print(
            json.dumps({"bag": os.fspath(options.bag), **lists, "url": url}, indent=1), flush=True
        )
    elif options.save:
        print(
            f"layout: {', '.join(map(str, layouts))}\nnext: {shlex.join(map(str, command))}",
            flush=True,
        )
    else:
        where = f"{url}, until Ctrl-C" if url else "in a window"
        print(
            f"{options.bag}: {where}\nnext: dart-skill report {shlex.quote(str(options.bag))}",
            flush=True,
        )


def has_screen() -> bool:
    """Whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def run_to_the_end(command: Sequence[str], environment: dict[str, str]) -> int:
    """Run a program and whatever it starts until it ends, or until Ctrl-C or SIGTERM, which is no
    error; its status, 0 or 1.
    """
    # A command that is asked to end ends what it started; a shell may have switched SIGINT off for what
    # runs in the background. A signal that comes while the program starts is kept until there is a
    # process to end.
    early: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: early.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        for number in before:
            signal.signal(number, signal.default_int_handler)
        return 0 if early else int(process.wait() != 0)
    except KeyboardInterrupt:
        return 0
    finally:
        _end(process)
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(process: subprocess.Popen) -> None:
    """Rerun's executable is a script that starts the viewer, so the whole group is ended."""
    try:
        os.killpg(process.pid, signal.SIGTERM)
    except ProcessLookupError:
        pass
    process.wait()
