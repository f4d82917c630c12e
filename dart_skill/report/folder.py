"""What a run of the main job leaves behind: summary.json, report.html and pictures, made from its bag."""

from pathlib import Path

from dart_skill.report import PAGE, write_page
from dart_skill.report.run import About
from dart_skill.session.summary import DemoSummary, ThrowResult, table, write_summary

__all__ = ["DemoSummary", "ThrowResult", "table", "write_report"]


def write_report(summary: DemoSummary, bag: Path, output: Path, about: About | None = None) -> list[Path]:
    """Write summary.json, the page and every picture into `output`; returns the paths. about: what the page says of the run besides.

    The skill is learned again from the bag: the same demonstrations give the same plans to the last bit.
    """
    written = [write_summary(summary, output)]
    return written + write_page(bag, Path(output) / PAGE, about, summary.throws, figures=output)
