"""`dart-skill status`: the graph that runs, as a person reads it."""

import argparse
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.printable import printable
from dart_skill.cli.run_options import add_namespace
from dart_skill_nodes.client.graph_report import GraphReport, NodeReport
from dart_skill_nodes.comms.names import ADDRESS_FILE, GUIDING
from dart_skill_nodes.process.environment import Interrupts, stay_on_this_machine
from dart_skill_nodes.verbs.on_graph import say

if TYPE_CHECKING:
    from rclpy.node import Node

USUAL = 2.5
"""Every node tells its status once a second [s]."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "Listens to the graph that runs, moves nothing, and prints its nodes, topics, limits, and"
        " who commands the arm. Exit status 0 if nothing is wrong, else 1; what a node only warns"
        " of is not wrong."
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=USUAL,
        metavar="S",
        help=f"listen for so long [s] (default {USUAL:g})",
    )
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the same as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Look and tell; returns the exit status."""
    if not (0.0 < options.duration < math.inf):
        parser.error(f"--duration is {options.duration}; it must be positive and finite")
    stay_on_this_machine()
    report = look(options.duration, options.namespace)
    if report is None or not report.nodes:
        problem = nothing_runs(() if report is None else report.bystanders)
        if options.json:
            print(json.dumps({"ok": False, "problems": [problem]}))
        else:
            say(f"dart-skill status: {problem}")
        return 1
    report = with_pages(report)
    print(json.dumps(as_json(report)) if options.json else as_text(report))
    return 1 if report.problems else 0


def nothing_runs(bystanders: Iterable[str]) -> str:
    """What to say where no node of the graph is found; bystanders: who else is there."""
    from dart_skill_nodes.client.graph_listener import this_domain

    others = printable(", ".join(bystanders))
    there = f", only {others}" if others else ""
    return (
        f"nothing runs in ROS domain {this_domain()} on this machine{there}: 'dart-skill up'"
        " starts it, or set ROS_DOMAIN_ID"
    )


def look(seconds: float, namespace: str = "") -> GraphReport | None:
    """What is found in a namespace in so long [s]; None if there is nothing."""
    interrupts = Interrupts()  # before the imports, in which an interrupt may get lost
    from dart_skill_nodes.process.node_base import node_of_command

    with node_of_command("status", namespace) as (node, spin):

        def spin_a_moment() -> None:
            if interrupts:
                raise KeyboardInterrupt
            spin(0.02)

        return _look(node, spin_a_moment, seconds)


def _look(node: "Node", spin, seconds: float) -> GraphReport | None:
    from dart_skill_nodes.client.graph_listener import GraphListener, this_domain
    from dart_skill_nodes.client.service_calls import APPEARS

    listener = GraphListener(node, spin)
    try:
        if not listener.find(APPEARS):
            return None
        listener.listen(seconds)
        return listener.report(this_domain())
    finally:
        listener.close()


def with_pages(report: GraphReport) -> GraphReport:
    """The report with the whole address of a viewer's page, token included, where this user may
    read the file in which the viewer keeps it.
    """
    return replace(report, nodes=tuple(map(_with_page, report.nodes)))


def _with_page(node: NodeReport) -> NodeReport:
    address = node.values.get("address", "")
    try:
        whole = Path(node.values.get(ADDRESS_FILE, "")).read_text().strip()
    except (OSError, ValueError):  # it runs on another machine, or another user's
        return node
    is_it = address and whole.startswith(f"{address}/") and whole.isprintable()
    return replace(node, says=whole) if is_it else node


def as_json(report: GraphReport) -> dict:
    """The report with what is derived from it."""
    derived = {
        "ok": not report.problems,
        "problems": report.problems,
        "commanders": report.commanders,
        "refusals": report.refusals,
    }
    return {**derived, **asdict(report)}


def as_text(report: GraphReport) -> str:
    """The report as tables and lines."""
    parts = [
        _heading(report),
        _nodes(report),
        _topics(report),
        _arm(report),
        _limits(report),
        _refusals(report),
        _problems(report),
    ]
    # nodes of strangers may say anything
    return printable("\n\n".join(part for part in parts if part))


def _heading(report: GraphReport) -> str:
    processes = len({node.process for node in report.nodes if node.process})
    where = f"ROS domain {report.domain}{', ' if report.namespace else ''}{report.namespace}"
    text = (
        f"{where}: {len(report.nodes)} nodes in {processes} processes, listened to for"
        f" {report.seconds:.1f} s"
    )
    return text + (f"; also there: {', '.join(report.bystanders)}" if report.bystanders else "")


def _nodes(report: GraphReport) -> str:
    rows = [(one.name, one.process, one.state, one.says) for one in report.nodes]
    return "\n".join(table(("node", "process", "state", "says"), rows))


def _topics(report: GraphReport) -> str:
    rows = [
        (
            one.topic,
            f"{one.rate:.1f}",
            "none" if one.age is None else f"{one.age:.2f}",
            str(one.lost),
            ", ".join(one.publishers),
        )
        for one in report.topics
    ]
    head = ("topic", "per second", "newest [s]", "lost", "published by")
    return "\n".join(table(head, rows)) if rows else ""


def _arm(report: GraphReport) -> str:
    commander, pushes = report.node("commander"), report.topic(GUIDING)
    lines = [f"commanded by   {', '.join(report.commanders) or 'nobody'}"]
    if commander is not None and "mode" in commander.values:
        lines.append(
            f"commander      {commander.values['mode']}; last:"
            f" {commander.values.get('last') or 'nothing'}"
        )
    lines.append(
        "guided by     "
        f" {', '.join(pushes.publishers) if pushes is not None and pushes.rate else 'nobody'}"
    )
    bridge = report.node("effort_bridge")
    if report.safety is not None:
        lines.append(
            "safety module "
            f" {report.safety[0]}{f': {report.safety[1]}' if report.safety[1] else ''}"
        )
    elif bridge is not None:
        lines.append(f"effort bridge  {bridge.says}")
    else:
        lines.append(f"safety module  not told: nobody publishes {report.namespace}/wam/safety")
    return "\n".join(lines)


def _limits(report: GraphReport) -> str:
    if not report.limits:
        return ""
    name, limits = next(iter(report.limits.items()))
    return "\n".join(
        [
            f"limits, as {name} has them",
            *(f"  {limit:18s} {_number(value)}" for limit, value in limits.items()),
        ]
    )


def _number(value) -> str:
    return ", ".join(f"{one:g}" for one in value) if isinstance(value, list) else f"{value:g}"


def _refusals(report: GraphReport) -> str:
    return (
        "\n".join(
            [
                "refused so far",
                *(f"  {place}: {count}" for place, count in report.refusals.items()),
            ]
        )
        if report.refusals
        else ""
    )


def _problems(report: GraphReport) -> str:
    return "\n".join(f"wrong: {problem}" for problem in report.problems) or "nothing is wrong"


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Lines of a table, whose columns are as wide as what stands in them."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
