"""`dart-skill demonstrations`: what a graph that runs was shown so far; one can be dropped, and
restored.
"""

import argparse
from datetime import datetime
from typing import TYPE_CHECKING

from dart_skill.cli.run_options import add_namespace
from dart_skill_nodes.verbs.on_graph import PATIENCE, on_running_graph

if TYPE_CHECKING:
    from dart_skill_nodes.client.graph_client import GraphClient

NOT_A_DATE = 1e9
"""Stamps before this are times of a simulation, later ones dates [s]."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.description = (
        "What a graph that runs was shown so far. A bad demonstration is dropped by its number or"
        " id, for the learner and in the bag."
    )
    parser.add_argument(
        "task",
        nargs="?",
        choices=("list", "drop", "restore"),
        default="list",
        help="default: list",
    )
    parser.add_argument(
        "id",
        metavar="ID",
        nargs="?",
        help="of a demonstration, or its number in the list, to drop or restore it",
    )
    parser.add_argument(
        "--compare", action="store_true", help="also how far each is from what the others teach"
    )
    add_namespace(parser)
    parser.add_argument("--json", action="store_true", help="the result as JSON")


def main(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """List, drop or restore; returns the exit status."""
    if (options.id is None) != (options.task == "list"):
        parser.error(
            "drop and restore need the number or ID of one demonstration, which the list shows;"
            " the list needs none"
        )

    def task(client: "GraphClient") -> dict:
        if options.task == "list":
            return _listed(client, options.compare)
        name = id_of(client, options.id)
        text = client.drop(name, restore=options.task == "restore")
        text = text if name == options.id else text.replace(name, f"{options.id} ({name})", 1)
        told = {"text": text, "message": text, "id": name, "ok": True}
        return {**told, "next": "dart-skill learn"}

    return on_running_graph(options, lambda client: client.wait_for_learner(PATIENCE), task)


def id_of(client: "GraphClient", given: str) -> str:
    """The id of a demonstration, given that or its number in the list; ValueError for a number that
    it does not have.
    """
    if not given.isdecimal():
        return given
    shown = client.demonstrations().demonstrations
    if not 1 <= int(given) <= len(shown):
        have = f"numbers 1 to {len(shown)}" if shown else "nothing in it yet"
        raise ValueError(f"no demonstration {given}: the list has {have}")
    return shown[int(given) - 1].id


def _listed(client: "GraphClient", compare: bool) -> dict:
    from dart_skill_nodes.comms import conversions

    rows = [
        {
            "number": number,
            "id": one.id,
            "stamp": conversions.stamp_ns(one.header.stamp) * 1e-9,
            "duration": conversions.seconds(one.duration),
            **_where(one.situation),
            "dropped": bool(one.dropped),
            "readable": bool(one.readable),
            "finding": one.finding,
            **(
                {"weight": one.weight, "unlike_m": one.unlike, "outlier": bool(one.outlier)}
                if compare
                else {}
            ),
        }
        for number, one in enumerate(client.demonstrations(compare=compare).demonstrations, 1)
    ]
    text = "\n".join(map(_line, rows)) or "nothing has been shown yet"
    return {
        "text": text,
        "demonstrations": rows,
        "ok": True,
        "next": "dart-skill learn" if rows else "dart-skill teach --count 5",
    }


def _where(situation) -> dict:
    """Place of the basket of a throw; of another skill the places of all bodies."""
    from dart_skill_nodes.comms import conversions

    if list(situation.bodies) == [conversions.BASKET]:
        return {"target": conversions.target_of(situation).tolist()}
    return {"situation": conversions.situation(situation).to_json()}


def _line(row: dict) -> str:
    stamp = row["stamp"]
    when = f"{datetime.fromtimestamp(stamp):%H:%M:%S}" if stamp > NOT_A_DATE else f"{stamp:.1f} s"
    state = "dropped" if row["dropped"] else "taught" if row["readable"] else "left out"
    apart = row.get("unlike_m", float("nan"))
    unlike = (
        ""
        if apart != apart
        else (
            f"; {1e3 * apart:.0f} mm from what the others"
            f" teach{', an outlier' if row['outlier'] else ''}"
        )
    )
    told = f"{when}  {row['duration']:.2f} s  {state}: {row['finding']}{unlike}"
    return f"{row['number']:3d}  {row['id']}  {told}"
