"""What can be checked about the words by a machine: short paragraphs, wrapped lines, and no
citation of a file that is not here.
"""

import ast
import io
import re
import tokenize
from functools import cache
from pathlib import Path

import pytest

from tests.paths import ROOT

MADE_BY_A_TOOL = "reference.md"
PAGES = [
    ROOT / "README.md",
    *(page for page in sorted((ROOT / "docs").glob("*.md")) if page.name != MADE_BY_A_TOOL),
]
LONGEST_LINE = 120
ITEM = re.compile(r" *([*+-]|\d+\.) ")
CITED = re.compile(
    r"(?<![\w./*-])[\w./*-]*\w\.(?:md|yaml)\b|\bwam_facts\b|\bfacts \d|\(facts\)|\berrata\b"
)
"""A name that ends as a page or a parameter file does, and the notes that were cited without an
ending.
"""
OF_THE_USER = {"thursday.yaml", "cameras.yaml", "mapping.yaml", "demonstrations_csv/mapping.yaml"}
"""Files of the user's own in examples."""


def prose(text: str) -> list[list[str]]:
    """Paragraphs of Markdown as lists of lines, each item of a list by itself; headings, tables
    and blocks of code are left out.
    """
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    paragraphs: list[list[str]] = [[]]
    for line in text.splitlines():
        if not line.strip() or line.startswith(("#", "|", "    ")):
            paragraphs.append([])
        elif ITEM.match(line):
            paragraphs.append([line])
        else:
            paragraphs[-1].append(line)
    return [paragraph for paragraph in paragraphs if paragraph]


def test_paragraphs_and_items_are_told_apart():
    text = (
        "# Head\n\none\ntwo\n* three\n  four\n  * five\n\n    code\n\n| a"
        " |\n|---|\n\n```text\ncode\n```\n1. six\n"
    )
    assert prose(text) == [["one", "two"], ["* three", "  four"], ["  * five"], ["1. six"]]


BESIDE = [ROOT / name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "bags/README.md")]
"""Pages that are no part of the website."""


@pytest.mark.parametrize(
    "page", [*PAGES, *BESIDE], ids=lambda page: page.relative_to(ROOT).as_posix()
)
def test_lines_of_prose_are_wrapped(page):
    lines = [line for paragraph in prose(page.read_text(encoding="utf-8")) for line in paragraph]
    long = [line for line in lines if len(line) > LONGEST_LINE]
    assert not long, f"{page.name}: wrap at {LONGEST_LINE} characters: {long}"


# --- citations ---


MODULE = re.compile(r"(?<![\w./*-])[\w./*-]*\w\.py\b")
"""A name of a module, which a page must spell as it is called today."""


@cache
def files_of_the_repository() -> set[str]:
    """Paths of pages, parameter files and modules, without what set-up, builds and runs have made."""
    made = {".venv", ".venv-benchmark", ".venv-rerun", "build", "install", "log"}
    tops = [top for top in ROOT.iterdir() if top.name not in made]
    found = (path for top in tops for path in ([top] if top.is_file() else top.rglob("*")))
    return {
        path.relative_to(ROOT).as_posix()
        for path in found
        if path.suffix in (".md", ".yaml", ".py")
    }


def missing(text: str, cites: re.Pattern[str] = CITED) -> set[str]:
    """What a text cites and is in no folder of the repository."""
    files = files_of_the_repository()
    cited = {re.sub(r"^(\.{0,2}/)+", "", name) for name in cites.findall(text)} - OF_THE_USER
    return {
        name
        for name in cited
        if "*" not in name and not any(file == name or file.endswith(f"/{name}") for file in files)
    }


def comments_and_docstrings(source: str) -> str:
    """What a module says about itself: comments, and strings that stand alone as a statement."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    alone = (
        node.value
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    )
    return "\n".join(
        [*comments, *(constant.value for constant in alone if isinstance(constant.value, str))]
    )


def test_a_file_that_is_not_here_is_noticed():
    assert (
        missing("[a](../config/wam.yaml), docs/throwing.md, throwing.md, `config/*.yaml`") == set()
    )
    assert missing("see nowhere.md, docs/wam.yaml, facts 6.1") == {
        "nowhere.md",
        "docs/wam.yaml",
        "facts 6",
    }
    assert missing("`world.py`, dart_skill/glances.py", MODULE) == {"dart_skill/glances.py"}
    assert comments_and_docstrings('"""One."""\nname = "two"  # three\n"""Four."""\n').split() == [
        "#",
        "three",
        "One.",
        "Four.",
    ]


@pytest.mark.parametrize(
    "page", [*PAGES, ROOT / "docs" / MADE_BY_A_TOOL], ids=lambda page: page.name
)
def test_every_file_that_a_page_cites_is_here(page):
    text = page.read_text(encoding="utf-8")
    assert not missing(text), "give the fact itself with its published source: docs/sources.md"
    assert not missing(text, MODULE), "give the module the name that it has today"


def cited_by_the_code() -> dict[str, list[str]]:
    """What is cited and is not here, and the modules that cite it."""
    found: dict[str, list[str]] = {}
    for folder in ("dart_skill", "nodes", "launch", "tools", "tests", "benchmarks", "docs"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            if path == Path(__file__) or not missing(source):
                # most modules: what they say of themselves is a part of all that they say
                continue
            names = missing(comments_and_docstrings(source))
            for name in names:
                found.setdefault(name, []).append(path.relative_to(ROOT).as_posix())
    return found


def test_every_file_that_the_code_cites_is_here():
    found = cited_by_the_code()
    assert not found, f"give the fact itself with its published source instead: {found}"
