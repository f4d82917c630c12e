"""Whether a bag is what it says: bytes, CRCs, indexes, statistics, metadata and messages.

A check reads every byte and decodes every message by the definition in the bag. It changes
nothing. An error is what is lost or cannot be read; a fault that costs nothing, because messages
are read without what it concerns, is a warning.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import pairwise
from pathlib import Path, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.typesys.store import Typestore

from dart_skill.common.files import NoFile, require_file
from dart_skill.recording.bags._file_check import (
    NO_MESSAGES,
    FileFacts,
    McapCheck,
    MessageCheck,
    check_sqlite,
    glance_at,
)
from dart_skill.recording.bags._findings import RECOVER, REWRITE, SEVERITIES, Finding, TimeLine
from dart_skill.recording.bags.files import (
    chosen_files,
    has_only_log,
    is_packed,
    missing_parts,
    part_number,
    storage_files,
    storage_of,
    unpack_file,
)
from dart_skill.recording.bags.metadata import (
    METADATA_FILE,
    METADATA_VERSION,
    extent_of,
    full_name,
    lost_in,
    read_metadata_file,
    topics_of,
)
from dart_skill.recording.bags.reader import BagError, BagReader
from dart_skill.recording.mcap import DamagedError

__all__ = ["Finding", "check_bag", "check_file", "glance"]
EMPTY = "the file is empty (0 bytes): its recorder stopped before the first write"
APART = "give each bag a folder of its own"
"""Remedy for a folder whose files may be of different bags."""


def check_bag(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a bag, the worst first; empty if nothing is.

    Parameters
    ----------
    path
        Folder or file.
    types
        Definitions for topics whose bag holds none (`typestore`).
    """
    path = Path(path)
    if not path.exists():
        return [Finding("error", str(path), "no such bag")]
    if not path.is_dir():
        return check_file(path, types)
    return _with_refusal(path, _found_in(path, partial(_check_of, types=types)))


def glance(path: str | os.PathLike, topics: tuple[str, ...]) -> list[Finding]:
    """What of a check takes no time: its files, what they and metadata.yaml say of themselves, and
    log times, by the indexes.

    Nothing is said of what is no bag, or cannot be opened: its reader says why.

    Parameters
    ----------
    path
        Folder or file.
    topics
        Endings of the names of topics whose log times are looked at.
    """
    path, look = Path(path), partial(glance_at, topics=topics)
    with suppress(DamagedError, OSError):
        if path.is_dir() and storage_files(path):
            return _sorted(_found_in(path, look))
        if path.is_file() and storage_of(path) is not None:
            return _sorted(_found_in_files([path], look, path.name)[1])
    return []


