"""Models in axes of the user's: what is drawn is where the model says."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from dart_skill.figures import (
    ATTRACTOR,
    GAUSSIAN,
    HAND,
    plot_frames,
    plot_mixture,
    plot_reproduction,
)
from dart_skill.mixture import GaussianMixture
from dart_skill.movement import Reproduction, TaskFrame


@pytest.fixture
def axes():
    return Figure().subplots()


def test_ellipses_of_a_mixture_are_its_marginals(axes):
    mixture = GaussianMixture.from_parameters(
        [0.75, 0.25], [[9.0, 1.0, 2.0], [9.0, 3.0, 4.0]], [np.diag([1.0, 4.0, 0.25])] * 2
    )
    made = plot_mixture(axes, mixture, dims=(1, 2), deviations=3.0, label="two")
    assert [one.center for one in made] == [(1.0, 2.0), (3.0, 4.0)]
    assert all({round(one.width, 9), round(one.height, 9)} == {12.0, 3.0} for one in made), (
        "three deviations to either side"
    )
    assert made[0].get_facecolor() == to_rgba(GAUSSIAN, 0.5) and made[
        1
    ].get_facecolor() == to_rgba(GAUSSIAN, 0.5 / 3.0)
    assert axes.get_legend_handles_labels()[1] == ["two"]
    assert axes.get_xlim()[0] < -5.0 and axes.get_xlim()[1] > 9.0, "all of them can be seen"


def test_axes_of_frames_begin_where_they_stand(axes):
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 2.0, 0.0]])
    plot_frames(axes, [None, TaskFrame(turned, [0.0, 5.0, 6.0])], size=0.5)
    first, second = (line.get_xydata() for line in axes.lines[:2])
    assert first.tolist() == [[5.0, 6.0], [5.0, 7.0]] and second.tolist() == [
        [5.0, 6.0],
        [4.0, 6.0],
    ]
    assert [text.get_text() for text in axes.texts] == ["frame 2"]


def test_a_reproduction_has_its_attractor_and_demonstrations(axes):
    time = np.linspace(0.0, 1.0, 5)
    position = np.column_stack([time, time**2, time**3])
    made = Reproduction(time, position + 1.0, None, position, position, position)
    plot_reproduction(axes, made, (0, 2), demonstrations=[position, position])
    assert axes.get_legend_handles_labels()[1] == ["demonstrations", "attractor", "reproduction"]
    drawn = {line.get_color(): line.get_xydata() for line in axes.lines[:-1]}
    assert np.array_equal(drawn[HAND], position[:, [0, 2]]) and np.array_equal(
        drawn[ATTRACTOR], position[:, [0, 2]] + 1.0
    )


def test_a_plane_has_two_dimensions(axes):
    with pytest.raises(ValueError, match="dims must name two dimensions"):
        plot_frames(axes, [TaskFrame(np.eye(4), np.zeros(4))], dims=(1, 2, 3))
    with pytest.raises(ValueError, match="dims must be distinct"):
        plot_mixture(
            axes, GaussianMixture.from_parameters([1.0], [[0.0, 0.0]], [np.eye(2)]), dims=(0, 2)
        )
