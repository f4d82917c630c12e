"""Teaching, learning and throwing in one process without ROS, learning from a bag, and what a run amounts to."""

from dart_skill.session._from_bag import LearnReport, find_throws, learn_from_bag
from dart_skill.session._in_process import Session, Trial
from dart_skill.session._summary import DemoSummary, ThrowResult, footer, table, write_summary

__all__ = [
    "LearnReport",
    "DemoSummary",
    "Session",
    "ThrowResult",
    "Trial",
    "find_throws",
    "footer",
    "learn_from_bag",
    "table",
    "write_summary",
]