def check_file(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a single file of a bag, the worst first; empty if nothing is.

    Parameters
    ----------
    types
        As for `check_bag`.
    """
    path = Path(path)
    try:
        require_file(path)
        if path.stat().st_size and storage_of(path) is None:
            return _read_through(path)
        _, findings = _found_in_files([path], partial(_check_of, types=types), path.name)
    except OSError as error:
        is_told = isinstance(error, NoFile) or error.filename
        return [Finding("error", str(path), str(error) if is_told else "no such file")]
    return _with_refusal(path, findings)


def _check_of(file: Path, line: TimeLine, name: str, types: Typestore | None) -> FileFacts:
    if storage_of(file) != "sqlite3":
        return McapCheck(file, types, line, name)
    check = MessageCheck(types, line, name)
    check_sqlite(file, check)
    return check


_Look = Callable[[Path, TimeLine, str], FileFacts]
"""What looks at a file, of which the name in findings is given."""


def _found_in(path: Path, look: _Look) -> list[Finding]:
    """What is wrong with a folder and its files."""
    metadata, findings = _metadata_of(path)
    files, of_files = _files_of(path, metadata or {})
    checked, of_content = _found_in_files(files, look, path.name)
    findings += of_files
    # a part of a bag may well hold none
    findings += [finding for finding in of_content if finding.message != NO_MESSAGES]
    if metadata is not None and checked:
        findings += _metadata_findings(metadata, checked)
    elif len(files) > 1 and len({part_number(file)[0] for file in files}) == 1:
        if missing := missing_parts(files):
            findings.append(
                Finding(
                    "warning",
                    path.name,
                    (
                        f"by the numbers of its files {', '.join(missing)} is missing: what is there is"
                        " read without it"
                    ),
                    "find it and put it into the folder",
                )
            )
    findings += _one_bag_findings(path, checked)
    if checked and not any(check.counts for check in checked):
        findings.append(Finding("warning", path.name, "the bag holds no messages"))
    return findings


def _read_through(path: Path) -> list[Finding]:
    """Whether all messages of a bag of ROS 1 are there and can be decoded; or why a file is no
    bag.
    """
    try:
        with BagReader(path) as bag:
            there, told = sum(1 for _ in bag.messages()), bag.message_count
    except (BagError, OSError) as error:
        return [Finding("error", path.name, str(error).removeprefix(f"{path}: "))]
    note = Finding(
        "note",
        path.name,
        (
            "a bag of ROS 1, which has no CRC: it was read as a whole, but changed bytes may go"
            " unnoticed"
        ),
    )
    return (
        [note]
        if there == told
        else [
            Finding(
                "warning", path.name, (f"its index tells of {told} messages, in it are {there}")
            ),
            note,
        ]
    )


def _found_in_files(
    files: list[Path], look: _Look, place: str
) -> tuple[list[FileFacts], list[Finding]]:
    """What a look at each file of a bag found; nothing of a file that is none. place: of findings
    of the bag.
    """
    line, checked = TimeLine(), []
    findings: list[Finding] = []
    for file in files:
        try:
            require_file(file)
            if has_only_log(file):
                findings.append(
                    Finding(
                        "error",
                        file.name,
                        f"the file is empty (0 bytes): what was recorded is in {file.name}-wal",
                        RECOVER,
                    )
                )
            elif file.stat().st_size == 0:
                findings.append(Finding("error", file.name, EMPTY, "delete it"))
            else:
                with TemporaryDirectory(prefix="dart_skill_") as folder:
                    plain = unpack_file(file, Path(folder)) if is_packed(file) else file
                    checked.append(look(plain, line, file.name))
                findings += checked[-1].findings
        except (NoFile, FileNotFoundError) as error:
            findings.append(Finding("error", file.name, str(error)))
        except DamagedError as error:
            if not is_packed(file):
                raise
            findings.append(Finding("error", file.name, str(error)))
    return checked, findings + line.findings(place)


def _with_refusal(path: Path, findings: list[Finding]) -> list[Finding]:
    """The findings, and why the bag cannot be opened if none of them is an error that says it."""
    try:
        BagReader(path).close()
    except (BagError, OSError) as error:
        if not any(finding.severity == "error" for finding in findings):
            findings = [
                *findings,
                Finding("error", path.name, str(error).removeprefix(f"{path}: ")),
            ]
    return _sorted(findings)


def _metadata_of(path: Path) -> tuple[dict | None, list[Finding]]:
    """What metadata.yaml tells, None where there is none, and what is wrong with it."""
    faults: list[str] = []
    without = "the files are read without it; " + REWRITE
    try:
        metadata = read_metadata_file(path, faults)
    except FileNotFoundError:
        return None, [
            Finding(
                "warning",
                path.name,
                f"there is no {METADATA_FILE}: the recorder did not close the bag",
                (
                    "the files can be read without it"
                    + ("; dart-skill bag recover makes one" if any(path.glob("*.mcap")) else "")
                ),
            )
        ]
    except (ValueError, OSError) as error:
        return None, [Finding("warning", path.name, str(error), without)]
    findings = [Finding("warning", METADATA_FILE, fault, without) for fault in faults]
    if (version := metadata.get("version", 0)) > METADATA_VERSION:
        findings.append(
            Finding(
                "note",
                METADATA_FILE,
                f"it has version {version}, which is newer than {METADATA_VERSION}",
            )
        )
    return metadata, findings


def _files_of(path: Path, metadata: dict) -> tuple[list[Path], list[Finding]]:
    """Files that are there, in order; findings for those that are missing or too many."""
    chosen, missing = chosen_files(path, metadata)
    remedy = "find it, or " + REWRITE if chosen else "find it"
    text = f"the file is missing, which {METADATA_FILE} names"
    findings = [Finding("error", file.name, text, remedy) for file in missing]
    text = f"the file is in the folder, but {METADATA_FILE} does not name it: readers leave it out"
    findings += [
        Finding("warning", file.name, text, "move it away, or " + REWRITE)
        for file in storage_files(path)
        if file not in chosen
    ]
    named = [PureWindowsPath(name).name for name in metadata.get("relative_file_paths") or []]
    renamed = [file.name for file in chosen if file.name not in named]
    if named and renamed:
        findings.append(
            Finding(
                "warning",
                METADATA_FILE,
                (
                    f"it names {', '.join(named)}, but in the folder there are {', '.join(renamed)}"
                    " instead: they are read"
                ),
                ("other tools want the names that it names, or " + REWRITE),
            )
        )
    return chosen, findings


def _metadata_findings(metadata: dict, checked: list[FileFacts]) -> list[Finding]:
    """Whether metadata.yaml agrees with the files. Where it tells more messages than there are,
    they may be lost.
    """
    counts: Counter = sum((check.counts for check in checked), Counter())
    may_be_lost = (metadata.get("message_count") or 0) > counts.total() and not all(
        check.is_vouched_for for check in checked
    )
    findings = []
    for name, (said, is_so) in _metadata_pairs(metadata, checked, counts).items():
        if said is None or said == is_so:
            continue
        text = f"it says {said} for {name}, the files say {is_so}"
        if may_be_lost and name.startswith("messages") and isinstance(said, int) and said > is_so:
            findings.append(Finding("error", METADATA_FILE, text))
        else:
            findings.append(Finding("warning", METADATA_FILE, text, REWRITE))
    told = metadata.get("custom_data") or {}
    if lost := [f"{count} on {topic}" for topic, count in (lost_in(told) or {}).items()]:
        findings.append(
            Finding(
                "warning",
                METADATA_FILE,
                f"the recorder never received messages that were sent: {', '.join(lost)}",
            )
        )
    if stopped := told.get("writing_stopped"):
        findings.append(
            Finding("warning", METADATA_FILE, (f"the recorder could not write all: {stopped}"))
        )
    return findings


def _metadata_pairs(
    metadata: dict, checked: list[FileFacts], counts: Counter
) -> dict[str, tuple[Any, Any]]:
    """What metadata.yaml says (None: nothing) and what is so, by name."""
    topics, whole = topics_of(metadata), extent_of(metadata)
    types = {name: names for check in checked for name, names in check.topic_types().items()}
    pairs: dict[str, tuple[Any, Any]] = {
        "messages in all": (metadata.get("message_count"), counts.total())
    }
    starts = [check.start_ns for check in checked if check.start_ns is not None]
    ends = [check.end_ns for check in checked if check.end_ns is not None]
    if starts and whole is not None:
        pairs["the time of the first message"] = (whole[1], min(starts))
        pairs["the duration"] = (whole[2] - whole[1], max(ends) - min(starts))
    for name, told in topics.items():
        pairs[f"messages on {name}"] = (told.get("message_count"), counts.get(name, 0))
        found = types.get(name)
        if found and "type" in told and full_name(told["type"]) not in map(full_name, found):
            pairs[f"the type of {name}"] = (told["type"], found[0])
    if topics:
        pairs["topics it does not name"] = ([], sorted(counts.keys() - topics.keys()))
    by_name = {check.name: check for check in checked}
    for item in metadata.get("files") or []:
        check, told_extent = by_name.get(PureWindowsPath(item["path"]).name), extent_of(item)
        if check is None or told_extent is None:
            continue
        count, first, last = told_extent
        pairs[f"messages in {check.name}"] = (count, check.counts.total())
        if check.start_ns is not None and check.end_ns is not None:
            extent = (check.start_ns, check.end_ns - check.start_ns)
            pairs[f"start and duration of {check.name}"] = ((first, last - first), extent)
    return pairs


def _one_bag_findings(path: Path, checked: list[FileFacts]) -> list[Finding]:
    """Signs that the files of a folder are of different bags."""
    findings: list[Finding] = []
    stems = sorted({part_number(Path(check.name))[0] for check in checked})
    if len(stems) > 1:
        findings.append(
            Finding(
                "warning",
                path.name,
                (
                    f"its files have different names ({', '.join(stems)}): they may be of different bags"
                ),
                APART,
            )
        )
    types: dict[str, list[str]] = {}
    for check in checked:
        for topic, names in check.topic_types().items():
            if (before := types.setdefault(topic, names)) != names:
                findings.append(
                    Finding(
                        "warning",
                        check.name,
                        (
                            f"topic {topic} has type {', '.join(names)} here and {', '.join(before)} in a"
                            " file before: they may be of different bags"
                        ),
                        APART,
                    )
                )
    for one, other in pairwise([check for check in checked if check.counts]):
        if (other.start_ns or 0) < (one.end_ns or 0):
            findings.append(
                Finding(
                    "warning",
                    other.name,
                    (
                        f"it begins before {one.name} ends: the files are of different bags, or log time"
                        " jumped back"
                    ),
                )
            )
    return findings


def _sorted(findings: list[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
