"""The figures of a run, as SVG and PNG: reading a bag for them, and one module per figure.

The same data give the same bytes.
"""

from dart_skill.figures._darts import arm_darts_figure, draw_arm_darts, running
from dart_skill.figures._execution import SAME_BASKET, ExecutedThrow, draw_execution, executed_throw, execution_figure
from dart_skill.figures._gaussians import FrameView, draw_gaussians, frame_views, gaussians_figure
from dart_skill.figures._landings import RIM_RADIUS, draw_landings, landings_figure
from dart_skill.figures._recordings import COMMAND, Recording, read_recordings
from dart_skill.figures._skill_trials import draw_trials, trials_figure
from dart_skill.figures._style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILION,
    basket_from_above,
    gaussian_ellipse,
    house_style,
    quantity_colours,
    save,
    svg_text,
    unit_along,
)
from dart_skill.figures._synchronisation import DemonstratedMotion, demonstrated_motions, draw_synchronisation, synchronisation_figure
from dart_skill.figures.board import draw_board, draw_heat_map, draw_path

__all__ = [
    "arm_darts_figure",
    "draw_arm_darts",
    "running",
    "trials_figure",
    "BLACK",
    "BLUE",
    "COMMAND",
    "DemonstratedMotion",
    "ExecutedThrow",
    "FrameView",
    "GREEN",
    "GREY",
    "LIGHT",
    "ORANGE",
    "PALE",
    "PURPLE",
    "RIM_RADIUS",
    "Recording",
    "SAME_BASKET",
    "SKY",
    "VERMILION",
    "basket_from_above",
    "demonstrated_motions",
    "draw_board",
    "draw_execution",
    "draw_gaussians",
    "draw_heat_map",
    "draw_landings",
    "draw_path",
    "draw_synchronisation",
    "draw_trials",
    "executed_throw",
    "execution_figure",
    "frame_views",
    "gaussian_ellipse",
    "gaussians_figure",
    "house_style",
    "landings_figure",
    "quantity_colours",
    "read_recordings",
    "save",
    "svg_text",
    "synchronisation_figure",
    "unit_along",
]
