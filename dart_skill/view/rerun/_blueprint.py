"""The layout of a bag in Rerun, as a blueprint file. This file runs in Rerun's own interpreter and
imports nothing of ours:

    python _blueprint.py OUTPUT.rbl '{"application": "...", "frame": "world", "ball": "/vrpn_mocap/ball/pose", ...}'

Keys, of which what is null is left out:
  application   name of the recording, which Rerun takes from its file frame         in which
  everything is drawn ball, basket  topics of their poses ball_radius   of what stands for the ball
  [m] basket_size   radius and depth of what stands for the basket [m] joints        topic of the
  joint states names         of the joints effort        whether joint states have efforts arm name
  of the robot, below which Rerun puts the shapes of /robot_description stands        how high the
  arm's base is above the ground [m]
"""

import json
import sys
from importlib import import_module
from typing import Any

rr, rrb, encodings = map(import_module, ("rerun", "rerun.blueprint", "rerun.blueprint.encodings"))

BALL = (213, 94, 0)
"""Colour of the ball."""
BASKET = (0, 114, 178)
"""Colour of the basket."""
GREY = (119, 119, 119)
"""Colour of the first coordinate of a pose."""
SKY = (86, 180, 233)
"""Colour of the second coordinate of a pose."""
LIGHT = (187, 187, 187)
"""Colour of the pedestal."""
JOINTS = (BASKET, (230, 159, 0), (0, 158, 115), BALL, (204, 121, 167), SKY, GREY)
"""A joint has one colour in all plots, on a light page and on a dark one."""
MOUNT_RADIUS = 0.12
"""Radius of what stands for the pedestal [m], as on the live page."""
TIMELINE = "message_log_time"
"""All topics are on it."""


def scene(about: dict[str, Any]) -> Any:
    """The arm on its pedestal with ball and basket in space."""
    drawn = {}
    if about.get("arm") and (height := about.get("stands", 0.0)) > 0.0:
        drawn[f"/{about['arm']}"] = rr.Cylinders3D.from_fields(
            centers=[[0.0, 0.0, -height / 2]],
            radii=[MOUNT_RADIUS],
            lengths=[height],
            colors=[LIGHT],
            fill_mode="Solid",
        )
    if about.get("ball"):
        drawn[about["ball"]] = rr.Ellipsoids3D.from_fields(
            half_sizes=[[about["ball_radius"]] * 3], colors=[BALL], fill_mode="Solid"
        )
    if about.get("basket"):
        radius, depth = about["basket_size"]
        drawn[about["basket"]] = rr.Cylinders3D.from_fields(
            centers=[[0.0, 0.0, -depth / 2]],
            radii=[radius],
            lengths=[depth],
            colors=[BASKET],
            fill_mode="TransparentFillMajorWireframe",
        )
    return rrb.Spatial3DView(
        name="Arm, ball, basket",
        origin="/",
        contents=["+ /**", "- /wam/collision_geometries/**"],
        overrides=drawn,
        defaults=[
            shape.from_fields(fill_mode="Solid")
            for shape in (rr.Boxes3D, rr.Cylinders3D, rr.Ellipsoids3D)
        ],
        spatial_information=rrb.SpatialInformation(target_frame=about["frame"]),
        eye_controls=rrb.EyeControls3D(
            position=(1.9, -4.0, 1.9), look_target=(0.9, 0.0, 0.9), eye_up=(0.0, 0.0, 1.0)
        ),
    )


def scalars(component: str, **how: str) -> Any:
    """That the lines of a plot are the numbers of a component."""
    source = encodings.ComponentSourceKind.SourceComponent
    return encodings.VisualizerComponentMapping(
        "Scalars:scalars", source, source_component=component, **how
    )


def joint_plot(about: dict[str, Any], field: str, name: str, legend: bool) -> Any:
    """One quantity of every joint over time."""
    topic, names = f"{about['joints']}/{field}", about["names"]
    lines = rr.SeriesLines(
        colors=[JOINTS[k % len(JOINTS)] for k in range(len(names))], names=names
    )
    drawn = {topic: lines.visualizer(mappings=[scalars("Scalars:scalars")])}
    corner = rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend)
    return rrb.TimeSeriesView(
        name=name, origin=topic, contents=[f"+ {topic}"], overrides=drawn, plot_legend=corner
    )


def height_plot(topic: str, name: str) -> Any:
    """Third coordinate of a pose over time; the legend switches the others on."""
    lines = rr.SeriesLines(
        colors=[GREY, SKY, BALL], names=["x", "y", "height"], visible_series=[False, False, True]
    )
    drawn = {
        topic: lines.visualizer(mappings=[scalars("InstancePoses3D:translations", selector=".[]")])
    }
    return rrb.TimeSeriesView(
        name=f"{name} [m]", origin=topic, contents=[f"+ {topic}"], overrides=drawn
    )


def layout(about: dict[str, Any]) -> Any:
    """What is seen of a bag, by what is in it."""
    plots = []
    if about.get("joints"):
        plots.append(joint_plot(about, "position", "Joint positions [rad]", legend=True))
        plots.append(joint_plot(about, "velocity", "Joint speeds [rad/s]", legend=False))
        if about.get("effort"):
            plots.append(joint_plot(about, "effort", "Joint efforts [N m]", legend=False))
    if about.get("ball"):
        plots.append(height_plot(about["ball"], "Height of the ball"))
    left = [scene(about)] if about.get("frame") else []
    right = [rrb.Vertical(*plots, row_shares=[2] + [1] * (len(plots) - 1))] if plots else []
    return rrb.Blueprint(
        rrb.Horizontal(*left, *right, column_shares=[3, 2][: len(left) + len(right)]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=not (left or right),
    )


if __name__ == "__main__":
    output, about = sys.argv[1], json.loads(sys.argv[2])
    layout(about).save(about["application"], output)
