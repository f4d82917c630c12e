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
from dart_skill.common.files import new_file

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
    from dart_skill.recording import SKILL, skill_of
    from dart_skill.skills.learning import configuration

    need("matplotlib")
    bag = options.bag / "bag" if (options.bag / "bag" / "metadata.yaml").is_file() else options.bag
    configuration(
        options.configuration
    )  # a name that is not known is told before anything is waited for
    output = options.output or page_beside(bag)
    if output.exists():
        raise ValueError(f"{output} exists already: name another file with --output")
    if (name := skill_of(bag)) == SKILL:
        return _report_of_throws(bag, output, options)
    return _report_of_skill(bag, name, output, options.json)


def _report_of_throws(bag: Path, output: Path, options: argparse.Namespace) -> int:
    """The page of a bag of throws at baskets; returns the exit status."""
    from dart_skill.report import About, page_of, pictures, read_run

    run = read_run(
        bag,
        About(f"Throws of the bag '{bag.resolve().name}'", configuration=options.configuration),
    )
    page = page_of(run, pictures(run))
    output.parent.mkdir(parents=True, exist_ok=True)
    with new_file(output) as file:
        file.write(page.encode())
    print(
        json.dumps(_as_json(run, output), indent=1)
        if options.json
        else printable(_as_text(run, output))
    )
    return 0


def _report_of_skill(bag: Path, name: str, output: Path, as_json: bool) -> int:
    """The page of a bag of another skill than throws at baskets."""
    from dart_skill.report import About, read_skill_run, skill_page_of, skill_pictures
    from dart_skill.skills.protocol import load_skill

    tell_bag_faults(bag)
    run = read_skill_run(
        bag, load_skill(name), About(f"{name.capitalize()}: the bag '{bag.resolve().name}'")
    )
    content = skill_page_of(run, skill_pictures(run, None))
    output.parent.mkdir(parents=True, exist_ok=True)
    with new_file(output) as file:
        file.write(content.encode())
    own = sum(not one.guided for one in run.movements)
    told = {
        "skill": name,
        "bag": os.fspath(run.bag),
        "report": os.fspath(output),
        "demonstrations": [one.id for one in run.shown],
    }
    lines = [
        f"{name}: {len(run.shown)} demonstrations, {own} movements of the arm's own",
        f"report: {output}",
        f"next: dart-skill view {shlex.quote(str(bag))}",
    ]
    print(
        json.dumps({**told, "own": own, "notes": list(run.notes)}, indent=1)
        if as_json
        else "\n".join(lines)
    )
    return 0


def _as_json(run: Run, output: Path) -> dict:
    return {
        "bag": os.fspath(run.bag),
        "report": os.fspath(output),
        "demonstrations": [one.id for one in run.shown],
        "throws": [throw.to_json() for throw in run.results],
        "notes": list(run.notes),
    }


def _as_text(run: Run, output: Path) -> str:
    from dart_skill.recording.imports import fault_lines
    from dart_skill.session import footer

    lines = fault_lines(
        fault for fault in run.recording.faults if not (fault.repaired or fault.is_information)
    )
    lines += [
        f"{len(run.shown)} demonstrations, {len(run.results)} throws of the arm:"
        f" {footer(run.results)}"
    ]
    lines += [
        f"report: {output}, {output.stat().st_size / 1e6:.1f} MB",
        f"next: dart-skill view {shlex.quote(str(run.bag))}",
    ]
    return "\n".join(lines)
