"""What a run of the main job leaves behind: summary.json and pictures, made from its bag."""

from pathlib import Path

import numpy as np

from dart_skill.experiments.figures import (
    demonstrated_motions,
    draw_execution,
    draw_gaussians,
    draw_landings,
    draw_synchronisation,
    executed_throw,
    read_recordings,
)
from dart_skill.experiments.summary import DemoSummary, ThrowResult, table, write_summary
from dart_skill.recording import read_demonstrations
from dart_skill.skill.configuration import configuration
from dart_skill.skill.throwing import ThrowingSkill, learn

__all__ = ["DemoSummary", "ThrowResult", "table", "write_report"]


def write_report(summary: DemoSummary, bag: Path, output: Path, configuration_name: str = "") -> list[Path]:
    """Write summary.json and every picture into `output`; returns the paths.

    The skill is learned again from the bag: the same demonstrations give the same plans to the last bit.
    """
    recordings, demonstrations = read_recordings(bag), read_demonstrations(bag)
    skill = learn(demonstrations, configuration(configuration_name))
    written = [write_summary(summary, output)]
    written += draw_synchronisation(demonstrated_motions(recordings, demonstrations), output)
    written += draw_gaussians(skill, output)
    written += _draw_first_execution(summary, skill, recordings, output)
    return written + draw_landings(summary.throws, np.array([one.target for one in demonstrations]), output)


def _draw_first_execution(summary: DemoSummary, skill: ThrowingSkill, recordings: list, output: Path) -> list[Path]:
    """The first throw that was really made; a refused or stopped one has nothing to draw."""
    for throw in summary.throws:
        try:
            return draw_execution(executed_throw(recordings, skill.plan(np.array(throw.target))), output)
        except ValueError:
            continue
    return []
