"""The task of docs/own_task.md, as a reader makes it: its files, three lessons with a pointer, and
a trial elsewhere.
"""

import os
import re
import sys

import numpy as np
import pytest
from dart_skill_msgs.action import Teach
from rclpy.action import ActionClient

from dart_skill.skills.protocol import load_skill
from dart_skill_nodes.comms import conversions
from tests.example import with_metadata
from tests.integration.conftest import graphs, wait_for
from tests.paths import ROOT
from tests.screen_person import ScreenPerson, begin_by_pointer

FILES = {"toml": "pyproject.toml", "python": "beside.py", "yaml": "beside.yaml"}
"""What the first block of each language is."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The package of the page, on the path of this process and of the nodes."""
    package, page = tmp_path / "my_task", (ROOT / "docs" / "own_task.md").read_text()
    package.mkdir()
    for language, name in FILES.items():
        text = re.search(rf"```{language}\n(.*?)```", page, re.DOTALL).group(1)
        (package / name).write_text(text)
    with_metadata(package)
    monkeypatch.syspath_prepend(package)
    path = f"{package}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    monkeypatch.setenv("PYTHONPATH", path)
    yield package
    sys.modules.pop("beside", None)


@pytest.mark.slow
def test_the_task_of_the_page_is_shown_with_a_pointer_and_made_elsewhere(ros, folder, tmp_path):
    skill, rng = load_skill("beside"), np.random.default_rng(1)
    assert skill.settings.components == 16, "the YAML file was read"
    with graphs(tmp_path / "graph") as make:
        _, client = make("composed", 0, skill="beside")
        person = ScreenPerson(client, ("hand", "part", "holder"))
        teacher = ActionClient(client.node, Teach, "/teach")
        wait_for(client, teacher.server_is_ready, what="the teacher")
        for _ in range(3):
            situation = skill.draw(rng)
            result = begin_by_pointer(client, teacher, situation)
            person.place(skill.goal(situation))
            person.hands.done()
            lesson = client.wait(result, "the end of the lesson").result
            assert lesson.success, lesson.message
        assert client.learn().demonstrations == 3
        made = client.execute(conversions.situation_msg(skill.draw(rng)), look=True)
        assert made.outcome.success, made.outcome.message
