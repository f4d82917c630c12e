"""A bar on stderr for what takes longer than a few seconds: nothing where stderr is no terminal, or
where tqdm is not installed, as the core of the package does without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def share_bar(what: str) -> Iterator[Callable[[float], None]]:
    """A bar for one job; call what it gives with the share that has been done, from 0 to 1.

    Parameters
    ----------
    what
        The job, in a word or two.
    """
    try:
        from tqdm import tqdm
    except ImportError:
        yield lambda share: None
        return
    form = "{desc}: {percentage:3.0f} % |{bar}| {elapsed}, {remaining} left"
    with tqdm(total=1.0, desc=what, bar_format=form, disable=None, leave=False) as bar:

        def tell(share: float) -> None:
            bar.update(share - bar.n)

        yield tell
