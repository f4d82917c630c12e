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
from pathlib import Path, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.typesys.store import Typestore

from dart_skill.common.files import NoFile, require_file
from dart_skill.recording.bags._file_check import EMPTY, FileGlance, McapCheck, SqliteCheck
from dart_skill.recording.bags._files import (
    chosen_files,
    has_only_log,
    is_packed,
    missing_parts,
    part_number,
    storage_files,
    storage_of,
    unpack_file,
)
from dart_skill.recording.bags._finding import RECOVER, REWRITE, SEVERITIES, Finding
from dart_skill.recording.bags._message_check import NO_MESSAGES, FileFacts
from dart_skill.recording.bags._metadata import (
    METADATA_FILE,
    METADATA_VERSION,
    extent_of,
    full_name,
    lost_in,
    read_metadata_file,
    topics_of,
)
from dart_skill.recording.bags._time_line import TimeLine
from dart_skill.recording.bags.reader import BagError, BagReader
from dart_skill.recording.mcap import DamagedError

__all__ = ["Finding", "check_bag", "check_file", "glance"]


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
    return _sorted(_with_refusal(path, _found_in(path, partial(_check_of, types=types))))


def glance(path: str | os.PathLike, topics: tuple[str, ...]) -> list[Finding]:
    """What of a check takes no time: its files, what they and metadata.yaml say of themselves, and
    log times, by the indexes.

    Nothing is said of what is no bag, or cannot be opened: who reads it says why.

    Parameters
    ----------
    path
        Folder or file.
    topics
        Endings of the names of topics whose log times are looked at.
    """
    path, look = Path(path), partial(FileGlance, topics=topics)
    with suppress(DamagedError, OSError):
        if path.is_dir() and storage_files(path):
            return _sorted(_found_in(path, look))
        if path.is_file() and storage_of(path) is not None:
            findings, line = list[Finding](), TimeLine()
            _checked(path, look, line, findings)
            return _sorted(findings + line.findings(path.name))
    return []


def _check_of(file: Path, line: TimeLine, name: str, types: Typestore | None) -> FileFacts:
    return (SqliteCheck if storage_of(file) == "sqlite3" else McapCheck)(file, types, line, name)


def _found_in(path: Path, look: Callable[[Path, TimeLine, str], FileFacts]) -> list[Finding]:
    """What is wrong with a folder and its files. look: at a file, of which the name in findings is
    given.
    """
    findings: list[Finding] = []
    metadata, line = _metadata_of(path, findings), TimeLine()
    checked = []
    for file in _files_of(path, metadata or {}, findings):
        checked += _checked(file, look, line, findings)
    if metadata is not None and checked:
        findings += _metadata_findings(metadata, checked)
    else:
        findings += _gap_findings(path, checked)
    findings += _one_bag_findings(path, checked)
    findings += line.findings(path.name)
    # a part of a bag may well hold none
    findings = [finding for finding in findings if finding.message != NO_MESSAGES]
    if checked and not any(check.counts for check in checked):
        findings.append(Finding("warning", path.name, "the bag holds no messages"))
    return findings


