"""Whether a bag is what it says: bytes, CRCs, indexes, statistics, metadata and messages.

A check reads every byte and decodes every message by the definition in the bag. It changes nothing.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path, PurePath
from typing import Any

from rosbags.typesys.store import Typestore

from dart_skill.files import NoFile, require_file
from dart_skill.recording.bags._file_check import NO_MESSAGES, REWRITE, SEVERITIES, FileCheck, Finding
from dart_skill.recording.bags._files import files_in, named_files, part_number
from dart_skill.recording.bags._metadata import METADATA_FILE, is_plain_mcap, read_metadata_file
from dart_skill.recording.bags.reader import BagError, BagReader


def check_bag(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a bag, the worst first; empty if nothing is.

    path: folder or file.
    types: definitions for topics whose bag holds none (`typestore`).
    """
    path = Path(path)
    if not path.exists():
        return [Finding("error", str(path), "no such bag")]
    if not path.is_dir():
        return check_file(path, types)
    findings: list[Finding] = []
    metadata = _metadata_of(path, findings)
    if metadata is not None and not is_plain_mcap(metadata):
        return _checked_by_reading(path, types)
    checked = []
    for file in _files_of(path, metadata, findings):
        if file.suffix != ".mcap":
            findings += check_file(file, types)
            continue
        checked.append(FileCheck(file, types))
        findings += checked[-1].findings
    if metadata is not None:
        findings += _metadata_findings(metadata, checked)
    findings += _one_bag_findings(path, checked)
    findings = [finding for finding in findings if finding.message != NO_MESSAGES]  # a part of a bag may well hold none
    if checked and not any(check.counts for check in checked):
        findings.append(Finding("warning", path.name, "the bag holds no messages"))
    return _sorted(findings)


def check_file(path: str | os.PathLike, types: Typestore | None = None) -> list[Finding]:
    """What is wrong with a single file of a bag, the worst first; empty if nothing is. types: as for `check_bag`."""
    path = Path(path)
    try:
        require_file(path)
    except OSError as error:
        return [Finding("error", str(path), str(error) if isinstance(error, NoFile) else "no such file")]
    if path.suffix != ".mcap":
        return _checked_by_reading(path, types)
    return _sorted(FileCheck(path, types).findings)


def _metadata_of(path: Path, findings: list[Finding]) -> dict | None:
    try:
        return read_metadata_file(path)
    except FileNotFoundError:
        remedy = "the files can be read without it" + ("; dart-skill bag recover makes one" if any(path.glob("*.mcap")) else "")
        findings.append(Finding("warning", path.name, f"there is no {METADATA_FILE}: the recorder did not close the bag", remedy))
    except (ValueError, OSError) as error:
        findings.append(Finding("error", path.name, str(error), REWRITE))
    return None


def _files_of(path: Path, metadata: dict | None, findings: list[Finding]) -> list[Path]:
    """Files that are there, in order; findings for those that are missing or too many."""
    there = files_in(path)
    if metadata is None:
        if not there:
            findings.append(Finding("error", path.name, "no .mcap file in this folder"))
        return there
    named = named_files(path, metadata)
    for file in named:
        if not file.is_file():
            findings.append(Finding("error", file.name, f"the file is missing, which {METADATA_FILE} names", "find it, or " + REWRITE))
    for file in there:
        if file not in named:
            message = f"the file is in the folder, but {METADATA_FILE} does not name it: readers leave it out"
            findings.append(Finding("warning", file.name, message, "move it away, or " + REWRITE))
    return [file for file in named if file.is_file()]


def _metadata_findings(metadata: dict, checked: list[FileCheck]) -> list[Finding]:
    """Whether metadata.yaml agrees with the files."""
    try:
        pairs = _metadata_pairs(metadata, checked)
        stopped = (metadata.get("custom_data") or {}).get("writing_stopped")
    except (KeyError, TypeError, AttributeError) as error:
        return [Finding("error", METADATA_FILE, f"it lacks or misuses {error}", REWRITE)]
    findings = [
        Finding("error", METADATA_FILE, f"it says {said} for {name}, the files say {is_so}", REWRITE)
        for name, (said, is_so) in pairs.items()
        if said != is_so
    ]
    if stopped:
        findings.append(Finding("warning", METADATA_FILE, f"the recorder could not write all: {stopped}"))
    return findings


