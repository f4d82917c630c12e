"""Numbers of things in words, for people."""


def counted(number: int, one: str, many: str = "") -> str:
    """So many things: "1 throw", "2 throws".

    Parameters
    ----------
    one, many
        What a thing is called, and what several are; default: with an s.
    """
    return f"{number} {one if number == 1 else many or one + 's'}"