def check_file(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a single file of a bag, the worst first; empty if nothing is.

    Parameters
    ----------
    types
        As for `check_bag`.
    """
    path, line = Path(path), TimeLine()
    findings: list[Finding] = []
    try:
        require_file(path)
        if path.stat().st_size and storage_of(path) is None:
            return _read_through(path)
        _checked(path, partial(_check_of, types=types), line, findings)
    except OSError as error:
        return [
            Finding(
                "error",
                str(path),
                str(error) if isinstance(error, NoFile) or error.filename else "no such file",
            )
        ]
    return _sorted(_with_refusal(path, findings + line.findings(path.name)))


def _read_through(path: Path) -> list[Finding]:
    """Whether all messages of a bag of ROS 1 are there and can be decoded; or why a file is no
    bag.
    """
    try:
        with BagReader(path) as bag:
            there = sum(1 for _ in bag.messages())
            told = bag.message_count
    except (BagError, OSError) as error:
        return [Finding("error", path.name, str(error).removeprefix(f"{path}: "))]
    findings = [
        Finding(
            "note",
            path.name,
            "a bag of ROS 1, which has no CRC: it was read as a whole, but changed bytes may go"
            " unnoticed",
        )
    ]
    if there != told:
        findings.append(
            Finding("warning", path.name, f"its index tells of {told} messages, in it are {there}")
        )
    return _sorted(findings)


def _checked(
    file: Path,
    look: Callable[[Path, TimeLine, str], FileFacts],
    line: TimeLine,
    findings: list[Finding],
) -> list[FileFacts]:
    """What a look at a file found, whose findings are added; nothing of a file that is none."""
    try:
        require_file(file)
    except OSError as error:
        findings.append(Finding("error", file.name, str(error)))
        return []
    if has_only_log(file):
        findings.append(
            Finding(
                "error",
                file.name,
                f"the file is empty (0 bytes): what was recorded is in {file.name}-wal",
                RECOVER,
            )
        )
        return []
    if file.stat().st_size == 0:
        findings.append(Finding("error", file.name, EMPTY, "delete it"))
        return []
    with TemporaryDirectory(prefix="dart_skill_") as folder:
        try:
            plain = unpack_file(file, Path(folder)) if is_packed(file) else file
        except DamagedError as error:
            findings.append(Finding("error", file.name, str(error)))
            return []
        check = look(plain, line, file.name)
    findings += check.findings
    return [check]


def _with_refusal(path: Path, findings: list[Finding]) -> list[Finding]:
    """The findings, and why the bag cannot be opened if none of them is an error that says it."""
    try:
        BagReader(path).close()
    except (BagError, OSError) as error:
        if not any(finding.severity == "error" for finding in findings):
            return [*findings, Finding("error", path.name, str(error).removeprefix(f"{path}: "))]
    return findings


def _metadata_of(path: Path, findings: list[Finding]) -> dict | None:
    faults: list[str] = []
    try:
        metadata = read_metadata_file(path, faults)
    except FileNotFoundError:
        remedy = "the files can be read without it" + (
            "; dart-skill bag recover makes one" if any(path.glob("*.mcap")) else ""
        )
        findings.append(
            Finding(
                "warning",
                path.name,
                f"there is no {METADATA_FILE}: the recorder did not close the bag",
                remedy,
            )
        )
        return None
    except (ValueError, OSError) as error:
        findings.append(
            Finding("warning", path.name, str(error), "the files are read without it; " + REWRITE)
        )
        return None
    findings += [
        Finding("warning", METADATA_FILE, fault, "the files are read without it; " + REWRITE)
        for fault in faults
    ]
    if metadata.get("version", 0) > METADATA_VERSION:
        findings.append(
            Finding(
                "note",
                METADATA_FILE,
                f"it has version {metadata['version']}, which is newer than {METADATA_VERSION}",
            )
        )
    return metadata


def _files_of(path: Path, metadata: dict, findings: list[Finding]) -> list[Path]:
    """Files that are there, in order; findings for those that are missing or too many."""
    chosen, missing = chosen_files(path, metadata)
    there = storage_files(path)
    remedy = "find it, or " + REWRITE if chosen else "find it"
    for file in missing:
        findings.append(
            Finding(
                "error", file.name, f"the file is missing, which {METADATA_FILE} names", remedy
            )
        )
    for file in there:
        if file not in chosen:
            message = (
                f"the file is in the folder, but {METADATA_FILE} does not name it: readers leave"
                " it out"
            )
            findings.append(Finding("warning", file.name, message, "move it away, or " + REWRITE))
    named = [PureWindowsPath(name).name for name in metadata.get("relative_file_paths") or []]
    if renamed := [file.name for file in chosen if file.name not in named] if named else []:
        message = (
            f"it names {', '.join(named)}, but in the folder there are {', '.join(renamed)}"
            " instead: they are read"
        )
        findings.append(
            Finding(
                "warning",
                METADATA_FILE,
                message,
                "other tools want the names that it names, or " + REWRITE,
            )
        )
    return chosen


def _metadata_findings(metadata: dict, checked: list[FileFacts]) -> list[Finding]:
    """Whether metadata.yaml agrees with the files. Where it tells more messages than there are,
    they may be lost.
    """
    counts: Counter = sum((check.counts for check in checked), Counter())
    may_be_lost = (metadata.get("message_count") or 0) > sum(counts.values()) and not all(
        check.is_vouched_for for check in checked
    )
    findings = []
    for name, (said, is_so) in _metadata_pairs(metadata, checked, counts).items():
        if said is not None and said != is_so:
            is_lost = (
                may_be_lost
                and isinstance(said, int)
                and name.startswith("messages")
                and said > is_so
            )
            text = f"it says {said} for {name}, the files say {is_so}"
            findings.append(
                Finding(
                    "error" if is_lost else "warning",
                    METADATA_FILE,
                    text,
                    "" if is_lost else REWRITE,
                )
            )
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
            Finding("warning", METADATA_FILE, f"the recorder could not write all: {stopped}")
        )
    return findings


def _metadata_pairs(
    metadata: dict, checked: list[FileFacts], counts: Counter
) -> dict[str, tuple[Any, Any]]:
    """What metadata.yaml says (None: nothing) and what is so, by name."""
    topics, whole = topics_of(metadata), extent_of(metadata)
    types = {name: names for check in checked for name, names in check.topic_types.items()}
    pairs: dict[str, tuple[Any, Any]] = {
        "messages in all": (metadata.get("message_count"), sum(counts.values()))
    }
    starts = [check.start_ns for check in checked if check.start_ns is not None]
    ends = [check.end_ns for check in checked if check.end_ns is not None]
    if starts and whole is not None:
        pairs["the time of the first message"] = (whole[1], min(starts))
        pairs["the duration"] = (whole[2] - whole[1], max(ends) - min(starts))
    for name, told in topics.items():
        pairs[f"messages on {name}"] = (told.get("message_count"), counts.get(name, 0))
        if (
            types.get(name)
            and "type" in told
            and full_name(told["type"]) not in map(full_name, types[name])
        ):
            pairs[f"the type of {name}"] = (told["type"], types[name][0])
    if topics:
        pairs["topics it does not name"] = ([], sorted(counts.keys() - topics.keys()))
    by_name = {check.name: check for check in checked}
    for item in metadata.get("files") or []:
        check, told_extent = by_name.get(PureWindowsPath(item["path"]).name), extent_of(item)
        if check is not None and told_extent is not None:
            count, first, last = told_extent
            pairs[f"messages in {check.name}"] = (count, sum(check.counts.values()))
            if check.start_ns is not None and check.end_ns is not None:
                extent = (check.start_ns, check.end_ns - check.start_ns)
                pairs[f"start and duration of {check.name}"] = ((first, last - first), extent)
    return pairs


def _gap_findings(path: Path, checked: list[FileFacts]) -> list[Finding]:
    """Parts of a split bag without metadata.yaml that are missing by their numbers."""
    files = [Path(check.name) for check in checked]
    missing = (
        missing_parts(files)
        if len(files) > 1 and len({part_number(file)[0] for file in files}) == 1
        else []
    )
    text = (
        f"by the numbers of its files {', '.join(missing)} is missing: what is there is read"
        " without it"
    )
    return (
        [Finding("warning", path.name, text, "find it and put it into the folder")]
        if missing
        else []
    )


def _one_bag_findings(path: Path, checked: list[FileFacts]) -> list[Finding]:
    """Signs that the files of a folder are of different bags."""
    findings: list[Finding] = []
    types: dict[str, list[str]] = {}
    stems = sorted({part_number(Path(check.name))[0] for check in checked})
    if len(stems) > 1:
        message = (
            f"its files have different names ({', '.join(stems)}): they may be of different bags"
        )
        findings.append(
            Finding("warning", path.name, message, "give each bag a folder of its own")
        )
    for check in checked:
        for topic, names in check.topic_types.items():
            if types.setdefault(topic, names) != names:
                told = (
                    f"type {', '.join(names)} here and {', '.join(types[topic])} in a file before"
                )
                message = f"topic {topic} has {told}: they may be of different bags"
                findings.append(
                    Finding("warning", check.name, message, "give each bag a folder of its own")
                )
    filled = [check for check in checked if check.counts]
    for before, after in zip(filled, filled[1:], strict=False):
        if (
            after.start_ns is not None
            and before.end_ns is not None
            and after.start_ns < before.end_ns
        ):
            message = (
                f"it begins before {before.name} ends: the files are of different bags, or log"
                " time jumped back"
            )
            findings.append(Finding("warning", after.name, message))
    return findings


def _sorted(findings: list[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
