"""Docstrings here are text, not reStructuredText: a star, a bar or an underscore in them is just
that.
"""

import re

MARKUP = re.compile(r"([\\*|_])")
ITEM = re.compile(r"[*-] ")


def plain(text: str) -> str:
    """Text in which nothing is markup but `names` in backticks, which become literals."""
    parts = re.split(r"`+([^`]+)`+", text)
    shown = [
        f"``{part}``" if i % 2 else MARKUP.sub(r"\\\1", part).replace("::", ":\\:")
        for i, part in enumerate(parts)
    ]
    return "\\ ".join(shown)


def is_list(lines: list[str]) -> bool:
    """Whether a paragraph is a list: items that begin with a star or a dash, and the lines that go
    on with them.
    """
    return bool(ITEM.match(lines[0])) and all(
        ITEM.match(line) or line.startswith("  ") for line in lines
    )


def is_as_it_stands(lines: list[str]) -> bool:
    """Whether a paragraph is indented somewhere, as an equation or a table is."""
    return not is_list(lines) and any(line.startswith(" ") for line in lines)


def paragraph(lines: list[str]) -> list[str]:
    """Lines without a blank one between them as reStructuredText: a list, or text, or, where they
    are indented, as they stand.
    """
    if is_list(lines):
        return [line[:2] + plain(line[2:]) for line in lines]
    if is_as_it_stands(lines):
        return ["::", "", *(f"   {line}" for line in lines)]
    return [
        "\\ " + plain(lines[0]),
        *map(plain, lines[1:]),
    ]  # what begins with an escape begins no list
