"""A learned skill on disk: the demonstrations that it was made from and its settings, in one NumPy
archive without pickle.

A model is a cache of its demonstrations: loading learns it again, to the last bit. What practice
has found out about misses goes with it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dart_skill.common.archive import in_order, numbered, read_arrays, write_arrays
from dart_skill.common.configuration import arm_name
from dart_skill.common.files import new_file, open_file
from dart_skill.common.situation import Pose, Situation
from dart_skill.recording import SKILL, Demonstration, Event, Track
from dart_skill.skills.protocol import Skill, SkillSettings, skill_type

KIND = "dart_skill model"
"""What a model file says it is."""
VERSION = 4
"""Changes when older files cannot be read as they are any more."""
WAM = "wam"
"""The arm of a model that does not say on which one it was learned."""
NO_TRIALS = np.empty((0, 6))
PARTS = ("time", "position", "quaternion")
JOINTS = ("joint_time", "joint_position", "joint_velocity")
PLAIN = ("id", "skill", "stamp_ns", "frame_id", "joint_names", "motion_start", "motion_stop")


class SavedModel(NamedTuple):
    """What is in a model file.

    Parameters
    ----------
    demonstrations
        List of Demonstration.
    configuration
        Settings with which its skill learned.
    practised
        (n, d), what trials told: of throws `Correction.throws`, else the misses.
    found
        Dict, what practice has found besides, `PractisingSkill.state`; None before practice.
    origin
        Dict, how the recording was read that it was learned from, where that was not plain; else
        None.
    skill
        Its name.
    """

    demonstrations: list[Demonstration]
    configuration: SkillSettings
    practised: np.ndarray
    found: dict | None
    origin: dict | None = None
    skill: str = SKILL


def save_model(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    configuration: Any,
    practised: np.ndarray = NO_TRIALS,
    found: dict | None = None,
    origin: dict | None = None,
) -> None:
    """Write a model to `path`, which must not exist; the folder must. It is there whole, or not at
    all.

    Parameters
    ----------
    demonstrations
        Of one skill; the others: as of `SavedModel`, by default without practice.

    Raises
    ------
    FileNotFoundError
        If there is no such folder, ValueError if the demonstrations are more than a model may
        have.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {path.parent} to save a model in")
    skill = next((one.skill for one in demonstrations), SKILL)
    content: dict[str, Any] = {
        "format": np.array(f"{KIND} {VERSION}"),
        "skill": np.array(skill),
        "arm": np.array(Path(arm_name()).stem),
        "configuration": np.array(json.dumps(asdict(configuration))),
        "practised": np.asarray(practised, dtype=float),
    }
    for name, value in (("found", found), ("origin", origin)):
        if value is not None:
            content[name] = np.array(json.dumps(value, allow_nan=False))
    content |= numbered(map(_arrays, demonstrations))
    with new_file(path) as file:
        write_arrays(file, content)


def load_model(path: str | Path, skill: Skill | None = None) -> SavedModel:
    """What is in a model file.

    Parameters
    ----------
    skill
        Of which it must be; default None: of any that is installed.

    Raises
    ------
    ValueError
        If it is none, of another skill, of another version, or was learned on another arm.
    """
    with open_file(path) as file:
        try:
            content = read_arrays(file)
            _check_format(str(content.pop("format")))
            name, settings = (str(content.pop(one)) for one in ("skill", "configuration"))
            arm = str(content.pop("arm", WAM))
            practised = _practised(content.pop("practised"))
            found, origin = _found(content.pop("found", None)), _found(content.pop("origin", None))
            demonstrations = [_demonstration(arrays) for arrays in in_order(content)]
            values = json.loads(settings)
        # zip, zlib, JSON and NumPy each have their own for bytes that they do not expect
        except Exception as error:
            raise ValueError(
                f"{path} is not a model file of dart_skill: {error or type(error).__name__}"
            ) from error
    if arm != (ours := Path(arm_name()).stem):
        raise ValueError(
            f"{path} was learned on the arm '{arm}', and this is '{ours}': choose it with --arm"
            f" {arm}, or learn from demonstrations of '{ours}'"
        )
    if skill and name != skill.name:
        raise ValueError(f"{path} is a model of the skill '{name}', not of '{skill.name}'")
    kind = type(skill) if skill else skill_type(name)
    configuration = kind.settings_type.from_saved(values, str(path))
    return SavedModel(demonstrations, configuration, practised, found, origin, name)


def _check_format(found: str) -> None:
    kind, _, version = found.rpartition(" ")
    if kind != KIND:
        raise ValueError(f"its format is '{found[:100]}', not '{KIND} {VERSION}'")
    if version != str(VERSION):
        raise ValueError(
            f"it has version {version[:20]}, and this dart_skill reads version {VERSION}: learn"
            " from the bag again"
        )


def _practised(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values)
    if values.ndim != 2 or not np.issubdtype(values.dtype, np.floating):
        raise ValueError(
            f"its practised trials have the shape {values.shape}: rows of numbers are known"
        )
    return values


def _found(text: np.ndarray | None) -> dict | None:
    found = None if text is None else json.loads(str(text))
    if not isinstance(found, (dict, type(None))):
        raise ValueError(
            "what practice found, or where it is from, is no object of JSON but"
            f" {type(found).__name__}"
        )
    return found


def _arrays(one: Demonstration) -> dict[str, Any]:
    """A demonstration as arrays by name: its numbers and texts as JSON, which keeps all bits."""
    about = {name: getattr(one, name) for name in PLAIN} | {
        "events": [(event.name, event.time) for event in one.events],
        "poses": {
            role: [pose.position.tolist(), pose.quaternion.tolist()]
            for role, pose in one.situation.poses.items()
        },
        "numbers": dict(one.situation.numbers),
    }
    tracks = {
        f"track.{role}.{part}": getattr(track, part)
        for role, track in one.tracks.items()
        for part in PARTS
    }
    joints = {name: getattr(one, name) for name in JOINTS}
    return {"about": np.array(json.dumps(about)), **joints, **tracks}


def _demonstration(arrays: dict[str, np.ndarray]) -> Demonstration:
    about = json.loads(str(arrays["about"]))
    roles = [name[6:-5] for name in arrays if name.startswith("track.") and name.endswith(".time")]
    return Demonstration(
        tracks={
            role: Track(*(arrays[f"track.{role}.{part}"] for part in PARTS)) for role in roles
        },
        situation=Situation(
            {role: Pose(*map(np.array, pose)) for role, pose in about["poses"].items()},
            about["numbers"],
        ),
        events=tuple(Event(str(name), float(time)) for name, time in about["events"]),
        joint_time=arrays["joint_time"],
        joint_position=arrays["joint_position"],
        joint_velocity=arrays["joint_velocity"],
        **{name: about[name] for name in PLAIN},
    )
