"""The figure of a skill: what was shown, where it was tried, how far each trial was off."""

from dataclasses import replace

import numpy as np
import pytest

from dart_skill.common.situation import Situation
from dart_skill.figures import svg_text, trials_figure
from dart_skill.session import TrialResult
from dart_skill.skills.protocol import Skill, TaskOutcome
from tests.unit.skills.task_demonstrations import body_at, draw_body, show


class Put(Skill):
    name, bodies = "put", ("lid", "pot")


def shown(n=3):
    """Demonstrations of a hand that goes from a lid to a pot."""
    found = []
    for seed in range(n):
        rng = np.random.default_rng(seed)
        one = show(rng, draw_body(rng), role="pot")
        found.append(replace(one, tracks={**one.tracks, "lid": one.tracks["pot"]}))
    return found


def trials(*outcomes):
    return tuple(
        TrialResult(Situation({"pot": body_at(0.6, 0.1 * k, 0.2 * k)}), one)
        for k, one in enumerate(outcomes)
    )


TRIED = trials(
    TaskOutcome(True, 0.001),
    TaskOutcome(False, 0.012, "it jammed"),
    TaskOutcome(False, np.nan, "not seen"),
)


def test_every_trial_is_numbered_at_its_place_and_as_high_as_its_error():
    figure = trials_figure(TRIED, Put(), shown())
    above, _, errors = figure.axes
    places = {text.get_text(): text.get_position() for text in above.texts}
    assert {name: places[name] for name in "123"} == {
        "1": (0.6, 0.0),
        "2": (0.6, pytest.approx(0.1)),
        "3": (0.6, pytest.approx(0.2)),
    }
    assert [bar.get_height() for bar in errors.patches] == pytest.approx([1.0, 12.0])
    assert errors.get_title(loc="left") == "(c) 1 of 3 succeeded" and [
        text.get_text() for text in errors.texts
    ] == ["?"]
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["arm", "hand, shown", "pot, shown", "pot, done", "pot, failed"]


def test_the_same_run_gives_the_same_bytes():
    assert svg_text(trials_figure(TRIED, Put(), shown())) == svg_text(
        trials_figure(TRIED, Put(), shown())
    )


def test_errors_of_very_different_size_are_drawn_on_a_scale_that_shows_both():
    figure = trials_figure(
        trials(*[TaskOutcome(True, 0.001)] * 3, TaskOutcome(False, 1.2, "lost")), Put(), shown()
    )
    assert figure.axes[2].get_yscale() == "log"


def test_what_was_not_shown_and_not_tried_is_refused():
    with pytest.raises(ValueError, match="nothing to draw"):
        trials_figure(trials(), Put(), [])


@pytest.mark.parametrize("narrow", [False, True])
def test_where_nothing_was_tried_no_panel_is_empty(narrow):
    panels = trials_figure(trials(), Put(), shown(), narrow).axes
    assert [panel.get_title(loc="left")[:3] for panel in panels] == ["(a)", "(b)"]
    assert all(panel.has_data() for panel in panels)


def test_a_trial_of_unknown_error_has_its_mark_in_the_panel():
    errors = trials_figure(TRIED, Put(), shown()).axes[2]
    left, right = errors.get_xlim()
    assert all(left < text.get_position()[0] < right for text in errors.texts)


@pytest.mark.parametrize("n", [1, 3])
def test_trials_are_counted_in_whole_numbers(n):
    errors = trials_figure(trials(*[TaskOutcome(True, 0.001)] * n), Put(), shown()).axes[2]
    low, high = errors.get_xlim()
    assert [tick for tick in errors.get_xticks() if low <= tick <= high] == list(range(1, n + 1))
