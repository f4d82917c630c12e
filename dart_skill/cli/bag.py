"""`dart-skill bag`: what is in a bag, whether it is whole, what can be made of a damaged or
foreign one, and playing it.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from dataclasses import asdict
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli import _bag_convert, graph_verbs
from dart_skill.cli.printable import printable

if TYPE_CHECKING:
    from dart_skill.recording.bags import Recovery

LONG_AGO_NS = 10**17
"""Log times before it (March 1973) are those of a simulation."""


def add_to(commands: argparse._SubParsersAction) -> None:
    """Add `bag` with its verbs to the commands of `dart-skill`."""
    bag = commands.add_parser(
        "bag", help="what is in a recording, whether it is whole; recover, convert, play it"
    )
    verbs = bag.add_subparsers(title="verbs", required=True, metavar="VERB")
    _add_info(verbs)
    _add_check(verbs)
    _add_recover(verbs)
    _bag_convert.add_to(verbs)
    graph_verbs.add_to(verbs, "play")


def _add_info(verbs: argparse._SubParsersAction) -> None:
    parser = verbs.add_parser("info", help="size, time, topics, types, quality of service")
    _add_bags(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="an object instead of text, or a list of them for several bags",
    )
    parser.set_defaults(run=_info)


def _add_check(verbs: argparse._SubParsersAction) -> None:
    parser = verbs.add_parser(
        "check",
        help="read every byte and decode every message; exit status 1 if something is wrong",
    )
    _add_bags(parser)
    parser.add_argument(
        "--definitions",
        metavar="FOLDER",
        type=Path,
        action="append",
        default=[],
        help="of .msg files of types that the bag lacks",
    )
    parser.add_argument("--json", action="store_true", help="the findings as a list")
    parser.set_defaults(run=_check)


def _add_recover(verbs: argparse._SubParsersAction) -> None:
    parser = verbs.add_parser(
        "recover", help="a new bag of what can be read of a damaged one, which is not changed"
    )
    parser.add_argument(
        "bag",
        metavar="BAG",
        type=Path,
        help="bag folder, with or without metadata.yaml, .mcap or .db3 file",
    )
    text = (
        "folder of the new bag, which must not exist (default: <name>_recovered in the working"
        " directory)"
    )
    parser.add_argument("--output", metavar="FOLDER", type=Path, help=text)
    parser.add_argument("--json", action="store_true", help="what was kept and lost as JSON")
    parser.set_defaults(run=_recover)


def _add_bags(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        type=Path,
        help="bag folder, with or without metadata.yaml, .mcap or .db3 file",
    )


# info


def _info(options: argparse.Namespace) -> int:
    from dart_skill.recording.bags import describe

    told, single = [], len(options.bags) == 1
    for path in options.bags:
        try:
            told.append(describe(path, with_definitions=options.json))
        except (ValueError, OSError) as error:
            if single:
                raise
            print(f"dart-skill: {printable(str(error))}", file=sys.stderr)
            told.append({"path": str(path), "error": str(error)})
    readable = [one for one in told if "error" not in one]
    if options.json:
        print(json.dumps(told[0] if single else told, indent=1))
    elif readable:
        print("\n\n".join(printable(_info_text(one)) for one in readable))
        if single:
            print(f"\nnext: dart-skill bag check {shlex.quote(str(options.bags[0]))}")
    return int(len(readable) < len(told))


def _info_text(told: dict) -> str:
    """The block about the bag, and a line for each topic."""
    distribution = f"ROS {told['ros_distro']}" if told["ros_distro"] else ""
    rows = [
        ("path", [told["path"]]),
        (
            "storage",
            [", ".join(filter(None, [told["storage"], told["compression"], distribution]))],
        ),
        ("size", [_size(told["size_bytes"])]),
        ("duration", [f"{told['duration_ns'] * 1e-9:.3f} s"]),
        ("start", [_instant(told["start_ns"])]),
        ("end", [_instant(told["end_ns"])]),
        ("messages", [str(told["message_count"])]),
        ("lost", [_lost_text(told["lost"])]),
        ("splits", [_file_text(file) for file in told["files"]]),
        (
            "custom data",
            [
                f"{name}: {_short(text)}"
                for name, text in told["custom_data"].items()
                if name != "lost"
            ],
        ),
        (
            "attachments",
            [
                f"{one['name']} ({one['media_type']}, {_size(one['size_bytes'])})"
                for one in told["attachments"]
            ],
        ),
        (
            "metadata",
            (
                []
                if told["has_metadata_file"]
                else ["no metadata.yaml: what is said here comes from the file itself"]
            ),
        ),
    ]
    lines = [
        f"{name + ':' if not k else '':<14}{value}"
        for name, values in rows
        for k, value in enumerate(values)
    ]
    return "\n".join([*lines, "", *_topic_table(told["topics"])])


def _lost_text(lost: dict | None) -> str:
    if lost is None:
        return "not known: the recorder does not say"
    return ", ".join(f"{count} on {topic}" for topic, count in lost.items()) or "0"


def _file_text(file: dict) -> str:
    if file["message_count"] is None:
        return f"{file['path']}  {_size(file['size_bytes'])}"
    return (
        f"{file['path']}  {_size(file['size_bytes'])}, {file['duration_ns'] * 1e-9:.3f} s,"
        f" {file['message_count']} messages"
    )


def _topic_table(topics: list[dict]) -> list[str]:
    head = ("topic", "type", "count", "Hz", "QoS", "type hash")
    rows = [
        (
            one["name"],
            ", ".join([one["type"] or "?", *one["other_types"]]),
            str(one["count"]),
            f"{one['rate_hz']:.1f}",
            _qos_text(one["qos"]),
            one["type_hash"][:15] or "-",  # RIHS01_ and eight of its 64 digits
        )
        for one in sorted(topics, key=lambda one: one["name"])
    ]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    lines = []
    for row in (head, *rows):
        cells = [
            text.rjust(width) if k in (2, 3) else text.ljust(width)
            for k, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines


def _qos_text(profiles: list[dict]) -> str:
    """What differs from publisher to publisher only once."""
    texts = []
    for profile in profiles:
        latched = ["latched"] if profile["durability"] == "transient_local" else []
        depth = {"keep_last": [f"last {profile['depth']}"], "keep_all": ["all"]}.get(
            profile["history"], []
        )
        texts.append(", ".join([profile["reliability"].replace("_", " "), *latched, *depth]))
    return " | ".join(dict.fromkeys(texts)) or "-"


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= 100 else line[:97] + "..."


def _size(n_bytes: int) -> str:
    for factor, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if n_bytes >= factor:
            return f"{n_bytes / factor:.1f} {unit}"
    return f"{n_bytes} B"


def _instant(stamp_ns: int) -> str:
    """Date and seconds, or only seconds for the clock of a simulation."""
    seconds = f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d} s"
    if not LONG_AGO_NS <= stamp_ns < 2**63:
        return seconds
    date = datetime.fromtimestamp(stamp_ns // 10**9, timezone.utc)
    return f"{date:%Y-%m-%d %H:%M:%S}.{stamp_ns // 10**6 % 1000:03d} UTC ({seconds})"


# check


def _check(options: argparse.Namespace) -> int:
    from dart_skill.recording import typestore
    from dart_skill.recording.bags import check_bag

    types = typestore(*options.definitions)
    found = {path: check_bag(path, types) for path in dict.fromkeys(options.bags)}
    if options.json:
        print(
            json.dumps(
                [
                    {"bag": str(path), **asdict(one)}
                    for path, findings in found.items()
                    for one in findings
                ],
                indent=1,
            )
        )
    else:
        for path, findings in found.items():
            print("\n".join(map(printable, [*map(str, findings), _verdict(path, findings)])))
        damaged = [
            path
            for path, findings in found.items()
            if any(one.severity == "error" and "bag recover" in one.remedy for one in findings)
        ]
        if damaged:
            print(f"next: dart-skill bag recover {shlex.quote(str(damaged[0]))}")
    return int(any(one.severity == "error" for findings in found.values() for one in findings))


def _verdict(path: Path, findings: list) -> str:
    counts = {
        severity: sum(one.severity == severity for one in findings)
        for severity in ("error", "warning", "note")
    }
    told = ", ".join(
        f"{count} {severity}{'s' * (count > 1)}" for severity, count in counts.items() if count
    )
    return f"{path}: {told or 'nothing is wrong with it'}"


# recover


def _recover(options: argparse.Namespace) -> int:
    from dart_skill.recording.bags import recover

    result = recover(
        options.bag, options.output or Path(f"{options.bag.resolve().stem}_recovered")
    )
    print(
        json.dumps(_recovery_json(result), indent=1)
        if options.json
        else printable(_recovery_text(result))
    )
    return int(not (sum(result.messages.values()) or result.n_attachments or result.is_complete))


def _recovery_text(result: Recovery) -> str:
    kept = sum(result.messages.values())
    lines = [
        *result.notes,
        *map(str, result.places),
        *(f"repaired: {text}" for text in result.repairs),
        _looked_at(result),
    ]
    between = ""
    if result.start_ns is not None and result.end_ns is not None:
        between = f", from {_instant(result.start_ns)} to {_instant(result.end_ns)}"
    lines.append(f"{kept} messages on {len(result.messages)} topics kept{between}")
    if result.unverified:
        lines.append(f"{result.unverified} of them have no CRC that vouches for them")
    lines.append(_loss_text(result))
    lines.append(f"new bag: {result.path}")
    lines.append(f"next: dart-skill bag info {shlex.quote(str(result.path))}")
    return "\n".join(lines)


def _looked_at(result: Recovery) -> str:
    """How much was looked at, and how much of that is damaged."""
    share = 100.0 * result.n_looked_at / result.n_bytes if result.n_bytes else 100.0
    damaged = sum(place.n_bytes for place in result.places)
    return (
        f"looked at {result.n_looked_at} of {result.n_bytes} bytes ({share:.4g} %); {damaged}"
        " bytes of them are damaged or left out"
    )


def _loss_text(result: Recovery) -> str:
    """What was lost, as far as anybody knows."""
    unseen = "what the recorder had not handed over when it stopped leaves no trace"
    if result.is_complete and not result.places:
        return "complete: nothing is lost"
    if result.is_complete:
        return f"complete: no message that was in it is lost; {unseen}"
    least = "" if result.is_exact else "at least "
    lost = ", ".join(
        f"{least}{count} messages on {topic}" for topic, count in result.lost.items()
    ) or _places_text(result)
    chunks = (
        f"; {result.lost_chunks} chunks and {result.lost_bytes} bytes left out"
        if result.lost_bytes
        else ""
    )
    return f"lost: {lost}{chunks}; {unseen}"


def _places_text(result: Recovery) -> str:
    """What the places tell where the topics tell nothing."""
    count = sum(place.messages or 0 for place in result.places)
    return (
        f"at least {count} messages, of unknown topics"
        if count
        else "it is not known how many messages"
    )


def _recovery_json(result: Recovery) -> dict:
    plain = asdict(result) | {
        "path": str(result.path),
        "is_complete": result.is_complete,
        "lost_bytes": result.lost_bytes,
    }
    return plain | {"message_count": sum(result.messages.values())}
