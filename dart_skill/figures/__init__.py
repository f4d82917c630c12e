"""The figures of a run, as SVG and PNG: one module per figure.

The same data give the same bytes.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.figures._board import (
        draw_board,
        draw_estimate,
        draw_heat_map,
        draw_leg,
        draw_path,
    )
    from dart_skill.figures._darts import arm_darts_figure, draw_arm_darts, running
    from dart_skill.figures._execution import (
        ExecutedThrow,
        draw_execution,
        executed_throw,
        execution_figure,
    )
    from dart_skill.figures._gaussians import (
        FrameView,
        draw_gaussians,
        frame_views,
        gaussians_figure,
    )
    from dart_skill.figures._landings import (
        RIM_RADIUS,
        draw_landings,
        draw_trials,
        landings_figure,
        trials_figure,
    )
    from dart_skill.figures._models import plot_frames, plot_mixture, plot_reproduction
    from dart_skill.figures._style import (
        ATTRACTOR,
        BALL,
        BASKET,
        BLACK,
        BLUE,
        DEMONSTRATION,
        FAILURE,
        GAUSSIAN,
        GREEN,
        GREY,
        HAND,
        LIGHT,
        ORANGE,
        PALE,
        PLANNED,
        PURPLE,
        RELEASE,
        SKY,
        SUCCESS,
        VERMILION,
        basket_from_above,
        gaussian_ellipse,
        house_style,
        legend_below,
        letter_panels,
        panels,
        quantity_colours,
        save,
        svg_text,
        unit_along,
        zoomed_inset,
    )
    from dart_skill.figures._synchronisation import (
        SAME_BASKET,
        DemonstratedMotion,
        HandRecording,
        demonstrated_motions,
        draw_synchronisation,
        synchronisation_figure,
    )
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "_board": "draw_board draw_estimate draw_heat_map draw_leg draw_path",
            "_darts": "arm_darts_figure draw_arm_darts running",
            "_execution": "ExecutedThrow draw_execution executed_throw execution_figure",
            "_gaussians": "FrameView draw_gaussians frame_views gaussians_figure",
            "_landings": "RIM_RADIUS draw_landings draw_trials landings_figure trials_figure",
            "_models": "plot_frames plot_mixture plot_reproduction",
            "_style": (
                "ATTRACTOR BALL BASKET BLACK BLUE DEMONSTRATION FAILURE GAUSSIAN GREEN GREY HAND"
                " LIGHT ORANGE PALE PLANNED PURPLE RELEASE SKY SUCCESS VERMILION basket_from_above"
                " gaussian_ellipse house_style legend_below letter_panels panels quantity_colours"
                " save svg_text unit_along zoomed_inset"
            ),
            "_synchronisation": (
                "DemonstratedMotion HandRecording SAME_BASKET demonstrated_motions"
                " draw_synchronisation synchronisation_figure"
            ),
        },
    )

__all__ = [
    "arm_darts_figure",
    "draw_arm_darts",
    "running",
    "trials_figure",
    "ATTRACTOR",
    "BALL",
    "BASKET",
    "BLACK",
    "BLUE",
    "DEMONSTRATION",
    "DemonstratedMotion",
    "ExecutedThrow",
    "FAILURE",
    "FrameView",
    "GAUSSIAN",
    "GREEN",
    "GREY",
    "HAND",
    "LIGHT",
    "ORANGE",
    "PALE",
    "PLANNED",
    "PURPLE",
    "RELEASE",
    "RIM_RADIUS",
    "HandRecording",
    "SAME_BASKET",
    "SKY",
    "SUCCESS",
    "VERMILION",
    "basket_from_above",
    "demonstrated_motions",
    "draw_board",
    "draw_estimate",
    "draw_execution",
    "draw_gaussians",
    "draw_heat_map",
    "draw_landings",
    "draw_leg",
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
    "legend_below",
    "letter_panels",
    "panels",
    "plot_frames",
    "plot_mixture",
    "plot_reproduction",
    "quantity_colours",
    "save",
    "svg_text",
    "synchronisation_figure",
    "unit_along",
    "zoomed_inset",
]
