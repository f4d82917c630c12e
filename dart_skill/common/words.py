"""Numbers of things in words, for people."""


def counted(number: int, one: str, many: str = "") -> str:
    """So many things: "1 throw", "2 throws".

    Parameters
    ----------
    one, many
        What a thing is called, and what several are; default: with an s.
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def too_few(number: int, one: str) -> str:
    """That so many things are too few: "1 demonstration is too few".

    Parameters
    ----------
    one
        What a thing is called.
    """
    return f"{counted(number, one)} {'is' if number == 1 else 'are'} too few"
