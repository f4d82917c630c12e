"""What a reader needs to understand a bag: the arm, and the parameters in force."""

from __future__ import annotations

from dart_skill.arm import wam_description, write_urdf
from dart_skill.common.configuration import config_path
from dart_skill.recording import BagWriter

PARAMETER_FILES = (
    "world.yaml",
    "limits.yaml",
    "wam.yaml",
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
    writer.add_attachment("wam.urdf", write_urdf(wam_description()), "application/xml")
    for name in PARAMETER_FILES:
        writer.add_attachment(
            name, config_path(name).read_text(encoding="utf-8"), "application/yaml"
        )
