"""`dart-skill arm`: arms other than the WAM, from their URDF: what a file of config/arms/ must say
beside it, and where such an arm can throw and point its hand.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import folder
from dart_skill.common.files import new_file

if TYPE_CHECKING:
    from dart_skill.arm import ThrowingBound, UrdfArm

HEIGHTS = (0.2, 0.3, 0.4, 0.5, 0.6)
"""Heights over the base at which the hand points down [m]."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `arm` with its verbs to the commands of `dart-skill`."""
    arm = commands.add_parser(
        "arm", help="arms from their URDF: import one, and where it can throw"
    )
    verbs = arm.add_subparsers(title="verbs", required=True, metavar="VERB")
    listed = verbs.add_parser("list", help="the arms of config/arms/, and what their URDFs lack")
    listed.add_argument("--json", action="store_true", help="JSON instead of text")
    listed.set_defaults(run=_list)
    _add_import(verbs)
    _add_reach(verbs)


def _add_import(verbs: argparse._SubParsersAction) -> None:
    parser = verbs.add_parser(
        "import", help="write the file of an arm from its URDF, with what the URDF does not say"
    )
    parser.add_argument(
        "urdf", metavar="URDF", help="a file, or package://PACKAGE/PATH of a ROS or Python package"
    )
    parser.add_argument(
        "--base", metavar="LINK", help="where the arm is mounted (default: the root)"
    )
    parser.add_argument(
        "--tool", metavar="LINK", help="whose z axis points out of the hand (default: it is asked)"
    )
    parser.add_argument(
        "--mount-height", type=float, default=0.8, metavar="M",
        help="of the base above the floor (default 0.8)",
    )  # fmt: skip
    parser.add_argument(
        "--output", type=Path, metavar="FILE", help="(default: the URDF's name with .yaml)"
    )
    parser.set_defaults(run=_import)


def _add_reach(verbs: argparse._SubParsersAction) -> None:
    parser = verbs.add_parser(
        "reach", help="where an arm can do a skill, from the limits of its joints alone"
    )
    parser.add_argument("arm", metavar="ARM", help="of config/arms/, or a file that import wrote")
    parser.add_argument("--skill", default="throw", metavar="NAME", help="(default throw)")
    parser.add_argument(
        "--rim", type=float, metavar="M", help="height of the rim that is thrown into (default: config/world.yaml)"
    )  # fmt: skip
    parser.add_argument(
        "--angle", type=float, default=45.0, metavar="DEGREES",
        help="of a throw above the horizontal (default 45)",
    )  # fmt: skip
    parser.add_argument(
        "--height", type=float, action="append", metavar="M",
        help="of a hand that points down, above the floor; may be given several times",
    )  # fmt: skip
    parser.add_argument(
        "--output", type=folder, metavar="FOLDER", help="draw the throw there, as SVG and PNG"
    )
    parser.add_argument("--json", action="store_true", help="JSON instead of text")
    parser.set_defaults(run=_reach)


def _list(options: argparse.Namespace) -> int:
    from dart_skill.arm import load_arm
    from dart_skill.common.configuration import arm_names

    rows: dict[str, dict] = {}
    for name in arm_names():
        try:
            arm = load_arm(name)
            rows[name] = {"joints": len(arm.joints), "doubts": arm.doubts()}
        except OSError as error:
            rows[name] = {"missing": f"not here: {str(error).rpartition(': ')[2]}"}
    if options.json:
        print(json.dumps(rows))
        return 0
    for name, row in rows.items():
        said = row.get("missing") or "; ".join([f"{row['joints']} joints", *row["doubts"]])
        print(f"{name}: {said}")
    return 0


def _import(options: argparse.Namespace) -> int:
    from dart_skill.arm import UrdfArm, read_urdf, urdf_ends

    text = read_urdf(options.urdf)
    root, tools = urdf_ends(text, options.urdf)
    if options.tool is None and len(tools) > 1:
        raise ValueError(f"which link is the tool? Give --tool, one of {', '.join(tools)}")
    base, tool = options.base or root, options.tool or tools[0]
    path = options.output or Path(Path(options.urdf).name).with_suffix(".yaml")
    arm = UrdfArm(path.stem, text, base, tool, mount_height=options.mount_height)
    where = options.urdf
    if not where.startswith("package://"):
        where = os.path.relpath(options.urdf, path.parent)
    with new_file(path) as stream:
        stream.write(_file_of(arm, where).encode())
    print(f"{path}: {len(arm.joints)} joints from {base} to {tool}")
    for doubt in arm.doubts():
        print(f"  doubtful: {doubt}")
    print(f"next: dart-skill arm reach {path}")
    return 0


def _file_of(arm: UrdfArm, where: str) -> str:
    """Text of the file of an arm."""
    lines = [
        f"urdf: {where}",
        f"base: {arm.base}",
        f"tool: {arm.tool}",
        f"joints: [{', '.join(joint.name for joint in arm.joints)}]",
        "grip: [0.0, 0.0, 0.0]    # where the hand holds, in the frame of the tool [m]",
        f"mount_height: {arm.mount_height}    # of the base above the floor [m]",
        *(f"# doubtful: {doubt}" for doubt in arm.doubts()),
    ]
    if arm.placeholders or any(not j.velocity > 0.0 or not j.torque > 0.0 for j in arm.joints):
        names = ", ".join(f"{joint.name}: " for joint in arm.joints)
        lines += [f"# velocity: {{{names}}}    # [rad/s]", f"# torque: {{{names}}}    # [N m]"]
    return "\n".join([*lines, *_start_of(arm)]) + "\n"


