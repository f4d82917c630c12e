"""Marks of demonstrations: the newest counts, and only the first time that it comes."""

from types import SimpleNamespace

import pytest

from dart_skill.recording import Marks
from dart_skill.recording.marks import ids_named


def mark(seconds, name, dropped):
    stamp = SimpleNamespace(sec=seconds, nanosec=0)
    return SimpleNamespace(header=SimpleNamespace(stamp=stamp), id=name, dropped=dropped)


def test_the_newest_mark_counts_in_whatever_order_they_come():
    marks = Marks()
    assert [
        marks.take(mark(*one)) for one in ((2, "a", False), (1, "a", True), (3, "b", True))
    ] == [True, False, True]
    assert marks.dropped == {"b"}


def test_a_mark_that_comes_again_is_no_news():
    """Nodes hand on what is news: two of them would do so for ever."""
    here, there = Marks(), Marks()
    pending = [mark(1, "a", True), mark(2, "a", False)]
    for one in pending:
        here.take(one)
    for _ in range(3):
        pending = [one for one in pending if there.take(one)]
        pending = [one for one in pending if here.take(one)]
    assert pending == [] and not there.dropped


def test_a_demonstration_is_named_by_its_id_or_its_number():
    assert ids_named(["b", "1"], ["a", "b"], "the bag") == ["b", "a"]
    for none in ("0", "3", "", "2"):
        with pytest.raises(
            ValueError, match=f"no demonstration '{none}': .* numbers 1 to 2, or a"
        ):
            ids_named([none], ["a", ""], "the bag")


def test_an_unknown_id_is_named_beside_those_that_there_are():
    with pytest.raises(
        ValueError, match="the bag has no demonstration 'c': there are numbers 1 to 2, or a, b"
    ):
        ids_named(["a", "c"], ["a", "b"], "the bag")
