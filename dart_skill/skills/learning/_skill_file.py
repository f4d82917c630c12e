"""A learned skill on disk: its demonstrations and settings in one NumPy archive without pickle.

A model is a cache of its demonstrations: loading learns it again, to the last bit. What practice
has found out about misses goes with it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dart_skill.arm import Grip
from dart_skill.common.archive import in_order, numbered, read_arrays, write_arrays
from dart_skill.common.files import new_file, open_file
from dart_skill.skills.learning._learning import AnySkill, learn
from dart_skill.skills.protocol import Skill, TaskDemonstration, Told, Track

K = TypeVar("K", bound=Skill)
FORMAT = "dart_skill skill 1"
PARTS = ("time", "position", "quaternion")
CHANGED = ("components", "stiffness", "orientation_stiffness", "start_speed", "stop_speed")
"""Settings that parameters of the learner change."""


def changed_skill(skill: K, parameters: dict[str, Any]) -> tuple[K, str]:
    """A skill with parameters of the node skill_learner, and what they change, in words; 0 and an
    empty text change nothing.

    ValueError names one that makes no sense, and a task frame that the skill does not have.
    """
    changes = {name: parameters[name] for name in CHANGED if parameters[name]}
    bounds = parameters["least_stiffness"], parameters["most_stiffness"]
    changes |= {"stiffness_range": bounds} if all(bounds) else {}  # one is set before the other
    changes |= (
        {"frames": tuple(name.strip() for name in parameters["frames"].split(","))}
        if parameters["frames"]
        else {}
    )
    if not changes:
        return skill, ""
    changed = type(skill)(replace(skill.settings, **changes))
    changed.check_settings()
    return changed, ", ".join(
        f"{name} {', '.join(value) if name == 'frames' else value}"
        for name, value in changes.items()
    )


def save_skill_model(path: str | Path, learned: AnySkill) -> None:
    """Write a model to `path`, which must not exist; the folder must. It is there whole, or not at
    all.

    learned: the skill. FileNotFoundError if there is no such folder, ValueError if its
    demonstrations are more than a model may have.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"there is no folder {path.parent} to save a model in")
    about = {"skill": learned.skill.name, "settings": asdict(learned.skill.settings)}
    content: dict[str, Any] = {
        "format": np.array(FORMAT),
        "about": np.array(json.dumps(about)),
        "misses": learned.misses,
    }
    content |= numbered(map(_arrays_of, learned.demonstrations))
    with new_file(path) as file:
        write_arrays(file, content)


def load_skill_model(path: str | Path, skill: Skill) -> AnySkill:
    """The model of a file, of the same skill; its settings are those that it was learned with.
    ValueError if it is none.
    """
    with open_file(path) as file:
        try:
            content = read_arrays(file)
            if str(content.pop("format")) != FORMAT:
                raise ValueError(f"its format is not '{FORMAT}'")
            about, misses = json.loads(str(content.pop("about"))), content.pop("misses")
            demonstrations = [_demonstration(own) for own in in_order(content)]
        except Exception as error:  # zip, zlib, JSON and NumPy each have their own for bytes that they do not expect
            raise ValueError(
                f"{path} is not a model file of a skill: {error or type(error).__name__}"
            ) from error
    if about["skill"] != skill.name:
        raise ValueError(
            f"{path} is a model of the skill '{about['skill']}', not of '{skill.name}'"
        )
    settings = skill.settings_type.from_mapping(about["settings"], str(path))
    learned = learn(type(skill)(settings), demonstrations)
    learned.remember(misses)
    return learned


def _arrays_of(one: TaskDemonstration) -> dict[str, Any]:
    tracks = {
        f"track.{role}.{part}": getattr(track, part)
        for role, track in one.tracks.items()
        for part in PARTS
    }
    joints = {
        name: getattr(one, name) for name in ("joint_time", "joint_position", "joint_velocity")
    }
    told = np.array([(item.time, int(item.grip)) for item in one.told], dtype=float).reshape(-1, 2)
    return {
        "id": np.array(one.id),
        "stamp_ns": np.array(one.stamp_ns),
        "told": told,
        **joints,
        **tracks,
    }


def _demonstration(own: dict[str, np.ndarray]) -> TaskDemonstration:
    roles = dict.fromkeys(name.split(".")[1] for name in own if name.startswith("track."))
    return TaskDemonstration(
        id=str(own["id"]),
        tracks={role: Track(*(own[f"track.{role}.{part}"] for part in PARTS)) for role in roles},
        joint_time=own["joint_time"],
        joint_position=own["joint_position"],
        joint_velocity=own["joint_velocity"],
        told=tuple(Told(float(time), Grip(int(grip))) for time, grip in own["told"]),
        stamp_ns=int(own["stamp_ns"]),
    )
