"""Numbers of things in words."""

from dart_skill.common.words import counted


def test_one_thing_is_not_several():
    assert [counted(n, "throw") for n in (0, 1, 2)] == ["0 throws", "1 throw", "2 throws"]
    assert counted(2, "reach", "reaches") == "2 reaches"
