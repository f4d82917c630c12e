"""A report: one HTML page of a run, made from its bag, with tables, figures and a replay in three dimensions; without ROS."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dart_skill.report.run import About
    from dart_skill.session.summary import ThrowResult

__all__ = ["write_page"]

PAGE = "report.html"


def write_page(
    bag: str | os.PathLike,
    output: str | os.PathLike,
    about: About | None = None,
    results: Sequence[ThrowResult] | None = None,
    figures: str | os.PathLike | None = None,
) -> list[Path]:
    """Write the page of a bag to the file `output`; returns the paths of everything that was written, the page first.

    about: what is known of the run besides. results: of the arm's throws as the run judged them; judged again from the bag by default.
    figures: a folder that gets every figure as SVG and PNG, too. BagError if the bag cannot be read; then nothing is written.
    """
    from dart_skill.report.page import page_of
    from dart_skill.report.pictures import pictures, save_pictures
    from dart_skill.report.run import read_run

    run = read_run(bag, about, results)
    drawn = pictures(run)
    page, output = page_of(run, drawn), Path(output)
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(page, encoding="utf-8", newline="\n")
    return [output, *(save_pictures(drawn, figures) if figures is not None else ())]
