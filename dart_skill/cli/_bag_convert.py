"""`dart-skill bag convert`: a recording in another form: a bag of ours, a dataset for LeRobot,
tables.
"""

from __future__ import annotations

import argparse
import json
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.cli.mapping_option import add_mapping, settle_mapping
from dart_skill.cli.printable import printable, tell_bag_faults

if TYPE_CHECKING:
    from dart_skill.recording.imports import RecordingMapping, ThrowRecording
    from dart_skill.session import ExportedDataset

ENDINGS = {"bag": "converted", "sqlite": "sqlite", "lerobot": "lerobot", "csv": "csv"}
"""What a recording can be made into, and how the new folder's name ends."""
STORAGES = {"bag": "mcap", "sqlite": "sqlite3"}
"""Formats of the files of a bag."""
OF_LEROBOT = {
    "--fps": "fps",
    "--video": "video",
    "--with-throws": "with_throws",
    "--without": "without",
    "--action": "action",
}


def add_to(verbs: argparse._SubParsersAction) -> None:
    """Add `convert` to the verbs of `dart-skill bag`."""
    parser = verbs.add_parser(
        "convert",
        help=(
            "a recording, ours or another laboratory's, as a bag of ours, a LeRobot dataset, CSV"
            " files"
        ),
    )
    parser.add_argument(
        "source", metavar="SOURCE", type=Path, help="bag, or a folder with CSV files"
    )
    add_mapping(parser)
    text = "what is made of it (default: a bag of ours; sqlite: the same in files of SQLite)"
    parser.add_argument("--to", choices=list(ENDINGS), default="bag", help=text)
    text = (
        "new folder, which must not exist (default: <name>_converted, _sqlite, _lerobot or _csv in"
        " the working directory)"
    )
    parser.add_argument("--output", metavar="FOLDER", type=Path, help=text)
    parser.add_argument(
        "--json", action="store_true", help="what was written and what was wrong as JSON"
    )
    group = parser.add_argument_group("to lerobot")
    group.add_argument(
        "--fps",
        type=int,
        metavar="N",
        help="frames per second (default 100, as the cameras of config/optitrack.yaml)",
    )
    group.add_argument(
        "--video",
        action="store_true",
        help="with rendered pictures of arm and bodies, as observation.images.scene",
    )
    group.add_argument(
        "--with-throws",
        action="store_true",
        help="also misses and the arm's own throws at baskets",
    )
    text = (
        "what a policy shall do: commands (default), what the arm was told, or pose, where the hand"
        " is in the next frame"
    )
    group.add_argument("--action", choices=("commands", "pose"), help=text)
    text = (
        "leave this demonstration out, named by its id or its number; may be given several times"
        " (those that were dropped are left out anyway)"
    )
    group.add_argument("--without", metavar="ID", action="append", default=[], help=text)
    parser.set_defaults(run=_convert)


def _convert(options: argparse.Namespace) -> int:
    from dart_skill.recording.imports import load_mapping

    output = options.output or Path(f"{options.source.resolve().stem}_{ENDINGS[options.to]}")
    if given := [
        name for name, key in OF_LEROBOT.items() if getattr(options, key) not in (None, False, [])
    ]:
        if options.to != "lerobot":
            raise ValueError(f"{given[0]} is for '--to lerobot': add this, or leave it out")
    if output.exists():
        raise FileExistsError(
            f"{output} exists already: nothing is ever overwritten, name another folder with"
            " --output"
        )
    settle_mapping(options, options.source, options.source.resolve().stem)
    mapping = load_mapping(options.mapping) if options.mapping else None
    text, told = {"bag": _to_bag, "sqlite": _to_bag, "lerobot": _to_lerobot, "csv": _to_csv}[
        options.to
    ](options, output, mapping)
    print(json.dumps(told, indent=1) if options.json else printable(text))
    return 0


