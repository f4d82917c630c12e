"""Sphinx for the pages of this folder, README.md and the docstrings of the library: `make docs` writes them to build/docs.

`-t prose` leaves the docstrings out: what a check of links needs, in a few seconds.
"""

import re
import sys
from itertools import groupby
from pathlib import Path

from docutils.nodes import SkipNode
from docutils.utils.math import latex2mathml
from sphinx.addnodes import pending_xref

ROOT = Path(__file__).resolve().parents[1]

project = "dart_skill"
author = "dart_skill maintainers"
project_copyright = "dart_skill maintainers, Apache-2.0"
release = re.search(r"<version>(.*)</version>", (ROOT / "package.xml").read_text(encoding="utf-8"))[1]

PROSE_ONLY = tags.has("prose")  # noqa: F821  `tags` is Sphinx's
FROM_CODE = [] if PROSE_ONLY else ["sphinx.ext.autodoc", "sphinx_gallery.gen_gallery"]
extensions = ["myst_parser", "sphinx_rtd_theme", *FROM_CODE]
exclude_patterns = ["examples/*", *(["api/*", "gallery/*"] if PROSE_ONLY else [])]
suppress_warnings = ["toc.excluded"] if PROSE_ONLY else ["config.cache"]  # the order of the gallery is a function

myst_heading_anchors = 4  # of the headings of Markdown, as GitHub makes them
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = False

autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}  # and not all that it stands for
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100

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

MARKUP = re.compile(r"([\\*|_])")
ITEM = re.compile(r"[*-] ")
ALIAS = re.compile(r"TypeAliasForwardRef\('(\w+)'\)")


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


def without_the_inside_of_names(app, what, name, obj, options, signature, returns):
    """Of a name for a type, such as ArrayLike, Sphinx shows how it holds it where it is one of several."""
    return tuple(None if part is None else ALIAS.sub(r"\1", part) for part in (signature, returns))


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


def _inline_equation(writer, node) -> None:
    writer.body.append(latex2mathml.tex2mathml(node.astext(), as_block=False))
    raise SkipNode


def _block_equation(writer, node) -> None:
    writer.body.append(f'<div class="math">{latex2mathml.tex2mathml(node.astext(), as_block=True)}</div>\n')
    raise SkipNode


def setup(app) -> None:
    """Connects what this file adds to Sphinx."""
    # Equations as MathML, which docutils writes and every browser of today shows: no script, no font and no other site is needed.
    app.add_html_math_renderer("mathml", (_inline_equation, None), (_block_equation, None))
    app.connect("doctree-read", show_what_has_no_page_as_text)
    if not PROSE_ONLY:
        app.connect("autodoc-process-docstring", show_as_written)
        app.connect("autodoc-process-signature", without_the_inside_of_names)
