"""A file of config/ that is broken ends a command, or a node, with a line that names file, entry and
remedy.
"""

import os
import shutil
import subprocess
import sys

import pytest

from dart_skill_nodes.executables import __name__ as EXECUTABLES
from tests.paths import CONFIG

DEMO = ("dart-skill", "demo", "--layout", "in-process")
PLACES = (*DEMO, "--skill", "place")
DRAWN = (*DEMO, "--arm", "fleet:3")
POLICY = ("dart-skill", "security", "policy")
STATUS = ("dart-skill", "status")


def _node(name):
    return sys.executable, "-m", f"{EXECUTABLES}.{name}"


@pytest.mark.parametrize(
    ("file", "old", "new", "commands", "said"),
    [
        ("world.yaml", None, "[" * 100_000, (STATUS, _node("commander")), "nested more than 30"),
        ("world.yaml", None, "a:\n\t- 1\n", (STATUS, _node("teacher")), "line 2, column 1: found"),
        ("world.yaml", "0.0577", "text", (DEMO, _node("viewer")), "ball_mass is 'text'; it must"),
        ("world.yaml", "2.37,", "1e308,", (DEMO,), "board_position[0] is '1e308'; it must be"),
        ("world.yaml", "    rim:", "    rims:", (STATUS,), "unknown entry 'rims': did you mean rim?"),
        ("limits.yaml", "    joint_margin:", "    # ", (_node("commander"),), "lacks joint_margin"),
        ("commander.yaml", "900.0", ".nan", (_node("commander"),), "tracking_stiffness is nan"),
        ("coach.yaml", "    seed: 0", "    seed: [0]", (_node("coach"),), "seed is [0]; it must be an"),
        ("optitrack.yaml", "[-1.8, -2.5, 2.8]", "[-1.8]", (_node("mock_optitrack"),), "c01.position"),
        ("recorder.yaml", '[".*"]', "[]", (_node("recorder"),), "topics is []; it must be a list"),
        ("parameters.yaml", "[1.0, 2.0]", "[1.0]", (_node("commander"),), "range is [1.0]; it must"),
        ("wam.yaml", "elbow: 4", "elbow: 4\nelbow: 3", (DEMO,), "elbow stands in line"),
        ("wam.yaml", "mass: 10.7677", "mass: heavy", (DEMO,), "links[0].mass is 'heavy'; it must"),
        ("fleet.yaml", "[0.7, 1.4]", "[1.4, 0.7]", (DRAWN,), "friction_scale is"),
        ("skills/place.yaml", None, "reach: []\n", (PLACES,), "reach is []; it must have 2 numbers"),
        ("permissions.yaml", "  managed: true", "  managed: 3", (POLICY,), "mock_optitrack.managed is 3"),
    ],
)  # fmt: skip
def test_a_broken_file_is_named_with_the_entry(tmp_path, file, old, new, commands, said):
    config = shutil.copytree(CONFIG, tmp_path / "config")
    text = (config / file).read_text()
    assert old is None or text.count(old) >= 1
    (config / file).write_text(new if old is None else text.replace(old, new, 1))
    environment = {**os.environ, "DART_SKILL_CONFIG": str(config)}
    for command in commands:
        ended = subprocess.run(
            command, capture_output=True, text=True, timeout=60, env=environment, cwd=tmp_path
        )
        lines = ended.stderr.strip().splitlines()
        assert ended.returncode == 1, (command, ended)
        # demo says two lines before it begins
        assert "Traceback" not in ended.stderr and len(lines) <= 3, ended.stderr
        assert str(config / file) in lines[-1] and said in lines[-1], ended.stderr
