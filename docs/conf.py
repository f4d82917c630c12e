"""Sphinx for the pages of this folder, README.md and the docstrings of the library: `make docs` writes them to build/docs.

`-t prose` leaves the docstrings out: what a check of links needs, in a few seconds.
"""

import re
from itertools import groupby
from pathlib import Path

from sphinx.addnodes import pending_xref

ROOT = Path(__file__).resolve().parents[1]

project = "dart_skill"
author = "dart_skill maintainers"
project_copyright = "dart_skill maintainers, Apache-2.0"
release = re.search(r"<version>(.*)</version>", (ROOT / "package.xml").read_text(encoding="utf-8"))[1]

PROSE_ONLY = tags.has("prose")  # noqa: F821  `tags` is Sphinx's
extensions = ["myst_parser", "sphinx_rtd_theme", *([] if PROSE_ONLY else ["sphinx.ext.autodoc"])]
exclude_patterns = ["api/*"] if PROSE_ONLY else []
suppress_warnings = ["toc.excluded"] if PROSE_ONLY else []

myst_heading_anchors = 4  # of the headings of Markdown, as GitHub makes them

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}  # and not all that it stands for
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100

html_theme = "sphinx_rtd_theme"  # as the packages' pages on docs.ros.org
html_theme_options = {"navigation_depth": 2}
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_show_sphinx = False
linkcheck_ignore = [r"http://(127\.0\.0\.1|localhost):\d+"]  # the viewer's page, while it runs

MARKUP = re.compile(r"([\\*|_])")
ITEM = re.compile(r"[*-] ")


def _plain(text: str) -> str:
    """Text in which nothing is markup but `names` in backticks, which become literals."""
    parts = re.split(r"`+([^`]+)`+", text)
    shown = [f"``{part}``" if i % 2 else MARKUP.sub(r"\\\1", part).replace("::", ":\\:") for i, part in enumerate(parts)]
    return "\\ ".join(shown)


def _paragraph(lines: list[str]) -> list[str]:
    """Lines without a blank one between them as reStructuredText: a list, or text, or, where they are indented, as they stand."""
    if ITEM.match(lines[0]) and all(ITEM.match(line) or line.startswith("  ") for line in lines):
        return [line[:2] + _plain(line[2:]) for line in lines]
    if any(line.startswith(" ") for line in lines):
        return ["::", "", *(f"   {line}" for line in lines)]
    return ["\\ " + _plain(lines[0]), *map(_plain, lines[1:])]  # what begins with an escape begins no list


def show_as_written(app, what, name, obj, options, lines: list[str]) -> None:
    """Docstrings here are text, not reStructuredText: a star, a bar or an underscore in them is just that."""
    paragraphs = [list(block) for is_text, block in groupby(lines, key=lambda line: bool(line.strip())) if is_text]
    lines[:] = [shown for paragraph in paragraphs for shown in [*_paragraph(paragraph), ""]]


def show_what_has_no_page_as_text(app, doctree) -> None:
    """A link to a folder of the checkout, or from README.md to a file beside it, has no page to go to here: its text alone. One to nowhere
    stays, and is warned of.
    """
    readme = app.env.docname == "index"  # README.md is part of it
    for link in list(doctree.findall(pending_xref)):
        target = link.get("reftarget", "")
        folder = any((where / target).is_dir() for where in (ROOT / "docs", *([ROOT] if readme else [])))
        if link["reftype"] == "myst" and (folder or (readme and (ROOT / target).is_file())):
            link.replace_self(link.children)


def setup(app) -> None:
    """Connects what this file adds to Sphinx."""
    app.connect("doctree-read", show_what_has_no_page_as_text)
    if not PROSE_ONLY:
        app.connect("autodoc-process-docstring", show_as_written)
