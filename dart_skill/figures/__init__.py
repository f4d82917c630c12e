"""The figures of a run, as SVG and PNG: reading a bag for them, and one module per figure.

The same data give the same bytes.
"""

from dart_skill.figures.execution import ExecutedThrow, draw_execution, executed_throw, execution_figure
from dart_skill.figures.gaussians import FrameView, draw_gaussians, frame_views, gaussians_figure
from dart_skill.figures.landings import draw_landings, landings_figure
from dart_skill.figures.recordings import Recording, read_recordings
from dart_skill.figures.synchronisation import DemonstratedMotion, demonstrated_motions, draw_synchronisation, synchronisation_figure

__all__ = [
    "DemonstratedMotion",
    "ExecutedThrow",
    "FrameView",
    "Recording",
    "demonstrated_motions",
    "draw_execution",
    "draw_gaussians",
    "draw_landings",
    "draw_synchronisation",
    "executed_throw",
    "execution_figure",
    "frame_views",
    "gaussians_figure",
    "landings_figure",
    "read_recordings",
    "synchronisation_figure",
]
