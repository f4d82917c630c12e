"""Whether an arm, its cameras and their numbers are fit to be moved: a table of lines from what
was heard of them, go or no go.
"""

from dart_skill.arm.check._check import ArmReport, check_arm
from dart_skill.arm.check._heard import Endpoint, Grade, Heard, HeardJoints, HeardPoses, Line
from dart_skill.arm.check._joints import PostureCounter
from dart_skill.arm.check._table import as_text

__all__ = [
    "ArmReport",
    "Endpoint",
    "Heard",
    "HeardJoints",
    "Line",
    "HeardPoses",
    "PostureCounter",
    "Grade",
    "as_text",
    "check_arm",
]
