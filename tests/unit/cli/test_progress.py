"""The bar of what takes longer: on a terminal only."""

import io
import sys

import pytest

from dart_skill.cli.progress import share_bar


class Stream(io.StringIO):
    """What is written to stderr, which is a terminal or not."""

    def __init__(self, is_terminal):
        super().__init__()
        self._is_terminal = is_terminal

    def isatty(self):
        return self._is_terminal


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_bar_is_shown_on_a_terminal_and_nowhere_else(monkeypatch, is_terminal):
    stream = Stream(is_terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    with share_bar("throws") as tell:
        tell(0.5)
        tell(1.0)
    assert ("throws:   0 % |" in stream.getvalue()) is is_terminal
    assert is_terminal or not stream.getvalue()


def test_it_does_without_tqdm(monkeypatch):
    stream = Stream(True)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setitem(sys.modules, "tqdm", None)
    with share_bar("throws") as tell:
        tell(1.0)
    assert not stream.getvalue()
