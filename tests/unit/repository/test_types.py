"""mypy finds wrong calls of the library, with the settings of pyproject.toml, and has nothing to
say about right ones.

The calls are those of typed_calls.py. mypy reads it in the same run as the library (`make test`):
a run of its own would read the library once more, which takes half a minute of a core.
"""

import re

from tests.paths import ROOT

CALLS = "tests.unit.repository.typed_calls"


def settings(path, heading):
    """The lines of a part of a file of settings."""
    return path.read_text().split(f"{heading}\n")[1].split("\n\n")[0].splitlines()


def test_mypy_reads_the_calls_with_the_library_and_says_if_one_is_not_as_wrong_as_it_should_be():
    lines = settings(ROOT / "pyproject.toml", "[tool.mypy]")
    assert {
        'packages = ["dart_skill"]',
        f'modules = ["{CALLS}"]',
        "warn_unused_ignores = true",
    } <= set(lines)
    assert "python3 -m mypy >" in (ROOT / "Makefile").read_text()


def test_every_wrong_call_names_the_error_that_is_to_be_found():
    right, wrong = (
        (ROOT / f"{CALLS.replace('.', '/')}.py")
        .read_text()
        .split("# --- right ---")[1]
        .split("# --- wrong ---")
    )
    assert "ignore" not in right and len(right.split("\n\n")[1].splitlines()) == 4
    calls = wrong.strip().splitlines()
    assert len(calls) == 8 and all(
        re.search(r"\)  # type: ignore\[[a-z]+-[a-z]+\]", call) for call in calls
    ), calls
