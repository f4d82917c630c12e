"""Sphinx for the pages of this folder, README.md and the docstrings of the library: `make docs`
writes them to build/docs.

`-t prose` leaves the docstrings out: what a check of links needs, in a few seconds.
"""

import re
import sys
from pathlib import Path

from docutils.nodes import SkipNode
from docutils.utils.math import latex2mathml
from sphinx.addnodes import pending_xref

ROOT = Path(__file__).resolve().parents[1]

project = "dart_skill"
author = "dart_skill maintainers"
project_copyright = "dart_skill maintainers, Apache-2.0"
release = re.search(
    r"<version>(.*)</version>", (ROOT / "package.xml").read_text(encoding="utf-8")
)[1]

PROSE_ONLY = tags.has("prose")  # noqa: F821  `tags` is Sphinx's
FROM_CODE = (
    []
    if PROSE_ONLY
    else [
        "sphinx.ext.autodoc",
        "sphinx.ext.napoleon",
        "sphinx_gallery.gen_gallery",
    ]
)
extensions = ["myst_parser", "sphinx_rtd_theme", *FROM_CODE]
exclude_patterns = ["examples/*", *(["api/*", "gallery/*"] if PROSE_ONLY else [])]
# the order of the gallery is a function
# napoleon takes what stands before a colon for a type: an ordinary word is looked up, and may name several things
suppress_warnings = ["toc.excluded"] if PROSE_ONLY else ["config.cache", "ref.python"]

myst_heading_anchors = 4  # of the headings of Markdown, as GitHub makes them
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = False

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "signature"
napoleon_google_docstring = False  # the docstrings are numpydoc's
napoleon_use_rtype = False
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True

sys.path.insert(0, str(ROOT))  # the examples use the library of this checkout
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r".*\.py",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 10_000,
    "write_computation_times": False,
    "copyfile_regex": r".*\.rst",
}

html_math_renderer = "mathml"
html_theme = "sphinx_rtd_theme"  # as the packages' pages on docs.ros.org
html_theme_options = {"navigation_depth": 2}
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_show_sphinx = False
linkcheck_ignore = [r"http://(127\.0\.0\.1|localhost):\d+"]  # the viewer's page, while it runs


SECTION = re.compile(r"^-{3,}$")
CODE = re.compile(r"`+([^`]+)`+")


def plain(text: str) -> str:
    """Text in which nothing is markup but `names` in backticks, which become literals."""
    parts = CODE.split(text)
    parts[::2] = [re.sub(r"([\\*|_])", r"\\\1", part) for part in parts[::2]]
    return "".join(f"``{part}``" if i % 2 else part for i, part in enumerate(parts))


def show_as_written(app, what, name, obj, options, lines: list[str]) -> None:
    """Docstrings are text, not reStructuredText, but for the sections of numpydoc: a star is a
    star, and what is indented in the prose, as an equation or a table, stands as it is.
    """
    if what == "attribute" and isinstance(obj, str):
        lines.clear()  # of the value: those of str
    rules = [number for number, line in enumerate(lines) if SECTION.match(line)]
    first = rules[0] - 1 if rules else len(lines)
    shown: list[str] = []
    in_item = False
    for number, line in enumerate(lines):
        in_item = line.startswith("* ") or (in_item and line.startswith(" "))
        if in_item:
            shown.append(line[:2] + plain(line[2:]))
        elif number < first and line.startswith(" "):
            begins = not lines[number - 1].startswith(" ")
            shown += ["", "::", "", f"   {line}"] if begins else [f"   {line}"]
        else:
            shown.append(line if SECTION.match(line) else plain(line))
    lines[:] = shown


def show_what_has_no_page_as_text(app, doctree) -> None:
    """A link to a folder of the checkout, or from README.md to a file beside it, has no page to go
    to here: its text alone. One to nowhere stays, and is warned of.
    """
    readme = app.env.docname == "index"  # README.md is part of it
    for link in list(doctree.findall(pending_xref)):
        target = link.get("reftarget", "")
        folder = any(
            (where / target).is_dir() for where in (ROOT / "docs", *([ROOT] if readme else []))
        )
        if link["reftype"] == "myst" and (folder or (readme and (ROOT / target).is_file())):
            link.replace_self(link.children)


def _inline_equation(writer, node) -> None:
    writer.body.append(latex2mathml.tex2mathml(node.astext(), as_block=False))
    raise SkipNode


def _block_equation(writer, node) -> None:
    writer.body.append(
        f'<div class="math">{latex2mathml.tex2mathml(node.astext(), as_block=True)}</div>\n'
    )
    raise SkipNode


def setup(app) -> None:
    """Connects what this file adds to Sphinx."""
    # Equations as MathML, which docutils writes and every browser of today shows: no script, no
    # font and no other site is needed.
    app.add_html_math_renderer("mathml", (_inline_equation, None), (_block_equation, None))
    app.connect("doctree-read", show_what_has_no_page_as_text)
    if not PROSE_ONLY:
        # before napoleon, which makes fields of the sections
        app.connect("autodoc-process-docstring", show_as_written, priority=400)