def _start_of(arm: UrdfArm) -> list[str]:
    """Lines with the posture in which a simulated arm begins: its hand points down."""
    from dart_skill.arm import pointing_posture

    try:
        angles = ", ".join(f"{angle:.4f}" for angle in pointing_posture(arm, HEIGHTS[1]))
    except ValueError as error:
        angles = ", ".join("0.0" for _ in arm.joints)
        start = f"    start_posture: [{angles}]    # [rad]; {error}"
    else:
        start = f"    start_posture: [{angles}]    # its hand points down [rad]"
    return ["parameters:", "  wam_simulator:", start]


def _reach(options: argparse.Namespace) -> int:
    from dart_skill.arm import Speed, load_arm
    from dart_skill.skills.protocol import load_skill

    arm = load_arm(options.arm)
    if load_skill(options.skill).speed == Speed.THROW:
        return _throws(options, arm)
    return _points(options, arm)


def _throws(options: argparse.Namespace, arm: UrdfArm) -> int:
    import numpy as np

    from dart_skill.arm import GUIDED_SPEED, throwing_bound
    from dart_skill.common.regions import REGION

    rim = REGION.rim if options.rim is None else options.rim
    bound = throwing_bound(arm, rim, math.radians(options.angle))
    guided = _guided(options, arm, rim)
    names = [joint.name for joint in arm.joints]
    if options.output:
        from dart_skill.figures import save, throwing_bound_figure

        save(throwing_bound_figure(arm, bound, rim), options.output, f"reach_{arm.name}")
    if options.json:
        numbers = {
            "distance_m": bound.distance,
            "speed_m_s": bound.speed,
            "release_m": bound.release.tolist(),
            "swing_s": bound.swing,
            "torque_share": bound.torque_share,
            "swinging": [names[joint] for joint in bound.plane.joints],
            "angles": dict(zip(names, bound.angles.tolist(), strict=True)),
            "rates": dict(zip(names, bound.rates.tolist(), strict=True)),
        }
        if guided is not None:
            start = guided.turned_start.tolist()
            numbers["guided_distance_m"] = guided.distance
            numbers["guided_start"] = dict(zip(names, start, strict=True))
        print(json.dumps(numbers))
        return 0
    print(
        f"{arm.name} throws {bound.distance:.2f} m at most, into a rim {rim:.2f} m high (no drag;"
        " what is learned reaches 70 to 80 % of it)"
    )
    print(
        f"  {bound.speed:.2f} m/s at {options.angle:.0f} degrees, released"
        f" {bound.release[0]:+.2f} m before the axis of the base, {bound.release[1]:.2f} m high"
    )
    print(
        f"  swinging {', '.join(names[joint] for joint in bound.plane.joints)} from rest in"
        f" {bound.swing:.1f} s; torque at most {100 * bound.torque_share:.0f} % of the limit of"
        f" {names[bound.tightest]}"
    )
    for what, values in (("starts", bound.start), ("releases", bound.angles)):
        print(f"  {what} at {np.array2string(values, precision=2, separator=', ')} rad")
    if guided is not None:
        told = np.array2string(
            guided.turned_start, precision=4, separator=", ", suppress_small=True
        )
        print(
            f"a person guides throws to {guided.distance:.2f} m, from {told} rad: over"
            f" {guided.swing:.1f} s, at {100 * GUIDED_SPEED:.0f} % of the joints' speeds"
        )
    return 0


def _guided(options: argparse.Namespace, arm: UrdfArm, rim: float) -> ThrowingBound | None:
    """The throw that a person guides it through; None where its file has one, or, with a line why,
    where there is none.
    """
    from dart_skill.arm import guided_bound
    from dart_skill.common.configuration import description_path, read_yaml
    from dart_skill.common.regions import REGION

    if "swing" in read_yaml(description_path(options.arm)):
        return None
    try:
        return guided_bound(arm, rim, REGION.side, math.radians(options.angle))
    except ValueError as error:
        print(f"no person guides a throw: {error}", file=sys.stderr)
        return None


def _points(options: argparse.Namespace, arm: UrdfArm) -> int:
    from dart_skill.arm import pointing_region

    heights = options.height or [arm.mount_height + height for height in HEIGHTS]
    rows: list[dict] = []
    for height in heights:
        try:
            near, far = pointing_region(arm, height)
            rows.append({"height_m": height, "near_m": near, "far_m": far})
        except ValueError as error:
            if len(heights) == 1:
                raise
            rows.append({"height_m": height, "reason": str(error)})
    if options.json:
        print(json.dumps(rows))
        return 0
    print(f"{arm.name} points its hand straight down, from the axis of its base:")
    for row in rows:
        where = f"{row['near_m']:.2f} to {row['far_m']:.2f} m" if "far_m" in row else "nowhere"
        print(f"  at {row['height_m']:.2f} m above the floor: {where}")
    return 0
