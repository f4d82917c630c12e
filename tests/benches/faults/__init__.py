"""`dart-skill experiment faults`: injects faults into the real graph, one by one, and judges what
comes of each.
"""

import argparse
import json
import tempfile
from pathlib import Path

from dart_skill.cli.run_options import folder
from dart_skill_nodes.process.environment import choose_domain
from dart_skill_nodes.process.graph_processes import GraphFailure
from dart_skill_nodes.verbs.on_graph import say
from tests.benches.faults.cases import SKILLS, THROW_SKILL, named


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Inject faults into the real graph, one by one: nodes, messages, disks, strangers. Judge"
        " what comes of it."
    )
    only = "only cases whose names hold one of these texts (default: all, which takes 50 minutes)"
    parser.add_argument(
        "--skill",
        metavar="NAME",
        choices=(THROW_SKILL, *SKILLS),
        default=THROW_SKILL,
        help=f"whose cases: {', '.join((THROW_SKILL, *SKILLS))} (default {THROW_SKILL})",
    )
    parser.add_argument("--case", metavar="TEXT", nargs="+", default=[""], help=only)
    parser.add_argument(
        "--list", action="store_true", help="the names of the cases, and nothing else"
    )
    parser.add_argument(
        "--output",
        type=folder,
        help="folder for bags and logs (default: a new one, which is taken away at the end)",
    )
    parser.add_argument(
        "--bag",
        type=Path,
        default=Path("bags/demonstrations"),
        help="what is replayed (default bags/demonstrations)",
    )
    parser.add_argument(
        "--page", type=Path, metavar="FILE", help="write the table as a page, too: docs/faults.md"
    )
    parser.add_argument("--json", action="store_true", help="JSON instead of the table")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the cases; exit status 1 if one of them is not as it must be."""
    cases = named(*options.case, skill=options.skill)
    if options.list:
        names = [case.name for case in cases]
        print(json.dumps(names) if options.json else "\n".join(names))
        return 0
    if options.page and options.skill != THROW_SKILL:
        parser.error(f"--page is that of throws: leave out --skill {options.skill}, or --page")
    if options.output and options.output.exists() and any(options.output.iterdir()):
        parser.error(f"--output {options.output} is not empty: name a new folder")
    choose_domain()
    import rclpy

    from tests.benches.faults.bench import run_all
    from tests.benches.faults.reactions import as_json, page

    rclpy.init(args=[])
    try:
        with tempfile.TemporaryDirectory(prefix="faults_") as temporary:
            reactions, usual = run_all(
                cases, (options.output or Path(temporary)).resolve(), options.bag, say
            )
    except GraphFailure as failure:
        say(f"the graph did not start: {failure}")
        return 1
    finally:
        rclpy.try_shutdown()
    table = page(reactions, usual)
    if options.page:
        options.page.write_text(table, encoding="utf-8")
    print(
        json.dumps([as_json(one, usual) for one in reactions], indent=1) if options.json else table
    )
    return int(any(one.faults(usual) for one in reactions))