def _metadata_pairs(metadata: dict, checked: list[FileCheck]) -> dict[str, tuple]:
    """What metadata.yaml says and what is so, by name."""
    counts: Counter = sum((check.counts for check in checked), Counter())
    types = {name: type_name for check in checked for name, type_name in check.topic_types.items()}
    pairs: dict[str, tuple[Any, Any]] = {"all messages": (metadata["message_count"], sum(counts.values()))}
    filled = [check for check in checked if check.counts]
    if filled:
        start = min(check.start_ns for check in filled if check.start_ns is not None)
        end = max(check.end_ns for check in filled if check.end_ns is not None)
        pairs["the time of the first message"] = (metadata["starting_time"]["nanoseconds_since_epoch"], start)
        pairs["the duration"] = (metadata["duration"]["nanoseconds"], end - start)
    for item in metadata["topics_with_message_count"]:
        topic = item["topic_metadata"]
        name = topic["name"]
        pairs[f"messages on {name}"] = (item["message_count"], counts.pop(name, 0))
        if types.get(name):
            pairs[f"the type of {name}"] = (topic["type"], types[name])
    pairs["topics it does not name"] = ([], sorted(counts))
    by_name = {check.path.name: check for check in checked}
    for item in metadata.get("files") or []:
        check = by_name.get(PurePath(item["path"]).name)
        if check is not None:
            pairs[f"messages in {check.path.name}"] = (item["message_count"], sum(check.counts.values()))
            if check.start_ns is not None and check.end_ns is not None:
                times = (item["starting_time"]["nanoseconds_since_epoch"], item["duration"]["nanoseconds"])
                pairs[f"start and duration of {check.path.name}"] = (times, (check.start_ns, check.end_ns - check.start_ns))
    return pairs


def _one_bag_findings(path: Path, checked: list[FileCheck]) -> list[Finding]:
    """Signs that the files of a folder are of different bags."""
    findings: list[Finding] = []
    types: dict[str, str] = {}
    if len(stems := sorted({part_number(check.path)[0] for check in checked})) > 1:
        message = f"its files have different names ({', '.join(stems)}): they may be of different bags"
        findings.append(Finding("warning", path.name, message, "give each bag a folder of its own"))
    for check in checked:
        for topic, type_name in check.topic_types.items():
            if types.setdefault(topic, type_name) != type_name:
                message = f"topic {topic} has type {type_name} here and {types[topic]} in a file before: they are of different bags"
                findings.append(Finding("error", check.path.name, message, "give each bag a folder of its own"))
    filled = [check for check in checked if check.counts]
    for before, after in zip(filled, filled[1:], strict=False):
        if after.start_ns is not None and before.end_ns is not None and after.start_ns < before.end_ns:
            message = f"it begins before {before.path.name} ends: the files are of different bags, or log time jumped back"
            findings.append(Finding("warning", after.path.name, message))
    return findings


def _checked_by_reading(path: Path, types: Typestore | None) -> list[Finding]:
    """A bag or file that only its reader knows: whether all of it can be read and decoded, and is as much as it says."""
    try:
        with BagReader(path, types) as bag:
            found = Counter(message.topic for message in bag.messages())
            told = {topic.name: topic.count for topic in bag.topics.values()}
    except BagError as error:
        return [Finding("error", path.name, str(error))]
    findings = [
        Finding("error", f"{path.name}, topic {name}", f"it is said to have {count} messages, found are {found[name]}")
        for name, count in told.items()
        if count != found[name]
    ]
    findings += [] if found else [Finding("warning", path.name, "the bag holds no messages")]
    return [*findings, Finding("note", path.name, "its format has no CRC: it was read as a whole, but changed bytes may go unnoticed")]


def _sorted(findings: list[Finding]) -> list[Finding]:
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
