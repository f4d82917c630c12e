"""Texts of strangers, as names in a bag, on a terminal: what would move its cursor, colour it or clear it is written as what it is."""


def printable(text: str) -> str:
    """The text with every control character but the end of a line spelled out, as \\x1b."""
    return "".join(one if one.isprintable() or one == "\n" else one.encode("unicode_escape").decode() for one in text)


def in_a_line(text: str) -> str:
    """The same in one line."""
    return printable("; ".join(line.strip() for line in text.splitlines() if line.strip()))
