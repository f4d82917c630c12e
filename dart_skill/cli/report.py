"""`dart-skill report`: the page of a bag."""

from __future__ import annotations

import argparse
import json
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.printable import printable, tell_bag_faults
from dart_skill.common.extras import need
from dart_skill.common.words import counted

if TYPE_CHECKING:
    from dart_skill.report import Run


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `report` to the commands of `dart-skill`."""
    parser = commands.add_parser(
        "report", help="one HTML page of a bag: tables, figures, and a replay in three dimensions"
    )
    parser.add_argument(
        "bag",
        metavar="BAG",
        type=Path,
        help="rosbag2 folder or .mcap file, or the folder in which a run left its bag",
    )
    parser.add_argument(
        "--output",
        metavar="FILE.html",
        type=Path,
        help="default: beside the bag, NAME_report.html, or report.html of a bag called 'bag'",
    )
    parser.add_argument(
        "--configuration",
        default="",
        help="of the skill that is learned again from the bag (default: default)",
    )
    parser.add_argument(
        "--json", action="store_true", help="the throws, and what was written, as JSON"
    )
    parser.set_defaults(run=_report)


def page_beside(bag: Path) -> Path:
    """Where the page of a bag goes by default."""
    bag = bag.resolve()
    return bag.parent / ("report.html" if bag.name == "bag" else f"{bag.stem}_report.html")


def _report(options: argparse.Namespace) -> int:
    from dart_skill.skills.learning import configuration

    need("matplotlib")
    bag = options.bag / "bag" if (options.bag / "bag" / "metadata.yaml").is_file() else options.bag
    configuration(options.configuration)  # an unknown name is told before anything is waited for
    output = options.output or page_beside(bag)
    if output.exists():
        raise ValueError(f"{output} exists already: name another file with --output")
    from dart_skill.recording import skill_of
    from dart_skill.report import About, read_run, write_page

    title = f"{skill_of(bag).capitalize()}: the bag '{bag.resolve().name}'"
    run = read_run(bag, About(title, configuration=options.configuration))
    if run.throws is None:
        tell_bag_faults(bag)
    write_page(run, output)
    if options.json:
        print(json.dumps(_as_json(run, output), indent=1))
    else:
        print(printable(_as_text(run, output)))
    return 0


def _as_json(run: Run, output: Path) -> dict:
    throws = [one.to_json_of_throw() for one in run.trials] if run.throws else None
    return {
        "skill": run.skill.name,
        "bag": os.fspath(run.bag),
        "report": os.fspath(output),
        "demonstrations": [one.id for one in run.shown],
        "own": len(run.own),
        **({} if throws is None else {"throws": throws}),
        "notes": list(run.notes),
    }


def _as_text(run: Run, output: Path) -> str:
    from dart_skill.recording.imports import fault_lines
    from dart_skill.session import throws_in_a_line

    shown = counted(len(run.shown), "demonstration")
    if run.throws:
        faults = (one for one in run.throws.recording.faults if not one.is_information)
        lines = fault_lines(one for one in faults if not one.repaired)
        own = f"{counted(len(run.trials), 'throw')} of the arm: {throws_in_a_line(run.trials)}"
        lines += [f"{shown}, {own}"]
    else:
        lines = [f"{run.skill.name}: {shown}, {len(run.own)} movements of the arm's own"]
    lines += [
        f"report: {output}, {output.stat().st_size / 1e6:.1f} MB",
        f"next: dart-skill view {shlex.quote(str(run.bag))}",
    ]
    return "\n".join(lines)
