"""What a reader needs to understand a bag: the arm, and the parameters in force."""

from __future__ import annotations

from dart_skill.arm import the_arm, write_urdf
from dart_skill.common.configuration import arm_name, config_path, description_path
from dart_skill.recording import BagWriter

PARAMETER_FILES = (
    "world.yaml",
    "limits.yaml",
    "wam_simulator.yaml",
    "optitrack.yaml",
    "commander.yaml",
    "teacher.yaml",
)


def attach_arm(writer: BagWriter) -> None:
    """Attach the arm's description and the parameter files to a bag.

    Parameters
    ----------
    writer
        Of the bag.
    """
    arm = the_arm()
    writer.add_attachment(f"{arm.name}.urdf", write_urdf(arm), "application/xml")
    for path in (description_path(arm_name()), *map(config_path, PARAMETER_FILES)):
        writer.add_attachment(path.name, path.read_text(encoding="utf-8"), "application/yaml")
