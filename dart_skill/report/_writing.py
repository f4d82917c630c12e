"""Writing the page of a bag, and what a run of the main job leaves behind."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from dart_skill.common.files import new_file
from dart_skill.report._page import page_of
from dart_skill.report._pictures import pictures, save_pictures
from dart_skill.report._run import About, read_run
from dart_skill.report._skill_page import skill_page_of, skill_pictures
from dart_skill.report._skill_run import read_skill_run
from dart_skill.session import DartsSummary, DemoSummary, SkillSummary, ThrowResult, write_summary
from dart_skill.skills.protocol import Skill

PAGE = "report.html"


def write_page(
    bag: str | os.PathLike,
    output: str | os.PathLike,
    about: About | None = None,
    results: Sequence[ThrowResult] | None = None,
    figures: str | os.PathLike | None = None,
) -> list[Path]:
    """Write the page of a bag to the file `output`; returns the paths of everything that was
    written, the page first.

    about: what is known of the run besides. results: of the arm's throws as the run judged them;
    judged again from the bag by default. figures: a folder that gets every figure as SVG and PNG,
    too. BagError if the bag cannot be read; then nothing is written.
    """
    run, output = read_run(bag, about, results), Path(output)
    drawn = pictures(run)
    page = page_of(run, drawn)
    output.parent.mkdir(parents=True, exist_ok=True)
    with new_file(output, replace=True) as file:
        file.write(page.encode())
    return [output, *(save_pictures(drawn, figures) if figures is not None else [])]


def write_skill_report(
    summary: SkillSummary | DartsSummary, skill: Skill, output: Path, about: About
) -> list[Path]:
    """Write summary.json, the page and every picture of a run of any other skill into `output`;
    returns the paths.

    about: what is known besides.
    """
    of = summary.of if isinstance(summary, DartsSummary) else summary
    written = [write_summary(summary, output)]
    leg = summary.leg if isinstance(summary, DartsSummary) else None
    then = [f"501, dart {number}" for number in range(1, 1 + len(leg.darts))] if leg else []
    run = read_skill_run(of.bag, skill, about, of.trials, then)
    drawn = skill_pictures(run, summary)
    content, path = skill_page_of(run, drawn, summary), Path(output) / PAGE
    with new_file(path, replace=True) as file:
        file.write(content.encode())
    return [*written, path, *save_pictures(drawn, output)]


def write_report(
    summary: DemoSummary, bag: Path, output: Path, about: About | None = None
) -> list[Path]:
    """Write summary.json, the page and every picture into `output`; returns the paths.

    about: what the page says of the run besides.

    The skill is learned again from the bag: the same demonstrations give the same plans to the
    last bit.
    """
    written = [write_summary(summary, output)]
    return written + write_page(bag, Path(output) / PAGE, about, summary.throws, output)
