"""What TAB offers, through bash itself; and that nothing but parsers is imported for it."""

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dart_skill import cli
from dart_skill.cli import _completion as completion
from dart_skill.cli import _main, names
from dart_skill.cli.run_options import folder as folder_type
from tests.paths import ROOT

pytest.importorskip("dart_skill_nodes", reason="its options are completed, too")

GLUE = ROOT / "tools" / "completion.bash"
PRESS_TAB = """
. "$1"; shift
dart-skill() { :; }
COMP_LINE=$1; COMP_POINT=${#1}
_dart_skill_complete "$2"
(( ${#COMPREPLY[@]} == 0 )) || printf '%s\\n' "${COMPREPLY[@]}"
"""

needs_bash = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash on this machine")


@pytest.fixture(scope="module")
def executable(tmp_path_factory):
    """`dart-skill` of this checkout, on whatever Python runs the tests."""
    path = tmp_path_factory.mktemp("bin") / "dart-skill"
    path.write_text(f"#!/bin/sh\nexec '{sys.executable}' -m dart_skill.cli \"$@\"\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def folder(tmp_path):
    """Folders, bags and other files to complete."""
    for name in ("day_1", "day_2", ".hidden"):
        (tmp_path / name).mkdir()
    for name in ("day_3.mcap", "day_4.db3", "day_5.yaml", "day six.mcap", ".day_7.mcap"):
        (tmp_path / name).touch()
    return tmp_path


def tab(line, executable, folder=ROOT):
    """What bash offers after a line."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
    }
    command = ["bash", "-c", PRESS_TAB, "bash", str(GLUE), line, str(executable)]
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, check=True
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


COMMANDS = (
    "up status demo practice teach demonstrations check arm learn throw execute bag view report"
    " experiment darts security".split()
)


@needs_bash
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("dart-skill ", COMMANDS),
        ("dart-skill t", ["teach", "throw"]),
        ("dart-skill bag ", ["info", "check", "recover", "convert", "play"]),
        ("dart-skill darts 5", ["501"]),
        ("dart-skill up --layout ", ["composed", "processes", "hardware", "replay"]),
        ("dart-skill up --layout=h", ["hardware"]),
        ("dart-skill practice --change-after 3 --change h", ["heavier_ball"]),
        ("dart-skill throw --c", ["--count"]),
        ("dart-skill bag play day --l", ["--loop"]),
        ("dart-skill learn --configuration thesis", ["thesis", "thesis_local"]),
        (
            "dart-skill experiment throws --configurations default,th",
            ["default,thesis", "default,thesis_local"],
        ),
        ("dart-skill experiment figure 8.1", ["8.1", "8.10", "8.11"]),
        ("dart-skill experiment throws --seeds ", []),
    ],
)
def test_bash_offers(line, offered, executable, folder):
    assert tab(line, executable, folder) == offered


@needs_bash
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        (
            "dart-skill bag info d",
            ["day_1/", "day_2/", "day_3.mcap", "day_4.db3", "day\\ six.mcap"],
        ),
        ("dart-skill up --play day_", ["day_1/", "day_2/", "day_3.mcap", "day_4.db3"]),
        ("dart-skill demo --output day", ["day_1/", "day_2/"]),
        ("dart-skill up --output day", ["day_1/", "day_2/"]),
        ("dart-skill experiment soak --output day", ["day_1/", "day_2/"]),
        ("dart-skill experiment figure 8.1 --output day", ["day_1/", "day_2/"]),
        ("dart-skill darts heatmap --output day", ["day_1/", "day_2/"]),
        ("dart-skill learn day_1 --mapping day_5", ["day_5.yaml"]),
        ("dart-skill learn day_1 --mapping .", [".day_7.mcap", ".hidden/"]),
        ("dart-skill view no_such_folder/", []),
    ],
)
def test_bash_offers_the_paths_that_are_wanted(line, offered, executable, folder):
    assert sorted(tab(line, executable, folder)) == sorted(offered)


@needs_bash
def test_options_are_offered_before_a_dash_only_where_nothing_else_fits(executable):
    assert "--viewer" in tab("dart-skill up ", executable)
    assert not [word for word in tab("dart-skill report ", executable) if word.startswith("-")]


@needs_bash
def test_without_argcomplete_nothing_is_printed_and_the_shell_goes_on(tmp_path):
    missing = tmp_path / "dart-skill"
    missing.write_text("#!/bin/sh\nexit 1\n")
    missing.chmod(0o755)
    assert tab("dart-skill ", missing) == []


def test_status_1_without_argcomplete(monkeypatch):
    monkeypatch.setitem(sys.modules, "argcomplete", None)
    monkeypatch.setenv("_ARGCOMPLETE", "1")
    monkeypatch.setenv("COMP_LINE", "dart-skill ")
    assert cli.main([]) == 1


def test_neither_ros_nor_numpy_is_imported_for_it():
    script = (
        "import json, sys; from dart_skill.cli import _completion, _main\n"
        "list(_completion.commands_of(_main._parser()))\n"
        "print(json.dumps(sorted({name.split('.')[0] for name in sys.modules})))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert not set(json.loads(done.stdout)) & {
        "numpy",
        "scipy",
        "matplotlib",
        "yaml",
        "rclpy",
        "pybullet",
        "pinocchio",
    }


def every_value():
    """Every option or argument that takes one, with its command."""
    parser = _main._parser()
    for command in completion.commands_of(parser):
        for action in command._actions:
            if action.nargs != 0 and not isinstance(action, argparse._SubParsersAction):
                yield command.prog, action


def test_every_path_completes():
    for command, action in every_value():
        if action.type in (Path, folder_type) or action.metavar in ("BAG", "FOLDER", "FILE"):
            completion.complete_with(action, command.removeprefix("dart-skill "))
            assert hasattr(action, "completer"), f"{command} {action.dest}"


def test_every_table_of_values_belongs_to_an_option():
    there = {
        (command.removeprefix("dart-skill "), action.dest) for command, action in every_value()
    }
    named = {(command, dest) for command, options in completion.LISTS.items() for dest in options}
    assert named <= there, f"no such options: {sorted(named - there)}"
    assert set(completion.WORDS) <= {dest for _, dest in there}


def test_names_are_those_of_the_library():
    from dart_skill.experiments import thesis
    from dart_skill.experiments.studies import dart_search, landscapes
    from dart_skill.simulation import CHANGES
    from dart_skill.skills.learning import CONFIGURATIONS
    from dart_skill.skills.protocol import PRACTICE_METHODS

    assert names.CONFIGURATIONS == tuple(CONFIGURATIONS)
    assert names.PRACTICE_METHODS == tuple(PRACTICE_METHODS)
    assert names.CHANGES == tuple(CHANGES)
    assert names.SEARCHES == tuple(dart_search.METHODS)
    assert names.SCHEDULES == tuple(dart_search.SCHEDULES)
    assert names.LANDSCAPES == tuple(landscapes.LANDSCAPES)
    assert names.FIGURES == tuple(thesis.FIGURES)
