"""What `make test` does after a run in which something failed."""

import importlib.util
import json
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[3] / "tools" / "try_again.py"


@pytest.fixture
def tool(tmp_path, monkeypatch):
    """The tool, on another folder that has a file that passes, one that fails, and one that takes
    its process with it.
    """
    specification = importlib.util.spec_from_file_location("try_again", TOOL)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "FAILED", tmp_path / "lastfailed")
    (tmp_path / "test_good.py").write_text("def test_it():\n    assert True\n")
    (tmp_path / "test_bad.py").write_text("def test_it():\n    assert False\n")
    (tmp_path / "test_dies.py").write_text(
        "import os, signal\ndef test_it():\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    return module


@pytest.mark.parametrize(
    "failed, status, said",
    [
        (
            ["test_good.py::test_it", "test_good.py::test_other[x]"],
            0,
            "TRIED AGAIN, alone: passed: test_good.py",
        ),
        (
            ["test_good.py::test_it", "test_bad.py::test_it"],
            1,
            "TRIED AGAIN, alone: failed: test_bad.py",
        ),
        (
            ["test_good.py::test_it", "test_dies.py::test_it"],
            1,
            "TRIED AGAIN, alone: failed: test_dies.py",
        ),
        ([], 1, "0 files failed"),
        (
            [f"test_{k}.py::test_it" for k in range(7)],
            1,
            "7 files failed; only one to 6 are tried again",
        ),
    ],
)
def test_what_passes_alone_has_passed_and_what_is_wrong_fails_again(
    tool, failed, status, said, capfd
):
    tool.FAILED.write_text(json.dumps(dict.fromkeys(failed, True)))
    assert tool.main() == status
    assert said in "".join(capfd.readouterr())


def test_it_is_tried_with_the_options_of_the_run(tool, capfd):
    """What was left out then is left out now."""
    tool.FAILED.write_text(json.dumps({"test_good.py::test_it": True}))
    (tool.ROOT / "test_good.py").write_text(
        "def test_it():\n    pass\ndef test_other():\n    assert False\n"
    )
    assert (tool.main(["-k", "not other"]), tool.main()) == (0, 1)


def test_without_a_record_nothing_is_tried(tool):
    assert tool.main() == 1