def _to_bag(
    options: argparse.Namespace, output: Path, mapping: RecordingMapping | None
) -> tuple[str, dict]:
    from dart_skill.recording.imports import convert

    recording = convert(options.source, output, mapping, storage=STORAGES[options.to])
    lines = [
        _recording_text(recording),
        f"new bag: {output}",
        f"next: dart-skill learn {shlex.quote(str(output))}",
    ]
    return "\n".join(lines), _recording_json(recording, output)


def _to_csv(
    options: argparse.Namespace, output: Path, mapping: RecordingMapping | None
) -> tuple[str, dict]:
    from dart_skill.recording import HAND, skill_of
    from dart_skill.recording.imports import MAPPING, bodies_to_csv, throws_to_csv
    from dart_skill.skills.protocol import load_skill

    skill = load_skill(skill_of(options.source))
    if mapping or skill.cuts_itself:
        recording = throws_to_csv(options.source, output, mapping)
        folder = shlex.quote(str(output))
        lines = [
            _recording_text(recording),
            f"new folder: {output}",
            f"next: dart-skill learn {folder} --mapping {folder}/{MAPPING}",
        ]
        return "\n".join(lines), {
            **_recording_json(recording, output),
            "mapping": str(output / MAPPING),
        }
    tell_bag_faults(options.source)
    rows = bodies_to_csv(options.source, output, (HAND, *skill.bodies))
    lines = [
        ", ".join(f"{file}: {count} rows" for file, count in rows.items()),
        f"new folder: {output}",
    ]
    lines.append(
        "only throws at baskets are learned from CSV files: 'dart-skill learn' takes the bag, or a"
        " dataset of '--to lerobot'"
    )
    return "\n".join(lines), {"path": str(output), "skill": skill.name, "rows": rows}


def _to_lerobot(
    options: argparse.Namespace, output: Path, mapping: RecordingMapping | None
) -> tuple[str, dict]:
    from dart_skill.session import FPS, write_lerobot

    camera = None
    if options.video:
        from dart_skill.view import SceneCamera

        camera = SceneCamera
    fps = FPS if options.fps is None else options.fps
    wanted = {
        "with_throws": options.with_throws,
        "without": options.without,
        "action": options.action or "commands",
    }
    tell_bag_faults(options.source, mapping)
    done = write_lerobot(options.source, output, mapping, fps=fps, camera=camera, **wanted)
    return _dataset_text(done, fps, output), {**asdict(done), "fps": fps, "path": str(output)}


def _dataset_text(done: ExportedDataset, fps: int, output: Path) -> str:
    lines = [f"{one}: left out: {why}" for one, why in done.left_out.items()]
    lines.append(
        f"{len(done.ids)} episodes of '{done.skill}', {done.n_frames} frames at {fps} per second"
    )
    if not done.has_commands and done.action == "commands":
        lines.append(
            "no commands were recorded: 'action' is where the joints are in the next frame"
        )
    lines.append(f"new dataset (LeRobotDataset v3.0): {output}")
    return "\n".join([*lines, f"next: dart-skill learn {shlex.quote(str(output))}"])


def _recording_text(recording: ThrowRecording) -> str:
    from dart_skill.recording.imports import fault_lines

    poses = ", ".join(
        f"{len(stream)} poses of the {role}" for role, stream in recording.bodies.items()
    )
    joints = (
        "no joint states"
        if recording.joints is None
        else f"{len(recording.joints.stamp_ns)} joint states"
    )
    opened = (
        f"the hand was told to open {len(recording.openings)} times"
        if recording.has_button
        else "it was not recorded when it opened"
    )
    return "\n".join([*fault_lines(recording.faults), f"{poses}, {joints}; {opened}"])


def _recording_json(recording: ThrowRecording, output: Path) -> dict:
    return {
        "source": recording.source,
        "path": str(output),
        "frame": recording.frame_id,
        "poses": {role: len(stream) for role, stream in recording.bodies.items()},
        "joint_states": None if recording.joints is None else len(recording.joints.stamp_ns),
        "openings": [asdict(opening) for opening in recording.openings],
        "faults": [asdict(fault) for fault in recording.faults],
    }
