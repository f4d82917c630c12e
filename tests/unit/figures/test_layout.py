"""Panels where matplotlib's own measure of their texts says that they have room, and ticks that are those of matplotlib."""

import io
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from dart_skill.figures import house_style, legend_below, letter_panels, panels, svg_text
from dart_skill.figures._layout import wrapped
from dart_skill.figures._style import _LAID_OUT, colour_bar
from dart_skill.figures._ticks import light_ticks

FAMILY = ("DejaVu Sans",)
SLACK = 2.0
"""Points by which a text may differ from what its font says: matplotlib measures it in whole pixels."""


def drawn(narrow, scale=1.0, title="Seen from the side", bar=True, aspect=False):
    """A figure of two panels with everything around them; scale: of its numbers, which makes labels of ticks long."""
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
@pytest.mark.parametrize("scale", [1.0, 3e4, 1e-3])
def test_no_panel_reaches_into_another_or_beyond_the_figure(narrow, bar, scale):
    figure, _ = drawn(narrow, scale, bar=bar)
    renderer = settled(figure)
    boxes = [one.get_tightbbox(renderer) for one in figure.axes] + [figure.legends[0].get_window_extent(renderer)]
    slack = SLACK * figure.dpi / 72.0
    for k, box in enumerate(boxes):
        assert box.x0 > -slack and box.y0 > -slack and box.x1 < figure.bbox.x1 + slack and box.y1 < figure.bbox.y1 + slack, box
        for other in boxes[:k]:
            across, up = (min(box.max[i], other.max[i]) - max(box.min[i], other.min[i]) for i in (0, 1))
            assert min(across, up) < slack, f"{box} and {other}"


def test_panels_have_the_ratio_that_was_asked_and_use_the_room():
    figure, axes = drawn(False, bar=False)
    settled(figure)
    widths = [one.get_position().width for one in axes]
    assert widths[0] / widths[1] == pytest.approx(5.0 / 4.0)
    assert sum(widths) > 0.8 and axes[0].get_position().height > 0.7


def test_a_figure_is_the_same_whatever_is_set_where_it_is_shown():
    """The settings of matplotlib by default name sizes in words, with which nothing can be computed."""
    first, second = drawn(True)[0], drawn(True)[0]
    settled(first)
    FigureCanvasAgg(second).draw()
    for one, other in zip(first.axes, second.axes, strict=True):
        np.testing.assert_array_equal(one.get_position().bounds, other.get_position().bounds)


def test_a_title_that_would_be_cut_off_has_more_lines():
    figure, axes = drawn(True, title="n = 20 throws, of which 19 landings were seen, and none of them in the basket at all")
    renderer = settled(figure)
    assert axes[0].get_title(loc="left").count("\n") >= 1
    assert axes[0].get_tightbbox(renderer).x1 <= figure.bbox.x1


@pytest.mark.parametrize("width", [40.0, 90.0, 200.0, 1e4])
def test_breaking_lines_keeps_all_words_in_their_order(width):
    text = "Landing error:\nmedian 0.5 cm, quartiles 0.3 and 0.6 cm, n = 20 throws, 19 landings seen"
    lines = wrapped(text, width, 10.0, FAMILY).split("\n")
    assert " ".join(lines).split() == text.split()
    assert width < 1e4 or len(lines) == 2, "the break that was there stays, and none is added"
    assert wrapped("\n".join(lines), width, 10.0, FAMILY).split("\n") == lines


def test_a_line_ends_at_a_comma_where_one_is_near():
    assert wrapped("median 0.5 cm, quartiles 0.3 and 0.6 cm, n = 20 throws", 255.0, 10.0, FAMILY).split("\n")[0].endswith("0.6 cm,")


# ticks


def texts_of(figure, light):
    """Every text of the SVG with its place, to a tenth of a point, as it is written with light ticks or without."""
    with house_style(), io.StringIO() as file:
        with light_ticks(light):
            figure.savefig(file, format="svg")
        root = ElementTree.fromstring(file.getvalue())
    found = []
    for element in root.iter("{http://www.w3.org/2000/svg}text"):
        place = element.get("transform", "") + f" {element.get('x', '')} {element.get('y', '')}"
        numbers = [
            round(float(part), 1) for part in place.replace("(", " ").replace(")", " ").replace(",", " ").split() if _is_number(part)
        ]
        found.append(("".join(element.itertext()), *numbers))
    return sorted(found)


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("aspect", [False, True])
def test_light_ticks_are_labelled_where_matplotlib_labels_them(aspect):
    figure, axes = drawn(False, aspect=aspect)
    svg_text(figure)  # which lays it out
    usual, light = texts_of(figure, []), texts_of(figure, axes)
    assert [one[0] for one in usual] == [one[0] for one in light] and len(usual) > 20
    for one, other in zip(usual, light, strict=True):
        np.testing.assert_allclose(one[1:], other[1:], atol=0.3, err_msg=one[0])


def test_an_axis_is_as_it_was_once_it_is_written():
    figure, axes = drawn(True)
    svg_text(figure)
    children = [len(one.get_children()) for one in axes]
    assert svg_text(figure) == svg_text(figure)
    assert [len(one.get_children()) for one in axes] == children
    assert all(axis.get_visible() for one in axes for axis in (one.xaxis, one.yaxis))


def test_what_is_special_about_an_axis_is_left_to_matplotlib():
    figure, (first, second) = drawn(False, bar=False)
    first.set_yscale("log")
    second.grid(axis="y")
    second.tick_params(axis="x", rotation=30)
    with light_ticks([first, second]):
        shown = [axis.get_visible() for one in (first, second) for axis in (one.xaxis, one.yaxis)]
    assert shown == [False, True, True, True], "a logarithmic scale, a grid, and labels that are turned"


def test_a_file_is_that_which_matplotlib_writes():
    figure, _ = drawn(False)
    ours = svg_text(figure)
    again, _ = drawn(False)
    svg_text(again)
    with house_style(), io.StringIO() as text, light_ticks(_LAID_OUT[again]):
        again.savefig(text, format="svg", metadata={"Date": None, "Creator": "dart_skill"})
        assert text.getvalue() == ours
    assert figure.dpi == again.dpi
