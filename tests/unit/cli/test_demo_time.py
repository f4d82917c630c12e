"""What a demo says of the time that it will take."""

from dart_skill.cli.demo import expected
from dart_skill.skills.protocol import SkillWords, load_skill


def test_a_demo_tells_how_long_it_will_take():
    words = load_skill("darts").words
    assert expected(words, words.lessons, words.tries) == (
        "8 demonstrations, then 75 throws; about 145 s on two idle cores"
    )
    assert expected(words, 4, 5) == "4 demonstrations, then 5 throws"  # that was not measured
    assert "about 72 s" in expected(load_skill("reach").words, 8, 10)


def test_of_a_skill_that_nobody_has_timed_no_time_is_told():
    unknown = SkillWords(welcome="", shown="", begin="")
    assert expected(unknown, 1, 2) == "1 demonstration, then 2 trials"
