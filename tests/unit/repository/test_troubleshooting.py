"""Every line that docs/troubleshooting.md quotes is still said somewhere in the code, word by
word.
"""

import ast
import re
from functools import cache

import pytest

from tests.paths import DOCS, ROOT

ELSEWHERE = {"No module named 'dart_skill_msgs'"}
"""Said by Python."""
GAP = "…"


def said_by(tree):
    """Texts of a module; what is filled in is a gap."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(
                part.value if isinstance(part, ast.Constant) else GAP for part in node.values
            )


@cache
def sources():
    files = [
        ROOT / "setup.py",
        *(
            file
            for folder in ("dart_skill", "nodes", "tools")
            for file in (ROOT / folder).rglob("*.py")
        ),
    ]
    return [file.read_text(encoding="utf-8") for file in files]


@cache
def texts_of(source):
    return list(said_by(ast.parse(source)))


def is_said(line):
    """Only modules that have all words of the line are parsed: all of them would take seconds."""
    words = re.findall(r"[^\W_]{4,}", line)
    texts = (
        text
        for source in sources()
        if all(word in source for word in words)
        for text in texts_of(source)
    )
    return any(line in text for text in texts) or line in re.sub(
        r"\$\w+", GAP, (ROOT / "tools/env.sh").read_text(encoding="utf-8")
    )


LINES = [
    found[1] for found in re.finditer(r"^\| `(.+?)` \|", (DOCS / "troubleshooting.md").read_text(encoding="utf-8"), re.MULTILINE)
]  # fmt: skip


@pytest.mark.parametrize("line", sorted(set(LINES) - ELSEWHERE))
def test_the_line_is_said(line):
    assert is_said(line), f"nothing says: {line}"


def test_the_page_is_read_and_a_line_that_nothing_says_is_found():
    assert len(LINES) > 30
    assert not is_said("the arm is purple, and stays so")
