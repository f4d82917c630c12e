"""Panels where matplotlib's own measure of their texts says that they have room."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from dart_skill.figures import colour_bar, house_style, legend_below, letter_panels, panels

SLACK = 2.0
"""Points by which a text may differ from what its font says: matplotlib measures it in whole
pixels.
"""


def drawn(narrow, scale=1.0, title="Seen from the side", bar=True, aspect=False):
    """A figure of two panels with everything around them; scale: of its numbers, which makes
    labels of ticks long.
    """
    with house_style():
        figure, axes = panels([(5.0, 4.0), (4.0, 4.0)], narrow)
        for k, one in enumerate(axes):
            one.plot([0.0, 1.0], [0.0, scale], label=f"a line in panel {k}")
            one.set(xlabel="time [s]", ylabel="height of the hand [m]", title=title)
        if aspect:
            axes[0].set_aspect("equal", adjustable="datalim")
        letter_panels(*axes)
        if bar:
            colour_bar(figure, ScalarMappable(Normalize(0.0, 1.0)), "distance [m]", narrow)
        handles, labels = axes[0].get_legend_handles_labels()
        legend_below(figure, handles, labels, 3, narrow)
    return figure, axes


def settled(figure):
    """The renderer that measures it, once it is drawn."""
    canvas = FigureCanvasAgg(figure)
    with house_style():
        canvas.draw()
    return canvas.get_renderer()


@pytest.mark.parametrize("narrow", [False, True])
@pytest.mark.parametrize("bar", [False, True])
@pytest.mark.parametrize("scale", [1.0, 2e3, 1e-2])
def test_no_panel_reaches_into_another_or_beyond_the_figure(narrow, bar, scale):
    figure, _ = drawn(narrow, scale, bar=bar)
    renderer = settled(figure)
    boxes = [one.get_tightbbox(renderer) for one in figure.axes] + [
        figure.legends[0].get_window_extent(renderer)
    ]
    slack = SLACK * figure.dpi / 72.0
    for k, box in enumerate(boxes):
        assert (
            box.x0 > -slack
            and box.y0 > -slack
            and box.x1 < figure.bbox.x1 + slack
            and box.y1 < figure.bbox.y1 + slack
        ), box
        for other in boxes[:k]:
            across, up = (
                min(box.max[i], other.max[i]) - max(box.min[i], other.min[i]) for i in (0, 1)
            )
            assert min(across, up) < slack, f"{box} and {other}"


def test_panels_have_the_ratio_that_was_asked_and_use_the_room():
    figure, axes = drawn(False, bar=False)
    settled(figure)
    widths = [one.get_position().width for one in axes]
    assert widths[0] / widths[1] == pytest.approx(5.0 / 4.0)
    assert sum(widths) > 0.75 and axes[0].get_position().height > 0.7


def test_a_figure_is_the_same_whatever_is_set_where_it_is_shown():
    """The settings of matplotlib by default name sizes in words, with which nothing can be
    computed.
    """
    first, second = drawn(True)[0], drawn(True)[0]
    settled(first)
    FigureCanvasAgg(second).draw()
    for one, other in zip(first.axes, second.axes, strict=True):
        np.testing.assert_array_equal(one.get_position().bounds, other.get_position().bounds)


def test_a_title_that_would_be_cut_off_has_more_lines():
    figure, axes = drawn(
        True,
        title=(
            "n = 20 throws, of which 19 landings were seen, and none of them in the basket at all"
        ),
    )
    renderer = settled(figure)
    assert axes[0].get_title(loc="left").count("\n") >= 1
    assert axes[0].get_tightbbox(renderer).x1 <= figure.bbox.x1
