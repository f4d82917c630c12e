"""`colcon build` of a clone below src/, without another word, builds the messages, too: setup.py
sees to it.
"""

import runpy
import subprocess
import sys
from types import SimpleNamespace

import pytest
import setuptools

from tests.paths import ROOT

DEVELOP = ["setup.py", "develop", "--editable", "--build-directory"]


@pytest.fixture
def colcon(tmp_path, monkeypatch):
    """What colcon makes of Python when it calls setup.py, and what is started then; `call()`: the
    part of setup.py that builds messages.
    """
    monkeypatch.setattr(sys, "argv", ["setup.py", "--version"])
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: None)
    monkeypatch.chdir(ROOT)
    names = runpy.run_path(str(ROOT / "setup.py"))
    build, install = tmp_path / "build" / "dart_skill", tmp_path / "install"
    (tmp_path / "build" / "dart_skill_msgs").mkdir(parents=True)
    build.mkdir()
    seen = SimpleNamespace(
        call=names["build_messages"],
        commands=[],
        environments=[],
        status=0,
        install=install,
        workspace=tmp_path,
    )

    def run(command, env, **_):
        seen.commands.append(command)
        seen.environments.append(env)
        return SimpleNamespace(returncode=seen.status)

    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(sys, "argv", [*DEVELOP, str(build / "build"), "--no-deps"])
    monkeypatch.setattr(sys, "real_prefix", sys.prefix, raising=False)
    monkeypatch.setattr(sys, "prefix", str(install / "dart_skill"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))
    monkeypatch.setenv("PYTHONPATH", f"{build}/prefix_override:/somewhere")
    return seen


def provide(prefix):
    (prefix / "share/dart_skill_msgs").mkdir(parents=True)
    (prefix / "share/dart_skill_msgs/package.xml").touch()


def after(command, option):
    return command[command.index(option) + 1]


def test_the_messages_are_built_beside_the_package_and_brought_up_to_date_the_next_time(
    colcon, monkeypatch
):
    colcon.call()
    [command] = colcon.commands
    assert after(command, "--base-paths") == str(ROOT / "msg_schemas")
    assert (after(command, "--install-base"), after(command, "--build-base")) == (
        str(colcon.install),
        str(colcon.workspace / "build"),
    )
    assert "--merge-install" not in command
    assert colcon.environments[0]["PYTHONPATH"] == "/somewhere", (
        "colcon would install into the prefix of this package"
    )
    provide(colcon.install / "dart_skill_msgs")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(colcon.install / "dart_skill_msgs"))
    colcon.call()
    assert len(colcon.commands) == 2


def test_in_a_merged_workspace_they_are_installed_with_the_rest(colcon, monkeypatch):
    colcon.install.mkdir()
    (colcon.install / ".colcon_install_layout").write_text("merged\n")
    monkeypatch.setattr(sys, "prefix", str(colcon.install))
    monkeypatch.setattr(
        sys,
        "argv",
        [
            "setup.py",
            "build",
            "--build-base",
            str(colcon.workspace / "build/dart_skill/build"),
            "install",
        ],
    )
    colcon.call()
    [command] = colcon.commands
    assert after(command, "--install-base") == str(colcon.install) and "--merge-install" in command


@pytest.mark.parametrize("where", ["install/dart_skill_msgs", "underlay"])
def test_what_another_build_brings_is_left_alone(colcon, monkeypatch, where):
    provide(colcon.workspace / where)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(colcon.workspace / where))
    colcon.call()
    assert not colcon.commands


@pytest.mark.parametrize(
    "asked",
    [
        ["--version"],
        ["--help-commands"],
        ["develop", "--help"],
        [*DEVELOP[1:], "x/y", "--uninstall"],
    ],
)
def test_nothing_is_built_where_colcon_only_asks_or_takes_away(colcon, monkeypatch, asked):
    monkeypatch.setattr(sys, "argv", ["setup.py", *asked])
    colcon.call()
    assert not colcon.commands


def test_without_colcon_nothing_is_built(colcon, monkeypatch):
    monkeypatch.delattr(sys, "real_prefix")
    colcon.call()
    assert not colcon.commands


def test_a_build_that_fails_says_in_a_line_where_to_look_and_what_to_type(colcon):
    colcon.status = 1
    with pytest.raises(SystemExit) as stopped:
        colcon.call()
    said = str(stopped.value)
    assert "\n" not in said and "is ROS 2 sourced?" in said and "colcon build --base-paths" in said
    colcon.status = 0
    colcon.call()
    assert len(colcon.commands) == 2, "a failure is not taken for a build"
